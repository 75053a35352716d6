"""Check the text of a kernel against its certificate: `check_text`."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...refimpl.reading import read_file
from ..kernel.interface import IMAGE, ITEMS, RESULT, WEIGHTS
from ..kernel.kernel import (
    INT,
    Array,
    Body,
    Call,
    For,
    If,
    Kernel,
    Let,
    Store,
    apply,
    inside,
    integer,
    parts,
    values,
    walk,
)
from ..parsing.frames import COMMENT
from ..parsing.grammar import LANGUAGES
from ..parsing.parse import parse
from ..parsing.reader import OtherWeights, Passes
from ..proof.evidence import FIRST_PASS, Refused, nodes_of, read, same
from .claim import Claim
from .lanes import Unread, Wrong, group_lanes, lanes_for, tile_lanes
from .languages import TITLES, is_read, language_of
from .limits import limited
from .spectra import Tiles
from .trial import Trial

KEYS = {
    "": "schema digest program target language entry_point profile sine passes window images output "
    "arguments bound certificate sine_arguments info files file_bytes private_bytes schedule "
    "weights variant factored",
    "window": "size border centre rows columns",
    "images": "name channels encoding low high whole",
    "output": "name channels encoding",
    "bound": "output against",
    "profile": "name text",
    "schedule": "name idea pixels rows group shared_bytes weights_a_texel asked reason "
    "launches memory items entries arrays",
    "weights": "count layout order folder",
}
"""All that a manifest, and each of its parts, may state."""

ENTRIES = {"c": "wamnet_pixel", **dict.fromkeys(("opencl", "cuda", "metal"), "wamnet_denoise")}
"""The names of kernels by language, but for `main`."""

MEANINGLESS = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError, AssertionError)
"""What Python raises where a text does with its values what no text of a kernel does."""


def check_text(path: Path, source: Path | None = None) -> dict[str, int]:
    """Return how much of the text beside a certificate was held against it, or of another one, `source`.

    Raises `Refused` for a text that does not compute the certificate's program, and `Unread` for one with
    constructs that this reader does not know, or in a language that it does not read.
    """
    held, manifest, _, _, weights = read(path)
    before = path.with_name(FIRST_PASS + path.name)
    first = check_text(before) if "factored" in held else {}
    sources = [name for name in manifest["files"] if name != "weights.bin"]
    if len(sources) != 1:
        raise Unread(f"kernels of {len(sources)} texts")
    if not is_read(manifest):
        kind = f"schedule {manifest['schedule']['name']}, profile {manifest['profile']['name']}"
        raise Unread(f"texts of target {manifest['target']} with {kind}")
    prefix = FIRST_PASS if path.name.startswith(FIRST_PASS) else ""
    point = ENTRIES.get(language_of(manifest), "main")
    is_first = point == "wamnet_pixel" and manifest["entry_point"] == "wamnet_horizontal_pixel"
    if not is_first or "factored" in held:
        wanted = "wamnet_horizontal_pixel" if prefix and point == "wamnet_pixel" else point
        same("manifest: entry point", manifest["entry_point"], wanted)
    own = read_file(path.parent / f"{prefix}{sources[0]}", "kernel", "restore it")
    try:
        check_facts(manifest, held, own + weights.tobytes())
    except MEANINGLESS as error:
        raise Refused(f"manifest: a fact is of another form ({error})") from error
    given = read_file(source, "kernel", "name a text in the kernel's language") if source else own
    text = given.decode(errors="replace")
    if is_first:
        text = common_names(text)
    found: dict[str, int] = limited(run_text, text, held, manifest, weights)
    return {"sums": found["sums"] + first.get("sums", 0), "lanes": found["lanes"]}


def common_names(source: str) -> str:
    """Return the first of a denoiser's two headers of C with the names that its kernel has alone (KER-16)."""
    table = "wamnet_horizontal_weights"
    if re.search(r"\bwamnet_(?!horizontal_)[a-z]|WAMNET_DENOISE_H", source):
        raise Unread("names of the second kernel in the first one")
    if table in source and re.search(r"\bweights\b", COMMENT.sub(" ", source)):
        raise Unread("weights in two places")
    source = source.replace("WAMNET_HORIZONTAL_H", "WAMNET_DENOISE_H").replace(table, "weights")
    return re.sub(r"\bwamnet_horizontal_", "wamnet_", source)


def run_text(source: str, held: Any, manifest: Any, weights: Any) -> dict[str, int]:
    """Parse a text, and run it in every lane."""
    schedule = manifest["schedule"]
    pixels, rows, group = int(schedule.get("pixels", 1)), int(schedule.get("rows", 1)), schedule.get("group")
    window, centre = int(manifest["window"]["size"]), int(manifest["window"]["centre"])
    try:
        check_items(manifest, "spectra" in held)
        passes = passes_of(schedule)
        slots = max(of for of, _ in passes[0]) if passes else 1
        tiles = Tiles(held["spectra"], pixels, rows, window, bool(passes)) if "spectra" in held else None
        if tiles:
            lanes = tile_lanes((pixels, rows), window, beyond=bool(passes))
        elif group:
            lanes = group_lanes((group[0], group[1]), pixels, window)
        else:
            reach = max(centre, window - centre)
            lanes = lanes_for((reach + pixels - 1, reach), pixels)
        claim = Claim(held, manifest, weights, lanes, pixels, group[0] if group else 1, tiles, slots)
        lanes.channels = max(int(manifest["output"]["channels"]), *(n for _, n in claim.images))
        kernel = parsed(source, manifest, weights)
        check_interface(kernel, claim, manifest)
        for each in kernel.functions:
            end = () if each.result is None else (Store(RESULT, (), each.result),)
            check_used((*each.body, *end), {RESULT, *(key for key, _ in each.takes)})
        check_used(kernel.body, {RESULT})
        trial = Trial(kernel, claim, LANGUAGES[language_of(manifest)].texels)
        trial.body(kernel.body)
        trial.ended()
        bodies = (kernel.body, *(each.body for each in kernel.functions))
        if not {id(each) for body in bodies for each in walk(body)} <= trial.ran:
            raise Wrong("a statement, or a branch, is never run")
        shared = 4 * sum(memory.size for memory in trial.shared)
        if shared != schedule.get("shared_bytes", 0):
            raise Wrong(f"its groups share {shared} bytes, not what its manifest says")
    except (Wrong, OtherWeights) as error:
        raise Refused(f"source: {error}") from error
    except RecursionError as error:
        raise Unread("expressions, or blocks, so deep in each other") from error
    except MEANINGLESS as error:
        raise Refused(f"source: it has no meaning to the checker ({error})") from error
    return {"sums": len(claim.tables) * claim.together // slots, "lanes": lanes.count}


def check_used(body: Body, ends: set[str]) -> None:
    """Refuse values, arrays and loops in a body of which nothing in these names is made."""
    made: dict[str, set[str]] = {}
    note_uses(body, {}, set(), made)
    live, more = set[str](), ends
    while more:
        live |= more
        more = set().union(*(made.get(each, ()) for each in more)) - live
    for key in (key for key in made if key not in live):
        raise Wrong(f"{key.split()[0]} is computed and never read")


def note_uses(body: Body, names: Mapping[str, str], within: set[str], made: dict[str, set[str]]) -> None:
    """Note of what each name's values are made; a name has a number, as it may be declared again elsewhere.

    `names`: those around a body; `within`: what decides whether it is run.
    """
    names = dict(names)
    for statement in body:
        every = [each for value in values(statement) for each in parts(value)]
        if any(e.type == INT and len(e.args) == 2 and apply(e.op, *e.args) != e for e in every):
            raise Wrong("arithmetic that no kernel has, as sums with 0 and products with 1")
        used = {each.value for each in every if each.op in ("name", "load")}
        written = {statement.array} if isinstance(statement, Store) else set()
        if isinstance(statement, Call):
            written = {view.array for view in statement.views}
        used = {names.get(key, key) for key in (used | written)} | within
        around = used if isinstance(statement, If) else within
        if isinstance(statement, Let | Array | For):
            names[statement.name] = f"{statement.name} {len(made)}"
            written, around = {statement.name}, used | {names[statement.name]}
        for key in written:
            made.setdefault(names.get(key, key), set()).update(used)
        for inner in inside(statement):
            note_uses(inner, names, around, made)


def passes_of(schedule: Any) -> Passes | None:
    """Return what a manifest says of launches: integers above 0, each item of one tile or of the most."""
    if "launches" not in schedule and "memory" not in schedule:
        return None
    launches = [(each["tiles"], each["lines"]) for each in schedule["launches"]]
    memory = dict(schedule["memory"])
    counts = [n for pair in launches for n in pair] + [*memory.values()]
    known = all({*each} == {"tiles", "lines"} for each in schedule["launches"])
    if not known or not all(type(n) is int and n > 0 for n in counts):
        raise Wrong("its manifest has launches, or memory, of no size")
    if {of for of, _ in launches} - {1, max(of for of, _ in launches)}:
        raise Wrong("its manifest has launches of several numbers of tiles")
    return launches, memory


def check_items(manifest: Any, tiles: bool) -> None:
    """Refuse a manifest by which a host would give a kernel other work items, or weights, than it has."""
    schedule = manifest["schedule"]
    items = [schedule.get("pixels", 1), schedule.get("rows", 1), *schedule.get("group", (1, 1))]
    if len(items) != 4 or not all(type(n) is int and n > 0 for n in items):
        raise Wrong("its manifest has work items of no size")
    target, name, count = language_of(manifest), schedule["name"], manifest["weights"]["count"]
    family, _, pixels = name.partition(":")
    right = (name == "plain") <= (items == [1] * 4) and name.startswith("group") == ("group" in schedule)
    in_passes = {key in schedule for key in ("launches", "memory", "items", "entries", "arrays")}
    right = (
        right
        and (name == "plain" or ":" not in manifest["target"])
        and in_passes == {name.startswith("fftpasses")}
        and (count == 0) == (family == "inlined")
    )
    if not right or (family == "group" and str(items[0]) != pixels):
        raise Wrong(f"its manifest has other work items, or weights, than schedule {name}")
    title = "GLSL 4.30" if target == "opengl" and family not in ("plain", "inlined") else TITLES[target]
    if not manifest["language"].startswith(title):
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
    words += [manifest["factored"]["cut"]["against"]] if "factored" in held else []
    same("manifest: descriptions are strings", {type(word) for word in words}, {str})
    count = manifest["private_bytes"]
    same("manifest: private_bytes is a count", type(count) is int and count >= 0, True)
    against = held["bound"]["against"]
    same("manifest: what its bound is against", manifest["bound"]["against"], against)
    text = str(held["program"])
    nodes = nodes_of(text)
    own = [int(nodes[int(n)][5] or 1) for n in re.findall(r"(?m)^  output \w+ = %(\d+)$", text)]
    same("manifest: channels of the output", [manifest["output"]["channels"]], own)
    sines = manifest["sine_arguments"]
    same("manifest: sine_arguments", len(sines), sum(m[2] == "sin" for m in nodes))
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


def parsed(source: str, manifest: Any, weights: Any) -> Kernel:
    """Return the kernel that a text is, of the images that a manifest names."""
    output = manifest["output"]
    channels = {f"{IMAGE}{image['name']}": image["channels"] for image in manifest["images"]}
    bounded = any(manifest["bound"]["output"])
    channels[RESULT] = output["channels"]
    return parse(source, manifest["target"], channels, bounded, passes_of(manifest["schedule"]), weights)


def check_interface(kernel: Kernel, claim: Claim, manifest: Any) -> None:
    """Refuse a kernel of other images, channels or work items than hosts have for it."""
    schedule = manifest["schedule"]
    arrays = {a.name: int(a.shape[-1]) for a in kernel.interface.arrays if a.name != WEIGHTS}
    wanted = {f"{IMAGE}{name}": n for name, n in claim.images}
    if list(arrays.items()) != [*wanted.items(), (RESULT, int(manifest["output"]["channels"]))]:
        raise Wrong("its arguments are not the images, the weights, the result, width and height")
    group, size = schedule.get("group"), kernel.group
    if (group and tuple(group)) != size:
        raise Wrong(f"its groups are not of {' x '.join(map(str, group or ['no']))} items")
    stated = [schedule.get(key, ()) for key in ("arrays", "entries")]
    # In GLSL the program is compiled for each launch, in other languages each is an entry point.
    point, of_each = manifest["entry_point"], "STAGE" not in LANGUAGES[language_of(manifest)].launch
    for number, (launch, arrays, entry) in enumerate(zip(kernel.launches, *stated, strict=True)):
        every = walk(launch.body)
        used = {s.array for s in every if isinstance(s, Store)}
        used |= {e.value for s in every for v in values(s) for e in parts(v) if e.op == "load"}
        used -= {s.name for s in every if isinstance(s, Array)}
        if used != {*arrays} or entry != (f"{point}_{number}" if of_each else point):
            raise Wrong("its launches have other arrays, or entry points, than its manifest says")
    if kernel.launches and schedule["items"] != ITEMS:
        raise Wrong("its launches have groups of another size than its manifest says")
    steps = tuple(integer(kernel, each) for each in kernel.step)
    if steps != (claim.pixels, claim.rows):
        raise Wrong(f"its work items are of {steps[0]} x {steps[1]} pixels, not what its manifest says")
