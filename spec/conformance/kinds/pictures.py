"""Kinds of whole pictures: denoising of a small frame, and a small render with a statistical verdict.

1. A denoised picture has a bound at each pixel: the network's at its window (compiler/proof/bounds.py), for
   encoded features that may be one ulp of float32 off [`_of_denoised`].
2. A rendered picture is an estimate. The answer holds the mean of each pixel and the variance of one sample;
   both are averaged over blocks of pixels, and the blocks' means are compared by Welch's test with those of
   the reference (welch.py) [`_of_rendered`].
3. A tiny render has bounds where each of its samples is sure: those of whole paths, averaged [`_of_exact`].
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ....compiler.core.lower import lower
from ....compiler.core.profiles import EMITTED_SINE
from ....compiler.plan import analysed
from ....compiler.proof import bounds
from ....refimpl.frame import validate
from ....refimpl.light import scene as scene_module
from ....refimpl.light.render import Job, Render, render
from ....refimpl.light.scene import Scene
from ....refimpl.network import dataset, denoise
from ....refimpl.network.window import all_windows, pad
from ..case import Output, within
from ..numbers import mean_and_variance
from . import paths
from .files import model_from
from .images import ULP, frame_of
from .tables import kind

SIGNIFICANCE = 1e-5
"""Chance that a right program fails a case of a render, over all its blocks and channels."""

REFERENCE_SPP, REFERENCE_SEED = 256, 1000
"""Samples per pixel of the reference, and what its seed has more than that of the answer."""

OF_SAMPLES = "ranges of single precision of all samples, from step to step (compiler/proof/ranges.py)"
"""Where the bounds of tiny pictures come from."""

AT_PIXELS = "bounds of profile ieee at these pixels, features being one ulp off (compiler/proof/bounds.py)"
"""Where the bounds of denoised pictures come from."""

ROUNDED = 2.0**-22
"""What a mean may be off by for its sum and its rounding to float32, relative: few samples are added."""


def _denoise(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the denoised picture."""
    frame = frame_of(inputs)
    validate(frame, finite=False)
    return {"picture": denoise.denoise(model_from(base64.b64decode(inputs["model"])), frame, np.float64)}


def _of_denoised(inputs: Mapping[str, Any], picture: Any) -> Any:
    """Return the bound (H, W, 3) of a picture."""
    model, frame = model_from(base64.b64decode(inputs["model"])), frame_of(inputs)
    program = analysed(lower(model))
    image = dataset.feature_image(frame, model.features, model.normalization).astype(np.float64)
    windows = all_windows(pad(image, model.window), model.window)
    nodes = bounds.enclose(program, {"window": (windows - ULP, windows + ULP)}, EMITTED_SINE)
    ((_, index),) = program.outputs
    found = nodes[index]
    return np.maximum(found.high - picture, picture - found.low) + found.read


def rendered(inputs: Mapping[str, Any], how: Callable[[Scene, Job], Render]) -> dict[str, Any]:
    """Return mean and variance of each pixel of a case."""
    width, height, spp, seed = (int(inputs[name]) for name in ("width", "height", "spp", "seed"))
    job = Job(width, height, spp, seed, paths.settings_of(inputs["settings"]))
    found = how(scene_module.from_json(inputs["scene"]), job)
    return {"mean": found.frame["color"], "variance": found.color_variance, "spp": job.spp}


def _of_rendered(inputs: Mapping[str, Any], wanted: Any, told: Mapping[str, Any]) -> dict[str, Output]:
    """Return the means of blocks, as large as the file says, and what the test needs."""
    block_px = int(told["mean"]["welch"]["block"])
    seed = REFERENCE_SEED + int(inputs["seed"])
    found = rendered({**inputs, "spp": REFERENCE_SPP, "seed": seed}, render)
    mean, variance = mean_and_variance(found["mean"].astype(np.float64), found["variance"], block_px)
    welch = {
        "variance": variance,
        "spp": REFERENCE_SPP,
        "asked": int(inputs["spp"]),
        "block": block_px,
        "shape": np.array(found["mean"].shape),
        "significance": SIGNIFICANCE,
    }
    text = f"Welch's test of block means, significance {SIGNIFICANCE:g} in all"
    return {"mean": Output(mean, 0.0, text, (), welch)}


def _of_exact(inputs: Mapping[str, Any], wanted: Mapping[str, Any], told: Any) -> dict[str, Output]:
    """Return the bounds of means and variances.

    A sample x is off by the width w of its range at most, a mean m by the mean of the widths. A variance, the
    sum of (x - m)^2 over n - 1, is off by the sum of 2 |x - m| e + e^2 over n - 1, e being both together; of
    one sample it is 0.
    """
    shape = tuple(int(inputs[name]) for name in ("height", "width", "spp"))
    ends = [paths.gathered({**inputs, "x": x, "y": y, "sample": n}) for y, x, n in np.ndindex(*shape)]
    low, high = (np.array([end[side] for end in ends]).reshape(*shape, 3) for side in (0, 1))
    mean, variance, middle = wanted["mean"], wanted["variance"], (low + high) / 2
    of_mean = np.mean(high - low, axis=2) + ROUNDED * mean
    off = (high - low) + of_mean[:, :, np.newaxis]
    spread = np.abs(middle - mean[:, :, np.newaxis]) + off
    of_variance = np.sum(2 * spread * off + off**2, axis=2) / max(shape[2] - 1, 1) + ROUNDED * variance
    return {
        "mean": Output(mean, of_mean, OF_SAMPLES),
        "variance": Output(variance, of_variance, OF_SAMPLES),
        "spp": Output(wanted["spp"]),
    }


KINDS = (
    kind("picture.denoised", _denoise, within(_of_denoised, AT_PIXELS)),
    kind(
        "picture.exact",
        partial(rendered, how=lambda scene, job: render(scene, replace(job, dtype="float64"))),
        _of_exact,
    ),
    kind("picture.rendered", partial(rendered, how=render), _of_rendered),
)
"""The kinds of this module."""
