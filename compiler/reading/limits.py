"""A check within limits: a source may make its reader work for ever, or fill the memory."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..proof.evidence import Refused
from .lanes import Unread

SECONDS = 60
"""Most seconds of computing time: FFT kernels of the bundled networks take 15 on a busy core."""

BYTES = 2**30
"""Most memory, in addition to what the process has."""


def limited(check: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a check, in a separate process; raises `Unread` if it exceeds its limits.

    Where there is no fork, as on Windows, there are none.
    """
    if "fork" not in multiprocessing.get_all_start_methods():
        return check(*arguments)
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(there, check, arguments))
    process.start()
    there.close()
    try:
        answer = here.recv()
    except EOFError:
        rule = f"a source that takes more than {SECONDS} s of computing time, or {BYTES >> 20} MB"
        answer = Unread(rule)
    process.join()
    if isinstance(answer, Exception):
        raise answer
    return answer


def _answer(to: Any, check: Callable[..., Any], arguments: Any) -> None:
    """Send what a function returns, or why it rejects."""
    import resource

    with suppress(OSError):  # where the system does not report what the process has, that is not limited
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + BYTES
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, resource.getrlimit(resource.RLIMIT_CPU)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    try:
        answer: Any = check(*arguments)
    except (Refused, Unread) as error:
        answer = error
    except MemoryError:
        return
    to.send(answer)
