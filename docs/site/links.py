"""Check a built site: every link leads somewhere, and nothing comes from another host.

1. Each page's addresses and anchors are gathered [`Page`].
2. An address within the site must be a file of it; behind `#` there must be an element of that name.
3. What a browser loads by itself (scripts, styles, pictures, fonts) must be of the site, or in the page; a
   link that a reader may follow may lead elsewhere, but none is needed and none is allowed. Scripts and
   styles name no other host either [`HOST`].
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

HOST = re.compile(r"""["'(]\s*(?:https?:)?//(?!www\.w3\.org/)[\w.-]+\.[a-z]{2,}[^"')\s]*""")
"""The address of a host in a script or a style; names of XML's vocabularies are not addresses."""

ADDRESSES = {"href", "src", "srcset", "action", "poster", "data"}
"""Attributes that hold an address."""


class Page(HTMLParser):
    """The addresses and the anchors of one page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.anchors: set[str] = set()
        self.images_without_text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note anchors and links."""
        given = dict(attrs)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}  # type: ignore[misc]
        self.addresses += [given[name] or "" for name in ADDRESSES if name in given and tag != "object"]
        if tag == "img" and not (given.get("alt") or "").strip():
            self.images_without_text.append((given.get("src") or "")[:60])


def broken(folder: Path) -> list[str]:
    """Return what is wrong with the site in a folder, a line each."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.html"))}
    wrong = []
    for path, page in pages.items():
        name = path.relative_to(folder).as_posix()
        for address in dict.fromkeys(page.addresses):
            reason = _wrong(address, path, pages)
            # A server gives this page at every address that has no page.
            if reason and not (name == "404.html" and address.startswith("/")):
                wrong.append(f"{name}: {address[:100]}: {reason}")
        wrong += [f"{name}: picture {source} has no alternative text" for source in page.images_without_text]
    return [*wrong, *_hosts(folder)]


def _wrong(address: str, path: Path, pages: dict[Path, Page]) -> str:
    """Return why an address of a page leads nowhere, or nothing."""
    parts = urlsplit(address)
    if parts.scheme in ("data", "javascript", "about"):
        return ""
    if parts.scheme or parts.netloc:
        return "it is not of this site"
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if target.is_dir():
        target = target / "index.html"
    if not target.exists():
        return "there is no such file"
    fragment = unquote(parts.fragment)
    if fragment and target in pages and fragment not in pages[target].anchors | {"__skip"}:
        return "there is no such place on the page"
    return ""


def _hosts(folder: Path) -> Iterator[str]:
    """Yield the addresses of hosts in scripts and styles."""
    for path in sorted(folder.rglob("*")):
        # The index of the search holds the text of all pages, quotations included.
        if path.suffix in (".js", ".css") and path.name != "search_index.js":
            for match in HOST.finditer(path.read_text(encoding="utf-8")):
                yield f"{path.relative_to(folder).as_posix()}: {match[0][:100]}: it is not of this site"
