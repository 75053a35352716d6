"""Three-vectors over lanes: leading axes are lanes (paths, pixels), the last axis holds the three components.

All functions are written without state, in-place writes or masks as indices, so that they can be traced;
dtype follows the arguments. [`vector`] keeps the components in separate planes of memory, which is why
elementwise code on `(..., 3)` arrays is as quick as on three separate arrays; the values do not depend on
it. A loop over the rows of constant tables is [`fold_rows`], so that it can be traced as a loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Kind = TypeVar("Kind", bound=np.generic)
"""Any kind of number."""

Floats: TypeAlias = NDArray[np.floating[Any]]
"""A number each lane, (...). Like all these names it stands for traced values too."""

Points: TypeAlias = NDArray[np.floating[Any]]
"""Places (..., 3) in scene units."""

Directions: TypeAlias = NDArray[np.floating[Any]]
"""Directions (..., 3), of length 1 unless said otherwise."""

Normals: TypeAlias = NDArray[np.floating[Any]]
"""Unit normals (..., 3)."""

Colors: TypeAlias = NDArray[np.floating[Any]]
"""Linear red, green and blue (..., 3): reflectances, and shares of light."""

Radiance: TypeAlias = NDArray[np.floating[Any]]
"""Light (..., 3) in W / (sr m^2) per channel."""

Truths: TypeAlias = NDArray[np.bool_]
"""Decisions (...)."""

Ids: TypeAlias = NDArray[np.integer[Any]]
"""Surface ids, or indices into a table (...)."""


def vector(x: Floats, y: Floats, z: Floats) -> Floats:
    """Join three components (...) into vectors (..., 3)."""
    return np.moveaxis(np.stack((x, y, z)), 0, -1)


def dot(a: Floats, b: Floats) -> Floats:
    """Return the inner products (...) of vectors a, b (..., 3), summed in the order x, y, z."""
    product: Floats = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return product


def cross(a: Floats, b: Floats) -> Floats:
    """Return the right-handed vector products (..., 3) of a, b (..., 3)."""
    return vector(
        a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
        a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
        a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
    )


def scale(a: Floats, s: Floats) -> Floats:
    """Return vectors a (..., 3) times scalars s (...)."""
    return a * s[..., np.newaxis]


def normalize(a: Floats) -> Directions:
    """Return a (..., 3) divided by its length; a must not be zero."""
    return a / np.sqrt(dot(a, a))[..., np.newaxis]


def rotate(rotation: Any, a: Floats) -> Floats:
    """Return rotation (3, 3) times vectors a (..., 3)."""
    return vector(dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a))


def choose(condition: Truths, a: Floats | float, b: Floats | float) -> Floats:
    """Return vectors (..., 3): a where condition (...) holds, else b."""
    return np.where(condition[..., np.newaxis], a, b)


def look_up(table: NDArray[Kind], index: Ids) -> NDArray[Kind]:
    """Return the entries (...) of a constant table (K,) at index (...).

    NumPy asks the table, not the index, who takes from it; `like` makes it a table of the index's kind, so
    that an index that is traced makes a look-up that is traced.
    """
    found: NDArray[Kind] = np.take(np.asarray(table, like=index), index)
    return found


def look_up_rows(table: Any, index: Ids) -> Floats:
    """Return the rows (..., 3) of a constant table (K, 3) at index (...)."""
    return vector(*(look_up(table[:, i], index) for i in range(3)))


def largest(a: Floats) -> Floats:
    """Return the largest component (...) of a (..., 3)."""
    return np.maximum(np.maximum(a[..., 0], a[..., 1]), a[..., 2])


def smallest(a: Floats) -> Floats:
    """Return the smallest component (...) of a (..., 3)."""
    return np.minimum(np.minimum(a[..., 0], a[..., 1]), a[..., 2])


def fold_rows(step: Callable[..., tuple[Any, ...]], tables: Sequence[Any], start: tuple[Any, ...]) -> Any:
    """Return what `start`, values (...), becomes by values = step(values, *row), row after row.

    Row i holds entry i of each of the constant tables (K, ...). As with ufuncs, values of another kind than
    NumPy's are asked first (`__fold_rows__`), and may answer NotImplemented: then they go through this loop.
    """
    for value in start:
        if hasattr(value, "__fold_rows__"):
            folded = value.__fold_rows__(step, tables, start)
            if folded is not NotImplemented:
                return folded
            break
    values = start
    for row in zip(*tables, strict=True):
        values = step(values, *row)
    return values
