"""From fields to layers: values at all places that a pixel of the output depends on, level by level.

1. The level of a value is the number of activations on the way to it: images have 0. Values of a level are
   one layer's, and must have the same activation [`_step_of`].
2. From the output backwards: which places of which values are needed, and until which level [`_needs`].
3. A layer has a neuron for each channel of its values at each place. What a later level reads of an earlier
   one passes through the layers between, where they are rectifiers: relu(v), and -relu(-v) where v may be
   negative, whose sum is v exactly [`Carrier`].
4. Coefficients, which are products in float64 where linear operators meet, are rounded to float32 once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import InputError
from ...refimpl.network.dataset import LARGEST_WINDOW_PX
from ...refimpl.network.imported import Imported, Source, Step
from .fields import Array, Field
from .graph import GraphNode

MOST_WEIGHTS = 2**22
"""Most weights of all layers, zeros counted: 16 MiB."""

MOST_NEURONS = 2**13
"""Most neurons of a layer."""

Spot = tuple[int, int, int]
"""A value's number and the rows and columns from the output's pixel to where it is read."""


@dataclass(frozen=True)
class Value:
    """An image (no node), or what an activation returns: a step of an argument, `level` activations deep.

    `positive`: no number is below 0.
    """

    channels: int
    level: int
    positive: bool
    node: GraphNode | None = None
    step: Step | None = None
    argument: Field | None = None


@dataclass(frozen=True)
class Layers:
    """The network, its window's size, and the weights that float32 rounded."""

    network: Imported
    size: int
    rounded: int


def layered(values: Sequence[Value], output: Field, sources: Sequence[Source]) -> Layers:
    """Return the layers whose last one is a field, in a window of the images, which are the first values."""
    low, high = -math.inf, math.inf
    at = _alone(output)
    last = values[at] if at is not None else None
    # A clip that nothing follows is the network's own.
    if last is not None and last.argument is not None and last.step is not None and _clips(last.step):
        (low, *rest), output = last.step.numbers, last.argument
        high = rest[0] if rest else math.inf
    output = output.folded()
    depth = 1 + max((values[value].level for value, _, _ in output.terms), default=0)
    spots = _needs(values, output, depth)
    size = _window(spots, len(sources))
    carrier = Carrier(values, spots, sources, size)
    weights, biases, steps = [], [], []
    for level in range(1, depth):
        weight, bias, step = carrier.layer(level)
        weights.append(weight)
        biases.append(bias)
        steps.append(step)
    weights.append(carrier.rows([((0, 0), output, c) for c in range(output.channels)]))
    biases.append(output.constant)
    exact = [*weights, *biases]
    with np.errstate(over="ignore"):
        held = [array.astype(np.float32) for array in exact]
    rounded = sum(int(np.sum(a != b)) for a, b in zip(exact, held, strict=True))
    made = tuple(held[: len(weights)]), tuple(held[len(weights) :])
    network = Imported(*made, 1.0, 1.0, "sine", tuple(steps), low, high, tuple(sources))
    return Layers(network, size, rounded)


def _alone(field: Field) -> int | None:
    """Return the number of the value that a field is, if it is one itself."""
    if len(field.terms) != 1 or np.any(field.constant) or field.scale != 1.0:
        return None
    ((value, dy, dx), term), *_ = field.terms.items()
    same = term.shape[0] == term.shape[1] and np.array_equal(term, np.eye(len(term)))
    return value if same and dy == dx == 0 else None


def _clips(step: Step) -> bool:
    """Return whether a step only clips."""
    return step.kind in ("relu", "clip")


def _needs(values: Sequence[Value], output: Field, depth: int) -> dict[Spot, int]:
    """Return the spots that are read, and the last level that reads each."""
    spots: dict[Spot, int] = {}

    def read(field: Field, row: int, column: int, level: int) -> None:
        for value, dy, dx in field.terms:
            spot = (value, row + dy, column + dx)
            spots[spot] = max(spots.get(spot, 0), level)
        if len(spots) > MOST_NEURONS * 8:
            rule = f"at most {MOST_NEURONS * 8}"
            raise InputError("places that a pixel depends on", len(spots), rule, WAY_OUT)

    read(output, 0, 0, depth)
    for number in range(len(values) - 1, -1, -1):
        argument = values[number].argument
        if argument is not None:
            for value, row, column in [spot for spot in spots if spot[0] == number]:
                read(argument, row, column, values[value].level)
    return spots


WAY_OUT = "import a network of fewer channels, fewer layers or smaller kernels"
"""What helps where a network is too large."""


def _window(spots: Sequence[Spot] | dict[Spot, int], sources: int) -> int:
    """Return the size of the smallest window that holds all places of images that are read."""
    places = [place for value, *both in spots if value < sources for place in both]
    # Of an even number of taps there is one more before the middle.
    size = max(-2 * min(places, default=0), 2 * max(places, default=0) + 1)
    if size > LARGEST_WINDOW_PX:
        rule = f"at most {LARGEST_WINDOW_PX} pixels"
        raise InputError("window that a pixel depends on", size, rule, WAY_OUT)
    return size


def _step_of(values: Sequence[Value]) -> Step:
    """Return the activation of a level's values, or refuse two of them."""
    first = values[0]
    assert first.node is not None
    assert first.step is not None, "levels above 0 are of activations"
    for other in values[1:]:
        if other.step != first.step:
            assert other.node is not None
            rule = f"{first.node} is as deep and is another activation: a layer has one"
            other.node.refuse(other.step, rule, "use one activation at each depth of the network")
    if not all(map(math.isfinite, first.step.numbers)):
        first.node.refuse(first.step.numbers, "only the last Clip may lack its lower end", "give both ends")
    return first.step


Parts = list[tuple[int, float]]
"""A number as multiples of the layer's neurons: their indices and factors."""


class Carrier:
    """The neurons of one layer after another, and where in them each number is that is still needed."""

    def __init__(
        self, values: Sequence[Value], spots: dict[Spot, int], sources: Sequence[Source], size: int
    ) -> None:
        self.values, self.spots = values, spots
        self.places: dict[tuple[Spot, int], Parts] = {}
        self.total, channels = 0, sum(source.channels for source in sources)
        self.width, middle, first = size * size * channels, size // 2, 0
        for value, source in enumerate(sources):
            for _, dy, dx in (spot for spot in spots if spot[0] == value):
                tap = ((dy + middle) * size + dx + middle) * channels + first
                for c in range(source.channels):
                    self.places[(value, dy, dx), c] = [(tap + c, 1.0)]
            first += source.channels

    def layer(self, level: int) -> tuple[Array, Array, Step]:
        """Return weights, biases and step of a level, whose neurons take the place of those before."""
        own = [spot for spot in sorted(self.spots) if self.values[spot[0]].level == level]
        step = _step_of([self.values[spot[0]] for spot in own])
        wanted: list[tuple[tuple[int, ...], Field, int]] = []
        new: dict[tuple[Spot, int], Parts] = {}
        for spot in own:
            argument = self.values[spot[0]].argument
            assert argument is not None
            for c in range(argument.channels):
                new[spot, c] = [(len(wanted), 1.0)]
                wanted.append((spot[1:], argument, c))
        matrix = self.rows(wanted)
        carried: list[NDArray[np.float64]] = []
        for spot in sorted(self.spots):
            value = self.values[spot[0]]
            if value.level < level < self.spots[spot]:
                for c in range(value.channels):
                    rows, parts = self._carried(spot, c, step, len(wanted) + len(carried))
                    carried += rows
                    new[spot, c] = parts
        bias = [argument.constant[c] for _, argument, c in wanted] + [0.0] * len(carried)
        self.places, self.width = new, len(bias)
        return np.concatenate([matrix, *(row[None] for row in carried)]), np.array(bias), step

    def rows(self, wanted: Sequence[tuple[tuple[int, ...], Field, int]]) -> Array:
        """Return the weights (n, width) of channels of fields at places."""
        self.total += len(wanted) * self.width
        if len(wanted) > MOST_NEURONS or self.total > MOST_WEIGHTS:
            rule = f"at most {MOST_NEURONS}, and {MOST_WEIGHTS} weights in all"
            raise InputError("neurons of a layer on its window", len(wanted), rule, WAY_OUT)
        found = np.zeros((len(wanted), self.width))
        for row, ((y, x), field, c) in enumerate(wanted):
            for (value, dy, dx), term in field.terms.items():
                for channel in np.flatnonzero(term[c]).tolist():
                    for index, factor in self.places[(value, y + dy, x + dx), channel]:
                        found[row, index] += factor * term[c, channel]
        return found

    def _carried(self, spot: Spot, c: int, step: Step, start: int) -> tuple[list[Array], Parts]:
        """Return the rows that carry a number through a layer, and what it is of them."""
        value, before = self.values[spot[0]], self.places[spot, c]
        # Parts of a number that is carried already are not negative.
        signs = (1.0,) if value.positive or len(before) > 1 else (1.0, -1.0)
        passes = step == Step("relu", (0.0,)) or (step.kind == "leaky" and signs == (1.0,))
        if not passes:
            node = next(v.node for v in self.values if v.level > value.level and v.step == step)
            assert node is not None
            what = str(value.node) if value.node else "an image"
            rule = f"what {what} gives skips past it, which only a rectifier lets through exactly"
            node.refuse(step.kind, rule, "use Relu where values are skipped past")
        rows: list[Array] = []
        parts: Parts = []
        for index, factor in before:
            for sign in signs:
                row = np.zeros(self.width)
                row[index] = sign
                parts.append((start + len(rows), factor * sign))
                rows.append(row)
        return rows, parts
