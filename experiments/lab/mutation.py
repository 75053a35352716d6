"""Mutants of Python modules: every single change of a few plain sorts, as an edit of the text with a name.

1. [`mutants`] walks the syntax tree of a module and yields the changes that a programmer could have made by
   mistake: a constant off by one, doubled or with another low digit; an operator, a comparison or a function
   in place of its neighbour; operands and arguments exchanged or left out; a condition turned round; a
   statement or a cast dropped; a counter cut to 8, 15, 16 or 31 bits.
2. A mutant's name is `module:line:operator:what`, the same in every run. Lines keep their numbers.
3. What is known of a mutant binds to its change, `module:place:operator:what` [`Mutant.change`], which stays
   as it is when lines above are added: the place is the function that it is in, or the name that is assigned.
4. Nothing is changed where no program can behave otherwise, or where only words differ: annotations,
   docstrings, assertions, the texts of errors.
"""

import ast
import copy
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

WIDTHS = (0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF)
"""Words of 8, 15, 16 and 31 bits, which counters are cut to."""

COUNTERS = {"seed", "pixel", "sample", "block", "depth", "stream", "index"}
"""Names of what counts."""

LEAST_COUNTERS = 4
"""Arguments of a function that draws random numbers, at least."""

SHOWN = 80
"""Most characters of a text in a name."""

LOW_DIGIT = 1.001
"""Factor of a fraction whose low digit is wrong."""

OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mod,
    ast.Mod: ast.FloorDiv, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitAnd, ast.Pow: ast.Mult,
}  # fmt: skip
"""What takes an operator's place."""

COMMUTATIVE = (ast.Add, ast.Mult, ast.BitAnd, ast.BitOr, ast.BitXor)
"""Operators whose operands may change places."""

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
"""What takes a comparison's place: the tie goes the other way, or everything does."""

PAIRS = (
    "maximum minimum",
    "max min",
    "any all",
    "sin cos",
    "floor ceil",
    "zeros_like ones_like",
    "zeros ones",
)
FUNCTIONS = {a: b for pair in map(str.split, PAIRS) for a, b in (pair, pair[::-1])}
"""What takes a function's place."""

UNDONE = {"abs", "sqrt", "rint", "floor", "ceil", "float32", "float64", "uint32", "int32", "int64", "float",
          "int", "bool", "sorted", "reversed", "cumsum", "square", "normalize"}  # fmt: skip
"""Functions of one number that may be forgotten."""

SYMMETRIC = {"minimum", "maximum", "min", "max", "dot", "isclose", "array_equal"}
"""Functions whose arguments may change places."""

WORDS_ONLY = {"InputError", "CompileError", "TypeVar", "NewType", "isinstance", "getattr", "hasattr", "cast"}
"""Calls that only say something, or whose arguments have types of their own."""


class Mutant(NamedTuple):
    """A change: its lines, its sort, what becomes of what, the bytes that it replaces.

    `function` is the function or method that it is in, nothing for what is outside; `first` to `last` are
    the lines of the statement, or of its head, that reach it. `change` is what no line number is part of.
    """

    module: str
    line: int
    first: int
    last: int
    operator: str
    detail: str
    function: str
    start: int
    end: int
    text: str
    change: str = ""

    @property
    def name(self) -> str:
        """Return the name: module, line, operator and detail."""
        return f"{self.module}:{self.line}:{self.operator}:{self.detail}"


def mutants(module: str, source: str) -> list[Mutant]:
    """Return all mutants of a module in the order of its text; names that repeat are numbered."""
    walk = _Walk(module, source)
    places = {line: place for lines, place in _places(walk.tree.body, "") for line in lines}
    return numbered((mutant, mutant.function or places.get(mutant.line, "")) for mutant in walk.all())


def numbered(some: Iterable[tuple[Mutant, str]]) -> list[Mutant]:
    """Return mutants, each given with its place, with their changes; what repeats gets numbers."""
    found, seen = [], Counter[str]()
    for mutant, place in some:
        change = f"{mutant.module}:{place}:{mutant.operator}:{mutant.detail}"
        seen.update((mutant.name, change))
        name, change = (
            f"{text} ({seen[text]})" if seen[text] > 1 else text for text in (mutant.name, change)
        )
        found.append(mutant._replace(detail=mutant.detail + name[len(mutant.name) :], change=change))
    return found


def _places(body: Sequence[ast.stmt], owner: str) -> Iterator[tuple[range, str]]:
    """Yield the lines of what is outside of functions, and its place: `NAME`, `Class.field`, `f()`."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from _places(node.body, f"{owner}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield range(node.lineno, node.body[0].lineno), f"{owner}{node.name}()"
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            yield range(node.lineno, (node.end_lineno or 0) + 1), f"{owner}{ast.unparse(target)}"


def mutated(mutant: Mutant, source: str) -> str:
    """Return the text of a module with the change."""
    raw = source.encode()
    return (raw[: mutant.start] + mutant.text.encode() + raw[mutant.end :]).decode()


Change = tuple[str, ast.AST, ast.AST | str]
"""A sort of change, the node that it replaces, and what takes its place."""


class _Walk:
    """A walk through a module that knows in which function it is."""

    def __init__(self, module: str, source: str) -> None:
        self.module, self.tree, self.raw = module, ast.parse(source), source.encode()
        self.starts = [0]
        for line in self.raw.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def all(self) -> Iterator[Mutant]:
        """Yield every mutant."""
        for statement in self.tree.body:
            yield from self._statement(statement, "", False)

    def _statement(self, node: ast.stmt, owner: str, inside: bool) -> Iterator[Mutant]:
        """Yield the mutants of a statement and of those in it; `inside`: the owner is a function."""
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = owner if inside else f"{owner}.{node.name}".lstrip(".")
            function = isinstance(node, ast.FunctionDef)
            for default in _defaults(node):
                yield from self._expression(default, default, owner if inside else "")
            for statement in node.body:
                yield from self._statement(statement, name, inside or function)
            return
        if _says_nothing(node):
            return
        at = owner if inside else ""
        yield from (self._made(change, node, at) for change in _dropped(node) if inside)
        for field, part in _parts(node):
            if isinstance(part, ast.stmt):
                yield from self._statement(part, owner, inside)
            elif isinstance(part, ast.ExceptHandler | ast.match_case):
                for statement in part.body:
                    yield from self._statement(statement, owner, inside)
            elif isinstance(part, ast.withitem):
                yield from self._expression(part.context_expr, part.context_expr, at)
            elif isinstance(part, ast.expr) and field not in ("annotation", "targets", "target", "exc"):
                if field == "test":
                    yield self._made(("condition", part, _not(part)), part, at)
                yield from self._expression(part, part if hasattr(node, "body") else node, at)

    def _expression(self, node: ast.expr, header: ast.AST, owner: str) -> Iterator[Mutant]:
        """Yield the mutants of an expression and of those in it; `header` has the lines that reach it."""
        if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Call) and _called(node) in WORDS_ONLY):
            return
        if type(node) in CHANGES:
            yield from (self._made(change, header, owner) for change in CHANGES[type(node)](node))
        for field, part in _parts(node):
            if isinstance(part, ast.comprehension):
                yield from self._expression(part.iter, header, owner)
                for test in part.ifs:
                    yield self._made(("condition", test, _not(test)), header, owner)
                    yield from self._expression(test, header, owner)
            elif isinstance(part, ast.keyword) and part.arg != "strict":
                yield from self._expression(part.value, header, owner)
            elif isinstance(part, ast.expr) and field not in ("annotation", "target"):
                yield from self._expression(part, header, owner)

    def _made(self, change: Change, header: ast.AST, owner: str) -> Mutant:
        """Return a mutant; its text has as many lines as what it replaces."""
        operator, node, new = change
        text = new if isinstance(new, str) else f"({ast.unparse(ast.fix_missing_locations(new))})"
        start, end = (self._byte(node, side) for side in ("", "end_"))
        old = self.raw[start:end].decode()
        text += "\n" * (old.count("\n") - text.count("\n")) * (text == "pass")
        if not isinstance(new, str):
            text = text[:-1] + "\n" * (old.count("\n") - text.count("\n")) + ")"
        detail = f"{_flat(old)} -> {_flat(text)}"
        first, last = int(header.lineno), int(header.end_lineno)  # type: ignore[attr-defined]
        line = int(node.lineno)  # type: ignore[attr-defined]
        return Mutant(self.module, line, first, last, operator, detail, owner, start, end, text)

    def _byte(self, node: ast.AST, side: str) -> int:
        """Return the byte at which a node begins, or ends."""
        return self.starts[getattr(node, f"{side}lineno") - 1] + int(getattr(node, f"{side}col_offset"))


def _parts(node: ast.AST) -> Iterator[tuple[str, object]]:
    """Yield what a node is made of, with the names of its fields."""
    for field, value in ast.iter_fields(node):
        for part in value if isinstance(value, list) else [value]:
            yield field, part


def _defaults(node: ast.FunctionDef | ast.ClassDef) -> list[ast.expr]:
    """Return the defaults of a function's arguments."""
    if isinstance(node, ast.ClassDef):
        return []
    return [default for default in (*node.args.defaults, *node.args.kw_defaults) if default is not None]


def _says_nothing(node: ast.stmt) -> bool:
    """Tell whether a statement is words only: a docstring, an assertion, an import, the name of a type."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    if isinstance(node, ast.AnnAssign):
        return node.value is None or "TypeAlias" in ast.unparse(node.annotation)
    return isinstance(node, ast.Assert | ast.Import | ast.ImportFrom | ast.Pass)


def _flat(text: str) -> str:
    """Return a text on one line, its middle left out where it is long."""
    flat = " ".join(text.split())
    return flat if len(flat) <= SHOWN else f"{flat[: SHOWN // 2]} ... {flat[-SHOWN // 2 :]}"


def _not(node: ast.expr) -> ast.expr:
    """Return the opposite of a condition."""
    return ast.UnaryOp(ast.Not(), node)


def _with(node: ast.AST, **fields: object) -> ast.AST:
    """Return a copy of a node with other fields."""
    made = copy.copy(node)
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def _called(node: ast.Call) -> str:
    """Return the last name of what is called."""
    return ast.unparse(node.func).rpartition(".")[2]


def _plain(node: ast.expr) -> str:
    """Return the last name of a name or an attribute, or nothing."""
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


# ---- changes ----------------------------------------------------------------------------------------------


def _dropped(node: ast.stmt) -> Iterator[Change]:
    """Yield a statement that is left out where others can do without it."""
    if isinstance(node, ast.Expr | ast.AugAssign | ast.Raise | ast.Break | ast.Continue):
        yield "dropped", node, "pass"
    if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
        # A value that is made from its own old one can stay as it was.
        name = node.targets[0].id
        if any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(node.value)):
            yield "dropped", node, "pass"


def _constant(node: ast.Constant) -> Iterator[Change]:
    """Yield a constant's neighbours."""
    value = node.value
    if isinstance(value, bool):
        yield "constant", node, ast.Constant(not value)
    elif isinstance(value, int):
        yield from (("constant", node, ast.Constant(value + step)) for step in (1, -1))
    elif isinstance(value, float):
        others = (2.0 * value, LOW_DIGIT * value) if value else (1.0,)
        yield from (("constant", node, ast.Constant(other)) for other in others)


def _binary(node: ast.BinOp) -> Iterator[Change]:
    """Yield another operator, exchanged operands, and each operand by itself."""
    kind = type(node.op)
    if any(
        isinstance(side, ast.Constant) and isinstance(side.value, str) for side in (node.left, node.right)
    ):
        return
    if kind in OPERATORS:
        yield "operator", node, _with(node, op=OPERATORS[kind]())
    if kind not in COMMUTATIVE:
        yield "exchanged", node, _with(node, left=node.right, right=node.left)
    yield "operand dropped", node, node.left
    if kind in COMMUTATIVE:
        yield "operand dropped", node, node.right


def _comparison(node: ast.Compare) -> Iterator[Change]:
    """Yield a comparison with its tie on the other side."""
    for at, kind in enumerate(map(type, node.ops)):
        if kind in COMPARISONS:
            ops = [COMPARISONS[kind]() if i == at else op for i, op in enumerate(node.ops)]
            yield "comparison", node, _with(node, ops=ops)


def _boolean(node: ast.BoolOp) -> Iterator[Change]:
    """Yield or for and, and conditions of which one is not asked."""
    other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    yield "operator", node, _with(node, op=other)
    for at in range(len(node.values)):
        rest = [value for i, value in enumerate(node.values) if i != at]
        yield "operand dropped", node, _with(node, values=rest) if len(rest) > 1 else rest[0]


def _unary(node: ast.UnaryOp) -> Iterator[Change]:
    """Yield what a sign or a negation is of."""
    if not isinstance(node.operand, ast.Constant) or not isinstance(node.op, ast.UAdd):
        yield "sign", node, node.operand


def _either(node: ast.IfExp) -> Iterator[Change]:
    """Yield the other choice."""
    yield "condition", node, _with(node, body=node.orelse, orelse=node.body)


def _call(node: ast.Call) -> Iterator[Change]:
    """Yield a call of a neighbour, of none, with arguments exchanged, left out or cut."""
    name, arguments = _called(node), node.args
    if name in FUNCTIONS:
        other = FUNCTIONS[name]
        func = _with(node.func, attr=other) if isinstance(node.func, ast.Attribute) else ast.Name(other)
        yield "function", node, _with(node, func=func)
    if name in UNDONE and len(arguments) == 1:
        yield "cast", node, arguments[0]
    if name == "astype" and isinstance(node.func, ast.Attribute):
        yield "cast", node, node.func.value
    for at in range(len(arguments) - 1) if name not in SYMMETRIC else ():
        first, second = arguments[at : at + 2]
        if not any(isinstance(a, ast.Starred) for a in (first, second)) and ast.dump(first) != ast.dump(
            second
        ):
            yield "arguments", node, _with(node, args=[*arguments[:at], second, first, *arguments[at + 2 :]])
    # Where lengths agree, `strict` says nothing.
    for at in (at for at, keyword in enumerate(node.keywords) if keyword.arg != "strict"):
        rest = [other for i, other in enumerate(node.keywords) if i != at]
        yield "argument dropped", node, _with(node, keywords=rest)
    for at, argument in enumerate(arguments):
        if _plain(argument) in COUNTERS and (len(arguments) >= LEAST_COUNTERS or name == "counter"):
            for width in WIDTHS:
                cut = ast.BinOp(argument, ast.BitAnd(), ast.Constant(width))
                yield "width", node, _with(node, args=[*arguments[:at], cut, *arguments[at + 1 :]])


CHANGES: dict[type[ast.AST], Callable[..., Iterator[Change]]] = {
    ast.Constant: _constant, ast.BinOp: _binary, ast.Compare: _comparison, ast.BoolOp: _boolean,
    ast.UnaryOp: _unary, ast.IfExp: _either, ast.Call: _call,
}  # fmt: skip
"""What may be wrong with an expression, by its kind."""
