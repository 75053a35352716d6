"""Figures as PNG: contact sheets of pictures; written all at once or not.

Drawn on white, to be looked at by themselves, with the colours of the reports [`cli/reports/plots.py`].
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wamnet.cli.files.outputs import replacing
from wamnet.cli.reports.plots import DOTS_PER_INCH, PAPER
from wamnet.refimpl.encoding import to_8bit
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats

INCHES = 2.2
"""Width of a picture in a contact sheet."""

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
    from matplotlib.figure import Figure

    size = (inches * len(rows[0][1]), sum(inches * ratio + 0.25 for ratio in tall))
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained", facecolor=PAPER.page)
    shape, grid = (len(rows), len(rows[0][1])), {"height_ratios": tall}
    axes = figure.subplots(*shape, squeeze=False, gridspec_kw=grid)
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


def save(path: Path, figure: Any) -> None:
    """Write a figure of matplotlib as PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as new:
        figure.savefig(new, format="png", facecolor=figure.get_facecolor())
