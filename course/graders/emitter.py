"""Grades lab 10: kernels are verified and run in NumPy; sources are read back to their kernels.

1. A schedule's statements become a kernel [`kernel_of`], which runs on images of odd sizes.
2. A source is what the student renders in the place of the statements of the compiler's own; the compiler's
   parser, which knows nothing of a student, must read the same kernel back [`read_back`].
3. What a student sends is bounded before it runs: kinds of statements, loops, and characters [`LONGEST`].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wamnet.compiler.core.ir import Image
from wamnet.compiler.kernel.interface import denoiser
from wamnet.compiler.kernel.kernel import (
    BOOL,
    FLOAT,
    Constant,
    For,
    Kernel,
    Let,
    Store,
    apply,
    const,
    load,
    name,
    walk,
)
from wamnet.compiler.kernel.run import run
from wamnet.compiler.kernel.verify import KernelError, verify
from wamnet.compiler.languages.renderer import Renderer
from wamnet.compiler.parsing.parse import Unread, parse
from wamnet.compiler.targets import language_named

from ..canonical import canonical
from ..frame import Check, Wrong, hold, spread
from ..wire import Node, Program

SIZE = (5, 7)
"""Rows and columns of the images: no multiple of the pixels of a work item."""

PIXELS = 3
"""Pixels of a work item of the second schedule."""

LONGEST, MOST = 10_000, 100
"""Most characters of a student's source, and most statements of a kernel."""

TARGETS = ("c", "opencl", "cuda", "wgsl")
"""The languages."""

A, B = Node("input", (), "a"), Node("input", (), "b")
"""The inputs of the programs."""


def evaluated(program: Program, given: dict[str, Any]) -> Any:
    """Return what a program computes at each pixel (H, W, 1)."""
    values: list[Any] = []
    for node in program.nodes:
        if node.op == "input":
            values.append(given[node.value])
        elif node.op == "const":
            values.append(np.float32(node.value))
        else:
            operation = np.where if node.op == "select" else getattr(np, node.op)
            values.append(operation(*(values[arg] for arg in node.args)))
    return np.broadcast_to(values[program.output], (*SIZE, 1))


def of(*lines: str, output: int | None = None) -> Program:
    """Return the program of operations on nodes, 0 and 1 being a and b; the output is the last one."""
    rows = [line.split() for line in lines]
    nodes = (A, B, *(Node(op, tuple(map(int, args))) for op, *args in rows))
    return Program(nodes, len(nodes) - 1 if output is None else output)


SINGLE = {
    "add": (of("add 0 1"), "an input is a separate image, image_ and node.value; a sum is {0} + {1}"),
    "subtract": (of("subtract 1 0"), "the order of the operands: node.args"),
    "multiply": (of("multiply 0 1"), "{0} * {1}"),
    "divide": (of("divide 0 1"), "{0} / {1}"),
    "negative": (of("negative 0"), "-{0}"),
    "absolute": (of("absolute 0"), "fabsf in C and CUDA, fabs in OpenCL, abs in WGSL"),
    "sqrt": (of("absolute 0", "sqrt 2"), "sqrtf in C and CUDA, sqrt elsewhere"),
    "floor": (of("floor 0"), "floorf in C and CUDA, floor elsewhere"),
    "sin": (of("sin 0"), "sinf in C and CUDA, sin elsewhere"),
    "cos": (of("cos 0"), "cosf in C and CUDA, cos elsewhere"),
    "minimum": (
        of("minimum 0 1"),
        "{1} < {0} ? {1} : {0} in C, which has no fast fminf; fminf in CUDA, fmin in OpenCL, min in WGSL",
    ),
    "maximum": (
        of("maximum 0 1"),
        "{1} > {0} ? {1} : {0} in C, which has no fast fmaxf; fmaxf in CUDA, fmax in OpenCL, max in WGSL",
    ),
    "select": (
        of("less 0 1", "select 2 0 1"),
        "condition ? where true : where false; in WGSL select(where false, where true, condition)",
    ),
    "greater": (of("greater 0 1", "select 2 0 1"), "less is <, greater is >"),
    "an input": (of(), "the output may be an input: it is program.output"),
    "a nested product": (
        of("subtract 0 1", "subtract 0 2", "multiply 3 2"),
        "a statement a node, or parentheses: a - (a - b) is not a - a - b",
    ),
    "a negative twice": (
        of("negative 0", "negative 2", "subtract 1 3"),
        "two signs in a row are an operator of its own: --",
    ),
    "a node that is not last": (
        of("add 0 1", "multiply 0 1", output=2),
        "the result is node program.output, not the last one",
    ),
}
"""Programs, and the likeliest mistake of each."""

CONSTANTS = (2.0, -2.0, 0.1, 1.0 / 3.0, 1e-7, 1e30, -1.5e-20, 16777216.0, 0.0, 123456.789, 3.0, 120408.766)
"""Constants that literals have to bring back; the last one needs nine digits."""

Y, X, P, COLUMNS = (name(word) for word in ("y", "x", "p", "width"))
"""A work item's first pixel, the counter of a loop, and the columns of an image."""


def inputs() -> dict[str, Any]:
    """Return the images (H, W, 1) in float32."""
    return {name: spread(131 + i, (*SIZE, 1), -3.0, 3.0).astype(np.float32) for i, name in enumerate("ab")}


def kernel_of(body: Any, rows: bool = False) -> Kernel:
    """Return the kernel of a student's statements; Wrong for what is not a kernel of this lab."""
    told = "a tuple of Let, Store and For"
    good = isinstance(body, tuple | list)
    hold("KER-24", "what the schedule returns", good, told, type(body).__name__, "it returns the statements")
    try:
        found = walk(tuple(body))
        kinds = {type(each).__name__ for each in found if not isinstance(each, Let | Store | For)}
        loops = [each for each in found if isinstance(each, For)]
        few = not kinds and len(found) <= MOST
        hold("KER-24", "the statements", few, told, ", ".join(kinds) or f"{len(found)} of them")
        right = len(loops) == int(rows) and all(
            (each.start, each.step, each.count) == (const(0), const(1), name("PIXELS")) for each in loops
        )
        likely = "one For over p, of name('PIXELS') turns, around all statements"
        hold("KER-24", "the loops", right, f"{int(rows)} of PIXELS turns", f"{len(loops)}", likely)
        images = [Image(key, 1, -np.inf, np.inf) for key in "ab"]
        more: dict[str, Any] = {}
        if rows:
            more = {"constants": (Constant("PIXELS", const(PIXELS)),), "step": (name("PIXELS"), const(1))}
        kernel = Kernel(denoiser(images, 1), tuple(body), **more)
        verify(kernel)
    except KernelError as error:
        likely = _reason(str(error), rows)
        raise Wrong("KER-25", "the kernel", "one that is well formed", str(error), likely) from None
    except (TypeError, ValueError, AttributeError, LookupError) as error:
        raise Wrong("KER-24", "the kernel", told, f"{type(error).__name__}: {error}") from None
    return kernel


ROW_ENDS = "until=column < name('width'): the last work item of a row has fewer pixels"
"""The likeliest mistake of a loop that leaves the image."""

OF_KERNELS = {
    "declared twice": "each node has a name: v0, v1, ...",
    "is beyond": "an element has the index (row, column, channel): load('image_a', name('y'), name('x'), 0)",
    "never": "each pixel is stored once: a Store at the end, in the loop",
    "twice": "each pixel is stored once, at column x + p",
    "type": "less and greater give booleans: name('v2', BOOL)",
}
"""Words of what a kernel is rejected for, and the likeliest mistake."""

OF_SOURCES = {
    "no ';'": "a statement ends in a semicolon",
    "is not a type": "a word of the row: float and bool have other names in some languages",
    "is not declared": "a word of the row: float and bool have other names in some languages",
    "row": "an element is image_a[(y * width + x) * 1 + 0]: row, width, column, channels, channel",
    "channels": "an element is image_a[(y * width + x) * 1 + 0]: row, width, column, channels, channel",
}
"""Words of what a source is rejected for, and the likeliest mistake."""


def _reason(text: str, rows: bool) -> str:
    """Return the likeliest mistake of a kernel that is rejected."""
    known = {**OF_KERNELS, "is beyond": ROW_ENDS} if rows else OF_KERNELS
    return next(
        (told for word, told in known.items() if word in text), "a name is declared before it is read"
    )


def ran(kernel: Kernel, name: str, program: Program, likely: str) -> None:
    """Compare what a kernel writes with the program, at each pixel."""
    given = inputs()
    try:
        found = run(kernel, given, np.zeros(0, np.float32))
    except (KernelError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise Wrong(
            "KER-25",
            f"the kernel of {name}",
            "a run",
            str(error),
            _reason(str(error), kernel.step[0] != const(1)),
        ) from None
    wanted = evaluated(program, given)
    near = np.abs(found.astype(np.float64) - wanted) <= 2.0**-22 * np.abs(wanted)
    if not np.all(near | (found == wanted)):
        row, column, _ = (int(i) for i in np.argwhere(~near)[0])
        what = f"{name} at row {row}, column {column}"
        if program.nodes[program.output].op == "input" or np.array_equal(found[:, 1:], wanted[:, :-1]):
            likely = f"an input is load('image_a', y, x, 0), at its own row and column; {likely}"
        raise Wrong("IR-3", what, f"{wanted[row, column, 0]:.9g}", f"{found[row, column, 0]:.9g}", likely)


def schedules(student: Any) -> None:
    """The kernel of each program computes it."""
    for key, (program, likely) in SINGLE.items():
        ran(kernel_of(student.schedule(program)), key, program, likely)
    program = Program((A, Node("const", (), -0.1), B, Node("subtract", (1, 2)), Node("divide", (3, 1))), 4)
    ran(kernel_of(student.schedule(program)), "constants", program, "a constant is const(float(node.value))")


def schedules_of_rows(student: Any) -> None:
    """The same for several pixels of a row."""
    for key, (program, likely) in SINGLE.items():
        ran(kernel_of(student.schedule_rows(program), True), f"{key}, {PIXELS} pixels", program, likely)


def read_back(source: Any, kernel: Kernel, language: str, what: str, likely: str) -> None:
    """Refuse a source of statements that is not read back to the kernel."""
    good = isinstance(source, str) and len(source) <= LONGEST
    hold("KER-26", f"the result of render, {what}", good, "a string", type(source).__name__)
    dialect = language_named(language).dialect
    own = Renderer(dialect, kernel, False, np.zeros(0, np.float32))
    whole = own.source([])
    body = "\n".join(own.lines)
    whole = whole.replace(body, source, 1)
    told = f"the {language} source of {what}"
    channels = {array.name: 1 for array in kernel.interface.arrays}
    try:
        found = canonical(parse(whole, language, channels))
    except (Unread, RecursionError) as error:
        likely = next((why for word, why in OF_SOURCES.items() if word in str(error)), likely)
        raise Wrong("KER-26", told, body.strip(), f"{source.strip()[:200]}: {error}", likely) from None
    wanted = canonical(kernel)
    if found != wanted:
        raise Wrong("KER-26", told, body.strip(), f"{source.strip()[:200]}, which is another kernel", likely)


def single_kernel(program: Program) -> Kernel:
    """Return the grader's own kernel of a program."""
    kinds = [BOOL if node.op in ("less", "greater") else FLOAT for node in program.nodes]
    body: list[Any] = []
    for index, node in enumerate(program.nodes):
        args = (name(f"v{arg}", kinds[arg]) for arg in node.args)
        value = load(f"image_{node.value}", Y, X, 0) if node.op == "input" else None
        value = const(float(node.value)) if node.op == "const" else value
        body.append(Let(f"v{index}", apply(node.op, *args) if value is None else value))
    body.append(Store("result", (Y, X, const(0)), name(f"v{program.output}", FLOAT)))
    return kernel_of(tuple(body))


def _language(language: str) -> Callable[[Any], None]:
    """Return the check of all operations in a language."""

    def rendered(student: Any) -> None:
        for key, (program, likely) in SINGLE.items():
            kernel = single_kernel(program)
            read_back(student.render(kernel.body, language), kernel, language, key, likely)
        a, b, c = (load(f"image_{key}", Y, X, 0) for key in "aba")
        nested = {
            "a difference in a difference": apply("subtract", a, apply("subtract", b, c)),
            "a sum in a product": apply("multiply", apply("add", a, b), c),
            "a sum in a minimum": apply("divide", apply("minimum", apply("negative", a), b), c),
        }
        likely = "an operand that is an operation needs parentheses"
        for key, value in nested.items():
            kernel = kernel_of((Store("result", (Y, X, const(0)), value),))
            read_back(student.render(kernel.body, language), kernel, language, key, likely)

    return rendered


def literals(student: Any) -> None:
    """Constants are read back as the same float32, and are floats."""
    for value in np.array(CONSTANTS, np.float32).tolist():
        found = student.literal(value)
        hold("KER-26", "the result of literal", isinstance(found, str), "a string", type(found).__name__)
        kernel = kernel_of((Store("result", (Y, X, const(0)), const(value)),))
        likely = "nine digits bring every float32 back: %.9g, or repr(float(np.float32(value)))"
        bare = found.strip("()").lstrip("-")
        if value < 0 and "-" not in found[:2]:
            likely = "the sign is lost"
        elif not bare.endswith("f"):
            likely = "2.0 is a double in C and OpenCL: 2.0f is a float"
        elif "." not in bare and "e" not in bare:
            likely = "a float needs a point or an exponent: 2.0f"
        source = f"result[(y * width + x) * 1 + 0] = {found};"
        read_back(source, kernel, "opencl", f"the constant {value!r}", likely)


def loops(student: Any) -> None:
    """A loop that ends at the image's border."""
    likely = "p < PIXELS && x + p < width: count and until, in this order; WGSL: var p: i32 = 0, and p++"
    column = X + P
    body = (
        Let("v0", load("image_a", Y, column, 0)),
        Store("result", (Y, column, const(0)), name("v0", FLOAT)),
    )
    kernel = kernel_of((For("p", name("PIXELS"), body, until=column < COLUMNS),), True)
    for language in TARGETS:
        read_back(student.render(kernel.body, language), kernel, language, "a loop", likely)


def together(student: Any) -> None:
    """Each of the student's schedules in each of the student's languages."""
    for key in ("a nested product", "select"):
        program, likely = SINGLE[key]
        for rows, build in enumerate((student.schedule, student.schedule_rows)):
            kernel = kernel_of(build(program), bool(rows))
            for language in TARGETS:
                source = student.render(kernel.body, language)
                read_back(source, kernel, language, f"your kernel of {key}", likely)
                again = student.render(kernel.body, language)
                hold("KER-24", "the source of the same kernel again", source == again, "the same", "another",
                     "something is kept between calls")  # fmt: skip


CHECKS = (
    Check("a schedule", schedules),
    Check("a schedule of several pixels", schedules_of_rows),
    Check("literals", literals),
    *(Check(f"{language}, operation by operation", _language(language)) for language in TARGETS),
    Check("a loop", loops),
    Check("your schedules in your languages", together),
)
"""In the order in which they explain a mistake best."""
