"""The README of an export: what there is, how it is called, how to check it.

Its sentences and lines of code are texts with fields [readme.txt, `said`]; what a manifest says fills them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Formatter
from typing import Any

from ...compiler.artifact import FIRST_PASS, Artifact, schedule_text
from ...compiler.core.lower import OWN_NUMBERS
from ...compiler.kernel.interface import PATH, SCENE_NUMBERS, WEIGHTS
from ...compiler.languages.c import whole
from ...compiler.reading.languages import is_read
from ..devices.kernel import BATCH_TILES
from .bindings import started
from .hosts.headers import stack_of
from .hosts.host import Host
from .targets import DISPATCHED, ONNX, TARGETS, Row


def _texts() -> dict[str, str]:
    """Return the texts by name."""
    text = (Path(__file__).parent / "readme.txt").read_text(encoding="utf-8").removesuffix("\n")
    parts = (part.partition("\n") for part in text.removeprefix("=== ").split("\n\n=== "))
    return {name: content for name, _, content in parts}


TEXTS = _texts()
"""All texts."""


def said(text: str, /, **fields: Any) -> str:
    """Return a text by its name, with its fields filled in; lines with a field that is None are left out."""
    lines = []
    for line in TEXTS[text].split("\n"):
        named = (re.split(r"[.\[]", name)[0] for _, name, _, _ in Formatter().parse(line) if name)
        if all(fields[name] is not None for name in named):
            lines.append(line.format(**fields))
    return "\n".join(lines)


def _each(text: str, rows: Iterable[Mapping[str, Any]]) -> str | None:
    """Return a text once for each of some rows, None without any."""
    return "\n".join(said(text, **row) for row in rows) or None


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
    graph = facts["target"] == ONNX
    # An imported network has numbers of its own.
    own = facts["output"]["encoding"] == OWN_NUMBERS
    inputs = _each("input", ({**i, "named": ", ".join(i["features"])} for i in facts.get("inputs", ())))
    return said(
        "readme",
        **facts,
        facts=_facts(facts, denoiser),
        hosted=host and _hosted(host),
        precisions=said("precisions") if graph else None,
        listed="\n".join(_kernel(kernel, sizes or {}) for kernel in facts["kernels"]),
        fence="python" if graph else "text",
        code=_code(facts),
        encoded="" if own else " Colour is encoded for the display already.",
        inputs_of=inputs and said("inputs", kernels=inputs),
        moving=_moving(facts),
        proof=_proof(facts, denoiser),
        checked=_check(facts["check"]),
    )


def _hosted(host: Host) -> str:
    """Return the section about the program around the kernels."""
    added = said("added", **host.storage) if host.storage["added"] else "its bound"
    return said("hosted", **vars(host), added=added)


def _facts(facts: Mapping[str, Any], denoiser: Artifact | None) -> str:
    """Return the lines about the whole."""
    bound, weights, speed = facts["bound"], facts["weights"], facts.get("speed", {})
    promise = f"no promise ({bound['against']})"
    if output := bound["output"]:
        size = f"at most {max(output):g} from the float64 reference"
        promise = f"{size if any(output) else 'none, the same bits'}, for every picture in the stated ranges"
    picked = facts["kernels"][-1].get("schedule")
    others = ", ".join(name for name in facts["schedules"] if picked and name != picked["name"])
    stack = None
    if denoiser is not None and TARGETS[facts["target"]].slots == "header":
        stack = said("stack", bytes=max(map(stack_of, denoiser.kernels)))
    return said(
        "facts",
        promise=promise,
        assumes=facts["assumes"] or None,
        window=facts["window"],
        count=weights["count"] or "all",
        weights=weights,
        half=weights.get("half"),
        schedule=picked and schedule_text(picked),
        others=f" Others, by `--schedule`: {others}." if others else "",
        speed=speed or None,
        plain=f"{speed['plain_ms']:.3g} ms with -O2 alone; " if "plain_ms" in speed else "",
        encoding=facts["output"]["encoding"] or "linear",
        images=_each("image", facts["images"]),
        rays=_rays(facts),
        domain=facts["model"].get("domain"),
        limits=_each("limit", facts["limits"]),
        stack=stack,
    )


def _moving(facts: Mapping[str, Any]) -> str | None:
    """Return the section about a scene that moves."""
    numbers = (facts["scene"] or {}).get("numbers")
    if numbers is None:
        return None
    path = next(kernel for kernel in facts["kernels"] if kernel["role"] == PATH)
    slot = next(b["slot"] for b in path["bindings"] if b["name"] == SCENE_NUMBERS)
    row, (moments, count) = TARGETS[facts["target"]], numbers["rows"]["shape"]
    formulas = {each["places"][0]["table"]: each["formula"] for each in numbers["list"]}
    return said(
        "moving",
        moving=", ".join(numbers["moving"]).capitalize(),
        count=count,
        moments=moments,
        rows=numbers["rows"],
        lines=said(_of("numbers", row), count=count, vectors=-(-count // 4), slot=slot),
        formulas="\n".join(f"* `{table}`: {text or 'by the rows only'}." for table, text in formulas.items()),
    )


def _rays(facts: Mapping[str, Any]) -> str | None:
    """Return the line about features of more camera rays than the colour's."""
    rays, scene = facts["model"]["feature_spp"], facts["scene"]
    if rays < 2:
        return None
    if scene is None:
        return said("rays", rays=rays, rest=said("rays without a scene"))
    own = scene["feature_rays"]
    rest = said("rays of its own", **own) if own else said("rays of the samples", rays=rays)
    return said("rays", rays=rays, rest=rest)


def _proof(facts: Mapping[str, Any], denoiser: Artifact | None) -> str:
    """Return the lines about the certificate, and about what reads the kernel's text (CER-1, TXT-7)."""
    if denoiser is None:
        return said("uncertified", reason="a runtime makes kernels of its own from a graph")
    paths = "" if facts["scene"] is None else f"\n{said('uncertified paths')}"
    if denoiser.certificate is None:
        return said("uncertified", reason=denoiser.plan.unproven) + paths
    bound, source = max(denoiser.certificate["bound"]["output"]), denoiser.source_name
    other = f" and `denoise/{FIRST_PASS}{denoiser.before.source_name}`" if denoiser.before else ""
    size = f"a bound of {bound:g} for all images" if bound else "that no operation rounds"
    made = [f"`{name}`" for name in facts["kernels"][-1]["files"] if name != f"denoise/{source}"]
    besides = f" {', '.join(made)}: translated from it, and not read." if made else ""
    kind = {"schedule": denoiser.manifest["schedule"]["name"], "profile": denoiser.profile}
    known = all(is_read(kernel.manifest) for kernel in denoiser.kernels)
    read = said("read" if known else "unread", source=source, other=other, besides=besides, **kind)
    return f"{said('certificate', certificate=facts['certificate'], size=size)}\n{read}{paths}"


def _check(check: Mapping[str, Any]) -> str:
    """Return the lines about the check pair."""
    promised = "" if check["bound"]["promised"] else "; expected, not promised, for this target"
    sums = check["sums"]
    others = sums and _each("moment", sums.get("moments", ()))
    told = sums and said("sums", seed=sums["seed"], others=others)
    return said("check", **{**check, "promised": promised, "sums": told})


def _kernel(kernel: Mapping[str, Any], sizes: Mapping[str, int]) -> str:
    """Return the lines about one kernel."""
    named = ", ".join(
        f"`{name}`" + (f" ({sizes[name]:,} bytes)" if name in sizes else "") for name in kernel["files"]
    )
    rows = ({**b, "sizes": ", ".join(map(str, b["shape"])) or "1"} for b in kernel["bindings"])
    return said("kernel", **kernel, named=named, rows=_each("binding", rows))


# ---- lines of code ----------------------------------------------------------------------------------------


def _of(kind: str, row: Row) -> str:
    """Return the name of a kind's text: that of the target, else that of its slots, else of all others."""
    return next(name for name in (f"{kind} {row.name}", f"{kind} {row.slots}", kind) if name in TEXTS)


def _code(facts: Mapping[str, Any]) -> str:
    """Return the lines of a program that calls all kernels in their order."""
    check = facts["check"]
    if facts["target"] == ONNX:
        shape = {name: image["channels"] for name, image in check["images"].items()}
        return said("code onnx", shape=shape, height=check["height"], width=check["width"])
    row = TARGETS[facts["target"]]
    *earlier, last = facts["kernels"][-1:] if row.single else facts["kernels"]
    called = [
        said("earlier", does=TEXTS[f"does {k['role']}"], lines=_called("call", row, k)) for k in earlier
    ]
    batched = "launches" in last["schedule"]
    return "\n\n".join([*called, _launches(last) if batched else _called("code", row, last)])


def _called(kind: str, row: Row, kernel: Mapping[str, Any]) -> str:
    """Return the lines that call a kernel."""
    bindings = kernel["bindings"]
    read = [each for each in bindings if each["access"] == "read" and each["type"] == "float32"]
    listed = bindings if row.slots in DISPATCHED else read
    integers = [each["name"] for each in bindings if each["type"] == "int32"]
    sizes = started(kernel.get("schedule", {"pixels": 1}))
    return said(
        _of(kind, row),
        **sizes,
        api=row.api,
        file=kernel["files"][0],
        entry=kernel["entry_point"],
        whole=whole(kernel["entry_point"]),
        # A structure by its address.
        arguments=", ".join("&part" if b["name"] == "part" else b["name"] for b in bindings),
        bound="\n".join(_bound(row, kernel["role"], number, each) for number, each in enumerate(listed))
        or None,
        dispatch=said(_of("dispatch", row), **sizes, height="rows" if kernel["role"] == PATH else "height"),
        integers=", ".join(integers) or None,
        cloned="" if kernel.get("schedule", {}).get("name", "").startswith(("tile:", "fft:")) else None,
        written=", ".join(each["name"] for each in bindings if each["access"] == "write"),
        note=TEXTS.get(f"note {row.name}"),
    )


def _bound(row: Row, role: str, number: int, bound: Mapping[str, Any]) -> str:
    """Return the line that binds an array or the integers, with what is in it."""
    name = bound["name"]
    inside = f"{role}/weights.bin" if name == WEIGHTS else ", ".join(map(str, bound["shape"]))
    access = "int32" if name == "sizes" else bound["access"]
    kind = "uniform" if "uniform" in bound["type"] else "storage"
    name = "weight_texture" if name == WEIGHTS and row.slots not in DISPATCHED else name
    told = {"kind": kind, "slot": bound["slot"], "number": number, "name": name}
    return said(_of("bind", row), **told, inside=f"{access}: {inside}")


def _launches(kernel: Mapping[str, Any]) -> str:
    """Return the lines that call a denoiser of several launches."""
    picked = kernel["schedule"]
    entries, every = picked["entries"], zip(picked["launches"], picked["arrays"], strict=True)
    told = f"Start {entries[0]} to {entries[-1]}, by their numbers"
    if len(set(entries)) == 1:
        told = f"Compile the text with STAGE defined as 0 to {len(entries) - 1}, or take the files"
    launches = ({**each, "number": n, "names": ", ".join(names)} for n, (each, names) in enumerate(every))
    return said(
        "launches",
        **picked,
        said=told,
        count=len(picked["memory"]),
        most=BATCH_TILES,
        whole=picked["items"] * max(each["tiles"] for each in picked["launches"]),
        started=_each("launch", launches),
    )
