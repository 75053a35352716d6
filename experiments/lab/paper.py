"""Tables about the paper's Table 1, from records."""

import importlib
import math
from collections.abc import Mapping

from . import tables
from .records import Records
from .results import Results


def table1(records: Records) -> str:
    """Return the table as the experiment prints it."""
    made: str = importlib.import_module("table1").written(records["table1"], records["table1-times"])
    return made


PRINTED: Mapping[str, tuple[str, str]] = {
    "input": ("82.93", "0.21"),
    "dncnn": ("79.03", "0.44"),
    "wamnet": ("48.04", "0.68"),
    "pix2pix": ("39.28", "0.70"),
}
"""MSE and SSIM of the paper's Table 1."""

PAPER_ROWS = (
    *("input", "dncnn", "dncnn-shrunk", "wamnet-color", "wamnet-color-own", "wamnet", "wamnet-own"),
    *("wamnet-short", "wamnet-best", "pix2pix", "svgf", "nlm", "oidn", "render30"),
)
"""Rows of Table 1 that docs/results/paper.md shows."""


def table1_readme(records: Records) -> str:
    """Return the rows of Table 1 of docs/results/paper.md, beside what the paper prints."""
    found, rows = records["table1"], importlib.import_module("baselines.rows").ROWS
    cells = []
    for row in (row for row in PAPER_ROWS if row in found.configurations()):
        mse, ssim = (f"; {text}" if text else "" for text in PRINTED.get(row, ("", "")))
        cells.append(
            [
                rows[row].text,
                found.text(row, "psnr", 2),
                f"{_mean(found, row, 'paper'):.2f}",
                f"{_mean(found, row, 'wrapped'):.1f}{mse}",
                f"{_mean(found, row, 'ssim'):.3f}{ssim}",
                f"{_mean(found, row, 'flip'):.3f}",
                f"{_mean(found, row, 'worth'):.0f}",
            ]
        )
    heads = [
        "",
        "PSNR, dB",
        'the paper\'s "PSNR"',
        "MSE modulo 256; the paper",
        "SSIM; the paper",
        "FLIP",
        "equivalent spp",
    ]
    return tables.markdown(heads, cells)


def _mean(found: Results, configuration: str, value: str) -> float:
    """Return the mean of a number over the seeds; NaN without one."""
    summary = found.summary(configuration, value)
    return summary.mean if summary else math.nan
