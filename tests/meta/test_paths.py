"""House rule about paths: what a document or a docstring names is there."""

import ast
import re
from collections.abc import Iterator

NAMED = re.compile(
    r"(?<![\w/.<>{}*:-])((?:refimpl|compiler|kernels|cli|tests|spec|experiments|examples|docs|models|\.ci)/[\w/.*<>{}-]*[\w>}*/])"
)
"""A path from the repository's root: it begins with one of its folders. What follows a colon is of
another commit."""


def named_paths(text: str) -> list[str]:
    """Return the paths that a text names; one with a gap to fill in, as in spec/<stem>.md, does not count."""
    found = [match.rstrip("/") for match in NAMED.findall(text)]
    return [path for path in found if not set("<>{}*") & set(path)]


def texts(house) -> Iterator[tuple[str, str]]:
    """Yield (place, text) of every document and of every string that is a statement of Python code."""
    for path in house.files():
        if path.suffix == ".md":
            yield path.relative_to(house.root).as_posix(), path.read_text()
    for source in house.python():
        for node in source.nodes:
            alone = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            if alone and isinstance(node.value.value, str):
                yield source.at(node, "docstring"), node.value.value


def test_named_paths_exist(house):
    wrong = [
        f"{place}: {path}"
        for place, text in texts(house)
        for path in named_paths(text)
        if not (house.root / path).exists()
    ]
    house.refuse(wrong, "A path that a document or a docstring names exists: correct it.")
