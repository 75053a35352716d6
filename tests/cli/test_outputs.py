"""Tests of safe writing: all or nothing, and every refusal before the work starts."""

import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.cli.files import exr, images
from wamnet.cli.files.outputs import check_output, replacing, spelled, write_text
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame


def test_a_complete_file_replaces_the_old_one(tmp_path: Path) -> None:
    """The new content is there, nothing else is, and everyone may read it who may read new files."""
    out = tmp_path / "a.txt"
    out.write_text("old")
    write_text(out, "new")
    assert out.read_text() == "new"
    assert list(tmp_path.iterdir()) == [out]
    other = tmp_path / "b.txt"
    other.touch()
    assert out.stat().st_mode == other.stat().st_mode


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, SystemExit])
@pytest.mark.parametrize("existed", [False, True])
def test_an_interrupted_writer_leaves_no_trace(tmp_path: Path, error: type, existed: bool) -> None:
    """Ctrl-C in the middle: the old file stays as it was, or there is none."""
    out = tmp_path / "a.exr"
    if existed:
        out.write_text("old")

    def write_and_fail() -> None:
        with replacing(out) as new:
            assert (new.parent, new.suffix) == (tmp_path, ".exr"), "only there replacing is one step"
            assert new != out
            new.write_text("half")
            raise error

    with pytest.raises(error):
        write_and_fail()
    assert [p.read_text() for p in tmp_path.iterdir()] == (["old"] if existed else [])


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("a.jpg", r"output file '.*a\.jpg': must end in \.exr or \.png"),
        ("dir.exr", r"is a folder \(give the name of a file"),
        ("device.exr", "is not a regular file"),
        ("none/a.exr", r"output folder '.*none': not found \(create it: mkdir -p"),
        ("in.exr", r"is an input of this command \(choose another name"),
        ("link.exr", r"is an input of this command \(choose another name"),
        ("a.EXR", None),
        ("out.exr", None),
    ],
)
def test_outputs_that_are_refused(tmp_path: Path, name: str, rule: str | None) -> None:
    """Folders and devices are not replaced, nor is an input, whatever the name of the same file."""
    source = tmp_path / "in.exr"
    source.write_text("data")
    (tmp_path / "link.exr").symlink_to(source)
    (tmp_path / "device.exr").symlink_to(os.devnull)
    (tmp_path / "dir.exr").mkdir()
    inputs = (source, tmp_path / "missing.exr")
    with pytest.raises(InputError, match=rule) if rule else nullcontext():
        check_output(tmp_path / name, (".exr", ".png"), inputs)
    assert source.read_text() == "data"


def test_a_folder_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The super user may write anywhere, so the system's answer is replaced."""
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(InputError, match=r"output folder .* cannot be written \(choose another with -o"):
        check_output(tmp_path / "a.exr")


def full(*_args: object, **_options: object) -> None:
    """Stand for a system call on a full disk."""
    raise OSError(28, "No space left on device", "/tmp/.secret-name")


def test_a_full_disk_names_the_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the temporary file, which nobody has named."""
    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(InputError, match=r"output file '.*a\.txt': cannot be written: No space left"):
        write_text(tmp_path / "a.txt", "text")


@settings(max_examples=60, deadline=None)
@given(st.text(st.characters(exclude_categories=())))
def test_no_text_brings_control_characters_into_a_file(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    """Escapes of names went into findings.csv and index.html, which a terminal obeys; surrogates raised."""
    path = tmp_path_factory.mktemp("text") / "text"
    write_text(path, text)
    written = path.read_text(encoding="utf-8")
    assert written.replace("\n", "").isprintable()
    assert written == text or not text.replace("\n", "").isprintable()


NAME = st.binary(min_size=1, max_size=20).filter(lambda name: not set(name) & set(b"/\0"))
"""What Linux takes for a name."""


@settings(max_examples=25, deadline=None)
@given(folder=NAME, name=NAME)
def test_any_bytes_are_the_name_of_a_frame(
    tmp_path_factory: pytest.TempPathFactory, folder: bytes, name: bytes
) -> None:
    """A frame was written under n\\xff.exr, and then was "not an OpenEXR image"."""
    place = tmp_path_factory.mktemp("names") / f"f{os.fsdecode(folder)}"
    place.mkdir()
    path = place / f"n{os.fsdecode(name)}.exr"
    frame = Frame({"color": np.full((2, 3, 3), 0.25, np.float32)}, {})
    exr.write_frame(path, frame)
    assert np.array_equal(exr.read_frame(path).layers["color"], frame.layers["color"])
    picture = path.with_suffix(".png")
    images.write_png(picture, np.zeros((2, 3, 3), np.uint8))
    assert images.read_png(picture).shape == (2, 3, 3)
    assert sorted(place.iterdir()) == sorted([path, picture])
    with spelled(path) as spelt:
        assert Path(spelt.encode().decode()).read_bytes() == path.read_bytes()


def test_a_full_disk_while_exr_is_written(tmp_path: Path) -> None:
    """OpenEXR tells it by errors of its own; here the largest size of a file is the limit."""
    code = (
        "import resource, sys; from pathlib import Path; import numpy as np; import OpenEXR\n"
        "from wamnet.cli.files import exr; from wamnet.refimpl.frame import Frame\n"
        "from wamnet.refimpl.errors import InputError\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        "noise = np.random.default_rng(1).random((64, 64, 3)).astype(np.float32)\n"
        "try: exr.write_frame(Path('a.exr'), Frame({'color': noise}))\n"
        "except InputError as error: print(error)\n"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert done.stderr == ""
    assert done.stdout.startswith("output file 'a.exr': cannot be written: ")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_while_a_kernel_is_written(
    tmp_path: Path, samples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is named."""
    from wamnet.cli.commands.choose import Request
    from wamnet.cli.commands.compile import OfScene, compile_model
    from wamnet.cli.common.request import KernelRequest

    monkeypatch.setattr(Path, "write_bytes", full)
    given = {"of_scene": OfScene(), "network": KernelRequest(), "limits": Request()}
    with pytest.raises(InputError, match=r"output folder '.*kernel': cannot be written: No space left"):
        compile_model(str(samples / "model.safetensors"), "glsl", tmp_path / "kernel", **given)
