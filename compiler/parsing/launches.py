"""The launches of a source in passes, and the memory between them, of which a manifest has the sizes."""

from __future__ import annotations

import re
from typing import Any

from ..kernel.kernel import BATCH, FLOAT, INT, Array, Expr, Launch, Statement, const, name
from .frames import LAUNCHES
from .grammar import NAME
from .reader import Passes, Unread


def launches(parser: Any) -> list[Statement]:
    """Read the arrays of the device and the launches of a `Parser` [parse.py]; a manifest has their sizes."""
    text, found = parser.parts.get("launches", ""), list[Statement]()
    if not parser.passes:
        return found
    programs_of, memory = parser.passes
    keys = re.findall(r"vec2 (\w+)\[\]|(\w+): array<", parser.parts["memory"])
    keys = ["".join(each) for each in keys]
    textures, has_entries = parser.language.texels, parser.language.lets
    first = 1 if textures else 3 + len(parser.parts["images"].splitlines())
    lines = []
    for number, key in enumerate(keys, first):
        block = f"{key}_buffer" if textures else key.capitalize()
        lines.append(
            f"@group(0) @binding({number}) var<storage, read_write> {key}: array<vec2<f32>>;\n"
            if has_entries
            else f"layout(std430, binding = {number}) restrict buffer {block} {{ vec2 {key}[]; }};\n"
        )
    pattern = LAUNCHES["texels" if textures else "vec2<f32>" if has_entries else "vec2"]
    programs = list(pattern.finditer(text))
    numbers = [int(each["number"]) for each in programs]
    named = keys == sorted(memory) and "".join(lines) == parser.parts["memory"]
    if not named or "".join(each[0] for each in programs) != text:
        raise Unread("other arrays of the device than the manifest's, or other lines than launches'")
    if numbers != [*range(len(programs_of))] or text.count("#if") > 1:
        raise Unread("other launches than the manifest's")
    tiles = name(BATCH[1])
    parser.scope.values |= dict.fromkeys(BATCH, INT)
    for key in keys:
        if not NAME.fullmatch(key):
            raise Unread(f"{key!r} is not a name of an array")
        parser.scope.arrays[key] = (FLOAT.of(2), 1, False)
        parser.scope.words[key] = "var" if has_entries else ""
        found.append(Array(key, FLOAT.of(2), (tiles * (memory[key] // 2),), "device"))
    for each, (of, count) in zip(programs, programs_of, strict=True):
        parser._read(each["body"])
        outer, parser.scope = parser.scope, parser.scope.inner(each["column"], each["row"])
        body = parser._body(end="")
        parser.scope = outer
        found.append(Launch((each["column"], each["row"]), (tiles // of, const(count)), body))
    return found


def batch(passes: Passes) -> Expr:
    """Return the tiles of a picture, a multiple of those of an item."""
    out, of = name("OUT"), max(tiles for tiles, _ in passes[0])
    across, down = ((name(size) + out - 1) // out for size in ("width", "height"))
    return (across * down + (of - 1)) // of * of
