"""Grades lab 11: single steps, kernels' errors that are met, and a certificate that the checker takes.

1. A bound is right when it is not below what can happen and not far above what has to be: any sound formula
   passes [`between`]. A number that is too small is compared with those of known mistakes [`MISTAKES`].
2. The last check writes the kernel of a small model with the student's numbers in its certificate, and asks
   the project's checker, which names the step that does not hold [`certificate`].
"""

from __future__ import annotations

import json
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....compiler import artifact
from ....compiler.compile import compile_program
from ....compiler.core.enclosure import round_up
from ....compiler.core.lower import lower
from ....compiler.proof.checker import check
from ....compiler.proof.evidence import Refused
from ....refimpl.network import siren
from ....refimpl.network.dataset import Normalization, Window
from ....refimpl.network.denoise import Model
from ..frame import Check, Likely, Wrong, expect, hold, number_text, numbers_of, spread

U, WIDER = 2.0**-24, 1 + 2.0**-16
"""float32's rounding, and the skeleton's factor."""

LOOSE = 2.0
"""A number may be so many times the one of the skeleton's formulas: a coarser rule is sound too."""

MOST = 8.0
"""A bound may be so many times the project's, which takes norms where the skeleton takes magnitudes."""

DIGITS = 4
"""Digits of a certificate's numbers."""

SINE_ERROR = 4e-7
"""Error of the sine in the checks of single steps."""

POINTS = 4000
"""Inputs at which errors are measured."""


class Setting(NamedTuple):
    """How a step is computed: each field is a part that a mistake leaves out or changes."""

    unit: float = U
    terms: int = 2
    magnitude: bool = True
    bias: bool = True
    both_ends: bool = True
    omega: bool = True
    product: bool = True
    sine: bool = True
    always: bool = False
    box: str = "unit"


RIGHT = Setting()
"""Without a mistake."""

MISTAKES = (
    (Setting(unit=2.0**-53), "U is float32's 2^-24, not float64's"),
    (Setting(magnitude=False), "magnitudes: |W| and |b|, for inputs and weights have both signs"),
    (Setting(bias=False), "the bias is one of the terms: + |b|"),
    (Setting(both_ends=False), "the largest |x| is at one of both ends: max(|low|, |high|)"),
    (Setting(omega=False), "omega multiplies the sum's error"),
    (Setting(product=False), "the product with omega rounds too: + U times the largest argument"),
    (Setting(sine=False), "the sine adds its own error"),
    (Setting(always=True), "the last layer has no sine: sine_error is None"),
    (Setting(terms=0), "n products and a bias: gamma(n + 2)"),
    (Setting(terms=-1), "n products and a bias: gamma(n + 2)"),
    (
        Setting(box="first"),
        "the inputs of later layers are the sines before, in [-1 - sine_error, 1 + sine_error]",
    ),
    (Setting(box="same omega"), "omegas[0] is the first layer's, omegas[1] that of the other hidden ones"),
)
"""Mistakes in a step, and their explanations."""


def step(w: Any, b: Any, omega: float, low: Any, high: Any, sine: float | None, how: Setting = RIGHT) -> Any:
    """Return (argument, rounding, error) of a layer by the skeleton's formulas, or by one with a mistake."""
    largest = np.maximum(np.abs(low), np.abs(high)) if how.both_ends else np.abs(high)
    size = np.abs(w) @ largest if how.magnitude else w @ largest
    size = size + (0 if not how.bias else np.abs(b) if how.magnitude else b)
    n = w.shape[1] + how.terms
    own = n * how.unit / (1 - n * how.unit) * size
    argument = omega * (size + own)
    added = (omega if how.omega else 1.0) * own
    added = added + (how.unit * argument if sine is not None and how.product else 0.0)
    more = sine if sine is not None and how.sine else SINE_ERROR if sine is None and how.always else 0.0
    return argument, added, added + more


def steps(w: Any, b: Any, omegas: Any, low: Any, high: Any, sine: float, how: Setting = RIGHT) -> list[Any]:
    """Return the steps of all layers, with one mistake."""
    found = []
    for number, (weight, bias) in enumerate(zip(w, b, strict=True)):
        last = number == len(w) - 1
        omega = 1.0 if last else omegas[0] if how.box == "same omega" else omegas[min(number, 1)]
        found.append(step(weight, bias, omega, low, high, None if last and not how.always else sine, how))
        if how.box == "first" and not last and len(bias) == len(low):
            continue
        high = np.full(len(bias), 1 + sine)
        low = -high
    return found


NAMES = ("the largest argument", "the rounding error", "the error")
"""What a step is."""


def _close(a: Any, b: Any) -> bool:
    """Tell whether numbers are alike up to the factors WIDER that a step may have."""
    return bool(np.all(np.abs(np.asarray(a) - b) <= 1e-4 * np.abs(b)))


def between(clause: str, what: str, found: Any, right: Any, wrong: Likely, least: float = 1.0) -> None:
    """Refuse numbers (m,) below `least` times the right ones, or above LOOSE times."""
    array = numbers_of(clause, what, found, np.shape(right)).astype(np.float64)
    low, high = least * np.asarray(right), LOOSE * np.asarray(right)
    # A number that a known mistake gives is wrong even where it happens to be large enough.
    near = [(value, text) for value, text in wrong if not _close(value, right)]
    fits = [text for value, text in near if _close(array, value)]
    if np.all((array >= low) & (array <= high)) and not fits:
        return
    bad = ~((array >= low) & (array <= high)) | bool(fits)
    at = int(np.flatnonzero(bad)[0]) if array.ndim else 0
    shown, limits = np.atleast_1d(array)[at], (np.atleast_1d(low)[at], np.atleast_1d(high)[at])
    text = (
        "too small to be a bound: a term is missing"
        if shown < limits[0]
        else "far too large: the last layer has neither omega nor sine, and nothing counts twice"
    )
    expected = f"at least {number_text(limits[0])}, at most {number_text(limits[1])}"
    raise Wrong(clause, f"{what} of neuron {at}", expected, number_text(shown), fits[0] if fits else text)


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


def one_layer(student: Any) -> None:
    """A layer of known numbers."""
    w, b = np.array([[1.0, -2.0, 0.5], [-0.25, 0.5, 3.0]]), np.array([0.5, -1.0])
    low, high = np.array([-2.0, -0.5, 0.0]), np.array([1.0, 1.0, 0.25])
    for omega, sine in ((3.0, SINE_ERROR), (1.0, None)):
        kept = w.copy(), b.copy()
        found = student.layer(w, b, omega, low, high, sine)
        good = isinstance(found, (tuple, list)) and len(found) == 3
        hold("CER-2", "the result of layer", good, "argument, rounding, error", str(type(found)))
        hold(
            "CER-2",
            "weights",
            all(map(np.array_equal, (w, b), kept)),
            "no change",
            "a change",
            "`*=` or `+=`",
        )
        right = step(w, b, omega, low, high, sine)
        parts = [numbers_of("CER-2", name, v, (2,)) for name, v in zip(NAMES, found, strict=True)]
        text = "the order is: the largest argument, the rounding error, the error with the sine's"
        told = f"{number_text(parts[2])} and {number_text(parts[1])}"
        hold(
            "CER-2",
            "error and rounding error",
            np.all(parts[2] >= parts[1]),
            "the error is larger",
            told,
            text,
        )
        for number, name in enumerate(NAMES):
            wrong = [(step(w, b, omega, low, high, sine, how)[number], told) for how, told in MISTAKES]
            kind = "a hidden layer" if sine is not None else "the last layer"
            # A tighter rule may count each addition with what is added by then, not with the whole sum.
            between(
                "CER-2", f"{name} of {kind}", found[number], right[number], wrong, 1.0 if number == 0 else 0.6
            )


@cache
def built() -> Any:
    """Return a small model's kernel and its program's weights, biases, omegas and box."""
    network = siren.init((3, 8, 6, 3), 2.0, 3.0, 5)
    model = Model(network, ("color",), Window(1), Normalization())
    kernel = compile_program(lower(model), "opencl")
    weights = [np.asarray(w, np.float32).astype(np.float64) for w in network.weights]
    biases = [np.asarray(b, np.float32).astype(np.float64) for b in network.biases]
    return kernel, weights, biases, (2.0, 3.0), np.zeros(3), np.ones(3)


def all_layers(student: Any) -> Any:
    """Return the student's steps of the model, checked."""
    kernel, w, b, omegas, low, high = built()
    sine = float(kernel.certificate["sine"]["error_bound"])
    found = student.layers(w, b, omegas, low, high, sine)
    good = isinstance(found, (list, tuple)) and len(found) == len(w)
    hold("CER-2", "the result of layers", good, f"{len(w)} steps", str(found)[:60])
    right = steps(w, b, omegas, low, high, sine)
    for layer, one in enumerate(found):
        for number, name in enumerate(NAMES):
            wrong = [
                (steps(w, b, omegas, low, high, sine, how)[layer][number], told) for how, told in MISTAKES
            ]
            least = 1.0 if number == 0 and layer else 0.5
            between("CER-2", f"{name} of layer {layer}", one[number], right[layer][number], wrong, least)
    return found


def model_steps(student: Any) -> None:
    """The steps of a model's layers."""
    all_layers(student)


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
    hold(
        "CER-3",
        "the bound of each output",
        below,
        f"at least {number_text(worst)}, which is met",
        total,
        "a term is missing",
    )


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
    Check("errors that are met", measured),
    Check("a certificate", certificate),
)
"""In the order in which they explain a mistake best."""
