"""Grades lab 1: rays whose distances are known, the spec's vectors, random rays, a sphere far away."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..frame import (
    Check,
    Likely,
    Wrong,
    asked,
    expect,
    hold,
    kind_of_number,
    normals,
    numbers_of,
    spread,
    still,
)

CENTER, RADIUS = np.array([0.25, -0.5, 0.125]), 0.75
"""The sphere of the vectors."""

FAR = 1000.0
"""Where the ray of the last check begins; the sphere has radius 1."""

BOUND = 1e-12
"""A dozen operations on numbers below 10, in float64."""

NO_HIT = tuple(
    (value, "it is known that nothing is met; the distance is MISS then, 1e30")
    for value in (np.inf, -np.inf, np.nan, -1.0, 0.0, 1e38)
)
"""Other numbers for a miss."""

NEAR_ROOT = "inside, the near root is behind the ray: take the far one where the near one is below 0"
"""The explanation of a distance below 0, and of its like."""


def one(student: Any, center: Sequence[float], radius: float, origin: Any, direction: Any) -> Any:
    """Return the distance of one ray in float64."""
    given = still(*(np.array(v, np.float64) for v in (center, origin, direction)))
    found = student.meet_sphere(given[0], np.float64(radius), *given[1:])
    pair = isinstance(found, (tuple, list)) and len(found) == 2
    text = "the nearer root that is above 0, or MISS: np.where chooses"
    hold("ISC-6", "the distance of one ray", not pair, "one number", "two of them", text)
    return numbers_of("ISC-6", "the distance of one ray", found, ())


def _ray(what: str, origin: Any, direction: Any, wanted: float, likely: Likely, otherwise: str = "") -> Any:
    """Return a check of one ray at the sphere of radius 2 around (0, 0, 5)."""

    def run(student: Any) -> None:
        found = one(student, (0, 0, 5), 2.0, origin, direction)
        expect("ISC-6", f"the distance of a ray {what}", found, wanted, BOUND, likely, otherwise)

    return run


from_outside = _ray(
    "from (0, 0, 0) along +z, to radius 2 around (0, 0, 5)",
    (0, 0, 0),
    (0, 0, 1),
    3.0,
    [
        (7.0, "that is the exit: from outside the smaller root is the entry"),
        (-3.0, "the sign of b: b = -(origin - center) . direction"),
        (-7.0, "the sign of b: b = -(origin - center) . direction"),
        (
            1e30,
            "the sign of b, the centre is not subtracted, or the discriminant is wrong",
        ),
        (5.0, "the root of the discriminant is missing: t = b - sqrt(discriminant)"),
        (1.0, "the discriminant itself is subtracted, not its root"),
        (5.0 - 2**0.5, "the discriminant has the radius and not its square"),
        (21 / (5.0 + 2**0.5), "the discriminant has the radius and not its square"),
        (4.2, "the root of the discriminant is missing: t = b - sqrt(discriminant)"),
        (21 / 9.0, "the discriminant itself is subtracted, not its root"),
        (2.0, "the centre is not subtracted from the origin"),
        (6.0, "divided by 2 too little or too often: with a unit direction t = b - sqrt(b * b - c)"),
        (1.5, "divided by 2 too often: with b and not 2 b there is no 2 to divide by"),
    ],
    "the quadratic equation's coefficients: b = -f . d, c = f . f - r * r, f = origin - center",
)
aside = _ray(
    "beside the middle: from (1, 0, 0) along +z, to radius 2 around (0, 0, 5)",
    (1, 0, 0),
    (0, 0, 1),
    5.0 - 3.0**0.5,
    [(1e30, "a sum over all axes where the components are meant, or a wrong discriminant")],
    "the distance of the centre from the ray is not subtracted: r * r - f_perp . f_perp under the root",
)
from_inside = _ray(
    "from inside, (0, 0, 4) along +z",
    (0, 0, 4),
    (0, 0, 1),
    3.0,
    [(-1.0, NEAR_ROOT), (1.0, NEAR_ROOT), (1e30, "from inside there is always an exit: no miss")],
    NEAR_ROOT,
)
behind = _ray(
    "that looks away from the sphere",
    (0, 0, 0),
    (0, 0, -1),
    1e30,
    [
        (-3.0, "both roots are behind the ray: a miss, where the far root is not above 0"),
        (-7.0, "both roots are behind the ray: a miss, where the far root is not above 0"),
        (3.0, "an absolute value: the sphere is behind the ray"),
        (7.0, "an absolute value: the sphere is behind the ray"),
        *NO_HIT,
    ],
    "a sphere behind the ray is a miss",
)
beside = _ray(
    "that passes beside the sphere",
    (3, 0, 0),
    (0, 0, 1),
    1e30,
    [
        (5.0, "the root of max(discriminant, 0) is 0 where the discriminant is below 0: that is a miss"),
        *NO_HIT,
    ],
    "a discriminant below 0 is a miss: np.where(discriminant > 0, ..., MISS)",
)


def grazing(student: Any) -> None:
    """Rays that cut the edge of the sphere, the last one 1e-4 of its radius of 2 deep, and one that touches.

    A discriminant of 1e-8 is a difference of numbers of 4, and known to 1e-15 or so: half of that over its
    root, 1e-4, is what the distance may be off by.
    """
    late = "a threshold other than 0 for the discriminant, or a radius that is too small"
    what = "the distance of a ray at the sphere's edge"
    for square in (4.0 - 1.95**2, 1e-2, 1e-4, 1e-8):
        aside_by = (4.0 - square) ** 0.5
        found = one(student, (0, 0, 5), 2.0, (aside_by, 0, 0), (0, 0, 1))
        wanted = 5.0 - max(4.0 - aside_by**2, 0.0) ** 0.5
        expect("ISC-6", what, found, wanted, 1e-10, [(1e30, late)], late)
    found = one(student, (0, 0, 5), 2.0, (2, 0, 0), (0, 0, 1))
    text = "a ray that only touches misses: the discriminant is above 0, not at least 0"
    expect("ISC-6", "the distance of a ray that touches the sphere", found, 1e30, BOUND, [(5.0, text)], text)


def close(student: Any) -> None:
    """Rays that begin a ten-thousandth before a surface: the entry, and from inside the exit."""
    text = "t > 0, not t > a threshold: what a ray leaves is kept away by its origin (ISC-9)"
    for what, z in (("outside", 3.0), ("inside", 7.0)):
        found = one(student, (0, 0, 5), 2.0, (0, 0, z - 1e-4), (0, 0, 1))
        likely = [(1e30, text), (7.0 - 3.0 + 1e-4, text)]
        expect("ISC-6", f"the distance from just {what}", found, 1e-4, BOUND, likely, NEAR_ROOT)


def many(student: Any) -> None:
    """Arrays of rays (2, 3): each has a distance of its own, and no argument is changed."""
    origin = np.full((2, 3, 3), -4.0)
    origin[..., 1] = 2.0
    center = np.array([0.0, 2.0, 0.0])
    origin[..., 0] = np.arange(6.0).reshape(2, 3) / 4
    direction = np.broadcast_to(np.array([0.0, 0.0, 1.0]), origin.shape)
    found = student.meet_sphere(*still(center, 1.0, origin, direction))
    numbers_of("ISC-6", "the distances of rays (2, 3)", found, (2, 3))
    square = 1.0 - origin[..., 0] ** 2
    wanted = np.where(square > 0, 4.0 - np.sqrt(np.maximum(square, 0.0)), 1e30)
    text = "a sum over all rays: np.sum(..., axis=-1) is one for each"
    expect("ISC-6", "the distances of rays (2, 3)", found, wanted, BOUND, (), text)
    rays = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    found = student.meet_sphere(*still(center, 1.0, (0.0, 2.0, -4.0), rays))
    text = (
        "shapes of the origin where those of all operands are meant: np.full_like of a result, not of origin"
    )
    expect("ISC-6", "the distances of two rays from one origin", found, (3.0, 1e30), BOUND, (), text)


def answer(student: Any, given: Any) -> Any:
    """Return the student's answer to a case of intersection.sphere."""
    found = student.meet_sphere(CENTER, np.float64(RADIUS), given["origin"], given["direction"])
    return {"t": numbers_of("ISC-6", "the distance of one ray", found, ())}


def random_rays(student: Any) -> None:
    """Hits are on the sphere, and nothing is nearer."""
    origin, direction = spread(11, (2000, 3), -2.0, 2.0), normals(12, (2000, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    t = student.meet_sphere(CENTER, np.float64(RADIUS), origin, direction)
    t = numbers_of("ISC-6", "the distances of 2000 rays", t, (2000,))
    hit = t < 1e30
    away = np.linalg.norm(origin + np.where(hit, t, 0.0)[:, None] * direction - CENTER, axis=-1)
    # Some ten operations on numbers below 10, in float64; tangents lose half of the digits.
    off = float(np.abs(away - RADIUS)[hit].max(initial=0.0))
    text = "not a root of the equation"
    hold("ISC-6", "hits' distance from the sphere", off <= 1e-6, "at most 1e-6", off, text)
    hold("ISC-2", "the least distance", np.all(t > 0.0), "above 0", t.min(), NEAR_ROOT)
    inside = np.linalg.norm(origin - CENTER, axis=-1) < RADIUS
    missed = int(np.count_nonzero(inside & ~hit))
    hold("ISC-6", "misses from inside the sphere", missed == 0, "none", missed, NEAR_ROOT)
    steps = np.linspace(0, 0.999, 50)[:, None] * np.where(hit, t, 8.0)[:, None, None]
    outside = np.linalg.norm(origin[:, None] + steps * direction[:, None] - CENTER, axis=-1) > RADIUS
    through = int(np.count_nonzero(~np.all(outside, axis=1) & ~inside))
    text = "the far root from outside, or a miss where there is a hit"
    hold("ISC-2", "rays that went through the sphere before their hit", through == 0, "none", through, text)


def far_away(student: Any) -> None:
    """The distance is known to some 16 ulp of itself, 1000 * 16 * 2**-24, times the slant of at most 2.3."""
    across = np.linspace(0.0, 0.9, 200, dtype=np.float32)
    origin = np.stack([across, 0 * across, np.full_like(across, FAR)], axis=-1)
    direction = np.broadcast_to(np.array([0, 0, -1], np.float32), origin.shape)
    t = student.meet_sphere(np.zeros(3, np.float32), np.float32(1.0), origin, direction)
    kind_of_number("ISC-6", "distances of float32 rays", t, np.float32)
    numbers_of("ISC-6", "the distances of 200 rays", t, (200,))
    error = float(np.abs(t - (FAR - np.sqrt(1.0 - across.astype(np.float64) ** 2))).max())
    bound = 2.3 * FAR * 16 * 2.0**-24
    if not error <= bound:
        lost = (
            "b * b - (f . f - r * r) loses the radius: measure the discriminant at the point of the ray that "
            "is nearest to the centre, f - (f . d) d"
        )
        what = f"the error at a distance of {FAR:g} in float32"
        raise Wrong("ISC-6", what, f"at most {bound:.3g}", f"{error:.3g}", lost)


CHECKS = (
    Check("a ray from outside", from_outside),
    Check("a ray beside the middle", aside),
    Check("a ray from inside", from_inside),
    Check("a ray that looks away", behind),
    Check("a ray that misses", beside),
    Check("rays at the edge", grazing),
    Check("rays that begin close by", close),
    Check("arrays of rays", many),
    Check(
        "the spec's vectors",
        asked("intersection.sphere", answer, "rays that begin on the sphere, or look away from it"),
    ),
    Check("random rays", random_rays),
    Check("a small sphere far away in float32", far_away),
)
"""In the order in which they explain a mistake best."""
