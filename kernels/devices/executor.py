"""What every executor is: something that builds an artifact and runs it on images.

`build` is idempotent and does all that can be done before the pixels are known, the driver's own delayed
compilation included (it runs the kernel once on a few pixels). `run` copies the images to the device, runs,
and copies the result back; the times that wamnet reports mean these two [`denoise_on.RunResult`].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.languages.interface import UNSIGNED, Interface
from ...compiler.scenes.encode_kernel import EncodeArtifact
from ...compiler.scenes.path_kernel import PathArtifact
from ...compiler.schedules.schedules import PLAIN
from ...compiler.training.step_kernel import StepKernel
from ...refimpl.errors import InputError
from .images import Images, checked

if TYPE_CHECKING:
    from .passes import Passes

T = TypeVar("T")

KEPT_KERNELS = 64
"""Kernels that an executor keeps built: programs use a few; a process that makes thousands stays small."""

INDEX_LIMIT = 2**31
"""Numbers of an image must be fewer where a kernel's indices are `int`."""


@dataclass(frozen=True)
class Part:
    """A part of a render: rows [first_row, first_row + rows) of an image, samples from first_sample on."""

    width: int
    height: int
    first_row: int
    rows: int
    first_sample: int
    samples: int
    seed: int

    @property
    def integers(self) -> dict[str, int]:
        """Return what a path kernel is given, by the names of its interface."""
        return {"seed_number" if name == "seed" else name: value for name, value in vars(self).items()}


def in_order(kernel: Interface, given: Mapping[str, int]) -> list[np.integer[Any]]:
    """Return a kernel's integers in the order and of the types in which it takes them."""
    return [(np.uint32 if name in UNSIGNED else np.int32)(given[name]) for name in kernel.integers]


class Executor(ABC):
    """A device that is open; a context manager that closes it. `name` is its target, `device` a text.

    `lanes` is the number of paths that its path kernels should follow at once, `schedule` the name of the
    schedule that suits a denoiser on it, for pictures of at least `schedule_pixels`: smaller ones are done
    with the plain kernel before the other is compiled; `schedule_reason` says why. `driver` is the driver's
    version, where `device` does not name it. `trains` says whether it has a compiled trainer. `homes` are the
    homes of weights, apart from the target's usual one, whose kernels it runs
    [compiler/languages/interface.py].
    """

    name: str
    device: str
    lanes: int = 1
    schedule: str = PLAIN
    schedule_pixels: int = 0
    schedule_reason: str = "the only one"
    driver: str = ""
    trains: bool = False
    homes: tuple[str, ...] = ()

    @abstractmethod
    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Make the artifact ready to run on images of `size` (height, width); again costs nothing."""

    @abstractmethod
    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        """Run on checked images (H, W, C)."""

    @abstractmethod
    def build_path(self, kernel: PathArtifact) -> None:
        """Make a path kernel ready to run; again costs nothing."""

    @abstractmethod
    def _trace(self, kernel: PathArtifact, part: Part) -> NDArray[np.float32]:
        """Return the sums (planes, rows, width) of a part."""

    def schedule_for(self, size: tuple[int, int]) -> str:
        """Return the name of the schedule that suits one picture of `size` (height, width)."""
        return self.schedule if size[0] * size[1] >= self.schedule_pixels else PLAIN

    def _passes(self, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]) -> Passes:
        """Return the passes of checked kernels over a picture: by default their plain composition."""
        from .passes import HostPasses

        return HostPasses(self, encode, denoise, size)

    def _encode(self, kernel: EncodeArtifact, sums: NDArray[np.float32], samples: int) -> Images:
        """Return the encoded images of checked sums."""
        rule = "its encodings run in pipelines only, where nothing leaves the device"
        raise InputError("executor of an encoding by itself", self.name, rule, "use kernels.Pipeline")

    def passes(self, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]) -> Passes:
        """Return passes over a picture of `size` (height, width), whose images stay on the device."""
        for artifact in (encode, denoise):
            self._check_target(artifact)
        self.check_size(denoise, size)
        return self._passes(encode, denoise, size)

    def forget(self) -> None:
        """Drop the kernels that were built: the next build is the driver's."""

    def open_trainer(self, kernel: StepKernel, values: NDArray[Any], targets: NDArray[Any]) -> Any:
        """Return a trainer (opencl_trainer.py) for pictures laid out end to end, or refuse."""
        rule = "it has no compiled trainer"
        raise InputError(
            "executor that trains", self.name, rule, "use executor opencl, or refimpl.network.train"
        )

    def close(self) -> None:
        """Give the device back."""

    def trace(self, kernel: PathArtifact, part: Part) -> NDArray[np.float32]:
        """Return the sums (planes, rows, width) over the samples of a part of an image."""
        self._check_target(kernel)
        self.build_path(kernel)
        return self._trace(kernel, part)

    def encode(self, kernel: EncodeArtifact, sums: NDArray[np.float32], samples: int) -> Images:
        """Return the encoded images (H, W, C) of sums (planes, H, W) over so many samples, by name."""
        self._check_target(kernel)
        return self._encode(kernel, np.ascontiguousarray(sums), samples)

    def run(self, artifact: Artifact, inputs: Images) -> NDArray[np.float32]:
        """Return the output (H, W, C) for encoded feature images (H, W, C), float32, by name."""
        images = checked(artifact, inputs)
        self._check_target(artifact)
        height, width = next(iter(images.values())).shape[:2]
        self.check_size(artifact, (height, width))
        self.build(artifact, (height, width))
        return self._run(artifact, images)

    def check_size(self, artifact: Artifact, size: tuple[int, int]) -> None:
        """Refuse images of a size (height, width) that the device cannot hold."""

    def _check_target(self, artifact: Artifact | PathArtifact | EncodeArtifact) -> None:
        """Refuse a kernel in another language."""
        if artifact.target not in (self.name, *(f"{self.name}:{home}" for home in self.homes)):
            raise InputError(
                f"artifact for executor {self.name!r}: target",
                artifact.target,
                f"must be {self.name}",
                f"compile the program for {self.name}",
            )

    def __enter__(self) -> Any:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def keep(built: dict[str, T], digest: str, thing: T) -> list[T]:
    """Put a built kernel into `built` as the newest, and return those that fall out: the oldest."""
    built.pop(digest, None)
    built[digest] = thing
    return [built.pop(next(iter(built))) for _ in range(len(built) - KEPT_KERNELS)]
