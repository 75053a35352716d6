"""Programs under test, made of the example in the spec: right as it is, wrong with one line changed."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

CHAPTER = Path(__file__).parents[2] / "spec" / "conformance.md"
"""Where the examples stand."""


@pytest.fixture
def example() -> Callable[[str], str]:
    """Give a function that returns the text of the chapter's example in a language."""

    def text(language: str) -> str:
        (found,) = re.findall(rf"^```{language}\n(.*?)^```$", CHAPTER.read_text(), re.MULTILINE | re.DOTALL)
        return found

    return text


@pytest.fixture
def program(tmp_path: Path, example: Callable[[str], str]) -> Callable[..., list[str]]:
    """Give a function that writes the Python example, with pieces of it replaced, and returns its command."""

    def write(*changes: tuple[str, str]) -> list[str]:
        text = example("python")
        for old, new in changes:
            assert old in text, f"the example has no {old!r} any more"
            text = text.replace(old, new)
        path = tmp_path / "program.py"
        path.write_text(text)
        return [sys.executable, str(path)]

    return write


@pytest.fixture
def verdicts(needs: Callable[[str], None]) -> Callable[..., list[Any]]:
    """Give a function from a command, words that choose cases and a time-out to the verdicts."""
    needs("programs")
    from wamnet.spec.conformance import run, vectors
    from wamnet.spec.conformance.protocol import Session

    def ask(command: list[str], words: list[str], timeout_s: float = 60.0, folder: Path | None = None) -> Any:
        cases = run.chosen(run.read_vectors(folder or vectors.FOLDER), words)
        with Session(command, timeout_s) as session:
            return list(run.run(session, cases, "ieee"))

    return ask
