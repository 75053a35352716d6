"""`wamnet compare`: how far a picture is from its reference, in every metric."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..refimpl.errors import InputError
from . import options
from .terminal import table

if TYPE_CHECKING:
    from .images import Image

EXAMPLES = """Examples:

wamnet compare denoised.png reference.png

wamnet compare noisy.exr reference.exr --json"""
"""Shown below the help of `wamnet compare`."""


@dataclass(frozen=True)
class Score:
    """A metric's value, or None and in `note` the reason why there is no finite one."""

    metric: str
    value: float | None
    unit: str
    note: str = ""

    def __str__(self) -> str:
        """Return the value with four digits and its unit, or the reason."""
        return f"{self.value:.4g} {self.unit}".strip() if self.value is not None else self.note


def compare(
    image: Annotated[
        Path, typer.Argument(metavar="IMAGE", help="Picture (.exr or .png).", show_default=False)
    ],
    reference: Annotated[
        Path, typer.Argument(metavar="REFERENCE", help="What it should be.", show_default=False)
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of a table.")] = False,
    exposure: options.Exposure = 0.0,
) -> None:
    """Measure how far a picture is from its reference.

    MSE, PSNR and SSIM compare what is seen (sRGB-encoded, clipped to white); relMSE and SMAPE compare linear
    radiance.
    """
    from .images import read_image

    a, b = read_image(image, exposure), read_image(reference, exposure)
    if a.display.shape != b.display.shape:
        (height, width, _), (rows, columns, _) = a.display.shape, b.display.shape
        rule = f"{reference} has {columns}x{rows}"
        raise InputError(f"size of {image}", f"{width}x{height}", rule, "compare pictures of one size")
    scores = measure(a, b)
    if as_json:
        typer.echo(json.dumps({"image": str(image), "reference": str(reference), **scores_as_data(scores)}))
    else:
        table(f"{image} against {reference}", ("metric", "value"), [(s.metric, str(s)) for s in scores])


def measure(image: Image, reference: Image) -> tuple[Score, ...]:
    """Return the score of each metric, on the form of the colours that it is meant for."""
    from ..refimpl.metrics import METRICS

    scores = []
    for metric in METRICS.values():
        try:
            value = metric.function(getattr(image, metric.domain), getattr(reference, metric.domain))
        except InputError as error:
            scores.append(Score(metric.name, None, metric.unit, error.rule))
            continue
        if math.isinf(value):
            scores.append(Score(metric.name, None, metric.unit, "infinite: no difference"))
        else:
            scores.append(Score(metric.name, value, metric.unit))
    return tuple(scores)


def scores_as_data(scores: Sequence[Score]) -> dict[str, dict[str, float | str | None]]:
    """Return scores as JSON's types: numbers, or null with a note (JSON knows no infinity)."""
    return {
        "metrics": {score.metric: score.value for score in scores},
        "notes": {score.metric: score.note for score in scores if score.note},
    }
