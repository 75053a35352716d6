"""Programs under test, made of the example in the spec: right as it stands, wrong with one line changed."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

CHAPTER = Path(__file__).parents[2] / "spec" / "conformance.md"
"""Where the examples stand."""


def example(language: str) -> str:
    """Return the text of the chapter's example in a language."""
    (found,) = re.findall(rf"^```{language}\n(.*?)^```$", CHAPTER.read_text(), re.MULTILINE | re.DOTALL)
    return found


@pytest.fixture
def program(tmp_path: Path) -> Callable[..., list[str]]:
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
def command(program: Callable[..., list[str]]) -> Callable[..., str]:
    """Give the same as a text for --program."""
    return lambda *changes: shlex.join(program(*changes))
