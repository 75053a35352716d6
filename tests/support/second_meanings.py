"""A second meaning of kernels that run in NumPy: all pixels, or paths, at once, each program interpreted.

The path tracer is the skeleton that path kernels have (compiler/scenes/emit_path.py), written again.
"""

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.compiler.artifact import NONE, Artifact
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
from wamnet.compiler.scenes.lower_scene import WAY, PathPrograms
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


# ---- paths -------------------------------------------------------------------------------------------------


def traced(
    kernel: Artifact, integers: Mapping[str, int], numbers: NDArray[np.float32] = NONE
) -> NDArray[np.float32]:
    """Return the sums (planes, rows, width) of a part, with these numbers of the scene."""
    shape = (integers["rows"], integers["width"])
    y, x = (a.astype(np.uint32) for a in np.indices(shape))
    state: dict[str, Any] = {
        "x": x,
        "y": y + np.uint32(integers["first_row"]),
        "seed": np.full(shape, integers["seed_number"], np.uint32),
        "width": np.float32(integers["width"]),
        "height": np.float32(integers["height"]),
        **dict(zip(kernel.programs.inputs, numbers, strict=True)),
    }
    sums, rays = {plane: np.zeros(shape, np.float32) for plane in kernel.planes}, kernel.programs.rays
    # Paths that have ended are computed on, and may leave the range of numbers.
    with np.errstate(all="ignore"):
        for n in range(integers["samples"]):
            state["sample_number"] = np.full(shape, (integers["first_sample"] + n) % 2**32, np.uint32)
            first, end = follow(kernel.programs, state)
            # Features of their own rays are those of the first path, and of the further ones.
            if n and rays:
                first = dict.fromkeys(first, np.float32(0))
            _add(sums, first, end, np.float32(n))
        for n in range(1, rays.count if rays else 1):
            state["sample_number"] = np.full(shape, (integers["first_sample"] + n) % 2**32, np.uint32)
            for plane, value in looked(kernel.programs, state).items():
                if plane in sums:
                    _sum(sums, plane, value)
    return np.stack(list(sums.values()))


def follow(programs: PathPrograms, given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Follow paths; return the features of what they meet first and their state in the end.

    given holds the inputs of `start`: x, y, seed, sample_number (...), width and height; and the scene's
    numbers that are inputs of all programs.
    """
    state: dict[str, Any] = {**given, **interpret(programs.parts["start"], given)}
    state["alive"] = state["way_going"] = np.ones(state["x"].shape, bool)
    state["way_length"] = np.zeros(state["x"].shape, np.float32)
    first: dict[str, Any] = {}
    for depth in range(programs.settings.max_depth + 1):
        state["depth"] = np.full(state["x"].shape, depth, np.uint32)
        state = _masked(state, interpret(programs.parts["arrive"], state))
        if depth == 0:
            first = interpret(programs.parts["look"], state) | lit(programs, state)
        if "see" in programs.parts and (depth == 0 or programs.most_followed > 0):
            found = interpret(programs.parts["see"], state)
            state |= {name: found.pop(name) for name in WAY if name in found}
            first |= {name: first.get(name, np.float32(0)) + value for name, value in found.items()}
        if depth == programs.settings.max_depth:
            break
        state = _masked(state, interpret(programs.parts["scatter"], state))
        if not state["alive"].any():
            break
    return first, state


def looked(programs: PathPrograms, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the features of the first surfaces of the features' own rays; given as for [`follow`]."""
    state = {**given, **interpret(programs.parts["ray"], given)}
    state |= interpret(programs.parts["arrive"], state)
    return interpret(programs.parts["look"], state) | lit(programs, state)


def lit(programs: PathPrograms, state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of the layer `direct`, by plane: first surfaces' emission, then their shadow rays."""
    if "shadow" not in programs.parts:
        return {}
    found: dict[str, Any] = {f"direct_{c}": [state[f"radiance_{c}"]] for c in "rgb"}
    for number in range(programs.shadow_rays):
        given = {**state, "shadow_number": np.full(state["x"].shape, number, np.uint32)}
        for plane, part in interpret(programs.parts["shadow"], given).items():
            found[plane].append(part)
    return found


def _masked(state: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state with new values; the radiance of a path that has ended stays as it is."""
    alive = state["alive"]
    kept = {name: np.where(alive, new[name], state[name]) for name in new if name.startswith("radiance")}
    ended = {"alive": alive & new["alive"]} if "alive" in new else {}
    return {**state, **new, **kept, **ended}


def _sum(sums: dict[str, Any], plane: str, value: Any) -> None:
    """Add a value to a plane, or a list of values one after another, as a kernel does."""
    for part in value if isinstance(value, list) else (value,):
        sums[plane] += part


def _add(sums: dict[str, Any], first: Mapping[str, Any], end: Mapping[str, Any], n: np.float32) -> None:
    """Add a path to the sums, `n` being the number of samples before it."""
    one = np.float32(1)
    weight = one / (n * (n + one)) if n else np.float32(0)
    if "deviation_r" in sums:
        for c in "rgb":
            sums[f"deviation_{c}"] += (end[f"radiance_{c}"] * n - sums[f"color_{c}"]) ** 2 * weight
    for plane in sums:
        if plane in first:
            _sum(sums, plane, first[plane])
        elif plane.startswith("color"):
            sums[plane] += end[plane.replace("color", "radiance")]
        elif not plane.startswith("deviation"):
            sums[plane] += end[plane.removeprefix("last_")].astype(np.float32)
