"""What a source is read by: its tokens one by one, and the names that are known so far [parse.py]."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..kernel.interface import IMAGE, RESULT
from ..kernel.kernel import FLOAT, INT, Expr, Function, Type
from .grammar import FUNCTION, NAME, TOKEN, Language

Passes = tuple[Sequence[tuple[int, int]], Mapping[str, int]]
"""Of each launch the tiles of an item and the lines; of each array of the device its numbers for a tile."""


class Unread(Exception):
    """A source that this grammar does not have."""


@dataclass
class Scope:
    """The names of values and of arrays: their types, numbers of indices, whether components are read too.

    `words`: what each was declared with: a type, GLSL's qualifier, `let` or `var`.
    """

    values: dict[str, Type] = field(default_factory=dict)
    arrays: dict[str, tuple[Type, int, bool]] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)

    def inner(self, *counters: str) -> Scope:
        """Return the names at the beginning of a block, or of a loop with a counter."""
        scope = Scope(dict(self.values), dict(self.arrays), dict(self.words))
        for counter in counters:
            scope.declare(counter, INT, "")
        return scope

    def declare(self, key: str, kind: Type, word: str) -> None:
        """Note a value."""
        self.values[key], self.words[key] = kind, word
        self.arrays.pop(key, None)


class OtherWeights(Exception):
    """A source in which other weights stand than in the file beside it."""


class Reader:
    """The tokens of a part of a source, and the scope at one of them.

    `vector`: the type of the weights. C has vectors in arrays of floats, and functions instead of
    operators (`by_calls`). `bounded`: what an error bound rests on must be there.
    """

    def __init__(self, language: Language, parts: Mapping[str, str], channels: dict[str, int]) -> None:
        self.language, self.parts, self.channels = language, parts, channels
        self.types, self.vector = dict(language.types), FLOAT
        places = (parts.get("column", "x"), parts.get("row", "y"))
        grouped = ("local_x", "local_y", "item") if "shared" in parts else ()
        self.scope = Scope(dict.fromkeys((*places, *grouped, "width", "height"), INT))
        self.place = places
        self.by_calls = self.bounded = False
        self.passes: Passes | None = None
        self.functions: dict[str, Function] = {}
        self.results, self.lines = [RESULT], ""
        self.tokens: list[tuple[str, str]] = []
        self.at, self.depth, self.operator, self.pointer = 0, 0, "", ""

    def _read(self, text: str) -> None:
        """Begin to read the tokens of a text."""
        self.tokens, self.at, at = [], 0, 0
        while at < len(text):
            match = TOKEN.match(text, at)
            if match is None:
                raise Unread(f"{text[at : at + 20]!r} begins with no token")
            if match.lastgroup:
                self.tokens.append((match.lastgroup, match[0].strip()))
            at = match.end()

    def _now(self, ahead: int = 0) -> str:
        """Return a token, or nothing at the end."""
        return self.tokens[self.at + ahead][1] if self.at + ahead < len(self.tokens) else ""

    def _take(self, *texts: str) -> str:
        """Take these tokens, or any one; return the last."""
        for text in texts or (self._now(),):
            if self._now() != text or not text:
                raise Unread(f"{' '.join(t for _, t in self.tokens[self.at : self.at + 6])!r}: no {text!r}")
            self.at += 1
        return self.tokens[self.at - 1][1]

    def _form(self, form: str) -> list[Any]:
        """Read tokens as they stand in a form, and return what stands in its open places.

        An E is an expression, an N a name of a value, a K a type, a W any word.
        """
        found: list[Any] = []
        for word in form.split():
            if word in "ENKW":
                read = {"E": self._expression, "N": self._word, "K": self._type, "W": self._take}[word]
                found.append(read())
            else:
                self._take(word)
        return found

    def _expression(self) -> Expr:
        """Read an expression."""
        raise NotImplementedError

    def _has(self, *texts: str) -> bool:
        """Take these tokens if they are there."""
        there = all(self._now(k) == text for k, text in enumerate(texts))
        self.at += len(texts) * there
        return there

    def _word(self) -> str:
        """Take the name of a value: one of the closed list, or of a layer."""
        word = self._take()
        layer = re.search(rf"\b{IMAGE}{re.escape(word.removeprefix('patch_'))}\b", self.parts["images"])
        taken = ("w", "sums") if self.vector.dtype == "int32" else ("w",)  # `sums`: a type of bytes' kernels
        if not (NAME.fullmatch(word) or FUNCTION.fullmatch(word) or layer) or word in taken:
            raise Unread(f"{word!r} is not a name of a value")
        return word

    def _type(self) -> Type:
        """Take a type."""
        return self._kind(self._take())

    def _kind(self, word: str) -> Type:
        """Return a type by its name."""
        if word not in self.types:
            raise Unread(f"{word!r} is not a type")
        return self.types[word]
