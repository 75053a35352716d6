"""Break a renderer so that a given clause is blamed; then hide a fault, and write the case that finds it.

The grader replaces a function of the reference by yours, asks a part of the suite, and reads who is blamed:
the clause of the most elementary kind that fails. Your function gets the right one, and then what the right
one gets. Return what a programmer's mistake would give: numbers, and no exception. Look into
`spec/vectors` as much as you like: a suite has no secrets. Guide: how the suite is made. Clauses: CNF-3,
CNF-11, CNF-13.
"""

from __future__ import annotations

from typing import Any


def break_sphere(right: Any, center: Any, radius: Any, origin: Any, direction: Any) -> Any:
    """Return distances (...) so that ISC-6 is blamed, by at most 4 of the 16 cases of intersection.sphere.

    Replaces `refimpl/light/shapes/sphere.py: sphere_distance`.
    """
    raise NotImplementedError("break_sphere")


def break_surface(right: Any, geometry: Any, hit: Any, origin: Any, direction: Any) -> Any:
    """Return a surface (right(...)._replace(...)) so that ISC-8 is blamed.

    Replaces `refimpl/light/intersection.py: surface_at`.
    """
    raise NotImplementedError("break_surface")


def break_camera(right: Any, a: Any) -> Any:
    """Return vectors (..., 3) so that cases of camera.ray fail, and still not the camera is blamed: VEC-3 is.

    Replaces `refimpl/vectors.py: normalize`.
    """
    raise NotImplementedError("break_camera")


def break_path(right: Any, world: Any, path: Any, hit: Any, surface: Any) -> Any:
    """Return weights (...) so that every function is right by itself, and only paths are wrong.

    Replaces `refimpl/light/transport.py: emission_weight`: how much of a lamp counts that a path meets by
    chance. LTR-2 is to be blamed.
    """
    raise NotImplementedError("break_path")


def break_picture(picture: Any) -> Any:
    """Return a picture, layers (H, W, C) by name, with one over each distance as its layer `depth`.

    `wamnet verify-renderer` is to blame the rule `depth`, and none that comes before it.
    """
    raise NotImplementedError("break_picture")


def hide(right: Any, linear: Any, exposure_stops: float = 0.0) -> Any:
    """Return display-encoded values (...) that pass every case of encoding.display, and are wrong.

    Of a thousand values of linear, spread evenly over [0, 1], at least fifty must be off by 0.01 or more.
    Replaces `refimpl/encoding.py: to_display`.
    """
    raise NotImplementedError("hide")


def new_case() -> dict[str, float]:
    """Return the inputs of one more case of encoding.display, {"linear": ...}, which notices what you hid."""
    raise NotImplementedError("new_case")
