"""What the chunks of a PNG say about its pixels, and its colours in sRGB.

1. A chunk that changes the image appears once; a critical chunk that is unknown, and more than 8 bits per
   channel, which Pillow would cut silently, are rejected [`read_chunks`].
2. Colours are those of the first of these chunks that is there: `cICP` (sRGB only), `iCCP` (converted by its
   profile), `sRGB`, `gAMA` and `cHRM` (converted in float64), else sRGB [`in_srgb`].
3. What an array cannot hold is named: transparency, other frames, fewer significant bits, aspect [`notes`].

Source: Portable Network Graphics (PNG) Specification, third edition, W3C 2025.
"""

from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ...refimpl import encoding
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.frame import Floats
from ...refimpl.reading import refusing
from ..common.packages import need
from . import primaries

SIGNATURE = b"\x89PNG\r\n\x1a\n"
"""First bytes of every PNG."""

CRITICAL = (b"IHDR", b"PLTE", b"IDAT", b"IEND")
"""Chunks that a reader must understand; others of them begin with a capital letter."""

ONCE = (b"IHDR", b"PLTE", b"cICP", b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"sBIT", b"tRNS", b"pHYs", b"acTL")
"""Chunks of which a second one would contradict the first."""

MOST_BITS = 8
"""Most bits per channel."""

UNIT = 100_000
"""What an integer of `gAMA` and `cHRM` is divided by."""

GAMMA_SRGB, SAME_GAMMA = 0.45455, 1e-3
"""The gamma that writers of sRGB state, as the specification recommends, and its rounding."""


def read_chunks(path: Path, content: bytes) -> dict[bytes, bytes]:
    """Return the data of the first chunk of each kind."""
    if not content.startswith(SIGNATURE):
        raise InputError("input file", str(path), "is not a PNG", "export it as .png")
    at, chunks = len(SIGNATURE), dict[bytes, bytes]()
    while at < len(content) and b"IEND" not in chunks:
        length, kind = int.from_bytes(content[at : at + 4], "big"), content[at + 4 : at + 8]
        if kind in chunks and kind in ONCE:
            raise InputError(f"{path}: chunk", kind.decode(), "appears twice", "export it again")
        if kind[:1].isupper() and kind not in CRITICAL:
            rule = "no reader may ignore it, and its meaning is unknown"
            raise InputError(f"{path}: chunk", kind.decode(errors="replace"), rule, "export it again")
        chunks.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 12 + length
    header = chunks.get(b"IHDR", b"")
    if len(header) > MOST_BITS and header[8] > MOST_BITS:
        rule = f"a PNG must have {MOST_BITS} bits per channel or fewer"
        raise InputError(f"{path}: bits per channel", header[8], rule, "use .exr for more")
    return chunks


def in_srgb(path: Path, chunks: Mapping[bytes, bytes], picture: Any) -> tuple[Floats, str]:
    """Return display-encoded colour (H, W, 3) of sRGB of an RGB picture, and what it was converted from."""
    levels = np.asarray(picture)
    if b"cICP" in chunks:
        # Primaries of BT.709, transfer function of sRGB, RGB, full range.
        if chunks[b"cICP"] != bytes([1, 13, 0, 1]):
            shown = ", ".join(map(str, chunks[b"cICP"]))
            raise InputError(f"{path}: cICP", shown, "only 1, 13, 0, 1 is read: sRGB", "convert it to sRGB")
    elif b"iCCP" in chunks:
        converted, name = _by_profile(path, picture)
        if np.abs(converted.astype(int) - levels).max() > 1:
            return encoding.from_8bit(converted), f"the ICC profile {name!r}"
    elif b"sRGB" not in chunks:
        return _by_numbers(path, chunks, encoding.from_8bit(levels))
    return encoding.from_8bit(levels), ""


def _by_profile(path: Path, picture: Any) -> tuple[Any, str]:
    """Return the levels (H, W, 3) of a picture in sRGB, by the profile in it, and the profile's name."""
    color = need("PIL.ImageCms", "to convert by ICC profiles")
    try:
        profile = color.ImageCmsProfile(BytesIO(picture.info["icc_profile"]))
        converted = color.profileToProfile(picture, profile, color.createProfile("sRGB"))
        return np.asarray(converted), color.getProfileDescription(profile).strip()
    except (OSError, KeyError, color.PyCMSError) as error:
        rule = f"is not an RGB profile: {error}"
        raise InputError(f"{path}: iCCP", NO_VALUE, rule, "convert it to sRGB") from None


def _by_numbers(path: Path, chunks: Mapping[bytes, bytes], encoded: Floats) -> tuple[Floats, str]:
    """Return colours (H, W, 3) in sRGB, by gamma and chromaticities, and what they were converted from."""
    names, matrix, linear = [], None, encoding.srgb_decode(encoded)
    with refusing(f"{path}: gAMA or cHRM", NO_VALUE, "must define a colour space", "convert it to sRGB"):
        if b"gAMA" in chunks:
            gamma = int.from_bytes(chunks[b"gAMA"], "big") / UNIT
            if abs(gamma - GAMMA_SRGB) > SAME_GAMMA:
                names, linear = [f"gAMA {gamma:g}"], encoded ** (1.0 / gamma)
        if b"cHRM" in chunks:
            white, *colors = (np.frombuffer(chunks[b"cHRM"], ">u4") / UNIT).reshape(4, 2).tolist()
            with np.errstate(all="ignore"):
                matrix = primaries.conversion([value for color in (*colors, white) for value in color], white)
    if matrix is not None:
        names, linear = [*names, "cHRM"], primaries.converted(linear, matrix)
    return (encoding.to_display(linear), " and ".join(names)) if names else (encoded, "")


def notes(chunks: Mapping[bytes, bytes], picture: Any) -> Iterator[str]:
    """Yield sentences on what the colours of an RGBA picture do not show."""
    if picture.getextrema()[3][0] < encoding.LEVELS:
        yield "transparency is ignored"
    if int.from_bytes(chunks.get(b"acTL", b"")[:4], "big") > 1:
        yield "it is animated, and its default image is read"
    bits, depth = chunks.get(b"sBIT", b""), chunks[b"IHDR"][8]
    # A palette has 8 bits whatever its indices have.
    if bits and min(bits) < (MOST_BITS if b"PLTE" in chunks else depth):
        yield f"its channels have {', '.join(map(str, bits))} significant bits (sBIT)"
    aspect = chunks.get(b"pHYs", b"")
    if aspect[:4] != aspect[4:8]:
        yield "its pixels are not square (pHYs)"
