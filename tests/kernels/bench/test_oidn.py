"""Open Image Denoise's auxiliary images, denoised first."""

import numpy as np
import pytest
from packages import needed

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet_peers.peer_oidn import prefiltered

pytestmark = [pytest.mark.apart, pytest.mark.needs("packages")]


@pytest.fixture(autouse=True)
def pyoidn():
    """Give the package, or skip."""
    return needed("pyoidn")


SIZE = 64


def two_surfaces():
    """Give albedo and normals of two surfaces, without noise."""
    left = (np.arange(SIZE) < SIZE // 2)[None, :, None]
    albedo = np.broadcast_to(np.where(left, 0.4, 0.6), (SIZE, SIZE, 3))
    normal = np.broadcast_to(np.where(left, (0.6, 0.0, 0.8), (0.0, 0.6, 0.8)), (SIZE, SIZE, 3))
    return {"albedo": albedo.astype(np.float32), "normal": normal.astype(np.float32)}


def test_each_auxiliary_image_loses_its_noise():
    clean, random = two_surfaces(), np.random.default_rng(0)
    noisy = {
        name: (image + 0.05 * random.standard_normal(image.shape)).astype(np.float32)
        for name, image in clean.items()
    }
    found = prefiltered(Frame({"color": np.ones((SIZE, SIZE, 3)), **noisy}))
    assert set(found.layers) == {"albedo", "normal"}
    for name, image in clean.items():
        before, after = (float(np.mean((one - image) ** 2)) for one in (noisy[name], found[name]))
        # A filter of 3x3 pixels would leave a ninth of the noise away from the edge.
        assert after <= before / 4, name


def test_images_that_it_refuses_are_told(monkeypatch, pyoidn):
    monkeypatch.setattr(pyoidn, "OIDN_FORMAT_FLOAT3", 12345)
    with pytest.raises(InputError, match=r"albedo for Open Image Denoise \(64, 64, 3\): it says: "):
        prefiltered(Frame({"color": np.ones((SIZE, SIZE, 3)), **two_surfaces()}))
