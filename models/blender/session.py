"""Blender in a process of its own, with a file open: frames of it as EXR files.

1. The program is an installed Blender, or this Python where it has the package bpy [`program`]; both run
   process.py, which says how it is asked.
2. What Blender says against a file is an InputError with the file's name; a program that is missing or ends
   is ExecutorUnavailable [`Blender`].
"""

from __future__ import annotations

import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...refimpl.errors import ExecutorUnavailable, InputError
from ..lines import LineProcess
from .plan import Animation, Shot
from .process import MARK

SCRIPT = Path(__file__).with_name("process.py")
"""What runs in Blender."""

BLENDER = "blender"
"""Blender's program, looked for where no other is named."""

QUIET = ("--background", "--factory-startup", "--disable-autoexec", "--python")
"""Options of Blender: no window, no settings of the user, no scripts of files, and a script to run."""


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
        self._process.end()

    def __enter__(self) -> Blender:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
