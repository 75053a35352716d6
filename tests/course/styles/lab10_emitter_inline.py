"""Lab 10 in another style: one expression, parentheses everywhere, repr for literals, functions for words."""

import numpy as np

from wamnet.compiler.kernel import kernel as ir

Y, X = ir.name("y"), ir.name("x")
SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/", "less": "<", "greater": ">"}
SUFFIX = {"c": "f", "cuda": "f", "opencl": "", "wgsl": ""}
LEAST = {"cuda": "f{}f", "opencl": "f{}", "wgsl": "{}"}
LANGUAGES = {name: {} for name in SUFFIX}


def expression(program, index, column):
    node = program.nodes[index]
    args = [expression(program, arg, column) for arg in node.args]
    if node.op == "input":
        return ir.load("image_" + node.value, Y, column, 0)
    return ir.const(float(np.float32(node.value))) if node.op == "const" else ir.apply(node.op, *args)


def schedule(program):
    return [ir.Store("result", (Y, X, ir.const(0)), expression(program, program.output, X))]


def schedule_rows(program):
    column = X + ir.name("p")
    store = ir.Store("result", (Y, column, ir.const(0)), expression(program, program.output, column))
    return [ir.For("p", ir.name("PIXELS"), (store,), until=column < ir.name("width"))]


def literal(value):
    return repr(float(np.float32(value))) + "f"


def text(value, language):
    parts = [text(arg, language) for arg in value.args]
    if value.op == "const":
        return str(value.value) if value.type.dtype == "int32" else f"({literal(value.value)})"
    if value.op == "name":
        return value.value
    if value.op == "load":
        return f"{value.value}[({parts[0]} * width + {parts[1]}) * 1 + {parts[2]}]"
    if value.op in SIGNS:
        return f"({parts[0]} {SIGNS[value.op]} {parts[1]})"
    if value.op == "negative":
        return f"(-({parts[0]}))"
    if value.op == "select" and language == "wgsl":
        return f"select({parts[2]}, {parts[1]}, {parts[0]})"
    if value.op == "select":
        return f"({parts[0]} ? {parts[1]} : {parts[2]})"
    if value.op in ("minimum", "maximum"):
        if language == "c":
            sign = "<" if value.op == "minimum" else ">"
            return f"({parts[1]} {sign} {parts[0]} ? {parts[1]} : {parts[0]})"
        return f"{LEAST[language].format(value.op[:3])}({', '.join(parts)})"
    if value.op == "absolute":
        return f"{'abs' if language == 'wgsl' else 'fabs'}{SUFFIX[language]}({parts[0]})"
    return f"{value.op}{SUFFIX[language]}({parts[0]})"


def render(body, language):
    return "".join(statement(each, language) for each in body)


def statement(each, language):
    if isinstance(each, ir.Let):
        kind = "bool" if each.value.type == ir.BOOL else "f32" if language == "wgsl" else "float"
        declared = f"let {each.name}: {kind}" if language == "wgsl" else f"{kind} {each.name}"
        return f"{declared} = {text(each.value, language)};\n"
    if isinstance(each, ir.Store):
        element = text(ir.load(each.array, *each.index), language)
        return f"{element} = {text(each.value, language)};\n"
    head = f"for (int {each.name} = 0; {{}}; ++{each.name})"
    if language == "wgsl":
        head = f"for (var {each.name}: i32 = 0; {{}}; {each.name}++)"
    ends = f"{each.name} < {text(each.count, language)} && {text(each.until, language)}"
    return f"{head.format(ends)} {{\n{render(each.body, language)}}}\n"
