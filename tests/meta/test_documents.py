"""Every command that README.md and docs/ show is run, so that what a reader copies works.

1. Fenced `sh` and `python` blocks of one document run in their order, in one empty folder, with the package's
   commands first on PATH: a block may use the files of those before it [`test_commands_of_a_document`].
2. A block after `<!-- in a clone -->` runs in the repository's root, and writes nothing there.
3. What a block prints must be the `text` block that follows it after `<!-- printed -->`, to the letter;
   `pytest --update-golden tests/meta/test_documents.py` writes it.
4. A block after `<!-- with Blender -->` runs where the package bpy is, with the project's `examples` in the
   folder; elsewhere the document is reported as a skipped test. Any block outside a clone that names
   `examples/` has them.
5. A block after `<!-- not run: reason -->` is left out and reported, with its reason, as a skipped test. Only
   set-up may be marked so, for CI runs that itself [`SETUP`].
"""

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest
from packages import needed_sandbox
from programs import run_block

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""

DOCUMENTS = [path for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))] if path.exists()]
"""What a user reads."""

SETUP = re.compile(
    r"(git clone|cd|make|sudo apt-get install|python3 -m venv|(\S+/)?pip install|\.ci/run)\b.*"
)
"""Commands that need not run here: they make the environment of this test, or CI calls them itself."""

BLOCK = re.compile(
    r"(?:<!-- (?:not run: (?P<reason>.+?)|(?P<clone>in a clone)|(?P<blender>with Blender)) -->\s*)?"
    r"^```(?P<language>sh|python)\n(?P<text>.*?)^```$"
    r"(?:\s*<!-- printed -->\s*```text\n(?P<printed>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)
"""An optional mark, then a fenced block, then perhaps what it prints."""


class Block(NamedTuple):
    """A fenced block: where it starts, why it is not run (or None), its language and its text; whether it
    runs in the repository's root, what it prints (or None), and whether it wants Blender."""

    where: str
    reason: str | None
    language: str
    text: str
    clone: bool = False
    printed: str | None = None
    blender: bool = False


def blocks(name: str, text: str) -> list[Block]:
    return [
        Block(
            f"{name}:{text.count(chr(10), 0, m.start('language')) + 1}",
            m["reason"],
            m["language"],
            m["text"],
            m["clone"] is not None,
            m["printed"],
            m["blender"] is not None,
        )
        for m in BLOCK.finditer(text)
    ]


def commands(block: Block) -> list[str]:
    """Return a block's lines without comments."""
    lines = (line.partition(" #")[0].strip() for line in block.text.splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def run(block: Block, folder: Path) -> str:
    """Run a block in a folder, and return what it prints."""
    paths = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | {"PATH": paths, "COLUMNS": "120"}
    # CI sets it against imports from the working folder; a reader's script finds the modules beside it.
    environment.pop("PYTHONSAFEPATH", None)
    return run_block(
        block.where, block.language, block.text, ROOT if block.clone else folder, env=environment
    )


ALL = {
    path.relative_to(ROOT).as_posix(): blocks(path.relative_to(ROOT).as_posix(), path.read_text())
    for path in DOCUMENTS
}
"""The blocks of each document."""


def rewrite(path: Path, block: Block, printed: str) -> None:
    """Put what a block has printed into its document."""
    before, after = f"```{block.language}\n{block.text}```", path.read_text()
    start = after.index(str(block.printed), after.index(before) + len(before))
    path.write_text(after[:start] + printed + after[start + len(str(block.printed)) :])


USUAL = ("README.md", "docs/guide/install.md", "docs/guide/python.md", "docs/first-kernel.md")
"""Documents whose commands run in every run; the others take minutes together."""


@pytest.mark.nightly(but=USUAL)
@pytest.mark.parametrize("document", ALL)
@pytest.mark.needs("programs")
def test_commands_of_a_document(document: str, tmp_path: Path, pytestconfig: pytest.Config) -> None:
    wanting = [block for block in ALL[document] if block.blender]
    if any("examples/" in block.text and not block.clone for block in ALL[document]):
        (tmp_path / "examples").symlink_to(ROOT / "examples")
    here = not wanting or find_spec("bpy") is not None
    for block in ALL[document]:
        if "course grade" in block.text:
            needed_sandbox()
        if block.reason is None and (here or not block.blender):
            found = run(block, tmp_path)
            if block.printed is not None and pytestconfig.getoption("--update-golden"):
                rewrite(ROOT / document, block, found)
            elif block.printed is not None:
                assert found == block.printed, (
                    f"{block.where} prints something else than the page shows: if that is meant, run "
                    "pytest --update-golden tests/meta/test_documents.py, and read the difference"
                )
    assert ALL[document] or document != "README.md", "README.md shows at least one command"
    if not here:
        what = f"{len(wanting)} blocks of {document} are not run"
        pytest.skip(f"MISSING: {what}: no Blender as a Python module; pip install --no-deps bpy")


@pytest.mark.parametrize(
    "block", [b for found in ALL.values() for b in found if b.reason], ids=lambda b: b.where
)
def test_block_that_is_not_run(block: Block) -> None:
    wrong = [command for command in commands(block) if not SETUP.fullmatch(command)]
    assert not wrong, (
        f"{block.where}: only set-up may be left out, so remove the mark or the command: {wrong}"
    )
    pytest.skip(f"{block.where} is not run: {block.reason}")
