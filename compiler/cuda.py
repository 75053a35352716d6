"""CUDA C: kernels of one pixel a thread on buffers of floats, as those for OpenCL; `extern "C"` names.

The compiler may fuse a product with a sum, which profile `ieee` allows. Division and square root are rounded
as IEEE 754 says unless an option relaxes them: do not pass -use_fast_math, -ftz=true or -prec-div=false.
"""

from __future__ import annotations

from .c import C
from .dialect import Dialect
from .encode_dialect import EncodeDialect, OpenCLEncode
from .opencl import OpenCL
from .opencl_path import OpenCLPath
from .path_dialect import PathDialect
from .profiles import UNIT_ROUNDOFF, SineContract

OUTSIDE = """\
    int x = (int)(blockIdx.x * blockDim.x + threadIdx.x);
    int y = (int)(blockIdx.y * blockDim.y + threadIdx.y);
    if (x >= width || y >= {rows}) {{
        return;
    }}"""
"""The start of a kernel: a thread outside of the picture ends."""

CLAMP = """\
#ifndef WAMNET_CLAMP
#define WAMNET_CLAMP
static __device__ inline int wamnet_clamp(int value, int low, int high)
{{
    return value < low ? low : value > high ? high : value;
}}
#endif
"""
"""Limits an index; the language has no such function."""

ASSUMES = (
    "the compiler is not told to relax arithmetic: no -use_fast_math, no -ftz=true, no -prec-div=false, no "
    "-prec-sqrt=false; it may fuse products with sums, which the bound allows"
)
"""What the source cannot check by itself."""

LAUNCH = "Launch blocks of any size that together cover (width, {rows}) threads"
"""How all these kernels are called."""


class _CUDA(Dialect):
    """What the three kernels have in common."""

    target = "cuda"
    language = "CUDA C"
    suffix = ".cu"
    native_sine = SineContract("sinf() of CUDA, 2 ulp on all arguments", 2 * 2 * UNIT_ROUNDOFF)
    assumes = ASSUMES
    types = {**Dialect.types, "uint32": "unsigned int"}
    magnitude = C.magnitude
    clamp = "wamnet_clamp"
    max_output_channels = 2**16
    table = "static __device__ const {type} {name}[{count}] = {{{values}}};"
    operations = {
        **C.operations,
        "minimum": "fminf({0}, {1})",
        "maximum": "fmaxf({0}, {1})",
        **{
            f"{op}imum.{kind}": f"{op}({{0}}, {{1}})" for op in ("min", "max") for kind in ("int32", "uint32")
        },
    }


class CUDA(_CUDA):
    """The dialect's table for denoisers."""

    entry = "wamnet_denoise"
    image_declaration = "    const float *__restrict__ image_{image}"
    image_separator = ",\n"
    begin = f"""\
{{defines}}
{CLAMP}
extern "C" __global__ void {{entry}}(
{{images}},
    const float *__restrict__ weights,
    float *__restrict__ result,
    int width,
    int height)
{{{{
{OUTSIDE.format(rows="height").replace("{", "{{").replace("}", "}}")}"""
    pixel = OpenCL.pixel
    weight = OpenCL.weight
    store = OpenCL.store
    arguments = (
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "weights; result: width * height * {channels} floats in the same order, encoded as `output` says;\n"
        "width; height.\n"
        f"{LAUNCH.format(rows='height')}"
    )


class CUDAPath(_CUDA, PathDialect):
    """The dialect's table for paths."""

    entry = PathDialect.entry
    lane_numbers = "0u"
    bounces = "for (unsigned int bounce = 0u; bounce <= MAX_DEPTH; ++bounce) {"
    path_begin = f"""\
#define MAX_DEPTH {{max_depth}}u /* scatterings of a path */
{{tables}}
extern "C" __global__ void {{entry}}(
    float *__restrict__ sums,
    int width,
    int height,
    int first_row,
    int rows,
    unsigned int first_sample,
    int samples,
    unsigned int seed_number)
{{{{
{
        OUTSIDE.format(rows="rows")
        .replace("int x", "int column")
        .replace("int y", "int row")
        .replace("(x >=", "(column >=")
        .replace("y >= rows", "row >= rows")
        .replace("{", "{{")
        .replace("}", "}}")
    }
    size_t plane = (size_t)rows * (size_t)width;
    size_t at = (size_t)row * (size_t)width + (size_t)column;
    {{counter}} x = {{column}} + {{lane_numbers}};
    {{counter}} y = {{row}};
    {{counter}} seed = {{seed}};"""
    path_end = "}}"
    uniforms = {
        "column": "(unsigned int)column",
        "row": "(unsigned int)(row + first_row)",
        "seed": "seed_number",
        "width": "(float)width",
        "height": "(float)height",
        "sample": "first_sample + (unsigned int)n",
    }
    scalar_float = "(float){0}"
    output_declaration = ""
    sum_store = OpenCLPath.sum_store
    max_planes = 2**16
    path_arguments = (
        "sums: float, one plane of rows * width numbers for each of:\n"
        "{planes};\n"
        "width, height of the image; first_row; rows; first_sample; samples to add up; seed.\n"
        f"{LAUNCH.format(rows='rows')}; thread (x, y) follows pixel x of row first_row + y"
    )


class CUDAEncode(_CUDA, EncodeDialect):
    """The dialect's table for encodings."""

    entry = EncodeDialect.entry
    encode_begin = f"""\
extern "C" __global__ void {{entry}}(
    const float *__restrict__ sums,
{{outputs}},
    int width,
    int height,
    int sample_count)
{{{{
{OUTSIDE.format(rows="height").replace("{", "{{").replace("}", "}}")}
    size_t plane = (size_t)width * (size_t)height;
    size_t at = (size_t)y * (size_t)width + (size_t)x;
    float samples = (float)sample_count;"""
    encode_end = "}}"
    input_declaration = ""
    output_declaration = "    float *__restrict__ image_{image}"
    output_separator = ",\n"
    load = OpenCLEncode.load
    image_store = "image_{image}[at * {channels} + {channel}] = {value};"
    planes_per_input = 1
    encode_arguments = (
        "sums: float, one plane of width * height numbers for each of:\n"
        "{planes};\n"
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "width; height; sample_count.\n"
        f"{LAUNCH.format(rows='height')}"
    )
