"""The emitted sine: its derivation added up, its coefficients made again, its values where they are hard."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import mpmath
import numpy as np
import pytest

from wamnet.compiler import bounds, sine
from wamnet.compiler.interpret import interpret
from wamnet.compiler.ir import Type
from wamnet.compiler.profiles import EMITTED_SINE
from wamnet.compiler.trace import trace

ERROR = sine.POLYNOMIALS[sine.DEGREE].error


@pytest.fixture(scope="module")
def script():
    """The script that makes the coefficients, at its own precision."""
    path = Path(__file__).parents[2] / "experiments" / "sine_coefficients.py"
    spec = importlib.util.spec_from_file_location("sine_coefficients", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    with mpmath.workprec(160):
        yield module


def test_coefficients_are_those_of_the_script(script):
    made = script.table(sine.DEGREE)
    stated = sine.POLYNOMIALS[sine.DEGREE]
    assert tuple(map(float.fromhex, made["coefficients"])) == stated.coefficients
    assert tuple(map(float.fromhex, made["pi_parts"])) == sine.PI_PARTS
    assert float.fromhex(made["inverse_pi"]) == sine.INVERSE_PI
    assert made["approximation_error"] <= stated.approximation_error
    assert made["pi_rest"] <= sine.PI_REST
    assert made["r_max"] == sine.R_MAX


def test_reduced_argument_stays_in_its_range():
    """Step 1: |x / pi - k| <= 1/2 + 2 u 4075 + 2^-13, u = 2^-24, where 4075 > DOMAIN / pi + 1/2."""
    assert sine.DOMAIN / np.pi + 0.5 <= 4075
    assert np.pi * (0.5 + 2 * 2.0**-24 * 4075 + 2.0**-13) <= sine.R_MAX


def test_products_with_k_are_exact():
    """Step 2: 12 bits of k times 12 bits of each part fit float32's 24."""
    k = np.arange(2**12, dtype=np.float64)
    for part in sine.PI_PARTS:
        assert np.array_equal((k * part).astype(np.float32).astype(np.float64), k * part)


def test_the_parts_of_the_error_add_up_to_the_stated_one():
    """Steps 2 to 4 on 4,000 intervals of r: reduction, approximation, rounding by the compiler's rules."""
    edges = np.linspace(-sine.R_MAX, sine.R_MAX, 4001)
    program = trace(sine.polynomial, {"r": Type()})
    (rounding,) = bounds.over_box(program, {"r": (edges[:-1], edges[1:])}, EMITTED_SINE).values()
    reduction = np.maximum(sine.reduction_error(edges[:-1]), sine.reduction_error(edges[1:]))
    # Between the ends of an interval |r cos r| moves by less than 2 |dr|, times 2 u.
    reduction += 4 * 2.0**-24 * np.diff(edges)
    total = rounding + reduction + sine.POLYNOMIALS[sine.DEGREE].approximation_error
    assert total.max() <= ERROR


def hard_arguments():
    """Float32 neighbours of k pi / 2 over the domain, its ends, zeros, denormals, small powers of two."""
    k = np.arange(-int(sine.DOMAIN / np.pi * 2), int(sine.DOMAIN / np.pi * 2) + 1)
    near = (k * (np.pi / 2)).astype(np.float32)
    near = np.concatenate(
        [near, np.nextafter(near, np.float32(np.inf)), np.nextafter(near, np.float32(-np.inf))]
    )
    few = [sine.DOMAIN, -sine.DOMAIN, 0.0, -0.0, 1e-40, -1e-45, *(2.0 ** np.arange(-149, 13))]
    found = np.concatenate([near, np.array(few, np.float32)])
    return found[np.abs(found) <= sine.DOMAIN]


def exact(x):
    """Return sin(x) in float64 (N,), from 120 bits: no argument in the domain is too hard for that."""
    with mpmath.workprec(120):
        return np.array([float(mpmath.sin(mpmath.mpf(float(v)))) for v in x])


def test_hard_arguments():
    x = hard_arguments()
    found = sine.sine(x)
    assert found.dtype == np.float32
    assert np.max(np.abs(found - exact(x))) <= ERROR


@pytest.mark.parametrize("largest", [1e-3, 4.0, 100.0, sine.DOMAIN])
def test_random_arguments(largest):
    """2^20 float32 values; NumPy's float64 sine is right to 2^-50 here, far below the margin of ERROR."""
    x = np.random.default_rng(1).uniform(-largest, largest, 2**20).astype(np.float32)
    assert np.max(np.abs(sine.sine(x) - np.sin(x.astype(np.float64)))) + 2.0**-50 <= ERROR


def test_the_parts_of_the_cosine_s_error_add_up_to_the_stated_one():
    """As above; where |r| > 1 the first difference may be rounded too, by 2^-24, passed on times |cos r|."""
    assert 2 * (sine.COSINE_DOMAIN / np.pi + 1) <= 2**12
    edges = np.linspace(-sine.R_MAX, sine.R_MAX, 4001)
    program = trace(sine.polynomial, {"r": Type()})
    (rounding,) = bounds.over_box(program, {"r": (edges[:-1], edges[1:])}, EMITTED_SINE).values()
    ends = np.maximum(np.abs(edges[:-1]), np.abs(edges[1:]))
    reduction = np.maximum(sine.reduction_error(edges[:-1]), sine.reduction_error(edges[1:]))
    reduction += 4 * 2.0**-24 * np.diff(edges)
    slope = np.maximum(np.abs(np.cos(edges[:-1])), np.abs(np.cos(edges[1:])))
    first = np.where(ends > 1.0, 2.0**-24 * (slope + 2.0**-12), 0.0)
    total = rounding + reduction + first + sine.POLYNOMIALS[sine.DEGREE].approximation_error
    assert total.max() <= sine.COSINE_ERROR


@pytest.mark.parametrize("largest", [1e-3, 4.0, 100.0, sine.COSINE_DOMAIN])
def test_cosine_of_random_arguments(largest):
    x = np.random.default_rng(1).uniform(-largest, largest, 2**20).astype(np.float32)
    found = sine.cosine(x)
    assert np.max(np.abs(found - np.cos(x.astype(np.float64)))) + 2.0**-50 <= sine.COSINE_ERROR
    assert np.max(np.abs(found)) <= 1


def test_cosine_of_hard_arguments():
    x = hard_arguments()
    x = x[np.abs(x) <= sine.COSINE_DOMAIN]
    with mpmath.workprec(120):
        exact_cosine = np.array([float(mpmath.cos(mpmath.mpf(float(v)))) for v in x])
    assert np.max(np.abs(sine.cosine(x) - exact_cosine)) <= sine.COSINE_ERROR


def test_numpy_s_float64_sine_is_good_enough():
    x = hard_arguments()[::97]
    assert np.max(np.abs(np.sin(x.astype(np.float64)) - exact(x))) <= 2.0**-50


def test_zero_keeps_its_sign_and_small_numbers_their_value():
    x = np.array([0.0, 1e-20, 1e-40], np.float32)
    assert np.array_equal(sine.sine(x), x)
    assert np.array_equal(sine.sine(-x), -x)


def test_result_stays_within_one():
    assert np.max(np.abs(sine.sine(hard_arguments()))) <= 1


def test_traced_sine_is_the_same_function():
    program = trace(sine.sine, {"x": Type()})
    x = hard_arguments()
    assert np.array_equal(interpret(program, {"x": x})["color"], sine.sine(x))


def test_degree_that_does_not_exist():
    with pytest.raises(KeyError, match="12"):
        sine.sine(np.float32(1), degree=12)
