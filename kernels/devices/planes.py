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

from ...compiler.artifact import Artifact, SmoothKernels
from ...compiler.kernel.interface import GUIDES, IMAGE, LIGHT, PAST, RESULT
from ...compiler.scenes.smooth_kernel import FEATURE
from ...refimpl.network.dataset import known
from ...refimpl.network.smoothing import LEVELS
from .executor import Executor
from .kernel import plane_integers, plane_shape


def smoothed(
    executor: Executor, kernels: SmoothKernels, layers: Mapping[str, NDArray[Any]]
) -> NDArray[np.float32]:
    """Return the feature image (H, W, 3) of the filter, at layers (H, W, C) by what they are to it.

    They are color, normal, albedo, position and depth; NaN counts as 0.
    """
    with np.errstate(over="ignore"):
        layers = {name: known(values.astype(np.float32)) for name, values in layers.items()}
    for kernel in kernels:
        executor._check_target(kernel)
        executor.build(kernel)
    height, width = layers[FEATURE].shape[:2]
    with executor._session((height, width)), ExitStack() as made:
        integers = plane_integers(kernels.smooth, (height, width))
        arrays = {
            f"{IMAGE}{name}": executor._stored(f"{IMAGE}{name}", values, made)
            for name, values in layers.items()
        }
        shapes = {array.name: array.shape for array in kernels.smooth.interface.arrays}
        guides, light, other = (
            executor._made(name, plane_shape(shapes[name], integers), made) for name in (GUIDES, LIGHT, LIGHT)
        )
        executor.start(kernels.guide, {**arrays, GUIDES: guides, LIGHT: light}, integers)
        for level in range(LEVELS):
            integers["gap"] = 2**level
            executor.start(kernels.smooth, {GUIDES: guides, LIGHT: light, RESULT: other}, integers)
            light, other = other, light
        images = executor._images(kernels.encode.images, (height, width), made)
        executor._turn(kernels.encode, light, images, 1)
        return executor._fetch(f"{IMAGE}{FEATURE}", images[FEATURE])


def followed(
    executor: Executor, kernel: Artifact, arrays: Mapping[str, NDArray[np.float32]]
) -> NDArray[np.float32]:
    """Return the planes (P, H, W) that an image leaves for the next one (refimpl/light/history.py).

    `arrays` are those of the kernel by name: planes of first hits and of the last image, the colour
    (H, W, 3), rows of motions, cameras.
    """
    _, height, width = arrays[PAST].shape
    return executor.call(kernel, arrays, plane_integers(kernel, (height, width)))[RESULT]
