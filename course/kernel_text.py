"""Run the text of a small kernel, lane by lane, as a compiler of its language would read it.

1. The parser is that of the check of texts [compiler/reading/syntax.py]; what it does not know is an error.
2. Values are NumPy's numbers of the kind that the language gives them: an integer, a float32, in OpenCL a
   double for a literal without f [`Lane`]. Integers divide as integers.
3. What is declared twice, is unknown, or is read or written beyond an array's end, is an error [`TextError`].

It is for texts of a course: straight-line code with `if` and `return`, no loops.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.reading.syntax import Parser
from wamnet.compiler.reading.tokens import Function, Text, Type


class TextError(Exception):
    """What is wrong with a text: the message, and the likeliest mistake."""

    def __init__(self, told: str, likely: str = "") -> None:
        super().__init__(told)
        self.likely = likely


class Returned(Exception):
    """A return statement, with its value."""

    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


Functions = Mapping[str, Callable[..., Any]]
"""A language's functions by name."""

BOTH: Functions = {"sin": np.sin, "cos": np.cos, "sqrt": np.sqrt, "floor": np.floor}
"""Functions of both languages."""

BUILTINS: Mapping[str, Functions] = {
    "opencl": {
        **BOTH,
        "fabs": np.abs,
        "fmin": np.fmin,
        "fmax": np.fmax,
        "min": np.minimum,
        "max": np.maximum,
        "select": lambda a, b, c: b if c else a,
    },
    "glsl": {
        **BOTH,
        "abs": np.abs,
        "min": np.minimum,
        "max": np.maximum,
        "float": np.float32,
        "mix": lambda a, b, c: (b if c else a) if isinstance(c, (bool, np.bool_)) else a + (b - a) * c,
    },
}
"""What each language calls its functions."""

OTHERS = {
    ("glsl", "fabs"): "GLSL calls it abs",
    ("glsl", "fmin"): "GLSL calls it min",
    ("glsl", "fmax"): "GLSL calls it max",
    ("opencl", "abs"): "abs is of integers in OpenCL: fabs",
    ("opencl", "float"): "a cast is (float)x in OpenCL",
}
"""Functions of the other language."""

KNOWN = ("get_global_id", "gl_GlobalInvocationID")
"""What a text does not declare, except functions."""

BINARY: Mapping[str, Callable[[Any, Any], Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "<": np.less,
    ">": np.greater,
    "<=": np.less_equal,
    ">=": np.greater_equal,
    "==": np.equal,
    "!=": np.not_equal,
    "&&": lambda a, b: bool(a) and bool(b),
    "||": lambda a, b: bool(a) or bool(b),
}
"""Operators but the division."""


def parsed(source: str) -> Text:
    """Return a text, parsed; TextError for what is not in the language."""
    if not isinstance(source, str):
        raise TextError(f"{type(source).__name__} is not a text", "return the text")
    try:
        # Of both languages: what the other one calls a function is explained where it is called.
        others = {name for _, name in OTHERS}
        parser = Parser(source, calls={*KNOWN, *others, *BUILTINS["opencl"], *BUILTINS["glsl"]})
        parser.types["size_t"] = Type("uint32")
        parser.inside = {"const", "precise", "__global", "__local", "shared"}
        return parser.parse()
    except Unread as error:
        raise TextError(f"it does not parse: {error}", "a bracket, a semicolon or an operator") from None
    except (LookupError, ValueError, TypeError) as error:
        raise TextError(f"it does not parse ({error})", "a bracket, a semicolon or an operator") from None


class Lane:
    """One work item, or one call: what is declared in it, by name."""

    def __init__(self, language: str, known: dict[str, Any], item: int = 0) -> None:
        self.language, self.known, self.item = language, known, item

    def call(self, function: Function) -> Any:
        """Run a function's body, and return what it returns."""
        try:
            self.run(function.body)
        except Returned as returned:
            return returned.value
        return None

    def run(self, tree: Any) -> None:
        """Run a statement."""
        form = tree[0]
        if form == "block":
            for statement in tree[1]:
                self.run(statement)
        elif form == "declare":
            self._declare(tree[1], tree[2])
        elif form == "declarations":
            for _, variable, value in tree[1]:
                self._declare(variable, value)
        elif form == "if":
            self.run(tree[2] if bool(self.value(tree[1])) else tree[3])
        elif form == "return":
            raise Returned(None if tree[1] is None else self.value(tree[1]))
        elif form == "do":
            self.value(tree[1])
        else:
            raise TextError(f"a statement `{form}`", "one statement a node, and a guard")

    def _declare(self, variable: Any, tree: Any) -> None:
        if variable.name in self.known:
            raise TextError(f"{variable.name} is declared twice", "a name a node: v0, v1, ...")
        value = None if tree is None else self.value(tree)
        self.known[variable.name] = (
            None if value is None else self._held(value, variable.type.kind, variable.name)
        )

    def _held(self, value: Any, kind: str, name: str) -> Any:
        """Return a value as a variable of a kind holds it."""
        truth = isinstance(value, (bool, np.bool_))
        if kind == "bool":
            if self.language == "glsl" and not truth:
                raise TextError(f"{name} is a bool and gets a number", "less and greater give booleans only")
            return bool(value)
        if truth and self.language == "glsl":
            raise TextError(f"{name} is a {kind} and gets a boolean", "less and greater give a bool")
        if kind == "float32" and self.language == "glsl" and isinstance(value, np.int32):
            raise TextError(f"{name} is a float and gets an integer", "a float literal has a point: 2.0")
        made: dict[str, Any] = {"float32": np.float32, "int32": np.int32, "uint32": np.uint32}
        return made.get(kind, np.float32)(value)

    def value(self, tree: Any) -> Any:
        """Return the value of an expression."""
        found = getattr(self, f"_{tree[0]}", None)
        if found is None:
            raise TextError(f"an expression `{tree[0]}`", "plain expressions only")
        return found(*tree[1:])

    def _number(self, text: str) -> Any:
        if text[-1] in "fF" and not text.lower().startswith("0x"):
            if not any(sign in text for sign in ".eE"):
                raise TextError(f"{text} is no number", "a float needs a point or an exponent: 2.0f")
            return np.float32(text[:-1])
        if any(sign in text for sign in ".eE"):
            # Nothing overflows: a double holds every float.
            return np.float64(text) if self.language == "opencl" else np.float32(text)
        return np.int32(int(text.rstrip("uU"), 0))

    def _name(self, name: str) -> Any:
        if name in ("true", "false"):
            return name == "true"
        if self.known.get(name) is None:
            raise TextError(f"{name} is not declared", "a node is written after its operands")
        return self.known[name]

    def _unary(self, op: str, tree: Any) -> Any:
        value = self.value(tree)
        if op == "!":
            return not value
        return -value if op == "-" else value

    def _binary(self, op: str, left: Any, right: Any) -> Any:
        a, b = self.value(left), self.value(right)
        if self.language == "glsl" and {type(a), type(b)} == {np.int32, np.float32}:
            raise TextError(f"a float {op} an integer", "a float literal has a point: 2.0")
        if op == "/":
            return (
                np.int32(int(a) // int(b))
                if isinstance(a, np.int32) and isinstance(b, np.int32)
                else np.divide(a, b)
            )
        if op not in BINARY:
            raise TextError(f"the operator {op}", "+, -, *, /, <, >")
        return BINARY[op](a, b)

    def _choice(self, condition: Any, then: Any, otherwise: Any) -> Any:
        truth = self.value(condition)
        if self.language == "glsl" and not isinstance(truth, (bool, np.bool_)):
            raise TextError("a condition that is a number", "less and greater give a bool")
        return self.value(then if truth else otherwise)

    def _cast(self, type_: Any, tree: Any) -> Any:
        return self._held(self.value(tree), type_.kind, "a cast")

    def _call(self, callee: Any, arguments: Any) -> Any:
        name = callee[1]
        values = [self.value(tree) for tree in arguments]
        if name == "get_global_id" and self.language == "opencl":
            if values != [0]:
                raise TextError("another get_global_id than that of 0", "the numbers are along axis 0")
            return np.int32(self.item)
        if name not in BUILTINS[self.language]:
            raise TextError(
                f"a function {name}", OTHERS.get((self.language, name), "no function of the language")
            )
        if self.language == "glsl" and any(isinstance(value, np.int32) for value in values):
            raise TextError(f"{name} of an integer", "a float literal has a point: 2.0")
        return BUILTINS[self.language][name](*values)

    def _place(self, array: Any, index: Any) -> tuple[Any, int]:
        """Return an array and a place in it."""
        held, at = self.value(array), int(self.value(index))
        if not isinstance(held, np.ndarray):
            raise TextError("an index of a number", "only arguments of a kernel are arrays")
        if not 0 <= at < len(held):
            guard = "items beyond the end run too: if (i >= count) return;"
            raise TextError(f"item {self.item} reads or writes number {at} of {len(held)}", guard)
        return held, at

    def _at(self, array: Any, index: Any) -> Any:
        held, at = self._place(array, index)
        return held[at]

    def _assign(self, op: str, target: Any, tree: Any) -> Any:
        if op:
            raise TextError(f"the operator {op}=", "each node has a variable of its own")
        value = self.value(tree)
        if target[0] == "at":
            held, at = self._place(target[1], target[2])
            held[at] = value
        elif target[0] == "name" and target[1] in self.known:
            self.known[target[1]] = self._held(value, "float32", target[1])
        else:
            raise TextError("an assignment to what is not declared", "float v3 = ...;")
        return value
