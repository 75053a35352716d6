"""Tests of writing: links that somebody has put in the way are neither followed nor needed to be guessed."""

import os

import pytest

from wamnet.compiler.artifact import MANIFEST_NAME
from wamnet.models import writing


def test_temporary_names_cannot_be_guessed(tmp_path) -> None:
    """They had the number of the process, for which a link could be put there."""
    names = {writing.temporary_beside(tmp_path / "m.exr").name for _ in range(100)}
    assert len(names) == 100
    assert all(writing.TEMPORARY_NAME.fullmatch(name) and name.endswith(".exr") for name in names)
    assert not writing.TEMPORARY_NAME.fullmatch(".wamnet-notes")


@pytest.mark.parametrize("dangling", [False, True])
def test_a_link_of_the_temporary_name_is_not_followed(tmp_path, monkeypatch, dangling) -> None:
    """Not even one that was guessed; its target stays."""
    victim, link = tmp_path / "victim", tmp_path / ".wamnet-guess"
    if not dangling:
        victim.write_text("precious")
    link.symlink_to(victim)
    monkeypatch.setattr(writing, "temporary_beside", lambda path: link)
    with pytest.raises(FileExistsError, match="File exists"):
        writing.write_bytes(tmp_path / "out", b"new")
    assert victim.exists() != dangling
    assert dangling or victim.read_text() == "precious"
    assert not (tmp_path / "out").exists()
    assert link.is_symlink()


def test_a_link_of_the_output_s_name_is_replaced(tmp_path) -> None:
    """What it led to stays."""
    (tmp_path / "target").write_text("old")
    (tmp_path / "out").symlink_to(tmp_path / "target")
    writing.write_bytes(tmp_path / "out", b"new")
    assert (tmp_path / "out").read_bytes() == b"new"
    assert not (tmp_path / "out").is_symlink()
    assert (tmp_path / "target").read_text() == "old"


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_files_have_the_usual_rights(tmp_path, mask) -> None:
    """Those that the user's mask leaves."""
    before = os.umask(mask)
    try:
        writing.write_bytes(tmp_path / "out", b"new")
    finally:
        os.umask(before)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o666 & ~mask


def test_the_last_file_is_named_last(tmp_path, monkeypatch) -> None:
    """A manifest that is there says that the others are."""
    named, real = [], writing.Path.replace

    def noting(self, target):
        named.append(target.name)
        return real(self, target)

    monkeypatch.setattr(writing.Path, "replace", noting)
    writing.write_together({tmp_path / name: b"" for name in ("a", "b", MANIFEST_NAME)})
    assert named == ["a", "b", MANIFEST_NAME]
