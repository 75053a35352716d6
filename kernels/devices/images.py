"""The images that a denoiser is given: which ones, and whether the kernel's bound holds for their numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.core.ir import Image
from ...refimpl.errors import InputError

Images = Mapping[str, NDArray[np.float32]]
"""Images (H, W, C) by name."""


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
                "encode the frame's features (refimpl.network.dataset.feature_image)",
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
    if not np.isfinite(array).all():
        y, x, _ = np.argwhere(~np.isfinite(array))[0]
        raise InputError(
            f"image {image.name!r} at row {y}, column {x}",
            array[y, x].tolist(),
            "all values must be finite",
            "fix or mask the frame first",
        )
    # In float64: a Python number would be rounded to the array's float32 first.
    outside = (array < np.float64(image.low)) | (array > np.float64(image.high))
    y, x, _ = np.argwhere(outside)[0]
    raise InputError(
        f"image {image.name!r} at row {y}, column {x}",
        array[y, x].tolist(),
        f"the kernel's bound holds for values in {image.range_text}",
        "encode the frame's features (refimpl.network.dataset.feature_image)",
    )


def black(artifact: Artifact, size: tuple[int, int]) -> Images:
    """Return black images of `size` (height, width), for the run that makes drivers finish compiling."""
    return {i.name: np.zeros((*size, i.channels), np.float32) for i in images_of(artifact)}
