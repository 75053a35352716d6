"""Machines that take things away, and renderers that misbehave: what is done follows from a target's bytes.

A command on such a machine ends with its output, or in status 2 with one line. A renderer gives pictures or a
reason, and leaves no process and no folder behind.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from random import Random

from faults import members
from targets import CommandRefused, Good, Target

from wamnet.refimpl.light.scenes import empty
from wamnet_verify.cases import Shot
from wamnet_verify.judgement import Missing
from wamnet_verify.renderers import NPZ, ByCommand

STRANGER = 54321
"""A user without an entry in the system's list."""

LIMIT_S = 0.5
"""Seconds that a renderer may take."""

GRACE_S = 5.0
"""Seconds for which a killed process may still be listed: a busy machine reaps it late."""

COMMANDS = (
    "denoise {good}/model.safetensors {good}/frame.exr --anyway -o out.exr --executor {executor}",
    "executors",
    "compile {good}/model.safetensors --target c -o kernel",
    "export {good}/model.safetensors --target c -o export --check",
    "denoise {good}/model.safetensors n\udcff\x1b[31m.exr -o out.exr",
    "compare {good}/frame.exr {good}/frame.exr",
    "list",
)
"""What is run."""

ACTIONS = (
    "os.write(1, os.urandom(1 << {n}))", "os.write(2, b'\\x1b[31m\\xff\\n')",
        "subprocess.Popen(['sleep', '600'])", "os.system('sleep 600 &')", "os.close(1)",
        "os.makedirs('d', exist_ok=True); os.chdir('d')",
        "[(os.makedirs('e', exist_ok=True), os.chdir('e')) for _ in range(60 * {n})]",
        "os.symlink('/', f'l{{os.getpid()}}')", "os.mkfifo(f'p{{os.getpid()}}')", "os.chmod('.', 0)",
        "shutil.rmtree(os.path.dirname(sys.argv[2]), ignore_errors=True)",
        "open(sys.argv[2], 'wb').write(os.urandom({n}))", "os.mkdir(sys.argv[2])",
        "os.symlink('/dev/zero', sys.argv[2])", "np.savez(sys.argv[2], color=np.full(({n}, 4, 3), np.nan))",
        "signal.signal({n}, signal.SIG_IGN)", "os.kill(os.getpid(), {n})", "sys.exit({n})", "time.sleep(600)",
)  # fmt: skip
"""What a renderer does, in any order."""


Taken = tuple[str, str, str]
"""What is taken away in a shell: before a command, by words before it, and by its streams."""


def machines(good: Good) -> list[Target]:
    """Return both targets."""
    return [
        Target("machine", "bytes", [b"a machine"], partial(_machine, good), 6.0),
        Target("renderer", "bytes", [b"a renderer"], _renderer, 4.0),
    ]


def _machine(good: Good, content: bytes, folder: Path) -> None:
    """Run a command with some things taken away."""
    random = Random(content)
    takes = [take for take in (_home, _folders, _streams, _stacks, _user) if random.random() < 0.6]
    variables = {"PATH": os.environ["PATH"], "HOME": str(folder), "OPENBLAS_NUM_THREADS": "1"}
    folder.chmod(0o777)
    good.folder.chmod(0o755)
    parts = [take(random, folder, variables) for take in takes]
    line = random.choice(COMMANDS).format(
        good=good.folder, executor=random.choice(("numpy", "c", "opencl", "opengl"))
    )
    limits, words, streams = ("".join(each) for each in zip(("", "", ""), *parts, strict=True))
    script = f'{limits} exec {words} "$@" {streams}'
    done = subprocess.run(
        ["bash", "-c", script, "bash", sys.executable, "-m", "wamnet.cli", *line.split()],
        env=variables,
        cwd=folder,
        capture_output=True,
        check=False,
    )
    told = done.stderr.decode(errors="surrogateescape")
    assert done.returncode in (0, 2), f"{script}: {line}: status {done.returncode}: {told[-300:]}"
    assert "Traceback" not in told, f"{script}: {line}: {told[-300:]}"
    if done.returncode == 2:
        raise CommandRefused(told)


def _home(random: Random, folder: Path, variables: dict[str, str]) -> Taken:
    """Take the home away, or name another one."""
    del variables["HOME"]
    if random.random() < 0.7:
        variables["HOME"] = random.choice(("", "/nowhere", "relative", "/dev/null", "/proc"))
    return "", "", ""


def _folders(random: Random, folder: Path, variables: dict[str, str]) -> Taken:
    """Give folders of other users, without rights, or none."""
    for name in ("TMPDIR", "XDG_CACHE_HOME", "POCL_CACHE_DIR", "WAMNET_CACHE", "MESA_SHADER_CACHE_DIR"):
        if random.random() < 0.5:
            path = folder / name.lower()
            path.mkdir()
            path.chmod(random.choice((0o777, 0o755, 0o500, 0)))
            if not os.geteuid():
                os.chown(path, random.choice((0, STRANGER, STRANGER + 1)), -1)
            variables[name] = random.choice((str(path), f"{path}/further", "", "/nowhere", "/dev/null"))
    return "", "", ""


def _streams(random: Random, folder: Path, variables: dict[str, str]) -> Taken:
    """Close streams, or let them have few characters."""
    variables["PYTHONIOENCODING"] = random.choice(("ascii", "latin-1", "utf-8", "utf-16"))
    variables["LC_ALL"] = random.choice(("C", "POSIX", "C.UTF-8", "xx_XX"))
    variables["COLUMNS"] = random.choice(("1", "0", "x", "40"))
    return "", "", " ".join(each for each in ("<&-", ">&-", "2>&-") if random.random() < 0.3)


def _stacks(random: Random, folder: Path, variables: dict[str, str]) -> Taken:
    """Limit stacks."""
    return f"ulimit -s {random.choice((256, 300, 512, 1024))};", "", ""


def _user(random: Random, folder: Path, variables: dict[str, str]) -> Taken:
    """Become a user that nobody has named, where this one may."""
    if os.geteuid() or shutil.which("setpriv") is None:
        return "", "", ""
    mask = random.choice(("0", "22", "77"))
    return f"umask {mask};", f"setpriv --reuid {STRANGER} --clear-groups", ""


def _renderer(content: bytes, folder: Path) -> None:
    """Let a renderer do some things, and look for what is left."""
    random = Random(content)
    lines = [random.choice(ACTIONS).format(n=random.randrange(1, 20)) for _ in range(random.randrange(1, 7))]
    tried = [f"try: {line}\nexcept OSError: pass" for line in lines]
    marked = f"open({str(folder / 'group')!r}, 'a').write(f'{{os.getpid()}} ')"
    head = "import os, shutil, signal, subprocess, sys, time\nimport numpy as np\n"
    program = "\n".join([head + marked, *tried])
    command = (sys.executable, "-c", program, "{scene}", "{output}")
    own = folder / "temporary"
    own.mkdir()
    tempfile.tempdir = str(own)
    try:
        renderer = ByCommand("fuzz", "wamnet", command, lambda path: {}, NPZ, limit_s=LIMIT_S)
        found = renderer.pictures(Shot("shot", empty(), size=4, spp=1), [1, 2])
    finally:
        tempfile.tempdir = None
    assert isinstance(found, Missing) or len(found) == 2, lines
    assert not list(own.iterdir()), f"a folder is left by {lines}"
    for group in map(int, (folder / "group").read_text().split()):
        end = time.monotonic() + GRACE_S
        while (left := members(group)) and time.monotonic() < end:
            time.sleep(0.02)
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        assert not left, f"a process is left by {lines}"
