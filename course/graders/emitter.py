"""Grades lab 10: texts in both languages are parsed and run, lane by lane, beside the program itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..frame import Check, Wrong, hold, spread
from ..kernel_text import Lane, TextError, parsed
from ..wire import Node, Program

COUNT, MORE = 12, 4
"""Numbers of an input, and work items beyond them."""


MEANING: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "negative": np.negative,
    "absolute": np.absolute,
    "sqrt": np.sqrt,
    "floor": np.floor,
    "sin": np.sin,
    "cos": np.cos,
    "minimum": np.minimum,
    "maximum": np.maximum,
    "less": np.less,
    "greater": np.greater,
    "select": np.where,
}
"""The operations."""

A, B = Node("input", (), "a"), Node("input", (), "b")
"""The inputs of the programs."""


def evaluated(program: Program, given: dict[str, Any]) -> Any:
    """Return what a program computes (COUNT,)."""
    values: list[Any] = []
    for node in program.nodes:
        if node.op == "input":
            values.append(given[node.value])
        elif node.op == "const":
            values.append(np.float32(node.value))
        else:
            values.append(MEANING[node.op](*(values[arg] for arg in node.args)))
    return np.broadcast_to(values[program.output], (COUNT,))


def one(op: str, *args: int) -> Program:
    """Return the program of one operation on a and b."""
    return Program((A, B, Node(op, args)), 2)


SINGLE = {
    "add": (one("add", 0, 1), "v0 + v1"),
    "subtract": (one("subtract", 1, 0), "the order of the operands: node.args"),
    "multiply": (one("multiply", 0, 1), "v0 * v1"),
    "divide": (one("divide", 0, 1), "v0 / v1"),
    "negative": (one("negative", 0), "-v0"),
    "absolute": (one("absolute", 0), "fabs in OpenCL, abs in GLSL"),
    "sqrt": (Program((A, B, Node("absolute", (0,)), Node("sqrt", (2,))), 3), "sqrt"),
    "floor": (one("floor", 0), "floor"),
    "sin": (one("sin", 0), "sin"),
    "cos": (one("cos", 0), "cos"),
    "minimum": (one("minimum", 0, 1), "fmin in OpenCL, min in GLSL"),
    "maximum": (one("maximum", 0, 1), "fmax in OpenCL, max in GLSL"),
    "select": (
        Program((A, B, Node("less", (0, 1)), Node("select", (2, 0, 1))), 3),
        "condition ? where true : where false",
    ),
    "greater": (
        Program((A, B, Node("greater", (0, 1)), Node("select", (2, 0, 1))), 3),
        "less is <, greater is >",
    ),
    "an input": (Program((A, B), 1), "the output may be an input: it is program.output"),
    "inputs in their order": (
        Program((B, A, Node("subtract", (0, 1))), 2),
        "arguments have the order of the program's inputs",
    ),
    "a nested product": (
        Program((A, B, Node("subtract", (0, 1)), Node("subtract", (0, 2)), Node("multiply", (3, 2))), 4),
        "brackets, or a statement a node: a - (a - b) is not a - a - b",
    ),
    "a negative twice": (
        Program((A, B, Node("negative", (0,)), Node("negative", (2,)), Node("subtract", (1, 3))), 4),
        "two signs in a row are an operator of its own: --",
    ),
    "a node that is not last": (
        Program((A, B, Node("add", (0, 1)), Node("multiply", (0, 1))), 2),
        "the result is node program.output, not the last one",
    ),
}
"""Programs, and the likeliest mistake of each."""

CONSTANTS = (2.0, -2.0, 0.1, 1.0 / 3.0, 1e-7, 1e30, -1.5e-20, 16777216.0, 0.0, 123456.789, 3, 120408.766)
"""Constants that literals have to bring back; the last one needs nine digits."""


def inputs() -> dict[str, Any]:
    """Return float32 inputs (COUNT,)."""
    return {name: spread(131 + i, (COUNT,), -3.0, 3.0).astype(np.float32) for i, name in enumerate("ab")}


def run_opencl(student: Any, program: Program, given: dict[str, Any]) -> Any:
    """Return what the student's kernel writes (COUNT,)."""
    text = parsed(student.emit_opencl(program, "compute"))
    function = text.functions.get("compute")
    if function is None:
        raise TextError("there is no function `compute`", "the kernel has the name that is given")
    names = [f"in_{node.value}" for node in program.nodes if node.op == "input"]
    takes = [variable.name for variable in function.takes]
    if takes != [*names, "result", "count"]:
        raise TextError(f"arguments {', '.join(takes)}", f"in their order: {', '.join(names)}, result, count")
    if not all(v.type.pointer for v in function.takes[:-1]) or function.takes[-1].type.pointer:
        raise TextError("arguments of other types", "arrays are __global const float *, count is int")
    result = np.full(COUNT, np.float32(np.nan))
    arrays = {f"in_{name}": values.copy() for name, values in given.items() if f"in_{name}" in names}
    for item in range(COUNT + MORE):
        Lane("opencl", {**arrays, "result": result, "count": np.int32(COUNT)}, item).call(function)
    return result


def run_glsl(student: Any, program: Program, given: dict[str, Any]) -> Any:
    """Return what the student's function returns (COUNT,)."""
    text = parsed(student.emit_glsl(program, "compute"))
    function = text.functions.get("compute")
    if function is None:
        raise TextError("there is no function `compute`", "the function has the name that is given")
    names = [node.value for node in program.nodes if node.op == "input"]
    takes = [variable.name for variable in function.takes]
    if takes != [f"in_{name}" for name in names]:
        raise TextError(
            f"arguments {', '.join(takes)}", f"in their order: {', '.join(names)}, each after in_"
        )
    found = []
    for item in range(COUNT):
        known = {f"in_{name}": values[item] for name, values in given.items()}
        found.append(Lane("glsl", {name: known[name] for name in takes}, item).call(function))
    if any(value is None for value in found):
        raise TextError("it returns nothing", "return v<output>;")
    return np.array(found, np.float64)


RUNS = {"opencl": run_opencl, "glsl": run_glsl}
"""What runs a language's text."""


def compare(student: Any, language: str, name: str, program: Program, likely: str) -> None:
    """Compare a text with its program."""
    given = inputs()
    try:
        found = RUNS[language](student, program, given)
    except TextError as error:
        what = f"the {language} text of {name}"
        wanted = "a text that compiles and runs"
        raise Wrong("IR-3", what, wanted, str(error), error.likely or likely) from None
    wanted = evaluated(program, given).astype(np.float64)
    # The same operations in float32; one unit in the last place for those who write them otherwise.
    near = np.abs(found.astype(np.float64) - wanted) <= 2.0**-22 * np.abs(wanted)
    if not np.all(near | (found == wanted)):
        at = int(np.flatnonzero(~near)[0])
        what = f"{name} in {language} at a = {given['a'][at]:g}, b = {given['b'][at]:g}"
        missed = "not every number is written: the guard is i >= count" if np.isnan(found[at]) else likely
        if np.all(found == found[0]) and not np.all(wanted == wanted[0]):
            missed = "item i reads number i: in_a[i]"
        raise Wrong("IR-3", what, f"{wanted[at]:.9g}", f"{found[at]:.9g}", missed)


def _singles(language: str) -> Callable[[Any], None]:
    """Return the check of all operations in a language."""

    def run(student: Any) -> None:
        for name, (program, likely) in SINGLE.items():
            compare(student, language, name, program, likely)

    return run


def literals(student: Any) -> None:
    """Constants read back as the same float32, and are floats."""
    for language in RUNS:
        for value in CONSTANTS:
            found = student.literal(value, language)
            hold("IR-6", "the result of literal", isinstance(found, str), "a text", type(found).__name__)
            what = f"the {language} literal of {value!r}"
            try:
                body = parsed(f"float compute(float x) {{ return {found}; }}").functions["compute"]
                number = Lane(language, {}).call(body)
            except (TextError, KeyError) as error:
                likely = getattr(error, "likely", "")
                raise Wrong("IR-6", what, "a number", f"{found!r}: {error}", likely) from None
            text = "a literal needs a point: 2.0"
            text = "2.0 is a double in OpenCL, 2.0f is a float" if language == "opencl" else text
            right = isinstance(number, np.float32)
            hold("IR-6", f"the kind of {what}", right, "float", f"{found!r}, a {type(number).__name__}", text)
            text = "nine digits bring every float32 back: %.9g, or repr(float(np.float32(value)))"
            text = "the sign is lost" if number == -np.float32(value) else text
            hold(
                "IR-6",
                what,
                number == np.float32(value),
                f"{np.float32(value):.9g}",
                f"{number:.9g}, by {found!r}",
                text,
            )


def constants(student: Any) -> None:
    """Programs with constants."""
    for language in RUNS:
        for value in (2.0, -0.1):
            for op, args in (("subtract", (0, 2)), ("divide", (2, 1)), ("maximum", (0, 2))):
                program = Program((A, B, Node("const", (), value), Node(op, args)), 3)
                likely = "a constant is literal(node.value, language)"
                compare(student, language, f"{op} with the constant {value:g}", program, likely)


def stable(student: Any) -> None:
    """The same text again, and no change to the program."""
    program = SINGLE["a nested product"][0]
    for emit in (student.emit_opencl, student.emit_glsl):
        first, second = emit(program, "f"), emit(program, "f")
        hold(
            "KER-1",
            "the text of the same program again",
            first == second,
            "the same",
            "another",
            "something is kept between calls",
        )


CHECKS = (
    Check("literals", literals),
    Check("OpenCL, operation by operation", _singles("opencl")),
    Check("GLSL, operation by operation", _singles("glsl")),
    Check("constants", constants),
    Check("the same text again", stable),
)
"""In the order in which they explain a mistake best."""
