"""ONNX's operators on values: linear ones give fields, and activations give values of their own.

1. A linear operator finds the channels on the axis where its definition has them, or rejects the node.
2. Products of matrices are in float64, and counted before they are computed [`Reader.afford`].
3. The argument of an activation is a field; a sine keeps the factor of it as its scale.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...refimpl.network.imported import Step
from .fields import BATCH, CHANNEL, COLUMNS, PLACE_NUMBERS, ROWS, Array, Field, added, convolved
from .graph import GraphNode
from .reader import (
    AGAIN,
    ANY,
    DOUBLE,
    FLOAT,
    INFERENCE,
    MOST_AXES,
    NUMBER,
    Handler,
    Operator,
    Reader,
    Rule,
    lists,
    only,
)

CHANNELS_LAST = "a matrix maps the last axis, which must be the channels"
"""The rule of matrices."""


def _dropout(reader: Reader, node: GraphNode) -> Field:
    """Return the input, which Dropout changes in training mode only."""
    if np.any(reader.constant(node, 2, False)):
        node.refuse("training_mode=1", "must be 0", "export a network in inference mode")
    return reader.field(node)


def _conv(reader: Reader, node: GraphNode) -> Field:
    """Convolve with stride 1, any dilation, in groups."""
    x, weight = reader.field(node), reader.weight(node, 1)
    bias = reader.weight(node, 2, np.zeros(weight.shape[:1]))
    spatial = x.layout[2:] == (ROWS, COLUMNS) and x.layout[0] in ("", BATCH) and x.has_channels(1)
    if not spatial or weight.ndim != 4 or bias.shape != weight.shape[:1]:
        what = f"axes {x.shown}, weights {weight.shape}, constants {bias.shape}"
        rule = "images (N, C, H, W), weights (D, C, K, L), constants (D,)"
        node.refuse(what, rule, "export two-dimensional images")
    groups, (rows, columns) = int(node.attributes.get("group", 1)), weight.shape[2:]
    if tuple(node.attributes.get("kernel_shape", (rows, columns))) != (rows, columns):
        node.refuse(
            node.attributes["kernel_shape"], f"kernel_shape must be that of weights {weight.shape}", AGAIN
        )
    if weight.shape[1] * groups != x.channels or len(weight) % groups or not weight.size:
        node.refuse(weight.shape, f"weights of {x.channels} channels in {groups} groups", AGAIN)
    products, each = rows * columns * len(x.terms), len(weight) * x.channels
    numbers = rows * columns * each + sum(
        rows * columns * (len(weight) * term.shape[1] + PLACE_NUMBERS) for term in x.terms.values()
    )
    work = rows * columns * each * sum(term.shape[1] for term in x.terms.values())
    reader.afford(node, numbers, products, work)
    full = np.zeros((len(weight), x.channels, rows, columns))
    for group, part in enumerate(np.split(weight, groups)):
        out, into = len(part), part.shape[1]
        full[group * out : (group + 1) * out, group * into : (group + 1) * into] = part
    down, across = (int(step) for step in node.attributes.get("dilations", (1, 1)))
    margins = _margins(node, [(rows - 1) * down, (columns - 1) * across])
    x = reader.padded(node, x, margins, "constant")
    return convolved(x, full, bias, (down, across)).labelled(1)


def _margins(node: GraphNode, reach: Sequence[int]) -> list[int]:
    """Return the margins (above, left, below, right) of a convolution that reaches so far."""
    kind, pads = node.attributes.get("auto_pad", "NOTSET"), node.attributes.get("pads")
    if kind == "NOTSET":
        return [int(n) for n in pads or (0, 0, 0, 0)]
    if pads is not None and any(pads):
        node.refuse(f"{kind} and pads {list(pads)}", "either auto_pad or pads", AGAIN)
    if kind == "VALID":
        return [0] * 4
    first = [n // 2 if kind == "SAME_UPPER" else n - n // 2 for n in reach]
    return [*first, *(n - before for n, before in zip(reach, first, strict=True))]


def _gemm(reader: Reader, node: GraphNode) -> Field:
    """alpha A B + beta C, A being computed and the others constant."""
    x, weight = reader.field(node), reader.weight(node, 1)
    weight = weight if node.attributes.get("transB", 0) else weight.T
    x = _matrix(reader, node, x, float(node.attributes.get("alpha", 1.0)) * weight, rank=2)
    constant = reader.weight(node, 2, 0.0)
    if constant.ndim > 2:
        node.refuse(f"C of shape {constant.shape}", "at most two axes", AGAIN)
    constant, _ = _per_channel(node, x, constant)
    return replace(x, constant=x.constant + float(node.attributes.get("beta", 1.0)) * constant)


def _matrix(reader: Reader, node: GraphNode, x: Field, weight: Array, rank: int = 0) -> Field:
    """Return weight (D, C) times a field; `rank`: how many axes it must have, 0 for any."""
    fits = x.layout and x.has_channels(-1) and weight.ndim == 2 and weight.shape[1:] == (x.channels,)
    if not fits or not weight.size or (rank and len(x.layout) != rank):
        what = f"axes {x.shown}, {x.channels} channels, weights {weight.T.shape}"
        node.refuse(what, CHANNELS_LAST, "transpose before it, or export rows (N, D)")
    columns = sum(term.shape[1] for term in x.terms.values())
    numbers = len(weight) * columns + PLACE_NUMBERS * len(x.terms)
    reader.afford(node, numbers, len(x.terms), weight.size * columns)
    return x.mapped(weight).labelled(len(x.layout) - 1)


def _per_channel(node: GraphNode, x: Field, array: Array) -> tuple[Array, Field]:
    """Return a constant as a number (1,), or one for each channel (C,); and the field with as many axes."""
    x = replace(x, layout=("",) * max(array.ndim - len(x.layout), 0) + x.layout)
    sizes = (1,) * (len(x.layout) - array.ndim) + array.shape
    wide = [axis for axis, size in enumerate(sizes) if size != 1]
    if len(sizes) > MOST_AXES or any(x.layout[a] != CHANNEL or sizes[a] != x.channels for a in wide):
        what = f"a constant of shape {array.shape} beside axes {x.shown}"
        node.refuse(what, "one number, or one for each channel", "export it this way")
    return array.reshape(-1), x


def _summed(sign: float) -> Handler:
    """Return the handler of Add (1) or Sub (-1)."""

    def handler(reader: Reader, node: GraphNode) -> Field:
        x, other, first = reader.pair(node)
        if isinstance(other, Field):
            reader.alike(node, (x, other))
            return added(x, replace(other, scale=other.scale * sign))
        constant, x = _per_channel(node, x.folded(), other)
        return x.scaled(1.0, sign * constant) if first else x.scaled(sign, constant)

    return handler


def _scaled(power: int) -> Handler:
    """Return the handler of Mul (1) or Div (-1)."""

    def handler(reader: Reader, node: GraphNode) -> Field:
        x, other, first = reader.pair(node)
        if isinstance(other, Field) or (power < 0 and not first):
            rule = "one of the factors must be constant, and each divisor"
            return node.refuse("two values", rule, "a network of linear maps and activations has none")
        factors, x = _per_channel(node, x, other)
        if power < 0 and not np.all(factors):
            node.refuse(0, "a divisor other than 0", AGAIN)
        factors = factors if power > 0 else 1.0 / factors
        if factors.size == 1 and x.scale == 1.0 and factors[0]:
            return replace(x, scale=float(factors[0]))
        return x.folded().scaled(factors)

    return handler


def _normalised(reader: Reader, node: GraphNode) -> Field:
    """Batch normalisation in inference: a scale and a constant for each channel, which are axis 1."""
    x = reader.field(node)
    gain, shift, mean, variance = (reader.weight(node, at) for at in range(1, 5))
    sizes = {array.shape for array in (gain, shift, mean, variance)}
    if len(x.layout) < 2 or not x.has_channels(1) or sizes != {(x.channels,)}:
        what = f"axes {x.shown}, {x.channels} channels, constants {', '.join(map(str, sizes))}"
        node.refuse(what, "axis 1 must be the channels, with one constant for each", "transpose before it")
    spread = variance + float(node.attributes.get("epsilon", np.float32(1e-5)))
    if not np.all(spread > 0.0):
        node.refuse(float(spread.min()), "each variance and epsilon must be above 0", AGAIN)
    factor = gain / np.sqrt(spread)
    return x.folded().scaled(factor, shift - factor * mean)


def _sin(reader: Reader, node: GraphNode) -> Field:
    """The sine keeps the factor of its argument."""
    x = reader.field(node)
    scale = float(np.float32(x.scale))
    x = x if scale == x.scale else x.folded()
    return reader.activated(node, replace(x, scale=1.0), Step("sine", (x.scale,)))


def _leaky(reader: Reader, node: GraphNode) -> Field:
    """The larger of x and slope x."""
    slope = float(node.attributes.get("alpha", np.float32(0.01)))
    if not 0.0 <= slope <= 1.0:
        node.refuse(slope, "a slope in [0, 1]", "use another activation")
    return reader.activated(node, reader.field(node).folded(), Step("leaky", (slope,)))


def _clip(reader: Reader, node: GraphNode) -> Field:
    """x between both ends; with a lower end only it is a rectifier."""
    ends = (reader.number(node, "min", 1, -math.inf), reader.number(node, "max", 2, math.inf))
    low, high = (float(np.float32(end)) for end in ends)
    # Ends that a version before 11 writes for none.
    largest = float(np.finfo(np.float32).max)
    low, high = -math.inf if low <= -largest else low, math.inf if high >= largest else high
    if not low <= high:
        node.refuse((low, high), "the lower end at most the upper one", "export the network again")
    step = Step("relu", (low,)) if high == math.inf and low > -math.inf else Step("clip", (low, high))
    return reader.activated(node, reader.field(node).folded(), step)


# ---- the rows ------------------------------------------------------------------------------------------

VALUES: Mapping[str, Operator] = {
    "Add": Operator(_summed(1.0)),
    "BatchNormalization": Operator(
        _normalised,
        {
            "epsilon": NUMBER,
            "momentum": ANY,
            "spatial": only(1),
            "training_mode": only(0, remedy=INFERENCE),
        },
    ),
    "Cast": Operator(
        lambda r, n: replace(r.field(n), integer=False),
        {"to": only(FLOAT, DOUBLE), "saturate": ANY},
        integers=True,
    ),
    "Clip": Operator(_clip, {"min": ANY, "max": ANY}),
    "Conv": Operator(
        _conv,
        {
            "auto_pad": only("NOTSET", "SAME_LOWER", "SAME_UPPER", "VALID"),
            "dilations": lists(2, 1),
            "group": Rule(lambda value: value >= 1, "at least 1"),
            "kernel_shape": lists(2, 1),
            "pads": lists(4, 0),
            "strides": Rule(
                lambda value: list(value) == [1, 1],
                "[1, 1], as a kernel computes every pixel: stride 1",
                "use a network without strides",
            ),
        },
    ),
    "Div": Operator(_scaled(-1)),
    "Dropout": Operator(_dropout, {"ratio": ANY, "seed": ANY}, outputs=2),
    "Gemm": Operator(_gemm, {"alpha": NUMBER, "beta": NUMBER, "transA": only(0), "transB": only(0, 1)}),
    "Identity": Operator(lambda r, n: r.field(n), integers=True),
    "LeakyRelu": Operator(_leaky, {"alpha": NUMBER}),
    "MatMul": Operator(lambda r, n: _matrix(r, n, r.field(n), r.weight(n, 1).T)),
    "Mul": Operator(_scaled(1)),
    "Neg": Operator(lambda r, n: replace(r.field(n), scale=-r.field(n).scale)),
    "Relu": Operator(lambda r, n: r.activated(n, r.field(n).folded(), Step("relu", (0.0,)))),
    "Sin": Operator(_sin),
    "Sub": Operator(_summed(-1.0)),
}
"""The operators on values."""
