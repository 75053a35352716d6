"""`wamnet bench exports`: every export compiled, run and checked, as a Markdown table.

A record is made of the rows (experiments/publish.py). The commands that measure other parts are those of the
distribution `wamnet-peers` (experiments/peers/command.py).
"""

from collections.abc import Iterable
from pathlib import Path

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
from ..common.options import parse_names
from ..common.terminal import STATUS_WRONG, say


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
    model: Path | None = None,
    scene: str = "minicubes",
    targets: str | None = None,
    places: bool = False,
) -> None:
    """Export for every target, compile, run, check against the bound, and print the verdicts."""
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
