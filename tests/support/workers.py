"""Processes that run tests stay small: what one file of tests has built is let go, and peaks are reported.

1. After each file executors drop their kernels, of which they keep dozens [`let_go`]: each of OpenGL's
   software renderer takes megabytes. What is freed goes back to the system; the C library keeps it.
2. The summary says how much memory each process took at most [`pytest_terminal_summary`].
"""

from __future__ import annotations

import ctypes
import resource
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Any

import pytest

_peaks: dict[str, int] = {}
"""The most memory that each process took, in MB, by its name."""


@pytest.fixture(scope="session")
def opened_executors() -> Iterator[dict[str, Any]]:
    """Give the executors and peers that were opened, by name; None for those that are missing."""
    found: dict[str, Any] = {}
    yield found
    for executor in found.values():
        if isinstance(executor, AbstractContextManager):
            executor.__exit__(None, None, None)


@pytest.fixture(scope="module", autouse=True)
def let_go(opened_executors: dict[str, Any]) -> Iterator[None]:
    """Drop what a file's tests have built on executors, and give freed memory back."""
    yield
    for executor in opened_executors.values():
        if hasattr(executor, "forget"):
            executor.forget()
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError):  # another C library, or another system
        return
    trim(0)


def _peak() -> int:
    """Return the most memory that this process took, in MB of 1024 * 1024 bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand a worker's peak to the process that writes the summary."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["peak"] = _peak()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Collect what one worker took; one that crashed has nothing to tell."""
    if "peak" in getattr(node, "workeroutput", {}):
        _peaks[node.gateway.id] = node.workeroutput["peak"]


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say how much memory each process took at most."""
    terminalreporter.section("memory at most")
    for name, peak in sorted((_peaks or {"this process": _peak()}).items()):
        terminalreporter.write_line(f"{name}: {peak} MB")
