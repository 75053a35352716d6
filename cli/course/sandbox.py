"""What a student's code may use while it is graded: time, memory, and files of its own folder.

1. The operating system limits computing time, memory and the size of a file [`limit`], `resource.setrlimit`.
2. A hook of Python refuses what leaves the folder: other files, processes, signals, the network [`confine`].
   A hook cannot be removed. It stops mistakes; it does not stop somebody who means harm, because code in
   C that Python loads does not ask it. Grade untrusted code in a container or a virtual machine.
3. Each refusal is an exception that `except Exception` does not catch [`Forbidden`], and is noted as well.
"""

from __future__ import annotations

import os
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

MEGABYTE = 1 << 20
"""Bytes."""


class Limits(NamedTuple):
    """Computing time of a lab in seconds; memory, and one file, in megabytes; files that may be opened."""

    seconds: int = 60
    memory_mb: int = 1024
    file_mb: int = 1
    files: int = 100

    @property
    def longest_wait_s(self) -> int:
        """Return the wall-clock time after which a lab is ended that computes nothing: it sleeps or waits."""
        return 3 * self.seconds + 30


LIMITS = Limits()
"""What suits all labs."""


class Forbidden(BaseException):
    """What a student's code may not do while it is graded."""


WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
"""Flags of `open` that change a file."""

PATHS = {
    "os.remove": ("deletes", 1),
    "os.rmdir": ("deletes", 1),
    "os.rename": ("renames", 2),
    "os.mkdir": ("makes", 1),
    "os.truncate": ("empties", 1),
    "os.link": ("links", 2),
    "os.symlink": ("links", 2),
    "os.chmod": ("changes the rights of", 1),
    "os.chown": ("changes the owner of", 1),
    "os.utime": ("changes the times of", 1),
    "shutil.rmtree": ("deletes", 1),
    "os.chdir": ("leaves for", 1),
}
"""Events of Python on files: the verb, and how many of its arguments are paths."""

NEVER = {
    "os.system": "starts a program",
    "os.exec": "starts a program",
    "os.posix_spawn": "starts a program",
    "os.spawn": "starts a program",
    "os.fork": "starts a process",
    "os.forkpty": "starts a process",
    "subprocess.Popen": "starts a program",
    "os.kill": "sends a signal",
    "os.killpg": "sends a signal",
    "signal.pthread_kill": "sends a signal",
    "resource.setrlimit": "changes its limits",
    "socket.connect": "uses the network",
    "socket.bind": "uses the network",
    "socket.sendto": "uses the network",
    "socket.getaddrinfo": "uses the network",
    "urllib.Request": "uses the network",
}
"""Events that are refused whatever their arguments are."""


def limit(limits: Limits) -> None:
    """Limit this process from now on: seconds and memory count in addition to what it has used by now."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime) + 1 + limits.seconds
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    memory = pages * resource.getpagesize() + limits.memory_mb * MEGABYTE
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    size = limits.file_mb * MEGABYTE
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


class Confinement:
    """A hook for `sys.addaudithook` that refuses what is outside of a folder, and tells `note` about it."""

    def __init__(self, folder: Path, limits: Limits, note: Callable[[str], None]) -> None:
        self.own, self.limits, self.note, self.opened = os.path.realpath(folder), limits, note, 0

    def __call__(self, event: str, given: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = given
            if isinstance(flags, int) and flags & WRITING and path is not None:
                self._write(path)
        elif event in PATHS:
            verb, count = PATHS[event]
            for path in given[:count]:
                if not self._inside(path):
                    self._refuse(f"{verb} {os.fsdecode(path)}")
        elif event in NEVER:
            self._refuse(NEVER[event])

    def _inside(self, path: Any) -> bool:
        if isinstance(path, int):
            return True
        where = os.path.realpath(os.fsdecode(path))
        return where == self.own or where.startswith(self.own + os.sep) or where == os.devnull

    def _write(self, path: Any) -> None:
        self.opened += not isinstance(path, int)
        if not self._inside(path):
            self._refuse(f"writes {os.fsdecode(path)}")
        if self.opened > self.limits.files:
            self._refuse(f"writes more than {self.limits.files} files")

    def _refuse(self, told: str) -> None:
        self.note(told)
        raise Forbidden(f"it {told}")


def confine(folder: Path, limits: Limits, note: Callable[[str], None]) -> None:
    """Refuse from now on what is outside of a folder, and tell `note` about it."""
    sys.addaudithook(Confinement(folder, limits, note))
