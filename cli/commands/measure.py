"""`wamnet bench exports`: every export compiled, run and checked, as a Markdown table.

A record is made of the rows (experiments/publish.py). The commands that measure other parts are those of the
distribution `wamnet-peers` (experiments/peers/command.py).
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from ...kernels.bench.workload import random_model
from ...kernels.export.check import HEAD, Verdict, check
from ...kernels.export.package import Request, export
from ...kernels.export.targets import NAMES, ONNX, TARGETS
from ...models.data.scene_source import scene_source
from ...refimpl.errors import ExecutorUnavailable, InputError
from ...refimpl.light.scene import Scene
from ...refimpl.network.denoise import Model
from ..common.inputs import load_model
from ..common.options import SCENES, option, parse_names, usage
from ..common.terminal import STATUS_WRONG, say

SceneShown = Annotated[str, usage(f"NAME  Canonical scene ({SCENES}) or scene file.")]


def names_of(option: str, text: str, known: Iterable[str]) -> tuple[str, ...]:
    """Return the names of a text like `opencl,opengl`, or refuse one that is not known."""
    names, known = parse_names(text), tuple(known)
    if not names or not set(names) <= set(known):
        rule = f"must be one or more of {', '.join(known)}, with commas"
        raise InputError(option, text, rule, f"for example {option} {','.join(known[:2])}")
    return names


def head(*cells: str, apart: bool = True) -> None:
    """Print the head of a table, apart from what is above it by an empty line."""
    if apart:
        say("")
    row(*cells)
    say(f"|{'---|' * len(cells)}")


def row(*cells: str, after: str = "") -> None:
    """Print a row of a table, and what is to be said behind it."""
    say(f"| {' | '.join(cells)} |{after}")


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
    shown = scene_source(scene).at(1.0)
    chosen = tuple(NAMES) if targets is None else names_of("--targets", targets, NAMES)
    network = load_model(model) if model else random_model()
    head(*HEAD, apart=False)
    wrong = 0
    for target in chosen:
        # Without a name it is the target's usual place.
        for place in TARGETS[target].places if places and target != ONNX else ("",):
            verdict = judged(network, target, place, None if places else shown)
            row(*verdict.cells(), after=f" {verdict.wrong}" if verdict.wrong else "")
            wrong += not verdict.holds
    if wrong:
        raise typer.Exit(STATUS_WRONG)


def judged(model: Model, language: str, place: str, scene: Scene | None) -> Verdict:
    """Return the verdict of one export; a limit or a missing translator is one too."""
    try:
        return check(export(Request(model, language, None if language == ONNX else scene, weights=place)))
    except ExecutorUnavailable as error:
        return Verdict(language, place, 0, f"missing: {error}", "-")
    except InputError as error:
        return Verdict(language, place, 0, f"beyond a limit: {error.what} {error.value}", "-")
