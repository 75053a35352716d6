"""Grades lab 11: single steps, kernels' errors that are met, and a certificate that the checker takes.

1. A bound is right when it is not below what the project's checker allows [`least`] and not far above the
   skeleton's formulas [`step`]: any sound formula passes [`between`]. A number outside is compared with those
   of known mistakes [`MISTAKES`]; layers are such that each mistake is outside in one of them [`LAYERS`].
2. What only float64's own rounding makes too small is found by rational numbers [`exactly`].
3. The last check writes the kernel of a small model with the student's numbers in its certificate, and asks
   the project's checker, which names the step that does not hold [`certificate`].
"""

from __future__ import annotations

import json
import tempfile
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import sums
from wamnet.compiler.core.enclosure import round_up
from wamnet.compiler.core.lower import lower
from wamnet.compiler.proof.checker import check
from wamnet.compiler.proof.evidence import Refused
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

from ..frame import Check, Likely, Wrong, expect, hold, number_text, numbers_of, results, spread, still

U, TINY, WIDER = 2.0**-24, 2.0**-110, 1 + 2.0**-16
"""float32's rounding, and the skeleton's number and factor."""

LOOSE = 2.0
"""A number may be so many times the one of the skeleton's formulas: a coarser rule is sound too."""

FLUSHES = 1e-25
"""What a bound may add for numbers that are taken for 0: many times TINY."""

MOST = 8.0
"""A bound may be so many times the project's, which takes norms where the skeleton takes magnitudes."""

DIGITS = 4
"""Digits of a certificate's numbers."""

SINE_ERROR = 4e-7
"""Error of the sine in the checks of single steps."""

COARSE = 0.25
"""Error of a sine that makes a box without it, or one that is added twice, plain to see."""

SMALLEST = 2.0**-126
"""A device may take a smaller number for 0."""

POINTS = 4000
"""Inputs at which errors are measured."""


OUTPUTS = 16
"""Outputs whose contributions are compared with rational numbers: some of their sums round downwards."""


class Setting(NamedTuple):
    """How a step is computed: each field is a part that a mistake leaves out or changes."""

    unit: float = U
    terms: int = 2
    magnitude: bool = True
    bias: bool = True
    both_ends: bool = True
    omega: bool = True
    product: bool = True
    held: bool = True
    tiny: bool = True
    sine: bool = True
    always: bool = False
    box: str = "unit"


RIGHT = Setting()
"""Without a mistake."""

MISTAKES = (
    (Setting(tiny=False), "a device may take all of these numbers for 0: + TINY"),
    (Setting(held=False), "the kernel's argument is off by its own error: omega times the sum and its error"),
    (Setting(unit=2.0**-53), "U is float32's 2^-24, not float64's"),
    (Setting(magnitude=False), "magnitudes: |W| and |b|, for inputs and weights have both signs"),
    (Setting(bias=False), "the bias is one of the terms: + |b|"),
    (Setting(both_ends=False), "the largest |x| is at one of both ends: max(|low|, |high|)"),
    (Setting(omega=False), "omega multiplies the sum's error"),
    (Setting(terms=1, product=False), "the product with omega rounds too: + U times the largest argument"),
    (Setting(sine=False), "the sine adds its own error"),
    (Setting(always=True), "the last layer has no sine: sine_error is None"),
    (Setting(terms=0), "a product and n additions, one after another: gamma(n + 1) or more, as n + 2"),
    (Setting(terms=-1), "a product and n additions, one after another: gamma(n + 1) or more, as n + 2"),
    (Setting(box="one"), "a sine is off by sine_error: the next box is [-1 - sine_error, 1 + sine_error]"),
    (Setting(box="same omega"), "omegas[0] is the first layer's, omegas[1] that of the other hidden ones"),
)
"""Mistakes in a step, and their explanations."""


def step(w: Any, b: Any, omega: float, low: Any, high: Any, sine: float | None, how: Setting = RIGHT) -> Any:
    """Return (argument, rounding, error) of a layer by the skeleton's formulas, or by one with a mistake."""
    largest = np.maximum(np.abs(low), np.abs(high)) if how.both_ends else np.abs(high)
    size = np.abs(w) @ largest if how.magnitude else w @ largest
    size = size + (0 if not how.bias else np.abs(b) if how.magnitude else b)
    n, tiny = w.shape[1] + how.terms, TINY if how.tiny else 0.0
    own = n * how.unit / (1 - n * how.unit) * size + tiny
    argument = omega * (size + own) if how.held else omega * size
    added = (omega if how.omega else 1.0) * own
    added = added + (how.unit * argument + tiny if sine is not None and how.product else 0.0)
    more = sine if sine is not None and how.sine else SINE_ERROR if sine is None and how.always else 0.0
    return argument * WIDER, added * WIDER, (added + more + tiny) * WIDER


def least(w: Any, b: Any, omega: float, low: Any, high: Any, sine: float | None) -> Any:
    """Return (argument, rounding, error) of a layer, below which no bound holds by the checker's rules.

    The largest |W x + b| is at a corner of the box; its error is PRO-6b's, or all of it where it is so small
    that a device may take it for 0. omega's product rounds once more.
    """
    middle, half = (low + high) / 2, (high - low) / 2
    size = np.abs(w @ middle + b) + np.abs(w) @ half
    own = np.maximum(sums.rounding(w, b, low, high, [slice(None)]), np.where(size < SMALLEST, size, 0.0))
    argument = omega * (size + own)
    added = omega * own + (U * argument if sine is not None else 0.0)
    return argument, added, added + (sine or 0.0)


def steps(w: Any, b: Any, omegas: Any, low: Any, high: Any, sine: float, how: Setting | None = RIGHT) -> Any:
    """Return the steps of all layers, with one mistake; without a setting the least ones."""
    found = []
    for number, (weight, bias) in enumerate(zip(w, b, strict=True)):
        last = number == len(w) - 1
        same = how is not None and how.box == "same omega"
        omega = 1.0 if last else omegas[0 if same else min(number, 1)]
        error = None if last and not (how and how.always) else sine
        one = weight, bias, omega, low, high, error
        found.append(step(*one, how) if how else least(*one))
        high = np.full(len(bias), 1.0 if how and how.box == "one" else 1 + sine)
        low = -high
    return found


NAMES = ("the largest argument", "the rounding error", "the error")
"""What a step is."""


def _close(a: Any, b: Any) -> bool:
    """Tell whether numbers are alike up to the factors WIDER that a step may have."""
    return bool(np.all(np.abs(np.asarray(a) - b) <= 1e-4 * np.abs(b)))


def between(clause: str, what: str, found: Any, low: Any, right: Any, wrong: Likely) -> None:
    """Refuse numbers (m,) below `low`, or above LOOSE times the right ones."""
    array = numbers_of(clause, what, found, np.shape(right)).astype(np.float64)
    # float64 rounds the limit too; `exactly` asks for what it rounds.
    low, high = np.asarray(low) * (1 - 2.0**-40), LOOSE * np.asarray(right) + FLUSHES
    bad = ~((array >= low) & (array <= high))
    if not np.any(bad):
        return
    at = int(np.flatnonzero(bad)[0])
    text = (
        "too small to be a bound: a term is missing"
        if array[at] < low[at]
        else "far too large: the last layer has neither omega nor sine, and nothing counts twice"
    )
    text = next((told for value, told in wrong if _close(array, value) and not _close(value, right)), text)
    expected = f"at least {number_text(low[at])}, at most {number_text(high[at])}"
    raise Wrong(clause, f"{what} of neuron {at}", expected, number_text(array[at]), text)


def gammas(student: Any) -> None:
    """Numbers of roundings."""
    for n in (1, 3, 1000):
        right = n * U / (1 - n * U)
        likely = [
            (n * 2.0**-53 / (1 - n * 2.0**-53), "U is float32's 2^-24, not float64's"),
            (n * 2 * U / (1 - n * 2 * U), "U is half a unit in the last place: 2^-24"),
            (n * U / (1 + n * U), "1 - n U below"),
            (n * U, "divided by 1 - n U"),
            (U / (1 - n * U), "n U above"),
            ((1 + U) ** n - 1, "n U / (1 - n U)"),
        ]
        found = numbers_of("PRO-6b", "gamma", student.gamma(n), ())
        bound = 1e-12 * right
        if right <= found <= right * WIDER:
            continue
        text = next((told for value, told in likely if abs(found - value) <= bound), "n U / (1 - n U)")
        expect("PRO-6b", f"gamma({n})", found, right, bound, (), text)


LAYERS = (
    ([[1.0, -2.0, 0.5], [-0.25, 0.5, 3.0]], [-0.5, 1.0], [-2.0, -4.0, -1.0], [1.0, 1.0, 0.25]),
    # One term is nearly all of the sum: every addition rounds it.
    ([[8.0, 2.0**-9, -(2.0**-9)], [2.0**-9, -8.0, 2.0**-9]], [2.0**-9, 2.0**-9], [-1.0] * 3, [1.0] * 3),
    # Long sums, whose error WIDER does not hide.
    (np.ones((2, 6000)), np.ones(2), np.full(6000, -1.0), np.ones(6000)),
    # Numbers that a device may take for 0.
    (np.full((2, 2), 2.0**-100), np.zeros(2), np.full(2, -(2.0**-40)), np.full(2, 2.0**-40)),
)
"""Weights, biases, and boxes of layers: each of MISTAKES is plain in one of them."""


def one_layer(student: Any) -> None:
    """Layers of known numbers."""
    for numbers in LAYERS:
        w, b, low, high = map(np.array, numbers)
        for omega, sine in ((1.0, None), (3.0, SINE_ERROR)):
            found = student.layer(*still(w, b), omega, low, high, sine)
            results("CER-2", "the result of layer", found, 3, "argument, rounding, error")
            kind = f"{'a hidden' if sine is not None else 'the last'} layer of {w.shape[1]} inputs"
            right, low_right = step(w, b, omega, low, high, sine), least(w, b, omega, low, high, sine)
            parts = [numbers_of("CER-2", name, v, (2,)) for name, v in zip(NAMES, found, strict=True)]
            text = "the order is: the largest argument, the rounding error, the error with the sine's"
            told = f"{number_text(parts[2])} and {number_text(parts[1])}"
            what = "error and rounding error"
            hold("CER-2", what, np.all(parts[2] >= parts[1]), "the error is larger", told, text)
            for number, name in enumerate(NAMES):
                wrong = [(step(w, b, omega, low, high, sine, how)[number], told) for how, told in MISTAKES]
                between("CER-2", f"{name} of {kind}", found[number], low_right[number], right[number], wrong)


@cache
def built() -> Any:
    """Return a small model's kernel and its program's weights, biases, omegas and box."""
    network = siren.init((3, 8, 6, 5, 3), 2.0, 3.0, 5)
    model = Model(network, ("color",), Window(1), Normalization())
    kernel = compile_program(lower(model), "opencl")
    weights = [np.asarray(w, np.float32).astype(np.float64) for w in network.weights]
    biases = [np.asarray(b, np.float32).astype(np.float64) for b in network.biases]
    return kernel, weights, biases, (2.0, 3.0), np.zeros(3), np.ones(3)


def all_layers(student: Any, sine: float | None = None) -> Any:
    """Return the student's steps of the model, checked; the sine's error is the kernel's unless given."""
    kernel, w, b, omegas, low, high = built()
    sine = float(kernel.certificate["sine"]["error_bound"]) if sine is None else sine
    found = student.layers(w, b, omegas, low, high, sine)
    results("CER-2", "the result of layers", found, len(w), f"{len(w)} steps")
    right, low_right = steps(w, b, omegas, low, high, sine), steps(w, b, omegas, low, high, sine, None)
    others = [(steps(w, b, omegas, low, high, sine, how), told) for how, told in MISTAKES]
    for layer, one in enumerate(found):
        for number, name in enumerate(NAMES):
            wrong = [(steps_of[layer][number], told) for steps_of, told in others]
            what = f"{name} of layer {layer}"
            between("CER-2", what, one[number], low_right[layer][number], right[layer][number], wrong)
    return found


def model_steps(student: Any) -> None:
    """The steps of a model's layers, with its kernel's sine and with a coarse one."""
    all_layers(student)
    all_layers(student, COARSE)


def reaches(w: Any, omegas: Any, errors: Any, how: str = "") -> Any:
    """Return what each layer adds to each output (D_out, L), with one mistake."""
    size = np.array if how == "signed" else np.abs
    found, reach = [np.asarray(errors[-1], np.float64)], size(w[-1])
    found[0] = 0 * found[0] if how == "no last" else found[0]
    for number in reversed(range(len(w) - 1)):
        found.insert(0, reach @ errors[number])
        omega = 1.0 if how == "omega" else omegas[0] if how == "first" else omegas[min(number, 1)]
        reach = reach @ (omega * size(w[number])) if how != "last only" or number else reach
    found = found[::-1] if how == "order" else found
    return np.stack(found, axis=1)


def passed_on(student: Any) -> None:
    """What each layer's errors become."""
    w = [np.array([[0.5, -1.0], [2.0, 0.25], [1.0, 1.5]]), np.array([[1.0, -2.0, 0.5], [0.5, 0.25, -1.0]])]
    w.append(np.array([[1.0, -0.5], [0.25, 2.0]]))
    errors = [np.array([1e-6, 2e-6, 5e-7]), np.array([3e-6, 1e-6]), np.array([2e-7, 4e-7])]
    found = student.contributions(w, (2.0, 5.0), errors)
    numbers_of("CER-3", "contributions", found, (2, 3))
    right = reaches(w, (2.0, 5.0), errors)
    likely = [
        (reaches(w, (2.0, 5.0), errors, how), told)
        for how, told in (
            ("signed", "magnitudes |W|: errors have either sign, and do not cancel"),
            ("omega", "an error before a sine is multiplied by omega as well"),
            ("first", "each layer's own omega"),
            ("no last", "the last layer's own error counts as well"),
            ("order", "the first column is the first layer"),
        )
    ]
    wrong = next((told for value, told in likely if np.allclose(found, value, rtol=1e-3, atol=0)), "")
    text = wrong or "|W_L| omega |W_(L-1)| ... e: from the output backwards, layer after layer"
    low = np.all(np.asarray(found) >= right * (1 - 1e-12))
    high = np.all(np.asarray(found) <= right * LOOSE)
    hold("CER-3", "contributions (D_out, L)", low and high, number_text(right), number_text(found), text)


def exactly(student: Any) -> None:
    """Contributions are not below those of rational numbers: float64 rounds, too."""
    shapes = ((4, 3), (4, 4), (OUTPUTS, 4))
    w = [spread(142 + number, shape, -1.0, 1.0) for number, shape in enumerate(shapes)]
    errors = [spread(145 + number, shape[:1], 1e-7, 1e-6) for number, shape in enumerate(shapes)]
    found = numbers_of("CER-3", "contributions", student.contributions(w, (3.0, 0.7), errors), (OUTPUTS, 3))
    one = [[[Fraction(float(abs(v))) for v in row] for row in weight] for weight in w]
    e = [[Fraction(float(v)) for v in error] for error in errors]
    before = [Fraction(0.7) * sum(a * b for a, b in zip(row, e[0], strict=True)) for row in one[1]]
    for output, row in enumerate(one[2]):
        for layer, passed in enumerate((before, e[1])):
            right = sum(a * b for a, b in zip(row, passed, strict=True))
            what = f"what layer {layer} adds to output {output}"
            told = f"at least {float(right):.17g}, rounded upwards", f"{found[output, layer]:.17g}"
            good = Fraction(float(found[output, layer])) >= right
            hold("CER-3", what, good, *told, "float64 rounds as well: times WIDER")


def measured(student: Any) -> None:
    """Errors that float32 makes at random inputs are below the bound."""
    _, w, b, omegas, _, _ = built()
    found = all_layers(student)
    total = np.sum(student.contributions(w, omegas, [one[2] for one in found]), axis=1)
    exact = single = spread(141, (POINTS, 3), 0.0, 1.0).astype(np.float32).astype(np.float64)
    single = single.astype(np.float32)
    for number, (weight, bias) in enumerate(zip(w, b, strict=True)):
        exact = exact @ weight.T + bias
        single = single @ weight.T.astype(np.float32) + bias.astype(np.float32)
        if number < len(w) - 1:
            omega = omegas[min(number, 1)]
            exact, single = np.sin(omega * exact), np.sin(np.float32(omega) * single)
    worst = np.abs(single - exact).max(axis=0)
    below = bool(np.all(worst <= total))
    wanted = f"at least {number_text(worst)}, which is met"
    hold("CER-3", "the bound of each output", below, wanted, total, "a term is missing")


def certificate(student: Any) -> None:
    """The project's checker takes the student's numbers, and they are not far above its own."""
    kernel, w, _, omegas, _, _ = built()
    found = all_layers(student)
    adds = np.asarray(student.contributions(w, omegas, [one[2] for one in found]))
    held = json.loads(json.dumps(kernel.certificate))
    own = list(held["bound"]["output"])

    def up(value: Any) -> float:
        return round_up(float(value), DIGITS)

    for stated, (argument, rounding, error) in zip(held["layers"], found, strict=True):
        stated["argument_bound"] = up(np.max(argument))
        stated["rounding_bound"] = [up(v) for v in np.broadcast_to(rounding, len(stated["rounding_bound"]))]
        stated["error_bound"] = [up(v) for v in np.broadcast_to(error, len(stated["error_bound"]))]
    for stated, some in zip(held["outputs"], adds, strict=True):
        stated["layer_bounds"] = [up(v) for v in some]
        stated["error_bound"] = up(np.sum(some) * WIDER)
    held["bound"]["output"] = [stated["error_bound"] for stated in held["outputs"]]
    with tempfile.TemporaryDirectory(dir=".") as folder:
        artifact.write(kernel, folder)
        path = Path(folder) / artifact.CERTIFICATE_NAME
        path.write_text(json.dumps(held), encoding="utf-8")
        manifest = Path(folder) / artifact.MANIFEST_NAME
        whole = json.loads(manifest.read_text(encoding="utf-8"))
        whole["bound"]["output"] = held["bound"]["output"]
        manifest.write_text(json.dumps(whole), encoding="utf-8")
        try:
            check(path)
        except Refused as reason:
            text = "the step that it names has a number that is too small"
            raise Wrong("CER-4", "the certificate", "that every step holds", str(reason), text) from None
    worst = float(np.max(np.array(held["bound"]["output"]) / np.array(own)))
    good = worst <= MOST
    hold("CER-3", "your bound over the project's", good, f"at most {MOST:g}", worst, "layers counted twice")


CHECKS = (
    Check("gamma", gammas),
    Check("a layer", one_layer),
    Check("all layers", model_steps),
    Check("from a layer to the outputs", passed_on),
    Check("what float64 rounds", exactly),
    Check("errors that are met", measured),
    Check("a certificate", certificate),
)
"""In the order in which they explain a mistake best."""
