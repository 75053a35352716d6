"""Denoise a frame on an executor: lower, compile, encode, run, with both times.

Features are encoded by the reference; the edge-avoiding filter, which takes it longer than a kernel takes for
the network, runs on the device [`images_on`].
"""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.core.ir import sha256
from ...compiler.core.profiles import profile_named
from ...compiler.scenes.smooth_kernel import SmoothKernels, compile_smoothing
from ...compiler.schedules import schedules
from ...compiler.schedules.schedules import PLAIN
from ...compiler.variants import FULL, plan_model
from ...refimpl.frame import Frame
from ...refimpl.network.dataset import FEATURES, Normalization
from ...refimpl.network.denoise import Model, input_image
from ..devices.executor import Executor
from ..devices.images import Images
from ..memory import keep_freed_memory
from .tune import choose


@dataclass(frozen=True)
class RunResult:
    """The picture (H, W, 3), display-encoded, and where and how fast it was made.

    `seconds_compile`: tracing, passes, bound, emission, the driver's compilation and one run on a few pixels.
    `seconds_run`: images to the device, the kernel, the result back; not the encoding of the features.
    `schedule`: what was picked, and why, where it is not the requested one; `reason`: why that was requested.
    `kernel`: its digest. `variant`: what it may cost.
    """

    image: NDArray[np.float32]
    seconds_compile: float
    seconds_run: float
    device: str
    schedule: str
    reason: str
    kernel: str
    variant: str = ""

    @property
    def digest(self) -> str:
        """Return the SHA-256 of the picture's numbers, little-endian float32, rows from the top."""
        return sha256(self.image.astype("<f4").tobytes())


def images_of(model: Model, frame: Frame) -> Images:
    """Return the encoded feature images (H, W, C) that the model's kernel reads, by name."""
    # NumPy works without the interpreter's lock: features are encoded beside each other.
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        made = pool.map(lambda name: input_image(model, frame, (name,)), model.features)
        return dict(zip(model.features, made, strict=True))


def filter_of(executor: Executor, model: Model, frame: Frame, profile: str) -> SmoothKernels | None:
    """Return the kernels, built, that smooth a frame's features on a device; None: the reference does.

    The reference smooths where a device would take longer, where a picture has the same bits on all devices
    (integers, profile `exact`), and layers with more digits than a kernel reads.
    """
    layers = [layer for name in model.features if FEATURES[name].guides for layer in FEATURES[name].layers]
    same_bits = model.is_whole or bool(profile_named(profile).common)
    if not layers or not executor.smooths or same_bits:
        return None
    if not all(layer in frame and frame[layer].dtype == np.float32 for layer in layers):
        return None
    kernels = _compiled(model.normalization, executor.name, profile, executor.lanes)
    for kernel in (kernels.guide, kernels.smooth, kernels.encode):
        executor.build(kernel)
    return kernels


@lru_cache(maxsize=16)
def _compiled(normalization: Normalization, target: str, profile: str, lanes: int) -> SmoothKernels:
    """Return the kernels of the filter, which all models with these scales share."""
    return compile_smoothing(normalization, target, profile, lanes)


def images_on(executor: Executor, model: Model, frame: Frame, profile: str = "ieee") -> Images:
    """Return the images of [`images_of`], smoothed ones by the device where it does that: up to SMO-5."""
    kernels = filter_of(executor, model, frame, profile)
    if kernels is None:
        return images_of(model, frame)
    others = [name for name in model.features if not FEATURES[name].guides]
    found = dict(images_of(replace(model, features=tuple(others)), frame))
    for feature in (FEATURES[name] for name in model.features if name not in found):
        given = {"color": feature.layer, **feature.guides}
        found[feature.name] = executor.smooth(kernels, {what: frame[layer] for what, layer in given.items()})
    return {name: found[name] for name in model.features}


def denoise_on(
    executor: Executor,
    model: Model,
    frame: Frame,
    profile: str = "ieee",
    schedule: str | None = None,
    variant: str = FULL,
    pictures: int = 1,
    images: Images | None = None,
) -> RunResult:
    """Return the denoised frame and the times.

    Without a `schedule`, it is the one that suits device, size and so many `pictures` to come [tune.py].
    `variant`: with fewer operations [variants.py]. `images`: those of [`images_of`], for whoever compares
    with the reference's picture; by default the device may make them [`images_on`].
    """
    start = time.perf_counter()
    size = (frame.height, frame.width)
    plan, reason = plan_model(model, executor.name, profile, schedule or PLAIN, variant), "as asked"
    if images is None:
        filter_of(executor, plan.model, frame, profile)
    planned = time.perf_counter() - start
    # A frame that lacks a layer is refused before its denoiser is compiled; encoding is not part of that.
    if images is None:
        images = images_on(executor, plan.model, frame, profile)
    start = time.perf_counter() - planned
    if not schedule:
        found = choose(executor, plan, size, pictures)
        plan, reason = found.plan, found.reason
    artifact = compile_plan(plan)
    executor.build(artifact, size)
    keep_freed_memory()
    built = time.perf_counter()
    image = executor.run(artifact, images)
    seconds = time.perf_counter() - built
    picked = schedules.text(artifact.manifest["schedule"])
    facts = (executor.device, picked, reason, artifact.digest, _text_of(artifact))
    return RunResult(image, built - start, seconds, *facts)


def _text_of(artifact: Artifact) -> str:
    """Return what a manifest says about a variant, for a reader; nothing where it is all of the network."""
    if (found := artifact.manifest.get("variant")) is None:
        return ""
    bound, share = found["bound"]["output"], found["products"] / found["products_of_full"]
    moves = f"moves a colour by at most {max(bound):g}" if bound else "moves colours without a bound"
    return f"variant {found['name']}: {share:.0%} of the multiplications; {moves}, whatever the picture"
