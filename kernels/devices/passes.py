"""The three passes of a pipeline on one device: what each executor provides for kernels/run/pipeline.py.

    path kernel -> sums -> encoding kernel -> feature images -> denoising kernel -> picture

Sums, images and picture are made once for a size and stay on the device; only [`Passes.read`] copies
anything to the host. Passes are ordered: each sees what the one before it has written.

On devices whose memory is the host's the passes are the plain composition of the three kernels, which is the
definition of all others [`HostPasses`].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.scenes.encode_kernel import EncodeArtifact
from ...compiler.scenes.path_kernel import PathArtifact
from .executor import Executor, Part
from .images import images_of

PICTURE = "picture"
"""Name under which the result is read."""


class Passes(ABC):
    """Kernels with their images on a device; a context manager that gives the images back."""

    def __init__(self, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]) -> None:
        self.encoder, self.denoiser, self.size = encode, denoise, size

    @abstractmethod
    def trace(self, kernel: PathArtifact, part: Part) -> None:
        """Leave the sums of a part that is the whole picture, by a kernel with the encoder's planes."""

    @abstractmethod
    def encode(self, samples: int) -> None:
        """Turn sums over so many samples into feature images."""

    @abstractmethod
    def denoise(self) -> None:
        """Turn feature images into the picture."""

    @abstractmethod
    def read(self, name: str) -> NDArray[np.float32]:
        """Copy an image to the host, (H, W, C): a feature by name, or the result, [`PICTURE`]."""

    def finish(self) -> None:
        """Wait until all passes that were started have ended; reading waits by itself."""

    def close(self) -> None:
        """Give the images back."""

    def channels(self, name: str) -> int:
        """Return the number of channels of a feature's image, or of the picture."""
        counts = {image.name: image.channels for image in self.encoder.images}
        return 3 if name == PICTURE else counts[name]

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class HostPasses(Passes):
    """What one kernel returns is what the next one is given."""

    def __init__(
        self, executor: Executor, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]
    ) -> None:
        super().__init__(encode, denoise, size)
        self._executor = executor
        self._sums = np.zeros((0, 0, 0), np.float32)
        self._images: dict[str, NDArray[np.float32]] = {}

    def trace(self, kernel: PathArtifact, part: Part) -> None:
        """Keep the sums (planes, H, W)."""
        self._sums = self._executor.trace(kernel, part)

    def encode(self, samples: int) -> None:
        """Keep the feature images."""
        self._images = dict(self._executor.encode(self.encoder, self._sums, samples))

    def denoise(self) -> None:
        """Run the denoiser on the images that it reads."""
        wanted = {image.name: self._images[image.name] for image in images_of(self.denoiser)}
        self._images[PICTURE] = self._executor.run(self.denoiser, wanted)

    def read(self, name: str) -> NDArray[np.float32]:
        """Return an image."""
        return self._images[name]
