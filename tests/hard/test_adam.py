"""Adam where float32 is at its ends, against exact or float64 arithmetic, interpreted and on the device."""

import numpy as np
import pytest

from wamnet.refimpl.network import adam

U = 2.0**-24
"""Unit roundoff of float32."""

ROUNDINGS = 24
"""More roundings than one step has: 3 for either moment, 2 divisions, a root, a sum, two products, a
difference; the root halves what it is given."""


def run(gradients, theta=1.0, dtype=np.float32, rate=1e-3):
    """Return parameter and state after steps along scalar gradients."""
    parameters, state = (np.full(1, theta, dtype),), None
    for g in gradients:
        state = state or adam.init(parameters)
        parameters, state = adam.step(parameters, (np.full(1, g, dtype),), state, rate)
    return parameters[0], state


def test_thousands_of_steps_without_a_gradient():
    """Moments fade through the denormals, the parameter comes to rest, nothing divides 0 by 0.

    0.9^n is below the least denormal, 2^-149, after 981 steps; but 0.9 of k such numbers rounds to k itself
    for k <= 4, so m may stay there, or at 0 where denormals are flushed. 0.999^n fades in 103,228 steps: v
    stays normal here.
    """
    moved, state = run([1.0] + [0.0] * 3_000)
    assert np.isfinite(moved).all()
    assert 0.0 <= state.m[0][0] <= 4 * 2.0**-149
    assert 0.0 < state.v[0][0] < 1e-3
    still, _ = run([1.0] + [0.0] * 2_000)
    np.testing.assert_array_equal(moved, still)
    untouched, state = run([0.0] * 3_000)
    np.testing.assert_array_equal(untouched, np.float32(1.0))
    assert state.m[0][0] == state.v[0][0] == 0.0


@pytest.mark.parametrize("gradient", [1e-30, 1e-12, 1e-8, 1e-4, 1.0, 1e4, 1e18])
def test_first_step_of_gradients_of_all_sizes(gradient):
    """At t = 1 both means are the gradient's own: the step is rate |g| / (|g| + epsilon), epsilon outside.

    Inside the root it would be rate |g| / sqrt(g^2 + epsilon): at g = 1e-8, 1e-7 of the rate and not half.
    """
    moved, _ = run([gradient], theta=0.0)
    # The square of 1e-30 underflows to 0 in float32: the denominator is epsilon then, as it is beside 1e-30.
    expected = -1e-3 * gradient / (gradient + 1e-8)
    assert abs(moved[0] - expected) <= ROUNDINGS * U * abs(expected)
    if gradient == 1e-8:
        inside = -1e-3 * gradient / np.sqrt(gradient**2 + 1e-8)
        assert abs(moved[0] - inside) > 0.4e-3


@pytest.mark.parametrize("gradient", [2e19, 3.4e38])
def test_a_square_that_overflows_stops_the_parameter(gradient):
    """v becomes infinite, the step 0: the parameter stays finite, and stays where it is from then on."""
    with np.errstate(over="ignore"):
        moved, state = run([gradient, 1.0, 1.0], theta=0.5)
    assert moved[0] == np.float32(0.5)
    assert np.isinf(state.v[0][0])
    assert np.isfinite(state.m[0][0])


def test_bias_correction_after_twenty_thousand_steps():
    """1 - beta^t is computed in float64: at t = 1 to the last bit but rounding, at 20,000 as good as 1.

    In float32, 1 - 0.999 would be off by 2^-24 / 0.001, 6e-5 of itself, and so would the first steps.
    """
    assert adam.growth(1) == (1.0 - 0.9, 1.0 - 0.999)
    assert abs(adam.growth(1)[1] - 1e-3) <= 2.0**-53
    first, second = adam.growth(20_000)
    assert first == 1.0
    assert abs(1.0 - second - np.exp(20_000 * np.log(0.999))) <= 2.0**-53
    assert second < 1.0


def test_a_constant_gradient_moves_by_the_rate_at_every_step():
    """Both means are exact whatever t is, so 2,000 steps go 2,000 rates.

    A step's error is at most ROUNDINGS u of the rate, and the sum's rounding half an ulp of numbers below 2.
    The moments' own rounding does not pile up: it fades with beta, 10 and 1,000 steps' worth at most.
    """
    steps, rate = 2_000, 1e-3
    moved, _ = run([0.37] * steps, theta=0.0, rate=rate)
    slack = steps * (rate * (ROUNDINGS + 10 + 1_000) * U + 2.0 * U)
    assert abs(moved[0] + steps * rate) <= slack


def test_float32_follows_float64():
    """Random gradients over twelve orders of magnitude, each step within its roundings of float64's."""
    random = np.random.default_rng(3)
    gradients = random.standard_normal(400) * 10.0 ** random.uniform(-6, 6, 400)
    narrow, _ = run(gradients.astype(np.float32), theta=0.0)
    wide, _ = run(gradients.astype(np.float32), theta=0.0, dtype=np.float64)
    # |step| <= rate (1 - beta_1) / sqrt(1 - beta_2) = 3.2 rates (Kingma, Ba, section 2.1); m and v are means
    # of at most t terms whose relative errors are at most (t + 3) u of the sum of magnitudes; cancellation in
    # m is measured against that sum, which Cauchy-Schwarz bounds by 3.2 times the denominator too.
    slack = sum(3.2e-3 * 1.5 * (t + ROUNDINGS) * U + 2 * U for t in range(400))
    assert abs(narrow[0] - wide[0]) <= slack
