"""What a shape is: where rays meet it, its normals there, and the rules for its numbers.

1. A shape is a frozen dataclass. Its fields are what a scene's JSON says of it; its `kind` is the name of the
   scene's list of such shapes [`Shape`].
2. All shapes of a kind are rows of tables of one float type, and are numbered one after another [`Group`].
   `row` gives the numbers of one shape, in float64.
3. Rays meet the rows one by one [`Group.fold`]: `distance` is the formula. The winner's row is looked up once
   more for its normal [`Group.normal`].

The functions work on all lanes at once, in operations that the compiler traces. Shapes know neither the scene
nor each other. Whatever is (nearly) zero and divides is replaced by [`LEAST_COMPONENT`], so there is no 0 *
infinity; a ray that starts inside a body meets it from inside.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from ... import vectors
from ...errors import InputError
from ...vectors import Directions, Floats, Ids, Normals, Points
from ..materials import Material

if TYPE_CHECKING:
    from ..scene import Scene

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

BLACK: Vector = (0.0, 0.0, 0.0)
"""No light: the default of emissions and of the background, in W / (sr m^2) per channel."""

OMITTED: Mapping[str, bool] = {"omitted at its default": True}
"""Mark of a field that the canonical text leaves out while it has its default: texts and digests of scenes
that were made before the field existed stay as they are."""

MISS = 1e30
"""Distance of a ray that hits nothing, in scene units; finite, so that no executor needs infinities."""

LEAST_COMPONENT = 1e-15
"""Least magnitude of a direction's component in a slab test, and of a cosine in a plane test. Over any
distance below 1e8 scene units the ray is moved by less than float32 can tell."""

Values = TypeVar("Values", bound=tuple[Any, ...])

Take = Callable[[Any, Floats, Ids | np.int32], Any]
"""(values (...), a primitive's distance (...), its surface id) -> the values after this primitive."""

Constant = Callable[[Any], Any]
"""Rounds numbers in float64 to a table of the geometry's float type."""


class Met(NamedTuple):
    """Rays that have met something: surface id (...), point (..., 3), origin and direction (..., 3).

    fronts (S + 1, 3) are the normals of the surfaces that have a front, by surface id; zero for the others.
    """

    surface: Ids
    point: Points
    origin: Points
    direction: Directions
    fronts: Any


class Extent(NamedTuple):
    """Corners low and high (3,) of the least box parallel to the axes that holds a shape, in float64.

    `spread`: how many times farther from the shape a hit can be than the rounding errors of its numbers.
    """

    low: Any
    high: Any
    spread: float = 1.0


class Shape:
    """A kind of shapes; a subclass is a frozen dataclass in one file, and a line in the registry.

    `kind` is the name of the list of `Scene` that holds them. Light may pass into shapes that are `closed`;
    those have a `center`.
    """

    kind: ClassVar[str]
    closed: ClassVar[bool] = False
    reflectance: Vector
    emission: Vector
    material: Material | None

    def check(self, path: str) -> None:
        """Raise InputError, with the path of the value, where a number breaks a rule."""

    @property
    def row(self) -> tuple[Any, ...]:
        """The numbers that `distance` and `normal` need, (3,) or () each, in float64."""
        raise NotImplementedError

    @staticmethod
    def distance(row: tuple[Any, ...], origin: Points, direction: Directions) -> Floats:
        """Return the distance (...) at which rays meet the shape, or MISS."""
        raise NotImplementedError

    @staticmethod
    def normal(row: tuple[Any, ...], met: Met) -> Normals:
        """Return unit normals (..., 3) of points on shapes, which a row of (..., 3) or (...) describes."""
        raise NotImplementedError

    @property
    def extent(self) -> Extent | None:
        """Where points of the shape can be; None: nobody says."""
        return None

    @classmethod
    def parts(cls, scene: Scene) -> tuple[Any, ...]:
        """Return the scene's shapes of this kind in the order of their ids."""
        found: tuple[Any, ...] = getattr(scene, cls.kind)
        return found

    @classmethod
    def groups(cls, parts: Sequence[Any], first_id: int, constant: Constant) -> tuple[Group, ...]:
        """Return the tables of shapes, one group if there are any; ids begin with `first_id`."""
        if not parts:
            return ()
        columns = zip(*(part.row for part in parts), strict=True)
        return (Rows(cls, first_id, tuple(constant(column) for column in columns)),)


class Group(ABC):
    """N shapes of one kind, laid out: surface ids first_id to first_id + N - 1."""

    first_id: int

    @abstractmethod
    def __len__(self) -> int:
        """Return N."""

    @property
    def fronts(self) -> Any:
        """The normals (N, 3) of shapes that have a front; None: these have none."""
        return None

    @abstractmethod
    def fold(
        self, origin: Points, direction: Directions, take: Take, values: Values, reach: Floats | None = None
    ) -> Values:
        """Return the values after take(values, distance, surface id) for each shape in the order of ids.

        Who gives a reach (...) asks only whether a distance is below it.
        """

    @abstractmethod
    def normal(self, met: Met) -> Normals:
        """Return unit normals (..., 3) that face the rays' origins, in all lanes as if all met this group."""

    def index(self, surface: Ids) -> Ids:
        """Return which of the shapes surface ids (...) name; any other id names the first or the last."""
        found: Ids = np.minimum(np.maximum(surface - np.int32(self.first_id), 0), len(self) - 1)
        return found


@dataclass(frozen=True)
class Rows(Group):
    """Shapes that are a row of numbers each: tables (N, 3) or (N,)."""

    shape: type[Shape]
    first_id: int
    tables: tuple[Any, ...]

    def __len__(self) -> int:
        """Return N."""
        return len(self.tables[0])

    def fold(
        self, origin: Points, direction: Directions, take: Take, values: Values, reach: Floats | None = None
    ) -> Values:
        """Return the values after take(values, distance, surface id) for each shape in the order of ids."""

        def meet(values: Values, *row: Any) -> Any:
            *numbers, surface = row
            return take(values, self.shape.distance(tuple(numbers), origin, direction), surface)

        return fold(meet, self.tables, self.first_id, values)

    def normal(self, met: Met) -> Normals:
        """Return unit normals (..., 3) that face the rays' origins, in all lanes as if all met this group."""
        index = self.index(met.surface)
        row = tuple(
            (vectors.look_up_rows if table.ndim == 2 else vectors.look_up)(table, index)
            for table in self.tables
        )
        return facing(self.shape.normal(row, met), met.direction)


def fold(step: Any, tables: Sequence[Any], first_id: int, values: Values) -> Values:
    """Return the values after the rows of tables whose shapes are numbered from first_id on."""
    ids = np.arange(first_id, first_id + len(tables[0]), dtype=np.int32)
    folded: Values = vectors.fold_rows(step, (*tables, ids), values)
    return folded


def facing(normal: Normals, direction: Directions) -> Normals:
    """Turn normals (..., 3) against the directions (..., 3) of the rays that meet them."""
    turned: Normals = vectors.choose(vectors.dot(normal, direction) > 0.0, -normal, normal)
    return turned


def away_from_zero(x: Floats) -> Floats:
    """Return x (...) with its magnitude raised to [`LEAST_COMPONENT`] where it is smaller."""
    least = np.full_like(x, LEAST_COMPONENT)  # np.where of two Python numbers would be float64
    return np.where(np.abs(x) < LEAST_COMPONENT, np.where(x < 0.0, -least, least), x)


def inverse(direction: Directions) -> Directions:
    """Return 1 / direction (..., 3), finite for rays that are parallel to an axis."""
    return np.reciprocal(away_from_zero(direction))


# ---- rules ------------------------------------------------------------------------------------------------


def require(holds: bool, value: Any, path: str, rule: str, way_out: str) -> None:
    """Raise InputError unless a rule holds for the value at a path."""
    if not holds:
        raise InputError(path, value, rule, way_out)


def inner(a: Vector, b: Vector) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the right-handed vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a: Vector) -> float:
    """Return the length."""
    return math.sqrt(inner(a, a))


def spans_area(a: Vector, b: Vector) -> bool:
    """Tell whether a and b are clearly not parallel: the sine between them exceeds 1e-6, float32's reach."""
    return length(cross(a, b)) > 1e-6 * length(a) * length(b)
