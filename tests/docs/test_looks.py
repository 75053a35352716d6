"""How the site looks and works: live page, no cut text, access in two themes."""

import figures
import pytest

PAGES = ("index.html", "tutorial/4-frame.html", "course/lab01-sphere.html", "spec/sampling.html")
"""A page of each kind."""


LARGEST_BYTES = 1_500_000
"""Of the live page of the shipped model [WEB-1]."""

WRAPPED = """[...document.querySelectorAll(".md-content .highlight pre code, .md-content .output pre")]
  .filter((one) => getComputedStyle(one).whiteSpace !== "pre").length"""
"""How many pieces of code wrap their lines."""


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
