"""Kernels of a network's inputs in an export: there where they are needed and can be, and named."""

import json
from pathlib import Path

import jsonschema
import pytest

from wamnet.compiler.scenes.history_kernel import compile_history
from wamnet.compiler.scenes.smooth_kernel import compile_smoothing
from wamnet.kernels.export.package import Request, export
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization, n_inputs
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

SCALES = Normalization(exposure_stops=-0.5)
SCHEMA = json.loads((Path(__file__).parents[3] / "spec/export.schema.json").read_text())


def made(target: str, *features: str):
    window = Window(2)
    network = siren.init((n_inputs(features, window), 4, 3), 1.0, 1.0, 0)
    found = export(Request(Model(network, features, window, SCALES), target))
    jsonschema.Draft202012Validator(SCHEMA).validate(found.manifest)
    return found


@pytest.mark.parametrize(("target", "suffix"), [("opencl", "cl"), ("c", "h"), ("glsl", "frag")])
def test_an_export_has_the_kernels_of_its_inputs(target, suffix):
    """EXP-18: their texts, manifests, and lines in manifest and README."""
    found = made(target, "color", "smoothed", "history", "history_weight")
    compiled = {"glsl": "opengl"}.get(target, target)
    smoothing = compile_smoothing(SCALES, compiled)
    texts = {
        "guide": smoothing.guide.source,
        "smooth": smoothing.smooth.source,
        "encode": smoothing.encode.source,
        "follow": compile_history(compiled).source,
    }
    contents = found.contents()
    for entry, (role, text) in zip(found.manifest["inputs"], texts.items(), strict=True):
        (path,) = entry["files"]
        assert path == f"inputs/{role}/{role}.{suffix}"
        assert contents[path].decode() == text
        assert f"`{path}`, entry point `{entry['entry_point']}`" in contents["README.md"].decode()
        assert json.loads(contents[f"inputs/{role}/manifest.json"])["entry_point"] == entry["entry_point"]
        assert entry["entry_point"] in text
    assert [entry["features"] for entry in found.manifest["inputs"]] == [
        *[["smoothed"]] * 3,
        ["history", "history_weight"],
    ]


def test_an_export_has_only_the_kernels_that_it_needs():
    assert [entry["role"] for entry in made("c", "color", "history").manifest["inputs"]] == ["follow"]
    assert "inputs" not in made("c", "color", "normal").manifest


def test_a_target_without_such_kernels_leaves_the_images_to_the_host():
    found = made("wgsl", "color", "smoothed")
    assert "inputs" not in found.manifest
    assert "Kernels of inputs" not in found.contents()["README.md"].decode()
