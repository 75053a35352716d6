"""A plan: what is compiled, for which target, with which arithmetic, in which order; resolved once.

1. A plan is made at the door (command line, `denoise_on`, pipeline, export) from names [`plan_program`,
   `variants.plan_model`]. Behind the door it holds objects: program, target, profile, and both passes of a
   first layer that is cut to a rank.
2. It runs the passes once: the program that bounds speak about [`Plan.analysed`], and the one that is emitted
   [`Plan.emitted`]; and it picks the schedule once [`Plan.picked`].
3. It bounds the output over all inputs that the images can hold, and refuses a program whose sines may leave
   the domain on which their error is known, or whose numbers may leave float32 [`Plan.bound`].
4. It says what a kernel may write for given images: the reference's picture in float64, and how far each
   number may be from it: a-posteriori [`Plan.expected`]. Both are computed for a block of rows at a time: all
   windows of a picture fill the memory.

Everything is computed when it is first needed, and then kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..refimpl.errors import CompileError
from .core.interpret import interpret
from .core.ir import Program
from .core.passes import pipeline
from .core.profiles import Profile, SineContract
from .proof import bounds, whole
from .proof.bounds import Enclosure
from .schedules import schedules
from .schedules.common import kernel_gather, output_channels
from .schedules.schedules import ALL, PLAIN, Images, Schedule, pick
from .targets import Language, language_named

if TYPE_CHECKING:
    from ..refimpl.network.denoise import Model
    from .proof.certificate import Proof
    from .schedules.factor import Cut

BLOCK_NUMBERS = 2**20
"""Numbers in the windows of one block of rows: a bound holds some copies of them, 8 MiB each."""


@dataclass(frozen=True)
class Bound:
    """A-priori promise: `output` bounds each channel's error, None where an operation promises nothing.

    `sines` holds the range of each sine's argument; `proof` the steps of a certificate, if it has one.
    `exact`: no operation rounds, so that every device computes the same bits.
    """

    output: tuple[float, ...] | None
    sines: tuple[tuple[float, float], ...]
    proof: Proof | None = None
    exact: bool = False


@dataclass(frozen=True)
class Expected:
    """The reference's picture (H, W, C) in float64, and the most that a kernel may be off (H, W, C)."""

    value: NDArray[np.float64]
    bound: NDArray[np.float64]

    def most_from(self, picture: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Return how far a kernel may be from a picture near the reference's, rounded up; 0 stays 0."""
        most = self.bound + np.abs(picture - self.value)
        raised = np.nextafter(most.astype(np.float32), np.float32(np.inf))
        return np.where(most == 0, np.float32(0), raised)


@dataclass(frozen=True)
class Plan:
    """How a program becomes a kernel, or two.

    `analysed`: the program after the passes that bounds see, each sine one node; `asked`: the name of the
    schedule that was requested; `cut`: both passes of a first layer of low rank; `proves`: whether a proof is
    looked for, which takes seconds; `varied`: the network that the program is, if it is one.
    """

    analysed: Program
    target: Language
    asked: str = PLAIN
    cut: Cut | None = None
    proves: bool = True
    varied: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """Travel to other processes without what is computed when it is needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def scheduled(self, name: str) -> Plan:
        """Return the same plan with another schedule."""
        return replace(self, asked=name)

    @property
    def model(self) -> Model:
        """Return the network that the program is, where the plan was made of one [variants.py]."""
        found: Model = self.varied.model
        return found

    @property
    def profile(self) -> Profile:
        """Return the numerical profile."""
        return self.target.profile

    @property
    def sine(self) -> SineContract:
        """Return what is promised of a sine."""
        return self.target.sine

    @cached_property
    def emitted(self) -> Program:
        """Return the program that is written as source."""
        return pipeline.run(self.analysed, self.profile.passes)

    @cached_property
    def picked(self) -> tuple[Schedule, str]:
        """Return the schedule, and why it is not the requested one where it is not."""
        return pick(self.target.schedules, self.asked, self.emitted)

    @property
    def schedule(self) -> Schedule:
        """Return the schedule."""
        return self.picked[0]

    @property
    def schedule_facts(self) -> Mapping[str, Any]:
        """Return what a manifest says about the schedule."""
        found, (_, reason) = self.schedule.facts(self.emitted), self.picked
        return {**found, "asked": self.asked, "reason": reason} if reason else found

    @cached_property
    def passes(self) -> tuple[Plan, ...]:
        """Return the plan of each kernel in the order in which they run: this one, or those of two passes."""
        if self.cut is None:
            return (self,)
        return tuple(
            Plan(part, self.target, self.asked, proves=self.proves)
            for part in (self.cut.horizontal, self.cut.vertical)
        )

    def enclosures(
        self, images: Images | None = None, rows: slice = ALL, of_cut: bool = True
    ) -> list[Enclosure]:
        """Return the enclosure of every node of the analysed program, errors being the kernel's.

        For all images in their ranges, or for given ones (H, W, C), then for each pixel of some `rows`; all
        rows where the first layer is cut. `of_cut`: what the cut leaves out counts as an error.
        """
        if self.cut is None:
            return self.schedule.enclosures(self.analysed, self.sine, images, rows)
        return self.cut.enclosures(self.sine, images, of_cut)

    @cached_property
    def bound(self) -> Bound:
        """Return the bound over all that the images can hold, or refuse the program."""
        if self.is_whole:
            return Bound((0.0,) * output_channels(self.analysed), (), exact=True)
        program, found = self.analysed, self.enclosures()
        if self.profile.sine is not None:
            _check_sizes(program, found)
        sines = [index for index, node in enumerate(program.nodes) if node.op == "sin"]
        ranges = []
        for number, index in enumerate(sines):
            argument = found[program.nodes[index].args[0]]
            ranges.append((float(argument.low.min()), float(argument.high.max())))
            # What a sine without a contract passes on is unknown: there is no domain to check against.
            if self.sine.error is not None and not bounds.argument_reach(argument).max() <= self.sine.domain:
                low, high = ranges[-1]
                raise CompileError(
                    f"sine {number + 1} of {len(sines)} (layer {number}, %{index}) may get arguments from "
                    f"{low:.6g} to {high:.6g}: the sine ({self.sine.text}) is proven for |x| <= "
                    f"{self.sine.domain:g}; use a smaller omega_0, smaller weights or features of a smaller "
                    "range, or profile native, which guarantees less"
                )
        errors = bounds.output_errors(program, found)[program.outputs[0][0]]
        if not all(math.isfinite(error) for error in errors):
            return Bound(None, tuple(ranges))
        proof = None
        cut = (self.cut.horizontal, self.cut.vertical) if self.cut else None
        if self.proves:
            from .proof import certificate

            of = None if cut else self.schedule.spectra(program)
            proof = certificate.prove(program, found, self.sine, of, cut)
        return Bound(proof.bound if proof else tuple(float(e) for e in errors), tuple(ranges), proof)

    @cached_property
    def is_whole(self) -> bool:
        """Return whether no operation rounds, in any order of sums."""
        return self.shares_bound and self.cut is None and whole.holds(self.emitted)

    @property
    def unproven(self) -> str:
        """Return why its kernel has no certificate (CER-1), or nothing where it has one."""
        if self.bound.exact or self.bound.proof:
            return ""
        if not self.proves:
            return "it was compiled to be run at once, without one"
        if self.sine.error is None:
            return f"nothing is promised of the sine ({self.sine.text})"
        return "the program is not a network of sines or rectifiers of the form that the proof knows"

    @property
    def assumes(self) -> str:
        """Return what the bound rests on that the language does not promise: nothing where nothing rounds."""
        return "" if self.is_whole else self.target.dialect.assumes

    @property
    def shares_bound(self) -> bool:
        """Return whether the bound is that of any order of sums: plans that agree so far have one bound."""
        return self.cut is not None or type(self.schedule).enclosures is Schedule.enclosures

    @property
    def reference(self) -> Program:
        """Return what a kernel computes up to rounding; a cut has the factors' product for weights."""
        return self.cut.product if self.cut else self.analysed

    def expected(self, images: Images) -> Expected:
        """Return what a kernel may write for images (H, W, C); any number where a sine promises nothing.

        With a cut the reference is the network that has the factors' product for weights: only rounding is
        bounded.
        """
        height, width = next(iter(images.values())).shape[:2]
        gather = kernel_gather(self.analysed)
        rows = height if self.cut else max(1, BLOCK_NUMBERS // (width * gather.n_inputs))
        values, errors = [], []
        for top in range(0, height, rows):
            block = slice(top, min(top + rows, height))
            windows = schedules.windows(gather, images, block)
            (value,) = interpret(self.reference, {"window": windows}, np.float64).values()
            values.append(_per_pixel(value, windows.shape[:2]))
            if self.is_whole:
                errors.append(np.zeros_like(values[-1]))
                continue
            (error,) = bounds.output_errors(self.analysed, self.enclosures(images, block, False)).values()
            errors.append(np.broadcast_to(_per_pixel(error, windows.shape[:2]), values[-1].shape))
        return Expected(np.concatenate(values), np.concatenate(errors))


def analysed(program: Program) -> Program:
    """Return the program that bounds speak about: after the common passes, each sine one node."""
    return pipeline.run(program, pipeline.COMMON)


def plan_program(program: Program, language: Language | str, schedule: str = PLAIN, rank: int = 0) -> Plan:
    """Return the plan of a program that reads a window and writes one output, or refuse it.

    With a `rank` the first layer is cut to it, and there are two kernels [factor.py].
    """
    chosen = language_named(language)
    if kernel_gather(program).whole and rank:
        raise CompileError(f"rank {rank}: needs a float network, not an integer one (leave it out)")
    common = analysed(program)
    dialect = chosen.dialect
    if rank > dialect.max_output_channels:
        raise CompileError(
            f"rank {rank}: the intermediate image has as many channels, and {dialect.language} "
            f"writes at most {dialect.max_output_channels}; use a smaller rank, or OpenCL or C, which have "
            "no such limit"
        )
    if not rank:
        return Plan(common, chosen, schedule)
    from .schedules.factor import factor

    return Plan(common, chosen, schedule, factor(common, rank, dialect.channels_per_result))


def _check_sizes(program: Program, found: Sequence[Enclosure]) -> None:
    """Refuse a program whose numbers may overflow, which would leave it without a bound."""
    layer = -1
    for index, (node, enclosure) in enumerate(zip(program.nodes, found, strict=True)):
        layer += node.op == "affine"
        if enclosure.overflows:
            place = f"layer {layer}, %{index}" if layer >= 0 else f"%{index}"
            raise CompileError(
                f"{node.op} ({place}) may reach {np.nanmax(enclosure.size):.3g}: the float32 "
                f"maximum is {np.finfo(np.float32).max:.3g}; use smaller weights, a smaller omega_0 or "
                "features of a smaller range, or profile native, which then has no bound"
            )


def _per_pixel(array: Any, size: tuple[int, ...]) -> NDArray[np.float64]:
    """Return (H, W, C) of an array that may lack the last axis, or all but it (constants)."""
    if np.ndim(array) < len(size):
        array = np.broadcast_to(np.atleast_1d(array), (*size, np.size(array)))
    found: NDArray[np.float64] = np.reshape(array, (*size, -1))
    return found
