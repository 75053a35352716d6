"""All kinds of cases, by name: a new one is a module here and a line in `KINDS` or `FUNCTIONS`.

The cases of a kind are numbered: first those of its module, last the requests whose integers JSON does
not write as such [`_wrong`].
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..case import Case, Kind
from ..functions import Function
from ..numbers import Decimal, to_json
from . import (
    files,
    images,
    light,
    materials,
    network,
    numbers,
    paths,
    pictures,
    smoothing,
    surfaces,
    whole,
)

FORMS: Mapping[str, Callable[[int], Any]] = {
    "with a point": Decimal,
    "as text": str,
    "true": lambda value: True,
}
"""What stands for an integer, by its name in notes: all of the same value, as far as there is one."""


def _wrong(kind: Kind, cases: Sequence[Case]) -> Iterator[Case]:
    """Yield requests that are refused (CNF-9): a program that takes `true` for 1 answers another request.

    Each integer is replaced in the shortest valid case: the first of the kind in every form [`FORMS`], the
    others in one form each.
    """
    if kind.integers:
        valid = [case for case in cases if case.expected is not None]
        short = min(valid, key=lambda case: len(json.dumps(to_json(dict(case.inputs)))))
        rows = [(kind.integers[0], form) for form in FORMS]
        rows += [(name, list(FORMS)[number % len(FORMS)]) for number, name in enumerate(kind.integers[1:])]
        for name, form in rows:
            inputs = {**short.inputs, name: FORMS[form](int(short.inputs[name]))}
            yield Case("CNF-9", inputs, None, f"{name} {form}")


def _numbered(kind: Kind) -> Kind:
    """Return a kind with all of its cases, each with its id."""

    def make() -> list[Case]:
        cases = [*kind.make()]
        cases += _wrong(kind, cases)
        return [replace(case, id=f"{kind.name}/{number}") for number, case in enumerate(cases)]

    return replace(kind, make=make)


FUNCTIONS: Mapping[str, Function] = {
    f.name: f for f in (*numbers.FUNCTIONS, *light.FUNCTIONS, *surfaces.FUNCTIONS, *materials.FUNCTIONS)
}
"""Kinds that are functions of numbers, which executors can run."""

KINDS: Mapping[str, Kind] = {
    kind.name: _numbered(kind)
    for kind in (
        *numbers.KINDS,
        *light.KINDS,
        *paths.KINDS,
        *network.KINDS,
        *images.KINDS,
        *smoothing.KINDS,
        *files.KINDS,
        *pictures.KINDS,
        *whole.KINDS,
        *(function.kind() for function in FUNCTIONS.values()),
    )
}
"""Kinds by name."""
