"""What an exported kernel is bound to, as a manifest says it: numbers, names, registers and so on.

Where a model reads colour smoothed, or a mean over the pictures before, and the target's language has the
kernels, an export has these too [`inputs_of`], each in a folder of `inputs/`. Elsewhere the host makes the
images by the formulas of the manifest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...compiler.artifact import Artifact
from ...compiler.core.ir import OUTPUT_ENCODING
from ...compiler.core.lower import lower
from ...compiler.kernel.interface import (
    BLOCK,
    DENOISE,
    PATH,
    READ,
    SCENE_NUMBERS,
    SUMS,
    WEIGHTS,
    WRITE,
    Interface,
)
from ...compiler.scenes.history_kernel import compile_history
from ...compiler.scenes.smooth_kernel import compile_smoothing
from ...compiler.targets import Language
from ...refimpl.frame import HISTORY
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ...refimpl.network.smoothing import LEVELS
from .targets import Row

Binding = dict[str, Any]
"""`name`, `access`, `type`, `shape`, and `slot`: a number, a name, a register or a place."""


def images(model: Model) -> list[dict[str, Any]]:
    """Return the images of a model, as manifests of kernels say it."""
    gather = lower(model).gather
    assert gather is not None, "models have windows"
    return [image.facts for image in gather.images]


def encoding(model: Model) -> str:
    """Return the formula of a model's output."""
    return dict(lower(model).info)[OUTPUT_ENCODING]


def kernels(row: Row, made: Mapping[str, Artifact], passes: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return what a manifest says about each kernel, by its name, in the order in which they run.

    Passes of a host that write a feature come first.
    """
    written = {"name": "colour", "access": WRITE, "type": "float32", "shape": ["height", "width", 4]}
    found: list[dict[str, Any]] = [
        {
            "role": f"feature {name}",
            "files": [f"features/{file}" for file in row.files(f"feature.{name}", text)],
            "entry_point": row.entry or "fragment",
            "bindings": [{**written, "slot": f"the texture of image_{name}"}],
            "arguments": "none: the host's own; every frame has random numbers of its own",
        }
        for name, text in passes.items()
    ]
    for role, kernel in made.items():
        facts = {
            "role": role,
            "files": [f"{role}/{name}" for name in sorted(row.files(kernel.role, kernel.source))],
            "entry_point": row.entry or kernel.entry_point,
            "bindings": SLOTS[row.slots](kernel.interface),
            "arguments": kernel.manifest["arguments"],
        }
        own = {"schedule": kernel.manifest["schedule"]} if kernel.role == DENOISE else {}
        found.append(facts | own)
    return found


def _bound(interface: Interface) -> list[Binding]:
    """Return what a kernel reads and writes, without slots, in the order of its arguments."""
    arrays = [array for array in interface.arrays if array.shape != (0,)]
    return [
        {
            "name": array.name,
            "access": array.access,
            "type": "uniform" if array.home == BLOCK else "float32",
            "shape": [*array.shape, *[array.lanes] * (array.lanes > 1)],
        }
        for array in arrays
    ]


def _integer(name: str) -> Binding:
    """Return an integer, without its slot."""
    return {"name": name, "access": READ, "type": "int32", "shape": []}


def _numbered(interface: Interface) -> list[Binding]:
    """Return bindings with numbers."""
    numbers = interface.numbers()
    found = [{**each, "slot": numbers[each["name"]]} for each in _bound(interface)]
    sizes = {"name": "sizes", "access": READ, "type": "int32 in a uniform buffer", "slot": 0}
    names = list(interface.integers)
    return [{**sizes, "shape": names}, *sorted(found, key=lambda each: int(each["slot"]))]


def _registers(interface: Interface) -> list[Binding]:
    """Return bindings with the registers of HLSL: b constants, t what is read, u what is written."""
    found = _numbered(interface)
    for each in found:
        constant = each["slot"] == 0 or each["type"] == "uniform"
        each["slot"] = f"{'b' if constant else 't' if each['access'] == READ else 'u'}{each['slot']}"
    return found


def _arguments(interface: Interface) -> list[Binding]:
    """Return bindings with places in a list of arguments."""
    order = [*_bound(interface), *(_integer(name) for name in interface.integers)]
    return [{**each, "slot": place} for place, each in enumerate(order)]


def _header(interface: Interface) -> list[Binding]:
    """Return bindings with places in the arguments of C's functions: a path's integers are one structure."""
    if interface.role != PATH:
        return _arguments(interface)
    part = {"name": "part", "access": READ, "type": "int32", "shape": list(interface.integers)}
    return [{**each, "slot": place} for place, each in enumerate([part, *_bound(interface)])]


def _names(interface: Interface) -> list[Binding]:
    """Return bindings with the names of uniforms and colour buffers of a fragment shader."""
    found = []
    location = 0
    for each in _bound(interface):
        if each["access"] == WRITE:
            count = -(-int(each["shape"][0 if interface.role == PATH else 2]) // 4)
            slots = f"colour buffers {location} to {location + count - 1}"
            found.append({**each, "slot": slots if count > 1 else f"colour buffer {location}"})
            location += count
        elif each["name"] == SCENE_NUMBERS:
            found.append({**each, "type": "float32, four to a vec4", "slot": f"uniform {SCENE_NUMBERS}"})
        elif each["name"] == SUMS:
            found.append({**each, "slot": "textures sums_0, sums_1, ...: four planes each"})
        else:
            name = {WEIGHTS: "weight_texture"}.get(each["name"], each["name"])
            slot = "uniform block Weights" if each["type"] == "uniform" else f"texture {name}"
            found.append({**each, "slot": slot})
    return found + [{**_integer(name), "slot": f"uniform {name}"} for name in interface.integers]


def _channels(interface: Interface) -> list[Binding]:
    """Return bindings with the channels of a Shadertoy tab."""
    bound = _bound(interface)
    read = [each for each in bound if each["access"] == READ]
    found = [{**each, "slot": f"iChannel{i}"} for i, each in enumerate(read)]
    return found + [{**each, "slot": "fragColor"} for each in bound if each["access"] == WRITE]


SLOTS: Mapping[str, Callable[[Interface], list[Binding]]] = {
    "numbered": _numbered,
    "registers": _registers,
    "arguments": _arguments,
    "header": _header,
    "names": _names,
    "channels": _channels,
}
"""How a target's kernels are bound, by the name in its row."""


# ---- kernels of inputs ------------------------------------------------------------------------------------

FOLDER = "inputs"
"""The folder of these kernels."""

GAPS = ", ".join(str(2**level) for level in range(LEVELS))
"""What the filter's level is given, in turn."""


@dataclass(frozen=True)
class Input:
    """A kernel, its folder's name, what it does, and the features whose images it is for."""

    kernel: Artifact
    name: str
    does: str
    features: tuple[str, ...]


def inputs_of(model: Model, language: Language) -> list[Input]:
    """Return the kernels of a model's inputs, in the order in which they run; none where there are none."""
    if 1 not in language.planes:
        return []
    smoothed = tuple(name for name in model.features if FEATURES[name].guides)
    before = tuple(name for name in model.features if FEATURES[name].layer in HISTORY)
    found = []
    if smoothed:
        kernels = compile_smoothing(model.normalization, language)
        found += [
            Input(kernels.guide, "guide", "Light and guides of a frame's layers, once a frame.", smoothed),
            Input(kernels.smooth, "smooth", f"A level of the filter: with gap {GAPS}, in turn.", smoothed),
            Input(kernels.encode, "encode", "The feature's image, of the last level's light.", smoothed),
        ]
    if before:
        found.append(Input(compile_history(language), "follow", "A history with one picture more.", before))
    return found


def input_facts(inputs: Sequence[Input]) -> list[dict[str, Any]]:
    """Return what an export's manifest says of these kernels."""
    return [
        {
            "role": each.name,
            "does": each.does,
            "features": list(each.features),
            "files": [f"{FOLDER}/{each.name}/{each.kernel.source_name}"],
            "entry_point": each.kernel.entry_point,
            "arguments": each.kernel.manifest["arguments"],
        }
        for each in inputs
    ]


def input_section(facts: Mapping[str, Any]) -> list[str]:
    """Return the section of a README about these kernels."""
    if "inputs" not in facts:
        return []
    lines = ["## Kernels of inputs", "", "A frame's layers become images by these, before the denoiser:", ""]
    for each in facts["inputs"]:
        features = ", ".join(each["features"])
        lines += [
            f"* `{each['files'][0]}`, entry point `{each['entry_point']}`, for {features}:",
            f"  {each['does']}",
        ]
    return [*lines, "", "The comment at the top of each says what its arguments are.", ""]
