"""Tiers of tests: `--quick` needs NumPy alone, the default adds devices, `--nightly` runs everything.

1. `pytest.mark.nightly`: a test that only a nightly run has, as it takes long and a cheaper one protects most
   of the same; with names of cases only these, or with `but=` all others [`_nightly`].
2. `pytest.mark.product`: the cases of a test are products of parameters. All run nightly; else each value of
   each parameter is in some case [`covering`], as faults are in one of the factors far more often than in a
   pair of them.
3. A test of `executor` or `denoiser` runs on those of USUAL; as a product, on each of them once.
4. What a tier leaves out is deselected and counted in the summary.
5. `--budget N`: the summary compares the processor time of the run with N seconds. Where CI is set,
   a run that takes half as much again fails [`SHARE`]; other machines may be slow.
"""

import os
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

import pytest

SHARE = 1.5
"""Multiple of its budget above which a run fails."""

MARKERS = {
    "nightly": "it takes long, and a cheaper test protects most of the same: pytest --nightly runs it",
    "device": "another executor runs it: pytest --nightly runs it on all",
    "product": "all combinations of its parameters: pytest --nightly runs them, pytest a covering selection",
}
"""What a nightly run has in addition, with the reasons; `nightly` and `product` are markers."""

USUAL = ("numpy", "opencl")
"""Executors on which every test of executors runs."""

_seconds = pytest.StashKey[float]()
"""Processor time of the workers of a run."""

_left_out = pytest.StashKey[Counter[str]]()
"""How many tests each marker left out."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--nightly", action="store_true", help="run the tests marked nightly, and all products")
    parser.addoption("--budget", type=float, help="seconds of processor time that the run may take")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_seconds], config.stash[_left_out] = 0.0, Counter()
    for marker in ("nightly", "product"):
        config.addinivalue_line("markers", f"{marker}: {MARKERS[marker]}")


def is_nightly(config: pytest.Config) -> bool:
    """Return whether a run has all tests."""
    return bool(config.getoption("--nightly")) or os.environ.get("HYPOTHESIS_PROFILE") == "long"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect what this tier does not run, except tests that the command line names with their case."""
    if is_nightly(config) or any("::" in str(arg) for arg in config.invocation_params.args):
        return
    tests = defaultdict[str, list[pytest.Item]](list)
    for item in items:
        tests[item.nodeid.partition("[")[0]].append(item)
    out: dict[pytest.Item, str] = {}
    for name, cases in tests.items():
        nightly = _nightly(name, cases)
        out |= dict.fromkeys(nightly, "nightly")
        rest = [item for item in cases if item not in nightly]
        if rest and rest[0].get_closest_marker("product"):
            kept = covering(rest)
            out |= {item: "product" for item in rest if item not in kept}
        else:
            out |= {item: "device" for item in rest if not _is_usual(item)}
    config.stash[_left_out].update(out.values())
    config.hook.pytest_deselected(items=list(out))
    items[:] = [item for item in items if item not in out]


def _nightly(name: str, cases: Sequence[pytest.Item]) -> set[pytest.Item]:
    """Return the cases of a test that are nightly: all, those named (`nightly("c-1")`), or all `but` some."""
    ids = {item: item.nodeid.partition("[")[2].removesuffix("]") for item in cases}
    found: set[pytest.Item] = set()
    for item in cases:
        for marker in item.iter_markers("nightly"):
            but = marker.kwargs.get("but", ())
            named = {but} if isinstance(but, str) else {*but, *marker.args}
            if unknown := named - set(ids.values()):
                raise pytest.UsageError(f"{name}: nightly: no case is named {sorted(unknown)}")
            if not named or (ids[item] in named) is not bool(but):
                found.add(item)
    return found


def _is_usual(item: pytest.Item) -> bool:
    """Return whether a case is for no executor, or for a usual one."""
    params = getattr(item, "callspec", None)
    return params is None or all(
        params.params.get(name, USUAL[0]) in USUAL for name in ("executor", "denoiser")
    )


def covering(cases: Sequence[pytest.Item]) -> list[pytest.Item]:
    """Return cases in which each value of each parameter occurs; each next one has the most new values."""
    values = {item: _values(item) for item in cases}
    missing = set().union(*values.values())
    kept: list[pytest.Item] = []
    while missing or not kept:
        kept.append(max(cases, key=lambda item: len(values[item] & missing)))
        missing -= values[kept[-1]]
    return kept


def _values(item: pytest.Item) -> set[tuple[str, str]]:
    """Return the values that a case has of the parameters of its test."""
    callspec = getattr(item, "callspec", None)
    return set() if callspec is None else {(name, repr(value)) for name, value in callspec.params.items()}


# ---- processor time --------------------------------------------------------------------------------------


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand a worker's processor time, with that of its ended children, to the process that sums them."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["seconds"] = sum(os.times()[:4])
        session.config.workeroutput["left_out"] = dict(session.config.stash[_left_out])
        return
    session.config.stash[_seconds] += sum(os.times()[:2])
    if _exceeded(session.config) and os.environ.get("CI"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _exceeded(config: pytest.Config) -> bool:
    """Return whether a run took too much processor time."""
    budget = config.getoption("--budget")
    return budget is not None and not config.stash[_seconds] <= SHARE * budget


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Add the processor time of one worker; all workers deselect the same."""
    output = getattr(node, "workeroutput", {})
    node.config.stash[_seconds] += output.get("seconds", 0.0)
    node.config.stash[_left_out] = Counter(output.get("left_out", {}))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say what the run left out, and what it took of its budget."""
    terminalreporter.section("tier")
    for marker, count in sorted(config.stash[_left_out].items()):
        terminalreporter.write_line(f"{count} tests left out: {marker}: {MARKERS[marker]}")
    budget = config.getoption("--budget")
    said = f"processor time: {config.stash[_seconds]:.0f} s"
    said += "" if budget is None else f", budget {budget:g} s"
    over = _exceeded(config)
    said += ": TOO MUCH: make tests cheaper, or mark them nightly (CONTRIBUTING.md, Tests)" if over else ""
    terminalreporter.write_line(said, red=over)
