"""Plots of the records, by name: [`PLOTS`]."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

from . import plots
from .plots import Plot
from .records import Records
from .speeds import draw_speed, draw_speed_short


def draw_quality(records: Records) -> Any:
    """Draw the PSNR of each denoiser on the mini cubes, inside the training range and outside, on one scale.

    The noisy input is left out: its error is so large that no interval could be seen.
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


ABLATED = {
    "window": "window (px)",
    "width": "width (neurons)",
    "depth": "depth (layers)",
    "frames": "training frames",
}
"""Factors of the ablations that are drawn, with the labels of their axes."""


def draw_ablations(records: Records) -> Any:
    """Draw the PSNR against window, width, depth and training frames, on one scale."""
    found = records["ablations"]
    figure, axes = plots.axes(len(ABLATED), (10.0, 2.8))
    for axis, (factor, label) in zip(axes, ABLATED.items(), strict=True):
        names = {
            float(name.partition(" = ")[2]): name
            for name in found.configurations()
            if name.startswith(f"{factor} = ")
        }
        line = plots.points(found, dict(sorted(names.items())), "psnr")
        plots.lines(axis, {factor: line}, (label, ""), ticks=sorted(names))
        axis.sharey(axes[0])
        axis.tick_params(labelleft=axis is axes[0])
    axes[0].set_ylabel("PSNR, dB")
    axes[0].autoscale(axis="y")
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
    plots.lines(axis, shown, ("seconds of training", "PSNR on unseen times, dB"), ticks=(1, 3, 10, 30, 100))
    return figure


PLOTS: Mapping[str, Plot] = {
    "quality": Plot(draw_quality, ("quality",)),
    "ablations": Plot(draw_ablations, ("ablations",)),
    "learning-curve": Plot(draw_learning_curve, ("learning_curve",)),
    "speed-against-error": Plot(draw_speed("bench-minicubes"), ("bench-minicubes",)),
    "speed-short": Plot(draw_speed_short("bench-minicubes"), ("bench-minicubes",)),
}
"""The plots by the names of their files."""
