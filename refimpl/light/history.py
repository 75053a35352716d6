"""History: what earlier pictures know of a pixel, found where its surface was, and averaged; over images.

A picture of one path a pixel is one draw of what it should be; pictures before it drew nearly the same.

1. [`first_hits`] says which primitive the camera ray of each pixel meets, and where: the ray is that of the
   job's first sample, so that colour and surface belong together. Primitives have numbers that do not depend
   on how a scene is laid out [`surface_numbers`], since a box that turns changes the order of surface ids.
2. Each primitive has a pose, an affine frame. Between two moments of a scene it has moved, and all points on
   it with it: p was at p + turn (p - center) + shift [`motion`]. Both are 0 where nothing moved, to the bit.
3. Projected by both cameras, the two points are some pixels apart [`displacement`]. A pixel takes up what the
   last picture has there: the mean of up to four pixels, in bilinear weights [`gathered`].
4. Of these only those count whose own ray met the same side of the same primitive: all others show what hid
   it, or what it now hides. Where camera and primitives rest, an edge stays what it was: a pixel in which
   several of them are seen keeps its mean over all of them.
5. The new sample is the n-th: h = r + (c - r) / n with n = min(count + 1, limit) [`follow`]. That is the
   running mean at first and then an exponential one. n is at least 1, so h stays between the samples
   that it is made of, and an error of the past shrinks by 1 - 1/n: after any number of pictures, rounding
   has left no more than [`error_bound`].
6. A denoiser gets h, and 1 - 1/n, the share of the past in it [`layers_of`].

Sources: reverse reprojection, Nehab, Sander, Lawrence, Tatarchuk, Isidoro, "Accelerating Real-Time Shading
with Reverse Reprojection Caching", Graphics Hardware 2007; averaging with tests on the surface, Schied et
al., "Spatiotemporal Variance-Guided Filtering", High Performance Graphics 2017; the running mean, Welford
1962. The bound is ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .. import rng, vectors
from ..errors import InputError
from ..frame import Floats as Image
from ..frame import check_finite
from ..vectors import Directions, Floats, Ids, Normals, Points, Truths
from . import intersection, shading
from .camera import CameraBasis, camera_basis
from .render import Job, pixel_counter, start
from .scene import WALLS, Room, Scene, Sphere
from .shapes import Box, Light, Quad, kinds
from .transport import Counters

MOST_LIMIT = 4096
"""Largest limit: beyond it the bound on rounding would need more terms, and no light stays for so long."""

SAME_SIDE = 0.5**0.5
"""Least cosine of the angle between two normals of one side of a primitive: that of 45 degrees, half of the
angle between two faces of a box."""

FARTHEST_PX = 1 << 17
"""Largest displacement that is looked at, in pixels: twice the largest picture."""


@dataclass(frozen=True)
class Limits:
    """Most samples that a history counts as: from then on each new one has a share of 1 / limit.

    `rest` is for a picture in which nothing has moved. Else light may change where nothing moves, as a shadow
    does: `moving`; and what mirrors and glass show moves otherwise than they do: `shown`.
    """

    moving: float = 6
    shown: float = 2
    rest: float = 64

    def __post_init__(self) -> None:
        """Refuse limits that are not from 1 to MOST_LIMIT."""
        for name, value in vars(self).items():
            if not 1 <= value <= MOST_LIMIT:
                rule = f"a number of samples from 1 to {MOST_LIMIT}"
                raise InputError(f"limit `{name}`", value, rule, f"{Limits.moving} is usual in motion")

    def of(self, moves: Motion) -> NDArray[np.float64]:
        """Return the limit (N + 1,) of each primitive."""
        if np.all(moves.rests):
            return np.full(moves.rests.shape, float(self.rest))
        return np.where(moves.shows, float(self.shown), float(self.moving))


LIMITS = Limits()
"""The limits that are usual."""


class First(NamedTuple):
    """First hits of camera rays: number (...) of the primitive; point, normal and direction (..., 3)."""

    number: Ids
    point: Points
    normal: Normals
    direction: Directions


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the points of N primitives were a moment before; rows by number, and a last one for "nothing".

    A point p was at p + turn (p - center) + shift; turn (N + 1, 3, 3), center and shift (N + 1, 3), in one
    float type. rests (N + 1,): neither the primitive nor the camera has moved. shows (N + 1,): what is
    seen there is something else, in a mirror or through glass.
    """

    turn: NDArray[Any]
    center: NDArray[Any]
    shift: NDArray[Any]
    rests: NDArray[np.bool_]
    shows: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class History:
    """What a picture leaves for the next: scene, number (H, W), normal and color (H, W, 3), count (H, W).

    number and normal are those of its first hits; count is the number of samples, at most a limit, that the
    colour is a mean over.
    """

    scene: Scene
    number: Ids
    normal: Image
    color: Image
    count: Image


@dataclass(frozen=True, eq=False)
class Known:
    """What the last picture knows: the mean colour (..., 3), count (...), and the least and largest colours.

    Where it knows nothing, colour and count are 0, and low and high are infinite: nothing is between them.
    """

    color: Floats
    count: Floats
    low: Floats
    high: Floats


# ---- primitives and their motion --------------------------------------------------------------------------

Primitive = Room | Box | Sphere | Quad | Light
"""What has a pose."""


def _primitives(scene: Scene) -> list[Primitive]:
    """Return the walls, boxes, spheres, quads and lights of a scene, in the order of their numbers."""
    walls = [] if scene.room is None else [scene.room] * len(WALLS)
    return [*walls, *scene.boxes, *scene.spheres, *scene.quads, *scene.lights]


def surface_numbers(scene: Scene) -> NDArray[np.int32]:
    """Return the number (S + 1,) of each surface id: its place among walls, boxes, spheres, quads, lights.

    The last one is that of "nothing".
    """
    found = list(range(0 if scene.room is None else len(WALLS)))
    for kind in kinds():
        listed = getattr(scene, kind.kind) + (scene.lights if kind is Quad else ())
        places: dict[int, list[int]] = {}
        for place, part in enumerate(listed, start=len(found)):
            places.setdefault(id(part), []).append(place)
        found += [places[id(part)].pop(0) for part in kind.parts(scene)]
    return np.array([*found, len(found)], np.int32)


def motion(scene: Scene, before: Scene, dtype: DTypeLike = np.float32) -> Motion:
    """Return where each primitive of a scene was; computed in float64 and then rounded to dtype.

    Raises InputError where the two scenes do not have the same primitives.
    """
    parts, parts_before = _primitives(scene), _primitives(before)
    if list(map(type, parts)) != list(map(type, parts_before)):
        rule = f"{scene.name} has {len(parts)}, and each must have a counterpart of its kind"
        way_out = "start a new history when the scene changes"
        raise InputError("primitives of the previous scene", len(parts_before), rule, way_out)
    rows = [_moved(_pose(now), _pose(then)) for now, then in zip(parts, parts_before, strict=True)]
    rows.append(_moved(_AT_REST, _AT_REST))
    turn, center, shift = (np.array(column, np.float64).astype(dtype) for column in zip(*rows, strict=True))
    moved = turn.any(axis=(1, 2)) | shift.any(axis=1) | (scene.camera != before.camera)
    rests: NDArray[np.bool_] = np.logical_not(moved)
    return Motion(turn, center, shift, rests, _shows(scene))


_Pose = tuple[NDArray[np.float64], NDArray[np.float64]]
"""An affine frame (3, 3), its axes in columns, and its origin (3,)."""

_AT_REST: _Pose = (np.eye(3), np.zeros(3))
"""That of "nothing", which never moves."""


def _pose(part: Primitive) -> _Pose:
    """Return the frame in which the points of a primitive stay what they are when it moves."""
    if isinstance(part, Room):
        low, high = np.array(part.low, np.float64), np.array(part.high, np.float64)
        return np.diag(high - low), low
    if isinstance(part, Box):
        axes = np.array(part.rotation, np.float64).T
        return axes * np.array(part.half_extent, np.float64), np.array(part.center, np.float64)
    if isinstance(part, Sphere):
        return np.eye(3) * part.radius, np.array(part.center, np.float64)
    u, v = np.array(part.edge_u, np.float64), np.array(part.edge_v, np.float64)
    axes = np.stack([u, v, vectors.normalize(vectors.cross(u, v))], axis=-1)
    return axes, np.array(part.corner, np.float64)


def _moved(now: _Pose, before: _Pose) -> tuple[NDArray[np.float64], ...]:
    """Return turn (3, 3), center (3,) and shift (3,): 0 where a pose is what it was."""
    (axes, origin), (axes_before, origin_before) = now, before
    turn = np.zeros((3, 3))
    if not np.array_equal(axes, axes_before):
        turn = axes_before @ np.linalg.inv(axes) - np.eye(3)
    return turn, origin, origin_before - origin


def _shows(scene: Scene) -> NDArray[np.bool_]:
    """Tell (N + 1,) whether features look past each primitive, by its number."""
    materials, numbers = shading.build(scene, np.float64), surface_numbers(scene)
    ids = np.arange(len(numbers), dtype=np.int32)
    shows = np.zeros(len(numbers), bool)
    shows[numbers] = shading.follows(materials, intersection.Hit(np.zeros(len(ids)), ids))
    return shows


class Moved(NamedTuple):
    """Rows of a motion: turn, three of (..., 3); center and shift (..., 3); rests (...)."""

    turn: Sequence[Floats]
    center: Points
    shift: Points
    rests: Truths


def row_of(moves: Motion, number: Ids) -> Moved:
    """Return the rows of the primitives of these numbers (...)."""
    turn = [vectors.look_up_rows(moves.turn[:, i], number) for i in range(3)]
    center, shift = (vectors.look_up_rows(table, number) for table in (moves.center, moves.shift))
    return Moved(turn, center, shift, vectors.look_up(moves.rests, number))


def point_before(row: Moved, first: First) -> tuple[Points, Normals]:
    """Return where first hits were (..., 3), and their normals then, of any length."""
    point: Points = first.point + (vectors.rotate(row.turn, first.point - row.center) + row.shift)
    normal: Normals = first.normal + vectors.rotate(row.turn, first.normal)
    return point, normal


# ---- pictures ---------------------------------------------------------------------------------------------


def first_hits(scene: Scene, job: Job) -> First:
    """Return the first hits (H, W) of a job's first sample."""
    geometry, basis = intersection.build(scene, job.dtype), camera_basis(scene.camera, job.dtype)
    y, x = np.divmod(np.arange(job.width * job.height), job.width)
    counters = Counters(rng.counter(job.seed), pixel_counter(x, y), rng.counter(job.first_sample))
    dtype = geometry.dtype
    size, sampler = (job.width, job.height), job.settings.sampler
    path = start(basis, x.astype(dtype), y.astype(dtype), *size, counters, dtype, sampler)
    hit = intersection.closest_hit(geometry, path.origin, path.direction)
    surface = intersection.surface_at(geometry, hit, path.origin, path.direction)
    number = vectors.look_up(surface_numbers(scene), hit.surface)
    found = (number, surface.point, surface.normal, path.direction)
    return First(*(np.reshape(part, (job.height, job.width, *part.shape[1:])) for part in found))


def projected(
    basis: CameraBasis, towards: Directions, width: float, height: float
) -> tuple[Floats, Floats, Truths]:
    """Return where in its image, x and y (...) in pixels, a camera sees what is towards (..., 3).

    The third (...) tells whether that is in front of it; elsewhere x and y mean nothing.
    """
    ahead = vectors.dot(towards, basis.forward)
    in_front = ahead > 0.0
    scale = height / (basis.tan_half_fov * np.where(in_front, ahead, 1.0))
    x = 0.5 * (width + vectors.dot(towards, basis.right) * scale)
    y = 0.5 * (height - vectors.dot(towards, basis.up) * scale)
    return x, y, in_front


def displacement(
    row: Moved, found: Truths, cameras: Sequence[CameraBasis], first: First, width: float, height: float
) -> tuple[Floats, Floats, Truths]:
    """Return how far first hits were, x and y (...) in pixels, from where they are, and whether (...) ahead.

    `cameras` are the one now and the one before. What is not `found` (...) is at infinity, and stays in its
    direction.
    """
    basis, basis_before = cameras
    point, _ = point_before(row, first)
    towards = vectors.choose(found, first.point - basis.position, first.direction)
    towards_before = vectors.choose(found, point - basis_before.position, first.direction)
    x, y, _ = projected(basis, towards, width, height)
    x_before, y_before, in_front = projected(basis_before, towards_before, width, height)
    return x_before - x, y_before - y, in_front


class Sums(NamedTuple):
    """What up to four pixels of the last picture add up to: weights (...), color (..., 3), samples (...).

    low and high (..., 3) are the least and the largest of their colours.
    """

    weights: Floats
    color: Floats
    samples: Floats
    low: Floats
    high: Floats


def gathered(past: History, moves: Motion, first: First, shift: tuple[Floats, Floats, Truths]) -> Known:
    """Return what the last picture knows of each pixel (H, W), displaced by `shift`.

    Its pixels are added in the order (0, 0), (1, 0), (0, 1), (1, 1) of x and y.
    """
    (x, fraction_x), (y, fraction_y) = (split(part) for part in shift[:2])
    row, none = row_of(moves, first.number), np.zeros_like(past.count)
    _, before = point_before(row, first)
    ends = np.full_like(past.color, np.inf)
    sums = Sums(none, np.zeros_like(past.color), none, ends, -ends)
    for below, right in product((0, 1), (0, 1)):
        inside, pixel = _pixel(past.count.shape, y + below, x + right)
        rests = row.rests & vectors.look_up(moves.rests, past.number[pixel])
        same = same_surface(past.number[pixel] == first.number, past.normal[pixel], before, rests)
        weight = share(fraction_x, right > 0) * share(fraction_y, below > 0)
        weight = np.where(inside & shift[2] & same, weight, 0.0)
        sums = added(sums, weight, past.color[pixel], past.count[pixel])
    return known_of(sums)


def split(shift: Floats) -> tuple[NDArray[np.int32], Floats]:
    """Return pixels (...) and the fraction (...) in [0, 1] of the next one; what is NaN is far away."""
    kept = np.where(np.abs(shift) <= FARTHEST_PX, shift, FARTHEST_PX)
    whole = np.floor(kept)
    return whole.astype(np.int32), kept - whole


def share(fraction: Floats, beyond: Truths | bool) -> Floats:
    """Return the bilinear weight (...) along an axis, of a pixel or of the one beyond it."""
    found: Floats = np.where(beyond, fraction, 1.0 - fraction)
    return found


def added(sums: Sums, weight: Floats, color: Floats, count: Floats) -> Sums:
    """Return the sums with one more pixel (...) of the last picture."""
    used = weight > 0.0
    return Sums(
        sums.weights + weight,
        sums.color + vectors.scale(color, weight),
        sums.samples + count * weight,
        vectors.choose(used, np.minimum(sums.low, color), sums.low),
        vectors.choose(used, np.maximum(sums.high, color), sums.high),
    )


def known_of(sums: Sums) -> Known:
    """Return the means of the pixels that were added."""
    some = np.where(sums.weights > 0.0, sums.weights, 1.0)
    return Known(sums.color / some[..., np.newaxis], sums.samples / some, sums.low, sums.high)


def _pixel(shape: Sequence[int], down: Ids, right: Ids) -> tuple[Truths, tuple[Ids, Ids]]:
    """Return whether pixels so far down and right of each (H, W) are in the picture, and the nearest ones."""
    height, width = shape
    y, x = np.arange(height)[:, np.newaxis] + down, np.arange(width) + right
    inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
    return inside, (np.clip(y, 0, height - 1), np.clip(x, 0, width - 1))


def same_surface(same_number: Truths, normal: Normals, before: Normals, rests: Truths) -> Truths:
    """Tell (...) whether pixels of the last picture show the same side of the primitives that are met now.

    `normal` is theirs, `before` that of the first hit as it was, of any length. Where neither camera nor both
    primitives moved, it does not matter.
    """
    length = np.sqrt(vectors.dot(before, before))
    side = vectors.dot(before, normal) >= SAME_SIDE * length
    same: Truths = (same_number & side) | rests
    return same


def begin(scene: Scene, job: Job, color: Image) -> History:
    """Return the history after its first picture, of a linear colour (H, W, 3)."""
    check_picture(job, color)
    first = first_hits(scene, job)
    own = color.astype(job.dtype)
    return History(scene, first.number, first.normal, own, np.ones_like(own[..., 0]))


def follow(past: History, scene: Scene, job: Job, color: Image, limits: Limits = LIMITS) -> History:
    """Return the history after the next picture, of a linear colour (H, W, 3), of the scene as it is now.

    Raises InputError for a scene with other primitives, a picture of another size, and colours that are not
    finite.
    """
    check_picture(job, color, past)
    first, moves = first_hits(scene, job), motion(scene, past.scene, job.dtype)
    cameras = [camera_basis(each.camera, job.dtype) for each in (scene, past.scene)]
    found = first.number < len(moves.rests) - 1
    shift = displacement(row_of(moves, first.number), found, cameras, first, job.width, job.height)
    limit = vectors.look_up(limits.of(moves).astype(job.dtype), first.number)
    mean, count = blend(gathered(past, moves, first, shift), color.astype(job.dtype), limit)
    return History(scene, first.number, first.normal, mean, count)


def blend(known: Known, color: Floats, limit: Floats) -> tuple[Floats, Floats]:
    """Return the mean (..., 3) of what is known and a new colour (..., 3), and its count, to limit (...).

    The mean stays between the colours that it is made of, which rounding might leave otherwise.
    """
    count = np.minimum(known.count + 1.0, limit)
    mean = known.color + (color - known.color) / count[..., np.newaxis]
    low, high = np.minimum(known.low, color), np.maximum(known.high, color)
    return np.minimum(np.maximum(mean, low), high), count


def layers_of(history: History) -> dict[str, Image]:
    """Return the layers `history` (H, W, 3) and `history_weight` (H, W, 1), the share of the past in it."""
    return {"history": history.color, "history_weight": (1.0 - 1.0 / history.count)[..., np.newaxis]}


def error_bound(limit: float, largest: float, dtype: DTypeLike = np.float32) -> float:
    """Return how far rounding takes a history's colours from exact ones, after any number of pictures.

    limit is the largest one that was used, largest the largest magnitude of all samples' colours.
    Displacements, their fractions and what is the same surface are taken as they were computed:
    (60 limit + 8) u largest, with u half an ulp of 1.
    """
    return (60.0 * limit + 8.0) * float(np.finfo(np.dtype(dtype)).eps) / 2.0 * largest


def check_picture(job: Job, color: Image, past: History | None = None) -> None:
    """Refuse a picture of another size than the job's and the last one's, and colours that are not finite."""
    sizes = {"the job": (job.height, job.width)}
    if past is not None:
        sizes["the history"] = past.count.shape
    for what, size in sizes.items():
        if color.shape != (*size, 3):
            rule = f"{what} has {(*size, 3)}"
            raise InputError("shape of the colour", color.shape, rule, "start a new history for another size")
    check_finite("the colour", color)
