"""Check a certificate: derive every number again from the program's text and the kernel's weights.

1. The files beside it have the lengths that the manifest states and the digests that both state; the text
   and the weights make the program's [`evidence.read`].
2. The text is that of a network of sines or rectifiers; anything else is refused [`_layers`].
3. Each layer: magnitudes, rounding of sums in parts, the sine's error [`_layer`]; each output: how far each
   layer's errors reach, by norms that hold for the scalings in the certificate [`_output`]. Sums from
   spectra have steps of their own [spectra_checker.py].
4. Elimination in integers proves that a matrix has a norm of at most N [`norm_is_below`].
   All other numbers are sums of magnitudes in float64, widened by more than it rounds.

It shares no code with what wrote the certificate. Formulas: spec/certificate.md.
"""

from __future__ import annotations

import re
from decimal import ROUND_CEILING, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ...refimpl.reading import refusing
from .evidence import INTEGERS, NODE, Refused, read, same
from .integer_checker import check_integers
from .sine_checker import PROMISES
from .spectra_checker import Tables

U, TINY, WIDER = 2.0**-24, 2.0**-126, 1 + 2.0**-34
"""float32's rounding and smallest normal number; a factor of more than float64 can be off in what follows."""


def check(path: Path) -> dict[str, Any]:
    """Return a certificate whose every step holds, else raise `Refused`; `InputError` for other files."""
    told = "must be a complete certificate next to its kernel", "compile the model again"
    with refusing("certificate", str(path), *told), np.errstate(over="ignore", invalid="ignore"):
        held, manifest, text, arrays, raw = read(path)
        if held["schema"] == INTEGERS:
            check_integers(held, text, arrays)
            same("manifest: bound", manifest["bound"]["output"], held["bound"]["output"])
            return held
        layers, box = _layers(text)
        promise: Any = PROMISES.get(held["sine"]["text"])
        if promise is None or promise.domain != (held["sine"]["domain"] or np.inf):
            raise Refused("sine: nobody promises it")
        stated = manifest["sine"]
        same("sine", [stated["text"], stated["domain"]], [promise.text, held["sine"]["domain"]])
        _at_least("manifest: error of the sine", [stated["error"]], [promise.error], exact=True)
        _at_least("sine: error_bound", [held["sine"]["error_bound"]], [promise.error], exact=True)
        same("layers", len(held["layers"]), len(layers))
        matrices, own, tables, joint = [], [], None, {}
        if "spectra" in held:
            tables = Tables(held["spectra"], *_arrays(layers[0], arrays), raw, *box[:2])
            joint = {o["output"]: _joint(tables, layers[0], o) for o in held["outputs"]}
        for number, layer in enumerate(layers):
            first = None if tables is None or number else (tables, *joint[0])
            errors, box = _layer(
                f"layer {number}", held["layers"][number], layer, box, arrays, promise, first
            )
            own.append(errors)
            matrices.append(arrays[layer["weight"]] * (layer["scale"] or 1.0))
        same("outputs", [o["output"] for o in held["outputs"]], list(range(len(own[-1]))))
        found = [
            _output(f"output {o['output']}", o, matrices[1:], own, joint.get(o["output"], (0.0,))[0])
            for o in held["outputs"]
        ]
        _at_least("bound: output", held["bound"]["output"], found)
        _at_least("manifest: bound", manifest["bound"]["output"], found)
        return held


def _layers(text: str) -> tuple[list[dict[str, Any]], tuple[Any, Any, Any]]:
    """Return the layers of a network, first to last, and (low, high, parts) of its windows."""
    nodes = {int(m[1]): m for m in map(NODE.fullmatch, text.splitlines()) if m}

    def arguments(m: Any) -> list[Any]:
        return [nodes[int(i)] for i in re.findall(r"%(\d+)", m[3])]

    def other(m: Any) -> tuple[Any, float]:
        first, second = sorted(arguments(m), key=lambda a: a[2] == "constant")
        value = float(second[4].removeprefix("value="))
        same("program: a constant in float32", float(np.float32(value)), value)
        return first, value

    (at,) = (nodes[int(i)] for i in re.findall(r"(?m)^  output \w+ = %(\d+)$", text))
    while at[2] in ("minimum", "maximum"):
        at, _ = other(at)
    layers: list[dict[str, Any]] = []
    while at[2] != "input":
        scale, floor, end = None, -np.inf, at[2] if layers else None
        if end in ("sin", "maximum"):
            at, floor = (*arguments(at), floor) if end == "sin" else other(at)
            if at[2] == "multiply":
                at, scale = other(at)
        elif end:
            raise Refused(f"program: %{at[1]} is {end}, no activation of a layer")
        same(f"program: operation of %{at[1]}", at[2], "affine")
        names = dict(pair.split("=") for pair in at[4].split(", "))
        layers.insert(0, {**names, "node": int(at[1]), "scale": scale, "end": end, "floor": floor})
        (at,) = arguments(at)
    (taps,) = re.findall(r"(?m)^  window (\d+)x(\d+), border (\w+)$", text)
    images = re.findall(r"(?m)^  image \w+: (\d+) in \[(\S+), (\S+)\]$", text)
    ends = [(int(n), float(low), float(high)) for n, low, high in images]
    zero, count = taps[2] == "zero", int(taps[0]) * int(taps[1])
    low = np.tile(np.concatenate([np.full(n, min(a, 0.0) if zero else a) for n, a, _ in ends]), count)
    high = np.tile(np.concatenate([np.full(n, max(b, 0.0) if zero else b) for n, _, b in ends]), count)
    same("program: numbers in a window", at[5], str(len(low)))
    owner = np.tile(np.repeat(np.arange(len(ends)), [n for n, _, _ in ends]), count)
    row = np.repeat(np.arange(int(taps[0])), len(low) // int(taps[0]))
    parts = [np.flatnonzero((owner == image) & (row == y)) for image in range(len(ends)) for y in set(row)]
    return layers, (low, high, parts if len(parts) > 1 else None)


def _arrays(layer: Any, arrays: Any) -> tuple[Any, Any]:
    """Return W and b of a layer."""
    weight = arrays[layer["weight"]]
    return weight, arrays[layer["bias"]] if "bias" in layer else np.zeros(len(weight))


def _joint(tables: Tables, layer: Any, stated: Any) -> tuple[float, Any]:
    """Return the bound of |s e| of an output's scalings, e what spectra add to arguments, and of each sum."""
    after, scale = np.array(stated["scalings"][0], np.float64), abs(layer["scale"] or 1.0)
    steps = tables.steps(np.array(stated["spectra"]["scalings"], np.float64), scale * after)
    _at_least("spectra: step_bounds", stated["spectra"]["step_bounds"], np.array(steps) * WIDER)
    return sum(steps), sum(steps) / (scale * after)


def _layer(name: str, stated: Any, layer: Any, given: Any, arrays: Any, promise: Any, first: Any) -> Any:
    """Check a layer's step; return what it adds to its numbers' errors (m,), and the next one's `given`.

    `first`: what spectra are, and how far they let each sum be off, of a layer whose sums come from them.
    """
    low, high, parts = given
    (weight, bias), scale = _arrays(layer, arrays), abs(layer["scale"] or 1.0)
    own, least, most = _sum(weight, bias, low - TINY, high + TINY, parts)
    largest = np.maximum(-low, high)
    own = own + TINY * (np.abs(weight).sum(axis=1) + largest.sum() + 4 * (len(low) + 1))
    sizes, more = np.abs(weight) @ (largest + TINY) + np.abs(bias), 0.0
    slack = 2.0**-40 * sizes
    if first:
        tables, _, more = first
        own = tables.last(sizes, more)
        sizes = tables.most() + 2 * (sizes + more)
    ends = np.stack([least, most]) + np.outer([-1, 1], own + more + slack)
    reach = np.abs(ends).max(axis=0)
    if layer["scale"] is not None:
        rounded = U * scale * reach + 2 * TINY
        ends = np.sort(layer["scale"] * ends, axis=0) + np.outer([-1, 1], rounded)
        own, reach = scale * own + rounded, scale * reach
    same(f"{name}: node", stated["node"], layer["node"])
    size, argument = sizes.max() * max(scale, 1.0) * (1 + 2.0**-10), reach.max() * (1 + 2.0**-20)
    sine = layer["end"] == "sin"
    if size >= 3.4e38 or (sine and not argument <= promise.domain):
        raise Refused(f"{name}: numbers up to {size:.3g}, arguments up to {argument:.6g} of a sine")
    errors = (own + (promise.error if sine else 0.0) + (2 * TINY if layer["end"] else 0.0)) * WIDER
    _at_least(f"{name}: size_bound", [stated["size_bound"]], [size])
    _at_least(f"{name}: argument_bound", [stated["argument_bound"]], [argument])
    _at_least(f"{name}: rounding_bound", stated["rounding_bound"], own * WIDER)
    _at_least(f"{name}: error_bound", stated["error_bound"], errors)
    if sine:
        ends = np.outer([-1, 1], np.full(len(own), 1 + promise.error + TINY))
    return errors, (*np.maximum(ends, layer["floor"]), None)


def _sum(weight: Any, bias: Any, low: Any, high: Any, parts: Any) -> tuple[Any, Any, Any]:
    """Return the error (m,) of W x + b in any order of all, or in parts, and its least and largest value."""
    if parts is None:
        low, high = np.append(low, 1.0), np.append(high, 1.0)
        return _part(np.append(weight, bias[:, None], axis=1), low, high, len(low) - 1)
    found = [_part(weight[:, p], low[p], high[p], len(p)) for p in parts]
    own = sum(error for error, _, _ in found)
    least = np.stack([*(least for _, least, _ in found), bias], axis=1)
    most = np.stack([*(most for _, _, most in found), bias], axis=1)
    sizes, n = np.maximum(-least, most), len(parts) + 1
    cap = np.maximum(np.maximum(most, 0).sum(axis=1), np.maximum(-least, 0).sum(axis=1))
    off = n * U / (1 - n * U) * (sizes.sum(axis=1) + own) + own
    return own + U * (_additions(sizes, cap) + n * off), least.sum(axis=1), most.sum(axis=1)


def _part(weight: Any, low: Any, high: Any, products: int) -> tuple[Any, Any, Any]:
    """Return the error (m,) of sums of terms in any order, `products` of them rounded, and their range."""
    ends = np.stack([weight * low, weight * high])
    least, most, n = ends.min(axis=0), ends.max(axis=0), weight.shape[1]
    sizes = np.maximum(-least, most)
    cap = np.maximum(np.maximum(most, 0).sum(axis=1), np.maximum(-least, 0).sum(axis=1))
    whole, rounded = sizes.sum(axis=1), sizes[:, :products].sum(axis=1)
    error = U * (_additions(sizes, cap) + rounded + n * (n * U / (1 - n * U)) * whole)
    return error, least.sum(axis=1) - 2.0**-40 * whole, most.sum(axis=1) + 2.0**-40 * whole


def _additions(sizes: Any, cap: Any) -> Any:
    """Return how large all additions of terms (m, n) are together, in any tree; no sum is above cap (m,)."""
    largest = np.cumsum(np.sort(sizes, axis=1)[:, ::-1], axis=1)[:, 1:]
    return np.minimum(largest, cap[:, None]).sum(axis=1)


def _output(name: str, stated: Any, matrices: Any, own: Any, joint: float) -> float:
    """Check the step of one output: how far each layer's errors reach; return its bound.

    `joint`: the bound of |s_1 e|, e being what spectra add to the first layer's arguments.
    """
    scales = [np.array(scale, np.float64) for scale in stated["scalings"]]
    row, last = matrices[-1][stated["output"]], float(own[-1][stated["output"]])
    same(f"{name}: sizes of scalings", [s.shape for s in scales], [e.shape for e in own[:-1]])
    if not all(np.isfinite(scale).all() and (scale > 0).all() for scale in scales):
        raise Refused(f"{name}: scalings must be positive numbers")
    short, sizes, found = float(np.linalg.norm(row / scales[-1])), np.abs(row), [last]
    for at in range(len(scales) - 1, -1, -1):
        by_norms = short * float(np.linalg.norm(scales[at] * own[at]))
        if joint and not at:  # which is known of all neurons together only
            found.insert(0, (by_norms + short * joint) * WIDER)
        else:
            found.insert(0, min(by_norms, float(sizes @ own[at])) * WIDER)
        if at:
            before, after, matrix = scales[at - 1], scales[at], matrices[at - 1]
            scaled = after[:, None] * matrix / before
            if not np.isfinite(scaled).all():  # LAPACK would print a complaint of its own
                raise Refused(f"{name}: layer {at}, scaled, is not finite")
            norm = _up(float(np.linalg.norm(scaled, 2)) * (1 + 1e-9))
            _at_least(f"{name}: norm of layer {at}", [stated["norm_bounds"][at - 1]], [norm], exact=True)
            if not norm_is_below(norm, after, matrix, before):
                raise Refused(f"{name}: the norm of layer {at} is not below {norm}")
            short, sizes = short * norm, sizes @ np.abs(matrix)
    same(f"{name}: number of norms", len(stated["norm_bounds"]), len(scales) - 1)
    _at_least(f"{name}: layer_bounds", stated["layer_bounds"], found)
    _at_least(f"{name}: error_bound", [stated["error_bound"]], [total := (sum(found) + TINY) * WIDER])
    return total


def norm_is_below(norm: float, after: Any, matrix: Any, before: Any) -> bool:
    """Return whether |S A B^-1| < N, S and B diagonal: all pivots of N^2 B^2 - A^T S^2 A, A (m, n), are > 0.

    All numbers are whole multiples of one power of two; elimination without fractions keeps them whole.
    """
    scaled = matrix.tolist(), after.tolist()
    lines = [[Fraction(a) * Fraction(s) for a in line] for line, s in zip(*scaled, strict=True)]
    diagonal = [Fraction(norm) * Fraction(scale) for scale in before]
    unit = max(value.denominator for line in [*lines, diagonal] for value in line)
    columns = [[int(value * unit) for value in column] for column in zip(*lines, strict=True)]
    rows = [[-sum(x * y for x, y in zip(a, b, strict=True)) for b in columns] for a in columns]
    for i, value in enumerate(diagonal):
        rows[i][i] += int(value * unit) ** 2
    pivot = 1
    for k, line in enumerate(rows):
        if line[k] <= 0:
            return False
        for i, other in enumerate(rows[k + 1 :], k + 1):
            pairs = zip(line[i:], other[i:], strict=True)
            other[i:] = [(y * line[k] - line[i] * x) // pivot for x, y in pairs]
        pivot = line[k]
    return True


def _up(value: float) -> float:
    """Round up to four significant decimal digits."""
    exact = Decimal(value)
    return float(exact.quantize(Decimal(1).scaleb(exact.adjusted() - 3), ROUND_CEILING)) if value else 0.0


def _at_least(step: str, stated: Any, found: Any, exact: bool = False) -> None:
    """Refuse numbers that are below those found, these rounded up as a certificate's are."""
    for value, wanted in zip(stated, found, strict=True):
        least = float(wanted) if exact else _up(float(wanted))
        if type(value) not in (int, float) or not least <= value <= 1e308:
            raise Refused(f"{step} is {value!r}: it must be a number, at least {least!r}")
