"""The sandbox of a student's code: Bubblewrap, and limits that the process sets for itself.

1. Bubblewrap gives the process namespaces of its own, no network, a file system that holds Python and this
   package read-only, and an empty folder in memory [`bubblewrap`, `unavailable`].
2. The process limits its computing time, memory, and the size and number of open files, and gives up the
   system calls that make processes, programs and sockets, or hold memory elsewhere [`confine`].
3. It ends when its parent ends [`die_with_parent`].
4. The process that grades limits its own memory: what it computes with an answer has the answer's size,
   broadcast with other arrays [`limit_memory`].
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import platform
import resource
import signal
import struct
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

MEGABYTE = 1 << 20
"""Bytes."""

BASE_MB = 256
"""Address space of Python, NumPy and this package, in megabytes: about 160 are used."""

GRADER_MB = 1024
"""Memory that grading may take, in megabytes, beyond that of Python and its packages: about 100 are used."""

FOLDER = "/tmp"
"""The working folder inside Bubblewrap: in memory, and gone with the process."""

FOLDER_MB = 16
"""Its size."""


class Limits(NamedTuple):
    """Computing time of a lab in seconds; memory, and one file, in megabytes; files that may be open."""

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


def bubblewrap() -> list[str]:
    """Return the command that runs another one in a sandbox."""
    names = ("wamnet", "wamnet.cli", "wamnet.compiler", "wamnet.kernels", "wamnet.models", "wamnet.refimpl")
    parts = (importlib.util.find_spec(name) for name in (*names, "wamnet_course"))
    packages = [place for part in parts if part for place in part.submodule_search_locations or ()]
    folders = ["/usr", "/etc/alternatives", "/etc/ld.so.cache", sys.base_prefix, sys.prefix]
    folders.append(str(Path(sys.executable).resolve().parents[1]))
    folders += [str(Path(np.__file__).parents[1]), *packages]
    command = ["bwrap", "--unshare-all", "--unshare-user", "--die-with-parent", "--new-session"]
    command += ["--cap-drop", "ALL", "--size", str(FOLDER_MB * MEGABYTE), "--tmpfs", FOLDER]
    for folder in ("/lib", "/lib64"):
        command += ["--symlink", f"usr{folder}", folder] if Path(folder).is_symlink() else []
        folders += [folder] if not Path(folder).is_symlink() else []
    # Shorter paths first: what is bound later lies on top.
    for folder in sorted(set(folders)):
        command += ["--ro-bind-try", folder, folder]
    return [*command, "--dev-bind", os.devnull, os.devnull, "--remount-ro", "/", "--chdir", "/"]


def limit_memory() -> None:
    """Let this process take GRADER_MB more than it has; those that it starts may raise the limit."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    most = pages * resource.getpagesize() + GRADER_MB * MEGABYTE
    resource.setrlimit(resource.RLIMIT_AS, (most if hard < 0 else min(most, hard), hard))


def unavailable() -> str:
    """Return why there is no sandbox on this machine, or ""."""
    try:
        done = subprocess.run(
            [*bubblewrap(), sys.executable, "-c", "import numpy"],
            capture_output=True, text=True, errors="replace", check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except OSError as error:
        return f"bwrap: {error.strerror}"
    return "" if done.returncode == 0 else ([*done.stderr.splitlines(), "no message"])[0]


# ---- inside ------------------------------------------------------------------------------------------------

_SET_DEATH_SIGNAL, _SET_SECCOMP, _NO_NEW_PRIVILEGES = 1, 22, 38
"""Of prctl(2)."""

_DENIED = (
    *("fork", "vfork", "execve", "execveat", "socket", "socketpair", "ptrace", "unshare", "setns", "mount"),
    *("umount2", "pivot_root", "keyctl", "add_key", "request_key", "bpf", "perf_event_open", "userfaultfd"),
    *("io_uring_setup", "memfd_create", "shmget", "msgget", "mq_open"),
)
"""System calls that a lab never needs: processes, programs, sockets, memory outside of the address
space, and parts of the kernel with a history of defects."""

_SYSTEMS = {
    "x86_64": (
        0xC000003E, 56,
        (57, 58, 59, 322, 41, 53, 101, 272, 308, 165, 166, 155, 250, 248, 249, 321, 298, 323, 425, 319, 29,
         68, 240),
    ),
    "aarch64": (
        0xC00000B7, 220,
        (221, 281, 198, 199, 117, 97, 268, 40, 39, 41, 219, 217, 218, 280, 241, 282, 425, 279, 194, 186, 180),
    ),
}  # fmt: skip
"""By machine: its number for seccomp(2), that of clone, those of _DENIED (aarch64 has no fork and vfork)."""

_CLONE3, _CLONE_THREAD, _X32 = 435, 0x10000, 0x40000000
"""clone3, which is everywhere the same; the flag of a new thread; numbers of x86_64's other interface."""

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
"""Operations of a filter: load a word of the call, jump by comparing it, return."""

_ALLOW, _NOT_PERMITTED, _NO_SUCH_CALL = 0x7FFF0000, 0x50001, 0x50026
"""What a filter returns: continue, EPERM, ENOSYS, on which the C library takes clone in place of clone3."""


def _filter(architecture: int, clone: int, denied: tuple[int, ...]) -> bytes:
    """Return a filter of seccomp(2): instructions of (operation, jump if true, jump if false, operand)."""
    rows = [(_LOAD, 0, 0, 4), (_EQUAL, 1, 0, architecture), (_RETURN, 0, 0, _NOT_PERMITTED), (_LOAD, 0, 0, 0)]
    for number in denied:
        rows += [(_EQUAL, 0, 1, number), (_RETURN, 0, 0, _NOT_PERMITTED)]
    rows += [(_AT_LEAST, 0, 1, _X32), (_RETURN, 0, 0, _NOT_PERMITTED)]
    rows += [(_EQUAL, 0, 1, _CLONE3), (_RETURN, 0, 0, _NO_SUCH_CALL)]
    rows += [(_EQUAL, 0, 3, clone), (_LOAD, 0, 0, 16), (_ANY_BIT, 1, 0, _CLONE_THREAD)]
    rows += [(_RETURN, 0, 0, _NOT_PERMITTED), (_RETURN, 0, 0, _ALLOW)]
    return b"".join(struct.pack("HBBI", *row) for row in rows)


def die_with_parent() -> None:
    """Let the kernel kill this process when the thread that started it ends."""
    ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)


def confine(limits: Limits) -> None:
    """Limit this process from now on; seconds count in addition to what it has used by now."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime) + 1 + limits.seconds
    memory, size = (BASE_MB + limits.memory_mb) * MEGABYTE, limits.file_mb * MEGABYTE
    for kind, value, most in (
        (resource.RLIMIT_CPU, seconds, seconds + 1),
        (resource.RLIMIT_AS, memory, memory),
        (resource.RLIMIT_FSIZE, size, size),
        (resource.RLIMIT_NOFILE, limits.files, limits.files),
        (resource.RLIMIT_CORE, 0, 0),
    ):
        resource.setrlimit(kind, (value, most))
    if platform.machine() in _SYSTEMS:
        code = _filter(*_SYSTEMS[platform.machine()])
        buffer = ctypes.create_string_buffer(code, len(code))
        program = struct.pack("HxxxxxxQ", len(code) // 8, ctypes.addressof(buffer))
        libc = ctypes.CDLL(None, use_errno=True)
        libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
        if libc.prctl(_SET_SECCOMP, 2, program, 0, 0):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
