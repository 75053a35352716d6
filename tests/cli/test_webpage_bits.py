"""The web page with a network of integers, in a headless Chromium: the same bits, and their SHA-256."""

import base64
import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from wamnet.cli.reports import webpage
from wamnet.kernels.run import page as P
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.whole import forward_whole, rounded

SIZE = 40
FEATURES = ("color", "normal", "position")
NO_MOTION = {"reduced_motion": "reduce"}

WITHOUT_HASHES = "Object.defineProperty(globalThis, 'crypto', { value: {} });"
"""A page that the browser does not trust."""

CHANGED = """
const read = WebGL2RenderingContext.prototype.readPixels;
WebGL2RenderingContext.prototype.readPixels = function (...given) {
  read.apply(this, given);
  const values = given[6];
  if (values instanceof Float32Array) {
    values[4 * 37 + 1] += 1 / 65536;
  }
};
"""
"""A device that computes one number a step of a colour too large: green of pixel (5, 1)."""


@pytest.fixture(scope="module")
def model(kit):
    window = dataset.Window(5, "zero")
    network = kit.network([dataset.n_inputs(FEATURES, window), 10, 7, 3], (3.0, 3.0))
    scales = dataset.Normalization(0.5, 12.0, (0.1, -0.2, 0.3), 6.0)
    return Model(rounded(network, window.size), FEATURES, window, scales, {})


@pytest.fixture(scope="module")
def data(model):
    animation = P.Animation((1.0,), (scenes.canonical("minicubes", time=1.0),))
    return P.page_data(animation, P.networks_of(model), Settings(max_depth=1))


@pytest.fixture(scope="module")
def path(data, tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "page.html"
    file.write_text(webpage.render_page(data), encoding="utf-8")
    return file


def expected(data):
    """Return the reference's picture of the page's check, float32."""
    values = np.frombuffer(base64.b64decode(data["variants"][0]["check"]["expected"]), "<f8")
    return values.astype("<f4")


def read(tab, name):
    """Return the floats (H, W, 3) of an image."""
    text = tab.page.evaluate("name => wamnet.read(name)", name)
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(SIZE, SIZE, 4)[..., :3].copy()


def test_the_page_shows_the_same_bits_and_their_digest(chromium, data, path, model):
    """The digest is of what the device drew; the moment that is shown has the reference's bits too."""
    digest = hashlib.sha256(expected(data).tobytes()).hexdigest()
    assert data["variants"][0]["check"]["sha256"] == digest
    with chromium.tab(path, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.text("error") == "none: the same bits as the reference"
        assert tab.text("digest") == digest
        assert (tab.text("bound"), tab.page.locator("#of-floats").is_visible()) == ("0", False)
        assert tab.page.locator("#of-integers").is_visible()
        check = tab.page.evaluate("wamnet.page.renderer.check('full')")
        assert (check["error"], check["share"]) == (0, 0)
        tab.page.evaluate("options => wamnet.draw(options)", {"size": SIZE, "seed": 5})
        joined = np.concatenate([read(tab, f"whole_{name}") for name in FEATURES], axis=-1)
        assert (joined == np.rint(joined)).all()
        windows = dataset.all_windows(dataset.pad(joined, model.window), model.window)
        held = forward_whole(model.siren, windows).astype(np.float32)
        assert len(np.unique(held)) > 50
        assert read(tab, "picture").tobytes() == held.tobytes()
        assert tab.said == []


def test_features_are_shown_as_those_of_floats(chromium, path):
    """They are encoded twice: as integers for the network, and as numbers up to 1 for people."""
    shown = """name => {
      const { renderer, device: { gl } } = wamnet.page;
      renderer.show(name, name, 1);
      const bytes = new Uint8Array(4 * renderer.size ** 2);
      gl.readPixels(0, 0, renderer.size, renderer.size, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      return Array.from(bytes);
    }"""
    with chromium.tab(path, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        tab.page.evaluate("options => wamnet.draw(options)", {"size": SIZE})
        for name, of in (("color", lambda x: x), ("normal", lambda x: 0.5 + x / 2)):
            found = np.array(tab.page.evaluate(shown, name)).reshape(SIZE, SIZE, 4)[::-1, :, :3]
            assert np.abs(found - 255 * of(read(tab, name))).max() <= 1, name
            assert np.ptp(found) > 100


def test_another_bit_is_a_plain_warning(chromium, data, path):
    with chromium.tab(path, CHANGED, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        wanted = float(expected(data)[3 * 37 + 1])
        told = f"NOT the bits of the reference: pixel (5, 1), green is {wanted + 2**-16!r}, not {wanted!r}"
        assert tab.text("error") == told
        assert "bad" in tab.page.locator("#error").get_attribute("class")
        assert tab.text("digest") not in ("", data["variants"][0]["check"]["sha256"])


def test_a_page_without_hashes_compares_all_the_same(chromium, data, path):
    with chromium.tab(path, WITHOUT_HASHES, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.text("error") == "none: the same bits as the reference"
        assert tab.text("digest") == data["variants"][0]["check"]["sha256"]


def test_another_digest_is_told(chromium, data, tmp_path):
    """As of a page whose numbers were changed on the way."""
    other = json.loads(json.dumps(data))
    other["variants"][0]["check"]["sha256"] = "0" * 64
    (tmp_path / "page.html").write_text(webpage.render_page(other), encoding="utf-8")
    with chromium.tab(tmp_path / "page.html", **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        assert tab.text("error") == "NOT the bits of the reference: another SHA-256"


def test_a_network_of_integers_is_alone(model, kit):
    floats = kit.network([dataset.n_inputs(FEATURES, model.window), 6, 3], (3.0, 3.0))
    assert [one.name for one in P.networks_of(model)] == ["full"]
    for pair in ((model, replace(model, siren=floats)), (replace(model, siren=floats), model)):
        with pytest.raises(InputError, match="an integer network cannot be cut to a rank"):
            P.networks_of(*pair)
