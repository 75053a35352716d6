"""The definition of denoising: equal to the network applied pixel by pixel, on frames of every shape."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, denoise, siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import BORDERS, Window, windows_at


def frame_of(height: int, width: int) -> Frame:
    """Return a frame of random colours and normals."""
    rng = np.random.default_rng(height * 100 + width)
    return Frame({"color": rng.random((height, width, 3)), "normal": rng.uniform(-1, 1, (height, width, 3))})


def model_of(size: int = 3, border: str = "clamp", dtype: Any = np.float64) -> Model:
    """Return an untrained model of colour and normals."""
    network = siren.init((size * size * 6, 5, 3), 3.0, 3.0, seed=size, dtype=dtype)
    return Model(network, ("color", "normal"), Window(size, border), Normalization())


@given(
    height=st.integers(1, 6),
    width=st.integers(1, 6),
    size=st.integers(1, 7),
    border=st.sampled_from(sorted(BORDERS)),
)
def test_denoise_is_the_network_on_every_window(height: int, width: int, size: int, border: str) -> None:
    """Both sum the same D_in products, perhaps in another order: gamma(D_in) times the sum of magnitudes.

    |window| <= 1, so a sum of the first layer has magnitude at most D_in * (1 / D_in) + 1 = 2, times
    omega_0 = 3; the second layer's weights are below sqrt(6 / 5) / 3 = 0.37, five of them.
    """
    model, frame = model_of(size, border), frame_of(height, width)
    image = dataset.feature_image(frame, model.features, model.normalization).astype(np.float64)
    y, x = (index.reshape(-1) for index in np.indices((height, width)))
    rows = windows_at(image, y, x, model.window)
    expected = np.array([denoise.denoise_pixel(model.siren, row) for row in rows])
    d_in, u = rows.shape[1], 2.0**-53
    bound = 2 * (5 * 0.37 * (3 * 2 * (d_in + 3) * u + 4 * u) + 3 * 10 * u)
    result = denoise.denoise(model, frame, np.float64)
    assert result.shape == (height, width, 3)
    assert np.abs(result.reshape(-1, 3) - expected).max() <= bound


def test_blocks_of_rows_join_to_the_whole_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """With small integers as weights and window every sum is exact in any order, so the bits are equal."""
    frame = Frame({"color": np.random.default_rng(1).integers(0, 2, (7, 4, 3)).astype(np.float64)})
    rng = np.random.default_rng(2)
    network = siren.Siren((rng.integers(-1, 2, (3, 27)) / 16,), (np.full(3, 0.5),), 1.0, 1.0)
    model = Model(network, ("color",), Window(3), Normalization())
    whole = denoise.denoise(model, frame)
    for rows in (1, 2, 3):
        monkeypatch.setattr(denoise, "BLOCK_NUMBERS", rows * 4 * 27)
        assert np.array_equal(denoise.denoise(model, frame), whole)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_result_has_the_type_that_was_asked_for(dtype: Any) -> None:
    assert denoise.denoise(model_of(), frame_of(4, 3), dtype).dtype == dtype


def test_result_is_clipped() -> None:
    network = siren.Siren((np.zeros((3, 6)),), (np.array([-0.5, 0.25, 7.0]),), 1.0, 1.0)
    model = Model(network, ("color", "normal"), Window(1), Normalization())
    assert denoise.denoise(model, frame_of(1, 2), np.float64).tolist() == [[[0.0, 0.25, 1.0]] * 2]


def test_missing_layer_is_named() -> None:
    with pytest.raises(InputError, match="layers of the frame 'color': layer 'normal' is missing"):
        denoise.denoise(model_of(), Frame({"color": np.zeros((2, 2, 3))}))


# ---- check_model -----------------------------------------------------------------------------------------


def changed(**siren_parts: Any) -> Model:
    """Return the model with other parts in its network."""
    model = model_of()
    return replace(model, siren=replace(model.siren, **siren_parts))


def test_a_good_model_passes() -> None:
    denoise.check_model(model_of())
    denoise.check_model(model_of(dtype=np.float32))


BROKEN = {
    "a layer that does not chain": (changed(weights=(np.zeros((5, 54)), np.zeros((3, 4)))),
        r"layer 1 'weights \(3, 4\), biases \(3,\)': weights \(D_out, 5\) .* must chain"),
    "biases of another length": (changed(biases=(np.zeros(5), np.zeros(2))),
        r"layer 1 'weights \(3, 5\), biases \(2,\)"),
    "weights that are not a matrix": (changed(weights=(np.zeros(5), np.zeros((3, 5)))),
        r"layer 0 'weights \(5,\)"),
    "not finite": (changed(weights=(np.full((5, 54), np.nan), np.zeros((3, 5)))),
        "layer 0: number of NaN, infinite or huge parameters 270: all must be finite"),
    "mixed types": (changed(biases=(np.zeros(5, np.float32), np.zeros(3))),
        "types of the parameters 'float32, float64': all must be float32, or all float64"),
    "omega": (changed(omega_0_hidden=0.0), "omega_0_hidden 0.0: must be positive"),
    "inputs": (replace(model_of(), features=("color",)),
        "inputs of the first layer 54: 3 x 3 pixels of color are 27 numbers"),
    "outputs": (changed(weights=(np.zeros((5, 54)), np.zeros((4, 5))), biases=(np.zeros(5), np.zeros(4))),
        "outputs of the last layer 4: a colour has 3 channels"),
    "features": (replace(model_of(), features=("glow",)), "feature 'glow"),
    "window": (replace(model_of(), window=Window(0)), "window size 0"),
    "scales": (replace(model_of(), normalization=Normalization(depth_scale=0.0)), "depth_scale 0.0"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_model_whose_parts_do_not_fit_is_refused(case: str) -> None:
    model, message = BROKEN[case]
    with pytest.raises(InputError, match=message):
        denoise.check_model(model)
