"""The folder of vectors: a file a kind, the files that cases name, a schema and a page about all formats.

1. [`contents`] has all of it, by name: what cases expect is computed by the reference; their inputs and the
   files that they name stay as they are.
2. [`write`] writes it; a test compares.
"""

from __future__ import annotations

import errno
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...models.writing import write_together
from ...refimpl.errors import InputError
from .case import FOLDER, VERSION, Case, Kind, text_of
from .kinds import KINDS
from .run import SCHEMA


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a file of vectors, which is kept as it is."""
    found: dict[str, Any] = json.loads((FOLDER / SCHEMA).read_text(encoding="utf-8"))
    return found


def page(cases: Mapping[str, Sequence[Case]]) -> str:
    """Return the page about all kinds, each with its cases."""
    lines = [
        "# Vectors",
        "",
        f"Version {VERSION}. Written by `wamnet conformance --write spec/vectors`; this page too.",
        "Licence of the vectors, scenes and images in this folder: Apache-2.0.",
        "How to use them, and what the words mean: spec/conformance.md.",
        "The form of the files: schema.json beside this page.",
        "",
        "`float` is a number as text, hexadecimal (C's `%a`) or `inf`, `-inf`, `nan`; decimals are read too.",
        "`[n]` are lists. `expected` is there where `valid` is true.",
    ]
    for kind in KINDS.values():
        lines += ["", *_about(kind, cases[kind.name])]
    return "\n".join(lines) + "\n"


def _about(kind: Kind, cases: Sequence[Case]) -> list[str]:
    """Return the page's lines about one kind."""
    bad = sum(case.expected is None for case in cases)
    clauses = ", ".join(dict.fromkeys(clause for case in cases for clause in case.clauses))
    counted = f"{len(cases)} cases" + (f", {bad} of them to be refused" if bad else "")
    fields = [
        f"| {side} | `{name}` | " + text.replace("|", "\\|") + " |"
        for side, some in (("input", kind.inputs), ("output", kind.outputs))
        for name, text in some.items()
    ]
    notes = [kind.notes, ""] if kind.notes else []
    return [
        f"## {kind.name}",
        "",
        f"{kind.title}. {counted}; clauses {clauses}.",
        "",
        *notes,
        "| | field | what it is |",
        "|---|---|---|",
        *fields,
    ]


def contents() -> Mapping[str, bytes]:
    """Return all files of the folder by name."""
    cases = {name: kind.make() for name, kind in KINDS.items()}
    found = {f"{name}.json": text_of(kind, cases[name]).encode() for name, kind in KINDS.items()}
    named = [path for path in FOLDER.glob("*/*") if path.is_file()]
    found |= {path.relative_to(FOLDER).as_posix(): path.read_bytes() for path in named}
    found[SCHEMA] = (json.dumps(schema(), indent=1) + "\n").encode()
    found["README.md"] = page(cases).encode()
    return found


def write(folder: Path) -> int:
    """Write all files of the folder, each whole or not at all, and return their number."""
    found = {folder / name: content for name, content in contents().items()}
    try:
        for parent in {path.parent for path in found}:
            if parent != folder and parent.is_symlink():
                raise OSError(errno.ELOOP, f"{parent.name} is a link")
            parent.mkdir(parents=True, exist_ok=True)
        write_together(found)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            "folder of vectors", str(folder), f"cannot be written: {reason}", "choose another"
        ) from None
    return len(found)
