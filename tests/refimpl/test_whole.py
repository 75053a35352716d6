"""Integers: the sine at all arguments, sums against int64, rounding, what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network import siren, whole
from wamnet.refimpl.network.whole import SINES, TURN, Whole

SIZE = 3
"""Taps along a side of the window of the networks here."""


def network(amplitude: int = 127, omegas: tuple[float, float] = (1.0, 5.0), seed: int = 3) -> Whole:
    """Return a small network of integers: two channels, two hidden layers."""
    return whole.rounded(siren.init((SIZE * SIZE * 2, 8, 8, 3), *omegas, seed=seed), SIZE, amplitude)


def inputs(count: int, seed: int = 1) -> np.ndarray:
    """Return whole inputs (count, D_in), the ends of the range among them."""
    drawn = np.random.default_rng(seed).integers(-127, 128, (count, SIZE * SIZE * 2))
    drawn[0], drawn[1] = 127, -127
    return drawn.astype(np.float32)


# ---- the sine ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("amplitude", SINES)
def test_the_sine_is_as_near_as_it_says(amplitude) -> None:
    """All 65,536 values of m in both halves of a half-turn; m stands for the middle of 64 phases."""
    phases = (np.arange(TURN // 64, dtype=np.uint32) << 6) + 31
    exact = amplitude * np.sin(2 * np.pi * (phases + 0.5) / TURN)
    found = whole.whole_sine(phases, amplitude)
    # Half a step of the last rounding is not the polynomial's.
    assert np.abs(found - exact).max() <= 0.5 + SINES[amplitude].error
    assert found.max() == amplitude == -found.min()


@pytest.mark.parametrize("amplitude", SINES)
def test_products_of_the_sine_fit_into_words(amplitude) -> None:
    (c1, c3, c5), shift = SINES[amplitude].coefficients, SINES[amplitude].shift
    m = np.arange(2**16, dtype=np.uint64)
    z = (m * m) >> 16
    inner = c3 - ((z * c5) >> 16)
    q = c1 - ((z * inner) >> 16)
    for product in (m * m, z * c5, z * inner):
        assert product.max() < 2**32
    assert (m * q + (1 << (shift - 1))).max() < 2**31
    assert q.min() > 0


# ---- sums and phases --------------------------------------------------------------------------------------


@pytest.mark.parametrize("amplitude", SINES)
def test_floats_give_the_bits_of_integers(amplitude) -> None:
    """The same network in int64, written by itself, against float32 sums."""
    net, x = network(amplitude), inputs(64)
    numbers = x.astype(np.int64)
    for layer in range(2):
        sums = numbers @ net.weights[layer].astype(np.int64).T
        phases = (sums * net.factors[layer].astype(np.int64) + net.biases[layer].astype(np.int64)) % TURN
        numbers = whole.whole_sine(phases.astype(np.uint32), amplitude).astype(np.int64)
    units = (numbers @ net.weights[2].astype(np.int64).T) * net.factors[2].astype(np.int64)
    steps = np.clip(units + net.biases[2].astype(np.int64), 0, 2**16 << net.fraction) >> net.fraction
    assert np.array_equal(whole.forward_whole(net, x), (steps / 2**16).astype(np.float32))


def test_a_million_turns_are_no_turn() -> None:
    net, x = network(), inputs(16)
    sums = np.array([[2.0**24 - 1, -(2.0**24) + 1]], np.float32)
    factor, bias = np.array([TURN - 1.0, TURN - 1.0]), np.array([5.0, 5.0])
    exact = [(int(s) * (TURN - 1) + 5) % TURN for s in sums[0]]
    assert (whole.phase(sums, factor, bias)[0] % TURN).tolist() == exact
    wide = network(omegas=(1e6, 1e6))
    assert np.isfinite(whole.forward_whole(wide, x)).all()
    assert whole.forward_whole(net, x).dtype == np.float32


def test_black_and_saturated_inputs_and_rows_of_zeros() -> None:
    small = siren.init((SIZE * SIZE * 2, 8, 8, 3), 1.0, 5.0, seed=3)
    rows = [weight.copy() for weight in small.weights]
    rows[0][2] = 0.0
    rows[1][3] = 1e-42  # denormal
    rows[2][1] = 0.0
    net = whole.rounded(replace(small, weights=tuple(rows)), SIZE)
    assert not net.weights[0][2].any()
    assert not net.weights[1][3].any()
    assert net.factors[0][2] == 1.0
    for level in (0.0, 127.0, -127.0):
        found = whole.forward_whole(net, np.full((1, SIZE * SIZE * 2), level, np.float32))
        assert (found * 65536 == np.floor(found * 65536)).all()
        assert (found >= 0).all()
        assert (found <= 1).all()


# ---- rounding ---------------------------------------------------------------------------------------------


def exact_input(x: float) -> int:
    """Return what WHO-2 says, in rational numbers."""
    from fractions import Fraction

    return max(-127, min(127, math.floor(127 * Fraction(x) + Fraction(1, 2))))


@given(st.floats(-1.0, 1.0, width=32))
def test_inputs_are_rounded_as_real_numbers(x) -> None:
    assert whole.round_image(np.float32([x]))[0] == exact_input(x)


def test_inputs_at_all_ties_and_their_neighbours() -> None:
    ties = ((np.arange(-127, 127) + 0.5) / 127).astype(np.float32)
    near = [np.nextafter(ties, np.float32(end)) for end in (-2, 2)]
    for x in (ties, *near, np.float32([0.0, -0.0, 1e-45, -1e-45, 1.0, -1.0])):
        assert whole.round_image(x).tolist() == [exact_input(float(v)) for v in x]


@pytest.mark.parametrize("amplitude", SINES)
def test_a_rounded_network_is_near(amplitude) -> None:
    """A row's errors: half a unit a weight, two where they are passed on; then half a step a sine."""
    small = siren.init((SIZE * SIZE * 2, 8, 3), 1.0, 5.0, seed=3, dtype=np.float64)
    net, x = whole.rounded(small, SIZE, amplitude), inputs(200)
    value = siren.forward(small, x.astype(np.float64) / 127)
    first = 2 * np.pi / TURN * (2 * net.factors[0].astype(np.float64) * 127 * SIZE * SIZE * 2 + 0.5)
    moved = first + (0.5 + SINES[amplitude].error) / amplitude
    own = 2.0**-16 / 2**net.fraction * (net.factors[1].astype(np.float64) * amplitude * 8 / 2 + 0.5)
    bound = np.abs(small.weights[1]) @ moved + own + 2.0**-16
    error = np.abs(whole.forward_whole(net, x) - np.clip(value, 0, 1))
    assert (error <= bound).all()


def test_rounding_is_the_same_for_both_types() -> None:
    small = siren.init((SIZE * SIZE * 2, 8, 8, 3), 1.0, 5.0, seed=3)
    wide = replace(
        small,
        weights=tuple(w.astype(np.float64) for w in small.weights),
        biases=tuple(b.astype(np.float64) for b in small.biases),
    )
    for a, b in zip(whole.rounded(small, SIZE).weights, whole.rounded(wide, SIZE).weights, strict=True):
        assert np.array_equal(a, b)


# ---- what is refused --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "message"),
    [({"amplitude": 100}, "amplitude"), ({"fraction": 9}, "fraction"), ({"factors": ()}, "factors")],
)
def test_fields_that_mean_nothing_are_refused(changed, message) -> None:
    with pytest.raises(InputError, match=message):
        whole.check_whole(replace(network(), **changed))


@pytest.mark.parametrize(
    ("name", "layer", "value", "message"),
    [
        ("weights", 0, 0.5, "layer 0: weights"),
        ("weights", 1, 128.0, "layer 1: weights"),
        ("weights", 1, math.nan, "layer 1: weights"),
        ("biases", 0, -1.0, "layer 0: biases"),
        ("factors", 2, 2.0**24, "layer 2: factors"),
        ("factors", 2, 2.0**24 - 1, "largest colour"),
    ],
)
def test_numbers_that_are_not_whole_or_too_large_are_refused(name, layer, value, message) -> None:
    net = network()
    arrays = [array.copy() for array in getattr(net, name)]
    arrays[layer].flat[0] = value
    with pytest.raises(InputError, match=message):
        whole.check_whole(replace(net, **{name: tuple(arrays)}))


def test_sums_that_float32_does_not_hold_are_refused() -> None:
    wide = Whole(
        (np.full((1, 2000), 127.0, np.float32), np.ones((3, 1), np.float32)),
        (np.zeros(1, np.float32), np.zeros(3, np.float32)),
        1.0,
        1.0,
        factors=(np.ones(1, np.float32), np.ones(3, np.float32)),
    )
    with pytest.raises(InputError, match="layer 0: largest sum"):
        whole.check_whole(wide)


def test_networks_that_cannot_be_rounded_are_refused() -> None:
    small = siren.init((SIZE * SIZE * 2, 8, 3), 1.0, 5.0, seed=3)
    with pytest.raises(InputError, match="activation"):
        whole.rounded(replace(small, activation="relu"), SIZE)
    with pytest.raises(InputError, match="rounded already"):
        whole.rounded(whole.rounded(small, SIZE), SIZE)
    with pytest.raises(InputError, match="amplitude"):
        whole.rounded(small, SIZE, 128)
    with pytest.raises(InputError, match="widths"):
        whole.rounded(small, 5)
    huge = replace(small, weights=(small.weights[0], small.weights[1] * np.float32(1e9)))
    with pytest.raises(InputError, match="too large"):
        whole.rounded(huge, SIZE)


# ---- rounding on windows ----------------------------------------------------------------------------------


def windows_of(count: int, seed: int = 4) -> np.ndarray:
    """Return windows (count, D_in) in [-1, 1] whose taps have much in common, as those of pictures have."""
    random = np.random.default_rng(seed)
    common = random.uniform(-0.8, 0.8, (count, 1, 2))
    taps = common + random.uniform(-0.2, 0.2, (count, SIZE * SIZE, 2))
    return taps.reshape(count, -1).astype(np.float32)


def losses(net: Whole, small: siren.Siren, windows: np.ndarray) -> float:
    """Return the mean square by which colours are off; the wanted ones are kept inside of [0, 1]."""
    wanted = np.clip(siren.forward(small, windows.astype(np.float64)), 0, 1)
    return float(np.mean((whole.forward_whole(net, whole.round_image(windows)) - wanted) ** 2))


@pytest.mark.parametrize("amplitude", SINES)
def test_rounding_on_windows_is_nearer_on_others(amplitude) -> None:
    """Of ten networks the errors on windows that were not seen are less in sum, by a third at least.

    Sums over windows of pictures are nearer by construction; a third is left for what chance does to ten.
    """
    plain = on_windows = 0.0
    for seed in range(10):
        small = siren.init((SIZE * SIZE * 2, 16, 16, 3), 3.0, 10.0, seed=seed)
        # Colours in the middle of their range, so that no clip hides an error.
        small = replace(small, biases=(*small.biases[:-1], small.biases[-1] * 0 + np.float32(0.5)))
        plain += losses(whole.rounded(small, SIZE, amplitude), small, windows_of(500, 9))
        found = whole.rounded_on(small, windows_of(2000), SIZE, amplitude)
        whole.check_whole(found)
        on_windows += losses(found, small, windows_of(500, 9))
    assert on_windows <= plain * 2 / 3


def test_the_nearest_integers_are_no_worse_than_any_neighbours() -> None:
    """Two inputs, all integers around: nearest to real weights in the covariance's own measure.

    The nearest plane finds the best one where inputs have little in common; it is never farther than half a
    step of each plane: the squared error is at most the sum of R_ii^2 / 4.
    """
    random = np.random.default_rng(7)
    for common in (0.0, 0.5, 0.95):
        n = random.standard_normal((500, 2)) * 40
        n[:, 1] = common * n[:, 0] + (1 - common) * n[:, 1]
        weight = random.uniform(-5, 5, (6, 2))
        found = whole.nearest(weight, n @ weight.T + 3.0, n)
        apart = n - n.mean(axis=0)
        covariance = apart.T @ apart / len(n)
        covariance += whole.SPREAD * np.mean(np.diag(covariance)) * np.eye(2)
        root = np.linalg.cholesky(covariance)
        error = np.sum(((weight - found) @ root) ** 2, axis=1)
        # The trace is the sum of all R_ij^2.
        assert (error <= np.trace(covariance) / 4 + 1e-9).all()
        if common == 0.0:
            around = [found + np.array(d) for d in ((1, 0), (-1, 0), (0, 1), (0, -1))]
            others = [np.sum(((weight - q) @ root) ** 2, axis=1) for q in around]
            assert (error <= np.min(others, axis=0) + 1e-9).all()


def test_inputs_that_do_not_vary_and_rows_of_zeros() -> None:
    """Constant windows have no covariance; what is left is the rounding of each weight by itself."""
    small = siren.init((SIZE * SIZE * 2, 8, 8, 3), 1.0, 5.0, seed=3)
    first = small.weights[0].copy()
    first[2] = 0.0
    small = replace(small, weights=(first, *small.weights[1:]))
    flat = np.full((50, SIZE * SIZE * 2), 0.25, np.float32)
    net = whole.rounded_on(small, flat, SIZE)
    whole.check_whole(net)
    assert not net.weights[0][2].any()
    # One window: its colour is right up to a step of a colour and what the last sines round.
    assert (
        losses(net, small, flat[:1])
        <= (2.0**-16 + 2.0 / 127 * np.abs(small.weights[2]).sum(axis=1).max()) ** 2
    )
