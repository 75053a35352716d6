"""Functions that the languages bring, as far as kernels call them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from . import words
from .field import Number, blended, choice, expression, hashed
from .lanes import Unread, Wrong, chosen, clamped
from .memory import Pointer, Texel, Weights
from .tokens import Type

if TYPE_CHECKING:
    from .machine import Machine


def extreme(name: str, sign: int, floats: bool = False) -> Callable[..., Any]:
    """Return min or max, of numbers or of integers; of `floats` only where it makes floats of integers."""

    def of_two(machine: Machine, a: Any, b: Any) -> Any:
        kinds = {n.kind if isinstance(n, Number) else "int32" for n in (a, b)}
        if len(kinds) > 1 or (floats and kinds != {"float32"}):
            raise Unread(f"{name} of {' and '.join(sorted(kinds))}")
        if isinstance(a, Number) or isinstance(b, Number):
            return expression(name, *machine.alike(a, b), commutes=True)
        return clamped(a, b, sign)

    return of_two


MINIMUM, MAXIMUM = extreme("minimum", -1), extreme("maximum", 1)


def clamp(machine: Machine, value: Any, low: Any, high: Any) -> Any:
    """Return a value between two others; of integers the first is not above the second."""
    integers = not isinstance(low, Number) and not isinstance(high, Number)
    if integers and not np.all(machine.operate("<=", low, high) | ~machine.running):
        raise Wrong("a value between two others in no order")
    return MINIMUM(machine, MAXIMUM(machine, value, low), high)


def select(machine: Machine, no: Any, yes: Any, where: Any) -> Any:
    """Return WGSL's choice."""
    if isinstance(where, Number):
        return choice(where, *machine.alike(yes, no))
    return choose(machine, where, yes, no)


def choose(machine: Machine, where: Any, a: Any, b: Any) -> Any:
    """Return a in some lanes and b in the others."""
    if isinstance(where, bool):
        return a if where else b
    if isinstance(a, Number) or isinstance(b, Number):
        return blended(*machine.alike(a, b), where)
    if isinstance(a, (bool, np.ndarray)):
        return np.where(where, a, b)
    if a is None or b is None:
        raise Wrong("a variable is written in some lanes only")
    return chosen(machine.lanes, where, a, b)


def of_one(name: str) -> Callable[..., Any]:
    """Return a function of one number."""
    return lambda machine, a: expression(name, a)


def conversion(kind: str) -> Callable[..., Any]:
    """Return a conversion to a kind of number."""
    return lambda machine, a: machine.converted(a, Type(kind), stated=True)


def as_int(machine: Machine, a: Number) -> Number:
    """Return the bits of a float, of which only the magnitude's are known [`bits`]."""
    return Number(None, hashed("bits", a.known), "int32", compared=(a, a))


def as_float(machine: Machine, a: Number) -> Number:
    """Return the float of a magnitude's bits."""
    if a.compared is None or not np.array_equal(
        a.known, hashed("magnitude", hashed("bits", a.compared[0].known))
    ):
        raise Wrong("it makes a float of other bits than a magnitude's")
    return expression("absolute", a.compared[0])


def bits(name: str, a: Number, b: Number) -> Number:
    """Return what an operator of bits makes of two integers."""
    if name == "bitwise_and" and a.compared and b.literal == 0x7FFFFFFF:
        return Number(None, hashed("magnitude", a.known), "int32", compared=a.compared)
    moved = words.moved(name, a, b)
    if moved is not None:
        return moved
    return expression(name, a, b, commutes=not name.endswith("shift"))


def fetch(machine: Machine, image: Any, place: Any, level: Any) -> Any:
    """Return a texel: of an image, or of the weights."""
    if type(level) is not int or level != 0:
        raise Wrong(f"it reads level {level} of a texture")
    if not isinstance(image, Pointer):
        return Texel(image, *place)
    if not 0 <= place[0] < Weights.TEXELS:
        raise Wrong(f"the weights have no column {place[0]}")
    return (image.memory.load(place[1] * Weights.TEXELS + place[0], 1, machine),)


def size_of(machine: Machine, image: Any, level: Any) -> Any:
    """Return how many pixels a texture has."""
    if type(level) is not int or level != 0:
        raise Wrong(f"it takes the size of level {level} of a texture")
    return image.size


def several(machine: Machine, *given: Any) -> Any:
    """Return a vector of values; one number is each of them."""
    return given[0] if len(given) == 1 and isinstance(given[0], Number) else list(given)


KINDS = {"int": "int32", "uint": "uint32", "float": "float32"}
"""Kinds of numbers by the names of types."""

BUILTINS: dict[str, Callable[..., Any]] = {
    "clamp": clamp, "select": select, "texelFetch": fetch, "textureSize": size_of,
    "min": MINIMUM, **dict.fromkeys(("fmin", "fminf"), extreme("minimum", -1, floats=True)),
    "max": MAXIMUM, **dict.fromkeys(("fmax", "fmaxf"), extreme("maximum", 1, floats=True)),
    **dict.fromkeys(("floor", "floorf"), of_one("floor")),
    **dict.fromkeys(("fabs", "fabsf", "abs"), of_one("absolute")),
    **dict.fromkeys(("int", "i32", "convert_int"), conversion("int32")),
    **dict.fromkeys(("uint", "u32", "convert_uint"), conversion("uint32")),
    **dict.fromkeys(("float", "f32", "convert_float"), conversion("float32")),
    "ivec2": several, **dict.fromkeys(("vec4", "float4"), words.vector("float32")),
    **dict.fromkeys(("ivec4", "make_int4"), words.vector("int32")),
    **{f"as_int{n}": words.seen("int32", as_int) for n in ("", 4, 8, 16)},
    "as_uint": words.seen("uint32", as_int),
    **{f"as_float{n}": words.seen("float32", as_float) for n in ("", 4, 8, 16)},
    **dict.fromkeys(("intBitsToFloat", "__int_as_float"), words.seen("float32", as_float)),
    "memcpy": words.copy, "pack4xI8": words.packed, "dot4I8Packed": words.of_words,
    **dict.fromkeys(("__dp4a", "dotPacked4x8EXT"), words.of_integers),
    "dot_acc_sat_4x8packed_ss_int": words.of_words,
    **dict.fromkeys(("__builtin_ia32_vpdpbusd512", "_mm512_dpbusd_epi32"), words.unsigned_first),
    "_mm512_loadu_si512": words.sixteen, "_mm512_storeu_ps": words.store_sixteen,
    "_mm512_set1_epi32": lambda machine, a: a, "_mm512_cvtepi32_ps": conversion("float32"),
}  # fmt: skip
"""By name: called with the machine and the arguments. Which of these a language has is its own [`calls`]."""
