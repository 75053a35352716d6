"""Programs of a history, traced from the reference (refimpl/light/history.py).

1. `find`: where a pixel's first hit was, in pixels of the last picture, and what its normal was then.
2. `take`: what the pixel has found so far, with one more pixel of the last picture.
3. `blend`: what that gives with the new colour.

What surrounds them, in every kernel and in the interpreter [numpy_executor.py]: for each of up to four pixels
of the last picture that are in it, what it knows, and the motion of its primitive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...refimpl import vectors
from ...refimpl.light import history
from ...refimpl.light.camera import CameraBasis
from ...refimpl.light.history import First, Known, Moved, Sums
from ..core.ir import Program, Type
from ..core.passes import pipeline
from ..core.trace import trace
from ..core.verify import verify
from .lower_smooth import THERE

PASSES = ("scalarize", "fold_float32", "eliminate_dead")
"""What the programs go through: numbers in place of vectors, the bits that float32 gives."""

NUMBER, COUNT = "number", "count"
"""The plane of a primitive's number, and that of the samples of a mean."""

COLOR = ("color_r", "color_g", "color_b")
"""Planes of the mean colour, and numbers of the new one."""


def _of(name: str, ends: str = "xyz") -> tuple[str, ...]:
    """Return the names of a vector's numbers."""
    return tuple(f"{name}_{end}" for end in ends)


FIRST = (NUMBER, *_of("point"), *_of("normal"), *_of("direction"))
"""Planes of first hits: which primitive, where, its normal, and the ray's direction."""

PAST = (NUMBER, *_of("normal"), *COLOR, COUNT)
"""Planes of what a picture leaves for the next one."""

RESTS, LIMIT, FOUND = "rests", "limit", "found"
"""Columns of a motion: 1 or 0 for whether nothing moved; most samples; 1, or 0 for "nothing"."""

MOTION = (
    *(name for i in range(3) for name in _of(f"turn{i}")),
    *_of("center"),
    *_of("shift"),
    *(RESTS, LIMIT, FOUND),
)
"""Columns of the table of motions, whose rows are primitives by number."""

CAMERA = (*_of("position"), *_of("right"), *_of("up"), *_of("forward"), "tan_half_fov")
"""Numbers of a camera: fields of refimpl/light/camera.py: CameraBasis."""

CAMERAS = (*CAMERA, *(f"{name}_before" for name in CAMERA))
"""Numbers of both cameras, that of now first."""

SIZE = ("image_width", "image_height")
"""The picture's size, as floats."""

BEFORE = _of("before")
"""The normal of the first hit, as it was."""

TOTALS = ("weights", *_of("total", "rgb"), "total_count", *_of("low", "rgb"), *_of("high", "rgb"))
"""What up to four pixels add up to."""

STARTS = (*(0.0,) * 5, *(float(np.finfo(np.float32).max),) * 3, *(-float(np.finfo(np.float32).max),) * 3)
"""What these begin with: colours are finite, and all of them are between these ends."""

PLACE = ("across", "share_across", "down", "share_down", "ahead")
"""Where the pixel was: pixels to the right and the share of the one beyond, the same down; if that was ahead
of the camera."""

BEYOND = ("beyond_across", "beyond_down")
"""Whether a pixel is the one beyond, along both axes."""


@dataclass(frozen=True)
class HistoryPrograms:
    """The three programs."""

    find: Program
    take: Program
    blend: Program


def lower_history() -> HistoryPrograms:
    """Return the programs of a history, of any scene."""
    kinds = {**dict.fromkeys(BEYOND, "bool")}
    find = (*FIRST[1:], *MOTION, *CAMERAS, *SIZE)
    there = [f"{THERE}{name}" for name in (*PAST, RESTS)]
    shares = ("share_across", "share_down")
    take = (NUMBER, RESTS, *BEFORE, *shares, *BEYOND, *there, *TOTALS)
    return HistoryPrograms(
        _lowered(_find, find, kinds),
        _lowered(_take, take, kinds),
        _lowered(_blend, (*TOTALS, *COLOR, LIMIT), kinds),
    )


Named = Mapping[str, Any]
"""Traced numbers by name."""


def _lowered(
    function: Callable[[Named], dict[str, Any]], names: Sequence[str], kinds: Mapping[str, str]
) -> Program:
    """Return the program of a function of named numbers."""
    inputs = {name: Type(kinds.get(name, "float32")) for name in names}
    program = trace(lambda *given: function(dict(zip(names, given, strict=True))), inputs)
    return pipeline.run(verify(program, "traced history"), PASSES)


def _vector(given: Named, name: str, ends: str = "xyz") -> Any:
    """Return a vector of its numbers."""
    return vectors.vector(*(given[each] for each in _of(name, ends)))


def _camera(given: Named, end: str) -> CameraBasis:
    """Return a camera."""
    axes = {
        name: vectors.vector(*(given[f"{name}_{axis}{end}"] for axis in "xyz"))
        for name in ("position", "right", "up", "forward")
    }
    return CameraBasis(**axes, tan_half_fov=given[f"tan_half_fov{end}"])


def _find(given: Named) -> dict[str, Any]:
    """Return where a pixel was, and its normal then."""
    point, normal, direction = (_vector(given, name) for name in ("point", "normal", "direction"))
    first = First(given[FOUND], point, normal, direction)
    turn = [_vector(given, f"turn{i}") for i in range(3)]
    row = Moved(turn, _vector(given, "center"), _vector(given, "shift"), given[RESTS] > 0.0)
    cameras = [_camera(given, end) for end in ("", "_before")]
    found, (width, height) = given[FOUND] > 0.0, (given[name] for name in SIZE)
    across, down, ahead = history.displacement(row, found, cameras, first, width, height)
    _, before = history.point_before(row, first)
    place = (*history.split(across), *history.split(down), ahead)
    return {**dict(zip(PLACE, place, strict=True)), **_apart(BEFORE, before)}


def _take(given: Named) -> dict[str, Any]:
    """Return the sums with one more pixel of the last picture."""
    rests = (given[RESTS] > 0.0) & (given[f"{THERE}{RESTS}"] > 0.0)
    same = history.same_surface(
        given[f"{THERE}{NUMBER}"] == given[NUMBER],
        _vector(given, f"{THERE}normal"),
        vectors.vector(*(given[name] for name in BEFORE)),
        rests,
    )
    across, down = (
        history.share(given[f"share_{axis}"], given[f"beyond_{axis}"]) for axis in ("across", "down")
    )
    weight = np.where(same, across * down, 0.0)
    color, count = _vector(given, f"{THERE}color", "rgb"), given[f"{THERE}{COUNT}"]
    return _totals(history.added(_sums(given), weight, color, count))


def _blend(given: Named) -> dict[str, Any]:
    """Return the mean and its count."""
    known: Known = history.known_of(_sums(given))
    mean, count = history.blend(known, _vector(given, "color", "rgb"), given[LIMIT])
    return {**_apart(COLOR, mean), COUNT: count}


def _sums(given: Named) -> Sums:
    """Return the sums of their numbers."""
    color, low, high = (_vector(given, name, "rgb") for name in ("total", "low", "high"))
    return Sums(given["weights"], color, given["total_count"], low, high)


def _totals(sums: Sums) -> dict[str, Any]:
    """Return the numbers of sums."""
    parts = (sums.weights, *_numbers(sums.color), sums.samples, *_numbers(sums.low), *_numbers(sums.high))
    return dict(zip(TOTALS, parts, strict=True))


def _numbers(vector: Any) -> list[Any]:
    """Return a vector's numbers."""
    return [vector[..., i] for i in range(3)]


def _apart(names: Sequence[str], vector: Any) -> dict[str, Any]:
    """Return a vector's numbers by name."""
    return dict(zip(names, _numbers(vector), strict=True))
