"""Plant faults in the texts of kernels, one at a time, and ask the reader of texts whether it notices.

    python experiments/text_faults.py
    python experiments/text_faults.py FOLDER... --count 500

Without a folder these are kernels of a small network, for each language and kind of schedule that is read; a
folder has any kernel with its manifest and certificate. A fault changes a digit of a constant, an integer by
one, an operator or a name, loses or repeats a statement, loses a line before the functions, or puts a word
before another one that no kernel has there. `CLASSES` are faults of the language around the arithmetic, each
of which some reader has accepted. A table is printed, and each fault that the reader accepts. An array with
more room changes nothing: such faults are counted by themselves. Status 1 if the reader accepts any other.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from lab.tables import markdown

from wamnet.compiler.artifact import CERTIFICATE_NAME, write
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.kernel.instructions import REFUSED, STRAIGHT, VECTORS
from wamnet.compiler.proof.evidence import Refused, read
from wamnet.compiler.reading.check import run_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.reading.languages import TITLES
from wamnet.compiler.variants import plan_model
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization, Window
from wamnet.refimpl.network.denoise import Model

TILES = (
    ("c", "tile:8", "full"), ("opencl", "tile:8", "full"), ("opencl", "group:1", "full"),
    ("wgsl", "group:4", "full"), ("c", "dot:16", "whole8"), ("opencl", "dot:16", "whole8"),
    ("cuda", "groupdot:4", "whole8"),
)  # fmt: skip
"""Targets, schedules and variants of small kernels, in addition to the plain ones."""

ROOM = re.compile(
    r" *(?:PRECISE )?(?:float\d*|vector|union|var|wamnet_vector|uchar|uint8_t|sums|wamnet_sums)"
    r"\b[^=]*[\[<][^=]*;"
)
"""A line that declares an array without a value."""

OPERATORS = {
    "+": "-", "-": "+", "*": "+", "/": "*", "%": "/", "<": "<=", "<=": "<", ">": ">=", ">=": ">",
    "&&": "||", "||": "&&", "+=": "=", "==": "!=", ">>": "<<", "&": "|", "^": "&",
}  # fmt: skip
"""What takes an operator's place."""

EXCHANGED = (
    "min max", "fmin fmax", "fminf fmaxf", "MINIMUM MAXIMUM", "width height", "x y", "row column", "dx dy",
    "i j", "floor fabs", "floorf fabsf", "left top",
)  # fmt: skip
NAMES = {a: b for pair in map(str.split, EXCHANGED) for a, b in (pair, pair[::-1])}
"""What takes a name's place; numbered names become those before them."""

TOKEN = re.compile(
    r"/\*.*?\*/|//[^\n]*|^[ \t]*#[^\n]*$"
    r"|(?P<number>(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?f?|\d+(?:e[+-]?\d+)?f?u?)(?![\w.]))"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<operator>\+=|&&|\|\||<=|>=|==|>>|<<|\+\+|--|->|[-+*/%<>&^])",
    re.S | re.M,
)

NOTHING = re.compile(r" \(?0\)?(?![\w.])")
"""An integer zero: whether it is added or taken away is the same."""

STATEMENT = re.compile(r"(?m)^ +(?!return|\(void\)|[}#])[^\n{}]*;$")


FOREIGN = (
    "static", "volatile", "register", "unsigned", "signed", "char", "short", "long", "double", "half",
    "mediump", "lowp", "inout", "goto", "while", "discard", "asm", "typedef", "extern", "switch", "0x",
    "1 +", "-", "!", "~", "*", "&", "(char)", "sizeof", "__attribute__((weak))", "\n#pragma x\n",
    "\n#define y\n", "\\", "??/", '"/*"', "'", "`", "$", "@", "\r", "\v", "\u2028", "/*/*", "*/",
)  # fmt: skip
"""Words that no kernel has before most of its words: each changes what it says, or is an error."""

C_LIKE = ("c", "opencl", "cuda", "metal", "opengl", "glsl-es", "glsl-vulkan")
GLSL = ("opengl", "glsl-es", "glsl-vulkan")
BUFFERS = ("c", "opencl", "cuda", "metal", "glsl-vulkan")
FRAGMENTS = ("opengl", "glsl-es")
CENTRE = "#define WINDOW_CENTRE 1"
OTHER_CENTRE = "#undef WINDOW_CENTRE\n#define WINDOW_CENTRE 0\n#endif\n"
TAP, COLUMN, ROW = "int tap = ", "int column = ", "int row = "

CLASSES: tuple[tuple[str, Sequence[str], str, str], ...] = (
    *((f"a branch on {name}", C_LIKE, CENTRE, f"{CENTRE}\n#ifndef {name}\n{OTHER_CENTRE}") for name in (
        "__PCPP__", "__OPTIMIZE__", "GL_ES", "WAMNET_PORTABLE")),
    ("another file", C_LIKE, CENTRE, f'{CENTRE}\n#include "other.h"'),
    ("a macro of its own", C_LIKE, CENTRE, f"{CENTRE}\n#define true 0"),
    ("a macro a second time", C_LIKE, CENTRE, f"{CENTRE}\n#define WINDOW_CENTRE 0"),
    ("a pragma", C_LIKE, CENTRE, f'{CENTRE}\n#pragma GCC optimize("fast-math")'),
    ("a directive that continues behind a comment", C_LIKE, CENTRE, f"{CENTRE} /*\n*/ - 1 //"),
    ("lines that are joined in a comment", ("c", "opencl", "cuda"), TAP, "// why \\\n" + TAP),
    ("a trigraph", ("c", "opencl"), TAP, "// why??/\n" + TAP),
    ("a comment in a comment", ("wgsl",), "let tap", "/* /* */ let tap = 0; // */ */ let tap"),
    ("another end of a line", ("wgsl",), "let tap", "// \v var tap = 0;\nlet tap"),
    ("a variable that stays", ("c",), "float v1[6]", "static float v1[6]"),
    ("a variable that is its own value", C_LIKE, "float value = ", "float value = value; value = "),
    ("a row without a sign", ("opencl", "cuda", "metal", *GLSL), ROW, "uint row = "),
    ("a column of a byte", ("opencl",), COLUMN, "uchar column = "),
    ("a column of a byte", ("c",), COLUMN, "int8_t column = "),
    ("a column by way of a byte", ("c",), "wamnet_clamp(x", "(int8_t)wamnet_clamp(x"),
    ("a coordinate as a float", C_LIKE, TAP, "float tap = "),
    ("an integer beyond 32 bits", BUFFERS, "row * width", "row * 70000 * 70000 / 70000 / 70000 * width"),
    ("an index beyond 32 bits", C_LIKE, "dy - WINDOW_CENTRE", "dy - WINDOW_CENTRE + x * 900 - 900 * x"),
    ("a literal beyond 32 bits", C_LIKE, "dy - WINDOW_CENTRE", "dy - WINDOW_CENTRE + 4294967296 * 0"),
    ("a negative remainder", C_LIKE, "tap + c", "tap + c + -1 % 2 + 1"),
    ("a literal without a sign", C_LIKE, "tap + c", "tap + 0u + c"),
    ("a step in an expression", C_LIKE, "(tap + c)", "(tap++ + c)"),
    ("an assignment in an expression", C_LIKE, "(tap + c)", "((tap = tap) + c)"),
    ("a function for doubles", ("c",), "floorf(", "floor("),
    ("a function for integers", ("c",), "fabsf(", "abs("),
    ("an array beyond the stack", C_LIKE, "float v1[6];", "float v1[6]; float big[2000000000];"),
    ("a component below 0", FRAGMENTS, "row), 0)[c]", "row), 0)[c - 1 + 1 - 1]"),
    ("a channel that is not there", FRAGMENTS, "row), 0)[c]", "row), 0)[3]"),
    ("the size of another level", FRAGMENTS, "textureSize(image_color, 0)", "textureSize(image_color, 1)"),
    ("the middle of a pixel", FRAGMENTS, "int(gl_FragCoord.x)", "int(gl_FragCoord.x + gl_FragCoord.x) / 2"),
    ("nothing to see", FRAGMENTS, "0.0, 1.0)", "0.0, 0.0)"),
    ("a value out of an argument", GLSL, "void main()", "void set(out float a) { a = 1.0; }\nvoid main()"),
    ("a function that is never called", ("c",), "static inline int", "void at() { }\nstatic inline int"),
    ("a constructor", ("c",), "static inline int", "__attribute__((constructor)) static inline int"),
    ("half the pixels of a corner", C_LIKE, "bool inside = ", "bool inside = !(x == 3 && y == 1) && "),
    ("a pixel of a corner", C_LIKE, "bool inside = ", "bool inside = !(x < 1 && y < 1) && "),
    ("a pixel near two borders", C_LIKE, "bool inside = ", "bool inside = !(x + 2 == width && y < 1) && "),
    ("rows of one height", ("c",), "y < height;", "y < (height == 16 ? 1 : height);"),
    ("every second row", ("c",), "y < height; ++y", "y < height; y += 2"),
    ("no rows of large images", ("c",), "        for (int x = 0", "        if (y < 1000) for (int x = 0"),
    ("no guard against fast-math", ("c",), "defined(__FAST_MATH__) || ", ""),
    ("products that are fused", ("c",), "pop_options", "pop_options\n#pragma STDC FP_CONTRACT ON"),
    ("options that end too early", ("c",), CENTRE, f"#pragma GCC pop_options\n{CENTRE}"),
    *((f"no precision of {of}", ("glsl-es",), f"precision highp {of};", "") for of in ("int", "sampler2D")),
    ("less precision", ("glsl-es",), "precision highp float", "precision mediump float"),
    ("a product that is not precise", ("opengl", "glsl-vulkan"), "PRECISE float t6", "float t6"),
    ("sums that are not precise", ("opengl", "glsl-vulkan"), "PRECISE float part1", "float part1"),
    ("precise is nothing", ("glsl-vulkan",), "#define PRECISE precise", "#define PRECISE"),
    ("another layout", ("glsl-vulkan",), "std430, binding = 3", "std140, binding = 3"),
    ("groups of another size", ("glsl-vulkan",), "local_size_x = 8", "local_size_x = 4"),
    ("groups of another size", ("wgsl",), "@workgroup_size(8, 8)", "@workgroup_size(1, 1)"),
    ("another axis", ("opencl",), "get_global_id(1)", "get_global_id(-1)"),
    ("another axis", ("cuda",), "blockIdx.y * blockDim.y", "blockIdx.y * blockDim.x"),
    ("a result in another order", ("opengl",), "result[i] = ", "result.bgra[i] = "),
    ("a member that does not exist", ("opengl",), "result[i] = ", "result.other[i] = "),
    ("a version that is not first", ("opengl",), "#version", "#define WINDOW_SIZE 3\n#version"),
    ("a version behind a comment", ("glsl-es",), "#version", "/* */\n#version"),
    ("a precision behind what it is for", ("glsl-es",), "precision highp sampler2D;",
     "uniform sampler2D image_other;\nprecision highp sampler2D;"),
    ("an integer as a float", ("glsl-es", "wgsl"), "] = 0.0f", "] = 0"),
    ("an integer times a float", ("glsl-es", "wgsl"), "3.0f * v50", "3 * v50"),
    ("a coordinate without a conversion", ("wgsl",), "i32(invocation.x)", "invocation.x"),
    ("a coordinate without a conversion", ("glsl-vulkan",), "x = int(gl_GlobalInvocationID.x)",
     "x = gl_GlobalInvocationID.x"),
    ("a float without a point", C_LIKE, "3.0f *", "3f *"),
    ("an octal integer", C_LIKE, "< 6;", "< 06;"),
    *(("a reserved word", C_LIKE, "float value = ", f"float {name} = 0.0f, value = ") for name in (
        "half", "sample", "input", "register", "gl_value", "a__b", "_", "uvec2", "sampler2DRect", "float4x4",
        "size_t", "_Bool", "and_eq", "isnan", "linux", "a" * 300)),
    *(("a reserved word", ("wgsl",), "let value", f"let {name} = 0; let value") for name in (
        "ref", "active", "__value", "_")),
    ("a constant that is written", C_LIKE, TAP, f"const int once = 0; once = 1; {TAP}"),
    ("a step of a constant", ("c", "cuda"), TAP, f"const int once = 0; once++; {TAP}"),
    ("a constant that is written", ("wgsl",), "let tap", "let once: i32 = 0; once = 1; let tap"),
    ("a step of a constant", ("wgsl",), "for (var j", "for (let j"),
    ("a const that does not exist", ("wgsl",), "let tap", "const tap"),
    ("a step before its name", ("wgsl",), "j++", "++j"),
    ("a loop without braces", ("wgsl",), "{\n        v1[j] = weights[324 + j];\n    }",
     "v1[j] = weights[324 + j];"),
    ("a branch without braces", ("wgsl",), "{\n        return;\n    }", "return;"),
    ("a choice of C", ("wgsl",), "select(t48, t44, t47)", "t47 ? t44 : t48"),
    ("operators in no order", ("wgsl",), "x >= width || y >= height", "x >= width || y >= height && true"),
    ("a value that is dropped", ("wgsl",), "let tap", "clamp(1, 0, 2); let tap"),
    ("a constant of other bits", C_LIKE, "0.318309873f", "0.318309885f"),
    ("an integer with f", C_LIKE, "1.0f - t22", "1f - t22"),
    ("a negative integer against a size", C_LIKE, "* value;", "* (c - 1 < sizeof v1 ? value : 0.0f);"),
    ("a difference of a size", C_LIKE, TAP, "row = sizeof v1 - 25 > 0 ? 0 : row; " + TAP),
    ("a vector of a comma", ("metal",), TAP, "float4 v0 = (float4)(0.0f, 1.0f, 2.0f, 3.0f); " + TAP),
    ("one number for a group", ("opencl",), TAP, "__local int tap; tap = "),
    ("one number for a group", ("metal",), TAP, "threadgroup int tap; tap = "),
    ("one number for a group", ("cuda",), TAP, "__shared__ int tap; tap = "),
    ("a row by way of a float", ("opencl",), TAP, "row = fmin(fmax(y + dy - 1, 0), height - 1); int tap = "),
    ("a row by way of a float", ("cuda",), TAP, "row = fminf(fmaxf(y + dy - 1, 0), height - 1); int tap = "),
    ("the least of a float and an integer", ("opencl", "metal"), "(t41, 1.0f)", "(t41, 1)"),
    ("an address before its array", BUFFERS[:4], "+= part1[j]", "+= (part1 - 6 + 6)[j]"),
    ("an address before the weights", BUFFERS[:4], "weights[(tap + c)", "(weights - 6)[(tap + 1 + c)"),
    ("an address behind an array", BUFFERS[:4], "float v1[6];", "float v1[6]; float *p = v1 + 7;"),
    ("arrays that together are beyond the stack", C_LIKE, "float v1[6];",
        "float v1[6];" + "".join(f" float v0{k}[262144];" for k in range(5))),
    ("a type of another language", ("c", "cuda", "metal", "opencl"), "float v1[6];", "f32 v0; float v1[6];"),
    ("a qualifier of another language", ("c",), "float v1[6];", "precise float v1[6];"),
    ("a name that is a word of a language", C_LIKE, TAP, "int short = 0; int tap = "),
    ("a name that is a macro of a header", C_LIKE, TAP, "int NAN = 0; int tap = "),
    ("a declaration for a loop's body", C_LIKE, TAP, "for (int q = 0; q < 1; ++q) float r; int tap = "),
    ("an address that loses const", BUFFERS[:4], "float v1[6];", "float *p = weights; float v1[6];"),
    ("a float beyond an integer", ("c", "cuda", "metal", "opencl"), TAP, f"int q = (int)3e9f; {TAP}"),
    ("a float beyond an integer", (*GLSL, "metal"), TAP, f"int q = int(3e9f); {TAP}"),
    ("a conversion without a word", GLSL, TAP, f"int q = 1.0f; {TAP}"),
    ("a conversion without a word", ("wgsl",), "let tap", "let q: i32 = 1.0f; let tap"),
    ("a cast of C", GLSL, TAP, f"float q = (float)1; {TAP}"),
    ("bits of a float", C_LIKE, TAP, f"float q = 1.0f & 2.0f; {TAP}"),
    ("a shift of a float", C_LIKE, TAP, f"float q = 1.0f << 1; {TAP}"),
    ("a variable of type void", ("c", "cuda", "metal", "opencl"), TAP, f"void q; {TAP}"),
    ("a value of type void", ("c", "cuda", "metal", "opencl"), TAP, f"int q = (void)0; {TAP}"),
    ("an array of a variable's size", C_LIKE, TAP, f"int n = 4; float q[n]; {TAP}"),
    ("a constant without a value", ("cuda", "metal"), TAP, f"const int q; {TAP}"),
    ("a constant of run time", FRAGMENTS, TAP, f"const {TAP}"),
    ("a loop's name in its body", C_LIKE, TAP, f"for (int q = 0; q < 1; ++q) {{ int q = 0; }} {TAP}"),
    ("a value between two in no order", ("metal", "opencl", *GLSL), TAP, f"int q = clamp(0, 2, 1); {TAP}"),
    ("an exponent of many digits", C_LIKE, "3.0f *", "3e00000000f *"),
    ("a suffix in upper case", ("wgsl",), "3.0f *", "3.0F *"),
    ("a namespace before its library", ("metal",), "#include <metal_stdlib>\nusing namespace metal;",
        "using namespace metal;\n#include <metal_stdlib>"),
    *(("constants that are 0 in the field", C_LIKE, "+= part1[j];", f"+= part1[j] + {a} + {b};")
      for a, b in (("0.9375f", "4.656612873077393e-10f"), ("2013265920.0f", "1.0f"))),
    *(("a name that an extension has", (of,), TAP, f"int {name} = 0; {TAP}") for of, name in (
        ("opencl", "cl_khr_fp64"), ("opencl", "vec_step"), ("opencl", "cles_khr_int64"), ("opengl", "packed"),
        ("opengl", "row_major"), ("opengl", "GL_core_profile"), ("glsl-vulkan", "samplerShadow"),
        ("glsl-vulkan", "isubpassInput"))),
    *((f"a constant that is {what}", C_LIKE, CENTRE, CENTRE.replace("1", text)) for what, text in (
        ("two in parentheses", "(2) - (1)"), ("a negative quotient", "((0 - 1) / 2 + 2)"),
        ("a negative remainder", "((0 - 1) % 3 - 1)"),
        ("beyond 32 bits on the way", "(65536 * 65536 / 65536 - 65535)"))),
    ("a comment to the end of a line in a product", C_LIKE, TAP, f"{TAP}12 //**/ 2\n - 6 + "),
    ("a comment that a joined line ends", C_LIKE, TAP, f"/* x *\\\n/ int n = 0; /* */ {TAP}"),
    ("a loop that moves its end", C_LIKE, TAP, f"int k = 3; for (int i = 0; i < k; ++i) {{ k = 1; }} {TAP}"),
    ("a loop that nothing unrolls", C_LIKE, TAP, f"WAMNET_UNROLL\nfor (int i = 0; i < 3; ++i) {{ }} {TAP}"),
    ("an end of another name", ("c",), "#undef restrict", "#undef NULL\n#undef restrict"),
    ("blocks deep in each other", (*C_LIKE, "wgsl"), "/* output color */", f"{'{' * 150}{'}' * 150}"),
    ("a second pragma of fused products", ("c",), CENTRE, f"""#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=fast")
#else
#pragma STDC FP_CONTRACT ON
#endif
{CENTRE}"""),
    ("a number beyond integers on the way", ("c", "cuda", "metal", "opencl"), "* 3 + i] =",
        "* 3 + 2000000000 - 2000000000 + i] ="),
    ("brackets beyond integers", ("c", "cuda", "metal", "opencl"), "v90[i];",
        "v90[i + ((0 - 2147483647) + (2147483647 + 1)) - 1];"),
    ("zero times what is no integer", ("c", "cuda", "metal", "opencl"), "v90[i];",
        "v90[i + 0 * (2147483647 + i)];"),
    ("a coordinate that wraps", ("c", "cuda", "metal", "opencl"), "x + dx -", "x * 30 - x * 29 + dx -"),
    ("a value that changes", ("wgsl",), "let t16: f32 = t13 - t15;",
        "let t16: f32 = t13;\n        t16 = t13 - t15;"),
    ("undeclared vectors of weights", ("c", "cuda", "metal", "opencl", "wgsl"), "weights[", "w[0 + "),
    ("an undeclared array of weights", ("glsl-es", "opengl"), TAP, f"float q = weights[0]; {TAP}"),
    ("an array of arrays", ("glsl-es", "opengl"), "PRECISE float p",
        "PRECISE float q[1][1]; PRECISE float p"),
    ("a mix of integers", ("glsl-es", "opengl"), TAP, f"{TAP}0 * mix(0, 1, true) + "),
    ("two blocks of one name", ("glsl-vulkan",), "Image_normal {", "Image_color {"),
    ("a message of another schedule", ("c",), "\n/* No product may", f"\n{REFUSED}\n/* No product may"),
    ("vectors of no size", ("c",), "static inline void wa", f"{STRAIGHT}\n{VECTORS}static inline void wa"),
    ("a picture of another kernel", ("opengl",),
        "    for (int i = 0; i < 3; ++i) {\n        result[i] = v90[i];\n    }",
        "vec4 color = vec4(0.0, 0.0, 0.0, 1.0);\ncolor[0] = v90[0]; color[1] = v90[1]; color[2] = v90[2];\n"
        "imageStore(result, ivec2(x, y), color);"),
)  # fmt: skip
"""What a fault is, in which languages' plain kernels, and what it puts instead of what."""

LOAD = "    memcpy(to->lane, from, sizeof to->lane);"
OF_SCHEDULES: tuple[tuple[str, str, str, str], ...] = (
    ("a vector of a comma", "metal group:1 full", "return float4(element", "return (float4)(element"),
    ("one number for a group", "cuda group:1 full", "float x0_0 = ", "__shared__ float x0_0; x0_0 = "),
    ("one vector for a group", "opencl group:1 full", "float4 part_0_0 =",
        "__local float4 part_0_0; part_0_0 ="),
    ("more memory for a group", "metal group:1 full", "threadgroup float tile",
        "threadgroup float spare[200000]; threadgroup float tile"),
    ("an operator that vectors lack", "cuda group:1 full", "v1_0_0 += part_0_0;",
        "v1_0_0 = v1_0_0 + part_0_0;"),
    ("operands that an operator lacks", "cuda group:1 full", "part_0_0 += m * x0_0", "part_0_0 += x0_0 * m"),
    ("a vector for a number", "opencl group:1 full", "float4 t4 = ", "float t4 = "),
    ("a size behind its use", "opencl group:1 full", "#define GROUP_HEIGHT 8\n", ""),
    ("vectors of another size", "opencl dot:16 whole8", "typedef int16 sums", "typedef int8 sums"),
    ("no header of a function", "c dot:16 whole8", "#include <string.h>\n", ""),
    ("a copy to itself", "c dot:16 whole8", LOAD, LOAD + LOAD.replace("from", "to->lane")),
    ("a copy of less than nothing", "c dot:16 whole8", LOAD, LOAD + "memcpy(to->lane, from, -4);"),
    ("weights seen as integers", "c dot:16 whole8", LOAD, "const int32_t *w = (const int32_t *)from;\n"
        "    for (int i = 0; i < LANES; ++i) { to->lane[i] = w[i]; }"),
    ("an address of other numbers", "opencl dot:16 whole8", "((const fours *)(", "((const uint *)("),
    ("an address of another space", "opencl group:1 full",
        "__global const float4 *w = (__global const float4 *)", "const float4 *w = (const float4 *)"),
    ("a cast to integers", "opencl group:1 full",
        "const float4 *w = (__global const float4 *)", "const int4 *w = (__global const int4 *)"),
    ("truths as floats", "opencl group:1 full", "int4 t47 =", "float4 t47 ="),
    ("a union of other numbers", "opencl tile:8 full", "]; float number", "]; int number"),
    ("a union of other sizes", "opencl tile:8 full", " * 8]; }", " * 4]; }"),
    ("a component of a colour", "cuda group:1 full", "v90_0_0.x;", "v90_0_0.r;"),
    ("a pragma of no loop", "c tile:8 full", "    int top = y", "    WAMNET_UNROLL int top = y"),
    ("a row of an array by another", "c tile:8 full", "&sum[p][0], &part[p][0]", "sum[0] + p, part[0] + p"),
    ("sums that may be reordered", "glsl-vulkan group:1 full", "PRECISE vec4 part_0_0", "vec4 part_0_0"),
    ("sums of sums that may be reordered", "glsl-vulkan group:1 full", "PRECISE vec4 v1_0_0", "vec4 v1_0_0"),
    ("a name of a type", "opencl dot:16 whole8", "int16 sum[", "int16 sums[1]; int16 sum["),
    ("an address of another vector", "c dot:16 whole8", "wamnet_weights(&w0", "wamnet_start(&w0"),
    ("a comparison that vectors lack", "glsl-vulkan group:1 full", "    barrier();",
        "    bvec4 q = w[0] < w[0]; barrier();"),
    ("a minimum of a number and a vector", "glsl-vulkan group:1 full", "    barrier();",
        "    PRECISE vec4 q = min(1.0f, w[0]); barrier();"),
    ("a number of a vector", "glsl-vulkan group:1 full", "    barrier();",
        "    vec4 q = float(w[0]); barrier();"),
    ("a choice of a number or a vector", "wgsl group:1 full", "    workgroupBarrier();",
        "    let q: vec4<f32> = select(0.0f, w[0], w[0] > w[0]); workgroupBarrier();"),
    ("a maximum of a vector and a number", "wgsl group:1 full", "    workgroupBarrier();",
        "    let q: vec4<f32> = max(w[0], 0.0f); workgroupBarrier();"),
    ("a vector of a number", "opencl group:1 full", "x0_0 = tile[at]", "x0_0 = convert_float4(tile[at])"),
    ("bits of a part of a vector", "opencl group:1 full", "as_float4(as_int4(v1)", "as_float2(as_int2(v1)"),
    ("another vector by a cast", "opencl dot:16 whole8", "CONVERT(sum[p][0], float16)",
        "(float16)(sum[p][0])"),
)  # fmt: skip
"""What a fault is, in which language, schedule and variant, and what it puts instead of what."""

Given = tuple[str, Any, Any, Any]
"""A kernel's text, certificate, manifest and weights."""


class Fault(NamedTuple):
    """A change of a text: where, to what, and what kind of mistake it is."""

    start: int
    end: int
    new: str
    kind: str


def faults(source: str) -> Iterator[Fault]:
    """Yield all faults of a text, those of its comments left out.

    Nor is it one to take a zero away where it was added, nor to keep a macro after the last function.
    """
    start, words = source.index("{", source.index("*/")), 0
    for m in re.finditer(r"(?m)^(?!#undef|__kernel __attr)[^\s/*}][^\n]*\n", source[:start]):
        yield Fault(m.start(), m.end(), "", "a line lost")
    for m in TOKEN.finditer(source, start):
        place = m.start(), m.end()
        if m["number"] or m["name"] or m["operator"]:
            words += 1
            foreign = FOREIGN[words % len(FOREIGN)]
            if (foreign, m["number"]) != ("-", "0"):  # the same number
                yield Fault(m.start(), m.start(), foreign + " ", "a foreign word")
        if m["number"]:
            yield from (Fault(*place, new, kind) for new, kind in numbers(m["number"]))
        elif m["name"] in NAMES:
            yield Fault(*place, NAMES[m["name"]], "another name")
        elif m["name"] and (numbered := re.fullmatch(r"([a-z]+)(\d+)", m["name"])) and m["name"] != "float4":
            yield Fault(*place, f"{numbered[1]}{int(numbered[2]) - 1}", "another variable")
        elif m["operator"] == "+" and NOTHING.match(source, m.end()):
            continue
        elif m["operator"] in OPERATORS:
            yield Fault(*place, OPERATORS[m["operator"]], "another operator")
    for m in STATEMENT.finditer(source, start):
        yield Fault(m.start(), m.end(), "", "a statement lost")
        if "+=" in m[0]:
            yield Fault(m.start(), m.end(), m[0] * 2, "a statement twice")


def numbers(text: str) -> Iterator[tuple[str, str]]:
    """Yield what takes a number's place: another seventh digit, or an integer one more or less."""
    if "." in text or "e" in text:
        digits = [k for k, c in enumerate(text.partition("e")[0]) if c.isdigit()]
        k = digits[min(6, len(digits) - 1)]
        yield f"{text[:k]}{(int(text[k]) + 1) % 10}{text[k + 1 :]}", "the seventh digit of a constant"
        return
    value = int(text.rstrip("uf"))
    tail = text[len(str(value)) :]
    yield f"{value + 1}{tail}", "an integer one more"
    if value:
        yield f"{value - 1}{tail}", "an integer one less"


def spare(source: str, fault: Fault) -> bool:
    """Return whether a fault gives an array more room, which changes nothing."""
    line = source[source.rfind("\n", 0, fault.start) + 1 : source.find("\n", fault.start)]
    before = line[: fault.start - source.rfind("\n", 0, fault.start) - 1]
    size = (
        fault.kind == "a foreign word" and fault.new.endswith("+ ") and before.rfind("[") > before.rfind("]")
    )
    return ROOM.match(line) is not None and (
        size or fault.kind in ("an integer one more", "another operator")
    )


def small(folder: Path) -> Iterator[Path]:
    """Write kernels of a small network: plain in every language that is read, and in tiles; yield folders."""
    network = siren.init((3**2 * 6, 6, 5, 3), 1.0, 3.0, seed=5)
    model = Model(network, ("color", "normal"), Window(3, "clamp"), Normalization())
    for target, schedule, variant in [*((target, "plain", "full") for target in TITLES), *TILES]:
        made = folder / f"{target}-{schedule}"
        write(compile_plan(plan_model(model, target, "ieee", schedule, variant)), made)
        yield made


def tried(given: Given, count: int, seed: int) -> Iterator[tuple[Fault, bool]]:
    """Plant faults in a kernel's text, one at a time; yield each, and whether the reader notices it."""
    source, *others = given
    every = list(faults(source))
    random.Random(seed).shuffle(every)
    for fault in every[:count]:
        try:
            run_text(source[: fault.start] + fault.new + source[fault.end :], *others)
        except (Refused, Unread):
            yield fault, True
        else:
            yield fault, False


def planted(folder: Path, count: int, seed: int) -> tuple[list[str], int]:
    """Plant faults in a kernel; return a row of the table, and how many were accepted, spare room apart."""
    held, manifest, _, _, weights = read(folder / CERTIFICATE_NAME)
    (name,) = (name for name in manifest["files"] if name != "weights.bin")
    source = (folder / name).read_text()
    run_text(source, held, manifest, weights)  # the text itself must hold
    done: Counter[str] = Counter()
    for fault, noticed in tried((source, held, manifest, weights), count, seed):
        if noticed:
            done["noticed"] += 1
            continue
        harmless = spare(source, fault)
        done["harmless" if harmless else "accepted"] += 1
        line = source.count("\n", 0, fault.start)
        sys.stderr.write(
            f"{'harmless' if harmless else 'ACCEPTED'}: {folder.name}, line {line + 1}, {fault.kind}: "
        )
        sys.stderr.write(f"{source.splitlines()[line].strip()} -> {fault.new!r}\n")
    counts = [len(list(faults(source))), done.total(), done["noticed"], done["harmless"], done["accepted"]]
    return [manifest["target"], manifest["schedule"]["name"], *map(str, counts)], done["accepted"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Plant faults as the command line says; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folders", type=Path, nargs="*", help="kernels; default: small ones, of all languages"
    )
    parser.add_argument("--count", type=int, default=60, help="faults in each kernel")
    parser.add_argument("--seed", type=int, default=0, help="which of all that are possible")
    options = parser.parse_args(arguments)
    rows, accepted = [], 0
    with TemporaryDirectory() as scratch:
        for folder in options.folders or small(Path(scratch)):
            row, wrong = planted(folder, options.count, options.seed)
            rows.append(row)
            accepted += wrong
    heads = ["target", "schedule", "possible faults", "planted", "noticed", "more room only", "accepted"]
    print(markdown(heads, rows))
    return int(accepted > 0)


if __name__ == "__main__":
    sys.exit(main())
