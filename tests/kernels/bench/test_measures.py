"""What is measured around the measurements: caches, scenes and noise are the same in every run."""

import os
from pathlib import Path

import numpy as np
import pytest

from wamnet.kernels import measure
from wamnet.kernels.bench import fresh
from wamnet.refimpl.light.scene import primitives
from wamnet.refimpl.network.train import PRESETS
from wamnet_peers import paths, training


def variables(names):
    return {name: os.environ.get(name) for name in names}


@pytest.mark.parametrize("fails", [False, True])
def test_environment_is_put_back(monkeypatch, fails) -> None:
    for name in (*fresh.CACHES, *paths.NO_CACHES):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "here")
    monkeypatch.setenv("POCL_KERNEL_CACHE", "1")
    before = variables((*fresh.CACHES, *paths.NO_CACHES))
    try:
        with fresh.empty_caches(), measure.environment(paths.NO_CACHES):
            assert all(Path(os.environ[name]).is_dir() for name in fresh.CACHES)
            assert variables(paths.NO_CACHES) == paths.NO_CACHES
            if fails:
                raise KeyboardInterrupt
    except KeyboardInterrupt:
        assert fails
    assert variables(before) == before


@pytest.mark.parametrize("kind", paths.KINDS)
def test_a_crowd_is_as_large_as_stated_and_the_same_again(kind) -> None:
    """Edges of quads are at right angles and as long as the size, with 8 u of rounding for three products."""
    scene = paths.crowd(kind, 12)
    assert scene == paths.crowd(kind, 12)
    assert scene.name == f"{kind} 12"
    assert primitives(scene) == 12 + len(scene.lights)
    parts = (*scene.boxes, *scene.spheres, *scene.quads)
    assert len(set(parts)) == 12
    size = 0.6 / 12 ** (1 / 3)
    for quad in scene.quads:
        edges = np.array([quad.edge_u, quad.edge_v])
        assert np.abs(edges @ edges.T - size**2 * np.eye(2)).max() <= 8 * 2.0**-53


def test_noise_is_other_noise_in_each_frame() -> None:
    frames = [frame["color"] for pair in training.noise(2, 4) for frame in pair]
    assert len({frame.tobytes() for frame in frames}) == 4


def test_operations_are_those_of_three_products() -> None:
    """Two for each weight and example; inputs of the first layer have no derivative."""
    recipe = PRESETS["short"]
    first, *_ = layers = [a * b for a, b in zip(recipe.layer_widths, recipe.layer_widths[1:], strict=False)]
    assert training.operations(recipe) == recipe.batch * (6 * sum(layers) - 2 * first)
