"""Grade a student's folder, or a class of them.

1. A lab is graded beside a new process that runs the student's code [`grade`, student.py]. Its checks run
   here, and only what they find counts.
2. A process that ends before the last check is the finding of the check that was running, and of those after
   it [`_stopped`].
3. A class is a folder of folders, one a student; labs are graded side by side, in processes that grade one
   after another [`grade_class`, worker.py]. One that ends is replaced, and costs its lab only.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector

from wamnet.refimpl.errors import InputError, shown

from .frame import Ended, Wrong, of_exception, outcome
from .judged import load
from .labs import LABS, Lab
from .sandbox import LIMITS, Limits
from .student import deadline, sources, started

LOADING = "loading the file"
"""The finding's name before the first check."""

STARTING = "starting a process"
"""The finding's name before that, when nothing of the student's has been executed."""

LONGEST_END_S = 60
"""Wall-clock time beyond that of a lab after which the process that grades it is replaced."""


@dataclass(frozen=True)
class Result:
    """What came of a lab: for each check None or what is wrong."""

    lab: Lab
    checks: tuple[tuple[str, Wrong | None], ...]

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


def grade(
    lab: Lab, folder: Path, limits: Limits = LIMITS, *, trusted: bool = False, shows: bool = False
) -> Result:
    """Grade a lab in a student's folder; `shows`: what the code prints is shown.

    `trusted`: without the sandbox, in the folder itself.
    """
    with started(folder, limits, trusted, shows) as (student, process):
        found: dict[str, Wrong | None] = {}
        running = STARTING
        try:
            files = sources(folder)
            if lab.file not in files:
                rule = "it is in another folder, which is named after the lab; or not a plain file below 1 MB"
                raise Wrong("", LOADING, lab.file, "no such file", rule)
            with deadline(limits.longest_wait_s):
                student.request(os.getpid)
                running = LOADING
                student.request(load, lab.file, {} if trusted else files)
                for check in lab.checks:
                    running = check.name
                    found[running] = outcome(check, student)
            cause = None
        except Ended as error:
            cause = _stopped(running, _status(process), limits, str(error))
        except Exception as error:  # noqa: BLE001
            cause = of_exception(error, LOADING)
    return result_of(lab, found, running, cause)


def result_of(lab: Lab, found: dict[str, Wrong | None], running: str, cause: Wrong | None) -> Result:
    """Return the result of a lab of which some checks have been made, and why there are no others."""
    missing = Wrong("", "this check", "an answer", "none", "what stopped the process before it")
    first = cause if running in (STARTING, LOADING) else missing
    return Result(
        lab,
        tuple((c.name, found.get(c.name, cause if c.name == running else first)) for c in lab.checks),
    )


def _status(process: subprocess.Popen[bytes]) -> int | None:
    """Return how a process has ended, the number of a signal below 0, or None where it runs."""
    try:
        status = process.wait(1)
    except subprocess.TimeoutExpired:
        return None
    # Bubblewrap ends like a shell where a signal has ended the process in it.
    return 128 - status if status > 128 else status


def _stopped(running: str, status: int | None, limits: Limits, reason: str) -> Wrong:
    """Return why a process has not answered."""
    if running == STARTING:
        return Wrong("", running, "a process", f"none, status {status}", "the machine: grade this one again")
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        loop = "a loop that does not end: look at its condition"
        return Wrong("", running, f"an end within {limits.seconds} s of computing", "none", loop)
    if reason:
        return Wrong("", running, "an answer", reason, "it sleeps, waits, or writes to the grader's pipe")
    if status is None or status >= 0:
        found = "none" if status is None else f"the process ended with status {status}"
        return Wrong("", running, "an answer", found, "os._exit, or exit in a thread: return a value")
    names = {number.value: number.name for number in signal.Signals}
    found = f"an end by signal {names.get(-status, -status)}"
    return Wrong("", running, "an answer", found, "a crash in a library's C code")


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


def files_of(folder: Path, labs: Sequence[Lab]) -> list[tuple[Path, Lab]]:
    """Return each student of a class with each lab of which there is a file."""
    return [
        (path, lab)
        for path in students_of(folder)
        for lab in labs
        # Unlike Path.is_file, it takes a folder without rights for an empty one.
        if os.access(path / lab.file, os.F_OK)
    ]


class Grader:
    """A process that grades lab after lab [worker.py]; a new one is started when it is needed."""

    process: subprocess.Popen[str] | None = None

    def begin(self, lab: Lab, folder: Path, limits: Limits, trusted: bool) -> int:
        """Begin with a lab; return the file number to wait for."""
        if self.process is None:
            command = [sys.executable, "-m", "wamnet_course.worker"]
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.lab, self.late = lab, time.monotonic() + limits.longest_wait_s + LONGEST_END_S
        with suppress(BrokenPipeError):
            print(json.dumps([lab.name, str(folder), limits, trusted]), file=self.process.stdin, flush=True)
        return self.process.stdout.fileno()

    def result(self) -> Result:
        """Return what it has found, or why there is nothing."""
        assert self.process is not None
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if line.endswith("\n"):
            rows = json.loads(line)
            return Result(self.lab, tuple((name, Wrong(*row) if row else None) for name, row in rows))
        self.close()
        wrong = Wrong("", LOADING, "a grade", "the process that grades has ended", "grade this one by itself")
        return result_of(self.lab, {}, LOADING, wrong)

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None


def grade_class(
    folder: Path,
    labs: Sequence[Lab] = LABS,
    limits: Limits = LIMITS,
    workers: int = 2,
    on_progress: Callable[[int], None] = lambda count: None,
    *,
    trusted: bool = False,
) -> list[Student]:
    """Grade all students of a folder, `workers` labs at a time."""
    students = students_of(folder)
    jobs = files_of(folder, labs)
    results: dict[tuple[Path, Lab], Result] = {}
    waiting = iter(jobs)
    with ExitStack() as stack, DefaultSelector() as selector:
        idle = [stack.enter_context(closing(Grader())) for _ in range(workers)]
        while len(results) < len(jobs):
            for job in islice(waiting, len(idle)):
                grader = idle.pop()
                number = grader.begin(job[1], job[0], limits, trusted)
                selector.register(number, EVENT_READ, (grader, job))
            ready = selector.select(1.0)
            for key in list(selector.get_map().values()):
                if key.data[0].late < time.monotonic():
                    key.data[0].process.kill()
            for key, _ in ready:
                grader, job = key.data
                selector.unregister(key.fileobj)
                results[job] = grader.result()
                idle.append(grader)
                on_progress(1)
    return [
        Student(shown(path.name), tuple(results[path, lab] for lab in labs if (path, lab) in results))
        for path in students
    ]
