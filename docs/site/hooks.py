"""What MkDocs calls while it builds the site; see mkdocs.yml.

1. Bring in the spec from its folder, the page of the vectors' formats, and a page for each source file that a
   text names, and the live page [`on_files`]; order the pages as spec/README.md does [`on_config`].
2. Give clauses their anchors, and execute the cells of tutorial and course [`on_page_markdown`].
3. Set formulas, give pictures their captions, fold long parts, and link what is named [`on_page_content`].
4. Name the theme's dialog for search [`on_post_page`].
5. Cut the addresses of other hosts out of the theme's scripts, and refuse a site with a link that leads
   nowhere, or to another host [`on_post_build`].
"""

from __future__ import annotations

import logging
import posixpath
import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from mkdocs.utils import get_relative_url

sys.path.insert(0, str(Path(__file__).parent))
import cells
import chapters
import figures
import folds
import formulas
import links
import listing_page
import sources

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""

SPEC = ROOT / "spec"
"""The spec's chapters."""

SECTION = re.compile(r"^## (.+)$|^\* \[.*?\]\((\w+\.md)\)", re.MULTILINE)
"""A heading of the spec's index, or a line of its list."""

GUIDE = re.compile(r"^\| \[.*?\]\(([\w-]+\.md)\)", re.MULTILINE)
"""A row of the guide's table of pages."""

START = ("index.md", "guide/install.md", "first-kernel.md", "support.md", "limits.md")
"""The first pages."""

RESULTS = ("quality.md", "hard-light.md", "paper.md")
"""Pages of results/, in their order."""

SPEED = ("gpu.md", "frames.md", "path-tracer.md", "rows.md")
"""Pages of speed/, in their order."""

LEAVING = re.compile(r"\]\(((?:\.\./)+(?:spec|docs|examples)/[\w./-]+)")
"""A link from docs/ to spec/ or examples/, or back, as it works in the repository."""

DOWNLOADS = ("examples/scenes/still-life.json", "examples/c99/wamnet.c", "spec/vectors/schema.json")
"""Files that pages link to and that the wheel does not have as files of a user's."""

FOREIGN = re.compile(r"https://(?:unpkg\.com|api\.github\.com)/[\w./@-]*")
"""Addresses in the theme's scripts, for diagrams and counts of stars that this site does not have."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Order the pages."""
    # Texts such as `[W][D_in]` in the spec look like cross-references, which the API's page does not have.
    logging.getLogger("mkdocs.plugins.mkdocs_autorefs").setLevel(logging.ERROR)
    docs = Path(config.docs_dir)

    def pages(folder: str) -> list[str]:
        return [f"{folder}/{name}" for name in by_number(path.name for path in (docs / folder).glob("*.md"))]

    parts: list[Any] = ["spec/README.md"]
    for title, chapter in SECTION.findall((SPEC / "README.md").read_text()):
        if title:
            parts.append({title: (section := [])})
        else:
            section.append(f"spec/{chapter}")
    parts = [part for part in parts if isinstance(part, str) or any(part.values())]
    parts.append({"Vectors' formats": "spec/vectors/README.md"})
    config.nav = [
        {"Start": [*START]},
        {"Learn": [{"Tutorial": pages("tutorial")}, {"Course": course(docs)}, "listing.md"]},
        {"Guide": ["guide/index.md", *(page for page in in_order(docs) if page not in START)]},
        {"API": ["reference.md"]},
        {"Spec": parts},
        {"Results": [*measured("results", RESULTS), *measured("speed", SPEED)]},
        {"Contribute": ["recipes.md", "trials.md"]},
    ]
    return config


def measured(page: str, names: Iterable[str]) -> list[str]:
    """Return a page of measurements, and those that it leads to."""
    return [f"{page}.md", *(f"{page}/{name}" for name in names)]


def course(docs: Path) -> list[str]:
    """Return the pages of the course: its index, the labs, the extras, and the page for teachers."""
    names = sorted(path.name for path in (docs / "course").glob("*.md"))
    labs = [name for name in names if name.startswith("lab")]
    extras = [name for name in names if name.startswith("extra")]
    return [f"course/{name}" for name in ("index.md", *labs, *extras, "teach.md")]


def by_number(names: Iterable[str]) -> list[str]:
    """Return the names of a folder's pages: its index, then by number, so that 10 comes after 9."""

    def key(name: str) -> tuple[bool, int, str]:
        number = re.match(r"\d*", name)
        return name != "index.md", int((number and number[0]) or 0), name

    return sorted(names, key=key)


def in_order(docs: Path) -> list[str]:
    """Return the guide's pages in the order of its table."""
    return [f"guide/{name}" for name in GUIDE.findall((docs / "guide/index.md").read_text())]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Bring in the spec and the source files that texts name."""
    texts = {path: path.read_text() for path in [*SPEC.glob("*.md"), *Path(config.docs_dir).rglob("*.md")]}
    pages = [*sorted(SPEC.glob("*.md")), SPEC / "vectors/README.md"]
    for path in [*pages, *(ROOT / name for name in DOWNLOADS)]:
        name = path.relative_to(ROOT).as_posix()
        files.append(File.generated(config, name, abs_src_path=str(path)))
    files.append(File.generated(config, figures.LIVE, content=figures.live_page()))
    named = {path for text in texts.values() for path in chapters.named_files(text)}
    for path in sorted(named):
        if (ROOT / path).exists():
            heading = f"---\nsearch:\n  exclude: true\nhide: [toc]\n---\n# {path}\n"
            name = chapters.source_page(path).replace(".html", ".md")
            hidden = InclusionLevel.NOT_IN_NAV
            files.append(File.generated(config, name, content=heading, inclusion=hidden))
    config.extra["sources"] = {
        path: set(sources.definitions((ROOT / path).read_text())) for path in named if (ROOT / path).exists()
    }
    config.extra["places"] = _places()
    return files


def _places() -> dict[str, str]:
    """Return the site's address of each clause and of each chapter."""
    found = {}
    for path in sorted(SPEC.glob("*.md")):
        address = f"spec/{'index' if path.stem == 'README' else path.stem}.html"
        if path.stem != "README":
            found[path.stem] = address
        found |= {clause: f"{address}#{clause.lower()}" for clause in chapters.clauses(path.read_text())}
    return found


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Give clauses their anchors, execute cells, and turn links to other folders."""
    uri = page.file.src_uri
    if uri.startswith("spec/"):
        return into_site(chapters.anchored(markdown), uri)
    if uri.startswith(("tutorial/", "course/")):
        markdown = cells.executed(markdown, f"docs/{uri}")
    return into_site(figures.with_live(markdown), f"docs/{uri}")


def into_site(markdown: str, path: str) -> str:
    """Return the Markdown of a file of the repository with links between docs/ and spec/ as on the site.

    The site's root is docs/, and spec/ lies in it.
    """

    def link(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(path), match[1]))
        own, there = (name.removeprefix("docs/") for name in (path, target))
        return f"]({posixpath.relpath(there, posixpath.dirname(own) or '.')}"

    return LEAVING.sub(link, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Set formulas, link what is named, and show sources."""
    uri = page.file.src_uri
    if uri.startswith("source/"):
        path = uri.removeprefix("source/").removesuffix(".md") + ".py"
        return html + sources.page((ROOT / path).read_text())

    def link(address: str) -> str:
        return get_relative_url(address, page.url)

    if uri == "listing.md":
        html = listing_page.page(html)
    html = folds.folded(figures.captioned(formulas.rendered(html, f"docs/{uri}")), uri)
    return chapters.linked(html, config.extra["places"], config.extra["sources"], link)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Name the dialog for search, which the theme leaves without a name."""
    return output.replace('role="dialog"', 'role="dialog" aria-label="Search"')


@event_priority(-200)  # after the plugins
def on_post_build(config: MkDocsConfig) -> None:
    """Cut the addresses of other hosts, and refuse links that lead nowhere."""
    folder = Path(config.site_dir)
    for path in [*folder.rglob("*.js"), *folder.rglob("*.css")]:
        text = path.read_text(encoding="utf-8")
        if (cut := FOREIGN.sub("about:blank", text)) != text:
            path.write_text(cut, encoding="utf-8")
    # Maps for debuggers, and the search's grammar of other languages, name other hosts and are not needed.
    for path in folder.rglob("*.map"):
        path.unlink()
    shutil.rmtree(folder / "assets/javascripts/lunr", ignore_errors=True)
    if wrong := links.broken(folder):
        shown = "\n  ".join(wrong[:40])
        raise PluginError(f"the site has {len(wrong)} links that lead nowhere or elsewhere:\n  {shown}")
