"""Training on a device: refimpl.network.train.train with the arithmetic of a step done by compiled kernels.

1. Data, pool and minibatches are the reference's, to the bit, and so are first weights, learning rates and
   the form of states: a run may continue with either trainer [`train_on`].
2. Steps run in blocks that end where a callback is due. While the device works on one, the host draws the
   minibatches of the next [`Run.draw`].
3. A loss that is not finite, or an interrupt, is reported and kept as the reference does it [`Run.settle`].

The definition is refimpl/network/train.py; how far a step may be from it: compiler/training/step.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.training.step import factor_names
from ...compiler.training.step_kernel import MATRIX, compile_step
from ...refimpl.errors import InputError, TrainingError
from ...refimpl.frame import Frame
from ...refimpl.light.variation import RANGES
from ...refimpl.network import adam, dataset, train
from ...refimpl.network.adam import AdamState
from ...refimpl.network.dataset import Dataset, Indices
from ...refimpl.network.denoise import Model
from ...refimpl.network.domain import DOMAIN, domain_of_frames, to_json
from ...refimpl.network.factored import Factors
from ...refimpl.network.siren import Siren
from ...refimpl.network.train import Checkpoint, Progress, Recipe, TrainState
from ..devices.executor import Executor
from ..memory import cores

BLOCK_STEPS = 32
"""Most steps in a block: an interrupt waits for one to end, and each needs the host once."""

BLOCK_BYTES = 2**23
"""Most bytes of minibatches in a block."""


@dataclass
class Run:
    """A run on a device, from step `begun` on; `step` is the one reached.

    `template` has what no step changes; `history` holds losses by step.
    """

    device: Any
    recipe: Recipe
    data: Dataset
    begun: int
    step: int
    template: TrainState
    history: dict[int, float]
    pool: tuple[Indices, Indices, Indices] | None = field(init=False)

    def __post_init__(self) -> None:
        drawn = train.draw_pool(self.recipe, self.data)
        self.pool = None if drawn is None else dataset.places_of(self.data, *drawn)

    def draw(self, first: int, last: int) -> NDArray[np.int32]:
        """Return places (steps, 3, batch), in numbers, of the minibatches of steps first to last - 1."""
        places = np.empty((last - first, 3, self.recipe.batch), np.int32)
        scale = np.array([self.data.channels, self.data.channels, 1])[:, None]
        for at, step in enumerate(range(first, last)):
            if self.pool is None:
                found = dataset.places_of(self.data, *train.draw_batch(self.recipe, step, self.data, None))
            else:
                pick = train.draw_picks(self.recipe, step)
                found = (self.pool[0][pick], self.pool[1][pick], self.pool[2][pick])
            places[at] = np.stack(found) * scale
        return places

    def enqueue(self, places: NDArray[np.int32]) -> None:
        """Hand a block of steps to the device."""
        steps = range(self.step, self.step + len(places))
        numbers = [(train.rate_at(self.recipe, step), *adam.growth(step + 1)) for step in steps]
        self.device.enqueue(steps.start, places, numbers)
        self.step = steps.stop

    def blocks(self, end: int, stops: Sequence[int]) -> Iterator[float]:
        """Do the steps up to `end` in blocks that end at multiples of `stops`; yield each's last loss."""
        upcoming = self.draw(self.step, _block_end(self.step, end, self.recipe, stops))
        while self.step < end:
            self.enqueue(upcoming)
            upcoming = self.draw(self.step, _block_end(self.step, end, self.recipe, stops))
            yield self.settle()

    def settle(self) -> float:
        """Wait for the device, and return the last loss; TrainingError if one is not finite.

        What the device was given counts, not what the host meant to give: an interrupt may lie between.
        """
        first, losses, failed = self.device.finish()
        self.step = first + len(losses) if failed is None else failed
        numbered = dict(zip(range(first, self.step + 1), map(float, losses), strict=False))
        self.history.update((step, numbered[step]) for step in numbered if step % self.recipe.log_every == 0)
        if failed is not None:
            train.check_loss(numbered[failed], failed, self.recipe)
        return float(losses[-1]) if len(losses) else 0.0

    def state(self, step: int) -> TrainState:
        """Return the state before `step`, the one reached or the one before it."""
        found, *moments = self.device.state(step)
        network = self.template.siren
        weights, biases = (
            _ordered(found, [f"{kind}{layer}" for layer in range(len(arrays))], arrays)
            for kind, arrays in (("W", network.weights), ("b", network.biases))
        )
        names, like = names_of(self.template.parameters), self.template.parameters
        factors = None
        if self.template.factors is not None:
            factors = Factors(*_ordered(found, names[:2], like[:2]))
        m, v = (_ordered(arrays, names, like) for arrays in moments)
        return replace(
            self.template,
            siren=replace(network, weights=weights, biases=biases),
            moments=AdamState(m, v, step),
            step=step,
            history=tuple(pair for pair in sorted(self.history.items()) if pair[0] < step),
            factors=factors,
        )


def train_on(
    device: Executor,
    recipe: Recipe,
    pairs: Sequence[tuple[Frame, Frame]],
    *,
    state: TrainState | None = None,
    network: Siren | None = None,
    until: int | None = None,
    on_progress: Progress | None = None,
    on_checkpoint: Checkpoint | None = None,
    checkpoint_every: int | None = None,
) -> TrainState:
    """Train as refimpl.network.train.train does, in float32, with the steps done by the executor's device."""
    train.check_recipe(recipe)
    normalization = (
        dataset.normalization_of([noisy for noisy, _ in pairs]) if state is None else state.normalization
    )
    # NumPy works without the interpreter's lock: frames are encoded beside each other.
    with ThreadPoolExecutor(cores()) as pool:
        data = dataset.build(pairs, recipe.features, recipe.window, normalization, pool.map)
    if state is None:
        state = train.start(recipe, normalization, data.digest, network=network)
    state = train.resumed(state, recipe, data.digest)
    run = begin(device, recipe, data, state)
    end = recipe.steps if until is None else min(until, recipe.steps)
    keep = on_checkpoint or (lambda state: None)
    stops = [recipe.log_every, *([checkpoint_every] if checkpoint_every else [])]
    try:
        for loss in run.blocks(end, stops):
            if on_progress and (run.step % recipe.log_every == 0 or run.step == end):
                on_progress(run.state(run.step), loss)
            if checkpoint_every and run.step % checkpoint_every == 0 and run.step < end:
                keep(run.state(run.step))
        final = run.state(run.step)
        train.check_parameters(final)
    except KeyboardInterrupt:
        run.settle()
        keep(run.state(run.step))
        raise
    except TrainingError:
        if run.step > run.begun:
            keep(run.state(run.step - 1))
        raise
    keep(final)
    return final


def begin(device: Executor, recipe: Recipe, data: Dataset, state: TrainState) -> Run:
    """Compile the step, and put the state on the device."""
    if state.siren.dtype != np.float32:
        rule = "a device trains in float32"
        raise InputError("type of the state's values", str(state.siren.dtype), rule, "use executor numpy")
    omegas = recipe.omega_0_first, recipe.omega_0_hidden
    kernel = compile_step(
        recipe.layer_widths, omegas, recipe.batch, recipe.window.size, recipe.rank, recipe.activation
    )
    trainer = device.open_trainer(kernel, data.values, data.targets)
    load(trainer, state)
    return Run(trainer, recipe, data, state.step, state.step, state, dict(state.history))


def load(device: Any, state: TrainState) -> None:
    """Put a state on a device: what moves, and the first layer's weights, which may follow its factors."""
    theta, m, v = map(named, (state.parameters, state.moments.m, state.moments.v))
    device.load(state.step, {**theta, MATRIX: state.siren.weights[0]}, m, v)


def names_of(arrays: Sequence[NDArray[Any]]) -> list[str]:
    """Return the names of weights W0, W1, ... and biases b0, b1, ... in a state's order.

    One more of them than a weight and a bias a layer: the first weights are two factors.
    """
    layers = len(arrays) // 2
    first = factor_names(MATRIX) if len(arrays) % 2 else (MATRIX,)
    others = [f"W{layer}" for layer in range(1, layers)]
    return [*first, *others, *(f"b{layer}" for layer in range(layers))]


def named(arrays: Sequence[NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return a state's arrays by name; a factor (D_out, size, R) as a matrix (D_out, size R)."""
    flat = (array.reshape(len(array), -1) if array.ndim == 3 else array for array in arrays)
    return dict(zip(names_of(arrays), flat, strict=True))


def _ordered(
    found: Mapping[str, NDArray[np.float32]], names: Sequence[str], like: Sequence[NDArray[Any]]
) -> tuple[NDArray[np.float32], ...]:
    """Return arrays by name in this order, in the shapes of others."""
    return tuple(found[name].reshape(array.shape) for name, array in zip(names, like, strict=True))


def _block_end(step: int, end: int, recipe: Recipe, stops: Sequence[int]) -> int:
    """Return where the block that begins at `step` ends: at a callback, or when it is long enough."""
    longest = max(1, min(BLOCK_STEPS, BLOCK_BYTES // (12 * recipe.batch)))
    return min(end, step + longest, *(step - step % every + every for every in stops))


def model_of_run(state: TrainState, pairs: Sequence[tuple[Frame, Frame]]) -> Model:
    """Return the trained model, rounded to integers if the recipe says so.

    Its facts are those of its training frames, and their domain if they are enough.
    """
    model = with_domain(train.model_of(state, facts_of(pairs)), pairs)
    recipe = state.recipe
    return train.whole_of(model, pairs, recipe.whole, recipe.seed) if recipe.whole else model


def with_domain(model: Model, pairs: Sequence[tuple[Frame, Frame]]) -> Model:
    """Return the model with the domain of its training frames among its facts, if they are enough."""
    domain = domain_of_frames(model, [noisy for noisy, _ in pairs])
    return replace(model, info={**model.info, DOMAIN: to_json(domain)}) if domain else model


def facts_of(pairs: Sequence[tuple[Frame, Frame]]) -> dict[str, str]:
    """Return the facts of the noisy frames, each value once, for the model's reader.

    Frames that name their ranges need not list what each of them has drawn.
    """
    names = dict.fromkeys(name for pair in pairs for name in pair[0].info)
    values = {
        name: dict.fromkeys(noisy.info[name] for noisy, _ in pairs if name in noisy.info) for name in names
    }
    drawn = RANGES in values
    return {
        f"trained_on_{name}": ", ".join(each) for name, each in values.items() if len(each) == 1 or not drawn
    }
