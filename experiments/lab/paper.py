"""Tables about the paper, from records: its Table 1, its claims, and the choices that it leaves open.

The verdicts about the claims are decided; `git show 81aad6ac:experiments/claims.py` has the code, which takes
the bootstrap interval of each number. A record of a claim has its answers, each with interval and verdict.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from wamnet.refimpl.encoding import LEVELS

from . import tables
from .intervals import interval
from .records import Records
from .results import Results
from .tables import Column


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


def departures(records: Records) -> str:
    """Return the PSNR of each choice that the paper leaves open."""
    found = records["departures"]
    return tables.table(found, [Column("psnr", "PSNR, dB")], found.data()["rows"], "choice")


def departure(name: str, sign: float = 1.0) -> Callable[[Records], str]:
    """Return how many decibels a choice has more than that of the spec, or, with sign -1, less."""

    def made(records: Records) -> str:
        found = records["departures"]
        first = found.configurations()[0]
        return f"{sign * (_mean(found, name, 'psnr') - _mean(found, first, 'psnr')):.2f}"

    return made


# ---- claims ----------------------------------------------------------------------------------------------


def claims(records: Records) -> str:
    """Return the table of the verdicts about the paper's claims."""
    lines = []
    for values in (record["values"] for record in records["claims"].records()):
        if "verdict" in values:
            answers = values["answers"]
            alone = sum(answer["decides"] for answer in answers) == 1
            here = "<br>".join(said(answer, answer["decides"] and alone) for answer in answers)
            lines.append([values["claim"], values["paper"], f"**{values['verdict']}**", here, values["note"]])
    return tables.markdown(["claim", "paper", "verdict", "here", "note"], lines)


def said(answer: Mapping[str, Any], alone: bool) -> str:
    """Return an answer in words; `alone`: its verdict is the claim's, and not repeated."""
    beside = "" if answer["decides"] else "beside it, "
    verdict = "" if alone else answer["verdict"]
    if "mean" not in answer:
        return f"{beside}{answer['what']}: {', '.join(filter(None, (verdict, answer['reason'])))}"
    write = f"{{:.{answer['digits']}f}}".format
    unit = f" {answer['unit']}" if answer["unit"] else ""
    means = " to ".join(f"{mean:.{answer['means_digits']}f}" for mean in answer["means"])
    ends = "" if answer["reason"] else f" [{write(answer['low'])}, {write(answer['high'])}]"
    bound = f"{'above' if answer['above'] else 'below'} {answer['bound']:g}?{verdict and f' {verdict}'}"
    parts = [means, f"{write(answer['mean'])}{ends}{unit}", answer["over"], bound, answer["reason"]]
    return f"{beside}{answer['what']}: {', '.join(filter(None, parts))}"


PAPER_MSE, PAPER_SSIM = map(float, PRINTED["input"])
"""What the paper's Table 1 prints for its input of 1 spp."""


def exposures(records: Records) -> str:
    """Return the scores of the noisy frames at several exposures, and what follows."""
    found = records["claims"]
    names = [name for name in found.configurations() if name.startswith("input")]
    columns = [
        Column("psnr", "PSNR, dB", 2, interval=True),
        Column("ssim", "SSIM", 3, interval=True),
        Column("mse255", "MSE", 1, interval=True),
        Column("wrapped", "MSE modulo 256", 1, interval=True),
    ]
    psnr, ssim = ([found.per_pose(name, value)[0] for name in names] for value in ("psnr", "ssim"))
    poses = [list(zip(*rows, strict=True)) for rows in (psnr, ssim)]
    return f"{tables.table(found, columns, {name: name for name in names})}\n{follows(*poses)}\n"


def follows(psnr: Sequence[Sequence[float]], ssim: Sequence[Sequence[float]]) -> str:
    """Return what follows from PSNR and SSIM (poses, exposures) of noisy frames that get darker."""
    wanted = -10.0 * math.log10(PAPER_MSE / LEVELS**2)
    printed = f"An MSE of {PAPER_MSE} is {wanted:.2f} dB"
    if not all(each[0] <= wanted <= each[-1] and np.all(np.diff(each) > 0.0) for each in psnr):
        return f"{printed}, which not all of the noisy frames have at one of these exposures."
    there = interval([float(np.interp(wanted, *pose)) for pose in zip(psnr, ssim, strict=True)])
    text = f"{printed}. Noisy frames so dark that they have this PSNR have an SSIM of {there.text(2)}"
    if not there.low > PAPER_SSIM:
        return f"{text}, which does not exclude the {PAPER_SSIM} that the paper prints beside it."
    return (
        f"{text}, where the paper prints {PAPER_SSIM}: so it is not the MSE of frames like these at any of "
        "these exposures. Squares modulo 256 give numbers of that size; that they were taken is a conjecture."
    )
