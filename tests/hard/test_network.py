"""Networks and pictures that break careless kernels, on every executor, each within its computed bound."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.plan import plan_program
from wamnet.kernels import denoise_on
from wamnet.refimpl import frame
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import dataset, denoise, siren
from wamnet.refimpl.network.window import Window

CHANNELS = {"a": 3}

LEAST_NORMAL = 2.0**-126
"""Smallest float32 that is not denormal."""


def picture(seed: int, shape: tuple[int, int] = (7, 9), scale: float = 2.0) -> dict[str, np.ndarray]:
    values = np.random.default_rng(seed).uniform(-scale, scale, (*shape, 3))
    return {"a": values.astype(np.float32)}


def changed(network: siren.Siren, layer: int, weight=None, bias=None) -> siren.Siren:
    """Return the network with another weight or bias in one layer; each is a function of the old one."""
    weights, biases = list(network.weights), list(network.biases)
    if weight is not None:
        weights[layer] = weight(weights[layer]).astype(np.float32)
    if bias is not None:
        biases[layer] = bias(biases[layer]).astype(np.float32)
    return replace(network, weights=tuple(weights), biases=tuple(biases))


# ---- weights ---------------------------------------------------------------------------------------------


def test_many_turns(executor, kit):
    """omega_0 = 30 and large weights: sines of arguments of thousands of radians, inside their domain."""
    network = kit.network([27, 8, 3], (30.0, 30.0), scale=60.0)
    program = kit.denoiser(network, CHANNELS, 3, "clamp")
    turns = max(abs(end) for span in plan_program(program, "opencl").bound.sines for end in span)
    assert 1_000 < turns < 12_800
    assert kit.excess(executor, program, picture(1)) <= 1


def test_arguments_beyond_the_sine_s_domain_are_refused(executor, kit):
    """Arguments beyond 1e5: no kernel; the message shows range, domain, layer and the way out."""
    network = kit.network([27, 8, 3], (30.0, 30.0), scale=1_000.0)
    program = kit.denoiser(network, CHANNELS, 3, "clamp")
    with pytest.raises(CompileError, match=r"sine.*12800"):
        compile_program(program, executor.name)


def test_dead_neurons(executor, kit):
    """A layer whose weights and biases are 0 passes on zeros, of either sign, and nothing else."""
    network = changed(kit.network([27, 8, 8, 3], (5.0, 5.0)), 1, np.zeros_like, np.zeros_like)
    assert kit.excess(executor, kit.denoiser(network, CHANNELS, 3, "zero"), picture(2)) <= 1


@pytest.mark.parametrize("crest", [np.pi / 2, -np.pi / 2, np.pi])
def test_saturated_neurons(executor, kit, crest):
    """All arguments lie on a crest, where rounding decides the side, or on a zero, where it is all."""
    network = kit.network([27, 8, 8, 3], (1.0, 1.0))
    network = changed(network, 1, lambda w: w * 1e-7, lambda b: np.full_like(b, crest))
    assert kit.excess(executor, kit.denoiser(network, CHANNELS, 3, "clamp"), picture(3)) <= 1


def test_denormal_weights(executor, kit):
    """Weights below the least normal float32: flushed or not, both are within the bound."""
    network = kit.network([27, 8, 8, 3], (30.0, 30.0))
    network = changed(network, 0, lambda w: np.sign(w) * LEAST_NORMAL / 7, lambda b: b * 0)
    network = changed(network, 1, lambda w: w * 1e3)
    assert 0 < np.abs(network.weights[0]).max() < LEAST_NORMAL
    assert kit.excess(executor, kit.denoiser(network, CHANNELS, 3, "clamp"), picture(4)) <= 1


def test_sums_that_cancel(executor, kit):
    """Weights in pairs of opposite sign: sums are a millionth of their terms."""
    network = kit.network([27, 8, 3], (30.0, 30.0))

    def pairs(weight: np.ndarray) -> np.ndarray:
        found = weight * 100
        found[:, 1::2] = -found[:, 0:-1:2] * (1 + 2.0**-20)
        return found

    flat = {"a": np.full((5, 6, 3), 1.37, np.float32)}
    program = kit.denoiser(changed(network, 0, pairs), CHANNELS, 3, "clamp")
    assert kit.excess(executor, program, flat) <= 1


# ---- pictures --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 3), (7, 13)])
def test_pictures_smaller_than_the_window(executor, kit, shape, border):
    network = kit.network([432, 8, 3], (3.0, 3.0))
    program = kit.denoiser(network, CHANNELS, 12, border)
    assert kit.excess(executor, program, picture(5, shape)) <= 1


HARD_VALUES = (np.nan, np.inf, -np.inf, -3.0, 1e6, 3.4e38, 1e-45, -0.0)
"""What a renderer may leave in a pixel: no number, infinities, a negative, fireflies, a denormal."""


@pytest.fixture(scope="module")
def model() -> denoise.Model:
    """Return a small model of colour and normal."""
    window = Window(3, "clamp")
    network = siren.init([54, 8, 3], 3.0, 3.0, seed=1, dtype=np.float32)
    return denoise.Model(network, ("color", "normal"), window, dataset.Normalization())


def frames(seed: int) -> tuple[frame.Frame, frame.Frame, np.ndarray]:
    """Return a sound frame, the same with hard values, and where (H, W) they are."""
    random = np.random.default_rng(seed)
    layers = {name: random.random((11, 12, 3)).astype(np.float32) for name in ("color", "normal")}
    hard = {name: values.copy() for name, values in layers.items()}
    bad = np.zeros((11, 12), bool)
    for i, value in enumerate(HARD_VALUES):
        y, x = 1 + 4 * (i // 4), 1 + 3 * (i % 4)
        hard["color"][y, x] = value
        hard["normal"][y, x, i % 3] = value
        bad[y, x] = True
    return frame.Frame(layers), frame.Frame(hard), bad


def test_bad_pixels_are_read_by_one_rule_and_do_not_spread(executor, model):
    """The result is finite, the reference's within float32's error, and equal where no window holds one.

    54 terms of at most 1 times a weight, 8 sines, 8 terms: fewer than 200 roundings of numbers up to 12,
    passed on by slopes of at most 3 * 8: at most 200 * 12 * 24 u = 3.5e-3, and a NaN fails it.
    """
    sound, hard, bad = frames(1)
    found, clean = (denoise_on(executor, model, f).image for f in (hard, sound))
    reference = denoise.denoise(model, hard, np.float64)
    assert np.abs(found - reference).max() <= 200 * 12 * 24 * 2.0**-24
    near = np.zeros_like(bad)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            near |= np.roll(bad, (dy, dx), (0, 1))
    assert near.any()
    assert not near.all()
    np.testing.assert_array_equal(found[~near], clean[~near])
    assert (found[bad] != clean[bad]).any()


def test_the_rule_for_bad_pixels(model):
    """NaN counts as 0, infinities as fireflies do: as the ends of the range."""
    _, hard, _ = frames(2)
    image = dataset.feature_image(hard, model.features, model.normalization)
    values = {str(v): image[1 + 4 * (i // 4), 1 + 3 * (i % 4), 0] for i, v in enumerate(HARD_VALUES)}
    assert values["nan"] == 0.0
    assert values["inf"] == values["1000000.0"] == values["3.4e+38"] == 1.0
    assert values["-inf"] == values["-3.0"] == 0.0
    assert np.isfinite(image).all()
    assert image.min() >= -1.0
    assert image.max() <= 1.0
