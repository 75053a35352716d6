"""Boxes, turned as they like, by the slabs between their faces.

1. Boxes are grouped by the rotation that they share, so that a ray is turned once for a group and not for
   each box [`BoxGroup`]. Groups of few boxes are joined, and rays turned for each of their boxes.
2. In the box's axes a ray enters and leaves three slabs [`slabs`]; the last one entered and the first one
   left are the ends of its way through the box [`box_distance`].

Source: slabs, Kay and Kajiya 1986, in the centre and half-extent form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain, groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ... import vectors
from ...vectors import Directions, Floats, Ids, Normals, Points, Truths
from ..materials import Material
from .shape import (
    BLACK,
    MISS,
    OMITTED,
    Constant,
    Extent,
    Group,
    Matrix,
    Met,
    Shape,
    Take,
    Values,
    Vector,
    cross,
    fold,
    inner,
    inverse,
    require,
)

if TYPE_CHECKING:
    from ..scene import Scene

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""The rotation that leaves a box parallel to the axes."""

ROTATION_TOLERANCE = 1e-6
"""Largest entry of R R^T - I that is still taken for a rotation: JSON written with seven digits passes."""

LEAST_SHARED = 4
"""Fewest boxes of a rotation for which rays are turned once instead of for each box: a scene of hundreds of
rotations is then one table of boxes, not hundreds of groups. (To turn a ray costs twice a slab test.)"""

CANCELLED = 16 * 2.0**-53
"""A sum of products below this share of its terms' magnitudes is rounding noise: centre, rotation and
products carry a few units of 2**-53 each. Boxes on a grid then share their slabs to the bit, and kernels
compute each slab once: a centre of 1e-16 here and -7e-18 there would be two."""


@dataclass(frozen=True)
class Box(Shape):
    """Oriented box; `rotation` turns world vectors into the box's own axes (its rows are those axes)."""

    kind = "boxes"
    closed = True

    center: Vector
    half_extent: Vector
    reflectance: Vector
    rotation: Matrix = IDENTITY
    emission: Vector = BLACK
    material: Material | None = field(default=None, metadata=OMITTED)

    def check(self, path: str) -> None:
        """Refuse a flat box, and a matrix that is not a rotation."""
        half, rows = self.half_extent, self.rotation
        require(min(half) > 0.0, half, f"{path}.half_extent", "half extents must be positive", "use a quad")
        rule, way_out = "its rows must be orthonormal", "normalise the rows"
        require(_is_rotation(rows), rows, f"{path}.rotation", rule, way_out)

    @property
    def extent(self) -> Extent:
        """The axes' projections, added up."""
        reach = np.abs(np.array(self.rotation)).T @ np.array(self.half_extent)
        return Extent(np.array(self.center) - reach, np.array(self.center) + reach)

    @classmethod
    def parts(cls, scene: Scene) -> tuple[Box, ...]:
        """Return the scene's boxes by rotation, in order of first use."""
        return tuple(chain(*_by_rotation(scene.boxes)))

    @classmethod
    def groups(cls, parts: Sequence[Box], first_id: int, constant: Constant) -> tuple[Group, ...]:
        """Return groups of boxes that share a rotation, small ones joined."""
        found = []
        for joined, run in groupby(_by_rotation(parts), _joined):
            for boxes in [list(chain(*run))] if joined else run:
                found.append(_group(boxes, joined, first_id, constant))
                first_id += len(boxes)
        return tuple(found)


def _is_rotation(rows: Matrix) -> bool:
    """Tell whether a matrix is orthonormal and keeps hands as they are."""
    products = ((i, j, inner(rows[i], rows[j])) for i in range(3) for j in range(3))
    orthonormal = all(abs(p - (i == j)) <= ROTATION_TOLERANCE for i, j, p in products)
    return orthonormal and inner(cross(rows[0], rows[1]), rows[2]) > 0.0


# ---- layout -----------------------------------------------------------------------------------------------


def _by_rotation(boxes: Sequence[Box]) -> list[list[Box]]:
    """Return the boxes of each rotation, in order of first use; of boxes there may be many."""
    found: dict[Matrix, list[Box]] = {}
    for box in boxes:
        found.setdefault(box.rotation, []).append(box)
    return list(found.values())


def _joined(boxes: list[Box]) -> bool:
    """Tell whether rays are turned for each of the boxes that have a rotation, not for all at once."""
    return len(boxes) < LEAST_SHARED and boxes[0].rotation != IDENTITY


def _group(boxes: list[Box], joined: bool, first_id: int, constant: Constant) -> BoxGroup:
    """Return the tables of boxes, their centres turned into the rotated axes."""
    matrices = np.array([box.rotation for box in boxes], np.float64)
    centers = [_turned(m, np.array(b.center)) for m, b in zip(matrices, boxes, strict=True)]
    return BoxGroup(
        rotation=constant(matrices if joined else matrices[0]),
        rotated=boxes[0].rotation != IDENTITY,
        first_id=first_id,
        centers=constant(centers),
        half_extents=constant([box.half_extent for box in boxes]),
    )


def _turned(rotation: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation (3, 3) times point (3,), with zeros where the terms cancel to their rounding errors."""
    size = np.abs(rotation) @ np.abs(point)
    turned = rotation @ point
    return np.where(np.abs(turned) <= CANCELLED * size, 0.0, turned)


@dataclass(frozen=True)
class BoxGroup(Group):
    """N boxes; per box: center in rotated axes (N, 3), half extent (N, 3).

    rotation is (3, 3) where they share it (`shared`), else (N, 3, 3).
    """

    rotation: Any
    rotated: bool
    first_id: int
    centers: Any
    half_extents: Any

    def __len__(self) -> int:
        """Return N."""
        return len(self.centers)

    @property
    def shared(self) -> bool:
        """Tell whether all boxes have one rotation."""
        return bool(self.rotation.ndim == 2)

    def fold(
        self, origin: Points, direction: Directions, take: Take, values: Values, reach: Floats | None = None
    ) -> Values:
        """Return the values after take(values, distance, surface id) for each box in the order of ids."""
        boxes = (self.centers, self.half_extents)

        def meet(values: Any, ray: tuple[Any, Any], center: Any, half: Any, surface: Any) -> Any:
            return take(values, box_distance(*slabs(center, half, *ray)), surface)

        def meet_turned(values: Any, rotation: Any, *box: Any) -> Any:
            local_origin, local_direction = _into_axes(rotation, origin, direction)
            return meet(values, (local_origin, inverse(local_direction)), *box)

        if not self.shared:
            return fold(meet_turned, (self.rotation, *boxes), self.first_id, values)
        local_origin, local_direction = self.into_axes(None, origin, direction)
        ray = local_origin, inverse(local_direction)
        return fold(lambda values, *box: meet(values, ray, *box), boxes, self.first_id, values)

    def normal(self, met: Met) -> Normals:
        """Return the normals (..., 3) of hits.

        The winner's slabs are evaluated once more, in the same way as in [`BoxGroup.fold`], so the face is
        the one that gave the distance, also at edges.
        """
        index = self.index(met.surface)
        local_origin, local_direction = self.into_axes(index, met.origin, met.direction)
        center = vectors.look_up_rows(self.centers, index)
        half_extent = vectors.look_up_rows(self.half_extents, index)
        enter, leave = slabs(center, half_extent, local_origin, inverse(local_direction))
        # From outside the last slab entered decides, from inside the first one left.
        face = vectors.choose(vectors.largest(enter) > 0.0, -enter, leave)
        normal = axis_normal(*least_axis(face), local_direction)
        return self.out_of_axes(index, normal)

    def into_axes(self, index: Any, origin: Points, direction: Directions) -> tuple[Points, Directions]:
        """Return rays in the axes of boxes number index (...), which groups that share them ignore."""
        if not self.rotated:
            return origin, direction
        if self.shared:
            return _into_axes(self.rotation, origin, direction)
        rows = [vectors.look_up_rows(self.rotation[:, i], index) for i in range(3)]
        return _into_axes(rows, origin, direction)

    def out_of_axes(self, index: Ids, normal: Normals) -> Normals:
        """Return normals (..., 3) in the axes of boxes number index (...) as those of the scene."""
        if not self.rotated:
            return normal
        if self.shared:
            turned: Normals = vectors.rotate(np.swapaxes(self.rotation, 0, 1), normal)
            return turned
        columns = [vectors.look_up_rows(self.rotation[:, :, i], index) for i in range(3)]
        looked_up: Normals = vectors.rotate(columns, normal)
        return looked_up


def _into_axes(rotation: Any, origin: Points, direction: Directions) -> tuple[Points, Directions]:
    """Return rays in rotated axes."""
    return vectors.rotate(rotation, origin), vectors.rotate(rotation, direction)


# ---- formulas ---------------------------------------------------------------------------------------------


def slabs(center: Points, half_extent: Points, origin: Points, inverse: Directions) -> tuple[Floats, Floats]:
    """Return the distances (..., 3) at which rays enter and leave the three slabs of a box.

    origin and inverse (1 / direction) are (..., 3), in the box's axes.
    """
    middle, half = (center - origin) * inverse, half_extent * np.abs(inverse)
    return middle - half, middle + half


def box_distance(enter: Floats, leave: Floats) -> Floats:
    """Return the distance (...) at which rays meet a box, given [`slabs`]; from inside, that of the exit."""
    t_near, t_far = vectors.largest(enter), vectors.smallest(leave)
    return np.where((t_near <= t_far) & (t_far > 0.0), np.where(t_near > 0.0, t_near, t_far), MISS)


def room_distance(enter: Floats, leave: Floats) -> Floats:
    """Return the distance (...) at which rays leave a room; the near walls are not there."""
    t_near, t_far = vectors.largest(enter), vectors.smallest(leave)
    return np.where((t_near <= t_far) & (t_far > 0.0), t_far, MISS)


def least_axis(a: Floats) -> tuple[Truths, Truths]:
    """Tell (...) whether x, and if not whether y, is the least component of a (..., 3)."""
    return (a[..., 0] <= a[..., 1]) & (a[..., 0] <= a[..., 2]), a[..., 1] <= a[..., 2]


def axis_normal(is_x: Truths, is_y: Truths, direction: Directions) -> Normals:
    """Return the axis-parallel normals (..., 3) against direction: of x, else of y, else of z."""
    against = np.where(direction > 0.0, -np.ones_like(direction), np.ones_like(direction))
    x, y, z = against[..., 0], against[..., 1], against[..., 2]
    nothing = np.zeros_like(x)
    normal: Normals = vectors.vector(
        np.where(is_x, x, nothing),
        np.where(~is_x & is_y, y, nothing),
        np.where(~is_x & ~is_y, z, nothing),
    )
    return normal
