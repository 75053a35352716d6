"""The process that runs a student's code: `python -m wamnet_course.judged FOLDER LIMITS...`.

1. It takes the pipes to the grader from its standard streams, which a student's prints do not reach [`main`].
2. It limits itself [sandbox.py], loads the student's file [`load`], and answers the grader's calls [`serve`].
   A call is a function and its arguments; the answer is data, or an exception.
3. It knows neither the checks nor what they expect. Whatever a student's code does to this process, it can
   only give other answers, or none.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.refimpl.errors import InputError

from .sandbox import Limits, confine, die_with_parent
from .wire import LONGEST_MESSAGE, MOST_BYTES, STUDENT, Channel, error_of, names_of, plain, unpacked


def load(name: str, files: Mapping[str, bytes]) -> None:
    """Write files to the working folder, then load the student's module of this name from there."""
    for file, data in files.items():
        Path(file).write_bytes(data)
    path = Path.cwd() / name
    spec = importlib.util.spec_from_file_location(STUDENT, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[STUDENT] = module
    # Last, so that a file named numpy.py does not hide NumPy; it stays, for imports within functions.
    sys.path.append(str(path.parent))
    spec.loader.exec_module(module)


def serve(channel: Channel) -> None:
    """Answer the grader's calls until there are no more."""

    def call(index: int, *args: Any) -> Any:
        """Call a function of the grader."""
        channel.send(_bytes("call", plain([index, *args])))
        kind, *rest = unpacked(channel.receive(), call)
        if kind == "raised":
            raise error_of(*rest)
        return rest[0]

    while True:
        try:
            message = channel.receive()
        except EOFError:
            return
        try:
            function, args = unpacked(message, call)
            with np.errstate(all="ignore"):
                answer = _bytes("value", plain(function(*args)))
        except BaseException as error:  # noqa: BLE001
            answer = _bytes("raised", [names_of(error), str(error)[:LONGEST_MESSAGE], _line(error)])
        channel.send(answer)


def _bytes(kind: str, rest: Any) -> bytes:
    """Return a message; InputError for one that the grader does not read."""
    message = json.dumps([kind, rest]).encode()
    if len(message) > MOST_BYTES:
        rule = f"at most {MOST_BYTES} are read"
        raise InputError("result", f"{len(message)} bytes", rule, "return an array of the stated shape")
    return message


def _line(error: BaseException) -> int:
    """Return the line of the student's file at which an exception was raised, or 0."""
    if isinstance(error, SyntaxError):
        return error.lineno or 0
    file = getattr(sys.modules.get(STUDENT), "__file__", None)
    frames = traceback.extract_tb(error.__traceback__)
    return next((frame.lineno or 0 for frame in reversed(frames) if frame.filename == file), 0)


def main(folder: str, *numbers: str) -> None:
    """Serve on the standard streams, with limits."""
    die_with_parent()
    channel = Channel(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    empty, end = os.pipe()
    os.close(end)
    os.dup2(empty, 0)
    os.dup2(2, 1)
    os.chdir(folder)
    confine(Limits(*map(int, numbers)))
    serve(channel)
    # What the student's code leaves behind, threads or exit functions, is not waited for.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
