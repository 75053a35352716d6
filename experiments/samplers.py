"""Scrambled Sobol points against independent random numbers: squared error at equal numbers of samples.

    python experiments/samplers.py --spp 1 4 64

For each scene, the squared error of each pixel and channel against a picture of many samples, relative to
that picture's value, is averaged over seeds; the table has the median over pixels of Sobol's, divided by the
median of the independent samples'. Below 1, Sobol's points are better.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from wamnet.kernels import open_executor, render_on
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings


def main() -> None:
    """Render and print one line a scene."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["cornell", "minicubes", "glossy", "daylight"])
    parser.add_argument("--spp", nargs="+", type=int, default=[1, 4, 64])
    parser.add_argument("--size", type=int, default=64, help="width and height in pixels")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--truth", type=int, default=16384, help="samples of the reference")
    parser.add_argument("--executor", default="opencl")
    given = parser.parse_args()
    print(f"| scene | {' | '.join(f'{spp} spp' for spp in given.spp)} |\n|---|{'---|' * len(given.spp)}")
    with open_executor(given.executor) as executor:
        for name in given.scenes:
            scene, size = canonical(name), given.size
            truth = _color(executor, scene, Job(size, size, given.truth, seed=1000))
            cells = []
            for spp in given.spp:
                medians = [
                    np.median(_errors(executor, scene, sampler, truth, spp, given.seeds))
                    for sampler in ("sobol", "pcg4d")
                ]
                cells.append(f"{medians[0] / medians[1]:.2f}")
            print(f"| {name} | {' | '.join(cells)} |", flush=True)


def _color(executor: Any, scene: Scene, job: Job) -> Any:
    """Return the picture (H, W, 3) in float64."""
    return render_on(executor, scene, job).frame["color"].astype(np.float64)


def _errors(executor: Any, scene: Scene, sampler: str, truth: Any, spp: int, seeds: int) -> Any:
    """Return the relative squared error (H, W, 3), averaged over seeds."""
    settings, (height, width, _) = Settings(sampler=sampler), truth.shape
    pictures = [
        _color(executor, scene, Job(width, height, spp, seed, settings)) for seed in range(1, seeds + 1)
    ]
    return np.mean([(picture / np.maximum(truth, 1e-3) - 1.0) ** 2 for picture in pictures], axis=0)


if __name__ == "__main__":
    main()
