"""Mutants of a C program: the same sorts of change as of Python (mutation.py), by the tokens of a line.

1. Functions have a comment above that names their clauses; what is outside of functions is left alone, and so
   are texts, comments and the lengths of arrays [`mutants`].
2. A mutant changes one line: a number, an operator, a comparison, a condition, a width, or is dropped.
"""

import re
from collections.abc import Iterator

from .mutation import LOW_DIGIT, Mutant, numbered

OPERATORS = {
    " + ": (" - ",), " - ": (" + ",), " * ": (" / ",), " / ": (" * ",), " % ": (" / ",), " << ": (" >> ",),
    " >> ": (" << ",), " & ": (" | ",), " | ": (" & ",), " ^ ": (" & ",), " && ": (" || ",),
    " || ": (" && ",),
    " += ": (" -= ", " = "), " -= ": (" += ",), " *= ": (" = ",), " /= ": (" *= ",),
    " ^= ": (" = ",), " |= ": (" = ",),
}  # fmt: skip
"""What takes an operator's place, spaces around."""

COMPARISONS = {" < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > ", " == ": " != ", " != ": " == "}
"""What takes a comparison's place."""

NAMES = {"fmax": "fmin", "fmin": "fmax", "sin": "cos", "cos": "sin", "floor": "ceil", "ceil": "floor"}
"""What takes a function's place."""

UNDONE = ("fabs", "sqrt", "floor", "unit", "largest")
"""Functions of one number that may be forgotten, as far as C's types allow."""

NARROWER = {"(uint32_t)": ("(uint16_t)", "(uint8_t)", "0x7fffffffu & (uint32_t)"), "(double)": ("(float)",)}
"""What cuts a width."""

NUMBER = re.compile(r"(?<![\w.\[])(\d+\.?\d*(?:e[+-]?\d+)?|0x[0-9a-fA-F]+)(u?)(?![\w.\]])")
"""A number that is neither length nor index in brackets of its own."""

STATEMENT = re.compile(r"\s+(?:[\w.\->\[\]*+ ]+ [-+*/|&^]?= |\+\+|--|\w+\()[^{}]*;\s*(?:/\*.*\*/)?")
"""A line that is one assignment or one call."""

CLAUSE = re.compile(r"\b[A-Z]{2,3}-\d+[a-z]?\b")
"""A clause in a comment."""

TYPES = re.compile(
    r"\s+(?:static |const |unsigned |struct )*"
    r"(?:\w+_t|double|int|bool|size_t|char|long|v3|words|json|array)\b [*\w]"
)
"""How a declaration begins, which cannot be dropped."""


def mutants(path: str, source: str) -> list[Mutant]:
    """Return the mutants of a program; `function` names the clauses of the comment above."""
    return numbered((mutant, mutant.function) for mutant in _all(path, source))


def _all(path: str, source: str) -> Iterator[Mutant]:
    """Yield the mutants of all lines in functions that have clauses."""
    clauses, inside, start = "", False, 0
    for number, line in enumerate(source.splitlines(keepends=True), 1):
        if line.startswith("/*"):
            clauses = " ".join(CLAUSE.findall(line))
        elif line[0] not in " }\n#":
            inside = not line.rstrip().endswith(";") and "(" in line and not line.startswith("typedef")
        if inside and clauses and line[0] in " s" and '"' not in line:
            for operator, at, end, text in _changes(line):
                old, new = (piece.strip() or "nothing" for piece in (line[at:end], text))
                detail = f"{old} -> {new} in {line.strip()[:70]}"
                yield Mutant(
                    path, number, number, number, operator, detail, clauses, start + at, start + end, text
                )
        if line.startswith("}") or (line.startswith("static") and line.rstrip().endswith("}")):
            clauses, inside = "", False
        start += len(line.encode())


Piece = tuple[str, int, int, str]
"""A sort of change, the columns that it replaces, and the new text."""


def _changes(line: str) -> Iterator[Piece]:
    """Yield the changes of a line; what is in a comment is left alone."""
    code = line.partition("/*")[0]
    for match in NUMBER.finditer(code):
        yield from _number(match)
    for table, operator in ((OPERATORS, "operator"), (COMPARISONS, "comparison")):
        for old, new in table.items():
            for match in re.finditer(re.escape(old), code):
                for text in new if isinstance(new, tuple) else (new,):
                    yield operator, match.start(), match.end(), text
    yield from _called(code)
    for match in re.finditer(r"(?<![\w)])[-!](?=[\w(])", code):
        yield "sign", match.start(), match.end(), ""
    for match in re.finditer(r"\bif \(", code):
        end = _closing(code, match.end() - 1)
        if end:
            yield "condition", match.end(), end, f"!({code[match.end() : end]})"
    for match in re.finditer(r"\? ([^?:;]+) : ([^?:;,)]+)", code):
        yield "condition", match.start(), match.end(), f"? {match[2]} : {match[1]}"
    if STATEMENT.fullmatch(code.rstrip() + "\n") and not TYPES.match(code) and "return" not in code:
        yield "dropped", len(code) - len(code.lstrip()), len(code.rstrip()), ";"
    yield from (("arguments", *exchanged) for exchanged in _exchanged(code))


def _called(code: str) -> Iterator[Piece]:
    """Yield functions and casts that are others, or forgotten."""
    for old, other in NAMES.items():
        yield from (("function", m.start(), m.end(), other) for m in re.finditer(rf"\b{old}(?=\()", code))
    for old in UNDONE:
        yield from (("cast", m.start(), m.end(), "") for m in re.finditer(rf"\b{old}(?=\()", code))
    for old, cuts in NARROWER.items():
        for match in re.finditer(re.escape(old), code):
            yield from (("width", match.start(), match.end(), cut) for cut in cuts)


def _number(match: re.Match[str]) -> Iterator[Piece]:
    """Yield a number's neighbours."""
    text = match[1]
    if "." in text or ("e" in text and not text.startswith("0x")):
        others = [repr(2 * float(text)), repr(LOW_DIGIT * float(text))] if float(text) else ["1.0"]
    else:
        value = int(text, 0)
        others = [f"{value + 1}{match[2]}", f"{value - 1}{match[2]}"]
    yield from (("constant", match.start(), match.end(), other) for other in others)


def _exchanged(code: str) -> Iterator[tuple[int, int, str]]:
    """Yield calls of two plain names with these exchanged."""
    for match in re.finditer(r"(?<=[(, ])([a-zA-Z_][\w.\->]*), ([a-zA-Z_][\w.\->]*)(?=[,)])", code):
        if match[1] != match[2] and "(" in code[: match.start()] and not code.lstrip().startswith("static"):
            yield match.start(), match.end(), f"{match[2]}, {match[1]}"


def _closing(code: str, at: int) -> int:
    """Return where the bracket that opens at a column closes, 0 where it does not on this line."""
    depth = 0
    for index in range(at, len(code)):
        depth += (code[index] == "(") - (code[index] == ")")
        if not depth:
            return index
    return 0
