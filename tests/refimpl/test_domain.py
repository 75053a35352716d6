"""Tests of domains: descriptions with closed forms, ranks, distances, their text and its refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import domain
from wamnet.refimpl.network.dataset import Normalization, feature_image
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.siren import Siren
from wamnet.refimpl.network.window import Window

ULP = 2.0**-52
"""Distance of 1 and the next float64."""


def images(count: int, seed: int = 0, size: int = 12, channels: int = 4) -> list[np.ndarray]:
    """Return feature images of noise around a level that each image draws."""
    rng = np.random.default_rng(seed)
    return [
        0.5 + 0.05 * rng.normal(size=channels) + 0.02 * rng.normal(size=(size, size, channels))
        for _ in range(count)
    ]


def test_a_step_has_its_description() -> None:
    """Half 0, half 1, in 4 x 6 pixels: mean 1/2, variance 1/4; 4 of 4 * 5 + 3 * 6 differences are 1.

    A checkerboard is all noise: each difference is 1, so its spread is 0.
    """
    step = np.zeros((4, 6, 1))
    step[:, 3:] = 1.0
    square = 4.0 / 38.0
    want = [[0.5], [np.sqrt(0.25 - square / 2.0)], [np.sqrt(square)]]
    # Each number is a sum of at most 38 terms below 1, and a root.
    assert np.abs(domain.describe(step) - want).max() <= 40 * ULP
    board = np.indices((4, 6)).sum(axis=0)[..., None] % 2
    assert np.abs(domain.describe(board) - [[0.5], [0.0], [1.0]]).max() <= 40 * ULP


def test_the_distance_by_another_way() -> None:
    """Written with loops: each number against mean and deviation, roughness upwards only; its name comes."""
    learned, shown = images(12), images(1, seed=5)[0] * 3.0
    found = domain.domain_of(learned, ("color", "depth"))
    assert found is not None
    names = ["color.R", "color.G", "color.B", "depth"]
    described = [domain.describe(image) for image in learned]
    best = (-1.0, "", "")
    for row, statistic in enumerate(domain.STATISTICS):
        for column, name in enumerate(names):
            numbers = [each[row, column] for each in described]
            scale = np.sqrt(np.var(numbers, ddof=1) + domain.LEAST_SCALE**2)
            off = (domain.describe(shown)[row, column] - np.mean(numbers)) / scale
            best = max(best, (off if statistic == "roughness" else abs(off), statistic, name))
    measured = domain.measure(found, shown)
    # The domain's numbers have six digits: middle and scale are off by 5e-6 of themselves each, and the
    # difference of value and middle is here at least a tenth of either.
    assert abs(measured.distance - best[0]) <= 2e-4 * best[0]
    assert (measured.statistic, measured.channel) == best[1:]
    assert measured.is_outside
    assert found.frames == 12


def test_frames_of_the_same_kind_are_seldom_outside() -> None:
    """300 domains of 19 images, and one new image each: the expected share outside is at most 1/20.

    A binomial count of 300 with p = 1/20 is above 32 with a probability below 5e-5.
    """
    outside = 0
    for seed in range(300):
        *learned, new = images(20, seed=100 + seed, size=3, channels=1)
        outside += domain.measure(domain.domain_of(learned, ("depth",)), new).is_outside
    assert outside <= 32


def test_few_frames_have_no_domain() -> None:
    """Fewer than nine; of many, a hundred are described, the first among them."""
    assert domain.domain_of(images(8), ("color", "depth")) is None
    assert domain.domain_of(images(9), ("color", "depth")).rate == 0.1
    assert domain.chosen(3) == [0, 1, 2]
    found = domain.chosen(250)
    assert (len(set(found)), found[:3], found[-1]) == (100, [0, 2, 5], 247)


def test_a_distance_that_is_no_number_is_outside() -> None:
    found = domain.domain_of(images(9), ("color", "depth"))
    assert domain.measure(found, np.full((3, 3, 4), np.nan)).is_outside


def model(text: str | None) -> Model:
    """Return a model of colour and depth with a domain's text."""
    siren = Siren((np.zeros((3, 4), np.float32),), (np.zeros(3, np.float32),), 1.0, 1.0)
    info = {} if text is None else {domain.DOMAIN: text}
    return Model(siren, ("color", "depth"), Window(1), Normalization(depth_scale=2.0), info)


def test_frames_are_measured_as_the_model_encodes_them() -> None:
    """The domain of frames is that of their feature images; a model without its text has none."""
    rng = np.random.default_rng(3)
    frames = [
        Frame({"color": rng.random((4, 5, 3)), "depth": rng.random((4, 5, 1)) + level})
        for level in rng.random(10)
    ]
    empty = model(None)
    found = domain.domain_of_frames(empty, frames)
    encoded = [feature_image(frame, empty.features, empty.normalization) for frame in frames]
    assert found == domain.domain_of(encoded, empty.features)
    assert domain.of_model(empty) is None
    assert domain.of_model(model(domain.to_json(found))) == found
    assert domain.measure_frame(found, empty, frames[3]) == domain.measure(found, encoded[3])
    assert domain.domain_of_frames(empty, frames[:8]) is None


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"features": ["color"]}, "domain.middle .* must have 3 rows of 3 numbers"),
        ({"features": ["color", "colour"]}, "feature 'colour"),
        ({"middle": [[0.0] * 4] * 2}, "domain.middle .* 3 rows of 4"),
        ({"scale": [[0.0] * 4] * 3}, "domain.scale 0.0: must be positive"),
        ({"threshold": -1.0}, "domain.threshold -1.0: must be positive"),
        ({"rate": 0}, "domain.rate 0.0: must be positive"),
        ({"more": 1}, "domain.more 1: Domain has no such key"),
        ({"features": ["depth", "color"]}, "domain.features 'depth, color': the model's are color, depth"),
    ],
)
def test_domains_that_are_refused(change, text) -> None:
    found = domain.domain_of(images(9), ("color", "depth"))
    changed = json.dumps({**json.loads(domain.to_json(found)), **change})
    with pytest.raises(InputError, match=text):
        domain.of_model(model(changed))


def test_an_image_of_other_channels_is_refused() -> None:
    found = domain.domain_of(images(9), ("color", "depth"))
    with pytest.raises(InputError, match="channels of the feature image 3: color, depth are 4"):
        domain.measure(found, np.zeros((2, 2, 3)))
    renamed = replace(found, features=("normal", "depth"))
    assert domain.channel_names(renamed.features)[:2] == ["normal.X", "normal.Y"]
