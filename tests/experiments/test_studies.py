"""The paper's figures, lights, ablations, orientations, learning curve and flicker, each at toy scale.

Each runs as its command does, in this process: it must leave JSON, table and figures, and a second run must
neither render nor train anything again.
"""

from __future__ import annotations

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest
from lab import frames, training
from lab.ground import PLANS, Ground, together, told
from lab.results import Results

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.train import PAPER, SHORT

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
pytest.importorskip("matplotlib", reason="matplotlib is not installed")

FIGURES = {
    "ablations": {"window.png", "width.png", "omega_0.png", "omega_0-first-layer.png", "frames.png"},
    "fig_prediction": {"prediction.png", "methods.png"},
    "flicker": {"flip.png", "rows.png"},
    "generalisation": {"orientations.png", "pictures.png"},
    "learning_curve": {"curve.png"},
    "losses": set(),
    "lights": {"psnr.png", "color.png", "a-on-b.png", "2-sets.png"},
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
    with pytest.raises(InputError, match="it belongs to flicker with settings"):
        run("flicker", tmp_path, cache)


# ---- what is compared -------------------------------------------------------------------------------------


def test_every_factor_changes_its_own_number_alone():
    ablations = importlib.import_module("ablations")
    changed = {}
    for factor in ablations.FACTORS:
        recipe = factor.change(SHORT, 7)
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
    own = lights.light_set(0)
    found = [lights.light_set(number) for number in (*range(-6, 0), *range(1, 32))]
    for colors in found:
        for name, values in colors.items():
            # A scaling and a sum of three: some roundings of numbers of that size.
            assert abs(sum(values) - sum(own[name])) <= 8 * np.finfo(float).eps * sum(own[name])
            assert min(values) >= 0.0
    assert len({tuple(colors["warm"]) for colors in (own, *found)}) == len(found) + 1
    # The tests' sets are those of no training, also at the largest scale.
    assert lights.light_set(1) != lights.light_set(-1)
    assert all(count > 0 for counts in lights.COUNTS.values() for count in counts)


def test_the_networks_of_lights_are_of_one_size():
    """Unseen colours are won by what the network sees, not by more parameters."""
    from wamnet.refimpl.dataset import channels_of

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
    """The one thing of a training's state that is asked for here."""

    def __init__(self, step):
        self.step = step


def test_orientations_share_no_noise():
    """Shots of all orientations and kinds have seeds of their own."""
    module = importlib.import_module("generalisation")
    degrees = sorted({*module.SEVERAL_DEGREES, *module.TEST_DEGREES["paper"]})
    seeds = [module.seed_of(turned) for turned in degrees]
    frames_each = max(PLANS["paper"].test_frames, PLANS["paper"].train_frames)
    assert min(seeds) >= 500 + PLANS["paper"].test_frames
    assert len(set(seeds)) == len(seeds)
    assert max(seeds) + frames_each < 10_000


def test_training_and_test_times_differ(tmp_path):
    ground = Ground(PLANS["small"], tmp_path, "numpy")
    train, test = ground.times()
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
