"""A process that plants bugs in a copy of the project, one at a time, and runs tests on each in a fork.

    python experiments/lab/kill_server.py TREE

1. What tests import from other packages is imported once; the project's modules are imported by each fork,
   from the copy [`serve`].
2. A request is one line of JSON: the file, its text, names of tests, and the CPU seconds of the fork. The
   answer is one line too [`Answer`]. The file is restored afterwards.
3. A fork prints the sources of small kernels [lab/emitted.py] and compares them with those of the copy as it
   is, then runs the tests in their order. It stops at the first that fails on a device or in the source
   checker; failures of other tests are noted.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

IMPORTED = (
    "numpy", "scipy.stats", "hypothesis", "hypothesis.extra.numpy", "pytest", "PIL.Image", "pyopencl",
    "moderngl", "OpenEXR", "typer", "rich", "jsonschema", "mpmath", "matplotlib",
)  # fmt: skip
"""Packages that tests import."""

MEMORY_BYTES = 12 << 30
"""Address space of a fork."""

WAIT_S = 900.0
"""Longest time of a fork by the clock: the limit of a request is in seconds of the processor."""

DECISIVE = ("reader", "device")
"""Tiers whose failure ends a run."""


def serve(tree: Path) -> None:
    """Answer requests until there are no more."""
    os.chdir(tree)
    _here(tree)
    for name in IMPORTED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    before = tree.parent / "emitted.json"
    if not before.exists():
        _fork(lambda: before.write_text(json.dumps(_emitted(""))), 600)
    for line in sys.stdin:
        request = json.loads(line)
        path = tree / request["file"]
        kept, notes = path.read_text(encoding="utf-8"), tree.parent / "notes.jsonl"
        notes.unlink(missing_ok=True)
        path.write_text(request["text"], encoding="utf-8")
        began = time.monotonic()
        try:
            ended = _fork(lambda r=request, n=notes: _tried(tree, r, n), request["limit_s"])
        finally:
            path.write_text(kept, encoding="utf-8")
        rows = [json.loads(row) for row in notes.read_text().splitlines()] if notes.exists() else []
        answer = {"ended": ended, "seconds": round(time.monotonic() - began, 1), "notes": rows}
        print(json.dumps(answer), flush=True)


def _here(tree: Path) -> None:
    """Import the project from the copy, in this process and in those that it starts."""
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    for name, module in sys.modules.items():
        if name.startswith("__editable___wamnet"):
            for package, path in module.MAPPING.items():
                module.MAPPING[package] = str(tree / Path(path).name)
    sys.path.insert(0, str(tree / "experiments"))


def _fork(task: Callable[[], Any], limit_s: float) -> str:
    """Run a task in a separate process group; return how it ended: done, late, or a signal."""
    child = os.fork()
    if not child:
        status = 1
        try:
            os.setpgid(0, 0)
            quiet = os.open(os.devnull, os.O_RDWR)
            log = os.open("../fork.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(quiet, 0)
            os.dup2(log, 1)
            os.dup2(log, 2)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
            resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(limit_s)))
            task()
            status = 0
        except BaseException:  # noqa: BLE001 - whatever it is, the parent must not return here
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(status)
    deadline = time.monotonic() + WAIT_S
    ended = "late"
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            ended = "done" if os.WIFEXITED(status) else f"signal {os.WTERMSIG(status)}"
            break
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    if ended == "late":
        os.waitpid(child, 0)
    return ended


# ---- a fork -----------------------------------------------------------------------------------------------


def _emitted(file: str) -> dict[str, str]:
    """Return the sources of small kernels that a file may change."""
    return dict(importlib.import_module("lab.emitted").sources(file))


def _tried(tree: Path, request: Mapping[str, Any], notes: Path) -> None:
    """Compare the sources, and run the tests."""
    with notes.open("a", encoding="utf-8", buffering=1) as file:

        def note(**facts: Any) -> None:
            file.write(json.dumps(facts) + "\n")

        before = json.loads((tree.parent / "emitted.json").read_text())
        try:
            note(**difference(before, _emitted(request["file"])))
        except Exception as error:  # noqa: BLE001 - an emitter may fail in any manner
            note(changed=-1, first="", old="", new=f"{type(error).__name__}: {error}"[:160])
        if request["tests"]:  # without names pytest would run all tests
            _run(request["tests"], note)


def difference(before: Mapping[str, str], after: Mapping[str, str]) -> dict[str, Any]:
    """Return how many sources differ, the first of them, and its first line that does, before and after."""
    differ = [name for name in after if before.get(name) != after[name]]
    if not differ:
        return {"changed": 0, "first": "", "old": "", "new": ""}
    old, new = (text.splitlines() for text in (before.get(differ[0], ""), after[differ[0]]))
    at = next((i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new)))
    lines = [rows[at].strip()[:160] if at < len(rows) else "" for rows in (old, new)]
    return {"changed": len(differ), "first": differ[0], "old": lines[0], "new": lines[1]}


def _run(tests: Sequence[Sequence[str]], note: Callable[..., None]) -> None:
    """Run tests (name, tier) in their order, until one of a decisive tier fails."""
    import pytest

    from lab.reach import here

    tiers: dict[str, str] = dict(map(tuple, tests))

    class Stop:
        """Notes what starts and what fails."""

        @pytest.hookimpl(tryfirst=True)
        def pytest_collection_modifyitems(self, session: Any, items: list[Any]) -> None:
            here(items)
            order = {name: at for at, name in enumerate(tiers)}
            items.sort(key=lambda item: order.get(item.nodeid, len(order)))
            self.session = session

        def pytest_collectreport(self, report: Any) -> None:
            if report.failed:
                note(test=report.nodeid, tier="import", failed=True)

        def pytest_runtest_logstart(self, nodeid: str) -> None:
            note(test=nodeid, tier=tiers.get(nodeid, ""), failed=False)

        def pytest_runtest_logreport(self, report: Any) -> None:
            if report.failed:
                tier = tiers.get(report.nodeid, "")
                note(test=report.nodeid, tier=tier, failed=True)
                if tier in DECISIVE:
                    self.session.shouldstop = "detected"

    options = ["-n0", "-q", "--tb=no", "-p", "no:cacheprovider", "--continue-on-collection-errors"]
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main([*options, *tiers], plugins=[Stop()])


if __name__ == "__main__":
    serve(Path(sys.argv[1]).resolve())
