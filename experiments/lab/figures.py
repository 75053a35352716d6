"""Figures as PNG: contact sheets of pictures, and curves with their spread; written all at once or not.

Drawn on white, to be looked at by themselves, with the colours of the reports [`cli/reports/plots.py`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.cli.files.outputs import replacing
from wamnet.cli.reports.plots import DOTS_PER_INCH, PAPER
from wamnet.refimpl.encoding import to_8bit
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats

INCHES = 2.2
"""Width of a picture in a contact sheet."""

STYLES = ("-", "--", "-.", ":")
"""Lines can be told apart in grey too."""

MARKERS = "osv^Dx*P"
"""And so can points."""


Row = tuple[str, Sequence[tuple[str, Floats]]]
"""A label, and labelled pictures (H, W, 3) or maps (H, W)."""


def sheet(path: Path, rows: Sequence[Row], inches: float = INCHES) -> None:
    """Write rows of display-encoded pictures (H, W, 3), or maps (H, W), each with a label; rows have one too.

    Pixels are shown as squares, never smoothed. Maps of a sheet share one scale.
    """
    if not rows or len({len(pictures) for _, pictures in rows}) != 1:
        shown = [len(pictures) for _, pictures in rows]
        raise InputError("pictures in each row", shown, "all rows need the same number", "fill the gaps")
    tall = [max(image.shape[0] / image.shape[1] for _, image in pictures) for _, pictures in rows]
    figure, axes = _axes(
        (len(rows), len(rows[0][1])),
        (inches * len(rows[0][1]), sum(inches * ratio + 0.25 for ratio in tall)),
        {"height_ratios": tall},
    )
    maps = [image for _, pictures in rows for _, image in pictures if image.ndim == 2]
    largest = max((float(values.max()) for values in maps), default=1.0)
    for line, (title, pictures) in zip(axes, rows, strict=True):
        for axis, (label, image) in zip(line, pictures, strict=True):
            if image.ndim == 2:
                axis.imshow(image, cmap="magma", vmin=0.0, vmax=largest or 1.0, interpolation="nearest")
            else:
                axis.imshow(to_8bit(image), interpolation="nearest")
            axis.set_title(label, fontsize=8, color=PAPER.text)
            axis.set_xticks([])
            axis.set_yticks([])
        line[0].set_ylabel(title, fontsize=8, color=PAPER.text)
    save(path, figure)


def curves(
    path: Path,
    lines: Mapping[str, Sequence[tuple[float, Sequence[float]]]],
    labels: tuple[str, str],
    log: tuple[bool, bool] = (False, False),
    title: str = "",
) -> None:
    """Write lines of means over x, each with a band from the least to the largest of the values at x."""
    figure, axes = _axes((1, 1), (6.4 if len(lines) < 2 else 8.4, 4.0))
    axis = axes[0][0]
    for number, (name, found) in enumerate(lines.items()):
        x = [place for place, _ in found]
        style = STYLES[number % len(STYLES)]
        marker = MARKERS[number % len(MARKERS)]
        means = [float(np.mean(values)) for _, values in found]
        (drawn,) = axis.plot(x, means, style, marker=marker, markersize=4, linewidth=1.3, label=name)
        low, high = ([float(choose(values)) for _, values in found] for choose in (np.min, np.max))
        axis.fill_between(x, low, high, color=drawn.get_color(), alpha=0.18, linewidth=0)
    if log[0]:
        axis.set_xscale("log")
    if log[1]:
        axis.set_yscale("log")
    axis.set_xlabel(labels[0])
    axis.set_ylabel(labels[1])
    axis.set_title(title, fontsize=10)
    axis.grid(visible=True, which="major", color=PAPER.text, alpha=0.15, linewidth=0.6)
    if len(lines) > 1:
        # Beside the axes, where it hides no line.
        figure.legend(frameon=False, fontsize=8, loc="outside right center")
    save(path, figure)


def save(path: Path, figure: Any) -> None:
    """Write a figure of matplotlib as PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as new:
        figure.savefig(new, format="png", facecolor=figure.get_facecolor())


def _axes(shape: tuple[int, int], inches: tuple[float, float], grid: Mapping[str, Any] | None = None) -> Any:
    """Return a white figure and its axes, rows of columns; nothing needs a display."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, layout="constrained", facecolor=PAPER.page)
    return figure, figure.subplots(*shape, squeeze=False, gridspec_kw=dict(grid or {}))
