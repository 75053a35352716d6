"""What runs on one device without leaving it: the passes of a pipeline, and the edge-avoiding filter.

    path kernel -> sums -> encoding kernel -> feature images -> denoising kernel -> picture

Sums, images and picture of a pipeline are made once for a size and stay on the device; only [`Passes.read`]
copies anything to the host. Passes are ordered: each sees what the one before it has written.

The edge-avoiding filter takes layers of a frame, and an encoded feature image comes back [`Filter`]; light
is in two arrays that change places from level to level:

    layers -> guide -> guides, light -> smooth, gaps of 1, 2, 4 -> light -> encode -> feature image

Rows of planes are filled up to whole work items; what is beyond the picture means nothing, and is not read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact, SmoothKernels
from ...compiler.kernel.interface import GUIDES, IMAGE, LIGHT, RESULT, SCENE_NUMBERS, SUMS
from ...compiler.scenes.smooth_kernel import FEATURE
from ...refimpl.network.dataset import known
from ...refimpl.network.smoothing import LEVELS
from .executor import Executor
from .kernel import Closing, Memory, Part, Size, images_of, numbers_for, plane_integers, plane_shape, shapes

PICTURE = "picture"
"""Name under which the result is read."""


@dataclass
class Passes(Closing):
    """Kernels with their images of `size` (height, width) on a device, which a context manager gives back."""

    executor: Executor
    encoder: Artifact
    denoiser: Artifact
    size: Size

    def __post_init__(self) -> None:
        """Make the images."""
        executor, size = self.executor, self.size
        for artifact in (self.encoder, self.denoiser):
            executor._check_target(artifact)
        executor.check_size(self.denoiser, size)
        self._sums, self._numbers, self._given = Memory((), None), Memory((), None), np.zeros(0, np.float32)
        with executor._session(size), ExitStack() as made:
            self._images = executor._images(self.encoder.images, size, made)
            self._written = [executor._made(RESULT, shape, made) for shape in shapes(self.denoiser, size)]
            self._giving_back = made.pop_all()

    def trace(self, kernel: Artifact, part: Part, numbers: NDArray[np.float32] | None = None) -> None:
        """Start the paths of a part that is the whole picture, by a kernel with the encoder's planes.

        One that writes encoded images leaves nothing to encode. `numbers` (n,): those of the scene that are
        the kernel's inputs, by default those of its own scene.
        """
        executor = self.executor
        executor.build(kernel)
        if kernel.images:
            written = {f"{IMAGE}{image.name}": self._images[image.name] for image in kernel.images}
            with executor._session(self.size):
                executor.start(kernel, {**written, **self._moving(kernel, numbers)}, part.integers)
            return
        shape = executor.sums_shape(kernel, part.rows, part.width)
        with executor._session(self.size):
            if shape != self._sums.shape:
                self._sums = self._dropped(self._sums)
                self._sums = executor._memory(SUMS, shape)
            arrays = {SUMS: self._sums, **self._moving(kernel, numbers)}
            executor.start(kernel, arrays, part.integers)

    def _moving(self, kernel: Artifact, numbers: NDArray[np.float32] | None) -> dict[str, Memory]:
        """Return the memory of the scene's numbers, where they are inputs; the same are not written again."""
        if not kernel.programs.inputs:
            return {}
        found = numbers_for(kernel, numbers)
        if found.tobytes() != self._given.tobytes():
            self._numbers = self._dropped(self._numbers)
            self._numbers, self._given = self.executor._store(SCENE_NUMBERS, found), found
        return {SCENE_NUMBERS: self._numbers}

    def encode(self, samples: int) -> None:
        """Start the encoding of sums over so many samples."""
        executor = self.executor
        executor.build(self.encoder)
        with executor._session(self.size):
            executor._turn(self.encoder, self._sums, self._images, samples)

    def denoise(self) -> None:
        """Start the denoiser on the images that it reads."""
        executor = self.executor
        executor.build(self.denoiser, self.size)
        images = {image.name: self._images[image.name] for image in images_of(self.denoiser)}
        with executor._session(self.size):
            executor._chain(self.denoiser, images, self._written)

    def read(self, name: str) -> Callable[[], NDArray[np.float32]]:
        """Begin to copy an image (H, W, C) to the host: a feature by name, or the result, [`PICTURE`].

        What is returned waits for it, and passes may start meanwhile.
        """
        named = (RESULT, self._written[-1]) if name == PICTURE else (f"{IMAGE}{name}", self._images[name])
        with self.executor._session(self.size):
            content = self.executor._fetch_later(*named)

        def waited() -> NDArray[np.float32]:
            with self.executor._session(self.size):
                return content()

        return waited

    def finish(self) -> None:
        """Wait until all passes that were started have ended; reading waits by itself."""
        with self.executor._session(self.size):
            self.executor._finish()

    def close(self) -> None:
        """Give the images back."""
        with self.executor._session():
            self._sums, self._numbers = self._dropped(self._sums), self._dropped(self._numbers)
            self._giving_back.close()
        self._images, self._written = {}, []

    def _dropped(self, old: Memory) -> Memory:
        """Give memory back, if there is any, and return none."""
        if old.shape:
            self.executor._release(old)
        return Memory((), None)


# ---- kernels on planes ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Filter:
    """The kernels of the filter, built on a device."""

    executor: Executor
    kernels: SmoothKernels

    def __post_init__(self) -> None:
        """Build the kernels."""
        for kernel in self.kernels:
            self.executor._check_target(kernel)
            self.executor.build(kernel)

    def image(self, layers: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the feature image (H, W, 3) of layers (H, W, C) by what they are to the filter.

        They are color, normal, albedo, position and depth; NaN counts as 0.
        """
        executor, (guide, smooth, encode) = self.executor, self.kernels
        with np.errstate(over="ignore"):
            layers = {name: known(values.astype(np.float32)) for name, values in layers.items()}
        height, width = layers[FEATURE].shape[:2]
        with executor._session((height, width)), ExitStack() as made:
            integers = plane_integers(smooth, (height, width))
            images = {f"{IMAGE}{name}": values for name, values in layers.items()}
            arrays = {name: executor._stored(name, values, made) for name, values in images.items()}
            shapes = {array.name: array.shape for array in smooth.interface.arrays}
            guides, light, other = (
                executor._made(name, plane_shape(shapes[name], integers), made)
                for name in (GUIDES, LIGHT, LIGHT)
            )
            executor.start(guide, {**arrays, GUIDES: guides, LIGHT: light}, integers)
            for level in range(LEVELS):
                integers["gap"] = 2**level
                executor.start(smooth, {GUIDES: guides, LIGHT: light, RESULT: other}, integers)
                light, other = other, light
            written = executor._images(encode.images, (height, width), made)
            executor._turn(encode, light, written, 1)
            return executor._fetch(f"{IMAGE}{FEATURE}", written[FEATURE])
