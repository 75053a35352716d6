"""Products of bytes in each language: instructions that a kernel uses as `dot4`, `pack4` and `bits`.

For groups kernels call functions: `wamnet_packed` makes four floats the bytes of a word, the first one the
lowest; `wamnet_dots(sums, weights, word)` adds to each of four sums the products of one word of weights with
a word; `wamnet_floats` makes sums floats; `wamnet_numbers` reads four words of weights as floats.
"""

from __future__ import annotations

PORTABLE = "WAMNET_PORTABLE"
"""What to define where a kernel may use nothing beyond its language's own standard."""

SHIFTED = """\
    return sums + (weights << 24 >> 24) * (word << 24 >> 24) + (weights << 16 >> 24) * (word << 16 >> 24)
        + (weights << 8 >> 24) * (word << 8 >> 24) + (weights >> 24) * (word >> 24);"""
"""Products of bytes with a sign in languages whose vectors can be shifted."""

OPENCL_TILE = """\
typedef int16 sums;
typedef struct __attribute__((packed)) { uchar4 bytes; } fours; /* at any address */
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

OPENCL_GROUP = f"""\
int wamnet_packed(float a, float b, float c, float d)
{{
    uint low = ((uint)(int)a & 255u) | ((uint)(int)b & 255u) << 8;
    return as_int(low | ((uint)(int)c & 255u) << 16 | (uint)(int)d << 24);
}}
int4 wamnet_dots(int4 sums, int4 weights, int word)
{{
#ifdef __opencl_c_integer_dot_product_input_4x8bit_packed
    int x = dot_acc_sat_4x8packed_ss_int(as_uint(weights.x), as_uint(word), sums.x);
    int y = dot_acc_sat_4x8packed_ss_int(as_uint(weights.y), as_uint(word), sums.y);
    int z = dot_acc_sat_4x8packed_ss_int(as_uint(weights.z), as_uint(word), sums.z);
    int w = dot_acc_sat_4x8packed_ss_int(as_uint(weights.w), as_uint(word), sums.w);
    return (int4)(x, y, z, w);
#else
{SHIFTED}
#endif
}}
float4 wamnet_floats(int4 sums)
{{
    return (float4)((float)sums.x, (float)sums.y, (float)sums.z, (float)sums.w);
}}
float4 wamnet_numbers(int4 bits)
{{
    return as_float4(bits);
}}
"""
"""Words of bytes: no sum is near the ends of 32 bits, where the instruction would saturate."""

C_TILE = """\
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

CUDA_GROUP = """\
#ifndef WAMNET_DOTS
#define WAMNET_DOTS
static __device__ inline int wamnet_packed(float a, float b, float c, float d)
{
    unsigned int low = ((unsigned int)(int)a & 255u) | ((unsigned int)(int)b & 255u) << 8;
    return (int)(low | ((unsigned int)(int)c & 255u) << 16 | (unsigned int)(int)d << 24);
}
static __device__ inline int4 wamnet_dots(int4 sums, int4 weights, int word)
{
    int x = __dp4a(weights.x, word, sums.x), y = __dp4a(weights.y, word, sums.y);
    int z = __dp4a(weights.z, word, sums.z), w = __dp4a(weights.w, word, sums.w);
    return make_int4(x, y, z, w);
}
static __device__ inline wamnet_vector wamnet_floats(int4 sums)
{
    return wamnet_made((float)sums.x, (float)sums.y, (float)sums.z, (float)sums.w);
}
static __device__ inline wamnet_vector wamnet_numbers(int4 bits)
{
    float x = __int_as_float(bits.x), y = __int_as_float(bits.y);
    float z = __int_as_float(bits.z), w = __int_as_float(bits.w);
    return wamnet_made(x, y, z, w);
}
#endif
"""
"""Words of bytes in CUDA."""

WGSL_GROUP = """\
fn wamnet_packed(a: f32, b: f32, c: f32, d: f32) -> i32 {
    return bitcast<i32>(pack4xI8(vec4<i32>(vec4<f32>(a, b, c, d))));
}
fn wamnet_dots(sums: vec4<i32>, weights: vec4<i32>, word: i32) -> vec4<i32> {
    let words = bitcast<vec4<u32>>(weights);
    let four = bitcast<u32>(word);
    let x = dot4I8Packed(words.x, four);
    let y = dot4I8Packed(words.y, four);
    let z = dot4I8Packed(words.z, four);
    let w = dot4I8Packed(words.w, four);
    return sums + vec4<i32>(x, y, z, w);
}
fn wamnet_floats(sums: vec4<i32>) -> vec4<f32> {
    return vec4<f32>(sums);
}
fn wamnet_numbers(bits: vec4<i32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(bits);
}
"""
"""Words of bytes in WGSL."""

VULKAN_EXTENSION = (
    f"#if defined(GL_EXT_integer_dot_product) && !defined({PORTABLE})",
    "#define WAMNET_DOT_PRODUCT",
    "#extension GL_EXT_integer_dot_product : require",
    "#endif",
)
"""Asks for Vulkan's products of bytes where the compiler knows them."""

VULKAN_GROUP = f"""\
int wamnet_packed(float a, float b, float c, float d)
{{
    return (int(a) & 255) | ((int(b) & 255) << 8) | ((int(c) & 255) << 16) | (int(d) << 24);
}}
ivec4 wamnet_dots(ivec4 sums, ivec4 weights, int word)
{{
#ifdef WAMNET_DOT_PRODUCT
    int x = dotPacked4x8EXT(weights.x, word), y = dotPacked4x8EXT(weights.y, word);
    int z = dotPacked4x8EXT(weights.z, word), w = dotPacked4x8EXT(weights.w, word);
    return sums + ivec4(x, y, z, w);
#else
{SHIFTED}
#endif
}}
vec4 wamnet_floats(ivec4 sums)
{{
    return vec4(sums);
}}
vec4 wamnet_numbers(ivec4 bits)
{{
    return intBitsToFloat(bits);
}}
"""
"""Words of bytes in GLSL for Vulkan."""
