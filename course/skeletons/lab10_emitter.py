"""Two emitters: from the programs of lab 9 to a kernel in OpenCL C and to a function in GLSL.

A program has `nodes` (each with op, args, value) and `output`, as in lab 9; its operations are here add,
subtract, multiply, divide, negative, absolute, sqrt, floor, sin, cos, minimum, maximum, less, greater,
select, input and const. All numbers are float; less and greater give booleans, which only select takes.

Write one statement a node: `float v3 = v1 * v2;`. Both languages are like C, and differ in small things:

* OpenCL: 2.0 is a double, 2.0f a float. fabs, fmin, fmax are those of floats; abs is of integers.
* GLSL: abs, min, max; there is no fabs. 2 is an integer, 2.0 a float.
* Nine digits bring every float32 back; %f has six places, and 1e-7 becomes 0.
* More work items run than there are numbers: those beyond the end must not read or write.

A constant may be any finite float32. The text may use float, int, uint, size_t and bool, `if`, `return`, and
`?:`. Tutorial: page 7. Clauses: IR-3, IR-6, KER-1; what a kernel and a function take is said below.
"""

from __future__ import annotations

from typing import Any


def literal(value: float, language: str) -> str:
    """Return a constant as a float of a language, `opencl` or `glsl`; it reads back as the same float32."""
    raise NotImplementedError("literal")


def emit_opencl(program: Any, name: str) -> str:
    """Return a kernel that computes the program for number i of each input, i = get_global_id(0) < count:

    __kernel void NAME(__global const float *in_a, __global float *result, int count)

    The inputs come first, in the program's order, `in_` and their name each.
    """
    raise NotImplementedError("emit_opencl")


def emit_glsl(program: Any, name: str) -> str:
    """Return a function: float NAME(float in_a, float in_b), with the inputs in the program's order."""
    raise NotImplementedError("emit_glsl")
