"""Tables of speed against error, from a record of `wamnet bench`: all rows, and a few for first readers."""

from collections.abc import Callable
from typing import Any

from wamnet.cli.reports import bench_report
from wamnet.cli.reports.plots import PAPER, trade_off_figure
from wamnet.compiler.core.profiles import PROFILES
from wamnet.compiler.reading.languages import is_read

from . import plots, tables
from .records import Records, bench_of

TableOf = Callable[[Records], str]
"""What makes a table of the records."""


def speed_against_error(record: str) -> TableOf:
    """Return time, quality, errors and bounds of all kernels and of Open Image Denoise."""
    return lambda records: bench_report.table(bench_of(records[record]))


SPEED_SHORT = {
    ("window6+rank12", "opencl tile:16"): "wamnet, window of 6 pixels and rank 12",
    ("window8+rank16", "opencl tile:16"): "wamnet, window of 8 pixels and rank 16",
    ("whole", "opencl fft:16"): "wamnet, FFT (`fft:16`)",
    ("whole", "c fft:16"): "wamnet, FFT (`fft:16`) in C, by GCC",
    ("whole", "opencl tile:16"): "wamnet, register tiles (`tile:16`)",
    ("whole8", "opencl dot:16"): "wamnet, bit-identical everywhere (`whole8`)",
    ("whole", "opencl plain"): "wamnet, the human-readable kernel (`plain`)",
    ("torch.compile", "–"): "the same network in `torch.compile`",
    ("onnxruntime", "–"): "the same network in ONNX Runtime",
    ("oidn:fast", "–"): "Open Image Denoise, fast",
    ("oidn:high", "–"): "Open Image Denoise, high",
}
"""Rows of [`speed_against_error`] that the README shows, by form and schedule, with their names there."""

SPEED_COLUMNS = ("ms", "PSNR, dB", "largest error", "bound, this frame", "bound, all frames")
"""Columns of [`speed_against_error`] that the README shows."""


def source_verified(form: str, way: str, bound: str) -> str:
    """Return whether `wamnet certify` verifies a row's source too: of kernels that have a certificate."""
    if way == "–":
        return way
    target, schedule = way.split()
    profile = form if form in PROFILES else "ieee"
    kind = {"target": target, "schedule": {"name": schedule}, "profile": {"name": profile}}
    rounds = float(not bound.startswith("0.0"))
    read = is_read({**kind, "sine_arguments": [None], "bound": {"output": [rounds]}})
    return "yes" if bound.endswith("†") and read else "no"


def short_rows(records: Records, record: str) -> list[list[str]]:
    """Return the cells of the few rows and columns of [`speed_against_error`] that fit on the first page."""
    found = speed_against_error(record)(records).splitlines()
    heads, _, *rows = ([cell.strip() for cell in row.split("|")[1:-1]] for row in found)
    shown: list[list[str]] = []
    for row in rows:  # of a kernel that is in front too, the first
        cells = dict(zip(heads, row, strict=True))
        form, way = cells["variant"].removesuffix(" *"), cells["executor, schedule"]
        name = SPEED_SHORT.get((form, way))
        if name and all(name != other for other, *_ in shown):
            checked = source_verified(form, way, cells[SPEED_COLUMNS[-1]])
            shown.append([name, way, *(cells[column] for column in SPEED_COLUMNS), checked])
    return shown


def speed_short(record: str) -> TableOf:
    """Return these rows as a table."""
    heads = ["backend", "schedule", *SPEED_COLUMNS, "source verified"]
    return lambda records: tables.markdown(heads, short_rows(records, record))


def draw_speed(record: str) -> Callable[[Records], Any]:
    """Return what draws time against loss and against bounds."""
    return lambda records: trade_off_figure(bench_report.panels(bench_of(records[record])), PAPER)


def draw_speed_short(record: str) -> Callable[[Records], Any]:
    """Return what draws these rows: a dot for the time of each, with its quality and its bound in words."""

    def draw(records: Records) -> Any:
        figure, (axis,) = plots.axes(1, (8.0, 3.6))
        rows = [row for row in short_rows(records, record) if row[3] != "–"]
        for at, (_, way, ms, psnr, *_, bound, _) in enumerate(rows):
            marker, color = ("s", "#D55E00") if way == "–" else ("o", "#0072B2")
            time, proven = float(ms.replace(",", "")), bound.removesuffix(" †")
            axis.plot(time, at, marker, color=color, markersize=7)
            error = "" if proven == "–" else f", error at most {proven}"
            axis.annotate(
                f"{ms} ms, {psnr} dB{error}", (time, at), (9, -3), fontsize=8, textcoords="offset points"
            )
        axis.set_yticks(range(len(rows)), [row[0].replace("`", "") for row in rows], fontsize=8)
        axis.invert_yaxis()
        axis.set_xscale("log")
        axis.set_xticks([30, 50, 100, 200, 500, 1000], ["30", "50", "100", "200", "500", "1000"])
        axis.minorticks_off()
        axis.set_xlim(30, 5000)
        axis.set_xlabel("ms per frame of 512x512, two cores (left is faster)")
        return figure

    return draw
