"""Kinds of cases that are functions of numbers: traced, so that the bound of each answer is computed.

1. A function of the reference is called with float64 numbers that float32 holds exactly: the expected value.
2. The same function, traced, has for each output a range of what single precision may give, under the
   promises of profile `ieee` (compiler/ranges.py): its farther end is the bound [`bounded`]. Where a decision
   is closer to its threshold than rounding, the range holds both ways, and the case has the flag `undecided`.
3. Cases are chosen numbers, edge cases first, and others from the project's own generator [`drawn`].
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compiler import ranges
from ...compiler.ir import Program, Type
from ...compiler.lower_scene import PASSES
from ...compiler.passes import pipeline
from ...compiler.trace import trace
from ...refimpl import rng, vectors
from .case import Case, Kind, Output

Numbers = Mapping[str, Any]

SOURCE = "range of single precision under profile ieee (compiler/ranges.py)"
"""Where these bounds come from."""

SEED = 20_240_817
"""Seed of the numbers that are drawn for cases."""


class Field(NamedTuple):
    """An input or output: what it is, its components (0: a number), and the least and largest value given."""

    text: str
    count: int = 0
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class Function:
    """A function of the reference as a kind of case: `call` has the inputs and the float type of constants.

    `given`: inputs of cases with a note; `draws` more are drawn by `draw` from uniform numbers in [0, 1).
    """

    name: str
    title: str
    clause: str
    inputs: Mapping[str, Field]
    outputs: Mapping[str, Field]
    call: Callable[[Numbers, Any], Numbers]
    given: Sequence[tuple[str, Numbers]] = ()
    draw: Callable[[NDArray[np.float64]], Numbers] | None = None
    draws: int = 8

    def kind(self) -> Kind:
        """Return the kind of case."""
        fields = [
            {name: f"{_shape(field.count)}, {field.text}" for name, field in side.items()}
            for side in (self.inputs, self.outputs)
        ]
        return Kind(self.name, self.title, fields[0], fields[1], self.cases, self.answer)

    def cases(self) -> list[Case]:
        """Return the cases with their answers and bounds."""
        rows = [(note, values) for note, values in self.given]
        if self.draw is not None:
            rows += [("", self.draw(drawn(self.name, index))) for index in range(self.draws)]
        found = []
        for index, (note, values) in enumerate(rows):
            inputs = {name: np.asarray(values[name], np.float32).astype(np.float64) for name in self.inputs}
            expected, undecided = self.bounded(inputs)
            flags = ("undecided",) if undecided else ()
            found.append(Case(f"{self.name}/{index}", self.clause, inputs, expected, flags, note))
        return found

    def answer(self, inputs: Numbers) -> Numbers:
        """Return the reference's answer, in float64."""
        return self.call({name: np.asarray(inputs[name], np.float64) for name in self.inputs}, np.float64)

    def bounded(self, inputs: Numbers) -> tuple[dict[str, Output], bool]:
        """Return expected outputs with bounds, and whether some decision is undecided."""
        wanted = self.answer(inputs)
        found = ranges.evaluate(self.program(), components(self.inputs, inputs))
        outputs, sure = {}, True
        for name, field in self.outputs.items():
            parts = [found[part] for part in names(name, field.count)]
            value = np.asarray(wanted[name], np.float64)
            low, high = (
                np.array([float(getattr(p, end)) for p in parts]).reshape(value.shape) for end in ENDS
            )
            outputs[name] = Output(value, np.maximum(high - value, value - low), SOURCE)
            sure &= all(bool(np.all(part.sure)) for part in parts)
        return outputs, not sure

    def program(self) -> Program:
        """Return the traced function, of numbers and to numbers."""
        inputs = {part: Type() for name, field in self.inputs.items() for part in names(name, field.count)}

        def call(*numbers: Any) -> dict[str, Any]:
            given = dict(zip(inputs, numbers, strict=True))
            return self.parts(given)

        return pipeline.run(trace(call, inputs), PASSES)

    def parts(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the components of the outputs for those of the inputs, by name, in float32."""
        fields = {
            name: vectors.vector(*(given[part] for part in names(name, f.count))) if f.count else given[name]
            for name, f in self.inputs.items()
        }
        return components(self.outputs, self.call(fields, np.float32))


ENDS = ("low", "high")
"""The ends of a range."""


def drawn(name: str, index: int, count: int = 16) -> NDArray[np.float64]:
    """Return uniform numbers (count,) in [0, 1) for a case of a kind, the same on every machine."""
    stream = rng.counter(zlib.crc32(name.encode()))
    blocks = rng.counter(np.arange((count + 3) // 4))
    found = rng.uniforms(rng.counter(SEED), blocks, rng.counter(index), stream, np.float64)
    return np.stack(found, axis=-1).reshape(-1)[:count]


def names(name: str, count: int) -> list[str]:
    """Return the names of a field's components."""
    return [f"{name}_{axis}" for axis in range(count)] if count else [name]


def components(fields: Mapping[str, Field], values: Numbers) -> dict[str, Any]:
    """Return the components of fields by name."""
    found = {}
    for name, field in fields.items():
        for axis, part in enumerate(names(name, field.count)):
            found[part] = values[name][..., axis] if field.count else values[name]
    return found


def _shape(count: int) -> str:
    """Return the type of a field for the format page."""
    return f"float[{count}]" if count else "float"
