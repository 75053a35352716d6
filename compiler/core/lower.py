"""From a model to the program of one pixel: trace the reference's own function [`lower`]."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from ...refimpl.network.dataset import DISPLAY_FORMULA, FEATURES, Normalization
from ...refimpl.network.denoise import Model, as_dtype, check_model, denoise_pixel
from ...refimpl.network.imported import Imported
from ...refimpl.network.whole import INPUT_LEVELS
from .ir import OUTPUT_ENCODING, Gather, Image, Program, Type
from .trace import trace
from .verify import verify

OWN_NUMBERS = "as the network was trained"
"""What is said about the numbers of images, and of the result, of a network that was imported."""


def lower(model: Model, keep_places: bool = False) -> Program:
    """Return the program of `denoise_pixel` for this model, with its weights rounded to float32.

    `keep_places`: its nodes know the lines of the reference that they came from, for listings.
    """
    check_model(model)
    siren = as_dtype(model.siren, np.float32)
    images, encoded = _read_by(model)
    gather, info = Gather(model.window, images), {**model.info, **encoded}
    program = trace(
        lambda window: denoise_pixel(siren, window),
        {"window": Type(shape=(gather.n_inputs,))},
        gather,
        info=info,
        keep_places=keep_places,
    )
    return verify(program, "lowered model")


def _read_by(model: Model) -> tuple[tuple[Image, ...], dict[str, str]]:
    """Return the images that a model reads, and how they and its output are encoded."""
    if isinstance(model.siren, Imported):
        found = (Image(s.name, s.channels, s.low, s.high, OWN_NUMBERS) for s in model.siren.sources)
        return tuple(found), {OUTPUT_ENCODING: OWN_NUMBERS}
    scales = model.normalization
    return images_of(model.features, scales, model.is_whole), {
        "normalization": json.dumps(asdict(scales), sort_keys=True),
        OUTPUT_ENCODING: DISPLAY_FORMULA.format_map(asdict(scales)),
    }


def images_of(
    features: Sequence[str], normalization: Normalization, whole: bool = False
) -> tuple[Image, ...]:
    """Return the images of features; `whole`: as a network of integers reads them."""
    known = [FEATURES[name] for name in features]
    images = tuple(Image(f.name, f.channels, f.low, f.high, f.encoding(normalization)) for f in known)
    if not whole:
        return images
    return tuple(
        replace(
            image,
            low=INPUT_LEVELS * image.low,
            high=INPUT_LEVELS * image.high,
            encoding=f"floor({INPUT_LEVELS} x + 1/2) of x = {image.encoding}",
            whole=True,
        )
        for image in images
    )
