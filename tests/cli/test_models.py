"""The models that come with the package: whole, small, with recipe and scores, good on an unseen frame."""

import hashlib
import json

import numpy as np
import pytest

from wamnet import models
from wamnet.cli.common.inputs import load_model
from wamnet.cli.common.request import table
from wamnet.compiler.scenes.encode_kernel import sees
from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import ranges_from_json
from wamnet.refimpl.network.denoise import denoise, learned_shadow_rays
from wamnet.refimpl.network.train import recipe_from_json

NAMES = table()["names"]["models"].split(", ")

LARGEST_BYTES = 320_000
"""What a model in the package may take."""

ROWS = (116, 140)
"""Rows of a 256x256 frame that are rendered here: the size of the training, at a tenth of the time."""

BASIC = "-basic"
"""Ends the names of models that need colour, normal and albedo alone."""

LEAST_DB = {"minicubes": 28.0, "cornell": 33.0, "glossy": 22.0}
"""PSNR against references of 64 samples, whose own noise is at 31 dB (minicubes), 37 (cornell) and 30
(glossy): with errors of 35, 46 and 30 dB beside it 29.5, 36.5 and 27, and windows that end at the band,
which has more edges and mirrors than the picture, cost some of it."""

UNSEEN_S = 1.1
"""A time between two training times, which are 0.125 s apart."""


def test_names_in_the_help_are_those_of_the_files():
    assert sorted(NAMES) == models.names()


def test_digests_are_noted():
    lines = (models.FOLDER / "SHA256SUMS").read_text().splitlines()
    noted = {name: digest for digest, name in (line.split() for line in lines)}
    found = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in models.FOLDER.glob("*.safetensors")}
    assert noted == found


@pytest.mark.parametrize("name", NAMES)
def test_a_model_says_what_it_is(name):
    """Small, the network of its recipe, its scene, its scores beside another denoiser's."""
    path = models.path(name)
    assert path.stat().st_size < LARGEST_BYTES
    model = load_model(path)
    recipe = recipe_from_json(model.info["recipe"])
    assert model.siren.widths == recipe.layer_widths
    assert 31_000 <= sum(a.size for a in (*model.siren.weights, *model.siren.biases)) <= 75_000
    assert model.info["trained_on_scene"] == name.removesuffix(BASIC)
    assert (model.features == ("color", "normal", "albedo")) == name.endswith(BASIC)
    assert model.info["trained_on_feature_spp"] == "16"
    assert recipe.steps == int(model.info["steps_done"])
    scores = json.loads(model.info["scores"])
    assert scores["16 rays"]["psnr"] > scores["input"]["psnr"]
    assert "Open Image Denoise, 16 rays" in scores
    assert str(UNSEEN_S) not in model.info.get("trained_on_time", "").split(", ")


@pytest.mark.parametrize("name", NAMES)
def test_a_model_says_its_ranges(name):
    """Camera and time, for the page the lamps too; each frame's own draw is not among the facts."""
    info = load_model(models.path(name)).info
    ranges = ranges_from_json(info["trained_on_ranges"])
    assert ranges.yaw_deg[0] <= -24.0
    assert ranges.yaw_deg[1] >= 24.0
    assert (ranges.saturation is not None) == (name == "minicubes")
    assert "trained_on_yaw_deg" not in info
    assert "trained_on_lights" not in info


@pytest.mark.nightly(but="minicubes-basic")
@pytest.mark.parametrize("name", NAMES)
def test_a_model_denoises_an_unseen_frame(name):
    """A band of rows, at a time and with noise that training had none of."""
    scene = canonical(name.removesuffix(BASIC), time=UNSEEN_S)
    model = load_model(models.path(name))
    rays = {"feature_spp": 16, "shadow_rays": learned_shadow_rays(model), "seen": sees(model.features)}
    job = Job(256, 256, seed=990, **rays)
    noisy = render(scene, job, rows=ROWS).frame
    target = to_display(render(scene, Job(256, 256, 64, seed=991), rows=ROWS).frame["color"])
    found = metrics.psnr(denoise(model, noisy), target)
    assert found >= LEAST_DB[name.removesuffix(BASIC)]
    # The features matter: without normals, and the light that follows from them, the network is far off;
    # less so where the first hit's normals say little, as in mirrors.
    guides = {"normal", "direct", "seen_normal", "seen_direct"}
    unseen = guides & set(model.features)
    blind = {**noisy.layers, **{name: np.zeros_like(noisy[name]) for name in unseen}}
    least = 1.0 if name == "glossy-basic" else 2.0
    assert metrics.psnr(denoise(model, Frame(blind)), target) <= found - least
