"""Tests of the headers of OpenEXR files: what is in them, and what cannot be read."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from raw_exr import RawPart, attribute, write_raw

from wamnet.cli.files.exr_header import read_headers
from wamnet.refimpl.errors import InputError

START = b"\x76\x2f\x31\x01\x02\0\0\0"
"""The first bytes of a file of version 2."""

PIXELS = {"R": np.ones((2, 3), np.float32)}


def test_text_in_no_encoding(tmp_path: Path) -> None:
    """The package reads a copy in UTF-8, and the bytes come back to what it writes."""
    owner = attribute("owner", "string", b"Andr\xe9")
    file = read_headers(write_raw(tmp_path / "a.exr", RawPart(PIXELS, owner)))
    with file.in_utf8() as copy:
        content = OpenEXR.File(str(copy), separate_channels=True)
        assert content.header()["owner"] == "André"
        assert (content.channels()["R"].pixels == 1).all()
        content.write(str(tmp_path / "b.exr"))
    assert not copy.exists()
    file.restore(tmp_path / "b.exr")
    assert owner in (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (b"", "is not an OpenEXR image"),
        (b"hello", "is not an OpenEXR image"),
        (b"\x76\x2f\x31\x01", "its header is damaged"),
        (b"\x76\x2f\x31\x01\x03\0\0\0\0", "is OpenEXR version 3, and version 2 is read"),
        (START + b"\0", "has no pixels"),
        (START + b"name", "a name is missing, or does not end"),
        (START + attribute("a", "int", b"abcd")[:-1], "attribute a ends behind the file"),
        (START + attribute("a", "int", b"abcd") * 2 + b"\0", "attributes 'a': appear"),
    ],
)  # fmt: skip
def test_each_cause_has_its_message(tmp_path: Path, content: bytes, rule: str) -> None:
    (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(InputError, match=rule):
        read_headers(tmp_path / "a.exr")


def test_parts_are_as_another_program_wrote_them(tmp_path: Path) -> None:
    """Names, windows, text of several kinds, channels and their sampling, which parts are deep."""
    header = {"type": OpenEXR.scanlineimage, "owner": "André ✓", "multiView": ["l", "r"]}
    samples = np.empty((2, 3), object)
    samples[:] = [[np.ones(2, np.float32)] * 3] * 2
    deep = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    parts = [OpenEXR.Part(header, dict(PIXELS), "a"), OpenEXR.Part(deep, {"R": samples}, "b")]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    flat, other = read_headers(tmp_path / "a.exr").parts
    assert (flat.text("name"), flat.text("owner"), flat.text("none")) == ("a", "André ✓", "")
    assert (flat.texts("multiView"), flat.texts("none")) == (["l", "r"], [])
    assert (flat.window, flat.channels, flat.deep) == ((0, 0, 2, 1), {"R": (1, 1)}, False)
    assert other.deep
