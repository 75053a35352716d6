"""Command lines: other values of every option, and commands that want a process of their own.

1. A line runs in a child [forks.py], in a folder that has all good files [`Good`], a pipe, a folder, a link.
2. What has not ended after BEGUN_S has been accepted, and works: it gets Ctrl-C, and must end in 130.
3. The status must be 0, 1, 2 or 130; 2 comes with one error in one line, and nothing shows a traceback or
   control characters. What the child has started must end with it.
"""

import json
import os
import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from forks import Wrong, in_child
from targets import CommandRefused, Good, Target

BEGUN_S = 1.5
"""Seconds after which a command has looked at all its options, and gets Ctrl-C."""

LINES: Sequence[str] = Path(__file__).with_name("lines.txt").read_text(encoding="utf-8").splitlines()
"""A line of each command, with all its options."""

APART: Sequence[tuple[str, str, str, str]] = json.loads(
    Path(__file__).with_name("apart.json").read_text(encoding="utf-8")
)
"""Name, way to change, the good file that is changed, and the command, in a folder of good files."""


def lines(good: Good) -> list[Target]:
    """Return the commands' options, each command a target, and files that are read by commands apart."""
    names = dict.fromkeys(line.split()[0] for line in LINES)
    targets = [
        Target(
            f"options, {name}",
            "words",
            [_listed(line) for line in LINES if line.split()[0] == name],
            use,
            0.3,
        )
        for name in names
        for use in [partial(_options, good)]
    ]
    return targets + [
        Target(f"apart, {name}", way, [good.read(file)], partial(_apart, good, file, line), 0.3)
        for name, way, file, line in APART
    ]


def _listed(line: str) -> bytes:
    """Return a line as a list of words."""
    return json.dumps(line.split()).encode()


def _options(good: Good, content: bytes, folder: Path) -> None:
    """Run a line; its words are data."""
    prepare(good, folder)
    check(*in_child(json.loads(content), folder, BEGUN_S))


def _apart(good: Good, file: str, line: str, content: bytes, folder: Path) -> None:
    """Run a command on a changed file instead of a good one."""
    prepare(good, folder)
    (folder / file).write_bytes(content)
    check(*in_child(line.split(), folder, BEGUN_S))


def prepare(good: Good, folder: Path) -> None:
    """Put all good files into a folder, and things that are not files."""
    shutil.copytree(good.folder, folder, dirs_exist_ok=True)
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    (folder / "link").symlink_to("picture.png")


def check(status: int, said: str, left: bool) -> None:
    """Insist on an end as commands have it; raise a refusal for status 2, else a finding."""
    if "Traceback" in said or status not in (0, 1, 2, 130):
        raise Wrong(f"status {status}, it said {said[-400:]!r}")
    if status == 2 and (said.count("wamnet: error: ") != 1 or "wamnet: error: " not in said.splitlines()[-1]):
        raise Wrong(f"no error in one line: {said[-400:]!r}")
    if left:
        raise Wrong("a process of it was left")
    shown = said.replace("\n", "")
    if not shown.isprintable():
        raise Wrong(f"control characters reach the terminal: {ascii(shown)[:300]}")
    if status == 2:
        raise CommandRefused(said)
