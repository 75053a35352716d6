"""What kernels are given: parts of a render, integers, arrays on a device, and checked images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.core.ir import Image
from ...compiler.kernel.interface import UNSIGNED, Interface
from ...refimpl.errors import InputError

Size = tuple[int, int]
"""Height and width."""

_Closed = TypeVar("_Closed", bound="Closing")


class Closing:
    """What is closed at the end of a `with` block."""

    def close(self) -> None:
        """Give back what it holds."""

    def __enter__(self: _Closed) -> _Closed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


BATCH_TILES = 128
"""Most tiles that launches compute at once: 50 MB of the bundled network's."""


def batches(schedule: Mapping[str, Any], size: Size) -> tuple[int, range]:
    """Return how many tiles launches compute at once, all of a picture or as many each time, and the firsts.

    They are whole groups of the items that compute the most.
    """
    tiles = -(-size[0] // schedule["rows"]) * -(-size[1] // schedule["pixels"])
    whole = schedule["items"] * max(launch["tiles"] for launch in schedule["launches"])
    count = -(-tiles // -(-tiles // BATCH_TILES))
    count = -(-count // whole) * whole
    return count, range(0, tiles, count)


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


@dataclass(frozen=True)
class Memory:
    """An array on a device: an image (H, W, C), or sums (planes, rows, columns); `held` is what holds it."""

    shape: tuple[int, ...]
    held: Any


def in_order(kernel: Interface, given: Mapping[str, int]) -> list[np.integer[Any]]:
    """Return a kernel's integers in the order and of the types in which it takes them."""
    return [(np.uint32 if name in UNSIGNED else np.int32)(given[name]) for name in kernel.integers]


def words(kernel: Interface, given: Mapping[str, int]) -> NDArray[np.uint32]:
    """Return a kernel's integers in its order, as words of 32 bits."""
    return np.array([int(n) % 2**32 for n in in_order(kernel, given)], np.uint32)


def numbers_for(kernel: Artifact, numbers: NDArray[np.float32] | None) -> NDArray[np.float32]:
    """Return the numbers (n,) of a scene for a path kernel, those of its own scene by default."""
    if numbers is None:
        return np.array(kernel.programs.values, np.float32)
    wanted = len(kernel.programs.inputs)
    if numbers.dtype != np.float32 or numbers.shape != (wanted,):
        raise InputError(
            "scene parameters",
            f"{numbers.dtype} of shape {numbers.shape}",
            f"must be float32 of shape ({wanted},)",
            "read them by the inputs that the kernel was compiled with",
        )
    return numbers.copy()


def shapes(artifact: Artifact, size: Size) -> list[tuple[int, ...]]:
    """Return the shapes (H, W, C) of what an artifact's kernels write."""
    return [(*size, kernel.channels) for kernel in artifact.kernels]


def plane_integers(kernel: Artifact, size: Size) -> dict[str, int]:
    """Return a kernel's integers for an image: rows of planes are whole work items."""
    height, width = size
    return {"width": width, "height": height, "row_stride": -(-width // kernel.lanes) * kernel.lanes}


def plane_shape(named: tuple[int | str, ...], integers: Mapping[str, int]) -> tuple[int, ...]:
    """Return an array's shape in numbers."""
    return tuple(integers[n] if isinstance(n, str) else n for n in named)


# ---- images -----------------------------------------------------------------------------------------------


Images = Mapping[str, NDArray[np.float32]]
"""Images (H, W, C) by name."""

ENCODE = "encode the frame's features (refimpl.network.dataset.feature_image)"
"""The remedy for images that a kernel does not read."""


def images_of(artifact: Artifact) -> tuple[Image, ...]:
    """Return the images that a caller gives: those of the first kernel."""
    return artifact.kernels[0].images


def checked(artifact: Artifact, inputs: Images) -> Images:
    """Return the images in the kernel's order, contiguous, or say what is wrong with them."""
    wanted = images_of(artifact)
    if sorted(inputs) != sorted(image.name for image in wanted):
        raise InputError(
            "images for the kernel",
            ", ".join(inputs),
            f"must be {', '.join(image.name for image in wanted)}",
            "give each encoded feature once, by name",
        )
    size = inputs[wanted[0].name].shape[:2]
    for image in wanted:
        array = inputs[image.name]
        if array.dtype != np.float32 or array.shape != (*size, image.channels) or 0 in array.shape:
            raise InputError(
                f"image {image.name!r}",
                f"{array.dtype} of shape {array.shape}",
                f"must be float32 of shape (height, width, {image.channels}), all images of equal size",
                ENCODE,
            )
        _check_range(image, array)
    return {image.name: np.ascontiguousarray(inputs[image.name]) for image in wanted}


def widest(artifact: Artifact) -> int:
    """Return the most channels of an image that one of the artifact's kernels reads or writes."""
    written = [kernel.channels for kernel in artifact.kernels]
    return max(*written, *(image.channels for image in images_of(artifact)))


def _check_range(image: Image, array: NDArray[np.float32]) -> None:
    """Refuse numbers outside the range on which the kernel's bound rests, and what is not a number."""
    # NaN among the numbers makes both NaN, and fails.
    if image.low <= float(array.min()) and float(array.max()) <= image.high:
        return
    wrong, rule, remedy = ~np.isfinite(array), "all values must be finite", "fix or mask the frame first"
    if not wrong.any():
        # In float64: a Python number would be rounded to the array's float32 first.
        wrong = (array < np.float64(image.low)) | (array > np.float64(image.high))
        rule, remedy = f"the kernel's bound holds for values in {image.range_text}", ENCODE
    y, x, _ = np.argwhere(wrong)[0]
    raise InputError(f"image {image.name!r} at row {y}, column {x}", array[y, x].tolist(), rule, remedy)


def black(artifact: Artifact, size: tuple[int, int]) -> Images:
    """Return black images of `size` (height, width), for the run that makes drivers finish compiling."""
    return {i.name: np.zeros((*size, i.channels), np.float32) for i in images_of(artifact)}
