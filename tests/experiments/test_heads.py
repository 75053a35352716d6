"""The study of heads: what it computes by hand, and all of it at toy scale."""

from __future__ import annotations

import importlib
import json
from itertools import pairwise

import numpy as np
import pytest
from lab import frames
from packages import needed

from wamnet.refimpl.encoding import srgb_decode, srgb_encode
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.train import SHORT

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")

pytestmark = pytest.mark.apart


@pytest.fixture
def headed():
    """Give the module of heads, which needs PyTorch."""
    needed("torch")
    return importlib.import_module("baselines.headed")


def test_a_study_leaves_results_and_a_table(headed, tmp_path, monkeypatch, capsys):
    """A second run renders and trains nothing."""
    arguments = ["--scale", "toy", "--executor", "numpy", "-o", str(tmp_path), "--cache", str(tmp_path / "c")]
    arguments += ["--seeds", "0", "--scenes", "vitrine"]
    heads = importlib.import_module("heads")
    heads.main(arguments)
    table = (tmp_path / "table.md").read_text()
    assert table in capsys.readouterr().out
    assert len(table.splitlines()) >= 8
    kept = (tmp_path / "results.json").read_bytes()
    numbers = [v for r in json.loads(kept)["records"] for v in r["values"].values() if isinstance(v, float)]
    assert all(np.isfinite(numbers))
    monkeypatch.setattr(frames, "render_frame", None)
    heads.main(arguments)
    assert (tmp_path / "results.json").read_bytes() == kept


def test_no_head_has_too_many_parameters(headed):
    """The goal allows 100 thousand."""
    heads = importlib.import_module("heads")
    channels = {"around": 54, "around, light": 54}
    for name in heads.HEADS:
        head, window = heads.head_of(name, heads.FEATURES["first hit"]), SHORT.window.size**2
        n_in = window * 3 * (len(head.windows) + len(head.spread)) + sum(channels[p] for p in head.points)
        widths = (n_in, *SHORT.widths, head.outputs)
        assert sum((a + 1) * b for a, b in pairwise(widths)) <= 100_000, name


# ---- planes and heads --------------------------------------------------------------------------------------


def test_means_of_squares_are_means(headed):
    """Against sums of each square; float64 sums of 20 x 14 numbers below 1 round by less than 1e-12."""
    image = np.random.default_rng(3).random((14, 20, 3))
    found = headed.box_mean(image, 5)
    padded = np.pad(image, ((2, 3), (2, 3), (0, 0)), mode="edge")
    for y, x in ((0, 0), (7, 9), (13, 19)):
        assert np.abs(found[y, x] - padded[y : y + 5, x : x + 5].mean(axis=(0, 1))).max() <= 1e-12
    around = headed.around(image)
    assert around.shape == (14, 20, 2 * 9 * 3)
    # The middle one of the nine squares of 8 pixels is the square around the pixel itself.
    assert np.abs(srgb_decode(around[7, 9, 12:15]) - headed.box_mean(image, 8)[7, 9]).max() <= 1e-12


def test_colours_are_encoded_as_the_reference_does(headed):
    """Within float32, whose powers are off by some ulps; above white the curve continues."""
    torch = needed("torch")
    linear = np.linspace(0.0, 1.0, 257)
    values = headed.encoded(torch.tensor(linear)).numpy()
    assert np.abs(values - srgb_encode(linear)).max() <= 1e-12
    assert (
        np.abs(headed.decoded(torch.tensor(values)).numpy() - linear).max() <= 1e-7
    )  # the two limits differ
    assert headed.encoded(torch.tensor([2.0])).item() > 1.0


def test_windows_are_those_of_the_reference(headed):
    """The same numbers in the same order, at the border too."""
    image = np.random.default_rng(4).random((9, 11, 2)).astype(np.float32)
    data = headed.table([{"linear": image}], [np.zeros((9, 11, 3), np.float32)], ["linear"])
    y, x, none = np.array([0, 4, 8]), np.array([10, 5, 0]), np.zeros(3, np.int64)
    center, row = headed.places(data, none, y, x)
    got = data.planes["linear"][headed.taps(center, row, 4)].flatten(1).numpy()
    assert np.array_equal(got, dataset.windows_at(image, y, x, dataset.Window(4)))


def test_heads_that_know_the_answer_give_it(headed):
    """Light over albedo times albedo, weights that choose one tap, and nothing added, are the picture."""
    torch = needed("torch")
    rng = np.random.default_rng(5)
    linear, albedo = rng.random((4, 3)), rng.uniform(0.1, 1.0, (4, 3))
    at = {"solid": torch.tensor(albedo), "smooth": torch.tensor(srgb_encode(linear))}
    at["taps"] = torch.tensor(np.stack([linear, 0.0 * linear], axis=1))
    at["taps of light"] = at["taps"] / at["solid"][:, None]
    chosen = torch.tensor([[40.0, -40.0]]).expand(4, 2).double()
    light = torch.tensor(srgb_encode(linear / albedo * 2.0**headed.LIGHT_STOPS))
    wanted = srgb_encode(linear)
    for finish, outputs in (
        (headed.remodulated, light),
        (headed.added, torch.zeros(4, 3)),
        (headed.weighted, chosen),
        (headed.weighted_light, chosen),
    ):
        # Encoding and decoding part at the curve's join by 1e-7 of a value, as IEC 61966-2-1 rounds it.
        assert np.abs(finish(outputs, at).numpy() - wanted).max() <= 1e-6, finish
