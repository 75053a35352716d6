"""Kinds of images: features, windows at borders, draws of pixels, metrics.

Features and metrics are computed in float64 (DAT-3, MET-1): their bounds are roundings of float64, and of the
one rounding to float32. u = 2^-53 and gamma(n) = n u / (1 - n u) for n roundings, Higham, "Accuracy and
Stability of Numerical Algorithms", 2002, section 3.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl import metrics, rng
from ....refimpl.errors import InputError
from ....refimpl.frame import LAYERS, USUAL, Frame, validate
from ....refimpl.network import dataset
from ....refimpl.network.dataset import Normalization, Window
from ..case import Case, Kind, Output
from . import smoothing

Array = NDArray[Any]

UNIT = 2.0**-53
"""Unit roundoff of float64."""

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


def single(values: Any) -> Array:
    """Return numbers (...) rounded to float32, in float64."""
    return np.asarray(values, np.float32).astype(np.float64)


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


SCALES = {
    "exposure_stops": 0.5,
    "depth_scale": 0.75,
    "position_center": np.array([0.25, -0.5, 0.5]),
    "position_scale": 0.5,
}
"""The scales of the cases."""

OTHER_SCALES = {
    "exposure_stops": -1.5,
    "depth_scale": 0.375,
    "position_center": np.array([-0.75, 0.5, 0.25]),
    "position_scale": 2.25,
}
"""Scales that lead beyond what features are clipped to."""

FEATURE_ROWS = (
    *((name, "DAT-1", "scales and clips", False) for name in dataset.FEATURES if name in USUAL),
    ("position,color", "DAT-3", "features in the order in which they are named", False),
    ("color", "DAT-10", "NaN is 0, infinities and fireflies are clipped", True),
    ("normal,depth", "DAT-10", "NaN is 0, what is out of range is clipped", True),
    ("albedo,position,direction", "DAT-10", "NaN is 0, what is out of range is clipped", True),
)
"""Features of the cases, clause, note, and whether pixels are bad."""


ENDS = (np.nan, -np.inf, np.inf, 0.0, -1e30, 1e30)
"""Numbers of which a layer may hold any, and what each is clipped to tells nothing of the others."""

FAR_SCALES = {
    "exposure_stops": -3.0,
    "depth_scale": 4.0,
    "position_center": np.array([1.0, 2.0, 3.0]),
    "position_scale": 8.0,
}
"""Scales with a centre that is not 0: what counts as a position of 0 is encoded as another number."""


def ends_of(layer: str, turn: int = 0) -> Array:
    """Return a layer (2, 3, channels) that has every one of `ENDS` in each channel, in turn."""
    channels = LAYERS[layer].channels
    return np.stack([np.roll(ENDS, turn + channel).reshape(2, 3) for channel in range(channels)], axis=-1)


def _end_cases(first: int) -> list[Case]:
    """Return each feature of one pixel's layers where these are NaN, infinite or huge, with either sign."""
    cases: list[Case] = []
    for feature in dataset.FEATURES.values():
        if not feature.guides:
            inputs = {feature.layer: ends_of(feature.layer), "features": feature.name, **FAR_SCALES}
            expected = {"image": Output(_features(inputs)["image"], ULP, ENCODED)}
            note = "NaN is 0 before it is encoded, infinities are the ends of the range"
            name = f"image.features/{first + len(cases)}"
            cases.append(Case(name, "DAT-10", inputs, expected, (), note, "FRM-5"))
    return cases


def _layers_of(names: str, shape: tuple[int, int]) -> dict[str, Array]:
    """Return the layers of features, with numbers from -0.5 to 2.5."""
    layers = [layer for name in names.split(",") for layer in dataset.FEATURES[name].layers]
    return {
        layer: single(noise(80 + i, (*shape, LAYERS[layer].channels)) * 3.0 - 0.5)
        for i, layer in enumerate(dict.fromkeys(layers))
    }


LATER_ROWS = (
    ("seen_albedo,seen_normal,seen_depth,seen_position", "what is seen past mirrors and glass"),
    ("seen_depth,depth,seen_position,position", "by the same scales as the first hit"),
    ("history_weight,history,color", "the pictures before"),
    ("albedo,seen_emission,unshadowed", "what is seen emits light of its own"),
)
"""Features that came later, with notes."""

WRONG_LAYERS: tuple[tuple[str, tuple[int, ...], str], ...] = (
    ("albedo", (3, 2, 3), "a layer of as many pixels and another size"),
    ("albedo", (1, 3, 3), "a layer of fewer rows"),
    ("albedo", (1, 1, 3), "a layer of one pixel beside larger ones"),
    ("albedo", (2, 3, 1), "a layer of one channel for three"),
    ("albedo", (2, 3, 4), "a layer of four channels for three"),
    ("albedo", (2, 9), "a layer of two axes"),
)
"""Layers beside a colour of 2 x 3 pixels that do not go with it."""


def _later_feature_cases(first: int) -> list[Case]:
    """Return other features, each with its limits, and more that is refused."""
    cases = _end_cases(first)

    def add(clause: str, inputs: Mapping[str, Any], valid: bool, note: str) -> None:
        expected = {"image": Output(_features(inputs)["image"], ULP, ENCODED)} if valid else None
        name = f"image.features/{first + len(cases)}"
        cases.append(Case(name, clause, inputs, expected, (), note, "FRM-5" if valid else ""))

    for names, note in LATER_ROWS:
        inputs = {**_layers_of(names, (2, 2)), "features": names, **OTHER_SCALES}
        add("DAT-1", inputs, True, note)
    color = {"color": single(noise(90, (2, 3, 3)))}
    for names, note in (("", "no feature"), ("color,", "a feature without a name"), (" color", "a space")):
        add("DAT-9", {**color, "features": names, **SCALES}, False, note)
    apart = {**color, "depth": single(noise(91, (2, 3, 1)))}
    add(
        "DAT-9",
        {**apart, "features": "color,depth,color", **SCALES},
        False,
        "a feature twice, another between",
    )
    for names in ("seen_depth", "history", "highlights,normal"):
        add("DAT-9", {**color, "features": names, **SCALES}, False, f"a layer of {names} is missing")
    for layer, shape, note in WRONG_LAYERS:
        inputs = {**color, layer: np.full(shape, 0.5), "features": f"color,{layer}", **SCALES}
        add("FRM-5", inputs, False, note)
    for clause, note, names, layers, stops in smoothing.feature_rows():
        add(clause, {**layers, "features": names, **SCALES, "exposure_stops": stops}, True, note)
    for note, names, layers in smoothing.missing_rows():
        add("DAT-9", {**layers, "features": names, **SCALES}, False, note)
    return cases


def _feature_cases() -> list[Case]:
    """Return feature images of a frame with bad pixels; one without a needed layer is refused."""
    cases: list[Case] = []
    layers = bad_layers(2, 3, 50)
    for names, clause, note, bad in FEATURE_ROWS:
        wanted = {layer for name in names.split(",") for layer in dataset.FEATURES[name].layers}
        shown = {n: v if bad else v[1:] for n, v in layers.items() if n in wanted}  # bad ones are in row 0
        inputs = {**shown, "features": names, **SCALES}
        expected = {"image": Output(_features(inputs)["image"], ULP, ENCODED)}
        # A program that knows no feature refuses the first one; later ones have other layers.
        refusal = "FRM-5" if cases else "DAT-9"
        cases.append(Case(f"image.features/{len(cases)}", clause, inputs, expected, (), note, refusal))
    all_of = ("position", "depth", "color", "unshadowed", "normal")
    shown = {name: v for name, v in bad_layers(3, 2, 60).items() if name in all_of}
    shown["normal"] = single(-1.5 * shown["normal"])
    names = ",".join(all_of)
    inputs = {**shown, "features": names, **OTHER_SCALES}
    expected = {"image": Output(_features(inputs)["image"], ULP, ENCODED)}
    cases.append(Case(f"image.features/{len(cases)}", "DAT-1", inputs, expected, (), "other scales"))
    names = "highlights,depth,color"
    shown = {name: layers[name][1:] for name in ("color", "depth")}
    expected = {"image": Output(_features({**shown, "features": names, **SCALES})["image"], ULP, ENCODED)}
    inputs = {**shown, "features": names, **SCALES}
    cases.append(Case(f"image.features/{len(cases)}", "DAT-1", inputs, expected, (), "two of one layer"))
    for names, note in (
        ("color,depth", "a layer is missing"),
        ("color,color", "a feature twice"),
        ("colour", "an unknown feature"),
    ):
        inputs = {"color": layers["color"], "features": names, **SCALES}
        cases.append(Case(f"image.features/{len(cases)}", "DAT-9", inputs, None, (), note))
    return [*cases, *_later_feature_cases(len(cases))]


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


WINDOW_ROWS = (
    (4, 4, 3, "clamp", 1, 2, "taps row by row, channels together"),
    (3, 4, 3, "clamp", 0, 0, "odd, upper left corner"),
    (3, 4, 3, "zero", 3, 2, "odd, lower right corner, zeros"),
    (5, 5, 4, "clamp", 2, 2, "even: two taps before the pixel, one after it"),
    (5, 5, 4, "zero", 0, 4, "even, lower left corner"),
    (2, 3, 6, "clamp", 1, 1, "an image smaller than the window"),
    (1, 1, 3, "clamp", 0, 0, "an image of one pixel"),
    (1, 4, 2, "zero", 0, 0, "an image of one row"),
    (4, 4, 1, "clamp", 1, 2, "a window of one pixel"),
    (13, 13, 12, "clamp", 6, 6, "the window of the paper"),
    (7, 12, 9, "clamp", 10, 1, "odd, above 8"),
    (11, 5, 11, "zero", 1, 8, "odd, above 8, zeros"),
    (3, 9, 8, "zero", 8, 0, "even, upper right corner"),
    (4, 3, 5, "clamp", 2, 3, "odd, lower right corner, clamped"),
)
"""Height, width, size, border, x, y and note of the cases."""


def _window_cases() -> list[Case]:
    """Return windows; channel c of the pixel (x, y) holds 100 y + 10 x + c."""
    cases: list[Case] = []
    for height, width, size, border, x, y, note in WINDOW_ROWS:
        row, column, channel = np.indices((height, width, 2 if size < 12 else 1))
        image = 100 * row + 10 * column + channel
        inputs = {"image": image, "size": size, "border": border, "x": x, "y": y}
        expected = {"window": Output(_window(inputs)["window"])}
        clause = (
            "DAT-5" if "corner" in note or "an image" in note else "DAT-6" if "taps row" in note else "DAT-4"
        )
        cases.append(Case(f"image.window/{len(cases)}", clause, inputs, expected, (), note, "DAT-9"))
    image = np.zeros((2, 2, 1), np.int64)
    for size, border in ((0, "clamp"), (65, "clamp"), (3, "mirror"), (-1, "zero"), (2, "")):
        inputs = {"image": image, "size": size, "border": border, "x": 0, "y": 0}
        cases.append(Case(f"image.window/{len(cases)}", "DAT-9", inputs, None, (), f"{size}, {border}"))
    inputs = {"image": image, "size": 64, "border": "zero", "x": 0, "y": 1}
    expected = {"window": Output(_window(inputs)["window"])}
    cases.append(Case(f"image.window/{len(cases)}", "DAT-9", inputs, expected, (), "the largest window"))
    for border, x, y in OUTSIDE:
        inputs = {"image": np.zeros((2, 3, 1), np.int64), "size": 3, "border": border, "x": x, "y": y}
        note = f"the window of the pixel ({x}, {y}) of an image of 3 x 2 pixels"
        cases.append(Case(f"image.window/{len(cases)}", "DAT-9", inputs, None, (), note))
    return cases


OUTSIDE = (
    *(("clamp", x, y) for x, y in ((3, 0), (0, 2), (-1, 0), (0, -1), (3, 2))),
    *(("zero", x, y) for x, y in ((3, 1), (2, 2), (-1, -1))),
)
"""Borders and pixels that the image does not have, the nearest ones: 2 is a column, and no row."""


# ---- draws ------------------------------------------------------------------------------------------------


def _draws(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return frame, row and column of draws."""
    shapes = [(int(h), int(w)) for h, w in np.asarray(inputs["shapes"])]
    seed, stream, count = (int(inputs[name]) for name in ("seed", "stream", "count"))
    found = dataset.sample_pixels(seed, stream, count, shapes)
    return dict(zip(("frame", "y", "x"), found, strict=True))


def _draw_cases() -> list[Case]:
    """Return draws from one frame and from several: large ones, and ones of a pixel, which have many ends."""
    cases: list[Case] = []
    rows = (
        (0, 0, 10, [(8, 8)]),
        (3, 19_999, 10, [(64, 64), (1, 7), (480, 640)]),
        (2**31 + 5, 2**31 + 70_000, 300, [(3, 5), (700, 300), (1, 1), (1, 60_000)]),
        (7, 4, 8, [(1, 1), (1, 1), (1, 2)]),
        (7, 5, 16, [(2, 1), (1, 2), (1, 1), (2, 2)]),
        (8, 0, 5, [(1, 1)] * 5),
        (9, 1, 1, [(1, 1)]),
        (10, 2, 12, [(32_768, 32_767), (32_767, 32_768)]),
    )
    for seed, stream, count, shapes in rows:
        inputs = {"seed": seed, "stream": stream, "count": count, "shapes": np.array(shapes)}
        expected = {name: Output(value) for name, value in _draws(inputs).items()}
        cases.append(Case(f"image.draws/{len(cases)}", "DAT-8", inputs, expected))
    return cases


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


PAIRS = (
    ("noisy", "reference", "a noisy picture"),
    ("near", "reference", "nearly equal: variances must be taken in float64"),
    ("reference", "reference", "equal"),
    ("flat", "flat", "equal and constant"),
    ("flat", "reference", "constant against structure"),
)
"""Pictures, references and notes."""


def _small() -> list[tuple[str, Array, Array]]:
    """Return small pictures given in the case itself: SSIM refuses them."""
    return [
        (
            "one pixel that differs by one bit",
            np.array([[[0.5, 0.5, 0.5]]]),
            np.array([[[0.5, 0.5, 0.5 + 2**-24]]]),
        ),
        ("negative and huge radiance", np.array([[[-2.0, 1e6, 0.0]]]), np.array([[[1.0, 1e-3, 0.0]]])),
        ("a negative reference", np.array([[[0.25, -0.5, -2.0]]]), np.array([[[-0.5, -0.75, 1.0]]])),
    ]


OTHER_SHAPES = (
    ((2, 1, 3), (1, 2, 3), "as many numbers, rows for columns"),
    ((1, 2, 3), (3, 2, 1), "as many numbers, axes exchanged"),
    ((1, 1, 6), (1, 2, 3), "as many numbers, more channels"),
    ((6,), (1, 2, 3), "as many numbers on one axis"),
    ((1, 1, 3), (1, 3), "the first axis is missing"),
    ((1, 1, 1), (1, 1, 3), "one channel against three"),
    ((2, 2, 3), (1, 1, 3), "pictures against a pixel"),
    ((2, 3, 3), (1, 3, 3), "rows against a row"),
)
"""Shapes of pictures that are not compared, and notes: as many numbers, or some that would repeat."""


OTHER_SIZES = (
    ([*SHAPE[:2], 2], "a file that is longer than its shape"),
    ([SHAPE[0] - 1, *SHAPE[1:]], "a file that has a row more"),
    ([SHAPE[0] + 1, *SHAPE[1:]], "a file that is shorter than its shape"),
    ([*SHAPE, 2], "a file of half of the numbers"),
)
"""Shapes that files of [`SHAPE`] do not have, and notes."""


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
        cases.append(Case(f"metric.{name}/{len(cases)}", rule, inputs, expected, (), note, refusal))

    for image, reference, note in PAIRS:
        add(_in_file(image), _in_file(reference), function(pictures[image], pictures[reference]), note)
    for note, left, right in _small():
        if name == "ssim":
            add(left, right, None, "smaller than a window")
        else:
            add(left, right, function(left, right), note)
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
    for shape, other, note in OTHER_SHAPES:
        add(np.full(shape, 0.5), np.full(other, 0.5), None, note, "MET-1")
    square = np.full((more, more, 1), 0.5)
    for value in (np.nan, -np.inf):
        bad = square.copy()
        bad[-1, -1] = value
        add(square, bad, None, f"{value} in a reference", "MET-1")
    add(bad, bad, None, "-inf in both, at the same place", "MET-1")
    if name == "mse":
        whole = _in_file("reference")
        for sides, note in OTHER_SIZES:
            add({**whole, "shape": sides}, {**whole, "shape": sides}, None, note, "RDG-4")
        add(square.tolist(), [[[0.5], [0.5]], [[0.5]]], None, "rows of two lengths", "MET-1")
    return cases


def _metric(name: str) -> Kind:
    """Return the kind of a metric."""
    return Kind(
        f"metric.{name}",
        f"The metric {name}",
        {"image": "float[H][W][C]", "reference": "float[H][W][C]"},
        {"value": "float; psnr in decibels, inf for equal pictures"},
        lambda: _metric_cases(name),
        lambda inputs: {"value": METRICS[name][1](inputs["image"], inputs["reference"])},
        files,
    )


LAYER_FIELDS = {name: f"float[H][W][{layer.channels}]" for name, layer in LAYERS.items()}
"""What the layers of a frame are, for the page."""

KINDS = (
    Kind(
        "image.features",
        "Layers of a frame to a feature image",
        {
            **LAYER_FIELDS,
            "features": "text, names with commas",
            "exposure_stops": "float",
            "depth_scale": "float",
            "position_center": "float[3]",
            "position_scale": "float",
        },
        {"image": "float[H][W][C], float32"},
        _feature_cases,
        _features,
        notes="The layers that the features need, and no others, are given; they may hold nan and inf.",
    ),
    Kind(
        "image.window",
        "The window of a pixel",
        {"image": "integer[H][W][C]", "size": "pixels", "border": "clamp or zero", "x": "column", "y": "row"},
        {"window": "integer[size * size * C]"},
        _window_cases,
        _window,
    ),
    Kind(
        "image.draws",
        "Pixels that training draws",
        {
            "seed": "integer",
            "stream": "integer",
            "count": "integer",
            "shapes": "integer[F][2], heights and widths",
        },
        {"frame": "integer[count]", "y": "integer[count], row", "x": "integer[count], column"},
        _draw_cases,
        _draws,
    ),
    *(_metric(name) for name in METRICS),
)
"""The kinds of this module."""
