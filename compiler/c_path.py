"""C99 for paths and encodings: headers of `static inline` functions, pixel by pixel, as the denoiser's."""

from __future__ import annotations

from .c import C
from .encode_dialect import EncodeDialect, OpenCLEncode
from .opencl_path import OpenCLPath
from .path_dialect import PathDialect

GUARD = """\
#ifndef WAMNET_{name}_H
#define WAMNET_{name}_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif
"""
"""The first lines of a header: no product is fused with a sum, as in the denoiser's."""

IGNORED = """\
/* What only planes need that are not asked for is computed all the same; compilers leave it out. */
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wunused-but-set-variable"
#endif
"""
"""Around a path kernel: its programs are the same whatever planes it adds up."""


class CPath(C, PathDialect):
    """The dialect's table for paths."""

    entry = "wamnet_trace_pixel"
    lane_numbers = "0u"
    bounces = "for (uint32_t bounce = 0u; bounce <= MAX_DEPTH; ++bounce) {"
    path_begin = f"""\
{GUARD.format(name="TRACE")}{IGNORED}
#define MAX_DEPTH {{max_depth}}u /* scatterings of a path */
{{tables}}
/* What all pixels of a launch share. */
typedef struct {{{{
    int width;
    int height;
    int first_row;
    int rows;
    uint32_t first_sample;
    int samples;
    uint32_t seed_number;
}}}} wamnet_part;

/* One pixel, in column `column` of row first_row + `row`. */
static inline void {{entry}}(const wamnet_part *part, float *restrict sums, int column, int row);

/* All pixels, one after another. */
static inline void wamnet_trace(const wamnet_part *part, float *restrict sums)
{{{{
    for (int row = 0; row < part->rows; ++row) {{{{
        for (int column = 0; column < part->width; ++column) {{{{
            {{entry}}(part, sums, column, row);
        }}}}
    }}}}
}}}}

static inline void {{entry}}(const wamnet_part *part, float *restrict sums, int column, int row)
{{{{
    const int samples = part->samples;
    size_t plane = (size_t)part->rows * (size_t)part->width;
    size_t at = (size_t)row * (size_t)part->width + (size_t)column;
    {{counter}} x = {{column}} + {{lane_numbers}};
    {{counter}} y = {{row}};
    {{counter}} seed = {{seed}};"""
    path_end = C.end.replace("}}", "}}\n\n#if defined(__GNUC__)\n#pragma GCC diagnostic pop\n#endif", 1)
    uniforms = {
        "column": "(uint32_t)column",
        "row": "(uint32_t)(row + part->first_row)",
        "seed": "part->seed_number",
        "width": "(float)part->width",
        "height": "(float)part->height",
        "sample": "part->first_sample + (uint32_t)n",
    }
    scalar_float = "(float){0}"
    output_declaration = ""
    sum_store = OpenCLPath.sum_store
    max_planes = 2**16
    path_arguments = (
        "sums: float, one plane of rows * width numbers for each of:\n"
        "{planes};\n"
        "part: width, height of the image; first_row; rows; first_sample; samples to add up; seed_number.\n"
        "wamnet_trace does all pixels, wamnet_trace_pixel one: call that from your own loops"
    )


class CEncode(C, EncodeDialect):
    """The dialect's table for encodings."""

    entry = "wamnet_encode"
    encode_begin = f"""\
{GUARD.format(name="ENCODE")}
/* All pixels. */
static inline void {{entry}}(
    const float *restrict sums,
{{outputs}},
    int width,
    int height,
    int sample_count)
{{{{
    const size_t plane = (size_t)width * (size_t)height;
    const float samples = (float)sample_count;
    for (size_t at = 0; at < plane; ++at) {{{{"""
    encode_end = f"    }}}}\n{C.end}"
    input_declaration = ""
    output_declaration = "    float *restrict image_{image}"
    output_separator = ",\n"
    load = OpenCLEncode.load
    image_store = "image_{image}[at * {channels} + {channel}] = {value};"
    planes_per_input = 1
    encode_arguments = (
        "sums: float, one plane of width * height numbers for each of:\n"
        "{planes};\n"
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "width; height; sample_count"
    )
