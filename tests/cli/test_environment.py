"""The command on machines that take things away: a home, a name, writable folders."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from wamnet.cli.files.exr import write_frame
from wamnet.models.model_file import save_model
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

pytestmark = pytest.mark.needs("programs", "devices")

STRANGER = 54321
"""A user without an entry in the system's list."""

EXECUTORS = ("numpy", "c", "opencl", "opengl")


@pytest.fixture
def place() -> Iterator[Path]:
    """Give a folder that every user may write, with a model and a frame."""
    with tempfile.TemporaryDirectory(prefix="wamnet-environment-") as name:
        folder = Path(name)
        folder.chmod(0o777)
        network = siren.init((27, 8, 3), 2.0, 2.0, 5, np.float32)
        save_model(
            folder / "m.safetensors", Model(network, ("color",), Window(3, "clamp"), Normalization(), {})
        )
        write_frame(folder / "f.exr", Frame({"color": np.full((5, 7, 3), 0.25, np.float32)}))
        yield folder


def command(place: Path, executor: str, *before: str, **variables: str) -> str:
    """Denoise with few variables, and return what was printed; skip an executor that is not here."""
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    words = ["denoise", "m.safetensors", "f.exr", "--executor", executor, "--anyway", "-o", "o.exr"]
    done = subprocess.run(
        [*before, sys.executable, "-m", "wamnet.cli", *words],
        env={**kept, "OPENBLAS_NUM_THREADS": "1", **variables},
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    if done.returncode == 2 and "cannot be imported" in done.stderr:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    assert (place / "o.exr").stat().st_size > 0
    return done.stdout + done.stderr


def as_stranger() -> tuple[str, ...]:
    """Return the words before a command of another user; skip where nobody may become one."""
    if os.geteuid() or shutil.which("setpriv") is None:
        pytest.skip("only root becomes another user, with setpriv")
    words = ("setpriv", "--reuid", str(STRANGER), "--clear-groups")
    done = subprocess.run([*words, sys.executable, "-c", "import wamnet.cli.main"], check=False)
    if done.returncode:
        pytest.skip("another user cannot read this environment")
    return words


@pytest.mark.nightly(but="opencl")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_an_unknown_user_without_a_home(place: Path, executor: str) -> None:
    """Containers and units of systemd have such users: every executor ended in a traceback."""
    command(place, executor, *as_stranger())


@pytest.mark.nightly(but="opencl")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_nothing_but_the_output_can_be_written(place: Path, executor: str) -> None:
    """HOME and TMPDIR are of somebody else, and read-only."""
    closed = place / "closed"
    closed.mkdir(mode=0o755)
    command(place, executor, *as_stranger(), HOME=str(closed), TMPDIR=str(closed))


@pytest.mark.nightly(but="c")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_a_cache_of_somebody_else_is_named_and_left_alone(place: Path, executor: str) -> None:
    if os.geteuid():
        pytest.skip("only root gives a folder to another user")
    foreign = place / "foreign"
    foreign.mkdir()
    foreign.chmod(0o777)
    os.chown(foreign, STRANGER, STRANGER)
    told = command(place, executor, XDG_CACHE_HOME=str(foreign))
    assert list(foreign.iterdir()) == []
    assert executor == "numpy" or "is not used: others own it" in told


@pytest.mark.nightly(but="c")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_folders_that_run_no_programs(place: Path, executor: str) -> None:
    """The message told to install a compiler, which was there."""
    mounted = place / "mounted"
    mounted.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "noexec", "tmpfs", mounted], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip(f"no file system can be mounted: {done.stderr.decode(errors='replace').strip()}")
    try:
        command(place, executor, TMPDIR=str(mounted), XDG_CACHE_HOME=str(mounted / "cache"))
    finally:
        subprocess.run(["umount", mounted], check=True)
