"""Lines and modules of each room, against what it may have: `python tests/support/budget.py`.

A change that needs more lines raises its room's budget here, in the open; one that makes a room smaller by
more than a hundred lowers it, so that what was gained stays [`tests/meta/test_layering.py`].
"""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]

BUDGET = {
    "models": 50,
    "refimpl": 1160,
    "refimpl/light": 4375,
    "refimpl/network": 2750,
    "compiler": 1860,
    "compiler/core": 3250,
    "compiler/importing": 1560,
    "compiler/languages": 2725,
    "compiler/proof": 3190,
    "compiler/reading": 5330,
    "compiler/schedules": 4650,
    "compiler/scenes": 3150,
    "compiler/training": 1200,
    "kernels": 620,
    "kernels/devices": 2825,
    "kernels/run": 3600,
    "kernels/judge": 1475,
    "kernels/bench": 4850,
    "kernels/blender": 500,
    "kernels/export": 4400,
    "kernels/verify": 2925,
    "spec/conformance": 8600,
    "cli": 320,
    "cli/commands": 6375,
    "cli/common": 1400,
    "cli/course": 6150,
    "cli/files": 2200,
    "cli/reports": 1450,
    "wamnet": 620,
}
"""Most lines of each room, comments counted; a part by itself is the files above its rooms."""

SLACK = 100
"""A budget is at most so far above what a room has."""


def modules(room: str) -> list[Path]:
    """Return the Python files of a room, and of the folders in it; of a part only its own."""
    folder = ROOT / room
    return sorted(folder.rglob("*.py") if "/" in room else folder.glob("*.py"))


def lines(room: str) -> int:
    """Return the number of lines of a room."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in modules(room))


if __name__ == "__main__":
    print(f"{'room':24}{'modules':>8}{'lines':>8}{'budget':>8}")
    for name, most in BUDGET.items():
        print(f"{name:24}{len(modules(name)):8}{lines(name):8}{most:8}")
