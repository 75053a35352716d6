"""The losses of `experiments/losses.py`: derivatives against differences, and that training takes them."""

from __future__ import annotations

import losses
import numpy as np
import pytest
from lab.ground import PLANS, Ground

from wamnet.refimpl.network import train
from wamnet.refimpl.network.train import SHORT

STEP = 2.0**-20
"""Of central differences: their error is STEP^2 times a third derivative, and u / STEP of rounding."""


@pytest.mark.parametrize("name", losses.LOSSES)
def test_derivatives(name):
    """Outputs and differences keep 0.05 from zero, where no derivative exists."""
    generator = np.random.default_rng(11)
    targets = generator.uniform(0.2, 0.8, (5, 3))
    outputs = targets + generator.choice([-1.0, 1.0], (5, 3)) * generator.uniform(0.05, 0.15, (5, 3))
    loss = losses.LOSSES[name]

    def mean(y):
        return float(np.mean(loss(y, targets, targets.size)[0]))

    _, found = loss(outputs, targets, targets.size)
    for at in np.ndindex(outputs.shape):
        moved = np.zeros_like(outputs)
        moved[at] = STEP
        slope = (mean(outputs + moved) - mean(outputs - moved)) / (2 * STEP)
        # Third derivatives stay below 6 / 0.2^4 on this range; values below 1 in sums of 15.
        assert abs(slope - found[at]) <= STEP**2 * 6 / 0.2**4 + 15 * 2.0**-52 / STEP


def test_training_follows_the_loss_and_leaves_the_reference_alone(tmp_path):
    ground = Ground(PLANS["toy"], tmp_path, "numpy")
    recipe, pairs = ground.plan.adapt(SHORT), ground.seen()
    found = {name: losses.trained(recipe, pairs, loss) for name, loss in losses.LOSSES.items()}
    assert train.squared_error is losses.squares_of
    alone = train.model_of(train.train(recipe, pairs))
    np.testing.assert_array_equal(found["MSE"].siren.weights[0], alone.siren.weights[0])
    for name in ("L1", "SMAPE", "MSE + 0.1 L1"):
        assert not np.array_equal(found[name].siren.weights[0], alone.siren.weights[0])
