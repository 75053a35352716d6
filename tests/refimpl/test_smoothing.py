"""The edge-avoiding filter: against sums written out pixel by pixel, and what its users rely on."""

import math

import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import FIRST_HIT, Frame
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.smoothing import dimmed, smooth

UNIT = 2.0**-53
"""Unit roundoff of float64."""


def layers_of(height, width, seed=0, depth=4.0):
    """Return the layers of a rough, coloured surface about `depth` away."""
    rng = np.random.default_rng(seed)
    layers = {
        name: rng.normal(0.0, spread, (height, width, 3))
        for name, spread in (("normal", 0.3), ("albedo", 0.1))
    }
    layers["position"] = rng.normal(0.0, 0.08 * depth, (height, width, 3))
    layers["depth"] = depth * rng.uniform(0.8, 1.25, (height, width, 1))
    return layers


def even(height, width, depth=1.0):
    """Return the layers of a surface that is alike everywhere."""
    return {
        **{name: np.zeros((height, width, 3)) for name in ("normal", "albedo", "position")},
        "depth": np.full((height, width, 1), depth),
    }


def by_the_clause(color, layers, levels):
    """Return SMO-3 written out, with Python's numbers."""
    height, width, _ = color.shape
    spline = {-2: 1 / 16, -1: 1 / 4, 0: 3 / 8, 1: 1 / 4, 2: 1 / 16}
    for level in range(levels):
        new = np.empty_like(color)
        for y in range(height):
            for x in range(width):
                shares, taps = [], []
                for dy in range(-2, 3):
                    for dx in range(-2, 3):
                        v = min(max(y + 2**level * dy, 0), height - 1)
                        u = min(max(x + 2**level * dx, 0), width - 1)
                        n, a, p = (
                            sum(float(layers[name][v, u, i] - layers[name][y, x, i]) ** 2 for i in range(3))
                            for name in ("normal", "albedo", "position")
                        )
                        z = float(layers["depth"][y, x, 0])
                        d = n / 0.5**2 + a / 0.2**2 + p / (0.08 * z) ** 2
                        shares.append(spline[dy] * spline[dx] * math.exp(-d / 2))
                        taps.append(color[v, u])
                new[y, x] = [
                    math.fsum(s * float(t[i]) for s, t in zip(shares, taps, strict=True)) / math.fsum(shares)
                    for i in range(3)
                ]
        color = new
    return color


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_levels_are_those_of_the_clause(levels):
    """Exponents below 50 have errors below 50 * 12 u, and so have the weights; a mean moves by twice as much
    of the spread of its colours, 1; sums of 25 numbers add 26 u. Each level has its own, and passes on the
    sum of those before it."""
    color, layers = np.random.default_rng(5).uniform(size=(7, 9, 3)), layers_of(7, 9)
    found = smooth(color, layers, levels)
    wanted = by_the_clause(color, layers, levels)
    assert np.abs(found - wanted).max() <= levels * (2 * 50 * 12 + 4 * 26) * UNIT
    assert np.abs(found - color).max() > 0.1  # it does something


def test_without_edges_it_is_the_spline():
    """A single bright pixel becomes the spline's outer product, and after two levels its convolution with the
    same at a gap of 2; all numbers are multiples of 2^-16, and the sum of weights is 1."""
    color = np.zeros((21, 21, 1)) * np.ones(3)
    color[10, 10] = 1.0
    spline = np.array([1, 4, 6, 4, 1]) / 16
    once = smooth(color, even(21, 21), 1)
    assert np.array_equal(once[8:13, 8:13, 0], np.outer(spline, spline))
    gaps = np.zeros(9)
    gaps[::2] = spline
    line = np.convolve(spline, gaps)
    twice = smooth(color, even(21, 21), 2)
    assert np.array_equal(twice[4:17, 4:17, 1], np.outer(line, line))
    assert np.count_nonzero(twice[..., 0]) == 13 * 13


@pytest.mark.parametrize("name", ["normal", "albedo", "position"])
def test_edges_are_not_crossed(name):
    """Ten standard deviations apart a weight is exp(-50) = 2e-22."""
    layers = even(8, 8, depth=2.0)
    layers[name][:, 4:, 1] = 10 * {"normal": 0.5, "albedo": 0.2, "position": 0.08 * 2.0}[name]
    color = np.zeros((8, 8, 3))
    color[:, 4:] = 1.0
    found = smooth(color, layers, 5)
    assert np.abs(found - color).max() <= 5 * 25 * math.exp(-50)


def test_a_miss_is_apart_from_what_is_hit():
    """Depth 0 at a miss counts as 1e-6, so that no position but its own is near."""
    layers = {**even(1, 6), "position": np.ones((1, 6, 3))}
    for values in layers.values():
        values[:, 3:] = 0.0
    color = np.zeros((1, 6, 3))
    color[:, 3:] = 7.0
    found = smooth(color, layers, 3)
    assert (found[:, 3:] == 7.0).all()
    # One unit away in each coordinate at a depth of 1: exp(-3 / (2 * 0.08^2)) is 0 for float64.
    assert (found[:, :3] <= 1e-50).all()


@pytest.mark.parametrize("value", [np.inf, -np.inf, 3e38, -3e38])
@pytest.mark.parametrize("name", ["normal", "albedo", "position", "depth"])
def test_layers_of_any_size_leave_numbers(name, value):
    layers = layers_of(3, 4)
    layers[name][1, 1:3] = value
    found = smooth(np.ones((3, 4, 3)), layers, 3)
    assert np.abs(found - 1.0).max() <= 3 * 52 * UNIT


def test_the_features_clip_smooth_and_encode():
    """At two stops less exposure white is 4, and sixteen times that 64."""
    shape = (6, 5, 3)
    layers = layers_of(6, 5, 3)
    color = np.random.default_rng(1).exponential(1.0, shape)
    color[2, 2] = (1e6, np.nan, -1.0)
    scales = Normalization(exposure_stops=-2.0)
    frame = Frame({"color": color, **layers, **{s: -layers[f] for s, f in FIRST_HIT.items() if f in layers}})
    clipped = np.where(np.isnan(color), 0.0, color).clip(0.0, 64.0)
    assert np.array_equal(dimmed(clipped, -2.0), clipped)
    past = {first: frame[seen].astype(np.float64) for seen, first in FIRST_HIT.items() if first in layers}
    for name, guides in (("smoothed", layers), ("seen_smoothed", past)):
        wanted = dataset.encode_color(smooth(clipped, guides, 3), scales).astype(np.float32)
        assert np.array_equal(dataset.feature_image(frame, (name,), scales), wanted)


def test_a_guide_that_is_missing_is_named():
    frame = Frame({"color": np.zeros((2, 2, 3)), **{n: v for n, v in even(2, 2).items() if n != "depth"}})
    with pytest.raises(InputError, match="layer 'depth' is missing"):
        dataset.feature_image(frame, ("smoothed",), Normalization())
    with pytest.raises(InputError, match=r"feature 'smoothed': computed from a pixel's own"):
        dataset.encode_sums({"color": np.zeros(3)}, 1.0, ("smoothed",), Normalization())
