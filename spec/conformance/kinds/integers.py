"""Requests with numbers that JSON does not write as integers: every kind given integers refuses them (CNF-9).

A program that takes `true` for 1, or `"7"` for 7, answers what was not asked. Each integer of a kind is
replaced in one valid case: the first of the kind in every form [`FORMS`], the others in one form each.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..case import Case, Kind
from ..numbers import Decimal, to_json

FORMS: Mapping[str, Callable[[int], Any]] = {
    "with a point": Decimal,
    "as text": str,
    "true": lambda value: True,
}
"""What stands for an integer, by its name in notes: all of the same value, as far as there is one."""


def asked(kind: Kind) -> Kind:
    """Return a kind with these cases after its own, if it is given integers."""
    if not kind.integers:
        return kind

    def make() -> Sequence[Case]:
        cases = list(kind.make())
        return [*cases, *_wrong(kind, cases)]

    return replace(kind, make=make)


def _wrong(kind: Kind, cases: Sequence[Case]) -> Iterator[Case]:
    """Yield the cases, made of the shortest valid one."""
    valid = [case for case in cases if case.expected is not None]
    short = min(valid, key=lambda case: len(json.dumps(to_json(dict(case.inputs)))))
    rows = [(kind.integers[0], form) for form in FORMS]
    rows += [(name, list(FORMS)[number % len(FORMS)]) for number, name in enumerate(kind.integers[1:])]
    for number, (name, form) in enumerate(rows, len(cases)):
        inputs = {**short.inputs, name: FORMS[form](int(short.inputs[name]))}
        yield Case(f"{kind.name}/{number}", "CNF-9", inputs, None, (), f"{name} {form}")
