"""What a kernel is bound to, as data: its role, its arrays, its integers. Everything that shows them follows.

A dialect declares an interface in its own words [openings.py], the manifest of an export states it, and a
device binds it: none of them lists arrays or integers again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..core.ir import Image

DENOISE, PATH, ENCODE = "denoise", "path", "encode"
"""What a kernel does."""

GUIDE, SMOOTH = "guide", "smooth"
"""What the two kernels of the filter do: clip a frame's layers, and take the means of a level."""

FOLLOW = "follow"
"""What the kernel of a history does: it adds a picture."""

TRAIN = "train"
"""What the kernel of a training step does: derivatives of a minibatch, and Adam."""

PLAIN = "plain"
"""Name of the schedule that every target has: the kernel that is made to be read."""

FULL = "full"
"""Name of the variant of a network that leaves nothing out [variants.py]."""

READ, WRITE, BOTH = "read", "write", "both"
"""What a kernel does with an array; one that it reads and writes is memory of the device."""

BUFFER, BLOCK, TABLE = "buffer", "uniform", "inline"
"""Homes of an array: memory, or a texture; a uniform block, or constant memory; a table in the source."""

WEIGHTS, RESULT, SUMS, IMAGE = "weights", "result", "sums", "image_"
"""Names of arrays; an image's name follows the last one."""

GUIDES, LIGHT = "guides", "light"
"""Names of the filter's arrays: planes that it compares, and planes of light that it takes means of."""

FIRST, PAST, MOTIONS, CAMERAS = "first", "past", "motions", "cameras"
"""Names of a history's arrays: planes of first hits and of the last picture, rows of primitives' motions, and
the numbers of both cameras."""

PLANES = (SUMS, GUIDES, LIGHT, FIRST, PAST)
"""Names of memory that holds planes, rows of a picture each."""

PRIMITIVES = "primitives"
"""What the rows of motions are counted by: no kernel is given their number."""

SCENE_NUMBERS = "scene_numbers"
"""Name of the array of the numbers of a scene that are inputs of its path kernel."""

UNSIGNED = ("first_sample", "seed_number")
"""Integers of 32 bits without a sign; all others have one."""

INTEGERS: Mapping[str, tuple[str, ...]] = {
    DENOISE: ("width", "height"),
    PATH: ("width", "height", "first_row", "rows", "first_sample", "samples", "seed_number"),
    ENCODE: ("width", "height", "sample_count"),
    GUIDE: ("width", "height", "row_stride"),
    SMOOTH: ("width", "height", "row_stride", "gap"),
    FOLLOW: ("width", "height", "row_stride"),
    TRAIN: ("groups", "at", "step"),
}
"""The integers that a kernel is given, in order, by role; a dialect may know some of them by itself."""

BATCH = ("first_tile", "tile_count")
"""Integers of a kernel of several launches: the first tile that they compute, and how many of them."""

ITEMS = 8
"""Items of a group of one of several launches, as many as vectors of most processors have lanes."""

READ_NUMBER, WRITTEN_NUMBER, FIRST_IMAGE = 1, 2, 3
"""Numbers of what is read, of what is written and of the first image; 0 are the integers."""


def staged(source: str, number: int) -> str:
    """Return a source of GLSL, which has one entry point, for one of several launches."""
    defined = rf"\g<0>\n#define STAGE {number}\n#define ITEMS {ITEMS}"
    return re.sub(r"^#version .*$", defined, source, count=1, flags=re.MULTILINE)


@dataclass(frozen=True)
class Array:
    """An array of float32, or of vectors of another kind: `shape` in numbers, or in names of integers.

    An array of the role TRAIN has one index.
    """

    name: str
    access: str
    shape: tuple[int | str, ...]
    home: str = BUFFER
    dtype: str = "float32"
    lanes: int = 1

    @property
    def is_image(self) -> bool:
        """Return whether it is a feature's image, before or after its encoding."""
        return self.name.startswith(IMAGE)

    @property
    def planes(self) -> int:
        """Return how many planes of images it has, or 0."""
        count = self.shape[0]
        return count if len(self.shape) == 3 and isinstance(count, int) else 0

    @property
    def quads(self) -> int:
        """Return how many vectors of four hold a one-dimensional array."""
        return -(-int(self.shape[0]) // 4)


@dataclass(frozen=True)
class Interface:
    """All that a kernel is given, in the order of its arguments: arrays, then integers."""

    role: str
    arrays: tuple[Array, ...]
    integers: tuple[str, ...]

    def named(self, name: str) -> Array | None:
        """Return the array of this name, if there is one."""
        return next((array for array in self.arrays if array.name == name), None)

    @property
    def images(self) -> tuple[Array, ...]:
        """Return the images, in order."""
        return tuple(array for array in self.arrays if array.is_image)

    @property
    def written(self) -> tuple[Array, ...]:
        """Return the arrays that the kernel writes."""
        return tuple(array for array in self.arrays if array.access == WRITE)

    @property
    def both(self) -> tuple[Array, ...]:
        """Return the arrays that the kernel reads and writes."""
        return tuple(array for array in self.arrays if array.access == BOTH)

    @property
    def place(self) -> tuple[str, str]:
        """Return the names of an item's column and row; a path's `x` and `y` are those of each lane."""
        return ("column", "row") if self.role == PATH else ("x", "y")

    @property
    def rows(self) -> str:
        """Return the integer that limits the row."""
        return "rows" if self.role == PATH else "height"

    def handing_on(self, memory: Mapping[str, int]) -> Interface:
        """Return it for several launches: `memory` are the numbers that they hand on, of a tile, by array."""
        arrays = (Array(name, BOTH, (count // 2, BATCH[1]), lanes=2) for name, count in memory.items())
        return replace(self, arrays=(*self.arrays, *arrays), integers=(*self.integers, *BATCH))

    def numbers(self) -> Mapping[str, int]:
        """Return the number of each array, where arrays have numbers."""
        found, free = {}, FIRST_IMAGE
        for array in self.arrays:
            if array.is_image or array.access == BOTH:
                found[array.name], free = free, free + 1
            else:
                found[array.name] = READ_NUMBER if array.access == READ else WRITTEN_NUMBER
        return found

    def by_number(self) -> list[Array]:
        """Return the arrays in the order of their numbers."""
        numbers = self.numbers()
        return sorted(self.arrays, key=lambda array: numbers[array.name])


def image_of(image: Image, access: str) -> Array:
    """Return the image of a feature, or of a layer."""
    return Array(f"{IMAGE}{image.name}", access, ("height", "width", image.channels))


def denoiser(images: Sequence[Image], channels: int) -> Interface:
    """Return what a denoiser is given: images, weights, which a language puts where it has them, a result."""
    weights, result = Array(WEIGHTS, READ, (0,)), Array(RESULT, WRITE, ("height", "width", channels))
    return Interface(DENOISE, (*(image_of(image, READ) for image in images), weights, result), ())


def planes_of(name: str, access: str, count: int) -> Array:
    """Return so many planes, whose rows may be longer than the picture's."""
    return Array(name, access, (count, "height", "row_stride"))
