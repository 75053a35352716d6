"""Kinds of networks: first parameters, activations layer by layer, derivatives, Adam; and those of integers.

Bounds are those of compiler/proof/bounds.py (PRO-6) at the case's own inputs; for Adam they are ranges, step
by step. Of integers every bound is 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
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
from ....compiler.training.step import ADAM_INPUTS, SQUARES, lower_adam, step_of, sum_errors
from ....refimpl.errors import InputError
from ....refimpl.network import adam, siren, train, whole
from ....refimpl.network.siren import Siren
from ....refimpl.network.whole import Whole
from ..case import Output, exact
from .tables import kind

Array = NDArray[Any]

POSTERIORI = "bounds of profile ieee at these inputs (compiler/proof/bounds.py)"
"""Where the bounds of networks come from."""

STEPS = "ranges of single precision under profile ieee, from step to step (compiler/proof/ranges.py)"
"""Where the bounds of Adam's runs come from."""


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


def _single(inputs: Mapping[str, Any]) -> Siren:
    """Return the network of a case in float32."""
    network = network_of(inputs)
    weights, biases = (
        tuple(part.astype(np.float32) for part in parts) for parts in (network.weights, network.biases)
    )
    return replace(network, weights=weights, biases=biases)


# ---- initial parameters -----------------------------------------------------------------------------------


def _init(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters in float32."""
    widths = [int(width) for width in np.ravel(inputs["widths"])]
    first, hidden = (float(inputs[f"omega_0_{part}"]) for part in ("first", "hidden"))
    made = siren.init(widths, first, hidden, int(inputs["seed"]), np.float32)
    pairs = enumerate(zip(made.weights, made.biases, strict=True))
    return {
        f"{name}_{layer}": part
        for layer, pair in pairs
        for name, part in zip(("weight", "bias"), pair, strict=True)
    }


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


def _of_forward(inputs: Mapping[str, Any], wanted: Mapping[str, Any], told: Any) -> dict[str, Output]:
    """Return activations with bounds."""
    types = {"x": Type(shape=inputs["x"].shape)}
    program = analysed(trace(partial(activations, _single(inputs)), types))
    found = bounds.at_inputs(program, {"x": inputs["x"][np.newaxis]}, EMITTED_SINE)
    return {
        name: Output(value, np.broadcast_to(found[name], (1, value.size))[0], POSTERIORI)
        for name, value in wanted.items()
    }


# ---- derivatives ------------------------------------------------------------------------------------------


def _gradient(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the loss and its derivatives."""
    windows, targets = (np.asarray(inputs[name], np.float64) for name in ("x", "target"))
    loss, found = train.loss_and_gradients(network_of(inputs), windows, targets)
    derivatives: dict[str, Any] = {"loss": loss}
    for layer, (weight, bias) in enumerate(zip(found.dweights, found.dbiases, strict=True)):
        derivatives |= {f"dweight_{layer}": weight, f"dbias_{layer}": bias}
    return derivatives


def _of_gradient(inputs: Mapping[str, Any], wanted: Mapping[str, Any], told: Any) -> dict[str, Output]:
    """Return derivatives with bounds. The mean of all squares has 8 roundings more than their sums."""
    x, target = inputs["x"], inputs["target"]
    step = step_of(partial(siren.forward, _single(inputs)), x.shape[1], target.shape[1], len(x))
    errors, expected = sum_errors(step, x, target), {}
    for name, value in wanted.items():
        if name == "loss":
            error = float(errors[SQUARES].sum()) / target.size + gamma(8) * value
        else:
            array = inputs[name.removeprefix("d")]
            owner = next(n for n, p in step.program.parameters.items() if np.array_equal(p, array))
            error = errors[owner].reshape(value.shape)
        expected[name] = Output(value, error, POSTERIORI)
    return expected


# ---- Adam -------------------------------------------------------------------------------------------------


def _adam(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters and moments (K, n) after each step."""
    theta: tuple[Array, ...] = (np.asarray(inputs["theta"], np.float64),)
    state, rows = adam.init(theta), []
    for gradient in np.asarray(inputs["gradients"], np.float64):
        theta, state = adam.step(theta, (gradient,), state, float(inputs["learning_rate"]))
        rows.append((theta[0], state.m[0], state.v[0]))
    return {name: np.array([row[i] for row in rows]) for i, name in enumerate(("theta", "m", "v"))}


def _either_way(value: float) -> Range:
    """Return the range of a float64 number that may be rounded to float32, either way."""
    near = np.float32(value)
    ends = sorted((float(np.nextafter(near, np.float32(0))), float(np.nextafter(near, np.float32(np.inf)))))
    return Range(np.float64(ends[0]), np.float64(ends[1]), near)


def _of_adam(inputs: Mapping[str, Any], wanted: Mapping[str, Any], told: Any) -> dict[str, Output]:
    """Return the runs (K, n) with bounds: what single precision may give, from step to step."""
    program, rate = lower_adam(), np.float64(inputs["learning_rate"])
    zero = np.zeros_like(np.asarray(inputs["theta"], np.float64))
    state: dict[str, Any] = {"theta": inputs["theta"], "m": zero, "v": zero}
    rows: list[Mapping[str, Range]] = []
    for t, gradient in enumerate(inputs["gradients"], start=1):
        grown = [_either_way(value) for value in adam.growth(t)]
        given = (state["theta"], gradient, state["m"], state["v"], rate, *grown)
        state = dict(ranges.evaluate(program, dict(zip(ADAM_INPUTS, given, strict=True))))
        rows.append(state)
    expected = {}
    for name, value in wanted.items():
        low, high = (np.array([getattr(row[name], end) for row in rows]) for end in ("low", "high"))
        expected[name] = Output(value, np.maximum(high - value, value - low), STEPS)
    return expected


# ---- integers ---------------------------------------------------------------------------------------------

INTEGERS = "integers: no operation rounds"
"""Where the bound 0 comes from."""

CHOSEN = "integers: what is rounded is at least 2^-12 from a tie, and float64 is off by less than 2^-20"
"""Where the bound 0 comes from: the covariance has a condition of at most 100 D_in + 1 (WHO-14), so that any
way to solve for a dozen inputs is off by some 1e-9."""

PARTS = ("weight", "factor", "bias")
"""The arrays of a layer, as inputs name them."""


def integers(values: Array) -> Array:
    """Return whole floats (...) as integers."""
    return np.asarray(values).astype(np.int64)


def _input(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of encoded features."""
    return {"n": integers(whole.round_image(np.asarray(inputs["x"], np.float32)))}


def _sine(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of phases."""
    phases = np.asarray(inputs["phase"], np.float64).astype(np.uint32)
    return {"value": integers(whole.whole_sine(phases, int(inputs["amplitude"])))}


def network_from(inputs: Mapping[str, Any]) -> Whole:
    """Return the network of a case, or refuse it."""
    count = sum(name.startswith("weight_") for name in inputs)
    given = [[np.asarray(inputs[f"{name}_{layer}"], np.float64) for layer in range(count)] for name in PARTS]
    fields = {name: int(inputs[name]) for name in ("amplitude", "fraction")}

    def network(dtype: type[np.floating[Any]]) -> Whole:
        weights, factors, biases = (tuple(array.astype(dtype) for array in arrays) for arrays in given)
        return Whole(weights, biases, 1.0, 1.0, factors=factors, **fields)  # type: ignore[arg-type]

    whole.check_whole(network(np.float64))  # float32 rounds what is beyond the limits to what is not
    return network(np.float32)


def layers(network: Whole, numbers: Any) -> dict[str, Any]:
    """Return the numbers of each hidden layer, and the colour; inputs (..., D_in) may be traced."""
    hidden = whole.sine_layers(network, numbers, len(network.weights) - 1)
    found = {f"layer_{layer}": values for layer, (_, values) in enumerate(hidden)}
    return {**found, "color": whole.forward_whole(network, numbers)}


def _forward_whole(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of each hidden layer, and the colour."""
    found = layers(network_from(inputs), np.asarray(inputs["n"], np.float32))
    return {name: value if name == "color" else integers(value) for name, value in found.items()}


def _rounded(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a network in integers, which may be rounded on windows.

    First is what the weights depend on, and those of the first layer are last.
    """
    siren, size, amplitude = network_of(inputs), int(inputs["size"]), int(inputs["amplitude"])
    if "windows" in inputs:
        network = whole.rounded_on(siren, np.asarray(inputs["windows"], np.float64), size, amplitude)
    else:
        network = whole.rounded(siren, size, amplitude)
    found: dict[str, Any] = {"fraction": network.fraction}
    for name, arrays in zip(PARTS, (network.weights, network.factors, network.biases), strict=True):
        found |= {f"{name}_{layer}": integers(array) for layer, array in enumerate(arrays)}
    order = sorted(found, key=lambda name: (name.startswith("weight_"), name == "weight_0"))
    return {name: found[name] for name in order}


KINDS = (
    kind("network.init", _init, exact("exact, rounded once to float32")),
    kind("network.forward", _forward, _of_forward),
    kind("network.gradient", _gradient, _of_gradient),
    kind("adam.run", _adam, _of_adam),
    kind("whole.input", _input, exact(INTEGERS)),
    kind("whole.sine", _sine, exact(INTEGERS)),
    kind("whole.forward", _forward_whole, exact(INTEGERS)),
    kind("whole.rounded", _rounded, exact(INTEGERS)),
    kind("whole.rounded_on", _rounded, exact(CHOSEN)),
)
"""The kinds of this module."""
