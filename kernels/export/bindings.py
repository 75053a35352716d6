"""What an exported kernel is bound to, as a manifest says it: numbers, names, registers and so on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ...compiler.artifact import Artifact
from ...compiler.encode_kernel import EncodeArtifact
from ...compiler.glsl_buffers import FIRST_IMAGE
from ...compiler.ir import OUTPUT_ENCODING, Image
from ...compiler.lower import lower
from ...compiler.path_kernel import PathArtifact
from ...compiler.weight_homes import INLINE, UNIFORM
from ...refimpl.denoise import Model
from .targets import Row

SIZES: Mapping[str, tuple[str, ...]] = {
    "denoise": ("width", "height"),
    "path": ("width", "height", "first_row", "rows", "first_sample", "samples", "seed_number"),
    "encode": ("width", "height", "sample_count"),
}
"""The 32-bit integers that a kernel takes, in order, by what it does."""

WITHOUT_ROWS = ("opencl",)
"""Targets whose path kernel takes no number of rows: its global size says it."""

Binding = dict[str, Any]
"""`name`, `access`, `type`, `shape`, and `slot`: a number, a name, a register or a place."""


def images(model: Model) -> list[dict[str, Any]]:
    """Return the images of a model, as manifests of kernels say it."""
    gather = lower(model).gather
    assert gather is not None, "models have windows"
    return [asdict(image) for image in gather.images]


def encoding(model: Model) -> str:
    """Return the formula of a model's output."""
    return dict(lower(model).info)[OUTPUT_ENCODING]


def kernels(
    row: Row,
    denoiser: Artifact,
    path: PathArtifact | None,
    encoder: EncodeArtifact | None,
    passes: Mapping[str, str],
) -> list[dict[str, Any]]:
    """Return what a manifest says about each kernel, in the order in which they run."""
    found = [_pass(row, name, text) for name, text in passes.items()]
    if path is not None:
        found.append(_kernel(row, "path", path, _of_path(path)))
    if encoder is not None:
        found.append(_kernel(row, "encode", encoder, _of_encoder(encoder)))
    for kernel in denoiser.kernels:
        role = "denoise" if kernel is denoiser else "horizontal"
        found.append(_kernel(row, role, kernel, _of_denoiser(kernel)))
    return found


def _of_denoiser(kernel: Artifact) -> list[Binding]:
    """Return what a denoiser reads and writes, without slots, in the order of its arguments."""
    gather = kernel.program.gather
    assert gather is not None, "kernels have windows"
    found = [_image(image) for image in gather.images]
    home = kernel.target.partition(":")[2]
    if home != INLINE and kernel.weights.size:
        found.append(
            {"name": "weights", "access": "read", "type": "uniform" if home == UNIFORM else "float32"}
            | {"shape": [int(kernel.weights.size)]}
        )
    channels = int(kernel.manifest["output"]["channels"])
    return [*found, _array("result", "write", ["height", "width", channels])]


def _of_path(kernel: PathArtifact) -> list[Binding]:
    """Return what a path kernel writes."""
    return [_array("sums", "write", [len(kernel.planes), "rows", "width"])]


def _of_encoder(kernel: EncodeArtifact) -> list[Binding]:
    """Return what an encoding reads and writes."""
    written = [{**_image(image), "access": "write"} for image in kernel.images]
    return [_array("sums", "read", [len(kernel.planes), "height", "width"]), *written]


def _array(name: str, access: str, shape: Sequence[int | str]) -> Binding:
    """Return a binding of an array."""
    return {"name": name, "access": access, "type": "float32", "shape": list(shape)}


def _image(image: Image) -> Binding:
    """Return a binding of an image that is read."""
    return _array(f"image_{image.name}", "read", ["height", "width", image.channels])


def _kernel(
    row: Row, role: str, kernel: Artifact | PathArtifact | EncodeArtifact, bound: Sequence[Binding]
) -> dict[str, Any]:
    """Return what a manifest says about one kernel."""
    files = sorted(row.files("denoise" if role == "horizontal" else role, kernel.source))
    return {
        "role": role,
        "files": [f"{role}/{name}" for name in files],
        "entry_point": row.entry or kernel.entry_point,
        "bindings": SLOTS[row.slots](role, kernel.target.partition(":")[0], bound),
        "arguments": kernel.manifest["arguments"],
        **({"schedule": kernel.manifest["schedule"]} if isinstance(kernel, Artifact) else {}),
    }


def _pass(row: Row, name: str, text: str) -> dict[str, Any]:
    """Return what a manifest says about a pass that writes a feature."""
    return {
        "role": f"feature {name}",
        "files": [f"features/{file}" for file in row.files(f"feature.{name}", text)],
        "entry_point": row.entry or "fragment",
        "bindings": [
            {**_array("colour", "write", ["height", "width", 4]), "slot": f"the texture of image_{name}"}
        ],
        "arguments": "none: the host's own; every frame has random numbers of its own",
    }


def _integers(role: str, target: str) -> list[str]:
    """Return the names of a kernel's integers."""
    names = SIZES["denoise" if role == "horizontal" else role]
    return [name for name in names if name != "rows" or target not in WITHOUT_ROWS]


def _numbered(role: str, target: str, bound: Sequence[Binding]) -> list[Binding]:
    """Return bindings with numbers: 0 sizes, 1 what is read but images, 2 what is written, 3 images."""
    fixed = {"weights": 1, "result": 2}
    fixed |= {"sums": 2 if role == "path" else 1}
    rest = iter(range(FIRST_IMAGE, FIRST_IMAGE + len(bound)))
    sizes = {"name": "sizes", "access": "read", "type": "int32 in a uniform buffer", "slot": 0}
    names = _integers(role, target)
    found = [{**each, "slot": fixed.get(each["name"]) or next(rest)} for each in bound]
    return [{**sizes, "shape": names}, *sorted(found, key=lambda each: int(each["slot"]))]


def _registers(role: str, target: str, bound: Sequence[Binding]) -> list[Binding]:
    """Return bindings with the registers of HLSL: b constants, t what is read, u what is written."""
    kind = {"read": "t", "write": "u"}
    found = _numbered(role, target, bound)
    for each in found:
        constant = each["slot"] == 0 or each["type"] == "uniform"
        each["slot"] = f"{'b' if constant else kind[each['access']]}{each['slot']}"
    return found


def _arguments(role: str, target: str, bound: Sequence[Binding]) -> list[Binding]:
    """Return bindings with places in a list of arguments."""
    integers = [
        {"name": name, "access": "read", "type": "int32", "shape": []} for name in _integers(role, target)
    ]
    order = [*bound, *integers]
    if target == "c" and role == "path":
        # One structure holds the integers, and stands first.
        order = [
            {"name": "part", "access": "read", "type": "int32", "shape": _integers(role, target)},
            *bound,
        ]
    return [{**each, "slot": place} for place, each in enumerate(order)]


def _names(role: str, target: str, bound: Sequence[Binding]) -> list[Binding]:
    """Return bindings with the names of uniforms and colour buffers of a fragment shader."""
    found = []
    location = 0
    for each in bound:
        if each["access"] == "write":
            count = -(-int(each["shape"][0 if role == "path" else 2]) // 4)
            slots = f"colour buffers {location} to {location + count - 1}"
            found.append({**each, "slot": slots if count > 1 else f"colour buffer {location}"})
            location += count
        elif each["name"] == "sums":
            found.append({**each, "slot": "textures sums_0, sums_1, ...: four planes each"})
        else:
            name = {"weights": "weight_texture"}.get(each["name"], each["name"])
            slot = "uniform block Weights" if each["type"] == "uniform" else f"texture {name}"
            found.append({**each, "slot": slot})
    if role in ("path", "encode"):
        names = _integers(role, target)
        names = [n for n in names if n != "rows" and (role == "path" or n == "sample_count")]
        found += [
            {"name": n, "access": "read", "type": "int32", "shape": [], "slot": f"uniform {n}"} for n in names
        ]
    return found


def _channels(role: str, target: str, bound: Sequence[Binding]) -> list[Binding]:
    """Return bindings with the channels of a Shadertoy tab."""
    read = [each for each in bound if each["access"] == "read"]
    found = [{**each, "slot": f"iChannel{i}"} for i, each in enumerate(read)]
    return found + [{**each, "slot": "fragColor"} for each in bound if each["access"] == "write"]


SLOTS: Mapping[str, Callable[[str, str, Sequence[Binding]], list[Binding]]] = {
    "numbered": _numbered,
    "registers": _registers,
    "arguments": _arguments,
    "names": _names,
    "channels": _channels,
}
"""How a target's kernels are bound, by the name in its row."""
