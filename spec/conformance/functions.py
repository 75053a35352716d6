"""Kinds of cases that are functions of numbers: traced, so that the bound of each answer is computed.

1. A function of the reference is called with float64 numbers that float32 holds exactly: the expected value.
2. The same function, traced, has for each output a range of what single precision may give, under the
   promises of profile `ieee` (compiler/proof/ranges.py): its farther end is the bound
   [`Function.bounded`]. Where a decision is closer to its threshold than rounding, either way is accepted;
   the flag is `undecided`. No rounding decides ties of numbers that are the same to the bit wherever like
   operations round alike: the file has [`GUIDED`] as the source of their bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.ir import Program
from ...compiler.proof import ranges
from ...compiler.scenes.lower_scene import PASSES
from ...compiler.scenes.values import FLOAT, NUMBER, Values, apart, lowered, names, numbered
from .case import EITHER, Kind, Output

Numbers = Mapping[str, Any]

SOURCE = "range of single precision under profile ieee (compiler/proof/ranges.py)"
"""Where these bounds come from."""


class Field(NamedTuple):
    """An input or output: what it is, its components (0: a number), and the least and largest value given."""

    text: str
    size: int = 0
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class Function:
    """A function of the reference as a kind: `call` has the inputs and the float type of constants."""

    name: str
    title: str
    inputs: Mapping[str, Field]
    outputs: Mapping[str, Field]
    call: Callable[[Numbers, Any], Numbers]

    def kind(self) -> Kind:
        """Return the kind of case."""
        fields = [
            {name: f"float{f'[{f.size}]' * (f.size > 0)}, {f.text}" for name, f in side.items()}
            for side in (self.inputs, self.outputs)
        ]
        return Kind(self.name, self.title, fields[0], fields[1], self.answer, self.expect, float32=True)

    def answer(self, inputs: Numbers) -> Numbers:
        """Return the reference's answer, in float64."""
        lanes = {name: np.asarray(inputs[name], np.float64)[np.newaxis] for name in self.inputs}
        return {name: np.asarray(value)[0] for name, value in self.call(lanes, np.float64).items()}

    def bounded(self, inputs: Numbers) -> dict[str, Output]:
        """Return expected outputs with bounds."""
        return self.expect(inputs, self.answer(inputs), {})

    def expect(self, inputs: Numbers, wanted: Numbers, told: Mapping[str, Any]) -> dict[str, Output]:
        """Return an answer with bounds; ties that no rounding decides are those that the file calls so."""
        given = apart(values_of(self.inputs), inputs)
        guided = bool(told) and all(output.get("source") == GUIDED for output in told.values())
        found = ranges.evaluate(self.program, given, guided=guided)
        sure = guided or all(bool(np.all(part.sure & part.known)) for part in found.values())
        outputs = {}
        for name, field in self.outputs.items() if sure else ():
            value = np.asarray(wanted[name], np.float64)
            low, high = (_ends(found, name, field, end).reshape(value.shape) for end in ENDS)
            bound = np.maximum(high - value, value - low)
            outputs[name] = Output(value, bound, GUIDED if guided else SOURCE)
            if guided:
                assert np.all(np.isfinite(bound) & (bound >= 0.0)), f"{self.name}: no bound at {inputs}"
                continue
            # Single precision may be sure of its way, and double precision go the other one.
            outside = np.maximum(low - value, value - high)
            sure &= bool(np.max(outside) <= APART * (1.0 + float(np.max(np.abs(value)))))
        if not sure:
            return self._either(inputs, wanted, ranges.evaluate(self.program, given, guided=True))
        return outputs

    def _either(
        self, inputs: Numbers, wanted: Numbers, guided: Mapping[str, ranges.Range]
    ) -> dict[str, Output]:
        """Return outputs where a decision is undecided: all that the reference answers nearby.

        Every input is moved by `NUDGE` either way. An answer that is farther off than `APART` is another one,
        and accepted as well; what is nearer adds to the bound.
        """
        near = [self.answer(moved) for moved in _nudged(inputs)]
        outputs = {}
        for name, field in self.outputs.items():
            value = np.asarray(wanted[name], np.float64)
            low, high = (_ends(guided, name, field, end) for end in ENDS)
            others, bound = list[Any](), float(np.max(high - low))
            for other in (np.asarray(answers[name], np.float64) for answers in near):
                least = min(float(np.max(np.abs(other - known))) for known in (value, *others))
                if least <= APART * (1.0 + float(np.max(np.abs(other)))):
                    bound = max(bound, least)
                else:
                    others.append(other)
            assert np.isfinite(bound), f"{self.name}: no bound at {inputs}"
            bounds = [np.maximum(bound, ULP * np.abs(other)) for other in (value, *others)]
            accepted = tuple({"value": v, "bound": b} for v, b in zip(others, bounds[1:], strict=True))
            outputs[name] = Output(value, bounds[0], EITHER, accepted)
        return outputs

    @cached_property
    def program(self) -> Program:
        """The traced function, of numbers and to numbers."""
        return lowered("function", self.single, values_of(self.inputs), values_of(self.outputs), PASSES)

    def single(self, given: Numbers) -> Numbers:
        """Return the outputs, with constants in float32."""
        return self.call(given, np.float32)


def _ends(found: Mapping[str, ranges.Range], name: str, field: Field, end: str) -> NDArray[np.float64]:
    """Return one end of the ranges of a field's components."""
    return np.array([float(getattr(found[part], end)) for part in names(values_of({name: field}))])


def _nudged(inputs: Numbers) -> Iterator[dict[str, Any]]:
    """Yield the inputs with one component moved, each in turn, either way."""
    for name, value in inputs.items():
        for index in np.ndindex(np.shape(value)):
            for step in (-NUDGE, NUDGE):
                moved = np.array(value, np.float64)
                moved[index] += step * max(1.0, abs(float(moved[index])))
                yield {**inputs, name: moved}


NUDGE = 2.0**-20
"""How far inputs are moved, relative to 1 or to their size, to see what is near an undecided decision: some
roundings of single precision."""

APART = 2.0**-10
"""Answers that differ by more than this, relative to 1 or to their size, are two."""

GUIDED = "range of single precision with decisions as the reference takes them: what ties is equal to the bit"
"""Where the bounds of ties come from that no rounding decides."""

ULP = 2.0**-23
"""One ulp of float32, relative: the rounding of the answer itself."""

ENDS = ("low", "high")
"""The ends of a range."""


def values_of(fields: Mapping[str, Field]) -> Values:
    """Return fields as values of programs: their components are numbered."""
    return {name: numbered(field.size) if field.size else (NUMBER, FLOAT) for name, field in fields.items()}
