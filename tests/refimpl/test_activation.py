"""Activations: what their rows state, their derivatives, and how a new one is added."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.profiles import EMITTED_SINE
from wamnet.compiler.core.trace import trace
from wamnet.compiler.proof import bounds
from wamnet.compiler.targets import LANGUAGES
from wamnet.compiler.training.step import lower_step
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network import activation, siren
from wamnet.refimpl.network.activation import ACTIVATIONS, Activation, activation_named
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

ROWS = pytest.mark.parametrize("row", ACTIVATIONS.values(), ids=ACTIVATIONS.keys())

NUMBERS = np.linspace(-20.0, 20.0, 4001) + 1e-3
"""Arguments on both sides of 0 and never at it: a rectifier has no derivative there."""


# ---- rows --------------------------------------------------------------------------------------------------


@ROWS
def test_values_and_slopes_are_those_stated(row: Activation) -> None:
    """They are reached up to the distance of two arguments, 0.01, times the largest slope."""
    y, slopes = row.forward(NUMBERS), np.abs(row.derivative(NUMBERS))
    assert y.min() >= row.values[0]
    assert y.max() <= row.values[1]
    assert slopes.max() <= row.slope
    assert slopes.max() >= row.slope - 0.01
    assert y.min() <= row.values[0] + 0.01
    assert math.isinf(row.values[1]) or y.max() >= row.values[1] - 0.01


@given(
    name=st.sampled_from(sorted(ACTIVATIONS)),
    low=st.floats(-8, 8),
    width=st.floats(0, 4),
    error=st.floats(0, 0.5),
)
def test_the_compiler_s_analysis_agrees(name: str, low: float, width: float, error: float) -> None:
    """What the rules of the operations find lies within what the row states.

    Ranges are widened by 2^-40 of their ends. An error grows by the slope at most; the sine adds its own.
    """
    row = ACTIVATIONS[name]
    program = trace(row.forward, {"x": Type(shape=(1,))})
    x = bounds.Enclosure(np.array([low]), np.array([low + width]), np.array([error]))
    found = bounds.enclose(program, {}, EMITTED_SINE, known={0: x})[program.outputs[0][1]]
    slack = 2.0**-38 * (1 + abs(low) + width)
    assert program.nodes[0].op == "input"
    assert found.low[0] >= row.values[0] - slack
    assert found.high[0] <= row.values[1] + slack
    own = EMITTED_SINE.error or 0.0
    assert found.error[0] <= (row.slope * error + own) * (1 + 2.0**-10) + 2 * bounds.FLUSH


def test_an_unknown_name_gets_the_list() -> None:
    with pytest.raises(InputError, match=r"activation 'tanh': unknown \(choose one of sine, relu"):
        activation_named("tanh")
    with pytest.raises(InputError, match="activation 'tanh': unknown"):
        siren.init((2, 2), 1.0, 1.0, 0, activation="tanh")


def test_a_rectifier_s_first_weights_have_the_variance_of_the_source() -> None:
    """2 / D_in in all layers. A z-test of each mean square at 1e-6 after Sidak, |z| <= 5.03.

    Of U(-1, 1): the mean of x^2 is 1/3, its variance 1/5 - 1/9. Biases are 0.
    """
    network = siren.init((300, 200, 100), 1.0, 1.0, 9, np.float64, "relu")
    for weight, bias in zip(network.weights, network.biases, strict=True):
        shares = np.square(weight) / (6 / weight.shape[1])
        z = (shares.mean() - 1 / 3) / math.sqrt((1 / 5 - 1 / 9) / weight.size)
        assert abs(z) <= 5.03
        assert not bias.any()


# ---- rectifiers --------------------------------------------------------------------------------------------


def test_a_network_of_rectifiers_by_hand() -> None:
    """Layer 0: max(2 (0.5, -1) x, 0), layer 1: 3 a - b + 0.25, for x = 0.75 and x = -0.75."""
    weights = np.array([[0.5], [-1.0]]), np.array([[3.0, -1.0]])
    network = siren.Siren(weights, (np.zeros(2), np.array([0.25])), 2.0, 1.0, "relu")
    # All these numbers are sums of few powers of two: nothing is rounded.
    assert siren.forward(network, np.array([[0.75], [-0.75]])).tolist() == [[2.5], [-1.25]]
    y, cache = siren.forward_cached(network, np.array([[0.75]]))
    found = siren.backward(network, cache, np.ones_like(y))
    assert [array.tolist() for array in found.dweights] == [[[4.5], [0.0]], [[0.75, 0.0]]]
    assert [array.tolist() for array in found.dbiases] == [[6.0, 0.0], [1.0]]


# ---- another one -------------------------------------------------------------------------------------------


def _leaky(a: Any) -> Any:
    """Return a, a quarter of it where it is negative."""
    return np.maximum(a, 0.25 * a)


LEAKY = Activation(
    "leaky",
    forward=_leaky,
    derivative=lambda a: np.where(a > 0.0, 1.0, 0.25).astype(a.dtype),
    values=(-math.inf, math.inf),
    slope=1.0,
    weight_bound=ACTIVATIONS["relu"].weight_bound,
    biases=ACTIVATIONS["relu"].biases,
)
"""Leaky rectifiers, which the project does not have: one place to touch, the registry."""


def test_one_row_is_all_that_a_new_activation_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every target's kernels have a bound; the compiled trainer derives the backward pass."""
    monkeypatch.setattr(activation, "ACTIVATIONS", {**ACTIVATIONS, "leaky": LEAKY})
    network = siren.init((27, 6, 5, 3), 1.0, 1.0, 5, activation="leaky")
    program = lower(Model(network, ("color",), Window(3), Normalization()))
    for name, target in LANGUAGES.items():
        for schedule in target.schedules.values():
            kernel = compile_program(program, name, schedule=schedule.name)
            errors = kernel.manifest["bound"]["output"]
            assert all(math.isfinite(error) and error > 0 for error in errors), name
    assert "greater" in {node.op for node in lower_step((27, 6, 5, 3), 1.0, 1.0, 4, "leaky").program.nodes}


@ROWS
def test_the_derivative_against_central_differences(row: Activation) -> None:
    """Off by h^2/6 |f'''| <= h^2/6 and by f's rounding over h: less than 4 2^-53 20 / h.

    No argument is nearer to 0 than h: a rectifier is affine on both sides, where its f''' is 0.
    """
    h = 2.0**-16
    slope = (row.forward(NUMBERS + h) - row.forward(NUMBERS - h)) / (2 * h)
    assert np.abs(NUMBERS).min() > h
    assert np.abs(slope - row.derivative(NUMBERS)).max() <= h * h / 6 + 80 * 2.0**-53 / h
