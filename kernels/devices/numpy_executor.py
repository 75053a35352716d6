"""The interpreters of the IR as an executor: all windows of a block of rows at once, in float32.

Kernels on planes are run as they are (compiler/kernel/run.py). The path tracer is the skeleton that path
kernels have (compiler/scenes/emit_path.py), with all paths of a part as lanes: it defines what they add up.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import NONE, Artifact
from ...compiler.core.interpret import interpret
from ...compiler.kernel.interface import DENOISE, IMAGE, PATH, READ, RESULT, SCENE_NUMBERS
from ...compiler.kernel.interface import SUMS as PATH_SUMS
from ...compiler.kernel.run import run_on
from ...compiler.scenes.lower_scene import WAY, PathPrograms
from ...compiler.schedules.common import kernel_gather
from ...refimpl.network import dataset
from .executor import Executor
from .kernel import Memory

BLOCK_NUMBERS = 2**22
"""Numbers in the windows of one block of rows: 16 MiB in float32, for images of any height."""


class NumpyExecutor(Executor):
    """Runs the program itself; there is nothing to build."""

    name = "numpy"
    interprets = True

    def __init__(self) -> None:
        super().__init__()
        self.device = f"NumPy {np.__version__}"

    def _prepare(self, kernel: Artifact) -> Any:
        """Do nothing: programs are interpreted."""

    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        held = {name: memory.held for name, memory in arrays.items()}
        if kernel.role == PATH:
            held[PATH_SUMS][:] = _traced(kernel, integers, held.get(SCENE_NUMBERS, NONE))
        elif kernel.role == DENOISE:
            images = [held[f"{IMAGE}{image.name}"] for image in kernel.images]
            _denoised(kernel, np.concatenate(images, axis=-1), held[RESULT])
        else:
            taken = {a.name: held[a.name] for a in kernel.interface.arrays if a.access == READ}
            for name, content in run_on(kernel.kernel, taken, integers).items():
                held[name][:] = content


def _traced(
    kernel: Artifact, integers: Mapping[str, int], numbers: NDArray[np.float32]
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


def _denoised(artifact: Artifact, image: NDArray[np.float32], result: NDArray[np.float32]) -> None:
    """Fill the output (H, W, C) of one kernel for its images, joined."""
    gather = kernel_gather(artifact.programs)
    height, width, _ = image.shape
    padded = dataset.pad(image, gather.window, gather.axes)
    rows = max(1, BLOCK_NUMBERS // (width * gather.n_inputs))
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        # These rows and the margin around them are all that their pixels see.
        strip = padded[top : bottom + gather.rows - 1]
        windows = dataset.all_windows(strip, gather.window, gather.axes)
        (value,) = interpret(artifact.programs, {"window": windows}).values()
        result[top:bottom] = np.reshape(value, (bottom - top, width, -1)) if np.ndim(value) > 1 else value


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
