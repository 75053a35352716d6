"""Imported networks as kernels: on every device within the bound, beside ONNX Runtime, their texts read."""

from pathlib import Path

import numpy as np
import pytest
from packages import needed
from strangers import STRANGERS

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.variants import plan_model
from wamnet.kernels.export.package import Request, export
from wamnet.models.importing.network import import_network
from wamnet.refimpl.errors import InputError

pytestmark = pytest.mark.needs("packages")


@pytest.fixture(params=STRANGERS, ids=lambda each: each.name)
def stranger(request):
    """Give each network."""
    needed("onnx")
    return request.param


def model_of(stranger):
    return import_network(stranger.path, {"": (stranger.low, stranger.high)}, stranger.border).model


def test_a_kernel_is_beside_onnx_runtime(stranger, denoiser):
    """Both are within the bound of float64's picture, so that they are within twice the bound of each other.

    The bound is for any order of sums in float32, which is what ONNX Runtime's processor provider computes.
    ONNX promises nothing of Sin: the runtime's is taken to be as near as the emitted one is promised to be.
    """
    onnxruntime = needed("onnxruntime")
    plan, image = plan_model(model_of(stranger), denoiser.name), stranger.image()
    kernel = compile_plan(plan)
    found = denoiser.run(kernel, {"x": image})
    expected = plan.expected({"x": image})
    assert np.all(np.abs(found - expected.value) <= expected.bound)
    session = onnxruntime.InferenceSession(str(stranger.path), providers=["CPUExecutionProvider"])
    theirs = stranger.picture(session.run(None, {"x": stranger.tensor(image)})[0])
    assert np.all(stranger.inside(np.abs(found - theirs) <= 2 * expected.bound))
    assert max(kernel.manifest["bound"]["output"]) >= expected.bound.max() / 2
    assert artifact.CERTIFICATE_NAME in kernel.contents()


@pytest.mark.parametrize("target", ["opencl", "opengl", "c"])
def test_its_text_is_read(stranger, target, tmp_path):
    needed("onnx")
    from wamnet.compiler.proof.checker import check
    from wamnet.compiler.reading.check import check_text

    plan = plan_model(model_of(stranger), target)
    artifact.write(compile_plan(plan), tmp_path / "kernel")
    path = tmp_path / "kernel" / artifact.CERTIFICATE_NAME
    assert check(path)["bound"]["output"] == list(plan.bound.output)
    assert check_text(path)["sums"] > 0


def test_a_graph_says_its_operators_and_what_runtimes_round():
    """The manifest and the README state the version; the README names what computes in fewer bits."""
    needed("onnx")
    from wamnet.cli.common.inputs import load_model

    made = export(Request(load_model(Path("minicubes")), "onnx"))
    text = made.contents()["README.md"].decode()
    assert made.manifest["language"].startswith("ONNX, operators 17:")
    for word in (
        "operators 17",
        "`INFERENCE_PRECISION_HINT` is",
        "TensorRT",
        "`TF32`",
        "Core ML",
        "`use_tf32`",
    ):
        assert word in text


def test_exports_are_of_kernels_only():
    needed("onnx")
    model = model_of(STRANGERS[0])
    made = export(Request(model, "c"))
    assert "encoded for the display" not in made.contents()["README.md"].decode()
    assert made.manifest["images"][0]["encoding"] == "as the network was trained"
    with pytest.raises(InputError, match="--target 'onnx': the model was imported from a graph"):
        export(Request(model, "onnx"))
    with pytest.raises(InputError, match="variant 'hidden2': an imported network has none"):
        export(Request(model, "c", variant="hidden2"))
