"""Kernels that are not well formed: each is refused with its reason; those of schedules are accepted."""

from itertools import product

import numpy as np
import pytest

from wamnet.compiler.core import ir
from wamnet.compiler.core.ir import DTYPES, Image
from wamnet.compiler.core.ops import OPS, TypeRuleError
from wamnet.compiler.kernel.interface import RESULT, denoiser
from wamnet.compiler.kernel.kernel import (
    BOOL,
    FLOAT,
    INT,
    Array,
    Barrier,
    Break,
    Call,
    Constant,
    Expr,
    For,
    Function,
    If,
    Kernel,
    Launch,
    Let,
    Store,
    Type,
    View,
    any_lane,
    apply,
    call,
    const,
    expr,
    load,
    name,
    splat,
)
from wamnet.compiler.kernel.verify import OPERATIONS, KernelError, verify

X, Y, TURN = map(name, ("x", "y", "i"))
V, FOUR = Array("v", FLOAT, (2,)), FLOAT.of(4)
ZERO = const(0.0)
WRITE = Store(RESULT, (Y, X, const(0)), ZERO)
GIVEN = Function("twice", (("n", INT),), (), name("n") + name("n"))
COPY = Function("copy", (("from", FLOAT), ("to", FLOAT)), (Store("to", (const(0),), load("from", 1)),))
TABLES = (("table", np.zeros(2, np.float32)),)


def small(*body, **more):
    """Return a kernel with an image of three channels and one channel of a result."""
    interface = denoiser([Image("a", 3, -2.0, 2.0)], 1)
    return Kernel(interface, body, **more)


def looped(*body, count=2, **more):
    """Return a loop over `i`."""
    return For("i", expr(count), body, **more)


WRONG = [
    (small(Let("t", name("later")), Let("later", ZERO)), "later is used before"),
    (small(looped(Let("t", TURN)), Let("u", name("t"))), "t is used before it is"),
    (small(Let("t", ZERO), Let("t", ZERO)), "t is declared twice"),
    (small(Let("t", ZERO), looped(Let("t", ZERO))), "t is declared twice"),
    (small(Let("width", const(1))), "width is declared twice"),
    (small(Let("t", name("x", FLOAT))), "name of type int32 is said to have type float32"),
    (small(V, Let("t", name("v", FLOAT))), "v is an array without its index"),
    (small(Let("t", ZERO), Let("u", load("t", 0))), "t is not an array"),
    (small(Array("m", FLOAT, (2, 2)), Let("t", load("m", 0))), "m has 2 indices, not 1"),
    (small(V, Let("t", load("v", ZERO))), "index of v has type float32 instead of int32"),
    (small(V, Store("v", (const(2),), ZERO)), "index 2 is beyond v, which has 2"),
    (
        small(V, Store("v", (name("N") - 1,), ZERO), constants=(Constant("N", const(4)),)),
        "index 3 is beyond v",
    ),
    (small(Array("w", FOUR, (2,)), Let("t", load("w", 8))), "index 8 is beyond w, which has 8"),
    (small(Let("t", load("image_a", Y, X, 3))), "index 3 is beyond image_a"),
    (small(Let("t", splat(ZERO, 4).lane(4))), "component 4 does not exist"),
    (small(Let("t", Expr("take", (const(2),), FLOAT, "table")), tables=TABLES), "index 2 is beyond table"),
    (small(Let("t", Expr("take", (X,), FLOAT, "other"))), "other is not a table"),
    (small(V, Store("v", (const(0),), const(1))), "v has elements of type float32, not"),
    (small(Let("t", apply("add", splat(ZERO, 4), ZERO))), "lanes differ"),
    (small(Let("t", apply("add", ZERO, 1))), "add: operands must all be"),
    (small(Let("t", Expr("add", (X < 1, X < 1), BOOL))), "add: operands must all be"),
    (small(Let("t", Expr("add", (ZERO,), FLOAT))), "add has 1 operands, not 2"),
    (small(Let("t", Expr("twist", (ZERO,), FLOAT))), "twist is not an operation"),
    (small(Let("t", const(0.5, INT))), "0.5 is not a constant of type int32"),
    (small(Array("v", Type("float16"), (2,))), "which does not exist"),
    (small(Let("t", Expr("bits", (ZERO,), FLOAT))), "an operand of bits has type"),
    (small(Let("t", Expr("dot4", (X, ZERO), INT))), "neither four bytes nor a"),
    (small(Let("t", Expr("pack4", (X, X, X, X), INT))), "an operand of pack4 has type"),
    (small(Store("image_a", (Y, X, const(0)), ZERO)), "image_a is written, which is read only"),
    (small(Let("t", load(RESULT, Y, X, 0))), "the result is read"),
    (small(Store(RESULT, (Y, X, const(0)), ZERO, add=True)), "is added to result"),
    (small(If(X, (WRITE,))), "a condition has type int32 instead of bool"),
    (small(looped(WRITE, step=const(0))), "the step of the loop over i is 0"),
    (small(looped(WRITE, step=X)), "the step of the loop over i is not determined"),
    (small(looped(WRITE, count=ZERO)), "a bound of the loop over i has type float32"),
    (small(looped(Break(X))), "the condition that ends a loop has type int32"),
    (small(Break(X < 1)), "a break outside of a loop's own body"),
    (small(looped(If(X < 1, (Break(Y < 1),)))), "a break outside of a loop's own body"),
    (small(looped(Break(X < 1), Barrier()), group=(2, 2)), "a barrier inside a branch"),
    (small(Let("t", any_lane(X))), "an operand of any has type int32"),
    (
        small(Let("t", Expr("take", (X,), FOUR, "table")), tables=TABLES),
        "the index of table has type int32 instead of int32 x 4",
    ),
    (small(Array("v", FLOAT, (0,))), "a size of v is 0"),
    (small(Array("v", FLOAT, (X,))), "a size of v is not determined by constants"),
    (small(Array("v", FLOAT, (2,), value=ZERO)), "v is an array with a first value"),
    (
        small(looped(Array("v", FLOAT, (2,), "device"))),
        "v is memory of the device, which a kernel declares at its top",
    ),
    (small(Array("v", FLOAT, (ZERO,), "device")), "a size of v has type"),
    (small(If(const(True), (Launch(("p", "q"), (X, Y), ()),))), "a launch inside another"),
    (small(Launch(("p", "q"), (ZERO, Y), ())), "the items of a launch has type"),
    (
        small(
            Launch(("p", "q"), (name("width"), const(1)), ()), Store(RESULT, (name("p"), X, const(0)), ZERO)
        ),
        "p is used before it is declared",
    ),
    (small(Array("v", FLOAT, (2,), "group")), "v is memory of a group"),
    (small(looped(Array("v", FLOAT, (2,), "group")), group=(2, 2)), "v is memory of a"),
    (small(Barrier()), "a barrier in a kernel without groups"),
    (small(If(X < 1, (Barrier(),)), group=(2, 2)), "a barrier inside a branch"),
    (small(looped(Barrier(), count=X), group=(2, 2)), "a barrier inside a branch"),
    (small(functions=(Function("f", (), (Barrier(),), ZERO),), group=(2, 2)), "function f has a barrier"),
    (small(Let("t", call("f", [X], INT))), "f is not a function of values"),
    (small(Let("t", call("twice", [], INT)), functions=(GIVEN,)), "twice takes 1 values, not 0"),
    (small(Let("t", call("twice", [ZERO], INT)), functions=(GIVEN,)), "argument n of twice has type float32"),
    (small(functions=(Function("f", (), (), X),)), "x is used before it is declared"),
    (
        small(functions=(Function("f", (("n", INT),), (), call("f", [name("n")], INT)),)),
        "f is not a function of values",
    ),
    (small(Call("twice", ()), functions=(GIVEN,)), "twice is not a function on views"),
    (small(V, Call("copy", (View("v", (X,), X),)), functions=(COPY,)), "copy takes 2 views, not 1"),
    (
        small(V, Call("copy", (View("v", (X,), X), View("weights", (X,), X))), functions=(COPY,)),
        "weights is written by copy",
    ),
    (small(constants=(Constant("N", name("M")),)), "M is used before it is declared"),
    (small(step=(const(0), const(1))), "the step of an item is 0"),
]


@pytest.mark.parametrize(("kernel", "message"), WRONG)
def test_refused(kernel, message):
    with pytest.raises(KernelError, match=message):
        verify(kernel)


def test_names_of_scopes_side_by_side_may_be_equal_but_not_those_within():
    verify(small(V, looped(Let("t", TURN)), looped(Let("t", TURN)), WRITE))
    with pytest.raises(KernelError, match="t is declared twice"):
        verify(small(V, Let("t", X), looped(Let("t", TURN)), WRITE))


def test_the_table_of_operations_is_that_of_the_compiler():
    """Each elementwise operation takes the same kinds here and there, and makes the same of them."""
    elementwise = {op.name: op for op in OPS.values() if op.elementwise and op.name != "convert"}
    assert set(OPERATIONS) == set(elementwise)
    for (what, op), lanes in product(elementwise.items(), (1, 4)):
        for kinds in product(DTYPES, repeat=op.arity):
            names = [name(f"a{i}", Type(kind, lanes)) for i, kind in enumerate(kinds)]
            variables = [Array(each.value, each.type) for each in names]
            try:
                found = op.type_rule([ir.Type(kind) for kind in kinds], {}, {})
            except TypeRuleError:
                divides = what == "divide" and {*kinds} == {"int32"} and lanes == 1  # indices
                found = ir.Type("int32" if divides else "none")
            kernel = small(*variables, Let("t", Expr(what, tuple(names), Type(found.dtype, lanes))))
            if found.dtype == "none":
                with pytest.raises(KernelError, match=what):
                    verify(kernel)
            else:
                verify(kernel)
