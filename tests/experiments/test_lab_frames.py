"""Frames of experiments: rendered once, verified, and never mixed up."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from lab import frames
from lab.frames import Shot

from wamnet.kernels.run import render_on
from wamnet.models.data.frame_plan import version
from wamnet.refimpl.frame import FIRST_HIT, USUAL
from wamnet.refimpl.light import render as driver
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scene import scene_digest
from wamnet.refimpl.light.scenes import canonical

pytestmark = pytest.mark.nightly  # it runs with the experiments

SHOT = Shot("minicubes", time=1.0, size=8, spp=2, seed=3)


def test_a_frame_is_the_reference_s(tmp_path):
    (found,) = frames.frames(tmp_path, [SHOT], "numpy")
    expected = render(canonical("minicubes", time=1.0), Job(8, 8, 2, 3)).frame
    assert found.info["time"] == "1.0"
    for name, values in expected.layers.items():
        assert np.array_equal(found[name], values)


def test_a_frame_is_rendered_once(tmp_path, monkeypatch):
    first = frames.render_all(tmp_path, [SHOT, SHOT], "numpy")
    assert first[0] == first[1]
    monkeypatch.setattr(frames, "render_frame", None)  # a second rendering would fail
    assert frames.render_all(tmp_path, [SHOT], "numpy") == first[:1]


def test_a_damaged_frame_is_rendered_again(tmp_path):
    (path,) = frames.render_all(tmp_path, [SHOT], "numpy")
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    assert frames.find(tmp_path, SHOT, "numpy") is None
    (again,) = frames.render_all(tmp_path, [SHOT], "numpy")
    assert again.read_bytes() == whole


def test_an_interrupted_run_keeps_what_was_done(tmp_path, monkeypatch):
    other, real = replace(SHOT, seed=4), frames.render_frame

    def interrupted(executor, scene, job, **options):
        if job.seed == other.seed:
            raise KeyboardInterrupt
        return real(executor, scene, job, **options)

    monkeypatch.setattr(frames, "render_frame", interrupted)
    with pytest.raises(KeyboardInterrupt):
        frames.render_all(tmp_path, [SHOT, other], "numpy")
    assert frames.find(tmp_path, SHOT, "numpy") is not None
    assert frames.find(tmp_path, other, "numpy") is None


@pytest.mark.parametrize(
    "change",
    [
        {"time": 1.5},
        {"size": 9},
        {"spp": 3},
        {"seed": 4},
        {"scene": "cornell"},
        {"seen": True},
    ],
    ids=str,
)
def test_another_shot_has_another_file(tmp_path, change):
    assert frames.path_of(tmp_path, replace(SHOT, **change), "numpy") != frames.path_of(
        tmp_path, SHOT, "numpy"
    )


def test_a_new_layer_makes_new_files(tmp_path, monkeypatch):
    before = frames.path_of(tmp_path, SHOT, "numpy")
    monkeypatch.setattr(driver, "USUAL", (*driver.USUAL, "another"))
    assert frames.path_of(tmp_path, SHOT, "numpy") != before


def test_noisy_frame_and_reference_share_no_random_numbers(tmp_path):
    shots = [replace(SHOT, seed=seed) for seed in range(4)]
    seeds = [make.seed for shot in shots for make in (frames.noisy(shot), frames.reference(shot, 8))]
    assert len(set(seeds)) == len(seeds)
    dirty, clean = frames.frames(tmp_path, [frames.noisy(SHOT), frames.reference(SHOT, 4)], "numpy")
    assert (dirty.info["spp"], clean.info["spp"]) == ("1", "4")


def test_shots_that_differ_in_numbers_share_a_kernel(tmp_path, executor_named, monkeypatch):
    """Compiling one for each took longer than tracing them; pictures are those of a kernel of constants."""
    executor_named("opencl")
    compiled, real = [], render_on.compile_path

    def counted(*given, **options):
        compiled.append(given)
        return real(*given, **options)

    shots = [Shot("cornell", time=time, size=6, seed=4) for time in (0.5, 1.0, 1.5)]
    alone = [frames.frames(tmp_path / "alone", [shot], "opencl")[0] for shot in shots]
    monkeypatch.setattr(render_on, "compile_path", counted)
    together = frames.frames(tmp_path / "together", shots, "opencl")
    assert len(compiled) == 1
    for one, other in zip(alone, together, strict=True):
        # Constants are folded in float64, inputs are not: features of first hits differ by some ulps.
        assert np.abs(one["normal"] - other["normal"]).max() <= 16 * np.finfo(np.float32).eps


def test_what_a_denoiser_of_first_hits_is_given_past_mirrors():
    """Layers keep their names, colour stays."""
    shot = Shot("glossy", size=6, seed=4, seen=True)
    found = render(shot.build(), shot.job).frame
    named = frames.past_mirrors(found)
    assert np.array_equal(named["color"], found["color"])
    assert all(np.array_equal(named[first], found[seen]) for seen, first in FIRST_HIT.items())
    assert not np.array_equal(named["position"], found["position"])


def test_a_colour_that_is_there_gets_other_features(tmp_path):
    """The frame is that of rendering both; only the features' rays are traced again."""
    shot = Shot("cornell", size=6, seed=4)
    (plain,) = frames.frames(tmp_path, [shot], "numpy")
    (found,) = frames.frames(tmp_path, [replace(shot, feature_spp=5)], "numpy")
    want = render(shot.build(), Job(6, 6, seed=4, feature_spp=5, feature_sampler="pcg4d")).frame
    assert all(np.array_equal(found[name], want[name]) for name in want.layers)
    assert found.info == want.info
    assert not np.array_equal(found["normal"], plain["normal"])
    assert frames.reference(replace(shot, feature_spp=5), 8) == frames.reference(shot, 8)


def test_names_without_features_of_their_own_are_the_older_ones(tmp_path):
    """Folders that were filled before there were any are still good."""
    shot = Shot("cornell", size=6, seed=4)
    names = {frames.path_of(tmp_path, replace(shot, feature_spp=rays), "numpy") for rays in (0, 5, 16)}
    assert len(names) == 3
    job = {**asdict(shot.job)}
    for later in ("feature_spp", "feature_sampler", "seen", "color", "shadow_rays"):
        del job[later]
    made_from = [scene_digest(shot.build()), job, "numpy", sorted(USUAL), version()]
    digest = hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()
    assert any(name.name.endswith(digest[:16]) for name in names)
