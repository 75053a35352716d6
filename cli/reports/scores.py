"""The score of a picture in every metric, for people and for programs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...refimpl.errors import InputError
from ...refimpl.metrics import METRICS, inside
from ..files.images import Image


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


def measure(image: Image, reference: Image) -> tuple[Score, ...]:
    """Return the score of each metric, on the form of the colours that it is meant for.

    In the penumbra too, where the reference has the layers that it is computed from.
    """
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
    if reference.penumbra is not None and reference.penumbra.any():
        inner = inside(reference.penumbra, image.display, reference.display)
        scores.append(Score("penumbra RMSE", inner, ""))
    return tuple(scores)


def as_data(scores: Sequence[Score]) -> dict[str, dict[str, float | str | None]]:
    """Return scores as JSON's types: numbers, or null with a note (JSON knows no infinity)."""
    return {
        "metrics": {score.metric: score.value for score in scores},
        "notes": {score.metric: score.note for score in scores if score.note},
    }
