"""OpenCL C 1.2 for the dot schedule [emit_dot.py]: VNNI's instruction where clang has it, else shifts.

Functions of PoCL's library are not inlined (opencl_tiled.py), so that four bytes are read without `vload4`.
"""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.interface import Interface
from .emit_dot import Dot, DotDialect
from .opencl_tiled import OpenCLTiled

DOTS = """\
typedef int{lanes} sums;
typedef struct __attribute__((packed)) {{ uchar4 bytes; }} fours; /* at any address */
#ifdef __has_builtin
#if defined(__AVX512VNNI__) && LANES == 16 && __has_builtin(__builtin_ia32_vpdpbusd512)
#define DOT(sum, weight, four) __builtin_ia32_vpdpbusd512(sum, (sums)(as_int(four)), weight)
#endif
#endif
#ifndef DOT
#define PRODUCT(weight, byte, shift) (((weight) << (sums)(shift) >> (sums)(24)) * (sums)((int)(byte)))
#define DOT(sum, weight, four) \\
    ((sum) + PRODUCT(weight, (four).s0, 24) + PRODUCT(weight, (four).s1, 16) \\
        + PRODUCT(weight, (four).s2, 8) + PRODUCT(weight, (four).s3, 0))
#endif"""
"""The type of vectors of sums, whose lanes hold four bytes of weights each, and four products a lane."""


class OpenCLDot(OpenCLTiled, DotDialect):
    """The dialect's table for vectors of `lanes` sums."""

    kind = "sums"

    def __init__(self, lanes: int) -> None:
        super().__init__(lanes)
        self.macros = f"{self.macros}\n{DOTS.format(lanes=lanes)}"

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [parts.top, self.macros]

    def bytes(self, name: str, count: str) -> str:
        """Return the declaration of an array of bytes."""
        return f"uchar {name}[{count}];"

    def byte_row(self, name: str, place: str, written: bool = False) -> str:
        """Return the declaration of a row that begins at a place of an array of bytes."""
        return f"{'' if written else 'const '}uchar *{name} = {place};"

    def to_byte(self, value: str) -> str:
        """Return the text of a float as a byte n + 128."""
        return f"(uchar)((int)({value}) + 128)"

    def integers_at(self, offset: int, index: str = "") -> str:
        """Return the text of the weights from `offset` on as vectors of integers, or of one of them."""
        start = f"(weights + {offset})" if offset else "weights"
        return f"((__global const sums *){start})" + (f"[{index}]" if index else "")

    def start_sum(self, total: str, offset: int, index: str) -> str:
        """Return the statement that gives a sum vector `index` of the integers from `offset` on."""
        return f"{total} = {self.integers_at(offset, index)};"

    def walk(self, name: str, offset: int, first: str = "") -> str:
        """Return the declaration of a place in the weights: vector `first` of those from `offset` on."""
        return f"__global const sums *{name} = {self.integers_at(offset)}{first and f' + {first}'};"

    def walked(self, name: str, place: str, index: int) -> list[str]:
        """Return the statements that declare the vector `index` vectors after a place."""
        return [f"sums {name} = {place}[{index}];"]

    def add_dot(self, total: str, weight: str, place: str) -> str:
        """Return the statement that adds four products a lane: of weights, and of the bytes at a place."""
        return f"{total} = DOT({total}, {weight}, ((const fours *)({place}))->bytes);"

    def hold_sum(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array of floats, as vector `index`."""
        return f"{name}.all[{index}] = CONVERT({total}, vector);"


OPENCL_DOT = (
    Dot("dot16", "products of bytes, four at a time, of a network of integers", OpenCLDot(16), 16, 14),
)
"""The schedule of bytes."""
