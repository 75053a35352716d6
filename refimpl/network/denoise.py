"""Denoise a frame with a trained network: the definition that every kernel is compared with.

1. Encode the features of the frame that the model names [`dataset.feature_image`].
2. For every pixel take its window and run the network, [`denoise_pixel`]: the function of one pixel that
   the compiler traces.
3. Do that for a block of rows at a time, because all windows of a picture fill the memory [`denoise`].

The result is display-encoded colour in [0, 1], as the training targets were. Source of the method: *WAMnet
for Image Denoising*.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..errors import InputError
from ..frame import LIT, Frame
from . import dataset
from .activation import activation_named
from .dataset import Normalization
from .imported import Imported, check_imported, forward_imported
from .siren import LARGEST_PARAMETER, Siren, check_shape, forward
from .whole import Whole, check_whole, forward_whole, round_image
from .window import Window, all_windows, check_window, pad

Array = NDArray[np.floating[Any]]

BLOCK_NUMBERS = 2**22
"""Numbers in the windows of one block of rows: 32 MiB in float64, for frames of any height."""

OUTPUT_CHANNELS = 3
"""Channels of the result: red, green, blue."""


@dataclass(frozen=True)
class Model:
    """All that is needed to denoise a frame: network, what it looks at, scales; `info` tells its origin."""

    siren: Siren
    features: tuple[str, ...]
    window: Window
    normalization: Normalization
    info: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return layers, window and features, and what the model was trained on, on two lines."""
        siren, size = self.siren, self.window.size
        kind = "integer" if self.is_whole else getattr(siren, "activation", "imported")
        scene, steps = (self.info.get(key, "unknown") for key in ("trained_on_scene", "steps_done"))
        return (
            f"Model({' -> '.join(map(str, siren.widths))}, {kind}; window {size} x {size}; "
            f"features {', '.join(self.features)};\n      trained on scene {scene}, {steps} steps)"
        )

    @property
    def is_whole(self) -> bool:
        """Return whether the network, and the images that it reads, are of integers."""
        return isinstance(self.siren, Whole)

    @property
    def is_imported(self) -> bool:
        """Return whether another program has trained the network: it reads images, not features of frames."""
        return isinstance(self.siren, Imported)


def check_model(model: Model) -> None:
    """Refuse a model whose parts do not fit each other or whose parameters are not finite numbers."""
    if isinstance(model.siren, Imported):
        check_window(model.window)
        _check_layers(model.siren)
        check_imported(model.siren, model.window)
        return
    dataset.check_features(model.features)
    check_window(model.window)
    dataset.check_normalization(model.normalization)
    activation_named(model.siren.activation)
    _check_layers(model.siren)
    check_shape(model.siren.widths, model.siren.omega_0_first, model.siren.omega_0_hidden)
    if isinstance(model.siren, Whole):
        check_whole(model.siren)
    n_inputs = dataset.n_inputs(model.features, model.window)
    if model.siren.widths[0] != n_inputs:
        size = model.window.size
        rule = f"{size} x {size} pixels of {', '.join(model.features)} are {n_inputs} numbers"
        raise InputError("inputs of the first layer", model.siren.widths[0], rule, "train the model again")
    if model.siren.widths[-1] != OUTPUT_CHANNELS:
        rule = "a colour has 3 channels"
        raise InputError("outputs of the last layer", model.siren.widths[-1], rule, "train the model again")


def _check_layers(siren: Siren) -> None:
    """Refuse layers of other types, whose shapes do not chain, or that hold a NaN or an infinity."""
    kinds = sorted({parameter.dtype.name for parameter in siren.weights + siren.biases})
    if kinds not in (["float32"], ["float64"]):
        rule = "all must be float32, or all float64"
        raise InputError("types of the parameters", ", ".join(kinds), rule, "convert them with as_dtype")
    n_in: int | None = None
    for layer, (weight, bias) in enumerate(zip(siren.weights, siren.biases, strict=True)):
        shapes = f"weights {weight.shape}, biases {bias.shape}"
        if weight.ndim != 2 or bias.shape != weight.shape[:1] or n_in not in (None, weight.shape[1]):
            rule = f"weights (D_out, {n_in or 'D_in'}) and biases (D_out,) must chain"
            raise InputError(f"layer {layer}", shapes, rule, "train the model again")
        # Written so that NaN counts.
        bad = sum(int(np.sum(~(np.abs(array) <= LARGEST_PARAMETER))) for array in (weight, bias))
        if bad:
            raise InputError(
                f"layer {layer}: number of NaN, infinite or huge parameters",
                bad,
                f"all must be finite, and at most {LARGEST_PARAMETER:g} in magnitude",
                "train the model again, with a lower learning rate",
            )
        n_in = weight.shape[0]


def learned_feature_spp(model: Model) -> int:
    """Return the camera rays of the features that a model has learned from, the most of several; or 0."""
    return _most(model, "feature_spp")


def learned_shadow_rays(model: Model) -> int:
    """Return the shadow rays of a camera ray that a model has learned from; 0 if no feature has any."""
    lit = not set(LIT).isdisjoint(model.features)
    return max(1, _most(model, "shadow_rays")) if lit else 0


def _most(model: Model, fact: str) -> int:
    """Return the largest number that the frames of a model's training have had as a fact, or 0."""
    texts = model.info.get(f"trained_on_{fact}", "").split(", ")
    return max((int(text) for text in texts if re.fullmatch("[0-9]{1,9}", text)), default=0)


def denoise_pixel(siren: Siren, window_vector: Any) -> Any:
    """Map window vectors (..., D_in) to display-encoded colours (..., 3) in [0, 1]; may be traced.

    An imported network has outputs of its own.
    """
    if isinstance(siren, Whole):
        return forward_whole(siren, window_vector)
    if isinstance(siren, Imported):
        return forward_imported(siren, window_vector)
    return np.minimum(np.maximum(forward(siren, window_vector), 0.0), 1.0)


def input_image(model: Model, frame: Frame, features: Sequence[str] = ()) -> NDArray[np.float32]:
    """Return what the network's window is taken from, (H, W, C): encoded features, all or some."""
    image = dataset.feature_image(frame, features or model.features, model.normalization)
    return round_image(image) if model.is_whole else image


def denoise(model: Model, frame: Frame, dtype: DTypeLike = np.float32) -> Array:
    """Return the denoised picture (H, W, 3), display-encoded, with the network computed in `dtype`."""
    siren = as_dtype(model.siren, dtype)
    image = input_image(model, frame).astype(dtype)
    height, width, _ = image.shape
    padded = pad(image, model.window)
    rows = max(1, BLOCK_NUMBERS // (width * siren.widths[0]))
    blocks = []
    for top in range(0, height, rows):
        # These rows and the margin around them are all that their pixels see.
        strip = padded[top : min(top + rows, height) + model.window.size - 1]
        blocks.append(denoise_pixel(siren, all_windows(strip, model.window)))
    return np.concatenate(blocks).astype(dtype, copy=False)


def as_dtype(siren: Siren, dtype: DTypeLike) -> Siren:
    """Return the same network with parameters of type `dtype`."""
    return replace(
        siren,
        weights=tuple(weight.astype(dtype) for weight in siren.weights),
        biases=tuple(bias.astype(dtype) for bias in siren.biases),
    )
