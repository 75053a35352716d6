"""The one form of kernels that differ only in what their sources do not show [parse.py].

Comments, order of operations that is kept, loops that compilers must unroll; the interface's integers and the
place of the weights; sums of indices, which are written from the left; a value that a variable has for good;
operations that languages write with others.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from ..kernel.interface import DENOISE, IMAGE, RESULT, Interface
from ..kernel.kernel import (
    FLOAT,
    INT,
    Array,
    Block,
    Body,
    Call,
    Comment,
    Constant,
    Expr,
    For,
    Function,
    If,
    Kernel,
    Launch,
    Let,
    Statement,
    Store,
    Write,
    const,
    expr,
    rewritten,
    substituted,
    walk,
)
from ..kernel.sizes import integer

Terms = list[tuple[Expr, int]]
"""Terms of a sum of integers, each with 1 or -1."""


def canonical(kernel: Kernel) -> Kernel:
    """Return the canonical form of a kernel of a denoiser."""
    arrays = [array for array in kernel.interface.arrays if array.is_image or array.name == RESULT]
    functions = (
        Function(each.name, each.takes, _body(each.body, ()), each.result and _value(each.result, ()))
        for each in kernel.functions
    )
    known = {each.name: const(integer(kernel, each.value)) for each in kernel.constants}
    body = tuple(_counted(each, known) for each in kernel.body)
    return replace(
        kernel,
        interface=Interface(DENOISE, tuple(arrays), ()),
        body=_body(body, ()),
        constants=tuple(Constant(each.name, _value(each.value, ())) for each in kernel.constants),
        functions=tuple(functions),
        step=(_value(kernel.step[0], ()), _value(kernel.step[1], ())),
    )


def _counted(statement: Statement, known: Mapping[str, Expr]) -> Statement:
    """Return an array of the device, or a launch, with integers for constants: no source states them."""
    if isinstance(statement, Launch):
        across, down = (substituted(each, known) for each in statement.counts)
        return replace(statement, counts=(across, down))
    if isinstance(statement, Array) and statement.space == "device":
        return replace(statement, sizes=tuple(substituted(expr(each), known) for each in statement.sizes))
    return statement


def _body(body: Body, variables: Collection[str]) -> Body:
    """Return statements in canonical form; `variables`: names around them that are read as memory."""
    statements: list[Statement] = []
    names = set(variables)
    for number, statement in enumerate(body):
        if isinstance(statement, Comment):
            continue
        if isinstance(statement, Write):
            place = (statement.row, statement.column)
            stores = (Store(RESULT, (*place, const(c)), value) for c, value in enumerate(statement.values))
            statements += [_statement(store, names) for store in stores]
            continue
        if isinstance(statement, For) and _writes(statement):
            for turn in range(int(statement.count.value)):
                known = {statement.name: const(turn)}
                statements += _body(rewritten(statement.body, partial(substituted, known=known)), names)
            continue
        rest = walk(body[number + 1 :])
        stored = any(
            isinstance(each, Store) and each.array == getattr(statement, "name", "") for each in rest
        )
        if isinstance(statement, Array) and statement.value is not None and not stored:
            statement = Let(statement.name, statement.value)
        elif isinstance(statement, Let) and stored:
            statement = Array(statement.name, statement.value.type, value=statement.value)
        statements.append(_statement(statement, names))
        if isinstance(statement, Array) and not statement.sizes:
            names.add(statement.name)
        elif isinstance(statement, Let | Array):
            names.discard(statement.name)
    return tuple(statements)


def _writes(loop: For) -> bool:
    """Return whether a loop does nothing but write channels of the result, which some languages write out."""
    stores = all(isinstance(each, Store) and each.array == RESULT for each in loop.body)
    whole = (loop.start, loop.step, loop.until) == (const(0), const(1), None)
    return stores and whole and loop.count.op == "const"


def _statement(statement: Statement, names: Collection[str]) -> Statement:
    """Return one statement in canonical form."""
    if isinstance(statement, Let):
        return Let(statement.name, _value(statement.value, names))
    if isinstance(statement, Array):
        sizes = tuple(_value(const(s) if isinstance(s, int) else s, names) for s in statement.sizes)
        value = statement.value and _value(statement.value, names)
        return replace(statement, sizes=sizes, value=value, kept=False, register=False)
    if isinstance(statement, Store):
        index = tuple(_value(each, names) for each in statement.index)
        return replace(statement, index=index, value=_value(statement.value, names))
    if isinstance(statement, For):
        inner = set(names) - {statement.name}
        start, count, step = (_value(e, names) for e in (statement.start, statement.count, statement.step))
        until = statement.until and _value(statement.until, inner)
        return For(statement.name, count, _body(statement.body, inner), "loop", start, step, until)
    if isinstance(statement, If):
        condition = _value(statement.condition, names)
        return If(condition, _body(statement.body, names), _body(statement.otherwise, names))
    if isinstance(statement, Block | Launch):
        return replace(statement, body=_body(statement.body, names))
    if isinstance(statement, Call):
        views = (
            replace(v, index=tuple(_value(each, names) for each in v.index), step=_value(v.step, names))
            for v in statement.views
        )
        return replace(statement, views=tuple(views))
    return statement


def _value(value: Expr, names: Collection[str]) -> Expr:
    """Return an expression in canonical form."""
    if value.op == "const":
        number = float(np.float32(value.value)) if value.type.dtype == "float32" else value.value
        return replace(value, value=number)
    if value.op == "name" and value.value in names:
        return Expr("load", (), value.type, value.value)
    value = replace(value, args=tuple(_value(each, names) for each in value.args))
    if value.op in ("add", "subtract") and value.type == INT:
        return total(terms(value))
    if value.op == "load" and value.value.startswith(IMAGE) and len(value.args) == 2 and value.type == FLOAT:
        first, *beyond = terms(
            value.args[1]
        )  # a row's position, as the pixel's column and a distance from it
        scaled = first[0].op == "multiply" and first[0].args[1].op == "const"
        column = first[0].args[0] if scaled else first[0]
        return replace(value, args=(value.args[0], column, total(beyond)))
    return _shortened(value)


def _shortened(value: Expr) -> Expr:
    """Return the operation that others stand for."""
    op, args = value.op, value.args
    if op == "negative" and args[0].op == "const":
        return replace(args[0], value=-args[0].value)
    if op == "stack" and all(each == args[0] for each in args[1:]):
        return Expr("splat", args[:1], value.type)
    if op == "add" and args[0].op == args[1].op == "splat" and args[0].args[0] == const(0.0):
        return args[1]
    if op == "divide" and args[0] == const(1.0):
        return Expr("reciprocal", args[1:], value.type)
    if op == "select" and args[0].op in ("less", "greater") and args[0].args == args[1:]:
        return Expr("minimum" if args[0].op == "less" else "maximum", (args[2], args[1]), value.type)
    if op == "exp2" and args[0].op == "multiply" and args[0].args[1].op == "log2":
        return Expr("power", (args[0].args[1].args[0], args[0].args[0]), value.type)
    return value


def terms(value: Expr) -> Terms:
    """Return the terms of a sum of integers; a difference that a term has to subtract stays one."""
    if value.op == "add" and value.type == INT:
        return [*terms(value.args[0]), *terms(value.args[1])]
    if value.op == "subtract" and value.type == INT:
        return [*terms(value.args[0]), (value.args[1], -1)]
    return [(value, 1)]


def total(values: Terms) -> Expr:
    """Return the sum of terms, from the left."""
    (result, _), *rest = values
    for value, sign in rest:
        result = Expr("add" if sign > 0 else "subtract", (result, value), INT)
    return result
