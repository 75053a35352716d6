"""The pictures of the web page: they show what they should, and those in the documents are small."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import page_pictures
import pytest
from PIL import Image

from wamnet.cli.reports import webpage
from wamnet.kernels.run import page as P
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
SIZE = 24
LARGEST_BYTES = 150_000


@pytest.fixture(scope="module")
def tab(kit, chromium, tmp_path_factory):
    """The page of a small network, ready."""
    window = dataset.Window(3, "clamp")
    scales = dataset.Normalization(0.0, 12.0, (0.0, 0.0, 0.0), 6.0)
    network = kit.network([dataset.n_inputs(("color",), window), 6, 3], (3.0, 3.0))
    times = tuple(0.1 + 0.01 * number for number in range(page_pictures.FRAME + 1))
    animation = P.Animation(times, tuple(scenes.canonical("minicubes", time=time) for time in times))
    networks = P.networks_of(Model(network, ("color",), window, scales), rank=2)
    file = tmp_path_factory.mktemp("page") / "page.html"
    file.write_text(webpage.render_page(P.page_data(animation, networks, Settings(max_depth=1))))
    with chromium.tab(file, reduced_motion="reduce") as opened:
        opened.page.evaluate("wamnet.ready")
        yield opened


def test_each_moment_is_another_picture(tab):
    found = [page_pictures.take(tab, moment, SIZE) for moment in ({}, *page_pictures.MOMENTS.values())]
    shown = [np.asarray(Image.open(io.BytesIO(one)).convert("RGB")) for one in found]
    assert {one.shape for one in shown} == {(SIZE, SIZE, 3)}
    assert len(set(found)) == len(found)
    assert min(np.ptp(one) for one in shown) > 0


def test_other_colours_keep_the_lamps_brightness():
    for own in (scenes.WARM, scenes.COOL):
        bright = page_pictures.as_bright(page_pictures.GREEN, own)
        assert np.mean(bright) == pytest.approx(np.mean(own), rel=1e-15)  # some roundings of 2**-53
        assert 1 - min(bright) / max(bright) == pytest.approx(0.7, rel=1e-15)  # the same, of a quotient


@pytest.mark.parametrize("moment", page_pictures.MOMENTS)
def test_pictures_in_the_documents_are_small(moment):
    contents = [path.read_bytes() for path in IMAGES.glob(f"page-*-{moment}.png")]
    assert contents
    for content in contents:
        assert len(content) <= LARGEST_BYTES
        assert Image.open(io.BytesIO(content)).size == (256, 256)
