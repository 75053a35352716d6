"""What large work will take, said before it starts: nothing is forbidden, but nobody should have to guess.

1. Every path meets every primitive at each bounce, so rendering takes a time in proportion to samples times
   primitives; the reference also starts some operations for each primitive and tile.
2. Memory goes into the primitives' tables and the layers of the picture.
3. From a stated size on a sentence says both [`said_of_rendering`], [`said_of_compiling`],
   [`said_of_measuring`], [`said_of_learning`].

The factors of time, and of memory for a primitive, were measured with minicubes and copies of its cubes, 27
to 27,000 of them: processor time on one core for NumPy and compilation, time on two busy cores for
OpenCL, with 30 primitives. The memory of a pixel is counted, not measured. A rule of thumb, no more.
"""

import math
import os
from collections.abc import Sequence

from ...refimpl.light.render import TILE_PIXELS
from ...refimpl.light.scene import Scene, primitives
from .terminal import say

MANY_PRIMITIVES = 100_000
"""From so many primitives on, 10**9 samples or half an hour of measurements, a sentence is said."""

MANY_PIXELS = 10**8
"""From so many pixels that are in memory at once on a sentence is said."""

_PAIR_BYTES = 92
"""Bytes of a pixel to learn from: 20 channels of a noisy frame and the colour of its target, in float32."""

_PICTURE_BYTES = 160
"""Bytes of a pixel that is denoised: features as rendered and as encoded, at most 40 numbers in float32."""

_NUMPY_SAMPLE_S, _NUMPY_START_S = 2e-7, 1.5e-4
"""Seconds of the reference on a core: for a sample and a primitive, for a tile of samples and a primitive."""

_KERNEL_SAMPLE_S = 1e-8
"""Seconds for a sample and a primitive of a kernel on two cores; graphics processors take far less."""

_COMPILE_S = 7e-5
"""Seconds that a compilation takes for a primitive."""

_PRIMITIVE_BYTES, _PIXEL_BYTES = 2_000, 500
"""Bytes of a primitive, in Python and in tables, and of a pixel: the sums of 20 channels in double precision,
their means, and the frame."""


def said_of_rendering(scene: Scene, samples: int, pixels: int, executor: str, workers: int | None) -> None:
    """Say what large work takes; `pixels` are those of one picture."""
    count = primitives(scene) + (scene.room is not None)
    if executor != "numpy":
        seconds = count * samples * _KERNEL_SAMPLE_S
    else:
        work = samples * _NUMPY_SAMPLE_S + samples / pixels * math.ceil(pixels / TILE_PIXELS) * _NUMPY_START_S
        seconds = count * work / (workers or len(os.sched_getaffinity(0)))
    if count >= MANY_PRIMITIVES or samples >= 10**9:
        size = count * _PRIMITIVE_BYTES + pixels * _PIXEL_BYTES
        _say(f"{count:,} primitives and {samples:,} samples", seconds, size)


def said_of_compiling(scene: Scene) -> None:
    """Say what it takes to compile a large scene."""
    if (count := primitives(scene) + (scene.room is not None)) >= MANY_PRIMITIVES:
        _say(f"{count:,} primitives", count * _COMPILE_S, count * _PRIMITIVE_BYTES)


def said_of_measuring(contenders: int, sizes: Sequence[int], budget_s: float) -> None:
    """Say what a large benchmark of pictures of these sides takes."""
    seconds, pixels = contenders * len(sizes) * budget_s, max(sizes) ** 2
    if seconds >= 1800.0 or pixels >= MANY_PIXELS:
        work = f"{contenders} program{'s' if contenders > 1 else ''} and images of up to {pixels:,} pixels"
        _say(work, seconds, pixels * _PICTURE_BYTES, " at most, compilation left out")


def said_of_learning(frames: int, pixels: int) -> None:
    """Say how much memory many pixels to learn from take."""
    if frames * pixels >= MANY_PIXELS:
        size = f"{frames * pixels * _PAIR_BYTES // 2**20:,} MiB of memory"
        say(f"{frames} frames of {pixels:,} pixels to learn from: by a rule of thumb {size}; Ctrl-C stops it")


def _say(work: str, seconds: float, size: int, more: str = "") -> None:
    """Say an estimate in units that people think in."""
    about = f"about {duration(seconds)} and {max(1, size // 2**20):,} MiB of memory"
    say(f"{work}: by a rule of thumb {about}{more}; Ctrl-C stops it")


def duration(seconds: float) -> str:
    """Return a time in the largest unit of which there are two at least."""
    for name, unit in (("years", 31_557_600.0), ("days", 86_400.0), ("hours", 3_600.0), ("minutes", 60.0)):
        if seconds >= 2 * unit:
            return f"{seconds / unit:,.0f} {name}"
    return f"{max(seconds, 1.0):.0f} s"
