"""The words of a source without its comments and directives, macros replaced: `tokens`; and its types."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from wamnet.compiler.parsing.parse import Unread

Macros = dict[str, tuple[list[str] | None, str]]
"""Macros by name: what one takes, None where it takes nothing, and what it is."""

UNROLLED = "\x01"
"""What stands for a pragma on the loop behind it: no source has this character."""

Tree = tuple[Any, ...]
"""An expression: its form, then its parts."""

Token = tuple[str, str, int]
"""Its kind, its text, and its line."""

TOKEN = re.compile(
    r"\s+|(?P<number>(?:0[xX][0-9a-fA-F]+[uU]?|(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d{1,3})?[fF]?|(?!0\d)\d+[uU]?)(?![\w.]))"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<text>\"[^\"]*\")"
    r"|(?P<sign>->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|::|[-+*/%&|^!<>=?:;,.(){}\[\]@\x01])"
)
"""Numbers, names, texts and signs."""

MOST_DIGITS = 64
"""Most characters of a number, so that none takes long to read."""

MOST_TOKENS = 2**20
"""Most tokens of a source: no kernel comes near."""


def tokens(text: str, macros: Macros | None = None) -> list[Token]:
    """Return (kind, text, line) of every token of a source without comments, macros replaced."""
    text = re.sub(r"\bunsigned int\b", "uint", text)
    result, at, line = [], 0, 1
    while at < len(text):
        m = TOKEN.match(text, at)
        if not m or (m["number"] and len(m[0]) > MOST_DIGITS):
            raise Unread(f"line {line}: {text[at : at + 20]!r}")
        if m.lastgroup:
            result.append((m.lastgroup, m[0], line))
        line += m[0].count("\n")
        at = m.end()
    own = {name: (takes, tokens(body)) for name, (takes, body) in (macros or {}).items()}
    result = [*_expanded(result, own)]
    if len(result) > MOST_TOKENS:
        raise Unread(f"{len(result)} tokens: at most {MOST_TOKENS} are read")
    return result


def _expanded(sequence: list[Token], macros: Mapping[str, Any]) -> Iterator[Token]:
    """Yield tokens, macros replaced: each by what it is, and by that once."""
    at = 0
    while at < len(sequence):
        kind, text, line = sequence[at]
        at += 1
        if kind != "name" or text not in macros:
            yield sequence[at - 1]
            continue
        takes, body = macros[text]
        parts: list[list[Token]] = [[]]
        if takes is not None:
            if at == len(sequence) or sequence[at][1] != "(":
                raise Unread(f"line {line}: {text} without its arguments")
            depth = 1
            while depth and (at := at + 1) < len(sequence):
                sign = sequence[at][1]
                depth += (sign in "([{") - (sign in ")]}")
                if sign == "," and depth == 1:
                    parts.append([])
                elif depth:
                    parts[-1].append(sequence[at])
            at += 1
            if depth or len(parts) != len(takes):
                raise Unread(f"line {line}: arguments of {text}")
        values = dict(zip(takes or (), parts, strict=False))
        rest = {name: macro for name, macro in macros.items() if name != text}
        done = [one for token in body for one in values.get(token[1], [(token[0], token[1], line)])]
        yield from _expanded(done, rest)


def constant(tree: Tree) -> int:
    """Return the value of an expression of literal integers."""
    if tree[0] == "number":
        return int(tree[1].rstrip("uU"), 0)
    if tree[0] == "binary" and tree[1] in ("+", "-", "*", "/"):
        a, b = constant(tree[2]), constant(tree[3])
        return {"+": a + b, "-": a - b, "*": a * b, "/": a // b if b else 0}[tree[1]]
    raise Unread(f"the size of a type: {tree!r}")


def rounds(tree: Tree) -> bool:
    """Return whether an expression is a sum, a product, or a function of numbers."""
    form, *given = tree
    if form == "choice":
        return any(map(rounds, given[1:]))
    if form in ("binary", "call"):
        return given[0] in ("+", "-", "*", "/") or given[0] in [("name", n) for n in ("min", "max", "floor")]
    return form in ("unary", "cast") and rounds(given[1])


@dataclass(frozen=True)
class Type:
    """A type: of one number, or of `width` of them; a struct by its name.

    A pointer or reference to them has their address `space`, in its language's word; `fixed`: they are const.
    """

    kind: str
    width: int = 1
    pointer: bool = False
    reference: bool = False
    space: str = ""
    fixed: bool = False


@dataclass
class Variable:
    """A name with its type; `sizes` of an array, expressions; `shared` by a group; `role`: what brings it."""

    name: str
    type: Type
    sizes: list[Any] = field(default_factory=list)
    shared: bool = False
    role: str = ""


@dataclass
class Function:
    """A function: what it takes, its statements, and the type that it returns."""

    name: str
    takes: list[Variable]
    body: Tree
    type: Type


@dataclass
class Text:
    """A parsed text: functions and variables outside them by name, structs' members, sizes of work groups.

    `vectors`: names of members that are all of a struct.
    """

    functions: dict[str, Function] = field(default_factory=dict)
    outside: list[tuple[Variable, Any]] = field(default_factory=list)
    structs: dict[str, list[Variable]] = field(default_factory=dict)
    group: list[Tree] = field(default_factory=list)
    bindings: dict[str, int] = field(default_factory=dict)
    vectors: set[str] = field(default_factory=set)
