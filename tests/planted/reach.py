"""Which planted faults a test reaches, in its own process and in the programs that it starts.

1. Each Python of a copied project imports this module when it starts [plant.py: `copied`]. With PLANT_WATCH
   it traces calls, and the lines of functions that hold a fault [`_trace`].
2. As a plugin of pytest it notes the test that runs, its outcome and its seconds. Programs inherit the test's
   name; a pytest that a test starts has no tests of its own, unless it runs a file apart.
3. With PLANT_TESTS only the tests of that file run, in its order.
4. Rows go to PLANT_OUT at once, as JSON: (test, fault, "hit"), (test, time, "started"), (test, seconds,
   outcome).

PYTEST_DONT_REWRITE: it is imported before pytest.
"""

import atexit
import json
import os
import sys
import threading
import time
from types import CodeType, FrameType
from typing import Any

_OPTIMIZED = 1
"""Flag of the code of functions; modules and classes run when they are imported."""

_Watched = tuple[()] | tuple[frozenset[str], dict[int, frozenset[str]], frozenset[str]]
"""What a call of a function reaches, what its lines reach, and all of the latter; or nothing."""

_watch: dict[str, Any] = {"root": "", "files": {}}
_codes: dict[int, _Watched] = {}
_held: list[CodeType] = []
_seen: set[str] = set()
_seconds: dict[str, float] = {}
_failed: dict[str, str] = {}
_test = os.environ.get("PLANT_TEST", "")
_active = True


def _put(*row: Any) -> None:
    """Write a row; short writes at the end of a file do not mix with those of other processes."""
    handle = os.open(os.environ["PLANT_OUT"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(handle, (json.dumps([_test, *row]) + "\n").encode())
    os.close(handle)


def _watched(code: CodeType) -> _Watched:
    """Return what a function reaches; code that is held keeps its id."""
    _held.append(code)
    root, path = _watch["root"], code.co_filename
    if not path.startswith(root) or not code.co_flags & _OPTIMIZED:
        return ()
    name = path[len(root) :]
    lines, marks = _watch["files"].get(name, ({}, ()))
    own = {n: frozenset(lines[str(n)]) for *_, n in code.co_lines() if str(n) in lines}
    folders = {name.rpartition("/")[0] + "/"} & {*_watch["folders"]}
    return frozenset({*marks, *folders}), own, frozenset().union(*own.values())


def _hit(faults: frozenset[str]) -> None:
    for fault in faults - _seen:
        _seen.add(fault)
        _put(fault, "hit")


def _trace(frame: FrameType, event: str, argument: Any) -> Any:
    """Note a call; follow the lines of a function while it holds faults that are not reached yet."""
    found = _codes.get(id(frame.f_code))
    if found is None:
        found = _codes[id(frame.f_code)] = _watched(frame.f_code)
    if not found:
        return None
    if not found[0] <= _seen:
        _hit(found[0])
    return None if found[2] <= _seen else _line


def _line(frame: FrameType, event: str, argument: Any) -> Any:
    faults = _codes[id(frame.f_code)][1].get(frame.f_lineno)  # type: ignore[misc]
    if event == "line" and faults:
        _hit(faults)
    return _line


if os.environ.get("PLANT_WATCH"):
    with open(os.environ["PLANT_WATCH"], encoding="utf-8") as _file:  # noqa: PTH123 - pathlib imports much
        _watch.update(json.load(_file))
    threading.settrace(_trace)
    sys.settrace(_trace)
    atexit.register(sys.settrace, None)


def pytest_configure(config: Any) -> None:
    global _active  # noqa: PLW0603 - hooks share the state of their process
    nested = _test and config.getoption("apart", None) is None
    _active = "PLANT_OUT" in os.environ and not nested and not config.getoption("numprocesses", None)


def pytest_collection_modifyitems(items: list[Any]) -> None:
    if _active and "PLANT_TESTS" in os.environ:
        with open(os.environ["PLANT_TESTS"], encoding="utf-8") as file:  # noqa: PTH123
            order = {name: at for at, name in enumerate(json.load(file))}
        items[:] = sorted((i for i in items if i.nodeid in order), key=lambda item: order[item.nodeid])


def pytest_runtest_logstart(nodeid: str) -> None:
    global _test  # noqa: PLW0603
    if _active:
        _test = os.environ["PLANT_TEST"] = nodeid
        _seen.clear()
        _put(time.time(), "started")
        if _watch["root"]:
            sys.settrace(_trace)  # a test that exhausts the stack ends it


def pytest_runtest_logreport(report: Any) -> None:
    _seconds[report.nodeid] = _seconds.get(report.nodeid, 0.0) + report.duration
    if report.outcome != "passed":
        _failed.setdefault(report.nodeid, report.outcome)


def pytest_runtest_logfinish(nodeid: str) -> None:
    global _test  # noqa: PLW0603
    if _active:
        _put(round(_seconds.get(nodeid, 0.0), 3), _failed.get(nodeid, "passed"))
        _test = ""
        os.environ.pop("PLANT_TEST", None)
