"""The web page in a headless Chromium: its pixels against the reference, its controls, what it says and asks.

A small network and few bounces: SwiftShader traces and denoises 40 x 40 pixels in a moment.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from errors_at import encoding_errors
from small_page import (
    AT_REST,
    COLORS,
    FEATURES,
    FRAME,
    NO_MOTION,
    SCALES,
    SEED,
    SETTINGS,
    SIZE,
    TIMES,
    TURN,
    draw,
    read,
)

from wamnet.cli.reports import webpage
from wamnet.compiler.scenes.encode_kernel import compile_encode, layers_of
from wamnet.compiler.scenes.lower_scene import FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.kernels.run import page as P
from wamnet.refimpl.light import scenes
from wamnet.refimpl.metrics import psnr
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.whole import forward_whole
from wamnet.refimpl.network.window import Window, all_windows, pad

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
def model(small_page):
    return small_page.model


@pytest.fixture(scope="module")
def data(small_page):
    return small_page.data


def test_where_shaders_run_on_the_processor_a_page_begins_with_the_module(chromium, path):
    with chromium.tab(path, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.state("variant") == "processor"
        assert tab.page.locator("#variant option:checked").text_content() == "full, on the processor"


# ---- pixels ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options", [{}, {"frame": FRAME, "seed": SEED, "turn": TURN, "colors": COLORS}], ids=["rest", "moved"]
)
def test_the_paths_are_the_reference_s(still, options):
    """WEB-10, as path kernels: 99 pixels in 100 have every number to 1e-5 of its layer's size."""
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
    features, window = tuple(dataset.FIRST_HITS), Window(3, "clamp")
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
    errors = encoding_errors(compile_encode(FEATURES, SCALES, P.TARGET), planes, 1)
    for first, name in zip((0, 3, 6), FEATURES, strict=True):
        values = sums[..., first : first + 3].astype(np.float64)
        expected = dataset.FEATURES[name].encode(values, SCALES)
        assert np.all(np.abs(read(still, name)[..., :3] - expected) <= errors[name]), name


@pytest.mark.parametrize("number", [0, 1, 2, 4])
def test_the_pictures_keep_their_bound(still, model, data, number):
    """Every number of the picture, at the features that the page has read, for each variant."""
    network = P.networks_of(model, rank=4, processor=True)[number]
    draw(still, frame=FRAME, seed=SEED, variant=network.name)
    images = {name: read(still, name)[..., :3].copy() for name in FEATURES}
    plan = P.plan_program(P.lower(model), network.target, network.schedule, network.rank)
    held = plan.expected(images)
    value, bound = held.value, held.bound
    found = read(still, "picture")[..., :3].astype(np.float64)
    assert 0 < bound.max() < 2**-8, "a step of 8 bits would hold for many wrong kernels"
    assert np.all(np.abs(found - value) <= bound)
    assert np.ptp(value) > bound.max()


def test_a_module_with_transforms_has_the_spectra_of_the_weights(chromium, kit, tmp_path):
    """FOU-4, WEB-14: the page computes them in float64, and rounds once; pictures end within a tile."""
    features, window = ("color", "normal"), Window(12, "clamp")
    network = kit.network([dataset.n_inputs(features, window), 32, 7, 3], (3.0, 3.0))
    model = Model(network, features, window, SCALES)
    networks = [each for each in P.networks_of(model, processor=True) if each.name in ("full", "processor")]
    animation = P.Animation(TIMES[:1], (scenes.canonical("minicubes", time=TIMES[0]),))
    data = P.page_data(animation, networks, SETTINGS)
    assert [one["schedule"] for one in data["variants"]] == ["packed", "fft:4"]
    (tmp_path / "page.html").write_text(webpage.render_page(data), encoding="utf-8")
    plan = P.plan_program(P.lower(model), "c", schedule="fft:4")
    held = P.compile_plan(plan).weights
    with chromium.tab(tmp_path / "page.html", **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        module = "wamnet.page.renderer.variant('processor').passes[0].processor.module"
        weights = np.float32(tab.page.evaluate(f"Array.from({module}.weights)"))
        spacing = np.spacing(np.abs(held))
        assert np.all(np.abs(weights - held) <= np.maximum(spacing, 2.0**-60))
        assert (weights == held).mean() > 0.99
        draw(tab, seed=SEED)
        images = {name: read(tab, name)[..., :3].copy() for name in features}
        expected = plan.expected(images)
        found = read(tab, "picture")[..., :3].astype(np.float64)
        assert np.all(np.abs(found - expected.value) <= expected.bound)
        assert np.ptp(expected.value) > expected.bound.max()
        assert tab.said == []


def test_the_network_in_integers_is_beside_those_of_floats(still, model, data):
    """The same bits as the reference, on the page's own picture and on the moment that is shown."""
    whole = P.networks_of(model, rank=4)[3].model
    assert data["variants"][3]["name"] == "whole"
    draw(still, frame=FRAME, seed=SEED, variant="whole")
    joined = np.concatenate([read(still, f"whole_{name}")[..., :3] for name in FEATURES], axis=-1)
    assert (joined == np.rint(joined)).all()
    held = forward_whole(whole.siren, all_windows(pad(joined, model.window), model.window))
    assert read(still, "picture")[..., :3].tobytes() == held.astype(np.float32).tobytes()
    assert still.text("error") == "none: the same bits as the reference"
    assert still.page.locator("#variant option:checked").text_content() == "integers of 8 bits"
    assert np.abs(read(still, "color")[..., :3]).max() <= 1
    draw(still, variant="full")


def test_the_page_measures_its_own_error(still, data):
    check = still.page.evaluate("wamnet.page.renderer.check('full')")
    assert 0 < check["share"] <= 1
    assert 0 < check["error"] <= check["bound"]
    assert "within" in still.text("error")
    # A number of the reference that is moved by 1e-3, as by a sine without its range reduction, is reported.
    moved = """async () => {
      const check = wamnet.page.data.variants[0].check;
      const kept = check.expected;
      const values = wamnet.parts.decodeFloats(kept);
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
    assert [one["rays"] for one in data["variants"]] == [1, 1, 1, 1, 1]
    many = replace(model, info={**model.info, "trained_on_feature_spp": "16, 4"})
    animation = P.Animation(TIMES[:1], (scenes.canonical("minicubes", time=TIMES[0]),))
    assert P.page_data(animation, P.networks_of(many, rank=4)[:1], SETTINGS)["variants"][0]["rays"] == 4


def test_it_stands_still_where_motion_is_not(chromium, path):
    """In a new page: one that other tests have used reports what they did last."""
    with chromium.tab(path, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.state("playing") is False
        paused = "Ready. The animation is paused."
        tab.until(f"document.getElementById('status').textContent.startsWith('{paused}')")
        assert tab.text("status").startswith(paused)


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
    """WEB-7: however costly a pixel is, what is dispatched at once costs no more than a batch."""
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
