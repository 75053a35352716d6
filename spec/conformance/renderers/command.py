"""`wamnet verify-renderer`: any renderer against scenes whose answers are known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wamnet.cli.common import options
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

Name = Annotated[
    str | None,
    typer.Option(
        "--renderer",
        metavar="NAME",
        help="A renderer that wamnet knows: wamnet, mitsuba, cycles, cycles-as-it-comes, cycles-gltf, "
        "luxcore or povray.",
    ),
]
Command = Annotated[
    str | None,
    typer.Option(
        "--command",
        metavar="CMD",
        help="In its place any program: a command with {scene}, {output} or {outputs}; no shell reads it. "
        "Further {seed}, {width}, {height}, {samples}, {depth}.",
    ),
]
Form = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="NAME",
        help="Form of the scene files: wamnet, mitsuba, blender, povray, luxcore, gltf or three.",
    ),
]
Words = Annotated[
    list[str] | None,
    typer.Option(
        "-k",
        metavar="WORD",
        help="Only cases whose name holds this word, or whose rule it is; repeat for more.",
        show_default="all",
    ),
]
Profiles = Annotated[
    list[str] | None,
    typer.Option(
        "--profile",
        metavar="NAME",
        help="A deviation by intent, such as clamps or no-caustics; repeat for more.",
        show_default="none",
    ),
]
Pictures = Annotated[
    int, typer.Option("--pictures", metavar="N", help="Pictures of each case, by other seeds.")
]
Timeout = Annotated[float, typer.Option("--timeout", help="Longest time for a command, in seconds.")]
Json = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write a report as JSON.")]
Markdown = Annotated[
    Path | None, typer.Option("--markdown", metavar="FILE", help="Write a report as Markdown.")
]
Write = Annotated[
    Path | None,
    typer.Option(
        "--write", metavar="FOLDER", help="Write the scene files of a format with their answers, and end."
    ),
]


def verify_renderer(
    renderer: Name = None,
    command: Command = None,
    form: Form = None,
    words: Words = None,
    profile: Profiles = None,
    pictures: Pictures = 8,
    seed: int = options.option("seed", 0),
    executor: Annotated[
        options.ExecutorName, typer.Option("--executor", help="What traces the paths of --renderer wamnet.")
    ] = options.ExecutorName.numpy,
    timeout: Timeout = 300.0,
    as_json: Json = None,
    markdown: Markdown = None,
    write: Write = None,
) -> None:
    """Ask any renderer to render scenes whose answers are known, and say which rule it breaks.

    Each case is rendered several times with other seeds; a t-test with Holm's correction for the number of
    cases says what deviates, and a smaller picture with other seeds must confirm it. What a format cannot say
    is "not tested". Ends with status 1 if a rule is broken.

    Examples:
    wamnet verify-renderer --renderer wamnet -k direct
    wamnet verify-renderer --renderer mitsuba --json mitsuba.json --markdown mitsuba.md
    wamnet verify-renderer --format mitsuba --command "my_renderer {scene} {output}" --profile clamps
    wamnet verify-renderer --format blender --write scenes
    """
    from . import report, run
    from .cases import PROFILES, chosen

    questions = chosen(words or ())
    if write is not None:
        if renderer is not None or command is not None:
            rule = "it writes scenes and asks nobody"
            raise InputError("--write", str(write), rule, "leave --renderer and --command out")
        _write_scenes(write, _known_form(form), questions)
        return
    profiles = list(profile or ())
    for name in profiles:
        if name not in PROFILES:
            raise InputError("--profile", name, "it is unknown", f"known are {', '.join(PROFILES)}")
    _check_numbers(pictures, seed, timeout)
    for path in (as_json, markdown):
        if path is not None:
            check_output(path)
    asked = _renderer(renderer, command, form, executor.value, timeout)
    shots = run.shots_of(questions)
    with progress(f"asking {asked.name}", len(shots)) as advance:
        verdicts = run.verify(
            asked, questions, pictures=pictures, seed=seed, profiles=profiles, advance=advance
        )
    about = {"pictures": pictures, "seed": seed, "profiles": [*profiles, *asked.intents]}
    if as_json is not None:
        write_text(as_json, report.to_json(asked.name, verdicts, about))
    if markdown is not None:
        write_text(markdown, report.to_markdown(asked.name, verdicts))
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


def _check_numbers(pictures: int, seed: int, timeout: float) -> None:
    """Refuse numbers that cannot be used."""
    from .run import LARGEST_SEED, LEAST_PICTURES

    if not LEAST_PICTURES <= pictures <= 1000:
        rule = f"their spread is the error of their mean: {LEAST_PICTURES} at least, and at most 1000"
        raise InputError("--pictures", pictures, rule, "8 are usual")
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError("--seed", seed, f"it must lie in [0, {LARGEST_SEED}]", "use a smaller one")
    if not 0.0 < timeout < math.inf:
        raise InputError("--timeout", timeout, "it must be a positive number of seconds", "300 is usual")


def _renderer(
    name: str | None, command: str | None, form: str | None, executor: str, timeout: float
) -> Renderer:
    """Return who is asked, or refuse what does not say it."""
    from .renderers import ByCommand, command_words, known

    if (name is None) == (command is None):
        value = "neither given" if name is None else "both given"
        raise InputError(
            "--renderer, --command", value, "exactly one says who is asked", "for example --renderer wamnet"
        )
    if name is not None:
        if form is not None:
            raise InputError("--format", form, "a known renderer has its own", "leave it out")
        return known(name, executor, read_layers, timeout)
    assert command is not None
    return ByCommand(command, _known_form(form), command_words(command), read_layers, limit_s=timeout)


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
        | {
            "answer": expected(q, FORMATS[form].intents)[0],
            "source": q.source,
            "slack": q.slack * q.scale,
            "size": q.shot.size,
        }
        | {"samples": q.shot.spp, "depth": q.shot.depth}
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
