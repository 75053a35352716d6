"""The languages that are read: their parsers, and names of their own."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .frame import preprocessed
from .syntax import Parser
from .tokens import Text
from .wgsl_syntax import WgslParser

RESERVED = (
    r"active alignas alignof and asm attribute auto bitand bitor break buffer case cast catch centroid "
    r"class coherent common compl complex concept const constant constexpr continue decltype default "
    r"delete device discard do else enum explicit export extern external false filter fixed flat for "
    r"friend global goto highp if inline inout input interface invariant kernel layout local lowp "
    r"mediump mutable namespace new noexcept noinline noperspective not operator or out output partition "
    r"patch precise precision private protected public quad read_only readonly register restrict return "
    r"sample shared signed sizeof smooth static struct subroutine superp switch template this thread "
    r"threadgroup throw true try typedef typeid typename typeof uniform union unsigned using varying "
    r"vertex virtual void volatile while write_only writeonly xor [biudfh]?vec[234] "
    r"(u?(char|short|int|long|longlong)|b?float|double|half|bool|d?mat)([1-9]+(x[1-9]+)?)? "
    r"[iu]?(sampler|image|texture)([123][Dd]|Cube|cube|Buffer|block|_)? "
    r"[iu]?(sampler|image|texture)([123][Dd]|[Cc]ube|[Bb]uffer)\w+ subpassInput\w* resource \w+_t \w+_eq "
    r"\w+_cast \w+_data _[A-Z]\w* (packed|atomic|simd|co|threadgroup|math|mem)_\w+ const(eval|init) "
    r"nullptr thread_local static_assert pipe generic linux unix defined "
    r"is(nan|inf|finite|normal|greater|less|unordered)\w* signbit fpclassify "
    r"(thread|block|grid)(Idx|Dim) warpSize metal fragment intersection visible mesh object "
    r"nonuniformEXT"
)
"""Words that no name is in some of C and its children, and patterns of their families."""

RESERVED_IN_WGSL = (
    "NULL Self abstract active alias alignas alignof as asm asm_fragment async attribute auto await "
    "become break case cast catch class co_await co_return co_yield coherent column_major common compile "
    "compile_fragment concept const const_assert const_cast consteval constexpr constinit continue "
    "continuing crate debugger decltype default delete demote demote_to_helper diagnostic discard do "
    "dynamic_cast else enable enum explicit export extends extern external fallthrough false filter final "
    "finally fn for friend from fxgroup get goto groupshared highp if impl implements import inline "
    "instanceof interface layout let loop lowp macro macro_rules match mediump meta mod module move mut "
    "mutable namespace new nil noexcept noinline nointerpolation non_coherent noncoherent noperspective "
    "null nullptr of operator override package packoffset partition pass patch pixelfragment precise "
    "precision premerge priv protected pub public readonly ref regardless register reinterpret_cast "
    "require requires resource restrict return self set shared sizeof smooth snorm static static_assert "
    "static_cast std struct subroutine super switch target template this thread_local throw trait true "
    "try type typedef typeid typename typeof union unless unorm unsafe unsized use using var varying "
    "virtual volatile wgsl where while with writeonly yield"
)
"""Words that no name is in WGSL (16.1, 16.2)."""


MOST_LETTERS = 256
"""No name has so many letters."""


@dataclass(frozen=True)
class Language:
    """How sources of a target are read.

    `calls`: the functions and types' names that kernels call. `title`: what its name in manifests begins
    with. `within`: the host calls the kernel for pixels of the image only. `fragment`: one pixel's result
    is a variable. `brings`: names that the source does not declare. `host`: a function of the source that
    calls the kernel for every work item. `doubles`: a constant without a suffix is one. `aligned`: a vector
    is at a multiple of its size. `precise`: what rounds is declared so. `types`, `qualifiers`: words for
    them in functions; all types where there are none. `lists`: a cast of several values is a vector.
    `mixes`: 2 if kinds of numbers become others without a word, 1 if integers become floats. `of_floats`,
    `of_integers`: what the names of other schedules than plain begin with that are read, of networks of
    floats and of integers.
    """

    calls: str
    title: str
    parser: type[Parser] = Parser
    within: bool = False
    fragment: bool = False
    brings: tuple[str, ...] = ()
    host: str = ""
    doubles: bool = False
    aligned: bool = True
    types: str = ""
    qualifiers: str = "const precise shared"
    mixes: int = 2
    reserved: str = RESERVED
    precise: bool = False
    lists: bool = False
    of_floats: tuple[str, ...] = ()
    of_integers: tuple[str, ...] = ()


GLSL = "abs clamp float floor int max min uint "
"""Functions of all versions of GLSL."""

LANGUAGES: Mapping[str, Language] = {
    "opencl": Language(
        "as_float4 as_float8 as_float16 as_int as_int4 as_int8 as_int16 as_uint barrier clamp convert_float "
        "convert_int convert_uint dot_acc_sat_4x8packed_ss_int fabs floor fmax fmin get_global_id "
        "get_group_id get_local_id max min __builtin_ia32_vpdpbusd512",
        "OpenCL C",
        doubles=True,
        lists=True,
        types="void bool float float4 float8 float16 int int4 int8 int16 uint uint4 uint8 uint16 uchar "
        "uchar4",
        qualifiers="const __global __local",
        brings=("CLK_LOCAL_MEM_FENCE",),
        of_floats=("tile", "vector", "group", "fft"),
        of_integers=("tile", "vector", "group", "dot"),
    ),
    "c": Language(
        "fabsf floorf memcpy _mm512_cvtepi32_ps _mm512_dpbusd_epi32 _mm512_loadu_si512 "
        "_mm512_set1_epi32 _mm512_storeu_ps",
        "C99",
        within=True,
        host="wamnet_image",
        doubles=True,
        aligned=False,
        types="void bool float int int8_t uint8_t int32_t uint32_t __m512i",
        qualifiers="const",
        of_floats=("tile", "fft"),
        of_integers=("tile", "dot"),
    ),
    "opengl": Language(
        GLSL + "ivec2 texelFetch textureSize vec4",
        "GLSL 3.30",
        within=True,
        fragment=True,
        precise=True,
        brings=("gl_FragCoord",),
        qualifiers="precise",
        mixes=1,
    ),
    "glsl-es": Language(
        GLSL + "ivec2 texelFetch textureSize vec4",
        "GLSL ES 3.00",
        within=True,
        fragment=True,
        precise=True,
        brings=("gl_FragCoord",),
        qualifiers="precise",
        mixes=0,
    ),
    "glsl-vulkan": Language(
        GLSL + "barrier dotPacked4x8EXT intBitsToFloat ivec4 vec4",
        "GLSL 4.50",
        precise=True,
        brings=("gl_GlobalInvocationID", "gl_LocalInvocationID", "gl_WorkGroupID"),
        of_floats=("group",),
        of_integers=("group",),
        mixes=1,
    ),
    "wgsl": Language(
        "abs bitcast clamp dot4I8Packed f32 floor i32 max min pack4xI8 select u32 vec4 workgroupBarrier",
        "WGSL",
        WgslParser,
        of_floats=("group",),
        of_integers=("group",),
        mixes=0,
        reserved=RESERVED_IN_WGSL,
    ),
    "metal": Language(
        "clamp fabs float4 floor int max min threadgroup_barrier",
        "Metal",
        types="void bool float float4 int int4 uint uint2",
        qualifiers="const device threadgroup",
        brings=("mem_flags::mem_threadgroup",),
        of_floats=("group",),
        of_integers=("group",),
    ),
    "cuda": Language(
        "__dp4a __int_as_float __syncthreads fabsf floorf fmaxf fminf make_int4 max min",
        "CUDA C",
        doubles=True,
        types="void bool float int int4 uint",
        qualifiers="const __shared__",
        brings=("threadIdx", "blockIdx", "blockDim"),
        of_floats=("group",),
        of_integers=("group",),
    ),
}
"""By a manifest's target."""

READ_PROFILE = "ieee"
"""The profile whose sines are read, of every degree."""


def is_read(manifest: Mapping[str, Any]) -> bool:
    """Return whether the text of a kernel is of a kind that is read, by its manifest (TXT-7)."""
    language, schedule = LANGUAGES.get(manifest["target"]), manifest["schedule"]["name"]
    known_sines = not manifest["sine_arguments"] or manifest["profile"]["name"].startswith(READ_PROFILE)
    if language is None or not known_sines:
        return False
    begins = language.of_floats if any(manifest["bound"]["output"]) else language.of_integers
    return bool(schedule == "plain" or schedule.startswith(begins))


def parsed(source: str, language: Language, true: Sequence[str]) -> Text:
    """Return a source, cleaned, as a compiler reads it for which these conditions hold."""
    parser = language.parser(*preprocessed(source, true), {*language.calls.split(), *language.brings})
    parser.doubles, parser.precise = language.doubles, language.precise
    parser.reserved = re.compile("|".join((*language.reserved.split(), rf"\w{{{MOST_LETTERS},}}")))
    parser.inside, parser.lists = set(language.qualifiers.split()), language.lists
    if language.types:
        parser.types = {name: parser.types[name] for name in language.types.split()}
    return parser.parse()
