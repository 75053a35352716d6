"""The certificate beside a kernel: every step of the proof of its bound, for a checker that trusts none.

1. A network of sines or rectifiers [scaled.py] over the box of its images, layer by layer: the magnitudes of
   its sums, what rounding and sines add to each number [`_layers`].
2. From each layer to each output: norms of the scaled matrices, or products of magnitudes, whichever is less
   [`_outputs`]. The scalings are data: any are sound, the checker need not find them.
3. Numbers are rounded up to `DIGITS` digits, as the checker rounds its own. One that is smaller than what the
   checker finds is refused; so none can be made smaller.
4. The program's text, where each weight lies in the kernel's file, digests of both and of the source
   [`certificate`]. Weights that the file does not hold are in the certificate itself.

checker.py repeats all of it from the text and the weights, with code of its own. Programs of another form,
kernels in two passes and sines without a promise have no certificate [`prove`].
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
from ..core.enclosure import round_up
from ..core.ir import Program
from ..core.profiles import FLUSH, UNIT_ROUNDOFF, SineContract
from ..core.sums import parts, rounding
from . import bounds, scaled, spectra, spectra_search, whole
from .evidence import FLOATS, INTEGERS
from .spectra import Spectra

if TYPE_CHECKING:
    from ..schedules.schedules import Schedule

Array = NDArray[np.float64]

SCHEMA = FLOATS
"""Name and version of the form; spec/certificate.schema.json."""

DIGITS = 4
"""Significant decimal digits of a number of the proof, rounded up."""

WIDER = 1 + 2.0**-34
"""Factor by which each result is widened: more than float64 rounds in it."""


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
) -> Proof | None:
    """Return the proof for an analysed program over all images, or None where it has no certificate.

    `of`: how the first layer's sums are computed from spectra, if they are.
    """
    output = program.outputs[0][1]
    network = scaled.network(program, found, output)
    if sine.error is None or len(network) < 2 or program.nodes[network[0].read].op != "input":
        return None
    if found[network[0].affine].own is None and of is None:  # sums of which the steps know nothing
        return None
    matrices = [layer.scale * _array(program, layer, "weight") for layer in network]
    if not scaled.decomposable(matrices[1:]):
        return None
    low, high = bounds.window_box(program.gather)  # type: ignore[arg-type]
    groups = scaled.outputs(len(matrices[-1]))
    lasts = [[*matrices[1:-1], matrices[-1][rows]] for rows in groups]
    joint = [_joint(of, program, network[0], last, low, high) if of else None for last in lasts]
    layers, own = [], []
    for number, layer in enumerate(network):
        blocks = parts(None if number else program.gather, len(low))
        step, errors, ends = _layer(program, layer, low, high, sine, blocks, None if number else joint[0])
        layers.append({"node": layer.affine, **step})
        own.append(errors)
        low, high = _activated(program, layer, sine, *ends)
    if not all(np.isfinite(errors).all() for errors in own):
        return None
    pairs = zip(groups, joint, strict=True)
    outputs = [step for rows, first in pairs for step in _outputs(matrices[1:], own, rows, first)]
    return Proof(tuple(layers), tuple(outputs), tuple(step["error_bound"] for step in outputs))


@dataclass(frozen=True)
class Joint:
    """What spectra add to the first layer's arguments, e of all neurons: |s e| is below the sum of `steps`.

    `before` are the scalings of the channels, `after` those of all layers' values.
    """

    of: Spectra
    before: Array
    after: list[Array]
    steps: tuple[float, ...]

    @property
    def error(self) -> float:
        """Return the bound of |s e|."""
        return math.fsum(self.steps)


def _joint(
    of: Spectra, program: Program, layer: scaled.Layer, later: Sequence[Array], low: Array, high: Array
) -> Joint:
    """Return what spectra add to the first layer, given the matrices after it, with scalings that suit."""
    weight, omega, channels = _array(program, layer, "weight"), abs(layer.scale), len(of.centres)
    radius = np.maximum(high[:channels] - of.centres, of.centres - low[:channels])
    before, after = spectra_search.scalings(of, omega * weight, radius, later)
    return Joint(of, before, after, spectra.reach(of, weight, radius, before, omega * after[0]))


def _array(program: Program, layer: scaled.Layer, name: str) -> Array:
    """Return a layer's weights, or its biases, in float64."""
    held = program.nodes[layer.affine].get(name)
    if held is None:
        return np.zeros(program.nodes[layer.affine].type.shape[0])
    return program.parameters[str(held)].astype(np.float64)


def _layer(
    program: Program,
    layer: scaled.Layer,
    low: Array,
    high: Array,
    sine: SineContract,
    blocks: Sequence[Any],
    joint: Joint | None,
) -> tuple[dict[str, Any], Array, tuple[Array, Array]]:
    """Return the step of one layer for inputs (n,) in [low, high], its part of the errors (m,), and a range.

    The range (m,) holds the arguments of the layer's activation.
    """
    weight, bias = _array(program, layer, "weight"), _array(program, layer, "bias")
    omega = abs(layer.scale)
    up, down, largest = (
        np.maximum(weight, 0.0),
        np.maximum(-weight, 0.0),
        np.maximum(np.abs(low), np.abs(high)),
    )
    sizes = (up + down) @ (largest + FLUSH) + np.abs(bias)
    if joint is None:
        own = rounding(weight, bias, low - FLUSH, high + FLUSH, blocks)
        own = own + FLUSH * (np.sum(up + down, axis=1) + largest.sum() + 4 * (len(low) + 1))
        slack = own + 2.0**-40 * sizes
    else:
        more = joint.error / (omega * joint.after[0])
        own = spectra.last_sum(joint.of, weight, bias, sizes, more)
        slack = own + more + 2.0**-40 * sizes
        sizes = spectra.sizes(joint.of, weight, np.maximum(high, -low)) + 2 * (sizes + more)
    most, negated = up @ high - down @ low + bias + slack, up @ -low - down @ -high - bias + slack
    reach = np.maximum(most, negated)
    if layer.multiply != layer.affine:
        rounded = UNIT_ROUNDOFF * omega * reach + 2 * FLUSH
        own = omega * own + rounded
        reach, sizes = omega * reach, np.maximum(omega, 1.0) * sizes
        if layer.scale < 0:
            most, negated = negated, most
        most, negated = omega * most + rounded, omega * negated + rounded
    added = 0.0
    if layer.activation is not None:
        added = 2 * FLUSH + (float(sine.error or 0.0) if _is_sine(program, layer) else 0.0)
    errors = (own + added) * WIDER
    step = {
        "size_bound": _up(float(sizes.max()) * (1 + 2.0**-10)),
        "argument_bound": _up(float(reach.max()) * (1 + 2.0**-20)),
        "rounding_bound": [_up(float(value) * WIDER) for value in own],
        "error_bound": [_up(float(value)) for value in errors],
    }
    return step, errors, (-negated, most)


def _is_sine(program: Program, layer: scaled.Layer) -> bool:
    """Return whether a layer ends in a sine."""
    return layer.activation is not None and program.nodes[layer.activation].op == "sin"


def _activated(
    program: Program, layer: scaled.Layer, sine: SineContract, least: Array, most: Array
) -> tuple[Array, Array]:
    """Return the range (m,) of a kernel's activations of arguments in [least, most]."""
    if layer.activation is None or _is_sine(program, layer):
        high = np.full(len(most), 1.0 + float(sine.error or 0.0) + FLUSH)
        return -high, high
    operands = (program.nodes[arg] for arg in program.nodes[layer.activation].args)
    (floor,) = (float(node["value"]) for node in operands if node.op == "constant")  # type: ignore[arg-type]
    return np.maximum(least, floor), np.maximum(most, floor)


def _outputs(
    matrices: Sequence[Array], own: Sequence[Array], rows: Sequence[int], joint: Joint | None
) -> list[dict[str, Any]]:
    """Return the steps of outputs that share scalings: from each layer's errors to each output's."""
    last = matrices[-1][rows]
    scales = joint.after if joint else scaled.scalings([*matrices[:-1], last], own[0])
    more = {}
    if joint:
        steps = [_up(value * WIDER) for value in joint.steps]
        more = {"spectra": {"scalings": joint.before.tolist(), "step_bounds": steps}}
    norms = [
        _up(float(np.linalg.norm(after[:, None] * matrix / before, 2)) * (1 + 1e-9))
        for matrix, before, after in zip(matrices[:-1], scales, scales[1:], strict=False)
    ]
    firsts = [joint.error if joint else 0.0, *[0.0] * (len(scales) - 1)]
    reach, least = [1.0], [np.eye(len(own[-2]))]
    for norm, matrix in zip(reversed(norms), reversed(matrices[:-1]), strict=True):
        reach.insert(0, reach[0] * norm)
        least.insert(0, least[0] @ np.abs(matrix))
    found = []
    for row, number in zip(last, rows, strict=True):
        short = float(np.linalg.norm(row / scales[-1]))
        by_norms = [
            short * norm * (float(np.linalg.norm(s * e)) + first)
            for norm, s, e, first in zip(reach, scales, own[:-1], firsts, strict=True)
        ]
        by_size = [float(np.abs(row) @ matrix @ e) for matrix, e in zip(least, own[:-1], strict=True)]
        # What spectra add is known of all neurons together only.
        by_size[0] = math.inf if joint else by_size[0]
        layers = [min(pair) * WIDER for pair in zip(by_norms, by_size, strict=True)]
        layers.append(float(own[-1][number]))
        found.append(
            {
                "output": number,
                **more,
                "scalings": [scale.tolist() for scale in scales],
                "norm_bounds": norms,
                "layer_bounds": [_up(value) for value in layers],
                "error_bound": _up((math.fsum(layers) + FLUSH) * WIDER),
            }
        )
    return found


def _up(value: float) -> float:
    """Round up to the digits that the checker compares."""
    return round_up(value, DIGITS)


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
    order = of.order.tolist()
    return {
        "spectra": {
            "points": of.points,
            "lanes": of.lanes,
            "block": of.block,
            "centres": of.centres.tolist(),
            "order": order,
            "table": {"offset": layout[weight].offset, "shape": list(layout[weight].shape)},
            "bias": None if bias is None else layout[str(bias)].offset,
        }
    }


def integers(
    program: Program, schedule: Schedule, emitted: Program, manifest: Mapping[str, Any]
) -> Mapping[str, Any]:
    """Return the certificate of a kernel in which nothing rounds: ends of all values, largest sums."""
    known = whole.known(program)
    sums = {
        str(index): whole.magnitudes(program, node, known[node.args[0]]).tolist()
        for index, node in enumerate(program.nodes)
        if node.op == "affine"
    }
    return {
        **_about(INTEGERS, program, schedule, emitted, manifest),
        "ranges": [[float(value.low.min()), float(value.high.max())] for value in known],
        "sums": sums,
        "bound": dict(manifest["bound"]),
    }


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
            held = np.ascontiguousarray(array, "<f4").tobytes()
            found[name] = {"shape": shape, "base64": base64.b64encode(held).decode()}
    return found


def _listed(places: NDArray[np.int64]) -> list[int] | dict[str, int]:
    """Return places (n,), the first of which is 0: how far apart and how many, or a list of them."""
    step = int(places[1]) if len(places) > 1 else 0
    if (places == step * np.arange(len(places))).all():
        return {"step": step, "count": len(places)}
    found: list[int] = places.tolist()
    return found
