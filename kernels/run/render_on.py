"""Render a scene on an executor: trace, compile, follow the paths part by part, and add up.

1. The scene's programs become a kernel for the executor's schedule [`Frames`]. Scenes of one layout are a
   family [`_Family`], whose kernel has the numbers in which they differ as inputs
   (compiler/scenes/scene_inputs.py): one that fits the kernel needs no other [`MovingPaths.of`]. One that
   differs in more numbers widens the inputs, and the kernel is compiled once more; one of another layout
   begins another family. Scenes to come that are named at first have one kernel in all. By definition a
   kernel that is given a scene's numbers draws what the kernel of that scene draws.
2. A kernel adds up at most [`SAMPLES_AT_ONCE`] samples in float32; parts hold about [`PATHS_AT_ONCE`] paths,
   so that progress is seen and no driver takes a kernel for hanging.
3. Sums of parts are added in float64, squared deviations by the formula of Chan, Golub and LeVeque,
   "Algorithms for Computing the Sample Variance", The American Statistician 37(3), 1983 [`merge`].

The random numbers are those of the reference, to the bit, so that the same job gives the same picture up to
rounding, and to paths whose decision fell differently by it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.scenes.emit_path import FRAME_GROUPS, GROUPS, Encoding, planes
from ...compiler.scenes.lower_scene import lower_scene
from ...compiler.scenes.path_kernel import can_move, compile_path
from ...compiler.scenes.scene_inputs import SceneInputs, Tables, layout_of, tables_of
from ...refimpl.errors import InputError
from ...refimpl.frame import LIT, SEEN, Frame
from ...refimpl.light.render import (
    Job,
    Render,
    checked_rows,
    feature_job,
    feature_settings,
    joined,
    render_info,
    with_own_features,
)
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings
from ..devices.executor import Executor
from ..devices.kernel import Part
from ..memory import keep_freed_memory

SAMPLES_AT_ONCE = 16
"""Most samples that are added up in float32: 15 roundings, a relative error below 1e-6."""

PATHS_AT_ONCE = 1 << 20
"""About how many paths a kernel follows before the host hears of it: a fraction of a second on a CPU."""


KEPT_SCENES = 8
"""Compiled scenes that a process keeps: bands of one picture, and noisy picture and target, share theirs."""


def groups_of(job: Job) -> tuple[str, ...]:
    """Return the groups of planes that a job's kernel adds up: its layers, and what its variance is of."""
    wanted = {*job.layers, "deviation"} if job.color else {*job.layers}
    return tuple(group for group in (*FRAME_GROUPS, *SEEN, *LIT) if group in wanted)


class Frames:
    """The kernels of frames of some scenes: one for all that differ only in numbers."""

    def __init__(self, scenes: Sequence[Scene]) -> None:
        self._scenes = tuple(scenes)
        self._paths: dict[tuple[object, ...], MovingPaths] = {}

    def of(self, device: Executor, scene: Scene, job: Job, groups: Sequence[str] = ()) -> Moment:
        """Return the kernel that renders a job's scene on an executor, and the scene's numbers.

        `groups` are those of its planes, by default what the job's frame is made of.
        """
        settings, groups = job.settings, tuple(groups) or groups_of(job)
        key = (device.name, device.lanes, device.profile, settings, groups, job.shadow_rays)
        if key not in self._paths:
            more = {"seen": job.seen, "shadow_rays": job.shadow_rays}
            paths = MovingPaths(device, settings, groups, more, moving=self._scenes)
            self._paths[key] = paths
        return self._paths[key].of(scene)


@lru_cache(KEPT_SCENES)
def frames_of(scene: Scene) -> Frames:
    """Return the kernels of a scene's frames, which a process keeps."""
    return Frames([scene])


def render_on(
    device: Executor,
    scene: Scene,
    job: Job,
    *,
    rows: tuple[int, int] | None = None,
    on_progress: Callable[[int], None] | None = None,
    frames: Frames | None = None,
) -> Render:
    """Render the rows [first, last) of a scene on an executor, all by default, in float32.

    on_progress is called with the number of samples that were just finished. `frames`: those that
    have the scene's kernel; by default it is compiled.
    """
    if job.dtype != "float32":
        raise InputError("dtype", job.dtype, "kernels compute in float32", "render with --executor numpy")
    if feature_job(job) is not None:
        again = partial(render_on, device, scene, rows=rows, on_progress=on_progress, frames=frames)
        return with_own_features(scene, job, again)
    first, last = checked_rows(job, rows)
    if job.seen and len(planes(groups_of(job))) > device.language.dialect.max_planes:
        # The same paths twice, for layers that no kernel of this device writes at once.
        settings = job.settings if job.color else feature_settings(job.settings, False)
        plain = replace(job, seen=False, settings=settings)
        again = partial(render_on, device, scene, rows=rows, frames=frames)
        hits, past = again(plain, on_progress=on_progress), replace(job, color=False)
        names = [name for name in job.layers if name not in plain.layers]
        moment = (frames or frames_of(scene)).of(device, scene, past, names)
        seen = _render(moment.kernel, moment.totals(past, (first, last)), names, {})
        return joined(scene, job, hits, seen)
    moment = (frames or frames_of(scene)).of(device, scene, job)
    totals = moment.totals(job, (first, last), on_progress)
    return _render(moment.kernel, totals, job.layers, render_info(scene, job))


def sample_ranges(job: Job, band: tuple[int, int]) -> Iterator[list[Part]]:
    """Yield the parts of a band of rows: for each range of samples the ranges of rows, top to bottom."""
    first, last = band
    for first_sample in range(0, job.spp, SAMPLES_AT_ONCE):
        samples = min(SAMPLES_AT_ONCE, job.spp - first_sample)
        rows = max(1, PATHS_AT_ONCE // (job.width * samples))
        whole = Part(job.width, job.height, 0, rows, job.first_sample + first_sample, samples, job.seed)
        yield [replace(whole, first_row=row, rows=min(rows, last - row)) for row in range(first, last, rows)]


@dataclass(frozen=True)
class Totals:
    """Sums (planes, H, W) in float64 over a number of samples."""

    samples: int
    planes: NDArray[np.float64]


def merge(kernel: Artifact, a: Totals, b: Totals) -> Totals:
    """Return the totals over the samples of both; a may have none."""
    if not a.samples:
        return b
    planes = a.planes + b.planes
    for names in zip(GROUPS["color"], GROUPS["deviation"], strict=True):
        if names[0] not in kernel.planes:
            continue
        color, deviation = map(kernel.planes.index, names)
        difference = b.planes[color] / b.samples - a.planes[color] / a.samples
        planes[deviation] += difference**2 * (a.samples * b.samples / (a.samples + b.samples))
    return Totals(a.samples + b.samples, planes)


def _render(kernel: Artifact, totals: Totals, names: Sequence[str], info: dict[str, str]) -> Render:
    """Return the means as a frame of these layers, and the variance of one sample."""
    means = dict(zip(kernel.planes, totals.planes / totals.samples, strict=True))
    layers: dict[str, Any] = {}
    for name in names:
        layers[name] = np.stack([means[plane] for plane in GROUPS[name]], axis=-1).astype(np.float32)
    none = np.zeros(totals.planes.shape[1:])
    deviations = np.stack([means.get(plane, none) for plane in GROUPS["deviation"]], axis=-1)
    return Render(Frame(layers, info), deviations * (totals.samples / max(totals.samples - 1, 1)))


# ---- scenes that move -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Moment:
    """A kernel that draws a scene, what runs it, and the scene's numbers (n,) that it is given."""

    executor: Executor
    kernel: Artifact
    numbers: NDArray[np.float32]

    def totals(
        self, job: Job, band: tuple[int, int], on_progress: Callable[[int], None] | None = None
    ) -> Totals:
        """Return the sums of the kernel over a job's samples, in a band of rows."""
        self.executor.build(self.kernel)
        keep_freed_memory()
        totals = Totals(0, np.zeros((len(self.kernel.planes), band[1] - band[0], job.width)))
        for parts in sample_ranges(job, band):
            sums = []
            for part in parts:
                sums.append(self.executor.trace(self.kernel, part, self.numbers))
                if on_progress is not None:
                    on_progress(part.rows * part.width * part.samples)
            joined_sums = np.concatenate(sums, axis=1, dtype=np.float64)
            totals = merge(self.kernel, totals, Totals(parts[0].samples, joined_sums))
        return totals


@dataclass
class _Family:
    """Scenes of one layout: the first one with its tables, the inputs, and the kernel when it is compiled.

    `moves` says whether a kernel takes the inputs, once it is known.
    """

    scene: Scene
    tables: Tables
    inputs: SceneInputs
    kernel: Artifact | None = None
    moves: bool | None = None


@dataclass
class MovingPaths:
    """The kernels of scenes on a device, for groups of planes or with the end of an `encoding`.

    `more`: what else lower_scene takes; `moving`: scenes to come, or inputs.
    """

    executor: Executor
    settings: Settings
    groups: Sequence[str]
    more: Mapping[str, Any]
    encoding: Encoding | None = None
    moving: Sequence[Scene] | SceneInputs = ()
    families: dict[tuple[object, ...], _Family] = field(default_factory=dict)

    def __post_init__(self) -> None:
        none = SceneInputs(self.settings, ())
        self._inputs = self.moving if isinstance(self.moving, SceneInputs) else none
        if not isinstance(self.moving, SceneInputs):
            self._find(self.moving)

    def of(self, scene: Scene) -> Moment:
        """Return a scene's kernel, compiled if there is none that it fits, and its numbers."""
        tables = tables_of(scene, self.settings)
        layout = layout_of(tables)
        if layout not in self.families:
            inputs = SceneInputs(self.settings, ()) if self.families else self._inputs
            self.families[layout] = _Family(scene, tables, inputs)
        family = self.families[layout]
        if not family.inputs.fits(family.tables, tables):
            family.inputs = family.inputs.widened([family.tables, tables])
            family.kernel = family.moves = None
        if family.moves is None:
            family.moves = can_move(self.executor.language, family.scene, family.tables, family.inputs)
        if not family.moves:
            alone = self._compiled(scene, SceneInputs(self.settings, ()))
            return Moment(self.executor, alone, np.zeros(0, np.float32))
        if family.kernel is None:
            family.kernel = self._compiled(family.scene, family.inputs)
        return Moment(self.executor, family.kernel, family.inputs.read(tables))

    def _compiled(self, scene: Scene, inputs: SceneInputs) -> Artifact:
        """Return the kernel of a scene, some of whose numbers are inputs."""
        language, lanes = self.executor.language, self.executor.lanes
        programs = lower_scene(scene, self.settings, language.forms, inputs, **self.more)
        return compile_path(programs, language, lanes, self.groups, self.encoding)

    def _find(self, scenes: Sequence[Scene]) -> None:
        """Make a family for each layout of some scenes, with the numbers in which they differ as inputs."""
        rows: dict[tuple[object, ...], list[Tables]] = {}
        for scene in scenes:
            tables = tables_of(scene, self.settings)
            layout = layout_of(tables)
            rows.setdefault(layout, []).append(tables)
            self.families.setdefault(layout, _Family(scene, tables, self._inputs))
        for layout, alike in rows.items():
            self.families[layout].inputs = self._inputs.widened(alike)
