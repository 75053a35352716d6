"""Grades exercise 6: the spec's vectors, and central differences of the student's own loss."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def arguments(given, *names):
    """Return weights, biases, omegas and further inputs of a case, in float64."""
    layers = sum(name.startswith("weight_") for name in given)
    weights, biases = ([given[f"{kind}_{i}"] for i in range(layers)] for kind in ("weight", "bias"))
    omegas = float(given["omega_0_first"]), float(given["omega_0_hidden"])
    return weights, biases, omegas, *(given[name] for name in names)


def test_forwards(student, hold_to_vectors):
    def answer(given):
        *network, x = arguments(given, "x")
        found = student.forward(*network, x[None])
        return {f"layer_{i}": values[0] for i, values in enumerate(found)}

    hold_to_vectors("network.forward", answer)


def test_backwards(student, hold_to_vectors):
    def answer(given):
        loss, dweights, dbiases = student.gradients(*arguments(given, "x", "target"))
        found = {f"dweight_{i}": dw for i, dw in enumerate(dweights)}
        return {"loss": loss, **found, **{f"dbias_{i}": db for i, db in enumerate(dbiases)}}

    hold_to_vectors("network.gradient", answer)


def test_the_loss_itself_agrees(student):
    """Central differences of step h = 1e-5: h^2 times a third derivative of at most omega^3 |x|^3 / 6, and
    2^-53 / h of rounding; both are below 1e-8."""
    rng = np.random.default_rng(3)
    sizes = [5, 4, 4, 3]
    weights = [rng.uniform(-1, 1, (n, m)) / np.sqrt(m) for m, n in pairwise(sizes)]
    biases = [rng.uniform(-1, 1, n) / 2 for n in sizes[1:]]
    x, target, omegas = rng.uniform(-1, 1, (6, 5)), rng.uniform(0, 1, (6, 3)), (2.0, 3.0)
    _, dweights, dbiases = student.gradients(weights, biases, omegas, x, target)
    for name, arrays, slopes in (("W", weights, dweights), ("b", biases, dbiases)):
        for layer, (array, slope) in enumerate(zip(arrays, slopes, strict=True)):
            for index in list(np.ndindex(array.shape))[::3]:
                kept, losses = array[index], []
                for step in (1e-5, -1e-5):
                    array[index] = kept + step
                    losses.append(student.gradients(weights, biases, omegas, x, target)[0])
                array[index] = kept
                error = abs((losses[0] - losses[1]) / 2e-5 - slope[index])
                assert error <= 1e-7, f"d{name}{layer}{list(index)} is off by {error:.3g}"
