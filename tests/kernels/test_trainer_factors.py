"""The compiled trainer with a first layer of low rank: both factors' derivatives, their product, and runs.

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
from wamnet.refimpl.errors import InputError, TrainingError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, factored, train
from wamnet.refimpl.network.dataset import Window
from wamnet.refimpl.network.factored import Factors
from wamnet.refimpl.network.train import Recipe, TrainState

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


def tensors(state: TrainState) -> list[bytes]:
    return [array.tobytes() for array in train.state_to_arrays(state)[0].values()]


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


def distance_to_the_reference(opencl: Any, recipe: Recipe) -> float:
    """Return how far a run ends from float64's, as a multiple of how far float32's reference does."""
    want, exact = (train.train(recipe, PAIRS, dtype=dtype) for dtype in (np.float32, np.float64))
    found = train_on(opencl, recipe, PAIRS)
    apart = far = 0.0
    states = (state.parameters + state.siren.weights[:1] for state in (want, exact, found))
    for a, b, c in zip(*states, strict=True):
        assert a.shape == c.shape
        assert c.dtype == np.float32
        apart, far = max(apart, np.abs(a - b).max()), max(far, np.abs(c - b).max())
    assert [number for number, _ in found.history] == [number for number, _ in want.history]
    assert apart > 0
    return float(far / apart)


@pytest.mark.parametrize("changes", [{}, {"n_windows": 50, "schedule": "constant", "rank": 1}])
def test_twenty_steps_are_the_references(opencl: Any, changes: Any) -> None:
    """As without a rank (test_trainer.py): float32's two ways to round end 8 times as far apart at most."""
    assert 0 < distance_to_the_reference(opencl, replace(SMALL, **changes)) <= 8


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


def test_runs_repeat_and_resume_to_the_same_bits(opencl: Any) -> None:
    whole, again = (train_on(opencl, SMALL, PAIRS) for _ in range(2))
    half = train_on(opencl, SMALL, PAIRS, until=7)
    resumed = train_on(opencl, SMALL, PAIRS, state=train.state_from_arrays(*train.state_to_arrays(half)))
    assert tensors(whole) == tensors(again) == tensors(resumed)
    train.check_state(whole)


def test_a_run_may_change_its_trainer(opencl: Any) -> None:
    """Either continues from the other's state; both end near the run that did not change."""
    whole = train.train(SMALL, PAIRS)
    on_device = lambda *a, **k: train_on(opencl, *a, **k)  # noqa: E731
    for first, second in ((train.train, on_device), (on_device, train.train)):
        half = first(SMALL, PAIRS, until=10)
        end = second(SMALL, PAIRS, state=train.state_from_arrays(*train.state_to_arrays(half)))
        assert end.step == 20
        moved = max(np.abs(a - b).max() for a, b in zip(end.parameters, whole.parameters, strict=True))
        # Twenty steps of at most 1e-3 each; a second half from the start would be off by some of them.
        assert moved <= 1e-3


def test_a_loss_that_is_not_finite_keeps_the_last_good_state(opencl: Any) -> None:
    """Factors and product: the state before the one whose loss is not finite."""
    good = train_on(opencl, SMALL, PAIRS, until=10)
    steep = replace(good, recipe=replace(SMALL, learning_rate=1e30))
    kept: list[TrainState] = []
    with pytest.raises(TrainingError, match=r"loss at step 11 (inf|nan): must stay finite"):
        train_on(opencl, steep.recipe, PAIRS, state=steep, on_checkpoint=kept.append)
    assert [tensors(state) for state in kept] == [tensors(good)]


def test_a_rank_that_no_layer_has_is_refused(opencl: Any) -> None:
    with pytest.raises(InputError, match=r"rank 16: a window of 5 rows, .* has ranks from 1 to 15"):
        train_on(opencl, replace(SMALL, rank=16), PAIRS)
