"""The report's plots as PNG, each in a light and a dark form, without a display.

Colour maps and scales are chosen so that a plot can be read in grey too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any


@dataclass(frozen=True)
class Theme:
    """Colours of text and axes, of the curve, and of the page, if the plot brings it along."""

    text: str
    curve: str
    page: str = "none"


LIGHT = Theme(text="#3b4252", curve="#b4530a")
"""For a light page."""

DARK = Theme(text="#cbd5e1", curve="#fbbf24")
"""For a dark page."""

PAPER = Theme(text="#1f2430", curve="#b4530a", page="#ffffff")
"""For a file that is looked at by itself."""

PLACES = tuple((x, sign * y) for y in (3, 12, 22, 32, 42, 52, 62) for x in (6, -6) for sign in (1, -1))
"""Where a label may stand from its point, in points of print: the first place that is free; a negative first
number puts its end there."""

NEAR = 12
"""Heights up to this one, in points of print, need no line from the point to its label."""

MARKER_PX = 9.0
"""Half the side of the square around a marker that labels leave free, in pixels."""

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


@dataclass(frozen=True)
class Point:
    """A contender of a benchmark: measured and predicted time in ms, and its error or loss."""

    name: str
    ms: float
    y: float
    predicted_ms: float | None
    is_kernel: bool
    on_front: bool


def speed_and_error(points: Sequence[Point], label: str, theme: Theme, logarithmic: bool = True) -> bytes:
    """Draw errors over times: kernels round, peers square, predictions hollow, the Pareto front a line."""
    figure, axis = _figure(theme, (8.0, 5.0))
    axis.set_xscale("log")
    if logarithmic:
        axis.set_yscale("log")
    front = sorted((point for point in points if point.on_front), key=lambda point: point.ms)
    axis.plot(
        [point.ms for point in front],
        [point.y for point in front],
        drawstyle="steps-post",
        color=theme.curve,
        linewidth=1.2,
        alpha=0.7,
        label="Pareto front",
    )
    for kernel, marker in ((True, "o"), (False, "s")):
        shown = [point for point in points if point.is_kernel == kernel]
        colour = theme.curve if kernel else theme.text
        known = [point for point in shown if point.predicted_ms]
        for point in known:
            axis.plot(
                [point.predicted_ms, point.ms], [point.y] * 2, color=colour, linewidth=0.8, linestyle=":"
            )
        hollow = [point.predicted_ms for point in known], [point.y for point in known]
        axis.plot(*hollow, marker, markersize=5, markerfacecolor="none", markeredgecolor=colour)
        solid = [point.ms for point in shown], [point.y for point in shown]
        axis.plot(*solid, marker, markersize=6, color=colour, label="kernels" if kernel else "peers")
    axis.plot([], [], "o", markerfacecolor="none", markeredgecolor=theme.text, label="predicted")
    axis.margins(0.12, 0.15)
    axis.set_xlabel("ms a frame")
    axis.set_ylabel(label)
    _dress(axis, theme)
    legend = axis.legend(frameon=False, fontsize=8, loc="upper right")
    for text in legend.get_texts():
        text.set_color(theme.text)
    _label(figure, axis, points, theme)
    return _png(figure)


def growth(lines: Mapping[str, Sequence[tuple[int, float]]], theme: Theme) -> bytes:
    """Draw times (ms) over widths of square pictures, a line for each name."""
    from matplotlib import colormaps

    figure, axis = _figure(theme, (8.0, 5.0))
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    colours = colormaps["turbo"]
    for number, (name, found) in enumerate(lines.items()):
        colour = colours((number + 0.5) / len(lines))
        style = ("-", "--", ":")[number % 3]
        axis.plot(*zip(*found, strict=True), style, marker=".", color=colour, linewidth=1.3, label=name)
    sizes = sorted({size for found in lines.values() for size, _ in found})
    axis.set_xticks(sizes, [str(size) for size in sizes])
    axis.minorticks_off()
    axis.set_xlabel("width and height, pixels")
    axis.set_ylabel("ms a frame")
    _dress(axis, theme)
    legend = figure.legend(frameon=False, fontsize=8, loc="outside right upper")
    for text in legend.get_texts():
        text.set_color(theme.text)
    return _png(figure)


def _label(figure: Any, axis: Any, points: Sequence[Point], theme: Theme) -> None:
    """Write the points' names where nothing else stands, those on the front first."""
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

    figure.draw_without_rendering()
    times = [(point.ms, point.y) for point in points]
    times += [(point.predicted_ms, point.y) for point in points if point.predicted_ms]
    centres = axis.transData.transform(times)
    corners = ((x - MARKER_PX, y - MARKER_PX, x + MARKER_PX, y + MARKER_PX) for x, y in centres)
    taken = [Bbox.from_extents(*corner) for corner in corners]
    if legend := axis.get_legend():
        taken.append(legend.get_window_extent())
    frame = axis.get_window_extent()
    for point in sorted(points, key=lambda point: (not point.on_front, point.ms)):
        for x, y in PLACES:
            text = axis.annotate(
                point.name,
                (point.ms, point.y),
                (x, y),
                textcoords="offset points",
                ha="left" if x > 0 else "right",
                va="bottom" if y > 0 else "top",
                fontsize=7.5,
                color=theme.text,
                fontweight="bold" if point.on_front else "normal",
                arrowprops={"arrowstyle": "-", "color": theme.text, "linewidth": 0.4, "alpha": 0.6}
                if abs(y) > NEAR
                else None,
            )
            # The first call puts the text into its place; its own box has no line to the point.
            text.get_window_extent()
            box = Text.get_window_extent(text)
            inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
            if (inside and not any(box.overlaps(other) for other in taken)) or (x, y) == PLACES[-1]:
                taken.append(box)
                break
            text.remove()


def _dress(axis: Any, theme: Theme) -> None:
    """Give an axis the theme's colours and a grid."""
    axis.grid(visible=True, which="major", color=theme.text, alpha=0.15, linewidth=0.6)
    axis.tick_params(which="both", colors=theme.text)
    axis.xaxis.label.set_color(theme.text)
    axis.yaxis.label.set_color(theme.text)
    for spine in axis.spines.values():
        spine.set_color(theme.text)


def _figure(theme: Theme, inches: tuple[float, float]) -> tuple[Any, Any]:
    """Return a transparent figure and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, layout="constrained", facecolor=theme.page)
    axis = figure.add_subplot(facecolor="none")
    axis.title.set_color(theme.text)
    return figure, axis


def _png(figure: Any) -> bytes:
    """Return the figure as PNG."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", facecolor=figure.get_facecolor())
    return buffer.getvalue()
