"""The certificate beside a kernel: every step of the proof of its bound, for a checker that trusts none.

1. A network of sines or rectifiers [scaled.py] over the box of its images. The numbers of all steps are those
   that the checker finds from the program's text: the least that it takes [checker.py].
2. The scalings are found here. They are data: any are sound, the checker need not find them.
3. The program's text, where each weight lies in the kernel's file, digests of both and of the source
   [`certificate`]. Weights that the file does not hold are in the certificate itself.

Programs of another form and sines without a promise have no certificate [`prove`].
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core import ir
from ..core.ir import Program
from ..core.profiles import SineContract
from . import bounds, checker, integer_checker, scaled, spectra_search, whole
from .evidence import FLOATS, INTEGERS, Refused
from .spectra import Spectra
from .spectra_checker import Tables

if TYPE_CHECKING:
    from ..schedules.schedules import Schedule

Array = NDArray[np.float64]

SCHEMA = FLOATS
"""Name and version of the form; spec/certificate.schema.json."""


@dataclass(frozen=True)
class Proof:
    """The steps for `layers` and `outputs`, as JSON's types; `bound` of each output channel."""

    layers: tuple[Mapping[str, Any], ...]
    outputs: tuple[Mapping[str, Any], ...]
    bound: tuple[float, ...]


def prove(
    program: Program,
    found: Sequence[bounds.Enclosure],
    sine: SineContract,
    of: Spectra | None = None,
    cut: tuple[Program, Program] | None = None,
) -> Proof | None:
    """Return the proof for an analysed program over all images, or None where it has no certificate.

    `of`: how the first layer's sums are computed from spectra, if they are. `cut`: the programs of both
    kernels of a first layer of low rank.
    """
    output = program.outputs[0][1]
    network = scaled.network(program, found, output)
    if sine.error is None or not network or program.nodes[network[0].read].op != "input":
        return None
    if found[network[0].affine].own is None and of is None and cut is None:  # sums unknown to the steps
        return None
    arrays = _floats(program if cut is None else cut[1])
    layers, box = checker.network_of(ir.text(program))
    matrices = [(layer["scale"] or 1.0) * arrays[layer["weight"]] for layer in layers]
    if len(layers) == 1 and of is not None:  # no scalings between layers, on which steps of spectra rest
        return None
    if len(layers) > 1 and not scaled.decomposable(matrices[1:]):
        return None
    groups = scaled.outputs(len(matrices[-1]))
    later = [[*matrices[1:-1], matrices[-1][rows]] if len(layers) > 1 else [] for rows in groups]
    first, joint, choices, steps_of_cut = None, list[list[float]](), list[dict[str, Any]](), None
    try:
        if cut is not None:
            weight = _floats(program)[layers[0]["weight"]]
            texts = ir.text(program), ir.text(cut[0]), ir.text(cut[1])
            steps_of_cut = checker.cut_steps(texts, (weight, _floats(cut[0]), arrays), sine)
        if of is not None:
            weight, bias = checker.arrays_of(layers[0], arrays)
            tables = Tables(_of(of), weight, bias, (of.table.transpose(1, 2, 0, 3), of.bias), *box[:2])
            matrix = abs(layers[0]["scale"] or 1.0) * weight
            pairs = [spectra_search.scalings(of, matrix, tables.radius, each) for each in later]
            choices = _choices(groups, pairs)
            joint = checker.joint_steps(layers, choices, tables)
            first = tables, sum(joint[0]), pairs[0][1][0]
        steps, own = checker.layer_steps(layers, box, arrays, sine, first, steps_of_cut)
        if of is None:
            choices = _choices(
                groups, [(None, scaled.scalings(each, own[0]) if each else []) for each in later]
            )
        outputs = checker.output_steps(layers, arrays, own, choices, joint)
    except Refused:
        return None
    for choice, more in zip(choices, joint, strict=False):
        choice["spectra"]["step_bounds"] = [checker.up(step * checker.WIDER) for step in more]
    found_steps = tuple({**choice, **step} for choice, step in zip(choices, outputs, strict=True))
    return Proof(tuple(steps), found_steps, tuple(step["error_bound"] for step in outputs))


def _floats(program: Program) -> dict[str, Array]:
    """Return a program's parameters in float64."""
    return {name: array.astype(np.float64) for name, array in program.parameters.items()}


def _choices(groups: Sequence[Sequence[int]], pairs: Sequence[Any]) -> list[dict[str, Any]]:
    """Return the scalings of each output: of spectra those of channels, and those of all layers' values."""
    return [
        {
            "output": number,
            **({} if before is None else {"spectra": {"scalings": before.tolist()}}),
            "scalings": [scale.tolist() for scale in after],
        }
        for rows, (before, after) in zip(groups, pairs, strict=True)
        for number in rows
    ]


def _of(of: Spectra) -> dict[str, Any]:
    """Return how sums are computed from spectra, as JSON's types."""
    arrays = {"centres": of.centres.tolist(), "order": of.order.tolist()}
    return {"points": of.points, "lanes": of.lanes, "block": of.block, **arrays}


def certificate(
    common: Program,
    proof: Proof,
    sine: SineContract,
    schedule: Schedule,
    emitted: Program,
    manifest: Mapping[str, Any],
) -> Mapping[str, Any]:
    """Return the certificate of a kernel, as JSON's types; `manifest` has the digests of its files."""
    return {
        **_about(SCHEMA, common, schedule, emitted, manifest),
        "sine": {
            "text": sine.text,
            "error_bound": sine.error,
            "domain": sine.domain if math.isfinite(sine.domain) else None,
        },
        **_spectra(common, schedule, emitted),
        "layers": [dict(step) for step in proof.layers],
        "outputs": [dict(step) for step in proof.outputs],
        "bound": {"output": list(proof.bound), "against": manifest["bound"]["against"]},
    }


def _spectra(common: Program, schedule: Schedule, emitted: Program) -> dict[str, Any]:
    """Return how the first layer's sums are computed from spectra, and where those are, if they are."""
    of = schedule.spectra(common)
    if of is None:
        return {}
    names = {str(node["weight"]): node.get("bias") for node in common.nodes if node.op == "affine"}
    weight, bias = next(iter(names.items()))
    layout = schedule.layout(emitted)
    return {
        "spectra": {
            **_of(of),
            "table": {"offset": layout[weight].offset, "shape": list(layout[weight].shape)},
            "bias": None if bias is None else layout[str(bias)].offset,
        }
    }


def integers(
    program: Program, schedule: Schedule, emitted: Program, manifest: Mapping[str, Any]
) -> Mapping[str, Any]:
    """Return the certificate of a kernel in which nothing rounds: ends of all values, largest sums."""
    found, sums = whole.ranges(program)
    return {
        **_about(INTEGERS, program, schedule, emitted, manifest),
        "ranges": [integer_checker.ends_of(each) for each in found],
        "sums": sums,
        "bound": dict(manifest["bound"]),
    }


def factored(whole: Program) -> Mapping[str, Any]:
    """Return what a certificate says of the program that was cut: its text, and its first matrix."""
    name = checker.network_of(ir.text(whole))[0][0]["weight"]
    return {"program": ir.text(whole), "parameters": {name: _held(whole.parameters[name])}}


def _held(array: NDArray[Any]) -> dict[str, Any]:
    """Return a parameter that the certificate itself holds."""
    held = np.ascontiguousarray(array, "<f4").tobytes()
    return {"shape": list(array.shape), "base64": base64.b64encode(held).decode()}


def _about(
    schema: str, program: Program, schedule: Schedule, emitted: Program, manifest: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what a certificate of any form says of its kernel: digests, the program's text, its weights."""
    return {
        "schema": schema,
        "manifest_digest": manifest["digest"],
        "program_digest": manifest["program"],
        "files": dict(manifest["files"]),
        "profile": manifest["profile"]["name"],
        "entry_point": manifest["entry_point"],
        "centre": manifest["window"]["centre"],
        "program": ir.text(program),
        "parameters": _places(program, schedule, emitted),
    }


def _places(common: Program, schedule: Schedule, emitted: Program) -> dict[str, Any]:
    """Return for each parameter where element (j, i) lies in the file: at offset + rows[j] + columns[i].

    The schedule packs numbers that count all elements from 1; where they come out is their place.
    """
    coded, count = {}, 1
    for name, array in emitted.parameters.items():
        coded[name] = np.arange(count, count + array.size, dtype=np.float64).reshape(array.shape)
        count += array.size
    packed = np.zeros(0, np.int64)
    if count < 2**24 and not schedule.bytewise:
        arrays = {name: array.astype(np.float32) for name, array in coded.items()}
        packed = schedule.coded(emitted, arrays).astype(np.int64)
    at = np.full(count, -1)
    at[packed] = np.arange(len(packed))
    found: dict[str, Any] = {}
    for name, array in common.parameters.items():
        place = np.atleast_2d(at[coded[name].astype(np.int64)]) if name in coded else np.full((1, 1), -1)
        rows, columns = place[:, 0] - place[0, 0], place[0] - place[0, 0]
        shape = list(array.shape)
        if (place >= 0).all() and (place == place[0, 0] + rows[:, None] + columns).all():
            found[name] = {"shape": shape, "offset": int(place[0, 0])}
            found[name] |= {"rows": _listed(rows), "columns": _listed(columns)}
        else:
            found[name] = _held(array)
    return found


def _listed(places: NDArray[np.int64]) -> list[int] | dict[str, int]:
    """Return places (n,), the first of which is 0: how far apart and how many, or a list of them."""
    step = int(places[1]) if len(places) > 1 else 0
    if (places == step * np.arange(len(places))).all():
        return {"step": step, "count": len(places)}
    found: list[int] = places.tolist()
    return found
