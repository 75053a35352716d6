"""Lines of source in the wheel and their limit; `python tests/support/budget.py` prints them per package."""

import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]

MAX_LINES = 59_886
"""Most lines of the packages in pyproject.toml, comments counted (62,568 at 5756b297). It only falls:
a change that removes lines lowers it in the same commit, and raising it needs an issue that says so."""

SOURCES = (".py", ".ini", ".jinja", ".txt")
"""Suffixes of sources: Python, and what it reads to print help, reports and programs."""

LEFT_OUT = ("vectors", "shelf")
"""Folders of what this project writes itself."""

SLACK = 500
"""The limit is at most so far above the count [`tests/meta/test_layering.py`]."""


def packages() -> dict[str, Path]:
    """Return the folder of each installed package."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    folders: dict[str, Path] = {}
    for name in sorted(table["packages"]):
        above, _, last = name.rpartition(".")
        mapped = table["package-dir"].get(name)
        folders[name] = ROOT / mapped if mapped else folders[above] / last
    return folders


def lines(folder: Path) -> int:
    """Return the lines of sources in a package's folder, those in folders of it that have no Python too."""
    own = [path for path in folder.iterdir() if path.is_file()]
    inner = [path for path in folder.iterdir() if path.is_dir() and not any(path.glob("*.py"))]
    inner = [path for path in inner if path.name not in LEFT_OUT]
    found = [*own, *(path for below in inner for path in below.rglob("*"))]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in found if path.suffix in SOURCES)


if __name__ == "__main__":
    for package, place in packages().items():
        print(f"{package:36}{lines(place):8}")
    print(f"{'wheel':36}{sum(map(lines, packages().values())):8}, at most {MAX_LINES}")
