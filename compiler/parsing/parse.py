"""From a source back to the kernel that it is, or a refusal: the inverse of the renderer, written apart.

1. What surrounds the statements is compared word for word [frames.py]; statements and expressions have the
   closed grammar below, in which each language has few words of its own [grammar.py].
2. A kernel that was read is verified.
3. Nothing is guessed: a name without declaration, a call that is not in the language's list, a number that is
   written in another way raise an `Unread`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import accumulate
from types import SimpleNamespace
from typing import Any, Literal

from ..kernel import kernel as tree
from ..kernel.interface import IMAGE, RESULT, WEIGHTS, denoiser
from ..kernel.verify import KernelError, verify
from .expressions import Expressions, rounds
from .frames import COMMENT, FRAMES, frame, lines_of, parts_of
from .grammar import CALLS, CONSTANT, FUNCTION, LANGUAGES, PRODUCTS
from .launches import batch, launches
from .reader import Passes, Scope
from .reader import Unread as Unread

Space = Literal["item", "group"]

LAYER = re.compile(r"v\d+(_\d+)*")
"""Sums of a layer: products with weights, which may be added in any order [PRO-6b]."""

STRANGE = re.compile(r"//|\\(?!\n *[^\s/])")
"""A comment up to the end of a line, and a backslash that no line follows."""

DEEPEST = 60
"""Most blocks in each other: WGSL's compilers take 127."""

WORD = re.compile(r"(?<!\.)\b(?:wamnet_\w+|DOT|FLOOR|CONVERT|WAMNET_\w+|w|weights)\b(?:(?<=weights)\()?")
"""What the frame of a source defines, where its statements use it."""

NESTED = re.compile(r"(?<=.)/\*|\\", re.S)
"""What makes another comment of a comment."""


def parse(
    source: str,
    language: str,
    channels: Mapping[str, int] | None = None,
    bounded: bool = False,
    passes: Passes | None = None,
    weights: Any = (),
) -> tree.Kernel:
    """Return the kernel of a source.

    `channels` of the images and of the result by name, where the source does not state them: of textures.
    `bounded`: it must say what an error bound rests on, where its language lets it. `passes`: what a manifest
    says of launches. `weights`: those of the file, which a table in the source repeats.

    Raises `Unread` for a text that it cannot read, and `OtherWeights` for a table of others.
    """
    language, _, home = language.partition(":")
    if re.search(r"[^\n -~]|\?\?", source):
        raise Unread("a character beyond printable ASCII, or a trigraph")
    if language == "glsl-es" and not source.startswith("#version"):
        raise Unread("a source that does not begin with its version")
    if found := STRANGE.search(source) or next(filter(NESTED.search, COMMENT.findall(source)), None):
        raise Unread(f"{found if isinstance(found, str) else found[0]!r}, which languages read differently")
    lines = lines_of(source)
    if lines.count("weight_texture") == 1:
        raise Unread("a texture of weights that is declared and not read, or read and not declared")
    match = frame(language).fullmatch(lines)
    parts = match and parts_of(match)
    if parts is None:
        raise Unread(f"what surrounds the statements is not a frame of {language}")
    if bounded and "@bounded@" in FRAMES[language] and "bounded" not in parts:
        raise Unread("a source that does not refuse compilers which void its bound")
    own = parts.get("functions", "") + (parts.get("body") or "") + parts.get("launches", "")
    if ("launches" in parts) != (passes is not None):
        raise Unread("a source in passes of which its manifest says nothing, or the other way round")
    if undefined := set(WORD.findall(own)) - _made(own, lines, parts):
        raise Unread(f"{undefined.pop()}, which nothing defines")
    if (
        re.search(r"(?m)^.+#pragma|#pragma (?!unroll$)", own)
        or (language != "opencl" and "#pragma" in own)
        or ((language != "opengl" or not {"shared", "launches"} & {*parts}) and "imageStore" in own)
    ):
        raise Unread(f"a word that {language} does not have")
    parser = Parser(LANGUAGES[language], parts, dict(channels or {}))
    parser.bounded, parser.passes, parser.lines = bounded, passes, lines
    try:
        parser.placed(home, weights)
        kernel = parser.kernel()
        verify(kernel)
    except (KernelError, RecursionError) as error:
        raise Unread(str(error)) from error
    return kernel


def _made(own: str, lines: str, parts: Mapping[str, str]) -> set[str]:
    """Return the words of a frame that a source has, apart from its functions and statements `own`."""
    around = lines
    for each in ("functions", "body", "launches"):
        around = around.replace(parts.get(each) or "\0", "")
    functions = set(re.findall(r"\b(wamnet_\w+)\([^;{}]*\)\s*\{", own))
    return set(WORD.findall(around)) | functions


class Parser(Expressions):
    """Reads one source: `kernel()`."""

    # ---- the whole ---------------------------------------------------------------------------------------

    def kernel(self) -> tree.Kernel:
        """Return the kernel."""
        parts = self.parts
        images = self._images(parts["images"])
        constants = tuple(map(self._constant, parts.get("constants", "").splitlines()))
        known = {each.name: each.value for each in constants}
        if "undefined" in parts and {*re.findall(r"#undef (\w+)", parts["undefined"])} != {*known}:
            raise Unread("other constants than those that an #undef ends")
        self._vectors(known.get("LANES"))
        self.buffers()
        self._read(parts.get("functions", ""))
        while self._now():
            self._function()
        shared: tuple[tree.Statement, ...] = ()
        if "shared" in parts:
            kind = self.types[parts["shared"]]
            shared = (self._array("tile", kind, [tree.name("TILE_NUMBERS")], "var", space="group"),)
        self._read(parts.get("body", ""))
        body = (*shared, *self._body(end=""), *launches(self))
        missing = [key for key in (*images, RESULT) if key not in self.channels]
        if missing:
            raise Unread(f"the channels of {missing[0]} are not stated")
        declared: list[Any] = [
            SimpleNamespace(name=key.removeprefix(IMAGE), channels=self.channels[key]) for key in images
        ]
        return tree.Kernel(
            denoiser(declared, self.channels[RESULT]),
            body,
            constants,
            tuple(self.functions.values()),
            self._steps(bool(shared)),
            self._group(known) if shared else None,
            self.place,
            self.vector,
            batch=batch(self.passes) if self.passes else None,
        )

    def _steps(self, shared: bool) -> tuple[tree.Expr, tree.Expr]:
        """Return how many columns and rows of pixels an item takes: of passes a tile."""
        if self.passes:
            return tree.name("OUT"), tree.name("OUT")
        parts = self.parts
        return self._step("PIXELS" if shared else parts.get("across")), self._step(parts.get("down"))

    def _group(self, known: Mapping[str, tree.Expr]) -> tuple[int, int]:
        """Return the items of a work group."""
        width, height = (known.get(key, tree.name(key)) for key in ("GROUP_WIDTH", "GROUP_HEIGHT"))
        if (width.op, height.op) != ("const", "const"):
            raise Unread("work groups of no stated size")
        return int(width.value), int(height.value)

    def _vectors(self, lanes: tree.Expr | None) -> None:
        """Note the type of the weights: single values, or vectors."""
        parts = self.parts
        if "vector" in parts:
            self.vector = self._kind(parts["vector"])
            if parts.get("lanes", str(self.vector.lanes)) != str(self.vector.lanes):
                raise Unread(f"words of {parts['lanes']} sums in vectors of {self.vector.lanes}")
        elif "lanes" in parts or "words" in parts:  # of C
            if lanes is None or str(lanes.value) != parts.get("lanes", str(lanes.value)):
                raise Unread("vectors of no stated lanes")
            self.types["wamnet_vector"] = self.vector = tree.FLOAT.of(int(lanes.value))
            if "words" in parts:
                self.vector = tree.INT.of(int(lanes.value))
                self.types |= dict.fromkeys(("wamnet_sums", "wamnet_bytes"), self.vector)
        self.by_calls = "wamnet_vector" in self.types and not self.language.number

    def _step(self, text: str | None) -> tree.Expr:
        """Return how many pixels an item takes along an axis."""
        self._read(text or "1")
        return self._expression()

    def _function(self) -> None:
        """Read a function above the kernel: of values with a result, or of views of two arrays."""
        lets = self.language.lets
        for word in ("fn",) if lets else self.language.function:
            self._take(word)
        outer = self.scope
        self.scope = Scope({key: kind for key, kind in outer.values.items() if key.isupper()})
        if self._has("void"):
            key, takes, kind = *self._views(), None
        else:
            kind = tree.FLOAT if lets else self._type()
            key, takes = self._word(), []
            while self._has("," if takes else "("):
                takes.append(self._argument())
            self._take(")")
            kind = self._type() if lets and self._take("->") else kind
            self.scope.values |= dict(takes)
        self._take("{")
        if not FUNCTION.fullmatch(key) or key in self.functions:
            raise Unread(f"{key!r} is not a function of a kernel, or its second one")
        body, result = self._statements("return", "}"), None
        if kind:
            self._take("return")
            result = self._of(self._expression(), kind, key)
            rounded = {each.op for each in tree.parts(result)} & {"add", "subtract", "multiply", "divide"}
            if self.bounded and self.language.qualifier and rounded and kind.dtype == "float32":
                raise Unread(f"a result of {key} that is not {self.language.qualifier}")
            self._take(";")
        self._take("}")
        self.scope = outer
        self.functions[key] = tree.Function(key, tuple(takes), body, result)

    def _argument(self) -> tuple[str, tree.Type]:
        """Read an argument's name and type."""
        first, second = self._form("N : K" if self.language.lets else "K N")
        return (first, second) if self.language.lets else (second, first)

    def _views(self) -> tuple[str, list[tuple[str, tree.Type]]]:
        """Read the head of a function of views, and return its name and arrays."""
        key, vector = self._take().removeprefix("wamnet_"), self._now(2)
        self._form(f"( const {vector} * from , int step , {vector} * to , int leap )")
        takes = [("from", self._kind(vector)), ("to", self._kind(vector))]
        self.scope.arrays = {array: (kind, 1, False) for array, kind in takes}
        self.scope.values |= {"step": tree.INT, "leap": tree.INT}
        return key, takes

    def _images(self, text: str) -> list[str]:
        """Return the names of the images: numbers count up from 3, and the order is everywhere the same."""
        images = [line[-1] for line in (re.findall(r"\bimage_\w+", line) for line in text.splitlines())]
        numbers = [int(each) for each in re.findall(r"(?:buffer\(|binding = |binding\()(\d+)", text)]
        given = self.parts.get("given")
        listed = given is None or given == "".join(f"{image}, " for image in images)
        if numbers not in ([], [*range(3, 3 + len(images))]) or len(set(images)) < len(images) or not listed:
            raise Unread("images in two orders, or with other numbers")
        blocks = re.findall(r"\bImage_\w+", text)
        if blocks and blocks != [f"I{image[1:]}" for image in images]:
            raise Unread("blocks of other names than their images")
        if (first := self.parts.get("first")) and first != images[0]:
            raise Unread(f"a size of {first}, which is not the first image")
        return images

    def _constant(self, line: str) -> tree.Constant:
        """Return a named integer: of a macro whose text is one number or in parentheses."""
        match = re.fullmatch(
            r"#define (\w+) (\d+|[A-Z_]+|\(.*\))|const (\w+): i32 = (\d+|[A-Z_]+|\(.*\));", line
        )
        key = match and (match[1] or match[3])
        if match is None or not CONSTANT.fullmatch(str(key)) or key in self.scope.values:
            raise Unread(f"{line!r} is not a constant, or its second value")
        text = match[2] or match[4]
        depths = list(accumulate((c == "(") - (c == ")") for c in text))
        if text[0] == "(" and 0 in depths[:-1]:
            raise Unread(f"{text}, which is not in parentheses")
        self._read(text)
        value = self._expression()
        if self._now():
            raise Unread(f"{self._now()!r} where nothing follows")
        self.scope.values[str(key)] = tree.INT
        return tree.Constant(str(key), value)

    # ---- statements --------------------------------------------------------------------------------------

    def _body(self, end: str = "}") -> tree.Body:
        """Read statements up to a brace, or to the end; their names end there."""
        outer = self.scope
        self.scope = outer.inner()
        self.depth += 1
        if self.depth > DEEPEST:
            raise Unread(f"more than {DEEPEST} blocks in each other")
        statements = self._statements(end)
        if end:
            self._take(end)
            if not statements:
                raise Unread("an empty block")
        self.scope = outer
        self.depth -= 1
        return statements

    def _statements(self, *ends: str) -> tree.Body:
        """Read statements up to one of some words; what one declares and another one sets is a variable."""
        statements: list[tree.Statement] = []
        while self._now() not in ends:
            pixel = self.at < len(self.tokens) and self.tokens[self.at][0] == "pixel"
            statements += self._written() if pixel else [self._statement()]
        stored = {each.array for each in tree.walk(tuple(statements)) if isinstance(each, tree.Store)}
        return tuple(
            tree.Array(each.name, each.value.type, value=each.value)
            if isinstance(each, tree.Let) and each.name in stored
            else each
            for each in statements
        )

    def _statement(self) -> tree.Statement:
        """Read a statement."""
        if self.at < len(self.tokens) and self.tokens[self.at][0] == "unroll":
            self.at += 1
            if self._now() != "for":
                raise Unread("an unrolled statement that is not a loop")
        if self._has("{"):
            return tree.Block(self._body())
        if self._has("for", "("):
            return self._for()
        if self._has("if", "("):
            (condition,) = self._form("E ) {")
            body = self._body()
            return tree.If(condition, body, self._body() if self._has("else", "{") else ())
        if self.language.barrier and self._now() == re.split(r"\W", self.language.barrier)[0]:
            words = re.findall(r"[\w:]+|\W", self.language.barrier)
            self._take(*words, ";")
            return tree.Barrier()
        statement = self._declaration() or self._view_call() or self._vector_call() or self._assignment()
        self._take(";")
        return statement

    def _written(self) -> list[tree.Store]:
        """Read how a pixel of the result is written at once."""
        self._take()
        values: list[tree.Expr] = []
        while self._now() == "color":
            values += self._form(f"color [ {len(values)} ] = E ;")
            self._check_order("color", values[-1], "")
        column, row = self._form("imageStore ( result , ivec2 ( E , E ) , color ) ;")
        return [tree.Store(RESULT, (row, column, tree.const(c)), value) for c, value in enumerate(values)]

    def _for(self) -> tree.For:
        """Read a counted loop."""
        counter, start = self._form("var N : i32 = E" if self.language.lets else "int N = E")
        outer = self.scope
        self.scope = outer.inner(counter)
        self._take(";")
        condition, until = self._expression(), None
        if condition.op == "logical_and":
            condition, until = condition.args
        if condition.op != "less" or condition.args[0] != tree.name(counter):
            raise Unread(f"the loop over {counter} has another condition")
        self._take(";")
        step = tree.const(1)
        if self.language.lets and self._now(1) == "++":
            self._take(counter, "++")
        elif self.language.lets or not self._has("++", counter):
            self._take(counter, "+=")
            step = self._expression()
        self._take(")", "{")
        body = self._body()
        self.scope = outer
        return tree.For(counter, condition.args[1], body, start=start, step=step, until=until)

    def _declaration(self) -> tree.Statement | None:
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
        word = self._take()
        kind, key = self.types[word], self._word()
        sizes, word = self._sizes(), self.language.qualifier if qualified else word
        if not sizes and self._has(";"):  # a vector of C, which a call sets
            return self._filled(key, kind, word)
        if sizes or self._now() == ";":
            return self._array(key, kind, sizes, word)
        self._take("=")
        value = self._of(self._expression(), kind, key)
        self._check_order(key, value, word)
        word = WEIGHTS if re.fullmatch(r"m|w\d+", key) and self._is_weight(value) else word
        self.scope.declare(key, value.type, word)
        return tree.Let(key, value)

    def _check_order(self, key: str, value: tree.Expr, word: str, add: bool = False) -> None:
        """Refuse a sum, or another value, of which GLSL may change the order of operations."""
        qualifier = self.bounded and self.language.qualifier
        rounded = rounds(value, bool(word)) or (add and value.type.dtype == "float32")
        if qualifier and word != qualifier and rounded:
            raise Unread(f"{key} is not declared {qualifier}")

    def _is_weight(self, value: tree.Expr) -> bool:
        """Return whether a value is of the weights, whose products are added in any order [PRO-6b]."""
        if value.op == "stack" and len(set(value.args)) > 1:  # a column of weights in the source itself
            return {each.op for each in value.args} <= {"const", "negative"}
        if value.op == "name":
            return self.scope.words.get(value.value) == WEIGHTS
        return value.op == "load" and value.value == WEIGHTS

    def _array(
        self,
        key: str,
        kind: tree.Type,
        sizes: list[tree.Expr],
        word: str,
        mixed: bool = False,
        space: Space = "item",
    ) -> tree.Array:
        """Return an array; in C one of floats of LANES times a count holds vectors."""
        if self.by_calls and len(sizes) == 1 and kind == tree.FLOAT:
            size = sizes[0]
            if size.op == "multiply" and size.args[1] == tree.name("LANES"):
                kind, sizes, mixed = self.types["wamnet_vector"], [size.args[0]], True
        if len(sizes) > 1 and self.language.texels and "shared" not in self.parts:
            raise Unread("an array of arrays")
        self.scope.declare(key, kind, word)
        self.scope.arrays[key] = (self.scope.values.pop(key), len(sizes), mixed)
        return tree.Array(key, kind, tuple(sizes), space)

    def _filled(self, key: str, kind: tree.Type, word: str) -> tree.Statement:
        """Read the call that sets a vector of C, or return a variable without a first value."""
        self.at -= 1
        if kind.lanes == 1:
            return self._array(key, kind, [], word)
        self._take(";")
        self._array(key, kind, [], word)
        statement = self._vector_call()
        if not isinstance(statement, tree.Store) or statement.array != key or statement.add:
            raise Unread(f"{key} is not set where it is declared")
        self.scope.declare(key, kind, word)
        return tree.Let(key, statement.value)

    def _union(self) -> tree.Array:
        """Read an array of vectors of OpenCL whose components are read by their own index."""
        vector, count, numbers = self._form("K all [ E ] ; float number [ E ] ; }")
        if numbers != self._made("multiply", count, tree.const(vector.lanes)):
            raise Unread("a union of two sizes")
        return self._array(self._word(), vector, [count], "union", True)

    def _declaration_of_wgsl(self) -> tree.Statement | None:
        """Read a declaration of WGSL, if there is one."""
        if self._now() not in ("let", "var"):
            return None
        word, key = self._form("W N :")
        fixed, sizes = word == "let", list[tree.Expr]()
        kind = self._sized(sizes)
        if self._has("="):
            value = self._of(self._expression(), kind, key)
            self.scope.declare(key, kind, word)
            return tree.Let(key, value) if fixed else tree.Array(key, kind, value=value)
        if fixed:
            raise Unread(f"{key} has no value")
        return self._array(key, kind, sizes, word)

    def _sized(self, sizes: list[tree.Expr]) -> tree.Type:
        """Read a type of WGSL, and collect the sizes of an array."""
        if not self._has("array", "<"):
            return self._type()
        kind = self._sized(sizes)
        self._take(",")
        sizes.insert(0, self._binary(PRODUCTS - 1))
        self._take(">")
        return kind

    def _assignment(self) -> tree.Store:
        """Read an assignment."""
        target = self._unary() if self._now() in ("*", "(") else self._postfix(self._take())
        sign = self._take()
        if sign not in ("=", "+=", "-="):
            raise Unread(f"{sign!r} is not an assignment")
        if target.op == "name":
            target = tree.Expr("load", (), target.type, target.value)
        if target.op != "load" or target.value == WEIGHTS or target.value.startswith(IMAGE):
            raise Unread("an assignment to no element")
        word = self.scope.words.get(target.value, "")
        if word == WEIGHTS or (self.language.lets and word != "var" and target.value != RESULT):
            raise Unread(f"an assignment to {target.value}, which never changes")
        if sign == "=" and (self._has("DOT", "(") or self._has("wamnet_dots", "(")):
            return tree.Store(target.value, target.args, self._dot(target), True)
        value = self._expression()
        if target.type == tree.BYTE and value.op == "const":
            value = tree.const(value.value, tree.BYTE)
        value = self._of(value, target.type, target.value)
        summed = value.op in ("add", "subtract") and target.type.lanes > 1 and value.args[0] == target
        product = sign == "+=" and value.op == "multiply" and any(map(self._is_weight, value.args))
        product = product and not any(map(rounds, value.args))
        if not (product and LAYER.fullmatch(target.value)):
            self._check_order(target.value, value, word, sign != "=")
        defined = sign == "+=" and target.type.dtype == "float32"
        if not self.language.operators:  # CUDA, whose frame defines both for one type
            defined = target.type == self.types["wamnet_vector"]
        if sign != "=" and not defined:
            self._check_vectors(sign, value)
        if summed and self.by_calls and sign == "=":
            sign, value = {"add": "+=", "subtract": "-="}[value.op], value.args[1]
        value = self._made("negative", value) if sign == "-=" else value
        return tree.Store(target.value, target.args, value, sign != "=")

    def _dot(self, total: tree.Expr) -> tree.Expr:
        """Read the operands of products of bytes that are added to a sum, behind the parenthesis."""
        if self._expression() not in (total, tree.name(total.value, total.type)):
            raise Unread(f"products of bytes are added to another sum than {total.value}")
        (weights,) = self._form(", E ,")
        if self._has("(", "(", "const", "fours", "*", ")", "("):
            four = self._four()
            self._form(") ) -> bytes )")
        else:
            (four,) = self._form("E )")
        return tree.Expr("dot4", (weights, four), weights.type)

    def _four(self) -> tree.Expr:
        """Read the address of four bytes."""
        array = self._word()
        if self.scope.arrays.get(array) != (tree.BYTE, 1, False):
            raise Unread(f"{array} holds no bytes")
        self._take("+")
        return tree.load(array, self._binary(PRODUCTS - 1), kind=tree.BYTE.of(4))

    # ---- vectors and views --------------------------------------------------------------------------------

    def _view_call(self) -> tree.Call | None:
        """Read a call of a function of views, if there is one."""
        function = self.functions.get(self._now().removeprefix("wamnet_"))
        if function is None or function.result is not None or self._now(1) != "(":
            return None
        self._take()
        views = []
        for sign in ("(", ","):
            self._take(sign)
            array, index = self._view()
            views.append(tree.View(array, index, *self._form(", E")))
        self._take(")")
        return tree.Call(function.name, tuple(views))

    def _view(self) -> tuple[str, tuple[tree.Expr, ...]]:
        """Read the address of a view: rows of an array in brackets, and its first element as a sum."""
        if self._has("(", "wamnet_vector", "*", ")", "("):
            vector = self._vector()
            self._take(")")
            return vector.value, vector.args
        array = self._word()
        if array not in self.scope.arrays:
            raise Unread(f"{array} is not an array")
        _, count, mixed = self.scope.arrays[array]
        if mixed:
            self._take(".", "all")
        rows = self._sizes()
        last = self._binary(PRODUCTS - 1) if self._has("+") else tree.const(0)
        if len(rows) != count - 1:
            raise Unread(f"{array} has {count} indices")
        return array, (*rows, last)

    def _vector_call(self) -> tree.Statement | None:
        """Read a call of one of C's functions on vectors, if there is one."""
        if not self.by_calls or not self._now().startswith("wamnet_"):
            return None
        call = self._take().removeprefix("wamnet_")
        self._take("(")
        target = self._vector()
        if target.op != "load":
            raise Unread("a call that sets a value which never changes")
        pointers = [self.pointer]
        vectors: list[tree.Expr] = []
        while len(pointers) < len(CALLS.get(call, "").split()) and self._has(","):
            vectors.append(self._vector())
            pointers.append(self.pointer)
        if pointers != CALLS.get(call, "").split():
            raise Unread(f"wamnet_{call} of {', '.join(pointers)}")
        if call == "dot":
            self._take(",")
            value = tree.Expr("dot4", (*vectors, self._four()), target.type)
        else:
            value = self._made("convert", *vectors, value="float32") if call == "floats" else vectors[0]
        self._take(")")
        value = self._of(value, target.type, target.value)
        return tree.Store(target.value, target.args, value, call == "dot")
