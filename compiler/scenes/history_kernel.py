"""Compile a history for a target: one kernel, of any scene and size.

    first hits, last picture, colour, motions, cameras -> follow -> this picture, for the next one

1. Trace the history [lower_history.py], and run the passes of the profile.
2. The three programs follow each other: where the pixel was, two loops around what a pixel adds, and the mean
   [`history_kernel`].
3. Put it together with a manifest [plane_kernel.py].

A pixel outside of the picture, or one that was not ahead of the camera, is not looked at: its weight is 0
in the definition. How far rounding takes a history is said by HIS-6.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..artifact import Artifact
from ..core import profiles
from ..core.ir import Image
from ..core.passes import pipeline
from ..kernel.interface import CAMERAS as CAMERAS_ARRAY
from ..kernel.interface import FIRST as FIRST_ARRAY
from ..kernel.interface import (
    FOLLOW,
    IMAGE,
    INTEGERS,
    MOTIONS,
    PRIMITIVES,
    READ,
    RESULT,
    WRITE,
    Interface,
    image_of,
    planes_of,
)
from ..kernel.interface import PAST as PAST_ARRAY
from ..kernel.interface import Array as Memory
from ..kernel.kernel import FLOAT, Array, Body, Expr, For, If, Kernel, Let, Store, apply, const, load, name
from ..schedules.common import HEIGHT, WIDTH, X, Y, lets, loop
from ..targets import Language, language_named
from .lower_history import (
    BEYOND,
    CAMERAS,
    COLOR,
    FIRST,
    MOTION,
    NUMBER,
    PASSES,
    PAST,
    RESTS,
    SIZE,
    STARTS,
    TOTALS,
    HistoryPrograms,
    lower_history,
)
from .lower_smooth import THERE
from .plane_kernel import check_lanes, compiled, reads

SCHEMA = "wamnet-history-kernel-1"
"""Name and version of the manifest's form; described in spec/history.md."""

BOUND = "(60 L + 8) u M after any number of pictures: largest limit L, largest colour M, u = 2^-24"
"""What the text says of rounding, where divisions and roots are rounded correctly (HIS-6)."""

NOTES = {
    f"{IMAGE}color": "finite",
    PAST_ARRAY: 'before the first image zeros, and primitive "nothing"',
    MOTIONS: 'one for each primitive by its number, and one for "nothing"',
    "row_stride": "at least width",
}
"""What callers must know of arguments."""


@lru_cache
def compile_history(language: Language | str, profile: str = "ieee") -> Artifact:
    """Return the kernel that adds a picture to a history."""
    chosen, promised = language_named(language), profiles.profile_named(profile)
    check_lanes(chosen, 1, "the history", "follow pictures by refimpl/light/history.py")
    programs = pipeline.run_each(lower_history(), promised.passes)
    lists = {"first": FIRST, "past": PAST, "motion": MOTION, "cameras": CAMERAS}
    facts = {"schema": SCHEMA, "passes": [*PASSES, *promised.passes]}
    return compiled(
        "history: one picture more",
        history_kernel(programs),
        [programs.find, programs.take, programs.blend],
        {**facts, **{each: list(names) for each, names in lists.items()}},
        BOUND,
        {FIRST_ARRAY: FIRST, PAST_ARRAY: PAST, RESULT: PAST, MOTIONS: MOTION, CAMERAS_ARRAY: CAMERAS},
        NOTES,
        (chosen, promised),
        programs,
    )


def history_kernel(programs: HistoryPrograms) -> Kernel:
    """Return the kernel of one pixel."""
    find, found = lets(programs.find, prefix="f")
    blend, mean = lets(programs.blend, prefix="b")
    values = {each: mean.get(each) or name(each, FLOAT) for each in PAST}
    body: Body = (
        *reads(FIRST, lambda i: load(FIRST_ARRAY, i, Y, X)),
        *reads(COLOR, lambda i: load(f"{IMAGE}color", Y, X, i)),
        Let("row", apply("convert", name(NUMBER, FLOAT), value="int32")),
        *reads(MOTION, lambda i: load(MOTIONS, name("row"), i)),
        *reads(CAMERAS, lambda i: load(CAMERAS_ARRAY, i)),
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
        planes_of(FIRST_ARRAY, READ, len(FIRST)),
        planes_of(PAST_ARRAY, READ, len(PAST)),
        image_of(Image("color", 3, -np.inf, np.inf), READ),
        Memory(MOTIONS, READ, (PRIMITIVES, len(MOTION))),
        Memory(CAMERAS_ARRAY, READ, (len(CAMERAS),)),
        planes_of(RESULT, WRITE, len(PAST)),
    )
    return Kernel(Interface(FOLLOW, arrays, INTEGERS[FOLLOW]), body)


def _taken(programs: HistoryPrograms, found: dict[str, Expr]) -> For:
    """Return the loops over the pixels of the last picture."""
    line, column = name("line"), name("column")
    take, sums = lets(programs.take, found)
    there = name(f"{THERE}row")
    body: Body = (
        *reads(PAST, lambda i: load(PAST_ARRAY, i, line, column), THERE),
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
