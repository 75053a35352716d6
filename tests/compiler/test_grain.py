"""Exact programs hold no denormal number: the rules, what they refuse, every value of programs that pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import grain, sine
from wamnet.compiler.core.grain import READ, SINE, Size
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import LEAST, Gather, Image, Type
from wamnet.compiler.core.ops import OPS
from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.profiles import EXACT_SINE, PROFILES
from wamnet.compiler.core.trace import trace
from wamnet.compiler.plan import analysed
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Window
from wamnet.refimpl.network.denoise import denoise_pixel

NORMAL = np.float32(2.0**-126)
FLOATS = st.floats(allow_nan=False, allow_infinity=False, width=32)


def gathered(function, channels=4):
    """Trace a function of a window of one pixel with values in [-2, 2]."""
    gather = Gather(Window(1, "clamp"), (Image("a", channels, -2.0, 2.0),))
    return trace(function, {"window": Type(shape=(channels,))}, gather)


def every_value(program, window):
    """Return the float values of all nodes of an exact program, before zeros are written as +0."""
    ends = tuple((f"v{i}", i) for i, node in enumerate(program.nodes) if node.type.dtype == "float32")
    return interpret(replace(program, outputs=ends), {"window": window})


def hard(shape, seed):
    """Return numbers of all magnitudes, zeros, denormals, and neighbours of the threshold."""
    random = np.random.default_rng(seed)
    values = np.ldexp(random.uniform(-2, 2, shape), random.integers(-149, 1, shape)).astype(np.float32)
    edges = np.float32(
        [0.0, -0.0, LEAST, -LEAST, np.nextafter(np.float32(LEAST), np.float32(0)), 1e-45, -1e-40]
    )
    return np.where(random.random(shape) < 0.3, random.choice(edges, shape), values).astype(np.float32)


def normal(values):
    """Return whether no number (...) is denormal."""
    return bool(((values == 0) | (np.abs(values) >= NORMAL)).all())


# ---- sizes -------------------------------------------------------------------------------------------


@given(values=st.lists(FLOATS, min_size=1, max_size=5))
@example(values=[6.0])
@example(values=[0.0])
@example(values=[1e-45, 3.0])
def test_size_of_numbers_holds_them(values):
    size = Size.of(np.float32(values))
    for value in map(float, np.float32(values)):
        if value:
            assert abs(value) >= 2.0**size.least
            assert (value * 2.0 ** -(size.grain + 160) * 2.0**160) % 1 == 0
        else:
            assert size.least >= -149


def test_size_of_zeros_is_infinite():
    assert Size.of(np.zeros(3)) == Size(np.inf, np.inf)


@given(a=FLOATS, b=FLOATS)
@example(a=1.0000001, b=-1.0)
def test_rules_of_products_and_sums_hold(a, b):
    """Where the rule promises a normal product or sum, it has the promised size."""
    sizes = [Size.of(a), Size.of(b)]
    with np.errstate(all="ignore"):
        product, total = float(np.float32(a) * np.float32(b)), float(np.float32(a) + np.float32(b))
    least = sizes[0].least + sizes[1].least
    if np.isfinite(product) and least >= -126 and product:
        found = grain._product(*sizes)
        assert abs(product) >= 2.0**found.least
        assert np.ldexp(product, int(-found.grain)) % 1 == 0
    multiple = min(s.grain for s in sizes)
    if np.isfinite(total) and total:
        assert np.ldexp(total, int(-multiple)) % 1 == 0


# ---- whole programs ----------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1.0, 1e-9, 2.0**-38])
def test_no_value_of_a_network_is_denormal(scale):
    """Weights, biases and pixels of all magnitudes; also the values inside the emitted sine."""
    drawn = siren.init([12, 8, 8, 3], 3.0, 30.0, seed=1, dtype=np.float32)
    weights = tuple((w * scale + hard(w.shape, 2) * 1e-3).astype(np.float32) for w in drawn.weights)
    biases = tuple(hard(b.shape, 3) * np.float32(scale) for b in drawn.biases)
    network = replace(drawn, weights=weights, biases=biases)
    program = analysed(gathered(lambda x: denoise_pixel(network, x), 12), "exact")
    emitted = pipeline.run(program, PROFILES["exact"].passes)
    values = every_value(emitted, hard((2000, 12), 4))
    assert len(values) > 50
    assert all(normal(value) for value in values.values())


def test_values_have_the_size_that_their_rules_say():
    """Affine maps, sums that cancel, products, selections."""

    def function(x):
        y = np.matmul(x, hard((5, 4), 5).T)
        z = np.minimum(y - y[..., 1][..., None], np.absolute(y * 0.3))
        return np.where(z < 0.5, np.stack([y[..., 0]] * 5, axis=-1), np.floor(z))

    program = analysed(gathered(function), "exact")
    values = every_value(program, hard((5000, 4), 6))
    for index, size in enumerate(grain.sizes(program)):
        if f"v{index}" in values:
            found = np.abs(values[f"v{index}"].astype(np.float64))
            assert (found[found > 0] >= 2.0**size.least).all(), program.nodes[index]
            assert (np.ldexp(found, int(min(-size.grain, 200))) % 1 == 0).all(), program.nodes[index]


def test_exact_sine_has_the_size_and_the_error_that_are_stated():
    """All powers of two, neighbours of multiples of pi / 2 (their rounding), zeros of both signs."""
    k = np.arange(-8148, 8149) * (np.pi / 2)
    near = [np.nextafter(k.astype(np.float32), np.float32(side)) for side in (-np.inf, np.inf)]
    powers = 2.0 ** np.arange(grain.SINE_ARGUMENT, 13)
    x = np.concatenate([*near, k.astype(np.float32), powers, -powers, [0.0, -0.0]]).astype(np.float32)
    x = x[(np.abs(x) <= sine.DOMAIN) & ((x == 0) | (np.abs(x) >= 2.0**grain.SINE_ARGUMENT))]
    program = pipeline.run(
        replace(trace(lambda v: np.sin(v), {"window": Type()}), exact=True), PROFILES["exact"].passes
    )
    values = list(every_value(replace(program, gather=None), x).values())
    assert all(normal(value) for value in values[1:])
    found = np.abs(sine.exact_sine(x))
    assert (found[found > 0] >= 2.0**SINE.least).all()
    error = np.abs(sine.exact_sine(x) - np.sin(x.astype(np.float64)))
    assert error.max() + 2.0**-50 <= EXACT_SINE.error


def test_weights_below_the_threshold_become_zero():
    drawn = np.float32([[1.0, LEAST, LEAST * 0.999, -1e-45]])
    program = analysed(gathered(lambda x: np.matmul(x, drawn.T)), "exact")
    assert program.exact
    assert np.array_equal(program.parameters["W0"], [[1.0, LEAST, 0.0, 0.0]])
    assert READ.least == np.log2(LEAST)


def test_rules_are_of_operations_that_exist():
    assert set(grain.RULES) <= set(OPS)
    assert all(OPS[op].rounding in ("exact", "nearest", "dot", "sine") for op in grain.RULES)


# ---- refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (
            lambda x: x * 2.0**-87,
            r"multiply \(%2\) may have products as small as 2\^-127, which targets flush",
        ),
        (lambda x: x * x * x * x, r"multiply \(%\d\) may have products as small as 2\^-160"),
        (lambda x: x * 2.0**-70 + 1.0, r"add \(%\d\) may have sums as small as 2\^-133"),
        (
            lambda x: np.sin(x * 2.0**-86),
            r"sin \(%\d\) may have quotients of an argument and pi as small as 2\^-128",
        ),
        (lambda x: np.maximum(x, 1e-40), r"constant \(%\d\) may have a value as small as 2\^-133"),
        (
            lambda x: np.matmul(
                np.matmul(x, np.float32([[1, 2, 3, 1e-7]] * 3).T), np.float32([[LEAST] * 3]).T
            ),
            r"affine \(%2\) may have products as small as 2\^-127",
        ),
        (lambda x: x / 3.0, r"divide \(%2\) need not have the same bits on all targets: profile exact holds"),
        (lambda x: np.sqrt(np.absolute(x)), r"sqrt \(%2\) need not .* use profile ieee"),
        (lambda x: x.astype(np.int32).astype(np.float32), r"convert \(%1\) need not"),
    ],
)
def test_what_need_not_have_the_same_bits_is_refused(function, message):
    with pytest.raises(CompileError, match=message):
        compile_program(gathered(function), "opencl", "exact")


def test_edges_of_the_refusals_are_held():
    for function in (lambda x: x * 2.0**-86, lambda x: x * 2.0**-63 + 1.0, lambda x: np.sin(x * 2.0**-84)):
        assert compile_program(gathered(function), "opencl", "exact").program.exact
