"""`wamnet verify-renderer`: any renderer against scenes whose answers are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from wamnet.cli.common.options import ExecutorName
from wamnet.cli.common.terminal import progress, say, table
from wamnet.cli.files.outputs import check_new_folder, check_output, making_folder, write_text
from wamnet.refimpl.errors import InputError

if TYPE_CHECKING:
    from .cases import Question
    from .judgement import Verdict
    from .renderers import Renderer

COMMANDS = {"verify-renderer": "verify_renderer"}
"""Function of the command, which `wamnet` registers."""

STATUS_DEVIATES = 1
"""Exit status when a rule is broken."""


@dataclass(frozen=True)
class Request:
    """Who is asked, what, and where the answer goes."""

    renderer: str | None = None
    command: str | None = None
    form: str | None = None
    words: list[str] | None = None
    profile: list[str] | None = None
    pictures: int = 8
    seed: int = 0
    executor: ExecutorName = ExecutorName.numpy
    timeout: float = 300.0
    as_json: Path | None = None
    markdown: Path | None = None
    write: Path | None = None


def verify_renderer(*, request: Request) -> None:
    """Ask any renderer to render scenes whose answers are known, and say which rule it breaks."""
    from . import report, run
    from .cases import PROFILES, chosen

    questions, profiles = chosen(request.words or ()), request.profile or []
    if request.write is not None:
        if request.renderer is not None or request.command is not None:
            rule = "it writes scenes and asks nobody"
            raise InputError("--write", str(request.write), rule, "leave --renderer and --command out")
        _write_scenes(request.write, _known_form(request.form), questions)
        return
    for name in profiles:
        if name not in PROFILES:
            raise InputError("--profile", name, "it is unknown", f"known are {', '.join(PROFILES)}")
    for path in (request.as_json, request.markdown):
        if path is not None:
            check_output(path)
    asked, numbers = _renderer(request), {"pictures": request.pictures, "seed": request.seed}
    with progress(f"asking {asked.name}", len(run.shots_of(questions))) as advance:
        verdicts = run.verify(asked, questions, profiles=profiles, advance=advance, **numbers)
    if request.as_json is not None:
        about = {**numbers, "profiles": [*profiles, *asked.intents]}
        write_text(request.as_json, report.to_json(asked.name, verdicts, about))
    if request.markdown is not None:
        write_text(request.markdown, report.to_markdown(asked.name, verdicts))
    _print(asked.name, verdicts)
    if any(verdict.deviates for verdict in verdicts):
        raise typer.Exit(STATUS_DEVIATES)


def _known_form(form: str | None) -> str:
    """Return the name of a format, or refuse it."""
    from .renderers import FORMATS

    if form is None or form not in FORMATS:
        rule = "a form of scene files must be named" if form is None else "it is unknown"
        raise InputError("--format", form or "not given", rule, f"known are {', '.join(FORMATS)}")
    return form


def _renderer(request: Request) -> Renderer:
    """Return who is asked, or refuse what does not say it."""
    from .renderers import ByCommand, command_words, known

    name, command, form, limit_s = request.renderer, request.command, request.form, request.timeout
    if name is not None and command is None:
        if form is not None:
            raise InputError("--format", form, "a known renderer has its own", "leave it out")
        return known(name, request.executor.value, read_layers, limit_s)
    if name is None and command is not None:
        return ByCommand(command, _known_form(form), command_words(command), read_layers, limit_s=limit_s)
    value = "neither given" if name is None else "both given"
    raise InputError(
        "--renderer, --command", value, "exactly one says who is asked", "for example --renderer wamnet"
    )


def read_layers(path: Path) -> Mapping[str, Any]:
    """Return the layers of an EXR by name, finite or not, or of a PNG as layer `display`."""
    from wamnet.cli.files import exr, images

    if path.suffix == ".png":
        return {"display": images.read_png(path)}
    return exr.read_frame(path, finite=False).layers


def _write_scenes(folder: Path, form: str, questions: Sequence[Question]) -> None:
    """Write the scene files of all shots, and answers.json."""
    import json

    from .judgement import expected
    from .parts import NotExpressed
    from .renderers import FORMATS
    from .run import shots_of

    check_new_folder(folder)
    answers = [
        {"name": q.name, "rule": q.rule, "scene": q.shot.name, "layer": q.layer, "block": q.block}
        | {"answer": expected(q, FORMATS[form].intents)[0], "source": q.source, "slack": q.slack * q.scale}
        | {"size": q.shot.size, "samples": q.shot.spp, "depth": q.shot.depth}
        for q in questions
    ]
    written, silent = 0, []
    with making_folder(folder) as new:
        for shot in shots_of(questions):
            try:
                text = FORMATS[form].write(shot, 0)
            except NotExpressed as error:
                silent.append(f"{shot.name}: format {form} has no {error}")
                continue
            (new / f"{shot.name}{FORMATS[form].suffix}").write_text(text, encoding="utf-8")
            written += 1
        (new / "answers.json").write_text(json.dumps(answers, indent=1) + "\n", encoding="utf-8")
    for line in silent:
        say(f"not written: {line}")
    say(f"{folder}: {written} scenes, and answers.json")


def _print(name: str, verdicts: Sequence[Verdict]) -> None:
    """Print a line for each case, and what to look at first."""
    from . import report
    from .judgement import first_blamed, sentence_of
    from .run import counts

    # What was found and the answer are in the sentences below, where they differ.
    kept = [0, 1, 2, 5, 6]
    rows = [[report.row(verdict)[i] for i in kept] for verdict in verdicts]
    table(f"Cases of {name}", [report.HEADS[i] for i in kept], rows, texts=5)
    for verdict in verdicts:
        if verdict.deviates:
            say(sentence_of(verdict))
    first = first_blamed(verdicts)
    if first is not None:
        say(f"look first at rule {first.rule}: others rest on it")
    say(", ".join(f"{number} {state}" for state, number in counts(verdicts).items()))
