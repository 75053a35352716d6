"""Tests of `wamnet train`: the reference's model, checkpoints, resuming to the same bits, refusals."""

import json
import shutil

import numpy as np
import pytest

from wamnet.cli.commands import train
from wamnet.cli.files import exr
from wamnet.kernels import train_on
from wamnet.models.model_file import load_checkpoint, load_model
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import train as reference


@pytest.fixture
def pair(samples, tmp_path) -> list[str]:
    """Put the sample pair into the working folder and return the options that name it."""
    for name in ("noisy.exr", "reference.exr"):
        shutil.copy(samples / name, tmp_path / name)
    return ["-i", "noisy.exr", "-t", "reference.exr", "--features", "color,normal"]


def test_the_model_is_the_references(wamnet, pair, tmp_path) -> None:
    """Preset and choices are passed on; the model says what it was trained on."""
    outcome = wamnet("train", *pair, "--steps", 2, "--seed", 3, "-o", "m.safetensors")
    assert outcome.status == 0
    first, second = outcome.out.splitlines()
    assert first == "m.safetensors: 2 steps; checkpoint in m.checkpoint.safetensors"
    assert second.startswith("m.safetensors: no domain, for which 9 frames are needed: ")
    model = load_model(tmp_path / "m.safetensors")
    assert model.features == ("color", "normal")
    assert model.info["trained_on_time"] == "1.0"
    recipe = train.choose_recipe("best", None, {"features": ("color", "normal"), "steps": 2, "seed": 3})
    frames = exr.read_frame(tmp_path / "noisy.exr"), exr.read_frame(tmp_path / "reference.exr")
    want = reference.train(recipe, [frames]).siren
    assert all((a == b).all() for a, b in zip(model.siren.weights, want.weights, strict=True))


def stopped_after(count: int, patch) -> None:
    """Let an interrupt end a training after so many steps."""
    step, calls = reference.train_step, []

    def stopped(*arguments):
        calls.append(1)
        if len(calls) > count:
            raise KeyboardInterrupt
        return step(*arguments)

    patch.setattr(reference, "train_step", stopped)


def test_resuming_gives_the_same_bits(wamnet, pair, tmp_path) -> None:
    """An interrupt after 2 of 4 steps keeps a checkpoint; --resume needs no other option to be repeated."""
    assert wamnet("train", *pair, "--steps", 4, "-o", "whole.safetensors").status == 0
    with pytest.MonkeyPatch.context() as patch:
        stopped_after(2, patch)
        outcome = wamnet("train", *pair, "--steps", 4, "-o", "parts.safetensors")
    assert outcome.status == 130
    assert outcome.err.splitlines()[0].startswith("wamnet: ")
    assert outcome.err.endswith("wamnet: interrupted\n")
    assert not (tmp_path / "parts.safetensors").exists()
    assert load_checkpoint(tmp_path / "parts.checkpoint.safetensors").step == 2
    assert wamnet("train", *pair[:4], "--resume", "-o", "parts.safetensors").status == 0
    assert (tmp_path / "parts.safetensors").read_bytes() == (tmp_path / "whole.safetensors").read_bytes()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--steps", "0"], "recipe: steps 0"),
        (["--seed", "-1"], "recipe: seed -1"),
        (["--features", "colour"], "colour"),
        (["-i", "noisy.exr"], "number of targets 1: each --input needs its --target, and there are 2 inputs"),
        (["-o", "m.pt"], "output file 'm.pt': must end in .safetensors"),
        (["-o", "no/m.safetensors"], "output folder 'no': not found"),
        (["--resume"], "wamnet-checkpoint file 'model.checkpoint.safetensors': not found"),
        (["-i", "none.exr", "-t", "noisy.exr"], "input file 'none.exr': not found"),
        (["--preset", "long"], "Invalid value for '--preset'"),
        (["--features", ""], "at least one, each once"),
        (["--whole", "--rank", "4"], "recipe: rank 4: integer networks have sines, and no rank"),
        (["--whole", "--activation", "relu"], "recipe: activation 'relu': integer networks have sines"),
        (["--whole", "--variant", "whole10"], "--variant 'whole10': --whole is short for whole8"),
        (["--variant", "whole9"], "variant 'whole9': there are whole8, whole10"),
        (["--variant", "window8+whole8"], "--variant 'window8+whole8': is derived from a trained model"),
    ],
)
def test_refusals(refused, pair, options, text) -> None:
    """Nothing is written, no checkpoint either."""
    assert text in refused("train", *pair[:4], *options)


def test_refusals_of_frames(refused, pair, tmp_path) -> None:
    """Sizes that differ, a layer that the features need, a pixel that is not finite."""
    color = np.zeros((3, 2, 3), np.float32)
    exr.write_frame(tmp_path / "small.exr", Frame({"color": color}))
    assert "sizes of noisy and reference frame '13x12 and 2x3" in refused(
        "train", "-i", "noisy.exr", "-t", "small.exr", "--features", "color"
    )
    assert "normal" in refused("train", "-i", "small.exr", "-t", "small.exr", "--features", "color,normal")
    # The writer refuses such a frame, so the package writes it.
    import OpenEXR

    color[1, 0, 2] = np.nan
    channels = {name: np.ascontiguousarray(color[:, :, i]) for i, name in enumerate("RGB")}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(tmp_path / "nan.exr"))
    text = "nan.exr: layer 'color' at x=0, y=1 (first of 1 such pixel) nan: every pixel must be finite"
    assert text in refused("train", "-i", "nan.exr", "-t", "small.exr")


def test_training_on_a_data_set(wamnet, refused, tmp_path) -> None:
    """Its training pairs in their order, and no test pair: the model that the named frames give."""
    set_of = ("dataset", "minicubes", "--frames", 2, "--test", 1, "--size", 13, "--spp", 2, "-o", "set")
    assert wamnet(*set_of).status == 0
    options = ("--steps", 2, "--features", "color,position")
    assert wamnet("train", "--dataset", "set", *options, "-o", "a.safetensors").status == 0
    named = [
        part
        for n in range(2)
        for option, kind in (("-i", "noisy"), ("-t", "target"))
        for part in (option, f"set/train/0000{n}-{kind}.exr")
    ]
    assert wamnet("train", *named, *options, "-o", "b.safetensors").status == 0
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()
    text = "--dataset 'set': cannot be combined with -i and -t (choose one of them"
    assert text in refused("train", "--dataset", "set", *named)
    assert "training frames: missing (give -i and -t, or --dataset" in refused("train")
    (tmp_path / "set/train/00001-target.exr").write_bytes(b"x")
    text = "data set 'set': 1 of its images do not match manifest.json, first train/00001-target.exr"
    assert text in refused("train", "--dataset", "set")
    assert "data set 'none': has no manifest.json" in refused("train", "--dataset", "none")


def test_resuming_with_another_recipe_or_other_frames(wamnet, refused, pair) -> None:
    """What was begun with one network and one set of frames is not finished with others."""
    assert wamnet("train", *pair, "--steps", 2).status == 0
    assert "changed parts of the recipe 'features" in refused(
        "train", *pair[:4], "--resume", "--features", "color"
    )
    swapped = ["-i", "reference.exr", "-t", "noisy.exr"]
    assert "digest of the training frames" in refused("train", *swapped, "--resume", "--steps", 3)
    assert "steps 1: the run has done 2 steps" in refused("train", *pair[:4], "--resume", "--steps", 1)


def test_a_model_is_cut_and_trained_on(wamnet, refused, pair, tmp_path) -> None:
    """As the reference does it; not with --resume, nor with a model of another shape."""
    assert wamnet("train", *pair, "--steps", 2, "-o", "full.safetensors").status == 0
    more = ("--from", "full.safetensors", "--rank", 4, "--steps", 3, "-o", "cut.safetensors")
    assert wamnet("train", *pair, *more).status == 0
    choices = {"features": ("color", "normal"), "steps": 3, "rank": 4}
    recipe = train.choose_recipe("best", None, choices)
    frames = exr.read_frame(tmp_path / "noisy.exr"), exr.read_frame(tmp_path / "reference.exr")
    network = load_model(tmp_path / "full.safetensors").siren
    want = reference.train(recipe, [frames], network=network)
    got = load_checkpoint(tmp_path / "cut.checkpoint.safetensors")
    assert all((a == b).all() for a, b in zip(got.parameters, want.parameters, strict=True))
    text = "--from 'full.safetensors': a resumed run continues from its checkpoint (leave it out"
    assert text in refused("train", *pair[:4], "--resume", "-o", "cut.safetensors", *more[:2])
    others = (*pair[:4], "--features", "color", *more[:2], "-o", "x.safetensors")
    assert "widths, omegas and activation of the first network (" in refused("train", *others)


def test_training_on_a_device(wamnet, refused, pair, tmp_path, executor_named) -> None:
    """The model is train_on's, to the bit; a checkpoint of one executor is resumed by the other."""
    device = executor_named("opencl")
    options = ("--steps", 4, "--executor", "opencl")
    assert wamnet("train", *pair, *options, "-o", "m.safetensors").status == 0
    recipe = train.choose_recipe("best", None, {"features": ("color", "normal"), "steps": 4})
    frames = exr.read_frame(tmp_path / "noisy.exr"), exr.read_frame(tmp_path / "reference.exr")
    want = train_on(device, recipe, [frames]).siren
    found = load_model(tmp_path / "m.safetensors").siren
    assert all((a == b).all() for a, b in zip(found.weights, want.weights, strict=True))
    assert wamnet("train", *pair[:4], "--resume", "--steps", 6, "-o", "m.safetensors").status == 0
    resumed = wamnet("train", *pair[:4], "--resume", "--steps", 8, *options[2:], "-o", "m.safetensors")
    assert resumed.status == 0
    assert load_checkpoint(tmp_path / "m.checkpoint.safetensors").step == 8
    assert "Invalid value for '--executor'" in refused("train", *pair, "--executor", "opengl", "--restart")


def test_a_model_is_rounded_on_frames(wamnet, refused, pair, tmp_path) -> None:
    """As the reference does it, with nothing trained and no checkpoint; its kernels have bound 0."""
    assert wamnet("train", *pair, "--steps", 2, "-o", "full.safetensors").status == 0
    outcome = wamnet("train", *pair[:4], "--from", "full.safetensors", "--whole", "-o", "w.safetensors")
    assert outcome.status == 0
    assert outcome.out == "w.safetensors: full.safetensors in integers, rounded on 1 frames\n"
    assert not (tmp_path / "w.checkpoint.safetensors").exists()
    frames = exr.read_frame(tmp_path / "noisy.exr"), exr.read_frame(tmp_path / "reference.exr")
    want = reference.whole_of(load_model(tmp_path / "full.safetensors"), [frames], 127)
    found = load_model(tmp_path / "w.safetensors")
    assert found.is_whole
    assert found.info == want.info
    for a, b in zip(
        found.siren.weights + found.siren.biases, want.siren.weights + want.siren.biases, strict=True
    ):
        assert np.array_equal(a, b)
    assert wamnet("compile", "w.safetensors", "--target", "c", "-o", "kernel").status == 0
    manifest = json.loads((tmp_path / "kernel" / "manifest.json").read_text())
    assert manifest["bound"]["output"] == [0.0, 0.0, 0.0]
    again = ("train", *pair[:4], "--from", "w.safetensors", "--whole")
    assert "the model is one of integers" in refused(*again)
    further = ("train", *pair[:4], "--from", "w.safetensors", "--steps", 2)
    assert "first network: is an integer network, and training needs floats" in refused(*further)


def test_integers_from_the_start_and_resumed(wamnet, refused, pair, tmp_path) -> None:
    """Floats until the last step, so that a run that resumes gives the same bytes; ten bits by their name."""
    ten = ("--variant", "whole10")
    assert wamnet("train", *pair, "--steps", 3, *ten, "-o", "all.safetensors").status == 0
    found = load_model(tmp_path / "all.safetensors")
    assert found.is_whole
    assert found.siren.amplitude == 511
    assert load_checkpoint(tmp_path / "all.checkpoint.safetensors").recipe.whole == 511
    # A recipe of the same length that is stopped after two steps.
    with pytest.MonkeyPatch.context() as patch:
        stopped_after(2, patch)
        outcome = wamnet("train", *pair, "--steps", 3, *ten, "-o", "parts.safetensors")
    assert outcome.status == 130
    assert wamnet("train", *pair[:4], "--resume", "-o", "parts.safetensors").status == 0
    assert (tmp_path / "parts.safetensors").read_bytes() == (tmp_path / "all.safetensors").read_bytes()
    text = "--variant 'whole8': a resumed run keeps the checkpoint's (leave it out"
    assert text in refused("train", *pair[:4], "--resume", "--whole", "-o", "parts.safetensors")


def test_checkpoints_by_time(wamnet, pair, tmp_path, monkeypatch) -> None:
    """When the interval is over, the next log line keeps a checkpoint, before the last step."""
    kept = []
    monkeypatch.setattr(train, "CHECKPOINT_INTERVAL_S", -1.0)
    monkeypatch.setattr(
        "wamnet.models.model_file.save_checkpoint", lambda _path, state: kept.append(state.step)
    )
    frames = [(exr.read_frame(tmp_path / "noisy.exr"), exr.read_frame(tmp_path / "reference.exr"))]
    recipe = train.choose_recipe("best", None, {"features": ("color",), "steps": 4})
    train.fit(train.replace(recipe, log_every=2), frames, tmp_path / "m.safetensors")
    assert kept == [2, 4, 4]


def test_an_earlier_run_is_not_lost(wamnet, refused, pair, tmp_path) -> None:
    """It resumes, or is replaced, only on request."""
    assert wamnet("train", *pair, "--steps", 2).status == 0
    line = refused("train", *pair, "--steps", 3)
    assert "checkpoint 'model.checkpoint.safetensors': belongs to an earlier run" in line
    assert "--resume" in line
    assert "--restart" in line
    assert wamnet("train", *pair, "--steps", 3, "--restart").status == 0
    assert load_checkpoint(tmp_path / "model.checkpoint.safetensors").step == 3
    assert "choose one of them" in refused("train", *pair, "--resume", "--restart")
