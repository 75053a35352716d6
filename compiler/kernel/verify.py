"""Checks a kernel before it is printed or run: names, types and lanes, constant indices, loops, barriers.

A name is declared before it is used and once in its scope, and no inner scope hides one; functions see
constants and what they take. Everything that depends on values is checked while a kernel runs [run.py].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import kernel as tree
from .interface import BOTH, DENOISE, IMAGE, READ, RESULT, UNSIGNED, WEIGHTS, WRITE

LIMITS = {
    dtype: (int(np.iinfo(dtype).min), int(np.iinfo(dtype).max))
    for dtype in ("int32", "uint32", "uint8", "int8")
}
"""The least and the largest integer of each kind."""


SIGNATURES: Mapping[str, Callable[[tree.Expr], tuple[Sequence[tree.Type], tree.Type]]] = {
    "splat": lambda value: ([value.type.of(1)], value.type),
    "stack": lambda value: ([value.type.of(1)] * len(value.args), value.type.of(len(value.args))),
    "clamp": lambda value: ([tree.INT] * 3, tree.INT.of(value.type.lanes)),
    "bits": lambda value: ([tree.INT.of(value.type.lanes)], tree.FLOAT.of(value.type.lanes)),
    "any": lambda value: ([tree.BOOL.of(each.type.lanes) for each in value.args[:1]], tree.BOOL),
    "lanes": lambda value: ([], tree.WORD.of(value.type.lanes)),
    "pack4": lambda value: ([tree.FLOAT] * 4, tree.INT),
}
"""Operations of the kernel IR alone: the types of their operands, and of their result."""


FLOATS, NUMBERS, TRUTHS = ("float32",), ("float32", "int32", "uint32"), ("bool",)
"""Kinds of operands: floats, any numbers, and booleans."""

OPERATIONS: Mapping[str, tuple[int, Sequence[str]]] = {
    **dict.fromkeys(("add", "subtract", "multiply", "minimum", "maximum", *tree.COMPARISONS), (2, NUMBERS)),
    **dict.fromkeys(("divide", "power"), (2, FLOATS)),
    **dict.fromkeys(
        ("reciprocal", "negative", "absolute", "floor", "sqrt", "exp", "sin", "cos"), (1, FLOATS)
    ),
    **dict.fromkeys(("logical_and", "logical_or"), (2, TRUTHS)),
    "logical_not": (1, TRUTHS),
    **dict.fromkeys(("bitwise_and", "bitwise_xor", "right_shift"), (2, ("uint32",))),
    "select": (3, (*NUMBERS, *TRUTHS)),
}
"""Operations of core/ops.py on the components of values: how many operands, all of one of these kinds.

The check of sources rests on this table, and on none of the compiler's own."""


class KernelError(Exception):
    """A kernel that no device runs as it is meant."""


@dataclass(frozen=True)
class Declared:
    """A name: a value without `sizes`, or an array; `limits` are None where only a run has them."""

    type: tree.Type
    sizes: tuple[int | None, ...] | None = None
    written: bool = True


def verify(kernel: tree.Kernel) -> None:
    """Raise a KernelError unless the kernel is well formed."""
    Verifier(kernel).all()


STEPS = ("step", "leap")
"""What a function on views calls the steps of its first and its second view."""


class Verifier:
    """Checks one kernel."""

    def __init__(self, kernel: tree.Kernel) -> None:
        self.kernel = kernel
        self.scopes: list[dict[str, Declared]] = [{}]
        self.constants: dict[str, int] = {}
        self.functions: dict[str, tree.Function] = {}
        self.tables = {key: np.asarray(table) for key, table in kernel.tables}
        self.branches = 0
        self.loops: list[int] = []
        self.rules: dict[str, Callable[[tree.Expr], tree.Type]] = {
            key.removeprefix("_type_"): getattr(self, key) for key in dir(self) if key.startswith("_type_")
        }

    def all(self) -> None:
        """Check constants, functions and the body."""
        kernel = self.kernel
        for constant in kernel.constants:
            self.declare(constant.name, Declared(tree.INT))
            self.check(constant.value, tree.INT, f"constant {constant.name}")
            self.constants[constant.name] = self.known(constant.value, f"constant {constant.name}")
        for step in kernel.step:
            self.positive(step, "the step of an item")
        for function in kernel.functions:
            self.function(function)
        self.interface()
        self.body(kernel.body, 0)

    def interface(self) -> None:
        """Declare what every item is given."""
        kernel = self.kernel
        integers = dict.fromkeys((*kernel.place, "width", "height", *kernel.interface.integers), tree.INT)
        integers |= {each: tree.Type("uint32") for each in kernel.interface.integers if each in UNSIGNED}
        integers |= dict.fromkeys(("local_x", "local_y", "item"), tree.INT) if kernel.group else {}
        integers |= dict.fromkeys(tree.BATCH, tree.INT) if kernel.batch is not None else {}
        for each, kind in integers.items():
            self.declare(each, Declared(kind))
        for array in kernel.interface.arrays:
            if array.name != WEIGHTS:
                sizes = tuple(each if isinstance(each, int) else None for each in array.shape)
                sizes = sizes if array.access != BOTH else (None,)
                self.declare(
                    array.name, Declared(tree.Type(array.dtype, array.lanes), sizes, array.access != READ)
                )
        if kernel.interface.role == DENOISE:
            self.declare(WEIGHTS, Declared(kernel.weights, (None,), False))

    # ---- names -------------------------------------------------------------------------------------------

    def declare(self, name: str, declared: Declared) -> None:
        """Declare a name in the innermost scope."""
        if any(name in scope for scope in self.scopes) or name in self.functions:
            raise KernelError(f"{name} is declared twice")
        if declared.type.dtype not in tree.BYTES or declared.type.lanes < 1:
            raise KernelError(f"{name} has the type {declared.type}, which does not exist")
        self.scopes[-1][name] = declared

    def named(self, name: str) -> Declared:
        """Return what a name stands for."""
        for scope in reversed(self.scopes):
            if name in scope:
                return scope[name]
        raise KernelError(f"{name} is used before it is declared")

    def array(self, name: str) -> Declared:
        """Return an array by its name."""
        declared = self.named(name)
        if declared.sizes is None:
            raise KernelError(f"{name} is not an array")
        return declared

    def constant(self, value: tree.Expr) -> int | None:
        """Return an integer that constants determine, or None."""
        if value.op == "const":
            return int(value.value) if value.type == tree.INT else None
        if value.op == "name":
            return self.constants.get(value.value)
        args = [self.constant(each) for each in value.args]
        if (
            value.op not in tree.INTEGERS
            or not args
            or None in args
            or (value.op in ("divide", "remainder") and not args[1])
        ):
            return None
        return tree.INTEGERS[value.op](*args)  # type: ignore[arg-type]

    def known(self, value: tree.Expr, what: str) -> int:
        """Return an integer that constants must determine."""
        number = self.constant(value)
        if number is None:
            raise KernelError(f"{what} is not determined by constants")
        return number

    def positive(self, value: tree.Expr | int, what: str) -> int:
        """Return a constant integer that must be positive."""
        number = value if isinstance(value, int) else self.known(value, what)
        if number <= 0:
            raise KernelError(f"{what} is {number}, which is not positive")
        return number

    # ---- statements --------------------------------------------------------------------------------------

    def function(self, function: tree.Function) -> None:
        """Check a function, which sees constants, earlier functions and what it takes."""
        self.scopes.append({})
        on_views = function.result is None
        for key, kind in function.takes:
            self.declare(key, Declared(kind, (None,) if on_views else None))
        for key in STEPS[: len(function.takes)] if on_views else ():
            self.declare(key, Declared(tree.INT))
        if any(isinstance(statement, tree.Barrier) for statement in tree.walk(function.body)):
            raise KernelError(f"function {function.name} has a barrier")
        for statement in function.body:
            self.statement(statement, 1)
        if function.result is not None:
            self.type(function.result)
        self.scopes.pop()
        self.declare(function.name, Declared(tree.FLOAT))
        self.functions[function.name] = function
        del self.scopes[-1][function.name]

    def body(self, body: tree.Body, depth: int = 1) -> None:
        """Check statements in a scope."""
        self.scopes.append({})
        for statement in body:
            self.statement(statement, depth)
        self.scopes.pop()

    def statement(self, statement: tree.Statement, depth: int) -> None:
        """Check a statement; `depth`: the statements around it."""
        getattr(self, f"_check_{type(statement).__name__.lower()}")(statement, depth)

    def _check_comment(self, statement: tree.Statement, depth: int) -> None:
        """Pass a comment."""

    def _check_let(self, statement: tree.Let, depth: int) -> None:
        """Check a value, and declare its name behind it."""
        self.declare(statement.name, Declared(self.type(statement.value)))

    def _check_array(self, statement: tree.Array, depth: int) -> None:
        """Check the sizes, or the first value of a variable."""
        name, kind, value = statement.name, statement.type, statement.value
        sizes = tuple(self.size(statement, each) for each in statement.sizes)
        if statement.space == "group" and (depth or not self.kernel.group or not sizes or value is not None):
            raise KernelError(f"{name} is memory of a group, which a kernel with groups declares at its top")
        if statement.space == "device" and (depth or not sizes or value is not None):
            raise KernelError(f"{name} is memory of the device, which a kernel declares at its top")
        if value is not None:
            if sizes:
                raise KernelError(f"{name} is an array with a first value")
            self.check(value, kind, f"the first value of {name}")
        self.declare(name, Declared(kind, sizes))

    def size(self, array: tree.Array, size: int | tree.Expr) -> int | None:
        """Return a size of an array; that of the device's memory may depend on the picture."""
        if array.space == "device" and isinstance(size, tree.Expr) and self.constant(size) is None:
            self.check(size, tree.INT, f"a size of {array.name}")
            return None
        return self.positive(size, f"a size of {array.name}")

    def _check_launch(self, statement: tree.Launch, depth: int) -> None:
        """Check a grid of items, whose names end with it."""
        if depth:
            raise KernelError("a launch inside another statement")
        self.scopes.append({})
        for each, count in zip(statement.place, statement.counts, strict=True):
            self.check(count, tree.INT, "the items of a launch")
            self.declare(each, Declared(tree.INT))
        self.body(statement.body)
        self.scopes.pop()

    def _check_store(self, statement: tree.Store, depth: int) -> None:
        """Check the element, and the type of the value."""
        array, kind = statement.array, self.type(statement.value)
        if not self.array(array).written:
            raise KernelError(f"{array} is written, which is read only")
        # Lanes of planes and images are pixels of a row, of which those beyond its end are not written.
        named = self.kernel.interface.named(array)
        pixels = self.kernel.interface.role != DENOISE and named is not None and named.access == WRITE
        self.element(array, statement.index, kind.of(1) if pixels else kind)
        if statement.add and (array == RESULT or kind.dtype not in ("float32", "int32", "uint32")):
            raise KernelError(f"a value of type {kind} is added to {array}")

    def _check_for(self, statement: tree.For, depth: int) -> None:
        """Check the bounds of a loop; a barrier inside needs bounds that all items share."""
        name = statement.name
        for each in (statement.start, statement.count, statement.step):
            self.check(each, tree.INT, f"a bound of the loop over {name}")
        self.positive(statement.step, f"the step of the loop over {name}")
        apart = statement.until is not None or None in map(self.constant, (statement.start, statement.count))
        self.scopes.append({})
        self.declare(name, Declared(tree.INT))
        if statement.until is not None:
            self.check(statement.until, tree.BOOL, f"the condition of the loop over {name}")
        apart |= any(isinstance(each, tree.Break) for each in statement.body)
        self.branches += apart
        self.loops.append(depth + 1)
        self.body(statement.body, depth + 1)
        self.loops.pop()
        self.branches -= apart
        self.scopes.pop()

    def _check_break(self, statement: tree.Break, depth: int) -> None:
        """Check the condition that ends a loop."""
        self.check(statement.condition, tree.BOOL, "the condition that ends a loop")
        if self.loops[-1:] != [depth]:
            raise KernelError("a break outside of a loop's own body")

    def _check_if(self, statement: tree.If, depth: int) -> None:
        """Check a branch."""
        self.check(statement.condition, tree.BOOL, "a condition")
        self.branches += 1
        self.body(statement.body, depth + 1)
        self.body(statement.otherwise, depth + 1)
        self.branches -= 1

    def _check_block(self, statement: Any, depth: int) -> None:
        """Check statements whose names end with them."""
        self.body(statement.body, depth + 1)

    def _check_barrier(self, statement: tree.Barrier, depth: int) -> None:
        """Refuse a barrier that some items of a group may miss."""
        if not self.kernel.group:
            raise KernelError("a barrier in a kernel without groups")
        if self.branches:
            raise KernelError("a barrier inside a branch, or a loop whose bounds are not constants")

    def _check_call(self, statement: tree.Call, depth: int) -> None:
        """Check the views that a function is given."""
        function = self.functions.get(statement.function)
        if function is None or function.result is not None:
            raise KernelError(f"{statement.function} is not a function on views")
        if len(function.takes) != len(statement.views) or len(statement.views) > len(STEPS):
            count = len(statement.views)
            raise KernelError(f"{statement.function} takes {len(function.takes)} views, not {count}")
        stored = {each.array for each in tree.walk(function.body) if isinstance(each, tree.Store)}
        for (key, kind), view in zip(function.takes, statement.views, strict=True):
            self.element(view.array, view.index, kind)
            self.check(view.step, tree.INT, "the step of a view")
            if key in stored and not self.array(view.array).written:
                raise KernelError(f"{view.array} is written by {statement.function}, and is read only")

    # ---- expressions -------------------------------------------------------------------------------------

    def check(self, value: tree.Expr, kind: tree.Type, what: str) -> None:
        """Refuse an expression of another type."""
        if (actual := self.type(value)) != kind:
            raise KernelError(f"{what} has type {shown(actual)} instead of {shown(kind)}")

    def type(self, value: tree.Expr) -> tree.Type:
        """Return the type of an expression, which must be the one that it states."""
        kind = self.rules.get(value.op, self._signed if value.op in SIGNATURES else self._operation)(value)
        if kind != value.type:
            raise KernelError(f"{value.op} of type {shown(kind)} is said to have type {shown(value.type)}")
        return kind

    def element(self, name: str, index: Sequence[tree.Expr], kind: tree.Type) -> None:
        """Check an access to an element of an array."""
        declared = self.array(name)
        row = len(index) == 3 and kind.lanes > 1  # several elements of a row
        for each in index:
            several = row and each is index[-1] and each.op == "clamp"
            self.check(each, tree.INT.of(kind.lanes) if several else tree.INT, f"an index of {name}")
        if name == WEIGHTS and kind.dtype in ("float32", "int32"):  # words, bit by bit
            declared = Declared(tree.Type(kind.dtype, declared.type.lanes), declared.sizes)
        sizes, whole = declared.sizes, kind == declared.type
        assert sizes is not None, "an array has sizes"
        if name.startswith(IMAGE) and len(index) == 2:
            if kind not in (tree.FLOAT, tree.FLOAT.of(sizes[-1] or 1)):
                raise KernelError(f"{name} is read as {shown(kind)}")
            return
        if row and len(sizes) == 3 and kind.dtype == declared.type.dtype:
            return
        # Memory of one type is accessed as another by component, or several elements at once.
        fits = declared.type.dtype == kind.dtype and 1 in (declared.type.lanes, kind.lanes)
        if not whole and (len(index) != 1 or not fits or len(sizes) != 1):
            raise KernelError(f"{name} has elements of type {shown(declared.type)}, not {shown(kind)}")
        if len(index) != len(sizes):
            raise KernelError(f"{name} has {len(sizes)} indices, not {len(index)}")
        for each, size in zip(index, sizes, strict=True):
            number = self.constant(each)
            if size is not None and not whole:
                size = limit(size, declared.type, kind)
            if number is not None and (number < 0 or (size is not None and number >= size)):
                raise KernelError(f"index {number} is beyond {name}, which has {size}")

    def _type_const(self, value: tree.Expr) -> tree.Type:
        """Return the type of a constant, whose value it must hold."""
        kind, number = value.type, value.value
        fits = {"bool": (bool,), "float32": (int, float)}.get(kind.dtype, (int,))
        truth = isinstance(number, bool) != (kind.dtype == "bool")
        least, most = LIMITS.get(kind.dtype, (-np.inf, np.inf))
        if kind.lanes != 1 or not isinstance(number, fits) or truth or not least <= number <= most:
            raise KernelError(f"{number!r} is not a constant of type {shown(kind)}")
        return kind

    def _type_name(self, value: tree.Expr) -> tree.Type:
        """Return the type of a named value, or of a variable."""
        declared = self.named(value.value)
        if declared.sizes:
            raise KernelError(f"{value.value} is an array without its index")
        return declared.type

    def _type_load(self, value: tree.Expr) -> tree.Type:
        """Return the type of an element."""
        array = self.kernel.interface.named(value.value)
        if array is not None and array.access == WRITE:
            raise KernelError(
                f"the {value.value} is read" if value.value == RESULT else f"{value.value} is read"
            )
        self.element(value.value, value.args, value.type)
        return value.type

    def _type_component(self, value: tree.Expr) -> tree.Type:
        """Return the type of one component."""
        vector = self.type(value.args[0])
        if not 0 <= value.value < vector.lanes or vector.lanes == 1:
            raise KernelError(f"component {value.value} does not exist in a value of type {shown(vector)}")
        return vector.of(1)

    def _signed(self, value: tree.Expr) -> tree.Type:
        """Return the type of an operation whose operands have the types of its signature."""
        operands, kind = SIGNATURES[value.op](value)
        self.arity(value, len(operands))
        for each, wanted in zip(value.args, operands, strict=True):
            self.check(each, wanted, f"an operand of {value.op}")
        return kind

    def _type_convert(self, value: tree.Expr) -> tree.Type:
        """Return the type of a value of another kind."""
        self.arity(value, 1)
        if value.value not in tree.BYTES:
            raise KernelError(f"a value is converted to {value.value}, which is not a kind of value")
        return tree.Type(value.value, self.type(value.args[0]).lanes)

    def _type_take(self, value: tree.Expr) -> tree.Type:
        """Return the type of an entry of a table."""
        if value.value not in self.tables:
            raise KernelError(f"{value.value} is not a table")
        self.check(value.args[0], tree.INT.of(value.type.lanes), f"the index of {value.value}")
        number, size = self.constant(value.args[0]), len(self.tables[value.value])
        if number is not None and not 0 <= number < size:
            raise KernelError(f"index {number} is beyond {value.value}, which has {size}")
        return tree.Type(str(self.tables[value.value].dtype), value.type.lanes)

    def _type_dot4(self, value: tree.Expr) -> tree.Type:
        """Return the type of products of bytes of words with four bytes, or with those of a word."""
        self.arity(value, 2)
        four = self.type(value.args[1])
        if four not in (tree.BYTE.of(4), tree.INT):
            raise KernelError(f"dot4 with {shown(four)}, which is neither four bytes nor a word")
        self.check(value.args[0], tree.INT.of(value.type.lanes), "an operand of dot4")
        return tree.INT.of(value.type.lanes)

    def _type_call(self, value: tree.Expr) -> tree.Type:
        """Return the type of a function's result."""
        function = self.functions.get(value.value)
        if function is None or function.result is None:
            raise KernelError(f"{value.value} is not a function of values")
        if len(value.args) != len(function.takes):
            raise KernelError(f"{value.value} takes {len(function.takes)} values, not {len(value.args)}")
        for each, (key, kind) in zip(value.args, function.takes, strict=True):
            self.check(each, kind, f"argument {key} of {value.value}")
        return function.result.type

    def _operation(self, value: tree.Expr) -> tree.Type:
        """Return the type of an operation on equal lanes; one condition may choose between vectors."""
        args = [self.type(each) for each in value.args]
        if value.op == "select" and len(args) == 3 and args[0] == tree.BOOL:
            args[0] = tree.BOOL.of(args[1].lanes)
        if value.op in ("divide", "remainder") and args == [tree.INT, tree.INT]:
            return tree.INT
        if value.op not in OPERATIONS:
            raise KernelError(f"{value.op} is not an operation")
        count, kinds = OPERATIONS[value.op]
        self.arity(value, count)
        if len({each.lanes for each in args}) != 1:
            raise KernelError(f"{value.op} of {', '.join(map(shown, args))}: lanes differ")
        chosen = args[value.op == "select" :]
        for some, allowed in ((args[: -len(chosen)], TRUTHS), (chosen, kinds)):
            found = {each.dtype for each in some}
            if len(found) > 1 or not found <= {*allowed}:
                types = ", ".join(map(shown, some))
                raise KernelError(f"{value.op}: operands must all be {' or all '.join(allowed)}, not {types}")
        return chosen[0] if value.op not in tree.COMPARISONS else tree.BOOL.of(args[0].lanes)

    def arity(self, value: tree.Expr, count: int) -> None:
        """Refuse an operation with another number of operands."""
        if len(value.args) != count:
            raise KernelError(f"{value.op} has {len(value.args)} operands, not {count}")


def shown(kind: tree.Type) -> str:
    """Return a type as messages name it."""
    return kind.dtype if kind.lanes == 1 else f"{kind.dtype} x {kind.lanes}"


def limit(size: int, declared: tree.Type, kind: tree.Type) -> int:
    """Return how many indices an array of elements of one type has that is accessed as another.

    Several elements at once begin at any one of them; else the index counts components.
    """
    return size - kind.lanes + 1 if declared.lanes == 1 else size * declared.lanes // kind.lanes
