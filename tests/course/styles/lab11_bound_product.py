"""Lab 11 in another style: omega's product is one more rounding of each term, and bounds are not widened."""

import math

import numpy as np

U = 2.0**-24


def gamma(n):
    return n / (2.0**24 - n)


def up(numbers):
    return np.nextafter(np.nextafter(np.nextafter(numbers, np.inf), np.inf), np.inf)


def layer(weight, bias, omega, low, high, sine_error):
    argument, rounding, error = [], [], []
    for row, b in zip(np.abs(weight), np.abs(bias), strict=True):
        terms = [w * max(-a, c) for w, a, c in zip(row, low, high, strict=True)] + [b]
        size = math.fsum(terms)
        argument.append(omega * size * (1 + gamma(len(row) + 2)) + 2.0**-112)
        rounding.append(omega * size * gamma(len(row) + 2) + 2.0**-112)
        error.append(rounding[-1] + (0.0 if sine_error is None else sine_error))
    return up(argument), up(rounding), up(up(error))


def layers(weights, biases, omegas, low, high, sine_error):
    found, box = [], (low, high)
    for i in range(len(weights)):
        last = i == len(weights) - 1
        omega = 1.0 if last else omegas[int(i > 0)]
        found.append(layer(weights[i], biases[i], omega, *box, None if last else sine_error))
        edge = np.full(len(biases[i]), 1.0 + sine_error)
        box = -edge, edge
    return found


def contributions(weights, omegas, errors):
    columns = [np.diag(errors[-1]).sum(axis=1)]
    reach = np.abs(weights[-1])
    for i in range(len(weights) - 2, -1, -1):
        columns.append(up(up(reach @ errors[i])))
        reach = up(up(reach @ np.abs(weights[i]))) * omegas[int(i > 0)]
    return up(np.array(columns[::-1]).T)
