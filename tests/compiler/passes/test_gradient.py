"""The derivative pass: each rule against central differences, networks against the backward pass by hand."""

from typing import Any

import numpy as np
import pytest
import step_sums
from hypothesis import given
from hypothesis import strategies as st

from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.ops import OPS
from wamnet.compiler.core.passes.gradient import gradient
from wamnet.compiler.core.passes.rewrite import eliminate_dead, fuse_bias
from wamnet.compiler.core.trace import trace
from wamnet.compiler.training.step import lower_step, step_of
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import siren, train
from wamnet.refimpl.network.activation import ACTIVATIONS
from wamnet.refimpl.network.siren import Siren

W = np.array([[0.5, -0.25, 0.75], [1.0, 0.5, -0.5]], np.float32)
B = np.array([1.5, 2.0], np.float32)
C = np.array([3.0, 2.5], np.float32)


def affine(x: Any, weight: Any = W, bias: Any = B) -> Any:
    return np.matmul(x, weight.T) + bias


CASES: dict[str, Any] = {
    "add": lambda x: affine(x) + np.sin(affine(x)),
    "subtract": lambda x: C - affine(x) - np.sin(affine(x)),
    "multiply": lambda x: affine(x) * (affine(x) * 0.5),
    "divide": lambda x: affine(x) / (affine(x) * affine(x) + 4.0),
    "negative": lambda x: -np.sin(-affine(x)),
    "absolute": lambda x: np.absolute(affine(x)) * affine(x),
    "reciprocal": lambda x: np.reciprocal(affine(x) + 6.0),
    "sqrt": lambda x: np.sqrt(affine(x) + 6.0),
    "minimum": lambda x: np.minimum(affine(x), C) * affine(x),
    "maximum": lambda x: np.maximum(affine(x), C) * affine(x),
    "sin": lambda x: np.sin(2.0 * affine(x)),
    "cos": lambda x: np.cos(2.0 * affine(x)),
}
"""One function for each rule; value numbering makes all affine maps of one function one."""


def arrays_of(network: Siren) -> dict[str, Any]:
    """Return a network's weights and biases by the names that tracing gives them."""
    weights = {f"W{layer}": array for layer, array in enumerate(network.weights)}
    return weights | {f"b{layer}": array for layer, array in enumerate(network.biases)}


def test_every_rule_has_a_case() -> None:
    assert set(CASES) == {op.name for op in OPS.values() if op.slopes}


@pytest.mark.parametrize("op", list(CASES))
def test_rule_against_central_differences(op: str) -> None:
    """The loss is the mean square; parameters move along one random direction by h = 2^-12.

    A central difference is off by h^2/6 |F'''| and by the rounding of F over h, 2^-53 |F| 2^12 < 1e-12 here.
    Third derivatives of these functions of numbers below 8 are below 1e3: h^2/6 1e3 < 1e-5.
    """
    random = np.random.default_rng(5)
    found = step_of(CASES[op], 3, 2, batch=4)
    assert op in {node.op for node in trace(CASES[op], {"window": Type(shape=(3,))}).nodes}
    x, t = random.uniform(-1, 1, (4, 3)), random.uniform(-1, 1, (4, 2))
    base = {name: found.program.parameters[name].astype(np.float64) for name in found.trained}
    moved = {name: random.uniform(-1, 1, array.shape) for name, array in base.items()}

    def loss(scale: float) -> float:
        at = step_sums.with_parameters(found, {name: base[name] + scale * moved[name] for name in base})
        return float(step_sums.sums(at, x, t)["squares"].sum()) / 8

    derivatives = step_sums.sums(step_sums.with_parameters(found, base), x, t)
    slope = sum(float(np.sum(derivatives[name] * moved[name])) for name in base)
    h = 2.0**-12
    assert abs((loss(h) - loss(-h)) / (2 * h) - slope) <= 1e-5
    assert abs(slope) >= 1e-3, "a slope of nothing would pass with any rule"


@given(
    widths=st.lists(st.integers(1, 9), min_size=2, max_size=5),
    n=st.integers(1, 6),
    omega_0_first=st.sampled_from([1.0, 2.5]),
    omega_0_hidden=st.sampled_from([1.0, 10.0]),
    seed=st.integers(0, 2**32 - 1),
    activation=st.sampled_from(sorted(ACTIVATIONS)),
)
def test_a_network_against_the_backward_pass_by_hand(
    widths: list[int], n: int, omega_0_first: float, omega_0_hidden: float, seed: int, activation: str
) -> None:
    """Both do the same operations in float64; the order of sums may differ: u gamma of the magnitudes.

    Each derivative is a sum of products of weights, cosines and inputs, fewer than `operations` roundings
    each; the magnitudes are those of the derivative with every term replaced by its absolute value, which is
    at most n times the product of all weights' 1-norms times omegas.
    """
    random = np.random.default_rng(seed)
    network = siren.init(widths, omega_0_first, omega_0_hidden, seed, np.float64, activation)
    x, t = random.uniform(-1, 1, (n, widths[0])), random.uniform(0, 1, (n, widths[-1]))
    loss, want = train.loss_and_gradients(network, x, t)
    lowered = lower_step(widths, omega_0_first, omega_0_hidden, n, activation)
    found = step_sums.sums(step_sums.with_parameters(lowered, arrays_of(network)), x, t)
    largest = max(omega_0_first, omega_0_hidden)
    gain = np.prod([1 + np.abs(w).sum() * largest + np.abs(b).sum() for w, b in layers(network)])
    operations = 4 * (sum(widths) + n * widths[-1] + 8 * len(widths))
    bound = operations * 2.0**-53 * gain * gain
    assert abs(found["squares"].sum() / t.size - loss) <= bound
    for layer, (dw, db) in enumerate(zip(want.dweights, want.dbiases, strict=True)):
        assert np.abs(found[f"W{layer}"] - dw).max() <= bound
        assert np.abs(found[f"b{layer}"] - db).max() <= bound


def layers(network: Siren) -> list[tuple[Any, Any]]:
    return list(zip(network.weights, network.biases, strict=True))


def test_equal_weights_stay_two() -> None:
    """Layers of one shape are traced with contents of their own: none is lost to value numbering."""
    assert lower_step((4, 4, 4, 4), 1.0, 1.0, 2).trained == ("W0", "b0", "W1", "b1", "W2", "b2")


def test_a_biased_affine_map() -> None:
    """After fuse_bias the map adds its bias itself, and both have the slope of its value."""

    def function(x: Any, t: Any) -> dict[str, Any]:
        y = affine(x)
        return {"y": y, "d": y - t}

    program = trace(function, {"window": Type(shape=(3,)), "target": Type(shape=(2,))})
    fused, sums = gradient(eliminate_dead(fuse_bias(program)), "y", "d")
    assert [known.parameter for known in sums] == ["W0", "b0"]
    ends = dict(fused.outputs)
    assert ends["b0.left"] == ends["W0.left"] == ends["d"]
    assert [node.op for node in fused.nodes].count("affine") == 1


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: np.floor(affine(x)), "floor has no derivative rule; supported: affine, parameter, add"),
        (lambda x: np.sin(affine(x)) + affine(x + 1.0), "parameter W0 is used twice"),
        (lambda x: x * affine(x)[..., 0], r"%\d+ multiply: a scalar that depends on weights meets a vector"),
        (lambda x: np.stack([affine(x)[..., 0]] * 3, axis=-1), "stack has no derivative rule"),
    ],
)
def test_refusals(function: Any, message: str) -> None:
    with pytest.raises(CompileError, match=message):
        step_of(function, 3, 2 if "floor" in message or "twice" in message else 3, 1)


def test_types_and_completeness_are_checked() -> None:
    def function(x: Any) -> dict[str, Any]:
        return {"y": affine(x), "d": x, "z": np.matmul(x, np.ones((2, 3), np.float32).T)}

    program = trace(function, {"x": Type(shape=(3,))})
    with pytest.raises(CompileError, match="outputs 'y' and 'd' have different types"):
        gradient(program, "y", "d")
    with pytest.raises(CompileError, match="the output does not depend on W1"):
        gradient(program, "y", "z")
