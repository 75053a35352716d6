"""A second meaning of kernels on planes: all pixels at once, each program by NumPy's operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import numpy as np

from wamnet.compiler.artifact import Artifact
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.kernel.interface import (
    CAMERAS,
    ENCODE,
    FIRST,
    FOLLOW,
    GUIDE,
    GUIDES,
    IMAGE,
    LIGHT,
    MOTIONS,
    PAST,
    RESULT,
    SMOOTH,
)
from wamnet.compiler.kernel.interface import SUMS as SUMS_ARRAY
from wamnet.compiler.scenes import history_kernel
from wamnet.compiler.scenes.encode_kernel import SAMPLES
from wamnet.compiler.scenes.history_kernel import BEYOND, COLOR, MOTION, NUMBER, RESTS, SIZE, STARTS, TOTALS
from wamnet.compiler.scenes.smooth_kernel import (
    GUIDED,
    HERE,
    LAYERS_READ,
    LIGHT_PLANES,
    SPLINE,
    SUMS,
    THERE,
    WEIGHTS,
)
from wamnet.refimpl.network import smoothing


def _guided(kernel: Artifact, held: Mapping[str, Any], integers: Mapping[str, int]) -> None:
    """Fill the planes of guides and light (n, H, W) for layers (H, W, C)."""
    given = {
        f"{layer.name}_{c}": held[f"{IMAGE}{layer.name}"][..., c]
        for layer in LAYERS_READ
        for c in range(layer.channels)
    }
    found = interpret(kernel.programs.guide, given)
    for array, names in ((GUIDES, kernel.programs.guides), (LIGHT, LIGHT_PLANES)):
        held[array][:] = [found[name] for name in names]


def _encoded(kernel: Artifact, held: Mapping[str, Any], integers: Mapping[str, int]) -> None:
    """Fill the images (H, W, C) of sums (P, H, W)."""
    sums = dict(zip(kernel.planes, held[SUMS_ARRAY], strict=True))
    samples = np.full(held[SUMS_ARRAY].shape[1:], integers["sample_count"], np.float32)
    found = interpret(kernel.programs, {**sums, SAMPLES: samples})
    for image in kernel.images:
        channels = [found[f"{image.name}_{c}"] for c in range(image.channels)]
        held[f"{IMAGE}{image.name}"][:] = np.stack(channels, axis=-1)


def _smoothed(kernel: Artifact, held: Mapping[str, Any], integers: Mapping[str, int]) -> None:
    """Fill the planes of light (3, H, W) after one level."""
    programs, (_, height, width) = kernel.programs, held[LIGHT].shape
    guides = dict(zip(programs.guides, held[GUIDES], strict=True))
    here = {f"{HERE}{name}": plane for name, plane in guides.items()}
    sums = dict.fromkeys((*SUMS, WEIGHTS), np.zeros((height, width), np.float32))
    for spline, rows, columns in smoothing.taps(height, width, integers["gap"]):
        at = np.ix_(rows, columns)
        there = {f"{THERE}{name}": guides[name][at] for name in GUIDED}
        light = {name: plane[at] for name, plane in zip(LIGHT_PLANES, held[LIGHT], strict=True)}
        sums = interpret(
            programs.tap, {**here, **there, **light, **sums, SPLINE: np.asarray(spline, np.float32)}
        )
    found = interpret(programs.mean, sums)
    held[RESULT][:] = [found[name] for name in LIGHT_PLANES]


def _followed(kernel: Artifact, held: Mapping[str, Any], integers: Mapping[str, int]) -> None:
    """Fill the planes (P, H, W) of a history with one picture more."""
    programs, (_, height, width) = kernel.programs, held[PAST].shape
    motions, color = held[MOTIONS], held[f"{IMAGE}color"]
    here = dict(zip(history_kernel.FIRST, held[FIRST], strict=True))
    here |= {name: color[..., c] for c, name in enumerate(COLOR)}
    here |= dict(zip(MOTION, np.moveaxis(motions[here[NUMBER].astype(np.int32)], -1, 0), strict=True))
    sizes = dict(zip(SIZE, (np.float32(width), np.float32(height)), strict=True))
    here |= {**dict(zip(history_kernel.CAMERAS, held[CAMERAS], strict=True)), **sizes}
    here |= interpret(programs.find, here)
    sums = {
        name: np.full((height, width), start, np.float32) for name, start in zip(TOTALS, STARTS, strict=True)
    }
    y, x = np.indices((height, width))
    for beyond in product((False, True), (False, True)):
        line, column = y + here["down"] + beyond[0], x + here["across"] + beyond[1]
        inside = here["ahead"] & (line >= 0) & (line < height) & (column >= 0) & (column < width)
        at = np.where(inside, line, 0), np.where(inside, column, 0)
        there = {
            f"{THERE}{name}": plane[at] for name, plane in zip(history_kernel.PAST, held[PAST], strict=True)
        }
        rests = motions[there[f"{THERE}{NUMBER}"].astype(np.int32), MOTION.index(RESTS)]
        flags = dict(zip(BEYOND, (np.asarray(beyond[1]), np.asarray(beyond[0])), strict=True))
        found = interpret(programs.take, {**here, **there, **flags, **sums, f"{THERE}{RESTS}": rests})
        sums = {name: np.where(inside, found[name], sums[name]) for name in TOTALS}
    here |= interpret(programs.blend, {**here, **sums})
    held[RESULT][:] = [here[name] for name in history_kernel.PAST]


INTERPRETED: Mapping[str, Callable[[Artifact, Mapping[str, Any], Mapping[str, int]], None]] = {
    ENCODE: _encoded,
    GUIDE: _guided,
    SMOOTH: _smoothed,
    FOLLOW: _followed,
}
"""What interprets kernels on planes, by role."""
