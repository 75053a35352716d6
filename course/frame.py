"""What graders are made of: a check, what it finds wrong, and the likeliest mistake.

1. A lab's checks are functions of the student's functions [`Check`], which run in another process. One that
   returns has passed; one that finds something wrong raises [`Wrong`]: the clause, what was expected, what
   was found, the likeliest mistake.
2. [`expect`] compares numbers. A list of values that known mistakes give, each with its explanation, turns
   what was found into the likeliest mistake. NaN is never within a bound.
3. [`vectors`] asks all cases of a kind of the spec's vectors, as `wamnet conformance` does.
4. An exception in the student's code is a finding too; common ones are explained [`of_exception`].
5. Random numbers are those of refimpl/rng.py with fixed seeds; a test's significance is [`SIGNIFICANCE`].
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl import rng
from wamnet.refimpl.errors import shown
from wamnet.spec.conformance import case as cases
from wamnet.spec.conformance.case import Case, given, load
from wamnet.spec.conformance.numbers import to_json
from wamnet.spec.conformance.run import judge

from .wire import Raised, names_of

VECTORS = Path(cases.__file__).resolve().parents[1] / "vectors"
"""The spec's vectors."""

SIGNIFICANCE = 0.01
"""Chance that a statistical check rejects a right answer: always or never, since its numbers are fixed."""

ALIKE = 1e-6
"""What is found counts as the value of a known mistake up to so much of the largest number of that value."""

Likely = Sequence[tuple[Any, str]]
"""Values that known mistakes give, and the explanation of each."""

ROUGH = 2e-6
"""What single precision or a constant of six digits is off by, relative to the largest number."""


class Check(NamedTuple):
    """A check of a lab: its name, and what it does with the student's module."""

    name: str
    run: Callable[[Any], None]


class Wrong(Exception):
    """What a check finds wrong: clause, what was looked at, expected, found, and the likeliest mistake.

    A student's strings may be among the parts: each is one line without control characters.
    """

    def __init__(self, clause: str, what: str, expected: str, found: str, likely: str = "") -> None:
        parts = [shown(part) for part in (clause, what, expected, found, likely)]
        super().__init__(*parts)
        self.clause, self.what, self.expected, self.found, self.likely = parts

    def __str__(self) -> str:
        """Return one line without control characters."""
        told = f"{self.clause}: " if self.clause else ""
        told += f"{self.what}: {self.expected} expected, {self.found} found"
        return shown(told + (f"; likely: {self.likely}" if self.likely else ""))


def number_text(value: Any) -> str:
    """Return numbers as a message shows them: few digits, the first of many."""
    try:
        array = np.asarray(value)
        if array.dtype == object or array.dtype.kind in "US":
            return shown(repr(value), 120)
        if array.ndim == 0:
            return f"{array[()]:.7g}" if array.dtype.kind == "f" else str(array[()])
        text = ", ".join(number_text(one) for one in array.ravel()[:6])
        return f"[{text}{', ...' if array.size > 6 else ''}]"
    except (TypeError, ValueError):
        return shown(repr(value), 120)


def numbers_of(clause: str, what: str, found: Any, shape: tuple[int, ...] | None = None) -> NDArray[Any]:
    """Return the student's result as an array; Wrong for None, what is no number, and another shape."""
    wanted = "numbers" if shape is None else f"numbers of shape {shape}"
    if found is None:
        raise Wrong(clause, what, wanted, "None", "a path through the function has no `return`")
    try:
        array = np.asarray(found)
    except (TypeError, ValueError):
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        likely = "a list of arrays of different shapes, or a tuple where one array belongs"
        raise Wrong(clause, what, wanted, type(found).__name__, likely)
    if shape is not None and array.shape != shape:
        likely = "the axis of the components is the last one; sums over it need axis=-1"
        if array.shape == shape[::-1]:
            likely = "the axes are transposed"
        elif array.ndim == 0 and shape:
            likely = "a sum or a mean over all axes where one axis is meant: axis=-1"
        raise Wrong(clause, f"the shape of {what}", str(shape), str(array.shape), likely)
    return array


def expect(
    clause: str,
    what: str,
    found: Any,
    expected: Any,
    bound: float = 0.0,
    likely: Likely = (),
    otherwise: str = "",
) -> None:
    """Refuse numbers found (...) that are farther than `bound` from those expected (...).

    `likely` explains values of known mistakes; `otherwise` is the explanation of any other value.
    """
    expected = np.asarray(expected)
    array = numbers_of(clause, what, found, expected.shape)
    if array.dtype.kind == "b" or expected.dtype.kind == "b":
        good = array == expected
    else:
        with np.errstate(all="ignore"):
            near = np.abs(array.astype(np.float64) - expected.astype(np.float64)) <= bound
        good = near | (array == expected)
    if np.all(good):
        return
    reason = next((text for value, text in likely if alike(array, value, bound)), otherwise)
    if array.dtype == np.float32 and alike(array, expected) and np.all(bound < ALIKE / 100):
        reason = "single precision: the result is in float32, and float64 is expected"
    if not reason and array.dtype.kind == "f" and np.any(np.isnan(array)):
        reason = "a root of a negative number, or 0 / 0"
    if array.ndim and array.size > 6:
        at = tuple(int(i) for i in np.argwhere(~good)[0])
        what, expected, found = f"{what} at {list(at)}", expected[at], array[at]
    told = number_text(expected), number_text(found)
    if told[0] == told[1]:
        told = repr(np.asarray(expected).tolist()), repr(np.asarray(found).tolist())
    raise Wrong(clause, what, *told, reason)


def alike(found: Any, value: Any, bound: float = 0.0) -> bool:
    """Tell whether two arrays are equal up to `bound`, or up to ALIKE of the largest; NaN is NaN."""
    a, b = np.asarray(found, np.float64), np.asarray(value, np.float64)
    if a.shape != b.shape:
        return False
    with np.errstate(all="ignore"):
        finite = np.abs(b)[np.isfinite(b)]
        most = max(bound, ALIKE * float(finite.max(initial=0.0)))
        return bool(np.all((np.abs(a - b) <= most) | (a == b) | (np.isnan(a) & np.isnan(b))))


def still(*arrays: Any) -> tuple[Any, ...]:
    """Return copies of arrays that cannot be written to: who changes an argument gets an error."""
    found = tuple(np.array(array) for array in arrays)
    for array in found:
        array.flags.writeable = False
    return found


def near(found: Any, wanted: Any) -> bool:
    """Tell whether numbers differ by what float32, or a constant of a few digits, makes of them."""
    return alike(found, wanted, ROUGH * max(1.0, float(np.abs(wanted).max(initial=0.0))))


SINGLE = "single precision somewhere, or a constant of a few digits: np.pi, np.radians, float64 all the way"
"""The explanation of numbers that are near the right ones."""


def hold(clause: str, what: str, good: Any, expected: str, found: Any, likely: str = "") -> None:
    """Refuse what does not hold: `good` is a boolean."""
    if not bool(good):
        raise Wrong(clause, what, expected, found if isinstance(found, str) else number_text(found), likely)


def equal(clause: str, what: str, found: Any, expected: Any, likely: str = "") -> None:
    """Refuse what is not equal to what is expected: a count, a shape, a name."""
    hold(clause, what, found == expected, str(expected), str(found), likely)


def results(clause: str, what: str, found: Any, count: int, expected: str, likely: str = "") -> None:
    """Refuse what is not a tuple or a list of so many results."""
    several, kind = isinstance(found, (tuple, list)), type(found).__name__
    told = f"{kind} of {len(found)}" if several else kind
    hold(clause, what, several and len(found) == count, expected, told, likely)


REFUSALS = (
    ArithmeticError, AssertionError, AttributeError, LookupError, RecursionError, TypeError, ValueError
)  # fmt: skip
"""Exceptions that code raises where it should refuse with another one."""


def refuses(
    clause: str,
    what: str,
    kind: type[Exception],
    call: Callable[[], Any],
    likely: str,
    told: Callable[[Any], str],
) -> None:
    """Call what must raise an exception of a kind; `told` says what an answer is."""
    try:
        answer = call()
    except kind:
        return
    except REFUSALS as error:
        found = f"{type(error).__name__}: {error}"
    else:
        found = told(answer)
    raise Wrong(clause, what, kind.__name__, found, likely)


def kind_of_number(clause: str, what: str, found: Any, dtype: Any) -> None:
    """Refuse an array of another kind of number than is expected."""
    array, wanted = numbers_of(clause, what, found), np.dtype(dtype)
    likely = f"a constant or an array of {array.dtype} among the operands: make it {wanted} first"
    hold(clause, f"the kind of {what}", array.dtype == wanted, str(wanted), str(array.dtype), likely)


HEXADECIMAL = re.compile(r"-?0x[01]\.?[0-9a-f]*p[+-]\d+")
"""A float as vectors write it."""

Answer = Callable[[Mapping[str, Any]], Mapping[str, Any]]
"""From a case's inputs, as arrays, to its outputs by name."""

Explain = Callable[[Case, Mapping[str, Any], Mapping[str, Any]], str]
"""From a case that fails, its inputs and the answer to the likeliest mistake, or ""."""


OF_PROGRAMS = ("CNF-9", "RDG-4")
"""Clauses of what programs are sent, which a student's functions do not see."""


@cache
def cases_of(kind: str) -> Sequence[Case]:
    """Return the spec's cases of a kind, which a process that grades a class reads once."""
    return load(VECTORS / f"{kind}.json")[1]


def vectors(
    kind: str, answer: Answer, only: Sequence[str] = (), likely: str = "", explain: Explain | None = None
) -> None:
    """Ask all cases of a kind; `only` are the outputs that count. Wrong names the case and its clause."""
    for case in cases_of(kind):
        if case.clause in OF_PROGRAMS:
            continue
        if only and case.expected is not None:
            case = replace(case, expected={name: case.expected[name] for name in only})
        inputs = {name: _kept(given(value)) for name, value in case.inputs.items()}
        results: Mapping[str, Any] = {}
        given_back: Mapping[str, Any]
        try:
            results = answer(inputs)
            for name, value in results.items():
                numbers_of(case.clause, f"{name} of {case.id}", value)
            found = {name: to_json(_plain(value)) for name, value in results.items()}
            given_back = {"output": found}
        except ValueError as error:
            # A case that has to be refused is; any other exception says what is wrong itself.
            if case.expected is not None:
                raise
            given_back = {"refused": str(error)}
        verdict = judge(kind, case, given_back)
        if verdict.failed:
            note = f" ({case.note})" if case.note else ""
            reason = (explain(case, inputs, results) if explain else "") or likely
            what = f"{verdict.stage} of {case.id}{note}" if verdict.stage else f"{case.id}{note}"
            if case.expected is None and "output" in given_back:
                text = f"it breaks {case.clause}: check it, and raise ValueError"
                raise Wrong(case.clause, what, "ValueError: this input is invalid", "an answer", text)
            expected = verdict.expected if verdict.stage else "what the case says"
            raise Wrong(case.clause, what, _decimal(expected), _decimal(verdict.got or verdict.text), reason)


def asked(
    kind: str, answer: Callable[[Any, Mapping[str, Any]], Mapping[str, Any]], likely: str
) -> Callable[[Any], None]:
    """Return the check that asks all cases of a kind; `answer` takes the student too."""
    return lambda student: vectors(kind, partial(answer, student), likely=likely)


def _kept(value: Any) -> Any:
    """Return an input that cannot be written to, where it is an array."""
    return still(value)[0] if isinstance(value, np.ndarray) else value


def _decimal(text: str) -> str:
    """Return a text with its hexadecimal floats as decimal ones."""
    return HEXADECIMAL.sub(lambda found: f"{float.fromhex(found[0]):.9g}", text)


def _plain(value: Any) -> Any:
    """Return a value as an array, or as a number where it is one."""
    array = np.asarray(value)
    return array if array.ndim else array[()]


MASK = "a mask of another shape than the array: make that from the shape of a result, not of one argument"
"""The explanation of a mask that does not fit."""

EXPLAINED = (
    ("NotImplementedError", "", "it is still to be written"),
    ("NameError", "'np'", "`import numpy as np` is missing at the top"),
    ("NameError", "'math'", "`import math` is missing; on arrays use np instead"),
    ("NameError", "", "a misspelt name, or one that is set only on another path"),
    ("UnboundLocalError", "", "a name that is set only on another path"),
    ("ValueError", "is ambiguous", "`if`, `and`, `or`, `min` or `max` on an array: np.where, &, |"),
    ("TypeError", "can be converted to", "a function of `math`, or float(), on an array: take that of np"),
    (
        "TypeError",
        "not supported for the input types",
        "a number of another kind: keep constants as they are",
    ),
    ("TypeError", "can not be traced", "an operation that a kernel does not have"),
    ("ValueError", "broadcast", "axes that do not fit: a number per ray goes with vectors as t[..., None]"),
    ("ValueError", "matmul", "the matrix is (D_out, D_in): x @ W.T"),
    ("ValueError", "read-only", "an argument is changed: make a new array"),
    (
        "IndexError",
        "for array of dimension",
        "one ray has no axis beside its components: axis=-1, not axis=1",
    ),
    ("IndexError", "too many indices for array: array is 0-dimensional, but 1 were", MASK),
    ("IndexError", "boolean index", MASK),
    ("IndexError", "too many indices", "one ray has no axis beside its components: [..., 0], not [:, 0]"),
    ("IndexError", "", "an index beyond the end"),
    ("KeyError", "", "a name that the dictionary does not hold"),
    ("AttributeError", "'NoneType'", "a function without `return` gives None"),
    ("AttributeError", "has no attribute", "a function or constant of the skeleton is gone or renamed"),
    ("RecursionError", "", "a function that calls itself without an end"),
    ("MemoryError", "", "an array that grows with every turn, or an axis too many"),
    ("ZeroDivisionError", "", "a divisor that can be 0: guard it"),
    (
        "ImportError",
        "",
        "the course needs NumPy and wamnet only; other packages are not there when it is graded",
    ),
    ("SyntaxError", "", "the file is not Python: a bracket, a colon or an indentation"),
    ("SystemExit", "", "it calls sys.exit or exit: return a value"),
    ("OSError", "", "a lab only computes: its functions need no files, processes or network"),
)
"""Names of exceptions, a part of their message, and their likely meaning; the first that fits counts."""


class Ended(BaseException):
    """The student's process has ended, or is to be ended; no check continues."""


def of_exception(error: BaseException, name: str) -> Wrong:
    """Return an exception of the student's code as a finding, with its line."""
    if isinstance(error, Wrong):
        return error
    names, text = names_of(error), str(error)
    where = f", line {error.line}" if isinstance(error, Raised) and error.line else ""
    likely = next((told for kind, part, told in EXPLAINED if kind in names and part in text), "")
    return Wrong("", name, "a result", f"{names[0]}{f': {text}' if text else ''}{where}", likely)


def outcome(check: Check, student: Any) -> Wrong | None:
    """Return what a check finds wrong with a student's functions, or None."""
    try:
        with np.errstate(all="ignore"):
            check.run(student)
    except Exception as error:  # noqa: BLE001
        return of_exception(error, check.name)
    return None


def uniforms(stream: int, count: int, block: int = 0) -> tuple[NDArray[np.float64], ...]:
    """Return four arrays of uniform numbers (count,) in [0, 1), named by a stream and a block."""
    first, second, third, fourth = (rng.counter(c) for c in (stream, np.arange(count), 0, block))
    return rng.uniforms(first, second, third, fourth, np.float64)


def spread(stream: int, shape: tuple[int, ...], low: float, high: float) -> NDArray[np.float64]:
    """Return uniform numbers of a shape in [low, high)."""
    count = math.prod(shape)
    return low + (high - low) * uniforms(stream, count)[0].reshape(shape)


def normals(stream: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return normal numbers of a shape, by Box and Muller."""
    u0, u1, _, _ = uniforms(stream, math.prod(shape))
    return (np.sqrt(-2.0 * np.log1p(-u0)) * np.cos(2.0 * np.pi * u1)).reshape(shape)


def normal_p(z: float) -> float:
    """Return the two-sided p-value of a normal deviate; NaN gives 0."""
    return math.erfc(abs(z) / math.sqrt(2.0)) if not math.isnan(z) else 0.0


def chi_square_p(observed: NDArray[Any], expected: float) -> float:
    """Return the p-value of counts (n,), n odd, each of which is expected to be `expected`.

    For n - 1 = 2 k degrees of freedom it is exp(-s / 2) times the sum over i < k of (s / 2)^i / i!.
    """
    half = float(np.sum((observed - expected) ** 2) / expected) / 2.0
    if half == 0.0:
        return 1.0
    terms = (i * math.log(half) - math.lgamma(i + 1) - half for i in range((observed.size - 1) // 2))
    return min(1.0, math.fsum(map(math.exp, terms)))
