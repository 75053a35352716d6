"""`wamnet dataset`: pairs of noisy pictures and targets over an animation, on as many processes as there are.

1. The request says what the data set consists of [`kernels.frame_plan`]; the folder says what of it is there
   [`dataset_files`].
2. What is missing or damaged is made by this process, or on a cluster [`make`]; the bytes of every file are
   the same.
3. `--check` compares every file with its checksum and changes nothing [`check`].
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..refimpl.errors import InputError
from . import cluster, dataset_files, options
from .options import Renderer, Sampler
from .terminal import hint_on_interrupt, progress, say

if TYPE_CHECKING:
    from ..kernels.frame_plan import FramePlan, Request

EXAMPLES = """Examples:

wamnet dataset minicubes -o cubes

wamnet dataset minicubes --frames 64 --size 256 --feature-spp 16 --executor opencl -o cubes

wamnet dataset minicubes --frames 1000 --test 100 --size 1024 --spp 1024 -o large

wamnet dataset minicubes --frames 1000 --scheduler tcp://10.0.0.1:8786 -o large

wamnet dataset --check -o cubes"""
"""Shown below the help of `wamnet dataset`."""

LEAST_SAMPLES = 1 << 20
"""Samples below which one process is sooner done than a cluster has started (about five seconds)."""

SceneOrNone = Annotated[
    str | None,
    typer.Argument(
        metavar="SCENE",
        help=f"Canonical scene ({options.SCENES}); --check needs none.",
        show_default=False,
    ),
]


def dataset(
    scene: SceneOrNone = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of the data set.")
    ] = Path("dataset"),
    frames: Annotated[int, typer.Option(help="Times to train on, evenly over the animation.")] = 8,
    test: Annotated[int, typer.Option(help="Times between them, to be judged on.")] = 2,
    size: Annotated[int, typer.Option(help="Width and height in pixels.")] = 64,
    spp: Annotated[int, typer.Option(help="Paths per pixel of a target; a noisy picture has 1.")] = 64,
    test_spp: Annotated[
        int, typer.Option(help="Paths per pixel of a test target.", show_default="as --spp")
    ] = 0,
    feature_spp: options.FeatureSpp = 0,
    start: Annotated[float, typer.Option(help="Begin of the animation, in seconds.")] = 0.0,
    seconds: Annotated[float, typer.Option(help="Length of the animation; minicubes turn in 8 s.")] = 8.0,
    seed: options.Seed = 0,
    parameters: options.Parameters = None,
    max_depth: Annotated[int, typer.Option(help="Greatest number of bounces of a path.")] = 5,
    executor: Annotated[Renderer, typer.Option(help="What traces the paths.")] = Renderer.numpy,
    sampler: options.SamplerName = Sampler.pcg4d,
    workers: Annotated[
        int | None, typer.Option(help="Processes that share the work.", show_default="one per core")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Running Dask scheduler whose workers share the work."),
    ] = None,
    only_check: Annotated[
        bool, typer.Option("--check", help="Compare the files with their checksums; change nothing.")
    ] = False,
) -> None:
    """Render the frames of a data set: noisy pictures and their targets over an animation.

    The folder gets a manifest with times, seeds and checksums. After any interruption the same command goes
    on where it was; a file that is damaged or missing is made again. The number of workers changes no byte.
    """
    from ..kernels.frame_plan import Request, plan

    if only_check:
        if scene is not None:
            rule = "--check looks at the folder, whatever it shows"
            raise InputError("argument SCENE", scene, rule, "leave it out: wamnet dataset --check -o FOLDER")
        check(output)
        return
    if scene is None:
        raise InputError(
            "argument SCENE", "missing", "a data set shows a scene", f"name one: {options.SCENES}"
        )
    chosen = options.parse_parameters(parameters or [])
    numbers = (start, seconds, frames, test, size, spp, seed, max_depth)
    request = Request(scene, chosen, *numbers, executor.value, sampler.value, feature_spp, test_spp)
    if scheduler is not None and workers is not None:
        rule = "a running scheduler has its own workers"
        raise InputError("--workers", workers, rule, "leave out --workers or --scheduler")
    if workers is not None and workers < 1:
        raise InputError("workers", workers, "at least one process must work", "use 1 or more")
    with hint_on_interrupt(lambda: f"the same command goes on where it was, in {output}"):
        make(output, request, plan(request), workers, scheduler)


def make(
    folder: Path, request: Request, frames: Sequence[FramePlan], workers: int | None, scheduler: str | None
) -> None:
    """Make what is missing in the folder; on a cluster if there is more than one worker (None: per core)."""
    from ..kernels import open_executor

    known = 0
    if (folder / dataset_files.MANIFEST).exists():
        known = dataset_files.bytes_of(dataset_files.read_manifest(folder))
    elif scheduler is None:
        # A device that is missing here is told before a folder asks for it.
        open_executor(request.executor).close()
    with (
        progress("checking", known) as look,
        dataset_files.Store.open(folder, request, frames, look) as store,
    ):
        made, again = len(store.missing), [name for name, what in store.missing.items() if what == "damaged"]
        for name in again:
            say(f"{folder / name}: damaged, is made again")
        if made:
            _render(store, workers, scheduler)
    for name in store.changed:
        say(f"{folder / name}: has other bytes than before; another NumPy or processor made it")
    count = len(store.pictures)
    say(f"{folder}: {count} pictures at {len(frames)} times, {made} of them made now")


def _render(store: dataset_files.Store, workers: int | None, scheduler: str | None) -> None:
    """Do the tasks that are left in the store."""
    from ..kernels.frame_plan import Task, carry_out
    from ..kernels.render_frame import renderer
    from ..refimpl.frame import Frame

    tasks = store.tasks()
    total = sum(task.samples for task in tasks)
    if workers is None:
        alone = total < LEAST_SAMPLES or renderer(store.request.executor).shares_work
        workers = 1 if alone else len(os.sched_getaffinity(0))
    if not tasks:
        return
    with progress("rendering", total) as advance:
        if scheduler is None and workers == 1:
            cluster.do_here(tasks, lambda task: carry_out(task, advance), store.put)
            return

        def keep(task: Task, band: Frame) -> None:
            store.put(task, band)
            advance(task.samples)

        with cluster.open_client(workers, scheduler) as client:
            cluster.do_on_cluster(client, tasks, carry_out, keep)


def check(folder: Path) -> None:
    """Compare the files of a data set with its manifest: tell each that is wrong, and refuse the data set."""
    manifest = dataset_files.read_manifest(folder)
    with progress("checking", dataset_files.bytes_of(manifest)) as look:
        wrong = dataset_files.verify(folder, manifest, look)
    for name, what in wrong.items():
        say(f"{folder / name}: {what}")
    dataset_files.refuse_wrong(folder, wrong)
    say(f"{folder}: {2 * len(manifest['frames'])} pictures are as {dataset_files.MANIFEST} says")
