"""The rules of error bounds, one by one, against exact rational arithmetic; then whole programs."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.compiler.core import intervals, ops
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.profiles import EMITTED_COSINE, EMITTED_SINE, SineContract
from wamnet.compiler.core.sine import COSINE_DOMAIN, cosine
from wamnet.compiler.core.trace import trace
from wamnet.compiler.proof import bounds
from wamnet.refimpl.network.window import Window

floats = st.floats(-100, 100, width=32)
shifts = st.integers(-(2**20), 2**20).map(lambda n: n / 2**20)

EXACT = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negative": lambda a: -a,
    "absolute": abs,
    "minimum": min,
    "maximum": max,
    "floor": lambda a: Fraction(a.__floor__()),
}
"""The operations on rationals."""


def enclosed(op, operands, context=EMITTED_SINE):
    """Return the rule's enclosure for operands that are enclosures of numbers."""
    inputs = {f"x{i}": Type() for i in range(len(operands))}
    program = trace(lambda *x: getattr(np, op)(*x), inputs)
    node = program.nodes[-1]
    return bounds.RULES[op](bounds.Context(node, {}, context), operands)


def around(value, error):
    return bounds.Enclosure(np.float64(value), np.float64(value), np.float64(error))


@pytest.mark.parametrize("op", EXACT)
@given(data=st.data())
def test_rule_bounds_the_rounded_operation_on_shifted_operands(op, data):
    """Reference: the operation on a, b, exactly. Kernel: float32, on operands off by up to their errors."""
    count = ops.OPS[op].arity
    kernel = [np.float32(data.draw(floats)) for _ in range(count)]
    errors = [np.float64(abs(data.draw(shifts))) * 0.01 for _ in range(count)]
    reference = [float(k) + e * data.draw(shifts) for k, e in zip(kernel, errors, strict=True)]
    found = enclosed(op, [around(r, e) for r, e in zip(reference, errors, strict=True)])
    if not np.isfinite(found.error):
        assert op == "divide"
        return
    with np.errstate(under="ignore"):
        computed = getattr(np, op)(*kernel)
    wanted = EXACT[op](*map(Fraction, reference))
    slack = 1 + Fraction(bounds.OUTWARD)
    assert abs(Fraction(float(computed)) - wanted) <= Fraction(float(found.error)) * slack
    assert Fraction(float(found.low)) - Fraction(2**-40) * abs(wanted) <= wanted
    assert wanted <= Fraction(float(found.high)) + Fraction(2**-40) * abs(wanted)


@given(x=st.floats(2.0**-10, 100, width=32), shift=shifts)
def test_sqrt(x, shift):
    """Reference sqrt(a), a within 2^-20 of x, in float64: its 2^-53 is far below the bound's 2^-24."""
    kernel, error = np.float32(x), 2.0**-20
    found = enclosed("sqrt", [around(float(kernel) + shift * error, error)])
    assert abs(float(np.sqrt(kernel)) - np.sqrt(float(kernel) + shift * error)) <= found.error


def powered(base, exponent):
    """Return the rule's enclosure of a power."""
    node = trace(lambda x: x**0.5, {"x": Type()}).nodes[-1]
    return bounds.RULES["power"](bounds.Context(node, {}, EMITTED_SINE), [base, exponent])


@given(
    x=st.floats(2.0**-8, 100, width=32), y=st.floats(0.125, 3), shift=shifts, sign=st.sampled_from([-1, 1])
)
def test_power_bounds_what_every_standard_allows(x, y, shift, sign):
    """exp2(y log2(x)), each with the error that GLSL 4.60 allows it, to one side and to the other."""
    error = 2.0**-12
    found = powered(around(x + shift * error, error), around(y, 0.0))
    wanted = (x + shift * error) ** y
    logarithm = np.log2(x) + sign * (2.0**-21 if 0.5 <= x <= 2 else 3 * 2.0**-23 * abs(np.log2(x)))
    product = y * logarithm * (1 + sign * np.sign(logarithm) * 2.0**-24)
    assert abs(2**product * (1 + sign * (3 + 2 * abs(product)) * 2.0**-23) - wanted) <= found.error


@given(x=st.floats(-100, 20, width=32), shift=shifts, ulps=st.floats(-1, 1))
def test_exp_bounds_what_every_standard_allows(x, shift, ulps):
    """An argument off by up to 2^-12, and 3 + 2 |x| ulp of the result, to one side and to the other."""
    error = 2.0**-12
    found = enclosed("exp", [around(x + shift * error, error)])
    wanted = np.exp(x + shift * error)
    assert abs(np.exp(x) * (1 + ulps * (3 + 2 * abs(x)) * 2.0**-23) - wanted) <= found.error
    assert found.error <= wanted * (1.1 * error + 2 * (5 + 2 * abs(x)) * 2.0**-24) + 2 * bounds.FLUSH


def test_exp_far_below_zero_is_known_to_be_nothing():
    """An argument of -1e30 may be off by more than float64's exponential holds."""
    assert enclosed("exp", [around(-1e30, 1e24)]).error <= 2 * bounds.FLUSH
    assert enclosed("exp", [around(1e3, 0.0)]).error == np.inf


@given(x=st.floats(0.25, 4), y=st.floats(0.125, 3), at=st.floats(0, 1))
def test_power_of_a_range(x, y, at):
    """From x to 2 x and y to y + 1; 2^-40 of float64's rounding is added to every range (PRO-9)."""
    base, exponent = ([a, b, 0.0] for a, b in ((x, 2 * x), (y, y + 1)))
    found = powered(bounds.Enclosure(*map(np.float64, base)), bounds.Enclosure(*map(np.float64, exponent)))
    value = (x + at * x) ** (y + at)
    assert found.low * (1 - 2.0**-40) <= value <= found.high * (1 + 2.0**-40)


def test_power_of_an_exact_number_has_its_own_error_alone():
    """0.5^(1/2.4): 2^-21 / 2.4 + 2^-24 / 2.4 in the exponent, times ln 2, and 3 + 2 / 2.4 ulp of 2^-23."""
    found, value = powered(around(0.5, 0.0), around(1 / 2.4, 0.0)), 0.5 ** (1 / 2.4)
    own = (2.0**-21 + 2.0**-24) / 2.4 * np.log(2) + (3 + 2 / 2.4) * 2.0**-23
    assert abs(found.error / value - own) <= 1e-5 * own


ends = st.sampled_from([-1.0, -0.5, 0.0, 1.0])
"""How much of its error a number is off by: the ends are what a rule must think of."""

DECISIONS = {
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "greater": lambda a, b: a > b,
    "greater_equal": lambda a, b: a >= b,
}
"""The comparisons that have a rule."""


@pytest.mark.parametrize("op", DECISIONS)
@given(
    a=st.integers(-3, 3),
    b=st.integers(-3, 3),
    errors=st.tuples(st.sampled_from([0.0, 0.5, 2.0]), st.sampled_from([0.0, 1.0])),
    at=st.tuples(ends, ends),
)
def test_decisions_that_are_sure_are_right_and_others_cost_the_distance(op, a, b, errors, at):
    """A selection between 10 and 3 by numbers that are off by their errors."""
    operands = [around(float(a), errors[0]), around(float(b), errors[1])]
    decided = enclosed(op, operands)
    compare = DECISIONS[op]
    reference = compare(a, b)
    kernel = compare(a + at[0] * errors[0], b + at[1] * errors[1])
    assert decided.low <= reference <= decided.high
    assert abs(float(kernel) - float(reference)) <= decided.error
    node = trace(lambda x: np.where(x > 0.0, x, -x), {"x": Type()}).nodes[-1]
    chosen = bounds.RULES["select"](
        bounds.Context(node, {}, EMITTED_SINE), [decided, around(10.0, 0.25), around(3.0, 0.125)]
    )
    values = {True: (10.0, 0.25), False: (3.0, 0.125)}
    assert chosen.low <= values[reference][0] <= chosen.high
    (seen, own), wanted = values[kernel], values[reference][0]
    assert abs(seen - wanted) + own <= chosen.error
    if abs(a - b) > errors[0] + errors[1]:
        assert chosen.error == values[reference][1]


@given(
    data=st.data(),
    n=st.integers(1, 40),
    m=st.integers(1, 5),
    seed=st.integers(0, 2**32 - 1),
    fused=st.booleans(),
)
def test_affine_in_any_order_with_and_without_fma(data, n, m, seed, fused):
    """Sum the D_in + 1 terms in a random order, rounding each product or not, against rationals."""
    random = np.random.default_rng(seed)
    weight = random.normal(size=(m, n)).astype(np.float32)
    x = random.normal(size=n).astype(np.float32) * np.float32(10.0 ** data.draw(st.integers(-3, 3)))
    program = trace(lambda v: np.matmul(v, weight.T), {"x": Type(shape=(n,))})
    named = bounds.at_inputs(program, {"x": x}, EMITTED_SINE)["color"]
    order = random.permutation(n)
    for row in range(m):
        total = np.float32(0)
        for i in order:
            product = Fraction(float(weight[row, i])) * Fraction(float(x[i]))
            if not fused:
                product = Fraction(float(weight[row, i] * x[i]))
            total = np.float32(float(product + Fraction(float(total))))
        exact = sum(Fraction(float(a)) * Fraction(float(b)) for a, b in zip(weight[row], x, strict=True))
        assert abs(Fraction(float(total)) - exact) <= Fraction(float(named[row]))


@pytest.mark.parametrize(
    ("low", "high", "wanted"),
    [
        (1.0, 2.0, (np.sin(1), 1)),
        (4.0, 5.0, (-1, np.sin(4))),
        (0.0, 7.0, (-1, 1)),
        (0.1, 0.2, np.sin([0.1, 0.2])),
    ],
)
def test_sine_range_is_tight(low, high, wanted):
    """The range is widened by 2^-40, no more."""
    found = intervals.sine((np.float64(low), np.float64(high)))
    assert np.max(np.abs(np.array(found) - wanted)) <= 2.0**-39


@given(x=st.floats(-1000, 1000), error=st.floats(0, 0.5), shift=shifts)
def test_sine_rule(x, error, shift):
    found = enclosed("sin", [around(x, error)])
    computed = np.sin(x + error * shift)
    assert abs(computed - np.sin(x)) + EMITTED_SINE.error <= found.error * (1 + bounds.OUTWARD)


NATIVE = SineContract("any argument", 1e-6)


@pytest.mark.parametrize(
    ("op", "operands", "sine", "finite"),
    [
        ("sqrt", [(1e-9, 1e-8)], EMITTED_SINE, False), ("sqrt", [(0.0, 0.0)], EMITTED_SINE, True),
        ("power", [(1e-9, 1e-8), (0.5, 0.0)], EMITTED_SINE, False),
        ("power", [(0.0, 0.0), (0.5, 0.0)], EMITTED_SINE, False),
        ("power", [(1e-9, 0.0), (0.5, 0.0)], EMITTED_SINE, True),
        ("divide", [(1.0, 0.0), (1e-9, 1e-8)], EMITTED_SINE, False),
        ("divide", [(1.0, 0.0), (2.0**125, 0.0)], EMITTED_SINE, True),
        ("divide", [(1.0, 0.0), (2.0**126, 0.0)], EMITTED_SINE, True),
        ("divide", [(1.0, 0.0), (2.0**126 * (1 + 2.0**-20), 0.0)], EMITTED_SINE, False),
        ("sin", [(20000.0, 0.0)], EMITTED_SINE, False), ("sin", [(1.0, np.inf)], NATIVE, False),
        ("sin", [(1.0, 0.0)], SineContract("none", None), False), ("sin", [(1e30, 0.0)], NATIVE, True),
    ],
)  # fmt: skip
def test_what_has_a_bound(op, operands, sine, finite):
    """Roots of what is not negative, powers of what is positive, divisors and sines up to a promise."""
    given = [around(*operand) for operand in operands]
    found = powered(*given) if op == "power" else enclosed(op, given, sine)
    assert np.isfinite(found.error) == finite


def test_no_bound_stays_no_bound_beside_a_weight_of_zero():
    program = trace(lambda x: np.matmul(np.sin(x), np.zeros((1, 2), np.float32).T), {"x": Type(shape=(2,))})
    assert bounds.at_inputs(program, {"x": np.zeros(2)}, SineContract("none", None))["color"] == np.inf


# ---- overflow: the programs on which a kernel gave NaN or an infinity beside a finite bound ---------------


@pytest.mark.parametrize(
    "function",
    [
        lambda x: ((x * 1e30) * 1e30) * 1e-30 * 1e-30,
        lambda x: np.sin((x * 1e30) * 1e30),
        lambda x: np.minimum((x * 1e30) * 1e30 * 1e-38, 5.0),
        lambda x: x * 3e38 + 3e38,
        lambda x: x * 1e3 / 1e-36,
    ],
)
def test_what_may_overflow_on_the_way_has_no_bound(function):
    program = trace(function, {"x": Type()})
    assert bounds.over_box(program, {"x": (-1.0, 1.0)}, NATIVE)["color"] == np.inf
    assert bounds.at_inputs(program, {"x": 1.0}, NATIVE)["color"] == np.inf


def test_a_sum_that_may_overflow_in_some_order_has_no_bound():
    """The whole sum is 2 x 3e38, too much for a partial sum, although its value is -3e38."""
    weight = np.array([[3e38, 3e38, -3e38, -3e38, -3e38]], np.float32)
    program = trace(lambda x: np.matmul(x, weight.T), {"x": Type(shape=(5,))})
    assert bounds.at_inputs(program, {"x": np.ones(5)}, EMITTED_SINE)["color"] == np.inf
    assert np.isfinite(bounds.at_inputs(program, {"x": np.full(5, 0.1)}, EMITTED_SINE)["color"])


def test_the_largest_numbers_that_fit_have_a_bound():
    largest = float(np.finfo(np.float32).max)
    for value, finite in ((largest * (1 - 2.0**-10), True), (largest, False)):
        found = enclosed("add", [around(value, 0.0), around(0.0, 0.0)])
        assert np.isfinite(found.error) == finite
        assert found.overflows != finite


@pytest.mark.parametrize(
    ("low", "high"), [(1653565164735162.0, 1653565164735165.0), (1e17, 1e17 + 16), (-np.inf, np.inf)]
)
def test_sine_range_does_not_trust_float64_with_many_turns(low, high):
    """The first range holds a crest that float64 does not find: it gave 0.9993."""
    assert intervals.sine((np.float64(low), np.float64(high))) == (-1, 1)


def test_range_of_a_long_sum_is_wide_enough():
    """2^16 equal terms lose up to n 2^-53 in float64: the exact sum still lies in the range."""
    n = 2**16
    weight = np.full((1, n), 0.1, np.float32)
    program = trace(lambda x: np.matmul(x, weight.T), {"x": Type(shape=(n,))})
    found = bounds.enclose(program, {"x": (np.full(n, 0.1), np.full(n, 0.1))}, EMITTED_SINE)[-1]
    assert found.high[0] - found.low[0] >= 2 * n * 2.0**-52 * 0.01 * n * 0.9


def test_constant_that_float32_does_not_hold():
    program = trace(lambda x: x * 0.1, {"x": Type()})
    found = bounds.enclose(program, {"x": (1.0, 1.0)}, EMITTED_SINE)
    index = next(i for i, node in enumerate(program.nodes) if node.op == "constant")
    assert abs(float(np.float32(0.1)) - 0.1) <= found[index].error


@given(seed=st.integers(0, 2**32 - 1))
def test_box_holds_what_happens_inside(seed):
    """Ranges and errors over a box are at least those at any point of it."""
    random = np.random.default_rng(seed)
    weight = random.normal(size=(3, 4)).astype(np.float32)

    def function(x):
        y = np.sin(np.matmul(x, weight.T) * 2.5)
        z = np.minimum(np.absolute(y), 0.5) - y * y[..., 1][..., None]
        return np.stack([z[..., 0], np.maximum(z[..., 2], y[..., 0]) / 3.0], axis=-1)

    program = trace(function, {"x": Type(shape=(4,))})
    low = random.uniform(-2, 0, 4)
    high = low + random.uniform(0, 2, 4)
    x = (low + (high - low) * random.uniform(0, 1, (20, 4))).astype(np.float32).clip(low, high)
    box = bounds.enclose(program, {"x": (low, high)}, EMITTED_SINE)
    points = bounds.enclose(program, {"x": (x, x)}, EMITTED_SINE)
    for over, at in zip(box, points, strict=True):
        assert np.all(over.low <= at.low)
        assert np.all(at.high <= over.high)
        assert np.all(at.error <= over.error)
    (value,) = interpret(program, {"x": x}, np.float64).values()
    assert np.all(box[-1].low <= value)
    assert np.all(value <= box[-1].high)


def test_minimum_forgets_an_operand_that_is_never_chosen():
    found = enclosed("minimum", [around(0.0, 1e-3), around(1.0, 0.5)])
    assert found.error == 1e-3


def test_window_box_has_a_range_for_each_channel_and_zero_outside():
    images = (Image("a", 2, 1.0, 2.0), Image("b", 1, -3.0, -1.0))
    low, high = bounds.window_box(Gather(Window(2, "clamp"), images))
    assert low.tolist() == [1, 1, -3] * 4
    assert high.tolist() == [2, 2, -1] * 4
    low, high = bounds.window_box(Gather(Window(2, "zero"), images))
    assert low.tolist() == [0, 0, -3] * 4
    assert high.tolist() == [2, 2, 0] * 4


def test_every_operation_but_inputs_has_a_rule():
    assert set(bounds.RULES) == set(ops.OPS) - {"input"}


@given(
    a=st.floats(-6400, 6400, width=32), width=st.floats(0, 4), shift=st.floats(-1, 1), error=st.floats(0, 0.1)
)
def test_a_cosine_with_a_contract_has_a_bound(a, width, shift, error):
    """The range holds the cosine; the error the emitted cosine of a number that is off by up to `error`."""
    program = trace(np.cos, {"x": Type()})
    context = bounds.Context(program.nodes[-1], {}, EMITTED_SINE, EMITTED_COSINE)
    exact, kernels = np.float64(a), np.float32(a + shift * error)
    off = np.abs(kernels.astype(np.float64) - exact)
    box = bounds.Enclosure(exact - width / 2, exact + width / 2, off)
    found = bounds.RULES["cos"](context, [box])
    assert found.low <= np.cos(exact) <= found.high
    if abs(a) + width / 2 + off > COSINE_DOMAIN:
        assert found.error == np.inf
        return
    if abs(a) + width / 2 + off <= COSINE_DOMAIN - 2:
        assert abs(np.float64(cosine(kernels)) - np.cos(exact)) <= found.error
        # A slope of at most 1 passes `off` on; the contract's own error comes once, flushing is far below it.
        assert found.error <= off + 2 * EMITTED_COSINE.error


def test_a_cosine_without_a_contract_has_none():
    program = trace(np.cos, {"x": Type()})
    assert bounds.at_inputs(program, {"x": 1.0}, EMITTED_SINE)["color"] == np.inf
