"""Compile the encoding of features for a target: passes, kernel, artifact.

1. Trace the encoding of the features [`lower_encode.lower_encode`], and run the passes of the profile.
2. The kernel is one statement an operation between the reads of the planes and the stores of the channels
   [`encode_kernel`].
3. Put both together with a manifest [`compile_encode`].

Colour may have any size before it is clipped, so there is no bound over all sums; at given sums the rules of
bounds.py give one for every channel of every pixel [`error_at`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.network.dataset import Normalization
from ..artifact import Artifact
from ..core import profiles
from ..core.lower import images_of
from ..core.passes import pipeline
from ..kernel.interface import ENCODE, IMAGE, INTEGERS, READ, WRITE, Array, Interface, image_of
from ..kernel.interface import SUMS as SUMS_ARRAY
from ..kernel.kernel import Body, Kernel, Let, Store, apply, const, load, name
from ..plan import sine_contract
from ..proof import bounds
from ..schedules.common import X, Y, lets
from ..targets import Language, language_named
from .emit_path import Encoding
from .lower_encode import PASSES, SAMPLES, channel_name, lower_encode, planes_of
from .plane_kernel import compiled, reads

SCHEMA = "wamnet-encode-kernel-1"
"""Name and version of the manifest's form; described in spec/pipeline.md."""


def compile_encode(
    features: Sequence[str],
    normalization: Normalization,
    language: Language | str,
    profile: str = "ieee",
    planes: Sequence[str] | None = None,
    whole: bool = False,
    rays: int = 0,
) -> Artifact:
    """Return the kernel that turns sums over samples into the encoded images of features.

    `planes` name those of the sums, in order; by default they are what the features need. `whole`: the
    images are those of a network of integers. `rays`: those of features [lower_encode].
    """
    chosen, promised = language_named(language), profiles.profile_named(profile)
    encoding = encoding_of(features, normalization, profile, whole, rays)
    program, images = encoding.program, encoding.images
    planes = tuple(planes or planes_of(features))
    lacking = set(planes_of(features)) - set(planes)
    if lacking:
        raise CompileError(
            f"the sums have no planes {', '.join(sorted(lacking))}: the features {', '.join(features)} are "
            "computed from them; add them to the path kernel"
        )
    if not chosen.encodes:
        raise CompileError(
            f"target {chosen.name} has no kernels that encode features: use one that has them, such as opencl"
        )
    if len(images) > (most := chosen.dialect.max_images):
        raise CompileError(
            f"the kernel encodes {len(images)} features: {chosen.language} writes at most {most} images at "
            "once; use fewer"
        )
    facts = {
        "schema": SCHEMA,
        "passes": [*PASSES, *promised.passes],
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
        (chosen, promised),
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
            Store(f"{IMAGE}{image.name}", (Y, X, const(c)), outputs[channel_name(image.name, c)])
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
    profile: str = "ieee",
    whole: bool = False,
    rays: int = 0,
) -> Encoding:
    """Return the encoding of features after the passes of a profile, and the images that it makes."""
    passes = profiles.profile_named(profile).passes
    program = pipeline.run(lower_encode(features, normalization, whole, rays), passes)
    return Encoding(program, images_of(features, normalization, whole))


def error_at(artifact: Artifact, sums: Mapping[str, Any], samples: int) -> dict[str, NDArray[np.float64]]:
    """Return the bound (H, W, C) of each image's error against float64, at planes of sums (H, W) by name."""
    names = planes_of([image.name for image in artifact.images])
    inputs = {name: np.asarray(sums[name], np.float64) for name in names}
    inputs[SAMPLES] = np.full(inputs[names[0]].shape, float(samples))
    contract = sine_contract(artifact.profile, artifact.target)
    boxes = {name: (value, value) for name, value in inputs.items()}
    found = bounds.enclose(artifact.programs, boxes, contract)
    errors = {name: found[index].read for name, index in artifact.programs.outputs}
    return {
        image.name: np.stack([errors[channel_name(image.name, c)] for c in range(image.channels)], axis=-1)
        for image in artifact.images
    }
