"""What surrounds the statements of a kernel's source in each language, compared word for word [parse.py].

A frame is a source without comments, blank lines and indentation. Between @ signs stand its few open places;
`@(@ ... @|@ ... @)@` is a choice, which may be left out. Nothing else is read: what compilers take from
directives, qualifiers, bindings and helper functions is what these lines say.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from ..languages.c import FUSED, RESTRICT, STRAIGHT, UNFUSED, VECTORS
from ..languages.opencl import BUILTINS

COMMENT = re.compile(r"/\*.*?\*/", re.S)
"""What becomes a blank."""

OPEN: Mapping[str, str] = {
    "(": "(?:", "|": "|", ")": ")?",
    "constants": r"(?P<constants>(?:#define [A-Z_]+ [^\n]*\n)*)",
    "wgsl_constants": r"(?P<constants>(?:const [A-Z_]+: i32 = [^\n]*;\n)*)",
    "undefined": r"(?:#undef [A-Z_]+\n)*",
    "images": r"(?P=images)",
    "given": r"(?P<given>(?:image_\w+, )+)",
    "first": r"(?P<first>image_\w+)",
    "scale": r"(?: \* (?P<step>[A-Z_]+))?",
    "advance": r"(?:\+\+x|x \+= (?P<step>[A-Z_]+))",
    "lanes": r"float(?P<lanes>\d+)",
    "same_lanes": r"float(?P=lanes)",
    "body": r"(?P<body>.*\n)?",
}  # fmt: skip
"""The open places by name; `@each LINE@` are lines, one for each image."""

ARGUMENTS = """
@each const float *restrict IMAGE,@
const float *restrict weights,
float *restrict result,
int width,
int height"""
"""The arguments of C's functions, and of one that names the images for the first time."""

SAME = ARGUMENTS.replace("@each const float *restrict IMAGE,@\n", "@images@")
"""The arguments of C's functions, which name the images in the same order each time."""

CLAMP = """int wamnet_clamp(int value, int low, int high)
{
return value < low ? low : value > high ? high : value;
}"""
"""An index within limits."""

FRAMES: Mapping[str, str] = {
    "c": f"""
#ifndef WAMNET_DENOISE_H
#define WAMNET_DENOISE_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
{RESTRICT}
@(@#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif
@)@
@(@{UNFUSED}
@|@{FUSED}
@)@
@constants@
@(@{STRAIGHT}
{VECTORS}
@)@
static inline void wamnet_pixel({ARGUMENTS},
int x,
int y);
static inline void wamnet_image({SAME})
{{
for (int y = 0; y < height; ++y) {{
for (int x = 0; x < width; @advance@) {{
wamnet_pixel(@given@weights, result, width, height, x, y);
}}
}}
}}
static inline {CLAMP}
static inline void wamnet_pixel({SAME},
int x,
int y)
{{
(void)weights;
@body@
}}
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
@undefined@
#undef restrict
#endif
""",
    "opencl": f"""
@(@{BUILTINS}
@)@
@constants@
@(@{BUILTINS}
@)@
__kernel void wamnet_denoise(
@each __global const float *restrict IMAGE,@
__global const float *restrict weights,
__global float *restrict result,
int width,
int height)
{{
int x = (int)get_global_id(0)@scale@;
int y = (int)get_global_id(1);
if (x >= width || y >= height) {{
return;
}}
@(@__global const @lanes@ *w = (__global const @same_lanes@ *)weights;
@)@
@body@
}}
""",
    "cuda": f"""
#ifndef WAMNET_CLAMP
#define WAMNET_CLAMP
static __device__ inline {CLAMP}
#endif
@constants@
extern "C" __global__ void wamnet_denoise(
@each const float *__restrict__ IMAGE,@
const float *__restrict__ weights,
float *__restrict__ result,
int width,
int height)
{{
int x = (int)(blockIdx.x * blockDim.x + threadIdx.x)@scale@;
int y = (int)(blockIdx.y * blockDim.y + threadIdx.y);
if (x >= width || y >= height) {{
return;
}}
@body@
}}
""",
    "metal": """
#include <metal_stdlib>
using namespace metal;
@constants@
struct Size {
int width;
int height;
};
kernel void wamnet_denoise(
constant Size &size [[buffer(0)]],
device const float *weights [[buffer(1)]],
device float *result [[buffer(2)]],
@each device const float *IMAGE [[buffer(NUMBER)]],@
uint2 thread_place [[thread_position_in_grid]])
{
int width = size.width;
int height = size.height;
int x = int(thread_place.x)@scale@;
int y = int(thread_place.y);
if (x >= width || y >= height) {
return;
}
@body@
}
""",
    "opengl": """
#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
@(@#define PRECISE
@|@#error the error bound needs `precise`: GL_ARB_gpu_shader5, or #version 400
@)@
#endif
@constants@
@each uniform sampler2D IMAGE;@
uniform sampler2D weight_texture;
layout(location = 0) out vec4 result;
float weights(int index)
{
ivec2 texel = ivec2(index % 1024, index / 1024);
return texelFetch(weight_texture, texel, 0).r;
}
void main()
{
int width = textureSize(@first@, 0).x;
int height = textureSize((?P=first), 0).y;
int x = int(gl_FragCoord.x);
int y = int(gl_FragCoord.y);
result = vec4(0.0, 0.0, 0.0, 1.0);
@body@
}
""",
    "glsl-vulkan": """
#version 450
#define PRECISE precise
@constants@
layout(local_size_x = 8, local_size_y = 8) in;
layout(std140, binding = 0) uniform Size {
int width;
int height;
};
layout(std430, binding = 1) restrict readonly buffer Weights { float weights[]; };
layout(std430, binding = 2) restrict buffer Result { float result[]; };
@each layout(std430, binding = NUMBER) restrict readonly buffer BLOCK { float IMAGE[]; };@
void main()
{
int x = int(gl_GlobalInvocationID.x)@scale@;
int y = int(gl_GlobalInvocationID.y);
if (x >= width || y >= height) {
return;
}
@body@
}
""",
    "wgsl": """
@wgsl_constants@
struct Size {
width: i32,
height: i32,
}
$group(0) $binding(0) var<uniform> size: Size;
$group(0) $binding(1) var<storage, read> weights: array<f32>;
$group(0) $binding(2) var<storage, read_write> result: array<f32>;
@each $group(0) $binding(NUMBER) var<storage, read> IMAGE: array<f32>;@
$compute $workgroup_size(8, 8)
fn main($builtin(global_invocation_id) invocation: vec3<u32>) {
let width: i32 = size.width;
let height: i32 = size.height;
let x: i32 = i32(invocation.x)@scale@;
let y: i32 = i32(invocation.y);
if (x >= width || y >= height) {
return;
}
@body@
}
""",
}
"""The frames by target; a dollar sign stands for WGSL's @."""


def lines_of(source: str) -> str:
    """Return a source without comments, blank lines and indentation."""
    lines = (line.strip() for line in COMMENT.sub(" ", source).splitlines())
    return "".join(f"{line}\n" for line in lines if line)


@cache
def frame(target: str) -> re.Pattern[str]:
    """Return the pattern of a target's frame."""
    text = lines_of(FRAMES[target])
    pieces = re.split(r"@([^@\n]+)@(\n?)", text)
    pattern = ""
    for literal, place, end in zip(pieces[::3], [*pieces[1::3], ""], [*pieces[2::3], ""], strict=True):
        pattern += re.escape(literal.replace("$", "@")).replace(re.escape("(?P=first)"), "(?P=first)")
        pattern += _each(place[5:]) if place.startswith("each ") else OPEN.get(place, "")
        inline = place in ("scale", "advance", "given", "first", "lanes", "same_lanes")
        pattern += re.escape(end) if inline else ""
    return re.compile(pattern, re.S)


def _each(line: str) -> str:
    """Return the pattern of lines, one for each image."""
    text = re.escape(line.replace("$", "@"))
    text = text.replace("IMAGE", r"image_\w+").replace("NUMBER", r"\d+").replace("BLOCK", r"Image_\w+")
    return rf"(?P<images>(?:{text}\n)+)"
