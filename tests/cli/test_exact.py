"""Profile `exact` for users: files and digests that are the same to the byte on every executor."""

from __future__ import annotations

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
        done = wamnet("denoise", model, noisy, "--profile", "exact", "--executor", name, "-o", path)
        files.add(path.read_bytes())
        digests.add(digest(" ".join(done.out.split())))
    assert len(files) == 1
    assert len(digests) == 1


def test_other_profiles_print_no_digest(wamnet, samples, tmp_path):
    model, noisy = samples / "model.safetensors", samples / "noisy.exr"
    assert "sha256" not in wamnet("denoise", model, noisy, "-o", tmp_path / "a.png").out
