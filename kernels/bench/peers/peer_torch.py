"""PyTorch as a peer: one convolution as large as the window, then 1 x 1 convolutions, on all threads.

Eager, and compiled by `torch.compile` with its default options. Pictures are in channels-last order, which is
the order of rows with interleaved channels: nothing is copied on the way in or out.

It trains too, eager and with its own Adam: a peer of the compiled trainer [`trainer`].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl.network.activation import RELU, SINE
from ....refimpl.network.denoise import Model
from ....refimpl.network.siren import Siren
from ....refimpl.network.train import Recipe
from ..contender import Contender, Opened, Tools, activation_in, told_as_missing
from ..cost import layered
from ..workload import Given

MODES = {"clamp": "replicate", "zero": "constant"}
"""Border rules as modes of `torch.nn.functional.pad`."""


def _open(compiled: bool, model: Model) -> Opened:
    """Return the network, compiled or not."""
    import torch

    size = model.window.size
    first, *others = (torch.from_numpy(weight.astype(np.float32)) for weight in model.siren.weights)
    kernels = [first.reshape(len(first), size, size, -1).permute(0, 3, 1, 2).contiguous()]
    kernels += [weight[:, :, None, None] for weight in others]
    kernels = [kernel.to(memory_format=torch.channels_last) for kernel in kernels]
    biases = [torch.from_numpy(bias.astype(np.float32)) for bias in model.siren.biases]
    omegas = (model.siren.omega_0_first, *[model.siren.omega_0_hidden] * len(others))
    activate = activation_in("PyTorch", {SINE: torch.sin, RELU: torch.relu}, model)
    margins, mode = (model.window.before, model.window.after) * 2, MODES[model.window.border]

    def network(images: Sequence[Any]) -> Any:
        x = torch.nn.functional.pad(torch.cat(images, dim=1), margins, mode=mode)
        for number, (kernel, bias) in enumerate(zip(kernels, biases, strict=True)):
            x = torch.nn.functional.conv2d(x, kernel, bias)
            if number < len(others):
                x = activate(omegas[number] * x)
        return x.clamp(0.0, 1.0)

    function = torch.compile(network) if compiled else network

    def run(given: Given) -> NDArray[np.float32]:
        with torch.inference_mode():
            images = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in given.images.values()]
            result: NDArray[np.float32] = function(images)[0].permute(1, 2, 0).numpy()
        return result

    device = f"PyTorch {torch.__version__}, {torch.get_num_threads()} threads"
    return Opened(run, device, layered(model, fuses=compiled))


def _open_eager(tools: Tools, model: Model, size: int) -> Opened:
    """Return the network as PyTorch runs it operation by operation."""
    with told_as_missing("torch"):
        return _open(compiled=False, model=model)


def _open_compiled(tools: Tools, model: Model, size: int) -> Opened:
    """Return the network that PyTorch compiles when it is first run."""
    with told_as_missing("torch.compile"):
        return _open(compiled=True, model=model)


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


CONTENDERS = (
    Contender("torch", "PyTorch, eager", _open_eager, packages=("torch",)),
    Contender(
        "torch.compile",
        "PyTorch, compiled",
        _open_compiled,
        packages=("torch",),
        caches="PyTorch keeps code on disk, in a folder torchinductor_USER of temporary files",
    ),
)
"""Both forms."""
