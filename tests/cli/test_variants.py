"""Tests of --variant and of choices from a curve, in compile, denoise and train."""

import json
import shutil

import numpy as np
import pytest

from wamnet.cli.files import exr
from wamnet.cli.files.images import read_png
from wamnet.compiler import variants
from wamnet.kernels import cache, denoise_on, open_executor
from wamnet.kernels.run.curve import Curve, Point
from wamnet.models.model_file import load_model
from wamnet.refimpl import encoding


@pytest.fixture
def here(samples, tmp_path, monkeypatch):
    """Put model.safetensors, two frames and curve.json into the working folder; its own cache."""
    for name in ("model.safetensors", "noisy.exr", "reference.exr"):
        shutil.copy(samples / name, tmp_path / name)
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "cache"))
    digest = variants.digest_of(load_model(tmp_path / "model.safetensors"))
    points = [
        Point("full", "plain", "opencl", 10.0, 1e-6, 1e-7, 0.0, 1e-3),
        Point("window3", "tile:8", "opencl", 5.0, 0.1, 0.01, 0.2, 1.0),
        Point("window3", "inlined", "opengl", 1.0, 0.1, 0.01, 0.2, 1.0),
    ]
    data = Curve(digest, "somewhere", (64, 64), "ieee", tuple(points)).as_data()
    (tmp_path / "curve.json").write_text(json.dumps(data))
    return tmp_path


def test_a_variant_denoises(wamnet, here) -> None:
    outcome = wamnet("denoise", "model.safetensors", "noisy.exr", "--variant", "window3", "-o", "d.png")
    assert outcome.status == 0
    assert "variant window3: 58% of the multiplications; moves a colour by at most " in outcome.out
    with open_executor("numpy") as executor:
        model, noisy = load_model(here / "model.safetensors"), exr.read_frame(here / "noisy.exr")
        expected = denoise_on(executor, model, noisy, variant="window3").image
    assert (encoding.to_8bit(read_png(here / "d.png")) == encoding.to_8bit(expected)).all()


def test_a_variant_is_trained_on(wamnet, here) -> None:
    frames = ("-i", "noisy.exr", "-t", "reference.exr", "--steps", 2)
    more = "--from model.safetensors --variant window3+hidden6+rank4 -o s.safetensors"
    outcome = wamnet("train", *frames, *more.split())
    assert outcome.status == 0, outcome.err
    found = load_model(here / "s.safetensors")
    assert (found.window.size, found.siren.widths) == (3, (54, 6, 3))
    assert np.linalg.matrix_rank(found.siren.weights[0].reshape(18, 18), tol=1e-4) == 4
    assert wamnet("train", *frames, "--resume", "-o", "s.safetensors").status == 0


COMPILE = ("compile", "model.safetensors", "--target", "opencl", "-o", "k")
"""The beginning of a command."""


def test_a_curve_is_chosen_from(wamnet, here) -> None:
    outcome = wamnet(*COMPILE, "--max-loss-db", 0.3, "--curve", "curve.json")
    assert outcome.status == 0
    assert outcome.out.splitlines()[0] == (
        "chosen: window3, schedule tile:8: 5 ms, error 0.1, PSNR loss 0.2 dB (64x64 on somewhere)"
    )
    manifest = json.loads((here / "k" / "manifest.json").read_text())
    assert (manifest["variant"]["name"], manifest["schedule"]["name"]) == ("window3", "tile:8")
    outcome = wamnet(*COMPILE, "--max-error", 0.01, "--curve", "curve.json")
    assert "chosen: full, schedule plain" in outcome.out
    assert "not window3, schedule tile:8: --max-error 0.01 (0.1)" in outcome.out
    outcome = wamnet(*COMPILE, "--max-error", 0.2, "--schedule", "plain", "--curve", "curve.json")
    assert "chosen: full, schedule plain" in outcome.out


AGAIN = ("train", "-i", "noisy.exr", "-t", "reference.exr", "--from", "model.safetensors")
"""A model is trained further."""

REFUSED = {
    "--variant 'half16': weights are rounded to halves when a kernel is compiled, not trained":
        (*AGAIN, "--variant", "half16"),
    "variant 'rank': 'rank' is not an approximation": (*COMPILE, "--variant", "rank"),
    "variant 'window9': the window has 4 x 4 taps": (*COMPILE, "--variant", "window9"),
    "--variant 'full': --max-ms chooses a variant itself": (*COMPILE, "--variant", "full", "--max-ms", 3),
    "list of options '--size': a choice needs --max-error": (*COMPILE, "--size", 64),
    "--curve 'curve.json': its points are measured already": (*(*COMPILE, "--max-ms", 3, "--curve",
        "curve.json", "--size", 64),),
    "--size 8: must be from 16 to 4096": (*COMPILE, "--max-ms", 3, "--size", 8),
    "--max-error nan: must be finite": (*COMPILE, "--max-error", "nan", "--curve", "curve.json"),
    "--frames: missing": (*COMPILE, "--max-error", 0.1),
    "no point of the curve keeps it; the nearest is window3": (*(*COMPILE, "--max-ms", 3, "--curve",
        "curve.json"),),
    "curve.json: profile 'ieee': this one is for native": (*(*COMPILE, "--profile", "native", "--max-ms", 3,
        "--curve", "curve.json"),),
    "curve file 'none.json': not found": (*COMPILE, "--max-ms", 3, "--curve", "none.json"),
    "rank 2: the variant is window3": (*("denoise", "model.safetensors", "noisy.exr", "--rank", 2,
        "--variant", "window3"),),
    "--variant 'window3': is derived from a trained model": (*("train", "-i", "noisy.exr", "-t",
        "reference.exr", "--variant", "window3"),),
    "--variant 'window3': it chooses what --rank does": (*AGAIN, "--variant", "window3", "--rank", 2),
    "minicubes is a scene, whose kernels have one schedule, no variants": (*("compile", "minicubes",
        "--target", "opencl", "--variant", "rank2"),),
}  # fmt: skip
"""What is said, and of which command."""


@pytest.mark.parametrize("message", REFUSED)
def test_refusals(refused, here, message) -> None:
    assert message in refused(*REFUSED[message])


def test_a_sine_is_not_trained(refused, here, monkeypatch) -> None:
    from wamnet.compiler.core import sine

    polynomial = sine.POLYNOMIALS[sine.DEGREE]
    monkeypatch.setattr(sine, "POLYNOMIALS", {7: polynomial, sine.DEGREE: polynomial})
    line = refused(*AGAIN, "--variant", "sine7")
    assert "--variant 'sine7': the degree of a sine is chosen when a kernel is compiled, not trained" in line


def test_a_data_set_without_test_frames_measures_nothing(refused, wamnet, here) -> None:
    assert (
        wamnet("dataset", "minicubes", "--frames", 1, "--test", 0, "--size", 12, "--spp", 1, "-o", "s").status
        == 0
    )
    line = refused(*COMPILE, "--max-error", 0.1, "--frames", "s")
    assert "--frames 's': has no test frames" in line


def test_sizes_that_are_the_ends_of_the_range_are_allowed(refused, here) -> None:
    for size in (16, 4096):
        assert "a choice needs --max-error" in refused(*COMPILE, "--size", size)
    message = "must be from 16 to 4096 (for example --size 1024)"
    for size in (15, 4097):
        assert f"--size {size}: {message}" in refused(*COMPILE, "--max-ms", 3, "--size", size)
