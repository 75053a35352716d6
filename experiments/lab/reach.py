"""Which lines of the emitters each test reaches, and its CPU time: a plug-in of pytest.

1. Caches of functions are emptied before each test, so that a test does not owe its kernels to an earlier
   one [`Reach.pytest_runtest_protocol`].
2. What a fixture reaches counts for every test that uses it, and what a file reaches when it is imported for
   every test of the file.
3. A test belongs to one tier [`tier`]: it compares a text with a golden file, runs a kernel, reads a kernel's
   source, or only compiles. A test that fails or is skipped is left out.
4. One line of JSON per test is appended to a file; a test that has a line is not run again.
"""

from __future__ import annotations

import functools
import gc
import json
import os
import sys
import threading
from collections.abc import Generator, Iterable, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import pytest

EMITTERS = ("compiler/schedules/", "compiler/languages/", "compiler/scenes/", "compiler/training/")
"""Folders whose lines are traced."""

READER = "compiler/reading/"
"""Folder of the source checker."""

DEVICES = ("kernels/devices/", "kernels/export/")
"""Folders of what runs kernels."""

RUNNERS = ("_runner.py", "/gl_runner.py", "/executor_", "/devices/")
"""Parts of the paths of modules that run kernels."""

TIERS = ("golden", "compile", "reader", "device")
"""Tiers of tests: compare a text with a file, only compile, read a source, run a kernel."""

SIMULATED = "tests/compiler/test_indices"
"""Beginning of the files whose tests compute all indices of a kernel from its source."""

GOLDEN = ("golden", "tests/kernels/export/test_shelf.py")
"""The fixture, and the file, that compare texts with files in git."""

MOST_CASES = 4
"""Most cases of one test: every so many of a larger number."""

Lines = set[tuple[str, int]]
"""Paths from the root, and lines."""


class Traced(NamedTuple):
    """A test that passes: its CPU seconds, tier, and the lines that it reaches, by path."""

    name: str
    seconds: float
    tier: str
    lines: Mapping[str, Sequence[int]]
    classes: Sequence[str]

    @property
    def file(self) -> str:
        """Return the test's file."""
        return self.name.partition("::")[0]

    @property
    def function(self) -> str:
        """Return the test without its case."""
        return self.name.partition("[")[0]


def read(path: Path) -> list[Traced]:
    """Return the tests in a file."""
    if not path.exists():
        return []
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return [Traced(*row) for row in rows if row[2]]


def tier(fixtures: Iterable[str], file: str, modules: Iterable[str]) -> str:
    """Return the tier of a test that uses fixtures and reaches modules."""
    if GOLDEN[0] in fixtures or file == GOLDEN[1]:
        return "golden"
    if any(name.startswith(DEVICES) and any(part in name for part in RUNNERS) for name in modules):
        return "device"
    read = file.startswith(SIMULATED) or any(name.startswith(READER) for name in modules)
    return "reader" if read else "compile"


class Reach:
    """The plug-in: it traces tests and appends a line for each to a file."""

    def __init__(self, root: Path, path: Path) -> None:
        self.root, self.path = f"{root}/", path
        self.done = (
            {json.loads(line)[0] for line in path.read_text().splitlines()} if path.exists() else set()
        )
        self.names: dict[str, str] = {}
        self.lines: Lines = set()
        self.modules: set[str] = set()
        self.of_fixture: dict[int, tuple[Lines, set[str]]] = {}
        self.of_file: dict[str, tuple[Lines, set[str]]] = {}
        self.outcomes: dict[str, bool] = {}
        self.kinds: dict[type, set[str]] = {}

    # ---- tracing ----------------------------------------------------------------------------------------

    def call(self, frame: FrameType, event: str, argument: Any) -> Any:
        """Be the trace function of calls: lines are traced in the emitters only."""
        name = self.names.get(frame.f_code.co_filename)
        if name is None:
            path = frame.f_code.co_filename
            kept = path.startswith(self.root) and path[len(self.root) :].startswith(
                (*EMITTERS, READER, *DEVICES)
            )
            name = self.names[path] = path[len(self.root) :] if kept else ""
        if not name:
            return None
        self.modules.add(name)
        if not name.startswith(EMITTERS):
            return None
        kind = type(frame.f_locals.get("self"))
        if kind not in self.kinds:
            self.kinds[kind] = {
                place for each in kind.__mro__ if (place := placed(each)).startswith(EMITTERS)
            }
        self.modules |= self.kinds[kind]
        return self.line

    def line(self, frame: FrameType, event: str, argument: Any) -> Any:
        """Be the trace function of lines."""
        self.lines.add((self.names[frame.f_code.co_filename], frame.f_lineno))
        return self.line

    def _since(self, before: tuple[Lines, set[str]]) -> tuple[Lines, set[str]]:
        """Return what was reached, and resume with what was reached before."""
        result = self.lines, self.modules
        self.lines, self.modules = before[0] | result[0], before[1] | result[1]
        return result

    # ---- hooks ------------------------------------------------------------------------------------------

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self, collector: pytest.Collector) -> Generator[None, Any, Any]:
        """Keep what the import of a file reaches."""
        self._on()
        self.lines, self.modules = set(), set()
        report = yield
        if isinstance(collector, pytest.Module):
            self.of_file[collector.nodeid] = self.lines, self.modules
        return report

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out what has a line, and most cases of a large test."""
        here(items)
        cases: dict[str, list[pytest.Item]] = {}
        for item in items:
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
        kept = [item for some in cases.values() for item in some[:: -(-len(some) // MOST_CASES)]]
        items[:] = [item for item in kept if item.nodeid not in self.done]

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, Any, Any]:
        """Keep what a fixture reaches."""
        before, self.lines, self.modules = (self.lines, self.modules), set(), set()
        try:
            return (yield)
        finally:
            self.of_fixture[id(fixturedef)] = self._since(before)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Trace a test, and append its line."""
        forget()
        self._on()
        self.lines, self.modules = set(), set()
        began = _cpu_s()
        result = yield
        seconds = _cpu_s() - began
        passed = self.outcomes.get(item.nodeid, False)
        parts = [self.of_fixture.get(id(each)) for each in _fixtures(item)]
        parts += [self.of_file.get(item.nodeid.partition("::")[0]), (self.lines, self.modules)]
        lines = set().union(*(part[0] for part in parts if part))
        modules = set().union(*(part[1] for part in parts if part))
        by_path: dict[str, list[int]] = {}
        for path, number in sorted(lines):
            by_path.setdefault(path, []).append(number)
        where = (
            tier(getattr(item, "fixturenames", ()), item.nodeid.partition("::")[0], modules) if passed else ""
        )
        with self.path.open("a", encoding="utf-8") as file:
            classes = sorted(name for name in modules if ":" in name)
            file.write(json.dumps([item.nodeid, round(seconds, 3), where, by_path, classes]) + "\n")
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Remember whether a test has passed."""
        if report.when == "call" or report.outcome != "passed":
            self.outcomes[report.nodeid] = report.passed and self.outcomes.get(report.nodeid, True)

    def _on(self) -> None:
        """Trace this thread and those that start from now on."""
        threading.settrace(self.call)
        sys.settrace(self.call)


def here(items: Iterable[pytest.Item]) -> None:
    """Let tests of files that have a process of their own run in this one."""
    for item in items:
        for node in item.listchain():
            node.own_markers[:] = [marker for marker in node.own_markers if marker.name != "apart"]


def placed(kind: type) -> str:
    """Return where a class is: `compiler/languages/c.py:C`; what is not of the package is elsewhere."""
    module = kind.__module__.removeprefix("wamnet.").replace(".", "/")
    return f"{module}.py:{kind.__qualname__}"


def _cpu_s() -> float:
    """Return the CPU seconds of this process and of those that it has waited for."""
    return sum(os.times()[:4])


def _fixtures(item: pytest.Item) -> list[Any]:
    """Return the definitions of the fixtures that a test names."""
    info = getattr(item, "_fixtureinfo", None)
    return [each for some in info.name2fixturedefs.values() for each in some] if info else []


def forget() -> None:
    """Empty the caches of functions of the package and of tests."""
    for some in _caches():
        some.cache_clear()


@functools.cache
def _caches() -> list[Any]:
    """Return these caches, once all files are imported."""
    kinds = (some for some in gc.get_objects() if isinstance(some, functools._lru_cache_wrapper))
    ours = ("wamnet.", "tests.", "kit", "texts", "worked", "rough", "test_")
    return [some for some in kinds if (some.__module__ or "").startswith(ours)]


FILES = (
    *(f"tests/compiler/{name}.py" for name in (
        "test_text", "test_schedules", "test_whole", "test_text_groups", "test_text_spectra",
        "test_text_words", "test_text_together", "test_text_frames", "test_indices", "test_indices_paths")),
    *(f"tests/kernels/{name}.py" for name in (
        "test_schedules", "test_c", "test_whole", "test_executors", "export/test_runners", "export/test_tint",
        "test_exact", "test_smoothing", "test_trainer", "test_follow_on", "test_paths", "test_factored")),
    "tests/compiler", "tests/kernels",
)  # fmt: skip
"""Files whose tests are traced, those that detect most first, and then the folders with all others."""

WITHOUT = ("tests/kernels/verify", "tests/kernels/blender", "tests/kernels/bench")
"""Folders whose tests are about other programs."""


def trace(folder: Path) -> None:
    """Trace the tests that have no line in the folder's file."""
    root = Path(__file__).resolve().parents[2]
    ignored = [f"--ignore={path}" for path in WITHOUT]
    options = ["-n0", "-q", "-p", "no:cacheprovider", "--rootdir", str(root)]
    pytest.main([*options, *ignored, *FILES], plugins=[Reach(root, folder / "reach.jsonl")])
