"""Lab 11 in another style: a product and n additions, gamma(n + 1); the box's lower end is left at -1."""

import numpy as np

U, TINY, WIDER = 2.0**-24, 2.0**-110, 1 + 2.0**-16


def gamma(n):
    return WIDER * n * U / (1 - n * U)


def layer(weight, bias, omega, low, high, sine_error):
    size = np.abs(weight) @ np.maximum(np.abs(low), np.abs(high)) + np.abs(bias)
    own = gamma(weight.shape[1] + 1) * size + TINY
    argument = WIDER * omega * (size + own)
    rounding = WIDER * (omega * own + (0.0 if sine_error is None else U * argument + TINY))
    return argument, rounding, WIDER * (rounding + (sine_error or 0.0))


def layers(weights, biases, omegas, low, high, sine_error):
    found = [layer(weights[0], biases[0], omegas[0], low, high, sine_error)]
    for weight, bias in zip(weights[1:-1], biases[1:-1], strict=True):
        n = weight.shape[1]
        found.append(layer(weight, bias, omegas[1], -np.ones(n), np.full(n, 1 + sine_error), sine_error))
    n = weights[-1].shape[1]
    found.append(layer(weights[-1], biases[-1], 1.0, -np.ones(n), np.full(n, 1 + sine_error), None))
    return found


def contributions(weights, omegas, errors):
    ways = [np.eye(len(errors[-1]))]
    for number in range(len(weights) - 1, 0, -1):
        omega = 1.0 if number == len(weights) - 1 else omegas[1]
        ways.insert(0, ways[0] @ np.abs(weights[number]) * omega)
    return WIDER * np.stack([way @ error for way, error in zip(ways, errors, strict=True)], axis=1)
