"""tinygrad as a peer, on the OpenCL device of the executor `opencl`, its program captured by its `TinyJit`.

tinygrad looks for an OpenCL loader in the system. Here it is given the one that this process has open: then
it finds the same platforms, PoCL of the Python package among them, and PoCL knows its processor
(pocl_cpu.py). tinygrad takes the first platform's GPU, or its default device.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.kernels.bench.contenders import Opened, Tools
from wamnet.kernels.bench.workload import Given
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.network.activation import RELU, SINE
from wamnet.refimpl.network.denoise import Model

from .common import Peer, activation_in, layered, told_as_missing

LOADER_VARIABLE = "OPENCL_PATH"
"""Environment variable that names the loader to tinygrad."""

MODES = {"clamp": "replicate", "zero": "constant"}
"""Border rules as modes of `Tensor.pad`."""


def loader() -> str:
    """Return the file of the OpenCL loader that this process has open, nothing if the system does not say."""
    maps = Path("/proc/self/maps")
    lines = maps.read_text().splitlines() if maps.exists() else []
    return next((line.split()[-1] for line in lines if "libOpenCL" in line), "")


def _network(model: Model) -> Any:
    """Return the function of the images that tinygrad captures."""
    from tinygrad import Tensor, TinyJit

    def on_device(array: Any) -> Any:
        return Tensor(np.ascontiguousarray(array, np.float32), device="CL").realize()

    kernels = []
    for layer, weight in enumerate(model.siren.weights):
        side = 1 if layer else model.window.size
        kernels.append(on_device(weight.reshape(len(weight), side, side, -1).transpose(0, 3, 1, 2)))
    biases = [on_device(bias) for bias in model.siren.biases]
    omegas = (model.siren.omega_0_first, *[model.siren.omega_0_hidden] * (len(kernels) - 1))
    activate = activation_in("tinygrad", {SINE: Tensor.sin, RELU: Tensor.relu}, model)
    margins, mode = (model.window.before, model.window.after) * 2, MODES[model.window.border]

    def network(*images: Any) -> Any:
        joined = images[0].cat(*images[1:], dim=-1)
        x = joined.permute(2, 0, 1).unsqueeze(0).pad(margins, mode=mode)
        for number, (weight, bias) in enumerate(zip(kernels, biases, strict=True)):
            x = x.conv2d(weight, bias)
            if number < len(kernels) - 1:
                x = activate(x * omegas[number])
        return x.clamp(0.0, 1.0)[0].permute(1, 2, 0).contiguous().realize()

    return TinyJit(network), on_device


def _open(tools: Tools, model: Model, size: int) -> Opened:
    """Return the network on OpenCL; the first two runs capture it, for one size of picture."""
    executor = tools.executor("opencl")
    os.environ.setdefault(LOADER_VARIABLE, loader())
    with told_as_missing("tinygrad"):
        import tinygrad
        from tinygrad import Device

        device = str(Device["CL"].device_name)
    if device not in executor.device:
        raise ExecutorUnavailable(
            f"tinygrad has {device}, the executor opencl {executor.device}: not the same"
        )
    # A captured program is one of a size.
    by_size: dict[int, Any] = {}

    def run(given: Given) -> NDArray[np.float32]:
        pixels = given.frame.height * given.frame.width
        if pixels not in by_size:
            by_size[pixels] = _network(model)
        function, on_device = by_size[pixels]
        images = [on_device(image) for image in given.images.values()]
        found: NDArray[np.float32] = function(*images).numpy()
        return found

    version = getattr(tinygrad, "__version__", "")
    return Opened(
        run, f"tinygrad {version} on {executor.device}".replace("  ", " "), layered(model, fuses=True)
    )


CONTENDERS = (
    Peer(
        "tinygrad",
        "tinygrad on OpenCL",
        _open,
        packages=("tinygrad", "pyopencl"),
        caches="tinygrad keeps code on disk, ~/.cache/tinygrad",
    ),
)
"""tinygrad with its default options."""
