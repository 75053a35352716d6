"""The command `wamnet`: its commands, and the one place where errors become a line and an exit status.

1. Commands are registered with typer in the order of `options.ini`, then those of other distributions
   [`_join`]; the module of a command is imported when it is the one that runs [`application`].
2. [`main`] runs one of them. Whatever a user can cause ends in one line on standard error and status 2;
   Ctrl-C ends in status 130 and SIGTERM in 143; anything else is a bug and shows its traceback.

A list of all commands appears at once: no module of a command is imported for it.
"""

import inspect
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import entry_points
from typing import Annotated, Any

import typer

from ..models.writing import signals_wait
from ..refimpl.errors import InputError, WamnetError
from .common import signatures
from .common.default_command import CommandWithOthers
from .common.request import spread, table, texts_of
from .common.terminal import tell

HELP = {"-h", "--help"}
"""The options that run no command, but print its text."""

VERSION = "--version"
"""The option that runs no command."""

INTERRUPTED, TERMINATED = 130, 143
"""Exit statuses after Ctrl-C and SIGTERM, as shells report them: 128 + the signal."""

DISTRIBUTIONS: Mapping[str, str] = {
    "verify-renderer": "wamnet-verify",
    "course": "wamnet-course",
    "bench render": "wamnet-peers",
    "bench train": "wamnet-peers",
    "bench pipeline": "wamnet-peers",
    "bench primitives": "wamnet-peers",
}
"""Distribution of each command that joins through an entry point of the group `ENTRY_POINTS`."""

ENTRY_POINTS = "wamnet.commands"
"""Group of entry points: a name is a command's or its group's, the value a module with a table `COMMANDS`:
the function of each command, and of those in its group."""

GROUPS: Mapping[str, Mapping[str, Any]] = {
    "course": {},
    "bench": {"cls": CommandWithOthers, "subcommand_metavar": "| COMMAND [OPTIONS]"},
}
"""Commands with commands of their own, and how typer makes the group."""


def application(arguments: Sequence[str] = ()) -> typer.Typer:
    """Return the command line, with only the command that `arguments` begin with, or else a list of all.

    Importing all commands takes longer than denoising a frame. A help text needs signatures only.
    """
    app = typer.Typer(
        name="wamnet",
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        context_settings={"help_option_names": [*HELP]},
    )
    app.callback(invoke_without_command=True)(root)
    commands = {path: lines for path, lines in table().items() if "call" in lines}
    first = arguments[0] if arguments and arguments[0] in (*commands, *DISTRIBUTIONS, VERSION) else None
    groups, package = {"": app}, signatures.package() if HELP & {*arguments} else f"{__package__}.commands"
    for path, lines in commands.items():
        if first == path.partition(" ")[0]:
            module, function = lines["call"].split(".")
            # Modules in C turn an interrupt of their import into errors of their own.
            with signals_wait():
                imported = import_module(f"{package}.{module}")
            _register(groups, path, getattr(imported, function))
        elif first is None and " " not in path:
            app.command(path, help=_help_of(lines["help"])[0])(lambda: None)
    if first is None or any(first == path.partition(" ")[0] for path in DISTRIBUTIONS):
        _join(groups, first, " ".join(arguments[:2]))
    return app


def _join(groups: dict[str, typer.Typer], name: str | None, line: str) -> None:
    """Add the commands of this name that other distributions have, or without one all but those in a group.

    `line` is the command line's first two words.
    """
    installed = {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}
    path = next((each for each in (name or "", line) if each in DISTRIBUTIONS), "")
    if path and name not in installed:
        remedy = f"install it: pip install {DISTRIBUTIONS[path]}"
        raise InputError("command", path, f"distribution {DISTRIBUTIONS[path]} is not installed", remedy)
    for entry in installed.values():
        if entry.name == name or (name is None and entry.name not in table()):
            module = entry.load()
            for each, function in module.COMMANDS.items():
                _register(groups, each, getattr(module, function))


def _register(groups: dict[str, typer.Typer], path: str, function: Callable[..., None]) -> None:
    """Add a command to its group; a group joins the others."""
    group, _, name = path.rpartition(" ")
    shown, epilog = _help_of(texts_of(function, path).get("help") or inspect.getdoc(function) or "")
    how: dict[str, Any] = {"help": shown, "epilog": epilog}
    if path in GROUPS:
        groups[path] = typer.Typer(invoke_without_command=True, **GROUPS[path])
        groups[path].callback(**how)(spread(function, path))
        groups[group].add_typer(groups[path], name=name)
    else:
        groups[group].command(name, **how)(spread(function, path))


def _help_of(docstring: str) -> tuple[str, str | None]:
    """Return the help text of a command, a line for each paragraph as typer wants it, and its examples."""
    text, mark, examples = docstring.partition("\n\nExample")
    shown = "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))
    return shown, f"Example{examples}".replace("\n", "\n\n") if mark else None


def root(
    context: typer.Context,
    version: Annotated[bool, typer.Option(VERSION, help="Print the version and exit.")] = False,
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
        return TERMINATED if status == INTERRUPTED and terminated else status


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
            # Not from here, where it would be dropped too, but a little later; the main thread may sleep.
            clock = threading.Timer(0.01, signal.pthread_kill, (main, signal.SIGINT))
            clock.daemon = True
            clock.start()
            return
        deletes = getattr(unraisable.object, "__name__", "") == "__del__"
        # An object that an interrupt has left half made lacks attributes when it is deleted: nothing to tell.
        if not (deletes and isinstance(unraisable.exc_value, AttributeError)):
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
        words = list(sys.argv[1:] if arguments is None else arguments)
        # A shell that completes a line has it in a variable.
        typed = os.environ.get("COMP_WORDS", os.environ.get("_TYPER_COMPLETE_ARGS", ""))
        arguments = words or [*typed.split()[1:], *HELP]
        form = {"prog_name": "wamnet", "standalone_mode": False}
        try:
            status = application(arguments)(words, **form)
        except NotImplementedError:
            # What asks for help is the value of an option or an argument.
            status = application(arguments[:1])(words, **form)
    except WamnetError as error:
        return _fail(str(error))
    except MemoryError:
        return _fail("out of memory (use smaller frames or fewer --workers, or close other programs)")
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        return _fail(f"{error.strerror or error}{where}")
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except Exception as error:
        # A wrong option: typer's own exceptions have this method, wherever their class lives.
        if not hasattr(error, "format_message"):
            raise
        context = getattr(error, "ctx", None)
        command, wrong = context.command_path if context else "wamnet", error.format_message()
        return _fail(f"{wrong.replace('Value error, ', '').rstrip('.')}; see {command} --help")
    if status == INTERRUPTED:
        tell("interrupted")
    return status if isinstance(status, int) else 0


def _fail(message: str) -> int:
    """Say in one line on standard error what is wrong."""
    tell(f"error: {message}")
    return 2
