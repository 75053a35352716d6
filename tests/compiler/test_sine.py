"""The emitted sines: their derivation added up, coefficients made again, values where they are hard."""

import importlib.util
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest

from wamnet.compiler.core import sine
from wamnet.compiler.core.enclosure import round_up
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.profiles import emitted_cosine, emitted_sine, profile_named
from wamnet.compiler.core.trace import trace
from wamnet.compiler.targets import language_named
from wamnet.refimpl.errors import CompileError

DEGREES = sorted(sine.POLYNOMIALS)
ERROR = {degree: polynomial.error for degree, polynomial in sine.POLYNOMIALS.items()}

NUMPY = 2.0**-50
"""What NumPy's float64 sine may be off here: `test_numpy_s_float64_sine_is_good_enough`."""


@pytest.fixture(scope="module")
def script():
    """The script that proves the errors, at its own precision."""
    path = Path(__file__).parents[2] / "experiments" / "sine_errors.py"
    spec = importlib.util.spec_from_file_location("sine_errors", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    with mpmath.workprec(160):
        yield module


def test_reduction_is_that_of_the_script(script):
    made = script.reduction()
    assert tuple(map(float.fromhex, made["pi_parts"])) == sine.PI_PARTS
    assert float.fromhex(made["inverse_pi"]) == sine.INVERSE_PI
    assert made["pi_rest"] <= sine.PI_REST
    assert made["r_max"] == sine.R_MAX


@pytest.mark.nightly(but="7")
@pytest.mark.parametrize("degree", DEGREES)
def test_errors_are_those_of_the_script(script, degree):
    """SIN-6: the whole error is steps 2 to 4 on 4,000 intervals of r: reduction, approximation, rounding."""
    made, stated = script.errors(degree), sine.POLYNOMIALS[degree]
    assert all(float(np.float32(c)) == c for c in stated.coefficients)
    for name in ("approximation_error", "error", "cosine_error"):
        assert round_up(made[name]) == getattr(stated, name)


def test_proven_error_holds_in_between(script):
    """A polynomial with an error of its own: the bound holds at points that are not of its grid."""
    coefficients = [1.0, -0.1666, 0.0083]
    r = np.random.default_rng(1).uniform(0, sine.R_MAX, 2**16)
    largest = np.max(np.abs(sine.horner(r, coefficients) - np.sin(r)))
    assert largest <= script.proven_error(coefficients) <= 1.001 * largest


def test_reduced_argument_stays_in_its_range():
    """Step 1: |x / pi - k| <= 1/2 + 2 u 4075 + 2^-13, u = 2^-24, where 4075 > DOMAIN / pi + 1/2."""
    assert sine.DOMAIN / np.pi + 0.5 <= 4075
    assert np.pi * (0.5 + 2 * 2.0**-24 * 4075 + 2.0**-13) <= sine.R_MAX


def test_products_with_k_are_exact():
    """Step 2: 12 bits of k times 12 bits of each part fit float32's 24; of k - 1/2, below 2^11, too."""
    k = np.arange(2**12, dtype=np.float64)
    assert 2 * (sine.COSINE_DOMAIN / np.pi + 1) <= 2**12
    for part in sine.PI_PARTS:
        for whole in (k, k / 2):
            assert np.array_equal((whole * part).astype(np.float32).astype(np.float64), whole * part)


# ---- arguments ------------------------------------------------------------------------------------------


def neighbours(x):
    """Return float32 numbers (3 N,): x (N,) and those next to it."""
    x = np.asarray(x).astype(np.float32)
    return np.concatenate([x, *(np.nextafter(x, np.float32(end)) for end in (np.inf, -np.inf))])


def nearest_to_multiples(domain):
    """Return the float32 numbers up to `domain` that are nearest to multiples of pi / 2, of each binade.

    x = m 2^e is near n pi / 2 where n / m is near 2^e / (pi / 2): best among all m of 24 bits are convergents
    of its continued fraction, and the fractions between two of them (Muller and others, "Handbook of
    Floating-Point Arithmetic", 2018, section 10.2, on the worst case of range reduction).
    """
    found = []
    with mpmath.workprec(200):
        for exponent in range(-24, int(np.log2(domain)) - 22):
            ratio = mpmath.mpf(2) ** exponent * 2 / mpmath.pi
            before, last = (0, 1), (1, 0)  # numerator, denominator
            while last[1] < 2**24:
                whole = int(mpmath.floor(ratio))
                for step in {1, whole // 2, whole - 1, whole}:
                    m = step * last[1] + before[1]
                    if 0 < m < 2**24 and m * 2.0**exponent <= domain:
                        found.append(m * 2.0**exponent)
                before, last = last, (whole * last[0] + before[0], whole * last[1] + before[1])
                ratio = 1 / (ratio - whole)
    return np.array(found, np.float32)


def hard_arguments(domain=sine.DOMAIN):
    """Return float32 arguments (N,): neighbours of k pi / 2, of where k turns, ends, zeros, powers of two."""
    k = np.arange(int(domain / np.pi * 4) + 1)
    near = neighbours(k * (np.pi / 4))
    few = neighbours(
        [domain, 1.0, *(2.0 ** np.arange(-149, 14)), *nearest_to_multiples(domain), 1e-40, 2.0**-126]
    )
    found = np.concatenate([near, few, [0.0]]).astype(np.float32)
    found = np.concatenate([found, -found])
    return found[np.abs(found) <= domain]


def exact(x, function=mpmath.sin):
    """Return sin(x) in float64 (N,), from 120 bits: no argument in the domain is too hard for that."""
    with mpmath.workprec(120):
        return np.array([float(function(mpmath.mpf(float(v)))) for v in x])


@pytest.fixture(scope="module")
def hard():
    """Arguments of the sine, their sines; of the cosine, their cosines."""
    x, y = hard_arguments(), hard_arguments(sine.COSINE_DOMAIN)
    return x, exact(x), y, exact(y, mpmath.cos)


def test_hard_arguments_are_the_hardest():
    """The nearest of all float32 numbers near n pi / 2, n > 0, is one that the continued fractions give."""

    def nearest(x):
        with mpmath.workprec(120):
            turns = (mpmath.mpf(float(v)) * 2 / mpmath.pi for v in x)
            return min(abs(t - mpmath.nint(t)) for t in turns if mpmath.nint(t))

    multiples = np.arange(1, int(sine.DOMAIN / np.pi * 2) + 1) * (np.pi / 2)
    assert nearest(nearest_to_multiples(sine.DOMAIN)) == nearest(multiples.astype(np.float32)) < 2.0**-28


@pytest.mark.parametrize("degree", DEGREES)
def test_hard_arguments(hard, degree):
    x, expected, y, cosines = hard
    found = sine.sine(x, degree)
    assert found.dtype == np.float32
    assert np.max(np.abs(found - expected)) <= ERROR[degree]
    assert np.max(np.abs(found)) <= 1
    other = sine.cosine(y, degree)
    assert np.max(np.abs(other - cosines)) <= sine.POLYNOMIALS[degree].cosine_error
    assert np.max(np.abs(other)) <= 1


def fused(a, b, c):
    """Return a b + c, rounded once to float32: exactly, in rationals."""
    return np.float32(float_of(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))))


def float_of(value):
    """Return the float32 nearest to a rational number, ties to even (results here are normal, or 0)."""
    guess = np.float32(float(value))
    around = [guess, np.nextafter(guess, np.float32(np.inf)), np.nextafter(guess, np.float32(-np.inf))]
    return min(around, key=lambda f: (abs(Fraction(float(f)) - value), int(f.view(np.uint32)) & 1))


def fused_sine(x, degree):
    """Return the sine as a target computes it that fuses every product with the sum that reads it."""
    x, parts = np.float32(x), [np.float32(p) for p in sine.PI_PARTS]
    k = np.floor(fused(x, np.float32(sine.INVERSE_PI), 0.5))
    r = x
    for part in parts:
        r = fused(-k, part, r)
    first, *others = map(np.float32, sine.POLYNOMIALS[degree].coefficients)
    z, q = r * r, others[-1]
    for coefficient in reversed(others[:-1]):
        q = fused(z, q, coefficient)
    value = fused(r, z * q, r) if first == 1 else r * fused(z, q, first)
    return value if k % 2 == 0 else -value


@pytest.mark.parametrize("degree", DEGREES)
def test_fused_products_stay_within_the_same_error(degree):
    x = np.random.default_rng(degree).choice(hard_arguments(), 400)
    off = np.abs(np.array([fused_sine(v, degree) for v in x], np.float64) - exact(x))
    assert off.max() <= ERROR[degree]


def test_numpy_s_float64_sine_is_good_enough(hard):
    x, expected, y, cosines = hard
    assert np.max(np.abs(np.sin(x.astype(np.float64)) - expected)) <= NUMPY
    assert np.max(np.abs(np.cos(y.astype(np.float64)) - cosines)) <= NUMPY


@pytest.mark.parametrize("degree", DEGREES)
def test_small_numbers(degree):
    """From degree 7 on their own sines; below, off by the first coefficient's factor; zeros give +0."""
    x = np.array([1e-20, 1e-40, 2.0**-126, 1e-5], np.float32)
    expected = x if degree >= 7 else x * np.float32(sine.POLYNOMIALS[degree].coefficients[0])
    assert np.array_equal(sine.sine(x, degree), expected)
    assert np.array_equal(sine.sine(-x, degree), -expected)
    zeros = sine.sine(np.array([0.0, -0.0], np.float32), degree)
    assert np.array_equal(zeros.view(np.uint32), [0, 0])


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize(
    ("function", "domain"), [(sine.sine, sine.DOMAIN), (sine.cosine, sine.COSINE_DOMAIN)]
)
def test_beyond_the_domain(function, domain, degree):
    beyond = np.nextafter(np.float32(domain), np.float32(np.inf))
    numbers = np.array([beyond, 1e5, 1e9, 1e38, np.finfo(np.float32).max], np.float32)
    with np.errstate(all="ignore"):
        for sign in (1, -1):
            found = function(np.float32(sign) * numbers, degree)
            assert np.array_equal(found.view(np.uint32), np.zeros(5))
        assert np.isnan(function(np.array([np.inf, -np.inf, np.nan], np.float32), degree)).all()


@pytest.mark.parametrize("degree", DEGREES)
def test_traced_sine_is_the_same_function(degree):
    program = trace(lambda x: np.sin(x) + 0.5 * np.cos(0.25 * x), {"x": Type()})
    emitted = pipeline.run(program, profile_named(f"ieee-sine{degree}").passes)
    assert not {"sin", "cos"} & {node.op for node in emitted.nodes}
    x = hard_arguments()
    expected = sine.sine(x, degree) + np.float32(0.5) * sine.cosine(np.float32(0.25) * x, degree)
    assert np.array_equal(interpret(emitted, {"x": x})["color"], expected)


# ---- degrees of profiles ----------------------------------------------------------------------------------


def test_degree_that_does_not_exist():
    with pytest.raises(KeyError, match="12"):
        sine.sine(np.float32(1), degree=12)


@pytest.mark.parametrize(
    "name", ["ieee-sine12", "native-sine7", "ieee-sine", "ieee-sine07", "ieee7", "x-sine7"]
)
def test_profile_with_a_sine_that_does_not_exist(name):
    with pytest.raises(CompileError, match=f"profile '{name}': unknown .* ieee-sine9, ieee-sine13"):
        profile_named(name)


def test_profile_of_the_degree_in_use_is_the_plain_one():
    assert profile_named(f"ieee-sine{sine.DEGREE}") == profile_named("ieee")


@pytest.mark.parametrize("degree", DEGREES)
def test_contracts_are_those_of_the_degree(degree):
    contract = language_named("opencl").under(f"ieee-sine{degree}").sine
    assert (contract.error, contract.domain) == (ERROR[degree], sine.DOMAIN)
    assert contract == emitted_sine(degree)
    assert f"degree {degree}" in contract.text
    cosine = emitted_cosine(degree)
    assert (cosine.error, cosine.domain) == (sine.POLYNOMIALS[degree].cosine_error, sine.COSINE_DOMAIN)
