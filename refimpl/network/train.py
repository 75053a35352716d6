"""Training: fit the network to pairs of a noisy frame and its reference.

1. Lay out all windows and targets of the pairs as one table [`dataset.build`].
2. Each step, draw a minibatch of pixels [`draw_batch`]: any pixels of any frame, or members of a pool that
   was drawn once, as in the paper.
3. Compute the mean squared error of display-encoded colour and its derivative [`loss_and_gradients`].
4. Follow it with Adam, at a learning rate given by the schedule [`SCHEDULES`]; where the recipe asks for a
   first layer of low rank, its factors are what moves [`factored`].
5. Where the recipe asks for a network of integers, the trained one is rounded in the end, on windows of the
   noisy frames [`whole_of`].
6. Everything that the next step depends on is in [`TrainState`], so training can stop after any step and
   resume later to the same bits [`state_to_arrays`], [`state_from_arrays`].

Source: *WAMnet for Image Denoising* for the protocol of the preset `paper`. No generator has a state:
minibatch k depends only on (seed, k). Bits repeat on one machine with one BLAS and one number of BLAS
threads; another BLAS sums in another order.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..errors import NO_VALUE, InputError, TrainingError, choice
from ..frame import Frame
from ..reading import parse_json, to_dataclass
from . import adam, dataset, factored, siren, whole
from .activation import SINE, activation_named
from .adam import AdamState
from .dataset import Dataset, Normalization
from .denoise import OUTPUT_CHANNELS, Model
from .factored import Factors
from .siren import Siren
from .whole import SINES, Whole
from .window import Window, check_window

Array = NDArray[np.floating[Any]]

POOL_STREAM = 0xFFFFFFFF
"""Counter `sample` of the words that draw the pool; steps use their own number, which is smaller."""

ROUNDING_STREAM = 0xFFFFFFFE
"""Counter `sample` of the words that draw the windows on which a network is rounded."""

ROUNDING_WINDOWS = 2**13
"""Windows on which a network is rounded: some for each weight of a row of the shipped networks."""

PICK_TAG = 0x5049434B
"""Counter `block` of the words that pick members of the pool ("PICK" in ASCII)."""


def constant(step: int, steps: int) -> float:
    """Keep the learning rate."""
    return 1.0


def cosine(step: int, steps: int) -> float:
    """Fall from 1 at the first step along half a cosine towards 0 after the last."""
    return 0.5 * (1.0 + math.cos(math.pi * step / steps))


SCHEDULES: Mapping[str, Callable[[int, int], float]] = {"constant": constant, "cosine": cosine}
"""Factors of the learning rate at a step of `steps`, by name; a new one is one function and one line here."""


@dataclass(frozen=True)
class Recipe:
    """All choices of a training run; `widths` are those of the hidden layers, `activation` is theirs.

    `n_windows` is the size of the pool that minibatches are picked from; 0 draws new pixels every step.
    `log_every` is in steps. `rank` is that of the first layer, 0 for no restriction. `whole` is the largest
    hidden value of the network of integers that the trained one becomes, 0 for floats.
    """

    features: tuple[str, ...]
    window: Window
    widths: tuple[int, ...]
    omega_0_first: float
    omega_0_hidden: float
    n_windows: int
    batch: int
    steps: int
    learning_rate: float
    schedule: str
    seed: int = 0
    log_every: int = 100
    rank: int = 0
    activation: str = SINE
    whole: int = 0

    @property
    def layer_widths(self) -> tuple[int, ...]:
        """Return (D_in, hidden widths ..., 3)."""
        return (dataset.n_inputs(self.features, self.window), *self.widths, OUTPUT_CHANNELS)


PAPER = Recipe(
    features=("color", "normal"),
    window=Window(12, "clamp"),
    widths=(32, 32, 32, 32),
    omega_0_first=1.0,
    omega_0_hidden=1.0,
    n_windows=20_000,
    batch=10_000,
    steps=20_000,
    learning_rate=1e-3,
    schedule="constant",
)
"""The paper's protocol; what the paper leaves open (omega_0, learning rate) is decided in the spec."""

SHORT = replace(
    PAPER,
    features=("color", "normal", "albedo", "position"),
    omega_0_hidden=10.0,
    n_windows=0,
    batch=512,
    steps=12_000,
    schedule="cosine",
)
"""Better than the paper's protocol on unseen frames in a minute: `experiments/records/presets.json`."""

BEST = replace(SHORT, steps=30_000)
"""The same for longer, which pays with many frames; chosen by `experiments/quality.py`."""

SHADOWS = replace(BEST, features=("color", "normal", "albedo", "position", "direct"))
"""For soft shadows, of frames that have the layer `direct`; chosen by `experiments/shadows.py`."""

MIRRORS = replace(
    BEST,
    features=(
        *("color", "highlights", "seen_smoothed", "seen_normal", "seen_albedo", "seen_position"),
        "seen_emission",
    ),
    window=Window(8, "clamp"),
    widths=(64, 64, 64, 64),
    steps=60_000,
    learning_rate=5e-4,
)
"""For scenes with mirrors, metal and glass, whose frames have layers of what is seen past these; chosen by
`experiments/quality.py --sets glossy`."""

SKY = replace(MIRRORS, features=(*MIRRORS.features, "sun"), window=Window(7, "clamp"))
"""The same for scenes under a sky whose sun moves: what it lights through glass, only its place tells; chosen
by `experiments/quality.py --sets daylight`."""

MIRROR_SHADOWS = replace(MIRRORS, features=(*MIRRORS.features, "seen_direct"))
"""For soft shadows in such scenes, past mirrors and glass too; chosen by `experiments/shadows.py`."""

SKY_SHADOWS = replace(SKY, features=(*SKY.features, "seen_direct"))
"""The same under a sky."""

PRESETS: Mapping[str, Recipe] = {
    "best": BEST,
    "mirrors": MIRRORS,
    "mirrors-shadows": MIRROR_SHADOWS,
    "paper": PAPER,
    "shadows": SHADOWS,
    "short": SHORT,
    "sky": SKY,
    "sky-shadows": SKY_SHADOWS,
}
"""Recipes by name; change single choices with `dataclasses.replace`."""


def check_recipe(recipe: Recipe) -> None:
    """Refuse a recipe with a value that means nothing."""
    dataset.check_features(recipe.features)
    check_window(recipe.window)
    siren.check_shape(recipe.layer_widths, recipe.omega_0_first, recipe.omega_0_hidden)
    counts = {"batch": 1, "steps": 1, "log_every": 1, "n_windows": 0, "seed": 0, "rank": 0}
    for name, least in counts.items():
        value = getattr(recipe, name)
        if not isinstance(value, int) or not least <= value < POOL_STREAM:
            rule = f"must be an integer from {least} to {POOL_STREAM - 1}"
            raise InputError(f"recipe: {name}", value, rule, "see the presets " + ", ".join(PRESETS))
    if not (math.isfinite(recipe.learning_rate) and recipe.learning_rate > 0):
        raise InputError(
            "recipe: learning_rate", recipe.learning_rate, "must be finite and positive", "try 0.001"
        )
    if recipe.rank > 0:
        factored.check_rank(recipe.rank, recipe.window.size, *recipe.layer_widths[:2])
    activation_named(recipe.activation)
    if recipe.whole:
        _check_whole(recipe)
    if recipe.schedule not in SCHEDULES:
        raise InputError("recipe: schedule", recipe.schedule, "unknown", choice(recipe.schedule, SCHEDULES))


def _check_whole(recipe: Recipe) -> None:
    """Refuse what does not become a network of integers."""
    if recipe.whole not in SINES:
        known = ", ".join(map(str, SINES))
        rule = "must be the largest value of an integer sine"
        raise InputError("recipe: whole", recipe.whole, rule, f"choose one of {known}, or 0 for floats")
    for name, floats in (("rank", 0), ("activation", SINE)):
        value = getattr(recipe, name)
        if value != floats:
            rule = "integer networks have sines, and no rank"
            raise InputError(f"recipe: {name}", value, rule, f"use {floats}, or train a float network")


def with_activation(recipe: Recipe, name: str) -> Recipe:
    """Return the recipe with another activation, and with the omegas that belong to it, if some do."""
    first, hidden = activation_named(name).omegas or (recipe.omega_0_first, recipe.omega_0_hidden)
    return replace(recipe, activation=name, omega_0_first=first, omega_0_hidden=hidden)


def recipe_to_json(recipe: Recipe) -> str:
    """Return the recipe as JSON text with sorted keys; the sine and floats are not named, as ever."""
    fields = asdict(recipe)
    for name, usual in (("activation", SINE), ("whole", 0)):
        if fields[name] == usual:
            del fields[name]
    return json.dumps(fields, sort_keys=True)


def recipe_from_json(text: str) -> Recipe:
    """Return the recipe written in `text`, or say what is wrong with it."""
    recipe = to_dataclass(Recipe, parse_json(text, "recipe", "write it with recipe_to_json"), "recipe")
    check_recipe(recipe)
    return recipe


@dataclass(frozen=True)
class TrainState:
    """All that the next step depends on, after `step` steps; `history` holds (step, loss before that step).

    `digest` names the data, so that training is not resumed on other frames by mistake. `factors` are those
    of the first layer's weights, if the recipe restricts its rank.
    """

    siren: Siren
    moments: AdamState
    step: int
    recipe: Recipe
    normalization: Normalization
    digest: str
    history: tuple[tuple[int, float], ...] = ()
    factors: Factors | None = None

    @property
    def parameters(self) -> tuple[Array, ...]:
        """Return the arrays that training moves: weights (or factors and the other weights), then biases."""
        return _parameters(self.factors, self.siren.weights, self.siren.biases)


def _parameters(
    factors: Factors | None, weights: tuple[Array, ...], biases: tuple[Array, ...]
) -> tuple[Array, ...]:
    """Return weights and biases, with the factors in place of the first weights if there are any."""
    if factors is None:
        return weights + biases
    return (factors.vertical, factors.horizontal, *weights[1:], *biases)


def _with_parameters(state: TrainState, parameters: tuple[Array, ...]) -> TrainState:
    """Return the state with other arrays in the order of `TrainState.parameters`."""
    layers = len(state.siren.weights)
    factors = None
    if state.factors is not None:
        factors = Factors(*parameters[:2])
        parameters = (factored.expand(factors), *parameters[2:])
    moved = replace(state.siren, weights=parameters[:layers], biases=parameters[layers:])
    return replace(state, siren=moved, factors=factors)


Progress = Callable[[TrainState, float], None]
"""Called with the state after a step and the loss before it."""

Checkpoint = Callable[[TrainState], None]
"""Called with a state that should be kept."""


def start(
    recipe: Recipe,
    normalization: Normalization,
    digest: str,
    dtype: DTypeLike = np.float32,
    network: Siren | None = None,
) -> TrainState:
    """Return the state before the first step: of random weights, or of a network that was trained before."""
    check_recipe(recipe)
    if network is None:
        network = siren.init(
            recipe.layer_widths,
            recipe.omega_0_first,
            recipe.omega_0_hidden,
            recipe.seed,
            dtype,
            recipe.activation,
        )
        factors = recipe.rank and factored.start(network.weights[0], recipe.window.size, recipe.rank)
    else:
        _check_network(network, recipe)
        factors = recipe.rank and factored.cut(network.weights[0], recipe.window.size, recipe.rank)
    if not factors:
        moments = adam.init(network.weights + network.biases)
        return TrainState(network, moments, 0, recipe, normalization, digest)
    network = replace(network, weights=(factored.expand(factors), *network.weights[1:]))
    moments = adam.init(_parameters(factors, network.weights, network.biases))
    return TrainState(network, moments, 0, recipe, normalization, digest, factors=factors)


def _check_network(network: Siren, recipe: Recipe) -> None:
    """Refuse to continue with a network of integers, or of another shape than the recipe's."""
    if isinstance(network, Whole):
        rule = "is an integer network, and training needs floats"
        raise InputError("first network", NO_VALUE, rule, "start with the model that was rounded")
    has = (network.widths, network.omega_0_first, network.omega_0_hidden, network.activation)
    wants = (recipe.layer_widths, recipe.omega_0_first, recipe.omega_0_hidden, recipe.activation)
    if has != wants:
        rule = f"must be those of the recipe, {wants}"
        what = "widths, omegas and activation of the first network"
        raise InputError(what, has, rule, "use its original recipe")


def train(
    recipe: Recipe,
    pairs: Sequence[tuple[Frame, Frame]],
    *,
    state: TrainState | None = None,
    network: Siren | None = None,
    until: int | None = None,
    dtype: DTypeLike = np.float32,
    on_progress: Progress | None = None,
    on_checkpoint: Checkpoint | None = None,
    checkpoint_every: int | None = None,
) -> TrainState:
    """Train on (noisy, reference) pairs from the start or from `state`, up to step `until` (all by default).

    A start from `network` begins with its weights, cut to the recipe's rank; else they are random.
    `on_progress` is called every recipe.log_every steps and after the last. `on_checkpoint` is called every
    `checkpoint_every` steps, after the last, on an interrupt, and before TrainingError is raised: then
    with the last state whose loss is finite, if this call has seen one.
    """
    check_recipe(recipe)
    normalization = (
        dataset.normalization_of([noisy for noisy, _ in pairs]) if state is None else state.normalization
    )
    data = dataset.build(pairs, recipe.features, recipe.window, normalization)
    if state is None:
        state = start(recipe, normalization, data.digest, dtype, network)
    state = resumed(state, recipe, data.digest)
    pool = draw_pool(recipe, data)
    end = recipe.steps if until is None else min(until, recipe.steps)
    keep = on_checkpoint or (lambda _: None)
    good: TrainState | None = None
    try:
        while state.step < end:
            after, loss = train_step(state, data, pool)
            # The loss of a state is known one step later: now that of `state` is known to be finite.
            good, state = state, after
            if on_progress and (state.step % recipe.log_every == 0 or state.step == end):
                on_progress(state, loss)
            if checkpoint_every and state.step % checkpoint_every == 0 and state.step < end:
                keep(state)
        check_parameters(state)
    except KeyboardInterrupt:
        keep(state)
        raise
    except TrainingError:
        if good is not None:
            keep(good)
        raise
    keep(state)
    return state


def check_parameters(state: TrainState) -> None:
    """Refuse to hand out parameters that the last step made infinite or NaN."""
    if not all(np.isfinite(array).all() for array in state.siren.weights + state.siren.biases):
        raise TrainingError(
            f"parameters after step {state.step}: must be finite "
            f"(lower the learning rate, {state.recipe.learning_rate}, or check the frames)"
        )


def resumed(state: TrainState, recipe: Recipe, digest: str) -> TrainState:
    """Return `state` under `recipe`, which may change the number of steps and of log lines, nothing else."""
    same = replace(recipe, steps=state.recipe.steps, log_every=state.recipe.log_every)
    if same != state.recipe:
        names = [name for name in asdict(same) if getattr(same, name) != getattr(state.recipe, name)]
        rule = "a resumed run keeps its recipe, except for steps and log_every"
        raise InputError("changed parts of the recipe", ", ".join(names), rule, "start a new run")
    if digest != state.digest:
        rule = f"the run was started on frames with digest {state.digest[:12]}"
        raise InputError("digest of the training frames", digest[:12], rule, "give the same frames, in order")
    if state.step > recipe.steps:
        rule = f"the run has done {state.step} steps"
        raise InputError("steps", recipe.steps, rule, f"give at least {state.step}, or start a new run")
    return replace(state, recipe=recipe)


def train_step(state: TrainState, data: Dataset, pool: Pixels | None) -> tuple[TrainState, float]:
    """Return the state after one more step and the loss before it; TrainingError if that is not finite."""
    recipe, network = state.recipe, state.siren
    windows, targets = dataset.examples_at(data, *draw_batch(recipe, state.step, data, pool))
    # A run that diverges overflows on its way; the loss tells, so NumPy need not warn.
    with np.errstate(over="ignore", invalid="ignore"):
        loss, gradients = loss_and_gradients(
            network, windows.astype(network.dtype), targets.astype(network.dtype)
        )
        check_loss(loss, state.step, recipe)
        dfactors = state.factors and factored.backward(state.factors, gradients.dweights[0])
        slopes = _parameters(dfactors, gradients.dweights, gradients.dbiases)
        parameters, moments = adam.step(state.parameters, slopes, state.moments, rate_at(recipe, state.step))
        moved = _with_parameters(state, parameters)
    history = state.history
    if state.step % recipe.log_every == 0:
        history = (*history, (state.step, loss))
    return replace(moved, moments=moments, step=state.step + 1, history=history), loss


def check_loss(loss: float, step: int, recipe: Recipe) -> None:
    """Refuse to follow a gradient when the loss is not finite."""
    if not math.isfinite(loss):
        raise TrainingError(
            f"loss at step {step} {loss}: must stay finite "
            f"(lower the learning rate, {recipe.learning_rate}, or check the frames)"
        )


def rate_at(recipe: Recipe, step: int) -> float:
    """Return the learning rate of a step."""
    return recipe.learning_rate * SCHEDULES[recipe.schedule](step, recipe.steps)


Pixels = tuple[dataset.Indices, dataset.Indices, dataset.Indices]
"""Frame, y and x (N,) of N pixels."""


def draw_pool(recipe: Recipe, data: Dataset) -> Pixels | None:
    """Draw the pixels that minibatches are picked from, or none when every step draws its own."""
    if recipe.n_windows == 0:
        return None
    return dataset.sample_pixels(recipe.seed, POOL_STREAM, recipe.n_windows, data.shapes)


def draw_batch(recipe: Recipe, step: int, data: Dataset, pool: Pixels | None) -> Pixels:
    """Draw the pixels of one minibatch, which depends only on (recipe.seed, step)."""
    if pool is None:
        return dataset.sample_pixels(recipe.seed, step, recipe.batch, data.shapes)
    pick = draw_picks(recipe, step)
    frame, y, x = pool
    return frame[pick], y[pick], x[pick]


def draw_picks(recipe: Recipe, step: int) -> dataset.Indices:
    """Draw the members of the pool that make up one minibatch."""
    return dataset.sample_indices(recipe.seed, step, PICK_TAG, recipe.batch, recipe.n_windows)


def loss_and_gradients(network: Siren, windows: Array, targets: Array) -> tuple[float, siren.Gradients]:
    """Return the mean squared error of windows (N, D_in) against targets (N, 3), and its derivatives.

    Outputs are not clipped here: the derivative of a clipped output is 0 where it matters most.
    """
    outputs, cache = siren.forward_cached(network, windows)
    squares, dy = squared_error(outputs, targets, outputs.size)
    return float(np.mean(squares, dtype=np.float64)), siren.backward(network, cache, dy, with_dx=False)


def squared_error(outputs: Any, targets: Any, count: int) -> tuple[Any, Any]:
    """Return (y - t)^2 for y, t (..., 3), and d/dy of the sum of all squares over their `count`.

    Both may be tracing values.
    """
    error = outputs - targets
    return error * error, error * (2.0 / count)


def model_of(state: TrainState, info: Mapping[str, str] | None = None) -> Model:
    """Return the trained model; its `info` holds the recipe, the steps done and the caller's facts."""
    facts = {
        "recipe": recipe_to_json(state.recipe),
        "steps_done": str(state.step),
        "data_digest": state.digest,
        **(info or {}),
    }
    return Model(state.siren, state.recipe.features, state.recipe.window, state.normalization, facts)


def whole_of(model: Model, pairs: Sequence[tuple[Frame, Frame]], amplitude: int, seed: int = 0) -> Model:
    """Return a trained model in integers, rounded on windows of the noisy frames; `info` says which."""
    data = dataset.build(pairs, model.features, model.window, model.normalization)
    pixels = dataset.sample_pixels(seed, ROUNDING_STREAM, ROUNDING_WINDOWS, data.shapes)
    windows, _ = dataset.examples_at(data, *pixels)
    network = whole.rounded_on(model.siren, windows, model.window.size, amplitude)
    return replace(model, siren=network, info={**model.info, "rounded_on_digest": data.digest})


def state_to_arrays(state: TrainState) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Return the state as arrays by name and text by name: the content of a checkpoint file."""
    arrays: dict[str, NDArray[Any]] = {}
    for layer, (weight, bias) in enumerate(zip(state.siren.weights, state.siren.biases, strict=True)):
        arrays[f"layer{layer}.weight"], arrays[f"layer{layer}.bias"] = weight, bias
    if state.factors is not None:
        arrays["layer0.vertical"] = state.factors.vertical
        arrays["layer0.horizontal"] = state.factors.horizontal
    for index, (m, v) in enumerate(zip(state.moments.m, state.moments.v, strict=True)):
        arrays[f"adam.m{index}"], arrays[f"adam.v{index}"] = m, v
    arrays["history.step"] = np.array([step for step, _ in state.history], np.int64)
    arrays["history.loss"] = np.array([loss for _, loss in state.history], np.float64)
    text = {
        "recipe": recipe_to_json(state.recipe),
        "normalization": json.dumps(asdict(state.normalization), sort_keys=True),
        "step": str(state.step),
        "digest": state.digest,
    }
    return arrays, text


def state_from_arrays(arrays: Mapping[str, NDArray[Any]], text: Mapping[str, str]) -> TrainState:
    """Return the state that [`state_to_arrays`] wrote; the names that it needs must be there."""
    recipe = recipe_from_json(text["recipe"])
    layers = range(len(recipe.widths) + 1)
    network = Siren(
        tuple(arrays[f"layer{layer}.weight"] for layer in layers),
        tuple(arrays[f"layer{layer}.bias"] for layer in layers),
        recipe.omega_0_first,
        recipe.omega_0_hidden,
        recipe.activation,
    )
    factors = None
    if recipe.rank > 0:
        factors = Factors(arrays["layer0.vertical"], arrays["layer0.horizontal"])
    moments = range(2 * len(layers) + (factors is not None))
    step = int(text["step"])
    m = tuple(arrays[f"adam.m{index}"] for index in moments)
    v = tuple(arrays[f"adam.v{index}"] for index in moments)
    steps, losses = arrays["history.step"].tolist(), arrays["history.loss"].tolist()
    history = tuple(zip(steps, losses, strict=True))
    normalization = dataset.normalization_from_json(text["normalization"])
    adam_state = AdamState(m, v, step)
    return TrainState(network, adam_state, step, recipe, normalization, text["digest"], history, factors)


def check_state(state: TrainState) -> None:
    """Refuse a state whose arrays do not have the shapes and the finite numbers that its recipe calls for."""
    widths = state.recipe.layer_widths
    weights: list[tuple[int, ...]] = [(n_out, n_in) for n_in, n_out in pairwise(widths)]
    shapes = weights + [(n_out,) for n_out in widths[1:]]
    parameters: tuple[Array, ...] = state.siren.weights + state.siren.biases
    if state.factors is not None:
        size, rank = state.recipe.window.size, state.recipe.rank
        factors = [(widths[1], size, rank), (rank, widths[0] // size)]
        shapes, parameters = [*factors, *shapes[1:]], state.parameters
    groups = {"parameter": parameters, "first moment": state.moments.m, "second moment": state.moments.v}
    for name, arrays in groups.items():
        for index, (array, shape) in enumerate(zip(arrays, shapes, strict=True)):
            what, way_out = f"{name} {index}", "start a new run"
            if array.shape != shape or array.dtype != state.siren.dtype or array.dtype.kind != "f":
                rule = f"must be of shape {shape} and one float type"
                raise InputError(what, f"{array.dtype} {array.shape}", rule, way_out)
            if name == "parameter" and not np.isfinite(array).all():
                raise InputError(what, NO_VALUE, "must be finite", way_out)
    if not 0 <= state.step <= state.recipe.steps:
        raise InputError("step", state.step, f"must be from 0 to {state.recipe.steps}", "start a new run")
