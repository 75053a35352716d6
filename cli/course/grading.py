"""Grade a student's folder, or a class of them, each lab in a process with limits.

1. A lab's folder is copied: Python files only, so that nothing that the code does reaches the original
   [`copied`]. The worker runs in a folder of its own that goes afterwards [`grade`].
2. Its records are read when it has ended, by itself or by a limit; a check that has begun and not ended is
   where it was stopped, and how it ended says why [`_stopped`]. Checks after it are not reached.
3. A class is a folder of folders, one a student; labs run side by side [`grade_class`].
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from ...refimpl.errors import InputError
from .frame import Wrong
from .labs import LABS, Lab
from .sandbox import LIMITS, MEGABYTE, Limits
from .worker import LOADING

LARGEST_FILE = MEGABYTE
"""Bytes of the largest Python file that is copied: a lab has some kilobytes."""

MOST_FILES = 100
"""Python files of a student that are copied."""


@dataclass(frozen=True)
class Result:
    """What came of a lab: for each check None or what is wrong, and what else was seen of the process."""

    lab: Lab
    checks: tuple[tuple[str, Wrong | None], ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> int:
        """Return the number of checks that passed."""
        return sum(wrong is None for _, wrong in self.checks)

    @property
    def right(self) -> bool:
        """Return whether all checks passed."""
        return self.passed == len(self.checks)

    @property
    def first(self) -> Wrong | None:
        """Return the first finding."""
        return next((wrong for _, wrong in self.checks if wrong is not None), None)


def copied(source: Path, target: Path) -> None:
    """Copy a student's Python files (plain ones, not links) to a new folder."""
    target.mkdir()
    found = [path for path in sorted(source.glob("*.py")) if path.is_file() and not path.is_symlink()]
    for path in found[:MOST_FILES]:
        if path.stat().st_size <= LARGEST_FILE:
            shutil.copyfile(path, target / path.name)


def grade(lab: Lab, folder: Path, limits: Limits = LIMITS, shows: bool = False) -> Result:
    """Grade a lab in a student's folder; `shows`: what the code prints is shown."""
    with tempfile.TemporaryDirectory(prefix="wamnet-course-", ignore_cleanup_errors=True) as made:
        place = Path(made)
        copied(folder, place / "work")
        before = {path.name for path in (place / "work").iterdir()}
        records, said = place / "records", place / "said"
        command = [sys.executable, "-m", "wamnet.cli.course.worker", lab.name, str(place / "work")]
        with said.open("wb") as printed:
            output = None if shows else printed
            with _process([*command, str(records), *map(str, limits)], place, output) as process:
                try:
                    status = process.wait(limits.longest_wait_s)
                except subprocess.TimeoutExpired:
                    status = None
        after = {path.name for path in (place / "work").iterdir()} if (place / "work").is_dir() else set()
        lines = records.read_text(encoding="utf-8", errors="replace") if records.is_file() else ""
        notes = [f"it wrote {name}" for name in sorted(after - before) if name != "__pycache__"]
        notes += [f"it deleted {name}" for name in sorted(before - after)]
        tail = said.read_bytes()[-400:].decode(errors="replace")
        return _read(lab, lines, status, limits, notes, tail)


@contextmanager
def _process(command: Sequence[str], place: Path, output: IO[bytes] | None) -> Iterator[Any]:
    """Run the worker in a session of its own; whatever ends the block ends the worker and its children."""
    quiet = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "PYTHONDONTWRITEBYTECODE"), "1")
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH", "VIRTUAL_ENV") if name in os.environ}
    process = subprocess.Popen(
        command,
        cwd=place,
        env={**kept, **quiet, "HOME": str(place / "work"), "TMPDIR": str(place / "work")},
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT if output else None,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _read(lab: Lab, lines: str, status: int | None, limits: Limits, notes: list[str], tail: str) -> Result:
    """Return what the worker's records say, and what is missing in them."""
    found: dict[str, Wrong | None] = {}
    begun, ended = "", False
    for line in lines.splitlines():
        try:
            record = json.loads(line)
        except ValueError:
            continue
        begun, ended = record.get("begun", begun), ended or "end" in record
        if "check" in record:
            found[record["check"]] = Wrong(*record["wrong"]) if record["wrong"] else None
        if "refused" in record:
            notes.insert(0, f"it {record['refused']}: refused")
    names = [check.name for check in lab.checks]
    if not ended:
        found[begun or LOADING] = _stopped(begun or LOADING, status, limits, tail)
    elif LOADING not in found:
        return Result(lab, tuple((name, found[name]) for name in names), tuple(dict.fromkeys(notes)))
    cause = found.get(LOADING) or found.get(begun)
    missing = Wrong("", "this check", "an answer", "none", "what stopped the process before it")
    checks = [(name, found.get(name, cause if LOADING in found else missing)) for name in names]
    return Result(lab, tuple(checks), tuple(dict.fromkeys(notes)))


def _stopped(begun: str, status: int | None, limits: Limits, tail: str) -> Wrong:
    """Return why a process has ended before its last record."""
    loop = "a loop that does not end: look at its condition"
    if status == -signal.SIGXCPU or (status == -signal.SIGKILL and begun):
        return Wrong("", begun, f"an end within {limits.seconds} s of computing", "none", loop)
    if status is None:
        return Wrong(
            "", begun, f"an end within {limits.longest_wait_s} s", "none", "it sleeps, or waits for input"
        )
    if status < 0:
        name = signal.Signals(-status).name
        return Wrong("", begun, "an answer", f"an end by signal {name}", "a crash in a library's C code")
    if "MemoryError" in tail:
        return Wrong("", begun, f"at most {limits.memory_mb} MB of memory", "more", "an array that grows")
    found = f"the process ended with status {status}"
    return Wrong("", begun, "an answer", found, "os._exit, or exit in a thread: return a value")


@dataclass(frozen=True)
class Student:
    """A student: the folder's name, and the results of the labs that are there."""

    name: str
    results: tuple[Result, ...]

    def of(self, lab: Lab) -> Result | None:
        """Return the result of a lab, or None where its file is missing."""
        return next((result for result in self.results if result.lab == lab), None)

    @property
    def complete(self) -> int:
        """Return how many labs are right."""
        return sum(result.right for result in self.results)


def students_of(folder: Path) -> list[Path]:
    """Return the folders of a class, one a student; InputError for a folder without any."""
    if not folder.is_dir():
        raise InputError("folder of students", str(folder), "it is no folder", "give a folder of folders")
    found = [
        path
        for path in sorted(folder.iterdir())
        if path.is_dir() and not path.is_symlink() and not path.name.startswith(".")
    ]
    if not found:
        rule = "it holds no folders"
        raise InputError("folder of students", str(folder), rule, "put one folder a student in it")
    return found


def grade_class(
    folder: Path,
    labs: Sequence[Lab] = LABS,
    limits: Limits = LIMITS,
    workers: int = 2,
    on_progress: Callable[[int], None] = lambda count: None,
) -> list[Student]:
    """Grade all students of a folder, `workers` labs at a time."""
    found = students_of(folder)
    jobs = [(path, lab) for path in found for lab in labs if (path / lab.file).is_file()]

    def run(job: tuple[Path, Lab]) -> Result:
        result = grade(job[1], job[0], limits)
        on_progress(1)
        return result

    with ThreadPoolExecutor(max(1, workers)) as pool:
        results = list(pool.map(run, jobs))
    return [
        Student(path.name, tuple(r for (whose, _), r in zip(jobs, results, strict=True) if whose == path))
        for path in found
    ]
