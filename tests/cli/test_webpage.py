"""The web page in a headless Chromium: its pixels against the reference, its controls, what it says and asks.

A small network and few bounces: SwiftShader traces and denoises 40 x 40 pixels in a moment.
"""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from wamnet.cli.reports import webpage
from wamnet.compiler.scenes.encode_kernel import compile_encode, error_at
from wamnet.compiler.scenes.lower_encode import layers_of
from wamnet.compiler.scenes.lower_scene import FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.devices.executor import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.kernels.run import page as P
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import Ranges, Variation, lamp_color, outside, saturation_of, varied
from wamnet.refimpl.metrics import psnr
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model

SIZE, FRAME, SEED = 40, 3, 5
SETTINGS = Settings(max_depth=2)
FEATURES = ("color", "normal", "position")
SCALES = dataset.Normalization(0.5, 12.0, (0.1, -0.2, 0.3), 6.0)
TIMES = tuple((number + 0.5) / 4 for number in range(8))
AT_REST = "!wamnet.page.preparing && !wamnet.page.dirty && !wamnet.page.renderer.strips.busy"
COLORS = [[0.9, 0.2, 0.1], [0.3, 0.4, 0.8]]
RANGES = Ranges((0.0, 8.0), (-24.0, 24.0), (-8.0, 8.0), (0.9, 1.1), (0.0, 0.5))
TURN = {"yaw": 25.0, "pitch": 8.0, "distance": 0.9}

NO_MOTION = {"reduced_motion": "reduce"}
WITHOUT_WEBGL = """
const known = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind === "webgl2" ? null : known.call(this, kind, ...rest);
};
"""
WITHOUT_FLOATS = """
const known = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) {
  return name === "EXT_color_buffer_float" ? null : known.call(this, name);
};
"""


@pytest.fixture(scope="module")
def model(kit):
    """A network whose pictures lie within 0.5 +- 0.45, of an odd width."""
    window = dataset.Window(5, "zero")
    network = kit.network([dataset.n_inputs(FEATURES, window), 10, 7, 3], (3.0, 3.0))
    return Model(network, FEATURES, window, SCALES, {"trained_on_ranges": RANGES.to_json()})


@pytest.fixture(scope="module")
def data(model):
    animation = P.Animation(TIMES, tuple(scenes.canonical("minicubes", time=time) for time in TIMES))
    return P.page_data(animation, P.networks_of(model, rank=4), SETTINGS)


@pytest.fixture(scope="module")
def path(data, tmp_path_factory):
    """The page in a file."""
    file = tmp_path_factory.mktemp("page") / "page.html"
    file.write_text(webpage.render_page(data), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def still(chromium, path):
    """A tab whose animation stands still, ready."""
    with chromium.tab(path, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        yield tab


def read(tab, name):
    """Return the floats (H, W, 4) of an image."""
    text = tab.page.evaluate("name => wamnet.read(name)", name)
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(SIZE, SIZE, 4)


def draw(tab, **options):
    """Draw a moment; return what the page says of camera, colours and time."""
    return tab.page.evaluate("options => wamnet.draw(options)", {"size": SIZE, **options})


# ---- pixels ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options", [{}, {"frame": FRAME, "seed": SEED, "turn": TURN, "colors": COLORS}], ids=["rest", "moved"]
)
def test_the_paths_are_the_reference_s(still, options):
    """As the kernels of test_paths.py: 99 pixels in 100 have every number to 1e-5 of its layer's size."""
    told = draw(still, **options)
    expected, scene = traced(told, FEATURES, options.get("seed", 0))
    at_rest = scenes.canonical("minicubes", time=told["time"]).camera
    assert (scene.camera == at_rest) == ("turn" not in options)
    found = np.concatenate([read(still, f"sums_{number}") for number in range(3)], axis=-1)
    for first, layer in zip((0, 3, 6), FEATURES, strict=True):
        assert share_alike(found[..., first : first + 3], expected[..., first : first + 3]) >= 0.99, layer


def traced(told, features, seed, rays=None, samples=(0, 1)):
    """Return the reference's sums (H, W, planes) of what a page has drawn, and its scene.

    `samples`: the first one's number, and how many.
    """
    scene = scenes.canonical("minicubes", time=told["time"])
    camera = replace(scene.camera, position=tuple(told["camera"]["position"]))
    pairs = zip(scene.lights, told["colors"], strict=True)
    lights = tuple(replace(light, color=tuple(color)) for light, color in pairs)
    scene = replace(scene, camera=camera, lights=lights)
    kernel = compile_path(lower_scene(scene, SETTINGS, rays=rays), "numpy", groups=layers_of(features))
    sums = NumpyExecutor().trace(kernel, Part(SIZE, SIZE, 0, SIZE, *samples, seed))
    return np.moveaxis(sums, 0, -1), scene


def share_alike(found, held):
    """Return the share of pixels whose numbers (H, W, C) are all those of the reference, to 1e-5."""
    size = np.abs(held).max(axis=-1, keepdims=True) + np.abs(held).mean()
    return (np.abs(found - held) <= 1e-5 * size).all(axis=-1).mean()


def test_all_features_together_are_the_reference_s(chromium, kit, tmp_path):
    """They take two kernels of paths, which trace three rays for them; lamps' light follows their colours."""
    features, window = tuple(dataset.FIRST_HITS), dataset.Window(3, "clamp")
    network = kit.network([dataset.n_inputs(features, window), 6, 3], (3.0, 3.0))
    animation = P.Animation(TIMES, tuple(scenes.canonical("minicubes", time=time) for time in TIMES))
    learned = {"trained_on_feature_spp": "3", "trained_on_feature_sampler": "net"}
    networks = P.networks_of(Model(network, features, window, SCALES, learned), rank=2)[:1]
    data = P.page_data(animation, networks, SETTINGS)
    assert data["rays"] == data["variants"][0]["rays"] == 3
    (tmp_path / "page.html").write_text(webpage.render_page(data), encoding="utf-8")
    with chromium.tab(tmp_path / "page.html", **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        told = draw(tab, frame=FRAME, seed=SEED, turn=TURN, colors=COLORS)
        expected, _ = traced(told, features, SEED, FeatureRays(3, "net"))
        planes, first = {}, 0
        for path in data["paths"]:
            for number, plane in enumerate(path["planes"]):
                planes[plane] = read(tab, f"sums_{first + number // 4}")[..., number % 4]
            first += -(-len(path["planes"]) // 4)
        names = P.planes_of(features)
        for name in features:
            here = [names.index(plane) for plane in P.planes_of((name,))]
            found = np.stack([planes[names[place]] for place in here], axis=-1)
            assert share_alike(found, expected[..., here]) >= 0.99, name
        recoloured = read(tab, "unshadowed")
        draw(tab, frame=FRAME, seed=SEED, turn=TURN)
        assert np.any(read(tab, "unshadowed") != recoloured)
        assert 0 < tab.page.evaluate("wamnet.page.renderer.check('full')")["share"] <= 1
        assert tab.said == []


def test_the_features_keep_the_bound_of_the_encoding(still, model):
    """At the sums that the page has read, against their encoding in float64."""
    draw(still, frame=FRAME, seed=SEED)
    sums = np.concatenate([read(still, f"sums_{number}") for number in range(3)], axis=-1)
    names = [
        f"{layer}_{end}"
        for layer, ends in (("color", "rgb"), ("normal", "xyz"), ("position", "xyz"))
        for end in ends
    ]
    planes = {name: sums[..., i] for i, name in enumerate(names)}
    errors = error_at(compile_encode(FEATURES, SCALES, P.TARGET), planes, 1)
    for first, name in zip((0, 3, 6), FEATURES, strict=True):
        values = sums[..., first : first + 3].astype(np.float64)
        expected = dataset.FEATURES[name].encode(values, SCALES)
        assert np.all(np.abs(read(still, name)[..., :3] - expected) <= errors[name]), name


@pytest.mark.parametrize("number", range(3))
def test_the_pictures_keep_their_bound(still, model, data, number):
    """Every number of the picture, at the features that the page has read, for each variant."""
    network = P.networks_of(model, rank=4)[number]
    draw(still, frame=FRAME, seed=SEED, variant=network.name)
    images = {name: read(still, name)[..., :3].copy() for name in FEATURES}
    plan = P.plan_program(P.lower(model), P.TARGET, "ieee", network.schedule, network.rank)
    held = plan.expected(images)
    value, bound = held.value, held.bound
    found = read(still, "picture")[..., :3].astype(np.float64)
    assert 0 < bound.max() < 2**-8, "a step of 8 bits would hold for many wrong kernels"
    assert np.all(np.abs(found - value) <= bound)
    assert np.ptp(value) > bound.max()


def test_the_page_measures_its_own_error(still, data):
    check = still.page.evaluate("wamnet.page.renderer.check('full')")
    assert 0 < check["share"] <= 1
    assert 0 < check["error"] <= check["bound"]
    assert "within" in still.text("error")
    # A number of the reference that is moved by 1e-3, as by a sine without its range reduction, is reported.
    moved = """async () => {
      const check = wamnet.page.data.variants[0].check;
      const kept = check.expected;
      const values = wamnet.parts.decodeFloats(kept, Float64Array);
      values[7] += 1e-3;
      const letters = Array.from(new Uint8Array(values.buffer), (byte) => String.fromCharCode(byte));
      check.expected = btoa(letters.join(""));
      const found = await wamnet.page.renderer.check("full");
      check.expected = kept;
      return found.share;
    }"""
    assert still.page.evaluate(moved) > 1


def test_the_reference_grows_to_that_of_the_reference_implementation(still):
    """Samples 1 to 24 of the moment that is shown, with sample 0 in the noisy picture; then its distances."""
    page = still.page
    page.evaluate("wamnet.go(); wamnet.page.turn({ yaw: 20 }); wamnet.page.change({ samples: 24 })")
    page.evaluate(f"wamnet.page.change({{ size: {SIZE} }})")
    page.locator("#variant").select_option("full")
    still.until(f"wamnet.page.state.variant === 'full' && {AT_REST}")
    page.locator("#compare").click()
    still.until(
        "wamnet.page.reference.count === 24 && document.getElementById('status').textContent.endsWith('dB.')"
    )
    told = page.evaluate(
        "({ ...wamnet.page.moment, time: wamnet.page.data.times[wamnet.page.moment.frame] })"
    )
    expected, _ = traced(told, FEATURES, still.state("seed"), samples=(1, 24))
    assert share_alike(read(still, "reference_sums")[..., :3], expected[..., :3]) >= 0.97
    clean, noisy, picture = (read(still, name)[..., :3] for name in ("reference", "color", "picture"))
    encoded = dataset.FEATURES["color"].encode(
        read(still, "reference_sums")[..., :3].astype(float) / 24, SCALES
    )
    assert np.abs(clean - encoded).max() <= 1e-5  # powers of GLSL ES have no bound; a step of 8 bits is 4e-3
    for name, image in (("noisy-psnr", noisy), ("denoised-psnr", picture)):
        assert still.text(name) == f"{psnr(image, clean):.1f} dB"
    assert still.text("denoised-rms") == f"{np.sqrt(np.mean((picture.astype(float) - clean) ** 2)):.4f}"
    assert still.text("counted") == "24 of 24 samples"
    assert (still.state("left"), still.text("right-label")) == ("picture", "Reference")
    # Another network is compared with the same samples, another moment with its own.
    page.evaluate("wamnet.page.reference.marked = wamnet.page.reference.moment")
    page.locator("#variant").select_option("fast-texture")
    still.until(f"wamnet.page.state.variant === 'fast-texture' && {AT_REST}")
    assert psnr(other := read(still, "picture")[..., :3], clean) != psnr(picture, clean)
    assert still.text("denoised-psnr") == f"{psnr(other, clean):.1f} dB"
    assert page.evaluate("wamnet.page.reference.marked === wamnet.page.reference.moment")
    page.evaluate("wamnet.page.turn({ yaw: 10 })")
    still.until(
        "wamnet.page.reference.marked !== wamnet.page.reference.moment && wamnet.page.reference.count === 24"
    )
    page.locator("#compare").click()
    assert (still.state("left"), still.state("right")) == ("color", "picture")
    assert not page.locator("#compared").is_visible()
    page.evaluate("wamnet.page.turn(wamnet.parts.REST)")
    page.locator("#variant").select_option("full")
    still.until("wamnet.page.state.variant === 'full' && !wamnet.page.preparing")


# ---- behaviour -------------------------------------------------------------------------------------------


def test_nothing_is_asked_for_and_nothing_complained_of(still):
    assert still.asked == [still.address]
    assert still.said == []
    policy = still.page.locator("meta[http-equiv]").get_attribute("content")
    assert "default-src 'none'" in policy


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


FITS = """[...document.querySelectorAll("main, main *")].every((element) =>
  element.getBoundingClientRect().right <= document.querySelector("header").getBoundingClientRect().right)"""
"""Nothing reaches over the edge that the title keeps."""

BELOW = """[...document.querySelectorAll("figure > *, .controls, footer")]
  .filter((element) => element.getClientRects().length)
  .map((element) => element.getBoundingClientRect().top + scrollY)"""
"""Where everything around the sentence is in the document."""


def text_when(tab, condition):
    """Return the sentence about what is outside once it is as it should be."""
    tab.until(f"(() => {{ const text = document.getElementById('outside').textContent; {condition} }})()")
    return tab.text("outside")


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
        in text_when(still, "return text.includes('bright');")
    )
    page.locator("#beyond").uncheck()
    assert still.state("turn")["yaw"] == 24
    assert still.state("colors")[0] == pytest.approx(lamp_color(scenes.WARM, 0.0, 0.5), rel=1e-14)
    page.locator("#lights-reset").click()
    page.locator("#camera-reset").click()
    assert still.state("colors") == [list(scenes.WARM), list(scenes.COOL)]


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


def changed_page(data, folder, **facts):
    """Write a page whose networks say something else, and return its path."""
    other = json.loads(json.dumps(data))
    for one in other["variants"]:
        one.update(facts)
    (folder / "page.html").write_text(webpage.render_page(other), encoding="utf-8")
    return folder / "page.html"


def test_a_network_that_says_no_ranges_has_a_note(chromium, data, tmp_path):
    with chromium.tab(changed_page(data, tmp_path, ranges=None), **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.page.locator("#unknown-ranges").is_visible()
        assert tab.page.evaluate("wamnet.page.outside({ yaw: 90, pitch: 0, distance: 1 }, [])") == ""
        assert tab.text("outside-room") == ""


@pytest.mark.parametrize(("rays", "shown"), [(1, False), (16, True)])
def test_features_of_fewer_rays_than_learned_are_said(chromium, data, tmp_path, rays, shown):
    """Beside the picture; the page traces one ray a pixel."""
    with chromium.tab(changed_page(data, tmp_path, rays=rays), **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.page.locator("#rays").is_visible() == shown
        assert ("has learned from features of 16 rays per pixel" in tab.text("rays")) == shown


def test_rays_are_those_of_the_model(model, data):
    assert [one["rays"] for one in data["variants"]] == [1, 1, 1]
    many = replace(model, info={**model.info, "trained_on_feature_spp": "16, 4"})
    animation = P.Animation(TIMES[:1], (scenes.canonical("minicubes", time=TIMES[0]),))
    assert P.page_data(animation, P.networks_of(many, rank=4)[:1], SETTINGS)["variants"][0]["rays"] == 4


def test_ready_is_what_has_drawn(chromium, path):
    """On a slow device seconds pass between the check and the first picture: nothing is claimed meanwhile."""
    script = """
      window.heard = [];
      addEventListener("DOMContentLoaded", () => {
        const status = document.getElementById("status");
        const listen = () => heard.push([status.textContent, Boolean(window.wamnet?.page.times.length)]);
        new MutationObserver(listen).observe(status, { childList: true, characterData: true, subtree: true });
      });
    """
    with chromium.tab(path, script, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        tab.until("document.getElementById('status').textContent.startsWith('Ready')")
        heard = tab.page.evaluate("heard")
        assert [drawn for text, drawn in heard if text.startswith("Ready")] == [True]
        said = [text for text, _ in heard]
        assert said.index("Checking the network on this device.") < said.index("Drawing the first picture.")


def test_the_pointer_turns_the_camera_and_moves_the_line(still):
    page = still.page
    page.evaluate("wamnet.go(); wamnet.page.turn(wamnet.parts.REST); wamnet.page.wipeTo(0.5)")
    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + box["width"] / 4, y)
    page.mouse.up()
    assert still.state("wipe") == pytest.approx(0.75, abs=0.01)  # a pixel is a fifth of that
    assert still.state("turn")["yaw"] == 0
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 50, y - 20)
    page.mouse.up()
    assert still.state("turn") == {"yaw": -20, "pitch": -8, "distance": 1}
    page.evaluate("wamnet.page.turn(wamnet.parts.REST)")


def test_it_plays_where_motion_is_welcome(chromium, path):
    with chromium.tab(path) as tab:
        tab.page.evaluate("wamnet.page.change({ size: 64 })")
        tab.page.evaluate("wamnet.ready")
        assert tab.text("status").startswith("Ready. The animation is playing.")
        tab.until("wamnet.page.state.seed > 2 && wamnet.page.frame() > 0")
        tab.page.locator("#play").press("Enter")  # a click would wait for the picture to stand still
        assert tab.text("play") == "Play"
        assert tab.text("status") == "The animation is paused."
        assert tab.said == []


def test_it_stands_still_where_motion_is_not(still):
    assert still.state("playing") is False
    paused = "Ready. The animation is paused."
    still.until(f"document.getElementById('status').textContent.startsWith('{paused}')")
    assert still.text("status").startswith(paused)


@pytest.mark.parametrize(
    "options",
    [{}, {"color_scheme": "dark", "viewport": {"width": 390, "height": 800}}],
    ids=["light", "dark"],
)
def test_people_who_do_not_see_it_can_use_it(chromium, path, options):
    """axe-core finds nothing; no more scrolling to the side than none on a telephone."""
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


@pytest.mark.parametrize(
    ("script", "said"),
    [(WITHOUT_WEBGL, "does not offer WebGL 2"), (WITHOUT_FLOATS, "EXT_color_buffer_float is missing")],
)
def test_what_is_missing_is_said(chromium, path, script, said):
    with chromium.tab(path, script, **NO_MOTION) as tab:
        assert said in tab.page.evaluate("wamnet.ready.catch(error => error.message)")
        assert said in tab.text("trouble-what")
        assert tab.page.locator("#trouble").is_visible()
        assert not tab.page.locator("#controls").is_visible()
        assert tab.text("status") == "The page cannot run here."
        assert tab.said == []


def test_a_shader_that_is_refused_is_told(chromium, data, tmp_path):
    broken = json.loads(json.dumps(data))
    broken["encoders"][0]["source"] = "#version 300 es\nvoid main() { nonsense }\n"
    (tmp_path / "broken.html").write_text(webpage.render_page(broken), encoding="utf-8")
    with chromium.tab(tmp_path / "broken.html", **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready.catch(() => 0)")
        assert tab.text("trouble-what").startswith("A shader was refused by this device: ERROR: 0:2")


def test_a_lost_device_comes_back(chromium, path):
    with chromium.tab(path, **NO_MOTION) as tab:
        page = tab.page
        page.evaluate("wamnet.ready")
        page.evaluate("window.loss = wamnet.page.device.gl.getExtension('WEBGL_lose_context')")
        page.evaluate("loss.loseContext()")
        tab.until("document.getElementById('status').textContent.includes('was lost')")
        page.evaluate("setTimeout(() => loss.restoreContext(), 50)")
        tab.until("document.getElementById('status').textContent.startsWith('Ready')")
        draw(tab)
        assert np.ptp(read(tab, "picture")[..., :3]) > 0.01
        assert not any(text.startswith("error") for text in tab.said)


def test_slow_devices_get_small_pieces(still):
    """However costly a pixel is, what is dispatched at once costs no more than a batch."""
    rows = still.page.evaluate(
        """() => {
          const handed = [];
          const device = {
            draw: (shader, target, textures, set, [first, count]) => handed.push([first, count]),
            fence: () => 1, isPassed: () => true };
          const strips = new wamnet.parts.Strips(device);
          const shader = {};
          strips.run([{ shader, target: { size: 64 }, textures: {}, set: () => {} }]);
          strips.poll = () => {};
          for (let now = 0; strips.busy; now += 400) { strips.tick(now); }
          return handed;
        }"""
    )
    assert rows[0] == [0, 2], "the first strip is small, in whole squares of 2 x 2 pixels"
    assert [first for first, _ in rows] == [0, *np.cumsum([count for _, count in rows])[:-1].tolist()]
    assert sum(count for _, count in rows) == 64
    assert rows[-1][1] <= 2 < rows[1][1]


@pytest.mark.parametrize("name", webpage.SCRIPTS)
def test_scripts_are_javascript(name, tmp_path):
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed; Chromium runs the scripts in the other tests")
    script = tmp_path / "script.mjs"
    script.write_text(
        (resources.files(webpage.__package__) / webpage.FOLDER / name).read_text(encoding="utf-8")
    )
    found = subprocess.run([node, "--check", str(script)], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


def test_a_picture_of_it_is_in_the_documents():
    picture = Path(__file__).parents[2] / "docs" / "images" / "web-page.png"
    assert picture.stat().st_size <= 200_000
