"""The closed lists of frame.py: all that a source may have outside the bodies of its functions.

Each list is a source without bodies: `check_frame` reads it as it reads a kernel's. `INT`, `IMAGE` and the
other words of `HOLES` are open. What a bound rests on is in `NEEDS`, by language: words of which an item must
have all. `TRUE` are the conditions that hold for some compiler; all others do not.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

LISTS = r"""
== window ==
#define WINDOW_SIZE INT
#define WINDOW_CENTRE INT

== group ==
#define GROUP_WIDTH INT
#define GROUP_HEIGHT INT
#define TILE_WIDTH (GROUP_WIDTH * PIXELS + WINDOW_SIZE - 1)
#define TILE_HEIGHT (GROUP_HEIGHT + WINDOW_SIZE - 1)
#define PLANE (TILE_WIDTH * TILE_HEIGHT)
#define TILE_NUMBERS (PLANE * INT)

== tiles ==
#define LANES INT
#define PATCH_WIDTH (WINDOW_SIZE + PIXELS - 1)
#define POINTS INT
#define OUT (POINTS - WINDOW_SIZE + 1)
#define TILES INT
#define PAIRS INT
#define BLOCK INT
#define INPUTS INT
#define NEURONS INT
#define STRIDE (2 * (POINTS + 1))
#define PLACE(lane, i) (((lane) / LANES * POINTS * 2 + (i)) * LANES + (lane) % LANES)
#define SPECTRUM(lane, f) (((lane) / LANES * POINTS + (f)) * 4 * LANES + (lane) % LANES)

== pixels ==
#define PIXELS INT

== c-loads ==
static inline void wamnet_clear(wamnet_vector *to) { }
static inline void wamnet_load(wamnet_vector *to, const float *from) { }
static inline void wamnet_store(float *to, const wamnet_vector *from) { }

== c-sums ==
static inline void wamnet_add(wamnet_vector *sum, const wamnet_vector *term) { }
static inline void wamnet_add_product(wamnet_vector *sum, const wamnet_vector *weight, float value) { }

== c-words ==
static inline void wamnet_start(wamnet_sums *to, const float *from) { }
static inline void wamnet_weights(wamnet_bytes *to, const float *from) { }

== c ==
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#if defined(__cplusplus)
#define restrict __restrict
#endif
#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=fast")
#else
#pragma STDC FP_CONTRACT ON
#endif
#if defined(__clang__)
#define WAMNET_UNROLL _Pragma("unroll")
#elif defined(__GNUC__) && __GNUC__ >= 8
#pragma GCC optimize("no-trapping-math", "no-associative-math", "no-predictive-commoning")
#define WAMNET_UNROLL _Pragma("GCC unroll 16")
#define WAMNET_ROLLED _Pragma("GCC unroll 1")
#endif
#if !defined(WAMNET_UNROLL)
#define WAMNET_UNROLL
#endif
#if !defined(WAMNET_ROLLED)
#define WAMNET_ROLLED
#endif
#if (LANES <= 4 || (LANES <= 8 && defined(__AVX__)) || defined(__AVX512F__)) && defined(__GNUC__) && \
    __GNUC__ >= 4 && !defined(WAMNET_PORTABLE)
typedef float wamnet_vector __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
%c-loads%%c-sums%
#else
typedef struct { float lane[LANES]; } wamnet_vector;
%c-loads%
static inline void wamnet_add(wamnet_vector *restrict sum, const wamnet_vector *restrict term) { }
static inline void wamnet_add_product(
    wamnet_vector *restrict sum, const wamnet_vector *restrict weight, float value) { }
#endif
#if LANES == 16 && defined(__AVX512VNNI__) && defined(__AVX512BW__) && !defined(WAMNET_PORTABLE)
#include <immintrin.h>
typedef __m512i wamnet_sums;
typedef __m512i wamnet_bytes;
%c-words%
static inline void wamnet_dot(wamnet_sums *sum, const wamnet_bytes *weight, const uint8_t *four) { }
static inline void wamnet_floats(float *to, const wamnet_sums *from) { }
#else
typedef struct { int32_t lane[LANES]; } wamnet_sums;
typedef struct { int8_t byte[4 * LANES]; } wamnet_bytes;
%c-words%
static inline void wamnet_dot(
    wamnet_sums *restrict sum, const wamnet_bytes *restrict weight, const uint8_t *restrict four) { }
static inline void wamnet_floats(float *to, const wamnet_sums *from) { }
#endif
#if !defined(__GNUC__)
#error this schedule needs the vectors of GCC or clang: export a schedule of tiles for other compilers
#endif
typedef float wamnet_vector __attribute__((vector_size(4 * INT), aligned(4), may_alias));
%c-loads%%c-sums%
static void wamnet_forward(const wamnet_vector *from, int step, wamnet_vector *to, int leap) { }
static void wamnet_backward(const wamnet_vector *from, int step, wamnet_vector *to, int leap) { }
static inline void wamnet_pixel(
    IMAGES, const float *restrict weights, float *restrict result, int width, int height, PLACES);
static inline void wamnet_pixel(
    IMAGES, const float *restrict weights, float *restrict result, int width, int height, PLACES) { }
static inline void wamnet_image(
    IMAGES, const float *restrict weights, float *restrict result, int width, int height) { }
static inline int wamnet_clamp(int value, int low, int high) { }
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
%window%%pixels%%tiles%
#undef BLOCK
#undef INPUTS
#undef LANES
#undef NEURONS
#undef OUT
#undef PAIRS
#undef PATCH_WIDTH
#undef PIXELS
#undef PLACE
#undef POINTS
#undef SPECTRUM
#undef STRIDE
#undef TILES
#undef WINDOW_CENTRE
#undef WINDOW_SIZE
#undef restrict

== opencl-kernel ==
void wamnet_denoise(
    IMAGES, __global const float *restrict weights, __global float *restrict result,
    int width, int height) { }

== opencl ==
%window%%pixels%%tiles%%group%
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
#endif
typedef int16 sums;
typedef struct __attribute__((packed)) { uchar4 bytes; } fours;
#ifdef __has_builtin
#if defined(__AVX512VNNI__) && LANES == 16 && __has_builtin(__builtin_ia32_vpdpbusd512)
#define DOT(sum, weight, four) __builtin_ia32_vpdpbusd512(sum, (sums)(as_int(four)), weight)
#endif
#endif
#ifndef DOT
#define PRODUCT(weight, byte, shift) (((weight) << (sums)(shift) >> (sums)(24)) * (sums)((int)(byte)))
#define DOT(sum, weight, four) \
    ((sum) + PRODUCT(weight, (four).s0, 24) + PRODUCT(weight, (four).s1, 16) \
        + PRODUCT(weight, (four).s2, 8) + PRODUCT(weight, (four).s3, 0))
#endif
void forward(const float4 *from, int step, float4 *to, int leap) {
#pragma unroll
}
void backward(const float4 *from, int step, float4 *to, int leap) { }
void forward(const float8 *from, int step, float8 *to, int leap) { }
void backward(const float8 *from, int step, float8 *to, int leap) { }
void forward(const float16 *from, int step, float16 *to, int leap) { }
void backward(const float16 *from, int step, float16 *to, int leap) { }
float4 ELEMENTWISE(VECTORS) { }
int wamnet_packed(float a, float b, float c, float d) { }
int4 wamnet_dots(int4 sums, int4 weights, int word) {
#ifdef __opencl_c_integer_dot_product_input_4x8bit_packed
#else
#endif
}
float4 wamnet_floats(int4 sums) { }
float4 wamnet_numbers(int4 bits) { }
__kernel %opencl-kernel%
__kernel __attribute__((reqd_work_group_size(GROUP_WIDTH, GROUP_HEIGHT, 1))) %opencl-kernel%

== fragment ==
%window%
uniform sampler2D IMAGE;
uniform sampler2D weight_texture;
layout(location = 0) out vec4 result;
float weights(int index) { }
void main() { }

== opengl ==
#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
#error the error bound needs `precise`: GL_ARB_gpu_shader5, or #version 400
#endif
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
#define PRECISE
#endif
%fragment%

== glsl-es ==
#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
#define PRECISE
%fragment%

== glsl-vulkan ==
#version 450
#define PRECISE precise
#if defined(GL_EXT_integer_dot_product) && !defined(WAMNET_PORTABLE)
#define WAMNET_DOT_PRODUCT
#extension GL_EXT_integer_dot_product : require
#endif
%window%%pixels%%group%
layout(local_size_x = 8, local_size_y = 8) in;
layout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;
layout(std140, binding = INT) uniform Size { int width; int height; };
layout(std430, binding = INT) restrict readonly buffer Weights { float weights[]; };
layout(std430, binding = INT) restrict readonly buffer Weights { vec4 w[]; };
layout(std430, binding = INT) restrict readonly buffer Weights { ivec4 w[]; };
layout(std430, binding = INT) restrict buffer Result { float result[]; };
layout(std430, binding = INT) restrict readonly buffer IMAGE_BLOCK { float IMAGE[]; };
shared float tile[TILE_NUMBERS];
shared int tile[TILE_NUMBERS];
float ELEMENTWISE_of_one(FLOATS) { }
vec4 ELEMENTWISE(VECTORS) { }
int wamnet_packed(float a, float b, float c, float d) { }
ivec4 wamnet_dots(ivec4 sums, ivec4 weights, int word) {
#ifdef WAMNET_DOT_PRODUCT
#else
#endif
}
vec4 wamnet_floats(ivec4 sums) { }
vec4 wamnet_numbers(ivec4 bits) { }
void main() { }

== wgsl ==
requires packed_4x8_integer_dot_product;
const WINDOW_SIZE: i32 = INT;
const WINDOW_CENTRE: i32 = INT;
const GROUP_WIDTH: i32 = INT;
const GROUP_HEIGHT: i32 = INT;
const PIXELS: i32 = INT;
const TILE_WIDTH: i32 = (GROUP_WIDTH * PIXELS + WINDOW_SIZE - 1);
const TILE_HEIGHT: i32 = (GROUP_HEIGHT + WINDOW_SIZE - 1);
const PLANE: i32 = (TILE_WIDTH * TILE_HEIGHT);
const TILE_NUMBERS: i32 = (PLANE * INT);
struct Size { width: i32, height: i32, }
@group(0) @binding(INT) var<uniform> size: Size;
@group(0) @binding(INT) var<storage, read> weights: array<f32>;
@group(0) @binding(INT) var<storage, read> w: array<vec4<f32>>;
@group(0) @binding(INT) var<storage, read> w: array<vec4<i32>>;
@group(0) @binding(INT) var<storage, read_write> result: array<f32>;
@group(0) @binding(INT) var<storage, read> IMAGE: array<f32>;
var<workgroup> tile: array<f32, TILE_NUMBERS>;
var<workgroup> tile: array<i32, TILE_NUMBERS>;
fn ELEMENTWISE_of_one(WGSL_FLOATS) -> f32 { }
fn ELEMENTWISE(WGSL_VECTORS) -> vec4<f32> { }
fn wamnet_packed(a: f32, b: f32, c: f32, d: f32) -> i32 { }
fn wamnet_dots(sums: vec4<i32>, weights: vec4<i32>, word: i32) -> vec4<i32> { }
fn wamnet_floats(sums: vec4<i32>) -> vec4<f32> { }
fn wamnet_numbers(bits: vec4<i32>) -> vec4<f32> { }
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) invocation: vec3<u32>) { }
@compute @workgroup_size(GROUP_WIDTH, GROUP_HEIGHT)
fn main(
    @builtin(local_invocation_id) item_place: vec3<u32>, @builtin(workgroup_id) group_place: vec3<u32>) { }

== metal-kernel ==
kernel void wamnet_denoise(
    constant Size &size [[buffer(INT)]], device const float *weights [[buffer(INT)]],
    device float *result [[buffer(INT)]], IMAGES,

== metal ==
#include <metal_stdlib>
using namespace metal;
%window%%pixels%%group%
static inline float ELEMENTWISE_of_one(FLOATS) { }
static inline float4 ELEMENTWISE(VECTORS) { }
struct Size { int width; int height; };
%metal-kernel% uint2 item_place [[thread_position_in_threadgroup]],
    uint2 group_place [[threadgroup_position_in_grid]]) { }
%metal-kernel% uint2 thread_place [[thread_position_in_grid]]) { }

== cuda-kernel ==
wamnet_denoise(
    IMAGES, const float *__restrict__ weights, float *__restrict__ result, int width, int height) { }

== cuda ==
#ifndef WAMNET_CLAMP
#define WAMNET_CLAMP
static __device__ inline int wamnet_clamp(int value, int low, int high) { }
#endif
#ifndef WAMNET_VECTOR
#define WAMNET_VECTOR
struct __align__(16) wamnet_vector { float x, y, z, w; };
static __device__ inline wamnet_vector wamnet_made(float x, float y, float z, float w) { }
static __device__ inline wamnet_vector operator*(wamnet_vector a, float b) { }
static __device__ inline void operator+=(wamnet_vector &a, wamnet_vector b) { }
#endif
#ifndef WAMNET_DOTS
#define WAMNET_DOTS
static __device__ inline int wamnet_packed(float a, float b, float c, float d) { }
static __device__ inline int4 wamnet_dots(int4 sums, int4 weights, int word) { }
static __device__ inline wamnet_vector wamnet_floats(int4 sums) { }
static __device__ inline wamnet_vector wamnet_numbers(int4 bits) { }
#endif
%window%%pixels%%group%
static __device__ inline float ELEMENTWISE_of_one(FLOATS) { }
static __device__ inline wamnet_vector ELEMENTWISE(VECTORS) { }
extern "C" __global__ void __launch_bounds__(GROUP_WIDTH * GROUP_HEIGHT) %cuda-kernel%
extern "C" __global__ void %cuda-kernel%
"""
"""The list of each target, and pieces of lists, named between percent signs."""


def _put_together() -> dict[str, str]:
    """Return the lists by name, their pieces in place."""
    parts = re.split(r"(?m)^== (\S+) ==\n", LISTS)[1:]
    lists = dict(zip(parts[::2], parts[1::2], strict=True))
    for name in lists:
        while re.search(r"%[a-z-]+%", lists[name]):
            lists[name] = re.sub(r"%([a-z-]+)%", lambda m: lists[m[1]], lists[name])
    return lists


FRAMES: Mapping[str, str] = _put_together()
"""The list of each target."""

IMAGES: Mapping[str, str] = {
    "c": r"const float \* restrict IMAGE",
    "opencl": r"__global const float \* restrict IMAGE",
    "cuda": r"const float \* __restrict__ IMAGE",
    "metal": r"device const float \* IMAGE \[ \[ buffer \( INT \) \] \]",
}
"""How each of the images is declared where a kernel has them as arguments."""

NEEDS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "c": {
        "all": ("FP_CONTRACT", "pop_options", "float .h", "math .h", "stdbool .h", "stdint .h"),
        "floats": ("__FAST_MATH__",),
    },
    "opengl": {"all": ("330 core", "extension", "define PRECISE"), "floats": ("error",)},
    "glsl-es": {"all": ("300 es", "highp float", "highp int", "highp sampler2D", "define PRECISE")},
    "glsl-vulkan": {"all": ("version 450", "define PRECISE precise", "local_size_x")},
    "metal": {"all": ("metal_stdlib", "using namespace metal")},
}
"""What some item must have: in all sources, and in those with a bound that is not 0."""

TRUE: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "c": (
        (),
        (
            "(LANES <= 4 || (LANES <= 8 && defined(__AVX__)) || defined(__AVX512F__)) && "
            "defined(__GNUC__) && __GNUC__ >= 4 && !defined(WAMNET_PORTABLE)",
            "LANES == 16 && defined(__AVX512VNNI__) && defined(__AVX512BW__) && !defined(WAMNET_PORTABLE)",
        ),
    ),
    "opencl": (
        (),
        (
            "__has_builtin",
            "__opencl_c_integer_dot_product_input_4x8bit_packed",
            "defined(__AVX512VNNI__) && LANES == 16 && __has_builtin(__builtin_ia32_vpdpbusd512)",
        ),
    ),
    "glsl-vulkan": ((), ("defined(GL_EXT_integer_dot_product) && !defined(WAMNET_PORTABLE)",)),
}
"""The compilers of a language between which its sources may differ: conditions that hold for each."""
