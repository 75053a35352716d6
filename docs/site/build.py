"""Build the web site: `python docs/site/build.py [FOLDER]`, by default out/site.

MkDocs does it, as mkdocs.yml says, into a folder beside the last site; the new one takes its place when it is
whole. A broken link, a cell that raises or a formula that cannot be set refuses the site, and the last one
stays.
"""

from __future__ import annotations

import logging
import os
import shutil
import sys
from pathlib import Path

os.environ.setdefault("NO_MKDOCS_2_WARNING", "1")  # pyproject.toml keeps MkDocs below 2
from mkdocs.commands.build import build
from mkdocs.config import load_config
from mkdocs.exceptions import MkDocsException

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""


def build_site(folder: Path) -> Path:
    """Build the site into a folder, and return its first page."""
    part = folder.with_name(f"{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    config = load_config(str(ROOT / "mkdocs.yml"), site_dir=str(part))
    config.plugins.on_startup(command="build", dirty=False)
    try:
        build(config)
    except MkDocsException:
        shutil.rmtree(part, ignore_errors=True)
        raise
    finally:
        config.plugins.on_shutdown()
    if folder.exists():
        shutil.rmtree(folder)
    part.rename(folder)
    return folder / "index.html"


def main() -> int:
    """Build the site that the command line asks for."""
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    if len(sys.argv) > 2 or any(word.startswith("-") for word in sys.argv[1:]):
        print("usage: python docs/site/build.py [FOLDER]; out/site without one", file=sys.stderr)
        return 2
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "out/site"
    if folder.exists() and any(folder.iterdir()) and not (folder / "search").exists():
        print(f"docs: {folder} holds something that is not a site; name another folder", file=sys.stderr)
        return 2
    try:
        print(build_site(folder))
    except MkDocsException as error:
        print(f"docs: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
