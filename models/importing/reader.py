"""The state of an import, and how an operator's inputs are read.

1. Fields have the names of the graph's tensors; values, images first, are in order [`Reader`].
2. An option is an attribute or a constant input, as the version of the operators has it. Its type and its
   size are checked before it is used [`Reader.integers`, `Reader.number`, `Reader.weight`].
3. What is computed is limited before it is computed [`Reader.afford`].
4. Convolutions and Pad move the image's edge. Margins of images are the window's border rule; margins of
   what is computed are not, and are taken so only where the caller has chosen a rule [`Reader.padded`].
5. An operator is a row of a table: its handler, and the attributes that it may have [`Operator`, `Rule`].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import InputError
from ...refimpl.network.imported import Source, Step
from .fields import BATCH, CHANNEL, COLUMNS, ROWS, Array, Field, identity
from .graph import Graph, GraphInput, GraphNode
from .layers import WAY_OUT, Value

KNOWN_MODES = {"constant": "zero", "edge": "clamp"}
"""Modes of Pad that are border rules."""

FLOAT, DOUBLE = 1, 11
"""ONNX's numbers for float32 and float64."""

MOST_AXES = 8
"""Most axes of a value; lists of axes, sizes, starts, ends or margins have at most twice as many elements."""

MOST_NUMBERS = 2**24
"""Most numbers of float64 in all fields of a graph: 128 MiB."""

MOST_WORK = 2**32
"""Most multiplications in all products of matrices, of which each counts PRODUCT_WORK more: seconds."""

PRODUCT_WORK = 2**13
"""Multiplications that could be done while Python starts a product."""

AGAIN = "export the network again"
"""The remedy where no exporter writes such a node."""


class Reader:
    """The state of an import: fields by name, values in order, and the sizes of axes that inputs state.

    `asked` is the border rule that the caller has chosen, "" for none; `border` the one that the graph has.
    """

    def __init__(self, graph: Graph, asked: str) -> None:
        self.graph, self.asked = graph, asked
        self.border = asked
        self.fields: dict[str, Field] = {}
        self.values: list[Value] = []
        self.sizes: dict[str, int] = {}
        self.numbers = self.work = 0

    def image(self, name: str, source: Source, layout: Sequence[str], of: GraphInput) -> None:
        """Add an image."""
        for label, size in zip(layout, of.sizes, strict=True):
            if label != CHANNEL and size and self.sizes.setdefault(label, size) != size:
                rule = f"{self.sizes[label]} as of the inputs before: all images have one size"
                raise InputError(f"input {name}: size of axis {label}", size, rule, "export it this way")
        # Of a batch of any size one image is meant.
        labels = tuple("" if label == BATCH and self.sizes.get(label, 1) == 1 else label for label in layout)
        empty = Field(np.zeros(source.channels), {}, labels, integer=np.dtype(of.dtype).kind in "iu")
        x = identity(len(self.values), source.channels, empty)
        self.fields[name] = x.labelled(layout.index(CHANNEL))
        self.values.append(Value(source.channels, 0, source.low >= 0.0))

    def add(self, node: GraphNode, x: Field) -> None:
        """Keep the result of a node, if it has pixels and is not too large."""
        for label in (ROWS, COLUMNS):
            size = self.size(x, label)
            if size is not None and size < 1:
                node.refuse(size, f"at least one element on axis {label}", "use larger images")
        self.numbers += x.numbers
        self.afford(node, 0)
        self.fields[node.output] = x

    def afford(self, node: GraphNode, numbers: int, products: int = 0, work: int = 0) -> None:
        """Count products of matrices and their multiplications; refuse too many, or too large a result."""
        self.work += work + products * PRODUCT_WORK
        for what, count, most in (
            ("numbers", self.numbers + numbers, MOST_NUMBERS),
            ("multiplications", self.work, MOST_WORK),
        ):
            if count > most:
                node.refuse(f"{count} {what}", f"at most {most} in all linear operators together", WAY_OUT)

    def size(self, x: Field, label: str) -> int | None:
        """Return the size of a label of a field, None for any."""
        if label == CHANNEL:
            return x.channels
        grown = dict(zip((ROWS, COLUMNS), x.grown, strict=True)).get(label, 0)
        return self.sizes[label] + grown if label in self.sizes else None

    def field(self, node: GraphNode, at: int = 0) -> Field:
        """Return an input that is computed."""
        if at < len(node.inputs) and node.inputs[at] in self.fields:
            return self.fields[node.inputs[at]]
        return node.refuse(f"input {at}", "must come from the network's inputs", "change the network")

    def constant(self, node: GraphNode, at: int, default: Any = None) -> NDArray[Any]:
        """Return an input that is constant; without one that is left out it is the default."""
        name = node.inputs[at] if at < len(node.inputs) else ""
        if not name and default is not None:
            return np.asarray(default)
        if name not in self.graph.constants:
            node.refuse(f"input {at}", "must be constant: a weight of the graph", "export it this way")
        return self.graph.constants[name]

    def weight(self, node: GraphNode, at: int, default: Any = None) -> Array:
        """Return an input of constant floating-point numbers, as float64."""
        array = self.constant(node, at, default)
        if array.dtype.kind != "f":
            node.refuse(f"input {at} of {array.dtype}", "must be float16, float32 or float64", AGAIN)
        return array.astype(np.float64)

    def option(self, node: GraphNode, name: str, at: int, since: int, default: Any = None) -> NDArray[Any]:
        """Return what was an attribute before a version of the operators, and is a constant input since."""
        if self.graph.opset >= since:
            return self.constant(node, at, default)
        return np.asarray(node.attributes.get(name, () if default is None else default))

    def number(self, node: GraphNode, name: str, at: int, default: float) -> float:
        """Return an option since version 11 that is a number."""
        array = self.option(node, name, at, 11, default)
        if array.size != 1 or array.dtype.kind != "f" or np.isnan(array).any():
            node.refuse(
                f"{name} of {array.dtype}, shape {array.shape}", "one number of floating point", AGAIN
            )
        return float(array.reshape(()))

    def integers(self, node: GraphNode, name: str, at: int, since: int, default: Any = None) -> list[int]:
        """Return an option that is a list of integers."""
        array = self.option(node, name, at, since, default)
        if array.size > 2 * MOST_AXES or array.ndim > 1 or (array.size and array.dtype.kind not in "iu"):
            what = f"{name} of {array.dtype}, shape {array.shape}"
            node.refuse(what, f"at most {2 * MOST_AXES} integers", AGAIN)
        return [int(n) for n in np.ravel(array)]

    def axes(self, node: GraphNode, axes: Sequence[int], rank: int) -> list[int]:
        """Return axes of so many, counted from 0."""
        counted = [axis % rank for axis in axes if -rank <= axis < rank <= MOST_AXES]
        if len(set(counted)) != len(axes):
            node.refuse(list(axes), f"each axis once, of {rank}, which may be at most {MOST_AXES}", AGAIN)
        return counted

    def pair(self, node: GraphNode) -> tuple[Field, Array | Field, bool]:
        """Return a field, the other operand, and whether the field comes first."""
        first = node.inputs[0] in self.fields
        x, other = self.field(node, 0 if first else 1), 1 if first else 0
        both = node.inputs[other] in self.fields
        return x, self.field(node, other) if both else self.weight(node, other), first

    def alike(self, node: GraphNode, fields: Sequence[Field], axis: int | None = None) -> None:
        """Refuse fields of other axes or sizes; channels that are joined on an axis may differ in number."""
        plain = [x if axis is None else replace(x, constant=np.zeros(1)).labelled(axis) for x in fields]
        if len({(x.layout, x.grown, x.channels) for x in plain}) > 1:
            what = " and ".join(x.shown for x in fields[:2])
            rule = "all must have the same axes, channels and size"
            node.refuse(what, rule, "crop what is skipped past convolutions, or pad first")

    def activated(self, node: GraphNode, argument: Field, step: Step) -> Field:
        """Return what an activation makes of a field: a value of its own."""
        self.afford(node, argument.channels**2)
        number, places = len(self.values), argument.terms
        level = 1 + max((self.values[value].level for value, _, _ in places), default=0)
        positive = step.kind in ("relu", "clip") and step.numbers[0] >= 0.0
        self.values.append(Value(argument.channels, level, positive, node, step, argument))
        return identity(number, argument.channels, argument)

    def padded(self, node: GraphNode, x: Field, margins: Sequence[int], mode: str) -> Field:
        """Return a field with margins (above, left, below, right), by the mode of a border rule."""
        above, left, below, right = margins
        if not any(margins):
            return x
        if min(margins) < 0:
            node.refuse(list(margins), "margins of at least 0", "use Slice to cut")
        rule = KNOWN_MODES.get(mode, "")
        # A margin of images themselves is what a window reads outside of the image.
        of_images = x.grown == (0, 0) and all(
            not self.values[value].level and not dy and not dx for value, dy, dx in x.terms
        )
        kept = of_images and rule and (rule == "clamp" or not np.any(x.constant))
        kept = kept and self.border in ("", rule)
        if kept:
            self.border = rule
        elif not self.asked:
            node.refuse(
                f"margins {above}, {left}, {below}, {right}, {mode}",
                "a kernel reads a window of the image: only images have margins, of one rule "
                "(zeros, or the nearest pixel)",
                "put one Pad before the first convolution, or choose the image's border with --border "
                "zero or clamp: then pixels near the edge differ",
            )
        # What differs already is further in now, and does not repeat what is outside of the image.
        pairs = zip(x.edges, margins, strict=True)
        edges = tuple(edge + margin if edge or not kept else 0 for edge, margin in pairs)
        return replace(x.moved(-above, -left, (above + below, left + right)), edges=edges)


# ---- operators --------------------------------------------------------------------------------------------

Handler = Callable[[Reader, GraphNode], Field]
"""(reader, node) -> its result."""


@dataclass(frozen=True)
class Rule:
    """Which values of an attribute are right, in words, and the remedy."""

    holds: Callable[[Any], bool]
    text: str
    remedy: str = AGAIN


@dataclass(frozen=True)
class Operator:
    """A row: the handler, the attributes, the most outputs, and whether integers stay what they are."""

    handler: Handler
    attributes: Mapping[str, Rule] = field(default_factory=dict)
    outputs: int = 1
    integers: bool = False


def only(*values: Any, remedy: str = AGAIN) -> Rule:
    """Return the rule of some values."""
    return Rule(lambda value: value in values, " or ".join(str(value) for value in values), remedy)


def lists(size: int, least: int) -> Rule:
    """Return the rule of a list of so many integers."""
    text = f"{size} integers of at least {least}"
    return Rule(lambda value: len(value) == size and min(value) >= least, text)


NONE = Rule(lambda _: False, "left out: it is not supported")
"""The rule of other attributes."""

ANY = Rule(lambda _: True, "")
"""The rule of attributes that change nothing in inference."""

LISTED = Rule(lambda value: len(value) <= 2 * MOST_AXES, f"at most {2 * MOST_AXES} integers")
"""The rule of lists that the handler checks."""

NUMBER = Rule(math.isfinite, "a finite number")
"""The rule of numbers."""

INFERENCE = "export the network for inference, as after model.eval()"
"""The remedy of training modes."""
