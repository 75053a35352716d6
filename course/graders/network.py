"""Grades lab 7: single layers, the spec's vectors, and central differences of the student's own loss."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..frame import Check, Likely, alike, asked, equal, expect, results, spread, still

OMEGAS = (3.0, 2.5)
"""omega of the first sines and of the others."""

SIZES = (3, 4, 4, 2)
"""Neurons of a network of three layers."""

COUNT = 5
"""Examples."""

Network = tuple[list[Any], list[Any]]
"""Weights and biases."""


def network(sizes: tuple[int, ...] = SIZES) -> Network:
    """Return a network's weights and biases."""
    pairs = list(enumerate(pairwise(sizes)))
    weights = [spread(31 + i, (n, m), -1.0, 1.0) / np.sqrt(m) for i, (m, n) in pairs]
    return weights, [spread(41 + i, (n,), -0.5, 0.5) for i, (_, n) in pairs]


def forwards(w: Any, b: Any, omegas: Any, x: Any, how: str = "") -> list[Any]:
    """Return what the layers give, with one mistake."""
    found = []
    for layer, (weight, bias) in enumerate(zip(w, b, strict=True)):
        omega = omegas[0] if layer == 0 or how == "first" else omegas[1]
        omega = omegas[1 - min(layer, 1)] if how == "swapped" else omega
        omega = 1.0 if how == "none" else omega
        y = x @ weight.T + (0 if how == "bias" else bias)
        if layer < len(w) - 1 or how == "last":
            y = np.sin(omega * y if how != "outside" else omega * (x @ weight.T) + bias)
            y = np.cos(np.arcsin(y)) if how == "cosine" else y
        elif how == "omega":
            y = omega * y
        found.append(y)
        x = y
    return found


FORWARD_MISTAKES = (
    ("outside", "omega multiplies the bias too: sin(omega (W x + b))"),
    ("none", "omega is missing"),
    ("first", "omega of the first layer in all layers: the others have omegas[1]"),
    ("swapped", "omegas[0] is the first layer's, omegas[1] the others'"),
    ("last", "the last layer has no sine"),
    ("omega", "the last layer has no omega either"),
    ("bias", "the bias is missing"),
)
"""Mistakes on the way forwards, and their explanations."""


def layers(student: Any) -> None:
    """What each layer gives."""
    w, b = network()
    x = spread(51, (COUNT, SIZES[0]), -1.0, 1.0)
    found = student.forward(w, b, OMEGAS, x)
    wanted = forwards(w, b, OMEGAS, x)
    text = "the values of each layer, the last one's too, and not the input"
    results("SIR-2", "the result of forward", found, len(w), f"a list of {len(w)} arrays", text)
    for number, right in enumerate(wanted):
        likely = [(forwards(w, b, OMEGAS, x, how)[number], told) for how, told in FORWARD_MISTAKES]
        text = (
            "layer l takes what layer l - 1 gives" if number else "sin(omega (W x + b)), W is (D_out, D_in)"
        )
        # A sum of four products and a sine of an argument below 10, in float64.
        expect("SIR-2", f"layer {number}", found[number], right, 1e-12, likely, text)


def backwards(w: Any, b: Any, x: Any, target: Any, how: str = "") -> tuple[float, list[Any], list[Any]]:
    """Return the loss and its derivatives, with one mistake."""
    values = [x, *forwards(w, b, OMEGAS, x)]
    error = values[-1] - target
    size = {"sum": 1, "batch": len(x), "channels": error.shape[1]}.get(how, error.size)
    dy = {"half": 1.0, "sign": -2.0}.get(how, 2.0) * error / size
    dw: list[Any] = []
    db: list[Any] = []
    for layer in reversed(range(len(w))):
        if layer < len(w) - 1:
            omega = OMEGAS[min(layer, 1)]
            omega = 1.0 if how == "omega" else OMEGAS[0] if how == "first" else omega
            inner = OMEGAS[min(layer, 1)] * (values[layer] @ w[layer].T + b[layer])
            inner = inner / OMEGAS[min(layer, 1)] if how == "argument" else inner
            slope = {"sine": np.sin(inner), "minus": -np.cos(inner), "value": np.cos(values[layer + 1])}
            dy = dy * (slope.get(how, np.cos(inner)) if how != "linear" else 1.0) * omega
        dw.insert(0, dy.T @ values[layer])
        db.insert(0, dy.mean(axis=0) if how == "mean" else dy.sum(axis=0))
        dy = dy @ w[layer]
    return float(np.mean(error**2)) * {"half loss": 0.5, "sum loss": error.size}.get(how, 1.0), dw, db


BACKWARD_MISTAKES = (
    ("minus", "the derivative of sin is cos, with the sign +"),
    ("half", "the derivative of a square has a factor of 2"),
    ("sign", "the derivative goes by y - target, not target - y"),
    ("sum", "the loss is a mean: divide by N * D_out"),
    ("batch", "the mean is over N * D_out numbers, not over the N examples"),
    ("channels", "the mean is over N * D_out numbers, not over the D_out channels"),
    ("omega", "the inner derivative omega is missing: d sin(omega z) / dz = omega cos(omega z)"),
    ("first", "each layer's own omega: omegas[1] from the second layer on"),
    ("argument", "the cosine takes omega (W x + b), like the sine"),
    ("sine", "the derivative of sin is cos"),
    ("value", "the cosine takes the argument of the sine, not its value"),
    ("linear", "the derivative of the sine is missing"),
    ("mean", "a bias takes the sum over the examples: the mean is in the loss's factor already"),
)
"""Mistakes on the way backwards, and their explanations."""


def slopes(student: Any) -> None:
    """Loss and derivatives, last layer first."""
    w, b = network()
    x, target = spread(51, (COUNT, SIZES[0]), -1.0, 1.0), spread(52, (COUNT, SIZES[-1]), 0.0, 1.0)
    found = student.gradients(list(still(*w)), list(still(*b)), OMEGAS, *still(x, target))
    results("SIR-7", "the result of gradients", found, 3, "(loss, [dW], [db])")
    loss, dw, db = found
    right = backwards(w, b, x, target)
    likely: Likely = [
        (right[0] / 2, "the loss has no factor of 1 / 2"),
        (right[0] * COUNT * SIZES[-1], "the mean over all N * D_out numbers, not the sum"),
        (right[0] * SIZES[-1], "the mean over all N * D_out numbers: also over the D_out channels"),
        (right[0] * COUNT, "the mean over all N * D_out numbers: also over the N examples"),
        (right[0] ** 0.5, "the mean of squares, without a root"),
    ]
    expect("SIR-7", "the loss", loss, right[0], 1e-12, likely, "the mean of (y - target)^2")
    for name, some in (("dW", dw), ("db", db)):
        results("SIR-7", f"the numbers of {name}", some, len(w), f"a list of {len(w)} arrays")
    wrong = [(backwards(w, b, x, target, how), told) for how, told in BACKWARD_MISTAKES]
    text = "the chain: dy becomes dy @ W on the way to the layer before"
    for layer in reversed(range(len(w))):
        shape, own = np.shape(dw[layer]), w[layer].shape
        told = "the first layer of the list is the first of the network" if shape != own[::-1] else "dy.T @ x"
        equal("SIR-7", f"the shape of dW of layer {layer}", shape, own, told)
        # A mistake that changes nothing in this layer explains nothing.
        likely = [(v[1][layer], told) for v, told in wrong if not alike(v[1][layer], right[1][layer])]
        expect("SIR-7", f"dW of layer {layer}", dw[layer], right[1][layer], 1e-11, likely, text)
        likely = [(v[2][layer], told) for v, told in wrong if not alike(v[2][layer], right[2][layer])]
        expect("SIR-7", f"db of layer {layer}", db[layer], right[2][layer], 1e-11, likely, text)


def arguments(given: Any, *names: str) -> Any:
    """Return weights, biases, omegas and further inputs of a case, in float64."""
    count = sum(name.startswith("weight_") for name in given)
    weights, biases = ([given[f"{kind}_{i}"] for i in range(count)] for kind in ("weight", "bias"))
    omegas = float(given["omega_0_first"]), float(given["omega_0_hidden"])
    return weights, biases, omegas, *(given[name] for name in names)


def activations(student: Any, given: Any) -> Any:
    """Return the student's answer to a case of network.forward."""
    *known, x = arguments(given, "x")
    found = student.forward(*known, x[None])
    return {f"layer_{i}": values[0] for i, values in enumerate(found)}


def derivatives(student: Any, given: Any) -> Any:
    """Return the student's answer to a case of network.gradient."""
    loss, dweights, dbiases = student.gradients(*arguments(given, "x", "target"))
    found = {f"dweight_{i}": dw for i, dw in enumerate(dweights)}
    return {"loss": loss, **found, **{f"dbias_{i}": db for i, db in enumerate(dbiases)}}


def differences(student: Any) -> None:
    """Compare with central differences of step h = 1e-5.

    They are off by h^2 times a third derivative of at most omega^3 |x|^3 / 6, and by 2^-53 / h of rounding;
    both are below 1e-8.
    """
    weights, biases = network((5, 4, 4, 3))
    x, target = spread(61, (6, 5), -1.0, 1.0), spread(62, (6, 3), 0.0, 1.0)
    _, dweights, dbiases = student.gradients(weights, biases, OMEGAS, x, target)
    for name, arrays, found in (("W", weights, dweights), ("b", biases, dbiases)):
        for layer, (array, slope) in enumerate(zip(arrays, found, strict=True)):
            for index in list(np.ndindex(array.shape))[::5]:
                kept, losses = array[index], []
                for step in (1e-5, -1e-5):
                    array[index] = kept + step
                    losses.append(student.gradients(weights, biases, OMEGAS, x, target)[0])
                array[index] = kept
                what = f"d{name} of layer {layer} at {list(index)}, against your own loss"
                expect("SIR-7", what, slope[index], (losses[0] - losses[1]) / 2e-5, 1e-7)


CHECKS = (
    Check("layer by layer", layers),
    Check("the loss and its derivatives", slopes),
    Check(
        "the spec's vectors, forwards",
        asked("network.forward", activations, "a network of one layer, or of another number of neurons"),
    ),
    Check(
        "the spec's vectors, backwards",
        asked("network.gradient", derivatives, "a network of another number of layers or neurons"),
    ),
    Check("central differences", differences),
)
"""In the order in which they explain a mistake best."""
