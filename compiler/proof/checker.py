"""Check a certificate: derive every number again from the program's text and the kernel's weights.

1. The files beside it have the lengths that the manifest states and the digests that both state; the text
   and the weights make the program's [`evidence.read`].
2. The text is that of a network of sines or rectifiers; anything else is refused [`_layers`].
3. Each layer: magnitudes, rounding of sums in parts, the sine's error [`layer_steps`]; each output: how far
   each layer's errors reach, by norms for the scalings in the certificate [`output_steps`]. Sums from spectra
   have steps of their own [spectra_checker.py]. Both kernels of a low-rank first layer have a certificate:
   the second one's sums pass on the first one's bound, and what the rank leaves out [`cut_steps`].
4. Elimination in integers proves that a matrix has a norm of at most N [`norm_is_below`].
   All other numbers are sums of magnitudes in float64, widened by more than it rounds.

It imports nothing of the compiler, which gets the numbers of its certificates from steps 2 and 3: these are
the least that hold for the scalings that it has found. Formulas: spec/certificate.md.
"""

from __future__ import annotations

import re
from decimal import ROUND_CEILING, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...refimpl.reading import refusing
from .evidence import (
    AGAINST,
    FIRST_PASS,
    INTEGERS,
    Refused,
    digest_of,
    ends_of_window,
    inputs_of,
    nodes_of,
    parameters_of,
    read,
    same,
)
from .integer_checker import check_integers
from .sine_checker import PROMISES
from .spectra_checker import Tables

U, TINY, WIDER = 2.0**-24, 2.0**-126, 1 + 2.0**-34
"""float32's rounding and smallest normal number; a factor of more than float64 can be off in what follows."""

OF_INPUTS = re.compile(r"  (window|image|parameter|%\d+ = input) ")
"""How the lines begin in which a program that was cut may differ from that of its second kernel."""


STATED = {"rank", "program", "cut", "horizontal"}, {"first_layer", "of", "against"}
"""The keys of a manifest's `factored`, and of its `cut` (FAC-7)."""


class Cut(NamedTuple):
    """The first layer of low rank: `window` is what its second kernel reads, as `network_of` returns it.

    Of its sums (m,): what they are off by beside what the second kernel rounds, and their least and largest
    values in the reference. `left`: the most that the rank leaves out; `largest`: a sum of all magnitudes.
    """

    window: tuple[Any, Any, Any]
    passed: Any
    least: Any
    most: Any
    left: float
    largest: float


def check(path: Path) -> dict[str, Any]:
    """Return a certificate whose every step holds, else raise `Refused`; `InputError` for other files."""
    told = "must be a complete certificate next to its kernel", "compile the model again"
    with refusing("certificate", str(path), *told), np.errstate(over="ignore", invalid="ignore"):
        held, manifest, text, arrays, raw = read(path)
        kind = 1 if held["schema"] == INTEGERS else 2 if "factored" in held else 0
        same("bound: against", held["bound"]["against"], AGAINST[kind])
        if kind == 1:
            same("integers of two kernels", "factored" in held, False)
            check_integers(held, text, arrays)
            same("manifest: bound", manifest["bound"]["output"], held["bound"]["output"])
            return held
        layers, box = network_of(text)
        promise: Any = PROMISES.get(held["sine"]["text"])
        cut = _cut(path, held, manifest, text, arrays, promise) if "factored" in held else None
        if promise is None or promise.domain != (held["sine"]["domain"] or np.inf):
            raise Refused("sine: nobody promises it")
        stated = manifest["sine"]
        same("sine", [stated["text"], stated["domain"]], [promise.text, held["sine"]["domain"]])
        _at_least("manifest: error of the sine", stated["error"], promise.error)
        _at_least("sine: error_bound", held["sine"]["error_bound"], promise.error)
        same("layers", len(held["layers"]), len(layers))
        numbers = list(range(len(arrays[layers[-1]["weight"]])))
        same("outputs", [o["output"] for o in held["outputs"]], numbers)
        first, joint = None, []
        if "spectra" in held:
            (rows, columns, _), _ = inputs_of(text)
            same("spectra: a window along one axis, or of two kernels", [rows, cut], [columns, None])
            tables = Tables(held["spectra"], *arrays_of(layers[0], arrays), raw, *box[:2])
            joint = joint_steps(layers, held["outputs"], tables)
            for output, added in zip(held["outputs"], joint, strict=True):
                wanted = [up(step * WIDER) for step in added]
                _at_least("spectra: step_bounds", output["spectra"]["step_bounds"], wanted)
            first = tables, sum(joint[0]), np.array(held["outputs"][0]["scalings"][0], np.float64)
        found, own = layer_steps(layers, box, arrays, promise, first, cut)
        for number, step in enumerate(found):
            same(f"layer {number}: node", held["layers"][number]["node"], step.pop("node"))
        outputs = output_steps(layers, arrays, own, held["outputs"], joint, by_elimination=True)
        for name, steps in (("layer", found), ("output", outputs)):
            for number, (stated, step) in enumerate(zip(held[f"{name}s"], steps, strict=True)):
                for key, value in step.items():
                    _at_least(f"{name} {number}: {key}", stated[key], value)
        total = [step["error_bound"] for step in outputs]
        _at_least("bound: output", held["bound"]["output"], total)
        _at_least("manifest: bound", manifest["bound"]["output"], total)
        return held


def _cut(path: Path, held: Any, manifest: Any, text: str, arrays: Any, promise: Any) -> Cut:
    """Return the steps of a first layer of low rank, of which the manifest states no less."""
    before, stated, whole = path.with_name(FIRST_PASS + path.name), manifest["factored"], held["factored"]
    only = {"spectra", "factored"} & {*check(before)}
    same("first kernel: what no sums along a row have", only, set())
    _, first, first_text, first_arrays, _ = read(before)
    for key in ("target", "language", "profile", "sine"):
        same(f"first kernel: {key}", first[key], manifest[key])
    same("first kernel: centre", first["window"]["centre"], manifest["window"]["centre"])
    keys = [{*stated}, {*stated["cut"]}, stated["rank"], type(stated["rank"])]
    same("manifest: what it states of the rank", keys, [*STATED, first["output"]["channels"], int])
    in_fours = manifest["target"].partition(":")[0] in ("opengl", "glsl-es", "shadertoy", "godot")
    split = [image["name"] for image in manifest["images"]] != [FIRST_PASS[:-1]]
    same("second kernel: images of four channels, of a fragment shader", split, in_fours)
    name = network_of(text)[0][0]["weight"]
    same("program that was cut: its matrix", [*whole["parameters"]], [name])
    floats = {key: array.astype("<f4") for key, array in arrays.items()} | parameters_of(whole, [])
    same("digest of the program that was cut", digest_of(whole["program"], floats), stated["program"])
    weight = floats[name].astype(np.float64)
    cut = cut_steps((whole["program"], first_text, text), (weight, first_arrays, arrays), promise)
    _at_least("manifest: cut", [stated["cut"][key] for key in ("first_layer", "of")], [cut.left, cut.largest])
    return cut


def network_of(text: str) -> tuple[list[dict[str, Any]], tuple[Any, Any, Any]]:
    """Return the layers of a network, first to last, and (low, high, parts) of its windows."""
    nodes = nodes_of(text)

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
    (rows, columns, _), images = inputs_of(text)
    low, high = ends_of_window(text)
    same("program: numbers in a window", at[5], str(len(low)))
    owner = np.tile(np.repeat(np.arange(len(images)), [n for _, n, *_ in images]), rows * columns)
    row = np.repeat(np.arange(rows), len(low) // rows)
    parts = [np.flatnonzero((owner == i) & (row == y)) for i in range(len(images)) for y in range(rows)]
    return layers, (low, high, parts if len(parts) > 1 else None)


def cut_steps(texts: tuple[str, str, str], held: tuple[Any, Any, Any], promise: Any) -> Cut:
    """Return what the sums of a first layer of low rank are, of the program that was cut and both kernels'.

    `held`: its matrix W, and the arrays of both. Formula: FAC-7.
    """
    (whole, before, after), (weight, first_arrays, arrays) = texts, held
    lines = [[x for x in text.splitlines() if not OF_INPUTS.match(x)] for text in (whole, after)]
    same("program that was cut: what it does with the first layer", *lines)
    layers, (low, high, parts) = network_of(whole)
    same("program that was cut: layers", layers, network_of(after)[0])
    names = [layer["weight"] for layer in layers]
    same("program that was cut: layers with the first one's matrix", names.count(names[0]), 1)
    (rows, columns, border), images = inputs_of(whole)
    same("first kernel: window and images", inputs_of(before), ((1, columns, border), images))
    same("first kernel: operations", [m[2] for m in nodes_of(before)], ["input", "affine"])
    first, box = network_of(before)
    same("first kernel: a bias", "bias" in first[0], False)
    horizontal, nothing = arrays_of(first[0], first_arrays)
    rank, bias = len(horizontal), arrays_of(layers[0], arrays)[1]
    taps, between = inputs_of(after)
    same("second kernel: window", taps, (rows, 1, border))
    name, fours = FIRST_PASS[:-1], range(0, rank, 4)
    ways = [(name, rank)], [(f"{name}_{n}", min(4, rank - at)) for n, at in enumerate(fours)]
    held_as = [(image, channels) for image, channels, *_ in between]
    same("second kernel: images are the first one's result", held_as in ways, True)
    vertical = arrays[names[0]].reshape(-1, rank)
    product, magnitude = (
        (a @ b).reshape(weight.shape)
        for a, b in ((vertical, horizontal), (np.abs(vertical), np.abs(horizontal)))
    )
    # float64 rounds the sums of R products, and the difference.
    off = np.abs(weight - product) + (rank + 2) * 2.0**-52 * (magnitude + np.abs(weight))
    largest = np.maximum(-low, high)
    _, (own,) = layer_steps(first, box, first_arrays, promise)
    error = own + TINY
    _, least, most = _sum(horizontal, nothing, *box)
    ends = [np.tile(end, rows) for end in (least - error, most + error)]
    stated = ends_of_window(after)
    inside = bool((stated[0] <= ends[0]).all() and (ends[1] <= stated[1]).all())
    same("second kernel: its images hold what the first one writes", inside, True)
    of_rows = [*np.arange(rows * rank).reshape(rows, rank)] if rows > 1 else None
    _, least, most = _sum(weight, bias, low, high, parts)
    passed, left = np.abs(arrays[names[0]]) @ np.tile(error, rows), off @ largest
    most_of_all = float((np.abs(weight) @ largest).max())
    return Cut((ends[0], ends[1], of_rows), passed + left, least, most, float(left.max()), most_of_all)


def arrays_of(layer: Any, arrays: Any) -> tuple[Any, Any]:
    """Return W and b of a layer."""
    weight = arrays[layer["weight"]]
    return weight, arrays[layer["bias"]] if "bias" in layer else np.zeros(len(weight))


def joint_steps(layers: Any, choices: Any, tables: Tables) -> list[list[float]]:
    """Return for the scalings of each output what spectra add to |s e|, e the first layer's arguments."""
    scale = abs(layers[0]["scale"] or 1.0)
    pairs = [(choice["spectra"]["scalings"], choice["scalings"][0]) for choice in choices]
    return [tables.steps(np.array(t, np.float64), scale * np.array(s, np.float64)) for t, s in pairs]


def layer_steps(
    layers: Any, box: Any, arrays: Any, promise: Any, first: Any = None, cut: Cut | None = None
) -> tuple[Any, Any]:
    """Return the step of each layer, and what it adds to its numbers' errors (m,).

    `first`: spectra from which the first layer's sums are, and the bound of |s e|, s some scalings (m,).
    `cut`: how its numbers come from another kernel.
    """
    (low, high, parts), steps, every = cut.window if cut else box, list[dict[str, Any]](), []
    for layer in layers:
        (weight, bias), scale = arrays_of(layer, arrays), abs(layer["scale"] or 1.0)
        own, least, most = _sum(weight, bias, low - TINY, high + TINY, parts)
        largest = np.maximum(-low, high)
        own = own + TINY * (np.abs(weight).sum(axis=1) + largest.sum() + 4 * (len(low) + 1))
        sizes, more, passed = np.abs(weight) @ (largest + TINY) + np.abs(bias), 0.0, 0.0
        slack = 2.0**-40 * sizes
        if first:
            (tables, joint, after), first = first, None
            more = joint / (scale * after)
            own = tables.last(sizes, more)
            sizes = tables.most() + 2 * (sizes + more)
        if cut:
            passed, least, most, cut = cut.passed, cut.least, cut.most, None
        ends = np.stack([least, most]) + np.outer([-1, 1], own + more + passed + slack)
        reach = np.abs(ends).max(axis=0)
        if layer["scale"] is not None:
            rounded = U * scale * reach + 2 * TINY
            ends = np.sort(layer["scale"] * ends, axis=0) + np.outer([-1, 1], rounded)
            own, passed, reach = scale * own + rounded, scale * passed, scale * reach
        size, argument = sizes.max() * max(scale, 1.0) * (1 + 2.0**-10), reach.max() * (1 + 2.0**-20)
        sine = layer["end"] == "sin"
        if not size < 3.4e38 or (sine and not argument <= promise.domain):
            why = f"numbers up to {size:.3g}, arguments up to {argument:.6g} of a sine"
            raise Refused(f"layer {len(steps)}: {why}")
        own_end = (promise.error if sine else 0.0) + (2 * TINY if layer["end"] else 0.0)
        errors = (own + passed + own_end) * WIDER
        step = {"node": layer["node"], "size_bound": up(size), "argument_bound": up(argument)}
        bounds = {"rounding_bound": [*map(up, own * WIDER)], "error_bound": [*map(up, errors)]}
        steps.append({**step, **bounds})
        every.append(errors)
        if sine:
            ends = np.outer([-1, 1], np.full(len(own), 1 + promise.error + TINY))
        (low, high), parts = np.maximum(ends, layer["floor"]), None
    return steps, every


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
    off = n * U / (1 - n * U) * (sizes.sum(axis=1) + own) + own
    return own + U * (_additions(least, most) + n * off), least.sum(axis=1), most.sum(axis=1)


def _part(weight: Any, low: Any, high: Any, products: int) -> tuple[Any, Any, Any]:
    """Return the error (m,) of sums of terms in any order, `products` of them rounded, and their range."""
    ends = np.stack([weight * low, weight * high])
    least, most, n = ends.min(axis=0), ends.max(axis=0), weight.shape[1]
    sizes = np.maximum(-least, most)
    whole, rounded = sizes.sum(axis=1), sizes[:, :products].sum(axis=1)
    error = U * (_additions(least, most) + rounded + n * (n * U / (1 - n * U)) * whole)
    return error, least.sum(axis=1) - 2.0**-40 * whole, most.sum(axis=1) + 2.0**-40 * whole


def _additions(least: Any, most: Any) -> Any:
    """Return how large all additions of terms (m, n) are together, in any tree; no sum is above the cap."""
    cap = np.maximum(np.maximum(most, 0).sum(axis=1), np.maximum(-least, 0).sum(axis=1))
    largest = np.cumsum(np.sort(np.maximum(-least, most), axis=1)[:, ::-1], axis=1)[:, 1:]
    return np.minimum(largest, cap[:, None]).sum(axis=1)


def output_steps(
    layers: Any, arrays: Any, own: Any, choices: Any, joint: Any = (), by_elimination: bool = False
) -> list[dict[str, Any]]:
    """Return the step of each output for its scalings: how far each layer's errors reach it.

    `joint`: what spectra add, for each. `by_elimination`: and prove that each norm is below its bound.
    """
    matrices = [arrays[layer["weight"]] * (layer["scale"] or 1.0) for layer in layers[1:]]
    found = []
    for choice, more in zip(choices, joint or [[]] * len(choices), strict=True):
        name, scales = f"output {choice['output']}", [np.array(s, np.float64) for s in choice["scalings"]]
        same(f"{name}: sizes of scalings", [s.shape for s in scales], [e.shape for e in own[:-1]])
        if not all(np.isfinite(scale).all() and (scale > 0).all() for scale in scales):
            raise Refused(f"{name}: scalings must be positive numbers")
        reaches, norms = [float(own[-1][choice["output"]])], list[float]()
        if scales:
            row = matrices[-1][choice["output"]]
            short, sizes = float(np.linalg.norm(row / scales[-1])), np.abs(row)
        for at in range(len(scales) - 1, -1, -1):
            joined = 0.0 if at else sum(more)  # which is known of all neurons together only
            by_norms = short * (float(np.linalg.norm(scales[at] * own[at])) + joined)
            reaches.insert(0, (by_norms if joined else min(by_norms, float(sizes @ own[at]))) * WIDER)
            if at:
                before, after, matrix = scales[at - 1], scales[at], matrices[at - 1]
                scaled = after[:, None] * matrix / before
                if not np.isfinite(scaled).all():  # LAPACK would print a complaint of its own
                    raise Refused(f"{name}: layer {at}, scaled, is not finite")
                norms.insert(0, up(float(np.linalg.norm(scaled, 2)) * (1 + 1e-9)))
                if by_elimination and not norm_is_below(norms[0], after, matrix, before):
                    raise Refused(f"{name}: the norm of layer {at} is not below {norms[0]}")
                short, sizes = short * norms[0], sizes @ np.abs(matrix)
        bounds = {"layer_bounds": [*map(up, reaches)], "error_bound": up((sum(reaches) + TINY) * WIDER)}
        found.append({"norm_bounds": norms, **bounds})
    return found


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


def up(value: float) -> float:
    """Round up to four significant decimal digits."""
    exact = Decimal(float(value))
    return float(exact.quantize(Decimal(1).scaleb(exact.adjusted() - 3), ROUND_CEILING)) if value else 0.0


def _at_least(step: str, stated: Any, found: Any) -> None:
    """Refuse a number, or one of several, that is below what has been found."""
    pair = (stated, found) if isinstance(found, list) else ([stated], [found])
    same(f"{step}: how many", len(pair[0]), len(pair[1]))
    for value, least in zip(*pair, strict=True):
        if type(value) not in (int, float) or not least <= value <= 1e308:
            raise Refused(f"{step} is {value!r}: it must be a number, at least {least!r}")
