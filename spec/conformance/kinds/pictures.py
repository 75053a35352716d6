"""Kinds of whole pictures: denoising of a small frame, and a small render with a statistical verdict.

1. A denoised picture has a bound at each pixel: the network's at its window (compiler/proof/bounds.py), for
   encoded features that may be one ulp of float32 off [`_denoise_cases`].
2. A rendered picture is an estimate. The answer holds the mean of each pixel and the variance of one sample;
   both are averaged over blocks of pixels, and the blocks' means are compared by Welch's test with those of
   the reference (welch.py) [`_render_cases`].
3. A tiny render has bounds where each of its samples is sure: those of whole paths, averaged
   [`_exact_cases`].
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ....compiler.core.lower import lower
from ....compiler.core.profiles import EMITTED_SINE
from ....compiler.plan import analysed
from ....compiler.proof import bounds
from ....refimpl.frame import LAYERS, Frame, validate
from ....refimpl.light import scene as scene_module
from ....refimpl.light.render import Job, render
from ....refimpl.light.transport import Settings
from ....refimpl.network import dataset, denoise, siren
from ....refimpl.network.activation import SINE
from ....refimpl.network.dataset import Normalization, Window
from ....refimpl.network.denoise import Model
from .. import blocks
from ..case import Case, Output
from . import paths, views
from .files import file_of, model_from
from .images import ULP, bad_layers, frame_of
from .tables import kind

SIGNIFICANCE = 1e-5
"""Chance that a right program fails a case of a render, over all its blocks and channels."""

REFERENCE_SPP, ASKED_SPP = 256, 64
"""Samples per pixel of the reference and of the answer."""

SIZE_PX, BLOCK_PX = 16, 4
"""Side of the picture and of a block."""

RENDERED = (("cornell", BLOCK_PX), ("glossy", BLOCK_PX), ("daylight", BLOCK_PX), ("plate", SIZE_PX))
"""Scenes and sides of blocks. The plate is there for its brightness: samples of a pixel differ by a few
percent, so that the mean of the whole picture shows half a percent."""


# ---- denoising --------------------------------------------------------------------------------------------


MIDDLE, BEYOND = (0.5, 0.5, 0.5), (-0.25, 0.5, 1.25)
"""Colours that pictures are near: in the middle of [0, 1], where clipping hides nothing, and beyond."""


def _model(
    features: tuple[str, ...],
    window: Window,
    widths: list[int],
    seed: int,
    around: tuple[float, ...],
    activation: str = SINE,
) -> Model:
    """Return a small model whose pictures are near a colour."""
    n_in = dataset.n_inputs(features, window)
    network = siren.init([n_in, *widths, 3], 3.0, 1.0, seed=seed, dtype=np.float32)
    biases = (*network.biases[:-1], np.array(around, np.float32))
    weights = (*network.weights[:-1], (network.weights[-1] * np.float32(0.2)).astype(np.float32))
    scales = Normalization(0.5, 0.75, (0.25, -0.5, 0.5), 0.5)
    return Model(siren.Siren(weights, biases, 3.0, 1.0, activation), features, window, scales)


def _layers(inputs: Mapping[str, Any]) -> Frame:
    """Return the frame of a case."""
    return frame_of({name: inputs[name] for name in LAYERS if name in inputs})


def _denoise(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the denoised picture."""
    frame = _layers(inputs)
    validate(frame, finite=False)
    return {"picture": denoise.denoise(model_from(base64.b64decode(inputs["model"])), frame, np.float64)}


DENOISED = (
    (("color", "normal"), Window(4, "clamp"), [6, 6], (4, 5), MIDDLE, "NaN, infinities and a firefly"),
    (("color",), Window(5, "zero"), [8], (3, 3), MIDDLE, "smaller than the window, zeros outside"),
    (("depth", "albedo", "position"), Window(3, "clamp"), [5, 5], (1, 4), MIDDLE, "one row"),
    (("color",), Window(2, "clamp"), [4], (2, 2), BEYOND, "clipped to [0, 1]"),
)
"""Features, window, hidden widths, height and width, the colour that pictures are near, note."""


def _denoised() -> Iterator[tuple[Model, dict[str, Any], str]]:
    """Yield models, the layers that they are given, and notes."""
    for index, (features, window, widths, size, around, note) in enumerate(DENOISED):
        wanted = {layer for name in features for layer in dataset.FEATURES[name].layers}
        layers = {name: v for name, v in bad_layers(*size, 90 + 10 * index).items() if name in wanted}
        yield _model(features, window, widths, index, around), layers, note
    deep = _model(("depth",), Window(2, "clamp"), [4], len(DENOISED), MIDDLE)
    yield deep, {"depth": np.full((1, 1, 1), 0.25)}, "a frame of one number"
    other = _model(("color", "depth"), Window(2, "clamp"), [6, 5], len(DENOISED) + 1, MIDDLE, "relu")
    layers = bad_layers(2, 3, 160)
    yield other, {name: layers[name] for name in ("color", "depth")}, "the activation relu"


def _denoise_cases() -> list[Case]:
    """Return denoised pictures with bounds."""
    cases = []
    for model, layers, note in _denoised():
        inputs = {**layers, "model": base64.b64encode(file_of(model)).decode()}
        picture = _denoise(inputs)["picture"]
        bound = _bound(model, frame_of(layers), picture)
        text = "bounds of profile ieee at these pixels, features being one ulp off (compiler/proof/bounds.py)"
        expected = {"picture": Output(picture, bound, text)}
        clause = "DEN-2" if model.siren.activation == SINE else "ACT-1"
        cases.append(Case(clause, inputs, expected, note, "FRM-5"))
    needy = _model(("color", "normal"), Window(2, "clamp"), [4], 0, MIDDLE)
    inputs = {
        "color": bad_layers(2, 2, 5)["color"],
        "model": base64.b64encode(file_of(needy)).decode(),
    }
    cases.append(Case("DAT-9", inputs, None, "layers are missing"))
    wide = np.zeros((2, 3, 3))
    for note, changes in (
        ("layers of two sizes", {"normal": wide}),
        ("a layer of two channels", {"normal": np.zeros((2, 2, 2))}),
        ("a layer of two axes", {"color": wide, "normal": np.zeros((2, 3))}),
    ):
        other = {**inputs, **changes}
        cases.append(Case("FRM-1", other, None, note))
    return cases


def _bound(model: Model, frame: Frame, picture: Any) -> Any:
    """Return the bound (H, W, 3) of a picture."""
    program = analysed(lower(model))
    image = dataset.feature_image(frame, model.features, model.normalization).astype(np.float64)
    windows = dataset.all_windows(dataset.pad(image, model.window), model.window)
    nodes = bounds.enclose(program, {"window": (windows - ULP, windows + ULP)}, EMITTED_SINE)
    ((_, index),) = program.outputs
    found = nodes[index]
    return np.maximum(found.high - picture, picture - found.low) + found.read


# ---- rendering --------------------------------------------------------------------------------------------


def _render(inputs: Mapping[str, Any], dtype: str = "float32") -> dict[str, Any]:
    """Return mean and variance of each pixel."""
    width, height, spp, seed = (int(inputs[name]) for name in ("width", "height", "spp", "seed"))
    job = Job(width, height, spp, seed, paths.settings_of(inputs["settings"]), dtype)
    found = render(scene_module.from_json(inputs["scene"]), job)
    return {"mean": found.frame["color"], "variance": found.color_variance, "spp": job.spp}


@cache
def _render_cases() -> list[Case]:
    """Return small renders."""
    cases = []
    for index, (name, block_px) in enumerate(RENDERED):
        size = {"width": SIZE_PX, "height": SIZE_PX, "spp": REFERENCE_SPP, "seed": 1000 + index}
        own = {**size, "settings": asdict(Settings(max_depth=3))}
        found = _render({**own, "scene": views.scene_text(name)})
        mean, variance = blocks.mean_and_variance(
            found["mean"].astype(np.float64), found["variance"], block_px
        )
        welch = {
            "variance": variance,
            "spp": REFERENCE_SPP,
            "asked": ASKED_SPP,
            "block": block_px,
            "shape": np.array([SIZE_PX, SIZE_PX, 3]),
            "significance": SIGNIFICANCE,
        }
        text = f"Welch's test of block means, significance {SIGNIFICANCE:g} in all"
        inputs = {**own, "scene": {"file": views.scene_file(name)}, "spp": ASKED_SPP, "seed": index}
        expected = {"mean": Output(mean, 0.0, text, (), welch)}
        cases.append(Case("LTR-6", inputs, expected, name, flags=("statistical",)))
    return cases


# ---- rendering, to the bound ------------------------------------------------------------------------------


OF_SAMPLES = "ranges of single precision of all samples, from step to step (compiler/proof/ranges.py)"
"""Where the bounds of tiny pictures come from."""

ROUNDED = 2.0**-22
"""What a mean may be off by for its sum and its rounding to float32, relative: few samples are added."""


class Exact(NamedTuple):
    """A tiny picture of which every sample is sure: scene, settings, size, samples, seed."""

    scene: str
    settings: Settings
    width: int
    height: int
    spp: int
    seed: int


def _exact_rows(group: str) -> Iterator[tuple[Exact, str]]:
    """Yield pictures, with notes.

    Seeds are the first ones of which no sample has a decision that rounding could change, or the ends of what
    they may be; the numbers of 258 samples need more than 8 bits."""
    for scene, settings, *numbers, note in views.PLACED[group]:
        yield Exact(scene, Settings(**settings), *numbers), note


def samples_of(exact: Exact) -> Iterator[tuple[Any, Any] | None]:
    """Yield the ends (3,) of each sample of each pixel, row by row; None where a decision is not sure."""
    for y, x, n in np.ndindex(exact.height, exact.width, exact.spp):
        size = exact.width, exact.height
        yield paths.gathered(views.View(exact.scene, exact.settings, x, y, n, "", *size, exact.seed))


def exact_case(exact: Exact, note: str = "") -> Case:
    """Return a tiny picture with the bounds of its means and variances.

    A sample x is off by the width w of its range at most, a mean m by the mean of the widths. A variance, the
    sum of (x - m)^2 over n - 1, is off by the sum of 2 |x - m| e + e^2 over n - 1, e being both together; of
    one sample it is 0.
    """
    inputs = {
        "scene": {"file": f"scenes/{exact.scene}.json"},
        **{name: getattr(exact, name) for name in ("width", "height", "spp", "seed")},
        "settings": asdict(exact.settings),
    }
    found = _exact({**inputs, "scene": views.scene_text(exact.scene)})
    ends = [ends for ends in samples_of(exact) if ends is not None]
    shape = (exact.height, exact.width, exact.spp, 3)
    low, high = (np.array([end[side] for end in ends]).reshape(shape) for side in (0, 1))
    mean, variance, middle = found["mean"], found["variance"], (low + high) / 2
    of_mean = np.mean(high - low, axis=2) + ROUNDED * mean
    off = (high - low) + of_mean[:, :, np.newaxis]
    spread = np.abs(middle - mean[:, :, np.newaxis]) + off
    of_variance = np.sum(2 * spread * off + off**2, axis=2) / max(exact.spp - 1, 1) + ROUNDED * variance
    expected = {
        "mean": Output(mean, of_mean, OF_SAMPLES),
        "variance": Output(variance, of_variance, OF_SAMPLES, clause="RND-4"),
        "spp": Output(exact.spp),
    }
    return Case("RND-1", inputs, expected, note or exact.scene, "RND-6")


@cache
def _exact_cases() -> list[Case]:
    """Return tiny pictures, and what is refused."""
    cases = [exact_case(exact, note) for exact, note in _exact_rows("exact")]
    for name, value in views.PLACED["wrong_sizes"]:
        wrong = {**cases[0].inputs, name: value}
        cases.append(Case("RND-6", wrong, None, f"{name} = {value}"))
    return [*cases, *(exact_case(exact, note) for exact, note in _exact_rows("exact_later"))]


def _exact(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return mean and variance of each pixel in float64."""
    return _render(inputs, "float64")


KINDS = (
    kind("picture.denoised", _denoise_cases, _denoise),
    kind("picture.exact", _exact_cases, _exact, views.files),
    kind("picture.rendered", _render_cases, _render, views.files),
)
"""The kinds of this module."""
