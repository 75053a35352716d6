"""Tests of PNG files and of opening a picture of either kind."""

import struct
import zlib
from pathlib import Path

import numpy as np
import PIL.Image
import PIL.ImageCms
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.cli.files import exr, images, png_colors
from wamnet.cli.files.images import read_image, read_png, write_png
from wamnet.refimpl import encoding, reading
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame


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


def chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_raw(path: Path, *chunks: bytes, levels: tuple[int, ...] = (51, 102, 204), depth: int = 8) -> Path:
    """Write a PNG of one pixel with further chunks before its pixel."""
    color = {1: 0, 2: 4, 3: 2, 4: 6}[len(levels)]
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, depth, color, 0, 0, 0))
    pixel = b"".join(level.to_bytes(depth // 8, "big") for level in levels)
    parts = (header, *chunks, chunk(b"IDAT", zlib.compress(b"\0" + pixel)), chunk(b"IEND", b""))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    return path


def gamma(value: float) -> bytes:
    """Return the chunk of a gamma."""
    return chunk(b"gAMA", struct.pack(">I", round(value * 1e5)))


def chromaticities(*values: float) -> bytes:
    """Return the chunk of white, red, green and blue."""
    return chunk(b"cHRM", struct.pack(">8I", *(round(value * 1e5) for value in values)))


def profile() -> bytes:
    """Return the chunk of the profile of sRGB."""
    content = PIL.ImageCms.ImageCmsProfile(PIL.ImageCms.createProfile("sRGB")).tobytes()
    return chunk(b"iCCP", b"icc\0\0" + zlib.compress(content))


P3 = chromaticities(0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060)
SRGB = chromaticities(0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06)


@pytest.mark.parametrize(
    ("chunks", "levels", "note"),
    [
        ([], (51, 102, 204), ""),
        ([chunk(b"sRGB", b"\0"), gamma(1.0), P3], (51, 102, 204), ""),
        ([gamma(0.45455), SRGB], (51, 102, 204), ""),
        ([profile()], (51, 102, 204), ""),
        ([chunk(b"cICP", bytes([1, 13, 0, 1])), gamma(1.0)], (51, 102, 204), ""),
        # By the formula of sRGB, of linear 0.2, 0.4, 0.8.
        ([gamma(1.0)], (124, 170, 231), "converted to sRGB from gAMA 1"),
        # P3's red and green are more saturated: of linear values by its published matrix, 1.2249401,
        # -0.2249404, 0; -0.0420569, 1.0420571, 0; -0.0196376, -0.0786361, 1.0982735.
        ([P3], (27, 104, 211), "converted to sRGB from cHRM"),
        ([chunk(b"sBIT", bytes([5, 6, 5]))], (51, 102, 204), "5, 6, 5 significant bits"),
        # Pillow warns of an animation without frames.
        ([chunk(b"acTL", bytes(8))], (51, 102, 204), ""),
        ([chunk(b"pHYs", struct.pack(">IIB", 1, 2, 0))], (51, 102, 204), "its pixels are not square"),
    ],
)  # fmt: skip
def test_chunks_about_colours(tmp_path: Path, chunks: list[bytes], levels, note: str) -> None:
    """Converted or, where there is nothing to convert, the same bits; and said."""
    told: list[str] = []
    read = read_png(write_raw(tmp_path / "a.png", *chunks), told.append)
    assert encoding.to_8bit(read).tolist() == [[list(levels)]]
    assert (note in told[0]) if note else not told


@pytest.mark.parametrize(
    ("chunks", "levels", "rule"),
    [
        ([], {"levels": (1, 2, 3), "depth": 16}, "bits per channel 16: a PNG must have 8 bits"),
        ([], {"levels": (1,), "depth": 16}, "bits per channel 16"),
        ([gamma(1.0), gamma(0.5)], {}, "chunk 'gAMA': appears twice"),
        ([chunk(b"NEWS", b"")], {}, "chunk 'NEWS': no reader may ignore it"),
        ([chunk(b"cICP", bytes([9, 16, 0, 1]))], {}, "cICP '9, 16, 0, 1': only 1, 13, 0, 1 is read: sRGB"),
        ([chunk(b"iCCP", b"icc\0\0" + zlib.compress(b"no profile"))], {}, "iCCP: is not a"),
        ([gamma(0.0)], {}, "gAMA or cHRM: must define"),
        ([chromaticities(*(0.0,) * 8)], {}, "gAMA or cHRM: must define"),
    ],
)  # fmt: skip
def test_pngs_that_cannot_be_read_as_they_are(tmp_path: Path, chunks: list[bytes], levels, rule: str) -> None:
    """Rather than cut to 8 bits, or taken for sRGB, silently."""
    with pytest.raises(InputError, match=rule):
        read_png(write_raw(tmp_path / "a.png", *chunks, **levels))


def test_transparency_is_named(tmp_path: Path) -> None:
    told: list[str] = []
    read_png(write_raw(tmp_path / "a.png", levels=(1, 2, 3, 255)), told.append)
    read_png(write_raw(tmp_path / "b.png", levels=(1, 2, 3, 254)), told.append)
    assert told == [f"{tmp_path / 'b.png'}: transparency is ignored"]
    PIL.Image.new("P", (1, 1)).save(tmp_path / "b.png", transparency=bytes([0, 255]))
    read_png(tmp_path / "b.png", told.append)
    assert told[1] == told[0]


def test_a_png_that_does_not_fit_the_memory_is_refused_before_its_pixels(tmp_path: Path, monkeypatch) -> None:
    """A few bytes may stand for any size: what the header says is compared with what is free."""
    write_png(tmp_path / "a.png", np.zeros((40, 30, 3)))
    monkeypatch.setattr(reading, "_free_bytes", lambda: images.PNG_BYTES * 1200 - 1)
    with pytest.raises(InputError, match=r"size of .*a\.png '30 x 40': it would take 0 MiB"):
        read_png(tmp_path / "a.png")
    monkeypatch.setattr(reading, "_free_bytes", lambda: images.PNG_BYTES * 1200)
    assert read_png(tmp_path / "a.png").shape == (40, 30, 3)


def test_missing_and_broken_pngs(tmp_path: Path) -> None:
    """Not there; no PNG; cut short."""
    with pytest.raises(InputError, match=r"input file '.*none\.png': not found"):
        read_png(tmp_path / "none.png")
    (tmp_path / "a.png").write_bytes(b"hello")
    with pytest.raises(InputError, match="is not a PNG"):
        read_png(tmp_path / "a.png")
    write_png(tmp_path / "a.png", np.random.default_rng(0).random((40, 40, 3)))
    (tmp_path / "a.png").write_bytes((tmp_path / "a.png").read_bytes()[:-2000])
    with pytest.raises(InputError, match=r"pixels that cannot be read: .*truncated"):
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


@given(st.lists(st.tuples(st.sampled_from([*png_colors.ONCE, b"tEXt"]), st.binary(max_size=40)), max_size=4))
def test_any_chunks_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, chunks) -> None:
    """Colours in [0, 1], or an error of ours."""
    path = tmp_path_factory.mktemp("png") / "a.png"
    write_raw(path, *(chunk(kind, data) for kind, data in chunks))
    try:
        read = read_png(path, lambda text: None)
    except InputError as error:
        message = str(error)
        assert message.isprintable()
        return
    assert ((read >= 0) & (read <= 1)).all()
