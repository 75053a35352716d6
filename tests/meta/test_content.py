"""House rules about text: nothing in the repository depends on one machine or points outside the project."""

import re

FORBIDDEN = {
    "a path of one machine": r"(?<![\w.}])/(work|home|root|Users)/\w|[A-Z]:\\\\Users",
    "a package registry's host": r"\b(pypi|pythonhosted|npmjs|crates)\.(org|com|io)\b",
    "a document from outside": r"\b(DESIGN|STYLE|EVIDENCE|NOTES|ANCHORS-\w+)\.md|\.\./shared",
    "unfinished work": r"\b(TODO|FIXME|XXX|HACK)\b",
    "a writing tool": r"(?i)\b(chatgpt|copilot|claude|gemini|language model|ai assistant|co-authored-by)\b",
}
"""What no file may contain: the name of the reason, and the pattern."""


def test_no_forbidden_content(house):
    wrong = []
    for path in house.files():
        if path.name == "test_content.py" or not (text := text_of(path)):
            continue
        for reason, pattern in FORBIDDEN.items():
            for match in re.finditer(pattern, text):
                place = f"{path.relative_to(house.root)}:{text.count(chr(10), 0, match.start()) + 1}"
                wrong.append(f"{place}: {reason}: {match[0]}")
    house.refuse(wrong, "A file holds nothing of one machine, outside the project or unfinished: rewrite it.")


def text_of(path) -> str:
    """Return a file's text; that of a binary file is empty."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return ""


def test_a_worktree_of_git_is_the_project_s(house, tmp_path) -> None:
    """Its `.git` is a file with a path of the machine, and none of the project's."""
    (tmp_path / ".git").write_text("gitdir: elsewhere")
    (tmp_path / "a.txt").write_text("")
    assert [path.name for path in type(house)(tmp_path).files()] == ["a.txt"]
