"""Variants: a trained network with fewer operations, as a named list of approximations, and what each moves.

1. A variant is a text, `window8+rank12`: approximations in the order in which they are made [`parse`]; `full`
   is the network itself. Each is one function from a network to a network [`KINDS`], [`vary`].
2. The network is varied, not its program: a varied model is lowered, compiled and trained as any other. A
   rank is the product of the factors in the model and two passes in the kernel [factor.py]; a sine's degree
   is a profile [profiles.py].
3. What is left out is replaced by what is likely there [`_spread`], so that a picture that is constant is
   denoised as before.
4. Each varied network is also one of the full network's shape, with zeros where something is left out
   [`Varied.inside`]. With D = W' - W and d = b' - b a layer's sums move, for inputs in a box with the middle
   c and the radius r, by at most |D c + d| + |D| r, plus what the move of its inputs passes on through |W'|
   [`enclose`]. The rules of bounds.py carry that to the output, and add what rounding does.

The bound speaks of all images. Taps that are left out may hold anything: it says little for cuts (a picture
may be made to suit them) and much for sines; on frames the error is measured [kernels/run/curve.py].
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..refimpl.errors import InputError
from ..refimpl.network import factored, whole
from ..refimpl.network.dataset import FEATURES
from ..refimpl.network.denoise import Model
from ..refimpl.network.siren import Siren
from ..refimpl.network.window import Window
from .core import ir, sine
from .core.enclosure import round_up
from .core.lower import lower
from .core.profiles import SineContract
from .kernel.interface import FULL as FULL
from .plan import Plan, analysed, plan_program
from .proof import bounds
from .proof.bounds import Enclosure
from .schedules.common import kernel_gather
from .schedules.schedules import PLAIN
from .targets import Language, language_named

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PLUS = "+"
"""What joins two approximations in a name."""

EXAMPLE = "window8+rank12"
"""A variant, for messages."""

AMPLITUDES = {8: 127, 10: 511}
"""Largest hidden value of networks of integers, by its bits."""

HALF_BITS = 16
"""Bits of half precision (IEEE 754 binary16)."""

LARGEST_DIFFERENCE = 1.0
"""Colours are clipped to [0, 1] by the reference and by every kernel: no two are farther apart."""


@dataclass(frozen=True)
class Varied:
    """A network on its way: of the full one's shape in float64, with zeros for what is left out.

    `kept[l]` are the inputs of layer l that are left; `window` and `features` are what the first one reads.
    `bits`: of hidden values, where the network is one of integers.
    """

    full: Model
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    kept: tuple[Indices, ...]
    window: Window
    features: tuple[str, ...]
    variant: Variant
    rank: int = 0
    degree: int = sine.DEGREE
    bits: int = 0

    @property
    def rows(self) -> tuple[Indices, ...]:
        """Return the outputs of each layer that are left."""
        return (*self.kept[1:], np.arange(len(self.biases[-1])))

    @property
    def cut(self) -> Siren:
        """Return the network without what is left out, in the type of the full one's parameters."""
        siren = self.full.siren
        parts = zip(self.weights, self.biases, self.kept, self.rows, strict=True)
        cut = [(w[np.ix_(row, column)], b[row]) for w, b, column, row in parts]
        return replace(
            siren,
            weights=tuple(w.astype(siren.dtype) for w, _ in cut),
            biases=tuple(b.astype(siren.dtype) for _, b in cut),
        )

    @property
    def model(self) -> Model:
        """Return the model of that network, in integers where it is of integers."""
        siren = self.cut
        if self.bits:
            siren = whole.rounded(siren, self.window.size, AMPLITUDES[self.bits])
        return replace(self.full, siren=siren, window=self.window, features=self.features)

    @property
    def floats(self) -> tuple[Varied, int]:
        """Return the network before it is rounded, and the largest hidden value of its integers, or 0."""
        return replace(self, bits=0), AMPLITUDES[self.bits] if self.bits else 0

    @property
    def inside(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """Return weights and biases of the same function in the full network's shape, rounded as a kernel's.

        Rows of neurons that are left out are as they were: nothing reads them.
        """
        weights, biases = (
            tuple(array.astype(np.float32).astype(np.float64) for array in arrays)
            for arrays in (self.weights, self.biases)
        )
        if isinstance(network := self.model.siren, whole.Whole):
            real = whole.real(network, self.cut)
            for layer, (row, column) in enumerate(zip(self.rows, self.kept, strict=True)):
                weights[layer][np.ix_(row, column)] = real[0][layer]
                biases[layer][row] = real[1][layer]
        return weights, biases

    @property
    def products(self) -> int:
        """Return the multiplications a pixel."""
        first, *others = pairwise(self.model.siren.widths)
        inner = sum(a * b for a, b in others)
        if not self.rank:
            return first[0] * first[1] + inner
        size = self.window.size
        return self.rank * (first[0] // size + size * first[1]) + inner

    @property
    def is_full(self) -> bool:
        """Return whether nothing is left out, and nothing changed."""
        mine, given = (*self.weights, *self.biases), (*self.full.siren.weights, *self.full.siren.biases)
        same = all(np.array_equal(a, b) for a, b in zip(mine, given, strict=True))
        return not self.rank and not self.bits and same and self.model.siren.widths == self.full.siren.widths

    @property
    def sine(self) -> SineContract | None:
        """Return what is promised of the sine of integers: half a step, and the polynomial's error."""
        if not self.bits:
            return None
        amplitude = AMPLITUDES[self.bits]
        error = (0.5 + whole.SINES[amplitude].error) / amplitude
        return SineContract("sine of integers", error=error, domain=math.inf)

    def profile(self, base: str) -> str:
        """Return the name of the profile that has the variant's sine."""
        return base if self.degree == sine.DEGREE else f"{base}-sine{self.degree}"


# ---- approximations ---------------------------------------------------------------------------------------


def narrow_window(varied: Varied, size: int) -> Varied:
    """Leave out taps around the middle size x size; what they held is taken to be the mean of those left."""
    before, taps = varied.window.size, varied.window.size**2
    _check(f"window{size}", 1 <= size < before, f"the window has {before} x {before} taps", "window8")
    first = before // 2 - size // 2
    grid = np.arange(len(varied.kept[0])).reshape(before, before, -1)
    left = grid[first : first + size, first : first + size].ravel()
    channels = len(varied.kept[0]) // taps
    # The taps of a channel differ only by their place in the window vector.
    return replace(_spread(varied, left, channels), window=replace(varied.window, size=size))


def leave_out_feature(varied: Varied, name: str) -> Varied:
    """Leave out a feature; it is taken to be the middle of its range everywhere."""
    others = [feature for feature in varied.features if feature != name]
    rule = f"the model reads {', '.join(varied.features)}"
    _check(f"without-{name}", name in varied.features and bool(others), rule, "name one, not all of them")
    owner = np.repeat(varied.features, [FEATURES[feature].channels for feature in varied.features])
    chosen = np.tile(owner, varied.window.size**2) != name
    gone = varied.kept[0][~chosen]
    feature = FEATURES[name]
    weight, bias = varied.weights[0].copy(), varied.biases[0].copy()
    bias = bias + weight[:, gone].sum(axis=1) * (feature.low + feature.high) / 2
    weight[:, gone] = 0.0
    moved = replace(varied, weights=(weight, *varied.weights[1:]), biases=(bias, *varied.biases[1:]))
    return replace(moved, kept=(varied.kept[0][chosen], *varied.kept[1:]), features=tuple(others))


def remove_neurons(varied: Varied, width: int) -> Varied:
    """Leave `width` neurons in each hidden layer, those that the next one weighs most; others count as 0.

    0 is the middle of what a sine may be, and what a rectifier gives that is not active.
    """
    widest = max((len(kept) for kept in varied.kept[1:]), default=0)
    rule = f"the widest hidden layer has {widest} neurons"
    _check(f"hidden{width}", 1 <= width < widest, rule, f"hidden{max(widest * 3 // 4, 1)}")
    weights, kept = list(varied.weights), list(varied.kept)
    for layer in range(1, len(weights)):
        # Neurons of the layer after it that are gone already have no say.
        rows = kept[layer + 1] if layer + 1 < len(kept) else slice(None)
        importance = np.linalg.norm(weights[layer][rows][:, kept[layer]], axis=0)
        # The largest first; equal ones in their order.
        chosen = np.sort(kept[layer][np.argsort(-importance, kind="stable")[:width]])
        gone = np.setdiff1d(kept[layer], chosen)
        weights[layer] = weights[layer].copy()
        weights[layer][:, gone] = 0.0
        kept[layer] = chosen
    return replace(varied, weights=tuple(weights), kept=tuple(kept))


def cut_rank(varied: Varied, rank: int) -> Varied:
    """Cut the first layer to a rank: the nearest weights that two passes can compute [factored.py]."""
    rows = varied.kept[1] if len(varied.kept) > 1 else np.arange(len(varied.biases[0]))
    place = np.ix_(rows, varied.kept[0])
    weight = varied.weights[0].copy()
    weight[place] = factored.expand(factored.cut(weight[place], varied.window.size, rank))
    return replace(varied, weights=(weight, *varied.weights[1:]), rank=rank)


def choose_sine(varied: Varied, degree: int) -> Varied:
    """Emit a polynomial of another degree for the sine."""
    known = ", ".join(f"sine{known}" for known in sine.POLYNOMIALS)
    _check(f"sine{degree}", degree in sine.POLYNOMIALS, f"there are {known}", "use one of these")
    return replace(varied, degree=degree)


def halve_weights(varied: Varied, bits: int) -> Varied:
    """Round weights and biases to half precision: 16 bits hold each, and the kernel computes in float32."""
    _check(f"half{bits}", bits == HALF_BITS, f"there is half{HALF_BITS}", f"half{HALF_BITS}")
    _check(f"half{bits}", not varied.rank, "factors of a rank are other numbers", "half16 without a rank")
    largest = max(float(np.abs(array).max(initial=0.0)) for array in (*varied.weights, *varied.biases))
    limit = float(np.finfo(np.float16).max)
    _check(f"half{bits}", largest <= limit, f"a weight is {largest:.3g}, and {limit:g} is the largest", FULL)
    weights, biases = (
        tuple(array.astype(np.float16).astype(np.float64) for array in arrays)
        for arrays in (varied.weights, varied.biases)
    )
    return replace(varied, weights=weights, biases=biases)


def amplitude_of(bits: int) -> int:
    """Return the largest hidden value of a network of integers, by its bits."""
    known = ", ".join(f"whole{known}" for known in AMPLITUDES)
    _check(f"whole{bits}", bits in AMPLITUDES, f"there are {known}", "whole8")
    return AMPLITUDES[bits]


def make_whole(varied: Varied, bits: int) -> Varied:
    """Round the network to integers, hidden values of so many bits [whole.py]."""
    amplitude_of(bits)
    is_plain = not varied.rank and varied.degree == sine.DEGREE
    _check(f"whole{bits}", is_plain, "a rank rounds, and integers have a sine of their own", "whole8 only")
    return replace(varied, bits=bits)


def _spread(varied: Varied, left: Indices, channels: int) -> Varied:
    """Leave inputs at these positions of `kept`; the weights of others go to all that are left, evenly."""
    kept, weight = varied.kept[0], varied.weights[0].copy()
    chosen = kept[left]
    gone = np.setdiff1d(kept, chosen)
    channel = dict(zip(kept.tolist(), np.tile(np.arange(channels), len(kept) // channels), strict=True))
    for c in range(channels):
        ours, theirs = ([i for i in group.tolist() if channel[i] == c] for group in (chosen, gone))
        weight[:, ours] += weight[:, theirs].sum(axis=1, keepdims=True) / len(ours)
    weight[:, gone] = 0.0
    return replace(varied, weights=(weight, *varied.weights[1:]), kept=(chosen, *varied.kept[1:]))


class Kind(NamedTuple):
    """A kind of approximation: a sentence, its function, and the kinds that come before it."""

    text: str
    apply: Callable[[Varied, Any], Varied]
    before: tuple[str, ...] = ()


NARROWER = ("without-", "window", "hidden")
"""Kinds that a rank comes after: a first layer that is narrowed after the cut would not have it any more."""

KINDS: Mapping[str, Kind] = {
    "without-": Kind("leave out a feature: without-normal", leave_out_feature),
    "window": Kind("see N x N pixels: window8", narrow_window),
    "hidden": Kind("keep N neurons in each hidden layer: hidden24", remove_neurons),
    "rank": Kind("a first layer of rank N: rank12", cut_rank, NARROWER),
    "sine": Kind("sines of degree N: sine7", choose_sine),
    # What is narrowed or cut after it would be sums of halves, not halves.
    "half": Kind("weights in half precision: half16", halve_weights, (*NARROWER, "rank")),
    # What is rounded has no weights that could be spread, cut or counted.
    "whole": Kind(
        "integers of 8 or 10 bits, the same bits everywhere: whole8",
        make_whole,
        (*NARROWER, "rank", "sine", "half"),
    ),
}
"""All approximations, by what their names begin with."""

KNOWN = "; ".join(kind.text for kind in KINDS.values())
"""What a variant may be made of, for messages."""


# ---- names ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Variant:
    """Approximations as (kind, number or name), in order; none is the full network."""

    steps: tuple[tuple[str, int | str], ...] = ()

    @property
    def name(self) -> str:
        """Return the text that [`parse`] reads."""
        return PLUS.join(f"{kind}{value}" for kind, value in self.steps) or FULL


def parse(text: str) -> Variant:
    """Return the variant that a text names, or say what is wrong with it."""
    if text == FULL:
        return Variant()
    steps: list[tuple[str, int | str]] = []
    for part in text.split(PLUS):
        match = re.fullmatch(
            r"(without-)([a-z]+)|(window|hidden|rank|sine|half|whole)([1-9][0-9]{0,3})", part
        )
        if match is None:
            rule = f"{part!r} is not an approximation; supported: {KNOWN}"
            raise InputError("variant", text, rule, f"use {FULL}, or some of them, as in {EXAMPLE}")
        name, feature, kind, number = match.groups()
        steps.append((name, feature) if name else (kind, int(number)))
    _check_order(text, steps)
    return Variant(tuple(steps))


def with_rank(text: str, rank: int) -> str:
    """Return the name of a variant that may be given as a rank instead: short for the variant `rankR`."""
    if rank and text != FULL:
        raise InputError("rank", rank, f"the variant is {text}", "name it in the variant: +rank12")
    return f"rank{rank}" if rank else text


def _check_order(text: str, steps: Sequence[tuple[str, int | str]]) -> None:
    """Refuse approximations that come twice, or after one that rests on them."""
    done: list[str] = []
    for kind, value in steps:
        if kind in done and (kind != "without-" or (kind, value) in steps[: len(done)]):
            rule = f"{kind.rstrip('-')} comes twice"
            raise InputError("variant", text, rule, "name each approximation once")
        for other in done:
            if kind in KINDS[other].before:
                rule = f"{kind.rstrip('-')} must come before {other}, which it would undo"
                raise InputError("variant", text, rule, f"change the order, as in {EXAMPLE}")
        done.append(kind)


def vary(variant: Variant, model: Model) -> Varied:
    """Return the model with a variant's approximations, or say why it cannot have them."""
    siren = model.siren
    is_made = isinstance(siren, whole.Whole) and variant.steps
    _check(variant.name, not is_made, "the model is one of integers, which come last", FULL)
    _check(variant.name, not (model.is_imported and variant.steps), "an imported network has none", FULL)
    wide = [[array.astype(np.float64) for array in arrays] for arrays in (siren.weights, siren.biases)]
    kept = tuple(np.arange(weight.shape[1]) for weight in siren.weights)
    varied = Varied(
        model, tuple(wide[0]), tuple(wide[1]), kept, model.window, model.features, variant=variant
    )
    for kind, value in variant.steps:
        varied = KINDS[kind].apply(varied, value)
    return varied


def _check(name: str, holds: bool, rule: str, way_out: str) -> None:
    """Refuse an approximation that this model cannot have."""
    if not holds:
        raise InputError("variant", name, rule, f"choose another, for example {way_out}")


# ---- bounds -----------------------------------------------------------------------------------------------


def enclose(varied: Varied, plan: Plan) -> list[Enclosure]:
    """Return enclosures of the full network's values for all images, errors being a variant's kernel's."""
    program = analysed(lower(varied.full))
    contract = varied.sine or plan.sine
    box = bounds.window_box(kernel_gather(program))
    layers = [index for index, node in enumerate(program.nodes) if node.op == "affine"]
    assert len(layers) == len(varied.weights), "a lowered model has one affine map a layer"
    known: dict[int, Enclosure] = {}
    if varied.bits:  # the window's numbers are rounded: half a step each
        window = next(index for index, node in enumerate(program.nodes) if node.op == "input")
        known[window] = Enclosure(*box, np.full_like(box[0], 0.5 / whole.INPUT_LEVELS))
    for layer, index in enumerate(layers):
        node = program.nodes[index]
        until = replace(program, nodes=program.nodes[:index], outputs=())
        x = bounds.enclose(until, {"window": box}, contract, known=known)[node.args[0]]
        names = str(node["weight"]), str(node["bias"])
        inside = dict(zip(names, (arrays[layer] for arrays in varied.inside), strict=True))
        outside = {name: program.parameters[name].astype(np.float64) for name in names}
        # Where sines promise nothing, an infinite error may meet a weight of 0: NaN is not a bound.
        with np.errstate(invalid="ignore"):
            wanted, kernel = (
                bounds.RULES["affine"](bounds.Context(node, parameters, contract), [x])
                for parameters in (outside, inside)
            )
        error = np.where(np.isnan(kernel.error), np.inf, kernel.error)
        if layer == 0 and not varied.bits:
            error = _first_error(varied, plan, error)
        known[index] = replace(
            kernel,
            low=wanted.low,
            high=wanted.high,
            error=(error + _moved(x, *(inside[n] - outside[n] for n in names))) * (1 + bounds.OUTWARD),
        )
    return bounds.enclose(program, {"window": box}, contract, known=known)


def _moved(x: Enclosure, weight: Array, bias: Array) -> Array:
    """Return how far weights and biases that differ by these move a layer's sums: |D c + d| + |D| r."""
    middle, radius = (x.low + x.high) / 2, (x.high - x.low) / 2
    size = np.abs(weight) @ np.broadcast_to(x.largest, weight.shape[1:]) + np.abs(bias)
    # float64 rounds sums of n + 1 products, the middle and the radius.
    rounding = (weight.shape[1] + 4) * 2.0**-52 * size
    found: Array = np.abs(weight @ middle + bias) + np.abs(weight) @ radius + rounding
    return found


def _first_error(varied: Varied, plan: Plan, error: Array) -> Array:
    """Return the error of the first layer's sums as the kernel computes them: one pass, two, or spectra.

    `error` is that of one pass; neurons that are left out keep it.
    """
    layer = next(index for index, node in enumerate(plan.analysed.nodes) if node.op == "affine")
    found = plan.enclosures()
    rows = varied.kept[1] if len(varied.kept) > 1 else np.arange(len(varied.biases[0]))
    errors = np.array(np.broadcast_to(error, varied.biases[0].shape))
    errors[rows] = found[layer].error
    return errors


def bound_of(plan: Plan) -> Array | None:
    """Return how far each channel (3,) of a variant's kernel may be from the full network; None: no bound.

    In display-encoded colour, over all images, against float64.
    """
    if not plan.varied.is_full:
        program, found = analysed(lower(plan.varied.full)), enclose(plan.varied, plan)
    else:  # The kernel's own bound, which is sharper than one layer after another.
        program, found = plan.analysed, plan.enclosures()
    (errors,) = bounds.output_errors(program, found).values()
    # A colour in integers is the nearest multiple of its step.
    errors = errors + (1.0 / whole.COLOUR_STEPS if plan.varied.bits else 0.0)
    return np.minimum(errors, LARGEST_DIFFERENCE) if np.isfinite(errors).all() else None


# ---- kernels ----------------------------------------------------------------------------------------------


def plan_model(model: Model, language: Language | str, schedule: str = PLAIN, variant: str = FULL) -> Plan:
    """Return the plan of a model, or of a variant of it, whose sine the language's profile may get."""
    varied, chosen = vary(parse(variant), model), language_named(language)
    chosen = chosen.under(varied.profile(chosen.profile.name))
    found = plan_program(lower(varied.model), chosen, schedule, varied.rank)
    return replace(found, varied=varied)


def variation(plan: Plan) -> Mapping[str, Any] | None:
    """Return what a manifest says about a variant: what was done, and what it moves; nothing of all else."""
    if plan.varied is None or not plan.varied.variant.steps:
        return None
    variant, full, bound = plan.varied.variant, plan.varied.full, bound_of(plan)
    return {
        "name": variant.name,
        "approximations": [f"{kind}{value}" for kind, value in variant.steps],
        "program": digest_of(full),
        "products": plan.varied.products,
        "products_of_full": vary(Variant(), full).products,
        "bound": {
            "output": None if bound is None else [round_up(float(error)) for error in bound],
            "against": "float64 reference of the full network, for all images, in display-encoded colour",
        },
    }


def digest_of(model: Model) -> str:
    """Return the digest of the full network's program: what a curve is measured of."""
    return ir.digest(analysed(lower(model)))
