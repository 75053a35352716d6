"""How good a picture is: all numbers of one picture against its reference, in both spaces.

1. Display-encoded colour in [0, 1] is what a viewer sees: MSE, the same on 0 .. 255, PSNR in decibels, the
   paper's figure, SSIM, FLIP, and the error after a blur on 0 .. 255 [`score`].
2. Linear radiance: relMSE and SMAPE [`refimpl/metrics.py`]. A picture that is only display-encoded is
   decoded.
3. FLIP is that of the package `flip-evaluator`, for pictures of display range, at its usual 67 pixels per
   degree: Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator
   for Alternating Images", Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), 2020.
4. Each score comes with the number of samples per pixel whose render has the same error: the noise of a mean
   falls with their number, and what display-encoding adds is measured [`Ladder.spp_of`], [`Ladder.mse_of`].

*WAMnet for Image Denoising* prints MSE on 0 .. 255 and, as PSNR, ten times the natural logarithm of
255^2 / MSE; so does [`paper_figure`]. Its MSE of 82.93 for pictures of 1 spp is 28.9 dB. Such pictures have
that if they are some stops darker, but then their SSIM is far above the 0.21 beside it (record `claims`).
Squares of 8-bit numbers that wrap around give numbers of that size [`wrapped_mse`]; that the paper's did is a
conjecture.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.cli.common.packages import need
from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import LEVELS, from_display, to_8bit, to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats, Frame


def score(picture: Floats, reference: Floats, linear: Floats | None = None) -> dict[str, float]:
    """Return every score of a display-encoded picture (H, W, 3) against linear radiance (H, W, 3).

    `linear`: the picture's radiance, where it is known; else its colours are decoded.
    """
    target = to_display(reference)
    radiance = from_display(picture) if linear is None else linear
    error = metrics.mse(picture, target)
    return {
        "mse": error,
        "mse255": error * LEVELS**2,
        "wrapped": wrapped_mse(picture, target),
        "psnr": metrics.psnr(picture, target),
        "paper": paper_figure(error * LEVELS**2),
        "ssim": metrics.ssim(picture, target),
        "flip": flip(picture, target),
        "blurred": LEVELS * metrics.blurred(picture, target),
        "relmse": metrics.relmse(radiance, reference),
        "smape": metrics.smape(radiance, reference),
    }


def score_lit(picture: Floats, reference: Frame, linear: Floats | None = None) -> dict[str, float]:
    """Return every score, and the error in the penumbra, if there is one, on 0 .. 255.

    The reference has the layer `direct`.
    """
    found = score(picture, reference["color"], linear)
    mask = metrics.penumbra(reference["direct"], reference["unshadowed"])
    if mask.any():
        found["penumbra"] = LEVELS * metrics.inside(mask, picture, to_display(reference["color"]))
    return found


def mean_scores(found: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the means of the scores that all pictures have."""
    names = [name for name in found[0] if all(name in scores for scores in found)]
    return {name: float(np.mean([scores[name] for scores in found])) for name in names}


def paper_figure(mse255: float) -> float:
    """Return what the paper's Table 1 calls PSNR: 10 ln(255^2 / MSE), MSE on 0 .. 255; without error, inf."""
    return 10.0 * math.log(LEVELS**2 / mse255) if mse255 > 0.0 else math.inf


def wrapped_mse(picture: Floats, target: Floats) -> float:
    """Return the MSE of two display-encoded pictures in arithmetic of 8 bits: each square modulo 256."""
    difference = to_8bit(picture).astype(np.int64) - to_8bit(target)
    return float(np.mean(difference**2 % (LEVELS + 1)))


def flip(picture: Floats, target: Floats) -> float:
    """Return the mean FLIP of two display-encoded pictures (H, W, 3) in [0, 1]."""
    return float(np.mean(flip_map(picture, target)))


def flip_map(picture: Floats, target: Floats) -> NDArray[np.float32]:
    """Return the FLIP (H, W) of two display-encoded pictures (H, W, 3) in [0, 1] at each pixel."""
    # Shapes and finite numbers are checked as for every metric.
    metrics.mse(picture, target)
    for what, values in (("the picture", picture), ("its reference", target)):
        low, high = float(np.min(values)), float(np.max(values))
        if low < 0.0 or high > 1.0:
            rule = "FLIP takes display-encoded colours in [0, 1]"
            raise InputError(f"range of {what}", f"{low:g} to {high:g}", rule, "encode or clip it")
    package = need("flip_evaluator", "to compute FLIP", "flip-evaluator")
    images = [np.ascontiguousarray(values, np.float32) for values in (target, picture)]
    found, _, _ = package.evaluate(*images, "LDR", applyMagma=False, computeMeanError=False)
    return np.asarray(found, np.float32).reshape(picture.shape[:2])


@dataclass(frozen=True)
class Ladder:
    """Errors (display-encoded MSE) of renders of some numbers of samples per pixel, which rise."""

    spp: tuple[int, ...]
    mse: tuple[float, ...]

    def spp_of(self, mse: float) -> float:
        """Return the samples per pixel whose render has this error.

        Between two rungs log MSE is linear in log spp; outside of them it goes as 1 / spp.
        """
        if not mse > 0.0:
            return math.inf
        x, y = np.log(self.spp), np.log(self.mse)
        wanted = math.log(mse)
        if wanted <= y[-1]:
            return float(self.spp[-1] * math.exp(y[-1] - wanted))
        if wanted >= y[0]:
            return float(self.spp[0] * math.exp(y[0] - wanted))
        return float(np.exp(np.interp(-wanted, -y, x)))

    def mse_of(self, spp: float) -> float:
        """Return the error of a render of so many samples per pixel; between and beyond rungs as above."""
        if not self.spp[0] <= spp <= self.spp[-1]:
            nearest = 0 if spp < self.spp[0] else -1
            return self.mse[nearest] * self.spp[nearest] / spp
        return float(np.exp(np.interp(math.log(spp), np.log(self.spp), np.log(self.mse))))


def ladder(renders: Mapping[int, Sequence[tuple[Floats, Floats]]]) -> Ladder:
    """Return the ladder of (render, reference) pairs of linear radiance, by samples per pixel."""
    rungs: dict[int, Any] = {}
    for spp, found in sorted(renders.items()):
        errors = [metrics.mse(*(to_display(image) for image in pair)) for pair in found]
        rungs[spp] = float(np.mean(errors))
    values = tuple(rungs.values())
    if any(not a > b for a, b in pairwise(values)):
        rule = "must fall as the samples rise"
        raise InputError("errors of renders", values, rule, "use more frames, or rungs farther apart")
    return Ladder(tuple(rungs), values)
