"""Kinds as rows: titles, fields and chosen inputs are data in this folder; Python has what they call.

1. `functions.json` has a row for each function of numbers: its title, clause and fields, then inputs of
   cases, each with a note and a clause where it is another one; `usual` are the inputs that a case does not
   name. A row of Python adds the call and how more inputs are drawn [`function`], [`direct`].
2. `kinds.json` has the title and the fields of every other kind; Python adds cases and answer [`kind`].
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..case import Case, Kind
from ..functions import Field, Function, Numbers

Draw = Callable[[NDArray[np.float64]], Numbers]
"""Inputs of a case from uniform numbers."""


def table(name: str) -> Any:
    """Return the data of a file beside this module."""
    return json.loads((Path(__file__).parent / f"{name}.json").read_text(encoding="utf-8"))


ROWS: Mapping[str, Any] = table("functions")
"""The functions of numbers, by name."""


def function(
    name: str, call: Callable[[Numbers, Any], Numbers], draw: Draw | None = None, draws: int = 8
) -> Function:
    """Return the function of a row: `call` has the inputs by name, and the float type of constants."""
    row = ROWS[name]
    inputs, outputs = (
        {key: Field(*([field] if isinstance(field, str) else field)) for key, field in row[side].items()}
        for side in ("inputs", "outputs")
    )
    usual = row.get("usual", {})
    given, decided, later = (
        [(note, {**usual, **values}, *clause) for note, values, *clause in row.get(part, ())]
        for part in ("given", "decided", "later")
    )
    drawn = (lambda u: {**usual, **draw(u)}) if draw is not None else None
    return Function(
        name, row["title"], row["clause"], inputs, outputs, call, given, drawn, draws, decided, later
    )


def direct(name: str, call: Callable[..., Any], draw: Draw | None = None, draws: int = 8) -> Function:
    """Return the function of a row: `call` has the inputs one after another, and returns all outputs so."""
    inputs, outputs = ROWS[name]["inputs"], ROWS[name]["outputs"]

    def named(given: Numbers, dtype: Any) -> dict[str, Any]:
        # Looked up at each call, so that a fault that is planted in the reference is seen.
        now = getattr(sys.modules[call.__module__], call.__name__, call)
        found = now(*(given[key] for key in inputs))
        return dict(zip(outputs, found if isinstance(found, tuple) else (found,), strict=True))

    return function(name, named, draw, draws)


WORDS: Mapping[str, Any] = table("kinds")
"""Titles and fields of the kinds that are not functions of numbers, by name."""


def kind(
    name: str,
    make: Callable[[], Sequence[Case]],
    answer: Callable[[Mapping[str, Any]], Mapping[str, Any]],
    files: Callable[[], Mapping[str, bytes]] = dict,
) -> Kind:
    """Return a kind whose title and fields are in the table."""
    row = WORDS[name]
    return Kind(name, row["title"], row["inputs"], row["outputs"], make, answer, files, row.get("notes", ""))
