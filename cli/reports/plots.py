"""The report's plots as PNG, each in a light and a dark form, without a display.

Colour maps and scales are chosen so that a plot can be read in grey too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

from matplotlib import colormaps
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import NullLocator
from matplotlib.transforms import Bbox


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

MARKER_PX = 9.0
"""Half the side of the square around a marker that labels leave free, in pixels."""

DOTS_PER_INCH = 150
"""Resolution of the plots: sharp on a phone, small in a file."""


def error_maps(maps: Sequence[tuple[str, Any]], theme: Theme) -> list[bytes]:
    """Draw error maps (H, W) with their titles, a picture for each, in one colour scale, with its bar.

    The scale follows the square root of the error: else a few bright samples would hide everything else.
    """
    largest = max(float(values.max()) for _, values in maps)
    scale = PowerNorm(0.5, 0.0, largest or 1.0)
    drawn = []
    for title, values in maps:
        figure, axis = _figure(theme, (4.0, 3.4))
        picture = axis.imshow(values, cmap="magma", norm=scale)
        axis.set_title(title, color=theme.text, fontsize=10)
        axis.set_axis_off()
        bar = figure.colorbar(picture, ax=axis, shrink=0.85, label="absolute error, display-encoded")
        _dress(bar.ax, theme)
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
    _dress(axis, theme, grid="both")
    if seconds_per_step is not None:
        scale = seconds_per_step
        ways = (lambda step: step * scale, lambda second: second / scale)
        above = axis.secondary_xaxis("top", functions=ways)
        above.set_xlabel("seconds")
        _dress(above, theme)
    return _png(figure)


def growth(lines: Mapping[str, Sequence[tuple[int, float]]], theme: Theme) -> bytes:
    """Draw times (ms) over widths of square pictures, a line for each name."""
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
    axis.set_ylabel("ms per frame")
    _dress(axis, theme, grid="major")
    figure.legend(frameon=False, fontsize=8, labelcolor=theme.text, loc="outside right upper")
    return _png(figure)


def _taken(figure: Any, axis: Any, places: Sequence[tuple[float, float]]) -> list[Any]:
    """Return the boxes that labels leave free: around points at these coordinates, and the legend's."""
    figure.draw_without_rendering()
    corners = (
        (x - MARKER_PX, y - MARKER_PX, x + MARKER_PX, y + MARKER_PX)
        for x, y in axis.transData.transform(places)
    )
    taken = [Bbox.from_extents(*corner) for corner in corners]
    legend = axis.get_legend()
    return [*taken, legend.get_window_extent()] if legend else taken


def _place(axis: Any, name: str, at: tuple[float, float], theme: Theme, bold: bool, taken: list[Any]) -> None:
    """Write a name beside a point in the first position that is free, if there is one."""
    frame = axis.get_window_extent()
    # Offsets in points, the best first; a negative x is that of the label's end.
    for x, y in [(x, sign * y) for y in (3, 12, 22) for x in (6, -6) for sign in (1, -1)]:
        text = axis.annotate(
            name,
            at,
            (x, y),
            textcoords="offset points",
            ha="left" if x > 0 else "right",
            va="bottom" if y > 0 else "top",
            fontsize=7.5,
            color=theme.text,
            fontweight="bold" if bold else "normal",
            arrowprops={"arrowstyle": "-", "color": theme.text, "linewidth": 0.4, "alpha": 0.6}
            if abs(y) > 12
            else None,
        )
        # The first call puts the text into its place; its own box has no line to the point.
        text.get_window_extent()
        box = Text.get_window_extent(text)
        inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
        if inside and not any(box.overlaps(other) for other in taken):
            taken.append(box)
            return
        text.remove()


# ---- speed against error -----------------------------------------------------------------------------------

MARKERS = {"opencl": ("o", "OpenCL"), "opengl": ("^", "OpenGL"), "c": ("v", "C"), "numpy": ("s", "NumPy")}
"""Marker and name of each executor."""

PEER_MARKER, OTHER_MARKER = ("D", "library"), ("*", "Open Image Denoise")
"""Marker and name of peers that compute the network, and of another denoiser."""

COLOURS = {
    "whole": ("#0072B2", "whole network"),
    "sine": ("#E69F00", "other sine or profile"),
    "rank": ("#D55E00", "trained rank"),
    "window": ("#009E73", "trained window"),
    "both": ("#CC79A7", "trained rank and window"),
    "peer": ("#7F7F7F", "others"),
}
"""Colour and name of each kind: those of M. Okabe and K. Ito, "Color Universal Design" (2008), and grey."""

BAND = 1.8
"""Part of the logarithmic range of bounds, over its end, where those are drawn that have none."""


@dataclass(frozen=True)
class Mark:
    """A row of a benchmark: its time in ms with the extremes, and a number; None where it has none.

    `executor` chooses the marker, `kind` the colour [`MARKERS`, `COLOURS`].
    """

    name: str
    ms: tuple[float, float, float]
    y: float | None
    executor: str
    kind: str
    on_front: bool


@dataclass(frozen=True)
class Panel:
    """Marks over time; of losses in dB, or of bounds, which are positive and may be missing."""

    label: str
    marks: Sequence[Mark]
    is_loss: bool


def trade_off(panels: Sequence[Panel], theme: Theme) -> bytes:
    """Draw marks over time in panels one above the other, each with its Pareto front, as PNG."""
    return _png(trade_off_figure(panels, theme))


def trade_off_figure(panels: Sequence[Panel], theme: Theme) -> Any:
    """Return the figure of these panels, with one axis of time and one legend."""
    figure, *axes = _figure(theme, (9.0, 1.2 + 4.4 * len(panels)), len(panels))
    axes[0].set_xscale("log")
    for axis, panel in zip(axes, panels, strict=True):
        _panel(axis, panel, theme)
    axes[-1].set_xlabel("ms per frame, median; the line spans all rounds")
    _legend(figure, [mark for panel in panels for mark in panel.marks], theme)

    def order(mark: Mark) -> tuple[bool, bool, float]:
        # The front is named first, then other denoisers, then by time.
        return (not mark.on_front, mark.executor in MARKERS, mark.ms[0])

    # Places of labels need the last size of the axes, which the legend takes room from.
    for axis, panel in zip(axes, panels, strict=True):
        shown = [(mark, (mark.ms[0], _height(panel, mark))) for mark in panel.marks]
        taken = _taken(figure, axis, [at for _, at in shown])
        taken += [text.get_window_extent() for text in axis.texts]
        for mark, at in sorted(shown, key=lambda pair: order(pair[0])):
            _place(axis, mark.name, at, theme, mark.on_front, taken)
    return figure


def _top(panel: Panel) -> tuple[float, float]:
    """Return the least and the largest bound of a panel."""
    known = [mark.y for mark in panel.marks if mark.y]
    return (min(known), max(known)) if known else (1e-6, 1e-3)


def _height(panel: Panel, mark: Mark) -> float:
    """Return where a mark is drawn: that without a bound in a band above all others."""
    if mark.y is not None:
        return mark.y
    return float(_top(panel)[1] * 10.0 ** (BAND / 2 + 0.2))


def _panel(axis: Any, panel: Panel, theme: Theme) -> None:
    """Draw a panel's marks, front and band."""
    for mark in panel.marks:
        marker = {**MARKERS, "": PEER_MARKER, "other": OTHER_MARKER}[mark.executor][0]
        colour, height = COLOURS[mark.kind][0], _height(panel, mark)
        colour = theme.text if mark.executor == "other" else colour
        axis.plot(mark.ms[1:], [height] * 2, color=colour, linewidth=0.9, alpha=0.6)
        edge = theme.text if mark.on_front else colour
        size = 11 if marker == OTHER_MARKER[0] else 6.5
        axis.plot([mark.ms[0]], [height], marker, color=colour, markeredgecolor=edge, markersize=size)
    if panel.is_loss:
        # Smaller losses, in dB, mean little and may be negative.
        axis.set_yscale("symlog", linthresh=0.05)
        axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.axhline(0.0, color=theme.text, linewidth=0.8, alpha=0.5)
    else:
        low, high = _top(panel)
        axis.set_yscale("log")
        axis.set_ylim(low / 4, high * 10.0 ** (BAND + 0.2))
        if any(mark.y is None for mark in panel.marks):
            axis.axhspan(high * 10.0**0.2, high * 10.0 ** (BAND + 0.2), color=theme.text, alpha=0.07)
            at = (0.995, high * 10.0 ** (BAND + 0.05))
            style = {"ha": "right", "va": "top", "fontsize": 8, "color": theme.text}
            axis.text(*at, "no bound", transform=axis.get_yaxis_transform(), **style)
            # The band is off the scale.
            axis.yaxis.set_major_formatter(lambda value, _: f"{value:.0e}" if value <= high else "")
            axis.yaxis.set_minor_locator(NullLocator())
    front = sorted((mark for mark in panel.marks if mark.on_front), key=lambda mark: mark.ms[0])
    line = [mark.ms[0] for mark in front], [mark.y for mark in front]
    axis.plot(*line, drawstyle="steps-post", color=theme.text, linewidth=1.1, alpha=0.7, zorder=1)
    axis.margins(0.1, 0.12)
    axis.set_ylabel(panel.label)
    _dress(axis, theme, grid="major")


def _legend(figure: Any, marks: Sequence[Mark], theme: Theme) -> None:
    """Draw a legend of the markers and colours that occur, below the panels."""
    forms = {**MARKERS, "": PEER_MARKER, "other": OTHER_MARKER}
    here = {mark.executor for mark in marks}, {mark.kind for mark in marks}
    grey: dict[str, Any] = {"linestyle": "none", "color": theme.text, "markersize": 6.5}
    shown = [
        Line2D([], [], marker=m, label=text, **grey) for key, (m, text) in forms.items() if key in here[0]
    ]
    patch: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 8}
    shown += [
        Line2D([], [], color=colour, label=text, **patch)
        for key, (colour, text) in COLOURS.items()
        if key in here[1]
    ]
    shown.append(Line2D([], [], color=theme.text, linewidth=1.1, alpha=0.7, label="Pareto front"))
    form = {"frameon": False, "fontsize": 8, "labelcolor": theme.text}
    figure.legend(handles=shown, ncols=5, loc="outside lower center", **form)


def _dress(axis: Any, theme: Theme, grid: str = "") -> None:
    """Give an axis the theme's colours, and a grid at some of its ticks."""
    if grid:
        axis.grid(visible=True, which=grid, color=theme.text, alpha=0.15, linewidth=0.6)
    axis.tick_params(which="both", colors=theme.text)
    axis.xaxis.label.set_color(theme.text)
    axis.yaxis.label.set_color(theme.text)
    for spine in axis.spines.values():
        spine.set_color(theme.text)


def _figure(theme: Theme, inches: tuple[float, float], panels: int = 1) -> tuple[Any, ...]:
    """Return a figure and its transparent axes, one above the other."""
    figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, layout="constrained", facecolor=theme.page)
    form = {"facecolor": "none"}
    return figure, *figure.subplots(panels, sharex=True, squeeze=False, subplot_kw=form)[:, 0]


def _png(figure: Any) -> bytes:
    """Return the figure as PNG."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", facecolor=figure.get_facecolor())
    return buffer.getvalue()
