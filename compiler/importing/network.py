"""From a file in ONNX's form to a model [`import_network`].

1. Read the graph: nodes that the inputs reach, the rest computed [graph.py].
2. Take each input as an image, with its axis of channels and the range of its numbers [`_source`].
3. Run the operators on fields [operators.py], and bring the output back to the picture's size [`_centred`].
4. Lay out a neuron for each value at each place that a pixel depends on [layers.py].
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ...refimpl.errors import InputError
from ...refimpl.network.dataset import BORDERS, Window
from ...refimpl.network.denoise import Model, check_model
from ...refimpl.network.imported import MOST_CHANNELS, Source
from ..model_file import imported_model
from .fields import Field
from .graph import read
from .layers import Value, layered
from .operators import Reader

LAYOUTS: Mapping[int, tuple[str, ...]] = {
    1: ("C",),
    2: ("N", "C"),
    3: ("H", "W", "C"),
    4: ("N", "C", "H", "W"),
}
"""What the axes of an input are, by their number: rows of numbers, or a picture."""

CHANNELS_LAST = ("N", "H", "W", "C")
"""The axes of a picture whose second axis has any size and whose last one is known."""

RANGE = (0.0, 1.0)
"""The range of an image's numbers, if nobody gives another."""


@dataclass(frozen=True)
class Found:
    """A model, and what is to be said of it.

    `moved`: near the picture's edge the graph computes something else, in so many pixels (`margin`).
    `rounded`: weights that are products of the graph's and were rounded once.
    """

    model: Model
    moved: bool
    margin: int
    rounded: int


def import_network(path: Path, ranges: Mapping[str, tuple[float, float]], border: str = "") -> Found:
    """Return the model of the network in a file, or say which node no kernel can be made of.

    ranges: of images by the names of inputs, "" for all others. `border`: the rule outside of the picture,
    where the graph pads what it computes; "" refuses such a graph.
    """
    if border and border not in BORDERS:
        raise InputError("--border", border, "a known rule", f"use one of {', '.join(BORDERS)}")
    graph = read(path)
    for name in ranges:
        if name and name not in graph.inputs:
            known = ", ".join(graph.inputs)
            raise InputError("--range", name, "the network has no such input", f"inputs are {known}")
    reader = Reader(graph, border)
    sources: list[Source] = []
    for name, each in graph.inputs.items():
        sizes = each.sizes
        layout = _layout(name, sizes)
        source = _source(name, sizes[layout.index("C")], ranges, [source.name for source in sources])
        sources.append(source)
        reader.image(name, source, layout)
    for node in graph.nodes:
        reader.run(node)
    if graph.output not in reader.fields:
        raise InputError("output", graph.output, "it must depend on an input", "export the network again")
    output = _centred(reader, reader.fields[graph.output])
    made = layered(reader.values, output, sources)
    window = Window(made.size, reader.border or "clamp")
    info = {"imported_from": path.name, "operators": str(graph.opset), "producer": graph.producer}
    model = imported_model(made.network, window, {name: text for name, text in info.items() if text})
    check_model(model)
    return Found(model, reader.moved, _margin(reader.values, output), made.rounded)


def _layout(name: str, sizes: tuple[int | None, ...]) -> tuple[str, ...]:
    """Return what the axes of an input are."""
    if len(sizes) == 4 and sizes[1] is None and sizes[3] is not None:
        return CHANNELS_LAST
    if len(sizes) not in LAYOUTS:
        rule = "rows of numbers (N, D), or a picture (N, C, H, W) or (H, W, C)"
        raise InputError(f"input {name}: axes", len(sizes), rule, "export the network so")
    return LAYOUTS[len(sizes)]


def _source(
    name: str, channels: int | None, ranges: Mapping[str, tuple[float, float]], taken: list[str]
) -> Source:
    """Return an input as an image, under a name that kernels can have."""
    if channels is None or not 1 <= channels <= MOST_CHANNELS:
        rule = f"a size from 1 to {MOST_CHANNELS} that the graph states"
        way_out = "export with a fixed number of channels"
        raise InputError(f"input {name}: channels", "any" if channels is None else channels, rule, way_out)
    plain = re.sub("[^A-Za-z0-9]+", "_", name)[:32].strip("_")
    plain = plain if re.match("[A-Za-z]", plain) else f"x{plain}"
    if plain in taken:
        plain = f"{plain}_{len(taken)}"
    return Source(plain, channels, *ranges.get(name, ranges.get("", RANGE)))


def _centred(reader: Reader, output: Field) -> Field:
    """Return the output with the picture's size: without margins its pixel is the window's middle."""
    if "C" not in output.layout or output.grown == (0, 0):
        return output
    shown = " and ".join(f"{n:+d} {what}" for n, what in zip(output.grown, ("rows", "columns"), strict=True))
    if not reader.asked or any(n % 2 for n in output.grown):
        rule = "a kernel writes a picture of the size that it reads"
        way_out = "pad the images, or choose their border with --border zero or clamp"
        raise InputError("size of the output beside the picture's", shown, rule, way_out)
    rows, columns = output.grown
    return output.moved(rows // 2, columns // 2, (-rows, -columns))


def _margin(values: list[Value], output: Field) -> int:
    """Return how far the output reads around a pixel, in all operators one after another."""

    def reach(field: Field) -> int:
        found = 0
        for value, dy, dx in field.terms:
            found = max(found, max(abs(dy), abs(dx)) + known[value])
        return found

    known: dict[int, int] = {}
    for number, value in enumerate(values):
        known[number] = 0 if value.argument is None else reach(value.argument)
    return reach(output)
