"""Mutants of the reference before the judge: each in a process of its own, asked what reaches it.

1. The cases of all kinds are asked in the order of blame, the most elementary kind first: the first failure
   is the one that `wamnet conformance` says to look at first [`in_order`].
2. Which lines a case reaches is traced once; a mutant is asked only the cases that reach its statement
   [`reach`]. What runs as modules are imported is reached by those who use what it makes (users.py).
3. A mutant runs in a fork of this process [`forked`]: a function gets the code of the changed text; for a
   change outside of functions, or in one that an import calls, all modules are imported again [`install`].
4. It is caught by a wrong answer, an exception, a refusal, or one that does not come in time [`asked`].
"""

import functools
import gc
import importlib
import io
import json
import os
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import Any, NamedTuple

from wamnet.spec.conformance import program, run, vectors
from wamnet.spec.conformance.case import Case
from wamnet.spec.conformance.report import ELEMENTARY

from .mutation import Mutant, mutated
from .users import Users

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""

LIMIT_S = 20
"""Longest time for an answer: many times what the slowest case takes."""

MEMORY_BYTES = 8 << 30
"""Memory of a mutant: one that wants more fails."""

STATISTICAL = ("picture.rendered",)
"""Kinds that are judged by chance."""

Reach = Mapping[tuple[str, int], frozenset[int]]
"""Numbers of the cases that reach a line of a module."""


class Outcome(NamedTuple):
    """What came of a mutant: the first case that failed, its clause and output, and how; else it survives.

    `asked` is the number of cases that reach it, 0 where none does."""

    asked: int
    case: str = ""
    clause: str = ""
    stage: str = ""
    verdict: str = ""
    text: str = ""


class LateError(BaseException):
    """An answer has not come in time; no handler of errors takes it."""


def paths() -> list[str]:
    """Return the modules of the reference: what requests go through, without the words of errors."""
    found = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "refimpl").rglob("*.py"))
    named = [p for p in found if not p.endswith("__init__.py") and p != "refimpl/errors.py"]
    return [*named, "models/model_file.py"]


def dotted(path: str) -> str:
    """Return the name under which a module is imported."""
    return "wamnet." + path.removesuffix(".py").replace("/", ".")


def in_order() -> list[tuple[str, Case]]:
    """Return kinds and cases, the most elementary kind first, as blame goes."""

    def rank(kind: str) -> int:
        return min(
            (i for i, start in enumerate(ELEMENTARY) if kind.startswith(start)), default=len(ELEMENTARY)
        )

    cases = run.read_vectors(vectors.FOLDER)
    return [(kind, case) for kind in sorted(cases, key=rank) for case in cases[kind]]


# ---- processes --------------------------------------------------------------------------------------------


def forked(task: Callable[[], Any]) -> Any:
    """Return what a task returns, as JSON, from a fork; None where it ended otherwise."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.close(read)
            with os.fdopen(write, "w") as pipe:
                json.dump(task(), pipe)
            status = 0
        except BaseException:  # noqa: BLE001 - whatever it is, the parent must not return here
            traceback.print_exc()
        finally:
            os._exit(status)
    os.close(write)
    with os.fdopen(read) as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    return json.loads(text) if text else None


def _late(number: int, frame: FrameType | None) -> None:
    """Be the handler of the alarm."""
    raise LateError


# ---- reach ------------------------------------------------------------------------------------------------


class Reached(NamedTuple):
    """Cases by the lines that they reach, their seconds, functions that imports call, users of names."""

    lines: Reach
    seconds: list[float]
    at_import: frozenset[tuple[str, str]]
    users: Users


def reach(cases: Sequence[tuple[str, Case]]) -> Reached:
    """Return which cases reach which lines, from the reference as it is."""
    names = {str(ROOT / path): path for path in paths()}
    imported = forked(lambda: sorted(_imported(names)))
    rows = forked(lambda: [_lines(names, kind, case) for kind, case in cases])
    found: dict[tuple[str, int], set[int]] = {}
    for number, row in enumerate(rows):
        for path, line in row["lines"]:
            found.setdefault((path, line), set()).add(number)
    lines = {place: frozenset(some) for place, some in found.items()}
    users = Users({path: (ROOT / path).read_text(encoding="utf-8") for path in names.values()})
    seconds = [row["seconds"] for row in rows]
    return Reached(lines, seconds, frozenset((p, f) for p, f in imported), users)


def _imported(names: Mapping[str, str]) -> set[tuple[str, str]]:
    """Return the modules and functions that run as everything is imported."""
    found: set[tuple[str, str]] = set()

    def trace(frame: FrameType, event: str, argument: Any) -> Any:
        path = names.get(frame.f_code.co_filename)
        if path is not None:
            found.add((path, _outermost(frame.f_code)))

    _purge()
    sys.settrace(trace)
    try:
        for path in names.values():
            importlib.import_module(dotted(path))
    finally:
        sys.settrace(None)
    return found


def _outermost(code: CodeType) -> str:
    """Return the name of the outermost function of a code, with its classes."""
    name: str = getattr(code, "co_qualname", code.co_name)  # since Python 3.11 with its classes
    return name.partition(".<locals>")[0]


def _lines(names: Mapping[str, str], kind: str, case: Case) -> dict[str, Any]:
    """Return the lines of the reference that a case reaches, and its seconds."""
    found: set[tuple[str, int]] = set()

    def line(frame: FrameType, event: str, argument: Any) -> Any:
        found.add((names[frame.f_code.co_filename], frame.f_lineno))
        return line

    def call(frame: FrameType, event: str, argument: Any) -> Any:
        return line(frame, event, argument) if frame.f_code.co_filename in names else None

    forget()
    sys.settrace(call)
    try:
        answer = answered(program, kind, case)
    finally:
        sys.settrace(None)
    began = time.perf_counter()
    answered(program, kind, case)
    seconds = time.perf_counter() - began
    verdict = run.judge(kind, case, answer)
    assert not verdict.failed, f"{verdict.id}: {verdict.text}"
    return {"lines": sorted(found), "seconds": seconds}


def forget() -> None:
    """Empty all caches of functions of the package."""
    for some in _caches():
        some.cache_clear()


@functools.cache
def _caches() -> list[Any]:
    """Return the caches of the package's functions, which are as many as its modules have."""
    kinds = (some for some in gc.get_objects() if isinstance(some, functools._lru_cache_wrapper))
    return [some for some in kinds if some.__module__.startswith("wamnet.")]


# ---- a mutant ---------------------------------------------------------------------------------------------


def trial(mutant: Mutant, source: str, cases: Sequence[tuple[str, Case]], reached: Reached) -> Outcome:
    """Ask a mutant the cases that reach it until one fails."""
    import_time = not mutant.function or (mutant.module, mutant.function) in reached.at_import
    places = [(mutant.module, line) for line in range(mutant.first, mutant.last + 1)]
    numbers = sorted(set().union(*(reached.lines.get(place, ()) for place in places)))
    if import_time:
        numbers = sorted(set().union(*(reached.lines.get(p, ()) for p in reached.users.lines(mutant))))
    if not numbers:
        return Outcome(0)
    # Renders take longest, and tell least: they are for what nothing else reaches.
    numbers = [n for n in numbers if cases[n][0] not in STATISTICAL] or numbers
    found = forked(lambda: _tried(mutant, source, [cases[n] for n in numbers], import_time))
    return Outcome(len(numbers), *(found if found is not None else ("", "", "", "killed", "")))


def failures(mutant: Mutant, source: str, cases: Sequence[tuple[str, Case]]) -> list[list[str] | None]:
    """Ask a mutant all cases: of each return what [`asked`] does, case, clause, output, verdict and text."""
    found: list[list[str] | None] | None = forked(lambda: list(_asked_all(mutant, source, cases, True)))
    return [[case.id, case.clause, "", "killed", ""] for _, case in cases] if found is None else found


def _tried(mutant: Mutant, source: str, cases: Sequence[tuple[str, Case]], import_time: bool) -> list[str]:
    """Be the fork: return the first failure of a mutant."""
    every = _asked_all(mutant, source, cases, import_time)
    return next((failed for failed in every if failed is not None), [""] * 5)


def _asked_all(
    mutant: Mutant, source: str, cases: Sequence[tuple[str, Case]], import_time: bool
) -> Iterator[list[str] | None]:
    """Be the fork: install the mutant, and yield what failed of each case."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGALRM, _late)
    warnings.simplefilter("ignore")  # of wrong arithmetic
    try:
        signal.alarm(LIMIT_S)
        modules = install(mutant, source, import_time)
    except BaseException as error:  # noqa: BLE001 - it fails whatever is asked
        signal.alarm(0)
        text = f"{type(error).__name__} as it is imported"
        yield from ([case.id, case.clause, "", "crash", text] for _, case in cases)
        return
    for kind, case in cases:
        signal.alarm(LIMIT_S)
        failed = asked(modules, kind, case)
        signal.alarm(0)
        yield failed


Modules = tuple[ModuleType, ModuleType]
"""What answers, and what judges."""


def answered(answers: ModuleType, kind: str, case: Case) -> Mapping[str, Any]:
    """Return the reference's answer in the form of the protocol."""
    request = {"kind": kind, "input": dict(case.inputs), "profile": "ieee"}
    found = io.StringIO()
    answers.serve([json.dumps(request)], found, "", [kind], answers.of_reference)
    return dict(json.loads(found.getvalue()))


def asked(modules: Modules, kind: str, case: Case) -> list[str] | None:
    """Return case, clause, output, verdict and text of a failure, or None."""
    answers, judge = modules
    try:
        verdict = judge.judge(kind, case, answered(answers, kind, case))
    except LateError:
        return [case.id, case.clause, "", "timeout", ""]
    except BaseException as error:  # noqa: BLE001 - a program that ends so has crashed
        return [case.id, case.clause, "", "crash", type(error).__name__]
    if not verdict.failed:
        return None
    return [case.id, verdict.clause, verdict.stage, verdict.verdict, verdict.text[:120]]


def install(mutant: Mutant, source: str, import_time: bool) -> Modules:
    """Put a mutant instead of what it changes; return the modules that answer and judge."""
    filename = str(ROOT / mutant.module)
    code = compile(mutated(mutant, source), filename, "exec", dont_inherit=True)
    if import_time:
        return again(dotted(mutant.module), code)
    function: Any = sys.modules[dotted(mutant.module)]
    for name in mutant.function.split("."):
        function = vars(function)[name]
    _plain(function).__code__ = _code(code, mutant.function.split("."))
    return program, run


def _plain(function: Any) -> FunctionType:
    """Return the function in a property, a method of a class, or a cache."""
    while not isinstance(function, FunctionType):
        known = [getattr(function, name, None) for name in ("fget", "__func__", "__wrapped__")]
        function = next(inner for inner in known if inner is not None)
    return function


def _code(code: CodeType, names: Sequence[str]) -> CodeType:
    """Return the code of a function in that of its module."""
    for name in names:
        # The last of several definitions is the one that counts.
        code = [c for c in code.co_consts if isinstance(c, CodeType) and c.co_name == name][-1]
    return code


def again(module: str = "", code: CodeType | None = None) -> Modules:
    """Import the package's modules again, one of them with another code."""
    true = SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        return code if fullname == module else true(loader, fullname)

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign]
    _purge()
    answers = importlib.import_module("wamnet.spec.conformance.program")
    return answers, importlib.import_module("wamnet.spec.conformance.run")


def _purge() -> None:
    """Forget the package's modules."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "wamnet"]:
        del sys.modules[name]
