"""Exports of a network of integers (EXP-9, WHO-10): graph and any compiler have the same bits."""

from dataclasses import replace

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler.compile import compile_program
from wamnet.compiler.variants import parse, vary
from wamnet.kernels.export import check, onnx_export, targets
from wamnet.kernels.export.host_runner import CRunner, CUDARunner, MetalRunner
from wamnet.kernels.export.package import Request, export
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable, InputError
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.whole import forward_whole
from wamnet.refimpl.network.window import all_windows, pad

pytestmark = pytest.mark.apart  # a kernel of -Ofast makes its process flush denormal numbers


def model(bits=8, border="clamp"):
    """An untrained network in integers, its colours near the middle."""
    found = untrained((8, 5), border=border)
    biases = (*found.siren.biases[:-1], np.full(3, 0.5, np.float32))
    return vary(parse(f"whole{bits}"), replace(found, siren=replace(found.siren, biases=biases))).model


def made(target, network, **options):
    """Return the export of a network, or skip where a translator is missing."""
    try:
        return export(Request(network, target, settings=Settings(max_depth=1), **options))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))


def by_definition(network, images):
    """Return the picture (H, W, 3) that the reference makes of integers (H, W, C) by name."""
    joined = np.concatenate([images[name] for name in network.features], axis=-1)
    windows = all_windows(pad(joined, network.window), network.window)
    return forward_whole(network.siren, windows).astype(np.float32)


def insist(whole, network):
    """Insist on the reference's digest, and on a bound that demands it; skip where nothing runs it."""
    verdict = check.check(whole)
    assert verdict.holds, verdict.wrong
    assert whole.manifest["bound"]["output"] == [0.0] * 3
    assert not whole.pair.bound.any()
    assert "Error: none, the same bits" in whole.files["README.md"].decode()
    held = by_definition(network, whole.pair.images)
    assert held.tobytes() == whole.pair.output.tobytes()
    assert len(np.unique(held)) > 50, "a picture of few colours would hide errors"
    if "missing" in verdict.executed:
        pytest.skip(verdict.executed)
    assert (verdict.error, verdict.bound, verdict.cells()[5:7]) == (0, 0, ("0", "0"))
    assert verdict.digest == check.digest_of(held)


FAST = ("-Ofast", "-ffp-contract=fast", "-march=native")
"""What lets a compiler reorder, fuse and drop most."""


@pytest.mark.parametrize("opened", [CRunner, CUDARunner, MetalRunner], ids=lambda opened: opened.name)
def test_compilers_that_may_do_anything_with_floats(opened):
    """The kernel does not ask for strict arithmetic; that of floats, which C's compiler must refuse, does."""
    network = model()
    whole = made(opened.name, network)
    try:
        runner = opened(*FAST)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    with runner:
        found = runner.run(whole.denoiser, whole.pair.images)
    assert check.digest_of(found) == check.digest_of(by_definition(network, whole.pair.images))


def test_floats_need_strict_arithmetic(kit):
    program = kit.denoiser(kit.network([36, 5, 3], (3.0, 3.0)), {"a": 4}, 3, "clamp")
    images = {"a": np.zeros((2, 3, 4), np.float32)}
    try:
        runner = CRunner(*FAST)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    with runner, pytest.raises(CompileError, match="the error bound needs float arithmetic"):
        runner.run(compile_program(program, "c"), images)


@pytest.mark.parametrize("target", ["opencl", "c"])
def test_spectra_are_refused(target):
    with pytest.raises(InputError, match="sums from spectra are rounded, those of integers are not"):
        export(Request(model(), target, schedule=targets.SPECTRA[0]))


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("bits", [8, 10])
def test_a_graph_has_the_reference_s_digest(bits, border):
    """EXP-11: in ONNX Runtime, and in the evaluator that defines the operators."""
    pytest.importorskip("onnx")
    network = model(bits, border)
    whole = made("onnx", network)
    assert "the runtime's Conv adds up products" in whole.manifest["assumes"]
    (result,) = reference_evaluator(whole).run(None, dict(whole.pair.images))
    assert check.digest_of(result) == check.digest_of(by_definition(network, whole.pair.images))
    insist(whole, network)


def reference_evaluator(whole):
    """Return ONNX's own evaluator of an exported graph."""
    from onnx.reference import ReferenceEvaluator

    return ReferenceEvaluator(whole.files["denoise/denoise.onnx"])


def test_a_graph_of_integers_has_phases_below_zero():
    """A remainder with the dividend's sign would be another phase."""
    pytest.importorskip("onnxruntime")
    network = model()
    factors, biases = network.siren.factors, network.siren.biases
    changed = replace(
        network.siren,
        factors=tuple(np.full_like(f, 2**24 - 1) for f in factors[:-1]) + factors[-1:],
        biases=tuple(np.zeros_like(b) for b in biases[:-1]) + biases[-1:],
    )
    extreme = replace(network, siren=changed)
    images = {n: np.full((6, 7, 3), v, np.float32) for n, v in (("color", -127), ("normal", 127))}
    _, found = onnx_export.run_graph(onnx_export.graph(extreme), images)
    assert found.tobytes() == by_definition(extreme, images).tobytes()


@pytest.mark.needs("programs")
def test_what_is_not_a_number_is_found():
    whole = made("c", model())
    broken = replace(whole.pair, output=np.full_like(whole.pair.output, np.nan))
    assert not check.check(replace(whole, pair=broken)).holds
