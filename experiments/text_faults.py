"""Plant faults in the text of any kernel, one at a time, and ask the reader of texts whether it notices.

    python experiments/text_faults.py FOLDER [--count 500] [--seed 0]

FOLDER has a kernel with its manifest and certificate. A fault changes a digit of a constant, an integer by
one, an operator, a name, or loses or repeats a statement. Printed are the faults that the reader accepts, to
be looked at: an array with a spare number, say, changes nothing. Status 1 if there are any.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wamnet.compiler.proof.evidence import Refused, read
from wamnet.compiler.reading.check import run_text
from wamnet.compiler.reading.lanes import Unread

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

STATEMENT = re.compile(r"(?m)^ +(?!return|[}#])[^\n{}]*;$")


class Fault(NamedTuple):
    """A change of a text: where, to what, and what kind of mistake it is."""

    start: int
    end: int
    new: str
    kind: str


def faults(source: str) -> Iterator[Fault]:
    """Yield all faults of a text, those of its comments and of its preprocessor left out."""
    start = source.index("{", source.index("*/"))
    for m in TOKEN.finditer(source, start):
        place = m.start(), m.end()
        if m["number"]:
            yield from (Fault(*place, new, kind) for new, kind in numbers(m["number"]))
        elif m["name"] in NAMES:
            yield Fault(*place, NAMES[m["name"]], "another name")
        elif m["name"] and (numbered := re.fullmatch(r"([a-z]+)(\d+)", m["name"])) and m["name"] != "float4":
            yield Fault(*place, f"{numbered[1]}{int(numbered[2]) - 1}", "another variable")
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


def main() -> int:
    """Plant faults as the command line says; return the exit status."""
    parser = argparse.ArgumentParser(description="Plant faults in a kernel's text.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, help="write the counts as JSON")
    options = parser.parse_args()
    held, manifest, *_ = read(options.folder / "denoise.certificate.json")
    weights = np.frombuffer((options.folder / "weights.bin").read_bytes(), "<f4")
    (name,) = (name for name in manifest["files"] if name != "weights.bin")
    source = (options.folder / name).read_text()
    run_text(source, held, manifest, weights)  # the text itself must hold
    every = list(faults(source))
    random.Random(options.seed).shuffle(every)
    noticed: Counter[str] = Counter()
    accepted = []
    for fault in every[: options.count]:
        try:
            run_text(source[: fault.start] + fault.new + source[fault.end :], held, manifest, weights)
        except (Refused, Unread):
            noticed[fault.kind] += 1
        else:
            line = source.count("\n", 0, fault.start)
            accepted.append((line + 1, fault.kind, source.splitlines()[line].strip(), fault.new))
            print(f"accepted: line {line + 1}, {fault.kind}: {accepted[-1][2]} -> {fault.new!r}", flush=True)
    found = {
        "target": manifest["target"], "schedule": manifest["schedule"]["name"], "possible": len(every),
        "planted": noticed.total() + len(accepted), "noticed": dict(noticed), "accepted": accepted,
    }  # fmt: skip
    print(
        f"{noticed.total()} of {found['planted']} noticed, {len(every)} possible; accepted: {len(accepted)}"
    )
    if options.output:
        options.output.write_text(json.dumps(found, indent=1) + "\n")
    return int(bool(accepted))


if __name__ == "__main__":
    sys.exit(main())
