"""Make a record in git of what an experiment has found, and write the texts that show it again.

    python experiments/publish.py out/quality/quality.json
    python experiments/publish.py speed/bench.json --name bench-minicubes --command 'wamnet bench ...'
    python experiments/publish.py --run bench-train wamnet bench train

1. A file of results, of `wamnet bench` or of `wamnet demo` (report.json) is checked and becomes
   experiments/records/<name>.json [`lab/records.py`]. Its name is the experiment's, or `--name`.
2. `--run NAME COMMAND...` runs a program of experiments/, or `wamnet`, that prints Markdown tables;
   their rows are the records [`lab/printed.py`]. It must end with status 0.
3. `--picture FILE` adds a picture of frames, made smaller, to docs/images and its digest to the record.
"""

import argparse
import hashlib
import json
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lab import printed
from lab.command import begin, described
from lab.records import BENCH, DEMO, FOLDER, ROOT, checked, of_bench, of_demo
from lab.results import PACKAGES, SCHEMA, Results, written

from wamnet.cli.files.outputs import replacing, write_text
from wamnet.cli.reports import machine
from wamnet.refimpl.errors import NO_VALUE, InputError

LARGEST_BYTES = 400_000
"""The largest record: one that is larger holds what nobody shows."""

PICTURE_PX = 1200
"""The largest width of a picture in git."""

PICTURE_QUALITY = 88
"""Quality of JPEG, at which noise keeps its look."""

IMAGES = "docs/images"
"""The folder of the pictures."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Make a record."""
    parser = described(__doc__)
    parser.add_argument("file", type=Path, nargs="?", help="results of an experiment, or bench.json")
    parser.add_argument("--name", help="the record's name")
    parser.add_argument("--command", help="what made the file, where it does not say so")
    parser.add_argument("--partial", action="store_true", help="configurations may lack seeds")
    parser.add_argument("--picture", type=Path, nargs="+", default=[], help="pictures of frames")
    parser.add_argument("--run", nargs=argparse.REMAINDER, help="NAME COMMAND...: keep what a command prints")
    options = parser.parse_args(arguments)
    if bool(options.run) == bool(options.file):
        rule = "one of them is needed"
        raise InputError("FILE or --run NAME COMMAND", NO_VALUE, rule, "see --help")
    if options.run:
        name, data = options.run[0], ran(options.run[0], options.run[1:])
    else:
        data = opened(options.file, options.command)
        name = options.name or data["experiment"]
    made = checked(data, options.partial)
    if options.picture:
        made["pictures"] = dict(map(shrunk, options.picture))
    text = written(made)
    if len(text) > LARGEST_BYTES:
        rule = f"a record has at most {LARGEST_BYTES:,}"
        raise InputError(f"record {name}", f"{len(text):,} bytes", rule, "keep only what is shown")
    write_text(FOLDER / f"{name}.json", text)
    print(
        f"experiments/records/{name}.json: {len(made['records'])} records; now python experiments/rewrite.py"
    )


def opened(path: Path, command: str | None) -> dict[str, Any]:
    """Return the results of a file, with the command if it names none."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            "file", str(path), f"cannot be read: {type(error).__name__}", "name another"
        ) from None
    if isinstance(data, dict) and data.get("schema") == BENCH:
        return of_bench(data, command or "")
    if isinstance(data, dict) and data.get("schema") == DEMO:
        return of_demo(data)
    found = Results.read(path).data()
    return {**found, "commands": [command]} if command else found


def ran(name: str, command: Sequence[str]) -> dict[str, Any]:
    """Run a program of the project, show what it prints, and return the rows of its tables."""
    program = list(command)
    allowed = len(program) > 1 and program[0] == "python" and program[1].startswith("experiments/")
    if not allowed and program[:1] != ["wamnet"]:
        rule = "must be python experiments/... or wamnet ..."
        raise InputError("command", shlex.join(program), rule, "correct it")
    here = Path(sys.executable)
    program[0] = str(here if program[0] == "python" else here.with_name("wamnet"))
    with subprocess.Popen(program, cwd=ROOT, stdout=subprocess.PIPE, text=True) as running:
        lines = []
        for text in running.stdout or ():
            sys.stdout.write(text)
            lines.append(text)
    if running.returncode:
        rule = "must end with status 0"
        raise InputError(f"command for {name}", f"status {running.returncode}", rule, "see what it says")
    rows = printed.records_of("".join(lines))
    head = {"schema": SCHEMA, "experiment": name, "commands": [shlex.join(command)], "settings": {}}
    return {**head, "machine": machine.describe(), "versions": machine.versions(PACKAGES), "records": rows}


def shrunk(path: Path) -> tuple[str, str]:
    """Write a picture as a small JPEG under docs/images; return its path and digest."""
    from PIL import Image

    target = ROOT / IMAGES / f"{path.resolve().parent.name}-{path.stem}.jpg"
    with Image.open(path) as image:
        small = image.convert("RGB")
        small.thumbnail((PICTURE_PX, 4 * PICTURE_PX))
        with replacing(target) as new:
            small.save(new, "JPEG", quality=PICTURE_QUALITY, optimize=True)
    return target.relative_to(ROOT).as_posix(), hashlib.sha256(target.read_bytes()).hexdigest()


if __name__ == "__main__":
    begin(main)
