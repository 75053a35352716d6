"""Lab 11 in another style: PRO-6b's sum of the largest terms in place of gamma."""

import numpy as np

U = 2.0**-24


def gamma(n):
    return n * U / (1 - n * U)


def layer(weight, bias, omega, low, high, sine_error):
    reach = np.maximum(-np.asarray(low), high)
    terms = np.concatenate([np.abs(weight) * reach, np.abs(bias)[:, None]], axis=1)
    largest = np.cumsum(-np.sort(-terms, axis=1), axis=1)
    total, n = largest[:, -1], terms.shape[1]
    own = U * (largest[:, 1:].sum(axis=1) + terms[:, :-1].sum(axis=1) + n * gamma(n) * total) * 1.0001 + 1e-30
    argument = omega * (total + own) * 1.0001
    rounding = omega * own + (U * argument if sine_error is not None else 0) + 1e-30
    return argument, rounding, (rounding + (sine_error or 0)) * 1.0001


def layers(weights, biases, omegas, low, high, sine_error):
    steps = []
    for i, (w, b) in enumerate(zip(weights, biases, strict=True)):
        last = i == len(weights) - 1
        omega = 1.0 if last else omegas[0] if i == 0 else omegas[1]
        steps.append(layer(w, b, omega, low, high, None if last else sine_error))
        low, high = -np.ones(len(b)) * (1 + sine_error), np.ones(len(b)) * (1 + sine_error)
    return steps


def contributions(weights, omegas, errors):
    columns = []
    for i, error in enumerate(errors):
        e = np.asarray(error, float)
        for j in range(i + 1, len(weights)):
            e = np.abs(weights[j]) @ e
            if j < len(weights) - 1:
                e = e * omegas[min(j, 1)]
        columns.append(e * 1.0001)
    return np.column_stack(columns)
