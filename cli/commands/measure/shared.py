"""What the measuring commands share: their lists with commas, their refusals, and the form of their tables.

Rows are Markdown, which a record is made of (experiments/publish.py); progress is on standard error.
"""

from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import Annotated

from ....kernels.bench.workload import check_size
from ....refimpl.errors import InputError
from ...common.options import SCENES, parse_names, usage
from ...common.terminal import say
from ...reports import machine

MOST = 1 << 20
"""Largest count that an option takes: a typing error is refused before anything is measured."""

NUMPY = f"NumPy {metadata.version('numpy')}"
"""NumPy's version, with its name."""

Repeats = Annotated[int, usage("Number of interleaved rounds.")]
SceneShown = Annotated[str, usage(f"NAME  Canonical scene ({SCENES}) or scene file.")]
Square = Annotated[int, usage("Width and height in pixels.")]


def names_of(option: str, text: str, known: Iterable[str]) -> tuple[str, ...]:
    """Return the names of a text like `opencl,opengl`, or refuse one that is not known."""
    names, known = parse_names(text), tuple(known)
    if not names or not set(names) <= set(known):
        rule = f"must be one or more of {', '.join(known)}, with commas"
        raise InputError(option, text, rule, f"for example {option} {','.join(known[:2])}")
    return names


def counts_of(option: str, text: str, example: str) -> tuple[int, ...]:
    """Return the integers of a text like `256,512`, or refuse it."""
    try:
        counts = tuple(int(part) for part in parse_names(text))
    except ValueError:
        counts = ()
    if not counts or not all(1 <= count <= MOST for count in counts):
        rule = f"must be integers from 1 to {MOST}, with commas"
        raise InputError(option, text, rule, f"for example {option} {example}")
    return counts


def check_counts(sizes: Iterable[int] = (), **counts: tuple[int, int]) -> None:
    """Refuse sizes of which no picture is made, and numbers of things that make none: (value, example)."""
    for size in sizes:
        check_size(size)
    for name, (value, example) in counts.items():
        if not 1 <= value <= MOST:
            option = f"--{name}"
            raise InputError(option, value, f"must be from 1 to {MOST}", f"for example {option} {example}")


def say_facts(*others: str) -> None:
    """Print what is said of the machine, then what else was given."""
    say(", ".join([*(f"{name} {value}" for name, value in machine.describe().items()), *others]))


def head(*cells: str, apart: bool = True) -> None:
    """Print the head of a table, apart from what is above it by an empty line."""
    if apart:
        say("")
    row(*cells)
    say(f"|{'---|' * len(cells)}")


def row(*cells: str, after: str = "") -> None:
    """Print a row of a table, and what is to be said behind it."""
    say(f"| {' | '.join(cells)} |{after}")


def extent(values: Sequence[float], digits: int) -> str:
    """Return the least and the greatest value, as a table shows them."""
    return f"{min(values):.{digits}f} - {max(values):.{digits}f}"
