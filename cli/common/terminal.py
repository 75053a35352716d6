"""What the commands print: results on standard output, progress on standard error if that is a terminal.

Names and texts may be untrusted: nothing reaches the terminal before [`errors.escaped`] has seen it.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from ...refimpl.errors import escaped, shown


class _Work(ProgressColumn):
    """How much of the total is done, and how much per second; a share where the work has no unit."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        """Return the text of a task."""
        if not self._unit:
            return Text(f"{task.percentage:.0f} %,")
        rate = f", {_short(task.speed, 1)} {self._unit}/s" if task.speed else ""
        return Text(f"{_short(task.completed)} of {_short(task.total or 0)} {self._unit}{rate},")


def _short(number: float, digits: int = 0) -> str:
    """Return a count or a rate of few characters."""
    return f"{number / 1e6:.1f}M" if number >= 1e6 else f"{number:,.{digits}f}"


STATUS_WRONG = 1
"""Exit status when what a command has checked is wrong: a kernel, a proof, a program, a path."""

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
def progress(title: str, total: float | None, unit: str = "") -> Iterator[Advance]:
    """Show a progress bar on a terminal, and nothing where standard error is a file or a pipe.

    It has one form: a verb, the count of the total in its `unit`, the rate, and the time left; without a
    total (None) it has only the verb.
    """
    console = Console(stderr=True)
    work = () if total is None else (_Work(unit), TimeRemainingColumn(), TextColumn("left"))
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), *work)
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
