"""The frame of a source: what is outside the bodies of its functions, compared with a closed list.

A source is printable ASCII and line ends. What compilers, linkers and hosts of a language could read in
another way is not understood but compared, word by word: directives, declarations, types, attributes, and the
heads of functions [`check_frame`]. Only names and integers that kernels differ in are open [`HOLES`].

1. Comments go first. Neither a comment sign in a comment or a string, nor a backslash that does not join two
   lines of a directive, nor the trigraphs' `??` is read [`cleaned`].
2. A branch of the preprocessor is one item of the list, with its conditions. Which conditions are true is
   stated by the language [`preprocessed`]; function bodies in all branches are run by the machine.
3. No file is opened, whatever a source includes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from .frames import FRAMES, IMAGES, NEEDS
from .lanes import Unread

Macros = dict[str, tuple[list[str] | None, str]]
"""Macros by name: what one takes, None where it takes nothing, and what it is."""

COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*|\"[^\"\n]*\"", re.S)
"""Comments, and strings, in which no comment begins."""

WORD = re.compile(r"\"[^\"\n]*\"|[A-Za-z_]\w*|[\d.]\w*|[-+*/%<>=!&|^#]+|\S")
"""What an item is compared by."""

HOLES: Mapping[str, str] = {
    "INT": r"\d+", "IMAGE": r"image_\w+", "IMAGE_BLOCK": r"Image_\w+", "ELEMENTWISE": r"elementwise_\d+",
    "ELEMENTWISE_of_one": r"elementwise_\d+_of_one", "PLACES": "(?:int x , int y|int tile_x , int tile_y)",
    "FLOATS": r"float v\d+(?: , float v\d+)*", "VECTORS": r"VECTOR v\d+(?: , VECTOR v\d+)*",
    "WGSL_FLOATS": r"v\d+ : f32(?: , v\d+ : f32)*",
    "WGSL_VECTORS": r"v\d+ : vec4 < f32 >(?: , v\d+ : vec4 < f32 >)*",
}  # fmt: skip
"""Words of the list that stand for what kernels differ in."""

REPEATED = re.compile("IMAGE|ELEMENTWISE|pragma unroll")
"""What an item of the list has if a source may have several such, of different names."""

FIRST = re.compile("version|extension|include|precision|CONTRACT|define PRECISE|# ?error")
"""What comes before all functions."""

WIDTH = re.compile(r"(?m)^typedef (?:float|int)(\d+) (?:vector|mask)\b|^# define vector float(\d+)")
"""How many numbers OpenCL's vectors have, by each of the words that say so."""

LAST = re.compile("# ?undef|pop_options")
"""What comes behind all functions."""


def cleaned(source: str) -> str:
    """Return a source with blanks for its comments; directives of several lines are one."""
    source = re.sub(r"(?m)^#.*\\\n(?:.*\\\n)*", lambda m: m[0].replace("\\\n", " "), source)
    foreign = re.search(r"[^\n -~]|\?\?|\\", source)
    if foreign:
        raise Unread(f"line {source.count(chr(10), 0, foreign.start()) + 1}: {foreign[0]!r}")

    def blank(m: re.Match[str]) -> str:
        if "/*" in m[0][1:] or (m[0][0] == '"' and "//" in m[0]):
            raise Unread(f"a comment sign in {m[0][:60]!r}")
        line = source[source.rfind("\n", 0, m.start()) + 1 : m.start()]
        if "\n" in m[0] and "#" in line:
            raise Unread("a directive that continues behind a comment")
        return m[0] if m[0][0] == '"' else " " + "\n" * m[0].count("\n")

    blanked = COMMENT.sub(blank, source)
    for sign in ("/*", "*/"):
        if sign in blanked:
            raise Unread(f"line {blanked.count(chr(10), 0, blanked.index(sign)) + 1}: {sign!r}")
    return blanked


def normal(text: str) -> str:
    """Return the words of a text with a blank between each."""
    return " ".join(WORD.findall(text))


def items(source: str, closed: bool = False) -> Iterator[str]:
    """Yield what is outside functions: a directive, a declaration, a head with `{ }` for its body.

    From `#if` to its `#endif` all is one item, line by line. `closed`: a struct ends with its brace.
    """
    branch: list[str] = []
    depth = 0
    for item in _pieces(source, closed):
        branch.append(item)
        word = re.match("(?:in a body )?# ?(if|endif)", item)
        depth += {"if": 1, "endif": -1}[word[1]] if word else 0
        if depth < 0:
            raise Unread("an #endif without its #if")
        if not depth:
            yield "\n".join(branch)
            branch = []
    if depth:
        raise Unread("an #if without its #endif")


def _pieces(source: str, closed: bool) -> Iterator[str]:
    """Yield items, and those of a branch one by one."""
    depth, body, text = 0, False, ""
    for line in source.splitlines():
        if line.lstrip().startswith("#"):
            if text.strip():
                raise Unread(f"a directive inside of {normal(text)[:60]!r}")
            yield ("in a body " if depth else "") + normal(line)
            continue
        for piece in filter(None, re.split(r"([{};])", line)):
            depth += (piece == "{") - (piece == "}")
            if depth < 0:
                raise Unread("a brace that closes nothing")
            if body:
                body = depth > 0
                continue
            text += piece + " "
            body = depth == 1 and bool(HEAD.match(normal(text)))
            if body or (not depth and (piece == ";" or (closed and piece == "}"))):
                yield normal(text) + (" }" if body else "")
                text = ""
    if depth or text.strip():
        raise Unread("a source that ends too early")


HEAD = re.compile(r"(?!typedef|struct|layout)[^{}]*\)( -> [\w<> ]+)? {$")
"""What comes before the body of a function."""


@cache
def allowed(target: str) -> list[tuple[re.Pattern[str], bool]]:
    """Return patterns of the items of a target's list, and whether there may be several of each."""
    images = IMAGES.get(target, "IMAGE")
    vector = {"opencl": "float4", "cuda": "wamnet_vector", "metal": "float4"}.get(target, "vec4")
    patterns = []
    for item in items(cleaned(FRAMES[target]), target == "wgsl"):
        words = [
            f"{images}(?: , {images})*" if word == "IMAGES" else HOLES.get(word, re.escape(word))
            for word in re.split("( |\n)", item)
        ]
        pattern = "".join(words).replace("VECTOR v", vector + " v")
        pattern = re.sub(r"\b(?:IMAGE|INT)\b", lambda m: HOLES[m[0]], pattern)
        patterns.append((re.compile(pattern), bool(REPEATED.search(item))))
    return patterns


def check_frame(source: str, target: str, floats: bool) -> None:
    """Refuse a source, cleaned, that has outside its functions what is not in its target's list."""
    guard = GUARD.fullmatch(source) if target == "c" else None
    if target == "c" and not guard:
        raise Unread("a header without its guard")
    own = [*items(guard[1] if guard else source, target == "wgsl")]
    seen: set[Any] = set()
    functions = [k for k, item in enumerate(own) if "{ }" in item] or [0]
    for k, item in enumerate(own):
        at = next((i for i, (p, _) in enumerate(allowed(target)) if p.fullmatch(item)), None)
        if at is None:
            raise Unread(f"{item[:100]!r} outside of functions")
        several = allowed(target)[at][1]
        if (at in seen and not several) or (item in seen and "pragma" not in item):
            raise Unread(f"a second {item[:100]!r}")
        seen |= {at, item}
        late = re.match("# define", item) and k > functions[-1]
        if late or (FIRST.search(item) and k > functions[0]) or (LAST.search(item) and k < functions[-1]):
            raise Unread(f"{item[:100]!r} at another place")
        behind = [one for one in own[:k] if one.startswith(("uniform", "layout"))]
        if (item.startswith("# version") and k) or (item.startswith("precision") and behind):
            raise Unread(f"{item[:100]!r} behind {own[k - 1][:100]!r}")
        if item.startswith("using") and not any("include" in one for one in own[:k]):
            raise Unread(f"{item[:100]!r} before its library")
    if target == "glsl-es" and not source.startswith("#version"):
        raise Unread("a source that does not begin with its version")
    _check_together(own, source)
    needs = NEEDS.get(target, {})
    for words in needs.get("all", ()) + needs.get("floats", ()) * floats:
        if not any(words in item for item in own):
            raise Unread(f"a source without {words!r}")


def _check_together(own: Sequence[str], source: str) -> None:
    """Refuse items that may each be there, but not together."""
    widths = {a or b for item in own for a, b in WIDTH.findall(item)}
    if len(widths) > 1:
        raise Unread(f"vectors of {' and of '.join(sorted(widths))} numbers")
    if "memcpy" in source and "# include < string .h >" not in own:
        raise Unread("memcpy without string.h")
    if sum("FP_CONTRACT" in item for item in own) > 1:
        raise Unread("a second pragma of products that are fused")


def preprocessed(source: str, true: Sequence[str]) -> tuple[str, Macros]:
    """Return what of a source, cleaned, is read where these conditions hold and no other; and its macros."""
    holds, macros = {normal(t) for t in true}, dict(BROUGHT)
    lines: list[str] = []
    branches: list[list[bool]] = []
    for line in source.splitlines():
        lines.append("")
        if not line.lstrip().startswith("#"):
            lines[-1] = line if all(b[0] for b in branches) else ""
            continue
        word, _, rest = normal(line).removeprefix("# ").removeprefix("#").partition(" ")
        if word in ("if", "ifdef", "ifndef"):
            holding = rest in holds or rest in macros
            branches.append([holding != (word == "ifndef"), holding != (word == "ifndef")])
        elif word in ("elif", "else"):
            branches[-1] = [not branches[-1][1] and (word == "else" or rest in holds), True]
        elif word == "endif":
            branches.pop()
        elif (word, rest) == ("pragma", "unroll") and all(b[0] for b in branches):
            lines[-1] = UNROLLED
        elif word == "define" and all(b[0] for b in branches):
            name, takes, body = DEFINE.findall(line.strip())[0]
            if name not in BROUGHT:
                macros[name] = re.findall(r"\w+", takes) if takes else None, body
    return "\n".join(lines), macros


GUARD = re.compile(r"\s*#ifndef WAMNET_DENOISE_H\n#define WAMNET_DENOISE_H\n(.*)\n#endif\s*", re.S)
"""A header of C, between the directives that let it be included twice."""

DEFINE = re.compile(r"#define\s+(\w+)(\([\w, ]*\))?(.*)")
"""A macro: its name, what it takes, and what it is."""

UNROLLED = "\x01"
"""What stands for a pragma on the loop behind it: no source has this character."""

BROUGHT: Macros = {
    "CONVERT": (["a", "kind"], "((kind)(a))"), "FLOOR": (["a"], "floor(a)"), "PRECISE": (None, "precise"),
    "restrict": (None, ""),
    "WAMNET_UNROLL": (None, UNROLLED), "WAMNET_ROLLED": (None, UNROLLED),
}  # fmt: skip
"""Macros by what they mean, whichever way a compiler has for it."""
