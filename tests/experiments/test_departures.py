"""Departures from the paper, measured: the choice of the spec is the reference's training, others differ."""

from __future__ import annotations

from dataclasses import replace

import departures
import numpy as np
import pytest
from departures import CHOICES, SCALES
from lab import frames
from lab.frames import Shot

from wamnet.refimpl.network import train
from wamnet.refimpl.network.denoise import denoise

TOY = SCALES["toy"]


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    return frames.pairs(tmp_path_factory.mktemp("frames"), [Shot("cornell", size=8)], 2, "numpy")


def test_what_is_decided_is_the_reference_s_training(pairs):
    recipe = replace(TOY.recipe, seed=3)
    found = departures.fit(recipe, pairs, CHOICES["as decided"])
    expected = train.model_of(train.train(recipe, pairs))
    assert all(np.array_equal(a, b) for a, b in zip(found.siren.weights, expected.siren.weights, strict=True))
    assert np.array_equal(
        departures.picture_of(found, pairs[0][0], CHOICES["as decided"]), denoise(expected, pairs[0][0])
    )


@pytest.mark.parametrize("name", [name for name in CHOICES if name not in ("as decided", "unclipped")])
def test_other_choices_give_other_networks(pairs, name):
    made = [[departures.encoded(frame, CHOICES[n]) for frame in pairs[0]] for n in ("as decided", name)]
    found, other = (
        departures.fit(TOY.recipe, [tuple(pair)], CHOICES[n])
        for n, pair in zip(("as decided", name), made, strict=True)
    )
    assert not np.array_equal(found.siren.weights[0], other.siren.weights[0])


def test_the_command_writes_a_table(tmp_path, capsys):
    arguments = ["--scale", "toy", "--seeds", "0", "1", "--executor", "numpy"]
    departures.main([*arguments, "-o", str(tmp_path / "out"), "--cache", str(tmp_path / "frames")])
    text = (tmp_path / "out/departures.md").read_text()
    assert text in capsys.readouterr().out
    lines = text.splitlines()
    assert len(lines) == 2 + len(CHOICES)
    assert lines[2].endswith("| 0.00 ± 0.00 |")
