"""`experiments/feature_rays.py` at toy scale: its rows, the scores of the separate way, times."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import feature_rays
import numpy as np
import pytest
from lab.scores import mean_scores, score

from wamnet.cli.commands.bench_frames import request_for
from wamnet.cli.common.inputs import load_model
from wamnet.models.data.frame_plan import KINDS, plan
from wamnet.refimpl.light.render import render
from wamnet.refimpl.network.denoise import denoise

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")


def test_one_ray_is_the_same_from_all_sources():
    assert feature_rays.ways((1, 4)) == [("net", 1), ("pcg4d", 4), ("net", 4)]


def test_scores_are_those_of_the_separate_way(executor_named):
    """Pictures of a pipeline and of the reference differ by rounding: 1e-3 dB, and less of SSIM and FLIP."""
    executor, model = executor_named("numpy"), load_model(Path("cornell"))
    request = request_for(model, "numpy", frames=1, test_frames=1, spp=1, test_spp=2, size_px=12)
    noisy, target = (plan(request)[1].pictures[kind] for kind in KINDS)
    reference = render(target.scene, target.job).frame["color"]
    with feature_rays.pipelines(executor, model, [noisy], 12, [("net", 3)]) as opened:
        found = feature_rays.scored(opened["net", 3], model, [noisy], [reference])
        times = feature_rays.timed(opened, 1)
    job = replace(noisy.job, feature_spp=3, feature_sampler="net")
    picture = denoise(model, render(noisy.scene, job).frame)
    wanted = mean_scores([score(picture, reference, exposure_stops=model.normalization.exposure_stops)])
    assert all(abs(found[name] - wanted[name]) <= 1e-3 for name in feature_rays.SHOWN)
    assert np.all(np.array(times["net", 3]) > 0.0)


def test_the_table(capsys):
    small = ("--frames", "1", "--size", "12", "--reference-spp", "2", "--time-size", "12", "--repeats", "1")
    feature_rays.main(["--executor", "numpy", "--rays", "1", "2", "--models", "cornell", *small])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("| features | PSNR, dB |")
    names = [line.split("|")[1].strip() for line in lines[2:]]
    assert names == ["cornell, 1 ray", "cornell, 2 rays of pcg4d", "cornell, 2 rays of net"]
