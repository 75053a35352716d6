"""Verdicts: each case is asked, each answer checked against its bounds, and no program causes a traceback.

1. Cases are chosen by kind, clause, flag or part of their id [`chosen`].
2. A verdict is one word [`Verdict`], with the first output that deviates, what was expected, what was found,
   and the error beside its bound [`judge`].
3. `unsupported` is not a failure; the report counts it. A NaN is never within a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels.judge.welch import sidak, welch_p
from ...refimpl.errors import InputError
from . import case as cases_module
from .case import Case, Output
from .numbers import from_file, from_json, is_number, mean_and_variance, number_text
from .protocol import NoAnswerError, Session

Numbers = NDArray[Any]

VERDICTS = PASS, FAIL, UNSUPPORTED, TIMEOUT, CRASH, GARBAGE = (
    "pass", "fail", "unsupported", "timeout", "crash", "garbage",
)  # fmt: skip
"""Verdicts: three of answers, and those of [`NoAnswerError`]."""

MOST_TIMEOUTS = 3
"""Cases of a kind that may run out of time before the others of this kind are given up."""


@dataclass(frozen=True)
class Verdict:
    """What came of a case. `stage`: the first output that deviates; `ratio`: error / bound, the largest."""

    id: str
    kind: str
    clause: str
    verdict: str
    text: str = ""
    stage: str = ""
    expected: str = ""
    got: str = ""
    ratio: float = 0.0

    @property
    def failed(self) -> bool:
        """Return whether this is a failure."""
        return self.verdict not in (PASS, UNSUPPORTED)

    def to_json(self) -> dict[str, Any]:
        """Return the verdict in the form of JSON."""
        return {**asdict(self), "ratio": number_text(self.ratio)}


SCHEMA = "schema.json"
"""Name of the file beside the vectors that says how they are written."""


def read_vectors(folder: Path) -> dict[str, list[Case]]:
    """Return all cases under a folder, by kind."""
    paths = sorted(path for path in folder.glob("*.json") if path.name != SCHEMA)
    if not paths:
        rule = "holds no file of vectors"
        raise InputError("folder of vectors", str(folder), rule, "give spec/vectors or a copy of it")
    return dict(cases_module.load(path) for path in paths)


def chosen(cases: Mapping[str, Sequence[Case]], words: Sequence[str]) -> dict[str, list[Case]]:
    """Return the cases whose id holds one of the words, or whose clause or flag is one; all without words.

    A word with a stroke is a whole id: random.block/1 is not random.block/10.
    """

    def wanted(case: Case) -> bool:
        known = (case.id, *case.clauses, *case.flags)
        return not words or any(word in known or ("/" not in word and word in case.id) for word in words)

    found = {kind: [case for case in some if wanted(case)] for kind, some in cases.items()}
    return {kind: some for kind, some in found.items() if some}


def run(
    session: Session,
    cases: Mapping[str, Sequence[Case]],
    profile: str,
    on_progress: Callable[[int], None] = lambda count: None,
) -> Iterator[Verdict]:
    """Yield a verdict for each case; of a kind that hangs, the cases after some are not asked."""
    known = introduced(session)["kinds"]
    for kind, some in cases.items():
        hung = 0
        for case in some:
            if kind not in known:
                yield Verdict(case.id, kind, case.clause, UNSUPPORTED, "the program does not name this kind")
            elif hung == MOST_TIMEOUTS:
                text = f"not asked: {hung} cases of this kind had no answer in time"
                yield Verdict(case.id, kind, case.clause, TIMEOUT, text)
            else:
                request = {"id": case.id, "kind": kind, "profile": profile, "input": dict(case.inputs)}
                try:
                    yield judge(kind, case, session.ask(request))
                except NoAnswerError as error:
                    hung += error.verdict == TIMEOUT
                    yield Verdict(case.id, kind, case.clause, error.verdict, str(error))
            on_progress(1)


def introduced(session: Session) -> Mapping[str, Any]:
    """Return what a program says of itself, or refuse it."""
    try:
        return session.hello()
    except NoAnswerError as error:
        rule = f"must answer to hello ({error.verdict}: {error})"
        way_out = "see spec/conformance.md; give a path such as ./mine, flush each answer; or set --timeout"
        raise InputError("--program", " ".join(session.command), rule, way_out) from None


def judge(kind: str, case: Case, answer: Mapping[str, Any]) -> Verdict:
    """Hold an answer to what is expected."""
    if answer.get("unsupported"):
        return Verdict(case.id, kind, case.clause, UNSUPPORTED, str(answer["unsupported"])[:200])
    refused = "refused" in answer
    if case.expected is None:
        text = "" if refused else "the input is invalid and must be refused"
        return Verdict(case.id, kind, case.clause, PASS if refused else FAIL, text)
    if refused:
        text = f"a valid input was refused: {str(answer['refused'])[:200]}"
        return Verdict(case.id, kind, case.refusal or case.clause, FAIL, text)
    outputs = answer.get("output")
    if not isinstance(outputs, dict):
        return Verdict(case.id, kind, case.clause, GARBAGE, "the answer has no output")
    largest, found = 0.0, list[Verdict]()
    for name, expected in case.expected.items():
        blamed = expected.clause or case.clause
        if name not in outputs:
            return Verdict(case.id, kind, blamed, FAIL, "the output is missing", name)
        wrong, ratio = _compared(name, expected, outputs[name], outputs, kind in IN_STEPS)
        if wrong:
            found.append(Verdict(case.id, kind, blamed, FAIL, *wrong, ratio))
        if found and kind not in IN_STEPS:
            break
        largest = max(largest, ratio)
    return min(found, key=_step, default=Verdict(case.id, kind, case.clause, PASS, ratio=largest))


IN_STEPS = ("path.whole",)
"""Kinds whose outputs have steps on their first axis: the earliest step that deviates is reported."""


def _step(verdict: Verdict) -> int:
    """Return the step of a deviation: `point[2][0]` is of step 2; another shape is before all."""
    index = verdict.stage.partition("[")[2].partition("]")[0]
    return int(index) if index else -1


Wrong = tuple[str, str, str, str]
"""What is wrong with an output: text, stage, what was expected, what was found."""


def _compared(
    name: str, expected: Output, got: Any, outputs: Mapping[str, Any], in_steps: bool = False
) -> tuple[Wrong | None, float]:
    """Return what is wrong with an output, if anything, and the largest error / bound.

    Where its first axis has steps, that is the worst number of the earliest step that is wrong."""
    if isinstance(expected.value, str) and not is_number(expected.value):
        return (None if got == expected.value else ("another text", name, expected.value, str(got)[:80])), 0.0
    try:
        found = _read(name, got)
        if expected.welch is not None:
            return _as_likely(name, expected, found, _read("variance", outputs.get("variance")), outputs)
    except InputError as error:
        return (str(error), name, "", ""), np.inf
    ways = ({"value": expected.value, "bound": expected.bound}, *expected.accepted)
    verdicts = [_nearness(name, way, found, in_steps) for way in ways]
    return min(verdicts, key=lambda verdict: (verdict[0] is not None, verdict[1]))


def _read(name: str, got: Any) -> Numbers:
    """Return the numbers of an answer, which may be in a file."""
    found = from_file(got, name) if isinstance(got, dict) else from_json(got, f"output {name}")
    return found.astype(np.float64)


def _nearness(
    name: str, expected: Mapping[str, Any], found: Numbers, in_steps: bool
) -> tuple[Wrong | None, float]:
    """Return what is wrong with numbers that should be within the bound of a value, and error / bound."""
    wanted = from_json(expected["value"], name).astype(np.float64)
    if found.shape != wanted.shape:
        return (f"shape {found.shape}, not {wanted.shape}", name, "", ""), np.inf
    bound = np.broadcast_to(from_json(expected["bound"], name).astype(np.float64), wanted.shape)
    # What is not a number, or no number away, is wrong.
    with np.errstate(all="ignore"):
        error = np.where(found == wanted, 0.0, np.abs(found - wanted))
        error = np.where(np.isnan(error), np.inf, error)
        right = (error <= bound) & (error < np.inf)
        ratio = np.where(right & (error == 0), 0.0, np.where(right & (bound > 0), error / bound, np.inf))
        ratio = np.where(~right & (bound > 0), error / bound, ratio)
    if np.all(right):
        return None, float(ratio.max(initial=0.0))
    asked = np.where(right, -1.0, ratio)
    if in_steps:
        first = int(np.argmin(right.reshape(len(right), -1).all(axis=1)))
        asked = np.where(np.arange(len(asked)).reshape(-1, *(1,) * (asked.ndim - 1)) == first, asked, -1.0)
    worst = np.unravel_index(int(np.argmax(asked)), ratio.shape)
    place = name + "".join(f"[{index}]" for index in worst)
    text = f"error {error[worst]:.3g}, bound {bound[worst]:.3g}"
    return (text, place, number_text(wanted[worst]), number_text(found[worst])), float(ratio[worst])


def _as_likely(
    name: str, expected: Output, mean: Numbers, variance: Numbers, outputs: Mapping[str, Any]
) -> tuple[Wrong | None, float]:
    """Hold block means of an estimated picture to those of the reference's, by Welch's test.

    What a sample's variance is, the vectors say: an answer's own could excuse any mean."""
    assert expected.welch is not None
    told = {key: from_json(value, key) for key, value in expected.welch.items()}
    shape = tuple(int(side) for side in told["shape"])
    if mean.shape != shape or variance.shape != shape:
        return (f"shapes {mean.shape} and {variance.shape}, not {shape}", name, "", ""), np.inf
    count, size = int(told["spp"]), int(told["block"])
    own = int(_read("spp", outputs.get("spp", expected.welch["asked"])))
    if own < int(told["asked"]):
        return (f"{own} samples per pixel, {int(told['asked'])} asked", name, "", ""), np.inf
    mean, _ = mean_and_variance(mean, variance, size)
    wanted = from_json(expected.value, name)
    p = welch_p(mean, told["variance"], own, wanted, told["variance"], count)
    level = sidak(float(told["significance"]), p.size)
    least = float(np.min(np.where(np.isnan(p), 0.0, p)))
    if least >= level:
        return None, 0.0
    worst = np.unravel_index(int(np.argmin(np.where(np.isnan(p), 0.0, p))), p.shape)
    place = name + "".join(f"[{index}]" for index in worst)
    text = f"p-value {least:.3g} of a block of {size} x {size} pixels, at least {level:.3g} expected"
    return (text, place, number_text(wanted[worst]), number_text(mean[worst])), np.inf
