"""From pictures to verdicts: is a mean the known answer, up to noise and a stated slack?

1. Each picture of a shot has its own seed. The mean of the block in each of N pictures is one sample, so
   that nothing is assumed of the noise within a picture [`samples_of`]. Where all seeds give the same noisy
   picture, its pixels are the samples, and the verdict says so.
2. What is beyond the slack is tested against 0 by the t-test, which is Welch's with a constant on the other
   side [kernels/judge/welch.py]; the least p of three channels counts three times [`measure`].
3. Over all questions Holm's correction says which answers deviate [`judge`]: the chance of any false alarm is
   the significance. A number that is not finite deviates by the rule `finite`.
4. A verdict has an interval for the deviation, and what deviation would have been seen [`Verdict.detects`]. A
   pass that would not have seen [`FEEBLE`] of the answer is called feeble.
5. Under profiles the answers of their intent count, and anything where the intent is None [`expected`].
   Without them a deviation that an intent explains names the profile [`explained`].
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from wamnet.kernels.judge.welch import welch_p

from .cases import PROFILES, RULES, Question

SIGNIFICANCE = 0.01
"""Chance of any false alarm in a run over all questions."""

POWER = 0.9
"""Probability with which a deviation of [`Verdict.detects`] is found."""

FEEBLE = 0.1
"""Share of an answer that a pass must be able to tell from it."""

PASS, FEEBLE_PASS, DEVIATES, UNCONFIRMED, INTENT, UNTESTED, FAILED = (
    "pass",
    "feeble pass",
    "deviates",
    "not confirmed",
    "by intent",
    "not tested",
    "failed",
)
"""What a verdict can be."""

Array = NDArray[np.float64]
Picture = Mapping[str, Any]
"""Layers (H, W, C) by name."""


@dataclass(frozen=True)
class Missing:
    """Why a shot has no pictures: it was not asked (UNTESTED), or there is no answer (FAILED)."""

    state: str
    note: str


@dataclass(frozen=True)
class Verdict:
    """What was found for a question: mean and answer (C,), the half width of an interval, and p.

    `detects`: the deviation that would have been found with probability POWER, in units of the answer's
    scale; `note`: why it was not tested, how it failed, or what explains it; `profile`: whose intent it is;
    `confirmed`: whether a smaller picture with other seeds showed the same, None where nobody asked.
    """

    question: Question
    state: str = UNTESTED
    mean: tuple[float, ...] = ()
    answer: tuple[float, ...] = ()
    half_width: tuple[float, ...] = ()
    p: float = 1.0
    detects: float = float("nan")
    note: str = ""
    profile: str = ""
    confirmed: bool | None = None

    @property
    def deviates(self) -> bool:
        """Tell whether the renderer breaks the rule."""
        return self.state in (DEVIATES, FAILED)

    @property
    def rule(self) -> str:
        """Return the rule that it is about: a number that is not finite breaks that one first.

        An infinite depth where nothing is hit is a way to say so, and breaks the rule of misses.
        """
        mean = np.array(self.mean)
        allowed = np.isinf(mean) if self.question.rule == "misses" else np.zeros(mean.shape, bool)
        strange = self.state == DEVIATES and not np.all(np.isfinite(mean) | allowed)
        return "finite" if strange else self.question.rule

    @property
    def deviation(self) -> tuple[float, ...]:
        """Return mean less answer."""
        return tuple(m - a for m, a in zip(self.mean, self.answer, strict=True))


@dataclass(frozen=True)
class Measured:
    """Samples' mean and standard error (C,), their number, p beyond the slack, and a note."""

    mean: Array
    error: Array
    count: int
    p: float
    note: str = ""


def samples_of(question: Question, pictures: Sequence[Picture]) -> tuple[Array, str]:
    """Return the samples (N, C) of a question's block, and a note where they are not one for each seed."""
    channels = len(question.answer)
    blocks = [_block(question, picture).reshape(-1, channels) for picture in pictures]
    means = np.stack([block.mean(axis=0) for block in blocks])
    if len(means) > 1 and np.all(means == means[0]) and np.any(blocks[0] != blocks[0][0]):
        return blocks[0], "all seeds give one picture: its pixels are the samples"
    return means, ""


def _block(question: Question, picture: Picture) -> Array:
    """Return the pixels (h, w, C) of the question's block."""
    layer = np.asarray(picture[question.layer], np.float64)
    if question.block is None:
        return layer
    top, left, height, width = question.block
    return layer[top : top + height, left : left + width]


def measure(question: Question, answer: Sequence[float], pictures: Sequence[Picture]) -> Measured:
    """Return how far a block's mean is from an answer (C,)."""
    samples, note = samples_of(question, pictures)
    count = len(samples)
    if not np.isfinite(samples).all():
        with np.errstate(invalid="ignore"):
            mean = samples.mean(axis=0)
        return Measured(mean, np.zeros(len(mean)), count, 0.0, "numbers that are not finite")
    # Equal samples have no variance, not the rounding of their sum.
    mean = np.where(np.ptp(samples, axis=0) == 0.0, samples[0], samples.mean(axis=0))
    variance = np.mean((samples - mean) ** 2, axis=0) * count / max(count - 1, 1)
    beyond = np.maximum(np.abs(mean - answer) - question.slack * question.scale, 0.0)
    p = welch_p(beyond, variance, count, 0.0, np.zeros_like(variance), 2)
    least = min(1.0, len(mean) * float(np.min(p)))
    return Measured(mean, np.sqrt(variance / count), count, least, note)


def expected(question: Question, profiles: Collection[str]) -> tuple[tuple[float, ...] | None, str]:
    """Return the answer under profiles, None for any, and the profile that says so."""
    for name, answer in question.intents.items():
        if name in profiles:
            return answer, name
    return question.answer, ""


def holm(p_values: NDArray[np.float64], significance: float) -> NDArray[np.bool_]:
    """Tell (m,) which of m hypotheses fall: from the least p on, while p <= significance / (those left).

    The chance that any true one falls is at most the significance, whatever they have in common: S. Holm, "A
    Simple Sequentially Rejective Multiple Test Procedure", Scandinavian Journal of Statistics 6(2), 1979. NaN
    falls: nobody may take it for a pass.
    """
    p = np.where(np.isnan(p_values), 0.0, p_values)
    order = np.argsort(p, kind="stable")
    left = len(p) - np.arange(len(p))
    falls = np.logical_and.accumulate(p[order] * left <= significance)
    found = np.zeros(len(p), bool)
    found[order] = falls
    return found


@lru_cache(1024)
def student_quantile(tail: float, freedom: float) -> float:
    """Return the t that Student's distribution exceeds with probability `tail` < 1/2."""
    return float(-stdtrit(freedom, tail))


def judge(
    questions: Sequence[Question],
    pictures: Mapping[str, Sequence[Picture] | Missing],
    profiles: Collection[str] = (),
    significance: float = SIGNIFICANCE,
) -> list[Verdict]:
    """Return the verdicts about pictures by the name of their shot."""
    missing = [_missing(question, pictures[question.shot.name]) for question in questions]
    tested = [q for q, why in zip(questions, missing, strict=True) if why is None]
    shown = {name: some for name, some in pictures.items() if not isinstance(some, Missing)}
    found = {q.name: _verdict(q, shown[q.shot.name], profiles, len(tested), significance) for q in tested}
    falls = holm(np.array([found[q.name].p for q in tested]), significance) if tested else np.zeros(0, bool)
    for question, falling in zip(tested, falls, strict=True):
        found[question.name] = _decided(found[question.name], bool(falling), shown[question.shot.name])
    return [found[q.name] if why is None else why for q, why in zip(questions, missing, strict=True)]


def _missing(question: Question, pictures: Sequence[Picture] | Missing) -> Verdict | None:
    """Return the verdict where there is nothing to measure, else None."""
    if isinstance(pictures, Missing):
        return Verdict(question, pictures.state, note=pictures.note)
    for picture in pictures:
        if question.layer not in picture:
            return Verdict(question, note=f"the pictures have no layer {question.layer!r}")
        shape, size = np.shape(picture[question.layer]), question.shot.size
        wanted = (size, size, len(question.answer))
        if shape != wanted:
            return Verdict(question, FAILED, note=f"layer {question.layer!r} is {shape}, and not {wanted}")
    return None


def _verdict(
    question: Question,
    pictures: Sequence[Picture],
    profiles: Collection[str],
    tested: int,
    significance: float,
) -> Verdict:
    """Return a verdict with all numbers, before the correction says whether it deviates."""
    answer, profile = expected(question, profiles)
    found = measure(question, question.answer if answer is None else answer, pictures)
    freedom = max(found.count - 1, 1)
    level = significance / (tested * len(found.mean))
    t = student_quantile(level / 2, freedom)
    reach = t + student_quantile(1.0 - POWER, freedom)
    return Verdict(
        question,
        INTENT if answer is None else PASS,
        tuple(map(float, found.mean)),
        question.answer if answer is None else answer,
        tuple(map(float, t * found.error)),
        1.0 if answer is None else found.p,
        float(question.slack + np.max(reach * found.error) / question.scale),
        found.note,
        profile,
    )


def _decided(verdict: Verdict, falls: bool, pictures: Sequence[Picture]) -> Verdict:
    """Return the verdict after the correction."""
    if verdict.state == INTENT:
        return verdict
    if falls:
        return replace(
            verdict, state=DEVIATES, profile=verdict.profile or explained(verdict.question, pictures)
        )
    return replace(verdict, state=FEEBLE_PASS if verdict.detects > FEEBLE else PASS)


def explained(question: Question, pictures: Sequence[Picture]) -> str:
    """Return the profile whose answer the pictures agree with, or the one that may show anything, or ""."""
    for name, answer in question.intents.items():
        if answer is not None and measure(question, answer, pictures).p > SIGNIFICANCE:
            return name
    return next((name for name, answer in question.intents.items() if answer is None), "")


def first_blamed(verdicts: Sequence[Verdict]) -> Verdict | None:
    """Return the verdict to look at first: of the rule that others rest on."""
    order = list(RULES)
    odd = [verdict for verdict in verdicts if verdict.deviates]
    return min(odd, key=lambda verdict: order.index(verdict.rule), default=None)


def sentence_of(verdict: Verdict) -> str:
    """Return in one sentence what a deviating verdict says, and what may be the reason."""
    if verdict.state == FAILED:
        return f"{verdict.question.name}: {verdict.note}"
    rule = RULES[verdict.rule]
    found = f"{_numbers(verdict.mean)} and not {_numbers(verdict.answer)}"
    text = f"{verdict.question.name}: {found}. {rule.sentence}"
    if verdict.profile:
        return f"{text} It is what profile {verdict.profile} expects: {PROFILES[verdict.profile]}"
    return f"{text} Usual reasons: {rule.suspects}."


def _numbers(values: Sequence[float]) -> str:
    """Return numbers with commas between them."""
    return ", ".join(f"{value:.4g}" for value in values)
