"""Student's distribution against SciPy's, and Welch's test on drawn samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from packages import Late
from statistical import stats, welch_p

from wamnet.kernels.judge import welch

special = Late("scipy.special", "scipy")


@given(t=st.floats(0, 40), freedom=st.floats(0.5, 1e6))
@example(t=2.08e-07, freedom=512.0)
@example(t=2.0, freedom=2.0)
def test_student_is_scipy_s(t, freedom):
    """To 1e-7 of the value: the logarithm of the gamma function, up to 1e7, loses nine digits of sixteen."""
    expected = 2 * stats.t.sf(t, freedom)
    found = welch.student_p(np.array(t), np.array(freedom))
    assert abs(found - expected) <= 1e-7 * expected + np.finfo(float).tiny


@given(a=st.floats(0.1, 1000), b=st.floats(0.1, 1000), x=st.floats(0, 1))
def test_incomplete_beta_is_scipy_s(a, b, x):
    """To 1e-10: of numbers up to 1e4 the logarithm of gamma loses four digits, and 1 - x a few."""
    assert abs(welch.incomplete_beta(a, b, x) - special.betainc(a, b, x)) <= 1e-10


def test_welch_is_scipy_s():
    """To 1e-9 of the value, as above with few degrees of freedom."""
    random = np.random.default_rng(1)
    a, b = random.normal(0, 1, (12, 50)), random.normal(0.3, 3, (20, 50))
    expected = stats.ttest_ind(a, b, equal_var=False).pvalue
    moments = [m for x in (a, b) for m in (x.mean(axis=0), x.var(axis=0, ddof=1), len(x))]
    assert np.all(np.abs(welch.welch_p(*moments) - expected) <= 1e-9 * expected)
    assert np.allclose(welch_p(*moments), expected, rtol=1e-9, atol=0)


@pytest.mark.parametrize("of", [welch.welch_p, welch_p], ids=["wamnet", "tests"])
def test_without_noise_only_equals_agree(of):
    zero = np.zeros(3)
    p = of(np.array([1.0, 2.0, np.nan]), zero, 4, np.array([1.0, 3.0, 1.0]), zero, 4)
    assert p[:2].tolist() == [1, 0]
    assert np.isnan(p[2])


@pytest.mark.parametrize("comparisons", [1, 7, 1000])
def test_sidak(comparisons):
    """(1 - level)^m is 1 - significance; float64 rounds m times."""
    level = welch.sidak(0.01, comparisons)
    assert abs((1 - level) ** comparisons - 0.99) <= comparisons * 2.0**-52
