"""The folder of vectors: a file a kind, the files that cases name, a schema and a page about all formats.

1. [`contents`] makes all of it from the reference, by name.
2. [`write`] writes it; nothing else does, and a test compares.
"""

from __future__ import annotations

import errno
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...models.writing import write_together
from ...refimpl.errors import InputError
from .case import FORMAT, VERSION, Kind, text_of
from .kinds import KINDS

FOLDER = Path(__file__).resolve().parents[1] / "vectors"
"""Where the vectors are, in the repository and where the package is installed."""

NUMBER = {
    "anyOf": [
        {"type": "number"},
        {"type": "string", "pattern": "^-?0x[01](\\.[0-9a-f]+)?p[+-][0-9]+$"},
        {"enum": ["inf", "-inf", "nan"]},
    ]
}
"""A number: decimal, hexadecimal, or one of three words."""


CLAUSE = {"type": "string", "pattern": "^[A-Z]+-[0-9]+[a-z]?$"}
"""The number of a clause."""


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a file of vectors."""
    numbers = {"anyOf": [{"$ref": "#/$defs/number"}, {"type": "array", "items": {"$ref": "#/$defs/numbers"}}]}
    output = {
        "type": "object",
        "required": ["value", "bound", "source"],
        "additionalProperties": False,
        "properties": {
            "value": {"anyOf": [{"$ref": "#/$defs/numbers"}, {"type": "boolean"}, TEXT]},
            "bound": {"$ref": "#/$defs/numbers"},
            "source": {"type": "string", "minLength": 1},
            "clause": {"$ref": "#/$defs/clause"},
            "accepted": {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/accepted"}},
            "welch": {
                "type": "object",
                "required": ["variance", "spp", "asked", "block", "shape", "significance"],
            },
        },
    }
    accepted = {
        "type": "object",
        "required": ["value", "bound"],
        "additionalProperties": False,
        "properties": {name: {"$ref": "#/$defs/numbers"} for name in ("value", "bound")},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Vectors of one kind",
        "type": "object",
        "required": ["format", "version", "kind", "title", "cases"],
        "additionalProperties": False,
        "properties": {
            "format": {"const": FORMAT},
            "version": {"type": "string", "pattern": "^[0-9]+\\.[0-9]+\\.[0-9]+$"},
            "kind": {"type": "string"},
            "title": {"type": "string"},
            "cases": {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/case"}},
        },
        "$defs": {
            "number": NUMBER,
            "numbers": numbers,
            "clause": CLAUSE,
            "output": output,
            "accepted": accepted,
            "case": _case_schema(),
        },
    }


def _case_schema() -> dict[str, Any]:
    """Return the JSON Schema of a case."""
    return {
        "type": "object",
        "required": ["id", "clause", "flags", "valid", "input"],
        "additionalProperties": False,
        "properties": {
            "id": {"type": "string", "pattern": "^[a-z0-9_.]+/[0-9]+$"},
            "clause": {"$ref": "#/$defs/clause"},
            "flags": {"type": "array", "items": {"enum": ["undecided", "statistical"]}, "uniqueItems": True},
            "note": {"type": "string", "minLength": 1},
            "refusal": {"$ref": "#/$defs/clause"},
            "valid": {"type": "boolean"},
            "input": {"type": "object", "minProperties": 1},
            "expected": {
                "type": "object",
                "minProperties": 1,
                "additionalProperties": {"$ref": "#/$defs/output"},
            },
        },
        "if": {"properties": {"valid": {"const": True}}},
        "then": {"required": ["expected"]},
        "else": {"not": {"required": ["expected"]}},
    }


TEXT = {"type": "string", "pattern": "^(?!-?0x)"}
"""A text; what begins like a number must be one."""


def page() -> str:
    """Return the page about all kinds."""
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
        lines += ["", *_about(kind)]
    return "\n".join(lines) + "\n"


def _about(kind: Kind) -> list[str]:
    """Return the page's lines about one kind."""
    cases = kind.make()
    bad = sum(case.expected is None for case in cases)
    clauses = ", ".join(dict.fromkeys(clause for case in cases for clause in case.clauses))
    counted = f"{len(cases)} cases" + (f", {bad} of them to be refused" if bad else "")
    fields = [
        f"| {side} | `{name}` | {_cell(text)} |"
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


def _cell(text: str) -> str:
    """Return a text for a cell of a table."""
    return text.replace("|", "\\|")


def contents() -> Mapping[str, bytes]:
    """Return all files of the folder by name."""
    found = {f"{name}.json": text_of(kind).encode() for name, kind in KINDS.items()}
    for kind in KINDS.values():
        found |= kind.files()
    found["schema.json"] = (json.dumps(schema(), indent=1) + "\n").encode()
    found["README.md"] = page().encode()
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
