"""One writer for one output: the second is refused, in one line, before it has written anything.

1. A writer locks an empty file, in its folder [`alone_in`] or beside its file [`alone_at`]; [`working_in`]
   makes the folder too. The system forgets the lock of a process that was killed, so that the next run can
   begin; at every other end the file is removed.
2. A lock is made or opened as itself: a link of its name, anything but a regular file, and a file with
   content are somebody else's, refused, and stay.
3. While a lock is taken or given back SIGINT and SIGTERM wait, so that none ends a run in between
   [`signals_wait`, models/writing.py].
"""

import errno
import fcntl
import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from ...models.writing import making_parents, signals_wait
from ...refimpl.errors import InputError
from .outputs import unwritable

LOCK = ".lock"
"""File that is locked, and there, as long as a process writes into the folder."""

BESIDE = ".wamnet_lock_"
"""How the name of the lock of a single file begins; a hash of the file's name follows."""


@contextmanager
def alone_in(
    folder: Path, doing: str, way_out: str = "wait for it, or choose another with -o"
) -> Iterator[None]:
    """Keep other writers out of a folder, which is there; `doing` says what they do."""
    refusal = InputError("output folder", str(folder), f"another process is {doing} there", way_out)
    with _locked(folder / LOCK, refusal):
        yield


@contextmanager
def working_in(folder: Path, doing: str) -> Iterator[None]:
    """Make a folder if it is missing, and keep others out; an error that leaves it empty removes it."""
    with ExitStack() as stack:
        try:
            stack.enter_context(making_parents(folder))
        except OSError as error:
            raise unwritable(folder, error, "output folder") from None
        stack.enter_context(alone_in(folder, doing))
        yield


@contextmanager
def alone_at(path: Path, doing: str) -> Iterator[None]:
    """Keep other writers from a file; `doing` says what they do."""
    rule = f"another process is {doing} there"
    refusal = InputError("output file", str(path), rule, "wait for it, or choose another with -o")
    name = hashlib.sha256(os.fsencode(path.name)).hexdigest()[:16]
    with _locked(path.with_name(BESIDE + name), refusal):
        yield


@contextmanager
def _locked(path: Path, refusal: InputError) -> Iterator[None]:
    """Hold the lock of a file, or raise the refusal if another process has it."""
    handle = -1
    try:
        with signals_wait():
            handle = _lock(path, refusal)
        yield
    finally:
        with signals_wait():
            if handle >= 0:
                try:
                    # Somebody may have moved the whole folder away, with the lock in it.
                    with suppress(OSError):
                        if _is_file(path, handle):
                            path.unlink()
                finally:
                    os.close(handle)


def _lock(path: Path, refusal: InputError) -> int:
    """Return the handle of the file, locked and still of this name."""
    while True:
        handle = _open(path)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Between the two its last owner may have ended, and removed it.
            if _is_file(path, handle):
                return handle
        except BlockingIOError:
            os.close(handle)
            raise refusal from None
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _open(path: Path) -> int:
    """Return the handle of an empty regular file, which is made if there is none."""
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        handle = os.open(path, flags, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
            raise _strange(path) from None
        raise InputError(
            "lock file", str(path), f"cannot be written: {error.strerror}", "choose another output with -o"
        ) from None
    found = os.fstat(handle)
    if not stat.S_ISREG(found.st_mode) or found.st_size:
        os.close(handle)
        raise _strange(path)
    return handle


def _strange(path: Path) -> InputError:
    """Return the refusal of what is not a lock."""
    rule = "a lock of wamnet is an empty file, and this is something else"
    return InputError("lock file", str(path), rule, "move it elsewhere, or choose another output with -o")


def _is_file(path: Path, handle: int) -> bool:
    """Tell whether an open file still has this name."""
    try:
        found = path.lstat()
    except FileNotFoundError:
        return False
    mine = os.fstat(handle)
    return (found.st_dev, found.st_ino) == (mine.st_dev, mine.st_ino)
