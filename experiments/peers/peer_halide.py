"""Halide as a peer: the network as functions of a pixel, compiled at once for this processor, on all threads.

1. Images come as rows with interleaved channels. They are joined inside of the window's margins once
   [`_joined`]; every layer is a function of neuron, column and row [`_layer`].
2. The schedule is one by hand, for processors with vectors of 16: rows are shared out to threads, and of
   `STRIP` pixels all layers are computed before the next ones; sums of `BLOCK` pixels and all neurons stay in
   registers while the taps are read. Halide's automatic schedulers were slower.
3. Its `sin` calls the C library for every number: the sine is the polynomial of our profile `ieee`
   [compiler/core/sine.py] in Halide's expressions.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.compiler.core import sine
from wamnet.kernels.bench.contenders import Opened, Tools
from wamnet.kernels.bench.workload import Given
from wamnet.refimpl.network.activation import RELU, SINE
from wamnet.refimpl.network.dataset import FEATURES
from wamnet.refimpl.network.denoise import Model

from .common import Peer, activation_in, layered, told_as_missing

BLOCK = 12
"""Pixels whose sums are in registers: with 32 neurons 24 registers of 16 numbers."""

STRIP = 24
"""Pixels of a row that all layers have in a processor's first cache."""

LANES = 16
"""Numbers of a vector."""


def _sine(hl: Any, x: Any) -> Any:
    """Return the sine of an expression: steps 1 to 4 of compiler/core/sine.py."""
    k = hl.floor(x * sine.INVERSE_PI + 0.5)
    sign = 1.0 - 2.0 * (k - 2.0 * hl.floor(0.5 * k))
    # Otherwise Halide joins the parts of pi.
    r = hl.strict_float(sine.reduce(x, k))
    return sign * sine.polynomial(r)


def _network(model: Model) -> Any:
    """Return a function of images (H, W, C) that is compiled when it is first called."""
    import halide as hl

    neuron, column, row = hl.Var("neuron"), hl.Var("column"), hl.Var("row")
    outer, block, inner = hl.Var("outer"), hl.Var("block"), hl.Var("inner")
    images = [hl.ImageParam(hl.Float(32), 3) for _ in model.features]
    joined, channels = _joined(hl, model, images, (neuron, column, row))
    joined.compute_root().reorder(neuron, column, row).parallel(row)
    network, x = model.siren, joined
    activate = activation_in("Halide", {SINE: lambda x: _sine(hl, x), RELU: lambda x: hl.max(x, 0.0)}, model)
    layers, last = [], len(network.weights) - 1
    kept: list[Any] = []
    for number, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        side, read = (1, len(network.weights[number - 1])) if number else (model.window.size, channels)
        taps = hl.RDom([(0, read), (0, side), (0, side)])
        # Halide counts the quickest index first: (neuron, tap).
        arrays = np.ascontiguousarray(weight.T, np.float32), np.ascontiguousarray(bias, np.float32)
        kept.append(arrays)
        w, b = map(hl.Buffer, arrays)
        summed = hl.Func(f"sums{number}")
        summed[neuron, column, row] = b[neuron]
        tap = taps.x + read * (taps.y + side * taps.z)
        summed[neuron, column, row] += w[neuron, tap] * x[taps.x, column + taps.y, row + taps.z]
        x = hl.Func(f"layer{number}")
        omega = network.omega_0_hidden if number else network.omega_0_first
        found = summed[neuron, column, row]
        shown = hl.clamp(found, 0.0, 1.0) if number == last else activate(found * np.float32(omega).item())
        x[neuron, column, row] = shown
        layers.append((summed, x, taps, len(weight)))
    x.bound(neuron, 0, len(network.weights[-1]))
    x.split(column, outer, column, STRIP, hl.TailStrategy.GuardWithIf)
    x.reorder(neuron, column, outer, row).parallel(row)
    for summed, layer, taps, neurons in layers:
        wide = neurons % LANES == 0
        if layer is not x:
            layer.compute_at(x, outer)
        if layer is x:
            layer.split(column, block, inner, BLOCK, hl.TailStrategy.GuardWithIf)
        else:
            layer.split(column, block, inner, BLOCK).reorder(neuron, inner, block, row)
        if wide:
            layer.vectorize(neuron, LANES)
        summed.compute_at(layer, block).unroll(column)
        summed.update().reorder(neuron, column, taps.x, taps.y, taps.z)
        for stage in (summed, summed.update()):
            if wide:
                stage.vectorize(neuron, LANES)
            stage.unroll(neuron)
        summed.update().unroll(column)
    x.compile_jit(hl.get_jit_target_from_environment())

    def run(given: Sequence[NDArray[np.float32]], kept: Any = tuple(kept)) -> NDArray[np.float32]:
        # Halide's buffers own nothing: `kept` keeps the weights for as long as there is this function.
        for image, values in zip(images, given, strict=True):
            image.set(hl.Buffer(values))
        height, width = given[0].shape[:2]
        return np.array(x.realize([len(network.weights[-1]), width, height]))

    return run


def _joined(hl: Any, model: Model, images: Sequence[Any], indices: tuple[Any, Any, Any]) -> tuple[Any, int]:
    """Return all channels of the images, moved by the window's margin, and their number."""
    channel, column, row = indices
    planes = []
    for name, image in zip(model.features, images, strict=True):
        ends = [(image.dim(d).min(), image.dim(d).extent()) for d in (1, 2)]
        if model.window.border == "clamp":
            bounded = hl.BoundaryConditions.repeat_edge(image, [(0, FEATURES[name].channels), *ends])
        else:
            bounded = hl.BoundaryConditions.constant_exterior(
                image, 0.0, [(0, FEATURES[name].channels), *ends]
            )
        before = model.window.before
        planes += [bounded[c, column - before, row - before] for c in range(FEATURES[name].channels)]
    joined = hl.Func("joined")
    joined[channel, column, row] = hl.mux(channel, planes)
    joined.bound(channel, 0, len(planes)).unroll(channel)
    return joined, len(planes)


def _open(tools: Tools, model: Model, size: int) -> Opened:
    """Return the network, compiled for this processor."""
    with told_as_missing("halide"):
        import halide as hl

        function = _network(model)
    device = f"Halide {version('halide')}, {hl.get_host_target()}"

    def run(given: Given) -> NDArray[np.float32]:
        found: NDArray[np.float32] = function([np.ascontiguousarray(i) for i in given.images.values()])
        return found

    return Opened(run, device, layered(model, fuses=True))


CONTENDERS = (Peer("halide", "Halide, a schedule by hand", _open, packages=("halide",)),)
"""Halide with one schedule."""
