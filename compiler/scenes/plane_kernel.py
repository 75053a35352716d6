"""Kernels on planes of numbers: the edge-avoiding filter's, and that of the history; source and manifest.

A kernel has a role, programs that were traced, and statements around them, which smooth_kernel.py and
history_kernel.py write in the words of a dialect. What is left is the same for all [`put_together`].
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...refimpl.errors import CompileError
from ...refimpl.reading import SIZES
from ..artifact import OneSource
from ..core import ir, profiles
from ..core.ir import Program
from ..kernel import interface
from ..kernel.interface import Interface
from ..languages.dialect import Dialect, Parts
from ..languages.renderer import framed
from ..schedules.schedules import PRINTED
from ..targets import target_named


@dataclass(frozen=True)
class PlaneArtifact(OneSource):
    """A kernel on planes, by its role; `lanes` pixels in a work item, `programs` what was emitted."""

    role: str
    target: str
    profile: str
    entry_point: str
    source: str
    source_name: str
    programs: Any
    lanes: int
    interface: Interface
    manifest: Mapping[str, Any]


@dataclass(frozen=True)
class Draft:
    """What is particular to a kernel: its title, programs, interface, statements, bound in words, and facts.

    `said` are names of planes by what they fill in the words on arguments. `written` are all programs, for
    what interprets them, `used` those whose text this kernel is.
    """

    role: str
    title: str
    used: Sequence[Program]
    written: Any
    interface: Interface
    lines: Sequence[str]
    top: str
    said: Mapping[str, Sequence[str]]
    bound: str
    facts: Mapping[str, Any]


def dialect_of(target: str, lanes: int, what: str, way_out: str) -> Any:
    """Return the dialect of a target's kernels on planes, None for the interpreter's, or refuse."""
    planes = target_named(target).planes
    if lanes not in planes:
        known = ", ".join(map(str, planes)) or "none"
        raise CompileError(
            f"target {target}, {lanes} pixels in a work item: there are kernels of {what} for {known}; "
            f"{way_out}"
        )
    return planes[lanes]


PLANES_A_BUFFER = 4
"""Planes of a texture, where planes are textures."""


def place_of(array: str, plane: int) -> dict[str, Any]:
    """Return what fills a dialect's words for a plane: where planes are textures, four to each."""
    buffer, component = divmod(plane, PLANES_A_BUFFER)
    return {"array": array, "plane": plane, "buffer": buffer, "component": component}


def integers_of(dialect: Dialect | None, role: str) -> Sequence[str]:
    """Return the integers of a role."""
    return (dialect.integers if dialect else interface.INTEGERS)[role]


def put_together(draft: Draft, target: str, profile: str, lanes: int) -> PlaneArtifact:
    """Return a kernel with its source and its manifest."""
    chosen, promised = target_named(target), profiles.profile_named(profile)
    dialect = chosen.planes[lanes]
    arguments = dialect.said[draft.role] if dialect else PRINTED
    listed = {what: "\n".join(textwrap.wrap(", ".join(names), 98)) for what, names in draft.said.items()}
    arguments = arguments.format(**listed, lanes=lanes)
    header = _header(draft, dialect.language if dialect else chosen.language, arguments)
    if dialect is None:
        text = "".join(f"# {line}".rstrip() + "\n" for line in header) + "".join(map(ir.text, draft.used))
    else:
        parts = Parts(draft.top, promised.sine is not None)
        text = framed(dialect, draft.interface, parts, header, [f"    {line}" for line in draft.lines])
    name = f"{draft.role}{chosen.suffix}"
    entry = dialect.entries[draft.role] if dialect else chosen.entry
    manifest = {
        "schema": draft.facts["schema"],
        "digest": ir.sha256(text.encode()),
        "role": draft.role,
        "programs": [ir.digest(each) for each in draft.used],
        "target": target,
        "language": chosen.language,
        "entry_point": entry,
        "profile": {"name": promised.name, "text": promised.text},
        **draft.facts,
        "lanes": lanes,
        "arguments": arguments,
        "bound": None,
        "files": {name: ir.sha256(text.encode())},
        SIZES: {name: len(text.encode())},
    }
    names = draft.role, target, profile, entry, text, name
    return PlaneArtifact(*names, draft.written, lanes, draft.interface, manifest)


def _header(draft: Draft, language: str, arguments: str) -> list[str]:
    """Return the lines of the comment at the top of the source."""
    first, *others = arguments.split("\n")
    return [
        f"wamnet {draft.title}, {language}. Generated: change the compiler, not this text.",
        *(f"program   {ir.digest(each)[:32]}" for each in draft.used),
        f"bound     {draft.bound}",
        f"arguments {first}",
        *(f"          {line}" for line in others),
    ]
