"""Expressions of a source [parse.py]."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from ..kernel.interface import IMAGE, RESULT, WEIGHTS
from ..kernel.kernel import FLOAT, INT, Expr, Type, const, load, name, parts, terms, total
from .grammar import BINARY, COMPARED, LANEWISE, PRODUCTS, SHIFTS
from .reader import OtherWeights, Reader, Unread


class Expressions(Reader):
    """Reads an expression: `_expression()`."""

    def placed(self, home: str, weights: Any) -> None:
        """Hold weights in a table of the source, or in a uniform block, against those of the file."""
        weights = np.asarray(weights, np.float32)
        parts, found = self.parts, {"table", "fours", "quads", "constant"} & {*self.parts}
        if len(found) != bool(home) or ("table" in found) != (home == "inline"):
            raise Unread("weights in another place than the manifest says")
        if found and ("argued" in parts or "weight_texture" in self.lines):
            raise Unread("weights in two places")
        vectors = -(-len(weights) // 4)
        for key, count in (("count", len(weights)), ("fours", vectors), ("quads", vectors)):
            if int(parts.get(key, count)) != count:
                raise OtherWeights(f"it has room for {parts[key]} weights, or vectors of 4, not {count}")
        self._read(parts.get("table", ""))
        numbers = []
        while self._now():
            numbers.append(self._expression())
            if self._now():
                self._take(",")
        floats = [each.value if (each.op, each.type) == ("const", FLOAT) else np.nan for each in numbers]
        values = np.array(floats, np.float32)
        if home == "inline" and values.tobytes() != weights.tobytes():
            raise OtherWeights("weights in its table are not those of weights.bin")

    def buffers(self) -> None:
        """Note the colour buffers of a fragment shader: several for more than four channels, in order."""
        count, buffers, cleared = -(-self.channels.get(RESULT, 1) // 4), "", ""
        if count > 1 and self.language.texels:
            self.results = [f"{RESULT}_{number}" for number in range(count)]
            buffers = "".join(
                f"layout(location = {n}) out vec4 {each};\n" for n, each in enumerate(self.results)
            )
            cleared = "".join(f"{each} = vec4(0.0, 0.0, 0.0, 1.0);\n" for each in self.results)
        if (self.parts.get("buffers", ""), self.parts.get("cleared", "")) != (buffers, cleared):
            raise Unread("other colour buffers than the result's channels fill")

    def _made(self, what: str, *args: Expr, value: Any = None) -> Expr:
        """Return an operation; a single value among vectors fills all lanes where the language lets it."""
        lanes, dtype = max(each.type.lanes for each in args), args[-1].type.dtype
        if lanes > 1 and not self._takes_lanes(what, *(each.type.lanes for each in args)):
            raise Unread(f"{what} of vectors and single values, or of vectors, which has no such form")
        if what != "select":
            args = tuple(Expr("splat", (a,), a.type.of(lanes)) if a.type.lanes < lanes else a for a in args)
        if what.startswith(("less", "greater", "equal", "not_", "logical")):
            dtype = "bool"
        return Expr(what, args, Type(value if what == "convert" else dtype, lanes), value)

    def _takes_lanes(self, what: str, first: int, *rest: int) -> bool:
        """Return whether an operation takes operands of so many lanes, one of them a vector."""
        language, alike = self.language, {first, *rest} == {first}
        if what == "logical_and":
            return False
        if what == "select":
            return rest[0] == rest[1] and first in (1, rest[0])
        if what in ("minimum", "maximum", "clamp"):
            splats = "float16" in language.types or not (language.casts or language.lets)
            return alike or (splats and first > 1 and {*rest} == {1})
        signs = BINARY if language.casts else BINARY[PRODUCTS - 1 :]
        return alike or (what != "remainder" and any(what in level.values() for level in signs))

    def _expression(self) -> Expr:
        """Read an expression."""
        condition = self._binary(0)
        if self.language.lets or not self._has("?"):
            return condition
        chosen = self._expression()
        self._check_vectors("?", chosen)
        if condition.type.lanes > 1 and not self.language.casts:
            raise Unread("a vector of conditions in front of ?")
        (other,) = self._form(": E")
        if condition.op in ("less", "greater") and condition.args == (chosen, other):
            return self._made("minimum" if condition.op == "less" else "maximum", other, chosen)
        return self._made("select", condition, chosen, other)

    def _binary(self, level: int) -> Expr:
        """Read operators of a level, from the left."""
        if level == len(BINARY):
            value, self.operator = self._unary(), ""
            return value
        value = self._binary(level + 1)
        while self._now() in BINARY[level]:
            first, sign = self.operator, self._take()
            other = self._binary(level + 1)
            product = sign == "*" and value.type.lanes > 1 and other.type == FLOAT and not self.by_calls
            self._check_vectors(sign, *(() if product else (value, other)))
            first_made = sign == "+" and other.type == INT and other.op in ("add", "subtract")
            if first_made and other != name("x") + name("p"):
                raise Unread("a sum of integers in brackets behind +, which is made first")
            if value.type.lanes > 1 and level < SHIFTS and not self.language.casts and not self.language.lets:
                raise Unread(f"{sign} of vectors, which have none")
            value = self._made(BINARY[level][sign], value, other)
            if self.language.lets and not binds(sign, first, self.operator):
                raise Unread(f"an operand of {sign} without brackets")
            self.operator = sign
        return value

    def _unary(self) -> Expr:
        """Read an operator of one operand, a conversion, or a value."""
        if self._has("-"):
            value = self._unary()
            self._check_vectors("-", value)
            return const(-value.value, value.type) if value.op == "const" else self._made("negative", value)
        if self.by_calls and self._has("*", "("):
            self._has("const")
            self._form("wamnet_vector * ) (")
            vector = self._vector()
            self._take(")")
            return vector
        if self.language.casts and self._now() == "(" and self._now(1) in self.types and self._now(2) == ")":
            (kind,) = self._form("( K )")
            if kind.lanes > 1 and self.language.makers:
                raise Unread("several values behind a cast, which is a comma here")
            if kind.lanes > 1:
                self._take("(")
                return self._filled_lanes(kind, self._arguments())
            return self._number(kind, self._unary())
        return self._primary()

    def _number(self, kind: Type, value: Expr) -> Expr:
        """Return a value as one of another kind, of as many lanes."""
        if value.type.lanes != kind.lanes:
            raise Unread(f"{value.type} as {kind}")
        return self._made("convert", value, value=kind.dtype)

    def _filled_lanes(self, kind: Type, values: list[Expr]) -> Expr:
        """Return a vector of values, or of one in all lanes; no cast makes a vector of another one."""
        if [value.type.lanes for value in values] == [kind.lanes] and not self.language.casts:
            return self._number(kind, *values)
        if len(values) not in (1, kind.lanes):
            raise Unread(f"{len(values)} values of {kind.lanes} lanes")
        return Expr("splat" if len(values) == 1 else "stack", tuple(values), kind)

    def _primary(self) -> Expr:
        """Read a number, a name, an element, a call, or an expression in parentheses."""
        kind, text = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        if kind in ("float", "integer"):
            self._take()
            if kind == "float":
                return self._float(text[:-1])
            whole, of = int(text.removesuffix("u")), Type("uint32") if text.endswith("u") else INT
            if whole >= 2 ** (32 if of != INT else 31):
                raise Unread(f"{text}, which {of.dtype} does not hold")
            return const(whole, of)
        if self.language.number and self._has("(", "(", *self.language.number):
            (array,) = self._form(") N )")
            return self._component(array, self._sizes())
        if self._has("("):
            value: Expr = self._form("E )")[0]
            return value
        if kind != "word":
            raise Unread(f"{text!r} is not a value")
        self._take()
        read = self._lanewise if text in LANEWISE else self._call
        return read(text) if self._has("(") else self._postfix(text)

    def _float(self, text: str) -> Expr:
        """Return a constant; its digits are so many that each reader finds the same float32."""
        exact, nearest = Fraction(text), np.float32(text)
        if not np.isfinite(nearest):
            raise Unread(f"{text}, which float32 does not hold")
        if 4 * abs(exact - Fraction(float(nearest))) > Fraction(float(np.spacing(abs(nearest)))):
            raise Unread(f"{text}, which is half-way between two float32")
        return const(float(nearest))

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
        if word == "CONVERT" or word.startswith(("convert_", "as_float")):
            return self._converted(word)
        values = self._arguments()
        if language.texels and word == WEIGHTS:
            return load(WEIGHTS, *values, kind=self.vector)
        if word in language.makers:
            return self._filled_lanes(language.makers[word], values)
        if word in self.functions:
            result = self.functions[word].result
            return Expr("call", tuple(values), result.type if result else FLOAT, word)
        if word in self.types and not language.casts and len(values) == 1:
            return self._number(self.types[word], *values)
        if word == ("select" if language.lets else "mix") and not language.casts and len(values) == 3:
            return self._mixed(*values)
        if word not in language.calls:
            raise Unread(f"{word} is not a function of the language's list")
        operation = language.calls[word]
        if operation in ("pack4", "bits"):
            return Expr(operation, tuple(values), INT if operation == "pack4" else FLOAT.of(4))
        if operation == "convert":
            return self._number(FLOAT.of(4), *values)
        self._check_vectors(word, *values)
        if word.startswith("f") and any(value.type.dtype != "float32" for value in values):
            raise Unread(f"{word} of integers")
        return self._made(operation, *values)

    def _lanewise(self, word: str) -> Expr:
        """Read an operation of C on vectors in an expression: of two, or of one and a single value."""
        kind = self.types["wamnet_vector"]
        if word == "wamnet_zero":
            self._take(")")
            return Expr("splat", (const(0.0),), kind)
        values = self._arguments()
        if [value.type for value in values] != [kind, FLOAT if word == "wamnet_scaled" else kind]:
            raise Unread(f"{word} of other values than it takes")
        return self._made(LANEWISE[word], *values)

    def _mixed(self, no: Expr, yes: Expr, where: Expr) -> Expr:
        """Return one of two values; GLSL takes a truth for each lane, in fragment shaders floats only."""
        lanes, language = where.type.lanes, self.language
        if not language.lets and (lanes != no.type.lanes or (language.texels and no.type.dtype != "float32")):
            raise Unread(f"mix of {no.type}")
        return self._made("select", where, yes, no)

    def _check_vectors(self, word: str, *values: Expr) -> None:
        """Refuse vectors where the language has only functions for them, or operators of few."""
        if word in COMPARED and values[0].type.lanes == 1:
            raise Unread(f"{word} of single values")
        bare = self.by_calls or not self.language.operators
        if bare and any(value.type.lanes > 1 for value in values):
            raise Unread(f"{word} of vectors, which have none")

    def _converted(self, word: str) -> Expr:
        """Read OpenCL's conversions of vectors, and integers' bits as floats: of words, or magnitudes."""
        lanes = word.removeprefix("as_float")
        if lanes != word and self._has(f"as_int{lanes}", "("):
            (value,) = self._form("E ) & 0x7fffffff )")
            return self._made("absolute", self._of(value, self._kind(f"float{lanes}"), word))
        if lanes != word:
            return Expr("bits", tuple(self._form("E )")), self._kind(f"float{lanes}"))
        value = self._expression()
        kind = self._kind(
            word.removeprefix("convert_") if word != "CONVERT" else self._take(",") and self._take()
        )
        self._take(")")
        if word == "CONVERT" and kind.lanes == 1:
            raise Unread("CONVERT of single values")
        return self._number(kind, value)

    def _texel(self) -> Expr:
        """Read a channel of a texture's pixel."""
        image, column, row = self._form("W , ivec2 ( E , E ) , 0 )")
        if self._has("."):
            part = self._take()
            if part not in ("rg", "rgb", "rgba"):
                raise Unread(f"part {part!r} of a texel")
            return load(image, row, column, kind=FLOAT.of(len(part)))
        (channel,) = self._form("[ E ]")
        return load(image, row, column, channel)

    def _postfix(self, word: str) -> Expr:
        """Read the index or the component behind a name."""
        if word in self.results and self.language.texels:
            (channel,) = self._form("[ E ]")
            if len(self.results) > 1:
                if channel.op != "const" or not 0 <= channel.value < 4:
                    raise Unread(f"a channel of {word} that is no number of one")
                channel = const(4 * self.results.index(word) + channel.value)
            return load(RESULT, name("y"), name("x"), channel)
        if word.startswith(IMAGE) or word == RESULT:
            return self._pixel(word, *self._form("[ E ]"))
        if word == WEIGHTS and "quads" in self.parts:
            index, lane = self._form("[ E ] [ E ]")
            halves = (
                self._made("divide", index.args[0], const(4)),
                self._made("remainder", index.args[0], const(4)),
            )
            if (index, lane) != halves:
                raise Unread("a component of a block at another index than its vector")
            return load(WEIGHTS, index.args[0])
        if word in (WEIGHTS, "w") and self._now() == "[":
            return load(WEIGHTS, *self._form("[ E ]"), kind=self.vector if word == "w" else FLOAT)
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
        if len(indices) == count + 1 and kind.lanes > 1 and not self.by_calls:
            place, lane = indices
            index = place.args[0] if place.args else place
            halves = self._made("divide", index, const(4)), self._made("remainder", index, const(4))
            if (place, lane) != halves:
                raise Unread(f"a component of {word} of another form")
            return self._component(word, [index])
        if len(indices) != count or (in_union and part not in ("all", "number")):
            raise Unread(f"{word} has {count} indices")
        kind = kind.of(1) if mixed and part != "all" else kind
        return self._lane(load(word, *indices, kind=kind))

    def _component(self, word: str, index: Sequence[Expr]) -> Expr:
        """Return a component of an array of vectors by its own index."""
        kind, count, _ = self.scope.arrays.get(word, (FLOAT, 0, False))
        if kind.lanes == 1 or count != 1 or len(index) != 1:
            raise Unread(f"{word} holds no vectors")
        return load(word, *index, kind=kind.of(1))

    def _pixel(self, image: str, place: Expr) -> Expr:
        """Return an element: `(row * width + column) * channels + c`."""
        first, *index = terms(place)
        if first[0].op != "multiply" or [sign for _, sign in index] != [1]:
            raise Unread(f"a place in {image} of another form")
        pixel, channels = first[0].args
        if (channels.op, channels.type) != ("const", INT):
            raise Unread(f"channels of {image} that are not an int")
        if self.channels.setdefault(image, channels.value) != channels.value:
            raise Unread(f"{image} has two numbers of channels")
        (row, _), *columns = terms(pixel)
        if row.op != "multiply" or row.args[1] != name("width"):
            raise Unread(f"a place in {image} without its row")
        if [sign for _, sign in columns] not in ([1], [1, 1]):
            raise Unread(f"a place in {image} without its column")
        if len(columns) > 1 and columns[0][0] != name("x"):
            raise Unread(f"a place in {image} with two columns")
        return load(image, row.args[0], total(columns), index[0][0])

    def _sizes(self) -> list[Expr]:
        """Read the sizes of an array."""
        sizes = []
        while self._now() == "[":
            sizes += self._form("[ E ]")
        return sizes

    def _of(self, value: Expr, kind: Type, key: str) -> Expr:
        """Return a value of a declared type; OpenCL's vectors of truths are declared as integers."""
        if value.type != kind and (
            value.type != Type("bool", kind.lanes) or kind.dtype != "int32" or kind.lanes == 1
        ):
            raise Unread(f"{key} of type {kind} has a value of type {value.type}")
        return value

    def _vector(self) -> Expr:
        """Read the address of a vector: `&name[...]`, or `name + index * LANES`."""
        if self._has("&"):
            self.pointer = self.scope.words.get(self._now(), "")
            return self._postfix(self._take())
        array, self.pointer = self._take(), "float"
        self._take("+")
        place = self._binary(PRODUCTS)
        if place.op != "multiply" or place.args[1] != name("LANES"):
            raise Unread(f"a place in {array} that is not a vector's")
        kind = self.vector if array == WEIGHTS else self.types["wamnet_vector"]
        if array != WEIGHTS and self.scope.arrays.get(array) != (kind, 1, True):
            raise Unread(f"{array} holds no vectors")
        return load(array, place.args[0], kind=kind)


def binds(sign: str, first: str, second: str) -> bool:
    """Return whether WGSL lets an operator have operands of these operators without brackets."""
    relations, sums = ("==", "!=", "<", ">", "<=", ">="), ("+", "-", "*", "/", "%")
    if sign == "&&":
        inner: tuple[str, ...] = (*relations, *sums, ">>")
    elif sign in relations:
        inner = (*sums, ">>")
    else:
        inner = sums if sign in sums else ()
    again = (sign,) if sign in ("&&", "&", "^") else ()
    return first in (*inner, *again, "") and second in (*inner, "")


ROUNDING = ("add", "subtract", "multiply", "divide", "minimum", "maximum", "floor")
"""Operations whose order GLSL keeps only where their value is declared so."""


def rounds(value: Expr, kept: bool = True) -> bool:
    """Return whether there is a sum, a product, or a function of numbers anywhere in a value.

    One by itself has no order where the value is not `kept` by the item, but written for another launch.
    """
    if value.op == "stack" and not kept:
        return any(_rounded(each) > 1 for each in value.args)
    return _rounded(value) > 0


def _rounded(value: Expr) -> int:
    """Return how many operations of a value are of floats and have an order."""
    return sum(part.op in ROUNDING and part.type.dtype == "float32" for part in parts(value))
