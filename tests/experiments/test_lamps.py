"""The study of lamps: two renders that give each lamp's light, colours for pixels, and all at toy scale."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest
from lab import frames
from lab.ground import PLANS, Ground
from packages import needed

from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Variation, saturation_of, varied

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")

pytestmark = pytest.mark.apart


@pytest.fixture
def networks():
    """Give the module of networks, which needs PyTorch."""
    needed("torch")
    return importlib.import_module("baselines.lamp_network")


def test_a_study_leaves_results_and_a_table(networks, tmp_path, monkeypatch, capsys):
    """A second run renders and trains nothing."""
    arguments = ["--scale", "toy", "--executor", "numpy", "-o", str(tmp_path), "--cache", str(tmp_path / "c")]
    arguments += ["--seeds", "0"]
    lamps = importlib.import_module("lamps")
    lamps.main(arguments)
    table = (tmp_path / "table.md").read_text()
    assert table in capsys.readouterr().out
    assert len(table.splitlines()) >= 5
    kept = (tmp_path / "results.json").read_bytes()
    numbers = [v for r in json.loads(kept)["records"] for v in r["values"].values() if isinstance(v, float)]
    assert all(np.isfinite(numbers))
    monkeypatch.setattr(frames, "render_frame", None)
    lamps.main(arguments)
    assert (tmp_path / "results.json").read_bytes() == kept


def test_two_renders_give_each_lamp_s_light():
    """Any colours of the same sums give the very picture from both lights: the paths are the same.

    To float32's rounding (u = 6e-8) of sums over 5 bounces, times the norm of the equations' inverses, 4.
    """
    lamps = importlib.import_module("lamps")
    cubes, job = canonical("minicubes", time=0.4), Job(12, 12, 4, 3)

    def picture(colors):
        return render(varied(cubes, Variation(lights=colors)), job).frame["color"]

    lights = lamps.apart(*(picture(colors) for colors in lamps.UNDER))
    colors = ((1.0, 1.75, 0.25), (0.75, 1.25, 1.0))
    want = picture(colors)
    assert np.abs(lamps.under(lights, colors) - want).max() <= 1e-5 * want.max()


def test_colours_drawn_for_pixels_are_lamps_colours(networks):
    """Saturations in the range, brightness the lamps' own: float32's rounding is 1e-6 at most."""
    torch = needed("torch")
    lamps = importlib.import_module("lamps")
    colors = (
        networks.drawn_colors(300, torch.Generator().manual_seed(1), lamps.COLORS).numpy().astype(np.float64)
    )
    low, high = lamps.COLORS.saturation
    for k, light in enumerate(canonical("minicubes").lights):
        assert np.abs(colors[:, k].sum(axis=-1) / sum(light.color) - 1.0).max() <= 1e-6
        found = [saturation_of(color) for color in colors[:, k]]
        assert low - 1e-6 <= min(found) < 0.4
        assert 0.8 < max(found) <= high + 1e-6
        assert set(np.argmax(colors[:, k], axis=-1)) == {0, 1, 2}


def test_powers_drawn_for_pixels_are_factors_of_the_lamps_own(networks):
    """Colours with a range of power: the same hues from the same seed, times factors that fill the range."""
    torch = needed("torch")
    lamps = importlib.import_module("lamps")
    plain, powered = (
        networks.drawn_colors(300, torch.Generator().manual_seed(2), ranges).numpy().astype(np.float64)
        for ranges in (lamps.COLORS, lamps.POWERS)
    )
    factors = powered / plain
    # Three roundings of float32 to either side.
    assert np.ptp(factors, axis=-1).max() <= 6 * np.finfo(np.float32).eps * 2.0
    low, high = lamps.POWERS.power
    slack = 6 * np.finfo(np.float32).eps * high  # the same roundings
    assert low - slack <= factors.min() < 0.3
    assert 1.9 < factors.max() <= high + slack


def test_frames_of_both_studies_share_no_noise(tmp_path):
    """Neither with each other nor with the other studies."""
    heads, lamps, ablations, lights = map(importlib.import_module, ("heads", "lamps", "ablations", "lights"))
    ground = Ground(replace(PLANS["small"], size=16), tmp_path, "numpy")
    kinds = [*lamps.shots_of(ground), *heads.shots_of(ground, "glossy"), *ablations.glossy_shots(ground)]
    kinds += [lights.trained_on(ground, 4)]
    seeds = [shot.seed for shots in kinds for shot in shots]
    assert len(set(seeds)) == len(seeds)
    assert max(seeds) < importlib.import_module("flicker").FIRST_SEED
