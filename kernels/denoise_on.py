"""Denoise a frame on an executor: lower, compile, encode, run, with both times."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..compiler import schedules
from ..compiler.artifact import Artifact
from ..compiler.compile import compile_program
from ..compiler.ir import sha256
from ..compiler.lower import lower
from ..refimpl.dataset import feature_image
from ..refimpl.denoise import Model
from ..refimpl.frame import Frame
from .executor import Executor, Images
from .memory import keep_freed_memory


@dataclass(frozen=True)
class RunResult:
    """The picture (H, W, 3), display-encoded, and where and how fast it was made.

    `seconds_compile`: tracing, passes, bound, emission, the driver's compilation and one run on a few pixels.
    `seconds_run`: images to the device, the kernel, the result back; not the encoding of the features.
    `schedule`: what was picked, and why, where it is not what was asked for. `cut`: what a rank costs.
    """

    image: NDArray[np.float32]
    seconds_compile: float
    seconds_run: float
    device: str
    schedule: str
    cut: str = ""

    @property
    def digest(self) -> str:
        """Return the SHA-256 of the picture's numbers, little-endian float32, rows from the top."""
        return sha256(self.image.astype("<f4").tobytes())


def images_of(model: Model, frame: Frame) -> Images:
    """Return the encoded feature images (H, W, C) that the model's kernel reads, by name."""
    return {name: feature_image(frame, (name,), model.normalization) for name in model.features}


def denoise_on(
    executor: Executor,
    model: Model,
    frame: Frame,
    profile: str = "ieee",
    schedule: str | None = None,
    rank: int = 0,
) -> RunResult:
    """Return the denoised frame and the times; without a `schedule`, the one that suits device and size.

    With a `rank` the first layer is cut to it, and run in two passes [factor.py].
    """
    images = images_of(model, frame)
    start = time.perf_counter()
    size = (frame.height, frame.width)
    wanted = schedule or executor.schedule_for(size)
    artifact = compile_program(lower(model), executor.name, profile, wanted, rank)
    executor.build(artifact, size)
    keep_freed_memory()
    built = time.perf_counter()
    image = executor.run(artifact, images)
    seconds = time.perf_counter() - built
    picked = schedules.text(artifact.manifest["schedule"])
    return RunResult(image, built - start, seconds, executor.device, picked, _cut_text(artifact))


def _cut_text(artifact: Artifact) -> str:
    """Return what a manifest says about a cut, for a reader; nothing where there is none."""
    if (cut := artifact.manifest.get("factored")) is None:
        return ""
    layer, reach = cut["cut"]["first_layer"], cut["cut"]["of"]
    return f"rank {cut['rank']}: moves the first layer's sums by at most {layer:g}; they are up to {reach:g}"
