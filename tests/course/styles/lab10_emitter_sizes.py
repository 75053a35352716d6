"""Lab 10 in another style: size_t, and a negative literal without brackets."""

from __future__ import annotations

SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/", "less": "<", "greater": ">"}
NAMES = {
    "opencl": {"absolute": "fabs", "minimum": "fmin", "maximum": "fmax"},
    "glsl": {"absolute": "abs", "minimum": "min", "maximum": "max"},
}


def literal(value, language):
    digits = f"{float(value):.9g}"
    if not any(sign in digits for sign in ".e"):
        digits += ".0"
    digits += "f" if language == "opencl" else ""
    return digits


def expression(node, language):
    args = [f"v{arg}" for arg in node.args]
    if node.op == "const":
        return literal(node.value, language)
    if node.op in SIGNS:
        return f"{args[0]} {SIGNS[node.op]} {args[1]}"
    if node.op == "negative":
        return f"-{args[0]}"
    if node.op == "select":
        return f"{args[0]} ? {args[1]} : {args[2]}"
    return f"{NAMES[language].get(node.op, node.op)}({', '.join(args)})"


def statements(program, language, read):
    for index, node in enumerate(program.nodes):
        kind = "bool" if node.op in ("less", "greater") else "float"
        value = read(node.value) if node.op == "input" else expression(node, language)
        yield f"    {kind} v{index} = {value};\n"


def inputs(program):
    return [node.value for node in program.nodes if node.op == "input"]


def emit_opencl(program, name):
    takes = [f"__global const float *in_{given}" for given in inputs(program)]
    head = f"__kernel void {name}({', '.join([*takes, '__global float *result', 'int count'])})\n{{\n"
    guard = "    size_t i = get_global_id(0);\n    if (i >= (size_t)count) { return; }\n"
    body = "".join(statements(program, "opencl", lambda given: f"in_{given}[i]"))
    return f"{head}{guard}{body}    result[i] = v{program.output};\n}}\n"


def emit_glsl(program, name):
    takes = ", ".join(f"float in_{given}" for given in inputs(program))
    body = "".join(statements(program, "glsl", lambda given: f"in_{given}"))
    return f"float {name}({takes})\n{{\n{body}    return v{program.output};\n}}\n"
