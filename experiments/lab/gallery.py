"""Plots of the records, by name, and the page that shows them with the pictures of frames.

A plot is a [`plots.Plot`] in `PLOTS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

from . import plots
from .plots import Plot
from .records import Records
from .speeds import draw_speed, draw_speed_short


def draw_quality(records: Records) -> Any:
    """Draw the PSNR of each denoiser on the mini cubes, inside of the ranges and outside, on one scale.

    The noisy input is left out: it is so far off that no interval could be seen beside it.
    """
    module, found = importlib.import_module("quality"), records["quality"]
    figure, axes = plots.axes(2, (11.0, 3.6))
    for axis, (split, text) in zip(axes, module.SPLITS.items(), strict=True):
        shown = {}
        for row, kind in module.ROWS.items():
            at = found.interval(module.configuration("minicubes", split, row), "psnr")
            if at is not None and (kind.quality or kind.recipe):
                shown[kind.text] = (at.mean, at.low, at.high)
        plots.bars(axis, shown, f"PSNR {text}, dB")
    axes[1].sharex(axes[0])
    axes[1].sharey(axes[0])
    axes[1].tick_params(labelleft=False)
    axes[0].autoscale(axis="x")
    return figure


def draw_ablations(records: Records) -> Any:
    """Draw the PSNR against window, width, depth and training frames."""
    factors = ("window", "width", "depth", "frames")
    found = records["ablations"]
    figure, axes = plots.axes(len(factors), (10.0, 2.8))
    for axis, factor in zip(axes, factors, strict=True):
        names = {
            float(name.partition(" = ")[2]): name
            for name in found.configurations()
            if name.startswith(f"{factor} = ")
        }
        line = plots.points(found, dict(sorted(names.items())), "psnr")
        plots.lines(axis, {factor: line}, (factor, "PSNR, dB"), log=True)
    return figure


def draw_learning_curve(records: Records) -> Any:
    """Draw the PSNR against the seconds of training."""
    found, shown = records["learning_curve"], {}
    for name in found.configurations():
        curves = zip(*found.of(name, "curve"), strict=False)
        shown[name] = [
            (
                sum(p["seconds"] for p in at) / len(at),
                sum(p["psnr"] for p in at) / len(at),
                min(p["psnr"] for p in at),
                max(p["psnr"] for p in at),
            )
            for at in curves
        ]
    figure, (axis,) = plots.axes(1, (6.0, 3.5))
    plots.lines(axis, shown, ("seconds of training", "PSNR on unseen times, dB"), log=True)
    return figure


def pictures(records: Records) -> str:
    """Return all plots, and pictures of frames, that are there, as the page of the results shows them."""
    made = []
    for name, plot in PLOTS.items():
        if plots.ready(plot, records):
            made.append(f"![{plot.caption}](images/{name}.svg)\n\n*{plot.caption}*\n")
    for name in records.names():
        for path in records[name].data().get("pictures", {}):
            # The file says all commands that made the records; their program is what drew the picture.
            program = " ".join(records[name].data()["commands"][0].split()[:2])
            made.append(f"![Pictures of `{name}`]({path.removeprefix('docs/')})\n\n*`{program}`*\n")
    return "\n".join(made) or "None of the records in git has a picture yet.\n"


PLOTS: Mapping[str, Plot] = {
    "quality": Plot(
        draw_quality,
        ("quality",),
        "The mini cubes, camera and time moving: means over poses and seeds, and 95 % intervals.",
    ),
    "ablations": Plot(
        draw_ablations,
        ("ablations",),
        "What quality depends on: means over poses and seeds, and 95 % intervals.",
    ),
    "learning-curve": Plot(
        draw_learning_curve, ("learning_curve",), "Learning curves: means of three seeds, least and largest."
    ),
    "speed-against-error": Plot(
        draw_speed("bench-minicubes"),
        ("bench-minicubes",),
        "Milliseconds a frame against PSNR lost and against the bound of the error: the mini cubes.",
    ),
    "speed-short": Plot(
        draw_speed_short("bench-minicubes"),
        ("bench-minicubes",),
        "Milliseconds per frame, with PSNR and the bound on the rounding error of every frame.",
    ),
}
"""The plots by the names of their files."""
