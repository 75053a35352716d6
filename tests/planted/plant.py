"""Faults of a programmer, planted one at a time in a copy of the project: does a test detect each?

    python tests/planted/plant.py --map [TESTS...] [--jobs 2]
    python tests/planted/plant.py [--only WORD...] [--jobs 2]
    python experiments/publish.py out/planted/planted-faults.json --command 'python tests/planted/plant.py'

1. In a fault of `faults.json`, `old`, once in `file`, becomes `new`; `wrong` is what a user then gets. They
   were written without a look at the tests.
2. `--map` runs the suite (or TESTS) and writes each test's seconds, and the faults whose lines it reaches
   [reach.py], to map.json. A fault outside functions is reached by tests that call a function of its file,
   and, tried after these, of its folder.
3. Otherwise each fault without a result is planted, and the tests that reach it run, the fastest first, until
   one fails or LIMIT_S are over [`tried`]. A test that takes HANGS times its seconds fails too.
4. A result is detected, missed, unreached or stale. `how` is `golden` (a file in tests/golden differs),
   `hangs`, `collection` or `test`; `tests` of `reach` tests have run. Copies are of the commit alone.
"""

import argparse
import ast
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing import Process
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "experiments"))

FAULTS, OUTPUT = Path(__file__).with_name("faults.json"), ROOT / "out/planted"
LIMIT_S, HANGS, HANGS_S = 180.0, 10, 30.0
"""Seconds of one fault's tests; a test hangs that takes so many times its own, and more than the last."""
FIRST = 40
"""The fastest tests, which run before the others: fewer files are read."""
OF_FOLDER = ("bin/*", "lib/python*/site-packages/__editable__*.py")
"""Files of an environment that name the project's folder."""


Fault = Mapping[str, str]
"""A fault; see 1."""


def faults(words: Sequence[str] = ()) -> list[Fault]:
    """Return the faults whose id or file holds a word."""
    every: list[Fault] = json.loads(FAULTS.read_text(encoding="utf-8"))
    return [each for each in every if not words or any(word in each["id"] + each["file"] for word in words)]


def source_of(fault: Fault, root: Path = ROOT) -> str:
    """Return the file without the fault."""
    return (root / fault["file"]).read_text(encoding="utf-8")


def planted(fault: Fault, source: str) -> str:
    """Return a file with a fault, or nothing if `old` is not there once."""
    return source.replace(fault["old"], fault["new"]) if source.count(fault["old"]) == 1 else ""


def lines(fault: Fault, source: str) -> set[int]:
    """Return the lines of the statements in functions that a fault changes."""
    old, new = fault["old"].split("\n"), fault["new"].split("\n")
    first = source[: source.find(fault["old"])].count("\n") + 1
    changed = [first + i for i, line in enumerate(old) if i >= len(new) or line != new[i]] or [first]
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    inside = [s for f in functions for part in f.body for s in ast.walk(part) if isinstance(s, ast.stmt)]
    found: set[int] = set()
    for line in changed:
        around = [s for s in inside if s.lineno <= line <= (s.end_lineno or 0)]
        if around and (inner := max(around, key=lambda s: s.lineno)):
            body = getattr(inner, "body", None)
            end = body[0].lineno - 1 if body else inner.end_lineno or 0
            found |= {*range(inner.lineno, max(end, inner.lineno) + 1)}
    return found


def copied(tree: Path) -> None:
    """Copy the commit, and the environment, whose packages are hard links and import reach.py."""
    shutil.rmtree(tree, ignore_errors=True)
    subprocess.run(["git", "clone", "-q", "--shared", ROOT, tree], check=True)
    subprocess.run(["cp", "-al", ROOT / ".venv", tree / ".venv"], check=True)
    here, there = str(ROOT).encode(), str(tree).encode()
    for path in (path for pattern in OF_FOLDER for path in (tree / ".venv").glob(pattern)):
        if not path.is_symlink() and path.is_file() and here in (content := path.read_bytes()):
            mode = path.stat().st_mode
            path.unlink()
            path.write_bytes(content.replace(here, there))
            path.chmod(mode)
    (packages,) = (tree / ".venv").glob("lib/python*/site-packages")
    (packages / "planted.pth").write_text(f"{tree}/tests/planted\nimport reach\n")


def write(path: Path, text: str, seconds: int) -> None:
    """Write a module as if so many seconds from now: byte code of a text of the same length is old then."""
    path.write_text(text, encoding="utf-8")
    os.utime(path, (time.time() + seconds,) * 2)


def run(tree: Path, words: Sequence[str], limit: float | None, **told: Path) -> list[list[Any]]:
    """Run pytest in a copy, for so many seconds at most; return the rows of reach.py."""
    rows, python = tree.with_suffix(".rows"), tree / ".venv/bin/python"
    rows.write_text("")
    own = {"PLANT_OUT": rows, "PYTEST_ADDOPTS": "-p reach", "OPENBLAS_NUM_THREADS": 1, "OMP_NUM_THREADS": 1}
    environment = os.environ | {key: str(value) for key, value in (own | told).items()}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=short", *words]
    with tree.with_suffix(".log").open("w") as log:
        where = {"cwd": tree, "env": environment, "stdout": log, "stderr": log}
        process = subprocess.Popen(command, **where, start_new_session=True)
        try:
            with suppress(subprocess.TimeoutExpired):
                process.wait(limit)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    return [json.loads(line) for line in rows.read_text().splitlines()]


def mapped(tests: Sequence[str], jobs: int) -> dict[str, Any]:
    """Run tests in a copy; return seconds of those that pass, and the tests that reach each fault."""
    files: dict[str, Any] = defaultdict(lambda: (defaultdict(list), []))
    for fault in faults():
        own = lines(fault, source_of(fault))
        for line in own:
            files[fault["file"]][0][line].append(fault["id"])
        files[fault["file"]][1].extend([] if own else [fault["id"]])
    folders = sorted({name.rpartition("/")[0] + "/" for name, (_, marks) in files.items() if marks})
    tree, watch = OUTPUT / "tree0", OUTPUT / "watch.json"
    copied(tree)
    watch.write_text(json.dumps({"root": f"{tree}/", "files": files, "folders": folders}))
    rows = run(tree, [*tests, *(["-n", str(jobs)] if jobs > 1 else [])], None, PLANT_WATCH=watch)
    ends = {test: (what, value) for test, value, what in rows if what not in ("hit", "started")}
    seconds = {test: value for test, (what, value) in ends.items() if what == "passed"}
    sys.stdout.writelines(f"failed: {test}\n" for test, (what, _) in ends.items() if what == "failed")
    sys.stdout.write(f"{len(seconds)} of {len(ends)} tests pass\n")
    hits: dict[str, set[str]] = defaultdict(set)
    for test, fault, what in rows:
        if what == "hit" and test in seconds:
            hits[fault].add(test)
    order = {fault: sorted(some, key=lambda test: (seconds[test], test)) for fault, some in hits.items()}
    return {"seconds": seconds, "reach": order}


def tried(fault: Fault, known: Mapping[str, Any], tree: Path) -> dict[str, Any]:
    """Plant a fault in a copy, run the tests that reach it, and remove it; return what came of it."""
    source, reach, start = source_of(fault, tree), known["reach"], time.time()
    row: dict[str, Any] = {"by": "", "how": "", "tests": 0, "reach": 0, "seconds": 0.0}
    row |= {key: fault[key] for key in ("file", "kind", "wrong")}
    if not (made := planted(fault, source)):
        return {"result": "stale", **row}
    folder = "" if lines(fault, source) else fault["file"].rpartition("/")[0] + "/"
    tests = list(dict.fromkeys([*reach.get(fault["id"], []), *reach.get(folder, [])]))
    # A file that is gone since the map would be an error of the collection: a detection.
    tests = [test for test in tests if (tree / test.partition("::")[0]).exists()]
    order = tree.with_suffix(".tests")
    write(tree / fault["file"], made, 3600)
    for some in filter(None, (tests[:FIRST], tests[FIRST:])):
        left = LIMIT_S - (time.time() - start)
        if not row["by"] and left > 0:
            order.write_text(json.dumps(some))
            names = dict.fromkeys(test.partition("::")[0] for test in some)
            rows = run(tree, ["-x", *names], left, PLANT_TESTS=order)
            row["by"], row["how"] = detected(rows, known["seconds"], tree.with_suffix(".log").read_text())
            row["tests"] += sum(what == "started" for *_, what in rows)
    write(tree / fault["file"], source, 0)
    result = "detected" if row["by"] else "missed" if tests else "unreached"
    return {"result": result, **row, "reach": len(tests), "seconds": round(time.time() - start, 1)}


def detected(rows: Sequence[Sequence[Any]], seconds: Mapping[str, float], log: str) -> tuple[str, str]:
    """Return the test that fails, and how; nothing if none does."""
    done = {test: what for test, _, what in rows if what not in ("hit", "started")}
    for test, what in done.items():
        if what == "failed":
            return test, "golden" if "tests/golden/" in log else "test"
    for test, since, what in rows:
        longest = max(HANGS_S, HANGS * seconds.get(test, 0.0))
        if what == "started" and test not in done and time.time() - since > longest:
            return test, "hangs"
    return ("", "") if rows or "error" not in log.lower() else ("collection", "collection")


def work(some: Sequence[Fault], tree: Path) -> None:
    """Try faults that have no result, and write their results."""
    from lab.results import Results

    kept = Results.open(OUTPUT / "planted-faults.json", "planted-faults", {"limit_s": LIMIT_S})
    known = json.loads((OUTPUT / "map.json").read_text(encoding="utf-8"))
    left = [fault for fault in some if kept.get(fault["id"], 0) is None]
    if left:
        copied(tree)
    for fault in left:
        values = tried(fault, known, tree)
        kept.put(fault["id"], 0, values)
        sys.stdout.write(f"{fault['id']}: {values['result']} {values['by']}, {values['seconds']} s\n")
        sys.stdout.flush()


def main(arguments: Sequence[str] | None = None) -> None:
    """Map the tests, or try the faults."""
    parser = argparse.ArgumentParser(description="Plant faults, one at a time; see the module.")
    parser.add_argument("--map", nargs="*", metavar="TESTS", help="note what the tests reach")
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="words of ids or files")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each with a copy of the project")
    options = parser.parse_args(arguments)
    OUTPUT.mkdir(parents=True, exist_ok=True)
    chosen, jobs = faults(options.only), options.jobs
    if options.map is not None:
        (OUTPUT / "map.json").write_text(json.dumps(mapped(options.map, jobs)), encoding="utf-8")
    else:
        workers = [Process(target=work, args=(chosen[k::jobs], OUTPUT / f"tree{k}")) for k in range(jobs)]
        for do in (*(worker.start for worker in workers), *(worker.join for worker in workers)):
            do()
        rows = json.loads((OUTPUT / "planted-faults.json").read_text(encoding="utf-8"))["records"]
        sys.stdout.write(f"{dict(Counter(row['values']['result'] for row in rows))}\n")


if __name__ == "__main__":
    main()
