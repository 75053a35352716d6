"""Sharper bounds: rounding of sums in parts, sensitivities and scaled norms, against what happens."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.compiler.core import sums
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.profiles import EMITTED_SINE
from wamnet.compiler.core.trace import trace
from wamnet.compiler.plan import analysed
from wamnet.compiler.proof import adjoint, bounds, scaled
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.activation import ACTIVATIONS
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

U = 2.0**-24


def tree_sum(terms, random, shape):
    """Add float32 numbers up in a tree: "chain" by magnitude, largest first, or any two at a time."""
    numbers = sorted(terms, key=abs, reverse=True) if shape == "chain" else list(terms)
    while len(numbers) > 1:
        i, j = (0, 1) if shape == "chain" else random.choice(len(numbers), 2, replace=False)
        added = np.float32(numbers[i]) + np.float32(numbers[j])
        numbers = [added, *(n for k, n in enumerate(numbers) if k not in (i, j))]
    return numbers[0]


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 30), shape=st.sampled_from(["chain", "any"]))
def test_any_tree_of_a_part_is_within_the_bound(seed, n, shape):
    """Terms of one sign too, at points and at magnitudes that differ by far."""
    random = np.random.default_rng(seed)
    weight = (random.normal(size=(1, n)) * 10.0 ** random.integers(-3, 3)).astype(np.float32)
    x = random.uniform(random.choice([-1, 0]), 1, n).astype(np.float32)
    bias = random.normal(size=1).astype(np.float32)
    found = tree_sum([*(weight[0] * x), bias[0]], random, shape)
    exact = sum(Fraction(float(a)) * Fraction(float(b)) for a, b in zip(weight[0], x, strict=True))
    wide, b, point = weight.astype(np.float64), bias.astype(np.float64), x.astype(np.float64)
    (bound,) = sums.rounding(wide, b, point, point, [np.arange(n)])
    assert abs(Fraction(float(found)) - exact - Fraction(float(b[0]))) <= Fraction(float(bound)) * (
        1 + 2**-20
    )


@given(seed=st.integers(0, 2**32 - 1))
def test_partial_sums_in_any_order_are_within_the_bound(seed):
    random = np.random.default_rng(seed)
    gather = Gather(Window(3, "clamp"), (Image("a", 2, -1.0, 1.0), Image("b", 1, 0.0, 1.0)))
    blocks = sums.parts(gather, gather.n_inputs)
    assert sorted(np.concatenate(blocks)) == list(range(27))
    assert [len(block) for block in blocks] == [6, 6, 6, 3, 3, 3]
    weight = random.normal(size=(1, 27)).astype(np.float32)
    x = random.uniform(-1, 1, 27).astype(np.float32)
    bias = random.normal(size=1).astype(np.float32)
    parts = [tree_sum(weight[0, block] * x[block], random, "any") for block in blocks]
    found = tree_sum([*parts, bias[0]], random, "any")
    exact = sum(Fraction(float(a)) * Fraction(float(b)) for a, b in zip(weight[0], x, strict=True))
    wide, b, point = weight.astype(np.float64), bias.astype(np.float64), x.astype(np.float64)
    (bound,) = sums.rounding(wide, b, point, point, blocks)
    assert abs(Fraction(float(found)) - exact - Fraction(float(b[0]))) <= Fraction(float(bound)) * (
        1 + 2**-20
    )
    (lanes,) = sums.rounding(wide, b, point[None], point[None], blocks)
    assert abs(lanes[0] - bound) <= 2.0**-40 * bound  # float64 adds in another order


def test_a_long_chain_of_equal_terms_comes_near_the_bound():
    """1 + u + u + ...: each addition rounds to even, down to 1; all errors have one sign."""
    n = 1000
    terms = np.full((1, n), U, np.float64)
    terms[0, 0] = 1.0
    found = tree_sum(terms[0].astype(np.float32), None, "chain")
    off = abs(float(found) - terms.sum())
    (bound,) = sums.rounding(terms, np.zeros(1), np.ones(n), np.ones(n), [np.arange(n)])
    assert 0.9 * bound <= off <= bound


def test_many_terms_count_as_large_as_their_sum():
    """Beyond `MOST_SORTED` terms of each of many pixels the bound is larger, and still below gamma(n)."""
    random = np.random.default_rng(2)
    weight, x = random.normal(size=(8, 64)), random.uniform(-1, 1, (400, 64))
    assert sums.MOST_SORTED < 8 * 64
    large = sums.rounding(weight, np.zeros(8), x, x, [np.arange(64)])
    small = sums.rounding(weight, np.zeros(8), x[0], x[0], [np.arange(64)])
    assert (small < large[0]).all()
    assert (large <= sums.gamma(66) * (np.abs(x) @ np.abs(weight).T)).all()


def test_a_bias_and_two_partial_sums_are_two_additions():
    """1 + u + u, a little less each: both additions round down to 1."""
    almost = np.float32(0.999 * U)
    x, count = np.full((1, 2), almost, np.float64), sums.MOST_SORTED
    off = 2 * float(almost) - float(np.float32(1) + almost + almost - np.float32(1))
    bound = sums.rounding(np.ones((count, 2)), np.ones(count), x, x, [np.array([0]), np.array([1])])
    assert off > 1.9 * U
    assert (bound >= off).all()


def network(seed, widths, omega_0, scale, activation="sine"):
    found = siren.init(widths, omega_0, omega_0, seed, activation=activation)
    weights = tuple((w * np.float32(scale)).astype(np.float32) for w in found.weights)
    return Model(
        replace(found, weights=weights),
        ("color", "normal"),
        Window(2, "clamp"),
        Normalization(),
    )


@settings(max_examples=settings.default.max_examples // 4)
@given(
    seed=st.integers(0, 2**31 - 1),
    omega_0=st.sampled_from([1.0, 3.0, 10.0, 30.0]),
    scale=st.sampled_from([1e-20, 0.1, 1.0, 4.0]),
    activation=st.sampled_from(sorted(ACTIVATIONS)),
)
def test_float32_is_within_both_bounds(seed, omega_0, scale, activation):
    """Random networks, tiny and large weights, inputs at the ends of their ranges (a firefly is 1)."""
    model = network(seed, (24, 7, 6, 5, 3), omega_0, scale, activation)
    program = analysed(lower(model))
    random = np.random.default_rng(seed)
    low, high = bounds.window_box(program.gather)
    x = random.uniform(low, high, (50, 24))
    x[:20] = np.where(random.random((20, 24)) < 0.5, low, high)
    x = x.astype(np.float32)
    (everywhere,) = bounds.over_box(program, {"window": (low, high)}, EMITTED_SINE).values()
    (here,) = bounds.at_inputs(program, {"window": x}, EMITTED_SINE).values()
    (exact,) = interpret(program, {"window": x}, np.float64).values()
    emitted = program_with_emitted_sines(program)
    (found,) = interpret(emitted, {"window": x}, np.float32).values()
    off = np.abs(found.astype(np.float64) - exact)
    assert (off <= here).all()
    assert (off <= everywhere).all()
    assert (here <= everywhere * (1 + 2.0**-10)).all()


def program_with_emitted_sines(program):
    from wamnet.compiler.core.passes import pipeline
    from wamnet.compiler.core.profiles import PROFILES

    return pipeline.run(program, PROFILES["ieee"].passes)


def test_the_sharper_bounds_are_far_below_the_forward_one():
    """Four sine layers of 32: what adds magnitudes is off by factors, over boxes and at inputs."""
    model = network(3, (24, 32, 32, 32, 32, 3), 3.0, 1.0)
    program = analysed(lower(model))
    box = bounds.window_box(program.gather)
    output = program.outputs[0][1]
    found = bounds.enclose(program, {"window": box}, EMITTED_SINE)
    assert scaled.output_error(program, found, output).max() < 0.3 * found[output].error.max()
    x = np.random.default_rng(1).uniform(*box, (20, 24))
    found = bounds.enclose(program, {"window": (x, x)}, EMITTED_SINE)
    assert adjoint.output_error(program, found, output).max() < 0.1 * found[output].error.max()
    assert scaled.output_error(program, found, output) is None


@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_sensitivities_of_all_operations(data, seed):
    """Errors put into the constants of a program with every rule of slopes: no output moves by more."""
    random = np.random.default_rng(seed)
    weight = random.normal(size=(3, 3)).astype(np.float32)

    def function(x):
        y = np.sin(x @ weight.T) * x - np.absolute(x) * x[..., 0][..., None]
        z = np.stack([y[..., 2], -y[..., 0], np.maximum(y[..., 1], x[..., 1])], axis=-1)
        return np.minimum(z * z, y + 0.1)

    program = trace(function, {"x": Type(shape=(3,))})
    x = random.uniform(-2, 2, (9, 3)).astype(np.float32)
    off = 10.0 ** data.draw(st.integers(-6, -1))
    moved = (x + off * random.uniform(-1, 1, x.shape)).astype(np.float32)
    start = bounds.Enclosure(x.astype(np.float64), x.astype(np.float64), np.full(x.shape, off * (1 + 1e-5)))
    found = bounds.enclose(program, {}, EMITTED_SINE, known={0: start})
    (error,) = bounds.output_errors(program, found).values()
    (exact,) = interpret(program, {"x": x}, np.float64).values()
    (other,) = interpret(program, {"x": moved}, np.float64).values()
    assert (np.abs(other - exact) <= error).all()
    sharp = adjoint.output_error(program, found, program.outputs[0][1])
    assert (np.abs(other - exact) <= sharp).all()
