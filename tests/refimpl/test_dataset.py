"""Windows against a loop over pixels, features and their errors, normalization, sampling."""

import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import LAYERS, Frame
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.dataset import FEATURES, Normalization
from wamnet.refimpl.network.window import BORDERS, Window, all_windows, check_window, pad, windows_at


def frame_of(height: int, width: int, seed: int = 0, dtype: Any = np.float32) -> Frame:
    """Return a frame with every layer, filled with numbers in [-2, 2]."""
    rng = np.random.default_rng(seed)
    layers = {
        name: rng.uniform(-2, 2, (height, width, layer.channels)).astype(dtype)
        for name, layer in LAYERS.items()
    }
    layers["color"], layers["depth"] = np.abs(layers["color"]), np.abs(layers["depth"])
    return Frame(layers)


# ---- windows ---------------------------------------------------------------------------------------------


def slow_window(image: Any, y: int, x: int, window: Window) -> Any:
    """Return the window vector by the words of the spec: one tap, one channel at a time."""
    height, width, channels = image.shape
    vector = []
    for dy in range(-(window.size // 2), window.size - window.size // 2):
        for dx in range(-(window.size // 2), window.size - window.size // 2):
            inside = 0 <= y + dy < height and 0 <= x + dx < width
            tap = image[min(max(y + dy, 0), height - 1), min(max(x + dx, 0), width - 1)]
            seen = inside or window.border == "clamp"
            vector.extend(tap[channel] if seen else 0.0 for channel in range(channels))
    return np.array(vector, image.dtype)


SHAPES = st.tuples(st.integers(1, 9), st.integers(1, 9), st.integers(1, 3))
"""Height, width, channels: 1x1, 1xN and images smaller than the window are all among them."""


@given(shape=SHAPES, size=st.integers(1, 13), border=st.sampled_from(sorted(BORDERS)))
def test_windows_match_a_loop_over_taps(shape: tuple[int, int, int], size: int, border: str) -> None:
    image = np.random.default_rng(size).random(shape)
    window = Window(size, border)
    y, x = (index.reshape(-1) for index in np.indices(shape[:2]))
    expected = np.array([slow_window(image, *pixel, window) for pixel in zip(y, x, strict=True)])
    assert np.array_equal(windows_at(image, y, x, window), expected)
    every = all_windows(pad(image, window), window)
    assert every.shape == (*shape[:2], size * size * shape[2])
    assert np.array_equal(every.reshape(len(y), -1), expected)


@given(
    sizes=st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5)), min_size=1, max_size=4),
    size=st.integers(1, 6),
    border=st.sampled_from(sorted(BORDERS)),
)
def test_examples_of_frames_of_any_sizes_match_their_windows_and_targets(
    sizes: list[tuple[int, int]], size: int, border: str
) -> None:
    pairs = [(frame_of(*s, seed=i), frame_of(*s, seed=100 + i)) for i, s in enumerate(sizes)]
    window, scales, features = Window(size, border), Normalization(), ("color", "depth")
    data = dataset.build(pairs, features, window, scales)
    for index, ((height, width), (noisy, reference)) in enumerate(zip(sizes, pairs, strict=True)):
        y, x = (positions.reshape(-1) for positions in np.indices((height, width)))
        windows, targets = dataset.examples_at(data, np.full(len(y), index), y, x)
        image = dataset.feature_image(noisy, features, scales)
        assert np.array_equal(windows, windows_at(image, y, x, window))
        assert np.array_equal(
            targets, to_display(reference["color"].astype(np.float64)).astype(np.float32)[y, x]
        )


def test_digest_names_the_data() -> None:
    def digest(seed: int, size: int, reference: int = 9) -> str:
        pairs = [(frame_of(3, 4, seed), frame_of(3, 4, reference))]
        return dataset.build(pairs, ("color",), Window(size), Normalization()).digest

    assert digest(0, 2) == digest(0, 2)
    assert len({digest(0, 2), digest(1, 2), digest(0, 3), digest(0, 2, 8)}) == 4


# ---- features --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_no_frame_leaves_the_ranges(scale: float) -> None:
    """Executors refuse what lies outside: the largest float32 numbers, the smallest, and those around 1."""
    one = np.float32(1.0)
    values = [
        np.finfo(np.float32).max,
        1e-45,
        0.0,
        1.0,
        np.nextafter(one, 2 * one),
        np.nextafter(one, 0 * one),
    ]
    signed = np.array([*values, *np.negative(values)], np.float32).reshape(2, -1, 1)
    layers = {name: np.repeat(signed, layer.channels, axis=-1) for name, layer in LAYERS.items()}
    layers["color"], layers["depth"] = np.abs(layers["color"]), np.abs(layers["depth"])
    normalization = Normalization(20.0, scale, (scale, -scale, 0.0), scale)
    for name, feature in FEATURES.items():
        image = dataset.feature_image(Frame(layers), (name,), normalization)
        assert feature.low <= image.min()
        assert image.max() <= feature.high


def test_features_by_hand() -> None:
    """One pixel, numbers that float32 holds exactly, so that every result is exact."""
    one = np.ones((1, 1, 1))
    frame = Frame(
        {
            "color": one * [0.0, 0.25, 9.0],
            "albedo": one * [-0.5, 0.5, 1.5],
            "normal": one * [-2.0, 0.5, 1.0],
            "depth": one * [3.0],
            "position": one * [1.0, 5.0, -9.0],
            "direction": one * [0.0, -1.0, 0.5],
            "unshadowed": one * [0.0, 0.25, 9.0],
        }
    )
    scales = Normalization(2.0, 4.0, (1.0, 1.0, 1.0), 8.0)
    expected = {
        "color": [0.0, 1.0, 1.0],  # exposed by two stops: 0, 1, 36
        "albedo": [0.0, 0.5, 1.0],
        "normal": [-1.0, 0.5, 1.0],
        "depth": [0.75],
        "position": [0.0, 0.5, -1.0],
        "direction": [0.0, -1.0, 0.5],
        "unshadowed": [0.0, 1.0, 1.0],  # exposed as colour is
        # Two stops more and four less: 0, and a quarter of 0.25 and 9 by the curve of IEC 61966-2-1.
        "highlights": [0.0, np.float32(1.055 * 0.0625 ** (1 / 2.4) - 0.055), 1.0],
    }
    for name, values in expected.items():
        assert dataset.feature_image(frame, (name,), scales)[0, 0].tolist() == values


OF_A_PIXEL = tuple(name for name, feature in FEATURES.items() if not feature.guides)
"""Features that sums of a pixel are enough for."""


def test_sums_are_encoded_as_their_means_are() -> None:
    """Sums over 4 samples, which divide exactly; in float64, so that only feature_image rounds."""
    frame = frame_of(5, 4)
    scales = Normalization(0.5, 1.5, (0.1, -0.2, 0.3), 1.5)
    sums = {name: 4.0 * values.astype(np.float64) for name, values in frame.layers.items()}
    encoded = dataset.encode_sums(sums, 4.0, OF_A_PIXEL, scales)
    assert list(encoded) == list(OF_A_PIXEL)
    for name, values in encoded.items():
        assert np.array_equal(values.astype(np.float32), dataset.feature_image(frame, (name,), scales))


def test_sums_stay_in_the_range_that_a_feature_promises() -> None:
    """In float32 1.055 x 1 - 0.055 and its like may pass 1: the last clip is what keeps them."""
    sums = {name: np.full((1, layer.channels), 3e38, np.float32) for name, layer in LAYERS.items()}
    for name, values in dataset.encode_sums(sums, np.float32(1), OF_A_PIXEL, Normalization()).items():
        assert values.dtype == np.float32
        assert values.max() <= FEATURES[name].high


def test_missing_layer_is_named() -> None:
    frame = Frame({"color": np.zeros((2, 2, 3))})
    message = "layers of the frame 'color': layer 'normal' is missing (render it"
    with pytest.raises(InputError, match=re.escape(message)):
        dataset.feature_image(frame, ("color", "normal"), Normalization())
    message = "layer 'direct' is missing (render it: --shadow-rays 1, or shadow_rays=1; bundled models"
    with pytest.raises(InputError, match=re.escape(message)):
        dataset.feature_image(frame, ("color", "direct"), Normalization())


def test_feature_names_are_checked() -> None:
    with pytest.raises(
        InputError, match=r"feature 'colour': unknown \(did you mean 'color'\? choose one of color, normal"
    ):
        dataset.feature_image(frame_of(1, 1), ("colour",), Normalization())
    for names in ((), ("color", "color")):
        with pytest.raises(InputError, match=r"features '.*at least one, each once"):
            dataset.check_features(names)


# ---- normalization ---------------------------------------------------------------------------------------


def test_normalization_by_hand() -> None:
    """Positions (1, 2, 3) and (5, 2, -3): the box's centre is (3, 2, 0), its half extents 2, 0 and 3."""
    position = np.array([[[1.0, 2.0, 3.0], [5.0, 2.0, -3.0], [0.0, 0.0, 0.0]]])
    frame = Frame({"position": position, "depth": np.array([[[2.0], [7.0], [0.0]]])})
    assert dataset.normalization_of([frame]) == Normalization(0.0, 7.0, (3.0, 2.0, 0.0), 3.0)
    both = dataset.normalization_of([frame, Frame({"depth": np.full((1, 1, 1), 9.0)})], exposure_stops=1.0)
    assert both == Normalization(1.0, 9.0, (3.0, 2.0, 0.0), 3.0)


def test_a_plain_to_the_horizon_does_not_press_the_rest_together() -> None:
    """Along x eleven positions 1 to 11 and one at 1000. Their quartiles are 3 and 10, indices floor(11/4) = 2
    and ceil(33/4) = 9 of 12; the fence is at 10 + 1.5 * 7 = 20.5. So the box goes from 1 to 20.5."""
    position = np.zeros((1, 12, 3))
    position[0, :, 0] = [1000.0, *range(1, 12)]
    found = dataset.normalization_of([Frame({"position": position})])
    assert found == Normalization(0.0, 1.0, (10.75, 0.0, 0.0), 9.75)
    encoded = dataset.encode_position(position, found)
    assert encoded[0, 0, 0] == 1.0  # what is beyond is clipped
    assert encoded[0, 1, 0] == -1.0


@pytest.mark.parametrize(
    "values",
    [
        {"depth_scale": 0.0},
        {"position_scale": -1.0},
        {"position_scale": math.inf},
        {"exposure_stops": math.nan},
        {"position_center": (0.0, math.nan, 0.0)},
        {"position_center": (0.0, 0.0)},
    ],
)
def test_normalization_is_checked(values: Any) -> None:
    with pytest.raises(InputError, match=f"{next(iter(values))} .*must be"):
        dataset.check_normalization(Normalization(**values))


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"position_center": 1}', '{"position_center": [], "x": 1}']
)
def test_normalization_text_is_checked(text: str) -> None:
    with pytest.raises(InputError, match=r"^normalization"):
        dataset.normalization_from_json(text)


# ---- checks ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0, -1, 65, 1.5])
def test_window_sizes_are_checked(size: Any) -> None:
    with pytest.raises(InputError, match=r"window size .*must be an integer from 1 to 64"):
        check_window(Window(size))


def test_window_borders_are_checked() -> None:
    with pytest.raises(InputError, match=r"window border 'wrap': unknown \(choose one of clamp, zero"):
        check_window(Window(12, "wrap"))


def test_pairs_are_checked() -> None:
    with pytest.raises(InputError, match="training pairs: missing"):
        dataset.build([], ("color",), Window(), Normalization())
    message = "training pair 1: sizes of noisy and reference frame '3x2 and 2x3': must be equal"
    pairs = [(frame_of(2, 2), frame_of(2, 2)), (frame_of(2, 3), frame_of(3, 2))]
    with pytest.raises(InputError, match=message):
        dataset.build(pairs, ("color",), Window(), Normalization())


# ---- sampling --------------------------------------------------------------------------------------------


def test_samples_lie_in_their_frames_and_are_uniform() -> None:
    """Chi-square over all 46 pixels of three frames, 46,000 draws; 45 degrees of freedom, significance 1e-6.

    The quantile is 113.2 (Wilson and Hilferty: 45 (1 - 2/405 + 4.753 sqrt(2/405))^3 = 113.1).
    """
    shapes = [(3, 4), (1, 9), (5, 5)]
    frame, y, x = dataset.sample_pixels(7, 0, 46_000, shapes)
    heights, widths = np.array(shapes).T
    assert np.all((y >= 0) & (y < heights[frame]) & (x >= 0) & (x < widths[frame]))
    first = np.array([0, 12, 21])
    counts = np.bincount(first[frame] + y * widths[frame] + x, minlength=46)
    assert np.sum((counts - 1000.0) ** 2 / 1000.0) <= 113.2


@pytest.mark.parametrize("missed", [1e9, 1e10, np.finfo(np.float32).max, np.inf, np.nan])
def test_depths_of_misses_are_no_scale(missed) -> None:
    """As many renderers write them; with it as the scale all other depths would be 0."""
    depth = np.array([[2.0, 5.0, missed]], np.float32)[..., None]
    assert dataset.normalization_of([Frame({"depth": depth})]).depth_scale == 5.0
    assert dataset.normalization_of([Frame({"depth": depth[:, 2:]})]).depth_scale == 1.0
