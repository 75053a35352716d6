"""Kinds of the network: initial parameters, activations layer by layer, derivatives, Adam over several steps.

Bounds are those of compiler/proof/bounds.py (PRO-6) at the case's own inputs; for Adam they are ranges, step
by step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....compiler.core.ir import Type
from ....compiler.core.profiles import EMITTED_SINE
from ....compiler.core.sums import gamma
from ....compiler.core.trace import trace
from ....compiler.plan import analysed
from ....compiler.proof import bounds, ranges
from ....compiler.proof.ranges import Range
from ....compiler.training.lower_step import ADAM_INPUTS, lower_adam, step_of
from ....compiler.training.step import SQUARES, sum_errors
from ....refimpl.errors import InputError
from ....refimpl.network import adam, siren, train
from ....refimpl.network.siren import Siren
from ..case import Case, Output, exact
from ..functions import drawn
from .tables import kind, table

Array = NDArray[Any]

POSTERIORI = "bounds of profile ieee at these inputs (compiler/proof/bounds.py)"
"""Where the bounds of networks come from."""

ROWS = table("networks")
"""Networks of the cases, which are data: widths, omega_0 of the first layer and of the others; networks with
more than 1,024 weights or 255 neurons in a layer and large seeds, which are only drawn; what is refused;
layers and inputs that do not fit a network of 4, 5 and 3 numbers (SIR-1); and for Adam gradients of the first
step, which halve from step to step, and every second one turns in the second row."""

SIZES = ROWS["sizes"]
"""Networks of the cases."""

EXAMPLES = 4
"""Examples of a minibatch."""


def _network(index: int) -> Siren:
    """Return the network of a case: large weights in the third."""
    widths, first, hidden = SIZES[index]
    return siren.init(widths, first, hidden, seed=index, dtype=np.float32)


def as_inputs(network: Siren) -> dict[str, Any]:
    """Return a network as inputs of a case."""
    found: dict[str, Any] = {"omega_0_first": network.omega_0_first, "omega_0_hidden": network.omega_0_hidden}
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        found |= {f"weight_{layer}": weight, f"bias_{layer}": bias}
    return found


def network_of(inputs: Mapping[str, Any]) -> Siren:
    """Return the network of a case in float64."""
    count = sum(name.startswith("weight_") for name in inputs)
    weights, biases = (
        tuple(np.asarray(inputs[f"{name}_{layer}"], np.float64) for layer in range(count))
        for name in ("weight", "bias")
    )
    _check_fit(weights, biases)
    return Siren(weights, biases, float(inputs["omega_0_first"]), float(inputs["omega_0_hidden"]))


def _check_fit(weights: Sequence[Array], biases: Sequence[Array]) -> None:
    """Raise InputError where layers do not fit one another, or biases their layer (SIR-1)."""
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        wide = weights[layer - 1].shape[0] if layer else weight.shape[1]
        if weight.shape[1] != wide or bias.shape != weight.shape[:1]:
            rule = f"must take {wide} numbers, and have as many biases as rows"
            raise InputError(f"layer {layer}", weight.shape, rule, "give layers that fit one another")


def _numbers(index: int, shape: tuple[int, ...], scale: float = 1.0) -> Array:
    """Return numbers (...) in [-scale, scale], float32 in float64."""
    count = int(np.prod(shape))
    flat = (2.0 * drawn("network", index, count) - 1.0) * scale
    return flat.astype(np.float32).astype(np.float64).reshape(shape)


# ---- initial parameters -----------------------------------------------------------------------------------


def _init(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters in float32."""
    widths = [int(width) for width in np.ravel(inputs["widths"])]
    drawn_ones = siren.init(
        widths,
        float(inputs["omega_0_first"]),
        float(inputs["omega_0_hidden"]),
        int(inputs["seed"]),
        np.float32,
    )
    return {name: value for name, value in as_inputs(drawn_ones).items() if not name.startswith("omega")}


def _init_cases() -> list[Case]:
    """Return some networks."""
    cases = []
    rows = [(*row, index) for index, row in enumerate(SIZES)]
    for widths, first, hidden, seed in [*rows, *ROWS["drawn"]]:
        inputs = {"widths": np.array(widths), "omega_0_first": first, "omega_0_hidden": hidden, "seed": seed}
        cases.append(Case("SIR-5", inputs, exact(_init(inputs), "exact, rounded once to float32")))
    for name, value in ROWS["wrong"]:
        inputs = {"widths": np.array([4, 5, 3]), "omega_0_first": 3.0, "omega_0_hidden": 1.0, "seed": 0}
        wrong = {**inputs, name: np.array(value) if isinstance(value, list) else value}
        cases.append(Case("SIR-5", wrong, None, f"{name} = {wrong[name]}"))
    return cases


# ---- activations ------------------------------------------------------------------------------------------


def activations(network: Siren, x: Any) -> dict[str, Any]:
    """Return what each layer gives, the last one the network's value; `x` (..., D_in) may be traced."""
    found = {}
    for layer in range(len(network.weights)):
        part = Siren(
            (network.weights[layer],), (network.biases[layer],), network.omega_0_first, network.omega_0_hidden
        )
        omega = network.omega_0_first if layer == 0 else network.omega_0_hidden
        x = siren.forward(part, x)
        if layer < len(network.weights) - 1:
            x = np.sin(omega * x)
        found[f"layer_{layer}"] = x
    return found


def _forward(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the activations of one input vector."""
    network, x = network_of(inputs), np.asarray(inputs["x"], np.float64)[np.newaxis]
    if x.shape[1:] != network.widths[:1]:
        rule = f"the first layer takes {network.widths[0]} numbers"
        raise InputError("x", x.shape[1:], rule, "give as many")
    found = activations(network, x)
    found[f"layer_{len(network.weights) - 1}"] = siren.forward(network, x)
    return {name: value[0] for name, value in found.items()}


def _forward_cases() -> list[Case]:
    """Return activations with bounds."""
    cases = []
    rows = [(index, note) for index in range(len(SIZES)) for note in ("", "zeros", "an input of a firefly")]
    for number, (index, note) in enumerate(rows):
        network, n_in = _network(index), SIZES[index][0][0]
        x = {"": _numbers(number, (n_in,)), "zeros": np.zeros(n_in)}.get(
            note, _numbers(number, (n_in,), 40.0)
        )
        inputs = {**as_inputs(network), "x": x}
        program = analysed(trace(partial(activations, network), {"x": Type(shape=(n_in,))}))
        found = bounds.at_inputs(program, {"x": x[np.newaxis]}, EMITTED_SINE)
        expected = {
            name: Output(value, np.broadcast_to(found[name], (1, value.size))[0], POSTERIORI)
            for name, value in _forward(inputs).items()
        }
        cases.append(Case("SIR-2", inputs, expected, note))
    good = as_inputs(siren.init([4, 5, 3], 3.0, 1.0, seed=0, dtype=np.float32))
    for note, name, shape in ROWS["unfit"]:
        wrong = {**good, "x": np.zeros(4), name: np.zeros(shape)}
        cases.append(Case("SIR-1", wrong, None, note))
    return cases


# ---- derivatives ------------------------------------------------------------------------------------------


def _gradient(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the loss and its derivatives."""
    windows, targets = (np.asarray(inputs[name], np.float64) for name in ("x", "target"))
    loss, found = train.loss_and_gradients(network_of(inputs), windows, targets)
    derivatives: dict[str, Any] = {"loss": loss}
    for layer, (weight, bias) in enumerate(zip(found.dweights, found.dbiases, strict=True)):
        derivatives |= {f"dweight_{layer}": weight, f"dbias_{layer}": bias}
    return derivatives


def _gradient_cases() -> list[Case]:
    """Return derivatives with bounds."""
    cases = []
    for index, (widths, _, _) in enumerate(SIZES):
        network = _network(index)
        x, target = _numbers(20 + index, (EXAMPLES, widths[0])), _numbers(30 + index, (EXAMPLES, widths[-1]))
        inputs = {**as_inputs(network), "x": x, "target": target}
        step = step_of(partial(siren.forward, network), widths[0], widths[-1], EXAMPLES)
        errors = sum_errors(step, x, target)
        expected = {}
        # The loss comes first: what is wrong with it is wrong with all derivatives.
        for name, value in _gradient(inputs).items():
            if name == "loss":
                # The mean of all squares is their sums' sum over their number: 8 more roundings at most.
                error = float(errors[SQUARES].sum()) / target.size + gamma(8) * value
                expected[name] = Output(value, error, POSTERIORI, clause="TRN-3")
                continue
            array = inputs[name.removeprefix("d")]
            owner = next(n for n, p in step.program.parameters.items() if np.array_equal(p, array))
            expected[name] = Output(value, errors[owner].reshape(value.shape), POSTERIORI)
        cases.append(Case("SIR-7", inputs, expected))
    return cases


# ---- Adam -------------------------------------------------------------------------------------------------


def _adam(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters and moments (K, n) after each step."""
    theta: tuple[Array, ...] = (np.asarray(inputs["theta"], np.float64),)
    state, rows = adam.init(theta), []
    for gradient in np.asarray(inputs["gradients"], np.float64):
        theta, state = adam.step(theta, (gradient,), state, float(inputs["learning_rate"]))
        rows.append((theta[0], state.m[0], state.v[0]))
    return {name: np.array([row[i] for row in rows]) for i, name in enumerate(("theta", "m", "v"))}


def _adam_ranges(inputs: Mapping[str, Any]) -> dict[str, tuple[Array, Array]]:
    """Return the ends (K, n) of what single precision may give, from step to step."""
    program, theta = lower_adam(), np.asarray(inputs["theta"], np.float64)
    zero = np.zeros_like(theta)
    state: dict[str, Any] = {"theta": theta, "m": zero, "v": zero}
    rows = []
    for t, gradient in enumerate(inputs["gradients"], start=1):
        grown = [_rounded(value) for value in adam.growth(t)]
        rate = np.float64(inputs["learning_rate"])
        given = (state["theta"], gradient, state["m"], state["v"], rate, *grown)
        state = ranges.evaluate(program, dict(zip(ADAM_INPUTS, given, strict=True)))
        rows.append({name: (np.array(r.low), np.array(r.high)) for name, r in state.items()})
    return {
        name: tuple(np.array([row[name][end] for row in rows]) for end in (0, 1))  # type: ignore[misc]
        for name in ("theta", "m", "v")
    }


def _rounded(value: float) -> Range:
    """Return the range of a float64 number that may be rounded to float32, either way."""
    near = np.float32(value)
    ends = sorted((float(np.nextafter(near, np.float32(0))), float(np.nextafter(near, np.float32(np.inf)))))
    return Range(np.float64(ends[0]), np.float64(ends[1]), near)


def _adam_cases() -> list[Case]:
    """Return runs of a few steps."""
    cases = []
    for index, (note, first, count) in enumerate(ROWS["adam"]):
        factors = [(-0.5 if index == 1 else 0.5) ** k for k in range(count)]
        gradients = np.array([np.float32(f) * np.array(first, np.float32) for f in factors], np.float64)
        inputs = {"theta": _numbers(40 + index, (4,)), "gradients": gradients, "learning_rate": 2.0**-10}
        found, ends = _adam(inputs), _adam_ranges(inputs)
        expected = {
            name: Output(value, np.maximum(ends[name][1] - value, value - ends[name][0]), ranges_text())
            for name, value in found.items()
        }
        cases.append(Case("ADM-1", inputs, expected, note))
    return cases


def ranges_text() -> str:
    """Return where the bounds of Adam's runs come from."""
    return "ranges of single precision under profile ieee, from step to step (compiler/proof/ranges.py)"


KINDS = (
    kind("network.init", _init_cases, _init),
    kind("network.forward", _forward_cases, _forward),
    kind("network.gradient", _gradient_cases, _gradient),
    kind("adam.run", _adam_cases, _adam),
)
"""The kinds of this module."""
