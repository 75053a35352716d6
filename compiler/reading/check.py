"""Check the text of a kernel against its certificate: `check_text`."""

from __future__ import annotations

import hashlib
import math
import re
import secrets
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...refimpl.reading import read_file
from ..parsing.parse import parse
from ..proof.evidence import NODE, Refused, read, same
from .builtins import BUILTINS
from .claim import Claim
from .field import add_up_lanes, equal, fold_lanes, literal
from .frame import TRUE, cleaned
from .groups import FLAGS, Group, group_lanes, tile_lanes
from .lanes import Place, Raw, Unread, Wrong, axis_of, lanes_for
from .languages import LANGUAGES, Language, is_read, parsed
from .limits import limited
from .machine import Machine
from .memory import Image, Memory, Pointer, Result
from .spectra import Tiles
from .tokens import Text, Type, Variable
from .words import Stored, pointed

KEYS = {
    "": "schema digest program target language entry_point profile sine passes window images output "
    "arguments bound certificate sine_arguments info files file_bytes private_bytes schedule "
    "weights variant factored",
    "window": "size border centre rows columns",
    "images": "name channels encoding low high whole",
    "output": "name channels encoding",
    "bound": "output against",
    "profile": "name text",
    "schedule": "name idea pixels rows group shared_bytes weights_a_texel asked reason",
    "weights": "count layout order folder",
}
"""All that a manifest, and each of its parts, may state."""

AGAINST = re.compile(
    r"float64 reference, same float32 weights and images|reference in integers, the same bits"
)
"""What a certified bound is against."""

MEANINGLESS = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError, AssertionError)
"""What Python raises where a text does with its values what no text of a kernel does."""


def check_text(path: Path, source: Path | None = None) -> dict[str, int]:
    """Return how much of the text beside a certificate was held against it, or of another one, `source`.

    Raises `Refused` for a text that does not compute the certificate's program, and `Unread` for one with
    constructs that this reader does not know, or in a language that it does not read.
    """
    held, manifest, _, _, weights = read(path)
    sources = [name for name in manifest["files"] if name != "weights.bin"]
    if len(sources) != 1:
        raise Unread(f"kernels of {len(sources)} texts")
    if not is_read(manifest):
        kind = f"schedule {manifest['schedule']['name']}, profile {manifest['profile']['name']}"
        raise Unread(f"texts of target {manifest['target']} with {kind}")
    own = read_file(path.parent / sources[0], "kernel", "restore it")
    try:
        check_facts(manifest, held, own + weights.tobytes())
    except MEANINGLESS as error:
        raise Refused(f"manifest: a fact is of another form ({error})") from error
    text = read_file(source, "kernel", "name a text in the kernel's language") if source else own
    read_files = text.decode(errors="replace"), held, manifest, weights
    answers = limited(run_text, [(*read_files, k) for k in range(len(TRUE.get(manifest["target"], ((),))))])
    return answers[0]  # type: ignore[no-any-return]


def run_text(
    source: str, held: Any, manifest: Any, weights: Any, compiler: int | None = None
) -> dict[str, int]:
    """Run a text in every lane, for each kind of compiler that it makes a difference between, or for one."""
    language, schedule = LANGUAGES[manifest["target"]], manifest["schedule"]
    pixels, rows, group = int(schedule.get("pixels", 1)), int(schedule.get("rows", 1)), schedule.get("group")
    window, centre = int(manifest["window"]["size"]), int(manifest["window"]["centre"])
    seed = secrets.randbits(31)
    try:
        check_manifest(manifest, str(held["program"]), "spectra" in held)
        tiles = Tiles(held["spectra"], pixels, rows, window) if "spectra" in held else None
        if tiles:
            lanes = tile_lanes((pixels, rows), window, not language.within, seed)
        elif group:
            lanes = group_lanes((group[0], group[1]), pixels, window, seed)
        else:
            reach = max(centre, window - centre)
            lanes = lanes_for((reach + pixels - 1, reach), pixels, not language.within, seed)
        counts = (lanes.x < lanes.known[1]) & (lanes.y < lanes.known[3])
        fold_lanes(counts) if tiles else add_up_lanes(np.ones(lanes.count, dtype=bool) if group else counts)
        claim = Claim(held, manifest, weights, lanes, pixels, group[0] if group else 1, tiles)
        lanes.channels = max(int(manifest["output"]["channels"]), *(int(n) for _, n in claim.images))
        texts = different(source, language, manifest)
        for text in texts if compiler is None else texts[compiler : compiler + 1]:
            claim.found.clear()
            lanes.active = np.ones(lanes.count, dtype=bool)
            run_once(text, claim, manifest, language)
            if language.host:
                check_host(text, language.host, manifest["entry_point"], claim)
    except Wrong as error:
        raise Refused(f"source: {error}") from error
    except RecursionError as error:
        raise Unread("expressions, or blocks, so deep in each other") from error
    except MEANINGLESS as error:
        raise Refused(f"source: it has no meaning to the checker ({error})") from error
    finally:
        add_up_lanes(None)
    return {"sums": len(claim.tables) * claim.together, "lanes": lanes.count, "compilers": len(texts)}


def check_manifest(manifest: Any, program: str, tiles: bool) -> None:
    """Refuse a manifest by which a host would give a kernel other images, or work items, than it has."""
    schedule, size = manifest["schedule"], manifest["window"]["size"]
    own = [
        f"window {size}x{size}, border {manifest['window']['border']}",
        *("image {name}: {channels} in [{low}, {high}]".format(**image) for image in manifest["images"]),
        f"output {manifest['output']['name']} =",
    ]
    found = re.findall(r"(?m)^  (window .*|image .*|output \w+ =)", program.replace(" whole in ", " in "))
    items = [schedule.get("pixels", 1), schedule.get("rows", 1), *schedule.get("group", (1, 1))]
    if own != found or len(items) != 4 or not all(type(n) is int and n > 0 for n in items):
        raise Wrong("its manifest has other images, another window or other work items than its program")
    name, grouped = schedule["name"], re.fullmatch(r"group(\d*)", schedule["name"])
    right = (name == "plain") <= (items == [1] * 4) and name.startswith("group") == ("group" in schedule)
    if not right or (grouped and items[0] != int(grouped[1] or 1)):
        raise Wrong(f"its manifest has other work items than schedule {name}")
    if not manifest["language"].startswith(LANGUAGES[manifest["target"]].title):
        raise Wrong(f"its manifest has language {manifest['language']!r} for target {manifest['target']}")
    if items[1] != 1 and not tiles:
        raise Wrong("its manifest gives a work item several rows")


def check_facts(manifest: Any, held: Any, kernel: bytes) -> None:
    """Reject a manifest that states more than its schema has, or another fact than certificate and program.

    What a host reads in words, such as `arguments`, is a string: what it says is not checked. `kernel`: the
    bytes of source and weights.
    """
    same("manifest: digests of its files", manifest["files"], held["files"])
    same("manifest: digest of the kernel", manifest["digest"], hashlib.sha256(kernel).hexdigest())
    same("manifest: certificate", manifest["certificate"], "denoise.certificate.json")
    for at, names in KEYS.items():
        parts = [manifest] if not at else manifest[at] if at == "images" else [manifest[at]]
        same(f"manifest: unknown keys{at and f' of {at}'}", set().union(*parts) - {*names.split()}, set())
    words = [
        manifest["language"],
        manifest["arguments"],
        manifest["profile"]["text"],
        manifest["schedule"]["idea"],
    ]
    words += [one["encoding"] for one in (*manifest["images"], manifest["output"])]
    words += [manifest["weights"]["order"]]
    same("manifest: descriptions are strings", {type(word) for word in words}, {str})
    same("manifest: private_bytes is a count", type(manifest["private_bytes"]) is int, True)
    against = held["bound"]["against"]
    same("manifest: what its bound is against", manifest["bound"]["against"], against)
    same("bound: against a reference", bool(AGAINST.fullmatch(against)), True)
    text = str(held["program"])
    nodes = {m[1]: m for m in map(NODE.match, text.splitlines()) if m}
    own = [int(nodes[n][5] or 1) for n in re.findall(r"(?m)^  output \w+ = %(\d+)$", text)]
    same("manifest: channels of the output", [manifest["output"]["channels"]], own)
    sines = manifest["sine_arguments"]
    same("manifest: sine_arguments", len(sines), sum(m[2] == "sin" for m in nodes.values()))
    most = manifest["sine"]["domain"] if sines else 0
    right = all(-most <= low <= high <= most for low, high in sines)
    same("manifest: sine_arguments are ranges in the sine's domain", right, True)
    degree = re.search(r"of degree (\d+)", (held.get("sine") or {}).get("text", ""))
    name = manifest["profile"]["name"].partition("-sine")[2] or "11"
    same("profile: degree of its sine", name, degree[1] if degree else name)
    # Older manifests state no lengths [refimpl/reading.py: stated_bytes].
    lengths = manifest.get("file_bytes", dict.fromkeys(manifest["files"], 0))
    same("manifest: names in file_bytes", set(lengths), set(manifest["files"]))
    same("manifest: lengths in file_bytes are integers", {type(n) for n in lengths.values()}, {int})
    for slot in manifest["weights"]["layout"]:
        sides, first = slot["shape"], slot["offset"]
        right = bool(sides) and all(type(n) is int and n > 0 for n in [*sides, first + 1])
        within = right and first + math.prod(sides) <= manifest["weights"]["count"]
        same(f"manifest: layout of {slot['name']} lies in the weights", within, True)
    layout = {slot["name"]: slot["offset"] for slot in manifest["weights"]["layout"]}
    places = {} if "spectra" in held else held["parameters"]
    stated = {name: place["offset"] for name, place in places.items() if "offset" in place}
    same("manifest: layout of the weights", {name: layout.get(name) for name in stated}, stated)


def different(source: str, language: Language, manifest: Any) -> list[Text]:
    """Return what a text is for a language's compilers, each once."""
    target, output = manifest["target"], manifest["output"]
    channels = {f"image_{image['name']}": image["channels"] for image in manifest["images"]}
    parse(source, target, {**channels, "result": output["channels"]}, any(manifest["bound"]["output"]))
    source = cleaned(source)
    if target == "glsl-es" and not source.startswith("#version"):
        raise Unread("a source that does not begin with its version")
    found: list[Text] = []
    for true in TRUE.get(target, ((),)):
        text = parsed(source, language, true)
        if text not in found:
            found.append(text)
    return found


def run_once(text: Text, claim: Claim, manifest: Any, language: Language) -> None:
    """Run a text, parsed: `Wrong` unless it writes the claim's outputs, and nothing else."""
    lanes, channels, size = (
        claim.lanes,
        int(manifest["output"]["channels"]),
        manifest["schedule"].get("group"),
    )
    result, target = Result(claim, channels), Memory("result", 4, kind="float32")
    given = arguments(claim, language.fragment, result, target)
    group = Group(lanes, size[0] * size[1]) if size else None
    known: Mapping[str, Any]
    calls: Mapping[str, Any]
    if group:
        known, calls = {**group.brings(), **FLAGS}, group.calls()
    else:
        known, calls = items(claim, language.fragment)
    names = {v.name: sized(given[v.name], v) for v, _ in text.outside if v.name in given}
    names |= {name: known[name] for name in language.brings if name in known}
    span_of = claim.ranges.of if claim.stated else None
    machine = Machine(text, lanes, names, {**BUILTINS, **calls}, claim.added, group, span_of)
    machine.aligned, machine.mixes = language.aligned, language.mixes
    if group and text.group and [machine.value(n) for n in text.group][:2] != size:
        raise Wrong(f"its groups are not of {size[0]} x {size[1]} items")
    entry = manifest["entry_point"]
    takes = text.functions[entry].takes
    check_interface(text, [v.name for v in takes if v.role not in known], claim)
    machine.call(entry, [known[v.role] if v.role in known else sized(given[v.name], v) for v in takes])
    shared = 4 * sum(memory.size for memory in group.memories) if group else 0
    if shared != manifest["schedule"].get("shared_bytes", 0):
        raise Wrong(f"its groups share {shared} bytes, not what its manifest says")
    if language.fragment:
        for channel in range(channels):
            result.hold(0, channel, target.load(channel, 1, machine), machine.running)
        if channels < 4 and not equal(target.load(3, 1, machine).known, literal(1.0, "float32").known):
            raise Wrong("the fourth number of its result is not 1")
    result.complete()


CALLED = {"w": "weights", "width": "size", "height": "size"}
"""What a binding's names are for, where they are others."""


def check_interface(text: Text, takes: Sequence[str], claim: Claim) -> None:
    """Refuse a text whose bindings, or whose arguments' places, are not those that hosts fill."""
    images = [f"image_{name}" for name, _ in claim.images]
    wanted = {name: n for n, name in enumerate(("size", "weights", "result", *images))}
    bound = {CALLED.get(name, name): n for name, n in text.bindings.items()}
    if bound and bound != wanted:
        raise Wrong("its bindings are not the size, the weights, the result and the images, from 0")
    places = [*images, "weights", "result", "width", "height"]
    if takes and not bound and list(takes)[: len(places)] != places:
        raise Wrong("its arguments are not the images, the weights, the result, width and height")


def arguments(claim: Claim, fragment: bool, result: Result, target: Memory) -> dict[str, Any]:
    """Return what a kernel is given, by name."""
    lanes = claim.lanes
    x, width, y, height = (lanes.place(axis) for axis in range(4))
    spans = claim.ranges.images(claim.text)
    images = {
        f"image_{name}": Image(name, int(n), (width, height), spans.get(name)) for name, n in claim.images
    }
    weights = Pointer(claim.weights, 0)
    size = {"width": width, "height": height}
    given: dict[str, Any] = {
        **size, "size": size, **dict.fromkeys(("weights", "weight_texture", "w"), weights),
    }  # fmt: skip
    if lanes.inside is None:
        given |= {"x": x, "y": y, "tile_x": x, "tile_y": y}
    if fragment:
        return given | images | {"result": Pointer(target, 0, 4, ())}
    return (
        given | {name: Pointer(image, 0) for name, image in images.items()} | {"result": Pointer(result, 0)}
    )


def sized(value: Any, variable: Variable) -> Any:
    """Return what a kernel is given, a buffer as one of the numbers or vectors that the text declares."""
    if not isinstance(value, Pointer) or value.sizes != (None,):
        return value
    return (
        pointed(value, variable.type)
        if isinstance(value.memory, Stored)
        else Pointer(value.memory, 0, variable.type.width, of=variable.type)
    )


def check_host(text: Text, host: str, kernel: str, claim: Claim) -> None:
    """Refuse a host that is not two loops, over rows and columns, and a call with what it is given."""
    machine, tree = Machine(text, claim.lanes, {}, BUILTINS, claim.added), text.functions[host].body
    for name, end, size in (("y", "height", claim.rows), ("x", "width", claim.pixels)):
        ((form, start, below, step, inner),) = tree[1]
        own = ("name", name)
        right = (form, start[:2], start[2]) == (
            "for",
            ("declare", Variable(name, Type("int32"))),
            ("number", "0"),
        )
        right &= below == ("binary", "<", own, ("name", end))
        by = 1 if step == ("step", "++", own) else machine.value(step[3])
        if not right or by != size or step[1:3] not in (("++", own), ("+", own)):
            raise Wrong(f"{host} does not call {kernel} once for each work item")
        tree = inner
    takes = [("name", v.name) for v in text.functions[host].takes]
    if tree != ("block", [("do", ("call", ("name", kernel), [*takes, ("name", "x"), ("name", "y")]))]):
        raise Wrong(f"{host} does not call {kernel} once for each work item")


def items(claim: Claim, fragment: bool) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return the names, and functions, by which languages call a work item's place.

    CUDA's blocks have 8 by 4 threads.
    """
    lanes = claim.lanes
    x, y = lanes.place(0), lanes.place(2)
    x = Place(lanes, x.values // claim.pixels, x.form / claim.pixels)
    y = Place(lanes, y.values // claim.rows, y.form / claim.rows)
    inside, block = {}, {}
    for name, place, n in (("x", x, 8), ("y", y, 4)):
        inside[name] = Raw(lanes.constant(place.values % n))
        block[name] = Raw(Place(lanes, place.values // n, place.form / n))
    pixel = {"x": Raw(x, not fragment), "y": Raw(y, not fragment)}
    whole = ("gl_FragCoord", "gl_GlobalInvocationID", "global_invocation_id", "thread_position_in_grid")
    names = {
        **dict.fromkeys(whole, pixel), "threadIdx": inside, "blockIdx": block,
        "blockDim": {"x": Raw(lanes.constant(8)), "y": Raw(lanes.constant(4))},
    }  # fmt: skip
    return names, {"get_global_id": lambda machine, axis: axis_of((pixel["x"], pixel["y"]), axis)}
