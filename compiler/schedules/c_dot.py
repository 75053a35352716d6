"""C99 for the dot schedule [emit_dot.py]: VNNI's instruction where the processor has it, else loops.

AVX-512 VNNI's `vpdpbusd` multiplies 64 bytes without a sign by 64 with one and adds them up by fours, without
saturation. Without it, plain C says the same, which compilers turn into what they have.
"""

from __future__ import annotations

from ..languages.c import includes
from ..languages.dialect import Parts
from ..languages.interface import DENOISE, Interface
from .c_tiled import STRAIGHT, CTiled, from_weights
from .emit_dot import Dot, DotDialect

DOTS = """\
#if LANES == 16 && defined(__AVX512VNNI__) && defined(__AVX512BW__) && !defined(WAMNET_PORTABLE)
#include <immintrin.h>
typedef __m512i wamnet_sums;
typedef __m512i wamnet_bytes;

static inline void wamnet_start(wamnet_sums *to, const float *from)
{
    *to = _mm512_loadu_si512(from);
}

static inline void wamnet_weights(wamnet_bytes *to, const float *from)
{
    *to = _mm512_loadu_si512(from);
}

static inline void wamnet_dot(wamnet_sums *sum, const wamnet_bytes *weight, const uint8_t *four)
{
    int32_t word;
    memcpy(&word, four, 4);
    *sum = _mm512_dpbusd_epi32(*sum, _mm512_set1_epi32(word), *weight);
}

static inline void wamnet_floats(float *to, const wamnet_sums *from)
{
    _mm512_storeu_ps(to, _mm512_cvtepi32_ps(*from));
}
#else
typedef struct {
    int32_t lane[LANES];
} wamnet_sums;
typedef struct {
    int8_t byte[4 * LANES];
} wamnet_bytes;

static inline void wamnet_start(wamnet_sums *to, const float *from)
{
    memcpy(to->lane, from, sizeof to->lane);
}

static inline void wamnet_weights(wamnet_bytes *to, const float *from)
{
    memcpy(to->byte, from, sizeof to->byte);
}

static inline void wamnet_dot(
    wamnet_sums *restrict sum,
    const wamnet_bytes *restrict weight,
    const uint8_t *restrict four)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        const int8_t *w = weight->byte + 4 * i;
        sum->lane[i] += four[0] * w[0] + four[1] * w[1] + four[2] * w[2] + four[3] * w[3];
    }
}

static inline void wamnet_floats(float *to, const wamnet_sums *from)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        to[i] = (float)from->lane[i];
    }
}
#endif
"""
"""The types of vectors of sums and of bytes, and what is done with them."""


class CDot(CTiled, DotDialect):
    """The dialect's table."""

    kind = "wamnet_sums"

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the functions."""
        head = includes(DENOISE, "float", "math", "stdbool", "stdint", "string")
        return [*head, parts.top, STRAIGHT, DOTS]

    def bytes(self, name: str, count: str) -> str:
        """Return the declaration of an array of bytes."""
        return f"uint8_t {name}[{count}];"

    def byte_row(self, name: str, place: str, written: bool = False) -> str:
        """Return the declaration of a row that begins at a place of an array of bytes."""
        return f"{'' if written else 'const '}uint8_t *{name} = {place};"

    def to_byte(self, value: str) -> str:
        """Return the text of a float as a byte n + 128."""
        return f"(uint8_t)((int32_t)({value}) + 128)"

    def start_sum(self, total: str, offset: int, index: str) -> str:
        """Return the statement that gives a sum vector `index` of the integers from `offset` on."""
        return f"wamnet_start(&{total}, {from_weights(offset)} + ({index}) * LANES);"

    def walked(self, name: str, place: str, index: int) -> list[str]:
        """Return the statements that declare the vector `index` vectors after a place."""
        return [f"wamnet_bytes {name};", f"wamnet_weights(&{name}, {place} + {index} * LANES);"]

    def add_dot(self, total: str, weight: str, place: str) -> str:
        """Return the statement that adds four products a lane: of weights, and of the bytes at a place."""
        return f"wamnet_dot(&{total}, &{weight}, {place});"

    def hold_sum(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array of floats, as vector `index`."""
        return f"wamnet_floats({name} + ({index}) * LANES, &{total});"


C_DOT = (Dot("dot16", "products of bytes, four at a time, of a network of integers", CDot(), 16, 14),)
"""The schedule of bytes."""
