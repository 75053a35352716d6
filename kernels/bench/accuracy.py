"""How far a contender's picture is from the reference in float64, and what its quality on unseen frames is.

1. The reference is computed on a crop at the picture's first corner, whose pixels see the border [`Crop`].
   It is the full network's, whatever a variant leaves out [`Crop.full`]. A second one is what the variant
   computes: from it a kernel differs only by rounding, which has a bound [`Crop.rounding`].
2. The error is a difference of colours in [0, 1]: the largest, the mean, and the largest in units in the last
   place of the reference [`errors`].
3. Quality is PSNR and SSIM against a reference frame, and what is lost of the full network's [`quality`].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.interpret import interpret
from ...compiler.core.ir import Program
from ...compiler.core.lower import lower
from ...compiler.schedules.common import kernel_gather
from ...compiler.schedules.schedules import PLAIN, windows
from ...refimpl import metrics
from ...refimpl.frame import Frame
from ...refimpl.network import dataset
from ...refimpl.network.denoise import Model
from ...refimpl.network.whole import round_image
from ..devices.kernel import Images
from .contenders import Variant

Array = NDArray[np.float64]

CROP_PX = 42
"""Rows and columns of the crop: whole tiles of every schedule."""

MARGIN_PX = 48
"""Rows and columns beyond the crop that any schedule looks at: a window, and the points of a tile."""

ULP_FLOOR = 2.0**-10
"""Colours below this, a quarter of an 8-bit step, are measured in its units: near black units vanish."""


class Crop:
    """The first corner of a picture, with what its windows see."""

    def __init__(self, model: Model, images: Images) -> None:
        """Keep the corner of the images (H, W, C) and compute the full network there in float64."""
        self.model = model
        height, width = next(iter(images.values())).shape[:2]
        self.rows, self.columns = min(CROP_PX, height), min(CROP_PX, width)
        self.images = {
            name: np.ascontiguousarray(image[: self.rows + MARGIN_PX, : self.columns + MARGIN_PX])
            for name, image in images.items()
        }
        self.full = self.interpreted(lower(model))
        self._rounding: dict[tuple[Any, ...], tuple[Array, float]] = {}

    def interpreted(self, program: Program) -> Array:
        """Return the output (rows, columns, 3) of a program of one window, in float64."""
        seen = windows(kernel_gather(program), self._read(program))
        (found,) = interpret(program, {"window": seen}, np.float64).values()
        crop: Array = self.cut(found)
        return crop

    def rounding(self, variant: Variant, language: str | None, schedule: str = "") -> tuple[Array, float]:
        """Return what a variant computes in float64, and the largest bound of a kernel's rounding.

        `schedule` of `language`: whose sums; a peer without one is checked against the interpreter's.
        """
        plan = variant.plan(self.model, language or "numpy", schedule or PLAIN)
        # Most schedules of all targets share one bound, which takes seconds to compute.
        key = variant.name, plan.sine, None if plan.shares_bound else plan.schedule.name
        if key not in self._rounding:
            held = plan.expected(self._read(plan.analysed, plan.shares_bound))
            self._rounding[key] = self.cut(held.value), float(self.cut(held.bound).max())
        return self._rounding[key]

    def _read(self, program: Program, near: bool = False) -> Images:
        """Return the images that a program reads; `near`: no more of them than the crop's windows see."""
        gather = kernel_gather(program)
        rows, columns = (self.rows + gather.rows, self.columns + gather.columns) if near else (None, None)
        images = {image.name: self.images[image.name][:rows, :columns] for image in gather.images}
        return {name: round_image(image) for name, image in images.items()} if gather.whole else images

    def cut(self, picture: NDArray[Any]) -> Any:
        """Return the crop of a picture (H, W, C)."""
        return picture[: self.rows, : self.columns]


def errors(picture: NDArray[Any], reference: Array) -> dict[str, float]:
    """Return the largest and the mean difference of two pictures, and the largest in ulp; NaN stays NaN."""
    difference = np.abs(np.asarray(picture, np.float64) - reference)
    unit = np.spacing(np.maximum(np.abs(reference), ULP_FLOOR).astype(np.float32)).astype(np.float64)
    return {
        "max": float(difference.max()),
        "mean": float(difference.mean()),
        "ulp": float((difference / unit).max()),
    }


def scores(
    model: Model, pairs: Sequence[tuple[Frame, Frame]], picture_of: Callable[[Frame], NDArray[Any]]
) -> list[tuple[float, float]]:
    """Return PSNR and SSIM of display-encoded pictures (H, W, 3) of noisy frames, by the reference.

    SSIM is NaN where a frame is too small.
    """
    found = []
    for noisy, clean in pairs:
        picture, target = picture_of(noisy), dataset.target_image(clean, model.normalization)
        small = min(target.shape[:2]) < metrics.WINDOW_SIZE_PX
        found.append((metrics.psnr(picture, target), math.nan if small else metrics.ssim(picture, target)))
    return found


def quality(found: Sequence[tuple[float, float]], full: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return mean PSNR (dB) and SSIM of scores, what is lost of the full network's, and each PSNR."""
    (psnr, ssim), (full_psnr, full_ssim) = (np.mean(each, axis=0).tolist() for each in (found, full))
    means = {"psnr_db": psnr, "ssim": ssim, "psnr_loss_db": full_psnr - psnr, "ssim_loss": full_ssim - ssim}
    return {**means, "psnr_frames_db": [each for each, _ in found]}
