"""Student's distribution against a closed form, and Welch's test on drawn samples."""

import numpy as np
import pytest
from statistical import stats, welch_p

from wamnet.kernels.judge import welch


@pytest.mark.parametrize("t", [-2.0, 2.08e-07, 0.0, 2.0, 40.0])
def test_student_is_a_closed_form(t):
    """With two degrees of freedom: 1 - a, a = |t| / sqrt(2 + t^2), as (1 - a^2) / (1 + a)."""
    expected = 2 / ((2 + t * t) * (1 + abs(t) / np.sqrt(2 + t * t)))
    assert abs(welch.student_p(np.array(t), np.array(2.0)) - expected) <= 1e-13 * expected


def test_welch_is_scipy_s():
    """To 1e-9 of the value: ten roundings of t and its freedom, which move p little."""
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
