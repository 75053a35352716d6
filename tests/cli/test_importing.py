"""`wamnet import`: a model from another program's network, and what is said of it."""

import pytest
from packages import needed
from strangers import FOLDER


@pytest.fixture(autouse=True)
def onnx():
    """Give the package, or skip."""
    return needed("onnx")


def test_a_network_becomes_a_kernel_with_a_certificate(wamnet, tmp_path):
    outcome = wamnet("import", FOLDER / "sines.onnx", "--range", "-1:1")
    assert outcome.status == 0
    assert "layers 2 -> 8 -> 8 -> 3; window 1 x 1" in outcome.out
    assert "image x: 2 channels in [-1, 1], for which bounds hold" in outcome.out
    assert wamnet("compile", "sines.safetensors", "--target", "c", "-o", "kernel").status == 0
    assert "source: computes the certified program" in wamnet("certify", "kernel").out
    assert wamnet("listing", "sines.safetensors", "--target", "glsl").status == 0


def test_a_border_that_differs_is_said(wamnet, refused):
    told = refused("import", FOLDER / "same.onnx")
    assert "(Conv) 'margins 1, 1, 1, 1, constant'" in told
    outcome = wamnet("import", FOLDER / "same.onnx", "--border", "zero", "-o", "same.safetensors")
    assert "1 pixels and more from the image's edge the model is the network" in outcome.out


@pytest.mark.parametrize("text", ["1", "1:0", "a:b", "x=", "0:inf"])
def test_a_range_that_is_none_is_refused(refused, text):
    told = refused("import", FOLDER / "pixels.onnx", f"--range={text}")
    assert "two numbers in order" in told


def test_weights_without_a_graph_are_named(refused, samples):
    told = refused("import", samples / "model.safetensors")
    assert "holds weights, no graph (use torch.onnx.export)" in told


def test_other_commands_refuse_it(wamnet, refused):
    assert wamnet("import", FOLDER / "pixels.onnx", "-o", "p.safetensors").status == 0
    told = refused("tune", "p.safetensors")
    assert "was imported and reads x, not the features of a frame" in told
    told = refused("compile", "p.safetensors", "--target", "c", "--max-ms", "1")
    assert "limits are measured on frames" in told
    told = refused("export", "p.safetensors", "--target", "c", "--scene", "minicubes")
    assert "the model was imported and reads x, not a scene's features" in told
    told = refused("import", FOLDER / "pixels.onnx", "--range", "0:1", "--range", "0:2")
    assert "each input once" in told
