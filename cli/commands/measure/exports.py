"""`wamnet bench exports`: all targets of `wamnet export`, compiled, run and checked against their bound."""

from pathlib import Path

import typer

from ....kernels.bench.workload import random_model
from ....kernels.export.check import HEAD, Verdict, check
from ....kernels.export.package import Request, export
from ....kernels.export.targets import NAMES, ONNX, TARGETS
from ....models.data.scene_source import scene_source
from ....refimpl.errors import ExecutorUnavailable, InputError
from ....refimpl.light.scene import Scene
from ....refimpl.network.denoise import Model
from ...common.inputs import load_model
from ...common.options import option
from .shared import SceneShown, head, names_of, row

STATUS_WRONG = 1
"""Exit status when something that was tried is wrong."""

TIME_S = 1.0
"""Time of a scene that moves."""


def exports(
    model: Path | None = option(
        "MODEL  Trained model (.safetensors) or bundled model. [default: a small network with random weights]"
    ),
    scene: SceneShown = "minicubes",
    targets: str | None = option("NAME,...  Export targets to measure. [default: all]"),
    places: bool = option("--places  Export every weight storage, without the path tracer.", False),
) -> None:
    """Export for every target, compile, run, check against the bound, and print the verdicts.

    Each target is compiled by its own tools and run by the closest available runtime, and its image is
    compared with the reference. A missing tool is reported in the table. The exit status is 1 if the image of
    a target is wrong.

    Examples:
    wamnet bench exports
    wamnet bench exports --model model.safetensors --scene minicubes --targets wgsl,c --places
    """
    # Of a scene that moves, a time when its parts are turned.
    shown = scene_source(scene).at(TIME_S)
    chosen = tuple(NAMES) if targets is None else names_of("--targets", targets, NAMES)
    network = load_model(model) if model else random_model()
    head(*HEAD, apart=False)
    wrong = 0
    for target in chosen:
        for place in places_of(target, places):
            verdict = judged(network, target, place, None if places else shown)
            row(*verdict.cells(), after=f" {verdict.wrong}" if verdict.wrong else "")
            wrong += not verdict.holds
    if wrong:
        raise typer.Exit(STATUS_WRONG)


def places_of(language: str, every: bool) -> list[str]:
    """Return the requested places of the weights; nothing is the usual one."""
    return [*TARGETS[language].places] if every and language != ONNX else [""]


def judged(model: Model, language: str, place: str, scene: Scene | None) -> Verdict:
    """Return the verdict of one export; a limit or a missing translator is one too."""
    try:
        return check(export(Request(model, language, None if language == ONNX else scene, weights=place)))
    except ExecutorUnavailable as error:
        return Verdict(language, place, 0, f"missing: {error}", "-")
    except InputError as error:
        return Verdict(language, place, 0, f"beyond a limit: {error.what} {error.value}", "-")
