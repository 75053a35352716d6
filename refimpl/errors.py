"""Errors that a user can cause, and the one form in which they are reported.

Every message is one line with four parts: `WHAT 'VALUE': RULE (REMEDY)`, as in
`input file 'x.exr': not found (check the name)`. One fact has one phrase: a file is `not found`, a name is
`unknown` and its remedy a [`choice`]. Programs catch [`WamnetError`]; the command line prints the message and
exits with status 2.

Parts of a message may come from untrusted files, and a terminal executes control characters: [`escaped`]
replaces them, and [`shown`] also makes one line of a stated length.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from types import EllipsisType
from typing import Final

LONGEST_MESSAGE = 1000
"""Most characters of a message: some lines of a terminal, not a dump."""

_MOST_OF_WHAT, _MOST_OF_VALUE, _MOST_OF_RULE = 200, 120, 320
"""Most characters of a message's parts: the name of the thing, its value, the rule and, as long, the remedy.
Together with the punctuation between them they are at most LONGEST_MESSAGE."""

NO_VALUE: Final[EllipsisType] = ...
"""The value in an error about something without one, such as a missing argument."""


def escaped(text: str) -> str:
    """Return the text with what no terminal should be given as escapes, such as `\\x1b` and `\\u202e`.

    That is what moves a cursor, turns or hides writing, is half a character, or one without a sign.
    """
    if text.isprintable():
        return text
    return "".join(
        character.encode("unicode_escape").decode("ascii") if not character.isprintable() else character
        for character in text
    )


def shown(text: str, most: int = LONGEST_MESSAGE) -> str:
    """Return the text on one line without control characters, its middle left out where it is too long."""
    # Folding comes first: a line's end inside of a text is a blank to its reader, not an escape.
    line = escaped(" ".join(text.split()))
    if len(line) <= most:
        return line
    tail = (most - 3) // 3
    return f"{line[: most - 3 - tail]}...{line[len(line) - tail :]}"


def choice(name: str, names: Iterable[str]) -> str:
    """Return the remedy for an unknown name: all names, and first the most similar one, if any is similar."""
    names = list(names)
    near = get_close_matches(name, names, n=1)
    return f"{f'did you mean {near[0]!r}? ' if near else ''}choose one of {', '.join(names)}"


class WamnetError(Exception):
    """Base of all errors that stem from input, set-up or data; anything else that is raised is a bug."""

    def __str__(self) -> str:
        """Return the message as a terminal may have it; `args` keep it as it was given."""
        return shown(super().__str__())


class InputError(WamnetError, ValueError):
    """An argument, file or array that breaks a stated rule.

    `what` names the thing, `value` is what was found (text in quotation marks), `rule` states the requirement
    that it breaks, `way_out` the remedy.
    """

    def __init__(self, what: str, value: object, rule: str, way_out: str) -> None:
        subject = shown(what, _MOST_OF_WHAT)
        if isinstance(value, str):
            subject += f" '{shown(value, _MOST_OF_VALUE)}'"
        elif value is not NO_VALUE:
            subject += f" {shown(repr(value), _MOST_OF_VALUE)}"
        super().__init__(f"{subject}: {shown(rule, _MOST_OF_RULE)} ({shown(way_out, _MOST_OF_RULE)})")
        self.what, self.value, self.rule, self.way_out = what, value, rule, way_out

    def __reduce__(self) -> tuple[type[InputError], tuple[str, object, str, str]]:
        """Return how a copy is made in another process: an exception's own way would lose the parts."""
        return type(self), (self.what, self.value, self.rule, self.way_out)


class TrainingError(WamnetError):
    """Training cannot continue, for example because the loss is no longer finite."""


class CompileError(WamnetError):
    """A program cannot be traced, verified, bounded or emitted."""


class ExecutorUnavailable(WamnetError):
    """A device, driver or package that an executor needs is missing."""
