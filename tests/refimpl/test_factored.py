"""Tests of first layers of low rank: the two passes, the nearest cut, derivatives, training, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.network import dataset, factored, train
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model, check_model
from wamnet.refimpl.network.factored import Factors
from wamnet.refimpl.network.train import SHORT
from wamnet.refimpl.network.window import BORDERS, Window, all_windows, pad

SIZE, CHANNELS, N_OUT = 5, 3, 4


def random_factors(rank, seed=1):
    """Return factors with entries from the normal distribution."""
    rng = np.random.default_rng(seed)
    shapes = (N_OUT, SIZE, rank), (rank, SIZE * CHANNELS)
    return Factors(*(rng.normal(size=shape) for shape in shapes))


@pytest.mark.parametrize("border", BORDERS)
def test_two_passes_are_the_layer(border) -> None:
    """FAC-2, written as loops over taps, against the windows times the expanded weights."""
    factors = random_factors(2)
    image = np.random.default_rng(2).normal(size=(7, 6, CHANNELS))
    window = Window(SIZE, border)
    padded = pad(image, window)
    expected = all_windows(padded, window) @ factored.expand(factors).T
    height, width, _ = image.shape
    # The horizontal pass on all padded rows: a row beyond the border is a row of the border, or nothing.
    h = np.zeros((height + SIZE - 1, width, 2))
    for dx in range(SIZE):
        taps = factors.horizontal.reshape(2, SIZE, CHANNELS)[:, dx]
        h += padded[:, dx : dx + width] @ taps.T
    found = sum(h[dy : dy + height] @ factors.vertical[:, dy].T for dy in range(SIZE))
    # Two sums of at most 75 products, of numbers below 1e2.
    assert np.abs(found - expected).max() <= 2 * 75 * 2.0**-53 * 1e2


def mean_square_root(difference, shared):
    """Return the root of E|D x|^2 for windows with E[x x^T] = A (rows) A (columns), A = I + shared 1 1^T."""
    a = np.eye(SIZE) + shared
    taps = difference.reshape(N_OUT, SIZE, SIZE, CHANNELS)
    return np.sqrt(np.einsum("nyxc,yv,xw,nvwc->", taps, a, a, taps))


@pytest.mark.parametrize("shared", [0.0, factored.SHARED, 3.0])
@pytest.mark.parametrize("rank", [1, 2, 5])
def test_cut_is_the_nearest(rank, shared) -> None:
    """No random neighbour's sums are nearer; with nothing shared it is the Frobenius norm's."""
    rng = np.random.default_rng(3)
    weight = rng.normal(size=(N_OUT, SIZE * SIZE * CHANNELS))
    factors = factored.cut(weight, SIZE, rank, shared)
    distance = mean_square_root(weight - factored.expand(factors), shared)
    for scale in (1e-1, 1e-2, 1e-3):
        for _ in range(10):
            moved = Factors(
                factors.vertical + scale * rng.normal(size=factors.vertical.shape),
                factors.horizontal + scale * rng.normal(size=factors.horizontal.shape),
            )
            assert mean_square_root(weight - factored.expand(moved), shared) > distance
    if not shared:
        values = np.linalg.svd(weight.reshape(N_OUT * SIZE, -1), compute_uv=False)
        # The root of the sum of squares of what is left out.
        expected = np.sqrt(np.sum(values[rank:] ** 2))
        assert abs(distance - expected) <= 100 * 2.0**-53 * np.linalg.norm(weight)


def test_start_keeps_the_norm() -> None:
    """Of the weights; those of rank 0 in all entries stay zero."""
    weight = np.random.default_rng(4).normal(size=(N_OUT, SIZE * SIZE * CHANNELS))
    norms = [np.linalg.norm(w) for w in (weight, factored.expand(factored.start(weight, SIZE, 2)))]
    assert abs(norms[0] - norms[1]) <= 100 * 2.0**-53 * norms[0]
    assert not factored.expand(factored.start(0.0 * weight, SIZE, 2)).any()


def test_derivatives_against_differences() -> None:
    """Of the sum of dW W: linear in each factor, so that a difference is exact up to rounding."""
    factors, rng = random_factors(2), np.random.default_rng(5)
    dweight = rng.normal(size=(N_OUT, SIZE * SIZE * CHANNELS))
    slopes = factored.backward(factors, dweight)

    def loss(moved):
        return np.sum(dweight * factored.expand(moved))

    for name in ("vertical", "horizontal"):
        slope, values = getattr(slopes, name), getattr(factors, name)
        for index in [tuple(rng.integers(values.shape)) for _ in range(10)]:
            step = np.zeros_like(values)
            step[index] = 1.0
            difference = loss(replace(factors, **{name: values + step})) - loss(factors)
            # Sums of 300 products of numbers below 1e2.
            assert abs(difference - slope[index]) <= 4 * 300 * 2.0**-53 * 1e2


@pytest.fixture(scope="module")
def pairs():
    """Return one small pair of frames."""
    scene = canonical("cornell")
    return [(render(scene, Job(12, 12, 1, 1)).frame, render(scene, Job(12, 12, 8, 2)).frame)]


RECIPE = replace(
    SHORT, features=("color", "normal"), window=Window(6), widths=(8, 8), batch=64, steps=40, rank=3
)


def test_training_keeps_the_rank_and_learns(pairs) -> None:
    """The weights are the product of the factors to the bit, and the loss falls."""
    state = train.train(replace(RECIPE, log_every=1), pairs)
    assert (state.siren.weights[0] == factored.expand(state.factors)).all()
    values = np.linalg.svd(state.siren.weights[0].astype(np.float64).reshape(8 * 6, -1), compute_uv=False)
    # Rounding of 3 products a weight, of numbers below 1, in a matrix of 48 x 36.
    assert values[3] <= 3 * 2.0**-24 * np.sqrt(48 * 36)
    losses = [loss for _, loss in state.history]
    assert np.mean(losses[-5:]) < 0.8 * np.mean(losses[:5])
    check_model(Model(state.siren, RECIPE.features, RECIPE.window, Normalization()))


def test_a_step_is_adam_s_along_the_derivatives(pairs) -> None:
    """The first step moves each entry of a factor by the learning rate against the sign of its slope."""
    recipe = replace(RECIPE, schedule="constant")
    before = train.train(recipe, pairs, until=0, dtype=np.float64)
    after = train.train(recipe, pairs, until=1, dtype=np.float64)
    data = dataset.build(pairs, recipe.features, recipe.window, before.normalization)
    windows, targets = dataset.examples_at(data, *train.draw_batch(recipe, 0, data, None))
    _, gradients = train.loss_and_gradients(before.siren, windows.astype(float), targets.astype(float))
    slopes = factored.backward(before.factors, gradients.dweights[0])
    for name in ("vertical", "horizontal"):
        slope = getattr(slopes, name)
        moved = getattr(after.factors, name) - getattr(before.factors, name)
        # Adam's first step is rate g / (|g| + epsilon); a difference of numbers below 1 has lost 2^-52.
        expected = -recipe.learning_rate * slope / (np.abs(slope) + 1e-8)
        assert np.abs(moved - expected).max() <= 2.0**-50


def test_resuming_gives_the_same_bits(pairs) -> None:
    """Through the arrays and texts of a checkpoint."""
    whole = train.train(RECIPE, pairs)
    half = train.train(RECIPE, pairs, until=17)
    arrays, text = train.state_to_arrays(half)
    again = train.state_from_arrays(arrays, text)
    train.check_state(again)
    rest = train.train(RECIPE, pairs, state=again)
    for one, two in zip(whole.parameters, rest.parameters, strict=True):
        assert (one == two).all()


def test_refusals() -> None:
    """A rank that the layer cannot have."""
    with pytest.raises(InputError, match="rank 37: a window of 6 rows, 216 inputs and 8 neurons has ranks"):
        train.check_recipe(replace(RECIPE, rank=37))
    with pytest.raises(InputError, match="recipe: rank -1"):
        train.check_recipe(replace(RECIPE, rank=-1))
