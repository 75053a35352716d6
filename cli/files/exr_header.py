"""The headers of an OpenEXR file as they lie in it, read before its pixels.

1. A header is a list of attributes: name, type, bytes [`read_headers`]. Another kind or version of file, a
   damaged header, and an attribute or channel that appears twice are rejected, each with its own message.
2. Text is UTF-8. If an attribute's is not, all of it is read as Latin-1, which gives every byte a character
   and keeps the order of channels.
3. The OpenEXR package takes only UTF-8: it is given a copy [`File.in_utf8`], and what it writes gets the
   source's bytes back [`File.restore`]. A header of another length moves the chunks, so their offsets change.

Source: "OpenEXR File Layout" of the OpenEXR documentation.
"""

import mmap
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.reading import refusing
from ..common.inputs import check_input

PREFIX = 8
"""Bytes before the first header: those and the version with its flags."""

VERSION = 2
"""The version of the format; the flags below are in the same 32 bits."""

LONG_NAMES, DEEP, MULTI_PART = 0x400, 0x800, 0x1000
"""Flags: names of up to 255 bytes, pixels of several samples, a list of headers."""

PIXEL_FACTS = 16
"""Bytes after a channel's name: pixel type, a flag, its sampling in x and y."""


class Attribute(NamedTuple):
    """An attribute as it is in the file."""

    name: bytes
    kind: bytes
    data: bytes


@dataclass(frozen=True)
class Part:
    """One part: attributes by name, and the sampling (x, y) of each channel; all text in UTF-8."""

    attributes: Mapping[str, Attribute]
    channels: Mapping[str, tuple[int, int]]
    deep: bool

    def text(self, name: str) -> str:
        """Return an attribute of text, or "" where there is none."""
        attribute = self.attributes.get(name)
        return attribute.data.decode() if attribute and attribute.kind == b"string" else ""

    def texts(self, name: str) -> list[str]:
        """Return a list of texts, empty where there is none."""
        attribute = self.attributes.get(name)
        if attribute is None or attribute.kind != b"stringvector":
            return []
        return [text.decode() for text in _strings(attribute.data)]

    def numbers(self, name: str, kind: str, default: Sequence[float]) -> tuple[float, ...]:
        """Return an attribute of as many numbers as the default, which stands for one that is missing."""
        attribute = self.attributes.get(name)
        if attribute is None:
            return tuple(default)
        values = np.frombuffer(attribute.data, kind).tolist()
        if len(values) != len(default):
            raise ValueError(f"{name} has {len(values)} numbers instead of {len(default)}")
        return tuple(values)

    @property
    def window(self) -> tuple[float, ...]:
        """The data window: left, top, right, bottom, all inside."""
        return self.numbers("dataWindow", "<i4", (0, 0, 0, 0))


@dataclass(frozen=True)
class File:
    """The headers of a file as they are, where they end, its version, and its parts in UTF-8."""

    path: Path
    version: int
    headers: Sequence[Sequence[Attribute]]
    end: int
    parts: Sequence[Part]

    @property
    def deep(self) -> list[str]:
        """Return the names of the parts with several samples per pixel."""
        return [part.text("name") for part in self.parts if part.deep]

    @contextmanager
    def in_utf8(self) -> Iterator[Path]:
        """Yield a path under which the package can read the file: its own, or that of a copy in UTF-8."""
        headers = [[_in_utf8(attribute) for attribute in header] for header in self.headers]
        if headers == self.headers:
            yield self.path
            return
        with TemporaryDirectory() as folder:
            copy = Path(folder) / "copy.exr"
            with refusing("input file", str(self.path), "its table of offsets is damaged", "export it again"):
                copy.write_bytes(_rewritten(self.path, self, headers))
            yield copy

    def restore(self, path: Path) -> None:
        """Give attributes and channels that a written file has of this one their bytes back."""
        own: dict[tuple[bytes, bytes], bytes] = {}

        def restored(attribute: Attribute) -> Attribute:
            return _changed(attribute, lambda text: own.get((attribute.name, text), text))

        for attribute in (attribute for header in self.headers for attribute in header):
            read = _in_utf8(attribute)
            if read != attribute:
                pairs = zip(_texts(read), _texts(attribute), strict=True)
                own |= {(read.name, new): old for new, old in pairs}
        if own:
            written = _read(path)
            headers = [[restored(attribute) for attribute in header] for header in written.headers]
            path.write_bytes(_rewritten(path, written, headers))


def read_headers(path: Path) -> File:
    """Return the headers of an OpenEXR file."""
    check_input(path)
    with refusing("input file", str(path), "its header is damaged", "export it again"):
        file = _read(path)
        for part in file.parts:
            left, top, right, bottom = part.window
            if right < left or bottom < top or not part.channels:
                raise ValueError("it has no pixels")
    return file


def _read(path: Path) -> File:
    """Return the headers of a file, or raise ValueError."""
    with path.open("rb") as opened:
        # A header may have megabytes, the pixels behind it far more.
        size = path.stat().st_size
        content = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
        if content[:4] != b"\x76\x2f\x31\x01":
            rule = "is not an OpenEXR image"
            raise InputError("input file", str(path), rule, "render or export it as .exr")
        if size <= PREFIX:
            raise ValueError("it ends before the first attribute")
        version = int.from_bytes(content[4:PREFIX], "little")
        if version & 0xFF != VERSION:
            rule = f"is OpenEXR version {version & 0xFF}, and version {VERSION} is read"
            raise InputError("input file", str(path), rule, "export it again")
        headers: list[list[Attribute]] = []
        end = PREFIX
        while not headers or (version & MULTI_PART and content[end : end + 1] != b"\0"):
            attributes, end = _attributes(content, end)
            headers.append(attributes)
        end += bool(version & MULTI_PART)
    return File(path, version, headers, end, [_part(path, header, version) for header in headers])


def _part(path: Path, header: Sequence[Attribute], version: int) -> Part:
    """Return what a header says; refuse names that appear twice."""
    readable = [_in_utf8(attribute) for attribute in header]
    attributes = {attribute.name.decode(): attribute for attribute in readable}
    _once(path, "attributes", [attribute.name.decode() for attribute in readable])
    entries = list(_channels(attributes["channels"].data)) if "channels" in attributes else []
    _once(path, "channels", [name.decode() for name, _ in entries])
    sampling = {name.decode(): np.frombuffer(facts, "<i4")[2:].tolist() for name, facts in entries}
    kind = attributes["type"].data if "type" in attributes else b""
    deep = kind.startswith(b"deep") or bool(version & DEEP and not version & MULTI_PART)
    return Part(attributes, {name: (x, y) for name, (x, y) in sampling.items()}, deep)


def _once(path: Path, what: str, names: Sequence[str]) -> None:
    """Refuse a header with two things of one name: a reader would take either."""
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"{path}: {what}", ", ".join(twice), "appear twice in one header", "rename one")


def _attributes(content: mmap.mmap | bytes, at: int) -> tuple[list[Attribute], int]:
    """Return the attributes of the header that begins there, and where it ends."""
    attributes = []
    while content[at : at + 1] != b"\0":
        name, at = _name(content, at)
        kind, at = _name(content, at)
        length = int.from_bytes(content[at : at + 4], "little", signed=True)
        data = bytes(content[at + 4 : at + 4 + max(length, 0)])
        if len(data) != length:
            raise ValueError(f"attribute {name.decode(errors='replace')} ends behind the file")
        attributes.append(Attribute(name, kind, data))
        at += 4 + length
    return attributes, at + 1


def _name(content: mmap.mmap | bytes, at: int) -> tuple[bytes, int]:
    """Return a name that ends in a zero byte, and where the next thing begins."""
    end = content.find(b"\0", at, at + 255 + 1)
    if end <= at:
        raise ValueError("a name is missing, or does not end")
    return bytes(content[at:end]), end + 1


def _channels(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the name and the other facts of each channel of a list."""
    at = 0
    while data[at : at + 1] != b"\0":
        name, at = _name(data, at)
        facts = data[at : at + PIXEL_FACTS]
        if len(facts) < PIXEL_FACTS:
            raise ValueError("the list of channels ends too early")
        yield name, facts
        at += PIXEL_FACTS


def _strings(data: bytes) -> Iterator[bytes]:
    """Yield the texts of a list of texts."""
    at = 0
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "little")
        yield data[at + 4 : at + 4 + length]
        at += 4 + length


def _changed(attribute: Attribute, change: Callable[[bytes], bytes]) -> Attribute:
    """Return an attribute with all of its text changed."""
    name, kind, data = attribute
    if kind == b"string":
        data = change(data)
    elif kind == b"stringvector":
        texts = [change(text) for text in _strings(data)]
        data = b"".join(len(text).to_bytes(4, "little") + text for text in texts)
    elif kind == b"chlist":
        data = b"".join(change(channel) + b"\0" + facts for channel, facts in _channels(data)) + b"\0"
    return Attribute(change(name), change(kind), data)


def _texts(attribute: Attribute) -> list[bytes]:
    """Return all text of an attribute."""
    texts: list[bytes] = []
    _changed(attribute, lambda text: texts.append(text) or text)  # type: ignore[func-returns-value]
    return texts


def _in_utf8(attribute: Attribute) -> Attribute:
    """Return an attribute in UTF-8: as it is, or its text taken for Latin-1."""
    try:
        for text in _texts(attribute):
            text.decode()
    except UnicodeDecodeError:
        return _changed(attribute, lambda text: text.decode("latin-1").encode())
    return attribute


def _rewritten(path: Path, file: File, headers: Sequence[Sequence[Attribute]]) -> bytes:
    """Return a file's bytes with other headers; the offsets of its chunks move with them."""
    content = path.read_bytes()
    start = content[:4] + (file.version | LONG_NAMES).to_bytes(4, "little")
    for header in headers:
        for name, kind, data in header:
            start += name + b"\0" + kind + b"\0" + len(data).to_bytes(4, "little") + data
        start += b"\0"
    start += b"\0" * bool(file.version & MULTI_PART)
    # The tables of all parts follow the headers, up to the chunk that comes first.
    at, first, table = file.end, len(content), bytearray()
    while at + 8 <= first:
        offset = int.from_bytes(content[at : at + 8], "little")
        first = min(first, offset or first)
        # The offset of a chunk that was never written is 0.
        table += (offset + len(start) - file.end if offset else 0).to_bytes(8, "little")
        at += 8
    return start + bytes(table) + content[at:]
