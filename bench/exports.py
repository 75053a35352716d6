"""All targets of `wamnet export`, compiled, run and checked against their bound: the table of the README.

    python bench/exports.py
    python bench/exports.py --model model.safetensors --scene minicubes --targets wgsl c --places

Each target is exported, compiled by its own tools, run by what is nearest to it on this machine, and its
picture compared with the reference's. `--places` does so for every place of the weights, without paths. A
tool that is missing is a cell of the table; status 1 says that something that was tried is wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from wamnet.cli.common.inputs import load_model
from wamnet.kernels.export.check import HEAD, Verdict, check
from wamnet.kernels.export.package import Request, export
from wamnet.kernels.export.shelf import random_model
from wamnet.kernels.export.targets import NAMES, ONNX, TARGETS
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import CANONICAL, canonical
from wamnet.refimpl.network.denoise import Model


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, row by row, and return the status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", type=Path, help="a model; else a small network with random weights")
    parser.add_argument("--scene", default="minicubes", choices=list(CANONICAL))
    parser.add_argument("--targets", nargs="+", default=list(NAMES), choices=list(NAMES))
    parser.add_argument("--places", action="store_true", help="every place of the weights, without paths")
    options = parser.parse_args(arguments)
    model = load_model(options.model) if options.model else random_model()
    scene = canonical(options.scene, time=1.0)
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    wrong = 0
    for target in options.targets:
        for place in places(target, options.places):
            verdict = judged(model, target, place, None if options.places else scene)
            print(
                f"| {' | '.join(verdict.cells())} |{f' {verdict.wrong}' if verdict.wrong else ''}", flush=True
            )
            wrong += not verdict.holds
    return 1 if wrong else 0


def places(target: str, every: bool) -> list[str]:
    """Return the requested places of the weights; nothing is the usual one."""
    return [*TARGETS[target].places] if every and target != ONNX else [""]


def judged(model: Model, target: str, place: str, scene: Scene | None) -> Verdict:
    """Return the verdict of one export; a limit or a missing translator is one too."""
    try:
        return check(export(Request(model, target, None if target == ONNX else scene, weights=place)))
    except ExecutorUnavailable as error:
        return Verdict(target, place, 0, f"missing: {error}", "-")
    except InputError as error:
        return Verdict(target, place, 0, f"beyond a limit: {error.what} is {error.value}", "-")


if __name__ == "__main__":
    sys.exit(main())
