"""The packed schedule: four weights a texel, loops over taps and numbers; values are arrays of `vec4`.

1. Each number of a layer is a component of an array of `vec4`; the last one is filled up with neurons
   whose weights are 0, which nothing reads.
2. The weights are a texture of four floats a texel, `weights(i)`: a row of neurons for each input, one input
   after another, filled up as the values are [`Packed.pack`]. An affine map reads an input once, and adds a
   row of weights times it to all neurons.
3. A group of elementwise operations is a function on `vec4`, called for each of a layer's [emit_inlined.py].

The source is short, so that it compiles at once however many weights there are, and a read is four of them
(spec/webpage.md has what that is worth in a browser without a graphics processor).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Node, Program
from ..core.sums import is_split
from ..core.weights import Slot
from ..languages.dialect import Dialect
from .emit import emit, kernel_gather
from .emit_inlined import InlinedBody, _components, _vector
from .emit_tiled import refused_by_vectors
from .schedules import Schedule

WEIGHTS_A_TEXEL = "weights_a_texel"
"""Key of a manifest's schedule: how many floats a texel of the weight texture has, if not one."""


class Packed(Schedule):
    """Loops, and four weights a read."""

    name = "packed"
    idea = "four weights a texel, four neurons a `vec4`"
    order = "matrices input-major, each input's neurons filled up with 0 to a multiple of four"

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.arguments = dialect.arguments

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return refused_by_vectors(program, self.dialect)

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source."""
        body = PackedBody(program, self.dialect, kernel_gather(program))
        body.slots = self.layout(program)
        return emit(program, self.dialect, header, bounded, body)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of a pixel's vectors."""
        body = PackedBody(program, self.dialect, kernel_gather(program))
        return sum(16 * body.vectors(index) for index in body.group_of if body.declares(index))

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return the form of the texture."""
        return {WEIGHTS_A_TEXEL: 4}

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return the slot of each weight, in floats; a shape is the stored one."""
        slots: dict[str, Slot] = {}
        offset = 0
        for name, array in weights.weights(program).items():
            shape = (*array.shape[:0:-1], _filled(array.shape[0]))
            slots[name] = Slot(name, shape, offset)
            offset += int(np.prod(shape))
        return slots

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them."""
        pieces = []
        for array in weights.weights(program).values():
            missing = [(0, _filled(len(array)) - len(array)), *[(0, 0)] * (array.ndim - 1)]
            pieces.append(np.ravel(np.pad(array, missing).T))
        return np.concatenate(pieces, dtype=np.float32) if pieces else np.zeros(0, np.float32)


def _filled(neurons: int) -> int:
    """Return the next multiple of four."""
    return -(-neurons // 4) * 4


def _letters(count: int) -> list[str]:
    """Return the selectors of the first numbers of a `vec4`."""
    return [f".{letter}" for letter in "xyzw"[:count]]


@dataclass
class PackedBody(InlinedBody):
    """The statements of a packed kernel."""

    def _elementwise(self, group: tuple[int, ...]) -> None:
        """Write a loop that calls a group's function, once for each vector."""
        span = f"%{group[0]}" if len(group) == 1 else f"%{group[0]} to %{group[-1]}"
        self._comment(f"{span}: elementwise on {self.program.nodes[group[0]].type.shape[0]} numbers")
        count, results = self.vectors(group[0]), self._results(group)
        for index in results:
            self._line(f"vec4 v{index}[{count}];")
        operands = [self._at(index) for index in self._operands(group)]
        call = ", ".join([*operands, *(f"v{index}[i]" for index in results)])
        self._nested(self.dialect.loop("i", count), [f"elementwise_{group[0]}({call});"])

    def _at(self, index: int) -> str:
        """Return the text of the vector number `i` of a value."""
        node = self.program.nodes[index]
        return self._texel(str(node["name"]), "i") if node.op == "parameter" else f"v{index}[i]"

    def _value(self, index: int, vector: int) -> str:
        """Return the text of one `vec4` of a value."""
        return f"v{index}[{vector}]"

    def _texel(self, name: str, *terms: str) -> str:
        """Return the text of four weights of a parameter."""
        return f"weights({' + '.join([str(self.slots[name].offset // 4), *terms])})"

    def _nested(self, head: str, lines: Sequence[str]) -> None:
        """Write a loop or a block."""
        self._open(head)
        for line in lines:
            self._line(line)
        self._close()

    def _neurons(self, count: int, line: str) -> None:
        """Write a statement for each vector `j` of neurons."""
        self._nested(self.dialect.loop("j", count), [line])

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x + b."""
        name, bias = str(node["weight"]), node.get("bias")
        matrix, count = self.program.parameters[name], self.vectors(index)
        self._comment(f"%{index}: affine map {name} from {matrix.shape[1]} to {matrix.shape[0]}")
        self._line(f"vec4 v{index}[{count}];")
        start = self._texel(str(bias), "j") if bias else "vec4(0.0f)"
        self._neurons(count, f"v{index}[j] = {start};")
        source = node.args[0]
        if self.program.nodes[source].op == "input":
            self._over_images(index, name, count)
            return
        whole, rest = divmod(matrix.shape[1], 4)
        if whole:
            self._open(self.dialect.loop("i", whole))
            self._products(f"v{index}", name, f"v{source}[i]", _letters(4), count, f"i * {4 * count}")
            self._close()
        if rest:
            last = f"v{source}[{whole}]"
            self._products(f"v{index}", name, last, _letters(rest), count, str(4 * whole * count))

    def _over_images(self, index: int, name: str, count: int) -> None:
        """Write the products of all taps: a partial sum for each row of taps of an image."""
        gather, split = self.gather, is_split(self.gather)
        sums = f"part{index}" if split else f"v{index}"
        if split:
            self._line(f"vec4 {sums}[{count}];")
        for group in gather.groups:
            self._open(self.dialect.loop("dy", self.sides.rows))
            if split:
                self._neurons(count, f"{sums}[j] = vec4(0.0f);")
            self._open(self.dialect.loop("dx", self.sides.columns))
            self._line(f"ivec2 at = ivec2(x + dx - {self.sides.column}, y + dy - {self.sides.row});")
            self._line(f"int tap = (dy * {self.sides.columns} + dx) * {gather.channels * count};")
            for image, first in group:
                self._line(f"{_vector(image.channels)} {image.name} = tap_{image.name}(at);")
                parts = _components(image.channels)
                self._products(sums, name, image.name, parts, count, f"tap + {first * count}")
            self._close()
            if split:
                self._neurons(count, f"v{index}[j] += {sums}[j];")
            self._close()

    def _products(
        self, sums: str, name: str, value: str, parts: Sequence[str], count: int, place: str
    ) -> None:
        """Write the additions of rows of weights times each of a value's numbers."""
        terms = [
            f"{self._texel(name, place, str(n * count), 'j')} * {value}{part}" for n, part in enumerate(parts)
        ]
        self._neurons(count, f"{sums}[j] += {' + '.join(terms)};")

    def _outputs(self) -> None:
        """Write the only output."""
        name, index = self.program.outputs[0]
        self._comment(f"output {name}")
        channels = self.program.nodes[index].type.shape[0]
        for vector, result in enumerate(self.dialect.results(channels)):
            components = "xyzw"[: min(4, channels - 4 * vector)]
            self._line(f"{result}.{components} = v{index}[{vector}].{components};")
