"""A whole run: ask for all pictures, judge, and look again at what deviates.

1. Shots are rendered with PICTURES seeds each [`verify`], and judged together.
2. What deviates is asked once more with other seeds, in a picture of half the size where the question is
   about all of it: a deviation counts if that one shows it too, to the same side [`confirmed`].
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .cases import Question, Shot
from .judgement import DEVIATES, SIGNIFICANCE, UNCONFIRMED, Missing, Picture, Verdict, judge, measure
from .renderers import Renderer

PICTURES = 8
"""Pictures of a shot: with 7 degrees of freedom, means of thousands of paths decide about a few per cent."""

AGAIN = 1 << 20
"""Added to seeds when a question is asked again."""


def shots_of(questions: Sequence[Question]) -> list[Shot]:
    """Return the shots of questions, each once."""
    return list({question.shot.name: question.shot for question in questions}.values())


def verify(
    renderer: Renderer,
    questions: Sequence[Question],
    *,
    pictures: int = PICTURES,
    seed: int = 0,
    profiles: Collection[str] = (),
    advance: Callable[[float], Any] = lambda _: None,
) -> list[Verdict]:
    """Return the verdicts about a renderer; `advance` is called after each shot.

    What the form of its scenes means is expected, as under a profile that was named.
    """
    seeds = range(seed, seed + pictures)
    found: dict[str, Sequence[Picture] | Missing] = {}
    for shot in shots_of(questions):
        found[shot.name] = renderer.pictures(shot, seeds)
        advance(1)
    verdicts = judge(questions, found, {*profiles, *renderer.intents})
    return [confirmed(renderer, verdict, seeds) for verdict in verdicts]


def confirmed(renderer: Renderer, verdict: Verdict, seeds: Sequence[int]) -> Verdict:
    """Return a deviating verdict as a smaller case confirms it, or not; others as they are."""
    if verdict.state != DEVIATES:
        return verdict
    question = smaller(verdict.question)
    found = renderer.pictures(question.shot, [seed + AGAIN for seed in seeds])
    if isinstance(found, Missing):
        return replace(verdict, state=UNCONFIRMED, confirmed=False)
    again = measure(question, verdict.answer, found)
    if not np.isfinite(again.mean).all():
        return replace(verdict, confirmed=True)
    worst = int(np.argmax(np.abs(verdict.deviation)))
    same_side = (again.mean[worst] - verdict.answer[worst]) * verdict.deviation[worst] > 0.0
    shows = bool(again.p <= SIGNIFICANCE and same_side)
    return replace(verdict, state=DEVIATES if shows else UNCONFIRMED, confirmed=shows)


def smaller(question: Question) -> Question:
    """Return the question about a picture of half the size; about a part of a picture it stays as it is."""
    if question.block is not None:
        return question
    return replace(question, shot=replace(question.shot, size=question.shot.size // 2))


def counts(verdicts: Sequence[Verdict]) -> Mapping[str, int]:
    """Return how many verdicts there are of each state."""
    return Counter(verdict.state for verdict in verdicts)
