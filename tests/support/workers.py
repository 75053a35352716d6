"""Processes that run tests stay small: what one file of tests has built is let go, and peaks are reported.

1. After each file, and after a test with which a process has grown by much, executors drop their kernels, of
   which they keep dozens [`let_go`]: each of OpenGL's software renderer takes megabytes. What is freed goes
   back to the system; the C library keeps it.
2. Files that load what no process gives back run in one of their own [apart.py].
3. Garbage is not looked for among the thousands of tests: not while they are collected, nor later.
4. The summary says how much memory each process took at most [`pytest_terminal_summary`].
"""

import ctypes
import gc
import re
import resource
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest
from apart import PEAKS


def pytest_configure() -> None:
    gc.disable()


def pytest_collection_finish() -> None:
    gc.enable()
    gc.freeze()
    gc.set_threshold(20_000, 20)  # compilers make many small things that live


GROWTH_MB = 100
"""Growth since kernels were dropped after which they are dropped again, in MB."""

_peaks: dict[str, int] = {}
"""The most memory that each process took, in MB, by its name."""

_least: list[int] = []
"""Memory after kernels were dropped the last time, in MB."""


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
    drop(opened_executors)


@pytest.fixture(autouse=True)
def let_go_of_much(opened_executors: dict[str, Any]) -> Iterator[None]:
    """Do so too where the tests of one file have built much."""
    yield
    if not _least:
        _least.append(now())
    if now() > _least[-1] + GROWTH_MB:
        drop(opened_executors)


def drop(executors: dict[str, Any]) -> None:
    """Drop the kernels of executors, and give freed memory back."""
    for executor in executors.values():
        if hasattr(executor, "forget"):
            executor.forget()
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError):  # another C library, or another system
        return
    trim(0)
    _least[:] = [now()]


def now() -> int:
    """Return the memory that this process takes, in MB; 0 where the system does not say it."""
    path = Path("/proc/self/statm")
    return int(path.read_text().split()[1]) * resource.getpagesize() >> 20 if path.exists() else 0


def _peak() -> int:
    """Return the most memory that this process took, in MB of 1024 * 1024 bytes.

    `getrusage` counts what the process that started this one took then.
    """
    path = Path("/proc/self/status")
    if path.exists() and (found := re.search(r"VmHWM:\s+(\d+)", path.read_text())):
        return int(found[1]) // 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand a worker's peak to the process that writes the summary."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput |= {"peak": _peak(), "apart": PEAKS}


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Collect what one worker took; one that crashed has nothing to tell."""
    if "peak" in getattr(node, "workeroutput", {}):
        _peaks[node.gateway.id] = node.workeroutput["peak"]
        for file, peak in node.workeroutput["apart"].items():
            PEAKS[file] = max(peak, PEAKS.get(file, 0))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say how much memory each process took at most."""
    terminalreporter.section("memory at most")
    for name, peak in sorted({**(_peaks or {"this process": _peak()}), **PEAKS}.items()):
        terminalreporter.write_line(f"{name}: {peak} MB")
