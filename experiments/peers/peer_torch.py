"""PyTorch as a peer: one convolution as large as the window, then 1 x 1 convolutions, on all threads.

Eager, and compiled by `torch.compile` with its default options. Pictures are in channels-last order, which is
the order of rows with interleaved channels: nothing is copied on the way in or out. Compiled with `torch.fft`
the first layer is computed by the algorithm of our schedule `fft:16`, in tiles of `TILE` pixels [`_spectra`].

It trains too, eager and with its own Adam: a peer of the compiled trainer [`trainer`].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.kernels.bench.contenders import NO_CACHE, Opened, Tools
from wamnet.kernels.bench.workload import Given
from wamnet.refimpl.network.activation import RELU, SINE
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.siren import Siren
from wamnet.refimpl.network.train import Recipe

from .common import Peer, activation_in, layered, told_as_missing

MODES = {"clamp": "replicate", "zero": "constant"}
"""Border rules as modes of `torch.nn.functional.pad`."""

TILE = 32
"""Width and height of a tile of spectra, as of the schedule `fft:16`."""


def _spectra(model: Model) -> Callable[[Any], Any]:
    """Return the first layer's products (1, N, H, W) as a function of a padded picture (1, C, H', W').

    Tiles overlap by the window less one pixel; a spectrum of a tile times the conjugate of a kernel's is that
    of their correlation, whose first pixels no border has touched.
    """
    import torch

    size, weight = model.window.size, torch.from_numpy(model.siren.weights[0].astype(np.float32))
    whole = TILE - size + 1
    kernels = torch.fft.rfft2(
        weight.reshape(len(weight), size, size, -1).permute(1, 2, 3, 0), (TILE, TILE), (0, 1)
    )
    kernels = kernels.conj().resolve_conj().reshape(-1, *kernels.shape[2:])

    def products(x: Any) -> Any:
        height, width = (length - size + 1 for length in x.shape[2:])
        rows, columns = -(-height // whole), -(-width // whole)
        more = [
            length * whole + size - 1 - there for length, there in ((columns, x.shape[3]), (rows, x.shape[2]))
        ]
        x = torch.nn.functional.pad(x[0], (0, more[0], 0, more[1]))
        tiles = x.unfold(1, TILE, whole).unfold(2, TILE, whole)
        spectra = torch.fft.rfft2(tiles).permute(3, 4, 1, 2, 0).reshape(len(kernels), rows * columns, -1)
        sums = torch.bmm(spectra, kernels).reshape(TILE, TILE // 2 + 1, rows, columns, -1)
        maps = torch.fft.irfft2(sums, (TILE, TILE), (0, 1))[:whole, :whole]
        joined = maps.permute(2, 0, 3, 1, 4).reshape(rows * whole, columns * whole, -1)
        return joined[:height, :width].permute(2, 0, 1)[None]

    return products


def network(model: Model, device: str = "cpu", spectra: bool = False) -> Callable[[Any], Any]:
    """Return the network as a function of the images side by side (1, C, H, W), in channels-last order.

    With `spectra` the first layer is computed by them.
    """
    import torch

    size = model.window.size
    first, *others = (torch.from_numpy(w.astype(np.float32)).to(device) for w in model.siren.weights)
    kernels = [first.reshape(len(first), size, size, -1).permute(0, 3, 1, 2).contiguous()]
    kernels += [weight[:, :, None, None] for weight in others]
    kernels = [kernel.to(memory_format=torch.channels_last) for kernel in kernels]
    biases = [torch.from_numpy(bias.astype(np.float32)).to(device) for bias in model.siren.biases]
    omegas = (model.siren.omega_0_first, *[model.siren.omega_0_hidden] * len(others))
    activate = activation_in("PyTorch", {SINE: torch.sin, RELU: torch.relu}, model)
    margins, mode = (model.window.before, model.window.after) * 2, MODES[model.window.border]
    # The compiler makes no code of complex numbers: they are computed eagerly, by FFTs of a library.
    products = torch.compiler.disable(_spectra(model)) if spectra else None

    def computed(x: Any) -> Any:
        x = torch.nn.functional.pad(x, margins, mode=mode)
        for number, (kernel, bias) in enumerate(zip(kernels, biases, strict=True)):
            if products and number == 0:
                x = products(x) + bias[:, None, None]
            else:
                x = torch.nn.functional.conv2d(x, kernel, bias)
            if number < len(others):
                x = activate(omegas[number] * x)
        return x.clamp(0.0, 1.0)

    return computed


def _open(name: str, tools: Tools, model: Model, size: int) -> Opened:
    """Return the network, eager or compiled when it is first run; `torch.fft`: its first layer by spectra."""
    compiled = name != "torch"
    with told_as_missing(name):
        import torch

        computed = network(model, spectra=name == "torch.fft")

        def of_images(images: Sequence[Any]) -> Any:
            return computed(torch.cat(images, dim=1))

        function = torch.compile(of_images) if compiled else of_images

    def run(given: Given) -> NDArray[np.float32]:
        with torch.inference_mode():
            images = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in given.images.values()]
            result: NDArray[np.float32] = function(images)[0].permute(1, 2, 0).numpy()
        return result

    device = f"PyTorch {torch.__version__}, {torch.get_num_threads()} threads"
    return Opened(run, device, layered(model, fuses=compiled))


def trainer(
    recipe: Recipe,
    network: Siren,
    draw: Callable[[int], Any],
    pool: tuple[NDArray[Any], NDArray[Any]] | None = None,
) -> Callable[[int], None]:
    """Return a function that does so many steps of a recipe, from where its last call ended.

    `draw` gives for a step's number its windows (N, D_in) and colours (N, 3), or those of the `pool` (N,).
    """
    with told_as_missing("torch"):
        import torch
    weights = [torch.tensor(weight, requires_grad=True) for weight in network.weights]
    biases = [torch.tensor(bias, requires_grad=True) for bias in network.biases]
    optimizer = torch.optim.Adam([*weights, *biases], lr=recipe.learning_rate, fused=True)
    omegas = [recipe.omega_0_first] + [recipe.omega_0_hidden] * len(recipe.widths)
    gathered = None if pool is None else [torch.from_numpy(array) for array in pool]
    number = [0]

    def step() -> None:
        if gathered is None:
            x, target = map(torch.from_numpy, draw(number[0]))
        else:
            pick = torch.from_numpy(draw(number[0]))
            x, target = (array[pick] for array in gathered)
        for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
            x = torch.nn.functional.linear(x, weight, bias)
            if layer < len(weights) - 1:
                x = torch.sin(omegas[layer] * x)
        optimizer.zero_grad()
        torch.nn.functional.mse_loss(x, target).backward()
        optimizer.step()
        number[0] += 1

    def run(steps: int) -> None:
        for _ in range(steps):
            step()

    return run


CACHES = "PyTorch keeps code on disk, in a folder torchinductor_USER of temporary files"
"""What is kept of compiled code."""

CONTENDERS = tuple(
    Peer(name, text, partial(_open, name), packages=("torch",), caches=CACHES if at else NO_CACHE)
    for at, (name, text) in enumerate(
        {
            "torch": "PyTorch, eager",
            "torch.compile": "PyTorch, compiled",
            "torch.fft": "PyTorch, compiled, its first layer by torch.fft",
        }.items()
    )
)
"""All forms."""
