"""What an exported kernel is bound to, as a manifest says it: numbers, names, registers and so on.

Where a model reads colour smoothed, or a mean over the pictures before, and the target's language has the
kernels, an export has these too [`inputs_of`], each in a folder of `inputs/`. Elsewhere the host makes the
images by the formulas of the manifest.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...compiler.artifact import Artifact
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
from ...compiler.languages.glsl_buffers import GROUP
from ...compiler.scenes.history_kernel import compile_history
from ...compiler.scenes.smooth_kernel import compile_smoothing
from ...compiler.targets import Language
from ...refimpl.frame import HISTORY
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ...refimpl.network.smoothing import LEVELS
from .targets import DISPATCHED, Row

Binding = dict[str, Any]
"""`name`, `access`, `type`, `shape`, and `slot`: a number, a name, a register or a place."""


def folder_of(role: str) -> str:
    """Return the folder of a kernel, or that of all passes of a host that write a feature."""
    return "features" if role.startswith("feature ") else role


def kernels(
    row: Row, made: Mapping[str, Artifact], sources: Mapping[str, Mapping[str, bytes]]
) -> list[dict[str, Any]]:
    """Return what a manifest says about each kernel, by its name, in the order in which they run.

    `sources`: the files of their sources, and of passes of a host that write a feature, which come first.
    """
    written = {"name": "colour", "access": WRITE, "type": "float32", "shape": ["height", "width", 4]}
    listed = {
        role: [f"{folder_of(role)}/{name}" for name in sorted(files)] for role, files in sources.items()
    }
    found: list[dict[str, Any]] = [
        {
            "role": role,
            "files": listed[role],
            "entry_point": made["denoise"].entry_point,
            "bindings": [{**written, "slot": f"the texture of image_{role.removeprefix('feature ')}"}],
            "arguments": "none: the host's own; every frame has random numbers of its own",
        }
        for role in sources
        if role not in made
    ]
    for role, kernel in made.items():
        facts = {
            "role": role,
            "files": listed[role],
            "entry_point": kernel.entry_point,
            "bindings": bound(kernel.interface, row.slots),
            "arguments": kernel.manifest["arguments"],
        }
        own = {"schedule": kernel.manifest["schedule"]} if kernel.role == DENOISE else {}
        found.append(facts | own)
    return found


def started(schedule: Mapping[str, Any]) -> dict[str, int]:
    """Return the pixels of an item, the items of a group, and the pixels of a group."""
    columns, rows = schedule["pixels"], schedule.get("rows", 1)
    width, height = schedule.get("group", GROUP)
    found = {"columns": columns, "rows": rows, "group_x": width, "group_y": height}
    return {**found, "across": width * columns, "down": height * rows}


NAMED = {
    SCENE_NUMBERS: f"uniform {SCENE_NUMBERS}",
    SUMS: "textures sums_0, sums_1, ...: four planes each",
    WEIGHTS: "texture weight_texture",
}
"""Arrays of fragment shaders whose slots are not textures of their names."""


def bound(interface: Interface, slots: str) -> list[Binding]:
    """Return what a kernel is bound to, by the slots of its target.

    numbered: 0 are the integers; registers: HLSL's, b constants, t what is read, u what is written;
    arguments, header: places in a list; channels: those of a tab of Shadertoy; names: uniforms, textures and
    colour buffers of a fragment shader.
    """
    numbers, colours, found = {"sizes": 0, **interface.numbers()}, 0, []
    for place, each in enumerate(_ordered(interface, slots)):
        name, reads, constant = each["name"], each["access"] == READ, "uniform" in each["type"]
        slot: int | str = place
        if slots == "numbered":
            slot = numbers[name]
        elif slots == "registers":
            slot = f"{'b' if constant else 't' if reads else 'u'}{numbers[name]}"
        elif slots == "channels":
            slot = f"iChannel{place}" if reads else "fragColor"
        elif slots == "names" and reads:
            usual = f"{'uniform' if each['type'] == 'int32' else 'texture'} {name}"
            slot = "uniform block Weights" if constant else NAMED.get(name, usual)
        elif slots == "names":
            first, colours = colours, colours - (-int(each["shape"][0 if interface.role == PATH else 2]) // 4)
            several = colours - first > 1
            slot = f"colour buffers {first} to {colours - 1}" if several else f"colour buffer {first}"
        vectors = {"type": "float32, four to a vec4"} if slot == NAMED[SCENE_NUMBERS] else {}
        found.append({**each, **vectors, "slot": slot})
    return found


def _ordered(interface: Interface, slots: str) -> list[Binding]:
    """Return arrays and integers without slots, in the order in which they are bound."""
    arrays: list[Binding] = [
        {
            "name": array.name,
            "access": array.access,
            "type": "uniform" if array.home == BLOCK else "float32",
            "shape": [*array.shape, *[array.lanes] * (array.lanes > 1)],
        }
        for array in interface.arrays
        if array.shape != (0,)
    ]
    integer, numbers = {"access": READ, "type": "int32"}, interface.numbers()
    if slots in DISPATCHED:
        sizes = {**integer, "name": "sizes", "type": "int32 in a uniform buffer"}
        return [
            {**sizes, "shape": list(interface.integers)},
            *sorted(arrays, key=lambda each: numbers[each["name"]]),
        ]
    if slots == "channels":
        return sorted(arrays, key=lambda each: each["access"] == WRITE)
    if slots == "header" and interface.role == PATH:  # a path's integers are one structure
        return [{**integer, "name": "part", "shape": list(interface.integers)}, *arrays]
    return [*arrays, *({**integer, "name": name, "shape": []} for name in interface.integers)]


# ---- kernels of inputs ------------------------------------------------------------------------------------

FOLDER = "inputs"
"""The folder of these kernels."""

DOES = {
    "guide": "Light and guides of a frame's layers, once a frame.",
    "smooth": f"A level of the filter: with gap {', '.join(str(2**n) for n in range(LEVELS))}, in turn.",
    "encode": "The feature's image, of the last level's light.",
    "follow": "A history with one picture more.",
}
"""What each does, by role."""


def inputs_of(model: Model, language: Language) -> dict[str, Artifact]:
    """Return the kernels of a model's inputs by role, in the order in which they run; none without any."""
    found: dict[str, Artifact] = {}
    if 1 in language.planes and any(FEATURES[name].guides for name in model.features):
        found |= compile_smoothing(model.normalization, language)._asdict()
    if 1 in language.planes and any(FEATURES[name].layer in HISTORY for name in model.features):
        found["follow"] = compile_history(language)
    return found


def input_facts(model: Model, inputs: Mapping[str, Artifact]) -> list[dict[str, Any]]:
    """Return what an export's manifest says of these kernels."""
    smoothed = [name for name in model.features if FEATURES[name].guides]
    before = [name for name in model.features if FEATURES[name].layer in HISTORY]
    return [
        {
            "role": role,
            "does": DOES[role],
            "features": before if role == "follow" else smoothed,
            "files": [f"{FOLDER}/{role}/{kernel.source_name}"],
            "entry_point": kernel.entry_point,
            "arguments": kernel.manifest["arguments"],
        }
        for role, kernel in inputs.items()
    ]
