"""A writer of OpenEXR files that obeys its caller: any attribute, name, part or flag, valid or not.

It writes uncompressed scan lines, one a chunk, so that a test can ask what a reader makes of a file that no
library would write.
"""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

KINDS = {"uint32": 0, "float16": 1, "float32": 2}


def attribute(name: str | bytes, kind: str | bytes, data: bytes) -> bytes:
    """Return an attribute as it is in a file."""
    return _bytes(name) + b"\0" + _bytes(kind) + b"\0" + struct.pack("<i", len(data)) + data


def floats(name: str, kind: str, *values: float) -> bytes:
    """Return an attribute of float32 numbers."""
    return attribute(name, kind, struct.pack(f"<{len(values)}f", *values))


def window(name: str, left: int, top: int, right: int, bottom: int) -> bytes:
    """Return an attribute that is a rectangle."""
    return attribute(name, "box2i", struct.pack("<4i", left, top, right, bottom))


def texts(name: str, *values: str) -> bytes:
    """Return an attribute that is a list of texts."""
    return attribute(name, "stringvector", b"".join(struct.pack("<i", len(v)) + v.encode() for v in values))


class RawPart(NamedTuple):
    """Channels (H, W) by name, further attributes as bytes, the name, and what replaces the usual values."""

    channels: Mapping[str | bytes, Any]
    extra: bytes = b""
    name: str | None = None
    compression: int = 0
    origin: tuple[int, int] = (0, 0)
    display: tuple[int, int, int, int] | None = None
    sampling: int = 1


def write_raw(path: Path, *parts: RawPart, version: int = 2) -> Path:
    """Write parts, as a file of several where there are several, and return the path."""
    several = len(parts) > 1
    start = struct.pack("<iI", 20000630, version | 0x400 | (0x1000 if several else 0))
    headers = b"".join(_header(part, several) for part in parts) + b"\0" * several
    at, table, body = len(start) + len(headers) + 8 * sum(map(_height, parts)), b"", b""
    for index, part in enumerate(parts):
        for row in range(_height(part)):
            data = b"".join(np.ascontiguousarray(part.channels[n][row]).tobytes() for n in _order(part))
            chunk = struct.pack("<i", index) * several
            chunk += struct.pack("<ii", part.origin[1] + row, len(data)) + data
            table += struct.pack("<Q", at + len(body))
            body += chunk
    path.write_bytes(start + headers + table + body)
    return path


def _header(part: RawPart, several: bool) -> bytes:
    """Return the header of a part, with the attributes that all have."""
    entry = "<iBBBBii"
    channels = b"".join(
        _bytes(n) + b"\0" + struct.pack(entry, _kind(part, n), 0, 0, 0, 0, part.sampling, part.sampling)
        for n in _order(part)
    )
    (left, top), height = part.origin, _height(part)
    corners = (left, top, left + next(iter(part.channels.values())).shape[1] - 1, top + height - 1)
    header = attribute("channels", "chlist", channels + b"\0")
    header += attribute("compression", "compression", bytes([part.compression]))
    header += window("dataWindow", *corners) + window("displayWindow", *(part.display or corners))
    header += attribute("lineOrder", "lineOrder", b"\0")
    header += floats("screenWindowCenter", "v2f", 0, 0) + floats("screenWindowWidth", "float", 1)
    if b"pixelAspectRatio" not in part.extra:
        header += floats("pixelAspectRatio", "float", 1)
    if several:
        header += attribute("name", "string", _bytes(part.name or ""))
        header += attribute("type", "string", b"scanlineimage")
        header += attribute("chunkCount", "int", struct.pack("<i", height))
    elif part.name is not None:
        header += attribute("name", "string", _bytes(part.name))
    return header + part.extra + b"\0"


def _order(part: RawPart) -> Sequence[str | bytes]:
    """Return the names in the order of a file: that of their bytes."""
    return sorted(part.channels, key=_bytes)


def _height(part: RawPart) -> int:
    """Return the number of rows."""
    return int(next(iter(part.channels.values())).shape[0])


def _kind(part: RawPart, name: str | bytes) -> int:
    """Return the number of a channel's type."""
    return KINDS[str(part.channels[name].dtype)]


def _bytes(text: str | bytes) -> bytes:
    """Return text in UTF-8, bytes as they are."""
    return text if isinstance(text, bytes) else text.encode()
