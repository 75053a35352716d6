"""Tests of what the commands say of frames that a model has not learned, and of foreign ones they refuse."""

import shutil
from dataclasses import replace

import pytest

from wamnet.cli.common.domain import Watch
from wamnet.cli.files import exr
from wamnet.kernels.run.trainer import facts_of, with_domain
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.network import domain

LEARNED = 10
"""Frames that the model has learned: one more than a domain needs."""

SIZE = (13, 12)
"""Width and height of all frames, in pixels."""

BEYOND = "outside the model's domain: distance "


def shot(time: float, scene: str = "minicubes") -> Frame:
    """Return a frame of a canonical scene."""
    return render(canonical(scene, time=time), Job(*SIZE, 1, round(10 * time))).frame


@pytest.fixture(scope="module")
def stating(samples, tmp_path_factory):
    """Return a folder with a model that states its domain, and with frames inside and outside."""
    folder = tmp_path_factory.mktemp("domain")
    pairs = [(frame, frame) for frame in (shot(0.8 * k) for k in range(LEARNED))]
    model = with_domain(load_model(samples / "model.safetensors"), pairs)
    save_model(folder / "m.safetensors", replace(model, info={**model.info, **facts_of(pairs)}))
    own, other = shot(0.5), shot(0.5, "cornell")
    exr.write_frame(folder / "own.exr", own)
    exr.write_frame(folder / "cornell.exr", other)
    exr.write_frame(folder / "foreign.exr", Frame(own.layers))
    flipped = {**own.layers, "normal": -own["normal"]}
    exr.write_frame(folder / "flipped.exr", Frame(flipped))
    return folder


@pytest.fixture
def here(stating, tmp_path):
    """Put model and frames into the working folder."""
    shutil.copytree(stating, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_one_sentence_says_all(wamnet, here) -> None:
    """Another scene of our own: its distance, the channel, and what is known by name; it is denoised."""
    outcome = wamnet("denoise", "m.safetensors", "cornell.exr")
    assert outcome.status == 0
    model = load_model(here / "m.safetensors")
    found = domain.measure_frame(domain.of_model(model), model, exr.read_frame(here / "cornell.exr"))
    (line,) = [line for line in outcome.out.splitlines() if BEYOND in line]
    assert f"distance {found.distance:.3g}, threshold {found.threshold:.3g} (1 in 11 frames" in line
    assert f"farthest off is the {found.statistic} of {found.channel}: {found.value:.3g}, in" in line
    assert line.endswith(
        "; it shows cornell, but the model was trained only on minicubes: expect a poor image"
    )
    assert outcome.out.count("it shows cornell") == 1


def test_a_foreign_frame_outside_is_refused(wamnet, refused, here) -> None:
    """Normals of another sign: nothing is written, and the way out works."""
    line = refused("denoise", "m.safetensors", "flipped.exr")
    assert "flipped.exr: distance from the model's domain 2" in line
    assert "of this frame it reads color, normal; farthest off is the mean of normal" in line
    assert "give --anyway" in line
    outcome = wamnet("denoise", "m.safetensors", "flipped.exr", "--anyway")
    assert outcome.status == 0
    assert BEYOND in outcome.out
    assert (here / "denoised.png").exists()


@pytest.mark.parametrize("text", ["{}", "[", '{"features": ["color"]}'])
def test_a_domain_that_cannot_be_read(refused, here, text) -> None:
    model = load_model(here / "m.safetensors")
    save_model(here / "m.safetensors", replace(model, info={domain.DOMAIN: text}))
    assert "domain" in refused("denoise", "m.safetensors", "own.exr")


def test_a_model_without_a_domain_watches_nothing(samples, tmp_path) -> None:
    watch = Watch(load_model(samples / "model.safetensors"))
    watch.see_frame("a", shot(0.0))
    watch.see_images("a", {})
    watch.report(tmp_path)
    assert (watch.features, watch.pictures) == ((), [])


def test_training_states_the_domain(wamnet, here) -> None:
    """Of ten frames a domain, of one none; the network is the same."""
    named = [option for _ in range(LEARNED) for option in ("-i", "own.exr", "-t", "own.exr")]
    short = ("--features", "color,normal", "--steps", 1)
    outcome = wamnet("train", *named, *short, "-o", "ten.safetensors")
    found = domain.of_model(load_model(here / "ten.safetensors"))
    assert found is not None
    assert f"domain is that of 10 frames, up to distance {found.threshold:.3g}; of frames" in outcome.out
    assert (found.frames, found.features) == (LEARNED, ("color", "normal"))
    assert wamnet("train", *named[:4], *short, "-o", "one.safetensors").status == 0
    assert domain.DOMAIN not in load_model(here / "one.safetensors").info
