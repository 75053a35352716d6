"""Integer networks for users: files and digests that are the same to the byte on every executor."""

import re

import pytest

EXECUTORS = {"numpy": "numpy", "opencl": "opencl", "opengl": "opengl-egl", "c": "c"}
"""Executors as the command names them, and as the tests do."""


def digest(text: str) -> str:
    """Return the digest that the command prints."""
    (found,) = re.findall(r"sha256 of the float32 result, .*: ([0-9a-f]{64})$", text, re.MULTILINE)
    return found


@pytest.mark.parametrize("suffix", ["exr", "png"])
def test_executors_write_the_same_bytes(wamnet, samples, tmp_path, executor_named, suffix):
    files, digests = set(), set()
    for name, known in EXECUTORS.items():
        executor_named(known)
        path = tmp_path / f"{name}.{suffix}"
        model, noisy = samples / "model.safetensors", samples / "noisy.exr"
        done = wamnet("denoise", model, noisy, "--variant", "whole8", "--executor", name, "-o", path)
        files.add(path.read_bytes())
        digests.add(digest(" ".join(done.out.split())))
    assert len(files) == 1
    assert len(digests) == 1


def test_networks_of_floats_print_no_digest(wamnet, samples, tmp_path):
    model, noisy = samples / "model.safetensors", samples / "noisy.exr"
    assert "sha256" not in wamnet("denoise", model, noisy, "-o", tmp_path / "a.png").out


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("denoise", ("noisy.exr", "-o", "a.png")),
        ("compile", ("--target", "c", "-o", "kernel")),
        ("export", ("--host", "c", "-o", "program")),
        ("triage", ("noisy.exr",)),
    ],
)
def test_the_removed_profile_names_its_replacement(wamnet, samples, monkeypatch, command, options):
    """PRO-11: for one release, instead of the list of all profiles."""
    monkeypatch.chdir(samples)
    outcome = wamnet(command, "model.safetensors", *options, "--profile", "exact")
    assert outcome.status == 2
    assert "profile exact was removed; use an integer network" in outcome.err
    assert "--variant whole8" in outcome.err
