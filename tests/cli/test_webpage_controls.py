"""The controls of the web page in a headless Chromium: ranges, keys, pointers, telephones."""

import json
from dataclasses import replace

import numpy as np
import pytest
from small_page import BELOW, NO_MOTION, RANGES, text_when

from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.variation import Variation, lamp_color, outside, saturation_of, varied

FITS = """[...document.querySelectorAll("main, main *")].every((element) =>
  element.getBoundingClientRect().right <= document.querySelector("header").getBoundingClientRect().right)"""
"""Nothing reaches over the edge that the title keeps."""


def test_controls_work(still):
    page = still.page
    page.evaluate("wamnet.go()")
    before = still.state("turn")
    page.locator("#picture").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("+")
    after = still.state("turn")
    assert after["yaw"] == before["yaw"] + 5
    assert after["pitch"] == before["pitch"] + 5
    assert after["distance"] < before["distance"]
    page.keyboard.press("0")
    assert still.state("turn") == {"yaw": 0, "pitch": 0, "distance": 1}
    page.keyboard.press(".")
    assert still.page.evaluate("wamnet.page.frame()") == 1
    assert page.locator("#time").get_attribute("aria-valuetext") == "0.38 seconds"
    page.locator("#beyond").check()
    page.locator("#yaw").fill("40")
    assert still.state("turn")["yaw"] == 40
    page.locator("#camera-reset").click()
    page.locator("#light-0").fill("#ff0000")
    (color, other), own = still.state("colors"), scenes.WARM
    assert np.mean(color) == pytest.approx(np.mean(own), rel=1e-15)  # some roundings of 2**-53
    assert saturation_of(color) == pytest.approx(1 - 1e-3, rel=1e-15)
    assert other == list(scenes.COOL)
    page.locator("#lights-reset").click()
    assert still.state("colors")[0] == list(scenes.WARM)
    page.locator("#beyond").uncheck()
    page.locator("#size").select_option("96")
    still.until("wamnet.page.renderer.size === 96 && !wamnet.page.renderer.strips.busy")
    page.locator("#left").select_option("normal")
    page.locator("#wipe").fill("30")
    assert still.state("wipe") == 0.3
    assert still.text("left-label") == "Normals"
    assert page.locator("#wipe").get_attribute("aria-valuetext") == "30 percent Normals, the rest Denoised"
    page.locator("#variant").select_option("fast-texture")
    still.until("wamnet.page.state.variant === 'fast-texture' && !wamnet.page.preparing")
    assert "within" in still.text("error")


def test_what_was_not_learned_is_said_beside_the_picture(still):
    """In one sentence, and nothing below it moves; inside of the ranges there is none."""
    page = still.page
    page.evaluate("wamnet.go(); wamnet.page.turn(wamnet.parts.REST); wamnet.page.goBeyond(true)")
    assert text_when(still, "return text === '';") == ""
    before = page.evaluate(BELOW)
    page.locator("#yaw").fill("24")
    page.locator("#yaw").fill("40")
    said = "Outside of what the network has learned: the camera is 40° to the side (learned: -24° to 24°). "
    assert text_when(still, "return text !== '';") == f"{said}Expect errors."
    assert page.locator("#outside").is_visible()
    page.locator("#pitch").fill("-60")
    page.locator("#distance").fill("1.5")
    page.locator("#light-1").fill("#0000ff")
    text = text_when(still, "return text.includes('light 2');")
    assert text == (
        "Outside of what the network has learned: the camera is 40° to the side (learned: -24° to 24°), "
        "60° down (8° down to 8° up), 1.5 times as far away (0.9 to 1.1), light 2 is 100 % saturated "
        "(0 % to 50 %). Expect errors."
    )
    assert page.evaluate(BELOW) == before
    page.locator("#lights-reset").click()
    page.locator("#camera-reset").click()
    text_when(still, "return text === '';")
    assert page.locator("#outside").get_attribute("aria-live") == "polite"
    assert not page.locator("#unknown-ranges").is_visible()
    page.evaluate("wamnet.page.goBeyond(false)")


def test_camera_and_lights_move_inside_of_what_was_learned(still):
    """The ranges are beside the sliders; a box lets them go beyond, and back brings all inside again."""
    page = still.page
    page.evaluate("wamnet.go(); wamnet.page.turn(wamnet.parts.REST)")
    ends = "[...document.querySelectorAll('#yaw, #pitch, #distance')].map(one => [+one.min, +one.max])"
    assert page.evaluate(ends) == [[-24, 24], [-8, 8], [0.9, 1.1]]
    assert still.text("yaw-range") == "learned: -24° to 24°"
    assert still.text("distance-range") == "learned: × 0.9 to × 1.1"
    assert still.text("light-0-saturation-range") == "learned: 0 % to 50 %"
    assert not page.locator("#light-0-power").is_visible()
    page.evaluate("wamnet.page.turn({ yaw: 170, pitch: -75, distance: 2 })")
    assert still.state("turn") == {"yaw": 24, "pitch": -8, "distance": 1.1}
    page.locator("#light-0-hue").fill("240")
    page.locator("#light-0-saturation").fill("0.4")
    assert still.state("colors")[0] == pytest.approx(lamp_color(scenes.WARM, 240 / 360, 0.4), rel=1e-14)
    assert still.state("colors")[1] == list(scenes.COOL)
    page.locator("#light-0").fill("#ff0000")
    assert still.state("colors")[0] == pytest.approx(lamp_color(scenes.WARM, 0.0, 0.5), rel=1e-14)
    assert text_when(still, "return text === '';") == ""
    page.locator("#beyond").check()
    page.locator("#yaw").fill("90")
    page.locator("#light-0-power").fill("2")
    page.locator("#light-0-saturation").fill("1")
    assert still.state("colors")[0] == pytest.approx([2 * sum(scenes.WARM), 0, 0], rel=1e-14)
    assert (
        "light 1 is 100 % saturated (0 % to 50 %), 2 times as bright as its own (its own power)"
        in text_when(still, "return text.includes('100 %');")
    )
    page.locator("#beyond").uncheck()
    assert still.state("turn")["yaw"] == 24
    assert still.state("colors")[0] == pytest.approx(lamp_color(scenes.WARM, 0.0, 0.5), rel=1e-14)
    page.locator("#lights-reset").click()
    page.locator("#camera-reset").click()
    assert still.state("colors") == [list(scenes.WARM), list(scenes.COOL)]


@pytest.mark.product
@pytest.mark.parametrize("times", [(0.0, 8.0), (1.0, 3.0), (7.0, 9.0)], ids=str)
@pytest.mark.parametrize("saturation", [None, (0.0, 0.5)], ids=str)
@pytest.mark.parametrize("power", [None, (0.5, 2.0)], ids=str)
def test_the_page_says_what_the_reference_says(still, times, saturation, power):
    """Cameras and colours inside, at the limits and outside of ranges: as many things in both."""
    ranges, own = (
        replace(RANGES, time_s=times, saturation=saturation, power=power),
        [list(scenes.WARM), list(scenes.COOL)],
    )
    lights = [[{"color": color} for color in own]]
    counts = []
    for yaw, pitch, distance in ((0, 0, 1), (24, -8, 1.1), (25, 0, 1), (-40, 9, 0.5), (180, -75, 2)):
        for factor, picked in (
            (1, own),
            (2.5, own),
            (0.8, [[1, 0, 0], [0.5, 1, 0.5]]),
            (1, [[0.2, 0.9, 0.3], own[1]]),
            (1, [[1, 1, 0.499], own[1]]),
        ):
            for time in (0.0, 2.0, 3.5, 7.5):
                colors = [
                    color if color in own else still.page.evaluate(f"wamnet.parts.asBright({color}, {lamp})")
                    for color, lamp in zip(picked, own, strict=True)
                ]
                colors = [[factor * channel for channel in color] for color in colors]
                turn = {"yaw": yaw, "pitch": pitch, "distance": distance}
                moment = {"time": time, "turn": turn, "colors": colors}
                given = [json.loads(ranges.to_json()), 8.0, moment, *lights]
                found = still.page.evaluate("given => wamnet.parts.outside(...given)", given)
                variation = Variation(yaw, pitch, distance, tuple(tuple(color) for color in colors))
                scene = varied(scenes.canonical("minicubes", time=time), variation)
                counts.append(len(found))
                assert counts[-1] == len(outside(ranges, scene.info, own)), moment
    assert min(counts) == 0
    assert max(counts) >= 4


@pytest.mark.parametrize(
    "options",
    [{}, {"color_scheme": "dark", "viewport": {"width": 390, "height": 800}}],
    ids=["light", "dark"],
)
def test_people_who_do_not_see_it_can_use_it(chromium, path, options):
    """WEB-9: axe-core finds nothing; no more scrolling to the side than none on a telephone."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    with chromium.tab(path, **NO_MOTION, **options) as tab:
        tab.page.evaluate("wamnet.ready")
        tab.page.evaluate("wamnet.page.goBeyond(true)")
        before = tab.page.evaluate(BELOW)
        tab.page.evaluate("wamnet.page.turn({ yaw: -170, pitch: -75, distance: 2 })")
        tab.page.locator("#light-0").fill("#ff0000")
        tab.page.locator("#light-1").fill("#00ff00")
        text_when(tab, "return text.includes('light 2');")
        assert tab.page.evaluate(BELOW) == before
        found = axe.Axe().run(tab.page).response["violations"]
        assert [(one["id"], one["impact"]) for one in found] == []
        assert tab.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert tab.page.evaluate(FITS)


PHONE = {
    "viewport": {"width": 390, "height": 844},
    "is_mobile": True,
    "has_touch": True,
    "device_scale_factor": 2,
}
"""A telephone as Chromium emulates it."""

LOW = """[...document.querySelectorAll("input, select, button")]
  .filter((one) => one.getClientRects().length && !one.disabled && one.type !== "checkbox")
  .filter((one) => one.getBoundingClientRect().height < 44)
  .map((one) => one.id)"""
"""Controls that are lower than a finger is wide: 44 pixels of CSS, as WCAG 2.2 has it in 2.5.5."""


def touch(session, kind, *places):
    """Send what a touch screen sends."""
    points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(places)]
    session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def test_it_works_on_a_telephone(chromium, path):
    """A finger turns, two come closer; the picture stays in sight; nothing is wider than the screen."""
    with chromium.tab(path, **NO_MOTION, **PHONE) as tab:
        page = tab.page
        page.evaluate("wamnet.ready")
        assert page.evaluate("[document.documentElement.scrollWidth, innerWidth]") == [390, 390]
        assert page.evaluate(FITS)
        assert page.evaluate(LOW) == []
        box = page.locator("#picture").bounding_box()
        x, y = box["x"] + box["width"] / 4, box["y"] + box["height"] / 2
        session = page.context.new_cdp_session(page)
        touch(session, "touchStart", (x, y))
        for step in range(1, 6):
            touch(session, "touchMove", (x + 10 * step, y))
        touch(session, "touchEnd")
        turned = tab.state("turn")
        assert turned == {"yaw": -20, "pitch": 0, "distance": 1}
        touch(session, "touchStart", (x, y), (x + 100, y))
        for step in range(1, 5):
            touch(session, "touchMove", (x, y), (x + 100 + 2 * step, y))
        touch(session, "touchEnd")
        assert tab.state("turn")["distance"] == pytest.approx(100 / 108, abs=0.01)  # a pixel is a hundredth
        assert tab.state("turn")["yaw"] == -20
        page.locator("#light-1-saturation").scroll_into_view_if_needed()
        page.evaluate("document.getElementById('light-1-saturation').scrollIntoView({ block: 'center' })")
        seen = page.locator("#picture").bounding_box()
        assert page.evaluate("scrollY") > 300
        assert 0 <= seen["y"] <= 1  # it sticks to the top, to a pixel of the device
        assert seen["y"] + seen["height"] < 0.6 * 844
        page.locator("#light-1-saturation").fill("0.2")
        assert saturation_of(tab.state("colors")[1]) == pytest.approx(0.2, rel=1e-12)
        page.locator("#compare").tap()
        assert page.locator("#compared").is_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert tab.said == []


OVERTAKEN = """async () => {
  const { page } = wamnet;
  const { renderer } = page;
  const size = renderer.size;
  const run = renderer.strips.run;
  renderer.strips.run = async () => (renderer.resize(2 * size), 0);
  try {
    await renderer.draw(page.request(size));
  } finally {
    renderer.strips.run = run;
  }
  const shown = renderer.shown;
  renderer.resize(size);
  return shown;
}"""
"""Draw a picture while another size is chosen, and say what is shown afterwards."""


def test_a_picture_whose_textures_are_gone_is_not_shown(still):
    """A size that is chosen while a picture is drawn releases its textures: then there is none to show."""
    still.page.evaluate("wamnet.go()")
    still.until("!wamnet.page.renderer.strips.busy && !wamnet.page.preparing")
    assert still.page.evaluate(OVERTAKEN) is None
