"""Networks of experiments: trained once, and resumed after an interruption to the same bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lab import frames, training
from lab.frames import Shot

from wamnet.refimpl.network.dataset import Window
from wamnet.refimpl.network.train import SHORT, train

pytestmark = pytest.mark.nightly  # it runs with the experiments

RECIPE = replace(SHORT, features=("color",), window=Window(3), widths=(4,), batch=16, steps=6, log_every=2)


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    shot = Shot("cornell", size=8)
    made = [frames.noisy(shot), frames.reference(shot, 2)]
    return [tuple(frames.frames(tmp_path_factory.mktemp("frames"), made, "numpy"))]


def test_a_network_is_trained_once(tmp_path, pairs, monkeypatch):
    model, seconds = training.trained(RECIPE, pairs, tmp_path, "numpy")
    assert seconds > 0.0
    monkeypatch.setattr(training, "fit", None)  # training again would fail
    again, same = training.trained(RECIPE, pairs, tmp_path, "numpy")
    assert same == seconds
    assert np.array_equal(model.siren.weights[0], again.siren.weights[0])
    expected = train(RECIPE, pairs).siren
    assert all(np.array_equal(a, b) for a, b in zip(again.siren.weights, expected.weights, strict=True))


def test_other_recipes_and_data_have_other_files(tmp_path, pairs):
    names = {
        training.path_of(tmp_path, RECIPE, pairs, "numpy"),
        training.path_of(tmp_path, RECIPE, pairs, "opencl"),
        training.path_of(tmp_path, replace(RECIPE, seed=1), pairs, "numpy"),
        training.path_of(tmp_path, RECIPE, [*pairs, *pairs], "numpy"),
    }
    assert len(names) == 4


@pytest.mark.parametrize("done", [3, 6])
def test_an_interrupted_training_goes_on(tmp_path, pairs, done):
    from wamnet.cli.commands.train import checkpoint_path
    from wamnet.models.model_file import save_checkpoint

    path = training.path_of(tmp_path, RECIPE, pairs, "numpy")
    save_checkpoint(checkpoint_path(path), train(RECIPE, pairs, until=done))
    model, seconds = training.trained(RECIPE, pairs, tmp_path, "numpy")
    expected = train(RECIPE, pairs).siren
    assert all(np.array_equal(a, b) for a, b in zip(model.siren.weights, expected.weights, strict=True))
    assert seconds > 0.0
    assert not checkpoint_path(path).exists()


def test_pictures_are_the_network_s(tmp_path, pairs):
    model, _ = training.trained(RECIPE, pairs, tmp_path, "numpy")
    (picture,) = training.denoised(model, [pairs[0][0]], "numpy")
    assert picture.shape == (8, 8, 3)
