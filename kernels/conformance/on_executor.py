"""Answers of an executor to cases that are functions: each traced, compiled and run on an image of one pixel."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_program
from ...compiler.ir import Gather, Image, Program, Type
from ...compiler.passes import pipeline
from ...compiler.profiles import profile_named
from ...compiler.trace import trace
from ...refimpl.dataset import Window
from ...refimpl.errors import CompileError
from ..executor import Executor
from .functions import Function, components, names
from .kinds import FUNCTIONS
from .numbers import from_json


class OnExecutor:
    """Functions as kernels, compiled when they are first asked for."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor
        self.kinds = list(FUNCTIONS)
        self._compiled = cache(self._compile)

    def answer(self, kind: str, inputs: Mapping[str, Any], profile: str) -> Mapping[str, Any]:
        """Return the executor's outputs."""
        function, kernels = FUNCTIONS[kind], self._compiled(kind, profile)
        fields = {name: np.asarray(from_json(inputs[name], name), np.float32) for name in function.inputs}
        parts = components(function.inputs, fields)
        images = {part: np.full((1, 1, 1), value, np.float32) for part, value in parts.items()}
        found = np.concatenate([self.executor.run(kernel, images)[0, 0] for kernel in kernels])
        outputs, at = {}, 0
        for name, field in function.outputs.items():
            outputs[name] = found[at : at + field.count] if field.count else found[at]
            at += max(field.count, 1)
        return outputs

    def _compile(self, kind: str, profile: str) -> list[Artifact]:
        """Return the kernels of a function: outputs three at a time, since a picture has few channels."""
        function = FUNCTIONS[kind]
        total = sum(max(count, 1) for count in (field.count for field in function.outputs.values()))
        threes = [list(range(first, min(first + 3, total))) for first in range(0, total, 3)]
        return [self._kernel(_program(function, wanted), profile) for wanted in threes]

    def _kernel(self, program: Program, profile: str) -> Artifact:
        """Return the kernel of a program.

        Where the ranges of the inputs leave the argument of a sine without bound, as a division does, there is
        no bound over all inputs: sines are expanded before anything asks for one. Each case has its own.
        """
        try:
            return compile_program(program, self.executor.name, profile)
        except CompileError:
            expanded = pipeline.run(pipeline.run(program, pipeline.COMMON), profile_named(profile).passes)
            return compile_program(expanded, self.executor.name, profile)


def _program(function: Function, wanted: list[int]) -> Program:
    """Return the program of a pixel: inputs are its channels, outputs some of the function's numbers."""
    images = [
        Image(part, 1, field.low, field.high)
        for name, field in function.inputs.items()
        for part in names(name, field.count)
    ]
    gather = Gather(Window(1, "clamp"), tuple(images))

    def call(window: Any) -> Any:
        found = list(function.parts({image.name: window[..., i] for i, image in enumerate(images)}).values())
        return np.stack([found[i] for i in wanted], axis=-1)

    return trace(call, {"window": Type(shape=(len(images),))}, gather)
