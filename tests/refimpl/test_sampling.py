"""Every sampler has its density and its inverse: round trips and chi-square tests."""

from itertools import pairwise

import inverses
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistical import SIGNIFICANCE, chi_square_p, integrate, sidak

from wamnet.refimpl import rng, vectors
from wamnet.refimpl.light import sampling

UNIT = st.floats(0.0, 1.0, exclude_max=True, width=32)
CORNER, EDGE_U, EDGE_V = (np.array(v) for v in ((0.3, -1.0, 2.0), (2.0, 0.5, 0.0), (-0.4, 1.5, 0.7)))
CUMULATIVE = np.array([0.1, 0.35, 0.35, 1.0])
SAMPLES = 1 << 17


def uniforms(count: int = SAMPLES, seed: int = 11):
    return rng.uniforms(
        rng.counter(seed), rng.counter(np.arange(count)), rng.counter(0), rng.counter(0), np.float64
    )


ROUND_TRIP = 1e-13
"""Bound on |u - invert(sample(u))| in float64. Forward and back take about 20 operations, each of an error of
at most an ulp of numbers up to 4: 20 * 4 * 2**-53 = 9e-15. Division by the radius does no harm, since the
errors of x and y are relative to it. A factor of ten is left for sine, cosine and arctangent."""


@given(UNIT, UNIT)
def test_hemisphere_round_trip(u0, u1):
    wi = sampling.sample_cosine_hemisphere(np.float64(u0), np.float64(u1))
    assert wi[2] >= 0.0
    assert abs(vectors.dot(wi, wi) - 1.0) <= 8 * 2.0**-52  # z restores the length to a few roundings
    v0, v1 = inverses.invert_cosine_hemisphere_sample(wi)
    assert max(abs(v0 - u0), abs(v1 - u1)) <= ROUND_TRIP


@pytest.mark.parametrize("index", [0, 1, 3])
def test_discrete_round_trip(index):
    u = inverses.invert_discrete_sample(np.array([index]), CUMULATIVE)
    assert sampling.sample_discrete(u, CUMULATIVE)[0] == index


def test_discrete_chi_square():
    observed = np.bincount(sampling.sample_discrete(uniforms()[0], CUMULATIVE), minlength=4)
    expected = sampling.discrete_pdf(np.arange(4), CUMULATIVE) * SAMPLES
    assert chi_square_p(observed, expected) >= sidak(SIGNIFICANCE, 1)


def test_disk_chi_square():
    """Cells of equal radius steps and angles: expected share is pdf times area, r dr dphi."""
    x, y = sampling.sample_concentric_disk(*uniforms()[:2])
    radii, angles = np.linspace(0, 1, 17), np.linspace(-np.pi, np.pi, 33)
    observed, _, _ = np.histogram2d(np.hypot(x, y), np.arctan2(y, x), bins=(radii, angles))
    pdf = 1.0 / np.pi
    area = np.outer(np.diff(radii**2) / 2, np.diff(angles))
    assert chi_square_p(observed, pdf * area * SAMPLES) >= SIGNIFICANCE


def test_hemisphere_chi_square():
    """Cells in (cos theta, phi): expected share is the integral of the pdf over the solid angle, by
    quadrature."""
    wi = sampling.sample_cosine_hemisphere(*uniforms()[:2])
    cosines, angles = np.linspace(0, 1, 17), np.linspace(-np.pi, np.pi, 33)
    observed, _, _ = np.histogram2d(wi[:, 2], np.arctan2(wi[:, 1], wi[:, 0]), bins=(cosines, angles))
    share = [integrate.quad(sampling.cosine_hemisphere_pdf, a, b)[0] for a, b in pairwise(cosines)]
    assert chi_square_p(observed, np.outer(share, np.diff(angles)) * SAMPLES) >= SIGNIFICANCE


@given(UNIT, UNIT, st.sampled_from([0.0, 1.0, 100.0, 1e6]))
def test_spherical_cauchy_round_trip(u0, u1, concentration):
    """1 - z loses the digits of a small 1 - cos: an ulp of 1, times du0 / d(1 - cos) <= (1 + 2 k) / 2. Where
    the sine is small too, the azimuth loses them.
    """
    wi = sampling.sample_spherical_cauchy(np.float64(u0), np.float64(u1), concentration)
    assert abs(vectors.dot(wi, wi) - 1.0) <= 16 * 2.0**-52
    v0, v1 = inverses.invert_spherical_cauchy_sample(wi, concentration)
    assert abs(v0 - u0) <= ROUND_TRIP + (1.0 + 2.0 * concentration) * 2.0**-52
    if wi[0] ** 2 + wi[1] ** 2 > 0.0:
        assert abs(v1 - u1) <= ROUND_TRIP


@pytest.mark.parametrize("concentration", [0.0, 3.0, 500.0])
def test_spherical_cauchy_chi_square(concentration):
    """Cells in (1 - cos, phi), finer near the axis: expected share is the integral of the pdf, by
    quadrature.
    """
    wi = sampling.sample_spherical_cauchy(*uniforms()[:2], concentration)
    edges, angles = 2.0 * np.linspace(0, 1, 17) ** 3, np.linspace(-np.pi, np.pi, 33)
    observed, _, _ = np.histogram2d(1.0 - wi[:, 2], np.arctan2(wi[:, 1], wi[:, 0]), bins=(edges, angles))
    share = [
        integrate.quad(sampling.spherical_cauchy_pdf, a, b, args=(concentration,))[0]
        for a, b in pairwise(edges)
    ]
    expected = np.outer(share, np.diff(angles))
    assert expected.sum() == pytest.approx(1.0, rel=1e-9)  # quad's own estimate of its error
    assert chi_square_p(observed, expected * SAMPLES) >= sidak(SIGNIFICANCE, 3)


def test_quad_chi_square():
    """Equal cells of the parallelogram get equal counts, and the density integrates to one over its area."""
    p = sampling.sample_quad(*uniforms()[:2], CORNER, EDGE_U, EDGE_V)
    u0, u1 = inverses.invert_quad_sample(p, CORNER, EDGE_U, EDGE_V)
    observed, _, _ = np.histogram2d(u0, u1, bins=16, range=((0, 1), (0, 1)))
    area = np.linalg.norm(np.cross(EDGE_U, EDGE_V))
    # Some ten roundings.
    assert sampling.quad_pdf(EDGE_U, EDGE_V) * area == pytest.approx(1.0, rel=8 * 2.0**-52)
    assert chi_square_p(observed, np.full((16, 16), SAMPLES / 256)) >= SIGNIFICANCE


DIRECTIONS = st.tuples(*(st.floats(-1.0, 1.0, width=32),) * 3).filter(lambda v: sum(x * x for x in v) > 1e-6)


@given(DIRECTIONS, st.sampled_from([np.float32, np.float64]))
def test_tangent_frame_is_orthonormal_and_right_handed(v, dtype):
    normal = vectors.normalize(np.array([v], dtype))
    tangent, bitangent = sampling.tangent_frame(normal)
    frame = np.stack([tangent[0], bitangent[0], normal[0]]).astype(np.float64)
    # Each entry of the Gram matrix sums three products of numbers that took up to six roundings: 3 * (2 * 6 +
    # 3) u.
    assert np.max(np.abs(frame @ frame.T - np.eye(3))) <= 45 * np.finfo(dtype).eps
    assert np.linalg.det(frame) > 0.0


@pytest.mark.parametrize("z", [1.0, -1.0, -0.0, 0.0])
def test_tangent_frame_at_the_poles_and_on_the_equator(z):
    normal = np.array([[np.sqrt(1 - z * z), 0.0, z]])
    local = np.array([[0.0, 0.0, 1.0]])
    assert np.array_equal(sampling.to_world(local, normal), normal)
    assert all(np.all(np.isfinite(t)) for t in sampling.tangent_frame(normal))
