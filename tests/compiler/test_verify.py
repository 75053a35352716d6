"""The verifier refuses each malformed program with its own sentence."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.core import verify as verifier
from wamnet.compiler.core.ir import Gather, Image, Node, Program, Type, attributes
from wamnet.compiler.core.verify import verify
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network.window import Window

V3 = Type(shape=(3,))
INPUT = Node("input", (), V3, attributes(name="window", type=V3))
W = np.ones((2, 3), np.float32)
AFFINE = Node("affine", (0,), Type(shape=(2,)), attributes(weight="W0", bias="b0"))
GOOD = Program((INPUT, AFFINE), (("color", 1),), {"W0": W, "b0": np.ones(2, np.float32)})


def plus(*nodes):
    return replace(GOOD, nodes=(*GOOD.nodes, *nodes))


def constant(value):
    return Node("constant", (), Type(), attributes(value=value))


NUMBER = Type()
A = np.arange(3, dtype=np.float32)


def loop(*changed, outputs=(("sum", 4),), more=()):
    """Return the sum of a table's entries and x, with some nodes changed: (index, node)."""
    nodes = [
        Node("input", (), NUMBER, attributes(name="x", type=NUMBER)),
        Node("carried", (0,), NUMBER, attributes(index=0, loop=0)),
        Node("row", (), NUMBER, attributes(loop=0, table="T0")),
        Node("add", (1, 2), NUMBER),
        result(),
        *more,
    ]
    for index, node in changed:
        nodes[index] = node
    return Program(tuple(nodes), outputs, {"T0": A})


def result(args=(1, 3), index=0, number=0, trips=3, kind=NUMBER):
    return Node("loop", args, kind, attributes(index=index, loop=number, trips=trips))


def walk(skip=(2, 2), first=(0, 1, 3), *changed):
    """Return the sum of x and a table's entries in the nodes of a tree whose own entry is below it."""
    nodes = [
        Node("input", (), NUMBER, attributes(name="x", type=NUMBER)),
        Node("carried", (0,), NUMBER, attributes(index=0, loop=0)),
        Node("row", (), NUMBER, attributes(loop=0, table="T0")),
        Node("add", (1, 2), NUMBER),
        Node("branch", (), NUMBER, attributes(loop=0, table="T1")),
        Node("less", (4, 1), Type("bool")),
        Node("loop", (1, 3, 5), NUMBER, attributes(index=0, loop=0, trips=3, first="T2", skip="T3")),
    ]
    for index, node in changed:
        nodes[index] = node
    tables = {"T2": np.array(first, np.int32), "T3": np.array(skip, np.int32)}
    return Program(tuple(nodes), (("sum", 6),), {"T0": A, "T1": A[:2], **tables})


CASES = {
    "types_follow": [
        (loop((4, result((1, 3, 3)))), "result 0 does not exist of a loop with 3 operands"),
        (loop((4, result(index=1))), "result 1 does not exist of a loop with 2 operands"),
        (
            loop((3, Node("less", (1, 2), Type("bool")))),
            "a trip must keep the kinds that are carried: float32 became bool",
        ),
        (
            replace(loop(), parameters={"T0": np.ones((3, 2), np.float32)}),
            r"a loop walks along a table of one axis, not of shape \(3, 2\)",
        ),
        (
            plus(Node("carried", (0,), V3, attributes(index=0, loop=0))),
            r"a loop carries numbers, not float32\[3\]",
        ),
        (
            walk((2, 2), (0, 1, 3), (5, Node("add", (4, 1), NUMBER))),
            "the last operand of a walk must be a boolean: whether a lane enters a node",
        ),
        (plus(Node("sin", (1,), V3)), r"%2 sin is marked float32\[3\]; its operands give float32\[2\]"),
        (plus(Node("add", (0, 1), V3)), r"operands must be of one shape or numbers, not float32\[3\]"),
        (plus(constant(1)), "a constant must be a float that is finite in float32, not 1"),
        (plus(constant(float("nan"))), "finite in float32, not nan"),
        (plus(Node("component", (1,), Type(), attributes(index=2))), "component 2 does not exist"),
        (
            plus(Node("input", (), V3, attributes(name="y", type="V3"))),
            "an input's attribute `type` must be a Type",
        ),
        (
            replace(GOOD, parameters={**GOOD.parameters, "b0": np.ones(3, np.float32)}),
            r"bias must have shape \(2,\) beside a weight of \(2, 3\)",
        ),
        (
            plus(Node("constant", (), Type("int32"), attributes(value=1.0, dtype="int32"))),
            "a constant must be an integer that int32 holds, not 1.0",
        ),
        (
            plus(Node("constant", (), Type("bool"), attributes(value=1, dtype="bool"))),
            "a constant must be True or False, not 1",
        ),
        (
            replace(
                plus(Node("parameter", (), Type("int32", (2,)), attributes(name="n"))),
                parameters={**GOOD.parameters, "n": np.ones(2, np.int32)},
            ),
            "a parameter used as a value must be float32, not int32",
        ),
    ],
    "loops_are_whole": [
        (loop((4, result((0, 3)))), "%4 loop: operand 0 must be carried number 0 of loop 0"),
        (loop((4, result(number=1))), "operand 0 must be carried number 0 of loop 1"),
        (loop(more=(result((1, 1)),)), "%5 and another result of loop 0 have other operands or trips"),
        (loop(more=(result(trips=2),)), "have other operands or trips"),
    ],
    "tables_are_as_long_as_loops": [
        (loop((4, result(trips=0))), "%4 loop makes 0 trips; it must make one"),
        (loop((4, result(trips=4))), "%2 row: table T0 has 3 rows; the loop makes 4 trips"),
    ],
    "loops_are_closed": [
        (loop(outputs=(("a", 3),)), "output 'a', %3, is a value of a trip; take the loop's"),
        (loop(outputs=(("a", 1),)), "output 'a', %1, is a value of a trip"),
        (
            loop(more=(Node("carried", (3,), NUMBER, attributes(index=0, loop=1)),)),
            "%5 carried depends on trips of loops 0, 1; loops do not nest",
        ),
        (
            loop(
                more=(
                    Node("carried", (0,), NUMBER, attributes(index=0, loop=1)),
                    Node("add", (5, 3), NUMBER),
                )
            ),
            "%6 add depends on trips of loops 0, 1",
        ),
        (
            loop(
                more=(
                    Node("carried", (0,), NUMBER, attributes(index=0, loop=1)),
                    result((5, 3), number=1),
                )
            ),
            "%6 loop depends on trips of loops 0; loops do not nest",
        ),
    ],
    "walks_stay_on_their_trees": [
        (walk(first=(0, 1, 2, 3)), "%6 loop: table T2 has 4 entries for 1 x 3"),
        (walk(skip=(2, 1)), "%6 loop: table T3 must lead each node to a later one, or to 2"),
        (walk(skip=(3, 2)), "%6 loop: table T3 must lead each node to a later one, or to 2"),
        (walk(first=(0, 1, 2)), "%6 loop: table T2 must share out rows 0 to 2 in order"),
        (walk(first=(0, 4, 3)), "%6 loop: table T2 must share out rows 0 to 2 in order"),
        (
            walk((2, 2), (0, 1, 3), (4, Node("branch", (), NUMBER, attributes(loop=0, table="T0")))),
            "%4 branch: table T0 has 3 rows; a branch of a table of 2 is read here",
        ),
        (
            walk((2, 2), (0, 1, 3), (2, Node("branch", (), NUMBER, attributes(loop=0, table="T1")))),
            "%2 branch: table T1 has 2 rows; a row of a table of 3 is read here",
        ),
    ],
    "known_operations": [
        (plus(Node("tanh", (1,), V3)), "%2 is 'tanh', which is not an operation; supported: input,"),
    ],
    "operands_before_use": [
        (plus(Node("add", (1,), V3)), "%2 add has 1 operands; it takes 2"),
        (plus(Node("stack", (), V3)), "%2 stack has 0 operands; it takes one or more"),
        (plus(Node("sin", (2,), V3)), "%2 sin reads %2; only %0 to %1 are computed before it"),
        (plus(Node("sin", (-1,), V3)), "%2 sin reads %-1"),
    ],
    "attributes_in_order": [
        (plus(Node("constant", (), Type())), r"attributes \[\]; it takes, sorted: value"),
        (
            plus(replace(AFFINE, attributes=(("weight", "W0"), ("bias", "b0")))),
            r"\['weight', 'bias'\]; it takes, sorted: weight, bias \(optional\)",
        ),
        (plus(Node("sin", (1,), V3, attributes(x=1))), "it takes, sorted: none"),
    ],
    "parameters_exist": [
        (replace(GOOD, parameters={"W0": W}), "names parameter 'b0', which the program does not have"),
    ],
    "parameters_are_numbers": [
        (replace(GOOD, parameters={**GOOD.parameters, "W0": W * np.nan}), "must be finite"),
        (replace(GOOD, parameters={**GOOD.parameters, "W1": W[:0]}), "not empty"),
        (replace(GOOD, parameters={**GOOD.parameters, "W0": W * 1.0j}), "complex64"),
    ],
    "short_vectors": [
        (
            plus(Node("input", (), Type("int8"), attributes(name="y", type=Type("int8")))),
            "%2 input has type int8; values are numbers or vectors of float32, int32",
        ),
    ],
    "inputs_once": [
        (plus(INPUT), "input 'window' is declared more than once"),
    ],
    "outputs_exist": [
        (replace(GOOD, outputs=()), r"outputs are \[\]; there must be one or more"),
        (replace(GOOD, outputs=(("a", 0), ("a", 1))), "with different names"),
        (replace(GOOD, outputs=(("a", 2),)), "output 'a' is %2; the program computes %0 to %1"),
    ],
    "window_matches": [
        (
            replace(GOOD, gather=Gather(Window(2, "clamp"), (Image("a", 1, 0, 1),))),
            r"inputs are \(window: float32\[3\]\); the gathered window gives \(window: float32\[4\]\)",
        ),
    ],
    "images_have_ranges": [
        *(
            (
                replace(GOOD, gather=Gather(Window(1, "clamp"), (Image("a", 3, low, high),))),
                r"image a holds numbers in \[.*\]; the ends must be finite in float32",
            )
            for low, high in ((1.0, -1.0), (-np.inf, 1.0), (0.0, 1e39), (np.nan, 1.0))
        ),
    ],
}
"""Programs that break a rule, and what is said."""


@pytest.mark.parametrize(
    ("rule", "program", "message"), [(rule, *row) for rule, rows in CASES.items() for row in rows]
)
def test_malformed_program_is_refused(rule, program, message):
    with pytest.raises(CompileError, match=rf"after pass x: .*{message}.* \(rule {rule}\)"):
        verify(program, "after pass x")


def test_every_rule_has_a_case():
    assert set(CASES) == {rule.__name__ for rule in verifier.RULES}


def test_well_formed_program_passes():
    assert verify(GOOD) is GOOD
    verify(loop())
    verify(walk())
