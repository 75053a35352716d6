"""Extras and dependency groups can be installed on each processor and Python that the project names."""

import itertools
import re

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

tomllib = pytest.importorskip("tomllib", reason="Python 3.10 reads no TOML")

PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")

SYSTEMS = (
    ("linux", "x86_64"),
    ("linux", "aarch64"),
    ("darwin", "arm64"),
    ("darwin", "x86_64"),
    ("win32", "AMD64"),
)
"""Systems and processors as markers name them."""

WITHOUT = {
    "pocl-binary-distribution": lambda system, machine, python: (system, machine) != SYSTEMS[0],
    "moderngl": lambda system, machine, python: (system, machine) == SYSTEMS[1],
    "glcontext": lambda system, machine, python: (system, machine) == SYSTEMS[1],
    "flip-evaluator": lambda system, machine, python: machine != "x86_64" or python == "3.14",
}
"""Packages without wheels, by system, processor and Python, as the index had them in November 2026."""

BRINGS = {("pyopencl", "pocl"): {"pocl-binary-distribution"}, ("moderngl", ""): {"glcontext"}}
"""What these install in turn, with an extra or always."""

EXTRA = re.compile(r"wamnet\\*\[([a-z,]+)\\*\]")
"""Extras in a requirement of this package."""

GROUP = re.compile(r"pip install [^\n`']*--group ([a-z]+)")
"""The last dependency group of pip's command."""


@pytest.fixture(scope="module")
def project(house):
    """Return the table of the project."""
    return tomllib.loads((house.root / "pyproject.toml").read_text(encoding="utf-8"))


def installed(project, start, system, machine, python):
    """Return the packages that requirements, `start`, of the project install on a system with a Python."""
    environment = {"platform_machine": machine, "python_version": python, "sys_platform": system, "extra": ""}
    found, waiting = set(), list(start)
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            waiting += project["dependency-groups"][each["include-group"]]
            continue
        requirement = Requirement(each)
        if requirement.marker is not None and not requirement.marker.evaluate(environment):
            continue
        if requirement.name == "wamnet":
            options = project["project"]["optional-dependencies"]
            waiting += itertools.chain.from_iterable(options[each] for each in requirement.extras)
            continue
        found.add(requirement.name)
        for each in ("", *requirement.extras):
            found |= BRINGS.get((requirement.name, each), set())
    return found


@pytest.mark.parametrize(("system", "machine"), SYSTEMS)
@pytest.mark.parametrize("python", PYTHONS)
def test_no_extra_or_group_needs_a_package_without_files(project, system, machine, python):
    """wamnet[opencl] could not be installed on arm64 and on macOS, nor could make demo on arm64."""
    starts = dict(project["project"]["optional-dependencies"])
    if system == "linux":  # groups are for work in the repository
        starts |= project["dependency-groups"]
    lacking = {name for name, lacks in WITHOUT.items() if lacks(system, machine, python)}
    for name, start in starts.items():
        assert not installed(project, start, system, machine, python) & lacking, name
    full = installed(project, ["wamnet[full]"], system, machine, python)
    assert {"pyopencl", "pocl-binary-distribution", "moderngl"} - lacking <= full


def test_each_name_of_an_extra_or_a_group_exists(house, project):
    """In messages, documents and scripts: what they say to install can be installed."""
    extras, groups = project["project"]["optional-dependencies"], project["dependency-groups"]
    wrong = []
    for path in house.files():
        if path.suffix in {".py", ".md", ".sh", ".toml", ""}:
            content = path.read_text(encoding="utf-8", errors="ignore")
            named = {(name, "extra") for each in EXTRA.findall(content) for name in each.split(",")}
            named |= {(name, "group") for name in GROUP.findall(content)}
            wrong += [
                f"{path.relative_to(house.root)}: {kind} {name}"
                for name, kind in sorted(named)
                if name not in (extras if kind == "extra" else groups)
            ]
    house.refuse(wrong, "Extras and dependency groups are named as in pyproject.toml.")


def test_the_classifiers_name_each_python(project):
    named = [
        line.rpartition(" ")[2] for line in project["project"]["classifiers"] if ":: Python :: 3." in line
    ]
    assert tuple(named) == PYTHONS
    assert all(python in SpecifierSet(project["project"]["requires-python"]) for python in PYTHONS)
    assert project["tool"]["ruff"]["target-version"] == f"py{PYTHONS[0].replace('.', '')}"
