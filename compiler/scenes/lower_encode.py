"""From features to the program that encodes a pixel: trace the reference's own encodings [`lower_encode`].

It connects a path kernel, which leaves sums over the samples, plane by plane, to a denoiser's kernel, which
reads encoded feature images. Its inputs are the planes by name, and `samples`; its outputs the channels
of the images, `color_0` and so on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...refimpl import vectors
from ...refimpl.errors import InputError
from ...refimpl.frame import HISTORY, SEEN, SUN
from ...refimpl.light.render import FEATURE_SAMPLER, spread, spread_rays
from ...refimpl.light.transport import Settings
from ...refimpl.network.dataset import (
    FEATURES,
    Normalization,
    check_features,
    check_normalization,
    encode_sums,
)
from ...refimpl.network.denoise import Model, learned_feature_spp
from ..core.ir import Program, Type
from ..core.passes import pipeline
from ..core.trace import trace
from ..core.verify import verify
from .emit_path import GROUPS
from .lower_scene import FeatureRays

PASSES = ("scalarize", "fold", "eliminate_dead")
"""What the program goes through: numbers in place of vectors, constants in float64, rounded when emitted."""

SAMPLES = "samples"
"""The input beside the planes: how many samples they are sums of."""


def layers_of(features: Sequence[str]) -> tuple[str, ...]:
    """Return the layers that features are made of: the groups of planes that a path kernel has to add up."""
    check_features(features)
    layers = tuple(dict.fromkeys(FEATURES[name].layer for name in features))
    if smoothed := [name for name in features if FEATURES[name].guides]:
        rule = "a path kernel knows nothing of a pixel's neighbours"
        raise InputError("features", ", ".join(smoothed), rule, "denoise frames: wamnet render, then denoise")
    if before := [layer for layer in layers if layer in HISTORY]:
        rule = "a path kernel computes layers of one frame, not of earlier frames"
        way_out = "denoise frames that have them: wamnet animate makes them"
        raise InputError("features", ", ".join(before), rule, way_out)
    if SUN in layers:
        rule = "a path kernel knows what a pixel's paths meet, not where the sun is"
        raise InputError("features", SUN, rule, "denoise frames: wamnet render, then denoise")
    return layers


def sees(features: Sequence[str]) -> bool:
    """Tell whether some of the features are of what is seen past mirrors and glass."""
    check_features(features)
    return any(layer in SEEN for name in features for layer in FEATURES[name].layers)


def feature_rays(model: Model) -> int:
    """Return how many camera rays that are spread evenly are worth those that a model has learned from."""
    rays = learned_feature_spp(model)
    return rays if model.info.get(f"trained_on_{FEATURE_SAMPLER}") else spread_rays(rays)


def learned_rays(model: Model, settings: Settings) -> FeatureRays | None:
    """Return the rays of features that a path kernel makes for a model, or None: those of its samples.

    What is seen past mirrors and glass is seen by paths, which have no further rays.
    """
    count = feature_rays(model)
    if count < 2 or sees(model.features):
        return None
    return FeatureRays(count, spread(settings.sampler, False))


def planes_of(features: Sequence[str]) -> tuple[str, ...]:
    """Return the planes that features are made of, in the order in which a path kernel writes them."""
    return tuple(plane for layer in layers_of(features) for plane in GROUPS[layer])


def channel_name(feature: str, channel: int) -> str:
    """Return the name of the output that is a channel of a feature's image."""
    return f"{feature}_{channel}"


def lower_encode(
    features: Sequence[str], normalization: Normalization, whole: bool = False, rays: int = 0
) -> Program:
    """Return the program that turns a pixel's sums into its encoded features; `whole`: in integers.

    With `rays` all sums but the colour's are over so many camera rays.
    """
    check_normalization(normalization)
    inputs = (*planes_of(features), SAMPLES)

    def encode(*numbers: Any) -> dict[str, Any]:
        given = dict(zip(inputs, numbers, strict=True))
        sums = {layer: _joined([given[plane] for plane in GROUPS[layer]]) for layer in layers_of(features)}
        return _channels(encode_sums(sums, given[SAMPLES], features, normalization, whole, rays))

    program = trace(encode, dict.fromkeys(inputs, Type()))
    return pipeline.run(verify(program, "traced encoding"), PASSES)


def _joined(numbers: Sequence[Any]) -> Any:
    """Join a layer's channels; a single one stays a number."""
    return vectors.vector(*numbers) if len(numbers) == 3 else numbers[0]


def _channels(encoded: Mapping[str, Any]) -> dict[str, Any]:
    """Return the channels of encoded features by name."""
    return {
        channel_name(name, channel): value[..., channel] if FEATURES[name].channels > 1 else value
        for name, value in encoded.items()
        for channel in range(FEATURES[name].channels)
    }
