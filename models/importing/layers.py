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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import InputError
from ...refimpl.network.imported import Imported, Source, Step
from ...refimpl.network.window import LARGEST_WINDOW_PX
from .fields import Array, Field
from .graph import GraphNode

MOST_WEIGHTS = 2**22
"""Most weights of all layers, zeros counted: 16 MiB."""

MOST_NEURONS = 2**13
"""Most neurons of a layer."""

MOST_READS = 2**19
"""Most places of values that all values at all places read: each has a weight at least, and takes time."""

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
    if last and last.argument is not None and last.step and last.step.kind in ("relu", "clip"):
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
    weights.append(carrier.rows([((0, 0), output)]))
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


def _needs(values: Sequence[Value], output: Field, depth: int) -> dict[Spot, int]:
    """Return the spots that are read, and the last level that reads each."""
    spots: list[dict[tuple[int, int], int]] = [{} for _ in values]
    reads = 0

    def read(field: Field, places: Sequence[tuple[int, int]], level: int) -> None:
        nonlocal reads
        reads += len(field.terms) * len(places)
        if reads > MOST_READS:
            rule = f"at most {MOST_READS} in all layers"
            raise InputError("positions that a pixel depends on", reads, rule, WAY_OUT)
        for value, dy, dx in field.terms:
            for row, column in places:
                place = (row + dy, column + dx)
                spots[value][place] = max(spots[value].get(place, 0), level)

    read(output, [(0, 0)], depth)
    for number in range(len(values) - 1, -1, -1):
        argument = values[number].argument
        if argument is not None:
            read(argument, list(spots[number]), values[number].level)
    return {(value, *place): last for value, places in enumerate(spots) for place, last in places.items()}


WAY_OUT = "import a network of fewer channels, fewer layers or smaller kernels"
"""The remedy where a network is too large."""


def _window(spots: Mapping[Spot, int], sources: int) -> int:
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


Parts = tuple[NDArray[np.int64], Array]
"""A value at a place as multiples of the layer's neurons: their indices and factors, (C, parts) both."""

Row = tuple[tuple[int, ...], Field]
"""A place, and a field whose channels are neurons there."""


class Carrier:
    """The neurons of one layer after another, and where in them each value is that is still read."""

    def __init__(
        self, values: Sequence[Value], spots: Mapping[Spot, int], sources: Sequence[Source], size: int
    ) -> None:
        self.values, self.spots = values, spots
        self.places: dict[Spot, Parts] = {}
        self.total, channels = 0, sum(source.channels for source in sources)
        self.width, middle, first = size * size * channels, size // 2, 0
        self.levels: dict[int, list[Spot]] = {}
        for spot in sorted(spots):
            number, dy, dx = spot
            self.levels.setdefault(values[number].level, []).append(spot)
            if number < len(sources):
                first = sum(source.channels for source in sources[:number])
                tap = ((dy + middle) * size + dx + middle) * channels + first
                index = np.arange(tap, tap + sources[number].channels)[:, None]
                self.places[spot] = index, np.ones(index.shape)

    def layer(self, level: int) -> tuple[Array, Array, Step]:
        """Return weights, biases and step of a level, whose neurons take the place of those before."""
        spots = self.levels[level]
        step = _step_of([self.values[spot[0]] for spot in spots])
        rows: list[Row] = []
        places: dict[Spot, Parts] = {}
        start = 0
        for spot in spots:
            argument = self.values[spot[0]].argument
            assert argument is not None
            index = np.arange(start, start + argument.channels)[:, None]
            places[spot] = index, np.ones(index.shape)
            rows.append((spot[1:], argument))
            start += argument.channels
        matrix = self.rows(rows)
        bias = np.concatenate([argument.constant for _, argument in rows])
        blocks = [matrix]
        for spot in sorted(self.places):
            if self.spots[spot] > level:
                block, places[spot] = self._carried(spot, step, start)
                blocks.append(block)
                start += len(block)
        self.places, self.width = places, start
        return np.concatenate(blocks), np.concatenate([bias, np.zeros(start - len(bias))]), step

    def afford(self, neurons: int) -> None:
        """Count the weights of so many more neurons, or refuse them."""
        self.total += neurons * self.width
        if neurons > MOST_NEURONS or self.total > MOST_WEIGHTS:
            rule = f"at most {MOST_NEURONS}, and {MOST_WEIGHTS} weights in all"
            raise InputError("neurons of a layer over its window", neurons, rule, WAY_OUT)

    def rows(self, rows: Sequence[Row]) -> Array:
        """Return the weights (n, width) of the channels of fields at places."""
        total, start = sum(field.channels for _, field in rows), 0
        self.afford(total)
        weights = np.zeros((total, self.width))
        for (y, x), field in rows:
            block = weights[start : start + field.channels]
            for (value, dy, dx), term in field.terms.items():
                for index, factor in zip(*map(np.transpose, self.places[value, y + dy, x + dx]), strict=True):
                    block[:, index] += factor * term
            start += field.channels
        return weights

    def _carried(self, spot: Spot, step: Step, start: int) -> tuple[Array, Parts]:
        """Return the rows that carry a value through a layer, and what it is of them."""
        value, (before, factor) = self.values[spot[0]], self.places[spot]
        # Parts of a value that is carried already are not negative.
        signs = (1.0,) if value.positive or before.shape[1] > 1 else (1.0, -1.0)
        passes = step == Step("relu", (0.0,)) or (step.kind == "leaky" and signs == (1.0,))
        if not passes:
            node = next(v.node for v in self.values if v.level > value.level and v.step == step)
            assert node is not None
            what = str(value.node) if value.node else "an image"
            rule = f"what {what} gives skips past it, which only a ReLU passes exactly"
            node.refuse(step.kind, rule, "use Relu where values are skipped past")
        neurons = before.size * len(signs)
        self.afford(neurons)
        rows = np.zeros((neurons, self.width))
        rows[np.arange(neurons), np.repeat(before, len(signs))] = np.tile(signs, before.size)
        index = np.arange(start, start + neurons).reshape(len(before), -1)
        return rows, (index, np.einsum("cp,s->cps", factor, signs).reshape(index.shape))
