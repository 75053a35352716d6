"""Kernels on planes on a device: the edge-avoiding filter, and a history.

Layers of a frame go there, an encoded feature image comes back:

    layers -> guide -> guides, light -> smooth, gaps of 1, 2, 4 -> light -> encode -> feature image

First hits, the last picture and a new colour go there, this picture comes back:

    first, past, color, motions, cameras -> follow -> result

Light is in two arrays that change places from level to level. Rows of planes are filled up to whole work
items; what is beyond the picture means nothing, and is not read.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.languages.interface import GUIDES, IMAGE, LIGHT, PAST, PRIMITIVES, READ, RESULT
from ...compiler.scenes.plane_kernel import PlaneArtifact
from ...compiler.scenes.smooth_kernel import FEATURE, SmoothKernels
from ...refimpl.network.smoothing import LEVELS
from .executor import Executor, Memory, Size


def smoothed(
    executor: Executor, kernels: SmoothKernels, layers: Mapping[str, NDArray[np.float32]]
) -> NDArray[np.float32]:
    """Return the feature image (H, W, 3) of layers (H, W, C), float32, without NaN, by what they guide."""
    for kernel in (kernels.guide, kernels.smooth, kernels.encode):
        executor._check_target(kernel)
        executor.build(kernel)
    height, width = layers[FEATURE].shape[:2]
    with executor._session((height, width)), ExitStack() as made:
        integers = _integers(kernels.smooth, (height, width))
        arrays = {
            f"{IMAGE}{name}": executor._stored(f"{IMAGE}{name}", values, made)
            for name, values in layers.items()
        }
        shapes = {array.name: array.shape for array in kernels.smooth.interface.arrays}
        guides, light, other = (
            _memory(executor, name, shapes[name], integers, made) for name in (GUIDES, LIGHT, LIGHT)
        )
        _start(executor, kernels.guide, {**arrays, GUIDES: guides, LIGHT: light}, integers)
        for level in range(LEVELS):
            integers["gap"] = 2**level
            _start(executor, kernels.smooth, {GUIDES: guides, LIGHT: light, RESULT: other}, integers)
            light, other = other, light
        images = executor._images(kernels.encode.images, (height, width), made)
        executor._turn(kernels.encode, light, images, 1)
        return executor._fetch(f"{IMAGE}{FEATURE}", images[FEATURE])


def followed(
    executor: Executor, kernel: PlaneArtifact, arrays: Mapping[str, NDArray[np.float32]]
) -> NDArray[np.float32]:
    """Return the planes (P, H, W) that a picture leaves, of a history's arrays by the kernel's names."""
    executor._check_target(kernel)
    executor.build(kernel)
    _, height, width = arrays[PAST].shape
    with executor._session((height, width)), ExitStack() as made:
        integers = _integers(kernel, (height, width))
        given = {name: executor._stored(name, values, made) for name, values in arrays.items()}
        result = kernel.interface.named(RESULT)
        assert result is not None
        memory = _memory(executor, PAST, result.shape, integers, made)
        _start(executor, kernel, {**given, RESULT: memory}, integers)
        return executor._fetch(PAST, memory)


def run_once(executor: Executor, kernel: PlaneArtifact, size: Size) -> None:
    """Run a kernel once on zeros."""
    with executor._session(size), ExitStack() as made:
        integers = {**_integers(kernel, size), "gap": 1, PRIMITIVES: 1}
        arrays = {}
        for array in kernel.interface.arrays:
            shape = _shape(array.shape, integers)
            if array.access == READ:
                arrays[array.name] = executor._stored(array.name, np.zeros(shape, np.float32), made)
            else:
                name = LIGHT if array.name == RESULT else array.name
                arrays[array.name] = _memory(executor, name, array.shape, integers, made)
        _start(executor, kernel, arrays, integers)
        executor._finish()


def _integers(kernel: PlaneArtifact, size: Size) -> dict[str, int]:
    """Return a kernel's integers for a picture: rows of planes are whole work items."""
    height, width = size
    return {"width": width, "height": height, "row_stride": -(-width // kernel.lanes) * kernel.lanes}


def _shape(named: tuple[int | str, ...], integers: Mapping[str, int]) -> tuple[int, ...]:
    """Return an array's shape in numbers."""
    return tuple(integers[n] if isinstance(n, str) else n for n in named)


def _memory(
    executor: Executor, name: str, named: tuple[int | str, ...], integers: Mapping[str, int], made: ExitStack
) -> Memory:
    """Return memory for an array, which `made` gives back."""
    memory = executor._memory(name, _shape(named, integers))
    made.callback(executor._release, memory)
    return memory


def _start(
    executor: Executor, kernel: PlaneArtifact, arrays: Mapping[str, Memory], integers: Mapping[str, Any]
) -> None:
    """Start a built kernel."""
    executor._start(kernel, executor._built[kernel.digest].prepared, arrays, integers)
