"""Bugs in the emitters of kernels: written by hand, changes of the syntax tree, and of what is printed.

1. `experiments/emitter_faults.json` has bugs of a programmer, each with its kind and with what the kernel
   then does wrong, in words that hold for any emitter [`written`].
2. The mutants of [lab/mutation.py] change the emitters' logic [`of_logic`].
3. Templates and strings of a language's source have a number, an operator, a name or an operand exchanged
   [`of_strings`]: mutation.py changes no strings, and an emitter consists of them.
4. A seed shuffles the last two; those by hand come first [`faults`]. Fewer are a part of more.
"""

from __future__ import annotations

import ast
import functools
import io
import json
import random
import re
import tokenize
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from . import mutation
from .trial import ROOT

WRITTEN = ROOT / "experiments/emitter_faults.json"
"""The bugs that were written by hand."""

GROUPS = {
    "schedules": ("compiler/schedules/",),
    "languages": ("compiler/languages/",),
    "roles": ("compiler/scenes/", "compiler/training/"),
}
"""Folders of the emitters: of denoisers, of languages, and of the other roles."""

OF_ROLES = (
    "emit_path", "path_kernel", "encode_kernel", "smooth_kernel", "history_kernel", "plane_kernel",
    "emit_step", "emit_factors", "step_layout",
)  # fmt: skip
"""Modules of the last group that write kernels; the others lower programs."""

SWAPPED = {
    "+": "-", "-": "+", "*": "+", "/": "*", "%": "/", "<": "<=", "<=": "<", ">": ">=", ">=": ">", "&&": "||",
    "||": "&&", "+=": "=", "==": "!=", "!=": "==", ">>": "<<", "<<": ">>", "&": "|", "|": "&", "^": "&",
}  # fmt: skip
"""What takes an operator's place in a kernel's source."""

PAIRS = (
    "min max", "fmin fmax", "fminf fmaxf", "MINIMUM MAXIMUM", "LEAST MOST", "width height", "x y",
    "row column", "dx dy", "left top", "sin cos", "floor ceil", "true false",
    "WINDOW_SIZE WINDOW_CENTRE", "LANES PIXELS", "columns rows", "local_x local_y", "threadIdx blockIdx",
    "real imaginary",
)  # fmt: skip
NAMES = {a: b for pair in map(str.split, PAIRS) for a, b in (pair, pair[::-1])}
"""What takes a name's place."""

CODE = re.compile(
    r"/\*.*?\*/|//[^\n]*|\{[a-z_][^{}]*\}|\{\{|\}\}"
    r"|(?P<operand>\{[0-2]\})"
    r"|(?P<number>(?<![\w.])\d+(?:\.\d*)?(?![\w.]))"
    r"|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<operator>\+=|&&|\|\||<=|>=|==|!=|>>|<<|\+\+|--|->|[-+*/%<>&|^])",
    re.S,
)
"""Tokens of a template; braces with a word are left alone."""

PROSE = re.compile(r"[a-z]{2,}(?:,? [a-z]{2,}){3}")
"""A string that is text for readers."""

STATEMENT = re.compile(r"^(?!for\b)[^\n]*[^\s{};];$")
"""A string that is one statement."""


class Fault(NamedTuple):
    """A bug: the bytes of a file that it replaces, its kind, and what the kernel does wrong.

    `origin` is hand, logic or print; `first` and `last` are the lines that reach it, `function` where it is.
    """

    file: str
    origin: str
    kind: str
    says: str
    start: int
    end: int
    text: str
    first: int
    last: int
    function: str
    detail: str

    @property
    def name(self) -> str:
        """Return what an outcome is kept under."""
        return f"{self.file}:{self.first}:{self.start}:{self.kind}:{self.detail}"

    @property
    def group(self) -> str:
        """Return the group of the file."""
        return next(name for name, folders in GROUPS.items() if self.file.startswith(folders))

    def planted(self, source: str) -> str:
        """Return the module with the bug."""
        raw = source.encode()
        return (raw[: self.start] + self.text.encode() + raw[self.end :]).decode()


def modules(group: str) -> list[str]:
    """Return the modules of a group, from the root."""
    paths = sorted(path for folder in GROUPS[group] for path in (ROOT / folder).glob("*.py"))
    kept = [path for path in paths if group != "roles" or path.stem in OF_ROLES]
    return [path.relative_to(ROOT).as_posix() for path in kept if path.stem != "__init__"]


@functools.cache
def faults(group: str, seed: int = 0) -> Sequence[Fault]:
    """Return the bugs of a group: those by hand, then logic and print interleaved."""
    byhand = [fault for fault in written() if fault.group == group]
    logic, strings = [], []
    for path in modules(group):
        source = (ROOT / path).read_text(encoding="utf-8")
        logic += of_logic(path, source)
        strings += of_strings(path, source)
    for some in (logic, strings):
        random.Random(seed).shuffle(some)
    turns = [fault for pair in zip(logic, strings, strict=False) for fault in pair]
    return [*byhand, *turns]


def written(path: Path = WRITTEN) -> Iterator[Fault]:
    """Yield the bugs by hand: each `old` is in its file once."""
    for entry in json.loads(path.read_text(encoding="utf-8")):
        source = (ROOT / entry["file"]).read_text(encoding="utf-8")
        assert source.count(entry["old"]) == 1, f"{entry['file']}: {entry['old']!r} must be there once"
        start = source.index(entry["old"])
        first, last = (source.count("\n", 0, at) + 1 for at in (start, start + len(entry["old"])))
        begin = len(source[:start].encode())
        function = _functions(source).get(first, "")
        yield Fault(
            entry["file"], "hand", entry["kind"], entry["says"], begin, begin + len(entry["old"].encode()),
            entry["new"], first, last, function, f"{entry['old']} -> {entry['new']}",
        )  # fmt: skip


def of_logic(path: str, source: str) -> Iterator[Fault]:
    """Yield the mutants of a module's logic."""
    for m in mutation.mutants(path, source):
        yield Fault(
            path, "logic", m.operator, "", m.start, m.end, m.text, m.first, m.last, m.function, m.detail
        )


def of_strings(path: str, source: str) -> Iterator[Fault]:
    """Yield the changes of what a module's strings print."""
    functions, skipped = _functions(source), _docstrings(source)
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.STRING or token.start in skipped or PROSE.search(token.string):
            continue
        head = len(token.string) - len(token.string.lstrip("rfbRFB"))
        quote = 3 if token.string[head:].startswith(('"""', "'''")) else 1
        body = token.string[head + quote : -quote]
        at = starts[token.start[0] - 1] + token.start[1] + head + quote
        function = functions.get(token.start[0], "")
        for first, last, new, kind in changes(body):
            start = len(source[: at + first].encode())
            end = start + len(body[first:last].encode())
            detail = f"{_shown(body, first, last)} -> {new.strip() or 'nothing'}"
            yield Fault(
                path, "print", kind, "", start, end, new, token.start[0], token.end[0], function, detail
            )


def changes(body: str) -> Iterator[tuple[int, int, str, str]]:
    """Yield start, end, replacement and kind of each change of a string."""
    if STATEMENT.match(body) and len(body) > len("x = y;"):
        yield 0, len(body), "", "statement dropped"
    operands = [m for m in CODE.finditer(body) if m["operand"]]
    for m in CODE.finditer(body):
        place = m.start(), m.end()
        if m["number"]:
            yield from _number(m["number"], place)
        elif m["name"] in NAMES:
            yield *place, NAMES[m["name"]], "name exchanged"
        elif m["operator"] in SWAPPED:
            yield *place, SWAPPED[m["operator"]], "operator"
    if len(operands) >= 2:
        a, b = operands[:2]
        yield a.start(), b.end(), f"{b[0]}{body[a.end() : b.start()]}{a[0]}", "operands exchanged"


def _number(text: str, place: tuple[int, int]) -> Iterator[tuple[int, int, str, str]]:
    """Yield the neighbours of a number."""
    if "." in text:
        yield *place, "1.0" if float(text) == 0 else f"{1.001 * float(text):.4f}", "constant"
        return
    yield *place, str(int(text) + 1), "integer one more"
    if int(text):
        yield *place, str(int(text) - 1), "integer one less"


def _shown(body: str, first: int, last: int) -> str:
    """Return what is replaced, with a little before and after it."""
    around = body[max(0, first - 20) : first], body[first:last], body[last : last + 20]
    return " ".join(f"{around[0]}[{around[1]}]{around[2]}".split())


def _docstrings(source: str) -> set[tuple[int, int]]:
    """Return where strings begin that are statements, names of dictionaries in messages, or annotations."""
    result = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            result.add((node.value.lineno, node.value.col_offset))
        if isinstance(node, ast.Assert | ast.Raise):
            result |= {
                (n.lineno, n.col_offset)
                for n in ast.walk(node)
                if isinstance(n, ast.Constant | ast.JoinedStr)
            }
    return result


def _functions(source: str) -> dict[int, str]:
    """Return the function or class of each line, innermost name last; nothing outside."""
    result: dict[int, str] = {}

    def walk(body: Sequence[ast.stmt], owner: str, inside: bool) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                name = f"{owner}.{node.name}".lstrip(".")
                function = isinstance(node, ast.FunctionDef)
                if function:
                    result.update(dict.fromkeys(range(node.lineno, (node.end_lineno or 0) + 1), name))
                walk(node.body, name, inside or function)

    walk(ast.parse(source).body, "", False)
    return result
