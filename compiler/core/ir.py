"""The intermediate representation: a program of one pixel, as a list of named operations.

1. A value is the result of one node; nodes are in the order of evaluation and name their operands by
   index, so each value is assigned once [`Node`, `Program`].
2. A value has a type: a number, or a short vector of numbers [`Type`]. Leading lanes (pixels, paths) are not
   part of the program; every operation works on each lane by itself.
3. Weights and tables are beside the nodes, by name [`Program.parameters`]; floats are float32 exactly.
4. How a kernel fills the input named `window` from images is data of the program, not nodes [`Gather`].
5. Programs are built by value numbering: asking twice for the same operation gives the same value
   [`Builder`]. They are printed in one stable text [`text`], whose hash is their identity [`digest`].

What the operations mean is the table in ops.py; what a well-formed program is, the table in verify.py.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...refimpl.network.window import Window

Parameters = Mapping[str, NDArray[Any]]

DTYPES = ("float32", "int32", "uint32", "bool")
"""Kinds of numbers that every target has; arithmetic on uint32 is modulo 2**32."""


class Type(NamedTuple):
    """The type of a value in one lane: a number (shape ()) or a vector (shape (n,))."""

    dtype: str = "float32"
    shape: tuple[int, ...] = ()

    def __str__(self) -> str:
        return self.dtype + "".join(f"[{n}]" for n in self.shape)


OUTPUT_ENCODING = "output_encoding"
"""Key of [`Program.info`] under which a program says how its output is to be read."""

Attribute = str | int | float | Type
"""What a node may carry beside its operands: a name, an index, a constant, the type of an input."""


@dataclass(frozen=True)
class Node:
    """One operation: `args` are indices of earlier nodes, `attributes` are sorted by name.

    `places` are the lines of the reference that made it, callers first. Only listings read them: they
    do not count when nodes are compared.
    """

    op: str
    args: tuple[int, ...]
    type: Type
    attributes: tuple[tuple[str, Attribute], ...] = ()
    places: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def on(self, args: tuple[int, ...], kind: Type | None = None) -> Node:
        """Return the operation on other operands; itself where they are its own."""
        if args == self.args and kind in (None, self.type):
            return self
        return Node(self.op, args, kind or self.type, self.attributes, self.places)

    def __getitem__(self, name: str) -> Attribute:
        return dict(self.attributes)[name]

    def get(self, name: str) -> Attribute | None:
        """Return an attribute, or None when the node does not have it."""
        return dict(self.attributes).get(name)


@dataclass(frozen=True)
class Image:
    """A feature image: an encoded channel lies in [low, high]; `encoding` says how it is made.

    `whole`: its numbers are whole.
    """

    name: str
    channels: int
    low: float
    high: float
    encoding: str = ""
    whole: bool = False

    @property
    def facts(self) -> dict[str, Any]:
        """Return the fields for a manifest; `whole` only where it is true."""
        found = asdict(self)
        return found if self.whole else {name: value for name, value in found.items() if name != "whole"}

    @property
    def range_text(self) -> str:
        """Return "[low, high]" with all digits: other ranges give another text, and so another digest."""
        return f"[{float(self.low)!r}, {float(self.high)!r}]"


@dataclass(frozen=True)
class Gather:
    """The program's input `window` holds, for each tap (dy, dx) in C order, the channels of all `images`.

    `axes` are those along which the window reaches: both, or one, 0 (a column of pixels) or 1 (a row).
    `joined`: the images are the channels of one, which a target holds in several.
    """

    window: Window
    images: tuple[Image, ...]
    axes: tuple[int, ...] = (0, 1)
    joined: bool = False

    @property
    def rows(self) -> int:
        """Return the rows of taps."""
        return self.window.size if 0 in self.axes else 1

    @property
    def columns(self) -> int:
        """Return the columns of taps."""
        return self.window.size if 1 in self.axes else 1

    @property
    def channels(self) -> int:
        """Return the channels of all images together."""
        return sum(image.channels for image in self.images)

    @property
    def n_inputs(self) -> int:
        """Return the length of the window vector."""
        return self.rows * self.columns * self.channels

    @property
    def whole(self) -> bool:
        """Return whether all numbers of the window are whole."""
        return all(image.whole for image in self.images)

    @property
    def by_image(self) -> NDArray[np.intp]:
        """Return the window's indices (n_inputs,): image by image, in each tap by tap, channel by channel."""
        taps = np.arange(self.n_inputs).reshape(-1, self.channels)
        if self.joined:
            return taps.ravel()
        ends = np.cumsum([image.channels for image in self.images])[:-1]
        return np.concatenate([part.ravel() for part in np.split(taps, ends, axis=1)])

    @property
    def groups(self) -> list[list[tuple[Image, int]]]:
        """Return the images, each with its first channel's place in a tap; those that are joined together."""
        firsts = accumulate((image.channels for image in self.images), initial=0)
        found = list(zip(self.images, firsts, strict=False))
        return [found] if self.joined else [[image] for image in found]


@dataclass(frozen=True)
class Program:
    """A function of one lane; `info` says where it came from and how its images are encoded."""

    nodes: tuple[Node, ...]
    outputs: tuple[tuple[str, int], ...]
    parameters: Parameters = field(default_factory=dict)
    gather: Gather | None = None
    info: tuple[tuple[str, str], ...] = ()


class Builder:
    """Makes nodes; the same operation on the same operands is made once (value numbering).

    `places` are those of new nodes that have none: a pass sets them to those of the node that it replaces.
    """

    def __init__(self) -> None:
        self.places: tuple[str, ...] = ()
        self.nodes: list[Node] = []
        self.parameters: dict[str, NDArray[Any]] = {}
        self._numbers: dict[tuple[object, ...], int] = {}
        self._names: dict[tuple[object, ...], str] = {}

    def add(self, node: Node) -> int:
        """Return the index of `node`, which is appended unless it is there already."""
        # repr tells 0.0 from -0.0, which compare equal but divide differently.
        key = (node.op, node.args, node.type, node.attributes and repr(node.attributes))
        if key not in self._numbers:
            self._numbers[key] = len(self.nodes)
            if not node.places and (places := self.where()):
                node = Node(node.op, node.args, node.type, node.attributes, places)
            self.nodes.append(node)
        return self._numbers[key]

    def where(self) -> tuple[str, ...]:
        """Return the places of a new node."""
        return self.places

    def parameter(self, array: NDArray[Any]) -> str:
        """Return the name of an array of weights: W0, W1, ... for matrices, b0, b1, ... for vectors."""
        return self._named("W" if array.ndim == 2 else "b", array)

    def table(self, array: NDArray[Any]) -> str:
        """Return the name of a table: T0, T1, ..."""
        return self._named("T", array)

    def _named(self, letter: str, array: NDArray[Any]) -> str:
        """Return the name of an array, a new one for new content."""
        key = (letter, str(array.dtype), array.shape, array.tobytes())
        if key not in self._names:
            count = sum(name.startswith(letter) for name in self.parameters)
            self._names[key] = f"{letter}{count}"
            self.parameters[self._names[key]] = array
        return self._names[key]


def text(program: Program) -> str:
    """Return the program as text: one line a node, the same bytes for the same program."""
    lines = ["program"]
    if program.gather is not None:
        taps, border = f"{program.gather.rows}x{program.gather.columns}", program.gather.window.border
        lines.append(f"  window {taps}, border {border}")
        lines += [
            f"  image {i.name}: {i.channels}{' whole' * i.whole} in {i.range_text}"
            for i in program.gather.images
        ]
    lines += [f"  %{index} = {_line(node)}" for index, node in enumerate(program.nodes)]
    lines += [f"  output {name} = %{index}" for name, index in program.outputs]
    for name, array in sorted(program.parameters.items()):
        content = sha256(_bytes(array))[:16]
        lines.append(f"  parameter {name}: {array.dtype}{list(array.shape)} sha256 {content}")
    return "\n".join(lines) + "\n"


def _line(node: Node) -> str:
    """Return `op %a, %b {name=value} : type`."""
    words = [node.op]
    if node.args:
        words.append(", ".join(f"%{arg}" for arg in node.args))
    if node.attributes:
        words.append("{" + ", ".join(f"{name}={value}" for name, value in node.attributes) + "}")
    return " ".join(words) + f" : {node.type}"


def digest(program: Program) -> str:
    """Return the SHA-256 of the program's text and of every bit of its parameters, in hexadecimal."""
    return sha256(text(program).encode(), *(_bytes(a) for _, a in sorted(program.parameters.items())))


def sha256(*pieces: bytes) -> str:
    """Return the SHA-256 of the pieces one after another, in hexadecimal."""
    hashed = hashlib.sha256()
    for piece in pieces:
        hashed.update(piece)
    return hashed.hexdigest()


def _bytes(array: NDArray[Any]) -> bytes:
    """Return the array's bytes, little-endian and in C order, the same on every machine."""
    return np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()


def attributes(**given: Attribute | None) -> tuple[tuple[str, Attribute], ...]:
    """Return attributes in the order that nodes keep them; None means absent."""
    return tuple(sorted((name, value) for name, value in given.items() if value is not None))


def users(program: Program) -> Sequence[tuple[int, ...]]:
    """Return, for each node, the indices of the nodes that read it."""
    found: list[list[int]] = [[] for _ in program.nodes]
    for index, node in enumerate(program.nodes):
        for arg in set(node.args):
            found[arg].append(index)
    return [tuple(indices) for indices in found]
