"""Networks that see a picture of two lamps, or each lamp's light by itself: for experiments/lamps.py.

1. A network sees windows of the surfaces' features and of colour: of the picture under the lamps' colours,
   or of both lamps' light under white ones [`Lit.inputs`].
2. Its outputs are the picture, or both lamps' light, which the lamps' colours turn into the picture
   [`Lit.picture`].
3. Training is that of headed.py: first weights, pixels, Adam and rates of the reference; the loss is the mean
   square of display-encoded pictures, under colours of the frame or new ones for each pixel [`fit`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Ranges
from wamnet.refimpl.network import adam
from wamnet.refimpl.network.train import Recipe, draw_batch, rate_at

from .headed import (
    CHUNK,
    Head,
    Indices,
    Network,
    Table,
    decoded,
    drawn_from,
    encoded,
    places,
    table,
    taps,
)

Tensor = torch.Tensor

PLANES = ("surfaces", "noisy", "clean")
"""What is known of a frame: features, lights of one path a pixel, those of the reference."""

STOPS = -1.0
"""Exposure of the T_k that the network sees: white lamps are brighter than tinted ones."""

LEAK = 0.05
"""Slope of the loss's picture beyond white: there the target is 1, whatever is brighter is right, and a
derivative of 0 would keep what is wrong."""


class Lit(torch.nn.Module):
    """A network of sines, and what it does with lamps; `both`: it sees and gives each lamp's light."""

    def __init__(self, both: bool, channels: int, recipe: Recipe) -> None:
        super().__init__()
        self.both, self.size = both, recipe.window.size
        colors = 6 if both else 3
        head = Head((), outputs=colors)
        self.network = Network(self.size**2 * (channels + colors), head, recipe)

    def picture(self, data: Table, center: Tensor, row: Tensor, colors: Tensor) -> Tensor:
        """Return display-encoded pixels (N, 3), not clipped, under the lamps' colours (N, 2, 3)."""
        window = taps(center, row, self.size)
        light = data.planes["noisy"][window]
        if self.both:
            seen = encoded((light * 2.0**STOPS).clamp(0.0, 1.0))
        else:
            seen = encoded(under(light, colors[:, None]).clamp(0.0, 1.0))
        outputs = self.network(
            torch.cat([data.planes["surfaces"][window].flatten(1), seen.flatten(1)], dim=-1)
        )
        return encoded(under(decoded(outputs) * 2.0**-STOPS, colors)) if self.both else outputs


def under(lights: Tensor, colors: Tensor) -> Tensor:
    """Return the light (..., 3) of lamps' lights (..., 6) under colours (..., 2, 3)."""
    return lights[..., :3] * colors[..., 0, :] + lights[..., 3:] * colors[..., 1, :]


def drawn_colors(count: int, generator: torch.Generator, ranges: Ranges) -> Tensor:
    """Return colours (count, 2, 3) of any hue, and of saturations and powers in the ranges."""
    assert ranges.saturation is not None
    low, high = ranges.saturation
    own = torch.tensor([sum(light.color) for light in canonical("minicubes").lights], dtype=torch.float32)
    hue = 6.0 * torch.rand(count, 2, 1, generator=generator)
    saturation = low + (high - low) * torch.rand(count, 2, 1, generator=generator)
    # The hexcone: each channel falls from 1 to 1 - saturation around its own sixth.
    turn = (hue + torch.tensor([5.0, 3.0, 1.0])) % 6.0
    colors = 1.0 - saturation * torch.minimum(turn, 4.0 - turn).clamp(0.0, 1.0)
    bright = colors / colors.sum(dim=-1, keepdim=True) * own[:, None]
    if ranges.power is None:
        return bright
    least, most = ranges.power
    return bright * (least + (most - least) * torch.rand(count, 2, 1, generator=generator))


def fit(
    both: bool,
    colors_of: Sequence[Any] | Ranges,
    frames: Sequence[Mapping[str, NDArray[np.float32]]],
    recipe: Recipe,
) -> Lit:
    """Return a network trained on frames, under colours of each, or of these ranges for each pixel."""
    data = laid_out(frames)
    network = Lit(both, data.planes["surfaces"].shape[-1], recipe)
    follow = torch.optim.Adam(network.parameters(), betas=(adam.BETA_1, adam.BETA_2), eps=adam.EPSILON)
    generator = torch.Generator().manual_seed(recipe.seed)
    for step in range(recipe.steps):
        frame, y, x = draw_batch(recipe, step, drawn_from(data), None)
        center, row = places(data, frame, y, x)
        if isinstance(colors_of, Ranges):
            colors = drawn_colors(len(frame), generator, colors_of)
        else:
            colors = torch.tensor(np.array(colors_of), dtype=torch.float32)[torch.from_numpy(frame)]
        target = encoded(under(data.planes["clean"][center], colors).clamp(0.0, 1.0))
        found = network.picture(data, center, row, colors)
        bright = torch.where(found > 1.0, 1.0 + LEAK * (found - 1.0), found)
        loss = (((bright if both else found) - target) ** 2).mean()
        follow.param_groups[0]["lr"] = rate_at(recipe, step)
        follow.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        follow.step()
    return network


def laid_out(frames: Sequence[Mapping[str, NDArray[np.float32]]]) -> Table:
    """Return the planes of frames; the targets are among them."""
    return table(frames, [frame["clean"][..., :3] for frame in frames], PLANES)


@torch.no_grad()
def picture(
    network: Lit, frames: Sequence[Mapping[str, NDArray[np.float32]]], colors: NDArray[np.float64], size: int
) -> NDArray[np.float64]:
    """Return the denoised picture (H, W, 3) of the only frame, under the lamps' colours (2, 3)."""
    data = laid_out(frames)
    height, width = data.shapes[0]
    grid: Indices = np.mgrid[:height, :width].reshape(2, -1)
    center, row = places(data, np.zeros(grid.shape[1], np.int64), grid[0], grid[1])
    own = torch.tensor(colors, dtype=torch.float32)
    found = []
    for k in range(0, len(center), CHUNK):
        part = slice(k, k + CHUNK)
        found.append(network.picture(data, center[part], row[part], own.expand(len(center[part]), 2, 3)))
    pixels: NDArray[np.float64] = torch.cat(found).clamp(0.0, 1.0).numpy().astype(np.float64)
    return pixels.reshape(height, width, 3)
