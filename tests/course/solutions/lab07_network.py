"""A right answer to this lab, for the tests of its grader."""

import numpy as np


def layers(weights, biases, omegas, x):
    if any(len(b) != len(w) for w, b in zip(weights, biases, strict=True)):
        raise ValueError("a layer has as many biases as outputs")
    inputs, angles = [], []
    for layer, (w, b) in enumerate(zip(weights, biases, strict=True)):
        inputs.append(x)
        angles.append((x @ w.T + b) * omegas[min(layer, 1)])
        x = np.sin(angles[-1]) if layer < len(weights) - 1 else x @ w.T + b
    return [*inputs, x], angles


def forward(weights, biases, omegas, x):
    return layers(weights, biases, omegas, x)[0][1:]


def gradients(weights, biases, omegas, x, target):
    values, angles = layers(weights, biases, omegas, x)
    error = values[-1] - target
    dy = 2 * error / error.size
    dweights, dbiases = [], []
    for layer in reversed(range(len(weights))):
        if layer < len(weights) - 1:
            dy = dy * np.cos(angles[layer]) * omegas[min(layer, 1)]
        dweights.insert(0, dy.T @ values[layer])
        dbiases.insert(0, dy.sum(axis=0))
        dy = dy @ weights[layer]
    return np.mean(error**2), dweights, dbiases
