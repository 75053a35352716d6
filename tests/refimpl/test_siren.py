"""The network: shapes, initial ranges, the sine convention, and gradients against differences."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.siren import Siren

U = 2.0**-53
"""Unit roundoff of float64."""

SIN_ULP = 2
"""Error of NumPy's float64 sine and cosine, in units in the last place: C libraries state less than 1; twice
that covers them all."""


def gamma(n: int) -> float:
    """Relative error of n operations in a chain (Higham, Accuracy and Stability, lemma 3.1)."""
    return n * U / (1 - n * U)


# ---- initialisation --------------------------------------------------------------------------------------


def test_initial_weights_fill_the_ranges_of_the_source() -> None:
    network = siren.init((864, 32, 32, 3), 30.0, 2.0, seed=5, dtype=np.float64)
    bounds = [1 / 864, math.sqrt(6 / 32) / 2, math.sqrt(6 / 32) / 2]
    for weight, bias, bound in zip(network.weights, network.biases, bounds, strict=True):
        assert np.abs(weight).max() <= bound
        assert np.abs(bias).max() <= 1 / math.sqrt(weight.shape[1])
        # n uniform draws all fall below (1 - q) of the range with probability (1 - q)**n = 1e-9.
        assert np.abs(weight).max() >= bound * 1e-9 ** (1 / weight.size)


def test_seeds_layers_and_kinds_draw_different_numbers() -> None:
    one, two = siren.init((4, 4, 4), 1.0, 1.0, seed=1), siren.init((4, 4, 4), 1.0, 1.0, seed=2)
    draws = [one.weights[0] * 4, one.weights[1] / math.sqrt(6 / 4), two.weights[0] * 4]
    draws += [np.tile(one.biases[0] * 2, (4, 1))]
    for index, first in enumerate(draws):
        for second in draws[:index]:
            assert not np.any(np.isclose(first, second, rtol=0, atol=2.0**-24))


def test_float32_is_float64_rounded_once() -> None:
    single, double = (siren.init((7, 5, 3), 3.0, 3.0, 4, dtype) for dtype in (np.float32, np.float64))
    for narrow, wide in zip(single.weights + single.biases, double.weights + double.biases, strict=True):
        assert narrow.dtype == np.float32
        assert np.array_equal(narrow, wide.astype(np.float32))
    assert single.widths == (7, 5, 3)


@pytest.mark.parametrize("widths", [(3,), (0, 3), (3, -1, 2), (3, 2.5, 1)])
def test_init_refuses_widths(widths: Any) -> None:
    with pytest.raises(InputError, match=r"widths .*must be two or more positive integers"):
        siren.init(widths, 1.0, 1.0, seed=0)


@pytest.mark.parametrize("omega_0", [0.0, -1.0, math.nan, math.inf])
def test_init_refuses_omegas(omega_0: float) -> None:
    with pytest.raises(InputError, match=r"omega_0_first .*: must be positive"):
        siren.init((2, 2), omega_0, 1.0, seed=0)
    with pytest.raises(InputError, match=r"omega_0_hidden .*: must be positive"):
        siren.init((2, 2), 1.0, omega_0, seed=0)


# ---- forward ---------------------------------------------------------------------------------------------


def test_forward_by_hand() -> None:
    """One neuron a layer: 3 sin(2 sin(5 (0.5 x + 0.1)) * ...) worked out with the math module.

    layer 0: sin(5 (0.5 * 0.4 + 0.1)) = sin 1.5; layer 1: sin(2 (0.25 sin 1.5 - 0.5)); last: 3 y + 1.
    """
    network = Siren(
        tuple(np.array([[w]]) for w in (0.5, 0.25, 3.0)),
        tuple(np.array([b]) for b in (0.1, -0.5, 1.0)),
        omega_0_first=5.0,
        omega_0_hidden=2.0,
    )
    expected = 3 * math.sin(2 * (0.25 * math.sin(5 * (0.5 * 0.4 + 0.1)) - 0.5)) + 1
    # Fewer than 16 roundings of numbers below 4.
    assert abs(siren.forward(network, np.array([0.4]))[0] - expected) <= 4 * gamma(16)


def test_forward_keeps_leading_axes_and_dtype() -> None:
    network = siren.init((4, 6, 3), 3.0, 3.0, seed=0)
    x = np.linspace(0, 1, 2 * 5 * 4, dtype=np.float32).reshape(2, 5, 4)
    y = siren.forward(network, x)
    assert y.shape == (2, 5, 3)
    assert y.dtype == np.float32
    flat, _ = siren.forward_cached(network, x.reshape(10, 4))
    assert np.array_equal(siren.forward(network, x.reshape(10, 4)), flat)


# ---- gradients -------------------------------------------------------------------------------------------

Jet = tuple[Any, ...]
"""Bounds for a quantity q(t) of |t| <= h: on |q|, |q'|, |q''|, |q'''|, on the rounding error of q, and on
what the rounded layer inputs and sine arguments change in q'."""


def majorant(network: Siren, moved: Siren, x: Any, dx: Any, weights: Any, h: float) -> Jet:
    """Bound F(t) = sum(weights * forward(network + t moved, x + t dx)) and its first three derivatives.

    Product rule for z = (W + t dW) x + b + t db, chain rule for sin(omega z), with every term replaced by its
    absolute value. `error` follows the roundings: those of the shifted W, b and x (one each), of the D_in + 1
    terms of the sum, of the factor omega, and of the sine. `slope` follows how these errors enter the
    products x dW and cos(angle) z' of the derivative.
    """
    x0, x1 = np.abs(x) + h * np.abs(dx), np.abs(dx)
    x2, x3, error, slope = np.zeros_like(x0), np.zeros_like(x0), U * x0, np.zeros_like(x0)
    last = len(network.weights) - 1
    for layer, weight in enumerate(network.weights):
        d_weight, d_bias = np.abs(moved.weights[layer]).T, np.abs(moved.biases[layer])
        w = np.abs(weight).T + h * d_weight
        b = np.abs(network.biases[layer]) + h * d_bias
        slope = slope @ w + error @ d_weight
        error = error @ w + gamma(len(w) + 3) * (x0 @ w + b)
        x0, x1, x2, x3 = (
            x0 @ w + b,
            x1 @ w + x0 @ d_weight + d_bias,
            x2 @ w + 2 * x1 @ d_weight,
            x3 @ w + 3 * x2 @ d_weight,
        )
        if layer < last:
            omega = network.omega_0_first if layer == 0 else network.omega_0_hidden
            x0, x1, x2, x3, error, slope = (omega * q for q in (x0, x1, x2, x3, error, slope))
            error = error + U * x0 + SIN_ULP * 2 * U
            slope = slope + error * x1
            x0, x2, x3 = np.minimum(x0, 1), x2 + x1**2, x3 + 3 * x1 * x2 + x1**3
    w = np.abs(weights)
    error = error * w + gamma(weights.size) * x0 * w
    return tuple(np.sum(q) for q in (x0 * w, x1 * w, x2 * w, x3 * w, error, slope * w))


def shifted(network: Siren, moved: Siren, t: float) -> Siren:
    """Return network + t moved."""
    return replace(
        network,
        weights=tuple(w + t * d for w, d in zip(network.weights, moved.weights, strict=True)),
        biases=tuple(b + t * d for b, d in zip(network.biases, moved.biases, strict=True)),
    )


def directions(network: Siren, rng: np.random.Generator, x: Any) -> list[tuple[str, Siren, Any]]:
    """Return one random direction in each layer's weights, each layer's biases, and the input."""
    still = shifted(network, network, -1.0)
    zero, found = np.zeros_like(x), []
    for layer in range(len(network.weights)):
        for kind in ("weights", "biases"):
            arrays = list(getattr(still, kind))
            arrays[layer] = rng.uniform(-1, 1, arrays[layer].shape)
            found.append((f"{kind} {layer}", replace(still, **{kind: tuple(arrays)}), zero))
    return [*found, ("input", still, rng.uniform(-1, 1, x.shape))]


@given(
    widths=st.lists(st.integers(1, 6), min_size=2, max_size=5),
    n=st.integers(1, 4),
    omega_0_first=st.floats(0.5, 4.0),
    omega_0_hidden=st.floats(0.5, 4.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_gradients_of_every_layer_and_of_the_input_match_central_differences(
    widths: list[int], n: int, omega_0_first: float, omega_0_hidden: float, seed: int
) -> None:
    """|(F(h) - F(-h)) / 2h - F'(0)| <= h^2/6 max|F'''| + (rounding error of F) / h, by Taylor's theorem.

    `majorant` bounds both terms; h balances them. F'(0) = <gradient, direction> is rounded too: it is a sum
    of products of weights, cosines and inputs. Errors of cosines and inputs are `slope`; each product meets
    fewer than `operations` roundings, so they change the sum by less than gamma(operations) times the
    majorant of F'.
    """
    rng = np.random.default_rng(seed)
    network = siren.init(widths, omega_0_first, omega_0_hidden, seed, np.float64)
    x, weights = rng.uniform(-1, 1, (n, widths[0])), rng.uniform(-1, 1, (n, widths[-1]))
    _, cache = siren.forward_cached(network, x)
    gradients = siren.backward(network, cache, weights)
    for name, moved, dx in directions(network, rng, x):
        _, _, _, third, error, _ = majorant(network, moved, x, dx, weights, 2.0**-10)
        h = min((3 * error / max(third, 1e-9)) ** (1 / 3), 2.0**-10)
        _, first, _, third, error, slope_error = majorant(network, moved, x, dx, weights, h)
        up = np.sum(weights * siren.forward(shifted(network, moved, h), x + h * dx))
        down = np.sum(weights * siren.forward(shifted(network, moved, -h), x - h * dx))
        pairs = zip(
            (*gradients.dweights, *gradients.dbiases, gradients.dx),
            (*moved.weights, *moved.biases, dx),
            strict=True,
        )
        slope = sum(np.sum(gradient * direction) for gradient, direction in pairs)
        operations = 4 * (sum(widths) + n * widths[-1] + 8 * len(widths)) + sum(
            w.size for w in network.weights
        )
        bound = third * h * h / 6 + error / h + gamma(operations) * first + slope_error
        assert abs((up - down) / (2 * h) - slope) <= bound, name
        # The bound has teeth: it is far below what a wrong factor in the derivative would change.
        assert bound <= 1e-4 * max(first, 1e-3), name


def test_without_dx_the_other_gradients_stay() -> None:
    network = siren.init((5, 4, 3), 2.0, 2.0, seed=3, dtype=np.float64)
    x = np.linspace(-1, 1, 10).reshape(2, 5)
    y, cache = siren.forward_cached(network, x)
    full, lean = siren.backward(network, cache, y), siren.backward(network, cache, y, with_dx=False)
    assert lean.dx is None
    assert full.dx is not None
    assert full.dx.shape == x.shape
    for one, other in zip(full.dweights + full.dbiases, lean.dweights + lean.dbiases, strict=True):
        assert np.array_equal(one, other)
