"""Verdicts as JSON and as a Markdown table.

`wamnet-verify-1`: `renderer`, `pictures`, `seed`, `profiles`, `significance`, `counts` by state,
`look_first_at`, and `verdicts`. A verdict has its question's `name`, `rule`, `layer`, `source` and `shot`;
`state`; `mean`, `answer` and `half_width` of the deviation's interval, one number a channel; `p`;
`detects`; `note`, `profile`, `confirmed`. Numbers that are not finite are null.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from wamnet.kernels.cache import clean
from wamnet.refimpl.errors import escaped

from .cases import RULES
from .judgement import DEVIATES, SIGNIFICANCE, UNTESTED, Verdict, first_blamed, sentence_of
from .run import counts

SCHEMA = "wamnet-verify-1"
"""Name and version of the report's form."""


def entry(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict for JSON, but for numbers that it does not know."""
    question = verdict.question
    found = {name: value for name, value in vars(verdict).items() if name != "question"}
    about = {"name": question.name, "rule": verdict.rule, "layer": question.layer, "source": question.source}
    return {**about, "shot": question.shot.name, **found}


def to_json(renderer: str, verdicts: Sequence[Verdict], about: Mapping[str, Any]) -> str:
    """Return the report; `about` says pictures, seed and profiles."""
    first = first_blamed(verdicts)
    data = {
        "schema": SCHEMA,
        "renderer": renderer,
        **about,
        "significance": SIGNIFICANCE,
        "counts": dict(counts(verdicts)),
        "look_first_at": None if first is None else {"rule": first.rule, "case": first.question.name},
        "verdicts": [entry(verdict) for verdict in verdicts],
    }
    return json.dumps(clean(data), indent=1, allow_nan=False) + "\n"


def row(verdict: Verdict) -> tuple[str, ...]:
    """Return a verdict's cells: rule, case, verdict, found, answer, deviation with its interval, remark."""
    found, answer, off = _numbers(verdict) if verdict.mean else ("", "", "")
    remarks = [verdict.note] if verdict.note else []
    if verdict.profile:
        remarks.append(f"as profile {verdict.profile}")
    if verdict.state == DEVIATES and verdict.confirmed:
        remarks.append("confirmed")
    return verdict.rule, verdict.question.name, verdict.state, found, answer, off, "; ".join(remarks)


HEADS = ("rule", "case", "verdict", "found", "answer", "deviation", "remark")
"""Heads of a table of verdicts."""


def _numbers(verdict: Verdict) -> tuple[str, str, str]:
    """Return found, answer and deviation with its interval, in the channel that is farthest off."""
    sizes = [abs(d) if math.isfinite(d) else math.inf for d in verdict.deviation]
    at = sizes.index(max(sizes))
    unit = verdict.question.scale / 100.0
    off = f"{verdict.deviation[at] / unit:+.2f} % ± {verdict.half_width[at] / unit:.2f}"
    return f"{verdict.mean[at]:.4g}", f"{verdict.answer[at]:.4g}", off


def to_markdown(renderer: str, verdicts: Sequence[Verdict]) -> str:
    """Return a page: the counts, the broken rules in sentences, and a table of all cases."""
    told = ", ".join(f"{number} {state}" for state, number in counts(verdicts).items())
    lines = [f"# {escaped(renderer)}", "", f"{told}.", ""]
    odd = [verdict for verdict in verdicts if verdict.deviates]
    first = first_blamed(verdicts)
    if first is not None:
        lines += [f"Look first at rule `{first.rule}`: others rest on it.", ""]
        lines += [*(f"* {escaped(sentence_of(verdict))}" for verdict in odd), ""]
    untested = {verdict.rule for verdict in verdicts if verdict.state == UNTESTED}
    if silent := [rule for rule in RULES if rule in untested]:
        lines += [f"Rules with cases that were not tested: {', '.join(silent)}.", ""]
    lines += [_line(HEADS), _line(["---"] * len(HEADS)), *(_line(row(verdict)) for verdict in verdicts)]
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    """Return a line of a Markdown table."""
    return "| " + " | ".join(escaped(cell).replace("|", "\\|") for cell in cells) + " |"
