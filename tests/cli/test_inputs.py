"""Tests of what commands say of wrong inputs: folders, checkpoints, missing layers, invalid numbers."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wamnet import models
from wamnet.cli.common import inputs
from wamnet.cli.files import exr
from wamnet.compiler.scenes.encode_kernel import feature_rays
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.variation import Ranges, lamp_color


@pytest.fixture
def here(samples, tmp_path):
    """Put the sample frames and the model into the working folder."""
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_numbers_must_be_finite(refused, here, value) -> None:
    """A time, a parameter, an exposure; said before anything is rendered or overwritten."""
    (here / "minicubes.exr").write_text("precious")
    small = ["minicubes", "--width", 4, "--height", 3]
    assert "--time " in refused("render", *small, f"--time={value}")
    assert f"--set 'albedo={value}': must have finite numbers" in refused(
        "render", *small, "--set", f"albedo={value}"
    )
    assert "must have finite numbers" in refused("scene", "minicubes", "--set", f"warm=1,{value},1")
    for command in (["render", *small, "-o", "a.png"], ["compare", "noisy.exr", "reference.exr"]):
        for exposure in (value, 65):
            assert "must be from -64 to 64 stops" in refused(*command, f"--exposure={exposure}")


def test_a_folder_is_no_input(refused, here) -> None:
    """It is said that it is one, for frames, pictures and scenes."""
    (here / "dir.exr").mkdir()
    (here / "dir").mkdir()
    text = "is a folder (give the name of a file in it"
    assert f"input file 'dir.exr': {text}" in refused("denoise", "model.safetensors", "dir.exr")
    assert f"input file 'dir': {text}" in refused("compare", "dir", "noisy.exr")
    assert "is a folder" in refused("denoise", "dir", "noisy.exr")
    assert "is neither a canonical scene nor a scene file" in refused("render", "dir")


def test_a_checkpoint_is_no_model(wamnet, refused, here) -> None:
    """The model beside it is named."""
    pair = ["-i", "noisy.exr", "-t", "reference.exr", "--features", "color", "--steps", 2]
    assert wamnet("train", *pair, "-o", "m.safetensors").status == 0
    text = (
        "m.checkpoint.safetensors': is a checkpoint of training, not a model (give the model next to it: m."
    )
    assert text in refused("denoise", "m.checkpoint.safetensors", "noisy.exr")
    assert text in refused("compile", "m.checkpoint.safetensors", "--target", "glsl")


def test_a_missing_layer_names_the_file(refused, here) -> None:
    """The way out fits the command: a trained model cannot see something else."""
    exr.write_frame(here / "flat.exr", Frame({"color": np.zeros((12, 13, 3))}))
    line = refused("denoise", "model.safetensors", "flat.exr")
    assert (
        "flat.exr: list of layers 'color': normal must be among them, because the model was trained" in line
    )
    assert "features" not in line
    line = refused("denoise", "minicubes", "noisy.exr")
    assert "direct must be among them" in line
    assert "--shadow-rays 1, or shadow_rays=1; bundled models named -basic do without it" in line
    line = refused("train", "-i", "flat.exr", "-t", "reference.exr", "--features", "color,normal")
    assert "flat.exr: list of layers 'color': normal must be among them" in line
    assert "--features" in line


@pytest.mark.parametrize("command", [["denoise", "model.safetensors", "noisy.exr"], ["render", "minicubes"]])
def test_a_name_that_no_file_system_takes(refused, here, monkeypatch, command) -> None:
    """It is found before the work."""

    def never(*_args: object, **_options: object) -> None:
        raise AssertionError("this is the work")

    monkeypatch.setattr("wamnet.kernels.run.denoise_on.denoise_on", never)
    monkeypatch.setattr("wamnet.kernels.run.render_frame.render_parallel", never)
    line = refused(*command, "-o", "n" * 300 + ".exr")
    assert "cannot be written: File name too long (" in line


def test_models_have_names(samples, monkeypatch, tmp_path, capsys) -> None:
    """A file that is there comes first; then a name, with a prefix or not; else the names are listed.

    A folder of that name hides nothing.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(models, "FOLDER", tmp_path / "along")
    (tmp_path / "along").mkdir()
    shutil.copy(samples / "model.safetensors", tmp_path / "along" / "cubes.safetensors")
    assert models.names() == ["cubes"]
    for name in ("cubes", "model:cubes"):
        assert inputs.model_path(Path(name)) == tmp_path / "along" / "cubes.safetensors"
        assert inputs.load_model(Path(name)).features == ("color", "normal")
    (tmp_path / "cubes").mkdir()
    assert inputs.model_path(Path("cubes")) == tmp_path / "along" / "cubes.safetensors"
    assert "cubes/ is a folder, not a model" in capsys.readouterr().err
    (tmp_path / "cubes").rmdir()
    (tmp_path / "cubes").touch()
    assert inputs.model_path(Path("cubes")) == Path("cubes")
    assert inputs.model_path(Path("cubes.safetensors")) == Path("cubes.safetensors")
    text = r"model 'spheres': not found \(.*cubes, or give a \.safetensors file"
    with pytest.raises(InputError, match=text):
        inputs.model_path(Path("spheres"))


@pytest.mark.parametrize(
    ("trained", "shown", "told"),
    [
        ({}, {"scene": "cornell", "spp": "1"}, []),
        ({"scene": "cornell"}, {}, []),
        ({"scene": "cornell"}, {"scene": "cornell", "spp": "1"}, []),
        ({"scene": "cornell, empty"}, {"scene": "empty", "spp": "1"}, []),
        ({"scene": "cornell"}, {"scene": "empty", "spp": "1"}, ["it shows empty, but the model was trained"]),
        (
            {"scene": "empty", "feature_spp": "16"},
            {"scene": "empty", "spp": "1"},
            ["its features are of --feature-spp 1, those of the training of 16"],
        ),
        # Four rays that are spread stand for sixteen at random, but not the other way round.
        (
            {"scene": "empty", "feature_spp": "16"},
            {"scene": "empty", "spp": "1", "feature_spp": "4", "feature_sampler": "net"},
            [],
        ),
        (
            {"scene": "empty", "feature_spp": "16"},
            {"scene": "empty", "spp": "1", "feature_spp": "3", "feature_sampler": "net"},
            ["its features are of --feature-spp 3, those of the training of 16"],
        ),
        (
            {"scene": "empty", "feature_spp": "4", "feature_sampler": "net"},
            {"scene": "empty", "spp": "1", "feature_spp": "4"},
            ["its features are of --feature-spp 4 at random, those of the training of 4"],
        ),
        (
            {"scene": "empty"},
            {"scene": "cornell", "spp": "1", "feature_spp": "4"},
            ["it shows cornell", "its features are of --feature-spp 4, those of the training of 1"],
        ),
    ],
)
def test_frames_unlike_those_of_the_training(samples, trained, shown, told) -> None:
    """What is known of both is compared."""
    model = load_model(samples / "model.safetensors")
    model = replace(model, info={f"trained_on_{name}": value for name, value in trained.items()})
    found = inputs.unlike_training(model, shown)
    assert len(found) == len(told)
    assert all(text.startswith(begin) for text, begin in zip(found, told, strict=True))


def test_rays_that_stand_for_those_of_the_training(samples) -> None:
    """RND-2d: the root of so many at random, rounded up; as many where they were spread too."""
    model = load_model(samples / "model.safetensors")

    def rays(**facts: str) -> int:
        return feature_rays(replace(model, info={f"trained_on_{k}": v for k, v in facts.items()}))

    assert [rays(feature_spp=str(n)) for n in (1, 2, 4, 5, 16, 17)] == [1, 2, 2, 3, 4, 5]
    assert rays(feature_spp="6", feature_sampler="net") == 6
    assert rays() == 0


RANGES = Ranges((0.0, 6.0), (-24.0, 24.0), (-8.0, 8.0), (0.9, 1.1), (0.0, 0.5))


@pytest.mark.parametrize(
    ("shown", "told"),
    [
        ({}, []),
        ({"yaw_deg": "24.0", "pitch_deg": "-8.0", "distance": "1.1", "time": "13.0"}, []),
        ({"yaw_deg": "40.0"}, ["the camera's yaw is 40° (learned: -24° to 24°)"]),
        ({"time": "7.0", "pitch_deg": "-9.0"},
         ["the time is 7 s (learned: 0 s to 6 s)", "the camera's pitch is -9° (learned: -8° to 8°)"]),
        ({"lights": json.dumps([lamp_color(scenes.WARM, 0.3, 0.7), scenes.COOL])},
         ["the saturation of lamp 1 is 0.70 (learned: 0.00 to 0.50)"]),
    ],
    ids=str,
)  # fmt: skip
def test_frames_outside_of_the_ranges_of_the_training(samples, shown, told) -> None:
    """One sentence names all; the scene's own lamps are inside, whatever their saturation."""
    model = load_model(samples / "model.safetensors")
    learned = {"trained_on_scene": "minicubes", "trained_on_ranges": RANGES.to_json()}
    own = {"scene": "minicubes", "lights": json.dumps([scenes.WARM, scenes.COOL])}
    found = inputs.unlike_training(replace(model, info=learned), {**own, **shown})
    assert found == [f"outside the training ranges: {', '.join(told)}; expect errors"][: len(told)]
    assert inputs.unlike_training(model, {**own, **shown}) == [], "a model without ranges says nothing"
    other = inputs.unlike_training(replace(model, info=learned), {**own, **shown, "scene": "cornell"})
    assert [text.split(",")[0] for text in other] == ["it shows cornell"], "ranges are of its own scenes"


def test_ranges_that_are_none_are_refused(refused, here) -> None:
    model = load_model(here / "model.safetensors")
    save_model(here / "odd.safetensors", replace(model, info={"trained_on_ranges": "{"}))
    said = refused("denoise", "odd.safetensors", "noisy.exr")
    assert "ranges '{': is not acceptable JSON" in said
    assert "make the data set" in said


def test_a_frame_outside_of_the_ranges_is_denoised_with_a_warning(wamnet, here) -> None:
    model = load_model(here / "model.safetensors")
    learned = {"trained_on_scene": "minicubes", "trained_on_ranges": RANGES.to_json()}
    save_model(here / "narrow.safetensors", replace(model, info=learned))
    small = ("render", "minicubes", "--width", 8, "--height", 8)
    for yaw, told in ((24, []), (25, ["the camera's yaw is 25° (learned: -24° to 24°)"])):
        assert wamnet(*small, "--yaw", yaw, "-o", "frame.exr").status == 0
        outcome = wamnet("denoise", "narrow.safetensors", "frame.exr")
        assert outcome.status == 0
        warned = [line for line in outcome.out.splitlines() if "outside the training" in line]
        wanted = [f"frame.exr: outside the training ranges: {text}; expect errors" for text in told]
        assert warned == wanted


def test_a_frame_of_another_scene_is_denoised_with_a_warning(wamnet, here) -> None:
    model = load_model(here / "model.safetensors")
    save_model(here / "other.safetensors", replace(model, info={"trained_on_scene": "cornell"}))
    outcome = wamnet("denoise", "other.safetensors", "noisy.exr")
    assert outcome.status == 0
    assert "noisy.exr: it shows minicubes, but the model was trained only on cornell" in outcome.out
    assert (here / "denoised.png").exists()
