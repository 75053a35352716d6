"""Kinds of images: features, windows at borders, draws of pixels, metrics.

Features and metrics are computed in float64 (DAT-3, MET-1): their bounds are roundings of float64, and of the
one rounding to float32. u = 2^-53 and gamma(n) = n u / (1 - n u) for n roundings, Higham, "Accuracy and
Stability of Numerical Algorithms", 2002, section 3.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl import metrics, rng
from ....refimpl.errors import InputError
from ....refimpl.frame import LAYERS, USUAL, Frame, validate
from ....refimpl.network import dataset
from ....refimpl.network.dataset import Normalization, Window
from ..case import Case, Kind, Output, exact
from . import smoothing
from .smoothing import UNIT, Layers, single
from .tables import kind, table

Array = NDArray[Any]

ENCODED = "one rounding to float32 after float64, whose own errors may turn it: one ulp of numbers up to 1"
"""Where the bounds of features come from."""

ULP = 2.0**-23
"""One ulp of float32 numbers up to 1, and more of smaller ones."""


def noise(index: int, shape: tuple[int, ...]) -> Array:
    """Return uniform numbers (...) in [0, 1), the same on every machine."""
    count = int(np.prod(shape))
    blocks = rng.counter(np.arange(-(-count // 4)))
    found = rng.uniforms(rng.counter(31), blocks, rng.counter(index), rng.counter(0), np.float64)
    return np.stack(found, axis=-1).reshape(-1)[:count].reshape(shape)


# ---- features ---------------------------------------------------------------------------------------------


def frame_of(layers: Mapping[str, Any]) -> Frame:
    """Return a frame from layers that came as JSON numbers."""
    return Frame({name: np.asarray(values, np.float64) for name, values in layers.items()})


def normalization_of(inputs: Mapping[str, Any]) -> Normalization:
    """Return the scales of a case."""
    x, y, z = (float(value) for value in inputs["position_center"])
    stops, depth, position = (
        float(inputs[name]) for name in ("exposure_stops", "depth_scale", "position_scale")
    )
    return Normalization(stops, depth, (x, y, z), position)


def _features(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the feature image."""
    frame = frame_of({name: inputs[name] for name in LAYERS if name in inputs})
    validate(frame, finite=False)
    names = tuple(str(inputs["features"]).split(","))
    return {"image": dataset.feature_image(frame, names, normalization_of(inputs))}


def bad_layers(height: int, width: int, index: int) -> dict[str, Array]:
    """Return the layers of a small frame with NaN, infinities, negatives and a firefly."""
    layers = {
        name: single(noise(index + i, (height, width, layer.channels)) * 1.5 - 0.25)
        for i, (name, layer) in enumerate((name, LAYERS[name]) for name in USUAL)
    }
    flat = layers["color"].reshape(-1)
    flat[:6] = (np.nan, np.inf, -np.inf, 1e6, -3.0, 0.0)
    layers["normal"].reshape(-1)[:2] = (np.nan, 7.0)
    layers["depth"].reshape(-1)[:3] = (np.nan, np.inf, -1.0)
    return layers


ROWS = table("images")
"""Scales, features, windows, draws and pictures of the cases, which are data: each row ends with its note."""

SCALES, OTHER_SCALES, FAR_SCALES = (
    {name: np.array(value) if isinstance(value, list) else value for name, value in row.items()}
    for row in ROWS["scales"]
)
"""Scales of the cases; others that lead beyond what features are clipped to; and some with a centre whose
encoded position is far from 0."""

ENDS = (np.nan, -np.inf, np.inf, 0.0, -1e30, 1e30)
"""Numbers of which a layer may hold any, and what each is clipped to tells nothing of the others."""


def ends_of(layer: str, turn: int = 0) -> Array:
    """Return a layer (2, 3, channels) that has every one of `ENDS` in each channel, in turn."""
    channels = LAYERS[layer].channels
    return np.stack([np.roll(ENDS, turn + channel).reshape(2, 3) for channel in range(channels)], axis=-1)


def _layers_of(names: str, shape: tuple[int, int]) -> dict[str, Array]:
    """Return the layers of features, with numbers from -0.5 to 2.5."""
    layers = [layer for name in names.split(",") for layer in dataset.FEATURES[name].layers]
    return {
        layer: single(noise(80 + i, (*shape, LAYERS[layer].channels)) * 3.0 - 0.5)
        for i, layer in enumerate(dict.fromkeys(layers))
    }


PLAIN = ("other scales", "two of one layer")
"""Notes of those whose refusal is blamed on their clause."""


def _feature_rows() -> Iterator[tuple[str, str, bool, str, Layers, dict[str, Any]]]:
    """Yield clause, note, whether it is valid, features, layers and scales of feature images.

    Those of a frame with bad pixels first; then other features, each with its limits, and what is refused."""
    layers = bad_layers(2, 3, 50)
    for names, clause, note, bad in ROWS["features"]:
        wanted = {layer for name in names.split(",") for layer in dataset.FEATURES[name].layers}
        shown = {n: v if bad else v[1:] for n, v in layers.items() if n in wanted}  # bad ones are in row 0
        yield clause, note, True, names, shown, SCALES
    all_of = ("position", "depth", "color", "unshadowed", "normal")
    shown = {name: v for name, v in bad_layers(3, 2, 60).items() if name in all_of}
    shown["normal"] = single(-1.5 * shown["normal"])
    yield "DAT-1", PLAIN[0], True, ",".join(all_of), shown, OTHER_SCALES
    shown = {name: layers[name][1:] for name in ("color", "depth")}
    yield "DAT-1", PLAIN[1], True, "highlights,depth,color", shown, SCALES
    for names, note in ROWS["wrong_features"][:3]:
        yield "DAT-9", note, False, names, {"color": layers["color"]}, SCALES
    for feature in dataset.FEATURES.values():
        if not feature.guides:
            note = "NaN is 0 before it is encoded, infinities are the ends of the range"
            yield "DAT-10", note, True, feature.name, {feature.layer: ends_of(feature.layer)}, FAR_SCALES
    for names, note in ROWS["later_features"]:
        yield "DAT-1", note, True, names, _layers_of(names, (2, 2)), OTHER_SCALES
    color = {"color": single(noise(90, (2, 3, 3)))}
    for names, note in ROWS["wrong_features"][3:]:
        more = {"depth": single(noise(91, (2, 3, 1)))} if "depth," in names else {}
        yield "DAT-9", note, False, names, {**color, **more}, SCALES
    for layer, shape, note in ROWS["wrong_layers"]:
        yield "FRM-5", note, False, f"color,{layer}", {**color, layer: np.full(shape, 0.5)}, SCALES
    for clause, note, names, guided, stops in smoothing.feature_rows():
        yield clause, note, True, names, guided, {**SCALES, "exposure_stops": stops}
    for note, names, guided in smoothing.missing_rows():
        yield "DAT-9", note, False, names, guided, SCALES


def _feature_cases() -> list[Case]:
    """Return feature images, and what is refused."""
    cases: list[Case] = []
    for clause, note, valid, names, layers, scales in _feature_rows():
        inputs = {**layers, "features": names, **scales}
        expected = {"image": Output(_features(inputs)["image"], ULP, ENCODED)} if valid else None
        # A program that knows no feature refuses the first one; later ones have other layers.
        refusal = "" if not valid or note in PLAIN else "FRM-5" if cases else "DAT-9"
        cases.append(Case(clause, inputs, expected, note, refusal))
    return cases


# ---- windows ----------------------------------------------------------------------------------------------


def _window(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the window vector of a pixel; the reference's own function leaves its place to the caller."""
    window, image = Window(int(inputs["size"]), str(inputs["border"])), inputs["image"]
    dataset.check_window(window)
    if not isinstance(image, np.ndarray) or image.ndim != 3 or image.dtype.kind != "i" or not image.size:
        rule = "must be integers [H][W][C], none of the three 0"
        raise InputError("image", getattr(image, "shape", image), rule, "see the format page of this kind")
    for name, sides in (("x", image.shape[1]), ("y", image.shape[0])):
        if not 0 <= inputs[name] < sides:
            rule = f"the image has the pixels 0 to {sides - 1} on this axis"
            raise InputError(name, int(inputs[name]), rule, "ask for a pixel of the image")
    x, y = (np.array([int(inputs[name])]) for name in ("x", "y"))
    return {"window": dataset.windows_at(image, y, x, window)[0]}


def _window_cases() -> list[Case]:
    """Return windows; channel c of the pixel (x, y) holds 100 y + 10 x + c, or 0 if it is refused."""
    cases = []
    for clause, refusal, height, width, size, border, x, y, note in ROWS["windows"]:
        row, column, channel = np.indices((height, width, 2 if size < 12 and refusal else 1))
        image = (100 * row + 10 * column + channel) * (note != "the largest window" and refusal is not None)
        inputs = {"image": image, "size": size, "border": border, "x": x, "y": y}
        expected = exact(_window(inputs)) if refusal is not None else None
        cases.append(Case(clause, inputs, expected, note, refusal or ""))
    return cases


# ---- draws ------------------------------------------------------------------------------------------------


def _draws(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return frame, row and column of draws."""
    shapes = [(int(h), int(w)) for h, w in np.asarray(inputs["shapes"])]
    seed, stream, count = (int(inputs[name]) for name in ("seed", "stream", "count"))
    found = dataset.sample_pixels(seed, stream, count, shapes)
    return dict(zip(("frame", "y", "x"), found, strict=True))


def _draw_cases() -> list[Case]:
    """Return draws from one frame and from several."""
    given = [dict(zip(("seed", "stream", "count", "shapes"), row, strict=True)) for row in ROWS["draws"]]
    given = [{**inputs, "shapes": np.array(inputs["shapes"])} for inputs in given]
    return [Case("DAT-8", inputs, exact(_draws(inputs))) for inputs in given]


# ---- metrics ----------------------------------------------------------------------------------------------


def gamma(n: int) -> float:
    """Return the largest relative error of n roundings in float64."""
    return n * UNIT / (1.0 - n * UNIT)


def _sum_bound(value: float, count: int) -> float:
    """Terms of one sign: each has at most 8 roundings, their mean count more."""
    return gamma(count + 8) * value


def _psnr_bound(value: float, count: int) -> float:
    """10 / ln 10 times the relative error of the MSE; logarithm and product to 4 ulp."""
    return 0.0 if math.isinf(value) else 10.0 / math.log(10.0) * gamma(count + 10) + 8.0 * UNIT * abs(value)


def _blur_bound(value: float, count: int) -> float:
    """Return the bound of a root of a mean: differences of numbers up to 4 after two blurs, 49 taps each."""
    return 4.0 * gamma(count + 2 * 60)


def _ssim_bound(value: float, count: int, largest: float = 1.0) -> float:
    """Means of 121 products lose gamma(32) of the squares' size; the least denominator is c2 = 9e-4.

    Numerator and denominator of the structure each are off by 4 gamma(32) largest^2, and the quotient by the
    sum of both over c2; the luminance by less. Windows are averaged.
    """
    return 16.0 * gamma(32) * largest**2 / (metrics.K2**2) + gamma(count + 8)


Bound = Callable[[float, int], float]

METRICS: Mapping[str, tuple[str, Callable[[Array, Array], float], Bound]] = {
    "mse": ("MET-3", metrics.mse, _sum_bound),
    "psnr": ("MET-4", metrics.psnr, _psnr_bound),
    "ssim": ("MET-5", metrics.ssim, _ssim_bound),
    "relmse": ("MET-6", metrics.relmse, _sum_bound),
    "smape": ("MET-7", metrics.smape, _sum_bound),
    "blurred": ("MET-10", metrics.blurred, _blur_bound),
}
"""Clause, function and bound of each metric."""

SHAPE = (13, 12, 3)
"""Shape of the pictures that are compared."""


def _pictures() -> dict[str, Array]:
    """Return a reference, pictures near it, and one of fireflies, all in float32."""
    y, x, c = np.indices(SHAPE)
    reference = single(0.5 + 0.4 * np.sin(0.7 * x + 0.3 * y * y + c))
    return {
        "reference": reference,
        "noisy": single(np.clip(reference + 0.2 * (noise(70, SHAPE) - 0.5), 0.0, 1.0)),
        "near": single(reference + 2.0**-20 * noise(71, SHAPE)),
        "flat": np.full(SHAPE, 0.25),
    }


def files() -> dict[str, bytes]:
    """Return the pictures as files."""
    return {f"images/{name}.f32": values.astype("<f4").tobytes() for name, values in _pictures().items()}


def _in_file(name: str) -> dict[str, Any]:
    """Return the input that names a picture."""
    return {"file": f"images/{name}.f32", "shape": list(SHAPE)}


def _metric_cases(name: str) -> list[Case]:
    """Return the cases of a metric."""
    clause, function, bound = METRICS[name]
    pictures, cases = _pictures(), list[Case]()

    def add(image: Any, reference: Any, value: float | None, note: str, rule: str = clause) -> None:
        text = "roundings of float64, any order"
        expected = (
            None if value is None else {"value": Output(value, bound(value, int(np.prod(SHAPE))), text)}
        )
        inputs = {"image": image, "reference": reference}
        refusal = "" if value is None else "MET-1"
        cases.append(Case(rule, inputs, expected, note, refusal))

    for image, reference, note in ROWS["pairs"]:
        add(_in_file(image), _in_file(reference), function(pictures[image], pictures[reference]), note)
    for note, *small in ROWS["small"]:
        left, right = map(np.array, small)
        valid = name != "ssim" and (name != "blurred" or left.ndim == 3)
        why = note if valid else "two axes" if name == "blurred" else "smaller than a window"
        add(left, right, function(left, right) if valid else None, why)
    if name == "ssim":
        left, right = pictures["noisy"][:11, :11, :1], pictures["reference"][:11, :11, :1]
        add(left, right, function(left, right), "exactly a window")
        add(left[:10], right[:10], None, "a row less than a window")
        add(left[:, :10], right[:, :10], None, "a column less than a window")
        add(left[..., 0], right[..., 0], None, "two axes")
    one = np.full((1, 1, 3), 0.5)
    add(one, np.full((1, 2, 3), 0.5), None, "other shapes", "MET-1")
    add(one[:0, 0, 0], one[:0, 0, 0], None, "no number", "MET-1")
    for value in (np.nan, np.inf):
        add(np.where(one > 0, [value, 0.5, 0.5], one), one, None, f"{value} in a picture", "MET-1")
    more = 1 if name != "ssim" else metrics.WINDOW_SIZE_PX
    for shape, other, note in ROWS["shapes"]:
        add(np.full(shape, 0.5), np.full(other, 0.5), None, note, "MET-1")
    square = np.full((more, more, 1), 0.5)
    for value in (np.nan, -np.inf):
        bad = square.copy()
        bad[-1, -1] = value
        add(square, bad, None, f"{value} in a reference", "MET-1")
    add(bad, bad, None, "-inf in both, at the same place", "MET-1")
    if name == "mse":
        whole = _in_file("reference")
        for sides, note in ROWS["sizes"]:
            add({**whole, "shape": sides}, {**whole, "shape": sides}, None, note, "RDG-4")
        add(square.tolist(), [[[0.5], [0.5]], [[0.5]]], None, "rows of two lengths", "MET-1")
    return cases


def _metric(name: str) -> Kind:
    """Return the kind of a metric."""
    function = METRICS[name][1]
    return kind(
        f"metric.{name}",
        lambda: _metric_cases(name),
        lambda inputs: {"value": function(inputs["image"], inputs["reference"])},
        files,
    )


KINDS = (
    kind("image.features", _feature_cases, _features),
    kind("image.window", _window_cases, _window),
    kind("image.draws", _draw_cases, _draws),
    *map(_metric, METRICS),
)
"""The kinds of this module."""
