"""Verdicts about claims, each decided on the interval of the very number that the claim is about.

1. A question asks whether a number is above a bound, or below it [`Question`]; its answer has the number, its
   interval (95 %, over seeds and poses) and a verdict [`Answer`].
2. A number is above a bound if its whole interval is, and not above it if the whole interval is below. An
   interval that holds the bound decides nothing, nor does one value, which has no interval [`decide`].
3. What cannot be had, or is not finite, is not tested, with the reason [`Untested`].
4. A claim holds if all of the answers that decide it do; one that does not hold decides against it; else it
   is not tested if one of them is not [`together`].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .intervals import Interval

HOLDS, FAILS, OPEN, UNTESTED = "holds", "does not hold", "not decided", "not tested"
"""The verdicts."""


class Untested(Exception):
    """A number that a claim needs cannot be had; its text says why."""


@dataclass(frozen=True)
class Measured:
    """An interval, what it is over, and, of a comparison, both means."""

    interval: Interval
    over: str
    means: tuple[float, ...] = ()


@dataclass(frozen=True)
class Question:
    """Whether a number is above a bound, or below it; `decides`: whether the claim depends on it.

    `digits` after the point; `means_digits`: those of the means that are compared, if they are others.
    """

    what: str
    bound: float
    above: bool = True
    decides: bool = True
    digits: int = 2
    unit: str = ""
    means_digits: int | None = None

    def ask(self, measure: Callable[[], Measured]) -> Answer:
        """Return the answer of what is measured, or why there is none."""
        try:
            found = measure()
        except Untested as error:
            return Answer(self, None, UNTESTED, str(error))
        verdict, reason = decide(found.interval, self.bound, self.above)
        return Answer(self, found, verdict, reason)


@dataclass(frozen=True)
class Answer:
    """A question, what was measured, the verdict, and the reason where it is not clear."""

    question: Question
    found: Measured | None
    verdict: str
    reason: str = ""

    def as_data(self) -> dict[str, Any]:
        """Return the answer as a record holds it; what is not known is left out."""
        asked = self.question
        data: dict[str, Any] = {"what": asked.what, "bound": asked.bound, "above": asked.above}
        data |= {"decides": asked.decides, "digits": asked.digits, "unit": asked.unit}
        data |= {"verdict": self.verdict, "reason": self.reason}
        if self.found is not None and self.verdict != UNTESTED:
            found = self.found.interval
            data |= {"mean": found.mean, "low": found.low, "high": found.high, "over": self.found.over}
            data["means"] = list(self.found.means)
            data["means_digits"] = asked.digits if asked.means_digits is None else asked.means_digits
        return data


def decide(found: Interval, bound: float, above: bool = True) -> tuple[str, str]:
    """Return the verdict of an interval, and the reason where it is not clear."""
    if not all(map(math.isfinite, (found.mean, found.low, found.high, bound))):
        return UNTESTED, "a number is not finite"
    if found.seeds * found.poses == 1:
        return OPEN, "one value has no interval"
    if found.low > bound:
        return (HOLDS if above else FAILS), ""
    if found.high < bound:
        return (FAILS if above else HOLDS), ""
    return OPEN, ""


def together(answers: Sequence[Mapping[str, Any]]) -> str:
    """Return the verdict about a claim from the answers to its questions, as records hold them."""
    found = [answer["verdict"] for answer in answers if answer["decides"]]
    for verdict in (FAILS, UNTESTED, OPEN):
        if verdict in found:
            return verdict
    return HOLDS if found else UNTESTED


def said(answer: Mapping[str, Any], alone: bool) -> str:
    """Return an answer in words, from a record; `alone`: its verdict is the claim's, and not repeated."""
    beside = "" if answer["decides"] else "beside it, "
    verdict = "" if alone else answer["verdict"]
    if "mean" not in answer:
        return f"{beside}{answer['what']}: {', '.join(filter(None, (verdict, answer['reason'])))}"
    write = f"{{:.{answer['digits']}f}}".format
    unit = f" {answer['unit']}" if answer["unit"] else ""
    means = " to ".join(f"{mean:.{answer['means_digits']}f}" for mean in answer["means"])
    ends = "" if answer["reason"] else f" [{write(answer['low'])}, {write(answer['high'])}]"
    parts = [means, f"{write(answer['mean'])}{ends}{unit}", answer["over"]]
    wanted = f"{'above' if answer['above'] else 'below'} {answer['bound']:g}"
    parts.append(f"{wanted}? {verdict}" if verdict else f"{wanted}?")
    return f"{beside}{answer['what']}: {', '.join(filter(None, [*parts, answer['reason']]))}"
