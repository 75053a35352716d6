"""Cases: what is given, what is expected, how far off an answer may be, and which clause says so.

1. A kind of case has a function of the reference, and one that bounds its answers [`Kind`]; see `kinds/`.
2. A file of vectors holds the cases of one kind, with the version of the format [`text_of`], [`load`]. Files
   are text that can be reviewed: floats are hexadecimal (numbers.py). It is the table of the kind's cases:
   inputs, notes and clauses are written there, and what is expected is computed from them [`Kind.make`].
3. A case is valid, and has expected values with bounds, or invalid, and must be refused.

Versions are X.Y.Z: X changes with the format, Y with the behaviour that is expected, Z with the cases.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...refimpl.errors import CompileError, InputError
from ...refimpl.reading import parse_json, plain_name, read_file, refusing
from .numbers import from_file, from_json, rounded_up, to_json

FOLDER = Path(__file__).resolve().parents[1] / "vectors"
"""Where the vectors are, in the repository and where the package is installed."""

VERSION = "1.12.0"
"""Version of format, behaviour and cases."""

FORMAT = "wamnet-vectors"
"""Value of the key `format`, by which a file of vectors is recognised."""


@dataclass(frozen=True)
class Output:
    """One expected output: a value, how far off each number may be, and where that bound comes from.

    `bound` 0 asks for equality; `accepted` holds other values that are right too, where rounding decides,
    each a mapping with its own `value` and `bound`.
    `welch`: the value is an estimate, and so is the answer (kinds/pictures.py).
    `clause`: what a deviation is blamed on, where it is not the clause of the case.
    """

    value: Any
    bound: Any = 0.0
    source: str = "exact"
    accepted: tuple[Mapping[str, Any], ...] = ()
    welch: Mapping[str, Any] | None = None
    clause: str = ""


Expect = Callable[[Mapping[str, Any], Mapping[str, Any], Mapping[str, Any]], Mapping[str, Output]]
"""(inputs, the reference's answer, the outputs that the file has) -> outputs with bounds."""


def within(bound: Callable[[Mapping[str, Any], Any], Any], source: str) -> Expect:
    """Return what expects answers within a bound, a function of the inputs and the value."""
    return lambda inputs, wanted, told: {
        name: Output(value, bound(inputs, value), source) for name, value in wanted.items()
    }


def exact(source: str = "exact") -> Expect:
    """Return what expects answers to the bit."""
    return within(lambda inputs, value: 0.0, source)


EXACT = exact()
"""Expects answers to the bit, whose bound needs no reason."""

EITHER = "range of single precision with decisions as the reference takes them, or as it does 2^-20 away"
"""Where the bounds of undecided cases come from."""


@dataclass(frozen=True)
class Case:
    """One question to a program, and the answer. `expected` None: the program must refuse the input.

    `inputs` are in the form of JSON.
    `refusal`: what is blamed where it refuses a valid one, if that is not the case's clause.
    `id`: the kind's name and a number (kinds/__init__.py)."""

    clause: str
    inputs: Mapping[str, Any]
    expected: Mapping[str, Output] | None
    note: str = ""
    refusal: str = ""
    flags: tuple[str, ...] = ()
    id: str = ""

    @property
    def clauses(self) -> tuple[str, ...]:
        """Return the clauses that a deviation may be blamed on: those of the case, and those of outputs."""
        own = (output.clause for output in (self.expected or {}).values())
        return (self.clause, *(clause for clause in (*own, self.refusal) if clause))

    def to_json(self) -> dict[str, Any]:
        """Return the case in the form of JSON."""
        data: dict[str, Any] = {"id": self.id, "clause": self.clause, "flags": list(self.flags)}
        if self.note:
            data["note"] = self.note
        if self.refusal:
            data["refusal"] = self.refusal
        data |= {"valid": self.expected is not None, "input": dict(self.inputs)}
        if self.expected is not None:
            data["expected"] = {name: _output_json(output) for name, output in self.expected.items()}
        return data


def _output_json(output: Output) -> dict[str, Any]:
    """Return an expected output in the form of JSON."""
    data = {"value": to_json(output.value), "bound": _bound_json(output.bound), "source": output.source}
    if output.clause:
        data["clause"] = output.clause
    if output.accepted:
        data["accepted"] = [
            {"value": to_json(other["value"]), "bound": _bound_json(other["bound"])}
            for other in output.accepted
        ]
    if output.welch is not None:
        data["welch"] = to_json(dict(output.welch))
    return data


def _bound_json(bound: Any) -> Any:
    """Return bounds in the form of JSON, rounded up; those that are all one as that one."""
    rounded = rounded_up(bound)
    same = np.size(rounded) > 1 and np.all(rounded == np.ravel(rounded)[0])
    return to_json(np.ravel(rounded)[0] if same else rounded)


@dataclass(frozen=True)
class Kind:
    """A kind of case: its name, title, what its fields are, the reference's answer, and how that is bounded.

    `inputs` and `outputs` describe fields for the format page: type, shape, unit; `notes` say what else a
    reader must know. `float32`: all inputs are numbers of that type.
    """

    name: str
    title: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    answer: Callable[[Mapping[str, Any]], Mapping[str, Any]]
    expect: Expect = EXACT
    notes: str = ""
    float32: bool = False

    def make(self) -> list[Case]:
        """Return the cases of the kind's file; what is expected is computed again."""
        data = parse_json(
            read_file(FOLDER / f"{self.name}.json", "file of vectors"), self.name, "see git diff"
        )
        return [self.made(row, number) for number, row in enumerate(data["cases"])]

    def made(self, row: Mapping[str, Any], number: int = 0) -> Case:
        """Return the case of a row, which has an input and a clause at least.

        It is valid if the reference answers. An output has the clause that the row states, if any."""
        asked, told = dict(row["input"]), row.get("expected", {})
        if self.float32:
            asked = {name: to_json(single(given(value))) for name, value in asked.items()}
        expected, flags = None, [flag for flag in row.get("flags", ()) if flag != "undecided"]
        try:
            check_integers(self, asked)
            inputs = {name: given(_placed(value, FOLDER)) for name, value in asked.items()}
            wanted = self.answer(inputs)
        except (InputError, CompileError):
            pass
        else:
            expected = {
                name: replace(output, clause=told.get(name, {}).get("clause", ""))
                for name, output in self.expect(inputs, wanted, told).items()
            }
            flags += ["undecided"] * any(output.source == EITHER for output in expected.values())
        note, refusal = row.get("note", ""), row.get("refusal", "")
        return Case(row["clause"], asked, expected, note, refusal, tuple(flags), f"{self.name}/{number}")

    @property
    def integers(self) -> list[str]:
        """Return the names of the inputs that are one integer each."""
        return [name for name, text in self.inputs.items() if _INTEGER.match(text)]


_INTEGER = re.compile(r"(integer|pixels|row|column|samples|scatterings)\b(?!\[)")
"""How the format page begins where it says of a field that it is one integer (CNF-9)."""


def check_integers(kind: Kind, inputs: Mapping[str, Any]) -> None:
    """Refuse a request whose integers are not integers of JSON."""
    for name in kind.integers:
        if name in inputs and type(inputs[name]) is not int:
            rule = "must be an integer of JSON"
            raise InputError(name, inputs[name], rule, "write it without a point")


def single(value: Any) -> Any:
    """Return numbers (...) rounded to float32, in float64."""
    return np.asarray(value, np.float32).astype(np.float64)


def text_of(kind: Kind, cases: Sequence[Case]) -> str:
    """Return the vectors of a kind as text, one case a line."""
    lines = [json.dumps(case.to_json(), allow_nan=False) for case in cases]
    head = {"format": FORMAT, "version": VERSION, "kind": kind.name, "title": kind.title}
    opening = json.dumps(head)[:-1]
    return opening + ', "cases": [\n' + ",\n".join(lines) + "\n]}\n"


def load(path: Path) -> tuple[str, list[Case]]:
    """Return the kind's name and the cases of a file of vectors; paths in them are made absolute."""
    data = parse_json(read_file(path, "file of vectors"), f"file of vectors {path}", "fetch it again")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InputError("file of vectors", str(path), f"its format must be {FORMAT!r}", "give another file")
    version, major = data.get("version"), VERSION.split(".")[0]
    if not isinstance(version, str) or version.split(".")[0] != major:
        rule = f"this runner reads version {major}, a text such as {VERSION}"
        raise InputError(f"{path}: version", version, rule, "update wamnet or the vectors")
    rule = "its cases must be as spec/vectors/schema.json says"
    with refusing("file of vectors", str(path), rule, "fetch it again"):
        return str(data["kind"]), [_case(item, path.parent) for item in data["cases"]]


def _case(data: Mapping[str, Any], folder: Path) -> Case:
    """Return a case from JSON; numbers stay texts until they are compared."""
    expected = None
    if data["valid"]:
        expected = {
            name: Output(**{**output, "accepted": tuple(output.get("accepted", ()))})
            for name, output in data["expected"].items()
        }
    inputs = {name: _placed(value, folder) for name, value in data["input"].items()}
    note, refusal = (str(data.get(name, "")) for name in ("note", "refusal"))
    return Case(str(data["clause"]), inputs, expected, note, refusal, tuple(data["flags"]), str(data["id"]))


def _placed(value: Any, folder: Path) -> Any:
    """Return an input with the path of its file, if it is one, made absolute: a file below the folder."""
    if not isinstance(value, dict) or "file" not in value:
        return value
    named = value["file"]
    if isinstance(named, str) and Path(named).is_absolute():
        rule = "paths in a file of vectors are relative to its folder; those in requests are absolute"
        raise InputError("file of a vector", named, rule, "put the file into that folder, and name it there")
    names = named.split("/") if isinstance(named, str) else [named]
    path = folder.joinpath(*(plain_name(name, "file of a vector", WAY_OUT) for name in names)).resolve()
    if not path.is_relative_to(folder.resolve()):
        rule = "must lie in the folder of vectors, also where it is a link"
        raise InputError("file of a vector", named, rule, WAY_OUT)
    return {**value, "file": str(path)}


WAY_OUT = "fetch the vectors again"
"""What to do with vectors that name other files."""


def given(value: Any) -> Any:
    """Return an input as the reference takes it: numbers as arrays, files as what they hold."""
    if isinstance(value, dict) and "file" in value:
        if not isinstance(value["file"], str) or not Path(value["file"]).is_absolute():
            rule = "paths in a request are absolute; those in a file of vectors are relative to its folder"
            raise InputError("file of a request", value["file"], rule, "write the whole path")
        return from_file(value, "input") if "shape" in value else read_file(value["file"]).decode()
    if isinstance(value, (dict, bool)):
        return value
    try:
        found = from_json(value, "input")
    except InputError:
        return value
    return found if found.ndim else found[()]
