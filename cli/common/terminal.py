"""What the commands print: results on standard output, progress on standard error if that is a terminal.

Names and texts may be untrusted: nothing reaches the terminal before [`errors.escaped`] has seen it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

from rich import box
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from ...refimpl.errors import escaped, shown


class _Rate(ProgressColumn):
    """How many of a unit are done per second."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        """Return the text of a task."""
        return Text(f"{task.speed:.1f} {self._unit}/s" if task.speed else "")


Advance = Callable[[float], None]
"""Called with the work done since the last call, in the unit of the total."""


def say(text: str) -> None:
    """Print one line of result as it is: names of files may look like rich's markup or emoji codes."""
    Console(highlight=False, soft_wrap=True).print(escaped(text), markup=False, emoji=False)


def tell(text: str) -> None:
    """Write one line of `wamnet` itself to standard error, such as an error."""
    sys.stderr.write(f"wamnet: {shown(text)}\n")


@contextmanager
def hint_on_interrupt(hint: Callable[[], str]) -> Iterator[None]:
    """Say on standard error how to resume when the block is interrupted; the hint is made then."""
    try:
        yield
    except KeyboardInterrupt:
        tell(hint())
        raise


@contextmanager
def progress(title: str, total: float, unit: str = "") -> Iterator[Advance]:
    """Show a progress bar on a terminal, and nothing where standard error is a file or a pipe.

    With the name of a `unit` it shows how many of them are done per second.
    """
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("passed,"),
        TimeRemainingColumn(),
        TextColumn("left"),
        *([_Rate(unit)] if unit else []),
    )
    with ExitStack() as opened:
        if unit and console.is_terminal:
            # Threads that read files redirect the descriptor for a moment [files/exr.py].
            stream = os.fdopen(os.dup(2), "w", encoding="utf-8", errors="replace")
            console = Console(file=opened.enter_context(stream))
        bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        opened.enter_context(bar)
        task = bar.add_task(escaped(title), total=total)
        yield lambda done: bar.update(task, advance=done)


def table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, texts: int = 1) -> None:
    """Print a table: the first `texts` columns to the left, the others, numbers, to the right.

    All texts are shown as they are, without markup.
    """
    grid = Table(title=Text(escaped(title)), title_justify="left", box=box.SIMPLE_HEAD)
    for index, name in enumerate(header):
        grid.add_column(Text(escaped(name)), justify="left" if index < texts else "right")
    for row in rows:
        grid.add_row(*(Text(escaped(cell)) for cell in row))
    Console(highlight=False).print(grid)
