"""Tests of `wamnet tune`, and of what other commands do with its tables."""

import json
import shutil

import pytest

from wamnet.kernels import cache
from wamnet.kernels.run import tune as tuning


@pytest.fixture
def here(samples, tmp_path, monkeypatch):
    """Put model.safetensors and noisy.exr into the working folder, and the cache into another."""
    for name in ("model.safetensors", "noisy.exr"):
        shutil.copy(samples / name, tmp_path / name)
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(tuning, "REPEATS", 1)
    return tmp_path


@pytest.mark.nightly
def test_tuning_is_kept_shown_and_used(wamnet, executor_named, here) -> None:
    """A table with a row a schedule; the second time it is read; denoise and compile take its pick."""
    executor_named("opencl")
    arguments = ("tune", "model.safetensors", "--size", 12, "--cache", "mine")
    outcome = wamnet(*arguments)
    assert outcome.status == 0, outcome.err
    assert "12x12, 96-8-3, color + normal, window 4 (clamp)" in outcome.out
    for word in ("plain", "vector:16", "tile:16", "tile:8", "tile:4", "group:1", "group:4", "s to compile"):
        assert word in outcome.out
    assert "for 1 image: " in outcome.out
    assert "for 1000 images: " in outcome.out
    assert "--force measures again" not in outcome.out
    (entry,) = (here / "mine").iterdir()
    before = entry.read_bytes()
    again = wamnet(*arguments)
    assert again.status == 0
    assert "--force measures again" in again.out
    assert entry.read_bytes() == before
    assert wamnet(*arguments, "--force").status == 0
    assert entry.read_bytes() != before
    denoised = wamnet("denoise", "model.safetensors", "noisy.exr", "--executor", "opencl")
    assert "; tuned on this device on " in denoised.out, "noisy.exr has 13 x 12 pixels, of the same class"
    assert "(the first time" not in denoised.out
    denoised = wamnet("denoise", "model.safetensors", "noisy.exr", "--executor", "opencl")
    assert " s of compilation (the first time " in denoised.out


def test_a_kernel_for_this_machine(wamnet, refused, executor_named, here) -> None:
    """`compile --here` opens the device, and says what it took and why."""
    executor = executor_named("opencl")
    outcome = wamnet("compile", "model.safetensors", "--target", "opencl", "--here")
    assert outcome.status == 0
    assert f"schedule {executor.schedule} for {executor.device}: built-in choice for" in outcome.out
    manifest = json.loads((here / "opencl/manifest.json").read_text())
    picked = manifest["schedule"]
    assert picked.get("asked", picked["name"]) == executor.schedule
    opencl = ("--target", "opencl", "--here", "-o", "kernel")
    line = refused("compile", "model.safetensors", *opencl, "--schedule", "plain")
    assert "--schedule 'plain': --here chooses another (leave one of them out" in line
    assert "--here True: cornell is a scene" in refused("compile", "cornell", *opencl)


def test_refusals_of_tune(refused, here) -> None:
    """Sizes that mean nothing, and no model."""
    assert "--size 0: must be from 1 to 8192 (for example --size 512" in refused("tune", "--size", 0)
    assert "none.st': not found" in refused("tune", "none.st")


def test_without_a_model_the_network_is_the_paper_s(wamnet, here) -> None:
    """The interpreter has one schedule, and is timed too."""
    outcome = wamnet("tune", "--executor", "numpy", "--size", 4)
    assert outcome.status == 0
    assert "4x4, 864-32-32-32-32-3, color + normal, window 12 (clamp)" in outcome.out
    assert "for 1 image: plain; the only one" in outcome.out
