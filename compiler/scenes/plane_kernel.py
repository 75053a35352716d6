"""Kernels of one pixel, or several of a row, on images and planes: the filter, the history, the encoding.

1. A builder makes a kernel [kernel/kernel.py] of traced programs: each is a statement an operation
   [`common.lets`], between reads of what its inputs are and stores of its outputs.
2. The kernel is printed in a language, or its programs are; a manifest says what was made [`compiled`].
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...refimpl.errors import CompileError
from ...refimpl.reading import SIZES
from ..artifact import OneSource
from ..core import ir, profiles
from ..core.ir import Image, Program
from ..kernel.interface import Interface
from ..kernel.kernel import Expr, Kernel, Let
from ..languages.renderer import Renderer, housed
from ..schedules.schedules import PRINTED
from ..targets import target_named


@dataclass(frozen=True)
class PlaneArtifact(OneSource):
    """A kernel on images and planes; `programs`: what was emitted, for what interprets them."""

    target: str
    profile: str
    entry_point: str
    source: str
    source_name: str
    programs: Any
    kernel: Kernel
    interface: Interface
    manifest: Mapping[str, Any]
    images: tuple[Image, ...] = ()

    @property
    def role(self) -> str:
        """Return the role."""
        return self.interface.role

    @property
    def lanes(self) -> int:
        """Return how many pixels of a row a work item computes."""
        return int(self.kernel.step[0].value)

    @property
    def planes(self) -> tuple[str, ...]:
        """Return what the planes of sums are, in order, of an encoding; other kernels have none."""
        return tuple(self.manifest.get("planes", ()))


@dataclass(frozen=True)
class Draft:
    """What is particular to a role: title, programs, kernel, lines of the header, and facts of the manifest.

    `used` are the programs of this kernel, `programs` what is kept for an interpreter. `lists` says what the
    planes or columns of arrays are, `notes` what else callers must know of arrays and integers.
    """

    title: str
    used: Sequence[Program]
    programs: Any
    kernel: Kernel
    facts: Mapping[str, Any]
    bound: str
    lists: Mapping[str, Sequence[str]]
    notes: Mapping[str, str] = field(default_factory=dict)
    images: Sequence[Image] = ()


def reads(names: Sequence[str], element: Callable[[int], Expr], prefix: str = "") -> list[Let]:
    """Return the reads of elements, by name."""
    return [Let(f"{prefix}{each}", element(number)) for number, each in enumerate(names)]


def check_lanes(target: str, lanes: int, what: str, remedy: str) -> None:
    """Refuse a target that has no kernels of so many pixels in a work item."""
    if lanes not in (planes := target_named(target).planes):
        known = ", ".join(map(str, planes)) or "none"
        raise CompileError(
            f"target {target}, {lanes} pixels in a work item: there are kernels of {what} for {known}; "
            f"{remedy}"
        )


def compiled(draft: Draft, target: str, profile: str) -> PlaneArtifact:
    """Return a kernel with its source and its manifest."""
    chosen, promised, kernel = target_named(target), profiles.profile_named(profile), draft.kernel
    dialect, role, arguments, entry = chosen.dialect, kernel.interface.role, PRINTED, chosen.entry
    if dialect is not None:
        kernel, entry = housed(kernel, dialect), dialect.entries[role]
        lists = {key: "\n".join(textwrap.wrap(", ".join(names), 98)) for key, names in draft.lists.items()}
        arguments = dialect.arguments(kernel, lists, draft.notes)
    header = _header(draft, dialect.language if dialect else chosen.language, arguments)
    if dialect is None:
        text = "".join(f"# {line}".rstrip() + "\n" for line in header) + "".join(map(ir.text, draft.used))
    else:
        text = Renderer(dialect, kernel, promised.sine is not None).source(header)
    source = f"{role}{chosen.suffix}"
    manifest = {
        "digest": ir.sha256(text.encode()),
        "target": target,
        "language": chosen.language,
        "entry_point": entry,
        "profile": {"name": promised.name, "text": promised.text},
        **draft.facts,
        "arguments": arguments,
        "bound": None,
        "files": {source: ir.sha256(text.encode())},
        SIZES: {source: len(text.encode())},
    }
    made = target, profile, entry, text, source, draft.programs, kernel, kernel.interface, manifest
    return PlaneArtifact(*made, tuple(draft.images))


def role_facts(kernel: Kernel, used: Sequence[Program]) -> dict[str, Any]:
    """Return what manifests of the filter and the history say of the role and the programs."""
    digests = [ir.digest(each) for each in used]
    return {"role": kernel.interface.role, "programs": digests, "lanes": kernel.step[0].value}


def _header(draft: Draft, language: str, arguments: str) -> list[str]:
    """Return the lines of the comment at the top of the source."""
    images = [f"{i.name}: {i.channels} channels in {i.range_text}, {i.encoding}" for i in draft.images]
    return [
        f"wamnet {draft.title}, {language}. Generated: change the compiler, not this text.",
        *(f"program   {ir.digest(each)[:32]}" for each in draft.used),
        *_entry("images", images),
        *_entry("bound", [draft.bound]),
        *_entry("arguments", arguments.split("\n")),
    ]


def _entry(title: str, lines: Sequence[str]) -> list[str]:
    """Return an entry of the comment, with its title in front of the first line."""
    return [f"{'' if number else title:10}{line}" for number, line in enumerate(lines)]
