"""Figures: a picture by itself has its alternative text as a caption; the index has the live page.

1. A paragraph that holds nothing but a picture becomes a figure, as does a picture that a cell shows; its
   text becomes the caption, too [`captioned`]. Readers of screens hear it once: the caption is for eyes.
2. A mark in a page's text is the place of the live page: a button beside a picture of it, which puts the page
   into a frame when the reader asks (assets/live.js), and a link for those without scripts [`with_live`].
"""

from __future__ import annotations

import re
from pathlib import Path

from wamnet.cli.reports.webpage import page_of

LIVE = "live.html"
"""The site's address of the live page."""

MARK = "<!-- live page -->"
"""Where a page has it."""

MODEL = Path("minicubes")
"""Name of the shipped model that it shows."""

ALONE = re.compile(r"<p>(<img [^>]*?alt=\"([^\"]*)\"[^>]*>)</p>")
"""A picture in a paragraph of its own, and its text."""

SHOWN = re.compile(r"(<img class=\"shown[^\"]*\" alt=\"([^\"]*)\"[^>]*>)")
"""A picture that a cell shows."""

FRAME = f"""<div class="live" data-live="{LIVE}">
<button type="button" class="md-button md-button--primary" hidden>Run it here</button>
<a class="md-button" href="{LIVE}">Open it in a page of its own</a>
</div>"""
"""What the mark becomes; the button shows itself where scripts run."""


def captioned(html: str) -> str:
    """Return a page's HTML with pictures as figures with captions."""

    def figure(match: re.Match[str]) -> str:
        return f'<figure>{match[1]}<figcaption aria-hidden="true">{match[2]}</figcaption></figure>'

    return SHOWN.sub(figure, ALONE.sub(figure, html))


def with_live(markdown: str) -> str:
    """Return the text with the live page at its mark."""
    return markdown.replace(MARK, FRAME)


def live_page() -> str:
    """Return the live page of the shipped model."""
    return page_of(MODEL, None, [], None)
