"""ONNX's operators on axes: they move labels, pick or join channels, and cut or pad the image.

1. Transpose, Squeeze, Unsqueeze, Reshape and Flatten keep all elements in a known order [`_grouped`].
2. Slice and Concat pick and join channels; Slice and Pad move the edge of the image.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from .fields import CHANNEL, COLUMNS, PLACE_NUMBERS, ROWS, Field, joined
from .graph import GraphNode
from .reader import AGAIN, ANY, LISTED, MOST_AXES, NUMBER, Operator, Reader, only


def _transpose(reader: Reader, node: GraphNode) -> Field:
    """Axes in another order."""
    x = reader.field(node)
    order = list(node.attributes.get("perm", range(len(x.layout))[::-1]))
    if sorted(order) != list(range(len(x.layout))):
        node.refuse(order, f"an order of {len(x.layout)} axes", AGAIN)
    return replace(x, layout=tuple(x.layout[axis] for axis in order))


def _squeeze(reader: Reader, node: GraphNode) -> Field:
    """Leave out axes of one element: those that are named, or all."""
    x = reader.field(node)
    single = [axis for axis, labels in enumerate(x.layout) if not labels or reader.size(x, labels) == 1]
    axes = reader.axes(node, reader.integers(node, "axes", 1, 13, single), len(x.layout))
    if not set(axes) <= set(single):
        node.refuse(axes, f"only axes of one element, of {x.shown}", "leave it out")
    return replace(x, layout=tuple(labels for axis, labels in enumerate(x.layout) if axis not in axes))


def _unsqueeze(reader: Reader, node: GraphNode) -> Field:
    """Put in axes of one element."""
    x, axes = reader.field(node), reader.integers(node, "axes", 1, 13)
    rank = len(x.layout) + len(axes)
    axes, labels = reader.axes(node, axes, rank), iter(x.layout)
    return replace(x, layout=tuple("" if axis in axes else next(labels) for axis in range(rank)))


def _reshape(reader: Reader, node: GraphNode) -> Field:
    """Merge axes, or split those of known sizes."""
    x, shape = reader.field(node), reader.integers(node, "shape", 1, 5)
    if 0 in shape[len(x.layout) :] or (0 in shape and node.attributes.get("allowzero", 0)):
        node.refuse(shape, f"0 only for axes that are kept, of {x.shown}", AGAIN)
    return _grouped(reader, node, x, [size or x.layout[at] for at, size in enumerate(shape)])


def _flatten(reader: Reader, node: GraphNode) -> Field:
    """Merge all axes before one, and all others."""
    x, axis = reader.field(node), int(node.attributes.get("axis", 1))
    if not -len(x.layout) <= axis <= len(x.layout):
        node.refuse(axis, f"an axis of {x.shown}", AGAIN)
    axis += len(x.layout) if axis < 0 else 0
    return _grouped(reader, node, x, ["".join(x.layout[:axis]), "".join(x.layout[axis:])])


def _grouped(reader: Reader, node: GraphNode, x: Field, shape: Sequence[int | str]) -> Field:
    """Return the elements in the same order in axes of a shape: sizes, -1 for the rest, or labels."""
    own = [(labels, reader.size(x, labels) if labels else 1) for labels in x.layout]
    if len(shape) == len(own) and all(size in pair for size, pair in zip(shape, own, strict=True)):
        return x
    left = [label for label in "".join(x.layout) if reader.size(x, label) != 1]
    rest = list(shape).index(-1) if -1 in shape else len(shape)
    before = [_taken(reader, x, size, left, 0) for size in shape[:rest]]
    after = [_taken(reader, x, size, left, -1) for size in shape[:rest:-1]]
    axes = [*before, *(["".join(left)] if rest < len(shape) else []), *after[::-1]]
    split = "?" in axes or (left and rest == len(shape))
    if split or len(axes) > MOST_AXES or any(CHANNEL in labels and labels != CHANNEL for labels in axes):
        what = f"axes {x.shown} to {', '.join(str(size) or '1' for size in shape)}"
        rule = f"it mixes pixels and channels: the {x.channels} channels must stay an axis"
        rule = "it splits or swaps axes, of sizes that the inputs do not state" if split else rule
        node.refuse(what, rule, "keep images (N, C, H, W), or rows (N, D), and state sizes that are split")
    return replace(x, layout=tuple(axes))


def _taken(reader: Reader, x: Field, size: int | str, left: list[str], end: int) -> str:
    """Take an axis of a size, or of labels, from an end of the labels that are left; "?" if none fits."""
    several = [label for label in size if reader.size(x, label) != 1] if isinstance(size, str) else None
    taken: list[str] = []
    elements = 1.0
    while left and (elements < size if isinstance(size, int) else len(taken) < len(several or "")):
        label = left.pop(end)
        taken.insert(len(taken) if end == 0 else 0, label)
        elements *= reader.size(x, label) or math.inf
    fits = elements == size if several is None else taken == several
    return "".join(taken) if fits else "?"


def _concat(reader: Reader, node: GraphNode) -> Field:
    """Channels of several fields beside each other."""
    fields = [reader.field(node, at) for at in range(len(node.inputs))]
    (axis,) = reader.axes(node, [node.attributes["axis"]], len(fields[0].layout))
    reader.alike(node, fields, axis)
    if not all(x.has_channels(axis) for x in fields):
        node.refuse(axis, f"only channels are joined, of axes {fields[0].shown}", "leave it out")
    columns = {place: term.shape[1] for x in fields for place, term in x.terms.items()}
    numbers = sum(x.channels for x in fields) * sum(columns.values()) + PLACE_NUMBERS * len(columns)
    reader.afford(node, numbers)
    return joined(fields).labelled(axis)


def _pad(reader: Reader, node: GraphNode) -> Field:
    """Margins around the image."""
    x, pads = reader.field(node), reader.integers(node, "pads", 1, 11)
    mode, value = node.attributes.get("mode", "constant"), reader.number(node, "value", 2, 0.0)
    rank = len(x.layout)
    axes = reader.axes(node, reader.integers(node, "axes", 3, 18, range(rank)), rank)
    fits = len(pads) == 2 * len(axes)
    sides = {
        x.layout[axis]: pads[at :: len(axes)] for at, axis in enumerate(axes) if any(pads[at :: len(axes)])
    }
    if not fits or not sides.keys() <= {ROWS, COLUMNS} or (mode == "constant" and value):
        rule = "margins of rows and columns, of zeros or of the nearest pixel"
        node.refuse(f"{pads}, {mode}, {value}", rule, "pad images so")
    (above, below), (left, right) = (sides.get(label, (0, 0)) for label in (ROWS, COLUMNS))
    return reader.padded(node, x, (above, left, below, right), mode)


def _slice(reader: Reader, node: GraphNode) -> Field:
    """Some channels, or an image without some rows or columns at its sides."""
    x = reader.field(node)
    starts, ends = (reader.integers(node, name, at, 10) for name, at in (("starts", 1), ("ends", 2)))
    axes = reader.integers(node, "axes", 3, 10, range(len(starts)))
    steps = reader.integers(node, "steps", 4, 10, [1] * len(starts))
    if not len(starts) == len(ends) == len(axes) == len(steps) or any(step != 1 for step in steps):
        node.refuse(f"{starts}, {ends}, {axes}, {steps}", "lists of one length, steps of 1", "use no strides")
    for axis, start, end in zip(reader.axes(node, axes, len(x.layout)), starts, ends, strict=True):
        x = _cropped(reader, node, x, axis, start, end)
    return x


def _cropped(reader: Reader, node: GraphNode, x: Field, axis: int, start: int, end: int) -> Field:
    """Return a field from `start` to before `end` of an axis."""
    labels = x.layout[axis]
    size = reader.size(x, labels) if labels else 1
    if size is not None:
        start, end, _ = slice(start, end).indices(size)
        cut = (start, size - end)
    else:
        cut = (start, -end if end < 0 else 0)
    fits = start < end if size is not None else start >= 0 and (end < 0 or end >= 2**31 - 1)
    if not fits or (any(cut) and labels not in (CHANNEL, ROWS, COLUMNS)):
        rule = "channels, or rows and columns counted from both sides, at least one"
        node.refuse(f"axis {axis} from {start} to {end}", rule, "crop by a number at each side")
    if labels == CHANNEL:
        return x.picked(slice(start, end)).labelled(axis)
    rows, columns = int(labels == ROWS), int(labels == COLUMNS)
    cuts = (cut[0] * rows, cut[0] * columns, cut[1] * rows, cut[1] * columns)
    edges = tuple(max(edge - n, 0) for edge, n in zip(x.edges, cuts, strict=True))
    x = x.moved(cuts[0], cuts[1], (-sum(cut) * rows, -sum(cut) * columns))
    return replace(x, edges=edges)


AXES: Mapping[str, Operator] = {
    "Concat": Operator(_concat, {"axis": ANY}, integers=True),
    "Flatten": Operator(_flatten, {"axis": ANY}, integers=True),
    "Pad": Operator(
        _pad, {"mode": only("constant", "edge", "reflect", "wrap"), "pads": LISTED, "value": NUMBER}
    ),
    "Reshape": Operator(_reshape, {"allowzero": ANY}, integers=True),
    "Slice": Operator(_slice, {"axes": LISTED, "ends": LISTED, "starts": LISTED}, integers=True),
    "Squeeze": Operator(_squeeze, {"axes": LISTED}, integers=True),
    "Transpose": Operator(_transpose, {"perm": LISTED}, integers=True),
    "Unsqueeze": Operator(_unsqueeze, {"axes": LISTED}, integers=True),
}
"""The operators on axes."""
