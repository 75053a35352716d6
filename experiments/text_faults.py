"""Plant faults in the texts of kernels, one at a time, and ask the reader of texts whether it notices.

    python experiments/text_faults.py
    python experiments/text_faults.py FOLDER... --count 500

Without a folder these are kernels of a small network, for each language and kind of schedule that is read; a
folder has any kernel with its manifest and certificate. A fault changes a digit of a constant, an integer by
one, an operator or a name, loses or repeats a statement, loses a line before the functions, or puts a word
before another one that no kernel has there. A table is printed, and each fault that the reader accepts. An
array with more room changes nothing: such faults are counted by themselves. Status 1 if the reader accepts
any other. Faults of the language around the arithmetic are in tests/support/text_classes.py.
"""

import random
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from lab.command import described
from lab.tables import markdown

from wamnet.compiler.artifact import CERTIFICATE_NAME, write
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.proof.evidence import Refused, read
from wamnet.compiler.reading.check import run_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.reading.languages import TITLES
from wamnet.compiler.variants import plan_model
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

TILES = (
    ("c", "tile:8", "full"), ("opencl", "tile:8", "full"), ("opencl", "group:1", "full"),
    ("wgsl", "group:4", "full"), ("c", "dot:16", "whole8"), ("opencl", "dot:16", "whole8"),
    ("cuda", "groupdot:4", "whole8"),
)  # fmt: skip
"""Targets, schedules and variants of small kernels, in addition to the plain ones."""

ROOM = re.compile(
    r" *(?:PRECISE )?(?:float\d*|vector|union|var|wamnet_vector|uchar|uint8_t|sums|wamnet_sums)"
    r"\b[^=]*[\[<][^=]*;"
)
"""A line that declares an array without a value."""

OPERATORS = {
    "+": "-", "-": "+", "*": "+", "/": "*", "%": "/", "<": "<=", "<=": "<", ">": ">=", ">=": ">",
    "&&": "||", "||": "&&", "+=": "=", "==": "!=", ">>": "<<", "&": "|", "^": "&",
}  # fmt: skip
"""What takes an operator's place."""

EXCHANGED = (
    "min max", "fmin fmax", "fminf fmaxf", "MINIMUM MAXIMUM", "width height", "x y", "row column", "dx dy",
    "i j", "floor fabs", "floorf fabsf", "left top",
)  # fmt: skip
NAMES = {a: b for pair in map(str.split, EXCHANGED) for a, b in (pair, pair[::-1])}
"""What takes a name's place; numbered names become those before them."""

TOKEN = re.compile(
    r"/\*.*?\*/|//[^\n]*|^[ \t]*#[^\n]*$"
    r"|(?P<number>(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?f?|\d+(?:e[+-]?\d+)?f?u?)(?![\w.]))"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<operator>\+=|&&|\|\||<=|>=|==|>>|<<|\+\+|--|->|[-+*/%<>&^])",
    re.S | re.M,
)

NOTHING = re.compile(r" \(?0\)?(?![\w.])")
"""An integer zero: whether it is added or taken away is the same."""

STATEMENT = re.compile(r"(?m)^ +(?!return|\(void\)|[}#])[^\n{}]*;$")


FOREIGN = (
    "static", "volatile", "register", "unsigned", "signed", "char", "short", "long", "double", "half",
    "mediump", "lowp", "inout", "goto", "while", "discard", "asm", "typedef", "extern", "switch", "0x",
    "1 +", "-", "!", "~", "*", "&", "(char)", "sizeof", "__attribute__((weak))", "\n#pragma x\n",
    "\n#define y\n", "\\", "??/", '"/*"', "'", "`", "$", "@", "\r", "\v", "\u2028", "/*/*", "*/",
)  # fmt: skip
"""Words that no kernel has before most of its words: each changes what it says, or is an error."""

Given = tuple[str, Any, Any, Any]
"""A kernel's text, certificate, manifest and weights."""


class Fault(NamedTuple):
    """A change of a text: where, to what, and what kind of mistake it is."""

    start: int
    end: int
    new: str
    kind: str


def faults(source: str) -> Iterator[Fault]:
    """Yield all faults of a text, those of its comments left out.

    Nor is it one to take a zero away where it was added, nor to keep a macro after the last function.
    """
    start, words = source.index("{", source.index("*/")), 0
    for m in re.finditer(r"(?m)^(?!#undef|__kernel __attr)[^\s/*}][^\n]*\n", source[:start]):
        yield Fault(m.start(), m.end(), "", "a line lost")
    for m in TOKEN.finditer(source, start):
        place = m.start(), m.end()
        if m["number"] or m["name"] or m["operator"]:
            words += 1
            foreign = FOREIGN[words % len(FOREIGN)]
            if (foreign, m["number"]) != ("-", "0"):  # the same number
                yield Fault(m.start(), m.start(), foreign + " ", "a foreign word")
        if m["number"]:
            yield from (Fault(*place, new, kind) for new, kind in numbers(m["number"]))
        elif m["name"] in NAMES:
            yield Fault(*place, NAMES[m["name"]], "another name")
        elif m["name"] and (numbered := re.fullmatch(r"([a-z]+)(\d+)", m["name"])) and m["name"] != "float4":
            yield Fault(*place, f"{numbered[1]}{int(numbered[2]) - 1}", "another variable")
        elif m["operator"] == "+" and NOTHING.match(source, m.end()):
            continue
        elif m["operator"] in OPERATORS:
            yield Fault(*place, OPERATORS[m["operator"]], "another operator")
    for m in STATEMENT.finditer(source, start):
        yield Fault(m.start(), m.end(), "", "a statement lost")
        if "+=" in m[0]:
            yield Fault(m.start(), m.end(), m[0] * 2, "a statement twice")


def numbers(text: str) -> Iterator[tuple[str, str]]:
    """Yield what takes a number's place: another seventh digit, or an integer one more or less."""
    if "." in text or "e" in text:
        digits = [k for k, c in enumerate(text.partition("e")[0]) if c.isdigit()]
        k = digits[min(6, len(digits) - 1)]
        yield f"{text[:k]}{(int(text[k]) + 1) % 10}{text[k + 1 :]}", "the seventh digit of a constant"
        return
    value = int(text.rstrip("uf"))
    tail = text[len(str(value)) :]
    yield f"{value + 1}{tail}", "an integer one more"
    if value:
        yield f"{value - 1}{tail}", "an integer one less"


def spare(source: str, fault: Fault) -> bool:
    """Return whether a fault gives an array more room, which changes nothing."""
    line = source[source.rfind("\n", 0, fault.start) + 1 : source.find("\n", fault.start)]
    before = line[: fault.start - source.rfind("\n", 0, fault.start) - 1]
    size = (
        fault.kind == "a foreign word" and fault.new.endswith("+ ") and before.rfind("[") > before.rfind("]")
    )
    return ROOM.match(line) is not None and (
        size or fault.kind in ("an integer one more", "another operator")
    )


def small(folder: Path) -> Iterator[Path]:
    """Write kernels of a small network: plain in every language that is read, and in tiles; yield folders."""
    network = siren.init((3**2 * 6, 6, 5, 3), 1.0, 3.0, seed=5)
    model = Model(network, ("color", "normal"), Window(3, "clamp"), Normalization())
    for target, schedule, variant in [*((target, "plain", "full") for target in TITLES), *TILES]:
        made = folder / f"{target}-{schedule}"
        write(compile_plan(plan_model(model, target, schedule, variant)), made)
        yield made


def tried(given: Given, count: int, seed: int) -> Iterator[tuple[Fault, bool]]:
    """Plant faults in a kernel's text, one at a time; yield each, and whether the reader notices it."""
    source, *others = given
    every = list(faults(source))
    random.Random(seed).shuffle(every)
    for fault in every[:count]:
        try:
            run_text(source[: fault.start] + fault.new + source[fault.end :], *others)
        except (Refused, Unread):
            yield fault, True
        else:
            yield fault, False


def planted(folder: Path, count: int, seed: int) -> tuple[list[str], int]:
    """Plant faults in a kernel; return a row of the table, and how many were accepted, spare room apart."""
    held, manifest, _, _, weights = read(folder / CERTIFICATE_NAME)
    (name,) = (name for name in manifest["files"] if name != "weights.bin")
    source = (folder / name).read_text()
    run_text(source, held, manifest, weights)  # the text itself must hold
    done: Counter[str] = Counter()
    for fault, noticed in tried((source, held, manifest, weights), count, seed):
        if noticed:
            done["noticed"] += 1
            continue
        harmless = spare(source, fault)
        done["harmless" if harmless else "accepted"] += 1
        line = source.count("\n", 0, fault.start)
        sys.stderr.write(
            f"{'harmless' if harmless else 'ACCEPTED'}: {folder.name}, line {line + 1}, {fault.kind}: "
        )
        sys.stderr.write(f"{source.splitlines()[line].strip()} -> {fault.new!r}\n")
    counts = [len(list(faults(source))), done.total(), done["noticed"], done["harmless"], done["accepted"]]
    return [manifest["target"], manifest["schedule"]["name"], *map(str, counts)], done["accepted"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Plant faults as the command line says; return the exit status."""
    parser = described(__doc__)
    parser.add_argument(
        "folders", type=Path, nargs="*", help="kernels; default: small ones, of all languages"
    )
    parser.add_argument("--count", type=int, default=60, help="faults in each kernel")
    parser.add_argument("--seed", type=int, default=0, help="which of all that are possible")
    options = parser.parse_args(arguments)
    rows, accepted = [], 0
    with TemporaryDirectory() as scratch:
        for folder in options.folders or small(Path(scratch)):
            row, wrong = planted(folder, options.count, options.seed)
            rows.append(row)
            accepted += wrong
    heads = ["target", "schedule", "possible defects", "seeded", "detected", "larger arrays only", "accepted"]
    print(markdown(heads, rows))
    return int(accepted > 0)


if __name__ == "__main__":
    sys.exit(main())
