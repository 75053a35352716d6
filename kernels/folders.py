"""Folders of the machine: caches that nobody else writes, and temporary folders that disappear completely.

1. What is in a cache may become code of this user's processes: a folder that others own or may write is not
   used, nor one in such a folder [`is_private`]. Without a home there is no cache [`cache_base`]. Drivers and
   packages do not check theirs: they get a temporary folder where these are not private [`protect_caches`].
2. A temporary folder is removed with all that is in it, however deep [`discard`], [`remove`]. One for
   programs is on a file system that runs them [`runs_programs`].
3. A process that is killed leaves its temporary folders behind, and the next one removes them: a folder is
   locked as long as its process lives [`new_temporary`].
"""

from __future__ import annotations

import atexit
import fcntl
import logging
import os
import re
import stat
import subprocess
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

from ..refimpl.errors import ExecutorUnavailable, shown

CACHES = ("", "pocl", "pocl/kcache", "pytools", "mesa_shader_cache")
"""Folders in the user's caches whose content is run: kernels of PoCL and Mesa, pickles of pyopencl."""

CACHE_VARIABLES = ("POCL_CACHE_DIR", "MESA_SHADER_CACHE_DIR")
"""Environment variables that name other folders for these."""

TEMPORARY = re.compile(r"wamnet-[a-z]+\.[0-9a-z_]{8}")
"""Names of temporary folders that are locked."""

NEW_S = 2.0
"""Seconds after which a folder without a lock is one that was left behind, not one that was just made."""

_log = logging.getLogger("wamnet")


@cache  # one line, however often the folder is looked at
def _unused(path: Path, reason: str) -> None:
    """Say that a cache is not used."""
    _log.warning("cache %s is not used: %s", shown(str(path)), reason)


def cache_base() -> Path | None:
    """Return the folder of this user's caches, which need not exist yet, or None where there is no home."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    # The specification of the variable: a path that is not absolute is to be ignored.
    if base.is_absolute():
        return base
    with suppress(RuntimeError):  # neither HOME nor an entry of this user in the system's list
        return Path("~/.cache").expanduser()
    return None


def is_private(folder: Path) -> bool:
    """Tell whether nobody else may write a folder, or replace it; one that is not there yet is private."""
    for path, allowed in ((folder, 0), (folder.parent, stat.S_ISVTX)):
        try:
            status = path.stat()
        except FileNotFoundError:
            continue
        except OSError as error:
            _unused(path, str(error.strerror))
            return False
        writable = status.st_mode & 0o022 and not status.st_mode & allowed
        if status.st_uid not in (os.geteuid(), 0) or writable:
            _unused(path, "others own it or may write it; its mode must be 700 and its owner you")
            return False
    return True


def protect_caches() -> None:
    """Give drivers of this process a temporary folder for caches if the user's cannot be used.

    That is where there is none, where others may write it, or where it is read-only or runs no programs.
    """
    for variable in CACHE_VARIABLES:
        if variable in os.environ and not _safe(Path(os.environ[variable])):
            del os.environ[variable]
    base = cache_base()
    if base is None or not all(_safe(base / name) for name in CACHES):
        folder, lock = new_temporary("caches", programs=True)
        os.environ["XDG_CACHE_HOME"] = str(folder)
        atexit.register(discard, folder, lock)


def _safe(folder: Path) -> bool:
    """Tell whether programs can be kept in a folder that nobody else writes."""
    return is_private(folder) and runs_programs(folder)


def runs_programs(folder: Path) -> bool:
    """Tell whether a program can be made in a folder and run: its file system may be mounted noexec."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK | os.X_OK) and not os.statvfs(folder).f_flag & os.ST_NOEXEC


def new_temporary(name: str, programs: bool = False) -> tuple[Path, int]:
    """Return a new folder that nobody else may enter, and its lock; the caller gives both to [`discard`]."""
    first = Path(tempfile.gettempdir())
    others = [Path("/var/tmp"), Path("/tmp"), Path("/dev/shm"), *filter(None, [cache_base()])]
    where = next((each for each in [first, *others] if not programs or runs_programs(each)), None)
    if where is None or not where.is_dir():
        rule = "neither it nor another folder for temporary files runs programs (mounted noexec)"
        raise ExecutorUnavailable(f"TMPDIR is {first}: {rule}; set it to a folder on another file system")
    for left in where.iterdir():
        if TEMPORARY.fullmatch(left.name):
            _remove_left(left)
    folder = Path(tempfile.mkdtemp(prefix=f"wamnet-{name}.", dir=where))
    lock = _opened(folder)
    fcntl.flock(lock, fcntl.LOCK_EX)
    return folder, lock


def discard(folder: Path, lock: int) -> None:
    """Remove a temporary folder, unless somebody else did, and give up its lock."""
    remove(folder)
    os.close(lock)


def _remove_left(folder: Path) -> None:
    """Remove a temporary folder of this user whose process has ended."""
    with suppress(OSError):
        status = folder.lstat()
        if status.st_uid != os.geteuid() or time.time() - status.st_mtime < NEW_S:
            return
        lock = _opened(folder)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            remove(folder)
        finally:
            os.close(lock)


def remove(folder: Path) -> None:
    """Remove a folder and what is in it, however deep; no link is followed."""
    for program in (("chmod", "-R", "u+rwx"), ("rm", "-rf")):
        subprocess.run([*program, "--", str(folder)], check=False, capture_output=True)


def _opened(folder: Path) -> int:
    """Return a folder, opened; a link to one is an error."""
    return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
