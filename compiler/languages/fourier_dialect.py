"""What a language adds to the words of tiles for the Fourier schedule [emit_fourier.py].

Vectors are values here: a language's operators add, subtract and multiply them. Functions of the source take
arrays of the work item's own.
"""

from __future__ import annotations

from abc import abstractmethod

from .tiled_dialect import TiledDialect

PLACES = """\
#define PLACE(lane, i) (((lane) / LANES * POINTS * 2 + (i)) * LANES + (lane) % LANES)
#define SPECTRUM(lane, f) (((lane) / LANES * POINTS + (f)) * 4 * LANES + (lane) % LANES)"""
"""Where numbers of a row and of a column are: lanes beyond the first vector lie in further ones."""


class FourierDialect(TiledDialect):
    """The words of one language; `zeros` is a vector of zeros, `functions` are the words before a function.

    `own` is what the names of functions begin with, so that they are nobody else's; `spectrum` is a place in
    the weights, whose name no layer takes where compilers warn of that.
    """

    zeros: str
    functions: str = "void"
    own: str = ""
    spectrum: str = "w"

    def function(self, name: str) -> str:
        """Return the head of a transform: `from` in steps of `step` numbers, `to` in those of `leap`."""
        taken = f"const {self.kind} *from, int step, {self.kind} *to, int leap"
        return f"{self.functions} {self.own}{name}({taken})"

    def call(self, name: str, *given: str) -> str:
        """Return the statement that calls a transform."""
        return f"{self.own}{name}({', '.join(given)});"

    def vector(self, name: str, value: str) -> str:
        """Return the declaration of a vector."""
        return f"{self.kind} {name} = {value};"

    def vectors(self, name: str, *counts: str) -> str:
        """Return the declaration of an array of vectors."""
        return f"{self.kind} {name}{''.join(f'[{count}]' for count in counts)};"

    def numbered(self, name: str, count: str) -> str:
        """Return the declaration of an array of vectors, `all`, that is also one of numbers, `number`."""
        return f"union {{ {self.kind} all[{count}]; float number[{count} * LANES]; }} {name};"

    def pointer(self, name: str, place: str, written: bool = True) -> str:
        """Return the declaration of a place in an array of vectors."""
        return f"{'' if written else 'const '}{self.kind} *{name} = {place};"

    def least(self, a: str, b: str) -> str:
        """Return the text of the smaller one of two integers."""
        return f"min({a}, {b})"

    @abstractmethod
    def weights_at(self, offset: int, index: str = "") -> str:
        """Return the text of the weights from `offset` on as vectors, or of one of them."""
