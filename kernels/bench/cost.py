"""What a way to denoise should cost: a time predicted from operations, sines and bytes.

1. A way is a list of stages that run one after another: a kernel, or an operation of a library that reads and
   writes whole pictures [`Stage`].
2. A stage takes as long as its arithmetic or its memory, whichever is longer: S. Williams, A. Waterman and
   D. Patterson, "Roofline: An Insightful Visual Performance Model for Multicore Architectures",
   Communications of the ACM 52(4), 2009, figure 1 [`predicted_seconds`]

       pixels * max(pixel + products / products_per_s + sines / sines_per_s, bytes / bytes_per_s)

3. The rates are measured [rates.py]: on programs that are not those whose time is predicted.

Departure from the source: sines are counted apart from products, because one takes as long as many of those.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...compiler.artifact import Artifact
from ...compiler.core.ir import Program
from ...compiler.schedules.common import kernel_gather, output_channels
from ..run.denoise_on import products_of as products_of

FLOAT_BYTES = 4
"""Bytes of a float32."""


@dataclass(frozen=True)
class Stage:
    """What one pass over a picture does for a pixel: products with their sums, sines, bytes of memory."""

    products: float
    sines: float
    bytes: float


@dataclass(frozen=True)
class Rates:
    """What a device does in a second, and the seconds that a pixel takes in addition."""

    products_per_s: float
    sines_per_s: float
    bytes_per_s: float
    pixel_s: float = 0.0


def predicted_seconds(stages: Sequence[Stage], rates: Rates, pixels: int) -> float | None:
    """Return the time of a picture; None without stages, or where a rate is not positive."""
    known = (rates.products_per_s, rates.sines_per_s, rates.bytes_per_s)
    if not stages or not all(rate > 0.0 for rate in known):
        return None
    return pixels * sum(
        max(
            rates.pixel_s + stage.products / rates.products_per_s + stage.sines / rates.sines_per_s,
            stage.bytes / rates.bytes_per_s,
        )
        for stage in stages
    )


def sines_of(program: Program) -> int:
    """Return the sines of a pixel, in a program whose sines are single nodes."""
    return sum(math.prod(node.type.shape) for node in program.nodes if node.op == "sin")


def fused(artifact: Artifact, sines: int) -> tuple[Stage, ...]:
    """Return the stages of compiled kernels: each reads its images and writes one; the last has the sines."""
    channels = [kernel_gather(k.programs).channels + output_channels(k.programs) for k in artifact.kernels]
    return tuple(
        Stage(products_of(kernel.programs), sines if kernel is artifact else 0, FLOAT_BYTES * count)
        for kernel, count in zip(artifact.kernels, channels, strict=True)
    )
