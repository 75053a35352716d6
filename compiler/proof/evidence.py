"""What a certificate rests on: its kernel's manifest, the program's text, the weights, and their digests.

Checkers read it here [checker.py, integer_checker.py]; what wrote it is elsewhere [certificate.py].
"""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np

from ...refimpl.reading import parse_json, plain_name, read_file, stated_bytes

FLOATS, INTEGERS = "wamnet-certificate-1", "wamnet-integers-1"
"""The forms of certificates: of networks of floats, and of integers."""

FIRST_PASS = "horizontal."
"""What the names of the files of a first layer's first kernel begin with (FAC-6)."""

AGAINST = (
    "float64 reference, same float32 weights and images",
    "reference in integers, the same bits",
    "float64 reference of the program that was cut",
)
"""What bounds compare a kernel with: of floats, of integers, of two kernels (CER-9)."""

OTHER = re.compile(r"program|  (?:window|image|output|parameter) .+")
"""The other lines of a program's text."""

NODE = re.compile(r"  %(\d+) = (\w+)((?: %\d+,?)*)(?: \{(.*)\})? : \w+(?:\[(\d+)\])?")
"""A line of a program's text: number, operation, operands, attributes, length of the result."""


class Refused(Exception):
    """A step of a certificate that does not hold."""


def read(path: Path) -> tuple[dict[str, Any], dict[str, Any], str, dict[str, Any], Any]:
    """Return certificate, manifest, the program's text, its parameters and all weights: all digests agree."""
    texts = [read_file(p, "certificate") for p in (path, path.parent / "manifest.json")]
    held, manifest = (parse_json(text, "certificate", "restore it") for text in texts)
    same("schema", held["schema"], INTEGERS if held["schema"] == INTEGERS else FLOATS)
    first = FIRST_PASS if path.name.startswith(FIRST_PASS) and "factored" in manifest else ""
    if "factored" in manifest:
        manifest = manifest["factored"]["horizontal"] if first else _second(manifest, held)
    files, folder = {}, manifest["weights"].get("folder", ".")
    same("manifest: folder of weights.bin is . or ..", folder in (".", ".."), True)
    for name in (plain_name(name, "manifest: name of a file", "restore it") for name in manifest["files"]):
        stated = stated_bytes(manifest, name, "manifest", "restore it")
        place = path.parent / (folder if name == "weights.bin" else "") / f"{first}{name}"
        files[name] = read_file(place, "file", "restore it", stated=stated)
        same(f"digest of {name}", held["files"].get(name), hashlib.sha256(files[name]).hexdigest())
    kernel = [manifest["digest"], manifest["profile"]["name"]]
    same("digest of the kernel, and profile", [held["manifest_digest"], held["profile"]], kernel)
    if "entry_point" not in held:
        raise Refused("it has no entry point: an earlier version wrote it, so compile the model again")
    same("entry point", held["entry_point"], manifest["entry_point"])
    same("centre of the window", held["centre"], manifest["window"]["centre"])
    raw, text = np.frombuffer(files["weights.bin"], "<f4"), str(held["program"])
    arrays = parameters_of(held, raw)
    digest = digest_of(text, arrays)
    same("digest of the program in the certificate", held["program_digest"], digest)
    same("digest of the program in the manifest", manifest["program"], digest)
    check_manifest(manifest, text, len(raw))
    same("weights: all are finite", all(np.isfinite(array).all() for array in arrays.values()), True)
    return held, manifest, text, {name: a.astype(np.float64) for name, a in arrays.items()}, raw


def _second(manifest: Any, held: Any) -> Any:
    """Return the manifest of the second of two kernels, whose other files are the first one's."""
    first = manifest["factored"]["horizontal"]
    both = hashlib.sha256(f"{first['digest']} {held['manifest_digest']}".encode()).hexdigest()
    same("digest of both kernels", manifest["digest"], both)
    same("the program that was cut", "factored" in held, True)
    own = {**manifest, "digest": held["manifest_digest"]}
    for key in ("files", "file_bytes"):
        others = {f"{FIRST_PASS}{name}": value for name, value in first[key].items()}
        own[key] = {n: value for n, value in manifest[key].items() if not n.startswith(FIRST_PASS)}
        same(f"{key} of the first kernel", {**own[key], **others}, manifest[key])
    return own


def digest_of(text: str, arrays: Any) -> str:
    """Return the SHA-256 of a program: of its text, and of its arrays of float32 by their names."""
    return hashlib.sha256(text.encode() + b"".join(arrays[n].tobytes() for n in sorted(arrays))).hexdigest()


def nodes_of(text: str) -> list[re.Match[str]]:
    """Return the lines of a program's operations: each has its place for a number, and reads earlier ones."""
    lines = text.splitlines()
    found = [m for m in map(NODE.fullmatch, lines) if m]
    rest = [line for line in lines if not NODE.fullmatch(line) and not OTHER.fullmatch(line)]
    same("program: lines of no kind", rest, [])
    for number, line in enumerate(found):
        same("program: number of a line", int(line[1]), number)
        given = [int(i) for i in re.findall(r"%(\d+)", line[3])]
        same(f"program: %{number} reads earlier lines", max(given, default=-1) < number, True)
    return found


def parameters_of(held: Any, raw: Any) -> dict[str, Any]:
    """Return the parameters by name: from the certificate itself, or from the file's numbers."""
    arrays = {}
    for name, place in held["parameters"].items():
        if "base64" in place:
            array = np.frombuffer(base64.b64decode(place["base64"], validate=True), "<f4")
        else:
            at = places(name, place, len(raw))
            array = raw[at if at.min() >= 0 else len(raw)]
        arrays[name] = array.reshape(place["shape"])
        same(f"{name}: shape", [*arrays[name].shape], place["shape"])
    return arrays


def check_manifest(manifest: Any, text: str, count: int) -> None:
    """Refuse a manifest by which a host calls the kernel of another program.

    Window, images in their order, ranges and output are the program's, and what counts is an integer.
    Formula: CER-5.
    """
    same("program: at most 65,536 lines", text.count("\n") <= 2**16, True)
    same("manifest: schema", manifest["schema"], "wamnet-artifact-1")
    window, output, schedule, given = (manifest[key] for key in ("window", "output", "schedule", "images"))
    counted = [window["size"], window["centre"], output["channels"], *(image["channels"] for image in given)]
    sides = [window.get(key, window["size"]) for key in ("rows", "columns")]
    counted += [manifest["weights"]["count"], *schedule.get("group", ()), *sides]
    counted += [schedule.get(key, 1) for key in ("pixels", "rows")]
    same("manifest: sizes are integers above -1", all(type(n) is int and n >= 0 for n in counted), True)
    names = [manifest["target"], manifest["entry_point"], schedule["name"]]
    same("manifest: target, entry point and schedule are texts", all(isinstance(n, str) for n in names), True)
    taps, images = inputs_of(text)
    same("manifest: window", (*sides, window["border"]), taps)
    same("manifest: size of the window", window["size"], max(sides))
    stated = [(i["name"], i["channels"], i.get("whole", False), i["low"], i["high"]) for i in given]
    same("manifest: images", stated, images)
    same("program: ranges of images", all(low <= high for *_, low, high in images), True)
    same("manifest: output", [output["name"]], re.findall(r"(?m)^  output (\w+) = %\d+$", text))
    same("manifest: numbers of weights.bin", manifest["weights"]["count"], count)


def inputs_of(text: str) -> tuple[tuple[int, int, str], list[tuple[str, int, bool, float, float]]]:
    """Return the window of a program's text, its rows, columns and border, and its images.

    Of an image these are name, channels, whether it holds integers, and the ends of its range.
    """
    ((rows, columns, border),) = re.findall(r"(?m)^  window (\d+)x(\d+), border (\w+)$", text)
    images = re.findall(r"(?m)^  image (\w+): (\d+)( whole)? in \[(\S+), (\S+)\]$", text)
    found = [(name, int(n), bool(whole), float(low), float(high)) for name, n, whole, low, high in images]
    return (int(rows), int(columns), border), found


def ends_of_window(text: str) -> tuple[Any, Any]:
    """Return the least and the largest values (n,) of a window's numbers: at a zero border 0 is one."""
    (rows, columns, border), images = inputs_of(text)
    low, high = np.array([ends for _, n, _, *ends in images for _ in range(n)]).T
    edge = 0.0 if border == "zero" else np.nan  # which is left out
    return np.tile(np.fmin(low, edge), rows * columns), np.tile(np.fmax(high, edge), rows * columns)


def places(name: str, place: Any, most: int) -> Any:
    """Return where a parameter's numbers (rows, columns) lie in weights.bin, which has `most`.

    Raises `Refused` for more of them, before any is listed. Formula: CER-5.
    """
    sides = [place["rows"], place["columns"]]
    counts = [side["count"] if isinstance(side, dict) else len(side) for side in sides]
    steps = [side["step"] for side in sides if isinstance(side, dict)]
    known = all(type(n) is int and n >= 0 for n in counts) and all(type(step) is int for step in steps)
    same(f"{name}: counts and steps are integers", known, True)
    same(f"{name}: more numbers than weights.bin has", max(*counts, counts[0] * counts[1]) > most, False)
    sides = [np.arange(s["count"]) * s["step"] if isinstance(s, dict) else s for s in sides]
    return place["offset"] + np.add.outer(*sides)


def same(step: str, stated: Any, wanted: Any) -> None:
    """Refuse what is not what it must be."""
    if stated != wanted:
        raise Refused(f"{step} is {stated!r}: it must be {wanted!r}")
