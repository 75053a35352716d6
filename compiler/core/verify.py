"""What a well-formed program is: a table of rules that runs before and after every pass.

Each rule yields a sentence for each place that breaks it; the first sentence is the error [`verify`]. Later
rules may rely on the earlier ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...refimpl.errors import CompileError
from .ir import DTYPES, Node, Program, Type
from .loops import bodies, groups_of, is_walk, loop_number, loops
from .ops import OPS, TypeRuleError

Rule = Callable[[Program], Iterator[str]]


def known_operations(program: Program) -> Iterator[str]:
    """Every operation is in the table."""
    for index, node in enumerate(program.nodes):
        if node.op not in OPS:
            yield f"%{index} is {node.op!r}, which is not an operation; supported: {', '.join(OPS)}"


def operands_before_use(program: Program) -> Iterator[str]:
    """Operands are indices of earlier nodes, as many as the operation takes."""
    for index, node in enumerate(program.nodes):
        arity = OPS[node.op].arity
        if len(node.args) != arity and not (arity is None and node.args):
            yield f"%{index} {node.op} has {len(node.args)} operands; it takes {arity or 'one or more'}"
        for arg in node.args:
            if not 0 <= arg < index:
                yield f"%{index} {node.op} reads %{arg}; only %0 to %{index - 1} are computed before it"


def attributes_in_order(program: Program) -> Iterator[str]:
    """Attributes are those of the operation, sorted, each once."""
    right = set()
    for index, node in enumerate(program.nodes):
        names = [name for name, _ in node.attributes]
        op = OPS[node.op]
        if (key := (node.op, *names)) in right:
            continue
        unknown = set(names) - set(op.required) - set(op.optional)
        if not set(op.required) <= set(names) or unknown or names != sorted(set(names)):
            wanted = ", ".join((*op.required, *(f"{name} (optional)" for name in op.optional))) or "none"
            yield f"%{index} {node.op} has attributes {names}; it takes, sorted: {wanted}"
        else:
            right.add(key)


def parameters_exist(program: Program) -> Iterator[str]:
    """Named parameters are there."""
    for index, node in enumerate(program.nodes):
        for name in OPS[node.op].parameters:
            if node.get(name) is not None and node[name] not in program.parameters:
                yield f"%{index} {node.op} names parameter {node[name]!r}, which the program does not have"


def parameters_are_numbers(program: Program) -> Iterator[str]:
    """Parameters are arrays of a kind that values have, finite, none of them empty."""
    for name, array in program.parameters.items():
        if str(array.dtype) not in DTYPES or not array.size or not np.isfinite(array).all():
            yield (
                f"parameter {name} ({array.dtype}, shape {array.shape}) must be finite, not empty, and of "
                f"{', '.join(DTYPES)}"
            )


def types_follow(program: Program) -> Iterator[str]:
    """Every node has the type that its operation's rule gives."""
    right = set()  # without attributes the operands decide
    for index, node in enumerate(program.nodes):
        types = [program.nodes[arg].type for arg in node.args]
        if not node.attributes and (key := (node.op, node.type, *types)) in right:
            continue
        try:
            found = OPS[node.op].type_rule(types, dict(node.attributes), program.parameters)
        except TypeRuleError as error:
            yield f"%{index} {node.op}: {error}"
        else:
            if node.type != found:
                yield f"%{index} {node.op} is marked {node.type}; its operands give {found}"
            elif not node.attributes:
                right.add(key)


def short_vectors(program: Program) -> Iterator[str]:
    """A value is a number or a vector of at least one."""
    for index, node in enumerate(program.nodes):
        if node.type.dtype not in DTYPES or len(node.type.shape) > 1 or 0 in node.type.shape:
            yield (
                f"%{index} {node.op} has type {node.type}; values are numbers or vectors of "
                f"{', '.join(DTYPES)}"
            )


def inputs_once(program: Program) -> Iterator[str]:
    """No two inputs have one name."""
    names = [node["name"] for node in program.nodes if node.op == "input"]
    for name in sorted({str(name) for name in names if names.count(name) > 1}):
        yield f"input {name!r} is declared more than once"


def outputs_exist(program: Program) -> Iterator[str]:
    """There is an output; each has its own name and is a value."""
    names = [name for name, _ in program.outputs]
    if not names or len(set(names)) < len(names):
        yield f"outputs are {names}; there must be one or more, with different names"
    for name, index in program.outputs:
        if not 0 <= index < len(program.nodes):
            yield f"output {name!r} is %{index}; the program computes %0 to %{len(program.nodes) - 1}"


def loops_are_whole(program: Program) -> Iterator[str]:
    """The results of a loop agree on its operands and trips; it carries its own numbers, each once."""
    ends: dict[int, Node] = {}
    for index, node in enumerate(program.nodes):
        if node.op != "loop":
            continue
        first = ends.setdefault(loop_number(node), node)
        own, shared = (dict(each.attributes) | {"index": 0} for each in (node, first))
        if (node.args, own) != (first.args, shared):
            yield f"%{index} and another result of loop {node['loop']} have other operands or trips"
        for place, arg in enumerate(groups_of(node)[0]):
            found = program.nodes[arg]
            if found.op != "carried" or (found["index"], found["loop"]) != (place, node["loop"]):
                yield f"%{index} loop: operand {place} must be carried number {place} of loop {node['loop']}"


def tables_are_as_long_as_loops(program: Program) -> Iterator[str]:
    """A loop makes at least one trip, and each of its tables has a row for every trip."""
    trips = {}
    for index, node in enumerate(program.nodes):
        if node.op == "loop":
            if not is_walk(node):
                trips[loop_number(node)] = node["trips"]
            if type(node["trips"]) is not int or node["trips"] < 1:
                yield f"%{index} loop makes {node['trips']!r} trips; it must make one or more"
    for index, node in enumerate(program.nodes):
        if node.op == "row":
            rows = len(program.parameters[str(node["table"])])
            made = trips.get(loop_number(node), rows)
            if rows != made:
                yield f"%{index} row: table {node['table']} has {rows} rows; the loop makes {made} trips"


def loops_are_closed(program: Program) -> Iterator[str]:
    """Only a loop's results are read outside its body, and loops do not nest."""
    inside = bodies(program)
    for index, node in enumerate(program.nodes):
        if len(inside[index]) > 1 or (inside[index] and node.op == "loop"):
            numbers = ", ".join(map(str, sorted(inside[index])))
            yield f"%{index} {node.op} depends on trips of loops {numbers}; loops do not nest"
    for name, index in program.outputs:
        if inside[index]:
            yield f"output {name!r}, %{index}, is a value of a trip; take the loop's result"


def walks_stay_on_their_trees(program: Program) -> Iterator[str]:
    """A walk's tables are a tree over all rows, and its test and its parts read their own tables only."""
    for index, loop in loops(program)[0].items():
        if loop.walk is None:
            continue
        first, skip = (program.parameters[name] for name in (loop.walk.first, loop.walk.skip))
        parts, nodes = len(loop.walk.parts), len(skip)
        if len(first) != parts * (nodes + 1):
            yield f"%{index} loop: table {loop.walk.first} has {len(first)} entries for {parts} x {nodes + 1}"
            continue
        if not ((np.arange(nodes) < skip) & (skip <= nodes)).all():
            yield f"%{index} loop: table {loop.walk.skip} must lead each node to a later one, or to {nodes}"
        ends = first.reshape(parts, nodes + 1)
        if ends[:, 0].any() or (np.diff(ends) < 0).any() or ends[:, -1].sum() != loop.trips:
            yield f"%{index} loop: table {loop.walk.first} must share out rows 0 to {loop.trips - 1} in order"
        read = [("branch", nodes, loop.walk.guard)]
        read += [("row", end, part.body) for end, part in zip(ends[:, -1], loop.walk.parts, strict=True)]
        for op, length, body in read:
            for at in body:
                reader = program.nodes[at]
                if reader.op not in ("row", "branch"):
                    continue
                found = len(program.parameters[str(reader["table"])])
                if (reader.op, found) != (op, length):
                    rows = f"table {reader['table']} has {found} rows"
                    yield f"%{at} {reader.op}: {rows}; a {op} of a table of {length} is read here"


def window_matches(program: Program) -> Iterator[str]:
    """A gathered program has one input, `window`, as long as its images and window size say."""
    if program.gather is None:
        return
    wanted = {"window": Type(shape=(program.gather.n_inputs,))}
    found = {str(node["name"]): node.type for node in program.nodes if node.op == "input"}
    if found != wanted:
        shown = [", ".join(f"{name}: {kind}" for name, kind in kinds.items()) for kinds in (found, wanted)]
        yield f"inputs are ({shown[0]}); the gathered window gives ({shown[1]})"


def images_have_ranges(program: Program) -> Iterator[str]:
    """What an image can hold is a range of float32 numbers."""
    for image in program.gather.images if program.gather else ():
        largest = float(np.finfo(np.float32).max)
        if not -largest <= image.low <= image.high <= largest:
            yield (
                f"image {image.name} holds numbers in {image.range_text}; the ends must be finite in "
                "float32, the first not above the second"
            )


RULES: tuple[Rule, ...] = (
    known_operations,
    operands_before_use,
    attributes_in_order,
    parameters_exist,
    parameters_are_numbers,
    types_follow,
    short_vectors,
    inputs_once,
    outputs_exist,
    loops_are_whole,
    tables_are_as_long_as_loops,
    loops_are_closed,
    walks_stay_on_their_trees,
    window_matches,
    images_have_ranges,
)
"""The grammar, in the order in which it is checked."""


def verify(program: Program, when: str = "program") -> Program:
    """Return `program` unchanged, or raise with the first rule that it breaks; `when` names the moment."""
    for rule in RULES:
        for sentence in rule(program):
            raise CompileError(f"{when}: {sentence} (rule {rule.__name__})")
    return program
