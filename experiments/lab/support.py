"""The support matrix: what records show of each target, from its source to the hardware that ran it."""

from collections.abc import Mapping
from typing import Any

from .records import Records
from .tables import markdown

HEADS = (
    "target",
    "emitted",
    "compiled by",
    "run on",
    "hardware",
    "certified schedules",
    "source verified",
    "seeded defects accepted",
)
"""Of the matrix."""

SAME = {"glsl": "opengl"}
"""Exports whose kernels have another name as a backend."""

ON_CPU = ("pthread-", "llvmpipe", "c++", "cc (", "ONNX Runtime")
"""What names of devices that are processors contain."""

NOT = "–"
"""The cell of what no record shows."""


def matrix(records: Records) -> str:
    """Return a row for each target of exports; each cell is of a record, or empty."""
    found = {name: _rows(records, name) for name in ("exports", "certified", "text-faults")}
    cells = []
    for row in found["exports"]:
        name = SAME.get(row["target"], row["target"])
        mine, faults = (
            [other for other in found[record] if other["target"] == name]
            for record in ("certified", "text-faults")
        )
        done = row["executed on"] != "-"
        cells.append(
            [
                f"`{row['target']}`",
                row["emitted"] if done else NOT,
                row["compiled by"],
                row["executed on"] if done else NOT,
                hardware(row["executed on"]) if done else NOT,
                schedules(mine),
                schedules([other for other in mine if other["text"].startswith("computes it")]),
                f"{_sum(faults, 'accepted')} of {_sum(faults, 'seeded')}" if faults else NOT,
            ]
        )
    return markdown(HEADS, cells)


def hardware(device: str) -> str:
    """Return the kind of hardware that a device is: a processor, or what it is called."""
    return "CPU" if any(name in device for name in ON_CPU) else device


def schedules(rows: list[Mapping[str, Any]]) -> str:
    """Return the schedules of rows, those of integer networks after the others."""
    floats, integers = (
        ", ".join(row["schedule"] for row in rows if (row["variant"] != "full") == whole)
        for whole in (False, True)
    )
    return "; ".join(part for part in (floats, integers and f"integers: {integers}") if part) or NOT


def _rows(records: Records, name: str) -> list[Mapping[str, Any]]:
    """Return the values of the first table of a record."""
    return [row["values"] for row in records[name].records() if row["values"]["table"] == 1]


def _sum(rows: list[Mapping[str, Any]], column: str) -> int:
    """Return the sum of a column of counts."""
    return sum(int(row[column]) for row in rows)
