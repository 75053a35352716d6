"""What a benchmark has found, for readers: a Markdown text, a table, and a section of the demo's report.

The data are those of spec/bench.md; here they are only written down and drawn.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...compiler.schedules.names import split
from . import plots
from .pages import NONE, filled, number

Data = Mapping[str, Any]

PRINTED = plots.PAPER
"""Theme of the plots that are files."""

NO_CACHE = "nothing is kept"
"""What a contender's `caches` says that leaves no compiled code on disk; equal to that of kernels."""


def part(row: Data, name: str, key: str) -> float | None:
    """Return a number of a part of a row, if it has both."""
    found: float | None = (row.get(name) or {}).get(key)
    return found


def cells(row: Data, columns: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return a row's numbers of columns: each a head, a key or the keys `part.key`, and a format, or none."""
    found = []
    for _, key, *form in columns:
        name, _, inner = key.partition(".")
        found.append(number(part(row, name, inner) if inner else row.get(name), *form))
    return tuple(found)


def measured(data: Data) -> list[Data]:
    """Return the contenders that have a time, fastest first."""
    return sorted((row for row in data["contenders"] if row["ms"]), key=lambda row: row["ms"]["median"])


SPEED = (
    ("predicted, ms", "predicted_ms"),
    ("frames/s", "frames_per_s"),
    ("GFLOP/s", "gflops"),
    ("of sgemm", "of_sgemm", ".0%"),
    ("compile, s", "compile_s"),
    ("error", "error.max", ".1e"),
    ("PSNR loss, dB", "quality.psnr_loss_db", ".2f"),
)
"""Columns of the first table, after name, time and range; the last is that of frames."""


def speed_table(data: Data) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heads and rows of what each contender takes and how far off it is."""
    columns = SPEED if data["unseen_frames"] else SPEED[:-1]
    rows = []
    for row in measured(data):
        name = row["name"] + (" *" if row["name"] in data["front"]["error"] else "")
        ms = row["ms"]
        extent = f"{number(ms['min'])} - {number(ms['max'])}"
        rows.append((name, number(ms["median"]), extent, *cells(row, columns)))
    return ("contender", "ms", "range", *(head for head, *_ in columns)), rows


DETAILS = (
    ("spread", "ms.spread", ".0%"),
    ("kernel, ms", "kernel_ms.median"),
    ("of memory", "of_memory", ".0%"),
    ("predicted / measured", "predicted_over_measured", ".2f"),
    ("mean error", "error.mean", ".1e"),
    ("ulp", "error.ulp"),
    ("rounding", "rounding.max", ".1e"),
    ("its bound", "rounding.bound", ".1e"),
    ("PSNR, dB", "quality.psnr_db", ".2f"),
    ("SSIM", "quality.ssim", ".4f"),
    ("SSIM loss", "quality.ssim_loss", ".4f"),
    ("source, bytes", "source_bytes"),
    ("first run ever, s", "first_run_s"),
    ("later run, s", "later_run_s"),
)
"""Columns of everything else that is known."""


def growth_table(data: Data) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heads and rows of the time at each size, and beside it the predicted one; dashes: left out."""
    columns = growth(data)
    heads = ("contender", *(f"{size}, ms (predicted)" for size in columns))
    names = dict.fromkeys(name for found in columns.values() for name in found)

    def cell(row: Data) -> str:
        shown = number(part(row, "ms", "median")), number(row.get("predicted_ms"))
        return "{} ({})".format(*shown) if row.get("ms") else NONE

    return heads, [(name, *(cell(found.get(name, {})) for found in columns.values())) for name in names]


def growth(data: Data) -> dict[int, dict[str, Data]]:
    """Return the rows of each size by name, the main size among them; none where there is no other."""
    if not data["sizes"]:
        return {}
    found = {entry["size_px"]: entry["contenders"] for entry in data["sizes"]}
    found[data["size_px"]] = data["contenders"]
    return {size: {row["name"]: row for row in found[size] if row["ms"]} for size in sorted(found)}


def notes(data: Data) -> list[str]:
    """Return a line for all that was left out, or that took fewer turns, and for what readers should know."""
    lines = []
    for row in data["contenders"]:
        if row["state"] != "measured":
            lines.append(f"{row['name']}: {row['state']}" + (f", {row['reason']}" if row["reason"] else ""))
        elif row["reason"]:
            lines.append(f"{row['name']}: {row['reason']}")
    for entry in data["sizes"]:
        left_out = [row for row in entry["contenders"] if not row["ms"]]
        lines += [f"{row['name']} at {entry['size_px']}: {row['reason']}" for row in left_out]
    # Less does not stand out of noise.
    if any((row.get("of_sgemm") or 0.0) > 1.05 for row in data["contenders"]):
        lines.append(
            "a kernel is faster than sgemm: NumPy's OpenBLAS does not know this processor; "
            "OPENBLAS_CORETYPE=SkylakeX may double it where there is AVX-512"
        )
    draws = (data.get("frames") or {}).get("draws", ())
    if any(draw["time_in_training"] for draw in draws):
        lines.append("a test frame is at a time that training had")
    lines += dict.fromkeys(f"a test frame: {text}" for draw in draws for text in draw["unlike_training"])
    if data["interrupted"]:
        lines.append("interrupted: this is what was measured until then")
    return lines


def markdown(data: Data, pictures: Sequence[str]) -> str:
    """Return the result as a Markdown text."""
    return filled("bench.md.jinja", **_shown(data), plots=pictures)


def _shown(data: Data) -> dict[str, Any]:
    """Return what reports show of a benchmark: the data, tables as heads and rows, and lines."""
    rows = measured(data)
    known = [each for each in DETAILS if any(cells(row, (each,)) != (NONE,) for row in rows)]
    return {
        "data": {"frames": None, **data},
        "speed": speed_table(data),
        "trade": trade_table(data),
        "details": (
            ("contender", *(head for head, *_ in known)),
            [(row["name"], *cells(row, known)) for row in rows],
        ),
        "growth": growth_table(data),
        "notes": notes(data),
        "caches": sorted({row["caches"] for row in rows if row["caches"] != NO_CACHE}),
    }


# ---- speed against error -----------------------------------------------------------------------------------


PANELS = (
    ("quality", "psnr_loss_db", "PSNR lost against the full network, dB", True),
    ("rounding", "bound", "bound of the error, this frame", False),
)
"""Part and number of each panel of the picture, its label, and whether it is a loss."""

ERRORS = (("error", "max", "largest error against float64", False),)
"""The panel of a network that was not trained."""


def kind_of(row: Data, window: int) -> str:
    """Return what sets a row apart, by the names of plots.COLOURS; `window` is the full network's."""
    if row["kind"] != "kernel":
        return "peer"
    narrow = (row.get("window") or window) < window
    if row.get("rank"):
        return "both" if narrow else "rank"
    if narrow:
        return "window"
    return "sine" if row.get("profile", "ieee") != "ieee" else "whole"


def panels(data: Data, of: Sequence[tuple[str, str, str, bool]] = PANELS) -> list[plots.Panel]:
    """Return the panels of the picture that have something to show."""
    found = []
    for name, key, label, is_loss in of:
        marks = [
            plots.Mark(
                # Without the executor, which the marker says, and a variant without its schedule.
                next(filter(None, reversed(split(row["name"])))) if row["kind"] == "kernel" else row["name"],
                (row["ms"]["median"], row["ms"]["min"], row["ms"]["max"]),
                part(row, name, key),
                row.get("executor") or ("" if row.get("window") else "other"),
                kind_of(row, data["network"].get("window") or 0),
                row["name"] in data["front"].get(name, ()),
            )
            for row in measured(data)
            if name == "rounding" or part(row, name, key) is not None
        ]
        if any(mark.y is not None for mark in marks):
            found.append(plots.Panel(label, marks, is_loss))
    return found


TRADE = (
    ("rank", "rank"),
    ("window", "window"),
    ("parameters", "parameters"),
    ("ms", "ms.median"),
    ("spread", "ms.spread", ".0%"),
    ("PSNR, dB", "quality.psnr_db", ".2f"),
    ("PSNR loss, dB", "quality.psnr_loss_db", "+.2f"),
    ("largest error", "rounding.max", ".1e"),
    ("bound, this frame", "rounding.bound", ".1e"),
    ("bound, all frames", "rounding.bound_all", ".1e"),
)
"""Columns of speed against error, after those that name a row."""

TABLE_HEADS = ("variant", "executor, schedule", "profile, degree of sine", *(head for head, *_ in TRADE))
"""Columns of the table of speed against error."""


def trade_table(data: Data) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heads and rows of speed, quality, errors and bounds."""
    return TABLE_HEADS, [_full_row(data, row) for row in measured(data)]


def table(data: Data) -> str:
    """Return the rows of a benchmark's data as a Markdown table of speed, quality, errors and bounds."""
    return filled("table.md.jinja", shown=trade_table(data))


def _full_row(data: Data, row: Data) -> tuple[str, ...]:
    """Return the cells of a row; a star is on the front of time and loss, a dagger has a certificate."""
    front = data["front"].get("quality", ())
    kernel = row["kind"] == "kernel"
    form = (split(row["name"])[2] or "whole") if kernel else row["name"]
    degree = row.get("degree")
    *numbers, bound_all = cells(row, TRADE)
    return (
        form + (" *" if row["name"] in front else ""),
        f"{row.get('executor')} {row.get('schedule')}" if kernel else NONE,
        f"{row.get('profile')}, {degree or 'its own'}" if kernel else NONE,
        *numbers,
        bound_all + (" †" if part(row, "rounding", "certified") else ""),
    )


# ---- plots -------------------------------------------------------------------------------------------------


def draw(data: Data, theme: plots.Theme) -> dict[str, bytes]:
    """Return the plots as PNG by name: `error`, `trade-off` and `sizes`, where there is something to show."""
    drawn = {}
    if shown := panels(data, ERRORS):
        drawn["error"] = plots.trade_off(shown, theme)
    if data["unseen_frames"] and (found := panels(data)):
        drawn["trade-off"] = plots.trade_off(found, theme)
    if columns := growth(data):
        names = dict.fromkeys(name for cells in columns.values() for name in cells)
        lines = {
            name: [(size, cells[name]["ms"]["median"]) for size, cells in columns.items() if name in cells]
            for name in names
        }
        drawn["sizes"] = plots.growth(lines, theme)
    return drawn


def section(data: Data, embed: Callable[[bytes], str]) -> dict[str, Any]:
    """Return what the demo's report shows of a benchmark: texts, tables, and plots for both kinds of page."""
    light, dark = draw(data, plots.LIGHT), draw(data, plots.DARK)
    return {
        **_shown(data),
        "plots": {name: {"light": embed(light[name]), "dark": embed(dark[name])} for name in light},
    }
