"""Files of tests that load what no process gives back, as PyTorch, run in a process of their own.

1. Such a file has the marker `apart`. All workers read all files: what is large is imported by its tests, or
   through [`packages.Late`], not when the file is read.
2. A worker that comes to one starts another pytest, says test by test what is to be run, and gets reports
   [`Other`]; with the file the process ends, and its memory goes [`pytest_runtest_protocol`].
3. What executors and packages it had, and its peak, are in the summary like the worker's own.
"""

import json
import socket
import subprocess
import sys
import tempfile
from types import SimpleNamespace
from typing import IO, Any

import pytest
from packages import FOUND

LAST_WORDS = 4_000
"""Characters of what a process said that a report shows if it ends too early: the last ones."""

PEAKS: dict[str, int] = {}
"""The most memory that each of these processes took, in MB, by the file's name."""

_others: dict[str, "Other"] = {}
"""The process of this worker that runs a file, by the file's name; one at most."""

_asked: dict[str, IO[str]] = {}
"""In a process that runs a file: where it is asked, and answers."""


class Other:
    """A pytest in another process that runs tests of one file."""

    def __init__(self, item: pytest.Item) -> None:
        self.file, self.config = item.location[0], item.config
        ours, theirs = socket.socketpair()
        self.said = tempfile.TemporaryFile()  # noqa: SIM115 - it is open as long as the process runs
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--apart={theirs.fileno()}"]
        command += ["--nightly"] if item.config.getoption("nightly", False) else []
        self.process = subprocess.Popen(
            [*command, str(item.path)],
            cwd=item.config.rootpath,
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=self.said,
            stderr=subprocess.STDOUT,
        )
        theirs.close()
        self.socket, self.stream = ours, ours.makefile("rw")

    def run(self, item: pytest.Item, following: str | None) -> list[pytest.TestReport]:
        """Return the reports of a test; `following` is the next one of this file."""
        found = []
        try:
            print(json.dumps([item.nodeid, following]), file=self.stream, flush=True)
            while data := json.loads(self.stream.readline()):
                hook = self.config.hook.pytest_report_from_serializable
                report = hook(config=self.config, data=data)
                # Where and why a test was skipped is a tuple, which JSON does not have.
                if isinstance(report.longrepr, list):
                    report.longrepr = tuple(report.longrepr)
                found.append(report)
        except (OSError, ValueError):  # no line: it has ended
            self.process.wait()
            self.said.seek(0)
            text = self.said.read().decode(errors="replace")[-LAST_WORDS:]
            text = f"the process apart ended with status {self.process.returncode}:\n{text}"
            outcome: Any = "failed"
            found.append(pytest.TestReport(item.nodeid, item.location, {}, outcome, text, "call"))
            _others.pop(self.file).end()
        return found

    def end(self) -> None:
        """Let the process end, and take over what it has found."""
        try:
            self.socket.shutdown(socket.SHUT_WR)
            told = json.loads(self.stream.readline())
        except (OSError, ValueError):  # it has ended before
            told = {"executors": {}, "peak": 0}
        FOUND.update(told["executors"])
        PEAKS[self.file] = max(told["peak"], PEAKS.get(self.file, 0))
        self.process.wait()
        for held in (self.stream, self.socket, self.said):
            held.close()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--apart", type=int, help="descriptor by which another pytest says what to run")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "apart: the file runs in a process of its own, for what it loads")
    if (descriptor := config.getoption("apart")) is not None:
        with socket.socket(fileno=descriptor) as told:
            _asked["stream"] = told.makefile("rw")
        config.workeroutput = {}  # type: ignore[attr-defined]


# ---- a worker -------------------------------------------------------------------------------------------


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Have a marked test run by the process of its file; a quick run starts none."""
    if _asked or not _marked(item) or item.get_closest_marker("skip") or item.config.getoption("quick"):
        return None
    file, same = item.location[0], nextitem is not None and nextitem.path == item.path and _marked(nextitem)
    if file not in _others:
        _others[file] = Other(item)
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for report in _others[file].run(item, nextitem.nodeid if same and nextitem else None):
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    # What the test before it has left for this one, such as its folder, may not be for the next.
    item.session._setupstate.teardown_exact(nextitem)
    if not same and file in _others:
        _others.pop(file).end()
    return True


def _marked(item: pytest.Item) -> bool:
    return item.get_closest_marker("apart") is not None


# ---- the process of a file ------------------------------------------------------------------------------


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run the requested tests until there are no more."""
    if not _asked:
        return None
    items = {item.nodeid: item for item in session.items}
    for line in _asked["stream"]:
        name, following = json.loads(line)
        nextitem = items.get(following)
        session.config.hook.pytest_runtest_protocol(item=items[name], nextitem=nextitem)
        _answer(None)
    return True


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Hand a report on."""
    if _asked:
        _answer(_config.config.hook.pytest_report_to_serializable(config=_config.config, report=report))


_config = SimpleNamespace(config=None)
"""The configuration of this process, which a report does not have."""


def pytest_sessionstart(session: pytest.Session) -> None:
    _config.config = session.config


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Say what was found."""
    if _asked:
        _answer(session.config.workeroutput)  # type: ignore[attr-defined]


def _answer(data: Any) -> None:
    """Write a line, unless nobody reads it any more."""
    try:
        print(json.dumps(data), file=_asked["stream"], flush=True)
    except OSError:
        return
