"""Compile the encoding of features for a target: from sums over samples to the images that a denoiser reads.

1. Trace the reference's own encodings of features [`lower_encode`], and run the passes of the profile. Inputs
   are planes by name, and `samples`; outputs the channels of the images, `color_0` and so on.
2. The kernel is one statement an operation between the reads of the planes and the stores of the channels
   [`encode_kernel`].
3. Put both together with a manifest [`compile_encode`].

Colour may have any size before it is clipped, so there is no bound over all sums; at given sums the rules of
bounds.py give one for every channel of every pixel [tests/support/errors_at.py].
"""

from __future__ import annotations

from collections.abc import Sequence

from ...refimpl.errors import CompileError, InputError
from ...refimpl.frame import HISTORY, SEEN, SEEN_DIRECT, SUN
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
from ..artifact import Artifact
from ..core.ir import Program
from ..core.lower import images_of
from ..core.passes import pipeline
from ..core.profiles import IEEE
from ..kernel.interface import ENCODE, IMAGE, INTEGERS, READ, WRITE, Array, Interface, image_of
from ..kernel.interface import SUMS as SUMS_ARRAY
from ..kernel.kernel import Body, Kernel, Let, Store, apply, const, load, name
from ..schedules.common import X, Y, lets
from ..targets import Language, language_named
from .emit_path import GROUPS, SUMMED, Encoding
from .lower_scene import FeatureRays
from .plane_kernel import compiled, reads
from .values import Given, floats, lowered, numbered

SCHEMA = "wamnet-encode-kernel-1"
"""Name and version of the manifest's form; described in spec/pipeline.md."""

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
    return any(layer in (*SEEN, SEEN_DIRECT) for name in features for layer in FEATURES[name].layers)


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


def lower_encode(
    features: Sequence[str], normalization: Normalization, whole: bool = False, rays: int = 0
) -> Program:
    """Return the program that turns a pixel's sums into its encoded features; `whole`: in integers.

    With `rays` all sums but the colour's are over so many camera rays.
    """
    check_normalization(normalization)

    def encode(given: Given) -> Given:
        return encode_sums(given, given[SAMPLES], features, normalization, whole, rays)

    inputs = {**{layer: SUMMED[layer] for layer in layers_of(features)}, **floats(SAMPLES)}
    channels = {name: numbered(FEATURES[name].channels) for name in features}
    return lowered("encoding", encode, inputs, channels, PASSES)


def compile_encode(
    features: Sequence[str],
    normalization: Normalization,
    language: Language | str,
    planes: Sequence[str] | None = None,
    whole: bool = False,
    rays: int = 0,
) -> Artifact:
    """Return the kernel that turns sums over samples into the encoded images of features.

    `planes` name those of the sums, in order; by default they are what the features need. `whole`: the
    images are those of a network of integers. `rays`: those of features [lower_encode].
    """
    chosen = language_named(language)
    encoding = encoding_of(features, normalization, chosen.profile.passes, whole, rays)
    program, images = encoding.program, encoding.images
    planes = tuple(planes or planes_of(features))
    lacking = set(planes_of(features)) - set(planes)
    if lacking:
        raise CompileError(
            f"the sums have no planes {', '.join(sorted(lacking))}: the features {', '.join(features)} are "
            "computed from them; add them to the path kernel"
        )
    if not chosen.paths:
        raise CompileError(
            f"target {chosen.name} has no kernels that encode features: use one that has them, such as opencl"
        )
    if len(images) > (most := chosen.dialect.max_images):
        raise CompileError(
            f"the kernel encodes {len(images)} features: {chosen.dialect.language} writes at most {most} "
            "images at once; use fewer"
        )
    facts = {
        "schema": SCHEMA,
        "passes": [*PASSES, *chosen.profile.passes],
        "planes": list(planes),
        "images": [image.facts for image in images],
    }
    return compiled(
        "encoding of features",
        encode_kernel(encoding, planes),
        [program],
        facts,
        "at given sums: see the rules for each operation",
        {SUMS_ARRAY: planes},
        {"row_stride": "floats from row to row of a plane", "plane_stride": "and from plane to plane"},
        chosen,
        program,
        images,
    )


def encode_kernel(encoding: Encoding, planes: Sequence[str]) -> Kernel:
    """Return the kernel of one pixel, of sums whose planes these are."""
    used = planes_of([image.name for image in encoding.images])
    lines, outputs = lets(encoding.program)
    body: Body = (
        Let(SAMPLES, apply("convert", name("sample_count"), value="float32"), kept=True),
        *reads(used, lambda i: load(SUMS_ARRAY, planes.index(used[i]), Y, X)),
        *lines,
        *(
            Store(f"{IMAGE}{image.name}", (Y, X, const(c)), outputs[f"{image.name}_{c}"])
            for image in encoding.images
            for c in range(image.channels)
        ),
    )
    sums = Array(SUMS_ARRAY, READ, (len(planes), "height", "width"))
    arrays = (sums, *(image_of(image, WRITE) for image in encoding.images))
    return Kernel(Interface(ENCODE, arrays, INTEGERS[ENCODE]), body)


def encoding_of(
    features: Sequence[str],
    normalization: Normalization,
    passes: Sequence[str] = IEEE.passes,
    whole: bool = False,
    rays: int = 0,
) -> Encoding:
    """Return the encoding of features after the passes of a profile, and the images that it makes."""
    program = pipeline.run(lower_encode(features, normalization, whole, rays), passes)
    return Encoding(program, images_of(features, normalization, whole))
