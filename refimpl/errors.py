"""Errors that a user can cause, and the one form in which they are told.

Every message is one line with four parts: what is wrong, its value, the rule that it breaks, and the way out.
Programs catch [`WamnetError`]; the command line prints its text and exits with status 2.
"""

from __future__ import annotations

_SHOWN_CHARACTERS = 120
"""Longest piece of an offending value that a message repeats, in characters: a line, not a dump."""


class WamnetError(Exception):
    """Base of all errors that stem from input, set-up or data; anything else that is raised is a bug."""


class InputError(WamnetError, ValueError):
    """An argument, file or array that breaks a stated rule.

    `what` names the thing, `value` is shown as it was met, `rule` says what must hold, `way_out` what to do.
    """

    def __init__(self, what: str, value: object, rule: str, way_out: str) -> None:
        super().__init__(f"{what} is {_shown(value)}: {rule}; {way_out}")
        self.what, self.value, self.rule, self.way_out = what, value, rule, way_out

    def __reduce__(self) -> tuple[type[InputError], tuple[str, object, str, str]]:
        """Return how a copy is made in another process: an exception's own way would lose the parts."""
        return type(self), (self.what, self.value, self.rule, self.way_out)


class TrainingError(WamnetError):
    """Training cannot go on, for example because the loss is no longer finite."""


class CompileError(WamnetError):
    """A program cannot be traced, verified, bounded or emitted."""


class ExecutorUnavailable(WamnetError):
    """A device, driver or package that an executor needs is missing."""


def _shown(value: object) -> str:
    """Return `value` on one line, cut to a readable length."""
    text = value if isinstance(value, str) else repr(value)
    text = " ".join(text.split())
    return text if len(text) <= _SHOWN_CHARACTERS else text[: _SHOWN_CHARACTERS - 3] + "..."
