"""Plots of the records, by name [`PLOTS`]. Those of decided questions are pictures that records name."""

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


PLOTS: Mapping[str, Plot] = {
    "quality": Plot(draw_quality, ("quality",)),
    "speed-against-error": Plot(draw_speed("bench-minicubes"), ("bench-minicubes",)),
    "speed-short": Plot(draw_speed_short("bench-minicubes"), ("bench-minicubes",)),
}
"""The plots by the names of their files."""
