"""The three passes of a pipeline on one device, for kernels/run/pipeline.py.

    path kernel -> sums -> encoding kernel -> feature images -> denoising kernel -> picture

Sums, images and picture are made once for a size and stay on the device; only [`Passes.read`] copies
anything to the host. Passes are ordered: each sees what the one before it has written.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import IMAGE, RESULT, SCENE_NUMBERS, SUMS
from .executor import Executor
from .images import images_of
from .kernel import Memory, Part, Size, numbers_for, shapes

PICTURE = "picture"
"""Name under which the result is read."""


class Passes:
    """Kernels with their images on a device; a context manager that gives the images back."""

    def __init__(self, executor: Executor, encode: Artifact, denoise: Artifact, size: Size) -> None:
        """Keep images of `size` (height, width) on the device for these kernels."""
        for artifact in (encode, denoise):
            executor._check_target(artifact)
        executor.check_size(denoise, size)
        self.encoder, self.denoiser, self.size = encode, denoise, size
        self._executor, self._sums = executor, Memory((), None)
        self._numbers, self._given = Memory((), None), np.zeros(0, np.float32)
        with executor._session(size), ExitStack() as made:
            self._images = executor._images(encode.images, size, made)
            self._written = [executor._made(RESULT, shape, made) for shape in shapes(denoise, size)]
            self._giving_back = made.pop_all()

    def trace(self, kernel: Artifact, part: Part, numbers: NDArray[np.float32] | None = None) -> None:
        """Start the paths of a part that is the whole picture, by a kernel with the encoder's planes.

        One that writes encoded images leaves nothing to encode. `numbers` (n,): those of the scene that are
        the kernel's inputs, by default those of its own scene.
        """
        executor = self._executor
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
            self._numbers, self._given = self._executor._store(SCENE_NUMBERS, found), found
        return {SCENE_NUMBERS: self._numbers}

    def encode(self, samples: int) -> None:
        """Start the encoding of sums over so many samples."""
        executor = self._executor
        executor.build(self.encoder)
        with executor._session(self.size):
            executor._turn(self.encoder, self._sums, self._images, samples)

    def denoise(self) -> None:
        """Start the denoiser on the images that it reads."""
        executor = self._executor
        executor.build(self.denoiser, self.size)
        images = {image.name: self._images[image.name] for image in images_of(self.denoiser)}
        with executor._session(self.size):
            executor._chain(self.denoiser, images, self._written)

    def read(self, name: str) -> NDArray[np.float32]:
        """Copy an image to the host, (H, W, C): a feature by name, or the result, [`PICTURE`]."""
        with self._executor._session(self.size):
            return self._executor._fetch(*self._held(name))

    def read_later(self, name: str) -> Callable[[], NDArray[np.float32]]:
        """Begin to copy an image to the host, and return what waits for it: passes may start meanwhile."""
        with self._executor._session(self.size):
            return self._executor._fetch_later(*self._held(name))

    def _held(self, name: str) -> tuple[str, Memory]:
        """Return a kernel's name for an image, and its memory."""
        return (RESULT, self._written[-1]) if name == PICTURE else (f"{IMAGE}{name}", self._images[name])

    def finish(self) -> None:
        """Wait until all passes that were started have ended; reading waits by itself."""
        with self._executor._session(self.size):
            self._executor._finish()

    def close(self) -> None:
        """Give the images back."""
        with self._executor._session():
            self._sums, self._numbers = self._dropped(self._sums), self._dropped(self._numbers)
            self._giving_back.close()
        self._images, self._written = {}, []

    def _dropped(self, old: Memory) -> Memory:
        """Give memory back, if there is any, and return none."""
        if old.shape:
            self._executor._release(old)
        return Memory((), None)

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
