"""The compiled trainer with a first layer of low rank: both factors' derivatives, and their product.

Every test is of OpenCL, the executor that trains. An excess is the largest error over its bound.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.compiler.training import step
from wamnet.compiler.training.step_kernel import StepKernel, compile_step
from wamnet.kernels.run import trainer
from wamnet.kernels.run.trainer import train_on
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, factored, train
from wamnet.refimpl.network.dataset import Window
from wamnet.refimpl.network.factored import Factors
from wamnet.refimpl.network.train import Recipe

SMALL = Recipe(
    features=("color",),
    window=Window(5),
    widths=(12, 20),
    omega_0_first=1.0,
    omega_0_hidden=5.0,
    n_windows=0,
    batch=100,
    steps=20,
    learning_rate=1e-3,
    schedule="cosine",
    seed=3,
    log_every=4,
    rank=4,
)
"""A run of some milliseconds."""


def frame(seed: int, height: int, width: int) -> Frame:
    """Return a frame of noise: what a network does with it is of no interest here."""
    random = np.random.default_rng(seed)
    color = random.uniform(0, 1, (height, width, 3)).astype(np.float32)
    return Frame({"color": color, "normal": random.uniform(-1, 1, color.shape).astype(np.float32)})


PAIRS = [(frame(1, 9, 13), frame(2, 9, 13)), (frame(3, 11, 8), frame(4, 11, 8))]


@pytest.fixture(scope="module")
def opencl(executor_named: Any) -> Any:
    return executor_named("opencl")


def kernel_of(recipe: Recipe) -> StepKernel:
    omegas = recipe.omega_0_first, recipe.omega_0_hidden
    return compile_step(recipe.layer_widths, omegas, recipe.batch, recipe.window.size, recipe.rank)


def excesses(opencl: Any, recipe: Recipe) -> tuple[float, float]:
    """Return the excess of the first step's derivatives by the factors, and of the product after it."""
    data = dataset.build(PAIRS, recipe.features, recipe.window, dataset.Normalization())
    state = train.start(recipe, dataset.Normalization(), data.digest)
    device = opencl.open_trainer(kernel_of(recipe), data.values, data.targets)
    trainer.load(device, state)
    run = trainer.Run(device, recipe, data, 0, 0, state, {})
    run.enqueue(run.draw(0, 1))
    run.settle()
    found = run.device.sums()
    arrays = {**trainer.named(state.parameters), "W0": state.siren.weights[0]}
    at = step.with_parameters(kernel_of(recipe).step, arrays)
    windows, targets = dataset.examples_at(data, *train.draw_batch(recipe, 0, data, None))
    exact, error = (f(at, windows, targets)["W0"] for f in (step.sums, step.sum_errors))
    given_factors = doubled(state.factors)
    wanted = factored.backward(given_factors, exact)
    bound = step.factor_errors(given_factors, exact, error)
    far = [
        np.max(np.abs(found[name].reshape(w.shape) - w) / b)
        for name, w, b in zip(step.factor_names("W0"), pair_of(wanted), pair_of(bound), strict=True)
    ]
    assert all(np.isfinite(b).all() for b in pair_of(bound))
    moved = run.state(1)
    after = doubled(moved.factors)
    assert not np.array_equal(after.vertical, given_factors.vertical)
    excess = np.abs(moved.siren.weights[0] - factored.expand(after)) / step.expansion_error(after)
    return float(max(far)), float(np.max(excess))


def doubled(factors: Factors | None) -> Factors:
    assert factors is not None
    return Factors(*(array.astype(np.float64) for array in pair_of(factors)))


def pair_of(factors: Factors) -> tuple[Any, Any]:
    return factors.vertical, factors.horizontal


@pytest.mark.nightly
@settings(max_examples=15)
@given(
    widths=st.lists(st.sampled_from([1, 3, 15, 16, 17, 40]), max_size=2),
    batch=st.sampled_from([1, 65, 700]),
    features=st.sampled_from([("color",), ("color", "normal")]),
    window=st.builds(Window, st.integers(1, 7), st.sampled_from(["clamp", "zero"])),
    rank=st.integers(1, 40),
    seed=st.integers(0, 2**31),
)
def test_first_derivatives_and_product_are_within_the_bound(
    opencl: Any,
    widths: list[int],
    batch: int,
    features: tuple[str, ...],
    window: Window,
    rank: int,
    seed: int,
) -> None:
    """Layers and ranks of parts of vectors and of several, up to the largest rank that a window has."""
    recipe = replace(
        SMALL, widths=tuple(widths), batch=batch, features=features, window=window, seed=seed, rank=0
    )
    most = factored.largest_rank(window.size, *recipe.layer_widths[:2])
    assert max(excesses(opencl, replace(recipe, rank=min(rank, most)))) <= 1


@pytest.mark.parametrize("rank", [12, 16])
def test_the_preset_s_derivatives_are_within_the_bound(opencl: Any, rank: int) -> None:
    recipe = replace(train.SHORT, features=("color", "normal"), batch=130, rank=rank)
    assert max(excesses(opencl, recipe)) <= 1


def test_a_cut_network_goes_on_as_the_references(opencl: Any) -> None:
    """Twenty steps from a network in full: the factors are those of its cut."""
    full = train.train(replace(SMALL, rank=0), PAIRS)
    want, found = (
        run(replace(SMALL, seed=4), PAIRS, network=full.siren)
        for run in (train.train, lambda *a, **k: train_on(opencl, *a, **k))
    )
    for a, b in zip(want.parameters, found.parameters, strict=True):
        # Twenty steps move a number by 0.011 at most; another cut would be off by as much at once.
        assert np.max(np.abs(a - b)) <= 1e-3


def test_a_rank_that_no_layer_has_is_refused(opencl: Any) -> None:
    with pytest.raises(InputError, match=r"rank 16: a window of 5 rows, .* has ranks from 1 to 15"):
        train_on(opencl, replace(SMALL, rank=16), PAIRS)
