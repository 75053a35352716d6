"""What is denoised and by which network: a model and a frame of its features, of any size.

Without a model it is the paper's network with its initial weights, and without a data set the frame is noise.
A frame is laid out again and again until it fills the picture: times do not depend on what it shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl import rng
from ...refimpl.errors import InputError
from ...refimpl.frame import LAYERS, Frame
from ...refimpl.network import dataset, siren
from ...refimpl.network.denoise import Model
from ...refimpl.network.whole import round_image
from ...refimpl.network.window import Window
from ..devices.kernel import Images
from ..run.denoise_on import images_of

HIDDEN = (32, 32, 32, 32)
"""The paper's hidden layers."""

OMEGA_0 = 3.0
"""omega_0 of the network without a model: that of the presets."""

FEATURES = ("color", "normal")
"""What the paper's network sees."""

NOISE_PX = 256
"""Width and height of the noise that is repeated."""

LARGEST_PX = 8192
"""Largest width and height of a picture: 6 channels of it are 1.6 GB."""


@dataclass(frozen=True)
class Given:
    """A frame, and the encoded feature images (H, W, C) that the model reads of it."""

    frame: Frame
    images: Images

    @cached_property
    def integers(self) -> Images:
        """Return the images as networks of integers read them."""
        return {name: round_image(image) for name, image in self.images.items()}


def paper_model(
    features: Sequence[str] = FEATURES, size: int = 12, hidden: Sequence[int] = HIDDEN, **scales: Any
) -> Model:
    """Return an untrained network for these features, by default the paper's: windows of `size` pixels."""
    dataset.check_features(features)
    window = Window(size, "clamp")
    widths = [dataset.n_inputs(tuple(features), window), *hidden, 3]
    network = siren.init(widths, OMEGA_0, OMEGA_0, seed=1, dtype=np.float32)
    return Model(network, tuple(features), window, dataset.Normalization(**scales))


def random_model() -> Model:
    """Return a small network of random weights, whose outputs are around 0.5."""
    network = siren.init((96, 8, 3), 2.0, 2.0, 5, np.float32)
    network = replace(network, biases=(*network.biases[:-1], np.full(3, 0.5, np.float32)))
    return Model(network, ("color", "normal"), Window(4, "clamp"), dataset.Normalization())


def given(model: Model, frame: Frame) -> Given:
    """Return a frame with the images that the model reads."""
    return Given(frame, images_of(model, frame))


def noise(size: int, seed: int = 1) -> Frame:
    """Return all layers (size, size, C) of numbers in [0, 1), or in [-1, 1) for directions."""
    check_size(size)
    layers = {}
    for number, layer in enumerate(LAYERS.values()):
        side = min(size, NOISE_PX)
        pixels = rng.counter(np.arange(side * side))
        words = rng.uniforms(rng.counter(seed), pixels, rng.counter(number), rng.counter(0))
        values = np.stack(words[: layer.channels], axis=-1).reshape(side, side, -1)
        signed = layer.name in ("normal", "direction", "position")
        layers[layer.name] = 2 * values - 1 if signed else values
    return filled(Frame(layers), size)


def filled(frame: Frame, size: int) -> Frame:
    """Return a frame (size, size) that repeats this one."""
    return Frame({name: repeated(layer, size) for name, layer in frame.layers.items()}, frame.info)


def repeated(image: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Return an image (H, W, C) beside and below itself until it has size x size pixels."""
    check_size(size)
    height, width, _ = image.shape
    many = np.tile(image, (-(-size // height), -(-size // width), 1))
    return np.ascontiguousarray(many[:size, :size], np.float32)


def check_size(size: int) -> None:
    """Refuse a size of which no picture is made."""
    if not 1 <= size <= LARGEST_PX:
        rule = f"must be from 1 to {LARGEST_PX} pixels"
        raise InputError("size of the image", size, rule, "for example --size 1024")
