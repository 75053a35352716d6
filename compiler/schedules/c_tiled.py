"""C99 for the tiled schedule [emit_tiled.py], and the ladder of schedules of the header.

1. Sums are vectors of `LANES` floats. GCC and clang have a type for them, which stays in registers where the
   processor has such; other compilers and processors get a structure and loops of `LANES` steps, which
   compilers may turn into vector instructions themselves [`VECTORS`]. WAMNET_PORTABLE chooses the structure
   everywhere. Weights need no alignment.
2. Elementwise operations are those of plain C on numbers: compilers make vector instructions of a loop over
   all pixels' numbers by themselves.
3. Where the profile allows it, compilers may fuse products with sums [`FUSED`], which the plain header never
   does: on a processor that has such an instruction it halves the arithmetic.
"""

from __future__ import annotations

from ..languages.c import STACK, C, includes
from ..languages.dialect import Parts
from ..languages.interface import DENOISE, Interface
from ..languages.openings import IMAGES, WEIGHTS_RESULT
from ..languages.tiled_dialect import ON_INTEGERS, OPERATIONS, TiledDialect
from .emit_tiled import Tiled

FUSED = """\
/* A product may be fused with a sum: the bound holds either way. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=fast")
#else
#pragma STDC FP_CONTRACT ON
#endif"""
"""The lines that allow fusing."""

STRAIGHT = """\
#if defined(__clang__)
#define WAMNET_UNROLL _Pragma("unroll")
#elif defined(__GNUC__) && __GNUC__ >= 8
/* GCC makes no vector instructions of floorf() while it has to raise the standard's exceptions, on which no
   number depends. Nor may it carry inputs over from one step to the next, in the registers of the sums. */
#pragma GCC optimize("no-trapping-math", "no-associative-math", "no-predictive-commoning")
#define WAMNET_UNROLL _Pragma("GCC unroll 16")
#define WAMNET_ROLLED _Pragma("GCC unroll 1")
#endif
#if !defined(WAMNET_UNROLL)
#define WAMNET_UNROLL
#endif
#if !defined(WAMNET_ROLLED)
#define WAMNET_ROLLED
#endif"""
"""What makes straight code of loops over pixels, so that sums are registers, and vectors of other loops.

GCC would make straight code of the loops over lanes too, instead of vectors."""

OPERATORS = """\
static inline void wamnet_clear(wamnet_vector *to)
{
    *to = (wamnet_vector){0};
}

static inline void wamnet_load(wamnet_vector *to, const float *from)
{
    *to = *(const wamnet_vector *)from;
}

static inline void wamnet_store(float *to, const wamnet_vector *from)
{
    *(wamnet_vector *)to = *from;
}

static inline void wamnet_add(wamnet_vector *sum, const wamnet_vector *term)
{
    *sum += *term;
}

static inline void wamnet_add_product(wamnet_vector *sum, const wamnet_vector *weight, float value)
{
    *sum += *weight * value;
}
"""
"""What is done with vectors of GCC's type."""

LOOPS = """\
typedef struct {
    float lane[LANES];
} wamnet_vector;

static inline void wamnet_clear(wamnet_vector *to)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        to->lane[i] = 0.0f;
    }
}

static inline void wamnet_load(wamnet_vector *to, const float *from)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        to->lane[i] = from[i];
    }
}

static inline void wamnet_store(float *to, const wamnet_vector *from)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        to[i] = from->lane[i];
    }
}

static inline void wamnet_add(wamnet_vector *restrict sum, const wamnet_vector *restrict term)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        sum->lane[i] += term->lane[i];
    }
}

static inline void wamnet_add_product(
    wamnet_vector *restrict sum,
    const wamnet_vector *restrict weight,
    float value)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        sum->lane[i] += weight->lane[i] * value;
    }
}
"""
"""The type of vectors of other compilers, and what is done with it."""


def gnu_vectors(lanes: str) -> str:
    """Return GCC's type of vectors of so many floats, which need no alignment, and what is done with them."""
    kind = f"__attribute__((vector_size(4 * {lanes}), aligned(4), may_alias))"
    return f"typedef float wamnet_vector {kind};\n\n{OPERATORS}"


VECTORS = f"""\
/* GCC's vectors are fast where the processor has registers of LANES floats, else very slow. */
#if (LANES <= 4 || (LANES <= 8 && defined(__AVX__)) || defined(__AVX512F__)) && defined(__GNUC__) && \\
    __GNUC__ >= 4 && !defined(WAMNET_PORTABLE)
{gnu_vectors("LANES")}#else
{LOOPS}#endif
"""
"""The type of vectors and what is done with them, by GCC and clang, and by other compilers."""


def from_weights(offset: int) -> str:
    """Return the text of the address of the weights from `offset` on."""
    return f"weights + {offset}" if offset else "weights"


class CTiled(C, TiledDialect):
    """The dialect's table."""

    kind = "wamnet_vector"
    unroll = "WAMNET_UNROLL"
    contraction = tuple(FUSED.splitlines())
    pixels = (
        "Pixels (x, y), (x + 1, y), ..., PIXELS of them or to the end of the row: their channels are written "
        "to\n   `result`, the whole picture's array."
    )
    steps = ("x += PIXELS", "++y")
    store = "result[(y * width + x + p) * {channels} + {i}] = {value};"
    said = {
        DENOISE: (
            f"{IMAGES};\n{WEIGHTS_RESULT};\nwidth; height: fewer than 2^31 numbers an image.\n"
            "wamnet_image does the whole picture, wamnet_pixel {pixels} neighbours of a row from (x, y) on:\n"
            "call that from your own loops, for each x that is a multiple of {pixels}\n"
            f"{STACK}"
        )
    }
    operations = {name: C.operations[name] for name in (*OPERATIONS, *ON_INTEGERS)}

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the functions."""
        head = includes(DENOISE, "float", "math", "stdbool", "stdint")
        return [*head, self.unordered[parts.bounded], parts.top, STRAIGHT, VECTORS]

    def set_zero(self, total: str) -> str:
        """Return the statement that gives a sum zeros."""
        return f"wamnet_clear(&{total});"

    def set_weights(self, total: str, offset: int, index: str) -> str:
        """Return the statement that gives a sum vector `index` of the weights from `offset` on."""
        return f"wamnet_load(&{total}, {from_weights(offset)} + ({index}) * LANES);"

    def add(self, total: str, term: str) -> str:
        """Return the statement that adds a vector to a sum."""
        return f"wamnet_add(&{total}, &{term});"

    def add_product(self, total: str, weight: str, value: str) -> str:
        """Return the statement that adds a vector times a number to a sum."""
        return f"wamnet_add_product(&{total}, &{weight}, {value});"

    def walk(self, name: str, offset: int, first: str = "") -> str:
        """Return the declaration of a place in the weights: vector `first` of those from `offset` on."""
        return f"const float *{name} = {from_weights(offset)}{first and f' + {first} * LANES'};"

    def walked(self, name: str, place: str, index: int) -> list[str]:
        """Return the statements that declare the vector `index` vectors after a place."""
        return [f"{self.kind} {name};", f"wamnet_load(&{name}, {place} + {index} * LANES);"]

    def advance(self, place: str, vectors: int) -> str:
        """Return the statement that moves a place on."""
        return f"{place} += {vectors} * LANES;"

    def parameter(self, offset: int, element: str, vectors: int) -> str:
        """Return the text of a parameter's element in a loop over the elements of all pixels."""
        return f"weights[{offset} + {element} % ({vectors} * LANES)]"

    def held(self, name: str, count: str) -> str:
        """Return the declaration of an array of so many vectors."""
        return f"float {name}[{count} * LANES];"

    def hold(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array, as vector `index`."""
        return f"wamnet_store({name} + ({index}) * LANES, &{total});"

    def at(self, name: str, place: str) -> str:
        """Return the text of a number of an array."""
        return f"{name}[{place}]"

    def element(self, name: str, index: str) -> str:
        """Return the text of an element of an array: a number."""
        return f"{name}[{index}]"

    def elements(self, vectors: str) -> str:
        """Return the text of the number of elements of so many vectors."""
        return f"{vectors} * LANES"


def _tiled(name: str, lanes: int, pixels: int, idea: str) -> Tiled:
    """Return a rung of the ladder: two vectors of neurons at once."""
    return Tiled(name, idea, CTiled(), lanes, pixels, vectors=2)


C_LADDER = (
    _tiled("tile16", 16, 14, "14 pixels share each weight: 28 vectors of 16 sums stay in registers"),
    _tiled("tile8", 8, 6, "the same for 16 registers of 8 numbers: 6 pixels, 12 vectors of sums"),
    _tiled("tile4", 4, 6, "the same for 16 registers of 4 numbers: 6 pixels, 12 vectors of sums"),
)
"""All schedules except the plain one; AVX-512, AVX2 and SSE or NEON have those registers."""
