"""What surrounds the statements of a kernel's source in each language, compared word for word [parse.py].

A frame is a source without comments, blank lines and indentation. Between @ signs stand its few open places;
`@(@ ... @|@ ... @)@` is a choice, which may be left out. Nothing else is read: what compilers take from
directives, qualifiers, bindings and helper functions is what these lines say.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from ..kernel.instructions import (
    BUILTINS,
    C_TILE,
    CLONED,
    CLONED_IMAGE,
    CUDA_GROUP,
    CUDA_VECTOR,
    FUSED,
    OPENCL_GROUP,
    OPENCL_TILE,
    RESTRICT,
    STRAIGHT,
    TRANSFORMS,
    UNFUSED,
    VULKAN_EXTENSION,
    VULKAN_GROUP,
    WGSL_GROUP,
    c_vectors,
)
from ..kernel.interface import BATCH, ITEMS

COMMENT = re.compile(r"/\*.*?\*/", re.S)
"""What becomes a blank."""

OPEN: Mapping[str, str] = {
    "(": "(?:", "|": "|", ")": ")?", "<": "(?:", ">": ")",
    "constants": r"(?P<constants>(?:#define [A-Z_]+ [^\n]*\n)*)",
    "wgsl_constants": r"(?P<constants>(?:const [A-Z_]+: i32 = [^\n]*;\n)*)",
    "functions": r"(?P<functions>(?:[^\n]*\n)*?)",
    "undefined": r"(?P<undefined>(?:#undef [A-Z_]+\n)*)",
    "images": r"(?P=images)",
    "given": r"(?P<given>(?:image_\w+, )+)",
    "first": r"(?P<first>image_\w+)", "same_first": r"(?P=first)",
    "group": r"(?P<grouped>)", "passes": r"(?P<passes>)", "words": r"(?P<words>)",
    "gnu": r"(?P<gnu>)", "bounded": r"(?P<bounded>)",
    "column": r"(?P<column>x|tile_x)", "row": r"(?P<row>y|tile_y)",
    "x": r"(?P=column)", "y": r"(?P=row)",
    "scale": r"(?: \* (?P<across>[A-Z]+(?: \* [A-Z]+)*))?",
    "scale_y": r"(?: \* (?P<down>[A-Z]+))?",
    "advance": r"(?:\+\+x|x \+= (?P<across>[A-Z]+(?: \* [A-Z]+)*))",
    "advance_y": r"(?:\+\+y|y \+= (?P<down>[A-Z]+))",
    "vector": r"(?P<vector>(?:float|int)(?:2|4|8|16)|wamnet_vector|i?vec4|vec4<[fi]32>)",
    "same_vector": r"(?P=vector)",
    "shared": r"(?P<shared>float|int|f32|i32)",
    "lanes": r"(?P<lanes>[1-9]\d*)", "same_lanes": r"(?P=lanes)",
    "dropped": r"(?:#undef wamnet_(?:difference|scaled|sum|zero)\n)*",
    "body": r"(?P<body>.*\n)?",
    "memory": r"(?P<memory>(?:[^\n]*(?:vec|float)2\b[^\n]*\n)+)",
    "head": r"(?P<head>",
    "launches": r"(?P<launches>.*)",
    "argued": r"(?P<argued>)", "constant": r"(?P<constant>)",
    "table": r"weights\[(?P<count>[1-9]\d*)\] = \{\n?(?P<table>[^{};]*)\};",
    "fours": r"(?P<fours>[1-9]\d*)", "quads": r"(?P<quads>[1-9]\d*)",
    "buffers": r"(?P<buffers>(?:layout\(location = \d\) out vec4 result_\d;\n)+)",
    "cleared": r"(?P<cleared>(?:result_\d = vec4\(0\.0, 0\.0, 0\.0, 1\.0\);\n)+)",
}  # fmt: skip
"""The open places by name; `@each LINE@` are lines, one for each image."""

BLOCKS = (
    "constants", "wgsl_constants", "functions", "undefined", "images", "body", "bounded", "words", "gnu",
    "dropped", "memory", "launches", "argued", "constant", "buffers", "cleared", *"(|)<>",
)  # fmt: skip
"""Places that match whole lines or nothing: the newline behind the marker is not part of the pattern."""

GUARD = """if (@x@ >= width || @y@ >= height) {
return;
}"""
"""Items beyond the image write nothing."""

Two = tuple[str, str]


def begun(thread: Two, local: Two, group: Two, size: str = "", own: Two = ("", ""), index: str = "") -> str:
    """Return how the statements begin: those of an item, or of one of a group.

    `own`: declarations of the group's memory, and of the weights as vectors, inside the function.
    """
    let = (index or "int {} = {};").format
    shared, weights = own
    item = (
        let("local_x", local[0]),
        let("local_y", local[1]),
        let("item", "local_y * GROUP_WIDTH + local_x"),
    )
    places = (f"{group[0]} * (GROUP_WIDTH * PIXELS) + local_x", f"{group[1]} * GROUP_HEIGHT + local_y")
    first = (let("@column@", f"{thread[0]}@scale@"), let("@row@", f"{thread[1]}@scale_y@"), GUARD)
    alone = [size, *first, f"@(@{weights}\n@)@" if weights else ""]
    grouped = [shared, weights, size, *item, let("x", places[0]), let("y", places[1])]
    both = ("\n".join(filter(None, lines)) for lines in (alone, grouped))
    return "@<@{}\n@|@@group@{}\n@>@".format(*both)


def read_size(index: str, of: str, more: tuple[str, ...] = ()) -> str:
    """Return how an item gets the image's size, and `more`, from a block."""
    return "\n".join(index.format(each, f"{of}{each}") for each in ("width", "height", *more))


ARGUMENTS = """
@each const float *restrict IMAGE,@
@(@@argued@const float *restrict weights,
@)@
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

FRAGMENT = """
@constants@
@functions@
@each uniform sampler2D IMAGE;@
@(@uniform sampler2D weight_texture;
@|@layout(std140) uniform Weights { vec4 weights[@quads@]; };
@)@
@<@layout(location = 0) out vec4 result;
@|@@buffers@
@>@
@(@float weights(int index)
{
ivec2 texel = ivec2(index % 1024, index / 1024);
return texelFetch(weight_texture, texel, 0).r;
}
@|@@vector@ weights(int texel)
{
ivec2 place = ivec2(texel % 1024, texel / 1024);
return texelFetch(weight_texture, place, 0);
}
@)@
void main()
{
int width = textureSize(@first@, 0).x;
int height = textureSize(@same_first@, 0).y;
int @column@ = int(gl_FragCoord.x);
int @row@ = int(gl_FragCoord.y);
@<@result = vec4(0.0, 0.0, 0.0, 1.0);
@|@@cleared@
@>@
@body@
}
"""
"""A fragment shader behind its first lines."""

PLACES = (
    ("int(gl_GlobalInvocationID.x)", "int(gl_GlobalInvocationID.y)"),
    ("int(gl_LocalInvocationID.x)", "int(gl_LocalInvocationID.y)"),
    ("int(gl_WorkGroupID.x)", "int(gl_WorkGroupID.y)"),
)
"""The places of items in GLSL."""

SIZE = "int width = textureSize(@first@, 0).x;\nint height = textureSize(@same_first@, 0).y;"
"""The image's size in fragment shaders."""

EXTENSION = "\n".join(VULKAN_EXTENSION)
"""Products of bytes in Vulkan GLSL."""

STAGE = """@head@#if STAGE == 0
void main()
{{
{}int tile = int(gl_GlobalInvocationID.x);
int line = int({}.y);
@>@
@launches@
#endif"""
"""The first of a source's launches, each a program that is compiled by its number [launches.py]."""

SIZES = "int width = imageSize(result).x;\nint height = imageSize(result).y;\n"
"""The image's size in launches whose images are textures."""

FRAMES: dict[str, str] = {
    "c": f"""
#ifndef WAMNET_DENOISE_H
#define WAMNET_DENOISE_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
@(@@words@#include <string.h>
@)@
{RESTRICT}
@(@@bounded@
#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif
@)@
@<@{UNFUSED}
@|@{FUSED}
@>@
@(@@gnu@{STRAIGHT}
{c_vectors("@same_lanes@").replace("@same_lanes@", "@lanes@", 1)}
@(@{TRANSFORMS}
@)@
@)@
@constants@
@(@static const float @table@
@)@
@functions@
@(@@gnu@{CLONED}
@)@
@(@@words@
{STRAIGHT}
{C_TILE}
@)@
static inline void wamnet_pixel({ARGUMENTS},
int @column@,
int @row@);
@(@{CLONED_IMAGE}
@)@
static inline void wamnet_image({SAME})
{{
for (int y = 0; y < height; @advance_y@) {{
for (int x = 0; x < width; @advance@) {{
wamnet_pixel(@given@@(@@argued@weights, @)@result, width, height, x, y);
}}
}}
}}
static inline {CLAMP}
static inline void wamnet_pixel({SAME},
int @x@,
int @y@)
{{
@(@@argued@(void)weights;
@)@
@body@
}}
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
@undefined@
#undef restrict
@dropped@
#endif
""",
    "opencl": f"""
@(@{BUILTINS}
{OPENCL_GROUP}
@|@{BUILTINS}
@)@
@constants@
@(@{OPENCL_TILE.replace("int16", "int@lanes@", 1)}
@)@
@(@__constant float @table@
@)@
@functions@
@<@__kernel void wamnet_denoise(
@|@@group@__kernel __attribute__((reqd_work_group_size(GROUP_WIDTH, GROUP_HEIGHT, 1)))
void wamnet_denoise(
@>@
@each __global const float *restrict IMAGE,@
@(@@argued@__global const float *restrict weights,
@|@__constant float *restrict weights __attribute__((max_constant_size(16 * @fours@))),
@)@
__global float *restrict result,
int width,
int height)
{{
{
        begun(
            ("(int)get_global_id(0)", "(int)get_global_id(1)"),
            ("(int)get_local_id(0)", "(int)get_local_id(1)"),
            ("(int)get_group_id(0)", "(int)get_group_id(1)"),
            own=(
                "__local @shared@ tile[TILE_NUMBERS];",
                "__global const @vector@ *w = (__global const @same_vector@ *)weights;",
            ),
        )
    }
@body@
}}
""",
    "cuda": f"""
#ifndef WAMNET_CLAMP
#define WAMNET_CLAMP
static __device__ inline {CLAMP}
#endif
@(@{CUDA_VECTOR}
{CUDA_GROUP}
@|@{CUDA_VECTOR}
@)@
@constants@
@(@static __device__ const float @table@
@)@
@functions@
@<@@<@extern "C" __global__ void wamnet_denoise(
@|@@group@extern "C" __global__ void __launch_bounds__(GROUP_WIDTH * GROUP_HEIGHT) wamnet_denoise(
@>@
@each const float *__restrict__ IMAGE,@
@(@@argued@const float *__restrict__ weights,
@)@
float *__restrict__ result,
int width,
int height)
{{
{
        begun(
            ("(int)(blockIdx.x * blockDim.x + threadIdx.x)", "(int)(blockIdx.y * blockDim.y + threadIdx.y)"),
            ("(int)threadIdx.x", "(int)threadIdx.y"),
            ("(int)blockIdx.x", "(int)blockIdx.y"),
            own=(
                "__shared__ @shared@ tile[TILE_NUMBERS];",
                "const @vector@ *w = (const @same_vector@ *)weights;",
            ),
        )
    }
@body@
}}
@|@@passes@@head@extern "C" __global__ void wamnet_denoise_0(
@each const float *__restrict__ IMAGE,@
const float *__restrict__ weights,
float *__restrict__ result,
@memory@
int width,
int height,
int first_tile,
int tile_count)
{{
const @vector@ *w = (const @same_vector@ *)weights;
int tile = (int)(blockIdx.x * blockDim.x + threadIdx.x);
int line = (int)(blockIdx.y * blockDim.y + threadIdx.y);
@>@
@launches@
@>@
""",
    "metal": f"""
#include <metal_stdlib>
using namespace metal;
@constants@
@(@constant float @table@
@)@
@functions@
struct Size {{
int width;
int height;
@(@@passes@int first_tile;
int tile_count;
@)@
}};
@<@kernel void wamnet_denoise(
constant Size &size [[buffer(0)]],
@(@@argued@device const float *weights [[buffer(1)]],
@|@@constant@constant float *weights [[buffer(1)]],
@)@
device float *result [[buffer(2)]],
@each device const float *IMAGE [[buffer(NUMBER)]],@
@<@uint2 thread_place [[thread_position_in_grid]])
@|@@group@uint2 item_place [[thread_position_in_threadgroup]],
uint2 group_place [[threadgroup_position_in_grid]])
@>@
{{
{
        begun(
            ("int(thread_place.x)", "int(thread_place.y)"),
            ("int(item_place.x)", "int(item_place.y)"),
            ("int(group_place.x)", "int(group_place.y)"),
            read_size("int {} = {};", "size."),
            (
                "threadgroup @shared@ tile[TILE_NUMBERS];",
                "device const @vector@ *w = (device const @same_vector@ *)weights;",
            ),
        )
    }
@body@
}}
@|@@head@kernel void wamnet_denoise_0(
constant Size &size [[buffer(0)]],
device const float *weights [[buffer(1)]],
device float *result [[buffer(2)]],
@each device const float *IMAGE [[buffer(NUMBER)]],@
@memory@
uint2 thread_place [[thread_position_in_grid]])
{{
device const @vector@ *w = (device const @same_vector@ *)weights;
{read_size("int {} = {};", "size.", BATCH)}
int tile = int(thread_place.x);
int line = int(thread_place.y);
@>@
@launches@
@>@
""",
    "opengl": f"""
@<@#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
@(@#define PRECISE
@|@@bounded@#error the error bound needs `precise`: GL_ARB_gpu_shader5, or #version 400
@)@
#endif
{FRAGMENT}
@|@@bounded@
#version 430 core
#define PRECISE precise
@constants@
@functions@
@<@@group@layout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;
@|@@passes@layout(local_size_x = ITEMS, local_size_y = 1) in;
@>@
@each uniform sampler2D IMAGE;@
layout(std430, binding = 0) restrict readonly buffer weight_buffer {{ @vector@ w[]; }};
layout(rgba32f, binding = 0) restrict writeonly uniform image2D result;
@<@shared @shared@ tile[TILE_NUMBERS];
void main()
{{
{begun(*PLACES, SIZE)}
@body@
}}
@|@@memory@
uniform int first_tile;
uniform int tile_count;
{STAGE.format(SIZES, "gl_WorkGroupID")}
@>@
@>@
""",
    "glsl-es": f"""
#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
#define PRECISE
{FRAGMENT}
""",
    "glsl-vulkan": f"""
#version 450
#define PRECISE precise
@(@{EXTENSION}
@)@
@constants@
@functions@
@<@layout(local_size_x = 8, local_size_y = 8) in;
@|@@group@layout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;
@|@@passes@layout(local_size_x = {ITEMS}, local_size_y = 1) in;
@>@
layout(std140, binding = 0) uniform Size {{
int width;
int height;
@(@@passes@int first_tile;
int tile_count;
@)@
}};
@<@layout(std430, binding = 1) restrict readonly buffer Weights {{ @<@float weights@|@@vector@ w@>@[]; }};
@|@layout(std140, binding = 1) uniform Weights {{ vec4 weights[@quads@]; }};
@>@
layout(std430, binding = 2) restrict buffer Result {{ float result[]; }};
@each layout(std430, binding = NUMBER) restrict readonly buffer BLOCK {{ float IMAGE[]; }};@
@(@shared @shared@ tile[TILE_NUMBERS];
@)@
@(@{VULKAN_GROUP}
@)@
@<@void main()
{{
{begun(*PLACES)}
@body@
}}
@|@@memory@
{STAGE.format("", "gl_GlobalInvocationID")}
@>@
""",
    "wgsl": f"""
@(@requires packed_4x8_integer_dot_product;
@)@
@wgsl_constants@
@functions@
struct Size {{
width: i32,
height: i32,
@(@@passes@first_tile: i32,
tile_count: i32,
@)@
}}
$group(0) $binding(0) var<uniform> size: Size;
$group(0) $binding(1) var<@<@storage, read> @<@weights: array<f32>@|@w: array<@vector@>@>@
@|@uniform> weights: array<vec4<f32>, @quads@>@>@;
$group(0) $binding(2) var<storage, read_write> result: array<f32>;
@each $group(0) $binding(NUMBER) var<storage, read> IMAGE: array<f32>;@
@(@var<workgroup> tile: array<@shared@, TILE_NUMBERS>;
@)@
@(@{WGSL_GROUP}
@)@
@<@@<@$compute $workgroup_size(8, 8)
fn main($builtin(global_invocation_id) invocation: vec3<u32>) {{
@|@@group@$compute $workgroup_size(GROUP_WIDTH, GROUP_HEIGHT)
fn main($builtin(local_invocation_id) item_place: vec3<u32>, $builtin(workgroup_id) group_place: vec3<u32>) {{
@>@
{
        begun(
            ("i32(invocation.x)", "i32(invocation.y)"),
            ("i32(item_place.x)", "i32(item_place.y)"),
            ("i32(group_place.x)", "i32(group_place.y)"),
            read_size("let {}: i32 = {};", "size."),
            index="let {}: i32 = {};",
        )
    }
@body@
}}
@|@@memory@
@head@$compute $workgroup_size({ITEMS}, 1)
fn main_0($builtin(global_invocation_id) invocation: vec3<u32>) {{
{read_size("let {}: i32 = {};", "size.", BATCH)}
let tile: i32 = i32(invocation.x);
let line: i32 = i32(invocation.y);
@>@
@launches@
@>@
""",
}
"""The frames by target; a dollar sign stands for WGSL's @."""
FRAMES["glsl-compute"] = FRAMES["glsl-vulkan"].replace("#version 450", "#version 430 core")


def lines_of(source: str) -> str:
    """Return a source without comments, blank lines and indentation."""
    lines = (line.strip() for line in COMMENT.sub(" ", source).splitlines())
    return "".join(f"{line}\n" for line in lines if line)


@cache
def frame(language: str) -> re.Pattern[str]:
    """Return the pattern of a target's frame; groups of one name are numbered [`parts_of`]."""
    text = lines_of(FRAMES[language])
    pieces = re.split(r"@([^@\n]+)@(\n?)", text)
    pattern, last = "", {}
    for literal, place, end in zip(pieces[::3], [*pieces[1::3], ""], [*pieces[2::3], ""], strict=True):
        piece = _each(place[5:]) if place.startswith("each ") else OPEN.get(place, "")
        for key in re.findall(r"\(\?P<(\w+)>", piece):
            number = pattern.count(f"(?P<{key}")
            last[key] = f"{key}{number or ''}"
            piece = piece.replace(f"<{key}>", f"<{last[key]}>")
        piece = re.sub(r"\(\?P=(\w+)\)", lambda same: f"(?P={last[same[1]]})", piece)
        in_line = place not in BLOCKS and not place.startswith("each ")
        pattern += re.escape(literal.replace("$", "@")) + piece + (re.escape(end) if in_line else "")
    return re.compile(pattern, re.S)


def parts_of(match: re.Match[str]) -> dict[str, str] | None:
    """Return what stands in the open places, by name; nothing of half a kernel of groups, or of bytes."""
    texts = [(name.rstrip("0123456789"), text) for name, text in match.groupdict().items()]
    for together in (("grouped", "shared"), ("passes", "launches"), ("words",), ("gnu",)):
        if len({text is None for name, text in texts if name in together}) > 1:
            return None
    return {name: text for name, text in texts if text is not None}


def _each(line: str) -> str:
    """Return the pattern of lines, one for each image."""
    text = re.escape(line.replace("$", "@"))
    text = text.replace("IMAGE", r"image_\w+").replace("NUMBER", r"[1-9]\d*").replace("BLOCK", r"Image_\w+")
    return rf"(?P<images>(?:{text}\n)+)"
