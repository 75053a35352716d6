"""The README of an export: what there is, how it is called, how to check it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...compiler.artifact import Artifact
from ...compiler.languages.interface import SCENE_NUMBERS
from ...compiler.reading.languages import is_read
from ...compiler.schedules.schedules import text
from .targets import ONNX, TARGETS

ONNX_CODE = """\
import numpy as np, onnxruntime

session = onnxruntime.InferenceSession("denoise/denoise.onnx")
shape = {shape}
images = {{
    name: np.fromfile(f"check/image.{{name}}.f32", "<f4").reshape({height}, {width}, channels)
    for name, channels in shape.items()
}}
(result,) = session.run(["result"], images)   # any height and width
expected, bound = (np.fromfile(f"check/{{n}}.f32", "<f4").reshape(result.shape) for n in ("output", "bound"))
print("largest error", np.abs(result - expected).max(), "expected at most", bound.max())"""
"""A program for a graph, which checks itself."""

IMAGE_LINES: Mapping[str, str] = {
    "numbered": "bind_storage(pipeline, {slot}, {name});",
    "registers": "bind_storage(pipeline, {slot}, {name});",
    "names": 'bind_texture({number}, {name}, "{name}");',
    "channels": "   {slot}: {name}",
    "arguments": "",
    "header": "",
}
"""How a line of the code binds an image, by the kind of slots."""


def readme(facts: Mapping[str, Any], denoiser: Artifact | None) -> str:
    """Return the text for what a manifest says; `denoiser`: the kernel, None where it is a graph."""
    lines = [
        f"# Denoiser for {facts['target']}",
        "",
        f"{facts['language']}. Written by `wamnet export`; `manifest.json` says the same for programs.",
        "",
        *_facts(facts),
        "",
        "## Kernels, in the order in which they run",
        "",
        *(line for kernel in facts["kernels"] for line in _kernel(kernel)),
        "## Integration",
        "",
        f"```{'python' if facts['target'] == ONNX else 'text'}",
        _code(facts),
        "```",
        "",
        "Rows: row 0 of every image is the picture's TOP row. Colour is encoded for the display already.",
        "",
        *_moving(facts),
        "## Proof",
        "",
        *_proof(facts, denoiser),
        "",
        "## Check",
        "",
        *_check(facts["check"]),
        "",
        "## Rights",
        "",
        facts["licence"] + ".",
        "",
    ]
    return "\n".join(lines)


def _facts(facts: Mapping[str, Any]) -> list[str]:
    """Return the lines about the whole."""
    bound, window, weights = facts["bound"]["output"], facts["window"], facts["weights"]
    promise = f"no promise ({facts['bound']['against']})"
    if bound:
        size = f"at most {max(bound):g} from the float64 reference"
        promise = f"{size if any(bound) else 'none, the same bits'}, for every picture in the stated ranges"
    images = [
        f"* Image `{i['name']}`: {i['channels']} channels in [{i['low']:g}, {i['high']:g}]; {i['encoding']}."
        for i in facts["images"]
    ]
    return [
        f"* Error: {promise}.",
        *([f"* This assumes: {facts['assumes']}."] if facts["assumes"] else []),
        f"* Window: {window['size']} x {window['size']} pixels, border rule `{window['border']}`.",
        f"* Weights: {weights['count'] or 'all'} numbers, {weights['where']}.",
        *_schedule(facts),
        f"* Output: {facts['output']['encoding'] or 'linear'}.",
        *images,
        *_rays(facts),
        "* Size: no image, and no buffer of sums, may hold 2^31 numbers or more.",
        *(f"* Limit: {x['name']}: needs {x['needs']} of {x['most']}." for x in facts["limits"]),
    ]


def _schedule(facts: Mapping[str, Any]) -> list[str]:
    """Return the line about the denoiser's schedule, with the names of the other schedules."""
    picked = facts["kernels"][-1].get("schedule")
    if picked is None:
        return []
    others = [name for name in facts["schedules"] if name != picked["name"]]
    besides = f" Others, by `--schedule`: {', '.join(others)}." if others else ""
    return [f"* Schedule: {text(picked)}.{besides}"]


WRITTEN = "write_buffer(scene_numbers, rows + {count} * moment); /* {slot} of the path kernel */"
"""How a buffer of numbers is filled."""

TOLD: Mapping[str, str] = {
    "numbered": WRITTEN,
    "registers": WRITTEN,
    "arguments": WRITTEN,
    "header": "wamnet_trace(&part, sums, rows + {count} * moment);",
    "names": "float vectors[{vectors}][4] = {{{{0}}}}; /* {count} numbers, then zeros */\n"
    "memcpy(vectors, rows + {count} * moment, {count} * sizeof(float));\n"
    'glUniform4fv(glGetUniformLocation(path, "scene_numbers"), {vectors}, vectors[0]);',
}
"""Lines that give the path kernel the numbers of a moment, by the kind of slots."""


def _moving(facts: Mapping[str, Any]) -> list[str]:
    """Return the section about a scene that moves."""
    numbers = (facts["scene"] or {}).get("numbers")
    if numbers is None:
        return []
    path = next(kernel for kernel in facts["kernels"] if kernel["role"] == "path")
    slot = next(b["slot"] for b in path["bindings"] if b["name"] == SCENE_NUMBERS)
    (moments, count), rows = numbers["rows"]["shape"], numbers["rows"]
    lines = TOLD[TARGETS[facts["target"]].slots].format(count=count, vectors=-(-count // 4), slot=slot)
    formulas = {each["places"][0]["table"]: each["formula"] for each in numbers["list"]}
    return [
        "## What moves",
        "",
        f"{', '.join(numbers['moving']).capitalize()}: {count} numbers, which the path kernel is given as",
        f"`{SCENE_NUMBERS}`; all else of the scene is constant in it. `{rows['file']}` has a row of numbers",
        f"for each of {moments} times (`times` in `manifest.json`), {rows['format']}:",
        "",
        "```text",
        lines,
        "```",
        "",
        "`manifest.json` says of each number where it is in the scene's tables (`list`). A host computes",
        "others in 64 bits, and rounds once:",
        "",
        *(f"* `{table}`: {formula or 'by the rows only'}." for table, formula in formulas.items()),
        "",
    ]


def _rays(facts: Mapping[str, Any]) -> list[str]:
    """Return the line about features of more camera rays than the colour's."""
    rays = facts["model"]["feature_spp"]
    if rays < 2 or facts["scene"] is None:
        return []
    return [
        f"* The model has learned from features that are means over {rays} camera rays. Run the path kernel "
        f"again with samples = {rays}, divide all planes but the colour's by {rays}, and give the encoding "
        "those, with sample_count = 1; with features of one ray edges are worse."
    ]


def _proof(facts: Mapping[str, Any], denoiser: Artifact | None) -> list[str]:
    """Return the lines about the certificate, and about what reads the kernel's text (CER-1, TXT-7)."""
    if denoiser is None:
        return ["There is no certificate: a runtime makes kernels of its own from a graph."]
    if denoiser.certificate is None:
        found = [f"There is no certificate: {denoiser.plan.unproven}."]
    else:
        bound = max(denoiser.certificate["bound"]["output"])
        size = f"a bound of {bound:g} for all images" if bound else "that no operation rounds"
        found = [
            f"`{facts['certificate']}` proves {size} in their ranges. This command checks it:",
            *("", "```text", "wamnet certify denoise", "```", ""),
            _text(facts, denoiser),
        ]
    if facts["scene"] is not None:
        found += ["", "What traces paths or encodes features has no certificate."]
    return found


def _text(facts: Mapping[str, Any], denoiser: Artifact) -> str:
    """Return what the command does with the text of a kernel that has a certificate."""
    source, schedule = denoiser.source_name, denoiser.manifest["schedule"]["name"]
    if not is_read(denoiser.manifest):
        kind = f"schedule {schedule}, profile {denoiser.profile}"
        return f"It does not read `{source}`, whose kind ({kind}) it does not know."
    made = [name for name in facts["kernels"][-1]["files"] if name != f"denoise/{source}"]
    besides = f" {', '.join(f'`{name}`' for name in made)}: translated from it, and not read." if made else ""
    return f"It reads `denoise/{source}` too, and checks that this text computes what is certified.{besides}"


def _check(check: Mapping[str, Any]) -> list[str]:
    """Return the lines about the check pair."""
    promised = "" if check["bound"]["promised"] else "; expected, not promised, for this target"
    found = [
        f"`check/` holds a picture of {check['width']} x {check['height']} pixels, raw {check['format']}:",
        "feed the images to the denoiser, and compare with output.f32:",
        f"{check['rule']} (bound.f32{promised}).",
    ]
    if check["sums"]:
        found += [
            f"`sums.f32` are the paths' sums of this picture, seed {check['sums']['seed']}; a path",
            "that passes an edge within rounding may differ.",
        ]
    for moment in (check["sums"] or {}).get("moments", []):
        found.append(f"`{moment['file']}` are those of another moment, whose numbers are in `check.json`.")
    return found


def _kernel(kernel: Mapping[str, Any]) -> list[str]:
    """Return the lines about one kernel."""
    rows = []
    for b in kernel["bindings"]:
        shape = ", ".join(map(str, b["shape"])) or "1"
        rows.append(f"| {b['slot']} | `{b['name']}` | {b['access']} | {b['type']} | {shape} |")
    named = ", ".join(f"`{name}`" for name in kernel["files"])
    return [
        f"**{kernel['role']}**: {named}, entry point `{kernel['entry_point']}`.",
        "",
        "| where | what | access | type | shape |",
        "|---|---|---|---|---|",
        *rows,
        "",
    ]


GROUP = (8, 8)
"""Threads of a group where a kernel asks for no other number: those that its source declares, or any."""


def _started(schedule: Mapping[str, Any]) -> dict[str, int]:
    """Return the pixels of an item, the items of a group, and the pixels of a group."""
    columns, rows = schedule["pixels"], schedule.get("rows", 1)
    width, height = schedule.get("group", GROUP)
    across, down = width * columns, height * rows
    found = {"columns": columns, "rows": rows, "group_x": width, "group_y": height}
    return {**found, "across": across, "down": down}


def _code(facts: Mapping[str, Any]) -> str:
    """Return the lines of a program that calls the denoiser."""
    check = facts["check"]
    if facts["target"] == ONNX:
        shape = {name: image["channels"] for name, image in check["images"].items()}
        return ONNX_CODE.format(shape=shape, height=check["height"], width=check["width"])
    row, kernel = TARGETS[facts["target"]], facts["kernels"][-1]
    read = [
        b for b in kernel["bindings"] if b["name"].startswith("image_") or b["name"].startswith("horizontal")
    ]
    template = IMAGE_LINES[row.slots]
    if row.name == "godot":
        template = 'material.set_shader_parameter("{name}", ImageTexture.create_from_image({name}))'
    each = [template.format(slot=b["slot"], name=b["name"], number=i) for i, b in enumerate(read)]
    return row.code.format(
        **_started(kernel["schedule"]),
        images="\n".join(each),
        arguments=", ".join(b["name"] for b in kernel["bindings"]),
        count=len(read),
        file=kernel["files"][0],
        entry=kernel["entry_point"],
    )
