"""`wamnet course`: begin the labs, grade one's own, grade a class."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wamnet.cli.common.terminal import progress, say, table
from wamnet.cli.files.outputs import making_folder, write_text
from wamnet.refimpl.errors import InputError

if TYPE_CHECKING:
    from .grading import Result
    from .labs import Lab
    from .sandbox import Limits

COMMANDS = {
    "course": "course",
    "course start": "start",
    "course check": "check",
    "course grade": "grade",
}
"""Function of each command, which `wamnet` registers."""

STATUS_NOT_YET = 1
"""Exit status of a check when a lab is not right; grading a class ends with 0."""

ALL = "all"
"""The word for all labs."""

MOST_SECONDS, MOST_MEMORY_MB = 3600, 65536
"""Largest limits: an hour, and 64 GB."""

Seconds = Annotated[int, typer.Option("--seconds", help="Computing time of a lab, in seconds.")]
Memory = Annotated[int, typer.Option("--memory", help="Memory of a lab, in megabytes.")]


def course(context: typer.Context) -> None:
    """Learn by writing the pieces: twelve labs and three extras, each with a grader.

    A message names the clause of the spec, what was expected, what was found, and the likeliest mistake.
    """
    if context.invoked_subcommand is None:
        context.get_help()


def start(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder to make: a new one, or an empty one.")
    ],
) -> None:
    """Write the skeletons of all labs, a Makefile and a README to a new folder.

    Examples:
    wamnet course start mycourse
    """
    from .start import begin

    if folder.is_dir() and any(folder.iterdir()):
        raise InputError("output folder", str(folder), "is not empty", "name another folder")
    with making_folder(folder) as new:
        names = begin(new)
    say(
        f"wrote {len(names)} files to {folder}; read {folder / 'README.md'}, "
        f"then wamnet course check 1 {folder}"
    )


def check(
    lab: Annotated[
        str, typer.Argument(metavar="LAB", help="1 to 12, a lab's name, extra1 to extra3, or all.")
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of your answers.")] = Path(),
    every: Annotated[bool, typer.Option("--every", help="Show all findings, not only the first.")] = False,
    seconds: Seconds = 60,
    memory: Memory = 1024,
) -> None:
    """Grade a lab. Ends with status 1 if it is not right yet.

    Your code runs as yours, in your folder, in a separate process with limits on time and memory.

    Examples:
    wamnet course check 1
    wamnet course check sampling mycourse --every
    wamnet course check all mycourse
    """
    from .grading import grade
    from .labs import LABS, lab_named

    limits = _limits(seconds, memory)
    if not folder.is_dir():
        raise InputError("folder of answers", str(folder), "it is no folder", "wamnet course start makes one")
    chosen = LABS if lab.strip().lower() == ALL else (lab_named(lab),)
    results = [grade(one, folder, limits, trusted=True, shows=len(chosen) == 1) for one in chosen]
    for result in results:
        _show(result, every)
    if not all(result.right for result in results):
        raise typer.Exit(STATUS_NOT_YET)


def _limits(seconds: int, memory: int) -> Limits:
    """Return the limits, or refuse them."""
    from .sandbox import Limits

    for name, value, most in (("--seconds", seconds, MOST_SECONDS), ("--memory", memory, MOST_MEMORY_MB)):
        if not 1 <= value <= most:
            raise InputError(name, value, f"it must be 1 to {most}", "the default suits all labs")
    return Limits(seconds, memory)


def _show(result: Result, every: bool) -> None:
    """Print how far a lab is, and what is wrong."""
    verdict = "passed" if result.right else "not yet"
    say(f"{result.lab.name}: {result.passed} of {len(result.checks)} checks, {verdict}")
    wrong = [(name, one) for name, one in result.checks if one is not None]
    for name, one in wrong if every else wrong[:1]:
        clause = f", clause {one.clause}" if one.clause else ""
        say(f"  {name}{clause}")
        say(f"    {one.what}")
        for title, text in (("expected", one.expected), ("found", one.found), ("likely", one.likely)):
            if text:
                say(f"    {title + ':':10}{text}")


def grade(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with a folder for each student.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="New folder for the tables.")],
    lab: Annotated[
        list[str] | None, typer.Option("--lab", metavar="LAB", help="Only this lab; repeat for more.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Labs that are graded at a time.", show_default="one a core")
    ] = None,
    seconds: Seconds = 60,
    memory: Memory = 1024,
    trusted: Annotated[
        bool, typer.Option("--trusted", help="Run the students' code without a sandbox, with your rights.")
    ] = False,
) -> None:
    """Grade a whole class, and write its tables: index.html, grades.csv and findings.csv.

    Each lab of each student runs in a separate process under Bubblewrap: it sees Python and its own files,
    has no network, and has limits on time and memory. It returns data, which the grader compares. Endless
    loops and the like are named in the tables, and stop nobody else.

    Examples:
    wamnet course grade students -o grades
    wamnet course grade students -o grades --lab 3 --lab 4 --seconds 20
    """
    from . import table as tables
    from .grading import files_of, grade_class
    from .sandbox import unavailable

    limits = _limits(seconds, memory)
    if workers is not None and workers < 1:
        raise InputError("--workers", workers, "it must be at least 1", "one a core is usual")
    labs = _labs(lab)
    total = len(files_of(folder, labs))
    if not trusted and (reason := unavailable()):
        fix = "install bubblewrap, or add --trusted if you trust all of these files"
        raise InputError("sandbox", reason, "students' code runs in one", fix)
    with making_folder(output) as new:
        with progress("grading", total) as advance:
            count = workers or os.cpu_count() or 1
            students = grade_class(folder, labs, limits, count, advance, trusted=trusted)
        write_text(new / "index.html", tables.page(students, labs))
        write_text(new / "grades.csv", tables.grades(students, labs))
        write_text(new / "findings.csv", tables.findings(students))
    rows = [(s.name, str(len(s.results)), str(s.complete)) for s in students]
    table(f"{len(students)} students", ("student", "labs", "complete"), rows)
    say(f"wrote index.html, grades.csv and findings.csv to {output}")


def _labs(words: Sequence[str] | None) -> Sequence[Lab]:
    """Return the labs that are named, each once, or all without names."""
    from .labs import LABS, lab_named

    return tuple(dict.fromkeys(map(lab_named, words))) if words else LABS
