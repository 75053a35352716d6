"""What compilers see of a source: without comments, and each with its own branch of the preprocessor.

A source is printable ASCII and line ends. Neither a comment sign in a comment or a string, nor a backslash
that does not join two lines of a directive, nor the trigraphs' `??` is read [`cleaned`]. Which conditions of
the preprocessor hold is stated here, by language [`TRUE`]; no file is opened, whatever a source includes.
What surrounds the statements has been compared word by word before [../parsing/frames.py].
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from .lanes import Unread

Macros = dict[str, tuple[list[str] | None, str]]
"""Macros by name: what one takes, None where it takes nothing, and what it is."""

COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*|\"[^\"\n]*\"", re.S)
"""Comments, and strings, in which no comment begins."""

WORD = re.compile(r"\"[^\"\n]*\"|[A-Za-z_]\w*|[\d.]\w*|[-+*/%<>=!&|^#]+|\S")
"""What a directive is compared by."""

TRUE: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "c": (
        (),
        (
            "(LANES <= 4 || (LANES <= 8 && defined(__AVX__)) || defined(__AVX512F__)) && "
            "defined(__GNUC__) && __GNUC__ >= 4 && !defined(WAMNET_PORTABLE)",
            "LANES == 16 && defined(__AVX512VNNI__) && defined(__AVX512BW__) && !defined(WAMNET_PORTABLE)",
        ),
    ),
    "opencl": (
        (),
        (
            "__has_builtin",
            "__opencl_c_integer_dot_product_input_4x8bit_packed",
            "defined(__AVX512VNNI__) && LANES == 16 && __has_builtin(__builtin_ia32_vpdpbusd512)",
        ),
    ),
    "glsl-vulkan": ((), ("defined(GL_EXT_integer_dot_product) && !defined(WAMNET_PORTABLE)",)),
}
"""The compilers of a language between which its sources may differ: conditions that hold for each."""


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
