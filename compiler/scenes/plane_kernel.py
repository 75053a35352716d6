"""Kernels of one pixel, or several of a row, on images and planes: the filter, the history, the encoding.

1. A builder makes a kernel [kernel/kernel.py] of traced programs: each is a statement an operation
   [`common.lets`], between reads of what its inputs are and stores of its outputs.
2. The kernel is printed in a language, or its programs are [`compiled`].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...refimpl.errors import CompileError
from ..artifact import Artifact
from ..compile import CALLED, assemble
from ..core import ir
from ..core.ir import Image, Program
from ..kernel.interface import ENCODE
from ..kernel.kernel import Expr, Kernel, Let
from ..languages.renderer import Renderer
from ..targets import Language


def reads(names: Sequence[str], element: Callable[[int], Expr], prefix: str = "") -> list[Let]:
    """Return the reads of elements, by name."""
    return [Let(f"{prefix}{each}", element(number)) for number, each in enumerate(names)]


def check_lanes(language: Language, lanes: int, what: str, remedy: str) -> None:
    """Refuse a language that has no kernels of so many pixels in a work item."""
    if lanes not in language.planes:
        known = ", ".join(map(str, language.planes)) or "none"
        raise CompileError(
            f"target {language.name}, {lanes} pixels in a work item: there are kernels of {what} for "
            f"{known}; {remedy}"
        )


def compiled(
    title: str,
    kernel: Kernel,
    used: Sequence[Program],
    facts: Mapping[str, Any],
    bound: str,
    lists: Mapping[str, Sequence[str]],
    notes: Mapping[str, str],
    language: Language,
    programs: Any,
    images: Sequence[Image] = (),
) -> Artifact:
    """Return a kernel of programs with its source and its manifest, for a language.

    `lists` says what the planes or columns of arrays are, `notes` what else callers must know of arrays and
    integers; `programs` are kept for an interpreter.
    """
    renderer = Renderer(language.dialect, kernel, language.profile.sine is not None)
    kernel, digests, role = renderer.kernel, [ir.digest(each) for each in used], kernel.interface.role
    entries = [
        *(("program", [digest[:32]]) for digest in digests),
        ("images", [f"{i.name}: {i.channels} channels in {i.range_text}, {i.encoding}" for i in images]),
        ("bound", [bound]),
        (CALLED, []),
    ]
    several = {"role": role, "programs": digests, "lanes": kernel.step[0].value}
    own = {"program": digests[0]} if role == ENCODE else several
    return assemble(
        title,
        language,
        renderer,
        [("", each) for each in used],
        entries,
        {**own, **facts},
        programs,
        images=images,
        lists=lists,
        notes=notes,
    )
