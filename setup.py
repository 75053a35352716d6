"""Build the package; the metadata is in pyproject.toml, except the description that a package index shows.

1. It is README.md without HTML comments, which mark generated figures [`described`].
2. Its links and images lead to the project's home, which pyproject.toml names.
"""

from __future__ import annotations

import re
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
"""The folder of the sources."""

CODE = re.compile(r"(^```.*?^```$|`[^`\n]+`)", re.MULTILINE | re.DOTALL)
"""Blocks and spans of code, which stay as they are."""

COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
"""A comment of HTML."""

RELATIVE = re.compile(
    r"""(\]\(<?|^\[[^]\n]+\]:\s*<?|\b(?:src|href|poster|srcset)=["'])(?![a-z][a-z0-9+.-]*:|//)([^\s)>"']+)""",
    re.IGNORECASE | re.MULTILINE,
)
"""What comes before the target of a link or an image, and the target, which has no scheme."""

IMAGES = (".png", ".jpg", ".gif", ".svg", ".webp", ".webm", ".mp4")
"""Suffixes of files that a page shows: the home has them under `raw`, and pages about them under `blob`."""


def described(readme: str, home: str) -> str:
    """Return a README whose links do not depend on the files beside it."""

    def absolute(link: re.Match[str]) -> str:
        before, target = link.groups()
        if target.startswith("#"):
            return f"{before}{home}{target}"
        kind = "raw" if target.lower().endswith(IMAGES) else "blob"
        return f"{before}{home}/{kind}/HEAD/{target.removeprefix('./').removeprefix('/')}"

    parts = CODE.split(readme)
    parts[::2] = [RELATIVE.sub(absolute, COMMENT.sub("", part)) for part in parts[::2]]
    return "".join(parts)


if __name__ == "__main__":
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (home,) = re.findall(r'^Homepage = "(.+)"$', project, re.MULTILINE)
    setup(
        long_description=described((ROOT / "README.md").read_text(encoding="utf-8"), home),
        long_description_content_type="text/markdown",
    )
