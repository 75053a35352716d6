"""The report's plots as PNG, each in a light and a dark form, without a display.

Colour maps and scales are chosen so that a plot can be read in grey too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any


@dataclass(frozen=True)
class Theme:
    """Colours of text and axes, and of the curve."""

    text: str
    curve: str


LIGHT = Theme(text="#3b4252", curve="#b4530a")
"""For a light page."""

DARK = Theme(text="#cbd5e1", curve="#fbbf24")
"""For a dark page."""

DOTS_PER_INCH = 150
"""Resolution of the plots: sharp on a phone, small in a file."""


def error_maps(maps: Sequence[tuple[str, Any]], theme: Theme) -> list[bytes]:
    """Draw error maps (H, W) with their titles, a picture for each, in one colour scale, with its bar.

    The scale follows the square root of the error: else a few bright samples would hide everything else.
    """
    from matplotlib.colors import PowerNorm

    largest = max(float(values.max()) for _, values in maps)
    scale = PowerNorm(0.5, 0.0, largest or 1.0)
    drawn = []
    for title, values in maps:
        figure, axis = _figure(theme, (4.0, 3.4))
        picture = axis.imshow(values, cmap="magma", norm=scale)
        axis.set_title(title, color=theme.text, fontsize=10)
        axis.set_axis_off()
        bar = figure.colorbar(picture, ax=axis, shrink=0.85, label="absolute error, display-encoded")
        bar.ax.yaxis.label.set_color(theme.text)
        bar.ax.tick_params(colors=theme.text)
        bar.outline.set_edgecolor(theme.text)
        drawn.append(_png(figure))
    return drawn


def training_curve(
    history: Sequence[tuple[int, float]], seconds_per_step: float | None, theme: Theme
) -> bytes:
    """Draw the loss over the steps, with a second axis that counts seconds if their number is known."""
    figure, axis = _figure(theme, (7.2, 3.4))
    axis.plot([step for step, _ in history], [loss for _, loss in history], color=theme.curve, linewidth=1.4)
    axis.set_yscale("log")
    axis.set_xlabel("step")
    axis.set_ylabel("loss of one minibatch (MSE)")
    axis.grid(visible=True, which="both", color=theme.text, alpha=0.15, linewidth=0.6)
    parts = [axis]
    if seconds_per_step is not None:
        scale = seconds_per_step
        ways = (lambda step: step * scale, lambda second: second / scale)
        parts.append(axis.secondary_xaxis("top", functions=ways))
        parts[1].set_xlabel("seconds")
    for part in parts:
        part.tick_params(which="both", colors=theme.text)
        part.xaxis.label.set_color(theme.text)
        part.yaxis.label.set_color(theme.text)
        for spine in part.spines.values():
            spine.set_color(theme.text)
    return _png(figure)


def _figure(theme: Theme, inches: tuple[float, float]) -> tuple[Any, Any]:
    """Return a transparent figure and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, layout="constrained", facecolor="none")
    axis = figure.add_subplot(facecolor="none")
    axis.title.set_color(theme.text)
    return figure, axis


def _png(figure: Any) -> bytes:
    """Return the figure as PNG."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", transparent=True)
    return buffer.getvalue()
