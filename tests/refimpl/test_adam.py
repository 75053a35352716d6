"""Adam: PyTorch's numbers, gradients that are huge, and what a step leaves as it is."""

from typing import Any

import numpy as np

from wamnet.refimpl.network import adam

U = 2.0**-53
"""Unit roundoff of float64."""


def run(theta: Any, gradients: Any, learning_rate: float, **options: float) -> list[Any]:
    """Return the parameter after each of several steps."""
    parameters, path = (np.array(theta),), []
    state = adam.init(parameters)
    for gradient in gradients:
        parameters, state = adam.step(
            parameters, (np.array(gradient, parameters[0].dtype),), state, learning_rate, **options
        )
        path.append(parameters[0])
    return path


def test_three_steps_by_hand() -> None:
    """With beta_1 = 1/2, beta_2 = 3/4, epsilon = 1, learning rate 1/2, theta = 1, gradients 4, -2, then 8:

    | t | m                  | v                      | m_hat          | v_hat           | theta             |
    |---|--------------------|------------------------|----------------|-----------------|-------------------|
    | 1 | 4/2 = 2            | 16/4 = 4               | 2/(1/2) = 4    | 4/(1/4) = 16    | 1 - 1/2 4/(4 + 1) |
    | 2 | 2/2 - 2/2 = 0      | 3 + 4/4 = 4            | 0              | 4/(7/16) = 64/7 | unchanged         |
    | 3 | 8/2 = 4            | 3 + 64/4 = 19          | 4/(7/8) = 32/7 | 19/(37/64)      | as below          |

    so theta is 3/5 after two steps: one rounding of 4/5, one of the product, one of the difference.
    """
    path = run([1.0], [[4.0], [-2.0], [8.0]], 0.5, beta_1=0.5, beta_2=0.75, epsilon=1.0)
    assert abs(path[0][0] - 0.6) <= 4 * U
    assert path[1][0] == path[0][0]
    expected = 0.6 - 16 / 7 / ((1216 / 37) ** 0.5 + 1)
    # Under ten roundings of numbers below 1 in magnitude, on either side.
    assert abs(path[2][0] - expected) <= 20 * U


TORCH = [
    ["0x1.fae147afcc48ep-1", "-0x1.fae147ae826e6p-1", "0x1.0000000000000p-2"],
    ["0x1.f61b741c91f6ap-1", "-0x1.fc25f29e6a488p-1", "0x1.0000000000000p-2"],
    ["0x1.f729ee09f6efcp-1", "-0x1.fd20eac3fa3ecp-1", "0x1.f2eac6e789951p-3"],
    ["0x1.f7b380ab467f6p-1", "-0x1.fa2738a24a764p-1", "0x1.e8334c19422dep-3"],
]


def test_matches_pytorch() -> None:
    """Numbers printed by PyTorch 2.13.0 (CPU) with this script:

        import torch
        torch.set_default_dtype(torch.float64)
        gradients = [[0.5, -2.0, 0.0], [0.25, 3.0, 0.0], [-1.0, 1e-6, 4.0], [0.125, -1e6, 0.0]]
        theta = torch.tensor([1.0, -1.0, 0.25], requires_grad=True)
        adam = torch.optim.Adam([theta], lr=0.01)
        for gradient in gradients:
            theta.grad = torch.tensor(gradient)
            adam.step()
            print([float(value).hex() for value in theta.detach()])

    Bound: both sides compute each move (|move| <= 0.032: lr / sqrt(1 - beta_2) times 1 - beta_1 is 0.0316)
    with fewer than 20 roundings, and 1 - beta_2**t carries the rounding of beta_2 magnified by
    beta_2 / (1 - beta_2), at most 1000; each subtraction rounds a number below 1. Four steps of both sides
    add up.
    """
    gradients = [[0.5, -2.0, 0.0], [0.25, 3.0, 0.0], [-1.0, 1e-6, 4.0], [0.125, -1e6, 0.0]]
    path = run([1.0, -1.0, 0.25], gradients, 0.01)
    bound = 2 * 4 * (0.032 * (20 + 1000) * U + U)
    for ours, theirs in zip(path, TORCH, strict=True):
        assert np.abs(ours - [float.fromhex(value) for value in theirs]).max() <= bound


def test_step_changes_nothing_in_place_and_keeps_the_type() -> None:
    theta, gradient = np.ones(2, np.float32), np.full(2, 0.5, np.float32)
    before = adam.init((theta,))
    (moved,), after = adam.step((theta,), (gradient,), before, 0.1)
    assert moved.dtype == after.m[0].dtype == after.v[0].dtype == np.float32
    assert theta.tolist() == [1.0, 1.0]
    assert before.m[0].tolist() == [0.0, 0.0]
    assert (before.t, after.t) == (0, 1)
