"""Messages between the grader and the process that runs a student's code.

1. A message is its length in four bytes, then that many bytes [`Channel`]; MOST_BYTES is the limit.
2. The grader sends pickles: its peer trusts it. An array stays read-only, a function of a module goes by its
   name, a closure becomes a callback [`packed`, `unpacked`].
3. The student's process sends JSON: numbers, strings, containers, arrays as bytes in base64 [`plain`].
   Nothing in it is executed or looked up, except that RECORDS lists the classes it may name [`read`].
4. An exception is sent as the names of its classes, its message and its line [`error_of`].
"""

from __future__ import annotations

import base64
import builtins
import io
import json
import math
import pickle
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import FunctionType
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.errors import CompileError, WamnetError

MOST_BYTES = 1 << 23
"""Length limit of a student's message: the largest array of a lab has one megabyte."""

MOST_TEXT = 100_000
"""Length limit of a student's string: the longest kernel of a lab has some hundred characters."""

DEEPEST = 20
"""Depth limit of a student's nested containers."""

LONGEST_MESSAGE = 2000
"""Characters of an exception's message that are sent."""

STUDENT = "student"
"""Module name of the student's file."""


class BadMessage(WamnetError):
    """Bytes that `plain` does not give: other code than judged.py wrote to the pipe."""


class Node(NamedTuple):
    """A node of a program of labs 9 and 10."""

    op: str
    args: tuple[int, ...] = ()
    value: Any = None


class Program(NamedTuple):
    """A program of labs 9 and 10."""

    nodes: tuple[Node, ...]
    output: int


RECORDS = {
    f"{module}:{name}": (module, name)
    for module, names in (
        ("wamnet.refimpl.light.intersection", ("Surface",)),
        ("wamnet.refimpl.network.window", ("Window",)),
        ("wamnet.compiler.core.ir", ("Program", "Node", "Type", "Gather", "Image")),
        ("wamnet.compiler.kernel.kernel", ("Expr", "Type", "Let", "Store", "For")),
    )
    for name in names
} | {f"{STUDENT}:{name}": (__name__, name) for name in ("Node", "Program")}
"""Classes that a student's process may name, and where the grader finds its own."""


class Channel:
    """Sends and receives messages."""

    def __init__(self, reader: IO[bytes], writer: IO[bytes]) -> None:
        self.reader, self.writer = reader, writer

    def send(self, message: bytes) -> None:
        """Send a message."""
        self.writer.write(len(message).to_bytes(4, "little") + message)
        self.writer.flush()

    def receive(self, most: int = 1 << 32) -> bytes:
        """Return the next message; EOFError at the end, BadMessage for one of more bytes."""
        length = int.from_bytes(self._read(4), "little")
        if length > most:
            raise BadMessage(f"a message of {length} bytes, more than {most}")
        return self._read(length)

    def _read(self, length: int) -> bytes:
        data = self.reader.read(length)
        if len(data) < length:
            raise EOFError
        return data


# ---- from the grader --------------------------------------------------------------------------------------


def evaluated(source: str) -> Any:
    """Return the value of an expression; `student` is the student's module where there is one."""
    names = {"np": np, "import_module": import_module, "student": sys.modules.get(STUDENT)}
    return eval(source, names)


class Expression:
    """A function that is sent as its source: lab 9 traces it, beside the student's classes."""

    def __init__(self, source: str) -> None:
        self.source = source

    def __call__(self, *args: Any) -> Any:
        """Return the value of the function."""
        return evaluated(self.source)(*args)

    def __reduce__(self) -> tuple[Any, ...]:
        return evaluated, (self.source,)


def named(module: str, name: str) -> Any:
    """Return a function of a module."""
    return getattr(import_module(module), name)


def own(name: str, *values: Any) -> Any:
    """Return a record of the student's class of this name, or of this module's."""
    return getattr(sys.modules.get(STUDENT), name, globals()[name])(*values)


def array_of(data: bytes, dtype: str, shape: Sequence[int], writeable: bool) -> NDArray[Any]:
    """Return an array from its bytes."""
    array = np.frombuffer(data, dtype).reshape(shape)
    return array.copy() if writeable else array


class _Pickler(pickle.Pickler):
    """Pickles for a student's process; closures are appended to `callbacks`."""

    def __init__(self, file: IO[bytes], callbacks: list[Callable[..., Any]]) -> None:
        super().__init__(file)
        self.callbacks = callbacks

    def persistent_id(self, value: Any) -> int | None:
        """Return the index of a closure among the callbacks."""
        if isinstance(value, FunctionType) and "<" in value.__qualname__:
            self.callbacks.append(value)
            return len(self.callbacks) - 1
        return None

    def reducer_override(self, value: Any) -> Any:
        """Return the function that makes a value in the student's process, and its arguments."""
        if isinstance(value, FunctionType) and value.__module__ != __name__:
            # Not pickle's own way, which demands that no test or lab has replaced the function meanwhile.
            return named, (value.__module__, value.__qualname__)
        if isinstance(value, Node | Program):
            return own, (type(value).__name__, *value)
        if type(value) is np.ndarray and not value.dtype.hasobject:
            return array_of, (value.tobytes(), value.dtype.str, value.shape, value.flags.writeable)
        return NotImplemented


def packed(value: Any, callbacks: list[Callable[..., Any]]) -> bytes:
    """Return a value as bytes for a student's process."""
    file = io.BytesIO()
    _Pickler(file, callbacks).dump(value)
    return file.getvalue()


class _Unpickler(pickle.Unpickler):
    """Reads the grader's pickles; `call` makes a callback by its index."""

    def __init__(self, file: IO[bytes], call: Callable[..., Any]) -> None:
        super().__init__(file)
        self.call = call

    def persistent_load(self, index: int) -> Callable[..., Any]:
        """Return a callback."""
        return lambda *args: self.call(index, *args)


def unpacked(data: bytes, call: Callable[..., Any]) -> Any:
    """Return the grader's value; `call` takes a callback's index and its arguments."""
    return _Unpickler(io.BytesIO(data), call).load()


# ---- from the student's process ---------------------------------------------------------------------------


def plain(value: Any) -> Any:
    """Return a value for JSON: containers, arrays and records as objects of one key."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return _plain_array(value)
    if isinstance(value, int) and value.bit_length() <= 1024:
        return int(value)
    for kind in (float, str):
        if isinstance(value, kind):
            return kind(value)
    if isinstance(value, dict):
        return {"dict": [[plain(key), plain(one)] for key, one in value.items()]}
    name = f"{type(value).__module__}:{type(value).__qualname__}"
    if name in RECORDS:
        names = [field.name for field in fields(value)] if is_dataclass(value) else value._fields
        return {"record": [name, [[field, plain(getattr(value, field))] for field in names]]}
    for sequence in (list, tuple):
        if isinstance(value, sequence):
            return {sequence.__name__: [plain(one) for one in value]}
    return {"other": type(value).__name__}


def _plain_array(value: Any) -> Any:
    """Return an array of numbers for JSON."""
    array = np.asarray(value)
    if array.dtype.kind not in "biufc":
        return {"other": type(value).__name__}
    data = base64.b64encode(array.tobytes()).decode()
    return {"array": [array.dtype.str, array.shape, array.flags.writeable, value is not array, data]}


class Other:
    """A student's value of a type that is not sent; its class has the type's name."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}>"


def read(message: bytes) -> Any:
    """Return ("value", value), ("raised", exception) or ("call", [index, *arguments]); else BadMessage."""
    try:
        kind, rest = json.loads(message)
        if kind == "raised":
            return kind, error_of(*rest)
        if kind not in ("value", "call"):
            raise BadMessage(f"a message of kind {kind}")
        return kind, _value(rest, 0)
    except Exception as error:  # noqa: BLE001
        raise BadMessage(str(error)) from None


def _value(tree: Any, depth: int) -> Any:
    if depth > DEEPEST or (isinstance(tree, str) and len(tree) > MOST_TEXT):
        raise BadMessage(f"more than {DEEPEST} containers in each other, or {MOST_TEXT} characters")
    if tree is None or isinstance(tree, bool | int | float | str):
        return tree
    ((kind, rest),) = tree.items()
    if kind == "array":
        return _array(*rest)
    if kind == "other":
        return type(identifier(rest), (Other,), {})()
    if kind == "dict":
        return {_value(key, depth + 1): _value(one, depth + 1) for key, one in rest}
    if kind == "record":
        made = {field: _value(one, depth + 1) for field, one in rest[1]}
        return named(*RECORDS[rest[0]])(**made)
    return {"list": list, "tuple": tuple}[kind](_value(one, depth + 1) for one in rest)


def _array(name: str, shape: Sequence[int], writeable: bool, scalar: bool, data: str) -> Any:
    decoded = base64.b64decode(data)
    known = re.fullmatch(r"[<>|][biufc]\d\d?", name) and all(type(n) is int and n >= 0 for n in shape)
    if not known or len(decoded) != math.prod(shape) * np.dtype(name).itemsize:
        raise BadMessage(f"an array of {name}, shape {shape} and {len(decoded)} bytes")
    array = array_of(decoded, name, shape, bool(writeable))
    return array[()] if scalar else array


def identifier(text: str) -> str:
    """Return a name with an underscore for each character that a name cannot have."""
    return re.sub(r"\W", "_", text[:60], flags=re.ASCII)


# ---- exceptions -------------------------------------------------------------------------------------------


class Raised(Exception):
    """An exception of the other process: the names of its classes, and the line of the student's file."""

    names: tuple[str, ...] = ()
    line = 0

    def __str__(self) -> str:
        return str(self.args[0])


def names_of(error: BaseException) -> tuple[str, ...]:
    """Return the names of an exception's classes, its own first."""
    return error.names if isinstance(error, Raised) else tuple(c.__name__ for c in type(error).__mro__)


def error_of(names: Sequence[str], text: str, line: int = 0) -> Raised:
    """Return an exception that `except` of the first known one of these classes catches."""
    kinds = {"CompileError": CompileError}
    for name in names:
        kind = kinds.get(name, getattr(builtins, name, None))
        # UnicodeError's children take five arguments, and groups two.
        if isinstance(kind, type) and issubclass(kind, Exception) and "Unicode" not in name:
            break
    else:
        kind = Exception
    kind = Exception if kind.__name__.endswith("Group") else kind
    error: Raised = type(identifier(names[0]), (Raised, kind), {})(text)
    error.names, error.line = tuple(map(identifier, names)), int(line)
    return error
