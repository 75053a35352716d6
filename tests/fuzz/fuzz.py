"""Fuzz every reader and every command with changed files: `make fuzz MINUTES=10`.

1. Each input is a function of (seed, target, number): what was found can be repeated by itself [`changed`].
2. An input is used in a folder of its own, within a limit of time and of memory [`Limits`], [`tried`].
   A value or a `WamnetError` is right; another exception, a hang, too much memory, a number that is not
   finite, or control characters on the terminal are findings.
3. Targets take turns until the time is over or each had its count; processes share them [`fuzz`].
4. Counts, the seed, and for each finding the input's file and the command that repeats it are printed; the
   exit status is 1 if there are findings. A finding's file belongs into tests/fuzz/corpus once it is fixed.
"""

import argparse
import json
import logging
import os
import resource
import secrets
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from lines import lines
from machines import machines
from mutations import WAYS
from talks import talks
from targets import Good, Target, commands, networks, readers

from wamnet.refimpl.errors import WamnetError

HANG_S = 20.0
"""Seconds after which an input counts as a hang; the slowest good one takes one."""

MEMORY_BYTES = 512 * 2**20
"""Most memory that an input may take beside the program's own."""

_good: Good | None = None
_targets: dict[str, Target] = {}


class Hang(BaseException):
    """An input has taken too long; no handler of the program catches it."""


@dataclass
class Found:
    """What a slice has seen: counts by outcome, and findings (number of the input, what was wrong)."""

    name: str
    counts: Counter[str] = field(default_factory=Counter)
    findings: list[tuple[int, str]] = field(default_factory=list)
    following: int = 0


def read_state(path: Path, seed: int) -> dict[str, Found]:
    """Return what earlier runs of this seed have found; nothing where there was none."""
    if not path.exists():
        return {}
    state = json.loads(path.read_text())
    assert state["seed"] == seed, f"{path} is of seed {state['seed']}"
    found = state["found"].items()
    return {name: Found(name, Counter(one["counts"]), *(one[k] for k in KEPT)) for name, one in found}


KEPT = ("findings", "following")
"""What a state keeps in addition to counts."""


def write_state(path: Path, seed: int, total: dict[str, Found]) -> None:
    """Keep what was found, for runs that resume."""
    path.parent.mkdir(parents=True, exist_ok=True)
    found = {
        name: {"counts": one.counts, **{k: getattr(one, k) for k in KEPT}} for name, one in total.items()
    }
    path.write_text(json.dumps({"seed": seed, "found": found}, indent=1))


def changed(target: Target, seed: int, number: int) -> bytes:
    """Return the changed file of this number."""
    random = Random(f"{seed}/{target.name}/{number}")
    return WAYS[target.way](random, random.choice(target.examples))


def tried(target: Target, content: bytes) -> tuple[str, str]:
    """Use an input; return its outcome (accepted, refused, FOUND) and what was wrong."""
    before = Path.cwd()
    folder = Path(tempfile.mkdtemp(prefix="wamnet-fuzz-"))
    try:
        os.chdir(folder)
        signal.signal(signal.SIGALRM, _hang)
        signal.setitimer(signal.ITIMER_REAL, HANG_S)
        with np.errstate(all="ignore"):
            target.use(content, folder)
    except WamnetError:
        return "refused", ""
    except Hang:
        return "FOUND", f"a hang of {HANG_S:g} s"
    except MemoryError:
        return "FOUND", f"more than {MEMORY_BYTES} bytes of memory"
    except UnicodeDecodeError as error:
        # The targets themselves decode texts that the program gets as such.
        return ("refused", "") if "targets.py" in _innermost(error) else ("FOUND", _told(error))
    except Exception as error:  # noqa: BLE001 - whatever it is, we did not raise it
        return "FOUND", _told(error)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        os.chdir(before)
        shutil.rmtree(folder, ignore_errors=True)
    return "accepted", ""


def _innermost(error: BaseException) -> str:
    """Return the file in which an exception arose."""
    return traceback.extract_tb(error.__traceback__)[-1].filename


def _told(error: BaseException) -> str:
    """Return an exception and where it arose, on one line."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return ascii(f"{type(error).__name__}: {error} ({Path(frame.filename).name}:{frame.lineno})")[1:301]


def _hang(_number: int, _frame: object) -> None:
    raise Hang


def every(good: Good) -> list[Target]:
    """Return all targets."""
    return [*readers(good), *networks(), *talks(), *commands(good), *lines(good), *machines(good)]


def prepare() -> None:
    """Make the good files and the limits of this process."""
    global _good  # noqa: PLW0603 - the pool's initializer has no other way to reach its tasks
    os.environ["WAMNET_CACHE"] = tempfile.mkdtemp(prefix="wamnet-fuzz-cache-")
    os.environ["WAMNET_EXECUTOR"] = "numpy"  # a kernel of each mutation would be compiled
    os.environ["COLUMNS"] = "200"
    # The log's lines about damaged entries are right, and many.
    logging.getLogger("wamnet").setLevel(logging.CRITICAL)
    _good = Good(Path(tempfile.mkdtemp(prefix="wamnet-fuzz-good-")))
    _targets.update({target.name: target for target in every(_good)})
    for target in _targets.values():
        for example in target.examples:
            outcome, what = tried(target, example)
            assert outcome != "FOUND", f"{target.name}: a good file gives {what}"
    own = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (own + MEMORY_BYTES, resource.RLIM_INFINITY))


def run_slice(name: str, seed: int, first: int, count: int, until: float) -> tuple[Found, int]:
    """Try inputs from number `first` on: `count` of them, or as many as fit; return the next number too."""
    found, target = Found(name), _targets[name]
    ends = min(until, time.monotonic() + target.slice_s)
    number = first
    while number < first + count and (time.monotonic() < ends or number == first):
        outcome, what = tried(target, changed(target, seed, number))
        found.counts[outcome] += 1
        if what:
            found.findings.append((number, what))
        number += 1
    return found, number


def names_of() -> list[str]:
    """Return the names of all targets."""
    return list(_targets)


def fuzz(
    seed: int,
    seconds: float,
    count: int,
    workers: int,
    only: Sequence[str],
    most: int = 2**60,
    before: dict[str, Found] | None = None,
) -> dict[str, Found]:
    """Let all targets take turns, until there were `most` inputs; return what was found, by target.

    `before`: what earlier runs of this seed have found; this one continues where they ended.
    """
    total = dict(before or {})
    context = get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, prepare)
    names = [
        name for name in pool.submit(names_of).result() if not only or any(word in name for word in only)
    ]
    until = time.monotonic() + seconds  # the workers have been prepared by now
    following = {name: total[name].following if name in total else 0 for name in names}
    waiting, running, tried_all = list(names), {}, sum(sum(found.counts.values()) for found in total.values())
    while waiting or running:
        while waiting and len(running) < workers and time.monotonic() < until and tried_all < most:
            name = waiting.pop(0)
            left = count - following[name]
            running[pool.submit(run_slice, name, seed, following[name], left, until)] = name
        if not running:
            break
        done, _ = wait(running, return_when="FIRST_COMPLETED")
        for future in done:
            name = running.pop(future)
            known = total.setdefault(name, Found(name))
            try:
                found, following[name] = future.result()
            except BrokenProcessPool:
                known.findings.append((following[name], "the process ended (from this number on)"))
                following[name] += 1
                waiting += [name, *running.values()]
                pool, running = ProcessPoolExecutor(workers, context, prepare), {}
                break
            tried_all += sum(found.counts.values())
            for number, what in found.findings:
                print(f"FOUND {name}, {number}: {what}", flush=True)
            known.counts += found.counts
            known.findings += found.findings
            known.following = following[name]
            if following[name] < count:
                waiting.append(name)
    pool.shutdown()
    return total


def report(total: dict[str, Found], seed: int, folder: Path) -> int:
    """Print counts and findings, and keep the inputs of the findings; return the exit status."""
    everything = sum((found.counts for found in total.values()), Counter())
    print(f"{'target':28} {'inputs':>9} {'refused':>9} {'accepted':>9} {'FOUND':>6}")
    for name, found in sorted(total.items()):
        inputs = sum(found.counts.values())
        refused, accepted = found.counts["refused"], found.counts["accepted"]
        print(f"{name:28} {inputs:9} {refused:9} {accepted:9} {len(found.findings):6}")
    findings = [(name, *finding) for name, found in total.items() for finding in found.findings]
    told: Counter[tuple[str, str]] = Counter()
    for name, number, what in findings:
        told[name, what.rpartition("(")[2]] += 1
        if told[name, what.rpartition("(")[2]] <= 3:
            keep(name, seed, number, folder)
            print(f"FOUND {name}: {what}; again: make fuzz SEED={seed} ONLY='{name}' AT={number}")
    print(f"fuzz: seed {seed}: {sum(everything.values())} inputs, {len(findings)} findings")
    return 1 if findings or not everything else 0  # a run that tries nothing says nothing


def keep(name: str, seed: int, number: int, folder: Path) -> None:
    """Keep a finding's input."""
    if not _targets:
        prepare()
    folder.mkdir(parents=True, exist_ok=True)
    stem = name.replace("wamnet ", "command ").replace(", ", "-").replace(" ", "-")
    (folder / f"{stem}.{seed}.{number}").write_bytes(changed(_targets[name], seed, number))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="how long, beside the start")
    parser.add_argument("--count", type=int, default=2**40, help="inputs of each target, at most")
    parser.add_argument("--inputs", type=int, default=2**60, help="inputs of all targets, at least")
    parser.add_argument("--seed", type=int, default=None, help="repeats a run")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--only", nargs="*", default=[], help="targets whose name holds one of these words")
    parser.add_argument("--state", type=Path, help="file of counts: a run continues where the last one ended")
    parser.add_argument("--at", type=int, default=None, help="this one input, with its traceback")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/fuzz"), help="folder of findings")
    given: Any = parser.parse_args(arguments)
    seed = secrets.randbits(32) if given.seed is None else given.seed
    if given.at is not None:
        return again(" ".join(given.only), seed, given.at)
    numbers = (seed, given.minutes * 60, given.count, given.workers)
    before = read_state(given.state, seed) if given.state else {}
    total = fuzz(*numbers, given.only, given.inputs, before)
    if given.state:
        write_state(given.state, seed, total)
    return report(total, seed, given.output)


def again(name: str, seed: int, number: int) -> int:
    """Try one input without a net."""
    prepare()
    folder = Path(tempfile.mkdtemp(prefix="wamnet-fuzz-"))
    os.chdir(folder)
    content = changed(_targets[name], seed, number)
    print(ascii(content[:2000]))
    try:
        _targets[name].use(content, folder)
    except WamnetError as error:
        print(f"refused: {error}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
