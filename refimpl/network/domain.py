"""Domain of a model: what the frames were like that it has learned, and how far another frame is from them.

1. A feature image is described by three numbers of each channel: mean, spread, roughness [`describe`].
2. The descriptions of the training frames have a middle and a scale. The distance of a frame is its largest
   deviation from the middle, in scales [`measure`]. Rougher counts, smoother does not.
3. Each training frame is left out in turn and measured by the others: how far is a frame that is new, and of
   the same kind? The threshold is an order statistic of these distances, which states how many such frames
   are beyond it [`domain_of`], [`threshold_of`].
4. The domain is a text of the model [`to_json`], [`of_model`]. Models without it are as before.

Sources: J. von Neumann, "Distribution of the Ratio of the Mean Square Successive Difference to the Variance",
Annals of Mathematical Statistics 12(4), 1941, for noise from differences of neighbours; V. Vovk, A. Gammerman
and G. Shafer, "Algorithmic Learning in a Random World", 2005, for thresholds from ranks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..frame import Frame
from ..reading import to_value
from .dataset import FEATURES, channels_of, check_features, feature_image
from .denoise import Model

Array = NDArray[np.float64]

STATISTICS = ("mean", "spread", "roughness")
"""What describes a channel, in the order of a description's rows."""

LEAST_SCALE = 1.0 / 255.0
"""Smallest deviation that counts, of an encoded feature: a step of eight bits. A channel that is the same in
all training frames has no spread of its own."""

LEAST_FRAMES = 9
"""Fewest training frames of a domain: with fewer, more than a tenth of new frames would be beyond it."""

MOST_FRAMES = 100
"""Most training frames that are described: more change the threshold little, and each takes time."""

ALARMS = 20
"""One of so many frames of the kind that was learned may be outside, where there are as many frames."""

DIGITS = 6
"""Significant digits of a domain's numbers in its text."""

DOMAIN = "domain"
"""Name of the text, among a model's facts, that holds its domain."""

WAY_OUT = "train the model again"
"""What helps against a domain that cannot be read."""

Rows = tuple[tuple[float, ...], ...]
"""Numbers (3, C), one row for each statistic."""


@dataclass(frozen=True)
class Domain:
    """What training frames were like: `middle` and `scale` (3, C) of their descriptions, encoded features.

    Frames that are farther than `threshold` are outside; a share of at most `rate` of frames of the same kind
    is expected to be. `frames` have been described.
    """

    features: tuple[str, ...]
    frames: int
    middle: Rows
    scale: Rows
    threshold: float
    rate: float


@dataclass(frozen=True)
class Distance:
    """How far a frame is from a domain, in scales, and the number that is farthest off.

    `statistic` of `channel` is `value`; the middle of the training frames is `middle`.
    """

    distance: float
    threshold: float
    statistic: str
    channel: str
    value: float
    middle: float

    @property
    def is_outside(self) -> bool:
        """Return whether the frame is outside; a distance that is not a number is."""
        return not self.distance <= self.threshold


def channel_names(features: Sequence[str]) -> list[str]:
    """Return the names of a feature image's channels: `color.R`, `normal.X`, `depth`."""
    names = []
    for feature in (FEATURES[name] for name in features):
        letters = "RGB" if feature.low == 0.0 else "XYZ"
        one = feature.channels == 1
        names += [feature.name] if one else [f"{feature.name}.{letter}" for letter in letters]
    return names


def describe(image: NDArray[Any]) -> Array:
    """Return mean, spread and roughness (3, C) of a feature image (H, W, C), in encoded units.

    Roughness is the root of the mean square of differences between neighbours; of noise that is different in
    each pixel it is sqrt(2) deviations. Spread is the standard deviation without that noise.
    """
    # Channel by channel: a large picture's features in float64 would fill the memory.
    return np.stack([_described(image[..., c].astype(np.float64)) for c in range(image.shape[-1])], axis=-1)


def _described(values: Array) -> Array:
    """Return mean, spread and roughness (3,) of one channel (H, W)."""
    steps = [np.diff(values, axis=axis) for axis in (0, 1)]
    count = sum(step.size for step in steps)
    square = sum(float(np.sum(step * step)) for step in steps) / count if count else 0.0
    spread = np.sqrt(np.maximum(values.var() - square / 2.0, 0.0))
    return np.array([values.mean(), spread, np.sqrt(square)])


def _middle_and_scale(descriptions: Array) -> tuple[Array, Array]:
    """Return mean and scale (3, C) of descriptions (N, 3, C): their deviation, joined with LEAST_SCALE."""
    deviation = descriptions.var(axis=0, ddof=1)
    return descriptions.mean(axis=0), np.sqrt(deviation + LEAST_SCALE**2)


def _deviations(description: Array, middle: Array, scale: Array) -> Array:
    """Return how far a description (3, C) is off, in scales, each number; less roughness counts as 0."""
    off = (description - middle) / scale
    rough = STATISTICS.index("roughness")
    return np.stack([np.maximum(row, 0.0) if n == rough else np.abs(row) for n, row in enumerate(off)])


def distances_left_out(descriptions: Array) -> list[float]:
    """Return the distance of each of N descriptions (N, 3, C) from all others."""
    found = []
    for number, description in enumerate(descriptions):
        others = _middle_and_scale(np.delete(descriptions, number, axis=0))
        found.append(float(_deviations(description, *others).max()))
    return found


def threshold_of(distances: Sequence[float]) -> tuple[float, float]:
    """Return a threshold, and the share of new frames that is expected beyond it, from N distances.

    Were a new frame's distance among them, each rank would be as likely: of N + 1 ranks the largest
    floor((N + 1)/20), at least one, are beyond.
    """
    count = len(distances) + 1
    beyond = max(1, count // ALARMS)
    return sorted(distances)[count - beyond - 1], beyond / count


def domain_of(images: Iterable[NDArray[Any]], features: Sequence[str]) -> Domain | None:
    """Return the domain of feature images (H, W, C), sizes may differ; None of fewer than LEAST_FRAMES."""
    descriptions = np.array([describe(image) for image in images])
    if len(descriptions) < LEAST_FRAMES:
        return None
    threshold, rate = threshold_of(distances_left_out(descriptions))
    rows = ([map(_rounded, row) for row in each.tolist()] for each in _middle_and_scale(descriptions))
    middle, scale = (tuple(map(tuple, each)) for each in rows)
    return Domain(tuple(features), len(descriptions), middle, scale, _rounded(threshold), _rounded(rate))


def chosen(count: int) -> list[int]:
    """Return which of so many frames are described: all, or MOST_FRAMES of them, evenly."""
    most = min(count, MOST_FRAMES)
    return [k * count // most for k in range(most)]


def domain_of_frames(model: Model, frames: Sequence[Frame]) -> Domain | None:
    """Return the domain of a model's training frames, as the model encodes their features."""
    found = (frames[number] for number in chosen(len(frames)))
    images = (feature_image(frame, model.features, model.normalization) for frame in found)
    return domain_of(images if len(frames) >= LEAST_FRAMES else (), model.features)


def measure(domain: Domain, image: NDArray[Any]) -> Distance:
    """Return the distance of a feature image (H, W, C), encoded as the model does it."""
    names = channel_names(domain.features)
    if image.shape[-1] != len(names):
        rule = f"{', '.join(domain.features)} are {len(names)}"
        raise InputError("channels of the feature image", image.shape[-1], rule, "encode these features")
    description = describe(image)
    middle, scale = np.array(domain.middle), np.array(domain.scale)
    off = _deviations(description, middle, scale)
    row, column = (int(number) for number in np.unravel_index(int(np.argmax(off)), off.shape))
    return Distance(
        distance=float(off[row, column]),
        threshold=domain.threshold,
        statistic=STATISTICS[row],
        channel=names[column],
        value=float(description[row, column]),
        middle=float(middle[row, column]),
    )


def measure_frame(domain: Domain, model: Model, frame: Frame) -> Distance:
    """Return the distance of a frame from a model's domain."""
    return measure(domain, feature_image(frame, domain.features, model.normalization))


def _rounded(number: float) -> float:
    """Return a number with so many digits as a text has."""
    return float(f"{number:.{DIGITS}g}")


def to_json(domain: Domain) -> str:
    """Return a domain as one line of JSON."""
    return json.dumps(asdict(domain), sort_keys=True)


def from_json(text: str) -> Domain:
    """Return the domain that a model's text holds, or say what is wrong with it."""
    domain: Domain = to_value(Domain, text, DOMAIN, WAY_OUT)
    check_features(domain.features)
    channels = channels_of(domain.features)
    for name in ("middle", "scale"):
        rows = getattr(domain, name)
        if [len(row) for row in rows] != [channels] * len(STATISTICS):
            rule = f"must have {len(STATISTICS)} rows of {channels} numbers"
            raise InputError(f"{DOMAIN}.{name}", rows, rule, WAY_OUT)
    least = min(number for row in domain.scale for number in row)
    for name, number in {"scale": least, "threshold": domain.threshold, "rate": domain.rate}.items():
        if not 0.0 < number < math.inf:
            raise InputError(f"{DOMAIN}.{name}", number, "must be positive", WAY_OUT)
    return domain


def of_model(model: Model) -> Domain | None:
    """Return the domain that a model states, or None where it states none; refuse that of other features."""
    text = model.info.get(DOMAIN)
    if text is None:
        return None
    domain = from_json(text)
    if domain.features != model.features:
        rule = f"the model's are {', '.join(model.features)}"
        raise InputError(f"{DOMAIN}.features", ", ".join(domain.features), rule, WAY_OUT)
    return domain
