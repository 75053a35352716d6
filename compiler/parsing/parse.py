"""From a source back to the kernel that it is, or a refusal: the inverse of the renderer, written apart.

1. What surrounds the statements is compared word for word [frames.py]; statements and expressions have the
   closed grammar below, in which each language has few words of its own [grammar.py].
2. A kernel that was read is in canonical form [canonical.py], and is verified.
3. Nothing is guessed: a name without declaration, a call that is not in the language's list, a number that is
   written in another way raise an `Unread`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.ir import Image
from ..kernel.interface import BUFFER, IMAGE, RESULT, WEIGHTS, denoiser
from ..kernel.kernel import (
    FLOAT,
    INT,
    Array,
    Barrier,
    Block,
    Body,
    Constant,
    Expr,
    For,
    If,
    Kernel,
    Let,
    Statement,
    Store,
    Type,
    const,
    load,
    name,
)
from ..kernel.verify import KernelError, verify
from .canonical import canonical, terms
from .frames import frame, lines_of
from .grammar import BINARY, CONSTANT, LANGUAGES, PRODUCTS, TOKEN, Language


class Unread(Exception):
    """A source that this grammar does not have."""


def parse(source: str, language: str, channels: Mapping[str, int] | None = None) -> Kernel:
    """Return the canonical kernel of a source.

    `channels` of the images and of the result by name, where the source does not state them: of textures.
    """
    if re.search(r"[^\n -~]|\?\?", source):
        raise Unread("a character beyond printable ASCII, or a trigraph")
    match = frame(language).fullmatch(lines_of(source))
    if match is None:
        raise Unread(f"what surrounds the statements is not a frame of {language}")
    parser = Parser(LANGUAGES[language], match.groupdict(), dict(channels or {}))
    try:
        kernel = canonical(parser.kernel())
        verify(kernel)
    except (KernelError, RecursionError) as error:
        raise Unread(str(error)) from error
    return kernel


@dataclass
class Scope:
    """The names of values and of arrays: their types, numbers of indices, whether components are read too."""

    values: dict[str, Type] = field(default_factory=dict)
    arrays: dict[str, tuple[Type, int, bool]] = field(default_factory=dict)


class Parser:
    """Reads one source: `kernel()`."""

    def __init__(self, language: Language, parts: Mapping[str, str | None], channels: dict[str, int]) -> None:
        self.language, self.parts, self.channels = language, parts, channels
        self.types, self.vector = dict(language.types), FLOAT
        self.scope = Scope(dict.fromkeys(("x", "y", "width", "height"), INT))
        self.tokens: list[tuple[str, str]] = []
        self.at = 0

    # ---- the whole ---------------------------------------------------------------------------------------

    def kernel(self) -> Kernel:
        """Return the kernel, not yet in canonical form."""
        parts = self.parts
        images = self._images(parts["images"] or "")
        constants = tuple(map(self._constant, (parts["constants"] or "").splitlines()))
        lanes = {each.name: each.value for each in constants}.get("LANES")
        if parts.get("lanes"):
            self.vector = FLOAT.of(int(parts["lanes"] or 0))
        elif lanes is not None and "wamnet_vector" in (parts["body"] or ""):
            self.vector = self.types["wamnet_vector"] = FLOAT.of(int(lanes.value))
        self._read(parts["body"] or "")
        body = self._body(end="")
        scale = parts.get("step")
        step = (name(scale) if scale else const(1), const(1))
        missing = [key for key in (*images, RESULT) if key not in self.channels]
        if missing:
            raise Unread(f"the channels of {missing[0]} are not stated")
        declared = [Image(key.removeprefix(IMAGE), self.channels[key], -np.inf, np.inf) for key in images]
        interface = denoiser(declared, 0, self.channels[RESULT], BUFFER, ())
        return Kernel(interface, body, constants, step=step, weights=self.vector)

    def _images(self, text: str) -> list[str]:
        """Return the names of the images: numbers count up from 3, and the order is everywhere the same."""
        images = [line[-1] for line in (re.findall(r"\bimage_\w+", line) for line in text.splitlines())]
        numbers = [int(each) for each in re.findall(r"(?:buffer\(|binding = |binding\()(\d+)", text)]
        given = self.parts.get("given")
        listed = given is None or given == "".join(f"{image}, " for image in images)
        if numbers not in ([], [*range(3, 3 + len(images))]) or len(set(images)) < len(images) or not listed:
            raise Unread("images in two orders, or with other numbers")
        if (first := self.parts.get("first")) and first != images[0]:
            raise Unread(f"a size of {first}, which is not the first image")
        return images

    def _constant(self, line: str) -> Constant:
        """Return a named integer: of a macro whose text is one number or in parentheses."""
        match = re.fullmatch(r"#define (\w+) (\d+|\(.*\))|const (\w+): i32 = (\d+|\(.*\));", line)
        key = match and (match[1] or match[3])
        if match is None or not CONSTANT.fullmatch(str(key)):
            raise Unread(f"{line!r} is not a constant")
        self._read(match[2] or match[4])
        value = self._expression()
        self._end()
        self.scope.values[str(key)] = INT
        return Constant(str(key), value)

    def _read(self, text: str) -> None:
        """Begin to read the tokens of a text."""
        self.tokens, self.at, at = [], 0, 0
        while at < len(text):
            match = TOKEN.match(text, at)
            if match is None:
                raise Unread(f"{text[at : at + 20]!r} begins with no token")
            if match.lastgroup:
                self.tokens.append((match.lastgroup, match[0].strip()))
            at = match.end()

    # ---- tokens ------------------------------------------------------------------------------------------

    def _now(self, ahead: int = 0) -> str:
        """Return a token, or nothing at the end."""
        return self.tokens[self.at + ahead][1] if self.at + ahead < len(self.tokens) else ""

    def _take(self, *texts: str) -> str:
        """Take these tokens, or any one; return the last."""
        for text in texts or (self._now(),):
            if self._now() != text or not text:
                raise Unread(f"{' '.join(t for _, t in self.tokens[self.at : self.at + 6])!r}: no {text!r}")
            self.at += 1
        return self.tokens[self.at - 1][1]

    def _has(self, *texts: str) -> bool:
        """Take these tokens if they are there."""
        there = all(self._now(k) == text for k, text in enumerate(texts))
        self.at += len(texts) * there
        return there

    def _end(self) -> None:
        """Refuse further tokens."""
        if self._now():
            raise Unread(f"{self._now()!r} where nothing follows")

    def _word(self) -> str:
        """Take a name that is not a type, function or array of the interface."""
        kind = self.tokens[self.at][0] if self.at < len(self.tokens) else ""
        word = self._take()
        taken = word in self.types or word in self.language.calls or word in (WEIGHTS, RESULT, "w", "select")
        if kind != "word" or taken or word.startswith((IMAGE, "wamnet_", "gl_", "as_", "convert_")):
            raise Unread(f"{word!r} is not a name of a value")
        return word

    # ---- statements --------------------------------------------------------------------------------------

    def _body(self, end: str = "}") -> Body:
        """Read statements up to a brace, or to the end; their names end there."""
        outer = self.scope
        self.scope = Scope(dict(outer.values), dict(outer.arrays))
        statements: list[Statement] = []
        while self._now() != end:
            statements.append(self._statement())
        if end:
            self._take(end)
        self.scope = outer
        return tuple(statements)

    def _statement(self) -> Statement:
        """Read a statement."""
        if self.at < len(self.tokens) and self.tokens[self.at][0] == "unroll":
            self.at += 1
            if self._now() != "for":
                raise Unread("an unrolled statement that is not a loop")
        if self._has("{"):
            return Block(self._body())
        if self._has("for", "("):
            return self._for()
        if self._has("if", "("):
            condition = self._expression()
            self._take(")", "{")
            body = self._body()
            return If(condition, body, self._body() if self._has("else", "{") else ())
        if self.language.barrier and self._now() == re.split(r"\W", self.language.barrier)[0]:
            words = re.findall(r"[\w:]+|\W", self.language.barrier)
            self._take(*words, ";")
            return Barrier()
        statement = self._declaration() or self._vector_call() or self._assignment()
        self._take(";")
        return statement

    def _for(self) -> For:
        """Read a counted loop."""
        self._take("var" if self.language.lets else "int")
        counter = self._word()
        if self.language.lets:
            self._take(":", "i32")
        self._take("=")
        start = self._expression()
        outer = self.scope
        self.scope = Scope({**outer.values, counter: INT}, dict(outer.arrays))
        self._take(";")
        condition, until = self._expression(), None
        if condition.op == "logical_and":
            condition, until = condition.args
        if condition.op != "less" or condition.args[0] != name(counter):
            raise Unread(f"the loop over {counter} has another condition")
        self._take(";")
        step = const(1)
        if self.language.lets and self._now(1) == "++":
            self._take(counter, "++")
        elif not self._has("++", counter):
            self._take(counter, "+=")
            step = self._expression()
        self._take(")", "{")
        body = self._body()
        self.scope = outer
        return For(counter, condition.args[1], body, start=start, step=step, until=until)

    def _declaration(self) -> Statement | None:
        """Read a declaration, if there is one."""
        if self.language.lets:
            return self._declaration_of_wgsl()
        if self._has("union", "{"):
            return self._union()
        qualified = bool(self.language.qualifier) and self._has(self.language.qualifier)
        if self._now() not in self.types or self._now(1) == "(":
            if qualified:
                raise Unread(f"{self.language.qualifier} without a declaration")
            return None
        kind = self.types[self._take()]
        key = self._word()
        sizes = self._sizes()
        if not sizes and self._has(";"):  # a vector of C, which a call sets
            return self._filled(key, kind)
        if sizes or self._now() == ";":
            return self._array(key, kind, sizes)
        self._take("=")
        value = self._of(self._expression(), kind, key)
        self.scope.values[key] = kind
        return Let(key, value)

    def _sizes(self) -> list[Expr]:
        """Read the sizes of an array."""
        sizes = []
        while self._has("["):
            sizes.append(self._expression())
            self._take("]")
        return sizes

    def _array(self, key: str, kind: Type, sizes: list[Expr], mixed: bool = False) -> Array:
        """Return an array; in C one of floats of LANES times a count holds vectors."""
        if "wamnet_vector" in self.types and len(sizes) == 1 and kind == FLOAT:
            size = sizes[0]
            if size.op == "multiply" and size.args[1] == name("LANES"):
                kind, sizes, mixed = self.vector, [size.args[0]], True
        self.scope.arrays[key] = (kind, len(sizes), mixed)
        self.scope.values.pop(key, None)
        return Array(key, kind, tuple(sizes))

    def _filled(self, key: str, kind: Type) -> Statement:
        """Read the call that sets a vector of C, or return a variable without a first value."""
        self.at -= 1
        if kind.lanes == 1:
            return self._array(key, kind, [])
        self._take(";")
        self.scope.arrays[key] = (kind, 0, False)
        statement = self._vector_call()
        if not isinstance(statement, Store) or statement.array != key or statement.add:
            raise Unread(f"{key} is not set where it is declared")
        del self.scope.arrays[key]
        self.scope.values[key] = kind
        return Let(key, statement.value)

    def _union(self) -> Array:
        """Read an array of vectors of OpenCL whose components are read by their own index."""
        vector = self.types.get(self._take(), INT)
        self._take("all", "[")
        count = self._expression()
        self._take("]", ";", "float", "number", "[")
        numbers = self._expression()
        self._take("]", ";", "}")
        if numbers != self._made("multiply", count, const(vector.lanes)):
            raise Unread("a union of two sizes")
        return self._array(self._word(), vector, [count], True)

    def _declaration_of_wgsl(self) -> Statement | None:
        """Read a declaration of WGSL, if there is one."""
        if self._now() not in ("let", "var"):
            return None
        fixed = self._take() == "let"
        key = self._word()
        self._take(":")
        sizes: list[Expr] = []
        kind = self._sized(sizes)
        if self._has("="):
            value = self._of(self._expression(), kind, key)
            self.scope.values[key] = kind
            return Let(key, value) if fixed else Array(key, kind, value=value)
        if fixed:
            raise Unread(f"{key} has no value")
        return self._array(key, kind, sizes)

    def _sized(self, sizes: list[Expr]) -> Type:
        """Read a type of WGSL, and collect the sizes of an array."""
        if not self._has("array", "<"):
            word = self._take()
            if word not in self.types:
                raise Unread(f"{word!r} is not a type")
            return self.types[word]
        kind = self._sized(sizes)
        self._take(",")
        sizes.insert(0, self._binary(PRODUCTS - 1))
        self._take(">")
        return kind

    def _assignment(self) -> Store:
        """Read an assignment."""
        target = self._postfix(self._take())
        sign = self._take()
        if sign not in ("=", "+=", "-="):
            raise Unread(f"{sign!r} is not a assignment")
        if target.op == "name":
            target = Expr("load", (), target.type, target.value)
        if target.op != "load" or target.value == WEIGHTS or target.value.startswith(IMAGE):
            raise Unread("an assignment to no element")
        value = self._of(self._expression(), target.type, target.value)
        value = self._made("negative", value) if sign == "-=" else value
        return Store(target.value, target.args, value, sign != "=")

    def _of(self, value: Expr, kind: Type, key: str) -> Expr:
        """Return a value of a declared type; an operator's single value fills all lanes."""
        if value.type != kind:
            raise Unread(f"{key} of type {kind} has a value of type {value.type}")
        return value

    # ---- vectors of C ------------------------------------------------------------------------------------

    def _vector_call(self) -> Statement | None:
        """Read a call of one of C's functions on vectors, if there is one."""
        if "wamnet_vector" not in self.types or not self._now().startswith("wamnet_"):
            return None
        call = self._take().removeprefix("wamnet_")
        self._take("(")
        target = self._vector()
        if target.op != "load":
            raise Unread("a call that sets a value which never changes")
        values = [self._vector()] if self._has(",") else []
        values += [self._expression()] if self._has(",") else []
        self._take(")")
        if call == "clear" and not values:
            value = Expr("splat", (const(0.0),), self.vector)
        elif call == "add_product" and len(values) == 2:
            value = self._made("multiply", *values)
        elif call in ("load", "store", "add") and len(values) == 1:
            value = values[0]
        else:
            raise Unread(f"wamnet_{call} of {len(values)} values")
        value = self._of(value, self.vector, target.value)
        return Store(target.value, target.args, value, call.startswith("add"))

    def _vector(self) -> Expr:
        """Read the address of a vector: `&name[...]`, or `name + index * LANES`."""
        if self._has("&"):
            return self._postfix(self._take())
        array = self._take()
        self._take("+")
        place = self._binary(PRODUCTS)
        if place.op != "multiply" or place.args[1] != name("LANES"):
            raise Unread(f"a place in {array} that is not a vector's")
        if array != WEIGHTS and self.scope.arrays.get(array) != (self.vector, 1, True):
            raise Unread(f"{array} holds no vectors")
        return load(array, place.args[0], kind=self.vector)

    # ---- expressions -------------------------------------------------------------------------------------

    def _made(self, what: str, *args: Expr, value: Any = None) -> Expr:
        """Return an operation; a single value among vectors fills all lanes."""
        lanes = max((each.type.lanes for each in args), default=1)
        if not (what == "select" and args[0].type.lanes == 1):
            args = tuple(Expr("splat", (a,), a.type.of(lanes)) if a.type.lanes < lanes else a for a in args)
        dtype = args[-1].type.dtype
        if what.startswith(("less", "greater", "equal", "not_", "logical")):
            dtype = "bool"
        return Expr(what, args, Type(value if what == "convert" else dtype, lanes), value)

    def _expression(self) -> Expr:
        """Read an expression."""
        condition = self._binary(0)
        if self.language.lets or not self._has("?"):
            return condition
        chosen = self._expression()
        self._take(":")
        return self._made("select", condition, chosen, self._expression())

    def _binary(self, level: int) -> Expr:
        """Read operators of a level, from the left."""
        if level == len(BINARY):
            return self._unary()
        value = self._binary(level + 1)
        while self._now() in BINARY[level]:
            value = self._made(BINARY[level][self._take()], value, self._binary(level + 1))
        return value

    def _unary(self) -> Expr:
        """Read an operator of one operand, a conversion, or a value."""
        if self._has("-"):
            return self._made("negative", self._unary())
        if self._has("!"):
            return self._made("logical_not", self._unary())
        if self.language.casts and self._now() == "(" and self._now(1) in self.types and self._now(2) == ")":
            self._take("(")
            kind = self.types[self._take()]
            self._take(")")
            if kind.lanes > 1:
                self._take("(")
                return self._filled_lanes(kind, self._arguments())
            return self._made("convert", self._unary(), value=kind.dtype)
        return self._primary()

    def _filled_lanes(self, kind: Type, values: list[Expr]) -> Expr:
        """Return a vector of values, or of one in all lanes."""
        if len(values) not in (1, kind.lanes):
            raise Unread(f"{len(values)} values of {kind.lanes} lanes")
        return Expr("splat" if len(values) == 1 else "stack", tuple(values), kind)

    def _primary(self) -> Expr:
        """Read a number, a name, an element, a call, or an expression in parentheses."""
        kind, text = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        if kind in ("float", "integer"):
            self._take()
            if kind == "float":
                return const(float(np.float32(text[:-1])))
            return const(int(text.removesuffix("u")), Type("uint32") if text.endswith("u") else INT)
        if self._has("("):
            value = self._expression()
            self._take(")")
            return value
        if text in ("true", "false"):
            return const(self._take() == "true")
        if kind != "word":
            raise Unread(f"{text!r} is not a value")
        self._take()
        return self._call(text) if self._has("(") else self._postfix(text)

    def _arguments(self) -> list[Expr]:
        """Read the arguments of a call, behind its parenthesis."""
        values = [self._expression()]
        while self._has(","):
            values.append(self._expression())
        self._take(")")
        return values

    def _call(self, word: str) -> Expr:
        """Read a call of a function of the language."""
        language = self.language
        if language.texels and word == "texelFetch":
            return self._texel()
        if language.texels and word == WEIGHTS:
            return load(WEIGHTS, *self._arguments())
        if match := re.fullmatch(r"as_float(\d+)", word):
            self._take(f"as_int{match[1]}", "(")
            value = self._expression()
            self._take(")", "&", "0x7fffffff", ")")
            return self._made("absolute", value)
        if word == "CONVERT" or word.startswith("convert_"):
            value = self._expression()
            kind = self.types.get(word.removeprefix("convert_")) if word != "CONVERT" else None
            if word == "CONVERT":
                self._take(",")
                kind = self.types.get(self._take().rstrip("0123456789"))
            self._take(")")
            if kind is None:
                raise Unread(f"{word} to no type")
            return self._made("convert", value, value=kind.dtype)
        values = self._arguments()
        if word in self.types and not language.casts and len(values) == 1:
            return self._made("convert", *values, value=self.types[word].dtype)
        if word == "select" and language.lets and len(values) == 3:
            return self._made("select", values[2], values[1], values[0])
        if word not in language.calls:
            raise Unread(f"{word} is not a function of the language's list")
        return self._made(language.calls[word], *values)

    def _texel(self) -> Expr:
        """Read a channel of a texture's pixel."""
        image = self._take()
        self._take(",", "ivec2", "(")
        column = self._expression()
        self._take(",")
        row = self._expression()
        self._take(")", ",", "0", ")", "[")
        channel = self._expression()
        self._take("]")
        return load(image, row, column, channel)

    def _postfix(self, word: str) -> Expr:
        """Read the index or the component behind a name."""
        if word == RESULT and self.language.texels:
            self._take("[")
            channel = self._expression()
            self._take("]")
            return load(RESULT, name("y"), name("x"), channel)
        if word.startswith(IMAGE) or word == RESULT:
            self._take("[")
            place = self._expression()
            self._take("]")
            return self._pixel(word, place)
        if word in (WEIGHTS, "w") and self._has("["):
            place = self._expression()
            self._take("]")
            return load(WEIGHTS, place, kind=self.vector if word == "w" else FLOAT)
        if word in self.scope.arrays:
            return self._element(word)
        if word not in self.scope.values:
            raise Unread(f"{word} is not declared")
        value = name(word, self.scope.values[word])
        return self._lane(value)

    def _lane(self, value: Expr) -> Expr:
        """Read the component of a vector, if there is one."""
        if not self._has("."):
            return value
        lane = self._take()
        if lane not in tuple("xyzw"):
            raise Unread(f"component {lane!r}")
        return value.lane("xyzw".index(lane))

    def _element(self, word: str) -> Expr:
        """Read the index of an element of an array, or of a component of its vectors."""
        kind, count, mixed = self.scope.arrays[word]
        in_union = mixed and "wamnet_vector" not in self.types
        part = self._take(".") and self._take() if in_union else ""
        indices = self._sizes()
        if len(indices) != count or (in_union and part not in ("all", "number")):
            raise Unread(f"{word} has {count} indices")
        kind = kind.of(1) if mixed and part != "all" else kind
        return self._lane(load(word, *indices, kind=kind))

    def _pixel(self, image: str, place: Expr) -> Expr:
        """Return an element: `(row * width + column) * channels + c`."""
        first, *rest = terms(place)
        if first[0].op != "multiply" or not rest or rest[0][1] < 0:
            raise Unread(f"a place in {image} of another form")
        pixel, channels = first[0].args
        index = rest[0][0]
        for value, sign in rest[1:]:
            index = Expr("add" if sign > 0 else "subtract", (index, value), INT)
        if channels.op != "const" or self.channels.setdefault(image, channels.value) != channels.value:
            raise Unread(f"{image} has two numbers of channels")
        (row, _), *columns = terms(pixel)
        if row.op != "multiply" or row.args[1] != name("width"):
            raise Unread(f"a place in {image} without its row")
        if not columns:
            raise Unread(f"a place in {image} without its column")
        column = columns[0][0]
        if columns[0][1] < 0:
            raise Unread(f"a place in {image} left of its row")
        for value, sign in columns[1:]:
            column = Expr("add" if sign > 0 else "subtract", (column, value), INT)
        return load(image, row.args[0], column, index)
