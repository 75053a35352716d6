"""A schedule and a language: from the programs of lab 9 to a kernel, and from a kernel to its source.

A program has `nodes` (each with op, args, value) and `output`, as in lab 9; its operations are here add,
subtract, multiply, divide, negative, absolute, sqrt, floor, sin, cos, minimum, maximum, less, greater,
select, input and const. less and greater give booleans, which only select takes.

A kernel is data: a tuple of statements, which wamnet.compiler.kernel.kernel has. You need these:

* Let(name, value): a value that never changes. Names: v0, v1, ..., one for each node.
* Store(array, index, value): an element of an array. The result is "result", index (row, column, channel).
* For(name, count, body, until=condition): counts from 0, and ends before the condition is false.
* Expressions: const(2.0), name("y"), name("v3", FLOAT), name("v4", BOOL), load("image_a", y, x, 0) and
  apply("add", a, b), with the operations' names of a program. An Expr has op, args, type and value: its
  number (const), its text (name), its array (load). a + b and a < b of integer expressions are expressions.

Each input is an image of one channel, `image_` and its name. A work item computes the pixel at row y, column
x of images of `height` rows and `width` columns.

A language is a row of words; C, OpenCL C, CUDA C and WGSL differ in few. An element of an image, or of the
result, is image_a[(y * width + x) * 1 + 0] in all of them: row, column, 1 channel, channel 0.

Tutorial: page 7. Clauses: IR-3, KER-24, KER-25, KER-26.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wamnet.compiler.kernel.kernel import BOOL, FLOAT, For, Let, Store, apply, const, load, name  # noqa: F401

LANGUAGES: Mapping[str, Mapping[str, str]] = {
    "c": {"let": "{type} {name} = {value};", "maximum": "{1} > {0} ? {1} : {0}", "absolute": "fabsf({0})"},
    "opencl": {},
    "cuda": {},
    "wgsl": {"let": "let {name}: {type} = {value};", "float": "f32"},
}
"""The words of each language: to be filled in."""


def schedule(program: Any) -> tuple[Any, ...]:
    """Return the statements that compute the program at the pixel (y, x)."""
    raise NotImplementedError("schedule")


def schedule_rows(program: Any) -> tuple[Any, ...]:
    """Return the same for an item that computes PIXELS pixels of a row: columns x, x + 1, ... of the image.

    The kernel has the integer `name("PIXELS")`; the loop counts with `p`, and ends where the row ends.
    """
    raise NotImplementedError("schedule_rows")


def literal(value: float) -> str:
    """Return a float of these languages; it reads back as the same float32."""
    raise NotImplementedError("literal")


def render(body: Any, language: str) -> str:
    """Return statements as source, a line each: Let, Store and For, in one of LANGUAGES.

    A loop: for (int p = 0; p < PIXELS && x + p < width; ++p) { ... }; WGSL: for (var p: i32 = 0; ...; p++).
    """
    raise NotImplementedError("render")
