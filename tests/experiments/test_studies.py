"""The paper's figures, lights, ablations, orientations, learning curve and flicker, each at toy scale.

Each runs as its command does, in this process: it must leave JSON, table and figures, and a second run must
neither render nor train anything again.
"""

from __future__ import annotations

import importlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from lab import frames, training
from lab.ground import PLANS, Ground, left_to_render, together, told
from lab.results import Results

from wamnet.models.data.geometry import ALIKE, Shown, compare
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.scenes import TURN_SECONDS, canonical
from wamnet.refimpl.light.variation import AT_REST, saturation_of
from wamnet.refimpl.network.train import PAPER, SHORT

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
pytest.importorskip("matplotlib", reason="matplotlib is not installed")

pytestmark = pytest.mark.apart  # plots and frames stay in memory

FIGURES = {
    "ablations": {"window.png", "width.png", "omega_0.png", "omega_0-first-layer.png", "frames.png"},
    "fig_prediction": {"prediction.png", "methods.png"},
    "flicker": {"flip.png", "rows.png"},
    "generalisation": {"orientations.png", "pictures.png"},
    "history": set(),
    "learning_curve": {"curve.png"},
    "losses": set(),
    "lights": {"psnr.png", "color.png", "a-on-b.png", "each-frame.png"},
}
"""The experiments, and figures that each must leave."""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A folder of frames and networks that all experiments of this module share."""
    return tmp_path_factory.mktemp("lab")


def run(name, folder, cache, *more):
    """Run an experiment at toy scale by the reference."""
    arguments = ["--scale", "toy", "--executor", "numpy", "-o", str(folder), "--cache", str(cache)]
    importlib.import_module(name).main([*arguments, "--seeds", "0", *more])


@pytest.mark.parametrize("name", FIGURES)
def test_an_experiment_leaves_results_table_and_figures(name, tmp_path, cache, monkeypatch, capsys):
    run(name, tmp_path, cache)
    table = (tmp_path / "table.md").read_text()
    assert table in capsys.readouterr().out
    assert len(table.splitlines()) >= 4
    assert FIGURES[name] <= {path.name for path in tmp_path.glob("*.png")}
    kept = (tmp_path / "results.json").read_bytes()
    numbers = [v for r in json.loads(kept)["records"] for v in r["values"].values() if isinstance(v, float)]
    assert all(np.isfinite(numbers))
    # Again, with what renders and trains taken away: nothing is done twice.
    for module, what in ((frames, "render_frame"), (training, "fit")):
        monkeypatch.setattr(module, what, None)
    run(name, tmp_path, cache)
    assert (tmp_path / "results.json").read_bytes() == kept
    assert (tmp_path / "table.md").read_text() == table


def test_an_interrupted_experiment_goes_on(tmp_path, cache, monkeypatch):
    """The second configuration is interrupted: the first one's record stays, and is not made again."""
    real, put = Results.put, []

    def interrupted(self, configuration, seed, values):
        if len(put) == 1:
            raise KeyboardInterrupt
        put.append(configuration)
        real(self, configuration, seed, values)

    with monkeypatch.context() as patch:
        patch.setattr(Results, "put", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run("flicker", tmp_path, cache)
    before = json.loads((tmp_path / "results.json").read_text())["records"]
    assert [record["configuration"] for record in before] == put
    run("flicker", tmp_path, cache)
    after = json.loads((tmp_path / "results.json").read_text())["records"]
    assert after[0] == before[0]
    assert len(after) > len(before)


def test_another_scale_s_results_are_refused(tmp_path, cache):
    Results.open(tmp_path / "results.json", "flicker", {"size": 128})
    with pytest.raises(InputError, match="belongs to flicker with settings"):
        run("flicker", tmp_path, cache)


# ---- what is compared -------------------------------------------------------------------------------------


def test_every_factor_changes_its_own_number_alone():
    ablations = importlib.import_module("ablations")
    changed = {}
    for factor in ablations.FACTORS:
        recipe = factor.change(SHORT, 3)
        names = [name for name in vars(recipe) if getattr(recipe, name) != getattr(SHORT, name)]
        changed[factor.name] = names
    assert changed == {
        "window": ["window"],
        "width": ["widths"],
        "depth": ["widths"],
        "omega_0": ["omega_0_hidden"],
        "omega_0, first layer": ["omega_0_first"],
        "windows": ["n_windows"],
        "frames": [],
        "features": ["features"],
    }
    assert ablations._depth(SHORT, 2).widths == (32, 32)
    assert ablations._width(SHORT, 8).widths == (8, 8, 8, 8)


@pytest.mark.parametrize("scale", ["small", "paper"])
def test_every_factor_has_the_preset_among_its_values(scale):
    """Else the lines of the factors would not meet."""
    ablations = importlib.import_module("ablations")
    plan = PLANS[scale]
    for factor in ablations.FACTORS:
        same = [factor.change(SHORT, value) == SHORT for value in factor.values[scale]]
        assert any(same), factor.name
    assert plan.adapt(SHORT, seed=3) == replace(SHORT, seed=3, steps=plan.steps, batch=plan.batch)


def test_light_sets_keep_the_brightness_and_differ():
    lights = importlib.import_module("lights")
    own = [light.color for light in canonical("minicubes").lights]
    assert lights.light_set(0) == AT_REST
    found = [lights.light_set(number).lights for number in (*range(1, 32), *range(1000, 1032), 5000, 5001)]
    low, high = lights.COLORS.saturation
    for colors in found:
        for color, before in zip(colors, own, strict=True):
            # A scaling and a sum of three: some roundings of numbers of that size.
            assert abs(sum(color) - sum(before)) <= 8 * np.finfo(float).eps * sum(before)
            # So is the saturation: a quotient of two of them.
            assert -8 * np.finfo(float).eps <= saturation_of(color) - low
            assert saturation_of(color) - high <= 8 * np.finfo(float).eps
    assert len(set(found)) == len(found)


@pytest.mark.parametrize("scale", ["small", "paper"])
def test_light_sets_of_tests_are_those_of_no_training(scale, tmp_path):
    lights = importlib.import_module("lights")
    ground = Ground(PLANS[scale], tmp_path, "numpy")
    tests = {shot.variation for shot in lights.recoloured(ground)}
    assert len(tests) == PLANS[scale].test_frames
    for count in lights.COUNTS[scale]:
        train = [shot.variation for shot in lights.trained_on(ground, count)]
        assert not tests & set(train)
        assert len(set(train)) <= (count or len(train))
    assert len(set(train)) == len(train), "each frame has colours of its own"


@pytest.mark.parametrize("count", [4, 16])
def test_light_sets_follow_no_pose(count):
    """Taken in a fixed order, every set was seen in only a few poses: both periods had a common factor.

    Drawn one by one, hardly a frame has the set that the fixed order would give it.
    """
    lights = importlib.import_module("lights")
    frames_each = lights.FRAMES * PLANS["small"].train_frames
    found = lights.numbers(count, frames_each)
    assert set(found) <= set(range(count))
    turns = sum(number == k % count for k, number in enumerate(found))
    # Binomial of 48 frames: 28 of 48 have a probability below 1e-6 for 4 sets, and far less for 16.
    assert turns < 28
    if count == 4:
        # A set that is seen fewer than 3 times has a probability below 1e-3 for all sets together.
        assert min(found.count(number) for number in range(count)) >= 3


def test_the_networks_of_lights_are_of_one_size():
    """Unseen colours are won by what the network sees, not by more parameters."""
    from wamnet.refimpl.network.dataset import channels_of

    inputs = importlib.import_module("lights").INPUTS
    assert (
        channels_of(inputs["unshadowed"]) == channels_of(inputs["short"]) == channels_of(inputs["both"]) - 3
    )
    assert inputs["paper"] == PAPER.features


def test_stops_grow_and_end_with_the_last_step():
    curve = importlib.import_module("learning_curve")
    assert curve.stops(1000) == [50, 100, 200, 400, 800, 1000]
    assert curve.stops(30) == [30]


def test_the_clock_of_training_stands_still_while_it_is_looked_at():
    """Each step takes 1 s and each look 100 s, by a clock of this test's own."""
    curve = importlib.import_module("learning_curve")
    now = 0.0

    def trainer(recipe, pairs, on_checkpoint, checkpoint_every):
        nonlocal now
        for step in range(1, recipe.steps + 1):
            now += 1.0
            if step % checkpoint_every == 0 or step == recipe.steps:
                on_checkpoint(State(step))

    def look(state):
        nonlocal now
        now += 100.0
        return {"psnr": float(state.step)}

    found = curve.follow(trainer, replace(SHORT, steps=130), [], look, lambda: now)
    assert [point["step"] for point in found] == [50, 100, 130]
    assert [point["seconds"] for point in found] == [50.0, 100.0, 130.0]
    assert curve.at(found, 60.0, "psnr") == 50.0
    assert curve.at(found, 10.0, "psnr") is None
    assert curve.at(found, 130.0, "psnr") is None


class State:
    """The only part of a training's state that is read here."""

    def __init__(self, step):
        self.step = step


def noise_seeds(shots):
    """Return the seeds of shots, or fail if two are the same."""
    seeds = [shot.seed for shot in shots]
    assert len(set(seeds)) == len(seeds)
    return set(seeds)


@pytest.mark.parametrize("scale", ["small", "paper"])
def test_kinds_of_frames_share_no_noise(scale, tmp_path):
    """All training and test shots of all studies have seeds of their own, below those of flicker."""
    generalisation, lights, ablations = map(
        importlib.import_module, ("generalisation", "lights", "ablations")
    )
    ground = Ground(PLANS[scale], tmp_path, "numpy")
    kinds = [generalisation.learned(ground, kind) for kind in ("one", "a range", generalisation.SOME_POSES)]
    kinds += generalisation.tests(ground, scale).values()
    kinds += [lights.trained_on(ground, 4), *ablations.glossy_shots(ground)]
    found = [noise_seeds(shots) for shots in kinds]
    assert sum(map(len, found)) == len(set().union(*found))
    assert max(set().union(*found)) < importlib.import_module("flicker").FIRST_SEED


def test_a_range_of_orientations_follows_no_pose(tmp_path):
    """Each frame draws its yaw independently: neither it nor the pose determines the other.

    Yaw and pose of n independent frames have a correlation of deviation 1 / sqrt(n - 1); at the significance
    of 1 % it stays below 2.58 of these.
    """
    generalisation = importlib.import_module("generalisation")
    ground = Ground(PLANS["small"], tmp_path, "numpy")
    shots = generalisation.learned(ground, generalisation.SEVERAL)
    yaws = [shot.variation.yaw_deg for shot in shots]
    low, high = generalisation.RANGE.yaw_deg
    assert len(set(yaws)) == len(shots)
    assert low <= min(yaws) < low / 2
    assert high / 2 < max(yaws) <= high
    poses = [shot.time % generalisation.PERIOD_S for shot in shots]
    assert abs(np.corrcoef(yaws, poses)[0, 1]) <= 2.58 / np.sqrt(len(shots) - 1)


def test_poses_held_out_are_in_no_quarter_of_the_training(tmp_path):
    generalisation = importlib.import_module("generalisation")
    period, learned = generalisation.PERIOD_S, generalisation.LEARNED_S
    train, test = generalisation.posed(0, 24, held_out=False), generalisation.posed(24, 6, held_out=True)
    assert {int(time // period) for time in train} == {0, 1, 2, 3}
    assert max(time % period for time in train) < learned
    assert learned <= min(time % period for time in test)
    assert all(0.0 <= time < TURN_SECONDS for time in (*train, *test))


def test_frames_of_all_tests_are_different_ones(tmp_path):
    """No test frame shows what a training frame or another test does, also not under other lamps."""
    generalisation, ablations = map(importlib.import_module, ("generalisation", "ablations"))
    ground = Ground(PLANS["small"], tmp_path, "numpy")
    tests = {
        where: shown(where, shots)
        for where, shots in generalisation.tests(ground, "small").items()
        if where in ("at 0", "at 24", f"at {generalisation.HELD_OUT}")
    }
    for kind in (generalisation.SEVERAL, generalisation.SOME_POSES):
        compare(shown(kind, generalisation.learned(ground, kind)), tests)
    found = compare(shown("train", ground.training_shots()), {"at 0": tests["at 0"]})
    assert found["at 0"].differing >= ALIKE
    train, test = ablations.glossy_shots(ground)
    assert compare(shown("glossy", train), {"test": shown("glossy test", test)})["test"].differing >= ALIKE


def shown(name, shots):
    """Return shots as they are compared."""
    return [Shown(f"{name} {k}", shot.time, shot.build()) for k, shot in enumerate(shots)]


def test_training_and_test_times_differ(tmp_path):
    ground = Ground(PLANS["small"], tmp_path, "numpy")
    train, test = ground.times()
    assert [shot.time for shot in ground.training_shots()] == train
    assert [shot.time for shot in ground.test_shots()] == test
    assert not set(train) & set(test)
    assert importlib.import_module("flicker").BEGIN_S not in train


# ---- what is kept, and what is said beforehand ------------------------------------------------------------


def test_scores_of_several_kinds_of_frames_stand_side_by_side():
    found = {"psnr": 2.0, "mse": 9.0, "per_frame": {"psnr": [1.0, 3.0]}}
    one, other = told(found, "at 4", ["psnr"]), told(found, "", ["psnr"])
    assert together(one, other, {"seconds": 5.0}) == {
        "psnr at 4": 2.0,
        "psnr": 2.0,
        "seconds": 5.0,
        "per_frame": {"psnr at 4": [1.0, 3.0], "psnr": [1.0, 3.0]},
    }


def test_a_study_says_what_is_left_before_it_begins(tmp_path, cache, capsys):
    """Neither frames that exist nor duplicates count."""
    fresh = Ground(PLANS["toy"], tmp_path, "numpy")
    shots = fresh.training_shots()
    assert left_to_render(fresh, [(shots, 2), (shots[:1], 2)]) == (4, 2 * 16 * 16 * (1 + 2))
    fresh.learned(shots)
    assert left_to_render(fresh, [(shots, 2)]) == (0, 0)
    run("losses", tmp_path / "losses", cache)
    assert "4 networks to train and judge" in capsys.readouterr().err
    run("losses", tmp_path / "losses", cache)
    assert "losses: 0 frames to render, about 0.0 min; 0 networks" in capsys.readouterr().err


def test_every_table_has_intervals_over_frames(tmp_path, cache):
    """Frames of one seed already give one: `mean [low, high]`."""
    run("losses", tmp_path, cache)
    row = (tmp_path / "table.md").read_text().splitlines()[2]
    assert re.fullmatch(r"\| MSE (\| \S+ \[\S+, \S+\] ){3}\| \S+ \|", row)
    record = json.loads((tmp_path / "results.json").read_text())["records"][0]
    each = record["values"]["per_frame"]
    assert {len(values) for values in each.values()} == {PLANS["toy"].test_frames}
    assert set(each) == {"psnr", "ssim", "flip"}
