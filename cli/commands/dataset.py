"""`wamnet dataset`: pairs of noisy pictures and targets over an animation, on as many processes as there are.

1. The request says what the data set consists of [`models/data/frame_plan.py`]; the folder says what of it is
   there [`cli/files/dataset_files.py`].
2. Before anything is rendered, what the frames show is compared; test frames that are not unseen are refused
   [`compared`].
3. What is missing or damaged is made by this process, or on a cluster [`make`]; the bytes of every file are
   the same.
4. `--from-blender` makes frames of a Blender file in place of a scene [`make_from_blender`].
5. `--check` compares every file with its checksum and changes nothing [`check`].
"""

import dataclasses
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from ... import kernels
from ...kernels.run import before
from ...kernels.run.render_frame import shares_work
from ...models.blender import plan as film_plan
from ...models.blender.session import Blender
from ...models.data import frame_plan
from ...models.data.frame_plan import KINDS, FramePlan, Request, Task, plan
from ...models.data.scene_source import SceneSource, scene_source
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.frame import Frame
from ...refimpl.light.scenes import CANONICAL
from ..common import cluster, options
from ..common.executors import chosen
from ..common.inputs import check_input
from ..common.terminal import hint_on_interrupt, progress, say
from ..files import dataset_files, exr

PASSES = ("color", "albedo", "normal", "depth", "position")
"""Layers of a noisy picture of Blender: what Cycles has passes of."""


@dataclass(frozen=True)
class Frames:
    """The fields of a request that mean the same for a scene and for a Blender file."""

    frames: int = 8
    test_frames: int = 2
    outside_frames: int = 0
    spp: int = 64
    test_spp: int = 0
    arc_s: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Ranges:
    """What frames of a scene draw their cameras and lights from, as texts."""

    yaw_deg: str = "0:0"
    pitch_deg: str = "0:0"
    distance: str = "1:1"
    saturation: str | None = None
    power: str | None = None

    def limits(self) -> dict[str, tuple[float, float] | None]:
        """Return the ranges by field; None for the scene's own colours and powers."""
        return {
            name: None if text is None else options.parse_limits(f"--{name.removesuffix('_deg')}", text)
            for name, text in vars(self).items()
        }


@dataclass(frozen=True)
class OfScene:
    """Further fields of a request that only a scene has."""

    size_px: int = 64
    feature_spp: int = 0
    seen: bool = False
    shadow_rays: int = 0
    start_s: float = 0.0
    seconds: float = 8.0
    before: int = 0
    max_depth: int = 5
    executor: options.ExecutorChoice = "auto"
    sampler: options.Sampler = "pcg4d"


@dataclass(frozen=True)
class OfBlender:
    """What means nothing without --from-blender."""

    noisy_spp: int = 1
    percent: int = 100
    view_layer: str = ""
    blender: str | None = None


def dataset(
    command: typer.Context,
    scene: str | None = None,
    output: Path = Path("dataset"),
    *,
    frames: Frames,
    of_scene: OfScene,
    ranges: Ranges,
    parameters: list[str] | None = None,
    context: options.ContextName | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    from_blender: Path | None = None,
    of_blender: OfBlender,
    only_check: bool = False,
) -> None:
    """Render a data set: noisy frames and their targets over an animation."""
    blender = [field.name for field in dataclasses.fields(OfBlender)]
    if only_check:
        check(output, scene)
    elif from_blender is not None:
        known = {*(field.name for field in dataclasses.fields(Frames)), *blender, "from_blender", "output"}
        others = [each.name for each in command.command.params if each.name and each.name not in known]
        options.refuse_given(command, others, "with --from-blender")
        with hint_on_interrupt(lambda: f"{output}: the same command resumes"):
            make_from_blender(output, from_blender, **vars(of_blender), **vars(frames))
    else:
        if scene is None:
            raise InputError("argument SCENE", NO_VALUE, "missing", f"choose one of {', '.join(CANONICAL)}")
        source = scene_source(scene, options.parse_parameters(parameters or []))
        options.refuse_given(command, blender, "without --from-blender")
        if source.still is not None:
            options.refuse_given(
                command, ("start_s", "seconds", "arc_s"), "for a scene file, which is static"
            )
        fields: dict[str, Any] = {**vars(frames), **vars(of_scene), **ranges.limits()}
        _make_from_scene(output, source, fields, workers, scheduler)


def _make_from_scene(
    folder: Path, source: SceneSource, fields: dict[str, Any], workers: int | None, scheduler: str | None
) -> None:
    """Make the data set of a scene and the other fields of a request."""
    request = Request(source.name, source.parameters, still=source.still, **fields)
    if scheduler is not None and workers is not None:
        rule = "a running scheduler has its own workers"
        raise InputError("--workers", workers, rule, "leave out --workers or --scheduler")
    if workers is not None and workers < 1:
        raise InputError("workers", workers, "at least one process must work", "use 1 or more")
    executor = chosen(
        request.executor, because="the scheduler's workers may have no other" if scheduler else ""
    )
    request = replace(request, executor=executor)
    with hint_on_interrupt(lambda: f"{folder}: the same command resumes"):
        make(folder, request, plan(request), workers, scheduler)


def make(
    folder: Path, request: Request, frames: Sequence[FramePlan], workers: int | None, scheduler: str | None
) -> None:
    """Make what is missing in the folder; on a cluster if there is more than one worker (None: per core)."""
    nearest = compared(frames)
    if scheduler is None and not (folder / dataset_files.MANIFEST).exists():
        # A device that is missing here is reported before a folder needs it.
        kernels.open_executor(request.executor).close()
    with dataset_files.Store.open(folder, request, frames, nearest) as store:
        made, again = len(store.missing), [name for name, what in store.missing.items() if what == "damaged"]
        for name in again:
            say(f"{folder / name}: damaged, rendered again")
        if made:
            _render(store, request, workers, scheduler)
    for split, d in nearest.items():
        say(
            f"{split} frames differ from the nearest training frame in {100 * d['differing']:.0f} % of the "
            f"pixels at least; nearest time {d['time_s']:.3f} s, camera {d['camera_deg']:.2f} degrees, "
            f"distance {100 * d['distance']:.2f} %, lights {d['lamps']:.3f}"
        )
    for line in store.summary(made):
        say(line)


def compared(frames: Sequence[FramePlan]) -> dict[str, dict[str, float]]:
    """Return how far the nearest training frame is, by split of test frames; refuse frames that are alike."""
    tests = any(frame.split != frame_plan.TRAIN for frame in frames)
    with progress("comparing views", len(frames) if tests else 0, "frames") as advance:
        found = frame_plan.compared(frames, advance)
    return {split: comparison.as_data() for split, comparison in found.items()}


def _render(store: dataset_files.Store, request: Request, workers: int | None, scheduler: str | None) -> None:
    """Do the tasks that are left in the store."""
    tasks = store.tasks()
    total = sum(task.samples for task in tasks)
    if workers is None:
        # One process is sooner done with few samples than a cluster has started (about five seconds).
        alone = total < 1 << 20 or shares_work(request.executor)
        workers = 1 if alone else len(os.sched_getaffinity(0))
    if not tasks:
        return
    with progress("rendering", total, "samples") as advance:
        if scheduler is None and workers == 1:
            for task in tasks:
                store.put(task, before.carry_out(task, advance))
            return

        def keep(task: Task, band: Frame) -> None:
            store.put(task, band)
            advance(task.samples)

        with cluster.open_client(workers, scheduler) as client:
            cluster.do_on_cluster(client, tasks, before.carry_out, keep)


def check(folder: Path, scene: str | None = None) -> None:
    """Compare the files of a data set with its manifest: report each that is wrong, and refuse the data set.

    A scene beside it is refused: the folder says what it shows.
    """
    if scene is not None:
        rule = "--check looks at the folder, whatever it shows"
        raise InputError("argument SCENE", scene, rule, "leave it out: wamnet dataset --check -o FOLDER")
    manifest = dataset_files.read_manifest(folder)
    with progress("checking", dataset_files.bytes_of(manifest), "bytes") as look:
        wrong = dataset_files.verify(folder, manifest, look)
    for name, what in wrong.items():
        say(f"{folder / name}: {what}")
    dataset_files.refuse_wrong(folder, wrong)
    say(f"{folder}: {2 * len(manifest['frames'])} images match {dataset_files.MANIFEST}")


# ---- of a Blender file -------------------------------------------------------------------------------------


def make_from_blender(folder: Path, file: Path, view_layer: str, blender: str | None, **numbers: Any) -> None:
    """Make what is missing in the folder; `numbers` are those of a request of this file.

    Blender renders to a file beside the data set; what is read of it, as of any other program's, is kept in
    the project's own form, with the same manifest, checksums and resumption as other data sets.
    """
    check_input(file)
    with Blender(file, view_layer, blender) as opened:
        animation, digest = opened.animation, dataset_files.sum_of(file).sha256
        request = film_plan.Request(file.name, digest, animation, **numbers)
        with dataset_files.Store.open(folder, request, film_plan.plan(request)) as store:
            made = len(store.missing)
            if made:
                _render_by_blender(store, opened)
    shown = f"frames {animation.first} to {animation.last} of {animation.scene}"
    say(f"{file}: {shown}, view layer {animation.view_layer}, by Cycles of Blender {animation.version}")
    for line in store.summary(made):
        say(line)


def _render_by_blender(store: dataset_files.Store, blender: Blender) -> None:
    """Render what is left in the store."""
    tasks = store.tasks()
    with (
        progress("rendering", sum(shot.samples for shot in tasks), "samples") as advance,
        tempfile.TemporaryDirectory(prefix="wamnet-blender-") as scratch,
    ):
        path = Path(scratch, "picture.exr")
        for shot in tasks:
            blender.render(shot, path)
            store.put(shot, _read(path, shot))
            path.unlink()
            advance(shot.samples)


def _read(path: Path, shot: film_plan.Shot) -> Frame:
    """Return what Blender has rendered as a frame of a data set."""
    frame, animation = exr.read_frame(path), shot.request.animation
    wanted = PASSES if shot.name.endswith(f"{KINDS[0]}.exr") else PASSES[:1]
    return Frame(
        {name: frame[name] for name in wanted},
        {
            "renderer": f"Cycles, Blender {animation.version}",
            "scene": f"{shot.request.blend}: {animation.scene}",
            "film_frame": str(shot.frame),
            "spp": str(shot.spp),
            "seed": str(shot.seed),
        },
    )
