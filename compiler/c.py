"""C99: a header of `static inline` functions, to be pasted; images, weights and result are arrays of floats.

Contraction (a product fused with a sum) is off in the text itself: by the standard's pragma, which GCC
ignores, and by GCC's own. An option of the compiler that allows more than the standard does, such as
-ffast-math, voids the bound: where a bound is stated, the text refuses to compile with it.
"""

from __future__ import annotations

from .dialect import Dialect
from .profiles import SineContract

HEAD = """\
#ifndef WAMNET_DENOISE_H
#define WAMNET_DENOISE_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
{unordered}"""
"""The first lines."""

UNFUSED = """\
/* No product may be fused with a sum. Compilers differ in what they obey, so give them -ffp-contract=off too:
   clang takes the standard's pragma unless it is told -ffp-contract=fast, GCC ignores that and takes its own,
   others may ignore both. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif"""
"""The lines that forbid fusing."""

ARGUMENTS = """\
{images},
    const float *restrict weights,
    float *restrict result,
    int width,
    int height"""
"""The arguments of the functions; the first also has the place of a pixel."""


def functions(what: str, step: str) -> str:
    """Return the functions up to the statements of the first; `what` it computes, and how a row steps on."""
    return f"""\
/* {what} */
static inline void {{entry}}(
{ARGUMENTS},
    int x,
    int y);

/* All pixels, one after another. */
static inline void wamnet_image(
{ARGUMENTS})
{{{{
    for (int y = 0; y < height; ++y) {{{{
        for (int x = 0; x < width; {step}) {{{{
            {{entry}}({{names}}, weights, result, width, height, x, y);
        }}}}
    }}}}
}}}}

static inline int wamnet_clamp(int value, int low, int high)
{{{{
    return value < low ? low : value > high ? high : value;
}}}}

static inline void {{entry}}(
{ARGUMENTS},
    int x,
    int y)
{{{{
    (void)weights;"""


BEGIN = "\n".join(
    [
        *(HEAD, UNFUSED, "{defines}"),
        functions(
            "One pixel (x, y): its channels are written to `result`, the whole picture's array.", "++x"
        ),
    ]
)
"""What stands before the statements."""


class C(Dialect):
    """The dialect's table."""

    target = "c"
    language = "C99"
    suffix = ".h"
    entry = "wamnet_pixel"
    image_declaration = "    const float *restrict image_{image}"
    image_separator = ",\n"
    begin = BEGIN
    end = """\
}}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
#endif"""
    pixel = "image_{image}[(row * width + column) * {channels} + c]"
    weight = "weights[{index}]"
    store = "result[(y * width + x) * {channels} + {i}] = {value};"
    arguments = (
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "weights; result: width * height * {channels} floats in the same order, encoded as `output` says;\n"
        "width; height: fewer than 2^31 numbers an image.\n"
        "wamnet_image does the whole picture, wamnet_pixel one pixel: call that from your own loops"
    )
    max_output_channels = 2**16
    native_sine = SineContract("sinf() of C99, which promises nothing", None)
    magnitude = "fabsf({0})"
    clamp = "wamnet_clamp"
    unordered = (
        "",
        """\
#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif""",
    )
    types = {**Dialect.types, "int32": "int32_t", "uint32": "uint32_t"}
    table = "static const {type} {name}[{count}] = {{{values}}};"
    operations = {
        **Dialect.operations,
        "absolute": "fabsf({0})",
        "floor": "floorf({0})",
        "sqrt": "sqrtf({0})",
        "power": "powf({0}, {1})",
        "sin": "sinf({0})",
        "cos": "cosf({0})",
        "minimum": "{1} < {0} ? {1} : {0}",
        "maximum": "{1} > {0} ? {1} : {0}",
        "convert": "({type}){0}",
    }
