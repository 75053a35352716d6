"""The web site: it is whole, needs no other host, and says what the spec says; wrong pages are refused."""

import re
from html.parser import HTMLParser
from pathlib import Path

import cells
import chapters
import formulas
import hooks
import links
import pytest
from build import main
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError

from wamnet.spec.conformance.kinds import KINDS

ROOT = Path(__file__).resolve().parents[2]

TRIES = 30
"""How often a query is typed, a second apart, until it is answered."""


def chapter_files() -> list[Path]:
    return sorted(path for path in (ROOT / "spec").glob("*.md") if path.name != "README.md")


# ---- the site that is built ------------------------------------------------------------------------------


def test_a_site_with_a_broken_link_is_refused(tmp_path):
    """The fixture `site` is built by the same step, so no link of it is broken."""
    (tmp_path / "index.html").write_text('<a href="spec/none.html">')
    with pytest.raises(
        PluginError, match=r"1 links that lead nowhere.*\n.*spec/none\.html: there is no such"
    ):
        refuse(tmp_path)


def refuse(folder: Path) -> None:
    config = MkDocsConfig()
    config.site_dir = str(folder)
    hooks.on_post_build(config)


def test_a_page_s_links_to_the_spec_work_in_the_repository_and_on_the_site():
    text = "[a](../../spec/rng.md#x), [b](../listing.md)"
    assert hooks.into_site(text, "docs/tutorial/1.md") == "[a](../spec/rng.md#x), [b](../listing.md)"
    assert hooks.into_site("[a](../spec/rng.md)", "docs/index.md") == "[a](spec/rng.md)"
    assert hooks.into_site("[a](../docs/images/a.png)", "spec/x.md") == "[a](../images/a.png)"


@pytest.mark.parametrize("chapter", chapter_files(), ids=lambda path: path.stem)
def test_every_clause_has_an_anchor(site, chapter):
    page = links.Page((site / "spec" / f"{chapter.stem}.html").read_text())
    assert {number.lower() for number in chapters.clauses(chapter.read_text())} <= page.anchors


def test_every_kind_of_vectors_has_its_format(site):
    text = (site / "spec/vectors/index.html").read_text()
    headings = re.findall(r'<h2 id="[^"]*">([\w.]+)<', text)
    assert sorted(headings) == sorted(KINDS)


def test_code_that_the_spec_names_is_linked_to_its_line(site):
    page = links.Page((site / "spec/rng.html").read_text())
    assert "../source/refimpl/rng.html#pcg4d" in page.addresses
    source = (site / "source/refimpl/rng.html").read_text()
    line = (
        (ROOT / "refimpl/rng.py")
        .read_text()
        .splitlines()
        .index("def pcg4d(v0: Any, v1: Any, v2: Any, v3: Any) -> Block:")
    )
    assert f'<span id="pcg4d"></span><span id="L{line + 1}"' in source


MOVED = {
    "results.html": "summary how-test-frames-differ-from-training-frames how-far-ahead-of-a-general-denoiser "
    "all-presets-beside-it other-scenes hard-light-mirrors-metal-glass-a-sky the-papers-table-1 "
    "speed-against-error-all-rows plots-and-pictures the-web-page-before-and-after",
    "speed.html": "summary the-network speed-against-error training the-path-tracer whole-pictures-in-motion "
    "rays-for-features what-a-kernel-of-one-scene-saves scenes-of-many-primitives",
}
"""Anchors of the two pages before they were split: links from outside still lead to them."""


@pytest.mark.parametrize("name", MOVED)
def test_anchors_of_split_pages_remain(site, name):
    assert set(MOVED[name].split()) <= links.Page((site / name).read_text()).anchors


TABS = ["Start", "Learn", "Guide", "API", "Spec", "Results", "Contribute"]
"""The parts of the site."""

GROUPS = ["Scene & rendering", "Data & network", "Compiler & kernels", "Error bounds", "Conformance"]
"""The parts of the spec."""


def test_the_site_and_the_spec_have_named_parts(site, chromium):
    with chromium.tab(site / "spec/index.html", viewport={"width": 1400, "height": 900}) as tab:
        names = [text.strip() for text in tab.page.locator(".md-tabs__link").all_text_contents()]
        assert names == TABS
        shown = [text.strip() for text in tab.page.locator(".md-nav label .md-ellipsis").all_text_contents()]
        assert set(GROUPS) <= set(shown)


def outside(asked: list[str]) -> list[str]:
    """Return the addresses that are not of the site."""
    return [address for address in asked if not address.startswith(("file:", "data:", "about:"))]


CUT = """[...document.querySelectorAll(".highlight pre code, .output pre, .md-typeset__scrollwrap")]
    .filter((piece) => piece.scrollWidth > piece.clientWidth + 1)
    .filter((piece) => getComputedStyle(piece).overflowX !== "auto" || piece.closest("[tabindex]") === null)
    .map((piece) => piece.textContent.trim().slice(0, 60))"""
"""The beginnings of the code and tables of a page that are cut, or that the keyboard cannot scroll."""


def test_no_page_is_wider_than_a_phone_and_no_code_is_cut(site, chromium):
    """Without a server, 400 pixels wide; and none asks for anything of another host."""
    with chromium.tab(site / "index.html", viewport={"width": 400, "height": 800}) as tab:
        for path in sorted(site.rglob("*.html")):
            if path.relative_to(site).parts[0] not in ("source", "404.html", "live.html"):
                tab.page.goto(path.as_uri())
                assert tab.page.evaluate("document.documentElement.scrollWidth") <= 400, path
                assert tab.page.evaluate(CUT) == [], path
    assert outside(tab.asked) == []
    assert tab.said == []


def test_search_finds_a_page_without_a_server(site, chromium):
    with chromium.tab(site / "index.html", viewport={"width": 1300, "height": 800}) as tab:
        query = tab.page.locator("[data-md-component=search-query]")
        found = tab.page.locator(".md-search-result__link").first
        for _ in range(TRIES):
            # What is typed before the index has been read is not looked up.
            query.fill("")
            query.press_sequentially("spherical cauchy")
            tab.page.wait_for_timeout(1000)
            if found.is_visible():
                break
        assert "sampling.html" in (found.get_attribute("href") or "")
    assert outside(tab.asked) == []


# ---- what is refused -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("html", "reason"),
    [
        ('<a href="none.html">', "no such file"),
        ('<a href="other.html#none">', "no such place"),
        ('<a href="#none">', "no such place"),
        ('<script src="https://example.org/x.js">', "not of this site"),
        ('<link href="//example.org/x.css">', "not of this site"),
        ('<img src="other.html">', "no alternative text"),
        ('<a href="other.html#here">', None),
        ('<img src="data:image/png;base64,AA" alt="a plot">', None),
    ],
)
def test_links_are_checked(tmp_path, html, reason):
    (tmp_path / "index.html").write_text(html)
    (tmp_path / "other.html").write_text('<p id="here">')
    wrong = links.broken(tmp_path)
    assert len(wrong) == (reason is not None)
    assert reason is None or reason in wrong[0]


def test_a_cell_that_raises_stops_the_build():
    text = "# Title\n\n```python cell\nx = 1\ny = x / 0\n```\n"
    with pytest.raises(PluginError, match=r"page\.md:4: line 2 of the cell raises ZeroDivisionError"):
        cells.executed(text, "page.md")


@pytest.mark.parametrize(
    ("tex", "message"), [(r"\nosuch{x}", "unknown command"), (r"a^b^c", "cannot be set")]
)
def test_a_formula_that_cannot_be_set_is_refused(tex, message):
    with pytest.raises(PluginError, match=message):
        formulas.rendered(f'<span class="arithmatex">\\({tex}\\)</span>', "page.md")


def test_a_formula_becomes_mathml():
    html = formulas.rendered('<div class="arithmatex">\\[\na &lt; \\frac{1}{2}\n\\]</div>', "page.md")
    assert "<mfrac>" in html
    assert 'display="block"' in html
    assert "&lt;" in html or "&#x0003C;" in html


def test_links_are_made_outside_of_links_headings_and_listings():
    html = "<h2>RNG-1</h2><p>RNG-1, rng.md and <a>RNG-1</a> <code>a/b.py: f, g</code></p><pre>RNG-1</pre>"
    places = {"RNG-1": "spec/rng.html#rng-1", "rng": "spec/rng.html"}
    found = chapters.linked(html, places, {"a/b.py": {"f"}}, lambda address: f"/{address}")
    assert found == (
        '<h2>RNG-1</h2><p><a href="/spec/rng.html#rng-1">RNG-1</a>, <a href="/spec/rng.html">rng.md</a> and '
        '<a>RNG-1</a> <code><a href="/source/a/b.html">a/b.py</a>: '
        '<a href="/source/a/b.html#f">f</a>, g</code></p><pre>RNG-1</pre>'
    )


def test_a_folder_that_holds_something_else_is_left_alone(tmp_path, monkeypatch, capsys):
    (tmp_path / "letter.txt").write_text("mine")
    monkeypatch.setattr("sys.argv", ["build.py", str(tmp_path)])
    assert main() == 2
    assert "holds something that is not a site; name another folder" in capsys.readouterr().err
    assert (tmp_path / "letter.txt").read_text() == "mine"


class Torn(HTMLParser):
    """The marks of figures that no paragraph, item or cell holds."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.held: list[str] = []
        self.found: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in ("p", "li", "td"):
            self.held.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in self.held:
            self.held.remove(tag)

    def handle_comment(self, data: str) -> None:
        if data.startswith(("=", "/")) and not self.held:
            self.found.append(data.strip())


def test_no_paragraph_is_torn_by_a_mark(site):
    """A comment at the start of a line ends a paragraph in Markdown."""
    assert Torn("<p>in</p>\n<!--= a --> 3 <!--/--> of").found == ["= a", "/"]
    for path in site.rglob("*.html"):
        assert Torn(path.read_text()).found == [], path


def test_an_option_is_not_a_folder(monkeypatch, capsys, tmp_path):
    """`--help` once became a folder with a site in it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["build.py", "--help"])
    assert main() == 2
    assert "usage: " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
