"""Which tests detect bugs in the emitters: a queue of bugs, a server that plants them, a file of outcomes.

1. The project is copied once to the folder of results; bugs are planted there [`copied`].
2. Tests that reach a bug's lines run, the cheapest first, a few tests of each file before the others
   [`chosen`]. A bug outside functions is reached by tests that use its class.
3. An outcome is one line of JSON; a bug that has one is not tried again [`tried`].
4. A bug is `detected` by a test on a device or by the source checker, else `compiled` by a test that only
   compiles. If no test detects it, it is `equal` where no kernel's source differs, `text` where only a
   comment does, `open` where no test was traced that reaches it or the tests took too long, else `missed`:
   tests that compare sources with files in git do not count, for the sources will change [`outcome`].
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from .planting import GROUPS, Fault, faults, modules
from .reach import Traced, read
from .trial import ROOT

LIMIT_S = 60
"""CPU seconds of a bug's tests: a test at work when they are used up hangs."""

AGAIN = ("compiled", "missed", "open")
"""States that more tests may change."""

BUDGET_S = 60.0
"""Seconds of the tests of one kind that are tried on a bug, as they take without it."""

MOST_TESTS, MOST_COMPILED, AT_ONCE = 40, 5, 2
"""Tests per bug that run a kernel or check its source, and others; tests of one file before others come."""

DECISIVE = ("reader", "device")
"""Tiers whose tests detect what a kernel computes wrong."""

LINE_LENGTH = 90
"""Most letters in a record of a line that differs."""

COMMENT = re.compile(r"^(?:/\*|//|#(?!\s*(?:define|if|el|end|undef|pragma|include|version|extension))|\*)")
"""A line of a kernel that is a comment."""


class Outcome(NamedTuple):
    """What became of a bug: the tests that fail, and what differs in the kernels.

    `state`: detected, compiled, missed, text, equal or open; `by` is the first test of a device or the
    source checker, or else of those that compile; `changed` counts sources of small kernels that differ (-1:
    the emitter fails), `where` names the first, `old` and `new` are its first line that differs.
    """

    name: str
    group: str
    file: str
    line: int
    origin: str
    kind: str
    says: str
    state: str
    by: str
    tier: str
    changed: int
    where: str
    old: str
    new: str
    tests: int
    seconds: float


def outcomes(path: Path) -> dict[str, Outcome]:
    """Return the outcomes in a file, by the bugs' names."""
    if not path.exists():
        return {}
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return {row[0]: Outcome(*row) for row in rows}


def copied(tree: Path) -> None:
    """Copy the project's files to a folder, once; the emitters, which a run may have left changed, always."""
    if tree.exists():
        for file in (file for group in GROUPS for file in modules(group)):
            shutil.copy2(ROOT / file, tree / file)
        return
    listed = ["git", "ls-files", "-co", "--exclude-standard", "-z"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)


# ---- which tests ------------------------------------------------------------------------------------------


class Index:
    """The tests by what they reach."""

    def __init__(self, tests: Sequence[Traced]) -> None:
        self.tests = {test.name: test for test in tests}
        self.lines: dict[tuple[str, int], list[Traced]] = defaultdict(list)
        self.classes: dict[str, list[Traced]] = defaultdict(list)
        self.files: dict[str, list[Traced]] = defaultdict(list)
        for test in tests:
            for path, numbers in test.lines.items():
                self.files[path].append(test)
                for number in numbers:
                    self.lines[path, number].append(test)
            for name in test.classes:
                self.classes[name].append(test)

    def of(self, fault: Fault) -> list[Traced]:
        """Return the tests that reach a bug."""
        if fault.function:
            result = [t for n in range(fault.first, fault.last + 1) for t in self.lines[fault.file, n]]
        elif owner := _owner(fault):
            result = self.classes[f"{fault.file}:{owner}"]
        else:
            users = [fault.file, *_users(fault.file)]
            result = [t for path in users for t in self.files[path]]
            result += [t for n, some in self.classes.items() if n.partition(":")[0] in users for t in some]
        return list({test.name: test for test in result}.values())


def _owner(fault: Fault) -> str:
    """Return the class that a bug outside functions is in, or nothing."""
    tree = ast.parse((ROOT / fault.file).read_text(encoding="utf-8"))
    classes = (node for node in tree.body if isinstance(node, ast.ClassDef))
    inside = (node.name for node in classes if node.lineno <= fault.first <= (node.end_lineno or 0))
    return next(inside, "")


def _users(file: str) -> list[str]:
    """Return the modules of the emitters that import a module."""
    stem = Path(file).stem
    paths = [
        path for folders in GROUPS.values() for folder in folders for path in (ROOT / folder).glob("*.py")
    ]
    imports = re.compile(rf"^from \.[\w.]*\b{stem} import|^from \.[\w.]* import [^\n]*\b{stem}\b", re.M)
    return [p.relative_to(ROOT).as_posix() for p in paths if imports.search(p.read_text(encoding="utf-8"))]


def chosen(tests: Sequence[Traced]) -> list[Traced]:
    """Return the tests to run, in their order: decisive ones before others, cheap ones before dear ones.

    Two cases of each test come before the others, and so do two tests of each file.
    """
    result: list[Traced] = []
    for tiers, most in ((DECISIVE, MOST_TESTS), (("compile",), MOST_COMPILED)):
        seen = Counter[str]()
        ranked = []
        for test in sorted((test for test in tests if test.tier in tiers), key=lambda test: test.seconds):
            turn = max(seen[test.function], seen[test.file]) // AT_ONCE
            ranked.append((turn, test.seconds, test))
            seen.update((test.function, test.file))
        total = 0.0
        for *_, test in sorted(ranked, key=lambda row: row[:2])[:most]:
            if total + test.seconds <= BUDGET_S:
                total += test.seconds
                result.append(test)
    return result


# ---- trying -----------------------------------------------------------------------------------------------


def outcome(fault: Fault, tests: Sequence[Traced], answer: Mapping[str, Any]) -> Outcome:
    """Return what became of a bug, from what the server notes."""
    notes = answer["notes"]
    texts = next((note for note in notes if "changed" in note), None)
    texts = texts or {"changed": -1, "first": "", "old": "", "new": f"ended: {answer['ended']}"}
    failed: dict[str, str] = {}
    for note in notes:
        if note.get("failed") and note["tier"]:
            failed.setdefault(note["tier"], note["test"])
    if answer["ended"] != "done" and (hung := _hung(notes, answer)):
        failed.setdefault(hung[0], hung[1])
    tier = next((tier for tier in ("device", "reader", "compile", "import") if tier in failed), "")
    if tier:
        state = "detected" if tier in DECISIVE else "compiled"
    elif not texts["changed"]:
        state = "equal"
    elif COMMENT.match(texts["old"]) and COMMENT.match(texts["new"]):
        state = "text"
    elif answer["ended"] == "late" or not tests:
        state = "open"
    else:
        state = "missed"
    return Outcome(
        fault.name, fault.group, fault.file, fault.first, fault.origin, fault.kind, fault.says, state,
        failed.get(tier, ""), tier, texts["changed"], texts["first"], texts["old"],
        texts["new"], len(tests), answer["seconds"],
    )  # fmt: skip


def _hung(notes: Sequence[Mapping[str, Any]], answer: Mapping[str, Any]) -> tuple[str, str]:
    """Return tier and name of the test during which a fork crashed, or had no CPU time left."""
    started = [note for note in notes if "test" in note and not note["failed"]]
    if answer["ended"] == "late":
        return "", ""
    return (started[-1]["tier"], started[-1]["test"]) if started else ("import", "import")


def tried(
    folder: Path, counts: Mapping[str, int], seconds: float, seed: int = 0, again: bool = False
) -> Iterator[Outcome]:
    """Yield the outcomes of bugs that have none yet, for so many seconds; add them to the file.

    `counts`: bugs per group. `again`: those that no test on a device and no source checker detects are tried
    again, with the tests that are traced by now.
    """
    path, end = folder / "kills.jsonl", time.monotonic() + seconds
    done = {name: o for name, o in outcomes(path).items() if not again or o.state not in AGAIN}
    index = Index([t for p in sorted(folder.glob("reach*.jsonl")) for t in read(p)])
    queue = [fault for fault in in_turns(counts, seed) if fault.name not in done]
    copied(folder / "tree")
    with _server(folder) as ask, path.open("a", encoding="utf-8") as file:
        for fault in queue:
            if time.monotonic() > end:
                return
            source = (folder / "tree" / fault.file).read_text(encoding="utf-8")
            try:
                compile(text := fault.planted(source), fault.file, "exec", dont_inherit=True)
            except SyntaxError:
                continue
            tests = chosen(index.of(fault))
            request = {"file": fault.file, "text": text, "limit_s": LIMIT_S}
            result = outcome(fault, tests, ask({**request, "tests": [[t.name, t.tier] for t in tests]}))
            file.write(json.dumps(result) + "\n")
            file.flush()
            yield result


def in_turns(counts: Mapping[str, int], seed: int) -> list[Fault]:
    """Return so many bugs of each group, such that each part of them has its share of every group."""
    rows = [
        (at / counts[group], fault)
        for group in counts
        for at, fault in enumerate(faults(group, seed)[: counts[group]])
    ]
    return [fault for _, fault in sorted(rows, key=lambda row: row[0])]


class _server:  # noqa: N801 - it is used like a function
    """The process that plants bugs, as a context that gives a function from a request to its answer."""

    def __init__(self, folder: Path) -> None:
        server = folder / "tree/experiments/lab/kill_server.py"
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment["POCL_CACHE_DIR"] = str(folder.resolve() / "pocl")
        self.process = subprocess.Popen(
            [sys.executable, server, folder / "tree"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            text=True,
        )

    def __enter__(self) -> Callable[[Mapping[str, Any]], Mapping[str, Any]]:
        return self.ask

    def ask(self, request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the answer to a request."""
        assert self.process.stdin
        assert self.process.stdout
        print(json.dumps(request), file=self.process.stdin, flush=True)
        answer: Mapping[str, Any] = json.loads(self.process.stdout.readline())
        return answer

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait()


def rows(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the values of each bug's row in a record."""
    for result in outcomes(folder / "kills.jsonl").values():
        values = result._asdict()
        for name in ("name", "seconds"):
            del values[name]
        for name in ("old", "new"):
            values[name] = values[name][:LINE_LENGTH]
        yield f"bug: {' '.join(result.name.split())}", {"part": "kills", **values}
