"""Kinds of networks of integers: inputs, the sine, a network layer by layer, rounding. Every bound is 0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl.network import whole
from ....refimpl.network.whole import Whole
from ..case import exact
from .network import network_of
from .tables import kind

Array = NDArray[Any]

SOURCE = "integers: no operation rounds"
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


def _forward(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of each hidden layer, and the colour."""
    found = layers(network_from(inputs), np.asarray(inputs["n"], np.float32))
    return {name: value if name == "color" else integers(value) for name, value in found.items()}


def _rounded(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a network in integers."""
    return _in_order(whole.rounded(network_of(inputs), int(inputs["size"]), int(inputs["amplitude"])))


def _in_order(network: Whole) -> dict[str, Any]:
    """Return what a network holds: first what the weights depend on, and those of the first layer last."""
    found: dict[str, Any] = {"fraction": network.fraction}
    for name, arrays in zip(PARTS, (network.weights, network.factors, network.biases), strict=True):
        found |= {f"{name}_{layer}": integers(array) for layer, array in enumerate(arrays)}
    order = sorted(found, key=lambda name: (name.startswith("weight_"), name == "weight_0"))
    return {name: found[name] for name in order}


def _rounded_on(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a network in integers that was rounded on windows."""
    windows = np.asarray(inputs["windows"], np.float64)
    size, amplitude = int(inputs["size"]), int(inputs["amplitude"])
    return _in_order(whole.rounded_on(network_of(inputs), windows, size, amplitude))


KINDS = (
    kind("whole.input", _input, exact(SOURCE)),
    kind("whole.sine", _sine, exact(SOURCE)),
    kind("whole.forward", _forward, exact(SOURCE)),
    kind("whole.rounded", _rounded, exact(SOURCE)),
    kind("whole.rounded_on", _rounded_on, exact(CHOSEN)),
)
"""The kinds of this module."""
