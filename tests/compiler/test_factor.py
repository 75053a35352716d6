"""Tests of first layers in two passes: programs, bounds, what a manifest says, refusals."""

import json

import numpy as np
import pytest

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.plan import analysed
from wamnet.compiler.proof import bounds
from wamnet.compiler.schedules import factor
from wamnet.compiler.targets import language_named
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.denoise import denoise_pixel
from wamnet.refimpl.network.window import BORDERS, Window, all_windows, pad

SIZE, CHANNELS = 4, 3
CONTRACT = language_named("opencl").sine


def program(function=None, border="clamp"):
    """Trace a function of the window vector over one image in [-2, 2], or a small network."""
    network = siren.init([SIZE * SIZE * CHANNELS, 10, 8, 3], 3.0, 3.0, seed=1, dtype=np.float32)
    gather = Gather(Window(SIZE, border), (Image("a", CHANNELS, -2.0, 2.0),))
    chosen = function or (lambda window: denoise_pixel(network, window))
    return analysed(trace(chosen, {"window": Type(shape=(gather.n_inputs,))}, gather))


def windows(image, window, axes):
    return all_windows(pad(image, window, axes), window, axes)


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("rank", [1, 5, SIZE * CHANNELS])
def test_both_passes_are_the_network_of_the_product(rank, border) -> None:
    """In float64, in which nothing but the order of sums differs."""
    cut = factor.factor(program(border=border), rank)
    window = Window(SIZE, border)
    image = np.random.default_rng(1).uniform(-2, 2, (6, 9, CHANNELS))
    (expected,) = interpret(cut.product, {"window": windows(image, window, (0, 1))}, np.float64).values()
    (h,) = interpret(cut.horizontal, {"window": windows(image, window, (1,))}, np.float64).values()
    (found,) = interpret(cut.vertical, {"window": windows(h, window, (0,))}, np.float64).values()
    assert h.shape == (6, 9, rank)
    # Sums of less than 100 terms below 2, through layers that stretch by less than 100: 1e4 roundings.
    assert np.max(np.abs(found - expected)) <= 1e4 * 2.0**-52


def test_the_cut_is_bounded_at_its_worst_window() -> None:
    """The window that takes each input where the cut's row adds up reaches the bound of the first layer."""
    whole = program()
    cut = factor.factor(whole, 2)
    weight = whole.parameters[str(whole.nodes[cut.layer]["weight"])].astype(np.float64)
    difference = cut.product.parameters[str(whole.nodes[cut.layer]["weight"])] - weight
    row = int(np.abs(difference).sum(axis=1).argmax())
    worst = 2.0 * np.sign(difference[row])
    moved = abs(difference[row] @ worst)
    layer = cut.enclosures(CONTRACT)[cut.layer].error[row]
    alone = cut.enclosures(CONTRACT, of_cut=False)[cut.layer].error[row]
    assert moved <= layer
    # Nothing else is in the bound but rounding; float64 adds up in another order.
    assert layer - alone <= (1 + 1e-5) * moved


def test_rounding_is_that_of_both_passes() -> None:
    """The first pass's error goes through |V|, and the second one's products add their own.

    The range is that of the sums with the weights V H, some of whose rows are larger than those of W.
    """
    cut = factor.factor(program(), 11)
    box, vertical = bounds.window_box(cut.horizontal.gather), np.abs(cut.factors.vertical).reshape(10, -1)
    h = bounds.enclose(cut.horizontal, {"window": box}, CONTRACT)[-1]
    layer = cut.enclosures(CONTRACT, of_cut=False)[cut.layer]
    passed_on, own = (np.tile(part, SIZE) @ vertical.T for part in (h.error, h.largest))
    assert (layer.error >= passed_on + 2.0**-24 * own).all()
    node = cut.whole.nodes[cut.layer]
    reach = 2.0 * np.abs(cut.product.parameters[str(node["weight"])]).sum(axis=1)
    assert (reach > 2.0 * np.abs(cut.whole.parameters[str(node["weight"])]).sum(axis=1)).any()
    bias = cut.whole.parameters[str(node["bias"])].astype(np.float64)
    # float64 adds 48 numbers up in another order.
    assert (layer.high >= (bias + reach) - 48 * 2.0**-52 * reach).all()
    assert (layer.low <= (bias - reach) + 48 * 2.0**-52 * reach).all()


def test_manifest_and_files_hold_both_passes(tmp_path) -> None:
    found = compile_program(program(), "opencl", "tile:8", rank=5)
    names = [path.name for path in artifact.write(found, tmp_path)]
    own = ["denoise.cl", "weights.bin", "denoise.certificate.json"]
    assert names == [*(f"horizontal.{name}" for name in own), *own, "manifest.json"]
    manifest, files = json.loads((tmp_path / "manifest.json").read_text()), [names[i] for i in (0, 1, 3, 4)]
    assert sorted(manifest["files"]) == sorted(files)
    assert manifest["file_bytes"] == {name: (tmp_path / name).stat().st_size for name in files}
    assert manifest["factored"]["rank"] == 5
    assert manifest["factored"]["horizontal"]["window"] == {
        "size": 4,
        "border": "clamp",
        "centre": 2,
        "rows": 1,
        "columns": 4,
    }
    assert manifest["bound"]["against"] == "float64 reference of the program that was cut"
    assert 0 < manifest["factored"]["cut"]["first_layer"] < manifest["factored"]["cut"]["of"]
    assert "pass      1 of 2: sums along the rows" in (tmp_path / "horizontal.denoise.cl").read_text()
    assert "bound is that of both passes, against program " in (tmp_path / "denoise.cl").read_text()
    other = compile_program(program(), "opencl", "tile:8", rank=4)
    assert other.digest != found.digest


def test_native_sines_promise_nothing_on_numpy() -> None:
    found = compile_program(program(), language_named("numpy").under("native"), rank=5).manifest
    assert found["bound"]["output"] is None


TWICE = np.linspace(-0.1, 0.1, 48 * 48, dtype=np.float32).reshape(48, 48)
"""A matrix that fits the window and what it gives."""

UNFIT = {
    r"%1 \(affine\), %2 \(add\) reads the window: only a first layer": lambda x: x @ TWICE.T + x,
    r"%1 \(sin\) reads the window: only a first layer": lambda x: np.sin(x) @ TWICE.T,
    "another layer shares": lambda x: np.sin(x @ TWICE.T) @ TWICE.T,
}
"""What is said of functions that have no first layer."""


@pytest.mark.parametrize("reason", UNFIT)
def test_programs_without_a_first_layer_are_refused(reason) -> None:
    with pytest.raises(CompileError, match=reason):
        factor.factor(program(UNFIT[reason]), 2)
