"""Compile the encoding of features for a target: passes, source, artifact.

1. Trace the encoding of the features [`lower_encode.lower_encode`], and run the passes of the profile.
2. Emit one statement an operation between the loads of the planes and the stores of the channels [`_emit`].
3. Put both together with a manifest [`compile_encode`].

Colour may have any size before it is clipped, so there is no bound over all sums; at given sums the rules of
bounds.py give one for every channel of every pixel [`error_at`].
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.network.dataset import Normalization
from ...refimpl.reading import SIZES
from ..artifact import OneSource
from ..core import ir, profiles
from ..core.ir import Image, Program
from ..core.lower import images_of
from ..core.passes import pipeline
from ..kernel import interface
from ..kernel.interface import Interface
from ..languages.dialect import Dialect, Parts
from ..languages.renderer import framed
from ..plan import sine_contract
from ..proof import bounds
from ..schedules.schedules import PRINTED
from ..targets import integers_of, target_named
from .emit_path import Encoding
from .lower_encode import PASSES, SAMPLES, channel_name, lower_encode, planes_of

SCHEMA = "wamnet-encode-kernel-1"
"""Name and version of the manifest's form; described in spec/pipeline.md."""


@dataclass(frozen=True)
class EncodeArtifact(OneSource):
    """A compiled encoding; `program` is what was emitted, from `planes` of sums it makes `images`."""

    target: str
    profile: str
    entry_point: str
    source: str
    source_name: str
    program: Program
    planes: tuple[str, ...]
    images: tuple[Image, ...]
    manifest: Mapping[str, Any]

    @property
    def interface(self) -> Interface:
        """Return what the kernel is bound to, in its language."""
        taken = integers_of(self.target, interface.ENCODE)
        return interface.encoding(len(self.planes), self.images, taken)


def compile_encode(
    features: Sequence[str],
    normalization: Normalization,
    target: str,
    profile: str = "ieee",
    planes: Sequence[str] | None = None,
    whole: bool = False,
    rays: int = 0,
) -> EncodeArtifact:
    """Return the kernel that turns sums over samples into the encoded images of features.

    `planes` name those of the sums, in order; by default they are what the features need. `whole`: the
    images are those of a network of integers. `rays`: those of features [lower_encode].
    """
    chosen, promised = target_named(target), profiles.profile_named(profile)
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
            f"target {target} has no kernels that encode features: use one that has them, such as opencl"
        )
    dialect = chosen.dialect
    if dialect:
        _check_images(images, dialect)
    arguments = dialect.said[interface.ENCODE] if dialect else PRINTED
    arguments = arguments.format(planes="\n".join(textwrap.wrap(", ".join(planes), 98)))
    header = _header(program, images, dialect.language if dialect else chosen.language, arguments)
    if dialect is None:
        text = "".join(f"# {line}".rstrip() + "\n" for line in header) + ir.text(program)
        entry = chosen.entry
    else:
        bounded = promised.sine is not None
        text = _emit(program, dialect, planes, images, header, bounded)
        entry = dialect.entries[interface.ENCODE]
    name = f"encode{chosen.suffix}"
    manifest = {
        "schema": SCHEMA,
        "digest": ir.sha256(text.encode()),
        "program": ir.digest(program),
        "target": target,
        "language": chosen.language,
        "entry_point": entry,
        "profile": {"name": promised.name, "text": promised.text},
        "passes": [*PASSES, *promised.passes],
        "planes": list(planes),
        "images": [image.facts for image in images],
        "arguments": arguments,
        "bound": None,
        "files": {name: ir.sha256(text.encode())},
        SIZES: {name: len(text.encode())},
    }
    return EncodeArtifact(target, profile, entry, text, name, program, planes, images, manifest)


def _check_images(images: Sequence[Image], dialect: Dialect) -> None:
    """Refuse more images than a language draws at once."""
    if len(images) > (most := dialect.max_images):
        raise CompileError(
            f"the kernel encodes {len(images)} features: {dialect.language} writes at most {most} images at "
            "once; use fewer"
        )


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


def error_at(
    artifact: EncodeArtifact, sums: Mapping[str, Any], samples: int
) -> dict[str, NDArray[np.float64]]:
    """Return the bound (H, W, C) of each image's error against float64, at planes of sums (H, W) by name."""
    names = planes_of([image.name for image in artifact.images])
    inputs = {name: np.asarray(sums[name], np.float64) for name in names}
    inputs[SAMPLES] = np.full(inputs[names[0]].shape, float(samples))
    contract = sine_contract(artifact.profile, artifact.target)
    boxes = {name: (value, value) for name, value in inputs.items()}
    found = bounds.enclose(artifact.program, boxes, contract)
    errors = {name: found[index].read for name, index in artifact.program.outputs}
    return {
        image.name: np.stack([errors[channel_name(image.name, c)] for c in range(image.channels)], axis=-1)
        for image in artifact.images
    }


def _header(program: Program, images: Sequence[Image], language: str, arguments: str) -> list[str]:
    """Return the lines of the comment at the top of the source."""
    described = [f"{i.name}: {i.channels} channels in {i.range_text}, {i.encoding}" for i in images]
    first, *others = arguments.split("\n")
    return [
        f"wamnet encoding of features, {language}. Generated: change the compiler, not this text.",
        f"program   {ir.digest(program)[:32]}",
        f"images    {described[0]}",
        *(f"          {line}" for line in described[1:]),
        "bound     at given sums: see the rules for each operation",
        f"arguments {first}",
        *(f"          {line}" for line in others),
    ]


def _emit(
    program: Program,
    dialect: Dialect,
    planes: Sequence[str],
    images: Sequence[Image],
    header: Sequence[str],
    bounded: bool,
) -> str:
    """Return the kernel's source; `header` are the lines of the comment at its top.

    `bounded`: the language must keep the order of operations, on which bounds rest.
    """
    kernel = interface.encoding(len(planes), images, dialect.integers[interface.ENCODE])
    body = [f"    {line}" for line in _body(program, dialect, planes, images)]
    return framed(dialect, kernel, Parts(bounded=bounded), header, body)


def _body(program: Program, dialect: Dialect, planes: Sequence[str], images: Sequence[Image]) -> list[str]:
    """Return the statements: loads of planes, operations, stores of channels."""
    lines = []
    for name in planes_of([image.name for image in images]):
        number = planes.index(name)
        buffer, component = divmod(number, dialect.planes_per_buffer)
        lines.append(dialect.load.format(plane=number, name=name, buffer=buffer, component=component))
    texts = statements(program, dialect, lines)
    outputs = dict(program.outputs)
    for image in images:
        for channel in range(image.channels):
            value = texts[outputs[channel_name(image.name, channel)]]
            store = dialect.image_store
            place = {"image": image.name, "channels": image.channels, "channel": channel}
            lines.append(store.format(value=value, **place))
    return lines


def statements(program: Program, dialect: Dialect, lines: list[str]) -> list[str]:
    """Write one statement for each operation; return the text of each value."""
    texts: list[str] = []
    for index, node in enumerate(program.nodes):
        if node.op == "input":
            texts.append(str(node["name"]))
        elif node.op == "constant":
            texts.append(dialect.constant(node))
        else:
            kind = program.nodes[node.args[-1]].type.dtype
            expression = dialect.expression(node, kind, [texts[arg] for arg in node.args])
            lines.append(dialect.let(node.type.dtype, f"t{index}", expression, kept=True))
            texts.append(f"t{index}")
    return texts
