"""Tests of locks: one writer at a time, which no kill, link or foreign file turns into a loss."""

import os
import signal
import subprocess
import sys

import pytest

from wamnet.cli.files.alone import BESIDE, LOCK, alone_at, alone_in, signals_wait
from wamnet.refimpl.errors import InputError

HOLD = (
    "import sys; from pathlib import Path; from wamnet.cli.files.alone import alone_in\n"
    "with alone_in(Path('.'), 'waiting'):\n"
    "    print('ready', flush=True); sys.stdin.read()\n"
)
"""A process that holds a folder's lock until its standard input ends."""


@pytest.mark.parametrize("ends_by", [None, signal.SIGKILL])
def test_a_second_process_is_refused_until_the_first_has_ended(tmp_path, ends_by) -> None:
    """A killed one leaves the file of its lock, which the system has forgotten; no file stays in the end."""
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", HOLD]
    with subprocess.Popen(command, cwd=tmp_path, stdin=pipe, stdout=pipe) as other:
        other.stdout.readline()
        with pytest.raises(InputError, match=r"another process is painting there \(wait for it"):
            alone_in(tmp_path, "painting").__enter__()
        if ends_by is not None:
            other.send_signal(ends_by)
        other.communicate(timeout=60)
    assert (tmp_path / LOCK).exists() == (ends_by is not None)
    with alone_in(tmp_path, "painting"):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["link", "dangling link", "folder", "pipe", "text"])
def test_what_is_no_lock_is_refused_and_stays(tmp_path, kind) -> None:
    """A link's target is neither made nor written."""
    path, target = tmp_path / LOCK, tmp_path / "target"
    if kind == "link":
        target.write_text("")
    if "link" in kind:
        path.symlink_to(target)
    elif kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.write_text("mine")
    with pytest.raises(InputError, match=r"lock file '.*': a lock of wamnet is an empty file"):
        alone_in(tmp_path, "painting").__enter__()
    assert path.is_symlink() or path.exists()
    assert target.exists() == (kind == "link")


def test_a_folder_that_cannot_be_written_is_told(tmp_path) -> None:
    """With the way out."""
    with pytest.raises(InputError, match=r"cannot be written.* \(choose another output with -o"):
        alone_in(tmp_path / "none", "painting").__enter__()


def test_signals_wait_until_the_block_has_ended() -> None:
    """Then they come."""
    done = []

    def block() -> None:
        with signals_wait():
            signal.raise_signal(signal.SIGINT)
            done.append(1)

    with pytest.raises(KeyboardInterrupt):
        block()
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_locks_of_two_files_are_two(tmp_path) -> None:
    """Names of any length have one."""
    one, two = tmp_path / ("a" * 255), tmp_path / "b"
    with alone_at(one, "writing"), alone_at(two, "writing"):
        assert all(path.name.startswith(BESIDE) for path in tmp_path.iterdir())
        with pytest.raises(InputError, match=r"output file '.*b': another process is writing there"):
            alone_at(two, "writing").__enter__()
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_the_lock_is_taken_leaves_no_file(tmp_path, monkeypatch) -> None:
    """It came between the making of the file and its locking, and left the file."""
    real = os.open

    def interrupted(*arguments: object) -> int:
        signal.raise_signal(signal.SIGINT)
        return real(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", interrupted)
        lock = alone_in(tmp_path, "painting")
        with pytest.raises(KeyboardInterrupt):
            lock.__enter__()
    assert list(tmp_path.iterdir()) == []
