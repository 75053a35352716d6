"""The grammar of kernels' sources as tables: tokens, operators, and the words of each language [parse.py]."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..kernel.kernel import BOOL, BYTE, FLOAT, INT, Type

TOKEN = re.compile(
    r"(?P<pixel>vec4 color = vec4\(0\.0, 0\.0, 0\.0, 1\.0\);)"
    r"|(?P<unroll>#pragma unroll\n|WAMNET_UNROLL\n)|\s+"
    r"|(?P<float>\d+(?:\.\d+(?:e[+-]\d+)?|e[+-]\d+)f(?!\w))|(?P<mask>0x7fffffff)(?!\w)"
    r"|(?P<integer>(?:0|[1-9]\d*)u?(?![\w.]))|(?P<word>vec[24]<[fi]32>|unsigned int|[A-Za-z_]\w*(?:::\w+)?)"
    r"|(?P<sign>\+\+|--|->|[-+]=|<=|>=|==|!=|&&|>>|[-+*/%<>=?:;,.(){}\[\]&^])"
)
"""The tokens of all languages; a kernel has no others."""

BINARY: tuple[Mapping[str, str], ...] = (
    {"&&": "logical_and"}, {"^": "bitwise_xor"}, {"&": "bitwise_and"},
    {"==": "equal", "!=": "not_equal"},
    {"<": "less", "<=": "less_equal", ">": "greater", ">=": "greater_equal"}, {">>": "right_shift"},
    {"+": "add", "-": "subtract"}, {"*": "multiply", "/": "divide", "%": "remainder"},
)  # fmt: skip
"""Operators of two operands, from those that bind least."""

PRODUCTS = len(BINARY) - 1
"""The level of products."""

SHIFTS = PRODUCTS - 2
"""The level of shifts: only operators from here on are of vectors in every language that has any."""

COMMON = {"floor": "floor", "sqrt": "sqrt", "exp": "exp", "sin": "sin", "cos": "cos"}
"""Functions that most languages name as the operations."""

SHADER = {**COMMON, "pow": "power", "min": "minimum", "max": "maximum", "abs": "absolute", "clamp": "clamp"}
"""Functions of shading languages."""

C_CALLS = {f"{word}f": op for word, op in COMMON.items()} | {
    "powf": "power", "fabsf": "absolute", "wamnet_clamp": "clamp",
}  # fmt: skip
"""Functions of C and CUDA."""

OPENCL_CALLS = {
    "fabs": "absolute", "fmin": "minimum", "fmax": "maximum", "clamp": "clamp", "FLOOR": "floor",
    "exp2": "exp2", "log2": "log2",
}  # fmt: skip
"""Further functions of OpenCL C."""

LANEWISE = {
    "wamnet_zero": "splat", "wamnet_sum": "add", "wamnet_difference": "subtract", "wamnet_scaled": "multiply",
}  # fmt: skip
"""Functions of C on vectors in expressions."""

LEAST_MOST = {"min": "minimum", "max": "maximum"}
"""Functions of integers."""

C_TYPES = {"float": FLOAT, "int": INT, "bool": BOOL}
"""Types of C and its children."""

VECTORS = {
    f"{word}{n}": kind.of(n)
    for word, kind in (("float", FLOAT), ("int", INT), ("uint", Type("uint32")))
    for n in (2, 4, 8, 16)
}
"""Vectors of OpenCL; those of integers hold booleans too, with all bits set."""


DOTS = {"wamnet_packed": "pack4", "wamnet_numbers": "bits", "wamnet_floats": "convert"}
"""Functions of work groups on words of bytes."""


@dataclass(frozen=True)
class Language:
    """The words of a language: types, functions, a barrier; `qualifier`: one that changes no value.

    `makers`: what makes a vector of values; `function`: the words before a function's type; `number`: those
    before a vector's address as that of its components; `operators`: vectors have those of numbers;
    `launch`: the words before a launch's number; `memory`: the line of an array that launches hand on.
    """

    types: Mapping[str, Type]
    calls: Mapping[str, str]
    barrier: str = ""
    qualifier: str = ""
    casts: bool = True
    texels: bool = False
    lets: bool = False
    makers: Mapping[str, Type] = field(default_factory=dict)
    function: tuple[str, ...] = ()
    number: tuple[str, ...] = ()
    operators: bool = True
    launch: str = ""
    memory: str = ""


COMPARED = {
    "lessThan": "less", "lessThanEqual": "less_equal", "greaterThan": "greater",
    "greaterThanEqual": "greater_equal",
}  # fmt: skip
"""Comparisons of vectors in GLSL."""

SHADING = {**C_TYPES, "uint": Type("uint32"), "ivec4": INT.of(4), "bvec4": BOOL.of(4)} | {
    f"vec{n}": FLOAT.of(n) for n in (2, 3, 4)
}
"""Types of GLSL."""

BUFFERS = Language(
    SHADING,
    {**SHADER, **DOTS, **COMPARED},
    "barrier()",
    qualifier="PRECISE",
    casts=False,
    makers={"ivec4": INT.of(4), **{f"vec{n}": FLOAT.of(n) for n in (2, 3, 4)}},
    launch="STAGE == ",
    memory="layout(std430, binding = {0}) restrict buffer {2} {{ vec2 {1}[]; }};",
)
"""GLSL of compute shaders."""

LANGUAGES: Mapping[str, Language] = {
    "c": Language(
        {**C_TYPES, "int32_t": INT, "uint32_t": Type("uint32"), "uint8_t": BYTE},
        C_CALLS,
        function=("static",),
    ),
    "opencl": Language(
        {**C_TYPES, **VECTORS, "uint": Type("uint32"), "uchar": BYTE},
        {**COMMON, **LEAST_MOST, **DOTS, **OPENCL_CALLS},
        "barrier(CLK_LOCAL_MEM_FENCE)",
    ),
    "cuda": Language(
        {**C_TYPES, "unsigned int": Type("uint32"), "int4": INT.of(4)}
        | {"wamnet_vector": FLOAT.of(4), "float2": FLOAT.of(2)},
        {**C_CALLS, **LEAST_MOST, "fminf": "minimum", "fmaxf": "maximum", **DOTS},
        "__syncthreads()",
        makers={"wamnet_made": FLOAT.of(4), "make_int4": INT.of(4), "make_float2": FLOAT.of(2)},
        function=("static", "__device__", "inline"),
        number=("float", "*"),
        operators=False,
        launch="wamnet_denoise_",
        memory="float2 *__restrict__ {1},",
    ),
    "metal": Language(
        {**C_TYPES, "uint": Type("uint32"), "float2": FLOAT.of(2), "float4": FLOAT.of(4)},
        {**COMMON, **LEAST_MOST, "fabs": "absolute", "pow": "power", "clamp": "clamp"},
        "threadgroup_barrier(mem_flags::mem_threadgroup)",
        makers={"float2": FLOAT.of(2), "float4": FLOAT.of(4)},
        function=("static", "inline"),
        number=("thread", "float", "*"),
        launch="wamnet_denoise_",
        memory="device float2 *{1} [[buffer({0})]],",
    ),
    "opengl": replace(BUFFERS, texels=True, memory=BUFFERS.memory.replace("{2}", "{1}_buffer")),
    "glsl-es": replace(BUFFERS, texels=True),
    "glsl-vulkan": BUFFERS,
    "glsl-compute": BUFFERS,
    "wgsl": Language(
        {"f32": FLOAT, "i32": INT, "u32": Type("uint32"), "bool": BOOL}
        | {"vec2<f32>": FLOAT.of(2), "vec4<f32>": FLOAT.of(4), "vec4<i32>": INT.of(4)},
        {**SHADER, **DOTS},
        "workgroupBarrier()",
        casts=False,
        lets=True,
        makers={"vec2<f32>": FLOAT.of(2), "vec4<f32>": FLOAT.of(4), "vec4<i32>": INT.of(4)},
        launch="main_",
        memory="@group(0) @binding({0}) var<storage, read_write> {1}: array<vec2<f32>>;",
    ),
}
"""The languages by target."""

CONSTANT = re.compile(
    "WINDOW_(SIZE|CENTRE|ROWS|COLUMNS)|CENTRE_(ROW|COLUMN)|PIXELS|LANES|PATCH_WIDTH|GROUP_(WIDTH|HEIGHT)|"
    "TILE_(WIDTH|HEIGHT|NUMBERS)|PLANE|POINTS|OUT|TILES|PAIRS|BLOCK|INPUTS|NEURONS|STRIDE|IMAGES|FREQUENCIES|"
    "MIRRORED"
)
"""The names of constants; no macro has another name, so that none changes what surrounds the statements."""

NAME = re.compile(
    r"[a-z]|dx|dy|(?:[bsvx]|part)_?\d+(?:_\d+)*|(?:bytes|[twz])\d+|(?:whole_)?(?:real|imaginary)(?:_\d+_\d+)?|"
    r"(?:here|there|[a-d])_\d+|tile_(?:row|column|x|y)|across|apart|at|back|block|columns?|first|gathered|group|"
    "here|inside|last|left|line|number|opposite|own|pair|part|products?|rest|rows?|spectra|sums?|tap|there|tile|"
    "to|top|value|within"
)
"""The names of values and arrays, but those of layers: no language has one of these for something else."""

FUNCTION = re.compile(r"elementwise_\d+(_of_one)?|forward|backward")
"""The names of functions."""

CALLS = {
    "start": "wamnet_sums float", "weights": "wamnet_bytes float", "floats": "float wamnet_sums",
    "dot": "wamnet_sums wamnet_bytes",
}  # fmt: skip
"""C's functions on vectors, and what they take the addresses of: first the vector that they set."""
