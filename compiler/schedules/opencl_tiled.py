"""OpenCL C 1.2 for the tiled schedule [emit_tiled.py], and the ladder of schedules for processors.

Operators replace functions on vectors. PoCL's library may be compiled for another processor than the kernel:
LLVM then inlines none of its functions, and each call saves all vector registers. `floor` is one instruction
that no operator means; clang has a name for it, and other compilers get the function.
"""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.interface import DENOISE, Interface
from ..languages.opencl import OpenCL
from ..languages.openings import IMAGES
from ..languages.tiled_dialect import ON_INTEGERS, OPERATIONS, TiledDialect
from .emit_tiled import Tiled

MACROS = """\
typedef float{lanes} vector;
typedef int{lanes} mask;
#define MINIMUM(a, b) ((vector)(b) < (vector)(a) ? (vector)(b) : (vector)(a))
#define MAXIMUM(a, b) ((vector)(b) > (vector)(a) ? (vector)(b) : (vector)(a))
#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_floor)
#define FLOOR(a) __builtin_elementwise_floor(a)
#endif
#endif
#ifndef FLOOR
#define FLOOR(a) floor(a)
#endif"""
"""The type of vectors of `lanes` numbers, and functions on them."""

INTEGERS = """\
#define LEAST(kind, a, b) ((kind)(b) < (kind)(a) ? (kind)(b) : (kind)(a))
#define MOST(kind, a, b) ((kind)(b) > (kind)(a) ? (kind)(b) : (kind)(a))
#ifdef __has_builtin
#if __has_builtin(__builtin_convertvector)
#define CONVERT(a, kind) __builtin_convertvector(a, kind)
#endif
#endif
#ifndef CONVERT
#define vector float{lanes}
#define CONVERT(a, kind) CONVERTED(a, kind)
#define CONVERTED(a, kind) convert_##kind(a)
#endif"""
"""What kernels with vectors of integers need in addition."""

ALIGNED = (
    f"{IMAGES};\n"
    "weights, at an address that is a multiple of {bytes}; result: width * height * {channels} floats\n"
    "in the order of the images, encoded as `output` says; width; height."
)
"""What the arguments are: vectors are read from the weights."""


class OpenCLTiled(OpenCL, TiledDialect):
    """The dialect's table for vectors of `lanes` floats."""

    kind = "vector"
    unroll = "#pragma unroll"
    reach = " * PIXELS"
    store = "result[(y * width + x + p) * {channels} + {i}] = {value};"
    said = {DENOISE: f"{ALIGNED}\nGlobal size: at least (ceil(width / {{pixels}}), height)"}

    def __init__(self, lanes: int) -> None:
        self.macros = MACROS.format(lanes=lanes)
        self.types = {"float32": "vector", "bool": "mask", "int32": f"int{lanes}", "uint32": f"uint{lanes}"}
        # What is written for a vector as for a number; truth is an integer with all bits set.
        self.operations = {
            **{name: OpenCL.operations[name] for name in OPERATIONS},
            "absolute": f"as_float{lanes}(as_int{lanes}({{0}}) & 0x7fffffff)",
            "minimum": "MINIMUM({0}, {1})",
            "maximum": "MAXIMUM({0}, {1})",
            "floor": "FLOOR({0})",
            "select": "{0} ? (vector)({1}) : (vector)({2})",
            **{name: OpenCL.operations[name] for name in ON_INTEGERS},
            "convert": "CONVERT({0}, {type})",
            "minimum.int32": f"LEAST(int{lanes}, {{0}}, {{1}})",
            "minimum.uint32": f"LEAST(uint{lanes}, {{0}}, {{1}})",
            "maximum.int32": f"MOST(int{lanes}, {{0}}, {{1}})",
        }
        self.integers_top = (INTEGERS.format(lanes=lanes),)

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [parts.top, self.macros]

    def weights_at(self, offset: int, index: str = "") -> str:
        """Return the text of the weights from `offset` on as vectors, or of one of them."""
        start = f"(weights + {offset})" if offset else "weights"
        return f"((__global const vector *){start})" + (f"[{index}]" if index else "")

    def set_zero(self, total: str) -> str:
        """Return the statement that gives a sum zeros."""
        return f"{total} = (vector)(0.0f);"

    def set_weights(self, total: str, offset: int, index: str) -> str:
        """Return the statement that gives a sum vector `index` of the weights from `offset` on."""
        return f"{total} = {self.weights_at(offset, index)};"

    def add(self, total: str, term: str) -> str:
        """Return the statement that adds a vector to a sum."""
        return f"{total} += {term};"

    def add_product(self, total: str, weight: str, value: str) -> str:
        """Return the statement that adds a vector times a number to a sum."""
        return f"{total} += {weight} * {value};"

    def walk(self, name: str, offset: int, first: str = "") -> str:
        """Return the declaration of a place in the weights: vector `first` of those from `offset` on."""
        return f"__global const vector *{name} = {self.weights_at(offset)}{first and f' + {first}'};"

    def walked(self, name: str, place: str, index: int) -> list[str]:
        """Return the statements that declare the vector `index` vectors after a place."""
        return [f"vector {name} = {place}[{index}];"]

    def advance(self, place: str, vectors: int) -> str:
        """Return the statement that moves a place on."""
        return f"{place} += {vectors};"

    def parameter(self, offset: int, element: str, vectors: int) -> str:
        """Return the text of a parameter's element in a loop over the elements of all pixels."""
        return self.weights_at(offset, f"{element} % {vectors}")

    def held(self, name: str, count: str) -> str:
        """Return the declaration of an array of so many vectors."""
        return f"union {{ vector all[{count}]; float number[{count} * LANES]; }} {name};"

    def hold(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array, as vector `index`."""
        return f"{name}.all[{index}] = {total};"

    def at(self, name: str, place: str) -> str:
        """Return the text of a number of an array."""
        return f"{name}.number[{place}]"

    def element(self, name: str, index: str) -> str:
        """Return the text of an element of an array: a vector."""
        return f"{name}.all[{index}]"

    def elements(self, vectors: str) -> str:
        """Return the text of the number of elements of so many vectors."""
        return vectors


def _tiled(name: str, lanes: int, pixels: int, idea: str) -> Tiled:
    """Return a rung of the ladder: two vectors of neurons at once."""
    return Tiled(name, idea, OpenCLTiled(lanes), lanes, pixels, vectors=2)


OPENCL_LADDER = (
    _tiled("vector16", 16, 1, "a layer's neurons side by side in vectors of 16, one pixel after another"),
    _tiled("tile16", 16, 14, "14 pixels share each weight: 28 vectors of 16 sums stay in registers"),
    _tiled("tile8", 8, 6, "the same for 16 registers of 8 numbers: 6 pixels, 12 vectors of sums"),
    _tiled("tile4", 4, 6, "the same for 16 registers of 4 numbers: 6 pixels, 12 vectors of sums"),
)
"""All schedules for processors except the plain one; AVX-512, AVX2 and SSE or NEON have those registers."""
