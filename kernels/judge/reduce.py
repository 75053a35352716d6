"""Make a failure small: the smallest part of a picture, and the first stage of a network, that show it.

1. Cut rows and columns off while the failure stays, halves first, single ones at last [`shrink`]; before that
   look at only the worst pixel, and at what its window sees.
2. A stage is a layer's sums, or its sines: the network up to there is a program of its own, some neurons at
   a time, as many as a target's image has channels [`stages`], [`stage_program`]. The first one whose kernel
   deviates is where to look [`first_stage`]; a failure that no stage by itself has is in what comes after
   them, or in how they are combined.
3. [`reduced`] does both, for the kernels that a triage found to deviate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...compiler.compile import compile_plan
from ...compiler.core.ir import OUTPUT_ENCODING, Program, Type
from ...compiler.core.lower import lower
from ...compiler.core.trace import trace
from ...refimpl.network.activation import SINE, activation_named
from ...refimpl.network.denoise import Model, as_dtype
from ...refimpl.network.siren import Siren, forward
from ...refimpl.network.whole import Whole, sine_layers
from ..devices.kernel import Images
from .triage import Compile, Judge, Kernel, Verdict, judged, kernels_of, odd_ones

MOST_RUNS = 80
"""Most runs of a kernel that a picture is shrunk by: 1024 x 1024 pixels need about 40 in the worst case."""

MOST_FAILURES = 16
"""The same for kernels that crash, or never answer: each costs a process."""


@dataclass(frozen=True)
class Box:
    """A part of a picture, in pixels."""

    top: int
    left: int
    height: int
    width: int

    @property
    def text(self) -> str:
        """Return the part for a reader."""
        return f"{self.width}x{self.height} pixels from row {self.top}, column {self.left}"

    def cut(self, images: Images) -> Images:
        """Return this part of images (H, W, C)."""
        rows, columns = slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)
        return {name: np.ascontiguousarray(image[rows, columns]) for name, image in images.items()}


def shrink(
    whole: Box,
    fails: Callable[[Box], bool],
    at: tuple[int, int] | None = None,
    reach: int = 0,
    most: int = MOST_RUNS,
) -> Box:
    """Return a small part that fails as `whole` does, after at most so many runs.

    `at`: the worst pixel (row, column), whose neighbours up to `reach` are looked at first.
    """
    left = [most]

    def still(box: Box) -> bool:
        """Run a part, if there are runs left."""
        left[0] -= 1
        return left[0] >= 0 and fails(box)

    box = whole
    for distance in dict.fromkeys((0, reach)) if at is not None else ():
        around = _around(whole, at, distance)  # type: ignore[arg-type]
        if around != whole and still(around):
            box = around
            break
    before = None
    while before != box and left[0] > 0:
        before = box
        for side in (("top", "height"), ("left", "width")):
            box = _shrink_along(side, box, still)
    return box


def _around(whole: Box, at: tuple[int, int], distance: int) -> Box:
    """Return the pixels of `whole` that are at most so far from one."""
    top, left = max(at[0] - distance, whole.top), max(at[1] - distance, whole.left)
    bottom = min(at[0] + distance + 1, whole.top + whole.height)
    right = min(at[1] + distance + 1, whole.left + whole.width)
    return Box(top, left, bottom - top, right - left)


def _shrink_along(side: tuple[str, str], box: Box, still: Callable[[Box], bool]) -> Box:
    """Cut off the end, or the start, along one side: halves, then quarters, ... then single ones."""
    start, extent = side
    step = getattr(box, extent) // 2
    while step:
        end = replace(box, **{extent: getattr(box, extent) - step})
        for part in (end, replace(end, **{start: getattr(box, start) + step})):
            if still(part):
                box = part
                break
        else:
            step //= 2
        step = min(step, getattr(box, extent) - 1)
    return box


@dataclass(frozen=True)
class Stage:
    """A layer's sums, or its sines or other activations, of neurons [first, end)."""

    layer: int
    sines: bool
    first: int
    end: int
    activation: str = SINE

    @property
    def text(self) -> str:
        """Return the stage for a reader."""
        after = "sines" if self.activation == SINE else f"after {self.activation}"
        return f"layer {self.layer}, {after if self.sines else 'sums'}"


def stages(siren: Siren, most: int) -> Iterator[Stage]:
    """Give the stages of a network in order, of at most so many neurons each."""
    last = len(siren.weights) - 1
    for layer, weight in enumerate(siren.weights):
        for sines in (False, True) if layer < last else (False,):
            for first in range(0, len(weight), most):
                yield Stage(layer, sines, first, min(first + most, len(weight)), siren.activation)


def stage_program(model: Model, stage: Stage) -> Program:
    """Return the program of one pixel that ends with a stage: (n,) numbers, one a neuron."""
    whole, siren = lower(model), as_dtype(model.siren, np.float32)
    weights, biases = list(siren.weights[: stage.layer + 1]), list(siren.biases[: stage.layer + 1])
    weights[-1] = np.ascontiguousarray(weights[-1][stage.first : stage.end])
    biases[-1] = np.ascontiguousarray(biases[-1][stage.first : stage.end])
    part = replace(siren, weights=tuple(weights), biases=tuple(biases))
    if isinstance(part, Whole):
        factors = [*part.factors[: stage.layer], part.factors[stage.layer][stage.first : stage.end]]
        part = replace(part, factors=tuple(factors))
    omega_0 = siren.omega_0_first if stage.layer == 0 else siren.omega_0_hidden
    activate = activation_named(siren.activation).forward

    def function(window: Any) -> Any:
        """Run the network up to here."""
        if isinstance(part, Whole):
            *_, (whole_sums, values) = sine_layers(part, window, stage.layer + 1)
            return values if stage.sines else whole_sums
        sums = forward(part, window)
        return activate(omega_0 * sums) if stage.sines else sums

    assert whole.gather is not None
    info = {**dict(whole.info), OUTPUT_ENCODING: f"{stage.text}, neurons {stage.first} to {stage.end - 1}"}
    return trace(function, {"window": Type(shape=(whole.gather.n_inputs,))}, whole.gather, info=info)


def first_stage(
    kernel: Kernel, model: Model, images: Images, compiled: Compile = compile_plan
) -> tuple[Stage, Verdict] | None:
    """Return the first stage whose kernel deviates on images (H, W, C), or None if none does by itself."""
    assert kernel.artifact is not None, "a kernel that deviates has run"
    most = kernel.runner.language.dialect.max_output_channels
    size = next(iter(images.values())).shape[:2]
    for stage in stages(model.siren, most):
        kernels = kernels_of([kernel.runner], stage_program(model, stage), size, kernel.schedule, compiled)
        (verdict,) = judged(kernels, images)
        if verdict.deviates:
            return stage, verdict
    return None


@dataclass(frozen=True)
class Found:
    """An odd kernel, the first stage that deviates by itself, and how; None: no stage does."""

    kernel: Kernel
    stage: Stage | None
    verdict: Verdict | None

    @property
    def text(self) -> str:
        """Return the stage for a reader."""
        if self.stage is None or self.verdict is None:
            return f"{self.kernel.name}: no stage deviates by itself; look at what comes after the last one"
        at = ""
        if self.verdict.pixel is not None:
            row, column, channel = self.verdict.pixel
            at = f", neuron {self.stage.first + channel}, row {row}, column {column} of the part"
        return f"{self.kernel.name}: the first stage that deviates is {self.stage.text}{at}"


@dataclass(frozen=True)
class Reduced:
    """The smallest part of the picture that was found to show it, all kernels' verdicts there, the stages.

    `repeats` False: no part showed it once more, and the part is the whole picture with its first verdicts.
    """

    box: Box
    verdicts: tuple[Verdict, ...]
    stages: tuple[Found, ...]
    repeats: bool


def reduced(
    verdicts: Sequence[Verdict], model: Model, images: Images, compiled: Compile = compile_plan
) -> Reduced:
    """Return a small part of images (H, W, C) on which the kernels that deviate still do, and since where.

    If all deviate, the part shows the worst one. The stages are those of one kernel of each odd executor.
    """
    odd = odd_ones(verdicts)
    worst = max(odd, key=lambda verdict: (not verdict.failure, verdict.ratio))
    probes = [worst] if all(v.deviates for v in verdicts if v.ran) else odd

    def fails(box: Box) -> bool:
        """Tell whether the probes deviate on a part."""
        judge = Judge(box.cut(images))
        return all(judge.verdict(probe.kernel).deviates for probe in probes)

    size = next(iter(images.values())).shape[:2]
    whole = Box(0, 0, *size)
    crashed = any(probe.failure for probe in probes)
    at = worst.pixel and worst.pixel[:2]
    most = MOST_FAILURES if crashed else MOST_RUNS
    box = shrink(whole, fails, at, model.window.size, most)
    part = box.cut(images)
    again = judged([verdict.kernel for verdict in verdicts], part)
    repeats = bool(odd_ones(again))
    if not repeats:
        box, part, again = whole, images, list(verdicts)
    found = []
    for verdict in {v.kernel.runner.way: v for v in odd_ones(again)[::-1]}.values():
        kernel = verdict.kernel
        stage = first_stage(kernel, model, part, compiled)
        found.append(Found(kernel, *(stage or (None, None))))
    return Reduced(box, tuple(again), tuple(found[::-1]), repeats)
