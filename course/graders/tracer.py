"""Grades lab 9: nodes of short functions, the same bits, what is refused, and functions of the reference."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from wamnet.refimpl import rng

from ..frame import Check, Wrong, equal, hold, kind_of_number, number_text, refuses, spread
from ..wire import Expression, Node, Program

COUNT = 50
"""Lanes in which numbers are compared."""

OPS = (
    *("add", "subtract", "multiply", "divide", "negative", "absolute", "sqrt", "floor", "sin", "cos"),
    *("minimum", "maximum", "less", "greater", "select", "bitwise_xor", "right_shift"),
)
"""The names of OPS in the skeleton."""


def listed(program: Any) -> str:
    """Return a program in one line."""
    try:
        shown = [
            f"{n.op}{tuple(n.args)}" + ("" if n.value is None else f" {n.value!r}") for n in program.nodes
        ]
        return f"{', '.join(shown)}; output {program.output}"
    except (AttributeError, TypeError):
        return repr(program)


def function_of(body: str, names: Sequence[str]) -> Expression:
    """Return the function with a body of these arguments."""
    return Expression(f"lambda {', '.join(names)}: {body}")


def traced(student: Any, body: str, names: Sequence[str]) -> Any:
    """Return the student's program of a function, which is checked to be one."""
    program = student.trace(function_of(body, names), tuple(names))
    nodes: Any = getattr(program, "nodes", None)
    good = isinstance(nodes, (tuple, list)) and all(hasattr(n, "op") and hasattr(n, "args") for n in nodes)
    kind, text = type(program).__name__, "Program(tuple(nodes), output)"
    hold("IR-1", "the result of trace", good, "a Program of Nodes", kind, text)
    index = program.output
    text = "the output is the index of a node, not a traced value"
    hold("IR-1", "the output", isinstance(index, (int, np.integer)), "an index", type(index).__name__, text)
    hold("IR-1", "the output", 0 <= index < len(nodes), f"below {len(nodes)}", int(index), text)
    for number, node in enumerate(nodes):
        whole = all(isinstance(arg, (int, np.integer)) for arg in node.args)
        told = "operands are indices of nodes: a traced value gives its own, a number that of its constant"
        hold("IR-2", f"the operands of node {number}", whole, "indices", repr(node.args), told)
        early, first = all(0 <= arg < number for arg in node.args), "append operands first"
        hold("IR-2", f"the operands of node {number}", early, "earlier nodes", repr(node.args), first)
        known, told = node.op in (*OPS, "input", "const"), "np.where is called `select`"
        hold("IR-3", f"the operation of node {number}", known, "one of OPS", repr(node.op), told)
    return program


def short(student: Any) -> None:
    """Programs of few nodes, which are known."""
    found = traced(student, "a + b", "ab")
    nodes = [(n.op, tuple(n.args), n.value) for n in found.nodes]
    wanted = [("input", (), "a"), ("input", (), "b"), ("add", (0, 1), None)]
    text = "inputs first, in their order; then each operation when NumPy asks for it"
    if nodes == [*wanted[:2], ("add", (1, 0), None)]:
        text = "the operands are exchanged"
    hold("IR-1", "the program of a + b", nodes == wanted, "input a, input b, add (0, 1)", listed(found), text)
    equal("IR-1", "the output of a + b", found.output, 2, "the index of the result")
    found = traced(student, "a", "ab")
    text = "the output is the index of what is returned, not the last node"
    what = "the program of a function that returns a"
    hold("IR-1", what, found.output == 0, "output 0", listed(found), text)
    found = traced(student, "3.0", "a")
    node = found.nodes[found.output]
    text = "a function may return a number: it is a constant then"
    good, what = node.op == "const" and node.value == 3.0, "the output of a function that returns 3.0"
    hold("IR-1", what, good, "const 3.0", listed(found), text)


def given() -> dict[str, Any]:
    """Return float32 inputs (COUNT,) a, b and c > 0."""
    values = {n: spread(121 + i, (COUNT,), -3.0, 3.0).astype(np.float32) for i, n in enumerate("abc")}
    return {**values, "c": np.abs(values["c"]) + np.float32(0.5)}


FUNCTIONS = {
    "a, after b * c": ("(b * c, a)[1]", "the output's value, not the last node's"),
    "a - b": ("a - b", "the order of the operands"),
    "2.5 - a": ("2.5 - a", "the first operand may be the number: take all operands in their order"),
    "a / c": ("a / c", "the order of the operands"),
    "1 / c": ("1 / c", "the first operand may be the number: take all operands in their order"),
    "-a * b": ("-a * b", "negative has one operand"),
    "abs(a)": ("abs(a)", "abs is np.absolute"),
    "np.sqrt(c)": ("np.sqrt(c)", ""),
    "np.minimum(a, 0.5)": ("np.minimum(a, 0.5)", "the operations by name: np.minimum is `minimum`"),
    "np.maximum(a, b)": ("np.maximum(a, b)", "np.maximum is `maximum`"),
    "np.sin(a) + np.cos(b)": ("np.sin(a) + np.cos(b)", "sin and cos are exchanged"),
    "np.floor(a)": ("np.floor(a)", ""),
    "np.where(a < b, a, c)": ("np.where(a < b, a, c)", "np.where(condition, where true, where false)"),
    "np.where(a > 0, 1.0, c)": ("np.where(a > 0, 1.0, c)", "numbers are constants in np.where too"),
    "np.add(a, a) * 0.1": ("np.add(a, a) * 0.1", "both operands may be the same node"),
    "a * 0.0 + c * 0.0": ("a * 0.0 + c * 0.0", ""),
}
"""Functions of a, b and c by name, and the likeliest mistake of a wrong number."""


def numbers(student: Any) -> None:
    """Each program gives what its function gives, to the bit."""
    inputs = given()
    for name, (body, likely) in FUNCTIONS.items():
        program = traced(student, body, "abc")
        found, wanted = student.evaluate(program, inputs), function_of(body, "abc")(*inputs.values())
        equal("IR-3", f"the shape of {name}", np.shape(found), np.shape(wanted), "the output's value")
        kind_of_number("IR-3", name, found, wanted.dtype)
        off = np.flatnonzero(np.asarray(found) != wanted)
        if off.size:
            what = f"{name} at a = {inputs['a'][off[0]]:g}, b = {inputs['b'][off[0]]:g}"
            raise Wrong(
                "IR-3", what, number_text(wanted[off[0]]), number_text(np.asarray(found)[off[0]]), likely
            )


def constants(student: Any) -> None:
    """Constants that are equal for Python and are not the same."""
    inputs = {"a": np.array([1.0, -1.0, np.inf], np.float32)}
    program = traced(student, "1.0 / (0.0 / a) + 1.0 / (-0.0 / a)", "a")
    found = student.evaluate(program, inputs)
    text = "0.0 == -0.0 for Python: compare constants by type and repr"
    hold("IR-3", "1 / (0.0 / a) + 1 / (-0.0 / a) at a = 1", np.isnan(found[0]), "nan", found[0], text)
    words = np.array([5, 7], np.uint32)
    program = traced(student, "(v ^ (v >> np.uint32(1))) * np.uint32(3)", "v")
    found = student.evaluate(program, {"v": words})
    text = "constants are kept as they are given: np.uint32(3) is not a float"
    kind_of_number("IR-3", "(v ^ (v >> 1)) * 3 of words", found, np.uint32)
    wanted = (words ^ (words >> np.uint32(1))) * np.uint32(3)
    hold("IR-3", "(v ^ (v >> 1)) * 3 of words", np.array_equal(found, wanted), str(wanted), str(found), text)
    program = traced(student, "a * 1.0 + a * 1", "a")
    held = sorted(repr(n.value) for n in program.nodes if n.op == "const")
    text = "1 == 1.0 for Python: compare constants by type and repr"
    hold("IR-1", "the constants of a * 1.0 + a * 1", held == ["1", "1.0"], "1 and 1.0", ", ".join(held), text)


def once(student: Any) -> None:
    """The same operation on the same operands is the same node."""
    for body, count, text in (
        ("a * b + a * b", 4, "look an operation up before you add it"),
        ("(a + 2.0) * (b + 2.0)", 6, "look a constant up before you add it"),
        ("a - b + (b - a)", 5, "a - b and b - a are different: operands have an order"),
        ("np.sin(a) + np.cos(a)", 5, "the operation belongs to what is compared"),
    ):
        found = traced(student, body, "ab")
        number = len(found.nodes)
        hold("IR-1", f"nodes of {body}", number == count, str(count), f"{number}: {listed(found)}", text)
    first, second = (traced(student, "np.sin(a) + 1.0", "a") for _ in range(2))
    text = "the list of nodes is one of the program, not one of the module"
    equal("IR-1", "nodes of a second program", len(second.nodes), len(first.nodes), text)


BRANCH = "`__bool__` has to raise TypeError: else an `if` takes one branch, silently"
"""What is wrong with a tracer that lets `if` pass."""


def refusals(student: Any) -> None:
    """What is not in the table is refused."""
    for body, likely in (
        ("np.exp2(a)", "a ufunc that OPS does not have: raise TypeError"),
        ("np.add.reduce(a)", "method is not `__call__`: raise TypeError"),
        ("np.clip(a, 0, 1)", "any function but np.where: raise TypeError"),
        ("np.sort(a)", "any function but np.where: raise TypeError"),
        ("1.0 if a > 0 else a", BRANCH),
        ("np.add(a, 1, where=False)", "a ufunc with options: TypeError"),
    ):
        call = partial(student.trace, function_of(body, "a"), ("a",))
        refuses("IR-3", f"tracing {body}", TypeError, call, likely, listed)


def dead(student: Any) -> None:
    """Nodes that the output does not need go, and numbers stay."""
    body = "(np.sin(b * 3.0), kept := a + 1.0, np.cos(kept), kept * a)[-1]"
    program = traced(student, body, "ab")
    found = student.live(program)
    held = [n.op for n in found.nodes]
    text = "from the output backwards, operands of operands: what is not reached goes"
    if "input" not in held or held.count("input") < 2:
        text = "inputs stay: they are the program's arguments"
    right = sorted(held) == sorted(["input", "input", "const", "add", "multiply"])
    hold(
        "IR-2", "operations that are left", right, "input, input, const, add, multiply", ", ".join(held), text
    )
    inputs = {k: v for k, v in given().items() if k != "c"}
    text = "operands and output are renumbered"
    try:
        same = np.array_equal(student.evaluate(found, inputs), (inputs["a"] + 1.0) * inputs["a"])
    except (LookupError, TypeError, ValueError) as error:
        raise Wrong(
            "IR-2", "the numbers afterwards", "the same", f"{type(error).__name__}: {error}", text
        ) from None
    hold("IR-2", "the numbers afterwards", same, "the same", "others", text)
    before = listed(program)
    student.live(program)
    same = listed(program) == before
    hold("IR-2", "the program that was given", same, "no change", "a change", "make new nodes")


def shown(student: Any) -> None:
    """The text of a program."""
    value = np.float32(0.1)
    nodes = ("input", (), "a"), ("const", (), value), ("multiply", (0, 1), None)
    program = Program(tuple(Node(*node) for node in nodes), 2)
    wanted = f"%0 = input a\n%1 = const {value!r}\n%2 = multiply %0 %1\noutput %2\n"
    found = student.text(program)
    hold("IR-1", "the result of text", isinstance(found, str), "a text", type(found).__name__)
    if found == wanted:
        return
    lines, right = found.splitlines(), wanted.splitlines()
    if lines == right:
        text = "every line ends with a line's end, the last one too"
        raise Wrong("IR-1", "the end of the text", repr(wanted[-9:]), repr(found[-9:]), text)
    pairs = zip(right, lines, strict=False)
    at = next((i for i, (x, y) in enumerate(pairs) if x != y), min(len(lines), len(right)))
    told = [repr(part[at]) if at < len(part) else "nothing" for part in (right, lines)]
    text = "%INDEX = OP, then %OPERANDS, or the name, or repr(value)"
    text = "repr(value), not str(value): f'{value!r}'" if at == 1 and str(value) in told[1] else text
    raise Wrong("IR-1", f"line {at} of the text", told[0], told[1], text)


def reference(student: Any) -> None:
    """A function of the reference, unchanged: the four words of PCG4D."""
    words = {n: rng.counter(np.arange(COUNT) * k + 3) for n, k in zip("pqrs", (1, 5, 77, 9001), strict=True)}
    for number in range(4):
        body = f"import_module('wamnet.refimpl.rng').pcg4d(p, q, r, s)[{number}]"
        program = student.live(traced(student, body, "pqrs"))
        found = student.evaluate(program, words)
        wanted = rng.pcg4d(*words.values())[number]
        what, text = f"word {number} of refimpl/rng.py: pcg4d", "words wrap: uint32 all the way"
        hold("RNG-1", what, np.array_equal(found, wanted), number_text(wanted), found, text)


CHECKS = (
    Check("short programs", short),
    Check("numbers", numbers),
    Check("constants", constants),
    Check("each operation once", once),
    Check("what is refused", refusals),
    Check("dead nodes", dead),
    Check("the text", shown),
    Check("a function of the reference", reference),
)
"""In the order in which they explain a mistake best."""
