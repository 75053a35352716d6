"""The launches of a source in passes, and the memory between them, of which a manifest has the sizes."""

from __future__ import annotations

import re
from typing import Any

from ..kernel.kernel import BATCH, FLOAT, INT, Array, Expr, Launch, Statement, const, name
from .grammar import NAME
from .reader import Passes, Unread


def launches(parser: Any) -> list[Statement]:
    """Read the arrays of the device and the launches of a `Parser` [parse.py]; a manifest has their sizes.

    Each launch begins as the first one, but for its number.
    """
    parts, language, found = parser.parts, parser.language, list[Statement]()
    if not parser.passes:
        return found
    programs, memory = parser.passes
    numbered = enumerate(sorted(memory), 1 if language.texels else 3 + len(parts["images"].splitlines()))
    lines = (language.memory.format(number, key, key.capitalize()) for number, key in numbered)
    if "".join(f"{line}\n" for line in lines) != parts["memory"]:
        raise Unread("other arrays of the device than the manifest's")
    begins = [
        parts["head"].replace(f"{language.launch}0", f"{language.launch}{n}") for n in range(len(programs))
    ]
    begins[1:] = (each.replace("#if", "#elif", 1) for each in begins[1:])
    pattern = "".join(rf"{re.escape(each)}(.*?)\}}\n" for each in begins)
    match = re.fullmatch(pattern, parts["head"] + parts["launches"], re.S)
    if match is None:
        raise Unread("other launches than the manifest's")
    tiles = name(BATCH[1])
    parser.scope.values |= dict.fromkeys(BATCH, INT)
    for key in sorted(memory):
        if not NAME.fullmatch(key):
            raise Unread(f"{key!r} is not a name of an array")
        parser.scope.arrays[key] = (FLOAT.of(2), 1, False)
        parser.scope.words[key] = "var" if language.lets else ""
        found.append(Array(key, FLOAT.of(2), (tiles * (memory[key] // 2),), "device"))
    for text, (of, count) in zip(match.groups(), programs, strict=True):
        parser._read(text)
        outer, parser.scope = parser.scope, parser.scope.inner("tile", "line")
        body = parser._body(end="")
        parser.scope = outer
        found.append(Launch(("tile", "line"), (tiles // of, const(count)), body))
    return found


def batch(passes: Passes) -> Expr:
    """Return the tiles of a picture, a multiple of those of an item."""
    out, of = name("OUT"), max(tiles for tiles, _ in passes[0])
    across, down = ((name(size) + out - 1) // out for size in ("width", "height"))
    return (across * down + (of - 1)) // of * of
