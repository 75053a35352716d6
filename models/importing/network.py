"""From a file in ONNX's form to a model [`import_network`].

1. Read the graph: nodes that the inputs reach, the rest computed [graph.py].
2. Take each input as an image, with its axis of channels and the range of its numbers [`_source`].
3. Run the operators on fields: an operator, attribute or value of one that has no row is rejected, as names,
   types and numbers of inputs have been checked before [`run`, values.py, axes.py]. Bring the output back to
   the picture's size [`_centred`].
4. Lay out a neuron for each value at each place that a pixel depends on [layers.py].
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...refimpl.errors import InputError, choice
from ...refimpl.network.denoise import Model, check_model
from ...refimpl.network.imported import MOST_CHANNELS, Source
from ...refimpl.network.window import BORDERS, Window
from ...refimpl.reading import BROKEN
from ..model_file import imported_model
from .axes import AXES
from .fields import Field
from .graph import GraphInput, GraphNode, read
from .layers import layered
from .reader import AGAIN, INFERENCE, NONE, Operator, Reader
from .values import VALUES

LAYOUTS: Mapping[int, str] = {1: "C", 2: "PC", 3: "HWC", 4: "NCHW"}
"""The axes of an input by their number, as labels [fields.py]: rows of values, or an image."""

CHANNELS_LAST = "NHWC"
"""The axes of an image whose second axis has any size and whose last one is known."""

OUTPUTS = ("PC", "NHWC", "NCHW")
"""The axes of an output, of which those of one element may be missing."""

RANGE = (0.0, 1.0)
"""The range of an image's values, unless the caller gives another."""

TYPES: Mapping[str, tuple[float, float]] = {
    **{
        name: (-float(np.finfo(name).max), float(np.finfo(name).max))
        for name in ("float16", "float32", "float64")
    },
    **{name: (np.iinfo(name).min, np.iinfo(name).max) for name in ("int8", "int16", "uint8", "uint16")},
}
"""The types of inputs, and the range of each: that of integers is the default, and float32 holds it."""


OPERATORS: Mapping[str, Operator] = {**VALUES, **AXES}
"""All operators that are imported."""


@dataclass(frozen=True)
class Found:
    """A model, and its report.

    `margin`: in so many pixels from the image's edge the graph computes something else, or nothing.
    `rounded`: weights that are products of the graph's and were rounded once. `types`: those of the images.
    """

    model: Model
    margin: int
    rounded: int
    types: Mapping[str, str]

    @property
    def moved(self) -> bool:
        """Return whether the model differs from the graph near the image's edge."""
        return self.margin > 0


def import_network(path: Path, ranges: Mapping[str, tuple[float, float]], border: str = "") -> Found:
    """Return the model of the network in a file, or say which node no kernel can be made of.

    ranges: of images by the names of inputs, "" for all others. `border`: the rule outside of the picture,
    where the graph pads what it computes; "" refuses such a graph.
    """
    if border and border not in BORDERS:
        raise InputError("--border", border, "unknown", choice(border, BORDERS))
    graph = read(path)
    for name in ranges:
        if name and name not in graph.inputs:
            known = ", ".join(graph.inputs)
            raise InputError("--range", name, "the network has no such input", f"choose one of {known}")
    reader = Reader(graph, border)
    sources: list[Source] = []
    for name, each in graph.inputs.items():
        layout = LAYOUTS.get(len(each.sizes), "")
        if not layout:
            rule = "rows of values (N, D), or an image (N, C, H, W) or (H, W, C)"
            raise InputError(f"input {name}: axes", len(each.sizes), rule, "export it this way")
        if len(layout) == 4 and each.sizes[1] is None and each.sizes[3] is not None:
            layout = CHANNELS_LAST
        if each.dtype not in TYPES:
            rule = f"one of {', '.join(TYPES)}"
            raise InputError(
                f"input {name}: type of the elements", each.dtype, rule, "export with float32 inputs"
            )
        source = _source(name, each, layout, ranges, [source.name for source in sources])
        sources.append(source)
        reader.image(name, source, layout, each)
    for node in graph.nodes:
        run(reader, node)
    if graph.output not in reader.fields:
        raise InputError("output", graph.output, "must depend on an input", "export the network again")
    output, margin = _centred(reader, reader.fields[graph.output])
    layers = layered(reader.values, output, sources)
    window = Window(layers.size, reader.border or "clamp")
    info = {"imported_from": path.name, "operators": str(graph.opset), "producer": graph.producer}
    model = imported_model(layers.network, window, {name: text for name, text in info.items() if text})
    check_model(model)
    types = {source.name: each.dtype for source, each in zip(sources, graph.inputs.values(), strict=True)}
    return Found(model, margin, layers.rounded, types)


def _source(
    name: str,
    each: GraphInput,
    layout: str,
    ranges: Mapping[str, tuple[float, float]],
    taken: list[str],
) -> Source:
    """Return an input as an image, under a name that kernels can have."""
    channels = each.sizes[layout.index("C")]
    if channels is None or channels > MOST_CHANNELS:
        rule = f"a size from 1 to {MOST_CHANNELS} that the graph states"
        way_out = "export with a fixed number of channels"
        raise InputError(f"input {name}: channels", "any" if channels is None else channels, rule, way_out)
    least, most = TYPES[each.dtype]
    low, high = ranges.get(name, ranges.get("", RANGE if each.dtype.startswith("float") else (least, most)))
    if not least <= low <= high <= most:
        rule = f"inside [{least:g}, {most:g}], as its type is {each.dtype}"
        raise InputError(
            f"input {name}: range", (low, high), rule, "give the range of its values with --range"
        )
    plain = re.sub("[^A-Za-z0-9]+", "_", name)[:32].strip("_")
    plain = plain if re.match("[A-Za-z]", plain) else f"x{plain}"
    if plain in taken:
        plain = f"{plain}_{len(taken)}"
    return Source(plain, channels, low, high)


def _centred(reader: Reader, output: Field) -> tuple[Field, int]:
    """Return the output with the image's size, whose pixel is the window's middle, and its margin."""
    labels = [label for label in "".join(output.layout) if reader.size(output, label) != 1]
    if not any(labels == [label for label in order if label in labels] for order in OUTPUTS):
        rule = "rows of values (N, D), or an image (N, C, H, W) or (N, H, W, C), not transposed"
        raise InputError("axes of the output", output.shown, rule, "transpose it back")
    rows, columns = output.grown
    if (rows, columns) != (0, 0):
        shown = f"{rows:+d} rows and {columns:+d} columns"
        if not reader.asked or rows % 2 or columns % 2:
            rule = "a kernel writes an image of the size that it reads"
            way_out = "pad the images, or choose their border with --border zero or clamp"
            raise InputError("sizes of output and input image", shown, rule, way_out)
        output = output.moved(rows // 2, columns // 2, (-rows, -columns))
    # What was cut off has no pixels in the graph, and what was added is in no pixel of the model.
    edges = zip(output.edges, (rows, columns, rows, columns), strict=True)
    return output, max(0, *(edge - grown // 2 for edge, grown in edges))


def run(reader: Reader, node: GraphNode) -> None:
    """Add the result of a node."""
    operator = OPERATORS.get(node.op)
    if operator is None:
        rule = f"supported are {', '.join(sorted(OPERATORS))}"
        node.refuse(node.op, rule, "export the network without it, or compute it outside")
    for name, value in node.attributes.items():
        allowed = operator.attributes.get(name, NONE)
        if not allowed.holds(value):
            node.refuse(f"{name}={value}", f"{name} must be {allowed.text}", allowed.remedy)
    if len(node.outputs) > operator.outputs:
        node.refuse(", ".join(node.outputs), "further outputs are for training", INFERENCE)
    operands = [reader.fields[name] for name in node.inputs if name in reader.fields]
    if any(x.integer for x in operands) and not operator.integers:
        node.refuse("integers", "it would round or wrap integers", "Cast the input to float32 first")
    try:
        with np.errstate(all="ignore"):
            result = operator.handler(reader, node)
    except InputError:
        raise
    except (*BROKEN, RuntimeError) as error:
        node.refuse(f"{type(error).__name__}: {error}", "its inputs or attributes do not fit", AGAIN)
    reader.add(node, result)
