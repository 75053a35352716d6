"""Programs of others: a folder for each, what they print, and that they end with whoever started them.

A process that is killed by SIGKILL can end nobody. The system closes what it held open: a shell beside the
program waits for that, and ends the program and all that it has started [`running`].
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from wamnet.kernels.folders import discard, new_temporary

WATCH = ("/bin/sh", "-c", 'read -r line; kill -s KILL -- "-$0"')
"""What ends a group of processes, whose number follows, at the end of its own input."""

LATE_S = 0.2
"""Seconds in which the last words of a program that has ended are read."""


@contextmanager
def temporary(name: str, programs: bool = False) -> Iterator[Path]:
    """Yield a new folder, and remove it when the block ends; `programs`: what is built there has to run."""
    folder, lock = new_temporary(name, programs)
    try:
        yield folder
    finally:
        discard(folder, lock)


@contextmanager
def running(command: Sequence[str], **options: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program in a session of its own; with the block, or this process, all of its group ends."""
    process = subprocess.Popen(command, start_new_session=True, **options)
    quiet, watch = subprocess.DEVNULL, None
    try:
        watch = subprocess.Popen(
            [*WATCH, str(process.pid)],
            stdin=subprocess.PIPE,
            stdout=quiet,
            stderr=quiet,
            start_new_session=True,
            cwd="/",
        )
        yield process
    finally:
        # The group's number is its own as long as its first process has not been waited for.
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        if watch is not None:
            watch.kill()
            watch.communicate()


def printed(process: subprocess.Popen[bytes], most: int, limit_s: float) -> bytes:
    """Return the end of what a program prints until it ends; TimeoutExpired if that takes too long.

    What it has started may print on, and is not waited for.
    """
    tail = bytearray()
    assert process.stdout is not None
    stream = process.stdout

    def read() -> None:
        with stream:
            while part := os.read(stream.fileno(), 1 << 16):
                tail.extend(part)
                del tail[:-most]

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    process.wait(limit_s)
    thread.join(LATE_S)
    return bytes(tail)
