"""Writing files and folders so that nothing is half written, and nothing of others is touched.

1. Content goes into a new file beside the output, under a name that nobody can guess, which is made only
   where nothing is: no link that somebody put there is followed. When the content is complete the file takes
   the output's name in one step; a link of that name is replaced, not followed [`replacing`].
2. Folders that are made for an output go again if the work fails before anything is in them
   [`making_parents`].
3. Only a regular file of a name that this project gives is removed, never a link [`is_regular`],
   [`remove_temporaries`].

4. What must not be torn apart lets SIGINT and SIGTERM wait: locks, and imports of modules in C, some of which
   end the process if an interrupt reaches them [`signals_wait`].

Errors are the system's (OSError): the caller knows what the user requested.
"""

from __future__ import annotations

import os
import re
import secrets
import signal
import stat
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

TEMPORARY = ".wamnet-"
"""How the names of unfinished files begin; a process that is killed leaves them behind."""

TEMPORARY_NAME = re.compile(re.escape(TEMPORARY) + r"[0-9a-z_]{8,16}(\.[^/]*)?")
"""What an unfinished file is called; earlier versions gave eight letters."""


def temporary_beside(path: Path) -> Path:
    """Return a name in the folder of `path` that cannot be guessed, with its suffix.

    The name is short: one that repeats the output's could be longer than file systems allow.
    """
    return path.with_name(f"{TEMPORARY}{secrets.token_hex(8)}{path.suffix}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the name of a new file beside `path`: when the block ends well it replaces it, else it goes."""
    new = temporary_beside(path)
    # The usual rights of a new file, as the user's mask has them.
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    # If this fails there is nothing of ours to remove.
    os.close(os.open(new, flags, 0o666))
    try:
        yield new
        new.replace(path)
    finally:
        # What the block ended with counts, not that nothing can be removed either.
        with suppress(OSError):
            new.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Give `path` the content, whole or not at all."""
    with replacing(path) as new:
        new.write_bytes(content)


def write_together(contents: dict[Path, bytes]) -> None:
    """Write all files, then give them their names one by one in this order; none has its own before that."""
    with ExitStack() as stack:
        # A stack is left from its end.
        parts = {path: stack.enter_context(replacing(path)) for path in reversed(contents)}
        for path, content in contents.items():
            parts[path].write_bytes(content)


@contextmanager
def making_parents(folder: Path) -> Iterator[None]:
    """Make a folder and those above it; when the block fails, those go again that it has left empty."""
    made: list[Path] = []
    try:
        for each in reversed([folder, *folder.parents]):
            if not each.is_dir():
                made.append(each)
                # Another process may have made it meanwhile: then it is not ours to remove.
                try:
                    each.mkdir()
                except FileExistsError:
                    made.pop()
                    if not each.is_dir():
                        raise
        yield
    except BaseException:
        for each in reversed(made):
            with suppress(OSError):
                each.rmdir()
        raise


def is_regular(path: Path) -> bool:
    """Tell whether a name is that of a regular file itself, and not of a link to one."""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except FileNotFoundError:
        return False


def remove_temporaries(folder: Path) -> None:
    """Remove the unfinished files that a killed process has left in a folder of one writer."""
    for path in folder.iterdir():
        if TEMPORARY_NAME.fullmatch(path.name) and is_regular(path):
            path.unlink(missing_ok=True)


@contextmanager
def signals_wait() -> Iterator[None]:
    """Let SIGINT and SIGTERM wait until the block has ended."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    noted: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    try:
        for number in numbers:
            signal.signal(number, lambda number, _frame: noted.append(number))
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
        for held in noted:
            signal.raise_signal(held)
