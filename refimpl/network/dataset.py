"""From frames to training examples: features by name, windows around pixels, targets.

1. A feature turns a layer of a frame into numbers near [-1, 1] [`FEATURES`], with scales that belong to the
   model, not to the frame [`Normalization`], [`normalization_of`].
2. The chosen features, one after another on the channel axis, are the feature image [`feature_image`].
   What is not a number counts as 0 there, once and for all executors [`known`].
3. The window of a pixel is the network's input vector [window.py].
4. Training draws pixels uniformly from all frames with the counter generator [`sample_pixels`] and gathers
   windows and targets from one table [`build`], [`examples_at`].

The encodings are decisions, explained in the chapter of this module.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..encoding import to_display
from ..errors import NO_VALUE, InputError, choice
from ..frame import DIRECT, FIRST_HIT, LAYERS, SEEN_DIRECT, SUN, Frame, check_finite
from ..reading import to_value
from ..rng import counter, random_block
from ..vectors import vector
from .smoothing import DEPTH, GUIDES, LEVELS, dimmed, smooth
from .whole import steps_of
from .window import Window, gathered, pad

Array = NDArray[Any]
Indices = NDArray[np.int64]

PIXEL_TAG = 0x50495845
"""Counter `block` of the words that choose pixels ("PIXE" in ASCII); light paths use small numbers."""

LARGEST_SCALE = 1e18
"""Largest scale and position, in scene units. The smallest scale is its inverse: with a position of 1e12 no
feature overflows float32 before it is clipped."""

FARTHEST_DEPTH = 1e9
"""From here on a depth stands for a miss: renderers write 1e10 there (Blender), or the largest float."""

NORMALIZATION_LIMITS: Mapping[str, tuple[float, float]] = {
    "exposure_stops": (-64.0, 64.0),
    "depth_scale": (1.0 / LARGEST_SCALE, LARGEST_SCALE),
    "position_scale": (1.0 / LARGEST_SCALE, LARGEST_SCALE),
}
"""Least and largest value of a normalization's numbers; beyond 2^64 there is no picture."""

HIGHLIGHT_STOPS = -4.0
"""Exposure of `highlights` less that of `color`: of one path a pixel, most of the light is in few pixels that
are far brighter than white, which `color` clips."""


FENCES = 1.5
"""Distance of the fences from the quartiles in interquartile ranges; Tukey's. A plain that reaches to the
horizon is beyond them, and would leave a thirtieth of the range to all that is on it."""


@dataclass(frozen=True)
class Normalization:
    """Scales that bring a scene's numbers near [-1, 1]; part of the model, the same for all its frames.

    `depth_scale` and `position_scale` in scene units; `position_center` in world space.
    """

    exposure_stops: float = 0.0
    depth_scale: float = 1.0
    position_center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    position_scale: float = 1.0


@dataclass(frozen=True)
class Feature:
    """A network input: `encode` turns `layer` (..., channels) into numbers in [low, high].

    `formula` says the same in words for whoever feeds a kernel, with a [`Normalization`]'s fields in braces.
    With `guides`, names of layers by what they are to the filter, the layer is smoothed first [smoothing.py].
    """

    name: str
    layer: str
    channels: int
    low: float
    high: float
    encode: Callable[[Array, Normalization], Array]
    formula: str
    guides: Mapping[str, str] = field(default_factory=dict)

    @property
    def layers(self) -> tuple[str, ...]:
        """Return all layers that the feature is made of."""
        return (self.layer, *self.guides.values())

    def encoding(self, normalization: Normalization) -> str:
        """Return the formula with the model's scales in it."""
        return self.formula.format_map(asdict(normalization))


def encode_color(values: Array, normalization: Normalization) -> Array:
    """Encode linear radiance (..., 3) for display, to [0, 1]."""
    return to_display(values, normalization.exposure_stops)


def encode_highlights(values: Array, normalization: Normalization) -> Array:
    """Encode linear radiance (..., 3) for a display that is four stops less sensitive, to [0, 1]."""
    return to_display(values, normalization.exposure_stops + HIGHLIGHT_STOPS)


def encode_share(values: Array, normalization: Normalization) -> Array:
    """Clip reflectances or shares (...) to [0, 1]."""
    return np.clip(values, 0.0, 1.0)


def encode_signed(values: Array, normalization: Normalization) -> Array:
    """Clip components of a unit vector (..., 3) to [-1, 1]; a pixel's mean may be shorter than 1."""
    return np.clip(values, -1.0, 1.0)


def encode_depth(values: Array, normalization: Normalization) -> Array:
    """Scale distances (..., 1) to [0, 1]; what is farther than depth_scale counts as 1."""
    return np.clip(values / normalization.depth_scale, 0.0, 1.0)


def encode_position(values: Array, normalization: Normalization) -> Array:
    """Scale world positions (..., 3) to [-1, 1] around position_center."""
    center = normalization.position_center
    centred: Array = vector(*(values[..., i] - center[i] for i in range(3)))
    scaled: Array = np.clip(centred / normalization.position_scale, -1.0, 1.0)
    return scaled


DISPLAY_FORMULA = "sRGB of (linear radiance * 2^{exposure_stops!r}) clipped to 0 .. 1 (IEC 61966-2-1)"
"""How colour is encoded, on the way in and on the way out."""

SIGNED = (encode_signed, encode_position)
"""Encodings to [-1, 1]; all others are to [0, 1]."""


Row = tuple[Any, ...]
"""Encoding, formula, and perhaps a layer of another name than the feature's, and guides."""


def _features(rows: Mapping[str, Row]) -> dict[str, Feature]:
    """Return the features of rows, by name."""
    found = {}
    for name, (encode, formula, *others) in rows.items():
        layer, low = others[0] if others else name, -1.0 if encode in SIGNED else 0.0
        guides = others[1] if len(others) > 1 else {}
        found[name] = Feature(name, layer, LAYERS[layer].channels, low, 1.0, encode, formula, guides)
    return found


FIRST_HITS = _features(
    {
        "color": (encode_color, DISPLAY_FORMULA),
        "normal": (
            encode_signed,
            "unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit",
        ),
        "albedo": (
            encode_share,
            "linear reflectance clipped to 0 .. 1, mean over samples; 0 where nothing is hit",
        ),
        "depth": (
            encode_depth,
            "distance along the ray / {depth_scale!r}, clipped to 0 .. 1; 0 where nothing is hit",
        ),
        "position": (
            encode_position,
            "(world position - {position_center}) / {position_scale!r}, clipped to -1 .. 1; a miss is at 0",
        ),
        "direction": (encode_signed, "unit direction of the camera ray in world space"),
        "unshadowed": (
            encode_color,
            "the lamps' radiance off the first hit, were it matt and nothing in between: " + DISPLAY_FORMULA,
        ),
        "highlights": (
            encode_highlights,
            "sRGB of (linear radiance * 2^({exposure_stops!r} - 4)) clipped to 0 .. 1: what color clips",
            "color",
        ),
    }
)
"""Features of colour and of the first hit; a new one is one line here and one `encode_*` function."""

LIT_FORMULA = "emission, and unshadowed with its shadows: " + DISPLAY_FORMULA
"""The formula of direct light with shadows."""

PAST = "past mirrors and glass: "
"""How the formulas of features begin that are of what is seen there."""

FEATURES: Mapping[str, Feature] = {
    **FIRST_HITS,
    **{
        seen: replace(FIRST_HITS[first], name=seen, layer=seen, formula=PAST + FIRST_HITS[first].formula)
        for seen, first in FIRST_HIT.items()
    },
    **_features(
        {
            "seen_emission": (encode_color, PAST + "emission, " + DISPLAY_FORMULA),
            "history": (
                encode_color,
                "mean with the pictures before, where each surface was: " + DISPLAY_FORMULA,
            ),
            "history_weight": (
                encode_share,
                "share of the pictures before in that mean, 1 - 1 / (number of its samples); "
                "0 where it is new",
            ),
            **{
                f"{past}smoothed": (
                    encode_color,
                    f"color smoothed, guided by {', '.join(guides.values())} (spec/smoothing.md); "
                    + DISPLAY_FORMULA,
                    "color",
                    guides,
                )
                for past in ("", "seen_")
                for guides in [{guide: past + guide for guide in (*GUIDES, DEPTH)}]
            },
            SUN: (encode_signed, "unit direction in world space towards the sun"),
            DIRECT: (encode_color, LIT_FORMULA),
            SEEN_DIRECT: (encode_color, PAST + LIT_FORMULA),
        }
    ),
}
"""Every feature that a model may use. Those of what is seen past mirrors and glass are encoded as those of
the first hit are, by the same scales; smoothed colour is guided by the one or the other."""


def check_features(features: Sequence[str]) -> None:
    """Refuse feature names that are unknown, repeated or none."""
    for name in features:
        if name not in FEATURES:
            raise InputError("feature", name, "unknown", choice(name, FEATURES))
    if not features or len(set(features)) != len(features):
        rule = "must be at least one, each once"
        raise InputError("features", ", ".join(features), rule, f"choose some of {', '.join(FEATURES)}")


def check_normalization(normalization: Normalization) -> None:
    """Refuse scales that are not finite, or not positive where they divide."""
    for name in ("exposure_stops", "depth_scale", "position_scale"):
        value = getattr(normalization, name)
        least, most = NORMALIZATION_LIMITS[name]
        if not least <= value <= most:
            raise InputError(
                name, value, f"must be from {least:g} to {most:g}", "use normalization_of(frames)"
            )
    center = normalization.position_center
    if len(center) != 3 or not all(abs(value) <= LARGEST_SCALE for value in center):
        rule = f"must be three finite numbers of at most {LARGEST_SCALE:g} in magnitude"
        raise InputError("position_center", center, rule, "use normalization_of(frames)")


def normalization_from_json(text: str) -> Normalization:
    """Return the normalization written in `text`, or say what is wrong with it."""
    normalization: Normalization = to_value(Normalization, text, "normalization", "train the model again")
    check_normalization(normalization)
    return normalization


def channels_of(features: Sequence[str]) -> int:
    """Return the number of channels of a feature image."""
    return sum(FEATURES[name].channels for name in features)


def n_inputs(features: Sequence[str], window: Window) -> int:
    """Return D_in, the length of a window vector."""
    return window.size * window.size * channels_of(features)


def normalization_of(frames: Sequence[Frame], exposure_stops: float = 0.0) -> Normalization:
    """Measure the scales: the farthest depth, and the cube around positions that are not exactly 0.

    Those of what is seen past mirrors and glass count where a frame has them. Along an axis the cube ends at
    Tukey's fences, where positions go beyond them (Exploratory Data Analysis, 1977).
    """
    depths = _layers(frames, "depth", "seen_depth")
    far = max((float(np.max(d, initial=0.0, where=d < FARTHEST_DEPTH)) for d in depths), default=0.0)
    points = (p.reshape(-1, 3).astype(np.float64) for p in _layers(frames, "position", "seen_position"))
    hits = [each[np.any(each != 0.0, axis=-1)] for each in points]
    axes = np.array([_reach([points[:, axis] for points in hits]) for axis in range(3)])
    x, y, z = (float(value) for value in axes.mean(axis=1))
    extent = float((axes[:, 1] - axes[:, 0]).max()) / 2
    return Normalization(exposure_stops, far if far > 0 else 1.0, (x, y, z), extent if extent > 0 else 1.0)


def _reach(parts: Sequence[Array]) -> tuple[float, float]:
    """Return the least and the largest of all numbers, or Tukey's fences where numbers are beyond them."""
    numbers = np.concatenate(parts) if parts else np.zeros(0)
    if not len(numbers):
        return 0.0, 0.0
    # Quartiles are numbers that occur, not means of two: nothing is rounded.
    at = (len(numbers) - 1) // 4
    ends = [0, at, len(numbers) - 1 - at, len(numbers) - 1]
    low, first, third, high = (float(number) for number in np.partition(numbers, ends)[ends])
    return max(low, first - FENCES * (third - first)), min(high, third + FENCES * (third - first))


def _layers(frames: Sequence[Frame], *names: str) -> list[Array]:
    """Return the layers (H, W, C) of these names that frames have."""
    return [frame[name] for frame in frames for name in names if name in frame.layers]


def feature_image(frame: Frame, features: Sequence[str], normalization: Normalization) -> NDArray[np.float32]:
    """Encode the features in float64, round once to float32, join them in the order of names: (H, W, C)."""
    check_features(features)
    encoded = [_encoded(frame, FEATURES[name], normalization) for name in features]
    return np.concatenate(encoded, axis=-1).astype(np.float32)


def encode_sums(
    sums: Mapping[str, Any],
    samples: Any,
    features: Sequence[str],
    normalization: Normalization,
    whole: bool = False,
    rays: int = 0,
) -> dict[str, Any]:
    """Return encoded features (..., channels) by name, from layers (..., channels) summed over the samples.

    With `rays` the layers but the colour are sums over so many camera rays. That is what a renderer's kernel
    holds before it is read back; may be traced. The last clip changes nothing but what rounding has put
    outside the range that a feature promises. `whole`: for a network of integers [whole.py].
    """
    encoded = {}
    for feature in (FEATURES[name] for name in features):
        if feature.guides:
            raise InputError("feature", feature.name, "computed from a pixel's own sums", "use feature_image")
        count = rays if rays and feature.layer != "color" else samples
        values = feature.encode(sums[feature.layer] / count, normalization)
        clipped = np.clip(values, feature.low, feature.high)
        encoded[feature.name] = steps_of(clipped) if whole else clipped
    return encoded


def _encoded(frame: Frame, feature: Feature, normalization: Normalization) -> Array:
    """Return one encoded feature (H, W, channels) in float64."""
    values, *others = (known(frame[layer].astype(np.float64)) for layer in feature.layers)
    if feature.guides:
        guides = dict(zip(feature.guides, others, strict=True))
        values = smooth(dimmed(values, normalization.exposure_stops), guides, LEVELS)
    return feature.encode(values, normalization)


def known(values: Array) -> Array:
    """Return the values (...) with 0 for NaN, as where nothing is hit; encodings clip infinities."""
    return np.where(np.isnan(values), 0.0, values)


def target_image(reference: Frame, normalization: Normalization) -> NDArray[np.float32]:
    """Return the colours (H, W, 3) to learn: the reference's, encoded as the color feature is.

    What is not a number is refused here: it would be learned.
    """
    check_finite("layer 'color' of the reference", reference["color"])
    return feature_image(reference, ("color",), normalization)


@dataclass(frozen=True)
class Dataset:
    """Padded feature images and targets of all frames, end to end.

    `values` (P * C,) and `targets` (all pixels, 3); per frame (F,): `start_px` of its padded image in
    `values`, `row_px` of that image, `first` row of its targets; `shapes` are the (H, W) of the frames.
    """

    values: NDArray[np.float32]
    targets: NDArray[np.float32]
    start_px: Indices
    row_px: Indices
    first: Indices
    shapes: tuple[tuple[int, int], ...]
    channels: int
    window: Window

    @property
    def digest(self) -> str:
        """Return a SHA-256 of everything that training sees, in hexadecimal."""
        text = repr((self.shapes, self.channels, self.window.size)).encode()
        return hashlib.sha256(text + self.values.tobytes() + self.targets.tobytes()).hexdigest()


def build(
    pairs: Sequence[tuple[Frame, Frame]],
    features: Sequence[str],
    window: Window,
    normalization: Normalization,
    mapped: Callable[..., Iterable[Any]] = map,
) -> Dataset:
    """Lay out the examples of (noisy, reference) pairs; sizes may differ. `mapped` does what `map` does."""
    _check_pairs(pairs)
    images = list(mapped(lambda pair: pad(feature_image(pair[0], features, normalization), window), pairs))
    targets = [target_image(reference, normalization).reshape(-1, 3) for _, reference in pairs]
    return Dataset(
        values=np.concatenate([image.reshape(-1) for image in images]),
        targets=np.concatenate(targets),
        start_px=_starts([image.shape[0] * image.shape[1] for image in images]),
        row_px=np.array([image.shape[1] for image in images], np.int64),
        first=_starts([len(target) for target in targets]),
        shapes=tuple((noisy.height, noisy.width) for noisy, _ in pairs),
        channels=channels_of(features),
        window=window,
    )


def _check_pairs(pairs: Sequence[tuple[Frame, Frame]]) -> None:
    """Refuse no pairs, pairs whose pictures differ in size, and noisy frames with what is not a number."""
    if not pairs:
        raise InputError("training pairs", NO_VALUE, "missing", "give a noisy frame and its reference")
    for index, (noisy, reference) in enumerate(pairs):
        for name, values in noisy.layers.items():
            check_finite(f"pair {index}: layer {name!r}", values)
        sizes = [f"{frame.width}x{frame.height}" for frame in (noisy, reference)]
        if sizes[0] != sizes[1]:
            raise InputError(
                f"training pair {index}: sizes of noisy and reference frame",
                " and ".join(sizes),
                "must be equal",
                "render both at the same size",
            )


def _starts(lengths: Sequence[int]) -> Indices:
    """Return where each of several runs begins when they follow one another."""
    return np.cumsum([0, *lengths[:-1]], dtype=np.int64)


def examples_at(dataset: Dataset, frame: Indices, y: Indices, x: Indices) -> tuple[Array, Array]:
    """Return window vectors (N, D_in) and target colours (N, 3) of pixels given as frame, y, x (N,)."""
    corner, row_px, target = places_of(dataset, frame, y, x)
    windows = gathered(dataset.values, corner, row_px, dataset.channels, dataset.window.size)
    return windows, dataset.targets[target]


def places_of(dataset: Dataset, frame: Indices, y: Indices, x: Indices) -> tuple[Indices, Indices, Indices]:
    """Return the places of the examples of pixels frame, y, x (N,), each (N,).

    The pixel of `values` at the window's first corner, pixels from row to row there, the row of `targets`.
    """
    row_px = dataset.row_px[frame]
    width = row_px - dataset.window.size + 1
    return dataset.start_px[frame] + y * row_px + x, row_px, dataset.first[frame] + y * width + x


def sample_pixels(
    seed: int, stream: int, count: int, shapes: Sequence[tuple[int, int]]
) -> tuple[Indices, Indices, Indices]:
    """Draw frame, y, x (count,) uniformly, with replacement, from all pixels of frames of `shapes` (H, W)."""
    sizes = [height * width for height, width in shapes]
    index = sample_indices(seed, stream, PIXEL_TAG, count, sum(sizes))
    first = _starts(sizes)
    frame = np.searchsorted(first, index, side="right") - 1
    width = np.array([width for _, width in shapes], np.int64)[frame]
    y, x = np.divmod(index - first[frame], width)
    return frame, y, x


def sample_indices(seed: int, stream: int, tag: int, count: int, n: int) -> Indices:
    """Draw (count,) integers in [0, n), with replacement: floor(word n / 2**32), n < 2**31.

    Number i of a stream is made of word i % 4 of the block (seed, i // 4, stream, tag).
    """
    blocks = counter(np.arange((count + 3) // 4))
    words = np.stack(random_block(counter(seed), blocks, counter(stream), counter(tag)), axis=-1)
    scaled = words.reshape(-1)[:count].astype(np.uint64) * np.uint64(n)
    return (scaled >> np.uint64(32)).astype(np.int64)
