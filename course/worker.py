"""Grade the labs of a class one after another: `python -m wamnet_course.worker`.

Each line of the standard input is a lab, and each line of the standard output its result, as JSON; modules
are imported once. The process ends with the command that started it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from .grading import grade
from .labs import lab_named
from .sandbox import Limits, die_with_parent, limit_memory


def main() -> None:
    """Grade until there are no more lines."""
    die_with_parent()
    limit_memory()
    for line in sys.stdin:
        name, folder, limits, trusted = json.loads(line)
        result = grade(lab_named(name), Path(folder), Limits(*limits), trusted=trusted)
        rows = [(check, wrong and wrong.args) for check, wrong in result.checks]
        print(json.dumps(rows), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
