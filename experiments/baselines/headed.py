"""Networks of the paper's kind with other inputs and other heads, in PyTorch, for a study of what they gain.

1. A frame becomes planes [`planes`]: encoded features, colour divided by albedo ("light"), what the a-trous
   filter makes of it ("smooth"), and means of colour around a pixel: nine squares of 8 pixels and nine
   of 32 ("around"), or a window whose taps are 4 pixels apart ("wide").
2. A network sees windows of some planes and the numbers of others at the pixel itself [`Head`].
3. Its outputs become display-encoded colour [`Finish`]: as they are; as light, times albedo; as what is added
   to the smooth picture; or as weights of the window's colours, by which kernel prediction denoises.
4. Training is that of refimpl/network/train.py: first weights, pixels of a step, Adam and its rate; the loss
   is the mean square of display-encoded colour, whatever the head [`fit`].

Sources: demodulation as in SVGF (atrous.py); weights for taps: Bako et al., "Kernel-Predicting Convolutional
Networks for Denoising Monte Carlo Renderings", ACM Transactions on Graphics 36(4), 2017, section 4.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from wamnet.refimpl.encoding import GAMMA, LINEAR_LIMIT, OFFSET, SLOPE, to_display
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import adam, dataset, siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.train import Recipe, draw_batch, rate_at

from . import atrous

Tensor = torch.Tensor
Indices = NDArray[np.int64]
Planes = Mapping[str, NDArray[np.float32]]

LEAST_ALBEDO = 0.02
"""Reflectance below this one does not divide: there is no surface, or a lamp, and its light is its colour."""

LIGHT_STOPS = -2.0
"""Exposure of light in its plane: colour over albedo, of a picture whose white is 1, reaches four."""

BRIGHTEST = 8.0
"""Colour above this counts as this in means over pixels: one path that found a lamp would hide all others."""

LEVELS_PX = (8, 32)
"""Sides, in pixels, of the squares around a pixel: they reach 12 and 48 pixels far, a window 6."""

WIDE_PX = 4
"""Distance of the taps of the wide window, and the side of the squares that they are means of."""

CHUNK = 4096
"""Pixels that are denoised at a time."""


# ---- planes ------------------------------------------------------------------------------------------------


def planes(frame: Frame, features: Sequence[str], scales: Normalization) -> dict[str, NDArray[np.float32]]:
    """Return the planes (H, W, C) of a frame: its features, and what is made of its colour and albedo."""
    linear = np.minimum(np.asarray(frame["color"], np.float64), BRIGHTEST)
    albedo = solid(frame)
    light = np.minimum(linear / albedo, BRIGHTEST)
    made = {
        "light": to_display(light, LIGHT_STOPS),
        "smooth": to_display(atrous.denoise(frame)),
        "around": around(linear),
        "around, light": around(light, LIGHT_STOPS),
        "wide": to_display(box_mean(linear, WIDE_PX)),
        "linear": linear,
        "solid": albedo,
    }
    found = {name: dataset.feature_image(frame, (name,), scales) for name in features}
    return found | {name: np.asarray(plane, np.float32) for name, plane in made.items()}


def solid(frame: Frame) -> NDArray[np.float64]:
    """Return the albedo (H, W, 3), 1 where it is too small to divide by."""
    albedo = np.asarray(frame["albedo"], np.float64)
    return np.where(albedo < LEAST_ALBEDO, 1.0, albedo)


def box_mean(values: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """Return the means (H, W, C) of squares of `side` pixels around each, the border's pixels repeated."""
    before = side // 2
    padded = np.pad(values, ((before, side - before), (before, side - before), (0, 0)), mode="edge")
    sums = np.pad(padded.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0), (0, 0)))
    height, width = values.shape[:2]
    low, high = slice(0, height), slice(side, side + height)
    left, right = slice(0, width), slice(side, side + width)
    total = sums[high, right] - sums[low, right] - sums[high, left] + sums[low, left]
    return np.asarray(total / side**2)


def around(linear: NDArray[np.float64], stops: float = 0.0) -> NDArray[np.float64]:
    """Return display-encoded means of 3 x 3 squares of each size around pixels, (H, W, 9 * 3 * sizes)."""
    found = []
    height, width = linear.shape[:2]
    for side in LEVELS_PX:
        means = np.pad(box_mean(linear, side), ((side, side), (side, side), (0, 0)), mode="edge")
        for dy in (0, side, 2 * side):
            found += [means[dy : dy + height, dx : dx + width] for dx in (0, side, 2 * side)]
    return to_display(np.concatenate(found, axis=-1), stops)


# ---- heads -------------------------------------------------------------------------------------------------

Finish = Callable[[Tensor, Mapping[str, Tensor]], Tensor]
"""Outputs (N, D) and the planes at the pixels (N, C), "taps" (N, T, 3) among them, to colours (N, 3)."""


def encoded(linear: Tensor) -> Tensor:
    """Return linear values display-encoded, without a clip: it would end the derivative."""
    curve = (1.0 + OFFSET) * linear.clamp(min=LINEAR_LIMIT) ** (1.0 / GAMMA) - OFFSET
    return torch.where(linear <= LINEAR_LIMIT, SLOPE * linear, curve)


def decoded(values: Tensor) -> Tensor:
    """Return linear values of display-encoded ones; below 0 they follow the line."""
    limit = SLOPE * LINEAR_LIMIT
    curve = ((values.clamp(min=limit) + OFFSET) / (1.0 + OFFSET)) ** GAMMA
    return torch.where(values <= limit, values / SLOPE, curve)


def regressed(outputs: Tensor, at: Mapping[str, Tensor]) -> Tensor:
    """Return the outputs: today's head."""
    return outputs


def remodulated(outputs: Tensor, at: Mapping[str, Tensor]) -> Tensor:
    """Return light times albedo."""
    return encoded(decoded(outputs) * 2.0**-LIGHT_STOPS * at["solid"])


def added(outputs: Tensor, at: Mapping[str, Tensor]) -> Tensor:
    """Return the smooth picture and what is added to it."""
    return at["smooth"] + outputs


def weighted(outputs: Tensor, at: Mapping[str, Tensor]) -> Tensor:
    """Return the mean of the taps by the softmax of the outputs."""
    weights = torch.softmax(outputs, dim=-1)
    return encoded((weights[:, :, None] * at["taps"]).sum(dim=1))


def weighted_light(outputs: Tensor, at: Mapping[str, Tensor]) -> Tensor:
    """Return the mean of the taps' light, each over its own albedo, times the pixel's albedo."""
    weights = torch.softmax(outputs, dim=-1)
    return encoded((weights[:, :, None] * at["taps of light"]).sum(dim=1) * at["solid"])


@dataclass(frozen=True)
class Head:
    """What a network sees and what its outputs mean: planes by window, planes at the pixel, outputs, finish.

    `spread`: planes that are seen by a window whose taps are WIDE_PX apart.
    """

    windows: tuple[str, ...]
    points: tuple[str, ...] = ()
    spread: tuple[str, ...] = ()
    outputs: int = 3
    finish: Finish = regressed


@dataclass(frozen=True)
class Table:
    """The planes of all frames, padded and flat (P, C), by name; targets (all pixels, 3); `margin` in pixels.

    `start` (F,) is each frame's first pixel, `row` (F,) its pixels a row, `first` (F,) its first target.
    """

    planes: Mapping[str, Tensor]
    targets: Tensor
    start: NDArray[np.int64]
    row: NDArray[np.int64]
    first: NDArray[np.int64]
    shapes: tuple[tuple[int, int], ...]
    margin: int


def table(frames: Sequence[Planes], targets: Sequence[NDArray[np.float32]], names: Sequence[str]) -> Table:
    """Lay out the planes of some frames, with a margin for the widest window."""
    margin = WIDE_PX * 6
    edges = ((margin, margin), (margin, margin), (0, 0))
    flat = {
        name: np.concatenate([_flat(np.pad(frame[name], edges, mode="edge")) for frame in frames])
        for name in names
    }
    shapes = tuple((target.shape[0], target.shape[1]) for target in targets)
    sizes = [(h + 2 * margin) * (w + 2 * margin) for h, w in shapes]
    return Table(
        {name: torch.from_numpy(np.ascontiguousarray(plane)) for name, plane in flat.items()},
        torch.from_numpy(np.concatenate([_flat(target) for target in targets])),
        np.cumsum([0, *sizes[:-1]], dtype=np.int64),
        np.array([w + 2 * margin for _, w in shapes], np.int64),
        np.cumsum([0, *(h * w for h, w in shapes[:-1])], dtype=np.int64),
        shapes,
        margin,
    )


def _flat(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the pixels (H * W, C) of an image (H, W, C)."""
    return image.reshape(-1, image.shape[-1])


def places(data: Table, frame: Indices, y: Indices, x: Indices) -> tuple[Tensor, Tensor]:
    """Return the flat pixels (N,) of frame, y, x (N,) in the padded planes, and their rows' lengths (N,)."""
    row = data.row[frame]
    return torch.from_numpy(data.start[frame] + (y + data.margin) * row + x + data.margin), torch.from_numpy(
        row
    )


def taps(center: Tensor, row: Tensor, size: int, step: int = 1) -> Tensor:
    """Return the flat pixels (N, size * size) of windows around pixels, as dataset.py has them."""
    offset = step * (torch.arange(size) - size // 2)
    rows = center[:, None] + offset * row[:, None]
    return (rows[:, :, None] + offset).reshape(len(center), -1)


def seen(head: Head, data: Table, center: Tensor, row: Tensor, size: int) -> tuple[Tensor, dict[str, Tensor]]:
    """Return what a network sees of pixels (N, D), and the planes at them for its head."""
    window, wide = taps(center, row, size), taps(center, row, size, WIDE_PX)
    parts = [data.planes[name][window].flatten(1) for name in head.windows]
    parts += [data.planes[name][wide].flatten(1) for name in head.spread]
    parts += [data.planes[name][center] for name in head.points]
    at = {name: data.planes[name][center] for name in ("solid", "smooth")}
    if head.finish in (weighted, weighted_light):
        at["taps"] = data.planes["linear"][window]
        at["taps of light"] = at["taps"] / data.planes["solid"][window]
    return torch.cat(parts, dim=-1), at


# ---- training ----------------------------------------------------------------------------------------------


class Network(torch.nn.Module):
    """The sine network, with the first weights of the reference."""

    def __init__(self, n_in: int, head: Head, recipe: Recipe) -> None:
        super().__init__()
        widths = (n_in, *recipe.widths, head.outputs)
        first = siren.init(widths, recipe.omega_0_first, recipe.omega_0_hidden, recipe.seed)
        self.weights, self.biases = (
            torch.nn.ParameterList([torch.nn.Parameter(torch.from_numpy(each)) for each in arrays])
            for arrays in (first.weights, first.biases)
        )
        self.omegas = (recipe.omega_0_first, *[recipe.omega_0_hidden] * (len(recipe.widths) - 1))

    def forward(self, x: Tensor) -> Tensor:
        """Return the outputs (N, D) of inputs (N, D_in)."""
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.nn.functional.linear(x, weight, bias)
            if layer < last:
                x = torch.sin(self.omegas[layer] * x)
        return x


def names_of(head: Head) -> tuple[str, ...]:
    """Return the planes that a head needs."""
    return tuple(dict.fromkeys((*head.windows, *head.points, *head.spread, "linear", "solid", "smooth")))


def fit(head: Head, data: Table, recipe: Recipe) -> Network:
    """Return a network trained on all frames of a table, by the recipe's steps, minibatch and rates."""
    center, row = places(data, *draw_batch(recipe, 0, drawn_from(data), None))
    n_in = seen(head, data, center[:1], row[:1], recipe.window.size)[0].shape[1]
    network = Network(n_in, head, recipe)
    follow = torch.optim.Adam(network.parameters(), betas=(adam.BETA_1, adam.BETA_2), eps=adam.EPSILON)
    for step in range(recipe.steps):
        frame, y, x = draw_batch(recipe, step, drawn_from(data), None)
        center, row = places(data, frame, y, x)
        inputs, at = seen(head, data, center, row, recipe.window.size)
        width = np.array([w for _, w in data.shapes], np.int64)[frame]
        target = data.targets[torch.from_numpy(data.first[frame] + y * width + x)]
        loss = ((head.finish(network(inputs), at) - target) ** 2).mean()
        follow.param_groups[0]["lr"] = rate_at(recipe, step)
        follow.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        follow.step()
    return network


def drawn_from(data: Table) -> dataset.Dataset:
    """Return what the reference draws pixels from: of a data set it asks for the frames' shapes only."""
    nothing, none = np.zeros(0, np.float32), np.zeros(0, np.int64)
    return dataset.Dataset(nothing, nothing, none, none, none, data.shapes, 0, dataset.Window())


@torch.no_grad()
def picture(network: Network, head: Head, data: Table, number: int, size: int) -> NDArray[np.float64]:
    """Return the denoised picture (H, W, 3) of a table's frame."""
    height, width = data.shapes[number]
    y, x = (n.reshape(-1) for n in np.mgrid[:height, :width])
    center, row = places(data, np.full(y.shape, number), y, x)
    found = []
    for k in range(0, len(y), CHUNK):
        inputs, at = seen(head, data, center[k : k + CHUNK], row[k : k + CHUNK], size)
        found.append(head.finish(network(inputs), at).clamp(0.0, 1.0))
    return torch.cat(found).numpy().reshape(height, width, 3).astype(np.float64)
