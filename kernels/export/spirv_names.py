"""Names in SPIR-V: a block without a name of its own gets that of its first member.

glslang gives a block that the text does not name an empty name, and a translator then makes one up: `_709`. A
host that binds by name, as Unity does, needs `weights` and `image_color`, which the manifest says.

1. Words of a module are a head of 5 and then instructions: the first word has the length and the operation.
2. A variable of a buffer points to a structure; `OpMemberName` says what its member 0 is called [`named`].
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...compiler.kernel.interface import WEIGHTS

HEAD = 5
"""Words before the first instruction."""

SOURCE, NAME, MEMBER_NAME, POINTER, FUNCTION, VARIABLE = 3, 5, 6, 32, 54, 59
"""Numbers of OpSource, OpName, OpMemberName, OpTypePointer, OpFunction and OpVariable."""

UNIFORM, BLOCK_NAME = 2, "sizes"
"""The storage class of buffers and blocks; what a block of integers is called, as manifests say it."""

SHORT = {"w": WEIGHTS}
"""What schedules of groups call an array for short."""

Words = NDArray[np.uint32]


def _instructions(words: Words) -> Iterator[tuple[int, Words]]:
    """Yield the number and the operands of each instruction."""
    at = HEAD
    while at < len(words):
        length = int(words[at] >> 16)
        yield int(words[at] & 0xFFFF), words[at + 1 : at + length]
        at += length


def _text(words: Words) -> str:
    """Return the text in operands."""
    return words.tobytes().partition(b"\0")[0].decode()


def _named(number: int, text: str) -> Words:
    """Return the instruction that gives a number a name."""
    raw = text.encode() + b"\0" * (4 - len(text) % 4)
    operands = np.frombuffer(raw, "<u4")
    return np.array([(len(operands) + 2) << 16 | NAME, number, *operands], np.uint32)


def named(binary: bytes) -> bytes:
    """Return a module whose buffers have the names of their first members, its block of integers `sizes`."""
    words: Words = np.frombuffer(binary, "<u4").astype(np.uint32)
    members, structures, names = dict[int, list[str]](), dict[int, int](), dict[int, str]()
    for operation, given in _instructions(words):
        if operation == MEMBER_NAME:
            members.setdefault(int(given[0]), []).append(_text(given[2:]))
        elif operation == POINTER and given[1] == UNIFORM:
            structures[int(given[0])] = int(given[2])
        elif operation == VARIABLE and given[2] == UNIFORM:
            fields = members[structures[int(given[0])]]
            first = SHORT.get(fields[0], fields[0])
            names[int(given[1])] = first if len(fields) == 1 else BLOCK_NAME
        elif operation == FUNCTION:
            break
    written = [words[:HEAD]]
    for operation, given in _instructions(words):
        number = int(given[0]) if operation == NAME else -1
        head = np.array([(len(given) + 1) << 16 | operation], np.uint32)
        written += [_named(number, names[number])] if number in names else [head, given]
    return np.concatenate(written).astype("<u4").tobytes()


def unsourced(binary: bytes) -> bytes:
    """Return a module that does not say its source's language, a number that older readers may not know."""
    words: Words = np.frombuffer(binary, "<u4").astype(np.uint32)
    written = [words[:HEAD]]
    for operation, given in _instructions(words):
        if operation != SOURCE:
            written += [np.array([(len(given) + 1) << 16 | operation], np.uint32), given]
    return np.concatenate(written).astype("<u4").tobytes()
