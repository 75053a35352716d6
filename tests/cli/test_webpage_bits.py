"""The web page with a network of integers, in a headless Chromium: the same bits, and their SHA-256."""

import base64
import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from small_page import FEATURES, NO_MOTION, SIZE, read

from wamnet.cli.reports import webpage
from wamnet.kernels.run import page as P
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.whole import forward_whole, rounded
from wamnet.refimpl.network.window import all_windows, pad


@pytest.fixture(scope="module")
def model(small_page):
    network = rounded(small_page.model.siren, small_page.model.window.size)
    return replace(small_page.model, siren=network, info={})


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
    return np.frombuffer(base64.b64decode(data["variants"][0]["check"]["expected"]), "<f4")


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
        joined = np.concatenate([read(tab, f"whole_{name}")[..., :3] for name in FEATURES], axis=-1)
        assert (joined == np.rint(joined)).all()
        windows = all_windows(pad(joined, model.window), model.window)
        held = forward_whole(model.siren, windows).astype(np.float32)
        assert len(np.unique(held)) > 50
        assert read(tab, "picture")[..., :3].tobytes() == held.tobytes()
        assert tab.said == []


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
