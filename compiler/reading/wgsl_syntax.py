"""The parser of WGSL: expressions and most statements are those of syntax.py, declarations are its own."""

from __future__ import annotations

from typing import Any

from .lanes import Unread
from .syntax import SCALARS, Parser, Tree, constant
from .tokens import Type, Variable

MADE = {"float32": "vec4", "int32": "ivec4", "uint32": "uvec4"}
"""Functions that make vectors of four, by the kind of number."""

ARITHMETIC, RELATIONS = {"+", "-", "*", "/", "%"}, {"==", "!=", "<", ">", "<=", ">="}
"""Operators of WGSL that may be in an operand of some others without brackets."""

SEEN = {"float32": "as_float", "int32": "as_int", "uint32": "as_uint"}
"""Functions that take bits for another kind's, by that kind."""


class WgslParser(Parser):
    """Reads one text of WGSL."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._brackets: set[int] = set()

    def _outside(self) -> None:
        binding = self._attributes()
        word = self._take()
        if word == "struct":
            name = self._take()
            self.text.structs[name] = self._members_of("{", "}")
            self._has(";")
        elif word in ("var", "const"):
            self.at -= 1
            self.text.outside.append(self._declare()[1:])
            if binding >= 0:
                self.text.bindings[self.text.outside[-1][0].name] = binding
        elif word == "requires":
            self.at += 2
        elif word == "fn":
            name = self._take()
            self.scopes.append(set())
            takes = self._members_of("(", ")")
            for variable in takes:
                self._declared(variable.name, fixed=True)
            type_ = self._type() if self._has("->") else Type("void")
            self._function(name, takes, type_)
        elif word != ";":
            raise Unread(f"line {self.tokens[self.at - 1][2]}: {word!r}")

    def _attributes(self) -> int:
        """Read the attributes of a declaration; return its binding, -1 without one."""
        binding = -1
        while self._has("@"):
            name = self._take()
            if self._has("("):
                values = self._values(")")
                if name == "workgroup_size":
                    self.text.group = values
                if name == "binding":
                    binding = constant(values[0])
        return binding

    def _members_of(self, opening: str, closing: str) -> list[Variable]:
        """Read names with types between brackets."""
        self._take(opening)
        found = []
        while not self._has(closing):
            role = ""
            while self._has("@"):
                self._take()
                if self._now == "(":
                    role = self._ahead()
                    self._skip_brackets("(", ")")
            found.append(self._typed(self._take()))
            found[-1].role = role
            self._has(",")
        return found

    def _typed(self, name: str, shared: bool = False) -> Variable:
        """Read `: type`, if there is one; sizes of arrays belong to the variable."""
        found = Variable(name, Type("auto"), shared=shared)
        if self._has(":"):
            found.type = self._sized(found.sizes)
        return found

    def _sized(self, sizes: list[Any]) -> Type:
        if self._now != "array":
            return self._type()
        self._take()
        self._take("<")
        inner: list[Any] = []
        element = self._sized(inner)
        sizes += [self._binary(8) if self._has(",") else None, *inner]
        self._close()
        return element

    def _type(self) -> Type:
        name = self._take()
        if name in ("vec3", "vec4") and self._has("<"):
            inner = self._type()
            self._close()
            return Type(inner.kind, int(name[3]))
        if name in SCALARS or name in self.types:
            return self.types[name]
        if name in self.text.structs:
            return Type(name)
        raise Unread(f"line {self.tokens[self.at - 1][2]}: type {name!r}")

    def _expression(self) -> Tree:
        return self._binary(0)

    def _binary(self, level: int) -> Tree:
        """Read an expression; operators that bind in no stated order need brackets."""
        found = super()._binary(level)
        if found[0] == "binary":
            for n, operand in enumerate(found[2:]):
                if operand[0] == "binary" and id(operand) not in self._brackets:
                    own = {found[1]} if n == 0 and found[1] in ("&&", "||", "&", "|", "^") else set[str]()
                    least = RELATIONS | ARITHMETIC if found[1] in ("&&", "||") else ARITHMETIC
                    shifts = {"<<", ">>"} if found[1] in RELATIONS | {"&&", "||"} else set[str]()
                    inner = own if found[1] in ("&", "|", "^", "<<", ">>") else own | least | shifts
                    if operand[1] not in inner:
                        raise Unread(f"{operand[1]} in an operand of {found[1]} without brackets")
        return found

    def _effect(self) -> Tree:
        if self._now in ("++", "--"):
            raise Unread(f"line {self.tokens[self.at][2]}: {self._now} before a name")
        found = super()._effect()
        if found[0] == "call" and found[1][1] in self.calls and "arrier" not in found[1][1]:
            raise Unread(f"line {self.tokens[self.at][2]}: the value of {found[1][1]} is not used")
        return found

    def _read_for(self) -> Tree:
        return self._braced(super()._read_for())

    def _read_if(self) -> Tree:
        found = super()._read_if()
        self._braced(found[:3])
        return found if found[3][0] == "if" else self._braced(found)

    def _braced(self, found: Tree) -> Tree:
        """Return a statement whose last part is a block."""
        if found[-1][0] != "block":
            raise Unread(f"line {self.tokens[self.at][2]}: a statement without braces")
        return found

    def _close(self) -> None:
        """Take `>`, of `>>` the first."""
        kind, text, line = self.tokens[self.at]
        if text == ">>":
            self.tokens[self.at] = (kind, ">", line)
        else:
            self._take(">")

    def _declares(self) -> bool:
        return self._now in ("var", "let", "const")

    def _declare(self) -> Tree:
        word = self._take()
        shared = False
        if self._inside and word == "const":
            raise Unread(f"line {self.tokens[self.at][2]}: a const in a function")
        if not self._inside and self._has("<"):
            while not self._has(">"):
                shared |= self._take() == "workgroup"
        variable = self._typed(self._declared(self._take(), word != "var"), shared)
        self._unset = variable.name
        value = self._expression() if self._has("=") else None
        self._unset = ""
        self._take(";")
        return ("declare", variable, value)

    def _is_type(self) -> bool:
        return False

    def _primary(self) -> Tree:
        """Read `vec4<f32>` as the name of the function that makes one, and `bitcast<f32>` of its own."""
        if self._now in ("vec4", "bitcast") and self._ahead() == "<":
            line, made = self.tokens[self.at][2], MADE if self._now == "vec4" else SEEN
            if made is SEEN:
                self._take()
                self._take("<")
            found = self._type()
            if made is SEEN:
                self._close()
            if found.kind not in made or found.width != (4 if made is MADE else found.width):
                raise Unread(f"line {line}: vectors of other numbers")
            return ("name", made[found.kind])
        number = self.tokens[self.at][0] == "number" and self._now[:2].lower() != "0x"
        if self._now[-1:] == "U" or (number and self._now[-1] == "F"):
            raise Unread(f"line {self.tokens[self.at][2]}: {self._now}: suffixes are lower case")
        bracket = self._now == "("
        made_of = super()._primary()
        self._brackets |= {id(made_of)} if bracket else set()
        return made_of
