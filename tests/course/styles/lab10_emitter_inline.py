"""Lab 10 in another style: one expression in brackets, a guard around the work, repr for literals."""

from __future__ import annotations

import numpy as np

BINARY = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/", "less": "<", "greater": ">"}
CALLS = {"opencl": {"absolute": "fabs", "minimum": "min", "maximum": "max"}, "glsl": {"absolute": "abs"}}
SHORT = {"minimum": "min", "maximum": "max"}


def literal(value, language):
    digits = repr(float(np.float32(value)))
    return digits + "f" if language == "opencl" else digits


def build(program, index, language, suffix):
    node = program.nodes[index]
    parts = [build(program, arg, language, suffix) for arg in node.args]
    if node.op == "input":
        return f"in_{node.value}{suffix}"
    if node.op == "const":
        return f"({literal(node.value, language)})"
    if node.op in BINARY:
        return f"({parts[0]} {BINARY[node.op]} {parts[1]})"
    if node.op == "negative":
        return f"(-({parts[0]}))"
    if node.op == "select":
        return f"({parts[0]} ? {parts[1]} : {parts[2]})"
    name = CALLS[language].get(node.op, SHORT.get(node.op, node.op))
    return f"{name}({', '.join(parts)})"


def emit_opencl(program, name):
    names = [node.value for node in program.nodes if node.op == "input"]
    takes = "".join(f"__global const float *in_{one}, " for one in names)
    value = build(program, program.output, "opencl", "[i]")
    return (
        f"__kernel void {name}({takes}__global float *result, int count) {{\n"
        f"  const int i = (int)get_global_id(0);\n  if (i < count) {{ result[i] = {value}; }}\n}}\n"
    )


def emit_glsl(program, name):
    names = [node.value for node in program.nodes if node.op == "input"]
    takes = ", ".join(f"in float in_{one}" for one in names)
    return f"float {name}({takes}) {{ return {build(program, program.output, 'glsl', '')}; }}\n"
