"""Compile a history for a target: one kernel, of any scene and size.

    first hits, last picture, colour, motions, cameras -> follow -> this picture, for the next one

1. Trace the reference's history [`lower_history`], and run the passes of the profile. `find`: where a
   pixel's first hit was, in pixels of the last picture, and what its normal was then. `take`: what the pixel
   has found so far, with one more pixel of the last picture. `blend`: what that gives with the new colour.
2. The three programs follow each other: where the pixel was, two loops around what a pixel adds, and the mean
   [`history_kernel`].
3. Put it together with a manifest [plane_kernel.py].

A pixel outside of the picture, or one that was not ahead of the camera, is not looked at: its weight is 0
in the definition. How far rounding takes a history is said by HIS-6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...refimpl import vectors
from ...refimpl.light import history
from ...refimpl.light.camera import CameraBasis
from ...refimpl.light.history import First, Moved, Sums
from ..artifact import Artifact
from ..core.ir import Image, Program
from ..core.passes import pipeline
from ..kernel import interface
from ..kernel.interface import (
    FOLLOW,
    IMAGE,
    INTEGERS,
    MOTIONS,
    READ,
    RESULT,
    WRITE,
    Interface,
    image_of,
    planes_of,
)
from ..kernel.interface import Array as Memory
from ..kernel.kernel import FLOAT, Array, Body, Expr, For, If, Kernel, Let, Store, apply, const, load, name
from ..schedules.common import HEIGHT, WIDTH, X, Y, lets, loop
from ..targets import Language, language_named
from .emit_path import GROUPS
from .plane_kernel import check_lanes, compiled, reads
from .smooth_kernel import THERE
from .values import NUMBER as ONE
from .values import RGB, TRUTH, XYZ, Given, Values, floats, lowered, names

SCHEMA = "wamnet-history-kernel-1"
"""Name and version of the manifest's form; described in spec/history.md."""

PASSES = ("scalarize", "fold_float32", "eliminate_dead")
"""What the programs go through: numbers in place of vectors, the bits that float32 gives."""

NUMBER, COUNT = "number", "count"
"""The plane of a primitive's number, and that of the samples of a mean."""

COLOR = tuple(GROUPS["color"])
"""Planes of the mean colour, and numbers of the new one."""

_HIT: Values = floats("point", "normal", "direction", ends=XYZ)
"""A first hit: where, its normal, and the ray's direction."""

FIRST = (NUMBER, *names(_HIT))
"""Planes of first hits: which primitive, and the hit."""

_LEFT: Values = {**floats(NUMBER), **floats("normal", ends=XYZ), **floats("color", ends=RGB), **floats(COUNT)}
"""What a picture leaves for the next one."""

PAST = tuple(names(_LEFT))
"""Its planes."""

RESTS, LIMIT, FOUND = "rests", "limit", "found"
"""Columns of a motion: 1 or 0 for whether nothing moved; most samples; 1, or 0 for "nothing"."""

_MOVED: Values = {
    **floats("turn0", "turn1", "turn2", "center", "shift", ends=XYZ),
    **floats(RESTS, LIMIT, FOUND),
}
"""The motion of a primitive."""

MOTION = tuple(names(_MOVED))
"""Columns of the table of motions, whose rows are primitives by number."""

_AXES: Values = floats("position", "right", "up", "forward", ends=XYZ)
"""Vectors of a camera: fields of refimpl/light/camera.py: CameraBasis."""

_CAMERA = (*names(_AXES), "tan_half_fov")
"""Numbers of a camera."""

CAMERAS = (*_CAMERA, *(f"{each}_before" for each in _CAMERA))
"""Numbers of both cameras, that of now first."""

SIZE = ("image_width", "image_height")
"""The picture's size, as floats."""

_BEFORE: Values = floats("before", ends=XYZ)
"""The normal of the first hit, as it was."""

_SUMS: Values = {
    **floats("weights"),
    **floats("total", ends=RGB),
    **floats("total_count"),
    **floats("low", "high", ends=RGB),
}
"""What up to four pixels add up to."""

TOTALS = tuple(names(_SUMS))
"""Its numbers."""

STARTS = (*(0.0,) * 5, *(float(np.finfo(np.float32).max),) * 3, *(-float(np.finfo(np.float32).max),) * 3)
"""What these begin with: colours are finite, and all of them are between these ends."""

BEYOND = ("beyond_across", "beyond_down")
"""Whether a pixel is the one beyond, along both axes."""

BOUND = "(60 L + 8) u M after any number of pictures: largest limit L, largest colour M, u = 2^-24"
"""What the text says of rounding, where divisions and roots are rounded correctly (HIS-6)."""

NOTES = {
    f"{IMAGE}color": "finite",
    interface.PAST: 'before the first image zeros, and primitive "nothing"',
    MOTIONS: 'one for each primitive by its number, and one for "nothing"',
    "row_stride": "at least width",
}
"""What callers must know of arguments."""


@dataclass(frozen=True)
class HistoryPrograms:
    """The three programs."""

    find: Program
    take: Program
    blend: Program


def lower_history() -> HistoryPrograms:
    """Return the programs of a history, of any scene."""
    beyond, there = dict.fromkeys(BEYOND, (ONE, TRUTH)), {f"{THERE}{each}": v for each, v in _LEFT.items()}
    # Where the pixel was: pixels to the right and the share of the one beyond, the same down; if ahead.
    place = {**floats("across", "share_across", "down", "share_down"), "ahead": (ONE, TRUTH)}
    find = {**_HIT, **_MOVED, **floats(*CAMERAS, *SIZE)}
    take = {**floats(NUMBER, RESTS), **_BEFORE, **floats("share_across", "share_down"), **beyond, **there}
    color, new = floats("color", ends=RGB), {**floats("color", ends=RGB), **floats(COUNT)}

    def program(function: Callable[[Given], Given], inputs: Values, outputs: Values) -> Program:
        return lowered("history", function, inputs, outputs, PASSES)

    return HistoryPrograms(
        program(_find, find, {**place, **_BEFORE}),
        program(_take, {**take, **floats(f"{THERE}{RESTS}"), **_SUMS}, _SUMS),
        program(_blend, {**_SUMS, **color, **floats(LIMIT)}, new),
    )


def _camera(given: Given, end: str) -> CameraBasis:
    """Return a camera."""
    axes = {each: vectors.vector(*(given[f"{each}{axis}{end}"] for axis in XYZ)) for each in _AXES}
    return CameraBasis(**axes, tan_half_fov=given[f"tan_half_fov{end}"])


def _find(given: Given) -> Given:
    """Return where a pixel was, and its normal then."""
    first = First(given[FOUND], given["point"], given["normal"], given["direction"])
    turn = [given[f"turn{i}"] for i in range(3)]
    row = Moved(turn, given["center"], given["shift"], given[RESTS] > 0.0)
    cameras = [_camera(given, end) for end in ("", "_before")]
    found, (width, height) = given[FOUND] > 0.0, (given[each] for each in SIZE)
    across, down, ahead = history.displacement(row, found, cameras, first, width, height)
    _, before = history.point_before(row, first)
    place = (*history.split(across), *history.split(down), ahead, before)
    named = ("across", "share_across", "down", "share_down", "ahead", "before")
    return dict(zip(named, place, strict=True))


def _take(given: Given) -> Given:
    """Return the sums with one more pixel of the last picture."""
    rests = (given[RESTS] > 0.0) & (given[f"{THERE}{RESTS}"] > 0.0)
    number, normal = given[f"{THERE}{NUMBER}"], given[f"{THERE}normal"]
    same = history.same_surface(number == given[NUMBER], normal, given["before"], rests)
    across, down = (history.share(given[f"share_{a}"], given[f"beyond_{a}"]) for a in ("across", "down"))
    weight = np.where(same, across * down, 0.0)
    sums = history.added(_sums(given), weight, given[f"{THERE}color"], given[f"{THERE}{COUNT}"])
    return dict(zip(_SUMS, (sums.weights, sums.color, sums.samples, sums.low, sums.high), strict=True))


def _blend(given: Given) -> Given:
    """Return the mean and its count."""
    mean, count = history.blend(history.known_of(_sums(given)), given["color"], given[LIMIT])
    return {"color": mean, COUNT: count}


def _sums(given: Given) -> Sums:
    """Return the sums of up to four pixels."""
    return Sums(*(given[each] for each in _SUMS))


@lru_cache
def compile_history(language: Language | str) -> Artifact:
    """Return the kernel that adds a picture to a history."""
    chosen = language_named(language)
    check_lanes(chosen, 1, "the history", "follow pictures by refimpl/light/history.py")
    programs = pipeline.run_each(lower_history(), chosen.profile.passes)
    lists = {"first": FIRST, "past": PAST, "motion": MOTION, "cameras": CAMERAS}
    facts = {"schema": SCHEMA, "passes": [*PASSES, *chosen.profile.passes]}
    return compiled(
        "history: one picture more",
        history_kernel(programs),
        [programs.find, programs.take, programs.blend],
        {**facts, **{each: list(names) for each, names in lists.items()}},
        BOUND,
        {
            interface.FIRST: FIRST,
            interface.PAST: PAST,
            RESULT: PAST,
            MOTIONS: MOTION,
            interface.CAMERAS: CAMERAS,
        },
        NOTES,
        chosen,
        programs,
    )


def history_kernel(programs: HistoryPrograms) -> Kernel:
    """Return the kernel of one pixel."""
    find, found = lets(programs.find, prefix="f")
    blend, mean = lets(programs.blend, prefix="b")
    values = {each: mean.get(each) or name(each, FLOAT) for each in PAST}
    body: Body = (
        *reads(FIRST, lambda i: load(interface.FIRST, i, Y, X)),
        *reads(COLOR, lambda i: load(f"{IMAGE}color", Y, X, i)),
        Let("row", apply("convert", name(NUMBER, FLOAT), value="int32")),
        *reads(MOTION, lambda i: load(MOTIONS, name("row"), i)),
        *reads(CAMERAS, lambda i: load(interface.CAMERAS, i)),
        *(
            Let(each, apply("convert", size, value="float32"))
            for each, size in zip(SIZE, (WIDTH, HEIGHT), strict=True)
        ),
        *find,
        *(
            Array(each, FLOAT, kept=True, value=const(start))
            for each, start in zip(TOTALS, STARTS, strict=True)
        ),
        _taken(programs, found),
        *blend,
        *(Store(RESULT, (const(plane), Y, X), values[each]) for plane, each in enumerate(PAST)),
    )
    arrays = (
        planes_of(interface.FIRST, READ, len(FIRST)),
        planes_of(interface.PAST, READ, len(PAST)),
        image_of(Image("color", 3, -np.inf, np.inf), READ),
        Memory(MOTIONS, READ, (interface.PRIMITIVES, len(MOTION))),
        Memory(interface.CAMERAS, READ, (len(CAMERAS),)),
        planes_of(RESULT, WRITE, len(PAST)),
    )
    return Kernel(Interface(FOLLOW, arrays, INTEGERS[FOLLOW]), body)


def _taken(programs: HistoryPrograms, found: dict[str, Expr]) -> For:
    """Return the loops over the pixels of the last picture."""
    line, column = name("line"), name("column")
    take, sums = lets(programs.take, found)
    there = name(f"{THERE}row")
    body: Body = (
        *reads(PAST, lambda i: load(interface.PAST, i, line, column), THERE),
        Let(f"{THERE}row", apply("convert", name(f"{THERE}{NUMBER}", FLOAT), value="int32")),
        Let(f"{THERE}{RESTS}", load(MOTIONS, there, MOTION.index(RESTS))),
        *(Let(each, apply("greater", name(f"{each.removeprefix('beyond_')}_too"), 0)) for each in BEYOND),
        *take,
        *(Store(each, (), sums[each]) for each in TOTALS),
    )
    inside = (column >= 0) & (column < WIDTH) & (line >= 0) & (line < HEIGHT)
    return loop(
        "down_too",
        2,
        Let("line", Y + found["down"] + name("down_too")),
        loop(
            "across_too",
            2,
            Let("column", X + found["across"] + name("across_too")),
            If(found["ahead"] & inside, body),
        ),
    )
