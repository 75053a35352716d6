"""The table of same bits: ways that agree, one that does not, and one that is not here."""

from __future__ import annotations

import numpy as np
import pytest
import same_bits
from same_bits import FULL, WHOLE, Way

from wamnet.compiler.model_file import save_model
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.network.dataset import Normalization, Window, n_inputs
from wamnet.refimpl.network.denoise import Model

FEATURES = ("color", "normal")


@pytest.fixture
def case(kit, tmp_path):
    """The folder of a small network's case, and the digest of its picture."""
    window = Window(3, "clamp")
    network = kit.network([n_inputs(FEATURES, window), 6, 3], (3.0, 3.0))
    model = Model(network, FEATURES, window, Normalization(), {"trained_on_scene": "lone_light"})
    save_model(tmp_path / "model.safetensors", model)
    return tmp_path, same_bits.made(tmp_path, tmp_path / "model.safetensors", "whole8", 6)


def numpy_way():
    return next(way for way in same_bits.WAYS if way.kind == "numpy")


def test_ways_that_agree(case):
    folder, digest = case
    found = same_bits.answer(numpy_way(), "plain", folder)
    assert found[WHOLE]["digest"] == digest
    assert (found[WHOLE]["differ"], found[FULL]["differ"]) == (0, 0)


def test_a_way_that_differs_is_named(case, monkeypatch, capsys):
    folder, digest = case

    def wrong(model, images, schedule):
        device, picture = numpy_way().run(model, images, schedule)
        picture = picture.copy()
        picture[2, 4, 1] += np.float32(2.0**-16)
        return device, picture

    way = Way("numpy", "wrong", wrong)
    found = same_bits.answer(way, "plain", folder)
    assert found[WHOLE]["first"].startswith("pixel (4, 2), channel 1: ")
    assert found[WHOLE]["differ"] == 1 / 108
    monkeypatch.setattr(same_bits, "WAYS", (way,))
    monkeypatch.setattr(same_bits, "asked", lambda number, schedule, folder: found)
    with pytest.raises(SystemExit, match="1"):
        same_bits.main(["--model", str(folder / "model.safetensors"), "--size", "6"])
    assert f"| {digest} | yes |" not in capsys.readouterr().out


def test_what_is_not_here_is_said(case, monkeypatch, capsys):
    folder, _ = case

    def missing(model, images, schedule):
        raise ExecutorUnavailable("no abacus")

    found = same_bits.answer(Way("numpy", "abacus", missing), "plain", folder)
    assert found == {"missing": "no abacus"}
    monkeypatch.setattr(same_bits, "asked", lambda number, schedule, folder: found)
    same_bits.main(["--model", str(folder / "model.safetensors"), "--size", "6", "--only", "numpy"])
    assert "| NOT HERE: no abacus |" in capsys.readouterr().out
