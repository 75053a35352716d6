"""Training: gradients by hand, the same bits when it is resumed, presets, and what is refused."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import from_display, to_display
from wamnet.refimpl.errors import InputError, TrainingError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, denoise, siren, train, whole
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.train import PRESETS, Recipe, TrainState
from wamnet.refimpl.network.window import Window

SIGMA = 0.1
"""Standard deviation of the noise in the synthetic frames, in display-encoded units."""

SMALL = Recipe(
    features=("color",),
    window=Window(5),
    widths=(12, 12),
    omega_0_first=3.0,
    omega_0_hidden=3.0,
    n_windows=0,
    batch=128,
    steps=600,
    learning_rate=1e-2,
    schedule="cosine",
    seed=3,
    log_every=20,
)
"""A run of about a second."""


def pair(seed: int, height: int = 32, width: int = 32) -> tuple[Frame, Frame]:
    """Return a noisy and a clean frame: a plane in display-encoded colour, with and without normal noise."""
    rng = np.random.default_rng(seed)
    y, x = np.indices((height, width))[..., None] / max(height, width)
    clean = 0.5 + 0.15 * (rng.uniform(-1, 1, 3) * x + rng.uniform(-1, 1, 3) * y)
    noisy = np.clip(clean + SIGMA * rng.standard_normal(clean.shape), 0, 1)
    frames = [Frame({"color": from_display(image).astype(np.float32)}) for image in (noisy, clean)]
    return frames[0], frames[1]


PAIRS = [pair(1), pair(2, 24, 40), pair(3), pair(4)]


def tensors(state: TrainState) -> list[bytes]:
    """Return all arrays of a state as bytes."""
    return [array.tobytes() for array in train.state_to_arrays(state)[0].values()]


@pytest.mark.parametrize("n_windows", [0, 2000])
def test_training_beats_a_mean_filter_on_an_unseen_frame(n_windows: int) -> None:
    """On planes the mean over 3x3 pixels is unbiased; its error is sigma^2/9, a ninth of the input's error.

    The network sees 5x5 pixels, so sigma^2/25 is possible; one that has learned must at least beat sigma^2/9
    as measured on the same pixels (borders, where the mean is one-sided, are left out for both).
    """
    state = train.train(replace(SMALL, n_windows=n_windows), PAIRS)
    noisy, reference = pair(99)
    inner = (slice(2, -2), slice(2, -2))
    target, given = (to_display(frame["color"].astype(np.float64)) for frame in (reference, noisy))
    box = np.lib.stride_tricks.sliding_window_view(given, (3, 3), axis=(0, 1)).mean(axis=(-1, -2))[1:-1, 1:-1]
    result = denoise.denoise(train.model_of(state), noisy, np.float64)

    def mse(image: Any) -> float:
        return float(np.mean((image - target[inner]) ** 2))

    assert mse(result[inner]) <= mse(box)
    assert mse(box) <= mse(given[inner])
    assert state.history[0][1] >= state.history[-1][1]


# ---- learning --------------------------------------------------------------------------------------------


def test_float64_trains_in_float64() -> None:
    state = train.train(replace(SMALL, steps=3), PAIRS, dtype=np.float64)
    assert state.siren.dtype == state.moments.v[0].dtype == np.float64


def test_loss_and_gradients_by_hand() -> None:
    """y = 2 x, x = 3, t = 5: loss (6 - 5)^2 = 1, dloss/dw = 2 (y - t) x = 6, dloss/db = 2 (y - t) = 2."""
    network = train.Siren((np.array([[2.0]]),), (np.array([0.0]),), 1.0, 1.0)
    loss, gradients = train.loss_and_gradients(network, np.array([[3.0]]), np.array([[5.0]]))
    assert (loss, gradients.dweights[0].item(), gradients.dbiases[0].item()) == (1.0, 6.0, 2.0)


def test_schedules() -> None:
    assert [train.constant(step, 4) for step in range(4)] == [1.0] * 4
    # cos of 0, pi/2: 1 and 0, up to the rounding of pi / 2 (2**-53 each way).
    assert train.cosine(0, 4) == 1.0
    assert abs(train.cosine(2, 4) - 0.5) <= 2.0**-53
    assert 0 < train.cosine(3, 4) < train.cosine(2, 4)


# ---- minibatches -----------------------------------------------------------------------------------------


def test_a_pool_is_drawn_once_and_picked_from() -> None:
    recipe = replace(SMALL, n_windows=10, batch=500)
    data = dataset.build(PAIRS, recipe.features, recipe.window, Normalization())
    pool = train.draw_pool(recipe, data)
    assert pool is not None
    batch = train.draw_batch(recipe, 0, data, pool)
    members = set(zip(*(part.tolist() for part in pool), strict=True))
    # 500 picks miss one of 10 members with probability 10 * 0.9**500 < 1e-21.
    assert set(zip(*(part.tolist() for part in batch), strict=True)) == members
    again = train.draw_batch(recipe, 1, data, pool)
    assert not np.array_equal(batch[1], again[1])


# ---- resume ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes", [{}, {"n_windows": 50, "schedule": "constant"}, {"activation": "relu", "omega_0_hidden": 1.0}]
)
def test_twenty_steps_are_ten_and_ten(changes: Any) -> None:
    recipe = replace(SMALL, steps=20, log_every=3, **changes)
    whole = train.train(recipe, PAIRS)
    half = train.train(recipe, PAIRS, until=10)
    assert half.step == 10
    restored = train.state_from_arrays(*train.state_to_arrays(half))
    resumed = train.train(recipe, PAIRS, state=restored)
    assert tensors(resumed) == tensors(whole)
    assert resumed == replace(whole, siren=resumed.siren, moments=resumed.moments)
    assert [step for step, _ in whole.history] == [0, 3, 6, 9, 12, 15, 18]


def test_resume_refuses_another_recipe_other_frames_and_fewer_steps() -> None:
    recipe = replace(SMALL, steps=4)
    state = train.train(recipe, PAIRS, until=3)
    changed = replace(recipe, batch=64, learning_rate=0.5)
    with pytest.raises(InputError, match="changed parts of the recipe 'batch, learning_rate': a resumed run"):
        train.train(changed, PAIRS, state=state)
    with pytest.raises(InputError, match="changed parts of the recipe 'seed': a resumed run"):
        train.train(replace(recipe, seed=recipe.seed + 1), PAIRS, state=state)
    with pytest.raises(
        InputError, match=r"digest of the training frames '.*': the run was started on frames"
    ):
        train.train(recipe, PAIRS[:1], state=state)
    with pytest.raises(InputError, match=r"steps 2: the run has done 3 steps \(give at least 3"):
        train.train(replace(recipe, steps=2), PAIRS, state=state)
    assert train.train(replace(recipe, steps=6, log_every=1), PAIRS, state=state).step == 6


# ---- callbacks -------------------------------------------------------------------------------------------


def test_progress_and_checkpoints_come_when_promised() -> None:
    seen: list[tuple[int, float]] = []
    kept: list[int] = []
    train.train(
        replace(SMALL, steps=7, log_every=3),
        PAIRS,
        on_progress=lambda state, loss: seen.append((state.step, loss)),
        on_checkpoint=lambda state: kept.append(state.step),
        checkpoint_every=2,
    )
    assert [step for step, _ in seen] == [3, 6, 7]
    assert all(math.isfinite(loss) for _, loss in seen)
    assert kept == [2, 4, 6, 7]


def test_an_interrupt_keeps_the_state_and_goes_on() -> None:
    kept: list[TrainState] = []

    def interrupt(state: TrainState, loss: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train.train(SMALL, PAIRS, on_progress=interrupt, on_checkpoint=kept.append)
    assert [state.step for state in kept] == [SMALL.log_every]


def test_a_loss_that_is_not_finite_stops_and_keeps_the_last_good_state() -> None:
    """A learning rate of 1e30 moves float32 weights so far that the next loss overflows."""
    kept: list[TrainState] = []
    recipe = replace(SMALL, learning_rate=1e30)
    with pytest.raises(TrainingError, match=r"loss at step 1 (inf|nan): must stay finite \(lower the lear"):
        train.train(recipe, PAIRS, on_checkpoint=kept.append)
    assert [state.step for state in kept] == [0]
    data = dataset.build(PAIRS, recipe.features, recipe.window, kept[0].normalization)
    assert math.isfinite(train.train_step(kept[0], data, None)[1])


def test_parameters_that_are_not_finite_are_never_handed_out() -> None:
    """1e39 is not a float32: the one step makes the parameters infinite, and no later loss would tell."""
    kept: list[TrainState] = []
    with pytest.raises(TrainingError, match=r"parameters after step 1: must be finite \(lower the"):
        train.train(replace(SMALL, learning_rate=1e39, steps=1), PAIRS, on_checkpoint=kept.append)
    assert [state.step for state in kept] == [0]


@pytest.mark.parametrize(("value", "of"), [(math.nan, 0), (math.inf, 1)])
def test_frames_that_are_not_finite_leave_no_good_state(value: float, of: int) -> None:
    """A denoiser may read NaN as 0; a network must not learn that."""
    kept: list[TrainState] = []
    frames = list(pair(1))
    frames[of] = Frame({"color": np.full_like(frames[of]["color"], value)})
    with pytest.raises(InputError, match=rf"layer 'color' .*at x=0, y=0 .* {value}: every pixel"):
        train.train(SMALL, [(frames[0], frames[1])], on_checkpoint=kept.append)
    assert kept == []


def test_references_that_are_not_finite_are_refused() -> None:
    """A denoiser may read NaN as 0; a network must not learn that."""
    noisy, reference = pair(1)
    bad = Frame({"color": np.full_like(reference["color"], np.inf)})
    with pytest.raises(InputError, match=r"layer 'color' of the reference at x=0, y=0 .* inf"):
        train.train(SMALL, [(noisy, bad)])


def test_a_good_state_before_the_bad_one_is_kept() -> None:
    """Ten good steps, then weights that are spoilt: what is kept is a state whose own loss is finite."""
    kept: list[TrainState] = []
    good = train.train(SMALL, PAIRS, until=10)
    steep = replace(good, recipe=replace(SMALL, learning_rate=1e30))
    with pytest.raises(TrainingError, match="loss at step 11"):
        train.train(steep.recipe, PAIRS, state=steep, on_checkpoint=kept.append)
    assert tensors(kept[-1]) == tensors(good)


def test_presets_are_sound_and_the_paper_is_the_papers() -> None:
    for recipe in PRESETS.values():
        train.check_recipe(recipe)
        assert train.recipe_from_json(train.recipe_to_json(recipe)) == recipe
    paper = PRESETS["paper"]
    assert paper.layer_widths == (864, 32, 32, 32, 32, 3)
    assert (paper.n_windows, paper.batch, paper.steps) == (20_000, 10_000, 20_000)
    network = train.start(paper, Normalization(), "").siren
    assert sum(array.size for array in network.weights + network.biases) == 30_947


# ---- recipes ---------------------------------------------------------------------------------------------


def changed(name: str, other: str) -> dict[str, Any]:
    """Return what a preset has that another one has not."""
    one, two = vars(PRESETS[name]), vars(PRESETS[other])
    return {key: value for key, value in one.items() if value != two[key]}


def test_presets_are_sound_and_differ_as_the_spec_says() -> None:
    """TRN-8, TRN-9, TRN-9b, TRN-9e: channels times pixels of a window, layers, what is changed of another."""
    for recipe in PRESETS.values():
        train.check_recipe(recipe)
        assert train.recipe_from_json(train.recipe_to_json(recipe)) == recipe
    for name, widths, parameters in (
        ("paper", (864, 32, 32, 32, 32, 3), 30_947),
        ("mirrors", (21 * 64, 64, 64, 64, 64, 3), 98_755),
        ("sky", (24 * 49, 64, 64, 64, 64, 3), 88_003),
    ):
        network = train.start(PRESETS[name], Normalization(), "").siren
        assert PRESETS[name].layer_widths == widths
        assert sum(array.size for array in network.weights + network.biases) == parameters
    paper, mirrors, sky = (PRESETS[name] for name in ("paper", "mirrors", "sky"))
    assert (paper.n_windows, paper.batch, paper.steps) == (20_000, 10_000, 20_000)
    assert changed("best", "short") == {"steps": 30_000}
    assert set(changed("mirrors", "best")) == {"features", "window", "widths", "steps", "learning_rate"}
    assert changed("sky", "mirrors") == {"features": (*mirrors.features, "sun"), "window": Window(7)}
    for recipe, name in ((mirrors, "mirrors-shadows"), (sky, "sky-shadows")):
        assert PRESETS[name] == replace(recipe, features=(*recipe.features, "seen_direct"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"batch": 0}, "recipe: batch 0: must be an integer from 1"),
        ({"steps": 2.5}, "recipe: steps 2.5: must be an integer"),
        ({"steps": 2**32}, "recipe: steps 4294967296: must be an integer from 1 to 4294967294"),
        ({"log_every": 0}, "recipe: log_every 0"),
        ({"n_windows": -1}, "recipe: n_windows -1"),
        ({"seed": -1}, "recipe: seed -1"),
        ({"learning_rate": math.nan}, "recipe: learning_rate nan: must be finite and positive"),
        ({"learning_rate": 0.0}, r"recipe: learning_rate 0\.0"),
        ({"schedule": "step"}, r"recipe: schedule 'step': unknown \(choose one of constant, cosine"),
        ({"widths": (0,)}, "widths .*"),
        ({"omega_0_first": 0.0}, "omega_0_first .*"),
        ({"features": ("glow",)}, "feature 'glow"),
        ({"activation": "tanh"}, r"activation 'tanh': unknown \(choose one of sine, relu"),
        ({"window": Window(0)}, "window size 0"),
        ({"whole": 128}, r"whole 128: must be the largest value of an integer sine \(choose one of 127, 511"),
        ({"whole": 127, "rank": 2}, r"recipe: rank 2: integer networks have sines, and no rank \(use 0"),
        ({"whole": 127, "activation": "relu"}, "recipe: activation 'relu': integer networks have sines"),
    ],
)
def test_recipes_are_checked(changes: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        train.train(replace(SMALL, **changes), PAIRS)


def test_recipes_name_every_activation_but_the_sine() -> None:
    """Texts of recipes are what they were before there was another: digests of models rest on them."""
    assert "activation" not in train.recipe_to_json(SMALL)
    recipe = train.with_activation(SMALL, "relu")
    assert (recipe.activation, recipe.omega_0_first, recipe.omega_0_hidden) == ("relu", 1.0, 1.0)
    assert train.recipe_from_json(train.recipe_to_json(recipe)) == recipe
    assert train.with_activation(SMALL, "sine") == SMALL


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"features": 1, "widths": []}', "3"])
def test_recipe_text_is_checked(text: str) -> None:
    with pytest.raises(InputError, match=r"recipe"):
        train.recipe_from_json(text)


def test_model_tells_its_origin() -> None:
    state = train.train(replace(SMALL, steps=2), PAIRS)
    model = train.model_of(state, {"scene": "planes"})
    denoise.check_model(model)
    assert train.recipe_from_json(model.info["recipe"]) == state.recipe
    assert (model.info["steps_done"], model.info["scene"]) == ("2", "planes")
    assert model.info["data_digest"] == state.digest


# ---- check_state -----------------------------------------------------------------------------------------


def broken(state: TrainState, part: str) -> TrainState:
    """Return the state with one thing wrong."""
    network, moments = state.siren, state.moments
    return {
        "shape": replace(
            state, siren=replace(network, biases=(*network.biases[:-1], np.zeros(4, np.float32)))
        ),
        "type": replace(state, moments=replace(moments, v=(moments.v[0].astype(np.float64), *moments.v[1:]))),
        "finite": replace(
            state, siren=replace(network, weights=(network.weights[0] * np.nan, *network.weights[1:]))
        ),
        "step": replace(state, step=SMALL.steps + 1),
    }[part]


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("shape", r"parameter 5 'float32 \(4,\)': must be of shape \(3,\) and one float type"),
        ("type", "second moment 0 'float64"),
        ("finite", "parameter 0: must be finite"),
        ("step", "step 601: must be from 0 to 600"),
    ],
)
def test_states_are_checked(part: str, message: str) -> None:
    state = train.start(SMALL, Normalization(), "")
    train.check_state(state)
    with pytest.raises(InputError, match=message):
        train.check_state(broken(state, part))


# ---- integers --------------------------------------------------------------------------------------------


def test_a_recipe_of_integers_trains_the_same_floats() -> None:
    """To the bit: only what is made of them in the end differs; files of floats do not name it."""
    wanted = train.train(replace(SMALL, steps=3), PAIRS)
    found = train.train(replace(SMALL, steps=3, whole=127), PAIRS)
    assert tensors(found) == tensors(wanted)
    assert "whole" not in train.recipe_to_json(wanted.recipe)
    assert train.recipe_from_json(train.recipe_to_json(found.recipe)).whole == 127


@pytest.mark.parametrize("amplitude", whole.SINES)
def test_a_trained_network_loses_little_in_integers(amplitude: int) -> None:
    """On an unseen frame, against the floats, less than by rounding that sees no frames."""
    model = train.model_of(train.train(replace(SMALL, whole=amplitude), PAIRS), {"scene": "planes"})
    found = train.whole_of(model, PAIRS, amplitude)
    denoise.check_model(found)
    assert found.is_whole
    assert found.info["rounded_on_digest"] == model.info["data_digest"]
    assert found.info["scene"] == "planes"
    again = train.whole_of(model, PAIRS, amplitude)
    for a, b in zip(found.siren.weights, again.siren.weights, strict=True):
        assert np.array_equal(a, b)
    noisy, _ = pair(99)
    picture = denoise.denoise(model, noisy, np.float64)
    plain = replace(model, siren=whole.rounded(model.siren, 5, amplitude))
    near, far = (metrics.mse(denoise.denoise(m, noisy, np.float64), picture) for m in (found, plain))
    assert near < far


def test_training_does_not_begin_with_integers() -> None:
    first = siren.init(SMALL.layer_widths, SMALL.omega_0_first, SMALL.omega_0_hidden, 1)
    with pytest.raises(InputError, match="first network: is an integer network, and training needs floats"):
        train.start(SMALL, Normalization(), "", network=whole.rounded(first, 5))
