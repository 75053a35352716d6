"""Tables of speed against error, from a record of `wamnet bench`: all rows, and those for first readers."""

from __future__ import annotations

from collections.abc import Callable

from wamnet.cli.reports import bench_report
from wamnet.compiler.core.profiles import PROFILES
from wamnet.compiler.reading.languages import is_read

from . import tables
from .records import Records, bench_of

TableOf = Callable[[Records], str]
"""What makes a table of the records."""


def speed_against_error(record: str) -> TableOf:
    """Return time, quality, errors and bounds of all kernels and of Open Image Denoise."""
    return lambda records: bench_report.table(bench_of(records[record]))


def speed_readme(record: str) -> TableOf:
    """Return the rows of [`speed_against_error`] for a first reader: front, whole networks, peers."""
    whole, slow = {"whole", "exact", "native"}, ("opengl", "numpy", "group", "tile4", "tile8", "vector")

    def table(records: Records) -> str:
        heads, line, *rows = speed_against_error(record)(records).splitlines()
        cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows]
        kept = [
            row
            for row, (form, way, *_) in zip(rows, cells, strict=True)
            if form.endswith("*") or way == "–" or (form in whole and not any(name in way for name in slow))
        ]
        return "\n".join([heads, line, *kept])

    return table


SPEED_SHORT = {
    ("window6+rank12", "opencl tile16"): "wamnet, window of 6 pixels and rank 12",
    ("window8+rank16", "opencl tile16"): "wamnet, window of 8 pixels and rank 16",
    ("whole", "opencl fft32"): "wamnet, first layer from spectra (`fft32`)",
    ("whole", "c fft32"): "wamnet, spectra (`fft32`) in C, by GCC",
    ("whole", "opencl tile16"): "wamnet, register tiles (`tile16`)",
    ("exact", "opencl tile16"): "wamnet, the same bits everywhere (profile `exact`)",
    ("whole", "opencl plain"): "wamnet, the kernel that is made to be read (`plain`)",
    ("torch.compile", "–"): "the same network in `torch.compile`",
    ("onnxruntime", "–"): "the same network in ONNX Runtime",
    ("oidn:fast", "–"): "Open Image Denoise, fast",
    ("oidn:high", "–"): "Open Image Denoise, high",
}
"""Rows of [`speed_against_error`] that the README shows, by form and schedule, with their names there."""

SPEED_COLUMNS = ("ms", "PSNR, dB", "largest error", "bound, this frame", "bound, all frames")
"""Columns of [`speed_against_error`] that the README shows."""


def text_checked(form: str, way: str, bound: str) -> str:
    """Return whether `wamnet certify` reads a row's text too: of kernels that have a certificate."""
    if way == "–":
        return way
    target, schedule = way.split()
    profile = form if form in PROFILES else "ieee"
    kind = {"target": target, "schedule": {"name": schedule}, "profile": {"name": profile}}
    read = is_read({**kind, "sine_arguments": [None], "bound": {"output": [1.0]}})
    return "yes" if bound.endswith("†") and read else "no"


def speed_short(record: str) -> TableOf:
    """Return the few rows and columns of [`speed_against_error`] that fit on the first page."""

    def table(records: Records) -> str:
        found = speed_against_error(record)(records).splitlines()
        heads, _, *rows = ([cell.strip() for cell in row.split("|")[1:-1]] for row in found)
        shown: list[list[str]] = []
        for row in rows:  # of a kernel that is in front too, the first
            cells = dict(zip(heads, row, strict=True))
            form, way = cells["form"].removesuffix(" *"), cells["executor, schedule"]
            name = SPEED_SHORT.get((form, way))
            if name and all(name != other for other, *_ in shown):
                checked = text_checked(form, way, cells[SPEED_COLUMNS[-1]])
                shown.append([name, way, *(cells[column] for column in SPEED_COLUMNS), checked])
        return tables.markdown(["by", "schedule", *SPEED_COLUMNS, "text checked"], shown)

    return table
