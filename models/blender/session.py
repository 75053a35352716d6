"""Blender in a process of its own, with a file open: frames of it as EXR files.

1. The program is an installed Blender, or this Python where it has the package bpy [`program`]; both run
   process.py, which says how it is asked.
2. A program in a process of its own answers questions: a line of JSON in, a line of JSON back. Answers begin
   with a mark, so that other lines of the program are passed over. It is in a process group of its own: an
   interrupt is for the one who asks, who then closes this: by closing its input, and by killing it where it
   does not end then, or where an error is on its way [`LineProcess`].
3. What Blender says against a file is an InputError with the file's name; a program that is missing or ends
   is ExecutorUnavailable [`Blender`].
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...refimpl.errors import ExecutorUnavailable, InputError
from .plan import Animation, Shot
from .process import MARK

SCRIPT = Path(__file__).with_name("process.py")
"""What runs in Blender."""

BLENDER = "blender"
"""Blender's program, looked for where no other is named."""

QUIET = ("--background", "--factory-startup", "--disable-autoexec", "--python")
"""Options of Blender: no window, no settings of the user, no scripts of files, and a script to run."""

CLOSING_S = 20.0
"""Seconds in which the process has to end before it is ended."""


def program(named: str | None) -> list[str]:
    """Return the command that runs process.py: the named Blender, this Python, or a Blender on the path."""
    if named is None and find_spec("bpy") is not None:
        return [sys.executable, str(SCRIPT)]
    found = shutil.which(named or BLENDER)
    if found is not None:
        return [found, *QUIET, str(SCRIPT)]
    if named is not None:
        raise InputError("--blender", named, "not found", "give the path of Blender's program")
    rule = "there is no program blender, and this Python has no package bpy"
    raise ExecutorUnavailable(f"Blender: {rule}; install Blender, or pip install --no-deps bpy")


class LineProcess:
    """A running program; `ended` is what is said when it has gone, before the last line of its errors."""

    def __init__(self, command: Sequence[str], ended: str, mark: str = "") -> None:
        """Start it."""
        self._ended, self._mark = ended, mark
        self._said = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
            start_new_session=True,
        )

    def ask(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a question; ExecutorUnavailable says that the program has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
            for line in self._process.stdout:
                if line.startswith(self._mark):
                    found: dict[str, Any] = json.loads(line.removeprefix(self._mark))
                    return found
        raise ExecutorUnavailable(f"{self._ended}{self._last_words()}")

    def _last_words(self) -> str:
        """Return the last line that it printed as an error, if there is one."""
        self._said.seek(0)
        lines = self._said.read().strip().splitlines()
        return f": {lines[-1].strip()}" if lines else ""

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if not self._process.stdin.closed:
            with suppress(BrokenPipeError):
                self._process.stdin.close()
        if sys.exc_info()[0] is not None:
            self._process.kill()
        try:
            self._process.wait(CLOSING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._said.close()


class Blender:
    """An open file; closed as a context manager is."""

    def __init__(self, file: Path, view_layer: str = "", named: str | None = None) -> None:
        """Open `file` in the Blender that is `named` [`program`]; the view layer may be the only one."""
        self._file = file
        self._process = LineProcess(program(named), "Blender has ended", MARK)
        try:
            about = self._answer({"file": str(file.absolute()), "view_layer": view_layer})
            self.animation = Animation(**about)
        except BaseException:
            self.close()
            raise

    def render(self, shot: Shot, to: Path, prefilter: str = "") -> None:
        """Render a picture to an EXR file with all passes.

        `prefilter`: ACCURATE, FAST or NONE; the picture is then denoised by Blender's Open Image Denoise.
        """
        self._answer({**shot.as_question(), "to": str(to.absolute()), "prefilter": prefilter})

    def _answer(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return what the process answers."""
        found = self._process.ask(question)
        if "wrong" in found:
            rule = str(found["wrong"]).rstrip(".")
            raise InputError("Blender file", str(self._file), rule, "change it in Blender, and save it")
        return found

    def close(self) -> None:
        """End the process."""
        self._process.close()

    def __enter__(self) -> Blender:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
