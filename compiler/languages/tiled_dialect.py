"""What a language adds for register tiles [emit_tiled.py]: vectors, sums, weights, arrays of both.

A vector is `LANES` numbers; sums are `PIXELS` x `vectors` of them, `sum[p][j]`. `kind` is the type of a
vector, `unroll` the line before a loop that must become straight code, so that its sums are registers.
An array of vectors can be read number by number [`held`, `at`]; a loop over elements goes through it in the
language's own steps: vectors where operations have words on vectors, else numbers [`elements`, `element`].
`contraction` are the lines that allow a compiler to fuse products with sums.
"""

from __future__ import annotations

from abc import abstractmethod

from .dialect import Dialect

OPERATIONS = (
    *("add", "subtract", "multiply", "divide", "negative", "absolute", "minimum", "maximum", "floor"),
    *("reciprocal", "sqrt", "sin", "cos", "less", "less_equal", "greater", "greater_equal", "select"),
)
"""Operations of which a language has words for elements."""

ON_INTEGERS = ("bitwise_and", "bitwise_xor", "right_shift", "convert")
"""Those on integers, which are written alike for all kinds of element."""


class TiledDialect(Dialect):
    """The words of one language for tiles; what most of them share with C is here."""

    kind: str
    unroll: str = ""
    contraction: tuple[str, ...] = ()

    # ---- numbers and branches ----------------------------------------------------------------------------

    def singles(self, name: str, count: str) -> str:
        """Return the declaration of an array of numbers, also in a language whose values are vectors."""
        return f"float {name}[{count}];"

    def row(self, name: str, place: str, written: bool = False) -> str:
        """Return the declaration of a row that begins at a place of an array of numbers."""
        return f"{'' if written else 'const '}float *{name} = {place};"

    def flag(self, name: str, value: str) -> str:
        """Return the declaration of one boolean."""
        return f"bool {name} = {value};"

    def when(self, condition: str) -> str:
        """Return the line that opens what is done under a condition."""
        return f"if ({condition}) {{"

    def otherwise(self) -> str:
        """Return the line that opens what is done instead, below the brace that closes the former."""
        return "else {"

    def loop_while(self, counter: str, count: str, condition: str) -> str:
        """Return the line that opens a loop of a counter from 0 on, which ends early."""
        return f"for (int {counter} = 0; {counter} < {count} && {condition}; ++{counter}) {{"

    # ---- sums --------------------------------------------------------------------------------------------

    def sums(self, name: str, vectors: int) -> str:
        """Return the declaration of the sums of all pixels."""
        return f"{self.kind} {name}[PIXELS][{vectors}];"

    @abstractmethod
    def set_zero(self, total: str) -> str:
        """Return the statement that gives a sum zeros."""

    @abstractmethod
    def set_weights(self, total: str, offset: int, index: str) -> str:
        """Return the statement that gives a sum vector `index` of the weights from `offset` on."""

    @abstractmethod
    def add(self, total: str, term: str) -> str:
        """Return the statement that adds a vector to a sum."""

    @abstractmethod
    def add_product(self, total: str, weight: str, value: str) -> str:
        """Return the statement that adds a vector times a number to a sum."""

    # ---- weights -----------------------------------------------------------------------------------------

    @abstractmethod
    def walk(self, name: str, offset: int, first: str = "") -> str:
        """Return the declaration of a place in the weights: vector `first` of those from `offset` on."""

    @abstractmethod
    def walked(self, name: str, place: str, index: int) -> list[str]:
        """Return the statements that declare the vector `index` vectors after a place."""

    @abstractmethod
    def advance(self, place: str, vectors: int) -> str:
        """Return the statement that moves a place on."""

    @abstractmethod
    def parameter(self, offset: int, element: str, vectors: int) -> str:
        """Return the text of a parameter's element in a loop over the elements of all pixels."""

    # ---- arrays ------------------------------------------------------------------------------------------

    @abstractmethod
    def held(self, name: str, count: str) -> str:
        """Return the declaration of an array of so many vectors."""

    @abstractmethod
    def hold(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array, as vector `index`."""

    @abstractmethod
    def at(self, name: str, place: str) -> str:
        """Return the text of a number of an array."""

    @abstractmethod
    def element(self, name: str, index: str) -> str:
        """Return the text of an element of an array."""

    @abstractmethod
    def elements(self, vectors: str) -> str:
        """Return the text of the number of elements of so many vectors."""
