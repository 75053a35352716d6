"""Command lines in processes of their own, forked from a server that has opened no device.

1. A process that has opened OpenCL has threads of the driver, which a fork of it lacks: a kernel there never
   ends. So lines are run by a server that only imports the program [`serve`], started when one is needed.
2. It forks for each line, with the caller's environment and limit on memory, in the line's folder [`_run`].
3. What has not ended after a while has been accepted, and works: it gets Ctrl-C, and must end [`_ended`].
"""

import importlib
import json
import os
import pkgutil
import resource
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from wamnet.cli import commands

ENDING_S = 15.0
"""Seconds that it may take to end then; a kernel that is being compiled ends first."""

CRASHED = 99
"""Status of a child that an exception has ended."""

SAID = ".said"
"""File in a line's folder with all that it said."""


class Wrong(Exception):
    """A line has ended as none may."""


_servers: dict[int, subprocess.Popen[str]] = {}
"""The server of a process, by the process's number: a fork of it has none."""


def in_child(words: Sequence[str], folder: Path, begun_s: float) -> tuple[int, str, bool]:
    """Run a line in a child; return its status, all that it said, and whether a process of it was left."""
    server = _servers.get(os.getpid()) or _started()
    asked = {
        "words": list(words),
        "folder": str(folder),
        "begun_s": begun_s,
        "environment": dict(os.environ),
        "memory": resource.getrlimit(resource.RLIMIT_DATA)[0],
    }
    try:
        answer = _asked(server, asked)
    except BaseException:
        # What it would answer belongs to no later line; it ends where nothing is asked any more.
        del _servers[os.getpid()]
        _pipe(server.stdin).close()
        raise
    if "wrong" in answer:
        raise Wrong(answer["wrong"])
    said = (folder / SAID).read_text(encoding="utf-8", errors="replace")
    return answer["status"], said, answer["left"]


def _started() -> subprocess.Popen[str]:
    """Start this process's server; a Ctrl-C that is meant for this process does not reach it."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    command = [sys.executable, "-B", __file__]
    server = subprocess.Popen(command, **pipes, text=True, start_new_session=True)  # type: ignore[call-overload]
    _servers[os.getpid()] = server
    return server  # type: ignore[no-any-return]


def _asked(server: subprocess.Popen[str], asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return a server's answer."""
    print(json.dumps(asked), file=_pipe(server.stdin), flush=True)
    answer: dict[str, Any] = json.loads(_pipe(server.stdout).readline())
    return answer


def _pipe(pipe: IO[str] | None) -> IO[str]:
    """Return a pipe of the server."""
    assert pipe is not None, "the server is started with pipes"
    return pipe


# ---- the server ---------------------------------------------------------------------------------------


def serve() -> None:
    """Answer lines of JSON until there are no more."""
    # Children have from here what takes long to import; none of it opens a device.
    for module in pkgutil.iter_modules(commands.__path__, f"{commands.__name__}."):
        with suppress(ImportError):
            importlib.import_module(module.name)
    for line in sys.stdin:
        asked = json.loads(line)
        try:
            answer = _forked(asked)
        except Wrong as error:
            answer = {"wrong": str(error)}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


def _forked(asked: Mapping[str, Any]) -> dict[str, Any]:
    """Run a line in a child; return how it ended."""
    child = os.fork()
    if child == 0:
        _run(asked)
    status = _ended(child, asked["begun_s"])
    left = False
    # What it has started may end a moment after it.
    for _ in range(100):
        left = bool(_alive(child))
        if not left:
            break
        time.sleep(0.1)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    return {"status": status, "left": left}


def _run(asked: Mapping[str, Any]) -> None:
    """Be the child: run the line, with all that is said in a file."""
    status = CRASHED
    try:
        os.setsid()
        os.chdir(asked["folder"])
        os.environ.clear()
        os.environ.update({**asked["environment"], "BROWSER": "true"})
        resource.setrlimit(resource.RLIMIT_DATA, (asked["memory"], resource.RLIM_INFINITY))
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        with Path(SAID).open("w", buffering=1, encoding="utf-8", errors="backslashreplace") as file:
            sys.stdout = sys.stderr = file
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
            sys.argv = ["wamnet", *asked["words"]]
            from wamnet.cli.main import main

            try:
                status = main(asked["words"])
            except BaseException:  # noqa: BLE001 - whatever it is, we did not raise it
                traceback.print_exc()
            file.flush()
    finally:
        os._exit(status)


def _ended(child: int, begun_s: float) -> int:
    """Wait for a child, with Ctrl-C after a while, and again if nothing comes of it; return its status."""
    began, sent = time.monotonic(), 0
    while True:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status)
        passed = time.monotonic() - began
        if passed > begun_s + ENDING_S:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise Wrong(f"it did not end within {ENDING_S:g} s of Ctrl-C")
        if passed > begun_s + sent * ENDING_S / 3:
            os.kill(child, signal.SIGINT)
            sent += 1
        time.sleep(0.002)


def _alive(session: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, of = path.read_text().rpartition(")")[2].split()[:4]
            found += [int(path.parent.name)] if int(of) == session and state != "Z" else []
    return found


if __name__ == "__main__":
    serve()
