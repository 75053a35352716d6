"""ONNX's operators on fields: one function each, which returns the operator's result or refuses the node.

1. A handler reads the node's inputs and attributes as its version of the operators has them [`HANDLERS`].
2. Linear operators give fields [fields.py]; activations give values of their own [`Reader.activated`].
3. Convolutions and Pad move the picture's edge. Margins of images are the window's border rule; margins of
   what is computed are not, and are taken so only where the caller has chosen a rule [`Reader.padded`].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.network.imported import Source, Step
from .fields import CHANNEL, COLUMNS, ROWS, Array, Field, added, convolved, identity
from .graph import Graph, GraphNode
from .layers import Value

KNOWN_MODES = {"constant": "zero", "edge": "clamp"}
"""Modes of Pad that are border rules."""

FLOAT = 1
"""ONNX's number for float32."""

CHANNELS_LAST = "a matrix maps the last axis, which must be the channels"
"""The rule of matrices."""


class Reader:
    """What is known of a graph's tensors so far: fields by name, and values in order.

    `asked` is the border rule that the caller has chosen, "" for none; `border` the one that the graph has.
    `moved`: near the picture's edge the graph computes something else.
    """

    def __init__(self, graph: Graph, asked: str) -> None:
        self.graph, self.asked = graph, asked
        self.border, self.moved = asked, False
        self.fields: dict[str, Field] = {}
        self.values: list[Value] = []

    def image(self, name: str, source: Source, layout: tuple[str, ...]) -> None:
        """Add an image."""
        self.fields[name] = identity(len(self.values), source.channels, layout=layout)
        self.values.append(Value(source.channels, 0, source.low >= 0.0))

    def run(self, node: GraphNode) -> None:
        """Add the result of a node."""
        if node.op not in HANDLERS:
            rule = f"known are {', '.join(sorted(HANDLERS))}"
            node.refuse(node.op, rule, "export the network without it, or compute it outside")
        self.fields[node.output] = HANDLERS[node.op](self, node)

    def field(self, node: GraphNode, at: int = 0) -> Field:
        """Return an input that is computed."""
        if at < len(node.inputs) and node.inputs[at] in self.fields:
            return self.fields[node.inputs[at]]
        return node.refuse(f"input {at}", "it must come from the network's inputs", "change the network")

    def constant(self, node: GraphNode, at: int, default: Any = None) -> NDArray[Any]:
        """Return an input that is constant; without one that is left out it is the default."""
        name = node.inputs[at] if at < len(node.inputs) else ""
        if not name and default is not None:
            return np.asarray(default)
        if name not in self.graph.constants:
            node.refuse(f"input {at}", "it must be constant: a weight of the graph", "export the network so")
        return self.graph.constants[name]

    def option(self, node: GraphNode, name: str, at: int, since: int, default: Any = None) -> Any:
        """Return what was an attribute before a version of the operators, and is a constant input since."""
        if self.graph.opset < since:
            return np.asarray(node.attributes.get(name, default))
        return self.constant(node, at, default)

    def pair(self, node: GraphNode) -> tuple[Field, NDArray[Any] | Field, bool]:
        """Return a field, the other operand, and whether the field comes first."""
        first = node.inputs[0] in self.fields
        x = self.field(node, 0 if first else 1)
        other = node.inputs[1 if first else 0]
        return x, self.fields[other] if other in self.fields else self.graph.constants[other], first

    def activated(self, node: GraphNode, argument: Field, step: Step) -> Field:
        """Return what an activation makes of a field: a value of its own."""
        number, places = len(self.values), argument.terms
        level = 1 + max((self.values[value].level for value, _, _ in places), default=0)
        positive = step.kind in ("relu", "clip") and step.numbers[0] >= 0.0
        self.values.append(Value(argument.channels, level, positive, node, step, argument))
        return identity(number, argument.channels, argument)

    def padded(self, node: GraphNode, x: Field, margins: Sequence[int], mode: str) -> Field:
        """Return a field with margins (above, left, below, right), by the mode of a border rule."""
        above, left, below, right = (int(margin) for margin in margins)
        if not any((above, left, below, right)):
            return x
        if min(above, left, below, right) < 0:
            node.refuse(list(margins), "margins of at least 0", "use Slice to cut")
        rule = KNOWN_MODES.get(mode, "")
        # A margin of images themselves is what a window reads outside of the picture.
        of_images = x.grown == (0, 0) and all(
            not self.values[value].level and not dy and not dx for value, dy, dx in x.terms
        )
        kept = of_images and rule and (rule == "clamp" or not np.any(x.constant))
        if kept and self.border in ("", rule):
            self.border = rule
        elif self.asked:
            self.moved = True
        else:
            node.refuse(
                f"margins {above}, {left}, {below}, {right}, {mode}",
                "a kernel reads a window of the picture: only images have margins, of one rule "
                "(zeros, or the nearest pixel)",
                "put one Pad before the first convolution, or choose the picture's border with --border "
                "zero or clamp: then pixels near the edge differ",
            )
        return x.moved(-above, -left, (above + below, left + right))


Handler = Callable[[Reader, GraphNode], Field]
"""(reader, node) -> its result."""


def _same(reader: Reader, node: GraphNode) -> Field:
    """What changes nothing here: Identity, and Dropout after training."""
    return reader.field(node)


def _cast(reader: Reader, node: GraphNode) -> Field:
    """Cast to float32, which numbers are already."""
    if node.attributes["to"] != FLOAT:
        node.refuse(node.attributes["to"], "only to float32 (1)", "export a network of float32")
    return reader.field(node)


# ---- linear operators -----------------------------------------------------------------------------------


def _conv(reader: Reader, node: GraphNode) -> Field:
    """Convolve with stride 1, any dilation, in groups."""
    x, weight = reader.field(node), reader.constant(node, 1).astype(np.float64)
    bias = reader.constant(node, 2, np.zeros(len(weight))).astype(np.float64)
    if x.layout[1:] != (CHANNEL, ROWS, COLUMNS) or weight.ndim != 4:
        rule = "images (N, C, H, W) and weights (D, C, K, L)"
        node.refuse(
            f"axes {', '.join(x.layout)}, weights {weight.shape}", rule, "export two-dimensional images"
        )
    groups, kernel = int(node.attributes.get("group", 1)), weight.shape[2:]
    if any(step != 1 for step in node.attributes.get("strides", ())):
        rule = "a kernel computes every pixel: stride 1"
        node.refuse(node.attributes["strides"], rule, "use a network without strides")
    if groups < 1 or weight.shape[1] * groups != x.channels or len(weight) % groups:
        node.refuse(weight.shape, f"weights of {x.channels} channels in {groups} groups", "export it again")
    if x.loose and kernel != (1, 1):
        node.refuse(kernel, "a Reshape before it has lost the rows of the picture", "leave Reshape out")
    full = np.zeros((len(weight), x.channels, *kernel))
    for group, part in enumerate(np.split(weight, groups)):
        rows, columns = len(part), part.shape[1]
        full[group * rows : (group + 1) * rows, group * columns : (group + 1) * columns] = part
    dilation = tuple(int(step) for step in node.attributes.get("dilations", (1, 1)))
    margins = _margins(node, [(n - 1) * step for n, step in zip(kernel, dilation, strict=True)])
    x = reader.padded(node, x, margins, "constant")
    return convolved(x, full, bias, (0, 0), (dilation[0], dilation[1]))


def _margins(node: GraphNode, reach: Sequence[int]) -> list[int]:
    """Return the margins (above, left, below, right) of a convolution that reaches so far."""
    kind = node.attributes.get("auto_pad", b"NOTSET")
    kind = kind.decode() if isinstance(kind, bytes) else kind
    if kind in ("SAME_UPPER", "SAME_LOWER"):
        first = [n // 2 if kind == "SAME_UPPER" else n - n // 2 for n in reach]
        return [*first, *(n - before for n, before in zip(reach, first, strict=True))]
    return [int(n) for n in node.attributes.get("pads", (0, 0, 0, 0))] if kind == "NOTSET" else [0] * 4


def _gemm(reader: Reader, node: GraphNode) -> Field:
    """alpha A B + beta C, A being computed and the others constant."""
    x, weight = reader.field(node), reader.constant(node, 1).astype(np.float64)
    constant = reader.constant(node, 2, 0.0).astype(np.float64)
    weight = weight if node.attributes.get("transB", 0) else weight.T
    if node.attributes.get("transA", 0) or len(x.layout) != 2:
        node.refuse(f"axes {', '.join(x.layout)}", CHANNELS_LAST, "export rows of numbers (N, D)")
    added_on = np.broadcast_to(np.squeeze(constant), len(weight)) * float(node.attributes.get("beta", 1.0))
    return _matrix(node, x, float(node.attributes.get("alpha", 1.0)) * weight, added_on)


def _matmul(reader: Reader, node: GraphNode) -> Field:
    """Map the last axis by a constant matrix."""
    weight = reader.constant(node, 1).astype(np.float64)
    if weight.ndim != 2:
        node.refuse(weight.shape, "a matrix of two axes", "export linear layers")
    return _matrix(node, reader.field(node), weight.T, np.zeros(weight.shape[1]))


def _matrix(node: GraphNode, x: Field, weight: Array, constant: Array) -> Field:
    """Return weight (D, C) times a field, plus a constant (D,)."""
    if x.layout[-1] != CHANNEL or weight.shape[1] != x.channels:
        found = f"axes {', '.join(x.layout)}, {x.channels} channels, weights {weight.T.shape}"
        node.refuse(found, CHANNELS_LAST, "transpose before it")
    return x.mapped(weight, constant)


def _per_channel(node: GraphNode, x: Field, array: NDArray[Any]) -> Array:
    """Return a constant as a number (1,), or one for each channel (C,)."""
    shape, layout = array.shape, x.layout
    shape = shape[max(len(shape) - len(layout), 0) :] if array.ndim > len(layout) else shape
    labels = zip(layout[len(layout) - len(shape) :], shape, strict=True)
    fits = all(n == 1 or (label == CHANNEL and n == x.channels) for label, n in labels)
    if not fits or array.size not in (1, x.channels):
        rule = "one number, or one for each channel"
        node.refuse(
            f"a constant of shape {array.shape} beside axes {', '.join(layout)}", rule, "export it so"
        )
    return array.astype(np.float64).reshape(-1)


def _summed(sign: float) -> Handler:
    """Return the handler of Add (1) or Sub (-1)."""

    def handler(reader: Reader, node: GraphNode) -> Field:
        x, other, first = reader.pair(node)
        if isinstance(other, Field):
            alike = (x.layout, x.grown, x.channels) == (other.layout, other.grown, other.channels)
            if not alike:
                rule = "both must have the same axes, channels and size"
                node.refuse("two values", rule, "crop what is skipped past convolutions, or pad first")
            return added(x, replace(other, scale=other.scale * sign))
        constant = _per_channel(node, x, other)
        x = x.folded()
        if first:
            return replace(x, constant=x.constant + sign * constant)
        turned = replace(x, scale=sign).folded()
        return replace(turned, constant=turned.constant + constant)

    return handler


def _scaled(power: int) -> Handler:
    """Return the handler of Mul (1) or Div (-1)."""

    def handler(reader: Reader, node: GraphNode) -> Field:
        x, other, first = reader.pair(node)
        if isinstance(other, Field) or (power < 0 and not first):
            rule = "one of the factors must be constant, and each divisor"
            return node.refuse("two values", rule, "a network of linear maps and activations has none")
        factors = _per_channel(node, x, other)
        if power < 0 and not np.all(factors):
            node.refuse(0, "a divisor other than 0", "export the network again")
        factors = factors if power > 0 else 1.0 / factors
        if factors.size == 1 and x.scale == 1.0 and factors[0]:
            return replace(x, scale=float(factors[0]))
        return x.mapped(np.diag(np.broadcast_to(factors, x.channels)))

    return handler


def _negative(reader: Reader, node: GraphNode) -> Field:
    """-x."""
    x = reader.field(node)
    return replace(x, scale=-x.scale)


def _normalised(reader: Reader, node: GraphNode) -> Field:
    """Batch normalisation after training: a scale and a constant for each channel."""
    x = reader.field(node)
    gain, shift, mean, variance = (reader.constant(node, at).astype(np.float64) for at in range(1, 5))
    factor = gain / np.sqrt(variance + float(node.attributes.get("epsilon", 1e-5)))
    return x.mapped(np.diag(factor), shift - factor * mean)


# ---- activations ----------------------------------------------------------------------------------------


def _sin(reader: Reader, node: GraphNode) -> Field:
    """The sine keeps the factor of its argument."""
    x = reader.field(node)
    scale = float(np.float32(x.scale))
    x = x if scale == x.scale else x.folded()
    return reader.activated(node, replace(x, scale=1.0), Step("sine", (x.scale,)))


def _relu(reader: Reader, node: GraphNode) -> Field:
    """The larger of x and 0."""
    return reader.activated(node, reader.field(node).folded(), Step("relu", (0.0,)))


def _leaky(reader: Reader, node: GraphNode) -> Field:
    """The larger of x and slope x."""
    slope = float(node.attributes.get("alpha", np.float32(0.01)))
    if not 0.0 <= slope <= 1.0:
        node.refuse(slope, "a slope in [0, 1]", "use another activation")
    return reader.activated(node, reader.field(node).folded(), Step("leaky", (slope,)))


def _clip(reader: Reader, node: GraphNode) -> Field:
    """x between both ends; with a lower end only it is a rectifier."""
    low, high = (
        float(reader.option(node, name, at, 11, default))
        for name, at, default in (("min", 1, -math.inf), ("max", 2, math.inf))
    )
    # Ends that a version before 11 writes for none.
    largest = float(np.finfo(np.float32).max)
    low, high = -math.inf if low <= -largest else low, math.inf if high >= largest else high
    if not low <= high:
        node.refuse((low, high), "the lower end at most the upper one", "export the network again")
    step = Step("relu", (low,)) if high == math.inf and low > -math.inf else Step("clip", (low, high))
    return reader.activated(node, reader.field(node).folded(), step)


# ---- axes -----------------------------------------------------------------------------------------------


def _transpose(reader: Reader, node: GraphNode) -> Field:
    """Axes in another order."""
    x = reader.field(node)
    order = node.attributes.get("perm", range(len(x.layout))[::-1])
    if sorted(order) != list(range(len(x.layout))):
        node.refuse(list(order), f"an order of {len(x.layout)} axes", "export the network again")
    return replace(x, layout=tuple(x.layout[axis] for axis in order))


def _axes(reader: Reader, node: GraphNode, rank: int, since: int = 13) -> list[int]:
    """Return axes, counted from 0."""
    found = [int(axis) for axis in np.ravel(reader.option(node, "axes", 1, since))]
    if not all(-rank <= axis < rank for axis in found):
        node.refuse(found, f"axes of {rank}", "export the network again")
    return sorted(axis % rank for axis in found)


def _squeeze(reader: Reader, node: GraphNode) -> Field:
    """Leave out axes of one element."""
    x = reader.field(node)
    gone = _axes(reader, node, len(x.layout))
    if any(x.layout[axis] in (CHANNEL, ROWS, COLUMNS) for axis in gone):
        node.refuse(gone, f"only axes of one picture, of {', '.join(x.layout)}", "leave it out")
    return replace(x, layout=tuple(label for axis, label in enumerate(x.layout) if axis not in gone))


def _unsqueeze(reader: Reader, node: GraphNode) -> Field:
    """Put in axes of one element."""
    x = reader.field(node)
    rank = len(x.layout) + np.size(reader.option(node, "axes", 1, 13))
    given, labels = _axes(reader, node, int(rank)), iter(x.layout)
    return replace(x, layout=tuple("N" if axis in given else next(labels) for axis in range(int(rank))))


def _reshape(reader: Reader, node: GraphNode) -> Field:
    """Pixels in another order of axes, their channels last as before."""
    x, shape = reader.field(node), [int(n) for n in np.ravel(reader.constant(node, 1))]
    if x.layout[-1] != CHANNEL or not shape or shape[-1] != x.channels or len(shape) > 4:
        rule = f"the last axis must stay the {x.channels} channels"
        node.refuse(
            f"axes {', '.join(x.layout)} to {shape}", rule, "keep pictures (N, C, H, W), or rows (N, D)"
        )
    return replace(
        x, layout=("N", "H", "W", "C")[4 - len(shape) :] if len(shape) > 2 else ("N", "C"), loose=True
    )


def _flatten(reader: Reader, node: GraphNode) -> Field:
    """Rows of channels stay what they are."""
    x = reader.field(node)
    if len(x.layout) != 2 or node.attributes.get("axis", 1) != 1:
        rule = "it mixes pixels and channels"
        node.refuse(f"axes {', '.join(x.layout)}", rule, "keep pictures (N, C, H, W)")
    return x


def _concat(reader: Reader, node: GraphNode) -> Field:
    """Channels of several fields beside each other."""
    fields = [reader.field(node, at).folded() for at in range(len(node.inputs))]
    first, axis = fields[0], int(node.attributes["axis"])
    if any((f.layout, f.grown) != (first.layout, first.grown) for f in fields):
        node.refuse(len(fields), "all must have the same axes and size", "crop or pad them alike")
    if axis % len(first.layout) != first.axis:
        node.refuse(axis, f"only channels are joined, axis {first.axis}", "leave it out")
    total, start, parts = sum(f.channels for f in fields), 0, []
    for part in fields:
        place = np.eye(total)[:, start : start + part.channels]
        parts.append(part.mapped(place))
        start += part.channels
    found = parts[0]
    for part in parts[1:]:
        found = added(found, part)
    return found


def _pad(reader: Reader, node: GraphNode) -> Field:
    """Margins around the picture."""
    x = reader.field(node)
    pads = [int(n) for n in np.ravel(reader.option(node, "pads", 1, 11))]
    mode = node.attributes.get("mode", b"constant")
    mode = mode.decode() if isinstance(mode, bytes) else mode
    value = float(reader.option(node, "value", 2, 11, 0.0))
    rank = len(x.layout)
    axes = range(rank) if len(node.inputs) < 4 else [int(a) % rank for a in reader.constant(node, 3)]
    margins = {x.layout[a]: (pads[i], pads[i + len(axes)]) for i, a in enumerate(axes)} if pads else {}
    others = [pair for label, pair in margins.items() if label not in (ROWS, COLUMNS) and any(pair)]
    if others or len(pads) != 2 * len(axes) or x.loose or (mode == "constant" and value):
        rule = "margins of rows and columns, of zeros or of the nearest pixel"
        node.refuse(f"{pads}, {mode}, {value}", rule, "pad pictures so")
    (above, below), (left, right) = (margins.get(label, (0, 0)) for label in (ROWS, COLUMNS))
    return reader.padded(node, x, (above, left, below, right), mode)


def _slice(reader: Reader, node: GraphNode) -> Field:
    """Some channels, or a picture without some rows or columns at its sides."""
    x, rank = reader.field(node), len(reader.field(node).layout)
    starts, ends = (np.ravel(reader.option(node, n, i, 10)) for i, n in ((1, "starts"), (2, "ends")))
    axes = np.ravel(reader.option(node, "axes", 3, 10, np.arange(len(starts))))
    steps = np.ravel(reader.constant(node, 4, np.ones(len(starts)))) if len(node.inputs) > 4 else [1]
    for axis, start, end in zip(axes.tolist(), starts.tolist(), ends.tolist(), strict=True):
        label = x.layout[axis % rank]
        if label == CHANNEL:
            chosen = np.arange(x.channels)[start:end]
            x = (
                x.picked(chosen)
                if len(chosen)
                else node.refuse((start, end), "at least one channel", "widen it")
            )
        elif label in (ROWS, COLUMNS) and not x.loose and start >= 0 and (end < 0 or end >= 2**31 - 1):
            cut = start + (-end if end < 0 else 0)
            rows, columns = (1, 0) if label == ROWS else (0, 1)
            x = x.moved(start * rows, start * columns, (-cut * rows, -cut * columns))
        else:
            rule = "channels, or rows and columns counted from both sides"
            node.refuse(f"axis {label} from {start} to {end}", rule, "crop by a number at each side")
    if any(step != 1 for step in steps):
        node.refuse(list(steps), "steps of 1", "use a network without strides")
    return x


HANDLERS: Mapping[str, Handler] = {
    "Add": _summed(1.0),
    "BatchNormalization": _normalised,
    "Cast": _cast,
    "Clip": _clip,
    "Concat": _concat,
    "Conv": _conv,
    "Div": _scaled(-1),
    "Dropout": _same,
    "Flatten": _flatten,
    "Gemm": _gemm,
    "Identity": _same,
    "LeakyRelu": _leaky,
    "MatMul": _matmul,
    "Mul": _scaled(1),
    "Neg": _negative,
    "Pad": _pad,
    "Relu": _relu,
    "Reshape": _reshape,
    "Sin": _sin,
    "Slice": _slice,
    "Squeeze": _squeeze,
    "Sub": _summed(-1.0),
    "Transpose": _transpose,
    "Unsqueeze": _unsqueeze,
}
"""All operators that are read."""
