"""Temporary folders and caches: what is removed, what is left alone, what is trusted."""

import errno
import os
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.kernels import folders
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet_verify.programs import temporary

NAMES = st.one_of(
    st.text(st.characters(exclude_characters="/\0", exclude_categories=("Cs",)), min_size=1, max_size=9).map(
        str.encode
    ),
    st.binary(min_size=1, max_size=9).filter(lambda name: b"/" not in name and b"\0" not in name),
).filter(lambda name: name not in (b".", b".."))

TREES = st.recursive(
    st.sampled_from(["file", "link", "pipe"]),
    lambda inner: st.dictionaries(NAMES, inner, max_size=4),
    max_leaves=24,
)
"""What may be in a folder: folders by name, with any bytes, and leaves."""


def grow(at: Path, tree: object, outside: Path) -> None:
    """Make what a tree says; a folder below is closed to its owner."""
    if tree == "file":
        at.write_text("x")
    elif tree == "link":
        at.symlink_to(outside)
    elif tree == "pipe":
        os.mkfifo(at)
    else:
        at.mkdir()
        for name, inner in tree.items():
            grow(at / os.fsdecode(name), inner, outside)
        at.chmod(0)


@pytest.mark.needs("programs")
@settings(max_examples=40, deadline=None)
@given(TREES)
def test_whatever_is_in_a_folder_goes_and_nothing_else(tree) -> None:
    with tempfile.TemporaryDirectory() as around:
        outside = Path(around, "outside")
        outside.mkdir()
        (outside / "kept").write_text("x")
        inside = Path(around, "inside")
        inside.mkdir()
        grow(inside / "tree", tree, outside)
        folders.remove(inside)
        assert [*Path(around).rglob("*")] == [outside, outside / "kept"]


@pytest.mark.needs("programs")
def test_folders_deeper_than_recursion_and_paths_go(tmp_path) -> None:
    """shutil.rmtree ended in a RecursionError here, with a renderer's report lost."""
    code = "import os\nfor _ in range(1500): os.mkdir('deep'); os.chdir('deep')"
    with temporary("test") as folder:
        subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
    assert not folder.exists()


@pytest.mark.needs("programs")
def test_a_temporary_folder_may_be_gone_at_its_end() -> None:
    with temporary("test") as folder:
        folder.rmdir()
    assert not folder.exists()


@pytest.mark.needs("programs")
def test_folders_of_killed_processes_go_and_those_of_running_ones_stay(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    code = (
        f"import tempfile; tempfile.tempdir = {str(tmp_path)!r}\n"
        "from wamnet.kernels import folders; import os, signal, time\n"
        "print(folders.new_temporary('test')[0], flush=True); time.sleep(600)"
    )
    other = tmp_path / "wamnet-test.notes"
    other.mkdir()
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        left = Path(process.stdout.readline().strip())
        for path in (left, other):
            os.utime(path, (time.time() - 60,) * 2)
        with temporary("test"):
            assert left.exists()
        process.kill()
        process.wait()
    with temporary("test"):
        assert not left.exists()
    assert list(tmp_path.iterdir()) == [other]


@pytest.mark.parametrize(
    ("at", "mode", "owner", "private"),
    [
        ("folder", 0o700, None, True),
        ("folder", 0o755, None, True),
        ("folder", 0o777, None, False),
        ("folder", 0o770, None, False),
        ("folder", 0o1777, None, False),
        ("folder", 0o700, 12345, False),
        ("above", 0o1777, None, True),
        ("above", 0o777, None, False),
        ("above", 0o775, None, False),
        ("above", 0o755, 12345, False),
    ],
)
def test_a_cache_that_others_may_write_is_not_private(tmp_path, at, mode, owner, private) -> None:
    places = {"above": tmp_path / "above", "folder": tmp_path / "above" / "folder"}
    for path in places.values():
        path.mkdir(mode=0o700)
    places[at].chmod(mode)
    if owner is not None:
        if os.geteuid():
            pytest.skip("only root gives a folder to another user")
        os.chown(places[at], owner, -1)
    assert folders.is_private(places["folder"]) == private


@pytest.fixture
def drivers(tmp_path, monkeypatch):
    """Return the user's folder of caches, and undo what is set for drivers."""
    for name in ("HOME", "XDG_CACHE_HOME", *folders.CACHE_VARIABLES):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for name in folders.CACHE_VARIABLES:
        monkeypatch.delenv(name)
    base = tmp_path / "caches"
    (base / "pocl" / "kcache").mkdir(mode=0o700, parents=True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(base))
    return base


@pytest.mark.parametrize("name", ["", "pocl", "pocl/kcache", "pytools"])
def test_drivers_keep_their_caches_unless_others_may_write_them(drivers, name) -> None:
    """PoCL ran the library that another user had put into its cache."""
    (drivers / name).mkdir(exist_ok=True)
    folders.protect_caches()
    assert os.environ["XDG_CACHE_HOME"] == str(drivers)
    (drivers / name).chmod(0o777)
    folders.protect_caches()
    instead = Path(os.environ["XDG_CACHE_HOME"])
    assert instead != drivers
    assert stat.S_IMODE(instead.stat().st_mode) == 0o700


def test_without_a_home_drivers_get_a_temporary_cache(drivers, monkeypatch) -> None:
    """Path.expanduser raised RuntimeError in every executor."""
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME")
    monkeypatch.setattr("pwd.getpwuid", lambda uid: {}[uid])
    assert folders.cache_base() is None
    folders.protect_caches()
    assert Path(os.environ["XDG_CACHE_HOME"]).is_dir()


@pytest.mark.needs("programs")
def test_programs_are_built_where_they_run(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    real = folders.runs_programs
    monkeypatch.setattr(folders, "runs_programs", lambda path: tmp_path != path and real(path))
    with temporary("test", programs=True) as folder:
        assert folder.parent != tmp_path
    monkeypatch.setattr(folders, "runs_programs", lambda path: False)
    with pytest.raises(ExecutorUnavailable, match=r"TMPDIR is .*noexec.*set it to a folder on another"):
        folders.new_temporary("test", programs=True)


@pytest.mark.needs("programs")
def test_a_file_system_without_programs_is_noticed(tmp_path) -> None:
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "noexec", "tmpfs", tmp_path], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip(f"no file system can be mounted: {done.stderr.decode(errors='replace').strip()}")
    try:
        assert not folders.runs_programs(tmp_path / "not" / "there")
        (tmp_path / "run").write_text("#!/bin/sh\n")
        (tmp_path / "run").chmod(0o755)
        with pytest.raises(OSError, match="Permission") as raised:
            subprocess.run([tmp_path / "run"], check=False)
        assert raised.value.errno == errno.EACCES
    finally:
        subprocess.run(["umount", tmp_path], check=True)
