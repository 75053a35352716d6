"""From a model to the program of one pixel: trace the reference's own function [`lower`]."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np

from ...refimpl.network.dataset import DISPLAY_FORMULA, FEATURES
from ...refimpl.network.denoise import Model, as_dtype, check_model, denoise_pixel
from .ir import OUTPUT_ENCODING, Gather, Image, Program, Type
from .trace import trace
from .verify import verify


def lower(model: Model, keep_places: bool = False) -> Program:
    """Return the program of `denoise_pixel` for this model, with its weights rounded to float32.

    `keep_places`: its nodes know the lines of the reference that they came from, for listings.
    """
    check_model(model)
    features = [FEATURES[name] for name in model.features]
    scales = model.normalization
    images = tuple(Image(f.name, f.channels, f.low, f.high, f.encoding(scales)) for f in features)
    gather = Gather(model.window, images)
    siren = as_dtype(model.siren, np.float32)
    info = {
        **model.info,
        "normalization": json.dumps(asdict(scales), sort_keys=True),
        OUTPUT_ENCODING: DISPLAY_FORMULA.format_map(asdict(scales)),
    }
    program = trace(
        lambda window: denoise_pixel(siren, window),
        {"window": Type(shape=(gather.n_inputs,))},
        gather,
        info=info,
        keep_places=keep_places,
    )
    return verify(program, "lowered model")
