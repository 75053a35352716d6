"""WGSL on two compilers (EXP-5, PRO-1c): the sample of an export keeps its bound on naga and on Tint."""

from dataclasses import replace

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler.compile import compile_program
from wamnet.kernels.export import targets, tint_runner
from wamnet.kernels.export.package import Request, export
from wamnet.kernels.export.tint_runner import TintRunner
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable
from wamnet.refimpl.light.transport import Settings

pytestmark = pytest.mark.apart  # drivers of Vulkan stay in memory


def opened(name):
    """Return a runner by its name, or skip where it is not here."""
    try:
        return targets.RUNNERS[name]()
    except ExecutorUnavailable as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def exported():
    return export(Request(untrained((8, 5)), "wgsl", settings=Settings(max_depth=1)))


@pytest.mark.needs("devices")
@pytest.mark.parametrize("name", ["wgsl", "wgsl/tint", "wgsl/tint-gles"])
def test_the_sample_of_an_export_keeps_its_bound(exported, name):
    """The bound is not 0, and the error is not either: the sample would show another order of operations."""
    pair = exported.pair
    with opened(name) as runner:
        off = np.abs(runner.run(exported.denoiser, pair.images).astype(np.float64) - pair.output)
    assert (pair.bound > 0).all()
    assert (off <= pair.bound).all()
    assert off.max() > 0


@pytest.mark.needs("devices")
def test_a_weight_that_is_off_breaks_the_bound(exported):
    """By a tenth."""
    right = exported.denoiser
    weights = right.weights.copy()
    weights[3] += 0.1
    wrong = replace(right, weights=weights, manifest={**right.manifest, "digest": "0" * 64})
    with opened("wgsl/tint") as runner:
        off = np.abs(runner.run(wrong, exported.pair.images) - exported.pair.output)
    assert not (off <= exported.pair.bound).all()


@pytest.mark.needs("devices")
def test_what_dawn_does_not_take_is_told(exported, kit):
    wrong = kit.with_source(exported.denoiser, "@compute", "let nonsense = ; @compute")
    with (
        opened("wgsl/tint") as runner,
        pytest.raises(CompileError, match=r"Dawn, .* rejects the kernel"),
    ):
        runner.build(wrong)


def test_a_missing_program_is_told(monkeypatch):
    monkeypatch.setattr(tint_runner.shutil, "which", lambda name: None)
    with pytest.raises(ExecutorUnavailable, match=r"node is not installed: apt-get install nodejs npm"):
        TintRunner()


@pytest.mark.needs("programs")
def test_a_missing_package_is_told(monkeypatch, tmp_path):
    if tint_runner.shutil.which("node") is None:
        pytest.skip("no node; in Debian: apt-get install nodejs npm")
    monkeypatch.setattr(tint_runner, "_environment", lambda: {"HOME": str(tmp_path)})
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ExecutorUnavailable, match=r"no vulkan device .*webgpu.*npm install --global webgpu"):
        TintRunner()


@pytest.mark.nightly
@pytest.mark.nightly("cuda")
@pytest.mark.parametrize("target", ["wgsl", "metal", "glsl-es", "cuda"])
def test_what_a_bound_rests_on_is_said(kit, target):
    """PRO-1c, EXP-2."""
    program = kit.denoiser(kit.network([9, 4, 3], (3.0, 5.0)), {"a": 1}, 3, "zero")
    told = " ".join(compile_program(program, target).source.replace(" * ", " ").replace("#", " ").split())
    named = {
        "wgsl": "WGSL 15.7.5",
        "metal": "MSL 8.2",
        "glsl-es": "rounds to nearest",
        "cuda": "-use_fast_math",
    }
    assert named[target] in told
