"""A parser of the languages that kernels are written in: C and its children; wgsl_syntax.py adds WGSL.

A tree is made of tuples whose first item names the form. The grammar is that of the compiler's kernels:
anything else is rejected, so that no construct passes unread. An expression has no effect but by functions
that it calls, and a name is declared once in a block, and is not a function's. What is outside of functions
has been compared with a closed list already [frame.py].

    expression   ("number", text), ("name", n), ("call", callee, [arguments]), ("at", a, index),
                 ("of", a, member), ("unary", op, a), ("binary", op, a, b), ("choice", c, a, b),
                 ("cast", type, a), ("list", [values]), ("sizeof", a)
    effect       ("assign", op, target, value), ("step", op, target), ("call", ...)
    statement    ("declare", Variable, value or None), ("declarations", [...]), ("union", name, [Variable]),
                 ("do", expression), ("for", start, condition, step, body), ("if", c, then, otherwise),
                 ("return", value or None), ("block", [statements])
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace
from typing import Any

from wamnet.compiler.parsing.parse import Unread

from .text_tokens import UNROLLED, Function, Macros, Text, Type, Variable, rounds, tokens
from .text_tokens import Tree as Tree
from .text_tokens import constant as constant

OUTSIDE = {
    "const", "static", "inline", "restrict", "__restrict__", "precise", "__kernel", "kernel", "__global",
    "device", "constant", "readonly", "uniform", "in", "out", "__device__", "__global__", "buffer",
}  # fmt: skip
"""Qualifiers that change no value: outside of functions frame.py has compared them."""

SHARED = {"__local", "threadgroup", "__shared__", "shared"}
"""Qualifiers of memory that the work items of a group share."""

SPACES = {"__global", "__local", "device", "threadgroup", "constant"}
"""Qualifiers that are address spaces, which a pointer keeps."""

SCALARS = {
    "void": "void", "bool": "bool", "float": "float32", "int": "int32", "uint": "uint32", "f32": "float32",
    "int8_t": "int8", "uint8_t": "uint8", "uchar": "uint8", "int32_t": "int32", "uint32_t": "uint32",
    "i32": "int32", "u32": "uint32", "sampler2D": "image",
}  # fmt: skip
"""Names of types of one number."""

IN_A_FUNCTION = 3
"""How many blocks are open in that of a function: the source, what it takes, its statements."""

BINARY = [
    {"||"}, {"&&"}, {"|"}, {"^"}, {"&"}, {"==", "!="}, {"<", ">", "<=", ">="}, {"<<", ">>"}, {"+", "-"},
    {"*", "/", "%"},
]  # fmt: skip
"""Operators of two operands, from those that bind least."""


class Parser:
    """Reads one text: `parse()`."""

    def __init__(self, text: str, macros: Macros | None = None, calls: Collection[str] = ()) -> None:
        self.tokens, self.at, self.text = [*tokens(text, macros), ("end", "", 0)], 0, Text()
        self._role, self._binding, self.doubles, self.precise, self.lists = "", -1, False, False, False
        self._fixed, self._space, self.reserved = False, "", re.compile("")
        self.calls, self.scopes, self._inside, self._unset, self._precise = (
            calls,
            [set[str]()],
            False,
            "",
            False,
        )
        self.types = {name: Type(kind) for name, kind in SCALARS.items()}
        for base in ("float", "int", "uint", "uchar"):
            self.types |= {f"{base}{n}": Type(SCALARS[base], n) for n in (2, 4, 8, 16)}
        self.types["__m512i"], self.inside = Type("int32", 16), set[str]()
        for base, kind in (("vec", "float32"), ("ivec", "int32")):
            self.types |= {f"{base}{n}": Type(kind, n) for n in (2, 4)}

    # ---- tokens --------------------------------------------------------------------------------------------

    @property
    def _now(self) -> str:
        return self.tokens[self.at][1]

    def _ahead(self, n: int = 1) -> str:
        return self.tokens[min(self.at + n, len(self.tokens) - 1)][1]

    def _take(self, wanted: str | None = None) -> str:
        kind, text, line = self.tokens[self.at]
        if kind == "end" or (wanted is not None and text != wanted):
            raise Unread(f"line {line}: {text!r}" + (f" where {wanted!r} is read" if wanted else ""))
        self.at += 1
        return text

    def _has(self, wanted: str) -> bool:
        """Take a token if it is there."""
        if self.tokens[self.at][0] != "end" and self._now == wanted:
            self.at += 1
            return True
        return False

    def _skip_brackets(self, opening: str, closing: str) -> None:
        self._take(opening)
        depth = 1
        while depth:
            token = self._take()
            depth += (token == opening) - (token == closing)

    # ---- declarations --------------------------------------------------------------------------------------

    def parse(self) -> Text:
        """Return the whole text."""
        while self.tokens[self.at][0] != "end":
            self._outside()
        return self.text

    def _outside(self) -> None:
        """Read a declaration outside functions."""
        if self._has(";"):
            return
        if self._now == "using":
            while not self._has(";"):
                self._take()
        elif self._now == "extern" and self._ahead().startswith('"'):
            self.at += 2
        elif self._now == "precision":
            self.at += 4
        elif self._now == "typedef":
            self._typedef()
        elif self._now == "struct" and (self._ahead(2) == "{" or self._ahead() == "__align__"):
            self._take()
            self._qualifiers()
            name = self._take()
            self._struct(name)
            self._take(";")
        else:
            self._declaration_outside()

    def _typedef(self) -> None:
        self._take("typedef")
        if self._has("struct"):
            self._qualifiers()
            at = self.at
            self._skip_brackets("{", "}")
            name, end = self._take(), self.at
            self.at = at
            self._struct(name)
            self.at = end
        else:
            base = self._type()
            name = self._take()
            if self._has("__attribute__"):
                at = self.at
                self._skip_brackets("(", ")")
                words = self.tokens[at : self.at]
                sizes = [i for i, token in enumerate(words) if token[1] == "vector_size"]
                if sizes:
                    self.at, end = at + sizes[0] + 1, self.at
                    size = constant(self._expression())
                    self.at = end
                    base = Type(base.kind, size // 4)
            self.types[name] = base
        self._take(";")

    def _struct(self, name: str) -> None:
        """Read the members of a struct; one of a single array of numbers, or of x, y, z, w, is a vector."""
        members = self._members()
        if len(members) == 1 and len(members[0].sizes) == 1:
            self.types[name] = Type(members[0].type.kind, constant(members[0].sizes[0]))
        elif [v.name for v in members] == list("xyzw") and {v.type for v in members} == {Type("float32")}:
            self.types[name] = Type("float32", 4)
        elif len(members) == 1 and members[0].type.width > 1:
            self.types[name] = members[0].type
            self.text.vectors.add(members[0].name)
        else:
            self.types[name] = Type(name)
        self.text.structs[name] = members

    def _members(self) -> list[Variable]:
        self._take("{")
        found = []
        while not self._has("}"):
            _, type_ = self._qualified()
            found.append(self._variable(type_, of=True))
            while self._has(","):
                found.append(self._variable(type_, of=True))
            self._take(";")
        return found

    def _declared(self, name: str, fixed: bool = False) -> str:
        """Note the name of a variable: no type or function has it, nor its block or the one around that.

        A `fixed` one is not assigned to: this is noted by a name with a blank.
        """
        if self.reserved.fullmatch(name) or "__" in name or name.startswith("gl_") or not name.strip("_"):
            raise Unread(f"line {self.tokens[self.at - 1][2]}: {name}, which is reserved")
        known = name in self.types or name in self.calls or name in self.text.functions
        known = known or (self._inside and name.upper() == name)
        if known or any(name in scope for scope in (self.scopes[-1], *self.scopes[1:][-2:])):
            raise Unread(f"line {self.tokens[self.at - 1][2]}: another {name}")
        self.scopes[-1] |= {name, f"{name} is fixed"} if fixed else {name}
        return name

    def _writes(self, target: Tree) -> Tree:
        """Return what is written, which no declaration forbids."""
        inner = target
        while inner[0] in ("at", "of"):
            inner = inner[1]
        scope: set[str] = next((s for s in reversed(self.scopes) if inner[1] in s), set())
        if f"{inner[1]} is fixed" in scope:
            raise Unread(f"line {self.tokens[self.at][2]}: {inner[1]}, a constant, is written")
        return target

    def _qualifiers(self) -> bool:
        """Skip qualifiers; return whether the variable is shared."""
        shared = False
        while True:
            if self._inside and self._now not in self.inside:
                return shared
            self._space = self._now if self._now in SPACES else self._space
            if self._now in SHARED:
                shared = True
                self._take()
            elif self._now in ("layout", "__attribute__"):
                self._take()
                self._group_size()
            elif self._now in ("__launch_bounds__", "__align__"):
                self._take()
                self._skip_brackets("(", ")")
            elif self._now == "[" and self._ahead() == "[":
                self._role = self._ahead(2)
                if self._role == "buffer":
                    self._binding = int(self._ahead(4))
                self._skip_brackets("[", "]")
            elif self._now in OUTSIDE:
                word = self._take()
                self._precise |= word == "precise"
                self._fixed |= word == "const"
            else:
                return shared

    def _group_size(self) -> None:
        """Skip what is in brackets; note the size of work groups if it is there."""
        first = self.at
        self._skip_brackets("(", ")")
        end = self.at
        words = {token[1]: first + n for n, token in enumerate(self.tokens[first:end])}
        if "reqd_work_group_size" in words:
            self.at = words["reqd_work_group_size"] + 2
            self.text.group = self._values(")")
        if "binding" in words:
            self._binding = int(self.tokens[words["binding"] + 2][1])
        for axis in "xyz":
            if f"local_size_{axis}" in words:
                self.at = words[f"local_size_{axis}"] + 2
                self.text.group = [*self.text.group, self._expression()]
        self.at = end

    def _qualified(self) -> tuple[bool, Type]:
        """Read a type with qualifiers before, between and behind."""
        self._fixed, self._space = False, ""
        shared = self._qualifiers()
        found = self._type()
        while True:
            shared |= self._qualifiers()
            found = replace(found, space=self._space) if self._space else found
            if self._now not in ("*", "&"):
                return shared, found
            pointer = self._take() == "*"
            found = replace(found, pointer=pointer, reference=not pointer, fixed=self._fixed)
            self._fixed = False

    def _is_type(self) -> bool:
        """Return whether a type begins here."""
        kind, text, _ = self.tokens[self.at]
        return kind == "name" and (text in self.types or text in self.inside or text == "union")

    def _type(self) -> Type:
        name = self._take()
        if name not in self.types:
            raise Unread(f"line {self.tokens[self.at - 1][2]}: type {name!r}")
        return self.types[name]

    def _variable(self, type_: Type, shared: bool = False, of: bool = False) -> Variable:
        """Read the name, `of` a member or a variable, and the sizes of an array."""
        found = Variable(self._take(), type_, shared=shared)
        if not of:
            self._declared(found.name, self._fixed)
        if type_.kind == "void":
            raise Unread(f"line {self.tokens[self.at - 1][2]}: {found.name} of type void")
        while self._now == "[" and self._ahead() != "[":
            self._take()
            found.sizes.append(None if self._now == "]" else self._expression())
            constant(found.sizes[-1] or ("number", "0"))
            self._take("]")
        self._role = ""
        self._qualifiers()
        found.role = self._role
        return found

    def _declaration_outside(self) -> None:
        shared = self._qualifiers()
        if self._has(";"):
            return
        if self._ahead() == "{":  # a block of GLSL: its members are names of the text
            self._take()
            binding, members = self._binding, self._members()
            self.text.outside += [(member, None) for member in members]
            self.text.bindings |= {self._declared(member.name): binding for member in members}
            if self._now != ";":
                self._take()
            self._take(";")
            return
        also, type_ = self._qualified()
        name = self._take()
        if name == "operator":
            name += self._take()
        if self._now != "(":
            self.at -= 1
            self._variables(type_, shared or also, self.text.outside)
            return
        self.scopes.append(set())
        takes = self._parameters()
        if self._has(";"):
            self.scopes.pop()
            self.scopes[0].add(name)
        else:
            self._function(name, takes, type_)

    def _function(self, name: str, takes: list[Variable], type_: Type) -> None:
        """Read the statements of a function."""
        if name in self.text.functions or name in self.calls:
            raise Unread(f"two functions {name}()")
        self._inside = True
        self.text.functions[name] = Function(name, takes, self._block(), type_)
        self._inside = False
        self.scopes.pop()
        self.scopes[0].add(name)

    def _parameters(self) -> list[Variable]:
        self._take("(")
        found: list[Variable] = []
        while not self._has(")"):
            if found:
                self._take(",")
            shared, type_ = self._qualified()
            if type_.kind == "void" and self._now == ")":
                continue
            found.append(self._variable(type_, shared))
            if found[-1].role == "buffer":
                self.text.bindings[found[-1].name] = self._binding
        return found

    def _variables(self, type_: Type, shared: bool, into: list[tuple[Variable, Any]]) -> None:
        """Read declared names with their values, up to the semicolon."""
        fixed = self._fixed
        while True:
            self._fixed = fixed
            own = replace(type_, pointer=True, fixed=fixed or type_.fixed) if self._has("*") else type_
            self._qualifiers()
            found = self._variable(own, shared)
            self._unset = found.name
            into.append((found, self._value() if self._has("=") else None))
            self._unset = ""
            if self._inside and fixed and into[-1][1] is None:
                raise Unread(f"line {self.tokens[self.at - 1][2]}: {found.name}, a constant without a value")
            if self.precise and self._inside and not self._precise:
                self._check_precise(*into[-1])
            if not self._has(","):
                break
        self._take(";")

    def _check_precise(self, variable: Variable, value: Any) -> None:
        """Reject a number that is rounded, or a part of a sum, of which the language may change the order."""
        part = variable.sizes and not re.fullmatch(r"v\d+", variable.name)
        if variable.type == Type("float32") and (part or (value is not None and rounds(value))):
            raise Unread(f"line {self.tokens[self.at - 1][2]}: {variable.name} is not declared precise")

    def _value(self) -> Tree:
        """Read the value of a declaration: an expression, or a list in braces."""
        return ("list", self._values("}")) if self._has("{") else self._expression()

    # ---- statements ----------------------------------------------------------------------------------------

    def _block(self) -> Tree:
        self._take("{")
        self.scopes.append(set())
        found = []
        while not self._has("}"):
            found.append(self._statement())
        self.scopes.pop()
        return ("block", found)

    def _statement(self) -> Tree:
        if self._now == "{":
            return self._block()
        if self._has(";"):
            return ("block", [])
        if self._has(UNROLLED) and self._now != "for":
            raise Unread(f"line {self.tokens[self.at][2]}: a pragma for a loop before {self._now!r}")
        if self._now in ("for", "if", "return"):
            found: Tree = getattr(self, f"_read_{self._take()}")()
            return found
        if self._declares():
            return self._declare()
        done = self._effect()
        self._take(";")
        return ("do", done)

    def _effect(self) -> Tree:
        """Read an assignment, a step, or a call."""
        if self._now in ("++", "--"):
            return ("step", self._take(), self._writes(self._unary()))
        target = self._unary()
        if self._now in ("++", "--"):
            return ("step", self._take(), self._writes(target))
        if self._now in ("=", "+=", "-=", "*=", "/=", "|=", "&=", "^="):
            op = self._take()
            return ("assign", op[:-1], self._writes(target), self._expression())
        if target[0] != "call" and target[:2] != ("cast", Type("void")):
            raise Unread(f"line {self.tokens[self.at][2]}: a statement without an effect")
        return target

    def _declares(self) -> bool:
        """Return whether a declaration begins here: a type and a name behind it, not a cast or a call."""
        return self._is_type() and self._ahead() != "("

    def _declare(self) -> Tree:
        if self._now == "union":
            return self._union()
        self._precise = False
        shared, type_ = self._qualified()
        found: list[tuple[Variable, Any]] = []
        self._variables(type_, shared, found)
        if shared and (len(self.scopes) != IN_A_FUNCTION or not all(v.sizes for v, _ in found)):
            raise Unread(
                f"line {self.tokens[self.at - 1][2]}: shared memory that is not an array of its kernel"
            )
        pairs: list[Tree] = [("declare", variable, value) for variable, value in found]
        return pairs[0] if len(pairs) == 1 else ("declarations", pairs)

    def _union(self) -> Tree:
        """Read a union of arrays, which are the same numbers."""
        self._take("union")
        members = self._members()
        name = self._declared(self._take())
        self._take(";")
        return ("union", name, members)

    def _read_for(self) -> Tree:
        self._take("(")
        self.scopes.append(set())
        start = self._branch(begins=True)
        condition = self._expression()
        self._take(";")
        step = self._effect()
        self._take(")")
        found = ("for", start, condition, step, self._branch())
        self.scopes.pop()
        return found

    def _read_if(self) -> Tree:
        self._take("(")
        condition = self._expression()
        self._take(")")
        then = self._branch()
        return ("if", condition, then, self._branch() if self._has("else") else ("block", []))

    def _branch(self, begins: bool = False) -> Tree:
        """Read a statement that is not a block: no declaration; or what a loop `begins` with: no other."""
        if self._declares() != begins:
            raise Unread(
                f"line {self.tokens[self.at][2]}: a declaration that is a branch, or none before a loop"
            )
        return self._statement()

    def _read_return(self) -> Tree:
        value = None if self._now == ";" else self._expression()
        self._take(";")
        return ("return", value)

    # ---- expressions ---------------------------------------------------------------------------------------

    def _expression(self) -> Tree:
        condition = self._binary(0)
        if not self._has("?"):
            return condition
        then = self._expression()
        self._take(":")
        return ("choice", condition, then, self._expression())

    def _binary(self, level: int) -> Tree:
        if level == len(BINARY):
            return self._unary()
        found = self._binary(level + 1)
        while self._now in BINARY[level] and self.tokens[self.at][0] == "sign":
            op = self._take()
            found = ("binary", op, found, self._binary(level + 1))
        return found

    def _unary(self) -> Tree:
        if self._now in ("-", "!", "&", "*"):
            op = self._take()
            return ("unary", op, self._unary())
        cast = self._cast()
        return self._postfix(self._primary()) if cast is None else cast

    def _cast(self) -> Tree | None:
        """Read `(type)value`, `(type){...}` or `(type)(a, b, ...)`."""
        at = self.at
        if not self._has("("):
            return None
        if not self._is_type():
            self.at = at
            return None
        _, type_ = self._qualified()
        if not self._has(")"):
            self.at = at
            return None
        if self._now == "{":
            return self._postfix(("cast", type_, self._value()))
        if type_.width > 1 and self._now == "(" and self.lists:
            self._take()
            values = self._values(")")
            return self._postfix(("cast", type_, values[0] if len(values) == 1 else ("list", values)))
        return ("cast", type_, self._unary())

    def _values(self, closing: str, sizes: bool = False) -> list[Tree]:
        """Read expressions up to a bracket; `sizes` of arrays too, which are counted without a sign."""
        found: list[Tree] = []
        while not self._has(closing):
            if found:
                self._take(",")
            size = sizes and self._has("sizeof")
            found.append(("sizeof", self._unary()) if size else self._expression())
        return found

    def _primary(self) -> Tree:
        kind, text, line = self.tokens[self.at]
        if kind == "number":
            if self.doubles and re.fullmatch(r"[\d.]*(\.|\d[eE])[\d.eE+-]*", text):
                raise Unread(f"line {line}: {text} of type double")
            return ("number", self._take())
        if kind == "name":
            name = self._take()
            name = f"{name}::{self._take()}" if self._has("::") else name
            shown = name in ("true", "false") or name in self.calls or any(name in s for s in self.scopes)
            if not shown or name == self._unset:
                raise Unread(f"line {line}: {name} is not declared")
            return ("name", name)
        if text == "(":
            self._take()
            found = self._expression()
            self._take(")")
            return found
        raise Unread(f"line {line}: {text!r}")

    def _postfix(self, found: Tree) -> Tree:
        while True:
            if self._has("("):
                found = ("call", found, self._values(")", found == ("name", "memcpy")))
            elif self._has("["):
                found = ("at", found, self._expression())
                self._take("]")
            elif self._has(".") or self._has("->"):
                found = ("of", found, self._take())
                if self.doubles and found[2] in "rgba":  # C and its children but Metal
                    raise Unread(f"line {self.tokens[self.at - 1][2]}: component {found[2]}")
            else:
                return found
