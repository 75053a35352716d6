"""C99 for path kernels: as many paths at once as a register holds, where the compiler has types of vectors.

One source serves all compilers: the types of values, and their operations, are the header's own [`PATHS`]:
vectors of GCC and clang, else single values. A boolean in a vector is an integer with all bits set, or none.
Sums are bit-identical either way.
"""

from __future__ import annotations

PATHS = """\
/* Paths traced at once: the floats of a vector register, where GCC or clang has vectors and aligns them. */
#if defined(WAMNET_PORTABLE) || !defined(__GNUC__) || (__GNUC__ < 9 && !defined(__clang__)) || \\
    defined(__MINGW32__)
#define WAMNET_PATHS 1
#elif defined(__AVX512F__)
#define WAMNET_PATHS 16
#elif defined(__AVX2__)
#define WAMNET_PATHS 8
#elif defined(__SSE2__) || defined(__ARM_NEON)
#define WAMNET_PATHS 4
#else
#define WAMNET_PATHS 1
#endif
#if WAMNET_PATHS > 1
typedef float wamnet_reals __attribute__((vector_size(4 * WAMNET_PATHS)));
typedef int32_t wamnet_ints __attribute__((vector_size(4 * WAMNET_PATHS)));
typedef uint32_t wamnet_words __attribute__((vector_size(4 * WAMNET_PATHS)));
typedef wamnet_ints wamnet_masks;
#define wamnet_all(type, value) ((value) - __extension__(type){0})
#define wamnet_select(type, mask, a, b) ((type)(((mask) & (wamnet_ints)(a)) | (~(mask) & (wamnet_ints)(b))))
#define wamnet_not(mask) (~(mask))
#define wamnet_lane(value, i) (value)[i]
#define wamnet_convert(type, value) __builtin_convertvector(value, type)
#define wamnet_absolute(value) ((wamnet_reals)((wamnet_ints)(value) & 0x7fffffff))
static inline wamnet_reals wamnet_floor(wamnet_reals x)
{
    /* Cut off towards zero, and one less where that is above; one of 2^23 or more is an integer itself. */
    wamnet_reals near = wamnet_convert(wamnet_reals, wamnet_convert(wamnet_ints, x));
    wamnet_reals below = wamnet_select(wamnet_reals, near > x, near - 1.0f, near);
    return wamnet_select(wamnet_reals, ((wamnet_ints)x & 0x7fffffff) < 0x4b000000, below, x);
}
#else
typedef float wamnet_reals;
typedef int32_t wamnet_ints;
typedef uint32_t wamnet_words;
typedef bool wamnet_masks;
#define wamnet_all(type, value) (value)
#define wamnet_select(type, mask, a, b) ((mask) ? (a) : (b))
#define wamnet_not(mask) (!(mask))
#define wamnet_lane(value, i) (value)
#define wamnet_convert(type, value) ((type)(value))
#define wamnet_absolute(value) fabsf(value)
#define wamnet_floor(value) floorf(value)
#endif

static inline bool wamnet_any(wamnet_masks mask)
{
    bool found = false;
    for (int i = 0; i < WAMNET_PATHS; ++i) {
        found |= wamnet_lane(mask, i) != 0;
    }
    return found;
}

static inline void wamnet_write(float *to, size_t step, wamnet_reals value, int left)
{
    for (int i = 0; i < WAMNET_PATHS && i < left; ++i) {
        to[(size_t)i * step] = wamnet_lane(value, i);
    }
}
"""
"""Types and operations of the values of paths."""

ROOTS = """\
#if WAMNET_PATHS > 1 && defined(__SSE2__)
#include <immintrin.h>
#endif
#if WAMNET_PATHS == 16
#define wamnet_sqrt(x) ((wamnet_reals)_mm512_sqrt_ps((__m512)(x)))
#elif WAMNET_PATHS == 8
#define wamnet_sqrt(x) ((wamnet_reals)_mm256_sqrt_ps((__m256)(x)))
#elif WAMNET_PATHS == 4 && defined(__SSE2__)
#define wamnet_sqrt(x) ((wamnet_reals)_mm_sqrt_ps((__m128)(x)))
#else
#define wamnet_sqrt(x) wamnet_sqrtf(x)
#endif
"""
"""Roots: sqrtf() must set `errno`, so that compilers call it for one value after another."""

EACH = """\
static inline {0} {1}({2})
{{
    {0} found = wamnet_all({0}, 0);
    for (int i = 0; i < WAMNET_PATHS; ++i) {{
        wamnet_lane(found, i) = {3};
    }}
    return found;
}}
"""
"""A function on the values of one path after another."""


def _on_each(name: str, *operands: str) -> str:
    """Return the function that calls one of the library for each path."""
    taken = ", ".join(f"wamnet_reals {each}" for each in operands)
    lanes = ", ".join(f"wamnet_lane({each}, i)" for each in operands)
    return EACH.format("wamnet_reals", f"wamnet_{name}", taken, f"{name}({lanes})")


def _look_up(type_name: str, element: str) -> str:
    """Return the function that reads a table at the index of each path."""
    taken = f"const {element} *table, wamnet_ints index"
    return EACH.format(type_name, f"{type_name}_at", taken, "table[wamnet_lane(index, i)]")


TYPES = {"float32": "wamnet_reals", "int32": "wamnet_ints", "uint32": "wamnet_words", "bool": "wamnet_masks"}
"""The types of values."""

MASKS = {"true": "-1", "false": "0"}
"""A boolean in all lanes."""

NUMBERS_OF_PATHS = EACH.format("wamnet_words", "wamnet_numbers", "void", "(uint32_t)i")
"""The function that numbers the lanes."""

OPERATIONS = {
    **{name: f"wamnet_{name}({{0}})" for name in ("absolute", "floor", "sqrt", "any")},
    **{name: f"wamnet_{name}f({{0}})" for name in ("exp", "sin", "cos")},
    "power": "wamnet_powf({0}, {1})",
    "minimum": "wamnet_select({type}, {1} < {0}, {1}, {0})",
    "maximum": "wamnet_select({type}, {1} > {0}, {1}, {0})",
    "convert": "wamnet_convert({type}, {0})",
    "logical_and": "{0} & {1}",
    "logical_or": "{0} | {1}",
    "logical_not": "wamnet_not({0})",
    "select": "wamnet_select({type}, {0}, {1}, {2})",
    "take": "{type}_at({table}, {0})",
    "lanes": "wamnet_numbers()",
}
"""Operations on values of several paths that are not the operators of single ones."""

HELPERS = {
    **{name: _on_each(f"{name}f", "a") for name in ("exp", "sin", "cos")},
    "sqrt": _on_each("sqrtf", "a") + ROOTS,
    "power": _on_each("powf", "a", "b"),
    "take": _look_up("wamnet_reals", "float") + _look_up("wamnet_ints", "int32_t"),
}
"""The functions that operations call."""
