"""Ranges of what executors may compute: each rule against float32, and against made-up executors."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wamnet.compiler.core import ops
from wamnet.compiler.core.interpret import apply, interpret
from wamnet.compiler.core.ir import Node, Program, Type, attributes
from wamnet.compiler.core.loops import LISTS, STATEMENTS
from wamnet.compiler.core.profiles import FLUSH, SineContract
from wamnet.compiler.core.trace import trace
from wamnet.compiler.proof import ranges
from wamnet.compiler.proof.bounds import power_error
from wamnet.compiler.proof.ranges import CORRECT, PROMISED, Range, evaluate
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Sphere
from wamnet.refimpl.light.transport import Settings

U = 2.0**-24
"""Unit roundoff of float32."""

numbers = st.floats(-1000, 1000, width=32).map(lambda x: x if abs(x) > FLUSH else 0.0)
truths = st.sampled_from([(False, False), (False, True), (True, True)])


def program_of(op, kinds, result, **named):
    """Return the program of one operation on inputs a, b, c."""
    inputs = [
        Node("input", (), kind, attributes(name=name, type=kind))
        for name, kind in zip("abc", kinds, strict=False)
    ]
    node = Node(op, tuple(range(len(kinds))), result, attributes(**named))
    return Program((*inputs, node), (("out", len(kinds)),))


def between(low, high, plain=None, dtype=np.float64):
    """Return a range, unsure where it is not a point."""
    low, high = np.asarray(low, dtype), np.asarray(high, dtype)
    plain = low if plain is None else np.asarray(plain)
    return Range(low, high, plain.astype(np.float32) if dtype == np.float64 else plain, low == high)


def float_op(op, operands, arithmetic=PROMISED, guided=False):
    program = program_of(op, [Type()] * len(operands), Type())
    return evaluate(program, dict(zip("abc", operands, strict=False)), arithmetic, guided)["out"]


# ---- one rule at a time ---------------------------------------------------------------------------------


def test_every_operation_on_numbers_has_a_rule():
    """Inputs and constants are given, loops walked; the others are taken apart, or belong to networks."""
    assert set(ops.OPS) - set(ranges.RULES) == {
        *("input", "constant", *ops.LOOPS),
        *("parameter", "affine", "stack", "component"),
    }
    assert set(ranges.RULES) <= set(ops.OPS)


@given(
    op=st.sampled_from(["add", "subtract", "multiply", "divide", "minimum", "maximum"]),
    data=st.data(),
    arithmetic=st.sampled_from([PROMISED, CORRECT]),
)
def test_two_floats(op, data, arithmetic):
    """Any two members of the operands' ranges, computed by NumPy, give a member of the result's."""
    ends = [sorted((data.draw(numbers), data.draw(numbers))) for _ in range(2)]
    members = [data.draw(st.floats(*pair, width=32)) for pair in ends]
    found = float_op(op, [between(*pair, plain=m) for pair, m in zip(ends, members, strict=True)], arithmetic)
    assert found.holds(found.plain) or not found.known
    if not found.known:
        assert op == "divide"
        assert ends[1][0] <= FLUSH
        assert ends[1][1] >= -FLUSH


@given(
    op=st.sampled_from(["negative", "absolute", "sqrt", "reciprocal", "floor", "exp", "sin", "cos"]),
    data=st.data(),
)
def test_one_float(op, data):
    """As above; NumPy's sine is right to 1.5 ulp, which is less than the contract's 2.5e-7."""
    ends = sorted((data.draw(numbers), data.draw(numbers)))
    member = data.draw(st.floats(*ends, width=32))
    found = float_op(op, [between(*ends, plain=member)])
    assert found.holds(found.plain) or not found.known
    if not found.known:
        assert (op == "sqrt" and ends[0] < 0) or (op == "reciprocal" and ends[0] <= 0 <= ends[1])


@given(op=st.sampled_from(["add", "subtract", "multiply"]), a=numbers, b=numbers)
def test_points_round_to_the_neighbours_of_the_exact_result(op, a, b):
    """RAN-6: the range of two numbers is one float32, or two where the exact result is their middle."""
    exact = {"add": Fraction(a) + Fraction(b), "subtract": Fraction(a) - Fraction(b)}
    exact["multiply"] = Fraction(a) * Fraction(b)
    assume(exact[op] == 0 or abs(exact[op]) >= 2 * FLUSH)
    found = float_op(op, [np.float32(a), np.float32(b)])
    low, high = Fraction(float(found.low)), Fraction(float(found.high))
    assert found.holds(getattr(np, op)(np.float32(a), np.float32(b)))
    assert abs((low + high) / 2 - exact[op]) <= Fraction(U) * abs(exact[op])
    assert np.nextafter(np.float32(found.low), np.float32(np.inf)) >= found.high


def test_ties_may_fall_on_either_side():
    """1 + 2^-24 is the middle between 1 and its neighbour 1 + 2^-23: rounding to nearest allows both."""
    found = float_op("add", [np.float32(1), np.float32(2.0**-24)])
    assert (found.low, found.high) == (1, 1 + 2.0**-23)


@given(a=numbers, b=numbers, c=numbers, minus=st.booleans())
def test_sums_may_read_products_before_or_after_rounding(a, b, c, minus):
    """a b + c and c - a b with one rounding and with two, against rationals."""
    program = trace(lambda x, y, z: z - x * y if minus else -(x * y) + z, dict.fromkeys("xyz", Type()))
    x, y, z = (np.float32(v) for v in (a, b, c))
    exact = Fraction(c) - Fraction(a) * Fraction(b)
    assume(abs(exact) >= 2 * FLUSH)
    fused, plain = np.float32(float(exact)), z - x * y
    (found,) = evaluate(program, {"x": x, "y": y, "z": z}).values()
    assert found.holds(fused)
    assert found.holds(plain)
    (correct,) = evaluate(program, {"x": x, "y": y, "z": z}, CORRECT).values()
    assert correct.holds(plain)


@given(a=numbers, b=numbers, ulps=st.floats(-1, 1))
def test_promises_of_division_and_square_root(a, b, ulps):
    """2.5 ulp and 5 ulp off, as profiles.py allows; an ulp is at least u |result|."""
    assume(abs(b) > 1e-3)  # ordinary numbers: neither flushed nor overflowing
    assume(a == 0 or abs(a) > 1e-3)
    quotient = float_op("divide", [np.float32(a), np.float32(b)])
    assert quotient.holds(a / b * (1 + ulps * 2.5 * U))
    root = float_op("sqrt", [np.float32(abs(a))])
    assert root.holds(np.sqrt(abs(a)) * (1 + ulps * 5 * U))


@given(
    x=st.floats(2.0**-10, 100, width=32),
    width=st.floats(0, 1),
    y=st.floats(0.125, 4, width=32),
    data=st.data(),
)
def test_promise_of_powers(x, width, y, data):
    """Off by all that bounds.py allows, anywhere between the ends; NumPy's own is far better."""
    found = float_op("power", [between(x, x + width), between(y, y + width)])
    a, b = (data.draw(st.floats(end, end + width)) for end in (x, y))
    off = power_error(np.float64(b), np.abs(np.log2(np.float64(a))))
    assert found.holds(a**b * (1 + off))
    assert found.holds(a**b * (1 - off))
    assert found.holds(found.plain)
    assert not float_op("power", [between(0.0, x), np.float32(y)]).known


@given(x=st.floats(-6000, 6000, width=32), width=st.floats(0, 4), at=st.floats(0, 1), off=st.floats(-1, 1))
def test_promises_of_sine_and_cosine(x, width, at, off):
    for op, function in (("sin", np.sin), ("cos", np.cos)):
        found = float_op(op, [between(x, x + width)])
        contract = PROMISED.sine if op == "sin" else PROMISED.cosine
        assert found.holds(function(x + at * width) + off * contract.error)
        if width == 0:
            # 2^-37 is the slack that float64's own sine and pi / 2 are given, twice.
            assert found.high - found.low <= 2 * contract.error + 2.0**-36


def test_sine_outside_its_domain_or_without_promise_has_no_range():
    assert float_op("sin", [np.float32(12799)]).known
    assert not float_op("sin", [np.float32(12801)]).known
    assert not float_op("cos", [np.float32(6401)]).known
    unpromised = replace(PROMISED, sine=SineContract("none", None), cosine=SineContract("any", 1e-6))
    assert not float_op("sin", [np.float32(1)], unpromised).known
    assert float_op("cos", [np.float32(7000)], unpromised).known
    assert not float_op("cos", [np.float32(2**15)], unpromised).known


# ---- decisions -------------------------------------------------------------------------------------------

COMPARED = {
    "less": np.less,
    "less_equal": np.less_equal,
    "greater": np.greater,
    "greater_equal": np.greater_equal,
    "equal": np.equal,
    "not_equal": np.not_equal,
}


@given(op=st.sampled_from(list(COMPARED)), data=st.data())
def test_comparisons_are_certain_exactly_when_all_members_agree(op, data):
    """On integers all members of both ranges can be tried."""
    whole = st.integers(-3, 3)
    a, b = (sorted((data.draw(whole), data.draw(whole))) for _ in range(2))
    program = program_of(op, [Type("int32")] * 2, Type("bool"))
    inputs = {"a": between(*a, dtype=np.int32), "b": between(*b, dtype=np.int32)}
    found = evaluate(program, inputs)["out"]
    results = [COMPARED[op](x, y) for x in range(a[0], a[1] + 1) for y in range(b[0], b[1] + 1)]
    assert bool(found.low) == all(results)
    assert bool(found.high) == any(results)
    assert bool(found.sure) == (all(results) == any(results))
    guided = evaluate(program, inputs, guided=True)["out"]
    assert guided.point
    if not found.point:
        assert guided.low == COMPARED[op](a[0], b[0])  # the reference's operands are the lower ends


@given(op=st.sampled_from(["logical_and", "logical_or", "logical_not"]), a=truths, b=truths)
def test_logic_is_kleene_s(op, a, b):
    operands = [a, b][: ops.OPS[op].arity]
    program = program_of(op, [Type("bool")] * len(operands), Type("bool"))
    inputs = {name: between(*o, dtype=bool) for name, o in zip("ab", operands, strict=False)}
    found = evaluate(program, inputs)["out"]
    members = [set(o) for o in operands]
    results = {
        bool(getattr(np, op)(*pair))
        for pair in ([(x,) for x in members[0]] if len(members) == 1 else [(x, y) for x in a for y in b])
    }
    assert {bool(found.low), bool(found.high)} == results
    assert bool(found.sure) == (len(results) == 1)


def choose(condition, a, b, guided=False, plain=True):
    program = program_of("select", [Type("bool"), Type(), Type()], Type())
    chosen = between(*condition, plain=plain, dtype=bool)
    return evaluate(program, {"a": chosen, "b": a, "c": b}, guided=guided)["out"]


def test_a_selection_is_its_branch_or_the_hull_of_both():
    a, b = between(1, 2), between(5, 5)
    for condition, low, high in (((True, True), 1, 2), ((False, False), 5, 5), ((False, True), 1, 5)):
        found = choose(condition, a, b)
        assert (found.low, found.high) == (low, high)
        assert found.sure == (low == high)
    sure = replace(a, sure=np.True_)
    for condition, first, second in (((True, True), sure, a), ((False, False), a, sure)):
        assert choose(condition, first, second).sure
        assert not choose(condition, second, first).sure
    assert not choose((False, True), sure, sure).point
    assert not choose((False, True), sure, replace(sure, high=np.float64(9))).sure


def test_guided_decisions_are_the_reference_s():
    program = trace(lambda x, y: np.where(x < y, x - 8.0, y + 8.0), {"x": Type(), "y": Type()})
    near = {"x": between(1.0, 2.0, plain=2.0), "y": np.float32(1.5)}
    free, guided = (evaluate(program, near, guided=g)["color"] for g in (False, True))
    assert (free.low, free.high, bool(free.sure)) == (-7, 9.5, False)
    assert (guided.low, guided.high) == (9.5, 9.5)


def test_an_undecided_value_that_is_not_chosen_has_no_say():
    """A box behind the nearest surface may be undecided: the distance is sure all the same."""
    unsure, sure = between(3.0, 4.0), replace(between(2.0, 3.75), sure=np.True_)
    assert float_op("minimum", [np.float32(2), unsure]).sure
    assert float_op("maximum", [np.float32(5), unsure]).sure
    assert not float_op("minimum", [np.float32(3.5), unsure]).sure
    assert not float_op("maximum", [np.float32(3.5), unsure]).sure
    assert not float_op("minimum", [sure, unsure]).sure
    assert not float_op("maximum", [replace(sure, low=np.float64(3.5)), unsure]).sure
    assert float_op("minimum", [sure, between(4.0, 5.0)]).sure
    assert not float_op("add", [np.float32(3.5), unsure]).sure
    assert float_op("multiply", [np.float32(0), unsure]).sure


def test_floor_and_cutting_off_are_decisions():
    crossing = between(1.9, 2.1, plain=1.9)
    for op, kind in (("floor", Type()), ("convert", Type("int32"))):
        named = {"dtype": "int32"} if op == "convert" else {}
        program = program_of(op, [Type()], kind, **named)
        free, guided = (evaluate(program, {"a": crossing}, guided=g)["out"] for g in (False, True))
        assert (free.low, free.high, bool(free.sure)) == (1, 2, False)
        assert (guided.low, guided.high) == (1, 1)
        assert evaluate(program, {"a": np.float32(1.9)})["out"].sure


# ---- integers and tables -----------------------------------------------------------------------------------

words = st.integers(0, 2**32 - 1)


@given(op=st.sampled_from(["add", "multiply", "subtract", "bitwise_xor", "bitwise_and"]), a=words, b=words)
def test_words_are_exact(op, a, b):
    """Modulo 2^32; where an operand is not known, nothing is."""
    program = program_of(op, [Type("uint32")] * 2, Type("uint32"))
    x, y = np.array([a], np.uint32), np.array([b], np.uint32)
    found = evaluate(program, {"a": x, "b": y})["out"]
    assert found.low == found.high == getattr(np, op)(x, y)
    unknown = evaluate(program, {"a": x, "b": between([0], [5], dtype=np.uint32)})["out"]
    assert (unknown.low, unknown.high, bool(unknown.sure)) == (0, 2**32 - 1, False)


@given(a=st.integers(-(2**24), 2**24), dtype=st.sampled_from(["int32", "uint32"]))
def test_whole_numbers_become_floats_and_back(a, dtype):
    a = abs(a) if dtype == "uint32" else a
    to, back = (
        program_of("convert", [Type(k)], Type(t), dtype=t)
        for k, t in ((dtype, "float32"), ("float32", dtype))
    )
    found = evaluate(to, {"a": np.array([a], dtype)})["out"]
    assert found.low == found.high == a
    again = evaluate(back, {"a": found})["out"]
    assert again.low == again.high == a


def test_tables():
    table = np.array([4.0, -1.0, 7.0], np.float32)
    program = replace(program_of("take", [Type("int32")], Type(), table="T0"), parameters={"T0": table})
    exact = evaluate(program, {"a": np.array([0, 1, 2], np.int32)})["out"]
    assert np.array_equal(exact.low, table)
    assert np.array_equal(exact.high, table)
    unknown = evaluate(program, {"a": between([0], [1], dtype=np.int32)})["out"]
    assert (unknown.low, unknown.high, bool(unknown.sure)) == (-1, 7, False)


# ---- what leaves the range of numbers ----------------------------------------------------------------------


def test_what_may_overflow_has_no_range_and_nothing_after_it():
    huge = np.float32(3e38)
    for found in (
        float_op("add", [huge, huge]),
        float_op("multiply", [huge, huge]),
        float_op("divide", [np.float32(1), between(-0.5, 1)]),
        float_op("divide", [np.float32(1), np.float32(2.0**127)]),
        float_op("sqrt", [between(-1e-9, 1)]),
        float_op("minimum", [np.float32(1), between(-np.inf, np.inf)]),
    ):
        assert not found.known
        assert not found.sure
        assert found.holds(1e38)
        assert found.holds(-1e38)
        assert not found.holds(np.nan)
    assert not float_op("absolute", [between(-np.inf, np.inf)]).known
    decided = evaluate(
        program_of("less", [Type()] * 2, Type("bool")), {"a": between(-np.inf, np.inf), "b": np.float32(0)}
    )
    assert not decided["out"].point


def test_small_numbers_may_be_flushed():
    tiny = np.float32(2.0**-127)
    assert float_op("negative", [tiny]).holds(0.0)
    assert float_op("multiply", [np.float32(1e-30), np.float32(1e-30)]).holds(0.0)
    assert not float_op("multiply", [np.float32(1e-18), np.float32(1e-18)]).holds(0.0)
    assert not float_op("divide", [np.float32(1), tiny]).known


def test_an_operation_without_a_rule_is_refused_by_name():
    program = trace(lambda x: np.matmul(x, np.ones((1, 2), np.float32).T), {"x": Type(shape=(2,))})
    with pytest.raises(CompileError, match=r"operation 'affine' giving float32\[1\] has no rule for ranges"):
        evaluate(program, {"x": np.zeros(2)})


# ---- whole programs ----------------------------------------------------------------------------------------


def drawn_program(random):
    """Return a random program of 30 operations on three floats, with decisions between most of them."""

    def function(*values):
        values = [*values, values[0] * 0.5]
        for _ in range(random.integers(5, 30)):
            a, b, c = (values[i] for i in random.integers(0, len(values), 3))
            values.append(
                [
                    lambda a, b, c: a + b,
                    lambda a, b, c: a - b * c,
                    lambda a, b, c: a * b + c,
                    lambda a, b, c: a / (np.absolute(b) + 0.5),
                    lambda a, b, c: np.sqrt(np.absolute(a)),
                    lambda a, b, c: np.where(a < b, c, a),
                    lambda a, b, c: np.where((a > b) | ~(c <= a), b, c * 0.25),
                    lambda a, b, c: np.minimum(a, b) - np.maximum(b, c),
                    lambda a, b, c: np.sin(np.minimum(np.maximum(a, -9.0), 9.0)),
                    lambda a, b, c: np.cos(np.minimum(np.maximum(b, -9.0), 9.0)) * c,
                    lambda a, b, c: np.where(a == b, a, np.floor(c)),
                ][random.integers(0, 11)](a, b, c)
            )
        return {"last": values[-1], "other": values[-2], "sum": values[-3] + values[-1]}

    return trace(function, dict.fromkeys("xyz", Type()))


def execute(program, inputs, random):
    """Compute a program as some executor may: sums fused or not, functions off by what is promised."""
    values: list = []
    for node in program.nodes:
        if node.op == "input":
            values.append(np.float32(inputs[node["name"]]))
            continue
        if node.op == "constant":
            values.append(np.float32(node["value"]))
            continue
        operands = [values[arg] for arg in node.args]
        value = apply(node, operands, program.parameters, np.dtype(np.float32))
        off = random.choice([-1.0, 0.0, 1.0]) if random.random() < 0.5 else random.uniform(-1, 1)
        if node.op in ("add", "subtract"):
            value = fused(program, node, values, random)
        elif node.op in ("divide", "sqrt"):
            # Half an ulp is left for rounding to float32 here.
            wide = np.divide(*map(float, operands)) if node.op == "divide" else np.sqrt(float(operands[0]))
            value = np.float32(wide * (1 + off * {"divide": 2.0, "sqrt": 4.5}[node.op] * U))
        elif node.op in ("sin", "cos"):
            exact = getattr(np, node.op)(float(operands[0]))
            value = np.float32(exact + off * (PROMISED.sine.error - U))
        values.append(value)
    return {name: values[index] for name, index in program.outputs}


def fused(program, node, values, random):
    """Return a sum, with products among its operands unrounded or not."""
    exact = []
    for arg in node.args:
        source = program.nodes[arg]
        take = source.op == "multiply" and random.random() < 0.5
        factors = (
            [Fraction(float(values[i])) for i in source.args] if take else [Fraction(float(values[arg]))]
        )
        exact.append(factors[0] * factors[1] if len(factors) > 1 else factors[0])
    return np.float32(float(exact[0] + exact[1] if node.op == "add" else exact[0] - exact[1]))


@given(seed=st.integers(0, 2**32 - 1))
def test_every_executor_that_keeps_the_promises_is_in_range(seed):
    """Random programs, four random executors each; where all is sure or guided, the decisions agree."""
    random = np.random.default_rng(seed)
    program = drawn_program(random)
    inputs = {name: np.float32(random.choice([random.normal(), random.integers(-2, 3)])) for name in "xyz"}
    found = evaluate(program, inputs)
    expected = interpret(program, inputs)
    for name, one in found.items():
        if not one.known:  # too large for float32, by a tower of products
            continue
        assert np.array_equal(one.plain, expected[name])
        assert one.holds(one.plain)
        assert evaluate(program, inputs, guided=True)[name].holds(one.plain)
        for _ in range(4):
            assert one.holds(execute(program, inputs, random)[name])


def test_loops_have_the_ranges_of_their_trips_one_after_another():
    """A scene of spheres with all statements, and with a table and a loop: the same ends, to the bit."""
    spheres = tuple(Sphere((0.3 * i - 1.0, 0.1 * i, -0.2 * i), 0.2, (0.5, 0.6, 0.7)) for i in range(6))
    scene = replace(scenes.canonical("lone_light"), spheres=spheres)
    unrolled, looped = (
        lower_scene(scene, Settings(), forms).parts["arrive"] for forms in (STATEMENTS, LISTS)
    )
    assert {node.op for node in looped.nodes} > {*ops.LOOPS} - {"branch"}
    random = np.random.default_rng(4)
    directions = random.normal(size=(3, 500))
    directions /= np.sqrt(np.sum(directions**2, axis=0))
    names = [str(node["name"]) for node in looped.nodes if node.op == "input"]
    inputs = {name: np.full(500, 0.25, np.float32) for name in names}
    inputs |= {f"direction_{c}": directions[i].astype(np.float32) for i, c in enumerate("xyz")}
    for guided in (False, True):
        first, second = (evaluate(program, inputs, guided=guided) for program in (unrolled, looped))
        for name, expected in first.items():
            for end in ("low", "high", "plain", "sure"):
                a, b = (np.broadcast_to(getattr(r, end), 500) for r in (expected, second[name]))
                assert np.array_equal(a, b), (name, end)
    assert len(np.unique(first["surface"].low)) > 2


@given(st.integers(0, 2**24 - 1))
def test_what_single_precision_computes_exactly_stays_a_point(n):
    """2 u - 1 of a random number u = n / 2^24 is exact, fused or not, and so is the sign that it decides."""
    program = trace(lambda u: {"a": 2.0 * u - 1.0}, {"u": Type()})
    found = evaluate(program, {"u": np.float64(n / 2**24)})["a"]
    assert found.low == found.high == 2.0 * (n / 2**24) - 1.0
