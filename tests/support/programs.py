"""Blocks of documents that are run: of a shell, or of Python."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

PROGRAMS = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}
"""What runs a block, by its language."""

SECONDS_AT_MOST = 300
"""When a block counts as hanging; none should take a tenth of it."""


def run_block(where: str, language: str, text: str, folder: Path, **more: Any) -> str:
    """Run a block in a folder, and return what it prints; on failure say the place, the text and the last
    lines of the output."""
    done = subprocess.run(
        [*PROGRAMS[language], text],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=SECONDS_AT_MOST,
        check=False,
        **more,
    )
    if done.returncode:
        tail = "\n".join(done.stdout.splitlines()[-30:])
        pytest.fail(f"{where} ends with status {done.returncode}:\n{text}\n{tail}", pytrace=False)
    return done.stdout
