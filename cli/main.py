"""The command `wamnet`: its commands, and the one place where errors become a line and an exit status.

1. Commands are registered with typer in the order of a first session [`app`]; `bench`, which has commands
   of its own [common/default_command.py], comes last, and `course` before it.
2. [`main`] runs one of them. Whatever a user can cause ends in one line on standard error and status 2;
   Ctrl-C ends in status 130 and SIGTERM in 143; anything else is a bug and shows its traceback.

Modules that compute are imported when a command runs, so that a help text appears at once.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import typer

from ..refimpl.errors import WamnetError
from .commands import (
    animate,
    bench,
    certify,
    compare,
    conformance,
    dataset,
    demo,
    denoise,
    export,
    listing,
    render,
    train,
    triage,
    tune,
    view,
)
from .commands.compile import EXAMPLES as COMPILE_EXAMPLES
from .commands.compile import compile_model
from .commands.course import labs as course
from .commands.measure import exports, pipeline, primitives
from .commands.measure import render as measure_render
from .commands.measure import train as measure_train
from .commands.networks import importing
from .commands.verify import renderer as verify_renderer
from .common.default_command import CommandWithOthers
from .common.terminal import tell

STATUS_BAD_INPUT = 2
"""Exit status when a file, an option or the machine is not as it must be."""

STATUS_TERMINATED = 143
"""Exit status after the signal to end: 128 + SIGTERM."""

STATUS_INTERRUPTED = 130
"""Exit status after Ctrl-C: 128 + SIGINT, as shells report it."""

AGAIN_S = 0.01
"""Seconds after which a dropped interrupt is sent again: by then the object is gone."""

app = typer.Typer(
    name="wamnet",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


benches = typer.Typer(
    cls=CommandWithOthers, invoke_without_command=True, subcommand_metavar="| COMMAND [OPTIONS]"
)

courses = typer.Typer(invoke_without_command=True)


def _help(command: Callable[..., None]) -> str:
    """Return a command's docstring, each paragraph on one line, as typer wants it."""
    paragraphs = (command.__doc__ or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def _register(
    command: Callable[..., None], examples: str, name: str | None = None, to: typer.Typer = app
) -> None:
    """Add a command, whose help is its docstring."""
    to.command(name, help=_help(command), epilog=examples)(command)


_register(render.render, render.RENDER_EXAMPLES)
_register(render.scene, render.SCENE_EXAMPLES)
_register(dataset.dataset, dataset.EXAMPLES)
_register(train.train, train.EXAMPLES)
_register(importing.import_model, importing.EXAMPLES, "import")
_register(compile_model, COMPILE_EXAMPLES, "compile")
_register(listing.listing, listing.EXAMPLES)
_register(export.export, export.EXAMPLES)
_register(certify.certify, certify.EXAMPLES)
_register(denoise.denoise, denoise.DENOISE_EXAMPLES)
_register(compare.compare, compare.EXAMPLES)
_register(triage.triage, triage.EXAMPLES)
_register(animate.animate, animate.EXAMPLES)
_register(view.view, view.EXAMPLES)
_register(tune.tune, tune.EXAMPLES)
_register(denoise.executors, denoise.EXECUTORS_EXAMPLES)
_register(conformance.conformance, conformance.EXAMPLES)
_register(verify_renderer.verify_renderer, verify_renderer.EXAMPLES, "verify-renderer")
_register(demo.demo, demo.EXAMPLES)
_register(measure_render.render, measure_render.EXAMPLES, to=benches)
_register(measure_train.train, measure_train.EXAMPLES, to=benches)
_register(pipeline.pipeline, pipeline.EXAMPLES, to=benches)
_register(exports.exports, exports.EXAMPLES, to=benches)
_register(primitives.primitives, primitives.EXAMPLES, to=benches)
_register(course.start, course.START_EXAMPLES, to=courses)
_register(course.check, course.CHECK_EXAMPLES, to=courses)
_register(course.grade, course.GRADE_EXAMPLES, to=courses)
courses.callback(help=_help(course.course))(course.course)
app.add_typer(courses, name="course")
benches.callback(help=_help(bench.bench), epilog=bench.EXAMPLES)(bench.bench)
app.add_typer(benches, name="bench")


@app.callback(invoke_without_command=True)
def root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and end.")] = False,
) -> None:
    """Render a scene, train a small network that denoises it, and run that network anywhere.

    Start with [bold]wamnet demo[/], which does all of it in a few minutes and writes a report.
    """
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"wamnet {installed('wamnet')}")
    elif context.invoked_subcommand is None:
        context.get_help()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line (by default the process's) and return its exit status."""
    with _losing_no_interrupt(), _ending_on_sigterm() as terminated:
        status = _run(arguments)
        return STATUS_TERMINATED if status == STATUS_INTERRUPTED and terminated else status


@contextmanager
def _ending_on_sigterm() -> Iterator[list[int]]:
    """Make SIGTERM end the commands as Ctrl-C does, workers and half-written files too; yield those seen."""
    seen: list[int] = []

    def end(number: int, _frame: object) -> None:
        seen.append(number)
        raise KeyboardInterrupt

    # Signals belong to the main thread, and who has set another handler keeps it.
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield seen
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield seen
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _losing_no_interrupt() -> Iterator[None]:
    """Send an interrupt again that came while an object was deleted: Python prints it there and drops it."""

    def again(unraisable: Any) -> None:
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            # Not from here, where it would be dropped too; the main thread may sleep.
            clock = threading.Timer(AGAIN_S, signal.pthread_kill, (main, signal.SIGINT))
            clock.daemon = True
            clock.start()
        else:
            before(unraisable)

    main = threading.main_thread().ident or 0
    before, sys.unraisablehook = sys.unraisablehook, again
    try:
        yield
    finally:
        sys.unraisablehook = before


def _run(arguments: Sequence[str] | None) -> int:
    """Run the command line and return its exit status."""
    try:
        status = app(
            None if arguments is None else list(arguments), prog_name="wamnet", standalone_mode=False
        )
    except WamnetError as error:
        return _fail(str(error))
    except MemoryError:
        return _fail(
            "the memory does not suffice; use smaller frames or fewer --workers, or end other programs"
        )
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        return _fail(f"{error.strerror or error}{where}")
    except (KeyboardInterrupt, typer.Abort):
        status = STATUS_INTERRUPTED
    except Exception as error:
        # A wrong option: typer's own exceptions have this method, wherever their class lives.
        if not hasattr(error, "format_message"):
            raise
        return _fail(_usage(error))
    if status == STATUS_INTERRUPTED:
        tell("interrupted")
    return status if isinstance(status, int) else 0


def _usage(error: Any) -> str:
    """Return what is wrong with an option, and where help is."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "wamnet"
    return f"{error.format_message().rstrip('.')}; see {command} --help"


def _fail(message: str) -> int:
    """Say in one line on standard error what is wrong."""
    tell(f"error: {message}")
    return STATUS_BAD_INPUT
