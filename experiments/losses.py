"""Which loss to train with: squares, absolute differences, SMAPE, and a mix of the first two.

1. A loss is a function of outputs and targets that returns the values whose mean is the loss, and the
   derivative of that mean by the outputs [`LOSSES`]; each stands in for TRN-3's in the reference's own
   training [`trained`].
2. Each is trained for every seed, all else as in the preset `short`, and scored on unseen poses [`work`].

    python experiments/losses.py

Adam divides by the size of the gradients, so that the losses' different scales do not matter. Training is the
reference's, in NumPy, since only the loss of squares is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
from lab import command, tables
from lab.ground import Cost, Ground, measure_all, start, together, told, write_table
from lab.results import Values
from lab.tables import Column

from wamnet.refimpl.network import train
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import SHORT, Recipe

DARKEST = 0.01
"""What SMAPE adds to its denominator, so that black pixels divide by no zero; as that of MET-7."""

SHARE_OF_ABSOLUTE = 0.1
"""Share of the absolute difference in the mix: the squares of errors of 0.1 weigh as much."""

SLOWER = 8.0
"""Times the compiled trainer's time that the reference takes, roughly."""

Loss = Callable[[Any, Any, int], tuple[Any, Any]]
"""(outputs, targets, count of numbers) -> (values, derivative of their mean)."""


squares_of = train.squared_error
"""The loss of TRN-3, under a name that no patch replaces."""


def absolute(outputs: Any, targets: Any, count: int) -> tuple[Any, Any]:
    """Return |y - t|, and its derivative, 0 where both are equal."""
    error = outputs - targets
    return np.abs(error), np.sign(error) / count


def smape(outputs: Any, targets: Any, count: int) -> tuple[Any, Any]:
    """Return |y - t| / (|y| + |t| + e), and its derivative by the rule of quotients."""
    error, below = outputs - targets, np.abs(outputs) + np.abs(targets) + DARKEST
    value = np.abs(error) / below
    return value, (np.sign(error) - value * np.sign(outputs)) / (below * count)


def mixed(outputs: Any, targets: Any, count: int) -> tuple[Any, Any]:
    """Return the square plus a share of the absolute difference."""
    squares, slope = squares_of(outputs, targets, count)
    values, other = absolute(outputs, targets, count)
    return squares + SHARE_OF_ABSOLUTE * values, slope + SHARE_OF_ABSOLUTE * other


LOSSES: Mapping[str, Loss] = {
    "MSE": squares_of,
    "L1": absolute,
    "SMAPE": smape,
    "MSE + 0.1 L1": mixed,
}
"""The losses, by name."""

COLUMNS = (
    Column("psnr", "PSNR, dB", 2, interval=True),
    Column("ssim", "SSIM", 3, interval=True),
    Column("flip", "FLIP", 3, interval=True),
    Column("smape", "SMAPE of radiance", 4),
)
"""The columns of the table."""


def trained(recipe: Recipe, pairs: Sequence[Any], loss: Loss) -> Model:
    """Return the network that the reference trains with a loss."""
    with patch.object(train, "squared_error", loss):
        return train.model_of(train.train(recipe, pairs))


def work(ground: Ground, loss: Loss) -> Callable[[int], Values]:
    """Return what trains and scores with one loss for a seed."""

    def measure(seed: int) -> Values:
        model = trained(ground.plan.adapt(SHORT, seed=seed), ground.seen(), loss)
        found = ground.judge(model, ground.unseen())
        return together(told(found), {"smape": found["smape"]})

    return measure


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then print the table."""
    options, ground, results = start(command.parser(__doc__, "losses"), "losses", arguments)
    found = {name: work(ground, loss) for name, loss in LOSSES.items()}
    plan = ground.plan
    needed = [(ground.training_shots(), plan.train_spp), (ground.test_shots(), plan.test_spp)]
    windows = SLOWER * plan.steps * plan.batch
    measure_all(ground, results, found, options.seeds, Cost(needed, plan.test_frames, windows))
    names = {name: name for name in LOSSES}
    write_table(options.output / "table.md", tables.table(results, COLUMNS, names, "loss"))


if __name__ == "__main__":
    command.begin(main)
