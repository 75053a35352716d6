"""How far bounds are above what happens: certified and a-posteriori bounds beside measured errors.

    python experiments/bounds.py out/demo/model.safetensors out/demo/frames/test/00000-noisy.exr

1. The model's certified bound over all images, layer by layer; with sums of other parts, and with products of
   magnitudes in place of scaled norms: what each idea gains [`ladder`].
2. How small any bound can be that knows no more of slopes than that they are at most 1: a search for signs of
   slopes and errors that meet at the output [`attack`].
3. For the frame, on each executor that is here, the largest error and the a-posteriori bound [`measured`].
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.cli.files import exr
from wamnet.cli.reports.runs import frame_bound
from wamnet.compiler.core import sums
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.profiles import EMITTED_SINE
from wamnet.compiler.plan import Plan, analysed
from wamnet.compiler.proof import bounds, scaled
from wamnet.compiler.schedules.common import kernel_gather
from wamnet.compiler.targets import schedule_named
from wamnet.compiler.variants import plan_model
from wamnet.kernels import EXECUTORS, denoise_on, open_executor
from wamnet.models.model_file import load_model
from wamnet.refimpl.errors import WamnetError
from wamnet.refimpl.network.denoise import denoise

TRIES = 200
"""Random starts of the search."""

PARTS = {
    "parts of 36 terms, as compiled": lambda window: [
        part for row in window for part in np.split(row, 4, axis=1)
    ],
    "parts of 144 terms": lambda window: [*window],
    "one sum": lambda window: [window],
}
"""Ways to split the sum over the demo's window (rows, columns, channels): 12 channels of four images."""


def network(program: Any) -> tuple[list[Any], list[Any]]:
    """Return the matrices after the first layer, and the errors that each layer adds, over all images."""
    box = bounds.window_box(kernel_gather(program))
    found = bounds.enclose(program, {"window": box}, EMITTED_SINE)
    layers = scaled.network(program, found, program.outputs[0][1])
    matrices = [layer.scale * scaled.weight_of(program, layer) for layer in layers[1:]]
    return matrices, [scaled.own_error(found, layer) for layer in layers]


def ladder(program: Any) -> None:
    """Print the bound with one idea after another."""
    matrices, own = network(program)
    gather = kernel_gather(program)
    low, high = bounds.window_box(gather)
    first = program.nodes[1]
    weight, bias = (program.parameters[str(first[name])].astype(np.float64) for name in ("weight", "bias"))
    window = np.arange(gather.n_inputs).reshape(gather.rows, gather.columns, gather.channels)
    any_order = sums.gamma(gather.n_inputs + 1) * (np.maximum(-low, high) @ np.abs(weight).T + np.abs(bias))
    rounded = {"one sum, gamma(n)": any_order}
    for name, split in PARTS.items():
        blocks = [part.ravel() for part in split(window)]
        rounded[name] = sums.rounding(weight, bias, low, high, blocks)
    print(f"{'first layer':32} {'its error':>10} {'|W||W|..':>10} {'norms':>10} {'scaled':>10} {'signs':>10}")
    for name, error in rounded.items():
        added = [error + EMITTED_SINE.error, *own[1:]]
        reach = np.abs(matrices[-1])
        by_size = np.abs(matrices[-1]) @ added[-2] + added[-1]
        for matrix, later in zip(matrices[-2::-1], added[-3::-1], strict=True):
            reach = reach @ np.abs(matrix)
            by_size = by_size + reach @ later
        plain = scaled.amplified(matrices, added, [np.ones(m.shape[1]) for m in matrices])
        best = [
            scaled.amplified(some, [*added[:-1], added[-1][rows]], scaled.scalings(some, added[0]))
            for rows in scaled.outputs(len(added[-1]))
            for some in [[*matrices[:-1], matrices[-1][rows]]]
        ]
        found = [error.max(), by_size.max(), plain.max(), np.max(best), attack(matrices, added)]
        print(f"{name:32} " + " ".join(f"{value:10.2e}" for value in found))


def attack(matrices: list[Any], own: list[Any]) -> float:
    """Return the largest output error that was found over slopes of -1 and 1 and signs of all errors."""
    random, worst = np.random.default_rng(1), 0.0
    for row in matrices[-1]:
        for _ in range(TRIES):
            chain = matrices[:-1]
            slopes = [random.choice([-1.0, 1.0], len(matrix)) for matrix in chain]
            signs = random.choice([-1.0, 1.0], len(own[0]))
            for _ in range(20):
                values = [signs * own[0]]
                for matrix, slope in zip(chain, slopes, strict=True):
                    values.append(slope * (matrix @ values[-1]))
                back = row
                for at in range(len(chain) - 1, -1, -1):
                    slopes[at] = np.where(back * (chain[at] @ values[at]) < 0, -1.0, 1.0)
                    back = (back * slopes[at]) @ chain[at]
                signs = np.where(back < 0, -1.0, 1.0)
            worst = max(worst, float(np.abs(back) @ own[0]))
    return worst


def measured(model: Any, frame: Any) -> None:
    """Print each executor's largest error in the frame beside both bounds."""
    truth = denoise(model, frame, np.float64)
    print(f"{'kernel':16} {'error':>10} {'a-posteriori':>13} {'ratio':>7} {'certified':>10} {'ratio':>7}")
    for name in EXECUTORS:
        try:
            with open_executor(name) as executor:
                picked = executor.schedule_for((frame.height, frame.width))
                # The schedule that suits the device, and its stand-in: each has a bound of its own.
                for schedule in dict.fromkeys((picked, schedule_named(name, picked).instead)):
                    image = denoise_on(executor, model, frame, schedule=schedule).image
                    row = _row(plan_model(model, name, schedule=schedule), frame)
                    found = float(np.abs(image - truth).max())
                    ratios = f"{row[0]:13.2e} {row[0] / found:7.0f} {row[1]:10.2e} {row[1] / found:7.0f}"
                    print(f"{name + ':' + schedule:16} {found:10.2e} {ratios}")
        except WamnetError as error:
            print(f"{name:16} {error}")


def _row(plan: Plan, frame: Any) -> tuple[float, float]:
    """Return the bound in this frame and that in all frames, of one schedule."""
    return frame_bound(plan, frame) or np.inf, max(plan.bound.output or [np.inf])


def main() -> None:
    """Run the experiment on the files that the command line names."""
    parser = argparse.ArgumentParser(description="Bounds beside measured errors.")
    parser.add_argument("model", type=Path)
    parser.add_argument("frame", type=Path)
    given = parser.parse_args()
    model = load_model(given.model)
    ladder(analysed(lower(model)))
    measured(model, exr.read_frame(given.frame))


if __name__ == "__main__":
    main()
