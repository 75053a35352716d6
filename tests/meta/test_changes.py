"""House rule about the changelog: one line an entry, in files of `changes` until a release."""

import re
import shutil
import subprocess
import sys

import pytest
import quick

KINDS = [
    kind["directory"] for kind in quick.tomllib.loads(quick.PROJECT.read_text())["tool"]["towncrier"]["type"]
]
"""Kinds of changes, in the order of the changelog."""

FRAGMENT = re.compile(rf"\+[\w-]+\.({'|'.join(KINDS)})\.md")
"""The name of a file with changes of one kind."""

VERSION = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - \d{4}-\d\d-\d\d$", re.MULTILINE)
"""The heading of a version."""


def test_a_fragment_has_a_kind_and_one_line(house):
    wrong = [
        path.name
        for path in sorted((house.root / "changes").iterdir())
        if path.suffix != ".jinja"
        and not (FRAGMENT.fullmatch(path.name) and path.read_text(encoding="utf-8").count("\n") == 1)
    ]
    house.refuse(
        wrong, f"A file of `changes` is +NAME.KIND.md with one line; KIND is one of {', '.join(KINDS)}."
    )


def test_the_newest_version_is_the_package_s_with_one_line_an_entry(house):
    """Entries of 0.2.0 and before are as they were published."""
    content = (house.root / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = VERSION.findall(content)[0]
    project = quick.tomllib.loads(quick.PROJECT.read_text(encoding="utf-8"))["project"]
    assert newest == project["version"]
    section = content.partition(f"## [{newest}]")[2].partition("\n## [")[0]
    kinds = [kind.lower() for kind in re.findall(r"^### (.*)$", section, re.MULTILINE)]
    assert kinds == [kind for kind in KINDS if kind in kinds]
    entries = section.partition("\n### ")[2].splitlines()[1:]
    house.refuse(
        [line for line in entries if line and not line.startswith(("- ", "### "))],
        "An entry of CHANGELOG.md is one line; what explains it is in docs.",
    )


@pytest.mark.needs("programs", "packages")
def test_a_release_makes_a_section_of_the_fragments(house, tmp_path):
    pytest.importorskip("towncrier")
    settings = quick.tomllib.loads(quick.PROJECT.read_text())["tool"]["towncrier"]
    assert (house.root / "CHANGELOG.md").read_text().count(settings["start_string"]) == 1
    shutil.copy(quick.PROJECT, tmp_path)
    (tmp_path / "changes").mkdir()
    shutil.copy(house.root / settings["template"], tmp_path / "changes")
    (tmp_path / "changes/+fly.added.md").write_text("`wamnet fly` flies.\n")
    (tmp_path / "changes/+birds.breaking.md").write_text("Birds do not.\n")
    options = "build --draft --version 99.0.0 --date 2099-01-01 --dir"
    command = [sys.executable, "-m", "towncrier", *options.split(), tmp_path]
    made = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    lines = [line for line in made.splitlines() if line]
    added = ["### Breaking", "- Birds do not.", "### Added", "- `wamnet fly` flies."]
    assert lines == ["## [99.0.0] - 2099-01-01", *added]
