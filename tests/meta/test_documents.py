"""Every command that README.md and docs/ show is run, so that what a reader copies works.

1. Fenced `sh` and `python` blocks of one document run in their order, in one empty folder, with the package's
   commands first on PATH: a block may use the files of those before it [`test_commands_of_a_document`].
2. A block after `<!-- not run: reason -->` is left out and reported, with its reason, as a skipped test. Only
   set-up may be marked so, for CI runs that itself [`SETUP`].
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""

DOCUMENTS = [path for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))] if path.exists()]
"""What a user reads."""

SETUP = re.compile(
    r"(git clone|cd|make|sudo apt-get install|python3 -m venv|(\S+/)?pip install|\.ci/run)\b.*"
)
"""Commands that need not run here: they make the environment of this test, or CI calls them itself."""

BLOCK = re.compile(r"(?:<!-- not run: (.+?) -->\s*)?^```(sh|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""An optional mark, then a fenced block."""

SECONDS_AT_MOST = 300
"""When a command counts as hanging; no command of a document should take a tenth of it."""


class Block(NamedTuple):
    """A fenced block: where it starts, why it is not run (or None), its language and its text."""

    where: str
    reason: str | None
    language: str
    text: str


def blocks(name: str, text: str) -> list[Block]:
    return [
        Block(f"{name}:{text.count(chr(10), 0, m.start(2)) + 1}", m[1], m[2], m[3])
        for m in BLOCK.finditer(text)
    ]


def commands(block: Block) -> list[str]:
    """Return a block's lines without comments."""
    lines = (line.partition(" #")[0].strip() for line in block.text.splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def run(block: Block, folder: Path) -> None:
    """Run a block in a folder; on failure say the place, the text and the last lines of the output."""
    program = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}[block.language]
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": "120",
    }
    done = subprocess.run(
        [*program, block.text],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=SECONDS_AT_MOST,
        check=False,
    )
    if done.returncode:
        tail = "\n".join(done.stdout.splitlines()[-30:])
        pytest.fail(f"{block.where} ends with status {done.returncode}:\n{block.text}\n{tail}", pytrace=False)


ALL = {
    path.relative_to(ROOT).as_posix(): blocks(path.relative_to(ROOT).as_posix(), path.read_text())
    for path in DOCUMENTS
}
"""The blocks of each document."""


@pytest.mark.parametrize("document", ALL)
@pytest.mark.needs("programs")
def test_commands_of_a_document(document: str, tmp_path: Path) -> None:
    for block in ALL[document]:
        if block.reason is None:
            run(block, tmp_path)
    assert ALL[document] or document != "README.md", "README.md shows at least one command"


@pytest.mark.parametrize(
    "block", [b for found in ALL.values() for b in found if b.reason], ids=lambda b: b.where
)
def test_block_that_is_not_run(block: Block) -> None:
    wrong = [command for command in commands(block) if not SETUP.fullmatch(command)]
    assert not wrong, (
        f"{block.where}: only set-up may be left out, so remove the mark or the command: {wrong}"
    )
    pytest.skip(f"{block.where} is not run: {block.reason}")


SAMPLE = """
<!-- not run: CI runs it -->
```sh
make demo   # five minutes
```
```sh
echo one > file
```
```text
not a command
```
```python
assert open("file").read() == "one\\n"
```
"""
"""A document with all kinds of block."""


@pytest.mark.needs("programs")
def test_blocks_are_found_and_share_a_folder(tmp_path: Path) -> None:
    found = blocks("x.md", SAMPLE)
    assert [(b.where, b.reason, b.language) for b in found] == [
        ("x.md:3", "CI runs it", "sh"),
        ("x.md:6", None, "sh"),
        ("x.md:12", None, "python"),
    ]
    assert commands(found[0]) == ["make demo"]
    run(found[1], tmp_path)
    run(found[2], tmp_path)


@pytest.mark.parametrize("text", ["false", "false | cat", "echo $NO_SUCH_VARIABLE"])
@pytest.mark.needs("programs")
def test_block_that_fails_is_told(text: str, tmp_path: Path) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"x\.md:1 ends with status \d+"):
        run(Block("x.md:1", None, "sh", text), tmp_path)


@pytest.mark.parametrize(
    ("command", "allowed"), [("make demo", True), ("wamnet demo", False), ("echo make", False)]
)
def test_only_setup_may_be_left_out(command: str, allowed: bool) -> None:
    assert bool(SETUP.fullmatch(command)) is allowed
