"""Path kernels against the reference, step by step: what differs must be explained by rounding.

1. A kernel reports the state of each path after its last arrival; stopped at depth 0, 1, ... it reports every
   state [`_Paths`]. These are builds of the same text except for the depth: a compiler that made different
   code of them would show as unexplained.
2. One step of the reference starts from the *kernel's own* state, so that errors do not pile up: `start` or
   `scatter` gives ranges for the ray that the kernel has next, `arrive` on that ray gives ranges for the
   surface and the radiance (compiler/proof/ranges.py) [`step_ranges`].
3. What the kernel has must lie in its range: else it is *unexplained*, a fault [`_judge`]. Where a decision
   of the step is closer to its threshold than rounding, it is *undecided* and the range holds both ways;
   when the kernel then went another way than the float32 reference, it is *different*.
4. Beside the steps, the reference's own paths are followed, and how far the kernel's have moved from them is
   reported: that needs no explanation, it grows from bounce to bounce [`_moved`].
5. The random numbers' generator is compared to the bit, by a path kernel of the empty scene whose features of
   the first surface are its words, in halves of 16 bits, which floats hold exactly [`wrong_words`].

The picture as a whole is compared by compare_images.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.core.ir import Type
from ...compiler.core.passes import pipeline
from ...compiler.core.trace import trace
from ...compiler.proof import ranges
from ...compiler.proof.ranges import Range
from ...compiler.scenes.emit_path import END, planes
from ...compiler.scenes.lower_scene import PASSES, PATH, SURFACE, PathPrograms, lower_scene
from ...compiler.scenes.path_kernel import compile_path
from ...compiler.scenes.values import kinds, names
from ...refimpl import rng
from ...refimpl.light import render
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ...refimpl.light.scenes import canonical
from ...refimpl.light.transport import BLOCKS_PER_BOUNCE, Settings
from ..devices.executor import Executor
from ..devices.kernel import Part
from ..devices.registry import open_executor

QUANTITIES: Mapping[str, list[str]] = {
    name: names({name: value}) for name, value in {**PATH, **SURFACE}.items() if name != "surface"
}
"""The floats of a path's state with the names of their components."""

DECISIONS = ("alive", "surface")
"""The components of a path's state that are not floats."""

SHOWN = 10
"""Unexplained components that a report tells one by one."""

SHOWN_EACH = 2
"""Of these at most so many for each component and depth, so that others are seen too."""

PATHS_AT_ONCE = 1 << 13
"""Paths whose ranges are evaluated together: their arrays stay in a core's cache."""

State = dict[str, NDArray[Any]]
"""Values of paths (P,) by the names of programs, and `alive`."""

Build = Callable[[PathPrograms, Executor], Artifact]
"""Makes the kernel that reports the states; tests put a wrong one in its place."""


@dataclass(frozen=True)
class View:
    """Which paths: one through each pixel of an image, of one sample."""

    width: int
    height: int
    sample: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse sizes and counters as a render does."""
        Job(self.width, self.height, 1, self.seed, first_sample=self.sample)

    @property
    def part(self) -> Part:
        """Return what a path kernel has to draw."""
        return Part(self.width, self.height, 0, self.height, self.sample, 1, self.seed)


@dataclass(frozen=True)
class Unexplained:
    """A component outside its range: pixel, depth, what was found, and the range's ends."""

    depth: int
    x: int
    y: int
    component: str
    found: float
    low: float
    high: float

    def __str__(self) -> str:
        middle, bound = (self.low + self.high) / 2, (self.high - self.low) / 2
        return (
            f"pixel ({self.x}, {self.y}), depth {self.depth}, {self.component}: expected {middle!r}, "
            f"got {self.found!r}, bound {bound:.3g}"
        )


@dataclass(frozen=True)
class Gap:
    """How far a quantity is from the middle of its range, over the sure steps of all paths.

    The largest |difference| and |difference| / bound, and the median of the bounds that are not 0 (0 if all
    are).
    """

    difference: float
    ratio: float
    bound: float


@dataclass(frozen=True)
class Depth:
    """The step to one depth: counts of paths, gaps by quantity.

    `paths` were alive before it. Against the reference's own paths: `parted` in all until here, and the
    largest differences of those that still go together.
    """

    depth: int
    paths: int
    undecided: int
    different: int
    unexplained: int
    gaps: Mapping[str, Gap]
    parted: int
    moved: Mapping[str, float]


@dataclass(frozen=True)
class PathReport:
    """The comparison of all paths of a view; `wrong_words` counts paths with other random numbers."""

    view: View
    depths: tuple[Depth, ...]
    examples: tuple[Unexplained, ...]
    wrong_words: int

    @property
    def passed(self) -> bool:
        """Return whether every difference is explained."""
        return self.wrong_words == 0 and not any(depth.unexplained for depth in self.depths)


# ---- paths ------------------------------------------------------------------------------------------------


def kernel_of_states(programs: PathPrograms, device: Executor) -> Artifact:
    """Return the kernel that follows paths to the programs' depth and tells their state."""
    return compile_path(programs, device.language, device.lanes, tuple(END))


def compare_paths(
    device: Executor,
    scene: Scene,
    settings: Settings,
    view: View,
    *,
    build: Build = kernel_of_states,
    on_progress: Callable[[int], None] | None = None,
) -> PathReport:
    """Compare the paths of a view, step by step, and the random numbers.

    on_progress is called with 1 after each depth.
    """
    programs = lower_scene(scene, settings, device.language.forms)
    given = _given(view)
    before: State | None = None
    together = np.ones(view.width * view.height, bool)
    depths, examples = [], list[Unexplained]()
    own = _Paths(open_executor("numpy"), programs, view, kernel_of_states).states()
    for depth, after in enumerate(_Paths(device, programs, view, build).states()):
        step = _Step(programs, depth, given, before, after)
        verdict = _judge(step, view)
        examples += verdict.examples[: SHOWN - len(examples)]
        together, moved = _moved(after, next(own), together)
        depths.append(
            Depth(
                depth,
                int(step.entered.sum()),
                int(verdict.undecided.sum()),
                int(verdict.different.sum()),
                int(verdict.unexplained.sum()),
                verdict.gaps,
                int((~together).sum()),
                moved,
            )
        )
        before = {**after, "alive": step.entered & after["alive"]}
        if on_progress is not None:
            on_progress(1)
    return PathReport(view, tuple(depths), tuple(examples), wrong_words(device, view, settings.max_depth))


def _given(view: View) -> State:
    """Return the inputs of `start` and the counters of all paths (P,)."""
    y, x = np.divmod(np.arange(view.width * view.height), view.width)
    return {
        "x": x.astype(np.uint32),
        "y": y.astype(np.uint32),
        "pixel": render.pixel_counter(x, y),
        "seed": np.full(len(x), view.seed, np.uint32),
        "sample_number": np.full(len(x), view.sample, np.uint32),
        "width": np.full(len(x), view.width, np.float32),
        "height": np.full(len(x), view.height, np.float32),
    }


@dataclass(frozen=True)
class _Paths:
    """The paths of a view on an executor, by kernels that `build` makes of programs."""

    executor: Executor
    programs: PathPrograms
    view: View
    build: Build

    def states(self) -> Iterator[State]:
        """Yield, for each depth, the state of all paths (P,) as the kernel has it."""
        kind = {**kinds({**PATH, **SURFACE}), "alive": "bool"}
        for depth in range(self.programs.settings.max_depth + 1):
            # Paths end after so many scatterings and one more arrival.
            stopped = replace(self.programs, settings=replace(self.programs.settings, max_depth=depth))
            kernel = self.build(stopped, self.executor)
            sums = self.executor.trace(kernel, self.view.part).reshape(len(kernel.planes), -1)
            yield {
                plane.removeprefix("last_"): _as_kind(values, kind[plane.removeprefix("last_")])
                for plane, values in zip(kernel.planes, sums, strict=True)
            }


def _as_kind(values: NDArray[Any], kind: str) -> NDArray[Any]:
    """Return a plane of floats as the kind of number that it stands for."""
    if kind == "bool":
        return values > 0
    if kind == "float32":
        return values
    # A value that is not an integer of the kind stays visible: no surface is numbered -1.
    whole = (np.abs(values) < 2.0**24) & (values == np.floor(values))
    return np.where(whole, values, -1.0).astype(kind)


@dataclass(frozen=True)
class _Step:
    """The step from the kernel's state `before` (None: from the camera) to its state `after`, at `depth`."""

    programs: PathPrograms
    depth: int
    given: State
    before: State | None
    after: State

    @property
    def entered(self) -> NDArray[np.bool_]:
        """Return which paths (P,) were alive before."""
        return np.ones(len(self.given["x"]), bool) if self.before is None else self.before["alive"]

    def of(self, lanes: Any) -> _Step:
        """Return the step of some of the paths."""
        before = None if self.before is None else {name: a[lanes] for name, a in self.before.items()}
        given, after = ({name: a[lanes] for name, a in s.items()} for s in (self.given, self.after))
        return replace(self, given=given, before=before, after=after)

    def ranges(self, guided: bool = False) -> dict[str, Range]:
        """Return the range of each component of the state `after`."""
        parts = self.programs.parts
        if self.before is None:
            sent = ranges.evaluate(parts["start"], self.given, ranges.PROMISED, guided)
            sent["alive"] = Range(np.True_, np.True_, np.True_)
        else:
            depth = np.full(len(self.given["x"]), self.depth - 1, np.uint32)
            inputs = {**self.given, **self.before, "depth": depth}
            sent = ranges.evaluate(parts["scatter"], inputs, ranges.PROMISED, guided)
        gathered = {name: sent[name] for name in QUANTITIES["radiance"]}
        arrived = ranges.evaluate(parts["arrive"], {**self.after, **gathered}, ranges.PROMISED, guided)
        # A path that ends keeps what its last scattering has gathered.
        alive = self.after["alive"]
        kept = {name: ranges.where(alive, arrived[name], gathered[name]) for name in gathered}
        return {name: found for name, found in {**sent, **arrived, **kept}.items() if name in self.after}

    def applies(self, name: str) -> Any:
        """Return for which paths (P,) a component means anything."""
        if name == "alive" or name in QUANTITIES["radiance"]:
            return self.entered
        return self.entered & self.after["alive"]


@dataclass
class _Verdict:
    """What a step's comparison says of each path (P,)."""

    undecided: NDArray[np.bool_]
    different: NDArray[np.bool_]
    unexplained: NDArray[np.bool_]
    gaps: dict[str, Gap]
    examples: list[Unexplained] = field(default_factory=list)


def _judge(step: _Step, view: View) -> _Verdict:
    """Compare the kernel's state after a step with its ranges, in blocks of paths."""
    count = len(step.given["x"])
    verdict = _Verdict(np.zeros(count, bool), np.zeros(count, bool), np.zeros(count, bool), {})
    gaps: dict[str, list[tuple[Any, Any]]] = {name: [] for name in QUANTITIES}
    for first in range(0, count, PATHS_AT_ONCE):
        lanes = slice(first, first + PATHS_AT_ONCE)
        part = step.of(lanes)
        found = part.ranges()
        for name, expected in found.items():
            applies = part.applies(name)
            wrong = applies & ~expected.holds(part.after[name])
            verdict.unexplained[lanes] |= wrong
            verdict.undecided[lanes] |= applies & ~expected.sure
            verdict.examples += _examples(part, name, expected, np.flatnonzero(wrong)[:SHOWN_EACH], view)
        for quantity, components in QUANTITIES.items():
            gaps[quantity] += [_distances(part, name, found[name]) for name in components]
    # Decisions tell more than what follows from them.
    verdict.examples.sort(key=lambda example: example.component not in DECISIONS)
    verdict.gaps = {name: _gap(pairs) for name, pairs in gaps.items()}
    # Which undecided paths went another way than the reference goes from the same state?
    undecided = np.flatnonzero(verdict.undecided)
    part = step.of(undecided)
    for name, expected in part.ranges(guided=True).items() if len(undecided) else ():
        verdict.different[undecided] |= part.applies(name) & ~expected.holds(part.after[name])
    verdict.different &= ~verdict.unexplained
    return verdict


def _distances(step: _Step, name: str, expected: Range) -> tuple[Any, Any]:
    """Return |found - middle| and the bound (...), of the sure paths that a component has a meaning for."""
    sure = step.applies(name) & expected.sure
    low, high, found = (
        np.broadcast_to(a, sure.shape)[sure] for a in (expected.low, expected.high, step.after[name])
    )
    return np.abs(found - (low + high) / 2), (high - low) / 2


def _gap(pairs: list[tuple[Any, Any]]) -> Gap:
    """Return the largest distance, the largest ratio and the median bound; NaN counts as infinite."""
    distance, bound = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    distance = np.where(np.isnan(distance), np.inf, distance)
    ratio = np.divide(distance, bound, out=np.where(distance > 0, np.inf, 0.0), where=bound > 0)
    some = bound[bound > 0]
    return Gap(
        float(np.max(distance, initial=0.0)),
        float(np.max(ratio, initial=0.0)),
        float(np.median(some)) if len(some) else 0.0,
    )


def _examples(
    step: _Step, name: str, expected: Range, lanes: NDArray[np.intp], view: View
) -> list[Unexplained]:
    """Return some unexplained components in words."""
    x, y = step.given["x"], step.given["y"]
    low, high = (np.broadcast_to(end, x.shape) for end in (expected.low, expected.high))
    found = step.after[name]
    return [
        Unexplained(step.depth, int(x[i]), int(y[i]), name, float(found[i]), float(low[i]), float(high[i]))
        for i in lanes
    ]


def _moved(found: State, own: State, together: Any) -> tuple[Any, dict[str, float]]:
    """Return which paths (P,) still go as the reference's own, and how far those have moved, by quantity."""
    alive = own["alive"]
    together = together & (found["alive"] == alive) & (~alive | (found["surface"] == own["surface"]))
    going = together & alive
    moved = {}
    for quantity, components in QUANTITIES.items():
        # A value that is the same in all paths stands for all.
        expected = [np.broadcast_to(own[name], going.shape)[going] for name in components]
        differences = [np.abs(found[n][going] - e) for n, e in zip(components, expected, strict=True)]
        moved[quantity] = float(np.max(np.concatenate(differences), initial=0.0))
    return together, moved


# ---- the random numbers -----------------------------------------------------------------------------------


COUNTERS = ("seed", "pixel", "sample_number")
"""Inputs of the words, in the order of refimpl/rng.py: random_block."""

CARRIERS = ("albedo", "normal", "depth", "position")
"""Groups of planes that carry the halves: ten planes for eight halves."""

HALF = 16
"""Bits of half a word."""


def words(given: Mapping[str, Any], max_depth: int) -> list[Any]:
    """Return four words (...): those of all blocks that paths of this depth use, joined by exclusive or."""
    seed, pixel, sample = (given[name] for name in COUNTERS)
    blocks = [
        rng.random_block(seed, pixel, sample, np.uint32(block))
        for block in range(1 + BLOCKS_PER_BOUNCE * max_depth)
    ]
    return [reduce(lambda a, b: a ^ b, same) for same in zip(*blocks, strict=True)]


def wrong_words(device: Executor, view: View, max_depth: int) -> int:
    """Return for how many paths of a view the device's generator gives other words."""
    kernel = compile_path(_programs(max_depth), device.language, device.lanes, CARRIERS)
    found = device.trace(kernel, view.part).reshape(len(kernel.planes), -1)
    expected = [half.astype(np.float32) for word in words(_given(view), max_depth) for half in _halves(word)]
    return int(np.any(found[: len(expected)] != np.stack(expected), axis=0).sum())


def _programs(max_depth: int) -> PathPrograms:
    """Return the programs of the empty scene with words instead of features."""

    def look(*values: Any) -> dict[str, Any]:
        halves = [
            half
            for word in words(dict(zip(COUNTERS, values, strict=True)), max_depth)
            for half in _halves(word)
        ]
        carriers = planes(CARRIERS)
        # The planes that are left over repeat the first halves.
        return {name: halves[i % len(halves)].astype(np.float32) for i, name in enumerate(carriers)}

    program = trace(look, dict.fromkeys(COUNTERS, Type("uint32")))
    programs = lower_scene(canonical("empty"), Settings(max_depth=0))
    return replace(programs, parts={**programs.parts, "look": pipeline.run(program, PASSES)})


def _halves(word: Any) -> tuple[Any, Any]:
    """Return the upper and the lower 16 bits (...) of words (...)."""
    upper = word >> np.uint32(HALF)
    return upper, word - upper * np.uint32(1 << HALF)
