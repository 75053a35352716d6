"""`pytest --quick`: the tests that need NumPy and little else, on a machine that has nothing more.

1. A quick run has the packages of the dependency group `quick` and what they require [`brought`]. Others are
   absent, also where they are installed [`Absent`], and no program can be started [`refuse_programs`]: a run
   on a developer's machine fails where a run on a bare one would.
2. What a test needs is found, not listed. A file or folder whose import asks for an absent package is left
   out [`pytest_make_collect_report`]. Executors but `numpy` and peers are left out by the fixtures that open
   them.
3. What cannot be seen from there is marked: `pytest.mark.needs("programs")`, with the words of `NEEDS`. A
   test that asks for something absent without a mark fails with this advice [`pytest_runtest_makereport`].
"""

import re
import sys
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT = Path(__file__).parents[2] / "pyproject.toml"
"""Where the packages of the quick set-up are listed."""

DISTRIBUTIONS = {
    "spec/conformance/renderers": "wamnet_verify",
    "experiments/peers": "wamnet_peers",
    "course": "wamnet_course",
}
"""Package of each other distribution in this repository, by its folder."""

NEEDS = {
    "devices": "it runs kernels or other renderers",
    "packages": "it imports what the dependency group `quick` does not bring",
    "programs": "it starts programs",
    "time": "it computes for seconds",
}
"""Words of the marker `needs`: what a quick run does not have."""

STARTS = {"subprocess.Popen", "os.posix_spawn", "os.exec", "os.fork", "os.forkpty", "os.system"}
"""Events of Python's audit by which programs are started. Workers of `multiprocessing` are not among them."""


def left_out(need: str) -> str:
    """Return what is said of a test that a quick run leaves out."""
    return f"not quick: {NEEDS.get(need, f'it imports {need}')}; make test runs it"


def brought() -> set[str]:
    """Return the distributions of the group `quick` and all that they require."""
    project = tomllib.loads(PROJECT.read_text())
    return {"wamnet", *map(canonicalize_name, DISTRIBUTIONS.values())} | distributions(
        project["project"]["dependencies"] + project["dependency-groups"]["quick"]
    )


def distributions(requirements: Iterable[str]) -> set[str]:
    """Return the names of the distributions that requirements install, and of all that these require."""
    waiting, names = [(requirement, "") for requirement in requirements], set[str]()
    seen = set[tuple[str, str]]()
    while waiting:
        source, extra = waiting.pop()
        requirement = Requirement(source)
        if (source, extra) in seen or (
            requirement.marker and not requirement.marker.evaluate({"extra": extra})
        ):
            continue
        seen.add((source, extra))
        names.add(canonicalize_name(requirement.name))
        try:
            texts = requires(requirement.name) or []
        except PackageNotFoundError:  # another version of Python needs it
            continue
        waiting += [(each, option) for each in texts for option in ("", *requirement.extras)]
    return names


class Absent(MetaPathFinder):
    """Finds what the finders in its care find, except packages that a quick run does not have."""

    def __init__(self, finders: Sequence[Any]) -> None:
        has = brought()
        self.starts = STARTS  # a module's names are gone when Python ends
        self.finders = list(finders)
        self.asked: list[str] = []
        self.outside = {
            module
            for module, names in packages_distributions().items()
            if not has & {canonicalize_name(name) for name in names}
        }

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        top = fullname.partition(".")[0]
        if top not in self.outside:
            for finder in self.finders:
                if spec := finder.find_spec(fullname, path, target):
                    return spec  # type: ignore[no-any-return]
        if fullname == top:
            self.asked.append(top)
        return None

    def find_distributions(self, *context: Any) -> Iterator[Any]:
        """Yield what is known of installed packages; for `importlib.metadata`."""
        for finder in self.finders:
            if found := getattr(finder, "find_distributions", None):
                yield from found(*context)

    def refuse_programs(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Let no program start, as if it were not there; for `sys.addaudithook`."""
        if event in self.starts:
            program = str(arguments[0]) if arguments else event
            self.asked.append(program)
            raise FileNotFoundError(2, "pytest --quick starts no programs", program)


_absent: list[Absent] = []
"""The guard of a quick run; empty in others, and in the process that hands tests to workers."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="run the tests that need NumPy only")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", f"needs(*words): what a quick run lacks; of {', '.join(NEEDS)}")
    hands_out = config.getoption("dist", "no") != "no" and not hasattr(config, "workerinput")
    if config.getoption("quick") and not hands_out:
        guard = Absent(sys.meta_path)
        sys.meta_path[:] = [guard]
        sys.addaudithook(guard.refuse_programs)
        _absent.append(guard)


@pytest.fixture(scope="session")
def needs(pytestconfig: pytest.Config) -> Callable[[str], None]:
    """Give a function by which a fixture says what it needs: a quick run leaves out the tests that use it."""

    def need(word: str) -> None:
        assert word in NEEDS
        if pytestconfig.getoption("quick"):
            pytest.skip(left_out(word))

    return need


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    """Leave out a file or folder that an absent package keeps from being imported."""
    for guard in _absent:
        guard.asked.clear()
    report = yield
    for guard in _absent:
        missing = [n for n in guard.asked if re.search(rf"No module named '{n}['.]", str(report.longrepr))]
        if report.failed and missing:
            report.outcome = "skipped"
            report.longrepr = (__file__, 0, left_out(missing[-1]))
    return report


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out tests marked with a need; refuse words that nobody knows."""
    for item in items:
        words = [word for marker in item.iter_markers("needs") for word in marker.args]
        if not set(words) <= NEEDS.keys():
            raise pytest.UsageError(f"{item.nodeid}: needs{tuple(words)}: the words are {', '.join(NEEDS)}")
        if words and config.getoption("quick"):
            item.add_marker(pytest.mark.skip(reason=left_out(words[0])))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Count what a quick run has left out, by need; files that cannot be imported count once."""
    reasons = [report.longrepr[2] for report in terminalreporter.stats.get("skipped", ())]
    counted = Counter(reason.partition("not quick: ")[2] for reason in reasons)
    if config.getoption("quick"):
        terminalreporter.section("left out of a quick run")
        for reason, count in counted.most_common():
            if reason:
                terminalreporter.write_line(f"{count} tests or files: {reason}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Say in the report of a failed test what a quick run did not give it."""
    report = yield
    for guard in _absent:
        if report.failed and guard.asked:
            asked = ", ".join(dict.fromkeys(guard.asked))
            advice = "mark the test or the file pytest.mark.needs(...)"
            report.sections.append(("quick", f"A quick run does not have {asked}: do without, or {advice}."))
        if call.when == "teardown":
            guard.asked.clear()
    return report
