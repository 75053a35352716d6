"""Imported: a network that another program has trained, as layers on a window.

1. Images whose numbers lie in stated ranges are read through a window, as features are [`Source`].
2. Layer l maps x to W x + b. What follows it is a step of its own for each layer [`Step`, `STEPS`]; the last
   layer's numbers are clipped, if the network ends so [`forward_imported`]. This function is the one that the
   compiler traces.
3. A picture is that function of the window of each pixel [`evaluate`].

Convolutions are such layers: a neuron for each channel at each place that the window's middle depends on.
models/importing makes them of a graph in ONNX's form. Source of the operators' meanings: ONNX, "Operator
Schemas", operators 1 to 22.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..errors import InputError
from .siren import LARGEST_PARAMETER, Siren
from .window import Window, all_windows, pad

Array = NDArray[np.floating[Any]]

MOST_CHANNELS = 1024
"""Most channels of an image."""

MOST_OUTPUTS = 4
"""Most channels of the result: those of a colour buffer."""

NAME = re.compile("(?=.{1,40}$)[A-Za-z](_?[A-Za-z0-9])*")
"""What an image may be called: kernels have it in names, and languages reserve those with two _ in a row."""

AGAIN = "import the network again"
"""The way out of what no import writes."""


@dataclass(frozen=True)
class Source:
    """An image that the network reads: (H, W, channels), each number in [low, high]."""

    name: str
    channels: int
    low: float
    high: float


@dataclass(frozen=True)
class Step:
    """What a layer does with its sums: a row of [`STEPS`], and its numbers."""

    kind: str
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class StepKind:
    """A row: the function of sums (...) and of `names`; `holds` says which numbers it takes, as `rule`."""

    names: tuple[str, ...]
    forward: Callable[..., Any]
    rule: str
    holds: Callable[..., bool] = lambda *_: True


STEPS: Mapping[str, StepKind] = {
    "sine": StepKind(
        ("scale",),
        lambda x, scale: np.sin(x if scale == 1.0 else scale * x),
        "a scale other than 0",
        lambda scale: scale != 0.0,
    ),
    "relu": StepKind(("floor",), np.maximum, "a floor"),
    "leaky": StepKind(
        ("slope",),
        lambda x, slope: np.maximum(x, slope * x),
        "a slope in [0, 1]",
        lambda slope: 0.0 <= slope <= 1.0,
    ),
    "clip": StepKind(
        ("low", "high"),
        lambda x, low, high: np.minimum(np.maximum(x, low), high),
        "low at most high",
        lambda low, high: low <= high,
    ),
}
"""All steps, by name; each function may be traced."""


@dataclass(frozen=True)
class Imported(Siren):
    """Layers with `steps[l]` after each but the last, whose numbers are clipped to [low, high].

    `sources` are the images that the window is taken from. The omegas and the activation of the base mean
    nothing here.
    """

    steps: tuple[Step, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    sources: tuple[Source, ...] = ()

    @property
    def channels(self) -> int:
        """Return the channels of all images together."""
        return sum(source.channels for source in self.sources)


def forward_imported(network: Imported, x: Any) -> Any:
    """Map windows (..., D_in) to numbers (..., D_out); `x` may be a tracing value."""
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        x = np.matmul(x, weight.T) + bias
        if layer < len(network.steps):
            step = network.steps[layer]
            x = STEPS[step.kind].forward(x, *step.numbers)
    if network.low > -math.inf:
        x = np.maximum(x, network.low)
    return np.minimum(x, network.high) if network.high < math.inf else x


def evaluate(
    network: Imported, window: Window, images: Mapping[str, Array], dtype: DTypeLike = np.float64
) -> Array:
    """Return the picture (H, W, D_out) of images (H, W, C) by name, computed in `dtype`."""
    joined = np.concatenate([images[source.name] for source in network.sources], axis=2).astype(dtype)
    found: Array = forward_imported(network, all_windows(pad(joined, window), window))
    return found.astype(dtype, copy=False)


def check_imported(network: Imported, window: Window) -> None:
    """Refuse images, steps or a clip that mean nothing, and layers that do not fit them."""
    _check_sources(network.sources)
    if len(network.steps) != len(network.weights) - 1:
        rule = f"one after each of the {len(network.weights)} layers but the last"
        raise InputError("number of steps", len(network.steps), rule, AGAIN)
    for layer, step in enumerate(network.steps):
        _check_step(f"step of layer {layer}", step)
    ends = [end for end in (network.low, network.high) if not math.isinf(end)]
    if not network.low <= network.high or not all(map(_is_held, ends)):
        raise InputError("clip", (network.low, network.high), "must be float32 values, low < high", AGAIN)
    inputs, outputs = network.widths[0], network.widths[-1]
    wanted = window.size**2 * network.channels
    if inputs != wanted:
        rule = f"{window.size} x {window.size} pixels of {network.channels} channels are {wanted} numbers"
        raise InputError("inputs of the first layer", inputs, rule, AGAIN)
    if outputs > MOST_OUTPUTS:
        rule = f"at most {MOST_OUTPUTS}, the channels of a colour buffer"
        raise InputError(
            "outputs of the last layer", outputs, rule, "split the network, and import the parts"
        )


def _check_sources(sources: Sequence[Source]) -> None:
    """Refuse images without channels, of one name, or whose ranges are empty."""
    names = [source.name for source in sources]
    if not names or len(set(names)) != len(names) or not all(map(NAME.fullmatch, names)):
        rule = "at least one, each once, of at most 40 letters, digits and single _"
        raise InputError("names of the images", ", ".join(names), rule, AGAIN)
    for source in sources:
        if not 1 <= source.channels <= MOST_CHANNELS:
            rule = f"1 to {MOST_CHANNELS}"
            raise InputError(f"channels of image {source.name}", source.channels, rule, AGAIN)
        if not -LARGEST_PARAMETER <= source.low < source.high <= LARGEST_PARAMETER:
            rule = f"two numbers in order, at most {LARGEST_PARAMETER:g} in magnitude"
            way_out = "give the range of the network's inputs"
            raise InputError(f"range of image {source.name}", (source.low, source.high), rule, way_out)


def _check_step(what: str, step: Step) -> None:
    """Refuse a step that is not known, or numbers that it does not take."""
    kind = STEPS.get(step.kind)
    if kind is None:
        raise InputError(what, step.kind, f"a known one: {', '.join(STEPS)}", AGAIN)
    fits = len(step.numbers) == len(kind.names) and all(map(_is_held, step.numbers))
    if not fits or not kind.holds(*step.numbers):
        raise InputError(f"{what}, {step.kind}", step.numbers, f"{kind.rule}, exact in float32", AGAIN)


def _is_held(number: float) -> bool:
    """Return whether float32 holds a number, and it is not huge."""
    return abs(number) <= LARGEST_PARAMETER and float(np.float32(number)) == number
