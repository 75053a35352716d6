"""The graders' frame: who is graded, by which vectors, and the verdict.

1. `student` is the module that is graded: exercise.py beside the grader, or NAME.py in the folder that
   `--solutions` names, NAME being the exercise's folder.
2. `hold_to_vectors` asks it the cases of one kind of the spec's vectors, and fails with the first that is
   wrong, as `wamnet conformance` tells it.
3. At the end there is a line for each exercise [`pytest_terminal_summary`].
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from wamnet.spec.conformance.case import given, load
from wamnet.spec.conformance.numbers import to_json
from wamnet.spec.conformance.run import judge

VECTORS = Path(__file__).resolve().parents[2] / "spec/vectors"
"""The spec's vectors."""

Answer = Callable[[Mapping[str, Any]], Mapping[str, Any]]
"""From a case's inputs, as arrays, to its outputs by name."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Take the folder of answers."""
    parser.addoption("--solutions", metavar="FOLDER", help="grade FOLDER/ex1_sphere.py and so on")


@pytest.fixture
def student(request: pytest.FixtureRequest) -> ModuleType:
    """Give the module that is graded."""
    folder = request.path.parent
    chosen = request.config.getoption("--solutions")
    path = Path(chosen) / f"{folder.name}.py" if chosen else folder / "exercise.py"
    if not path.is_file():
        pytest.fail(f"there is no {path}", pytrace=False)
    spec = importlib.util.spec_from_file_location(f"graded_{folder.name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def hold_to_vectors() -> Callable[..., None]:
    """Give a function that asks all cases of a kind; `only` are the outputs that count."""

    def hold(kind: str, answer: Answer, only: tuple[str, ...] = ()) -> None:
        for case in load(VECTORS / f"{kind}.json")[1]:
            if only and case.expected is not None:
                case = replace(case, expected={name: case.expected[name] for name in only})
            inputs = {name: given(value) for name, value in case.inputs.items()}
            try:
                found = {name: to_json(_plain(value)) for name, value in answer(inputs).items()}
                verdict = judge(kind, case, {"output": found})
            except ValueError as error:
                verdict = judge(kind, case, {"refused": str(error)})
            if verdict.failed:
                place = (
                    f", {verdict.stage}: {verdict.expected} expected, {verdict.got} found"
                    if verdict.stage
                    else ""
                )
                note = f" ({case.note})" if case.note else ""
                pytest.fail(f"{case.id}{note}, clause {case.clause}: {verdict.text}{place}", pytrace=False)

    return hold


def _plain(value: Any) -> Any:
    """Return a value as an array, or as a number where it is one."""
    array = np.asarray(value)
    return array if array.ndim else array[()]


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say of each exercise how far it is."""
    outcomes: dict[str, list[tuple[bool, str]]] = {}
    for state in ("passed", "failed", "error"):
        for report in terminalreporter.stats.get(state, ()):
            if getattr(report, "when", "call") == "call" or state != "passed":
                name = Path(report.nodeid.partition("::")[0]).parent.name
                outcomes.setdefault(name, []).append((state == "passed", _reason(report)))
    terminalreporter.section("verdicts")
    for name in sorted(outcomes, key=lambda name: (len(name.partition("_")[0]), name)):
        found = outcomes[name]
        right = sum(passed for passed, _ in found)
        reasons = [reason for passed, reason in found if not passed]
        verdict = "passed" if not reasons else f"not yet; {reasons[0]}"
        terminalreporter.write_line(f"{name}: {right} of {len(found)} checks, {verdict}")


def _reason(report: Any) -> str:
    """Return why a check failed, in a line."""
    crash = getattr(report.longrepr, "reprcrash", None)
    text = crash.message if crash else str(report.longrepr or "")
    line = next((line for line in text.splitlines() if line.strip()), "")
    return line.removeprefix("AssertionError: ").removeprefix("Failed: ").removesuffix(".")
