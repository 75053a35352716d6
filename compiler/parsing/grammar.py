"""The grammar of kernels' sources as tables: tokens, operators, and the words of each language [parse.py]."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ..kernel.kernel import BOOL, FLOAT, INT, Type

TOKEN = re.compile(
    r"(?P<unroll>#pragma unroll\n|WAMNET_UNROLL\n)|\s+"
    r"|(?P<float>\d+(?:\.\d+(?:e[+-]\d+)?|e[+-]\d+)f(?!\w))|(?P<mask>0x7fffffff)(?!\w)"
    r"|(?P<integer>(?:0|[1-9]\d*)u?(?![\w.]))|(?P<word>[A-Za-z_]\w*(?:::\w+)?)"
    r"|(?P<sign>\+\+|--|[-+]=|<=|>=|==|!=|&&|\|\||>>|[-+*/%<>=!?:;,.(){}\[\]&^])"
)
"""The tokens of all languages; a kernel has no others."""

BINARY: tuple[Mapping[str, str], ...] = (
    {"||": "logical_or"}, {"&&": "logical_and"}, {"^": "bitwise_xor"}, {"&": "bitwise_and"},
    {"==": "equal", "!=": "not_equal"},
    {"<": "less", "<=": "less_equal", ">": "greater", ">=": "greater_equal"}, {">>": "right_shift"},
    {"+": "add", "-": "subtract"}, {"*": "multiply", "/": "divide", "%": "remainder"},
)  # fmt: skip
"""Operators of two operands, from those that bind least."""

PRODUCTS = len(BINARY) - 1
"""The level of products."""

COMMON = {"floor": "floor", "sqrt": "sqrt", "exp": "exp", "sin": "sin", "cos": "cos"}
"""Functions that most languages name as the operations."""

SHADER = {**COMMON, "pow": "power", "min": "minimum", "max": "maximum", "abs": "absolute", "clamp": "clamp"}
"""Functions of shading languages."""

C_CALLS = {f"{word}f": op for word, op in COMMON.items()} | {
    "powf": "power", "fabsf": "absolute", "wamnet_clamp": "clamp",
}  # fmt: skip
"""Functions of C and CUDA."""

LEAST_MOST = {"min": "minimum", "max": "maximum"}
"""Functions of integers."""

C_TYPES = {"float": FLOAT, "int": INT, "bool": BOOL}
"""Types of C and its children."""

VECTORS = {f"float{n}": FLOAT.of(n) for n in (2, 4, 8, 16)}
"""Vectors of OpenCL."""

MASKS = {f"int{n}": BOOL.of(n) for n in (2, 4, 8, 16)}
"""Booleans in vectors of OpenCL, which are integers with all bits set."""


@dataclass(frozen=True)
class Language:
    """The words of a language: types, functions, a barrier; `qualifier`: one that changes no value."""

    types: Mapping[str, Type]
    calls: Mapping[str, str]
    barrier: str = ""
    qualifier: str = ""
    casts: bool = True
    texels: bool = False
    lets: bool = False


LANGUAGES: Mapping[str, Language] = {
    "c": Language({**C_TYPES, "int32_t": INT, "uint32_t": Type("uint32")}, C_CALLS),
    "opencl": Language(
        {**C_TYPES, **VECTORS, **MASKS, "uint": Type("uint32")},
        {
            **COMMON,
            "fabs": "absolute",
            "fmin": "minimum",
            "fmax": "maximum",
            "clamp": "clamp",
            "FLOOR": "floor",
        }
        | {**LEAST_MOST, "exp2": "exp2", "log2": "log2"},
        "barrier(CLK_LOCAL_MEM_FENCE)",
    ),
    "cuda": Language(
        C_TYPES, {**C_CALLS, **LEAST_MOST, "fminf": "minimum", "fmaxf": "maximum"}, "__syncthreads()"
    ),
    "metal": Language(
        {**C_TYPES, "uint": Type("uint32")},
        {**COMMON, **LEAST_MOST, "fabs": "absolute", "pow": "power", "clamp": "clamp"},
        "threadgroup_barrier(mem_flags::mem_threadgroup)",
    ),
    "opengl": Language(
        {**C_TYPES, "uint": Type("uint32")}, SHADER, qualifier="PRECISE", casts=False, texels=True
    ),
    "glsl-vulkan": Language(
        {**C_TYPES, "uint": Type("uint32")}, SHADER, "barrier()", qualifier="PRECISE", casts=False
    ),
    "wgsl": Language(
        {"f32": FLOAT, "i32": INT, "u32": Type("uint32"), "bool": BOOL},
        SHADER,
        "workgroupBarrier()",
        casts=False,
        lets=True,
    ),
}
"""The languages by target."""

CONSTANT = re.compile(
    "WINDOW_(SIZE|CENTRE|ROWS|COLUMNS)|CENTRE_(ROW|COLUMN)|PIXELS|LANES|PATCH_WIDTH|GROUP_(WIDTH|HEIGHT)|"
    "TILE_(WIDTH|HEIGHT|NUMBERS)|PLANE"
)
"""The names of constants; no macro has another name, so that none changes what surrounds the statements."""
