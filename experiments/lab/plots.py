"""Plots in git: SVG drawn from records, the same bytes wherever the same versions draw them.

1. A plot is a function of the records that returns a figure of matplotlib [`gallery.PLOTS`]; its file is
   docs/images/<name>.svg.
2. Its last line has a digest of the records behind it and of the text of these functions [`digest`]: a plot
   of other records or by other code is seen without drawing it again, whatever version of matplotlib drew it
   [`stale`].
"""

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from .records import FOLDER, ROOT, Records, pending

IMAGES = "docs/images"
"""The folder of the plots."""

LINE = "<!-- records and code: {} -->\n"
"""The last line of a plot."""

STYLES, MARKERS = ("-", "--", "-.", ":"), "osv^Dx*P"
"""Lines and points can be told apart in grey too."""

Line = Sequence[tuple[float, float, float, float]]
"""Points (x, mean, low, high)."""


@dataclass(frozen=True)
class Plot:
    """What draws a plot, and the records that it shows."""

    draw: Callable[[Records], Any]
    records: Sequence[str]


def digest(plot: Plot, records: Records) -> str:
    """Return the SHA-256 of the records behind a plot and of the code that draws it."""
    made = hashlib.sha256()
    for path in (records.folder / f"{name}.json" for name in plot.records):
        made.update(path.read_bytes())
    for path in (Path(__file__), *map(Path(__file__).with_name, ("gallery.py", "speeds.py"))):
        made.update(path.read_bytes())
    return made.hexdigest()


def drawn_from(path: Path) -> str:
    """Return the digest that a plot's file has, or nothing."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    found = re.findall(LINE.strip().format(r"([0-9a-f]{64})"), text[-200:])
    return found[-1] if found else ""


def ready(plot: Plot, records: Records, folder: Path = FOLDER) -> bool:
    """Return whether all of a plot's records are there; one that is not must be in `pending.txt`."""
    left = [name for name in plot.records if name not in records]
    for name in left:
        if name not in pending(folder):
            records[name]  # says that it is missing
    return not left


def stale(records: Records, plots: Mapping[str, Plot], root: Path = ROOT) -> Iterator[tuple[Path, bytes]]:
    """Yield the plots that are not of these records and this code, each with its new file."""
    for name, plot in plots.items():
        path = root / IMAGES / f"{name}.svg"
        if ready(plot, records) and drawn_from(path) != (made := digest(plot, records)):
            yield path, svg(plot.draw(records)) + LINE.format(made).encode()


def svg(figure: Any) -> bytes:
    """Return a figure as SVG without a date and with names that do not change from run to run."""
    import matplotlib as mpl

    held = BytesIO()
    with mpl.rc_context({"svg.hashsalt": "wamnet", "svg.fonttype": "none"}):
        figure.savefig(held, format="svg", metadata={"Date": None, "Creator": None})
    lines = held.getvalue().decode().splitlines()
    return ("\n".join(line.rstrip() for line in lines) + "\n").encode()


def axes(columns: int, inches: tuple[float, float]) -> tuple[Any, Sequence[Any]]:
    """Return a white figure, and its axes side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    return figure, figure.subplots(1, columns, squeeze=False)[0]


def lines(axis: Any, found: Mapping[str, Line], labels: tuple[str, str]) -> None:
    """Draw lines of means with bands of their intervals."""
    for number, (name, points) in enumerate(found.items()):
        if not points:
            continue
        x, mean, low, high = zip(*points, strict=True)
        style, marker = STYLES[number % len(STYLES)], MARKERS[number % len(MARKERS)]
        (line,) = axis.plot(x, mean, style, marker=marker, markersize=4, linewidth=1.3, label=name)
        axis.fill_between(x, low, high, color=line.get_color(), alpha=0.18, linewidth=0)
    axis.set_xlabel(labels[0])
    axis.set_ylabel(labels[1])
    axis.grid(visible=True, alpha=0.2, linewidth=0.6)
    if len(found) > 1:
        axis.legend(frameon=False, fontsize=8)


def bars(axis: Any, found: Mapping[str, tuple[float, float, float]], label: str) -> None:
    """Draw a mean (mean, low, high) for each name, with its interval, the first on top; ours are round."""
    names = list(found)[::-1]
    for at, name in enumerate(names):
        mean, low, high = found[name]
        form, color = ("o", "#0072B2") if name.startswith("wamnet") else ("s", "#D55E00")
        axis.errorbar(mean, at, xerr=[[mean - low], [high - mean]], fmt=form, capsize=3, color=color)
    axis.set_yticks(range(len(names)), [name.replace("`", "") for name in names])
    axis.set_xlabel(label)
    axis.grid(visible=True, alpha=0.2, linewidth=0.6)
