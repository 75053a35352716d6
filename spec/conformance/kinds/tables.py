"""Kinds as rows: titles and fields are data in this folder, cases are in the files of vectors.

1. `functions.json` has the title and the fields of each function of numbers: text, and perhaps components,
   least and largest value; a row of Python adds the call [`function`].
2. `kinds.json` has those of every other kind; a row of Python adds answer and bound [`kind`].
3. `scenes.json` has the scenes that rays meet, by the kind.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..case import EXACT, Expect, Kind
from ..functions import Field, Function, Numbers

ROWS: Mapping[str, Mapping[str, Any]] = {
    name: json.loads((Path(__file__).parent / f"{name}.json").read_text(encoding="utf-8"))
    for name in ("functions", "kinds", "scenes")
}
"""The functions of numbers by name, the other kinds, and the scenes of rays."""


def function(name: str, call: Callable[..., Any], typed: bool = False) -> Function:
    """Return the function of a row: `call` has the inputs one after another, and returns all outputs so.

    `typed`: the float type of constants comes before the inputs.
    """
    row = ROWS["functions"][name]
    inputs, outputs = (
        {key: Field(*([field] if isinstance(field, str) else field)) for key, field in row[side].items()}
        for side in ("inputs", "outputs")
    )

    def named(given: Numbers, dtype: Any) -> dict[str, Any]:
        # Looked up at each call, so that a fault that is planted in the reference is seen.
        now = getattr(sys.modules[call.__module__], call.__name__, call)
        found = now(*[dtype] * typed, *(given[key] for key in inputs))
        return dict(zip(outputs, found if isinstance(found, tuple) else (found,), strict=True))

    return Function(name, row["title"], inputs, outputs, named)


def kind(name: str, answer: Callable[[Mapping[str, Any]], Mapping[str, Any]], expect: Expect = EXACT) -> Kind:
    """Return a kind whose title and fields are in the table."""
    row = ROWS["kinds"][name]
    return Kind(name, row["title"], row["inputs"], row["outputs"], answer, expect, row.get("notes", ""))
