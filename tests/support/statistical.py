"""Statistical verdicts for tests of random numbers and of noisy estimators.

Every test states its significance: the chance that it fails although the code is right. Seeds are fixed, so a
verdict does not change from run to run; the significance says how lucky the seed may be. Where a test makes m
comparisons, each is tested at the level that Sidak's correction gives [`sidak`], so that the chance of any
false alarm stays at the stated one. Follows Nori's and Mitsuba's habit of testing samplers and renderers by
hypothesis tests, and Jung, Hanika and Dachsbacher, "Detecting Bias in Monte Carlo Renderers using Welch's
t-test", JCGT 9(2), 2020. SciPy's own test is the oracle of kernels/judge/welch.py.
"""

import numpy as np
from packages import Late

from wamnet.kernels.judge.welch import sidak as sidak
from wamnet.refimpl.light.render import Job, Render, render
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.transport import Settings

stats, integrate = Late("scipy.stats", "scipy"), Late("scipy.integrate", "scipy")

SIGNIFICANCE = 0.01
"""Chance of a false alarm of one test function, over all its comparisons."""

LEAST_EXPECTED = 5.0
"""Cells of a chi-square test with a lower expected count are pooled: the usual rule for its approximation."""


def chi_square_p(observed: np.ndarray, expected: np.ndarray) -> float:
    """Return the p-value of observed against expected counts; cells with low expectation are pooled.

    A cell that cannot be reached (expectation 0) must be empty, else the p-value is 0.
    """
    observed, expected = observed.ravel().astype(float), expected.ravel().astype(float)
    assert np.all(np.isfinite(expected)), "expected counts must be finite"
    assert np.all(expected >= 0.0), "expected counts must not be negative"
    if np.any(observed[expected == 0.0] > 0):
        return 0.0
    # Pool from the rarest cell upwards.
    order = np.argsort(expected)
    groups = np.floor(np.cumsum(expected[order]) / LEAST_EXPECTED).astype(int)
    groups = np.minimum(groups, max(groups[-1] - 1, 0))
    observed, expected = (np.bincount(groups, weights=counts[order]) for counts in (observed, expected))
    used = expected > 0.0
    statistic = np.sum((observed[used] - expected[used]) ** 2 / expected[used])
    return float(stats.chi2.sf(statistic, max(int(used.sum()) - 1, 1)))


def z_p(difference: np.ndarray, standard_error: np.ndarray) -> np.ndarray:
    """Return two-sided p-values of differences, given their standard errors; exact equality has p = 1."""
    z = np.divide(
        np.abs(difference),
        standard_error,
        out=np.where(difference == 0.0, 0.0, np.inf),
        where=standard_error > 0,
    )
    return 2.0 * stats.norm.sf(z)


def welch_p(mean_a, variance_a, count_a, mean_b, variance_b, count_b) -> np.ndarray:
    """Return SciPy's p-values of Welch's t-test for equal means; variances are those of single samples.

    Equal means without variance have p = 1, where SciPy divides 0 by 0.
    """
    a, b = np.sqrt(variance_a), np.sqrt(variance_b)
    p = stats.ttest_ind_from_stats(mean_a, a, count_a, mean_b, b, count_b, equal_var=False).pvalue
    return np.where((mean_a == mean_b) & (variance_a + variance_b == 0), 1.0, p)


def assert_all_plausible(p_values: np.ndarray, significance: float = SIGNIFICANCE) -> None:
    """Fail when the least of the p-values is below Sidak's level for their number; NaN fails."""
    p_values = np.atleast_1d(p_values)
    level = sidak(significance, p_values.size)
    worst = np.min(p_values)
    assert worst >= level, f"least p-value {worst:.3g} of {p_values.size} is below {level:.3g}"


# ---- images ----------------------------------------------------------------------------------------------

BLOCK_PX = 8
"""Side of the blocks of an image that are compared: many pixels of few samples take less than few of many."""


def of_blocks(values: np.ndarray) -> np.ndarray:
    """Return the means (B,) of an image's (H, W, C) blocks, over their pixels and channels."""
    height, width = (side // BLOCK_PX for side in values.shape[:2])
    cut = values[: height * BLOCK_PX, : width * BLOCK_PX].astype(np.float64)
    return cut.reshape(height, BLOCK_PX, width, BLOCK_PX, -1).mean(axis=(1, 3, 4)).ravel()


def assert_same_image(a: Render, b: Render) -> None:
    """Fail unless two renders have the same mean: Welch's test on blocks, and a z-test on the whole image.

    The variance of the channels' mean is at most the mean of their variances. Blocks that show a light, or
    nothing, have none. The image as one number shows a bias too small for a block.
    """
    means, variances = ([of_blocks(x) for x in pair] for pair in zip(*map(_moments, (a, b)), strict=True))
    counts = [BLOCK_PX**2 * int(r.frame.info["spp"]) for r in (a, b)]
    noisy = (variances[0] > 1e-12) & (variances[1] > 1e-12)
    assert noisy.sum() >= 12
    parts = [x[noisy] for pair in zip(means, variances, strict=True) for x in pair]
    assert_all_plausible(welch_p(*parts[:2], counts[0], *parts[2:], counts[1]))
    error = np.sqrt(sum(v.mean() / n for v, n in zip(variances, counts, strict=True)) / means[0].size)
    assert z_p(np.array(means[0].mean() - means[1].mean()), error) >= SIGNIFICANCE


def _moments(r: Render) -> tuple[np.ndarray, np.ndarray]:
    return r.frame["color"], r.color_variance


STRATEGIES = (("light", "power"), ("bsdf", "power"), ("mis", "balance"))
"""Strategies and heuristics besides the default ones."""


def assert_strategies_agree(scene: Scene, depth: int, size: int = 64, spp: int = 8) -> None:
    """Fail unless light samples, BSDF samples and both give the image of the default (other seeds, and
    four times as many samples: those of the BSDF alone are rarely on a small light)."""
    combined = render(scene, Job(size, size, spp, 3, Settings(depth)))
    for ways in STRATEGIES:
        other = render(scene, Job(size, size, 4 * spp, 4, Settings(depth, None, *ways)))
        assert_same_image(combined, other)
