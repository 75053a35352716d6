"""The compiled trainer: derivatives and Adam within computed bounds, and the reference's rules for runs.

Every test is of OpenCL, the executor that trains. An excess is the largest error over its bound: at most 1
for a right kernel.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pyopencl as cl
import pytest
import step_sums
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.compiler.artifact import Artifact
from wamnet.compiler.core.profiles import EMITTED_SINE, UNIT_ROUNDOFF
from wamnet.compiler.kernel.run import run_on
from wamnet.compiler.proof.bounds import enclose
from wamnet.compiler.training import step
from wamnet.compiler.training.step_kernel import compile_step
from wamnet.compiler.training.step_layout import LANES, slots
from wamnet.kernels.devices.opencl_trainer import OpenCLTrainer
from wamnet.kernels.run import trainer
from wamnet.kernels.run.trainer import train_on
from wamnet.refimpl.errors import InputError, TrainingError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import adam, dataset, factored, train
from wamnet.refimpl.network.activation import ACTIVATIONS
from wamnet.refimpl.network.dataset import Dataset
from wamnet.refimpl.network.factored import Factors
from wamnet.refimpl.network.train import Recipe, TrainState
from wamnet.refimpl.network.window import Window

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
)
"""A run of some milliseconds; layers of less than one vector and of more."""

BOUNDED = 0.9
"""Least share of parameters for which a step of Adam has a bound: near g = 0 it has none."""


@pytest.fixture(scope="module")
def opencl(executor_named: Any) -> Any:
    return executor_named("opencl")


def pair(seed: int, height: int, width: int) -> tuple[Frame, Frame]:
    """Return frames of noise: what a network does with them is of no interest here."""
    random = np.random.default_rng(seed)

    def frame() -> Frame:
        color = random.uniform(0, 1, (height, width, 3)).astype(np.float32)
        normal = random.uniform(-1, 1, (height, width, 3)).astype(np.float32)
        return Frame({"color": color, "normal": normal})

    return frame(), frame()


PAIRS = [pair(1, 9, 13), pair(2, 11, 8)]


def tensors(state: TrainState) -> list[bytes]:
    return [array.tobytes() for array in train.state_to_arrays(state)[0].values()]


def kernel_of(recipe: Recipe) -> Artifact:
    omegas = recipe.omega_0_first, recipe.omega_0_hidden
    size, rank, activation = recipe.window.size, recipe.rank, recipe.activation
    return compile_step(recipe.layer_widths, omegas, recipe.batch, size, rank, activation)


def data_of(recipe: Recipe, pairs: Any = PAIRS) -> Dataset:
    return dataset.build(pairs, recipe.features, recipe.window, dataset.Normalization())


def begin(opencl: Any, recipe: Recipe, kernel: Artifact, state: TrainState, data: Dataset) -> Any:
    """Return a trainer with the state on it, and a run that draws and hands out steps."""
    device = opencl.open_trainer(kernel, data.values, data.targets)
    trainer.load(device, state)
    return trainer.Run(device, recipe, data, state.step, state.step, state, {})


def examples(recipe: Recipe, data: Dataset, number: int) -> tuple[Any, Any]:
    return dataset.examples_at(data, *train.draw_batch(recipe, number, data, train.draw_pool(recipe, data)))


# ---- derivatives -----------------------------------------------------------------------------------------


def sums_of(device: Any, traced: step.Step) -> dict[str, Any]:
    """Return the sums of a device's last step, by parameter."""
    found = np.empty((device._groups, slots(traced)[step.SQUARES].end * LANES), np.float32)
    cl.enqueue_copy(device._queue, found, device._arrays["sums"])
    return step_sums.summed(traced, found, len(found))


def gradient_excess(opencl: Any, recipe: Recipe, kernel: Artifact | None = None, pairs: Any = PAIRS) -> float:
    """Return the excess of the first step's sums over the bound at its examples."""
    data = data_of(recipe, pairs)
    state = train.start(recipe, dataset.Normalization(), data.digest)
    run = begin(opencl, recipe, kernel or kernel_of(recipe), state, data)
    run.enqueue(run.draw(0, 1))
    loss = run.settle()
    right = kernel_of(recipe).programs
    found = sums_of(run.device, right)
    named = trainer.named(state.siren.weights + state.siren.biases)
    at = step_sums.with_parameters(right, named)
    windows, targets = examples(recipe, data, 0)
    exact, bound = step_sums.sums(at, windows, targets), step.sum_errors(at, windows, targets)
    assert all(np.isfinite(error).all() and error.max() > 0 for error in bound.values())
    if recipe.rank:
        old, new = (doubled(each.factors) for each in (state, run.state(1)))
        slopes, errors = (
            factored.backward(old, exact["W0"]),
            step_sums.factor_errors(old, exact["W0"], bound["W0"]),
        )
        for name, part in zip(step.factor_names("W0"), ("vertical", "horizontal"), strict=True):
            exact[name], bound[name] = getattr(slopes, part), getattr(errors, part)
        exact["product"], bound["product"] = factored.expand(new), step_sums.expansion_error(new)
        found["product"] = run.state(1).siren.weights[0]
    assert sorted(found) == sorted(exact)
    worst = [np.max(np.abs(found[n].reshape(exact[n].shape) - exact[n]) / bound[n]) for n in exact]
    # The loss is the sum of three squared errors, over 3 N: two more sums and a division.
    squares = exact[step.SQUARES].sum()
    allowed = bound[step.SQUARES].sum() + 8 * UNIT_ROUNDOFF * squares
    return float(max(*worst, abs(loss * 3 * recipe.batch - squares) / allowed))


def doubled(factors: Factors | None) -> Factors:
    assert factors is not None
    return Factors(factors.vertical.astype(np.float64), factors.horizontal.astype(np.float64))


CHANGES = {
    "widths": st.lists(st.sampled_from([1, 3, 15, 16, 17, 40, 70]), max_size=3).map(tuple),
    "batch": st.sampled_from([1, 7, 8, 64, 65, 200, 700]),
    "features": st.sampled_from([("color",), ("color", "normal"), ("normal",)]),
    "window": st.builds(Window, st.integers(1, 7), st.sampled_from(["clamp", "zero"])),
    "omega_0_hidden": st.sampled_from([1.0, 10.0]),
    "n_windows": st.sampled_from([0, 30]),
    "activation": st.sampled_from(sorted(ACTIVATIONS)),
    "seed": st.integers(0, 2**31),
}
"""Layers of parts of vectors and of several, tiles that are not full, borders, frames of two sizes."""


COVERING = (
    ({"widths": (), "batch": 1, "features": ("normal",), "window": Window(1, "zero")}, 0),
    ({"widths": (1, 16, 17), "batch": 65, "features": ("color", "normal"), "window": Window(4, "zero")}, 0),
    ({"widths": (70, 3), "batch": 700, "window": Window(7), "activation": "relu", "n_windows": 30}, 16),
)
"""Changes and a rank; each kind of size occurs in one."""


@pytest.mark.parametrize(("changes", "rank"), COVERING)
def test_first_derivatives_are_within_the_bound(opencl: Any, changes: Any, rank: int) -> None:
    assert gradient_excess(opencl, replace(SMALL, rank=rank, **changes)) <= 1


@pytest.mark.nightly
@settings(max_examples=settings.default.max_examples // 10)
@given(changes=st.fixed_dictionaries(CHANGES), rank=st.sampled_from([0, 0, 1, 5, 16, 40]))
def test_first_derivatives_of_any_recipe(opencl: Any, changes: Any, rank: int) -> None:
    recipe = replace(SMALL, **changes)
    most = factored.largest_rank(recipe.window.size, *recipe.layer_widths[:2])
    assert gradient_excess(opencl, replace(recipe, rank=min(rank, most))) <= 1


# ---- Adam ------------------------------------------------------------------------------------------------


def adam_excess(opencl: Any, kernel: Artifact | None = None, recipe: Recipe = SMALL) -> float:
    """Return the largest excess in 20 steps, each from the device's own state before it.

    The derivatives lie in a box around the float64 ones, as wide as their bound; the moved numbers of the
    reference and of the kernel then both lie in what Adam makes of the box, up to the kernel's roundings.
    """
    data = data_of(recipe)
    state = train.start(recipe, dataset.Normalization(), data.digest)
    run = begin(opencl, recipe, kernel or kernel_of(recipe), state, data)
    right, program = kernel_of(recipe).programs, step.lower_adam()
    worst, bounded = 0.0, []
    for number in range(recipe.steps):
        before = [trainer.named(arrays) for arrays in _groups(run.state(number))]
        run.enqueue(run.draw(number, number + 1))
        run.settle()
        after = [trainer.named(arrays) for arrays in _groups(run.state(number + 1))]
        at = step_sums.with_parameters(right, before[0])
        windows, targets = examples(recipe, data, number)
        exact, bound = step_sums.sums(at, windows, targets), step.sum_errors(at, windows, targets)
        rates = (train.rate_at(recipe, number), *adam.growth(number + 1))
        for name in before[0]:
            old, new = ([arrays[name] for arrays in arrays_of] for arrays_of in (before, after))
            excess, share = _moved_excess(program, old, exact[name], bound[name], rates, new)
            worst = max(worst, excess)
            bounded.append(share * exact[name].size)
    assert sum(bounded) >= BOUNDED * recipe.steps * sum(exact[name].size for name in right.trained)
    return worst


def _groups(state: TrainState) -> tuple[Any, Any, Any]:
    return state.siren.weights + state.siren.biases, state.moments.m, state.moments.v


def _moved_excess(
    program: Any, points: list[Any], g: Any, error: Any, rates: tuple[float, ...], found: list[Any]
) -> tuple[float, float]:
    """Return the excess of parameter and moments after one step, and the share of them with a bound."""
    theta, m, v = (array.astype(np.float64) for array in points)
    values = dict(zip(("theta", "m", "v"), (theta, m, v), strict=True))
    boxes = {name: (array, array) for name, array in values.items()} | {"g": (g - error, g + error)}
    # The numbers that all parameters share are rounded to float32 on their way to the kernel.
    for name, rate in zip(("learning_rate", "grown_1", "grown_2"), rates, strict=True):
        boxes[name] = (np.float64(rate * (1 - UNIT_ROUNDOFF)), np.float64(rate * (1 + UNIT_ROUNDOFF)))
    with np.errstate(all="ignore"):
        nodes = enclose(program, boxes, EMITTED_SINE)
    worst, bounded = 0.0, np.ones(theta.shape, bool)
    for (_, index), array in zip(program.outputs, found, strict=True):
        low, high, allowed = nodes[index].low, nodes[index].high, nodes[index].read
        bounded &= np.isfinite(allowed)
        outside = np.maximum(low - array, array - high)
        worst = max(worst, float(np.max((outside / allowed)[np.isfinite(allowed)], initial=0.0)))
    return worst, float(bounded.mean())


def test_twenty_steps_of_adam_are_within_the_bound(opencl: Any) -> None:
    assert adam_excess(opencl) <= 1


@pytest.mark.nightly("0")
@pytest.mark.parametrize("rank", [0, 4])
def test_a_step_has_the_bits_of_its_kernel_in_numpy(opencl: Any, rank: int) -> None:
    """NumPy fuses no product with a sum; where OpenCL may not either, every number is the same."""
    recipe = replace(SMALL, batch=70, rank=rank)
    data, kernel = data_of(recipe), kernel_of(recipe)
    state = train.start(recipe, dataset.Normalization(), data.digest)
    source = f"#pragma OPENCL FP_CONTRACT OFF\n{kernel.source}"
    run = begin(opencl, recipe, replace(kernel, source=source), state, data)
    old, transposed = (numbers_in(each) for each in (run.device._states[0], run.device._arrays["transposed"]))
    places = run.draw(0, 1)
    run.enqueue(places)
    loss = run.settle()
    given = {"values": data.values, "targets": data.targets, "places": places, "old": old}
    given |= {"transposed": transposed, "losses": np.zeros(1), "failed": np.array([-1])}
    given["rates"] = np.array([train.rate_at(recipe, 0), *adam.growth(1)])
    flat = {key: np.ravel(value) for key, value in given.items()}
    found = run_on(kernel.kernel, flat, {"groups": run.device._groups, "at": 0, "step": 0})
    assert found["losses"] == [loss]
    for key, buffer in {"moved": run.device._states[1], "sums": run.device._arrays["sums"]}.items():
        written = ~np.isnan(found[key])
        assert np.array_equal(found[key][written], numbers_in(buffer)[written]), key


def numbers_in(buffer: Any) -> Any:
    """Return the floats of a buffer of the device."""
    found = np.empty(buffer.size // 4, np.float32)
    with cl.CommandQueue(buffer.get_info(cl.mem_info.CONTEXT)) as queue:
        cl.enqueue_copy(queue, found, buffer)
    return found


# ---- runs ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [{"n_windows": 50, "schedule": "constant"}, {"rank": 4}])
def test_twenty_steps_are_the_references(opencl: Any, changes: Any) -> None:
    """The float32 reference and the device round differently, and Adam makes much of little differences.

    How much, the reference's own two precisions tell: where they are d apart at most, over all parameters,
    float32's roundings in another order are as far from float64. 8 d leaves room (measured: below 1 d).
    """
    recipe = replace(SMALL, **changes)
    want = train.train(recipe, PAIRS)
    exact = train.train(recipe, PAIRS, dtype=np.float64)
    found = train_on(opencl, recipe, PAIRS)
    assert found.step == 20
    assert (found.recipe, found.digest, found.normalization) == (want.recipe, want.digest, want.normalization)
    apart = 0.0
    far = 0.0
    states = (state.parameters + state.siren.weights[:1] for state in (want, exact, found))
    for a, b, c in zip(*states, strict=True):
        assert a.shape == c.shape
        assert c.dtype == np.float32
        apart, far = max(apart, np.abs(a - b).max()), max(far, np.abs(c - b).max())
    assert 0 < far <= 8 * apart
    assert [number for number, _ in found.history] == [number for number, _ in want.history]
    for (_, loss), (_, other) in zip(found.history, want.history, strict=True):
        assert (
            abs(loss - other) <= 1e-5 * other
        )  # float32 adds 300 numbers of one sign: gamma(300) = 2e-5 / 2


@pytest.mark.parametrize("changes", [{"n_windows": 50, "schedule": "constant", "batch": 700}, {"rank": 4}])
def test_runs_repeat_and_resume_to_the_same_bits(opencl: Any, changes: Any) -> None:
    recipe = replace(SMALL, **changes)
    whole, again = (train_on(opencl, recipe, PAIRS) for _ in range(2))
    half = train_on(opencl, recipe, PAIRS, until=7)
    assert half.step == 7
    restored = train.state_from_arrays(*train.state_to_arrays(half))
    resumed = train_on(opencl, recipe, PAIRS, state=restored)
    assert tensors(whole) == tensors(again) == tensors(resumed)
    assert resumed == replace(whole, siren=resumed.siren, moments=resumed.moments, factors=resumed.factors)
    train.check_state(whole)


@pytest.mark.nightly("0")
@pytest.mark.parametrize("rank", [0, 4])
def test_a_run_may_change_its_trainer(opencl: Any, rank: int) -> None:
    """Either continues from the other's state; both end near the run that did not change."""
    recipe = replace(SMALL, rank=rank)
    whole = train.train(recipe, PAIRS)
    for first, second in ((train.train, device_train(opencl)), (device_train(opencl), train.train)):
        half = first(recipe, PAIRS, until=10)
        end = second(recipe, PAIRS, state=train.state_from_arrays(*train.state_to_arrays(half)))
        assert end.step == 20
        moved = max(np.abs(a - b).max() for a, b in zip(end.parameters, whole.parameters, strict=True))
        # Twenty steps of at most 1e-3 each; a second half from the start would be off by some of them.
        assert moved <= 1e-3


def device_train(opencl: Any) -> Any:
    return lambda *arguments, **options: train_on(opencl, *arguments, **options)


def test_minibatches_are_the_references(opencl: Any) -> None:
    """Places of windows, rows and targets, for new draws and for a pool, to the bit."""
    for recipe in (SMALL, replace(SMALL, n_windows=40)):
        data = data_of(recipe)
        state = train.start(recipe, dataset.Normalization(), data.digest)
        run = begin(opencl, recipe, kernel_of(recipe), state, data)
        places = run.draw(3, 5)
        for number in (3, 4):
            windows, targets = examples(recipe, data, number)
            corner, row, target = places[number - 3]
            taps = corner[:, None, None] + row[:, None, None] * np.arange(5)[:, None] + np.arange(15)
            assert np.array_equal(data.values[taps].reshape(windows.shape), windows)
            assert np.array_equal(data.targets[target], targets)


def test_a_cut_network_goes_on_as_the_references(opencl: Any) -> None:
    """Twenty steps from a network in full: the factors are those of its cut."""
    full, recipe = train.train(SMALL, PAIRS), replace(SMALL, seed=4, rank=4)
    want, found = (fit(recipe, PAIRS, network=full.siren) for fit in (train.train, device_train(opencl)))
    for a, b in zip(want.parameters, found.parameters, strict=True):
        # Twenty steps move a number by 0.011 at most; another cut would be off by as much at once.
        assert np.max(np.abs(a - b)) <= 1e-3


def test_an_interrupt_keeps_the_state_and_goes_on(opencl: Any) -> None:
    kept: list[TrainState] = []

    def interrupt(state: TrainState, loss: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_on(opencl, SMALL, PAIRS, on_progress=interrupt, on_checkpoint=kept.append)
    assert [state.step for state in kept] == [SMALL.log_every]
    whole = train_on(opencl, SMALL, PAIRS)
    assert tensors(train_on(opencl, SMALL, PAIRS, state=kept[0])) == tensors(whole)


def test_an_interrupt_while_the_device_works(opencl: Any, monkeypatch: Any) -> None:
    """What was sent to the device is waited for, and kept with its losses."""
    kept: list[TrainState] = []
    draw, calls = trainer.Run.draw, []

    def interrupted(run: Any, first: int, last: int) -> Any:
        calls.append(first)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return draw(run, first, last)

    with monkeypatch.context() as patch:
        patch.setattr(trainer.Run, "draw", interrupted)
        with pytest.raises(KeyboardInterrupt):
            train_on(opencl, SMALL, PAIRS, on_checkpoint=kept.append)
    assert [state.step for state in kept] == [8]
    assert [number for number, _ in kept[0].history] == [0, 4]
    assert tensors(train_on(opencl, SMALL, PAIRS, state=kept[0])) == tensors(train_on(opencl, SMALL, PAIRS))


@pytest.mark.parametrize("changes", [{"log_every": 1}, {"rank": 4}])
def test_a_loss_that_is_not_finite_stops_and_keeps_the_last_good_state(opencl: Any, changes: Any) -> None:
    """As the reference's: the state kept is the one before the one whose loss is not finite."""
    recipe = replace(SMALL, **changes)
    good = train_on(opencl, recipe, PAIRS, until=10)
    steep = replace(good, recipe=replace(recipe, learning_rate=1e30))
    kept: list[TrainState] = []
    with pytest.raises(TrainingError, match=r"loss at step 11 (inf|nan): must stay finite \(lower the lear"):
        train_on(opencl, steep.recipe, PAIRS, state=steep, on_checkpoint=kept.append)
    assert len(kept) == 1
    assert tensors(kept[0]) == tensors(good)
    with pytest.raises(TrainingError, match="loss at step 1"):
        train_on(opencl, replace(recipe, learning_rate=1e30), PAIRS, on_checkpoint=kept.append)
    assert kept[1].step == 0


def test_refusals(opencl: Any, executor_named: Any, monkeypatch: Any) -> None:
    double = train.train(SMALL, PAIRS, until=1, dtype=np.float64)
    with pytest.raises(InputError, match="type of the state's values 'float64': a device trains in float32"):
        train_on(opencl, SMALL, PAIRS, state=double)
    with pytest.raises(InputError, match=r"executor that trains 'numpy': has no compiled trainer \(use exec"):
        train_on(executor_named("numpy"), SMALL, PAIRS)
    with pytest.raises(InputError, match=r"rank 16: a window of 5 rows, .* has ranks from 1 to 15"):
        train_on(opencl, replace(SMALL, rank=16), PAIRS)
    with pytest.raises(InputError, match="changed parts of the recipe 'batch"):
        train_on(opencl, replace(SMALL, batch=5), PAIRS, state=train.train(SMALL, PAIRS, until=1))
    with monkeypatch.context() as patch:
        patch.setattr(opencl, "trains", False)  # as on a GPU
        with pytest.raises(
            InputError, match=r"device that trains '.*': the training step is scheduled for CPUs"
        ):
            train_on(opencl, SMALL, PAIRS)
    monkeypatch.setattr("wamnet.kernels.devices.opencl_trainer.INDEX_LIMIT", 100)
    with pytest.raises(
        InputError, match=r"values of all training images .*: the device takes fewer than 100"
    ):
        train_on(opencl, SMALL, PAIRS)


def test_no_step_left_is_no_step(opencl: Any) -> None:
    kept: list[TrainState] = []
    state = train_on(opencl, SMALL, PAIRS, until=2)
    again = train_on(opencl, SMALL, PAIRS, state=state, until=2, on_checkpoint=kept.append)
    assert tensors(again) == tensors(state) == tensors(kept[0])


def test_an_interrupt_while_steps_are_handed_out(opencl: Any, monkeypatch: Any) -> None:
    """The state kept is that of the steps that the device was given, in the middle of a block."""
    kept: list[TrainState] = []
    load = OpenCLTrainer.load

    def interrupting(device: Any, *arguments: Any) -> None:
        load(device, *arguments)
        (update, *sizes), calls = device._launches[-1], []

        def interrupted(*numbers: Any) -> None:
            calls.append(1)
            if len(calls) == 7:
                raise KeyboardInterrupt
            update(*numbers)

        device._launches[-1] = (interrupted, *sizes)

    with monkeypatch.context() as patch:
        patch.setattr(OpenCLTrainer, "load", interrupting)
        with pytest.raises(KeyboardInterrupt):
            train_on(opencl, SMALL, PAIRS, on_checkpoint=kept.append)
    assert [state.step for state in kept] == [6]
    assert tensors(kept[0]) == tensors(train_on(opencl, SMALL, PAIRS, until=6))


def test_waiting_again_changes_nothing(opencl: Any) -> None:
    """An interrupt may come after the wait, and what follows it waits once more."""
    data = data_of(SMALL)
    state = train.start(SMALL, dataset.Normalization(), data.digest)
    run = begin(opencl, SMALL, kernel_of(SMALL), state, data)
    run.enqueue(run.draw(0, 5))
    assert run.settle() == run.settle()
    assert tensors(run.state(run.step)) == tensors(run.state(5))
    assert [number for number, _ in run.state(5).history] == [0, 4]
