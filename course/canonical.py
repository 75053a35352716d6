"""The one form of kernels that differ only in what their sources do not show [compiler/parsing/parse.py].

Comments, order of operations that is kept, loops that compilers must unroll; the interface's integers and the
place of the weights; sums of indices, which are written from the left; a value that a variable has for good;
operations that languages write with others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from wamnet.compiler.kernel import kernel as tree
from wamnet.compiler.kernel.interface import DENOISE, IMAGE, RESULT, Interface
from wamnet.compiler.kernel.kernel import integer

BODIES = ("body", "otherwise")
"""Fields of statements that are statements."""


def canonical(kernel: tree.Kernel) -> tree.Kernel:
    """Return the canonical form of a kernel of a denoiser."""
    arrays = [array for array in kernel.interface.arrays if array.is_image or array.name == RESULT]
    functions = (
        tree.Function(each.name, each.takes, _body(each.body), each.result and _value(each.result))
        for each in kernel.functions
    )
    known = {each.name: tree.const(integer(kernel, each.value)) for each in kernel.constants}
    body = tuple(_counted(each, partial(tree.substituted, known=known)) for each in kernel.body)
    return replace(
        kernel,
        interface=Interface(DENOISE, tuple(arrays), ()),
        body=_body(body),
        constants=tuple(tree.Constant(each.name, _value(each.value)) for each in kernel.constants),
        functions=tuple(functions),
        step=(_value(kernel.step[0]), _value(kernel.step[1])),
    )


def _counted(statement: tree.Statement, counted: Callable[[tree.Expr], tree.Expr]) -> tree.Statement:
    """Return an array of the device, or a launch, with integers for constants: no source states them."""
    if isinstance(statement, tree.Launch):
        return replace(statement, counts=tuple(map(counted, statement.counts)))
    if isinstance(statement, tree.Array) and statement.space == "device":
        return replace(statement, sizes=tuple(counted(tree.expr(each)) for each in statement.sizes))
    return statement


def _body(body: tree.Body) -> tree.Body:
    """Return statements in canonical form."""
    return tree.rewritten(tuple(_statements(body)), _value)


def _statements(body: tree.Body) -> Iterator[tree.Statement]:
    """Yield statements in canonical form, but for their expressions."""
    for number, statement in enumerate(body):
        rest = (each.array for each in tree.walk(body[number + 1 :]) if isinstance(each, tree.Store))
        if isinstance(statement, tree.For) and _writes(statement):
            for turn in range(int(statement.count.value)):
                known = {statement.name: tree.const(turn)}
                yield from _statements(tree.rewritten(statement.body, partial(tree.substituted, known=known)))
        elif isinstance(statement, tree.Let | tree.Array) and statement.value is not None:
            name, value = statement.name, statement.value
            is_variable = name in rest
            yield tree.Array(name, value.type, value=value) if is_variable else tree.Let(name, value)
        elif isinstance(statement, tree.Array):
            sizes = tuple(map(tree.expr, statement.sizes))
            yield replace(statement, sizes=sizes, kept=False, register=False)
        elif not isinstance(statement, tree.Comment):
            own: dict[str, Any] = {"how": "loop"} if isinstance(statement, tree.For) else {}
            own |= {key: tuple(_statements(each)) for key, each in vars(statement).items() if key in BODIES}
            yield replace(statement, **own)


def _writes(loop: tree.For) -> bool:
    """Return whether a loop does nothing but write channels of the result, which some languages write out."""
    stores = all(isinstance(each, tree.Store) and each.array == RESULT for each in loop.body)
    whole = (loop.start, loop.step, loop.until) == (tree.const(0), tree.const(1), None)
    return stores and whole and loop.count.op == "const" and loop.count.type == tree.INT


def _value(value: tree.Expr) -> tree.Expr:
    """Return an expression in canonical form."""
    if value.op == "const":
        number = float(np.float32(value.value)) if value.type.dtype == "float32" else value.value
        return replace(value, value=number)
    if value.op == "load" and not value.args:
        return tree.name(value.value, value.type)
    value = replace(value, args=tuple(map(_value, value.args)))
    if value.op in ("add", "subtract") and value.type == tree.INT:
        return tree.total(tree.terms(value))
    if (
        value.op == "load"
        and value.value.startswith(IMAGE)
        and len(value.args) == 2
        and value.type == tree.FLOAT
    ):
        first, *beyond = tree.terms(
            value.args[1]
        )  # a row's position, as the pixel's column and a distance from it
        scaled = first[0].op == "multiply" and first[0].args[1].op == "const"
        column = first[0].args[0] if scaled else first[0]
        return replace(value, args=(value.args[0], column, tree.total(beyond)))
    return _shortened(value)


def _shortened(value: tree.Expr) -> tree.Expr:
    """Return the operation that others stand for."""
    op, args = value.op, value.args
    if op == "negative" and args[0].op == "const":
        return replace(args[0], value=-args[0].value)
    if op == "stack" and all(each == args[0] for each in args[1:]):
        return tree.Expr("splat", args[:1], value.type)
    if op == "add" and args[0].op == args[1].op == "splat" and args[0].args[0] == tree.const(0.0):
        return args[1]
    if op == "divide" and args[0] == tree.const(1.0):
        return tree.Expr("reciprocal", args[1:], value.type)
    if op == "select" and args[0].op in ("less", "greater") and args[0].args == args[1:]:
        return tree.Expr("minimum" if args[0].op == "less" else "maximum", (args[2], args[1]), value.type)
    if op == "exp2" and args[0].op == "multiply" and args[0].args[1].op == "log2":
        return tree.Expr("power", (args[0].args[1].args[0], args[0].args[0]), value.type)
    return value
