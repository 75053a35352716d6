"""Compile a history for a target: one kernel, of any scene and size.

    first hits, last picture, colour, motions, cameras -> follow -> this picture, for the next one

1. Trace the history [lower_history.py], and run the passes of the profile.
2. Emit the three programs as blocks: where the pixel was, two loops around what a pixel adds, and the mean
   [`_body`].
3. Put it together with a manifest [plane_kernel.py].

A pixel outside of the picture, or one that was not ahead of the camera, is not looked at: its weight is 0
in the definition. How far rounding takes a history is said by HIS-6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from ..core import profiles
from ..core.ir import Program
from ..core.passes import pipeline
from ..kernel import interface
from ..kernel.interface import CAMERAS as CAMERAS_ARRAY
from ..kernel.interface import FIRST as FIRST_ARRAY
from ..kernel.interface import FOLLOW, MOTIONS, RESULT
from ..kernel.interface import PAST as PAST_ARRAY
from . import plane_kernel
from .encode_kernel import statements
from .lower_history import (
    BEFORE,
    BEYOND,
    CAMERAS,
    COLOR,
    COUNT,
    FIRST,
    MOTION,
    NUMBER,
    PASSES,
    PAST,
    PLACE,
    RESTS,
    SIZE,
    STARTS,
    TOTALS,
    HistoryPrograms,
    lower_history,
)
from .lower_smooth import THERE
from .plane_kernel import Draft, PlaneArtifact, place_of

SCHEMA = "wamnet-history-kernel-1"
"""Name and version of the manifest's form; described in spec/history.md."""

SAID = "the history", "follow pictures by refimpl/light/history.py"
"""What is said where a target has no such kernel."""

BOUND = "(60 L + 8) u M after any number of pictures: largest limit L, largest colour M, u = 2^-24"
"""What the text says of rounding, where divisions and roots are rounded correctly (HIS-6)."""

LANES = 1
"""Pixels in a work item: each of them looks at other places."""


@lru_cache
def compile_history(target: str, profile: str = "ieee") -> PlaneArtifact:
    """Return the kernel that adds a picture to a history."""
    promised = profiles.profile_named(profile)
    dialect = plane_kernel.dialect_of(target, LANES, *SAID)
    programs = _of_profile(lower_history(), promised.passes)
    integers = plane_kernel.integers_of(dialect, FOLLOW)
    counts = {"first": len(FIRST), "past": len(PAST), "motion": len(MOTION), "cameras": len(CAMERAS)}
    draft = Draft(
        FOLLOW,
        "history: one picture more",
        [programs.find, programs.take, programs.blend],
        programs,
        interface.following(counts, integers),
        _body(programs, dialect) if dialect else (),
        "",
        {"first": FIRST, "past": PAST, "motion": MOTION, "cameras": CAMERAS},
        BOUND,
        {
            "schema": SCHEMA,
            "passes": [*PASSES, *promised.passes],
            "first": list(FIRST),
            "past": list(PAST),
            "motion": list(MOTION),
            "cameras": list(CAMERAS),
        },
    )
    return plane_kernel.put_together(draft, target, profile, LANES)


def _of_profile(programs: HistoryPrograms, passes: Sequence[str]) -> HistoryPrograms:
    """Return the programs after the passes of a profile."""
    return HistoryPrograms(
        *(pipeline.run(each, passes) for each in (programs.find, programs.take, programs.blend))
    )


# ---- text ---------------------------------------------------------------------------------------------


def _body(programs: HistoryPrograms, dialect: Any) -> list[str]:
    """Return the statements."""
    lines = [_plane(dialect, name, FIRST_ARRAY, i, "at") for i, name in enumerate(FIRST)]
    lines += [
        dialect.load.format(name=name, image="color", channels=3, channel=i) for i, name in enumerate(COLOR)
    ]
    lines.append(dialect.index("row", dialect.cast("int32", NUMBER)))
    lines += [_entry(dialect, name, MOTIONS, "row", i, MOTION) for i, name in enumerate(MOTION)]
    lines += [_entry(dialect, name, CAMERAS_ARRAY, "0", i, CAMERAS) for i, name in enumerate(CAMERAS)]
    lines += [
        dialect.let("float32", name, dialect.cast("float32", integer))
        for name, integer in zip(SIZE, ("width", "height"), strict=True)
    ]
    kinds = dict(zip(PLACE, ("int32", "float32", "int32", "float32", "bool"), strict=True))
    kinds |= dict.fromkeys(BEFORE, "float32")
    lines += [dialect.var(kind, name, kept=True) for name, kind in kinds.items()]
    lines += _block(programs.find, dialect, {name: name for name in kinds})
    lines += [
        dialect.var("float32", name, dialect.number(start, "float32"), kept=True)
        for name, start in zip(TOTALS, STARTS, strict=True)
    ]
    lines += _loops(programs.take, dialect)
    results = (*COLOR, COUNT)
    lines += [dialect.var("float32", f"new_{name}") for name in results]
    lines += _block(programs.blend, dialect, {name: f"new_{name}" for name in results})
    for plane, name in enumerate(PAST):
        value = f"new_{name}" if name in results else name
        lines.append(dialect.plane_store.format(**place_of(RESULT, plane), value=value))
    return lines


def _plane(dialect: Any, name: str, array: str, plane: int, where: str) -> str:
    """Return the declaration of a plane's number."""
    return str(dialect.let("float32", name, dialect.plane_at.format(**place_of(array, plane), where=where)))


def _entry(dialect: Any, name: str, array: str, row: str, column: int, columns: Sequence[str]) -> str:
    """Return the declaration of a number in a row of a table."""
    place = {"row": row, "column": column, "columns": len(columns)}
    return str(dialect.let("float32", name, dialect.table_at.format(array=array, **place)))


def _block(program: Program, dialect: Any, outputs: Mapping[str, str]) -> list[str]:
    """Return a program's statements as a block of their own, which assigns its outputs to variables."""
    lines: list[str] = []
    texts = statements(program, dialect, lines)
    lines += [f"{outputs[name]} = {texts[index]};" for name, index in program.outputs]
    return ["{", *(f"    {line}" for line in lines), "}"]


def _loops(take: Program, dialect: Any) -> list[str]:
    """Return the loops over the pixels of the last picture."""
    inside = "ahead && column >= 0 && column < width && line >= 0 && line < height"
    reads = [_plane(dialect, f"{THERE}{name}", PAST_ARRAY, i, "there") for i, name in enumerate(PAST)]
    of_row = dialect.index(f"{THERE}row", dialect.cast("int32", f"{THERE}{NUMBER}"))
    flags = [dialect.let("bool", name, f"{name.removeprefix('beyond_')}_too > 0") for name in BEYOND]
    body = [
        *reads,
        of_row,
        _entry(dialect, f"{THERE}{RESTS}", MOTIONS, f"{THERE}row", MOTION.index(RESTS), MOTION),
        *flags,
        *_block(take, dialect, {name: name for name in TOTALS}),
    ]
    return [
        dialect.loop("down_too", 2),
        f"    {dialect.index('line', 'y + down + down_too')}",
        f"    {dialect.loop('across_too', 2)}",
        f"        {dialect.index('column', 'x + across + across_too')}",
        f"        if ({inside}) {{",
        f"            {dialect.pixel_place('there', 'line', 'column')}",
        *(f"            {line}" for line in body),
        "        }",
        "    }",
        "}",
    ]
