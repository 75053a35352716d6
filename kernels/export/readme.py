"""The README of an export: what there is, how it is called, how to check it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ...compiler.artifact import Artifact, schedule_text
from ...compiler.core.lower import OWN_NUMBERS
from ...compiler.kernel.interface import SCENE_NUMBERS, WEIGHTS
from ...compiler.languages.c import whole
from ...compiler.reading.languages import is_read
from ..devices.kernel import BATCH_TILES
from .bindings import input_section
from .hosts import scratch
from .hosts.host import Host
from .targets import DISPATCHED, ONNX, TARGETS, Row

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

PRECISIONS = (
    "* Precision: a graph states float32, and some runtimes compute in fewer bits by default, which is",
    "  far beyond the bound of the check pair; run it on each. OpenVINO: `INFERENCE_PRECISION_HINT` is",
    "  `f32`; by default it is bfloat16 on processors that have it, 16-bit floats on graphics processors.",
    "  TensorRT: no flags `FP16`, `BF16` or `INT8`, and `TF32` cleared, which is set by default. Core ML:",
    "  convert with `compute_precision=FLOAT32`, since 16 bits are the default. ONNX Runtime computes in",
    "  float32 on processors; its provider for CUDA wants `use_tf32` to be 0.",
)
"""What a README says of runtimes' defaults."""

IMAGE_LINES: Mapping[str, str] = {
    "names": 'bind_texture({number}, {name}, "{name}");',
    "channels": "   {slot}: {name}",
    "godot": 'material.set_shader_parameter("{name}", ImageTexture.create_from_image({name}))',
}
"""How a line of the code binds an image of the denoiser, by the kind of slots, or by the target."""

EARLIER: Mapping[str, str] = {
    "arguments": "/* `arguments` of this kernel in manifest.json says how many items it takes. */\n"
    "run({file}, {entry}, {arguments});",
    "header": '#include "{file}"\n{whole}({arguments});',
    "names": "glUseProgram(link(fullscreen_triangle, compile(GL_FRAGMENT_SHADER, {file})));\n"
    "{images}{integers}"
    "draw_into({written});   /* RGBA32F colour buffers, in this order; then as below */",
    "channels": "",
}
"""Lines that call a kernel before the last one, by the kind of slots; of buffers [`BUFFER_LINES`]."""

DOES: Mapping[str, str] = {
    "path": "Paths: sums over samples.",
    "encode": "The images of the features, from the sums.",
    "horizontal": "Sums along the rows: this kernel's result is the next one's image_horizontal.",
}
"""What a kernel before the last one does, by its role."""

BUFFER_LINES = """\
pipeline = create_pipeline({file}, "{entry}");
{bound}
{dispatch};"""
"""Lines that call a kernel on buffers with numbers."""


def readme(
    facts: Mapping[str, Any],
    denoiser: Artifact | None,
    host: Host | None = None,
    sizes: Mapping[str, int] | None = None,
) -> str:
    """Return the text for what a manifest says.

    `denoiser`: the kernel, None where it is a graph; `host`: the program around it, if there is one; `sizes`:
    the bytes of files by path.
    """
    # An imported network has numbers of its own.
    own = facts["output"]["encoding"] == OWN_NUMBERS
    encoded = "" if own else " Colour is encoded for the display already."
    lines = [
        f"# Denoiser for {facts['target']}",
        "",
        f"{facts['language']}. Written by `wamnet export`; `manifest.json` says the same for programs.",
        "",
        *_hosted(host),
        *_facts(facts, denoiser),
        *(PRECISIONS if facts["target"] == ONNX else ()),
        "",
        "## Kernels, in the order in which they run",
        "",
        *(line for kernel in facts["kernels"] for line in _kernel(kernel, sizes or {})),
        "## Integration",
        "",
        f"```{'python' if facts['target'] == ONNX else 'text'}",
        _code(facts),
        "```",
        "",
        f"Rows: row 0 of every image is the picture's TOP row.{encoded}",
        "",
        *input_section(facts),
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


def _hosted(host: Host | None) -> list[str]:
    """Return the section about the program around the kernels."""
    if host is None:
        return []
    storage = host.storage
    added = (
        f"its bound and {storage.added:.3g} ({storage.name}: {storage.why})" if storage.added else "its bound"
    )
    return [
        "## Run it",
        "",
        f"Here is {host.text}, complete. It needs {host.needs}. In this folder:",
        "",
        "```sh",
        host.run,
        "```",
        "",
        f"It compares the check pair with the reference, each number within {added}, and shows {host.sees}:",
        "the noisy picture on the left, the denoised one on the right, as in `expected.png`.",
        "",
        "## Facts",
        "",
    ]


def _facts(facts: Mapping[str, Any], denoiser: Artifact | None) -> Iterator[str]:
    """Yield the lines about the whole."""
    bound, window, weights, model = (facts[name] for name in ("bound", "window", "weights", "model"))
    promise = f"no promise ({bound['against']})"
    if output := bound["output"]:
        size = f"at most {max(output):g} from the float64 reference"
        promise = f"{size if any(output) else 'none, the same bits'}, for every picture in the stated ranges"
    yield f"* Error: {promise}."
    if facts["assumes"]:
        yield f"* This assumes: {facts['assumes']}."
    yield f"* Window: {window['size']} x {window['size']} pixels, border rule `{window['border']}`."
    yield f"* Weights: {weights['count'] or 'all'} numbers, {weights['where']}."
    if half := weights.get("half"):
        widened = "widen them when you load, and nothing changes"
        yield f"* `{half}` has the same weights as 16-bit floats: {widened}."
    if picked := facts["kernels"][-1].get("schedule"):
        others = [name for name in facts["schedules"] if name != picked["name"]]
        besides = f" Others, by `--schedule`: {', '.join(others)}." if others else ""
        yield f"* Schedule: {schedule_text(picked)}.{besides}"
    if speed := facts.get("speed"):
        plain = f"{speed['plain_ms']:.3g} ms with -O2 alone; " if "plain_ms" in speed else ""
        between = f"{speed['least_ms']:.3g} to {speed['most_ms']:.3g}, {speed['rounds']} runs"
        yield f"* Speed: {speed['ms']:.3g} ms ({between}) for {speed['size']} x {speed['size']} pixels"
        yield f"  on {speed['device']}, with copies of the images there and back;"
        yield f"  {plain}{speed['compile_s']:.2g} s to compile. `wamnet export --measure` measures it again."
    yield f"* Output: {facts['output']['encoding'] or 'linear'}."
    for i in facts["images"]:
        between = f"[{i['low']:g}, {i['high']:g}]"
        yield f"* Image `{i['name']}`: {i['channels']} channels in {between}; {i['encoding']}."
    yield from _rays(facts)
    if "domain" in model:
        frames, threshold = model["domain"]["frames"], model["domain"]["threshold"]
        yield (
            f"* Domain: `model.domain` in the manifest describes the features of {frames} frames that it has "
            f"learned (DOM-1); a frame farther than {threshold:.3g} from them may be denoised poorly (DOM-2)."
        )
    yield "* Size: no image, and no buffer of sums, may hold 2^31 numbers or more."
    yield from (f"* Limit: {x['name']}: needs {x['needs']} of {x['most']}." for x in facts["limits"])
    if denoiser is not None and TARGETS[facts["target"]].slots == "header":
        most, memory = max(map(scratch.stack_of, denoiser.kernels)), "its thread's stack. For threads with"
        yield f"* Stack: a call of the denoiser takes up to {most:,} bytes of {memory}"
        with_memory = f"`wamnet_image_with` of `{scratch.NAME}`"
        yield f"  less (musl: 131,072), {with_memory} runs it on memory that you pass."


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
    rays, own = facts["model"]["feature_spp"], facts["scene"] and facts["scene"]["feature_rays"]
    if rays < 2:
        return []
    line = f"* The model was trained on features averaged over {rays} camera rays per pixel"
    if facts["scene"] is None:
        line += ": give it such images; with features of one ray edges are worse."
    elif own:
        line += f": the path kernel traces {own['count']}, spread evenly ({own['sampler']}), for any "
        line += "number of samples. Give the encoding the sums of one launch, of fewer samples than that."
    else:
        line += f". Run the path kernel with samples = {rays}, divide all planes but the colour's by {rays}, "
        line += "and give the encoding those, with sample_count = 1; with one ray edges are worse."
    return [line]


def _proof(facts: Mapping[str, Any], denoiser: Artifact | None) -> Iterator[str]:
    """Yield the lines about the certificate, and about what reads the kernel's text (CER-1, TXT-7)."""
    if denoiser is None:
        yield "There is no certificate: a runtime makes kernels of its own from a graph."
        return
    if denoiser.certificate is None:
        yield f"There is no certificate: {denoiser.plan.unproven}."
    else:
        bound = max(denoiser.certificate["bound"]["output"])
        size = f"a bound of {bound:g} for all images" if bound else "that no operation rounds"
        yield f"`{facts['certificate']}` proves {size} in their ranges. This command checks it:"
        yield from ("", "```text", "wamnet certify denoise", "```", "")
        source = denoiser.source_name
        made = [f"`{name}`" for name in facts["kernels"][-1]["files"] if name != f"denoise/{source}"]
        besides = f" {', '.join(made)}: translated from it, and not read." if made else ""
        reads = f"It reads `denoise/{source}` too, and checks that this text computes what is certified."
        kind = f"schedule {denoiser.manifest['schedule']['name']}, profile {denoiser.profile}"
        unread = f"It does not read `{source}`, whose kind ({kind}) it does not know."
        yield reads + besides if is_read(denoiser.manifest) else unread
    if facts["scene"] is not None:
        yield from ("", "What traces paths or encodes features has no certificate.")


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


def _kernel(kernel: Mapping[str, Any], sizes: Mapping[str, int]) -> list[str]:
    """Return the lines about one kernel."""
    rows = []
    for b in kernel["bindings"]:
        shape = ", ".join(map(str, b["shape"])) or "1"
        rows.append(f"| {b['slot']} | `{b['name']}` | {b['access']} | {b['type']} | {shape} |")
    named = ", ".join(
        f"`{name}`" + (f" ({sizes[name]:,} bytes)" if name in sizes else "") for name in kernel["files"]
    )
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
    """Return the lines of a program that calls all kernels in their order."""
    check = facts["check"]
    if facts["target"] == ONNX:
        shape = {name: image["channels"] for name, image in check["images"].items()}
        return ONNX_CODE.format(shape=shape, height=check["height"], width=check["width"])
    row, (*earlier, last) = TARGETS[facts["target"]], facts["kernels"]
    called = [_called(row, kernel) for kernel in earlier]
    return "\n\n".join([*filter(None, called), _last(row, last)])


def _called(row: Row, kernel: Mapping[str, Any]) -> str:
    """Return the lines that call a kernel before the last one, below what it does."""
    if row.single:
        return ""
    role, file = kernel["role"], kernel["files"][0]
    given = {"file": file if row.slots == "header" else f'"{file}"', "entry": kernel["entry_point"]}
    if row.slots in DISPATCHED:
        lines = BUFFER_LINES.format(**given, bound=_buffers(kernel), dispatch=_dispatch(row, kernel))
        return f"/* {DOES[role]} */\n{lines}"
    read = [
        b["name"] for b in kernel["bindings"] if b["access"] == "read" and b["type"].startswith("float32")
    ]
    read = ["weight_texture" if name == WEIGHTS else name for name in read]
    written = [b["name"] for b in kernel["bindings"] if b["access"] == "write"]
    integers = [b["name"] for b in kernel["bindings"] if b["type"] == "int32"]
    images = IMAGE_LINES["names"]
    lines = EARLIER[row.slots].format(
        **given,
        whole=whole(kernel["entry_point"]),
        arguments=_arguments(kernel),
        images="".join(f"{images.format(number=i, name=name)}\n" for i, name in enumerate(read)),
        integers=f"set_uniforms({', '.join(integers)});\n" if integers else "",
        written=", ".join(written),
    )
    return f"/* {DOES[role]} */\n{lines}"


def _arguments(kernel: Mapping[str, Any]) -> str:
    """Return the names of what a function is given, in order; a structure by its address."""
    return ", ".join("&part" if b["name"] == "part" else b["name"] for b in kernel["bindings"])


def _buffers(kernel: Mapping[str, Any]) -> str:
    """Return the lines that bind buffers, each with what is in it."""
    lines = []
    for b in kernel["bindings"]:
        shape, inside = ", ".join(map(str, b["shape"])), {"weights": f"{kernel['role']}/weights.bin"}
        kind = "uniform" if "uniform" in b["type"] else "storage"
        says = "int32: " if b["name"] == "sizes" else f"{b['access']}: "
        lines.append(
            f"bind_{kind}(pipeline, {b['slot']}, {b['name']});   /* {says}{inside.get(b['name'], shape)} */"
        )
    return "\n".join(lines)


def _dispatch(row: Row, kernel: Mapping[str, Any]) -> str:
    """Return the call that starts a kernel, one item a pixel if no schedule says otherwise."""
    started = _started(kernel.get("schedule", {"pixels": 1}))
    return row.dispatch.format(**started, height="rows" if kernel["role"] == "path" else "height")


LAUNCHED = """\
/* {said}; arguments as above.
   `start` starts so many items along x and y, in groups of {items} x 1, and waits for the launch before.
   The last {count} arrays hold the numbers of `memory` in manifest.json for each of tile_count tiles. */
int tiles = ceil(width / {columns}) * ceil(height / {rows});
int tile_count = round_up(min(tiles, {most}), {whole});   /* or any other multiple of {whole} */
for (int first_tile = 0; first_tile < tiles; first_tile += tile_count) {{
{launches}
}}"""
"""Lines that call a denoiser of several launches."""


def _launches(kernel: Mapping[str, Any]) -> str:
    """Return the lines that call a denoiser of several launches."""
    picked = kernel["schedule"]
    entries, every = picked["entries"], zip(picked["launches"], picked["arrays"], strict=True)
    launches = [
        f"    start({number}, tile_count / {each['tiles']}, {each['lines']});   /* {', '.join(arrays)} */"
        for number, (each, arrays) in enumerate(every)
    ]
    said = f"Start {entries[0]} to {entries[-1]}, by their numbers"
    if len(set(entries)) == 1:
        said = f"Compile the text with STAGE defined as 0 to {len(entries) - 1}, or take the files"
    return LAUNCHED.format(
        said=said,
        items=picked["items"],
        count=len(picked["memory"]),
        columns=picked["pixels"],
        rows=picked["rows"],
        most=BATCH_TILES,
        whole=picked["items"] * max(each["tiles"] for each in picked["launches"]),
        launches="\n".join(launches),
    )


def _last(row: Row, kernel: Mapping[str, Any]) -> str:
    """Return the lines that call the denoiser."""
    if "launches" in kernel["schedule"]:
        return _launches(kernel)
    read = [b for b in kernel["bindings"] if b["name"].startswith("image_")]
    template = IMAGE_LINES.get(row.name, IMAGE_LINES.get(row.slots, ""))
    each = [template.format(slot=b["slot"], name=b["name"], number=i) for i, b in enumerate(read)]
    return row.code.format(
        **_started(kernel["schedule"]),
        images="\n".join(each),
        bound=_buffers(kernel),
        dispatch=_dispatch(row, kernel) if row.dispatch else "",
        arguments=_arguments(kernel),
        count=len(read),
        file=kernel["files"][0],
        entry=kernel["entry_point"],
    )
