"""A right answer to this lab, for the tests of its grader."""

import numpy as np

U, TINY, WIDER = 2.0**-24, 2.0**-110, 1 + 2.0**-16


def gamma(n):
    return n * U / (1 - n * U)


def layer(weight, bias, omega, low, high, sine_error):
    largest = np.maximum(np.abs(low), np.abs(high))
    size = np.abs(weight) @ largest + np.abs(bias)
    rounding = gamma(weight.shape[1] + 2) * size + TINY
    argument = omega * (size + rounding)
    added = omega * rounding
    if sine_error is not None:
        added = added + U * argument + TINY
    error = added + (sine_error or 0.0) + TINY
    return argument * WIDER, added * WIDER, error * WIDER


def layers(weights, biases, omegas, low, high, sine_error):
    found = []
    for number, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if number < len(weights) - 1:
            found.append(layer(weight, bias, omegas[min(number, 1)], low, high, sine_error))
            high = np.full(len(bias), 1 + sine_error)
            low = -high
        else:
            found.append(layer(weight, bias, 1.0, low, high, None))
    return found


def contributions(weights, omegas, errors):
    found, reach = [errors[-1]], np.abs(weights[-1])
    found[0] = np.asarray(errors[-1])
    for number in reversed(range(len(weights) - 1)):
        found.insert(0, reach @ errors[number])
        reach = reach @ (omegas[min(number, 1)] * np.abs(weights[number]))
    return np.stack(found, axis=1) * WIDER
