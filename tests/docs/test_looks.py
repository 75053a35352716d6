"""How the site looks and works: live page, captions, no cut text, access in two themes, print."""

import figures
import folds
import pytest

PAGES = ("index.html", "tutorial/4-frame.html", "course/lab01-sphere.html", "spec/sampling.html")
"""A page of each kind."""

TABLED = (
    *("results.html", "results/hard-light.html", "speed.html", "speed/frames.html", "speed/rows.html"),
    *("support.html", "guide/kernels.html"),
)
"""Pages with wide tables."""

HIGHEST_PX = 8000
"""Of a page of measurements, on a desktop: about nine screens."""

LARGEST_BYTES = 1_500_000
"""Of the live page of the shipped model [WEB-1]."""

WRAPPED = """[...document.querySelectorAll(".md-content .highlight pre code, .md-content .output pre")]
  .filter((one) => getComputedStyle(one).whiteSpace !== "pre").length"""
"""How many pieces of code wrap their lines."""

TABLES = """[...document.querySelectorAll(".md-typeset__scrollwrap")].map((one) => {
  const left = () => one.querySelector("td:first-child").getBoundingClientRect().left;
  const far = one.scrollWidth - one.clientWidth;
  one.scrollLeft = far;
  return [far, left() - one.getBoundingClientRect().left];
})"""
"""How much wider than its place each table is, and where its first column is at the end of scrolling."""

SCROLLS = """[...document.querySelectorAll(".md-content pre, .md-content pre code, .md-content figure")]
  .filter((one) => one.clientWidth && one.scrollWidth > one.clientWidth + 1)
  .map((one) => one.textContent.trim().slice(0, 60))"""
"""What is wider than its place."""

FIGURES = """[...document.querySelectorAll("figure")].map((one) => [
  one.querySelector("figcaption")?.textContent, one.querySelector("img").alt,
  one.clientWidth - one.parentElement.clientWidth])"""
"""Captions, texts, and how much wider than the text a figure is."""


@pytest.mark.parametrize("width", [390, 800, 1280])
def test_nothing_is_cut(site, chromium, width):
    """At the widths of a phone, a tablet and a desktop; code scrolls, so that its indentation is right."""
    with chromium.tab(site / PAGES[0], viewport={"width": width, "height": 900}) as tab:
        for name in PAGES:
            tab.page.goto((site / name).as_uri())
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= width, name
            assert tab.page.evaluate(WRAPPED) == 0, name
            for caption, text, wider in tab.page.evaluate(FIGURES):
                assert caption == text, name
                assert wider <= 0, name


@pytest.mark.parametrize("width", [390, 1400])
def test_wide_tables_keep_their_first_column(site, chromium, width):
    """On a phone they scroll under it; on a desktop no column is cut."""
    with chromium.tab(site / PAGES[0], viewport={"width": width, "height": 900}) as tab:
        for name in TABLED:
            tab.page.goto((site / name).as_uri())
            tab.page.locator(".md-typeset__scrollwrap").first.wait_for()
            found = tab.page.evaluate(TABLES)
            assert all(abs(left) <= 1 for far, left in found if far > 1), name
            assert any(far > 1 for far, _ in found) == (width < 1000), name
            height = tab.page.evaluate("document.documentElement.scrollHeight")
            assert width < 1000 or height <= HIGHEST_PX, name


COLUMNS = """(() => {
  const code = document.querySelector(".highlight pre code");
  const probe = code.appendChild(document.createElement("span"));
  probe.textContent = "x".repeat(100);
  probe.style.whiteSpace = "pre";
  const width = probe.getBoundingClientRect().width / 100;
  probe.remove();
  const style = getComputedStyle(code);
  return (code.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight)) / width;
})()"""
"""How many letters of code fit into a line."""


def test_a_line_of_code_has_88_columns_on_a_desktop(site, chromium):
    """As many as programs in the documents have: they are not wrapped."""
    with chromium.tab(site / PAGES[1], viewport={"width": 1280, "height": 900}) as tab:
        assert tab.page.evaluate(COLUMNS) >= 88


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everyone_can_use_it(site, chromium, scheme):
    """axe-core finds nothing serious or critical, and both themes have their own paper."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    with chromium.tab(site / PAGES[0], color_scheme=scheme, reduced_motion="reduce") as tab:
        for name in (*PAGES, "results.html", "speed/rows.html", "support.html"):
            tab.page.goto((site / name).as_uri())
            tab.page.wait_for_load_state("load")
            found = axe.Axe().run(tab.page).response["violations"]
            grave = [(one["id"], one["nodes"][0]["html"][:100]) for one in found if one["impact"] in GRAVE]
            assert grave == [], name
        paper = tab.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert paper == {"light": "rgb(250, 249, 245)", "dark": "rgb(20, 22, 26)"}[scheme]


GRAVE = ("serious", "critical")
"""Impacts, as axe-core calls them."""


def test_the_index_has_the_live_page_when_the_reader_asks(site, chromium):
    """In a frame without a title of its own; before, nothing of it is loaded."""
    assert 10**5 < (site / figures.LIVE).stat().st_size < LARGEST_BYTES
    with chromium.tab(site / "index.html", reduced_motion="reduce") as tab:
        assert not any("live.html" in address for address in tab.asked)
        tab.page.locator(".live button").click()
        frame = tab.page.frame_locator("figure iframe")
        frame.locator("body.embedded #picture").wait_for()
        assert frame.locator("header").bounding_box()["height"] == 1
        assert tab.page.locator("figure iframe").get_attribute("title")
        assert tab.page.locator(".live button").count() == 0


def test_pages_print(site, chromium):
    """Black on white in either theme, without what only works on a screen, and no line is cut."""
    with chromium.tab(site / PAGES[1], color_scheme="dark", viewport={"width": 700, "height": 900}) as tab:
        tab.page.emulate_media(media="print", color_scheme="dark")
        colors = "(({ backgroundColor, color }) => [backgroundColor, color])(getComputedStyle(document.body))"
        assert tab.page.evaluate(colors)[0] == "rgb(255, 255, 255)"
        assert tab.page.evaluate("getComputedStyle(document.querySelector('h1')).color") == "rgb(0, 0, 0)"
        paper = "getComputedStyle(document.querySelector('pre code')).backgroundColor"
        assert tab.page.evaluate(paper) == "rgb(244, 244, 244)"
        for what in (".md-header", ".md-sidebar", ".md-footer"):
            assert not tab.page.locator(what).first.is_visible()
        assert tab.page.locator("figure img").first.is_visible()
        assert tab.page.evaluate(SCROLLS) == []


def test_pictures_that_stand_alone_have_captions():
    html = '<p><img alt="A cube" src="a.png" /></p><p>See <img alt="b" src="b.png" /></p>'
    assert figures.captioned(html) == (
        '<figure><img alt="A cube" src="a.png" /><figcaption aria-hidden="true">A cube</figcaption></figure>'
        '<p>See <img alt="b" src="b.png" /></p>'
    )
    shown = '<img class="shown pixels" alt="Two &lt; three" src="data:,">'
    assert figures.captioned(shown).endswith(
        '<figcaption aria-hidden="true">Two &lt; three</figcaption></figure>'
    )


def test_the_mark_is_the_place_of_the_live_page():
    assert figures.with_live(f"a\n\n{figures.MARK}\n") == f"a\n\n{figures.FRAME}\n"
    assert figures.with_live("a\n") == "a\n"


LONG = (
    "spec/vectors/index.html",
    "spec/departures.html",
    "spec/kernel_interface.html",
    "spec/conformance.html",
)
"""Pages of the spec that are folded."""


def test_no_page_of_the_spec_is_too_high(site, chromium):
    """And a heading in a fold is visible, so that links to it lead somewhere."""
    with chromium.tab(site / PAGES[0], viewport={"width": 1400, "height": 900}) as tab:
        for name in LONG:
            tab.page.goto((site / name).as_uri())
            assert tab.page.evaluate("document.documentElement.scrollHeight") <= HIGHEST_PX, name
            assert tab.page.locator("details:not([open])").count() > 0, name
            assert all(each.is_visible() for each in tab.page.locator("summary h2").all()), name


def test_pages_are_folded_by_kind_and_by_chapter():
    kinds = '<p>a</p><h2 id="x">X</h2><p>x</p><h2 id="y">Y</h2><p>y</p>'
    assert folds.folded(kinds, "spec/vectors/README.md") == (
        '<p>a</p><details><summary><h2 id="x">X</h2></summary><p>x</p></details>'
        '<details><summary><h2 id="y">Y</h2></summary><p>y</p></details>'
    )
    rows = "".join(f'<tr><td><a href="{name}.html">1</a></td></tr>' for name in ("adam", "adam", "box"))
    page = f"{folds.DECISIONS}></h2><table><thead></thead><tbody>{rows}</tbody></table>"
    html = folds.folded(page, "spec/departures.md")
    assert html.count("<details>") == html.count("<table>") == 2
    assert "<summary>adam (2)</summary>" in html
    assert html.count("<tr>") == 3
    assert folds.folded(page, "spec/adam.md") == page
