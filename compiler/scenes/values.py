"""Values by name, as the inputs and outputs of programs: a vector is three numbers, `origin_x` and so on.

A function of named values is traced with its vectors joined from their components [`lowered`]; what it
returns is taken apart again [`apart`].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..core.ir import Program, Type
from ..core.passes import pipeline
from ..core.trace import trace

XYZ, RGB, NUMBER = ("_x", "_y", "_z"), ("_r", "_g", "_b"), ("",)
"""Endings of the names of a vector's, a colour's and a number's components."""

FLOAT, INTEGER, COUNTER, TRUTH = "float32", "int32", "uint32", "bool"
"""Kinds of numbers of the values between programs."""

Values = Mapping[str, tuple[tuple[str, ...], str]]
"""Values by name: the endings of their components, and their kind of number."""

Given = Mapping[str, Any]
"""Traced values by name."""


def floats(*named: str, ends: tuple[str, ...] = NUMBER) -> Values:
    """Return floats, or vectors of them, by name."""
    return dict.fromkeys(named, (ends, FLOAT))


def numbered(channels: int) -> tuple[tuple[str, ...], str]:
    """Return the value whose components are so many numbered channels."""
    return tuple(f"_{c}" for c in range(channels)), FLOAT


def kinds(values: Values) -> dict[str, str]:
    """Return the kind of number of each component, in order."""
    return {name + end: kind for name, (ends, kind) in values.items() for end in ends}


def names(values: Values) -> list[str]:
    """Return the names of all components, in order."""
    return list(kinds(values))


def joined(values: Values, components: Given) -> dict[str, Any]:
    """Return values from their components."""
    parts = {name: [components[name + end] for end in ends] for name, (ends, _) in values.items()}
    return {name: np.stack(each, axis=-1) if len(each) > 1 else each[0] for name, each in parts.items()}


def apart(values: Values, found: Given) -> dict[str, Any]:
    """Return the components of values by name."""
    return {
        name + end: found[name][..., i] if len(ends) > 1 else found[name]
        for name, (ends, _) in values.items()
        for i, end in enumerate(ends)
    }


def lowered(
    what: str,
    function: Callable[[Given], Given],
    inputs: Values,
    outputs: Values,
    passes: Sequence[str],
    **options: Any,
) -> Program:
    """Return the program of a function of named values, after passes; `options` are those of `trace`."""
    components = kinds(inputs)

    def call(*numbers: Any) -> dict[str, Any]:
        given = dict(zip(components, numbers, strict=True))
        return apart(outputs, function(joined(inputs, given)))

    program = trace(call, {name: Type(kind) for name, kind in components.items()}, **options)
    return pipeline.run(program, passes, f"traced {what}")
