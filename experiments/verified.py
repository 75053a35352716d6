"""What renderers do with scenes whose answers are known: `wamnet verify-renderer` on each that is here.

1. Each renderer is asked all cases [spec/conformance/renderers/run.py]; a row of the first table says for
   each rule how many of its cases passed, and which profile explains the others.
2. The second table has a row for each deviation, with what a smaller case with other seeds said of it.
3. Those of `renderers.KNOWN` have commands; the path tracer of three.js is a page [lab/in_page.py].
4. What was found of a renderer is kept in the folder of results: an interrupted run resumes there. One that
   is not installed fails in all cases, and its column says so.

    python experiments/verified.py --only wamnet,mitsuba
    python experiments/publish.py --run verified python experiments/verified.py
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from lab import in_page
from lab.command import begin
from lab.tables import markdown

from wamnet.cli.files.outputs import write_text
from wamnet_verify import judgement, renderers, report, run
from wamnet_verify.case import RULES
from wamnet_verify.cases import questions
from wamnet_verify.command import read_layers
from wamnet_verify.judgement import Verdict

NAMES = ("wamnet", *renderers.KNOWN, in_page.NAME)
"""Renderers, in the order of the table."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", type=lambda text: text.split(","), default=list(NAMES), help="renderers")
    parser.add_argument("--executor", default="opencl", help="what traces the paths of wamnet")
    parser.add_argument("--pictures", type=int, default=run.PICTURES, help="of each case, by other seeds")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/verified"), help="folder of results")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    found = {name: kept(name, options) for name in options.only}
    cells = [[rule, *(each["cells"][rule] for each in found.values())] for rule in RULES]
    print(markdown(["rule", *found], cells))
    heads = ["renderer", *report.HEADS[:2], *report.HEADS[3:]]
    print(markdown(heads, [[name, *row] for name, each in found.items() for row in each["rows"]]))


def kept(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """Return what was found of a renderer, from the folder or by asking it."""
    path = options.output / f"{name}.json"
    if not path.exists():
        with opened(name, options.executor) as renderer:
            verdicts = run.verify(renderer, questions(), pictures=options.pictures)
        print(f"{name}: {dict(run.counts(verdicts))}", file=sys.stderr)
        shown = [report.row(verdict) for verdict in verdicts if verdict.deviates]
        rows = [[*row[:2], *row[3:]] for row in shown]
        data = {"cells": {rule: cell(verdicts, rule) for rule in RULES}, "rows": rows}
        write_text(path, json.dumps(data, indent=1) + "\n")
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


@contextmanager
def opened(name: str, executor: str) -> Iterator[renderers.Renderer]:
    """Yield a renderer by name."""
    if name != in_page.NAME:
        yield renderers.known(name, executor, read_layers)
        return
    with closing(in_page.PathTracer()) as renderer:
        yield renderer


def cell(verdicts: Sequence[Verdict], rule: str) -> str:
    """Return what a renderer does with a rule, in few words."""
    if rule == "finite":
        broken = sum(v.rule == rule for v in verdicts if v.deviates)
        return f"{broken} broken" if broken else "kept" if any(v.mean for v in verdicts) else "not tested"
    mine = [v for v in verdicts if v.question.rule == rule]
    tested = [v for v in mine if v.state != judgement.UNTESTED]
    odd = [v for v in tested if v.deviates]
    if not tested:
        return "not tested"
    silent = f", {len(mine) - len(tested)} not tested" if len(tested) < len(mine) else ""
    feeble = sum(v.state in (judgement.FEEBLE_PASS, judgement.UNCONFIRMED) for v in tested)
    if not odd:
        return f"{len(tested)} pass{f', {feeble} of them feeble' if feeble else ''}{silent}"
    whose = {v.profile or "none known" for v in odd}
    named = f" ({', '.join(sorted(whose))})" if whose != {"none known"} else ""
    return f"**{len(odd)} of {len(tested)} deviate**{named}{silent}"


if __name__ == "__main__":
    begin(main)
