"""The texts of instructions: products of bytes (`dot4`, `pack4`, `bits`), C's vectors, and what fuses.

For groups kernels call functions: `wamnet_packed` makes four floats the bytes of a word, the first one the
lowest; `wamnet_dots(sums, weights, word)` adds to each of four sums the products of one word of weights with
a word; `wamnet_floats` makes sums floats; `wamnet_numbers` reads four words of weights as floats.
"""

from __future__ import annotations

import textwrap

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

OPENCL_ROW = """\
/* Elements of a row from a column on; beyond the row's ends they are those at its ends. */
float{lanes} row_at(__global const float *restrict row, int column, int width)
{{
    if (column >= 0 && column + {lanes} <= width) {{
        return vload{lanes}(0, row + column);
    }}
    float all[{lanes}];
    for (int i = 0; i < {lanes}; ++i) {{
        all[i] = row[clamp(column + i, 0, width - 1)];
    }}
    return vload{lanes}(0, all);
}}
"""
"""Several elements of a row, each of which has its own column within the row. The branch is in each read: one
around all reads of a kernel took half as long again on PoCL."""

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

BYTE_CALLS = (
    (
        "start",
        "wamnet_sums *to, const float *from",
        "*to = _mm512_loadu_si512(from);",
        "memcpy(to->lane, from, sizeof to->lane);",
    ),
    (
        "weights",
        "wamnet_bytes *to, const float *from",
        "*to = _mm512_loadu_si512(from);",
        "memcpy(to->byte, from, sizeof to->byte);",
    ),
    (
        "dot",
        "wamnet_sums *sum, const wamnet_bytes *weight, const uint8_t *four",
        "int32_t word;\nmemcpy(&word, four, 4);\n"
        "*sum = _mm512_dpbusd_epi32(*sum, _mm512_set1_epi32(word), *weight);",
        "const int8_t *w = weight->byte + 4 * i;\n"
        "sum->lane[i] += four[0] * w[0] + four[1] * w[1] + four[2] * w[2] + four[3] * w[3];",
    ),
    (
        "floats",
        "float *to, const wamnet_sums *from",
        "_mm512_storeu_ps(to, _mm512_cvtepi32_ps(*from));",
        "to[i] = (float)from->lane[i];",
    ),
)
"""What is done with vectors of bytes and their sums: name, arguments, by instructions, in each lane `i`."""


def functions(loops: bool) -> str:
    """Return these functions of C; those in loops may take for granted that several vectors are apart."""
    found = []
    for name, takes, at_once, each in BYTE_CALLS:
        body = each if loops else at_once
        if loops and "[i]" in each:
            lines = textwrap.indent(each, "    ")
            body = f"WAMNET_ROLLED\nfor (int i = 0; i < LANES; ++i) {{\n{lines}\n}}"
        if loops and takes.count("wamnet_") > 1:
            takes = takes.replace("*", "*restrict ")
        head = f"static inline void wamnet_{name}({takes})"
        if len(head) > 100:
            head = head.replace(", ", ",\n    ").replace("(", "(\n    ", 1)
        found.append(f"{head}\n{{\n{textwrap.indent(body, '    ')}\n}}\n")
    return "\n".join(found)


C_TILE = f"""\
#if LANES == 16 && defined(__AVX512VNNI__) && defined(__AVX512BW__) && !defined(WAMNET_PORTABLE)
#include <immintrin.h>
typedef __m512i wamnet_sums;
typedef __m512i wamnet_bytes;

{functions(False)}#else
typedef struct {{
    int32_t lane[LANES];
}} wamnet_sums;
typedef struct {{
    int8_t byte[4 * LANES];
}} wamnet_bytes;

{functions(True)}#endif
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

PRAGMAS = """\
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif"""
"""The lines that forbid fusing."""

UNFUSED = f"""\
/* No product may be fused with a sum. Compilers differ in what they obey, so give them -ffp-contract=off too:
   clang takes the standard's pragma unless it is told -ffp-contract=fast, GCC ignores that and takes its own,
   others may ignore both. */
{PRAGMAS}"""
"""The same with an explanation."""

RESTRICT = """\
#if defined(__cplusplus)
#define restrict __restrict /* what compilers of C++ call it */
#endif"""
"""The lines that make the header C++."""

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


CLONES = """\
/* Compiled for newer processors too: by GCC each function on vectors, by clang wamnet_image alone. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GLIBC__) && defined(__OPTIMIZE__) && \\
    !defined(__AVX__) && !defined(WAMNET_PORTABLE)
#if defined(__clang__) && __clang_major__ >= 14
#define WAMNET_CLONES __attribute__((always_inline))
#define WAMNET_IMAGE_CLONES __attribute__((target_clones("fma", "default")))
#elif !defined(__clang__) && __GNUC__ >= 12
#define WAMNET_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#endif
#endif
"""
"""The attributes of functions on vectors."""

CLONED = """\
#if defined(WAMNET_CLONES)
WAMNET_CLONES
#endif"""
"""The attribute of the function that is declared next."""

CLONED_IMAGE = CLONED.replace("CLONES", "IMAGE_CLONES")
"""The same of the function of all pixels."""

TRANSFORMS = "\n".join(
    f"{CLONED}\nstatic void wamnet_{name}(const wamnet_vector *from, int step, wamnet_vector *to, int leap);"
    for name in ("forward", "backward")
)
"""The attribute of transforms, which are defined below."""

LANEWISE = (
    ("wamnet_sum", "wamnet_vector b", "+", "b.lane[i]"),
    ("wamnet_difference", "wamnet_vector b", "-", "b.lane[i]"),
    ("wamnet_scaled", "float b", "*", "b"),
)
"""Operations on vectors in C: name, second argument, operator, and that argument in lane `i`."""


def c_vectors(lanes: str) -> str:
    """Return the type of vectors of so many floats, and what is done with them, by operators or in loops."""
    calls = [
        (name, f"wamnet_vector a, {other}", "", f"{sign}= {lane}") for name, other, sign, lane in LANEWISE
    ]
    others = "\n".join(
        f"static inline wamnet_vector {name}({takes})\n{{\n{first}    WAMNET_ROLLED\n"
        f"    for (int i = 0; i < {lanes}; ++i) {{\n        a.lane[i] {each};\n    }}\n    return a;\n}}\n"
        for name, takes, first, each in (("wamnet_zero", "void", "    wamnet_vector a;\n", "= 0.0f"), *calls)
    )
    macros = "".join(f"#define {name}(a, b) ((a) {sign} (b))\n" for name, _, sign, _ in LANEWISE)
    return f"""\
{CLONES}/* GCC's vectors are fast where the processor has registers of so many floats, else very slow. */
#if defined(__GNUC__) && __GNUC__ >= 4 && !defined(WAMNET_PORTABLE) && (defined(__clang__) || \\
    {lanes} <= 4 || ({lanes} <= 8 && defined(__AVX__)) || defined(__AVX512F__) || defined(WAMNET_CLONES))
typedef float wamnet_vector __attribute__((vector_size(4 * {lanes}), aligned(4), may_alias));
#define wamnet_zero() ((wamnet_vector){{0}})
{macros}#else
typedef struct {{
    float lane[{lanes}];
}} wamnet_vector;

{others}#endif"""


CUDA_VECTOR = """\
#ifndef WAMNET_VECTOR
#define WAMNET_VECTOR
struct __align__(16) wamnet_vector { float x, y, z, w; };
static __device__ inline wamnet_vector wamnet_made(float x, float y, float z, float w)
{
    wamnet_vector made = {x, y, z, w};
    return made;
}
static __device__ inline wamnet_vector operator*(wamnet_vector a, float b)
{
    return wamnet_made(a.x * b, a.y * b, a.z * b, a.w * b);
}
static __device__ inline void operator+=(wamnet_vector &a, wamnet_vector b)
{
    a = wamnet_made(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}
static __device__ inline void operator-=(wamnet_vector &a, wamnet_vector b)
{
    a = wamnet_made(a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w);
}
#endif
"""
"""Vectors of four, with the operations that sums need: CUDA's own have none."""

BUILTINS = """\
#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_floor)
#define FLOOR(a) __builtin_elementwise_floor(a)
#endif
#if __has_builtin(__builtin_convertvector)
#define CONVERT(a, kind) __builtin_convertvector(a, kind)
#endif
#endif
#ifndef FLOOR
#define FLOOR(a) floor(a)
#endif
#ifndef CONVERT
#define CONVERT(a, kind) convert_##kind(a)
#endif"""
"""Operations on vectors that no operator means. PoCL's library may be compiled for another processor than the
kernel: LLVM then inlines none of its functions, and each call saves all vector registers. clang has names for
the instructions; other compilers get the functions."""
