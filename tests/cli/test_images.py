"""Tests of PNG files and of opening a picture of either kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.cli.files import exr, images
from wamnet.cli.files.images import read_image, read_png, write_png
from wamnet.refimpl import encoding, reading
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame


@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 99))
def test_png_round_trip(tmp_path_factory: pytest.TempPathFactory, height: int, width: int, seed: int) -> None:
    """Levels come back exactly."""
    path = tmp_path_factory.mktemp("png") / "a.png"
    levels = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    write_png(path, encoding.from_8bit(levels))
    assert (encoding.to_8bit(read_png(path)) == levels).all()


def test_row_0_is_the_top(tmp_path: Path) -> None:
    """As another program sees it: x to the right, y down."""
    picture = np.zeros((2, 3, 3))
    picture[0, 2] = (1.0, 0.5, 0.0)
    write_png(tmp_path / "a.png", picture)
    with PIL.Image.open(tmp_path / "a.png") as image:
        assert image.size == (3, 2)
        assert image.getpixel((2, 0)) == (255, 128, 0)


@pytest.mark.parametrize("mode", ["L", "LA", "P", "RGBA"])
def test_other_8_bit_pngs(tmp_path: Path, mode: str) -> None:
    """Grey, palette and transparency become colour."""
    PIL.Image.new("RGB", (3, 2), (255, 255, 255)).convert(mode).save(tmp_path / "a.png")
    assert (read_png(tmp_path / "a.png") == np.ones((2, 3, 3))).all()


def test_16_bit_png_is_refused(tmp_path: Path) -> None:
    """Rather than cut to 8 bits silently."""
    PIL.Image.fromarray(np.full((2, 3), 40000, np.uint16)).save(tmp_path / "a.png")
    with pytest.raises(
        InputError, match=r"pixel format is I;16.*: a PNG must have 8 bits a channel; use \.exr"
    ):
        read_png(tmp_path / "a.png")


def test_a_png_that_does_not_fit_the_memory_is_refused_before_its_pixels(tmp_path: Path, monkeypatch) -> None:
    """A few bytes may stand for any size: what the header says is compared with what is free."""
    write_png(tmp_path / "a.png", np.zeros((40, 30, 3)))
    monkeypatch.setattr(reading, "_free_bytes", lambda: images.PNG_BYTES * 1200 - 1)
    with pytest.raises(InputError, match=r"size of .*a\.png is 30 x 40: it would take 0 MiB"):
        read_png(tmp_path / "a.png")
    monkeypatch.setattr(reading, "_free_bytes", lambda: images.PNG_BYTES * 1200)
    assert read_png(tmp_path / "a.png").shape == (40, 30, 3)


def test_missing_and_broken_pngs(tmp_path: Path) -> None:
    """Not there; no PNG; cut short."""
    with pytest.raises(InputError, match=r"input file is .*none\.png: it does not exist"):
        read_png(tmp_path / "none.png")
    (tmp_path / "a.png").write_bytes(b"hello")
    with pytest.raises(InputError, match=r"it is not a readable PNG"):
        read_png(tmp_path / "a.png")
    write_png(tmp_path / "a.png", np.random.default_rng(0).random((40, 40, 3)))
    (tmp_path / "a.png").write_bytes((tmp_path / "a.png").read_bytes()[:-2000])
    with pytest.raises(InputError, match=r"it is not a readable PNG"):
        read_png(tmp_path / "a.png")


def test_exr_and_png_in_both_forms(tmp_path: Path) -> None:
    """Linear from the EXR, display-encoded from the PNG, and each in the other form, with exposure."""
    linear = np.array([[[0.1, 0.5, 4.0]]], np.float32)
    exr.write_frame(tmp_path / "a.exr", Frame({"color": linear}))
    image = read_image(tmp_path / "a.exr", -1.0)
    assert (image.linear == linear).all()
    assert (image.display == encoding.to_display(linear, -1.0)).all()
    write_png(tmp_path / "a.png", image.display)
    image = read_image(tmp_path / "a.PNG".replace("PNG", "png"), -1.0)
    assert (image.display == encoding.from_8bit(encoding.to_8bit(encoding.to_display(linear, -1.0)))).all()
    assert (image.linear == encoding.from_display(image.display, -1.0)).all()


def test_another_kind_of_file(tmp_path: Path) -> None:
    """The suffix decides."""
    with pytest.raises(InputError, match=r"a\.jpg: its name must end in \.exr or \.png; convert it"):
        read_image(tmp_path / "a.jpg")
