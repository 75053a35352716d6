"""A kernel's picture against the reference's, from other random numbers: Welch's test over the picture.

1. Both are rendered, and give a mean and a variance for each pixel and channel [`compare_images`].
2. Pixels are joined in blocks [`BLOCK_PX`]: a path's radiance is far from normally distributed, and the mean
   of few samples still is.
3. Each block and channel with noise has a p-value (welch.py); the least is checked against Sidak's level.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import InputError
from ...refimpl.light import render
from ...refimpl.light.render import Job, Render
from ...refimpl.light.scene import Scene
from ..devices.executor import Executor
from ..run.render_on import render_on
from . import welch

BLOCK_PX = 8
"""Side of the blocks whose means are compared. Measured at significance 0.01 with pairs of pictures differing
in nothing but the seed (`minicubes`, `cornell`, 64x64, 16 to 128 samples a pixel): of 16 pairs, 2 to 7 false
alarms with single pixels, 0 to 4 with blocks of 2, 0 or 1 with 4, and none with 8."""

KERNEL_SAMPLES = 4
"""Samples of the kernel for each one of the reference: they cost next to nothing."""

SIGNIFICANCE = 0.01
"""Chance that a kernel that is right is refused, over all blocks and channels."""

ROUNDING = 2.0**-18
"""What rounding may change in a sample, relative to the mean, 64 u: a few products and sums."""


@dataclass(frozen=True)
class ImageReport:
    """The `least` p-value of `comparisons` (blocks and channels with noise), and the `level` of each.

    `spp` are the samples a pixel of the kernel and of the reference. Without noise anywhere there is nothing
    to compare that the paths do not show, and `least` is 1.
    """

    comparisons: int
    least: float
    level: float
    significance: float
    spp: tuple[int, int]

    @property
    def passed(self) -> bool:
        """Return whether both may be pictures of the same; with NaN they may not."""
        return self.least >= self.level


def compare_images(
    device: Executor,
    scene: Scene,
    job: Job,
    *,
    on_progress: Callable[[int], None] | None = None,
) -> ImageReport:
    """Compare the kernel's picture with the reference's of the next seed.

    `job` is the reference's; the kernel takes [`KERNEL_SAMPLES`] times its samples. on_progress is called
    with the number of the reference's samples that were just finished.
    """
    check_samples(job)
    counts = (KERNEL_SAMPLES * job.spp, job.spp)
    found = render_on(device, scene, replace(job, spp=counts[0]))
    other = replace(job, seed=(job.seed + 1) % 2**32)
    expected = render.render(scene, other, on_progress=on_progress)
    means, variances = zip(*map(blocks, (found, expected)), strict=True)
    # What shows one colour without noise is compared by its paths.
    noisy = np.maximum(*variances) > (ROUNDING * np.maximum(*means)) ** 2
    p = welch.welch_p(
        means[0][noisy], variances[0][noisy], counts[0], means[1][noisy], variances[1][noisy], counts[1]
    )
    # A picture that is not finite is not a picture.
    finite = all(np.isfinite(a).all() for a in (*means, *variances))
    least = float(np.min(p, initial=1.0)) if finite else 0.0
    comparisons = int(noisy.sum())
    level = welch.sidak(SIGNIFICANCE, max(comparisons, 1))
    return ImageReport(comparisons, least, level, SIGNIFICANCE, counts)


def check_samples(job: Job) -> None:
    """Refuse a job whose samples have no variance."""
    if job.spp < 2:
        raise InputError("spp", job.spp, "Welch's test needs the variance of samples", "use 2 or more")


def blocks(picture: Render) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and variance of one sample of each block (blocks, blocks, 3); the last ones may be smaller.

    A sample of a block is the mean of one sample of each of its pixels.
    """
    color = picture.frame["color"].astype(np.float64)
    count = _block_sums(np.ones_like(color))
    return _block_sums(color) / count, _block_sums(picture.color_variance) / count**2


def _block_sums(a: NDArray[Any]) -> NDArray[np.float64]:
    """Return the sums over blocks of a picture (H, W, 3)."""
    for axis in (0, 1):
        a = np.add.reduceat(a, np.arange(0, a.shape[axis], BLOCK_PX), axis=axis)
    return a
