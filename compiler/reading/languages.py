"""The languages that are read: their parsers, and names of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .frame import preprocessed
from .syntax import Parser, Text
from .wgsl_syntax import WgslParser


@dataclass(frozen=True)
class Language:
    """How sources of a target are read.

    `calls`: the functions and types' names that kernels call. `within`: the host calls the kernel for pixels
    of the image only. `fragment`: one pixel's result is a variable. `brings`: names that the source does not
    declare. `host`: a function of the source that calls the kernel for every work item. `doubles`: a constant
    without a suffix is one. `aligned`: a vector is at a multiple of its size. `precise`: what rounds is
    declared so. `of_floats`, `of_integers`: what the names of other schedules than plain begin with that are
    read, of networks of floats and of integers.
    """

    calls: str
    parser: type[Parser] = Parser
    within: bool = False
    fragment: bool = False
    brings: tuple[str, ...] = ()
    host: str = ""
    doubles: bool = False
    aligned: bool = True
    precise: bool = False
    of_floats: tuple[str, ...] = ()
    of_integers: tuple[str, ...] = ()


GLSL = "abs clamp float floor int max min uint "
"""Functions of all versions of GLSL."""

LANGUAGES: Mapping[str, Language] = {
    "opencl": Language(
        "as_float4 as_float8 as_float16 as_int as_int4 as_int8 as_int16 as_uint barrier clamp convert_float "
        "convert_int convert_uint dot_acc_sat_4x8packed_ss_int fabs floor fmax fmin get_global_id "
        "get_group_id get_local_id max min __builtin_ia32_vpdpbusd512",
        doubles=True,
        brings=("CLK_LOCAL_MEM_FENCE",),
        of_floats=("tile", "vector", "group", "fft"),
        of_integers=("tile", "vector", "group", "dot"),
    ),
    "c": Language(
        "fabsf floorf memcpy _mm512_cvtepi32_ps _mm512_dpbusd_epi32 _mm512_loadu_si512 "
        "_mm512_set1_epi32 _mm512_storeu_ps",
        within=True,
        host="wamnet_image",
        doubles=True,
        aligned=False,
        of_floats=("tile", "fft"),
        of_integers=("tile", "dot"),
    ),
    "opengl": Language(
        GLSL + "ivec2 texelFetch textureSize vec4",
        within=True,
        fragment=True,
        precise=True,
        brings=("gl_FragCoord",),
    ),
    "glsl-es": Language(
        GLSL + "ivec2 texelFetch textureSize vec4",
        within=True,
        fragment=True,
        precise=True,
        brings=("gl_FragCoord",),
    ),
    "glsl-vulkan": Language(
        GLSL + "barrier dotPacked4x8EXT intBitsToFloat ivec4 vec4",
        precise=True,
        brings=("gl_GlobalInvocationID", "gl_LocalInvocationID", "gl_WorkGroupID"),
        of_floats=("group",),
        of_integers=("group",),
    ),
    "wgsl": Language(
        "abs bitcast clamp dot4I8Packed f32 floor i32 max min pack4xI8 select u32 vec4 workgroupBarrier",
        WgslParser,
        of_floats=("group",),
        of_integers=("group",),
    ),
    "metal": Language(
        "clamp fabs float4 floor int max min threadgroup_barrier",
        brings=("mem_flags::mem_threadgroup",),
        of_floats=("group",),
        of_integers=("group",),
    ),
    "cuda": Language(
        "__dp4a __int_as_float __syncthreads fabsf floorf fmaxf fminf make_int4 max min",
        doubles=True,
        brings=("threadIdx", "blockIdx", "blockDim"),
        of_floats=("group",),
        of_integers=("group",),
    ),
}
"""By a manifest's target."""

READ_PROFILES = ("ieee", "exact")
"""The profiles whose sines are read, of every degree."""


def is_read(manifest: Mapping[str, Any]) -> bool:
    """Return whether the text of a kernel is of a kind that is read, by its manifest (TXT-7)."""
    language, schedule = LANGUAGES.get(manifest["target"]), manifest["schedule"]["name"]
    known_sines = not manifest["sine_arguments"] or manifest["profile"]["name"].startswith(READ_PROFILES)
    if language is None or not known_sines:
        return False
    begins = language.of_floats if any(manifest["bound"]["output"]) else language.of_integers
    return bool(schedule == "plain" or schedule.startswith(begins))


def parsed(source: str, language: Language, true: Sequence[str]) -> Text:
    """Return a source, cleaned, as a compiler reads it for which these conditions hold."""
    parser = language.parser(*preprocessed(source, true), {*language.calls.split(), *language.brings})
    parser.doubles, parser.precise = language.doubles, language.precise
    return parser.parse()
