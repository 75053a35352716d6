"""Grade one lab in a process of its own: `python -m wamnet.cli.course.worker LAB FOLDER RECORDS LIMITS...`.

1. Import the grader, then limit and confine the process [sandbox.py], then load the student's file [`load`].
2. Write a record, a line of JSON, when a check begins and when it ends, and one at the end [`main`]: what is
   missing at the end says where the process was stopped.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from .frame import Wrong, of_exception, outcome
from .labs import Lab, lab_named
from .sandbox import Limits, confine, limit

LOADING = "loading the file"
"""What the first record is about."""


def load(lab: Lab, folder: Path) -> ModuleType | Wrong:
    """Return the student's module of a lab, or what is wrong with it; it may import what is beside it."""
    path = folder / lab.file
    if not path.is_file():
        return Wrong("", LOADING, lab.file, "no such file", "another name, or another folder")
    spec = importlib.util.spec_from_file_location(f"graded_{lab.name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Last, so that a file named numpy.py does not hide NumPy; it stays, for imports within functions.
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    try:
        spec.loader.exec_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001
        return of_exception(error, LOADING, str(path))
    return module


def graded(lab: Lab, folder: Path, tell: Callable[[dict[str, Any]], None]) -> None:
    """Load and check a lab; report what begins, and what each check finds."""
    tell({"begun": LOADING})
    module = load(lab, folder)
    if isinstance(module, Wrong):
        tell({"check": LOADING, "wrong": module.args})
        return
    for check in lab.checks:
        tell({"begun": check.name})
        wrong = outcome(check, module)
        tell({"check": check.name, "wrong": wrong.args if wrong else None})


def main(arguments: list[str]) -> None:
    """Grade a lab, and write records."""
    word, folder, records, *numbers = arguments
    lab, work = lab_named(word), Path(folder)
    _ = lab.checks
    with Path(records).open("w", encoding="utf-8") as file:

        def tell(record: dict[str, Any]) -> None:
            file.write(json.dumps(record) + "\n")
            file.flush()

        limits = Limits(*map(int, numbers))
        os.chdir(work)
        sys.dont_write_bytecode = True
        limit(limits)
        confine(work, limits, lambda told: tell({"refused": told}))
        graded(lab, work, tell)
        tell({"end": True})
    # What the student's code leaves behind, threads or output that cannot be written, is not waited for.
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1:])
