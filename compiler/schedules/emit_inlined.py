"""The inlined schedule: all loops unrolled, weights are constants of the source; values are `vec4`.

1. Each number of a layer is a component of a `vec4` variable; the last one is filled up with neurons
   whose weights are 0, which nothing reads.
2. An affine map multiplies constant matrices of four rows by what it reads: a tap's channels, or a `vec4`.
3. A group of elementwise operations is a function on `vec4`, called for each of a layer's.

For a renderer on a processor (Mesa's llvmpipe) a constant is an operand, while every other read of a weight
is a chain of checks and gathers: measured, a weight in a texture costs 23 times as much, one in a uniform
block 5 times. The price is paid once, when the driver compiles, in proportion to the number of weights
[`LARGEST_WEIGHTS`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Node, Program
from ..core.sums import is_split
from ..core.weights import Slot
from ..languages.dialect import Dialect
from .emit import Body, emit, kernel_gather
from .emit_tiled import refused_by_vectors
from .schedules import Schedule

LARGEST_WEIGHTS = 2**16
"""Most weights of a kernel: llvmpipe compiles some two thousand a second."""

COMPONENTS = ("x", "xy", "xyz", "xyzw")
"""The first one to four components of a `vec4`."""


class Inlined(Schedule):
    """Everything unrolled, weights in the source."""

    name = "inlined"
    idea = "all loops unrolled, every weight a constant of the source"
    order = "every weight is a constant of the source"

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.arguments = dialect.arguments

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        count = sum(array.size for array in weights.weights(program).values())
        if count > LARGEST_WEIGHTS:
            return (
                f"it has {count} weights, of at most {LARGEST_WEIGHTS}: more take a driver minutes to compile"
            )
        return refused_by_vectors(program, self.dialect)

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source."""
        body = InlinedBody(program, self.dialect, kernel_gather(program))
        return emit(program, self.dialect, header, bounded, body)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of a pixel's vectors."""
        body = InlinedBody(program, self.dialect, kernel_gather(program))
        return sum(16 * body.vectors(index) for index in body.group_of if body.declares(index))

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return nothing: no weight lies outside the source."""
        return {}

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return no weights."""
        return np.zeros(0, np.float32)


@dataclass
class InlinedBody(Body):
    """The statements of an inlined kernel; functions of elementwise groups come before it."""

    functions: list[str] = field(default_factory=list)

    def vectors(self, index: int) -> int:
        """Return the number of `vec4` that hold a value."""
        return -(-self.program.nodes[index].type.shape[0] // 4)

    def defines(self) -> list[str]:
        """Return the functions: one for each image's taps, one for each elementwise group."""
        self.functions = [
            line for image in self.gather.images for line in self._tap(image.name, image.channels)
        ]
        for group in self.groups:
            if self.program.nodes[group[0]].op not in ("input", "affine"):
                self.functions += self._function(group)
        return self.functions

    def _tap(self, name: str, channels: int) -> list[str]:
        """Return the function that reads a pixel under the border rule."""
        kind, border = _vector(channels), self.gather.window.border
        value = {"clamp": "texel", "zero": f"at == nearest ? texel : {kind}(0.0f)"}[border]
        return [
            f"{kind} tap_{name}(ivec2 at)",
            "{",
            f"    ivec2 nearest = clamp(at, ivec2(0), textureSize(image_{name}, 0) - 1);",
            f"    {kind} texel = texelFetch(image_{name}, nearest, 0).{'rgba'[:channels]};",
            f"    return {value};",
            "}",
        ]

    def _function(self, group: tuple[int, ...]) -> list[str]:
        """Return the function that computes a group from other groups' vectors."""
        read = [f"vec4 {self._element(index, '')}" for index in self._operands(group)]
        written = [f"out vec4 v{index}" for index in self._results(group)]
        lines = [f"void elementwise_{group[0]}({', '.join([*read, *written])})", "{"]
        for index in group:
            kind = self.dialect.variable(self.program.nodes[index].type.dtype)
            lines.append(f"    {kind} t{index} = {self._expression(index, '')};")
        lines += [f"    v{index} = t{index};" for index in self._results(group)]
        return [*lines, "}"]

    def _operands(self, group: tuple[int, ...]) -> list[int]:
        """Return the vectors from outside that a group reads."""
        read = {arg for index in group for arg in self.program.nodes[index].args} - set(group)
        return sorted(index for index in read if self.program.nodes[index].op != "constant")

    def _results(self, group: tuple[int, ...]) -> list[int]:
        """Return the values of a group that others read."""
        return [index for index in group if self._is_array(index)]

    def _elementwise(self, group: tuple[int, ...]) -> None:
        """Write the calls of a group's function, one for each vector."""
        span = f"%{group[0]}" if len(group) == 1 else f"%{group[0]} to %{group[-1]}"
        self._comment(f"{span}: elementwise on {self.program.nodes[group[0]].type.shape[0]} numbers")
        for vector in range(self.vectors(group[0])):
            results = [f"v{index}_{vector}" for index in self._results(group)]
            self._line(f"vec4 {', '.join(results)};")
            operands = [self._value(index, vector) for index in self._operands(group)]
            self._line(f"elementwise_{group[0]}({', '.join([*operands, *results])});")

    def _value(self, index: int, vector: int) -> str:
        """Return the text of one `vec4` of a value: a variable, or the numbers of a parameter."""
        node = self.program.nodes[index]
        if node.op == "parameter":
            return self._numbers(self.program.parameters[str(node["name"])], vector)
        return f"v{index}_{vector}"

    def _numbers(self, array: NDArray[np.float32], vector: int) -> str:
        """Return four numbers of a vector (n,), filled up with 0, as a constant."""
        return f"vec4({', '.join(map(self._literal, _filled(array, vector)))})"

    def _literal(self, value: float) -> str:
        return self.dialect.literal(float(value)).strip("()")

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x + b, one product of a constant matrix and a vector after another."""
        matrix, bias = self.program.parameters[str(node["weight"])], node.get("bias")
        source, numbers = self.program.nodes[node.args[0]], node.type.shape[0]
        self._comment(f"%{index}: affine map {node['weight']} from {matrix.shape[1]} to {numbers}")
        for vector in range(self.vectors(index)):
            start = self._numbers(self.program.parameters[str(bias)], vector) if bias else "vec4(0.0f)"
            self._line(f"vec4 v{index}_{vector} = {start};")
        if source.op == "input":
            self._windowed(index, matrix)
        else:
            for first in range(0, matrix.shape[1], 4):
                columns = matrix[:, first : first + 4]
                held = f"v{node.args[0]}_{first // 4}.{COMPONENTS[columns.shape[1] - 1]}"
                self._multiply(f"v{index}", columns, held)

    def _windowed(self, index: int, matrix: NDArray[np.float32]) -> None:
        """Write the products of all taps: a partial sum for each row of taps of an image."""
        gather, vectors, split = self.gather, range(self.vectors(index)), is_split(self.gather)
        for image in gather.images:
            self._line(f"{_vector(image.channels)} {image.name}_{index};")
        if split:
            parts = ", ".join(f"part{index}_{vector}" for vector in vectors)
            self._line(f"{self.dialect.variable('float32')} {parts};")
        sums, taps = f"part{index}" if split else f"v{index}", range(gather.rows * gather.columns)
        for group, tap in ((group, tap) for group in gather.groups for tap in taps):
            row, column = divmod(tap, gather.columns)
            dy, dx = row - gather.rows // 2, column - gather.columns // 2
            for image, first in group:
                name, start = f"{image.name}_{index}", tap * gather.channels + first
                self._line(f"{name} = tap_{image.name}(ivec2(x, y) + ivec2({dx}, {dy}));")
                opens = split and column == 0 and first == group[0][1]
                columns = matrix[:, start : start + image.channels]
                self._multiply(sums, columns, name, "=" if opens else "+=")
            if split and column == gather.columns - 1:
                for vector in vectors:
                    self._line(f"v{index}_{vector} += part{index}_{vector};")

    def _multiply(self, sums: str, columns: NDArray[np.float32], value: str, operator: str = "+=") -> None:
        """Write the additions of columns (D_out, k) times `value` with k components to all vectors."""
        count = columns.shape[1]
        kind = "vec4" if count == 1 else f"mat{count}x4"
        for vector in range(-(-columns.shape[0] // 4)):
            numbers = [n for column in columns.T for n in _filled(column, vector)]
            constant = f"{kind}({', '.join(map(self._literal, numbers))})"
            self._line(f"{sums}_{vector} {operator} {constant} * {value};")

    def _outputs(self) -> None:
        """Write the only output."""
        name, index = self.program.outputs[0]
        self._comment(f"output {name}")
        channels = self.program.nodes[index].type.shape[0]
        for vector, result in enumerate(self.dialect.results(channels)):
            components = COMPONENTS[min(4, channels - 4 * vector) - 1]
            self._line(f"{result}.{components} = v{index}_{vector}.{components};")

    def _element(self, index: int, lane: str) -> str:
        """Return the name of a value inside a function."""
        return f"v{index}"

    def _read(self, index: int, lane: str, group: int | None = None) -> str:
        """Return the text of a value inside a function."""
        if self.program.nodes[index].op == "parameter":
            return f"v{index}"
        return super()._read(index, lane, group)


def _components(count: int) -> list[str]:
    """Return the selectors of each component of a float or vector of so many."""
    return [""] if count == 1 else [f".{letter}" for letter in "xyzw"[:count]]


def _vector(components: int) -> str:
    """Return the type of a vector of one to four floats."""
    return "float" if components == 1 else f"vec{components}"


def _filled(array: NDArray[np.float32], vector: int) -> list[float]:
    """Return four numbers of (n,) from 4 * vector on, 0 behind the end."""
    numbers: list[float] = array[4 * vector : 4 * vector + 4].tolist()
    return numbers + [0.0] * (4 - len(numbers))
