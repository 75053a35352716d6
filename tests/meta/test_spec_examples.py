"""Examples in the spec are true: worked ones are computed again, fenced blocks run, links lead somewhere.

1. Between `<!-- worked: name -->` and `<!-- end -->` is what tests/support/worked.py computes under that
   name [`test_worked_examples`]; `--update-golden` writes it.
2. A fenced block is run, read or drawn by its language [`test_fenced_blocks`], or a mark before it says where
   a test runs it, `<!-- run by tests/... -->`, or why it cannot be, `<!-- not run: reason -->`.
3. Links lead to files of the repository [`test_links_lead_somewhere`]; named paths: tests/meta/test_paths.py.
4. What a chapter decides about the paper is in the appendix, in words
   [`test_decisions_about_the_paper_are_in_the_appendix`].
"""

import json
import re
from pathlib import Path

import pytest
from programs import run_block
from worked import LINES, decided

ROOT = Path(__file__).resolve().parents[2]

CHAPTERS = sorted((ROOT / "spec").glob("*.md"))
"""The text; the page of vectors is written by the program and tested with it."""

WORKED = re.compile(r"^<!-- worked: (\w+) -->\n(.*?)^<!-- end -->$", re.MULTILINE | re.DOTALL)
"""An example that is computed."""

FENCE = re.compile(
    r"(?:^<!-- (run by|not run:) (.+?) -->\n\n?)?^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
"""A fenced block, perhaps with a mark."""

LINK = re.compile(r"\]\(([\w./:-]*)(?:#[^)\s]*)?\)")
"""The target of a link, without its anchor."""


def filled(text: str) -> str:
    """Return a chapter with its worked examples as they are computed now."""

    def fill(match: re.Match[str]) -> str:
        lines = "\n".join(LINES[match[1]]())
        return f"<!-- worked: {match[1]} -->\n\n{lines}\n\n<!-- end -->"

    return WORKED.sub(fill, text)


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.name)
def test_worked_examples(path: Path, pytestconfig: pytest.Config) -> None:
    """Numbers, and the bindings of emitted kernels (KER-21, PTK-15, PPL-11)."""
    text = path.read_text()
    unknown = [name for name, _ in WORKED.findall(text) if name not in LINES]
    assert not unknown, f"{path.name}: write {unknown} in tests/support/worked.py"
    if pytestconfig.getoption("--update-golden"):
        path.write_text(filled(text))
    way_out = "run pytest --update-golden tests/meta/test_spec_examples.py, and read the difference"
    assert path.read_text() == filled(text), (
        f"{path.name}: a worked example is not what is computed; {way_out}"
    )


def test_every_worked_example_is_shown() -> None:
    shown = {name for path in CHAPTERS for name, _ in WORKED.findall(path.read_text())}
    assert shown == set(LINES), "a worked example is shown by a chapter: remove it or show it"


def fenced(path: Path) -> list[tuple[str | None, str | None, str, str]]:
    """Return (mark, its argument, language, text) of the blocks that are not worked examples."""
    return [(m[1], m[2], m[3], m[4]) for m in FENCE.finditer(WORKED.sub("", path.read_text()))]


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.name)
def test_fenced_blocks(path: Path, tmp_path: Path) -> None:
    for mark, argument, language, text in fenced(path):
        where = f"{path.name}: block of {language or 'no language'}: {text[:60]!r}"
        if mark == "run by":
            assert (ROOT / str(argument)).exists(), f"{where}: {argument} does not exist"
        elif mark is None and language == "json":
            json.loads(text)
        elif mark is None:
            assert language in ("sh", "python"), f"{where}: run it, or mark it with <!-- not run: reason -->"
            run_block(where, language, text, tmp_path)


def test_links_lead_somewhere() -> None:
    wrong = [
        f"spec/{path.name}: {target}"
        for path in CHAPTERS
        for target in LINK.findall(FENCE.sub("", path.read_text()))
        if target and "://" not in target and not (path.parent / target).exists()
    ]
    assert not wrong, f"a link leads to a file of the repository: {wrong}"


def test_decisions_about_the_paper_are_in_the_appendix() -> None:
    """What a chapter decides because the paper is silent, or against it, is in departures.md in words."""
    by_hand = WORKED.sub("", (ROOT / "spec/departures.md").read_text())
    about = {
        clause
        for _, clause, text in decided()
        if re.search(r"\b[Tt]he paper\b(?!'s (network|first layer))", text)
    }
    assert len(about) >= 8, "decisions that name the paper are found"
    missing = sorted(clause for clause in about if not re.search(rf"\b{clause}\b", by_hand))
    assert not missing, (
        f"spec/departures.md says how {missing} departs from the paper, or what it leaves open"
    )
