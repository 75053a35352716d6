"""Answers of an executor: functions traced, compiled and run on an image of one pixel, and whole pictures.

1. A function of numbers is compiled like a network: its inputs are the channels of an image [`OnExecutor`].
2. Kernels that stop at each depth report a whole path vertex by vertex (compare_paths.py) [`_vertices`].
3. Pictures are denoised and rendered as the commands do it; not every executor has kernels of paths.

Steps of a path, layers and derivatives of a network have no kernel of their own: they are not supported.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_program
from ...compiler.core.ir import Gather, Image, Program, Type
from ...compiler.core.passes import pipeline
from ...compiler.core.profiles import profile_named
from ...compiler.core.trace import trace
from ...compiler.scenes.emit_path import END
from ...compiler.scenes.lower_scene import PATH, SURFACE, PathPrograms, lower_scene
from ...compiler.scenes.path_kernel import compile_path
from ...compiler.scenes.values import apart, joined, names
from ...compiler.schedules.schedules import PLAIN
from ...compiler.targets import DENOISERS, Language
from ...kernels.devices.executor import Executor
from ...kernels.devices.kernel import Part
from ...kernels.run.denoise_on import denoise_on
from ...kernels.run.render_on import render_on
from ...refimpl.errors import CompileError
from ...refimpl.light import scene as scene_module
from ...refimpl.light.transport import Settings
from ...refimpl.network.whole import INPUT_LEVELS, Whole
from ...refimpl.network.window import Window
from .case import check_integers, given
from .functions import Function, values_of
from .kinds import FUNCTIONS, KINDS
from .kinds.files import model_from
from .kinds.images import frame_of
from .kinds.network import layers, network_from
from .kinds.paths import VERTEX
from .kinds.pictures import rendered
from .numbers import from_json

Own = Callable[[Mapping[str, Any]], Mapping[str, Any]]
"""Inputs -> outputs, of a kind that is not a function of numbers."""


class OnExecutor:
    """Functions as kernels, compiled at their first use."""

    def __init__(self, device: Executor) -> None:
        self.executor = device
        self._own: dict[str, Own] = {"picture.denoised": self._denoised, "whole.forward": self._whole}
        if device.language.paths:
            how = partial(render_on, device)
            self._own |= {"path.whole": self._vertices, "picture.rendered": partial(rendered, how=how)}
        self.kinds = [*FUNCTIONS, *self._own]
        self._compiled, self._programs = cache(self._compile), cache(self._lowered)
        self._path_kernel = cache(self._compile_path)

    def answer(self, kind: str, inputs: Mapping[str, Any], profile: str) -> Mapping[str, Any]:
        """Return the executor's outputs; it has the profile meanwhile."""
        before, self.executor.profile = self.executor.profile, profile_named(profile).name
        try:
            check_integers(KINDS[kind], inputs)
            if kind in self._own:
                return self._own[kind]({name: given(value) for name, value in inputs.items()})
            return self._answer(kind, inputs)
        finally:
            self.executor.profile = before

    def _answer(self, kind: str, inputs: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the outputs of a function of numbers."""
        function, kernels = FUNCTIONS[kind], self._compiled(kind, self.executor.language)
        fields = {name: np.asarray(from_json(inputs[name], name), np.float32) for name in function.inputs}
        parts = apart(values_of(function.inputs), fields)
        images = {part: np.full((1, 1, 1), value, np.float32) for part, value in parts.items()}
        found = np.concatenate([self.executor.run(kernel, images)[0, 0] for kernel in kernels])
        values = values_of(function.outputs)
        return joined(values, dict(zip(names(values), found, strict=True)))

    def _vertices(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return every vertex of a path, each from a kernel that stops there."""
        x, y, width, height, sample, seed = (
            int(inputs[name]) for name in ("x", "y", "width", "height", "sample", "seed")
        )
        part = Part(width, height, y, 1, sample, 1, seed)
        rows: list[dict[str, Any]] = []
        for depth in range(inputs["settings"]["max_depth"] + 1):
            settings = json.dumps({**inputs["settings"], "max_depth": depth})
            kernel = self._path_kernel(inputs["scene"], settings, self.executor.language)
            planes = self.executor.trace(kernel, part)[:, 0, x]
            state = dict(zip(kernel.planes, planes, strict=True))
            # A path that ended at the surface before has no vertex here.
            if rows and not state["alive"] > 0:
                break
            rows.append(state)
        return {name: np.array([_joined(row, name) for row in rows]) for name in VERTEX}

    def _compile_path(self, scene: str, settings: str, language: Language) -> Artifact:
        """Return the kernel that reports the last vertex of paths."""
        stopped = Settings(**json.loads(settings))
        programs = replace(self._programs(scene, replace(stopped, max_depth=0)), settings=stopped)
        return compile_path(programs, language, self.executor.lanes, tuple(END))

    def _lowered(self, scene: str, settings: Settings) -> PathPrograms:
        """Return the programs of a path, which do not depend on the depth."""
        return lower_scene(scene_module.from_json(scene), settings, self.executor.language.forms)

    def _denoised(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return a denoised picture."""
        model = model_from(base64.b64decode(inputs["model"]))
        schedule = None if self.executor.name in DENOISERS else PLAIN
        return {"picture": denoise_on(self.executor, model, frame_of(inputs), schedule).image}

    def _whole(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return what each layer of a network of integers gives, from kernels of a window of one pixel."""
        network = network_from(inputs)
        images = tuple(
            Image(f"n{i}", 1, -INPUT_LEVELS, INPUT_LEVELS, whole=True) for i in range(network.widths[0])
        )
        gather = Gather(Window(1), images)
        types = {"window": Type(shape=(gather.n_inputs,))}
        pixel = {f"n{i}": np.full((1, 1, 1), n, np.float32) for i, n in enumerate(np.ravel(inputs["n"]))}
        found: dict[str, Any] = {}
        *hidden, last = network.widths[1:]
        for name, width in (*((f"layer_{i}", width) for i, width in enumerate(hidden)), ("color", last)):
            for first in range(0, width, 3):
                wanted = range(first, min(first + 3, width))
                program = trace(partial(_some, network, name, wanted), types, gather)
                picture = self.executor.run(self._kernel(program, self.executor.language), pixel)
                found.setdefault(name, []).extend(picture[0, 0].tolist())
        return {name: np.array(values) for name, values in found.items()}

    def _compile(self, kind: str, language: Language) -> list[Artifact]:
        """Return the kernels of a function: outputs three at a time, since a picture has few channels."""
        function = FUNCTIONS[kind]
        total = len(names(values_of(function.outputs)))
        threes = [list(range(first, min(first + 3, total))) for first in range(0, total, 3)]
        return [self._kernel(_program(function, wanted), language) for wanted in threes]

    def _kernel(self, program: Program, language: Language) -> Artifact:
        """Return the kernel of a program.

        Where the ranges of the inputs leave the argument of a sine without bound, as a division does, there
        is no bound over all inputs: sines are expanded before anything asks for one. Each case has its own.
        """
        try:
            return compile_program(program, language)
        except CompileError:
            expanded = pipeline.run(pipeline.run(program, pipeline.COMMON), language.profile.passes)
            return compile_program(expanded, language)


def _joined(state: Mapping[str, Any], name: str) -> Any:
    """Return a value of a path's state from its planes."""
    ends, kind = {**PATH, **SURFACE}[name]
    parts = np.array([state[f"last_{name}{end}"] for end in ends])
    whole = parts if len(parts) > 1 else parts[0]
    return int(whole) if kind == "int32" else whole


def _program(function: Function, wanted: list[int]) -> Program:
    """Return the program of a pixel: inputs are its channels, outputs some of the function's numbers."""
    inputs, outputs = values_of(function.inputs), values_of(function.outputs)
    images = [
        Image(part, 1, function.inputs[name].low, function.inputs[name].high)
        for name, value in inputs.items()
        for part in names({name: value})
    ]
    gather = Gather(Window(1, "clamp"), tuple(images))

    def call(window: Any) -> Any:
        given = joined(inputs, {image.name: window[..., i] for i, image in enumerate(images)})
        found = list(apart(outputs, function.single(given)).values())
        return np.stack([found[i] for i in wanted], axis=-1)

    return trace(call, {"window": Type(shape=(len(images),))}, gather)


def _some(network: Whole, name: str, wanted: Sequence[int], window: Any) -> Any:
    """Return some numbers of what a layer gives; a program is made of it."""
    found = layers(network, window)[name]
    return np.stack([found[..., i] for i in wanted], axis=-1)
