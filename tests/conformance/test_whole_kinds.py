"""Cases of integers that float64 decides: none of them is near a tie, so that a bound of 0 holds."""

import sys

import numpy as np
import pytest

from wamnet.refimpl.network import whole
from wamnet.spec.conformance.case import FOLDER, given, load
from wamnet.spec.conformance.kinds import KINDS
from wamnet.spec.conformance.kinds.network import CHOSEN

KIND = KINDS["whole.rounded_on"]
"""The kind whose integers are chosen by least squares."""

CASES = [case for case in load(FOLDER / "whole.rounded_on.json")[1] if case.expected is not None]
"""Its valid cases."""

LEAST = 2.0**-12
"""Least distance from a tie."""


def test_the_distance_is_what_the_source_says() -> None:
    assert "2^-12 from a tie" in CHOSEN


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_nothing_is_near_a_tie(case, monkeypatch) -> None:
    """WHO-7's own roundings may be at ties: each of its operations is rounded in a stated order."""
    distances, round_ = [], np.rint

    def seen(values):
        if sys._getframe(1).f_code in (whole.rounded_on.__code__, whole.nearest.__code__):
            distances.append(np.abs(values - np.floor(values) - 0.5).min())
        return round_(values)

    monkeypatch.setattr(np, "rint", seen)
    inputs = {name: given(value) for name, value in case.inputs.items()}
    KIND.answer(inputs)
    rows = sum(inputs[name].shape[1] for name in inputs if name.startswith("weight_"))
    layers = sum(name.startswith("weight_") for name in inputs)
    assert len(distances) == rows + layers, (
        "each column of a layer's weights is rounded at once, then its biases"
    )
    assert min(distances) >= LEAST


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_inputs_do_not_vary_alike(case) -> None:
    """The order of two inputs of the same variance is free, and would change what is chosen.

    Where no input varies at all it is not: what is left of the covariance hands nothing on.
    """
    numbers = whole.steps_of(given(case.inputs["windows"]))
    variances = np.sort(numbers.var(axis=0))
    assert not variances.any() or (np.diff(variances) > 2.0**-12 * variances[1:]).all()
