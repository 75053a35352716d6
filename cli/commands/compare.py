"""`wamnet compare`: how far a picture is from its reference, in every metric, and a kernel's paths."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import typer

from ... import kernels
from ...kernels.cache import clean
from ...kernels.judge.compare_images import ImageReport, check_samples, compare_images
from ...kernels.judge.compare_paths import PathReport, View
from ...kernels.judge.compare_paths import compare_paths as compare_paths_of
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.light.render import Job
from ...refimpl.light.transport import Settings
from ..common import options
from ..common.inputs import load_scene
from ..common.options import ExecutorName
from ..common.terminal import STATUS_WRONG, progress, say, table, tell
from ..files.images import read_image
from ..reports.scores import as_data, measure


def compare(
    command: typer.Context,
    image: Path | None = None,
    reference: Path | None = None,
    as_json: bool = False,
    exposure: float = 0.0,
    paths: str | None = None,
    executor: ExecutorName = ExecutorName.opencl,
    width: int = 64,
    height: int = 64,
    sample: int = 0,
    spp: int = 64,
    seed: int = 0,
    max_depth: int = 5,
    time: float | None = None,
    parameters: list[str] | None = None,
) -> None:
    """Compare an image with its reference, or a kernel's paths with the reference path tracer's."""
    if paths is None:
        of_paths = ("executor", "width", "height", "sample", "spp", "seed", "max_depth", "time", "parameters")
        options.refuse_given(command, of_paths, "without --paths SCENE")
        if image is None or reference is None:
            rule = "needs IMAGE and REFERENCE, or --paths SCENE"
            raise InputError("wamnet compare", NO_VALUE, rule, "see wamnet compare --help")
        compare_pictures(image, reference, exposure, as_json)
        return
    options.refuse_given(command, ("image", "reference", "exposure"), "with --paths")
    job = Job(width, height, spp, seed, Settings(max_depth=max_depth), first_sample=sample)
    compare_paths(paths, executor.value, job, time, parameters or [], as_json)


def compare_pictures(image: Path, reference: Path, exposure: float, as_json: bool) -> None:
    """Print the score of a picture in each metric."""
    a, b = read_image(image, exposure, tell), read_image(reference, exposure, tell)
    if a.display.shape != b.display.shape:
        (height, width, _), (rows, columns, _) = a.display.shape, b.display.shape
        rule = f"{reference} has {columns}x{rows}"
        raise InputError(f"size of {image}", f"{width}x{height}", rule, "compare images of equal size")
    scores = measure(a, b)
    if as_json:
        typer.echo(json.dumps({"image": str(image), "reference": str(reference), **as_data(scores)}))
    else:
        table(f"{image} against {reference}", ("metric", "value"), [(s.metric, str(s)) for s in scores])


def compare_paths(
    name: str, executor: str, job: Job, time: float | None, parameters: Sequence[str], as_json: bool
) -> None:
    """Compare the paths of the job's first sample, and the picture; end with status 1 if they disagree."""
    scene = load_scene(name, time, parameters)
    check_samples(job)
    view = View(job.width, job.height, job.first_sample, job.seed)
    with kernels.open_executor(executor) as device:
        with progress(f"comparing paths of {name}", job.settings.max_depth + 1, "bounces") as advance:
            paths = compare_paths_of(device, scene, job.settings, view, on_progress=advance)
        with progress(f"rendering {name}", job.width * job.height * job.spp, "samples") as advance:
            image = compare_images(device, scene, job, on_progress=advance)
    if as_json:
        parts = {key: {**asdict(r), "passed": r.passed} for key, r in (("paths", paths), ("image", image))}
        typer.echo(json.dumps({"scene": name, "device": device.device, **clean(parts)}))
    else:
        _print(f"{name} on {device.device}", paths, image)
    if not (paths.passed and image.passed):
        raise typer.Exit(STATUS_WRONG)


def _print(title: str, paths: PathReport, image: ImageReport) -> None:
    """Print counts by depth, errors by quantity and depth, and the verdicts."""
    rows = [
        (d.depth, d.paths, d.undecided, d.different, d.unexplained, d.parted, f"{d.moved['point']:.1e}")
        for d in paths.depths
    ]
    view = paths.view
    table(
        f"Paths of {title}, {view.width}x{view.height}, sample {view.sample}, seed {view.seed}",
        ("depth", "paths", "undecided", "different", "unexplained", "parted", "moved"),
        [tuple(map(str, row)) for row in rows],
    )
    depths = paths.depths
    table(
        "Largest error / bound of a step, by depth",
        ("quantity", *(str(d.depth) for d in depths), "median bound"),
        [
            (
                quantity,
                *(f"{d.gaps[quantity].ratio:.2f}" for d in depths),
                f"{depths[-1].gaps[quantity].bound:.1e}",
            )
            for quantity in depths[0].gaps
        ],
    )
    for example in paths.examples:
        say(f"unexplained: {example}")
    count = view.width * view.height
    say(f"random numbers: {count - paths.wrong_words} of {count} paths have the reference's, to the bit")
    kernel, reference = image.spp
    say(
        f"picture: {kernel} against {reference} spp, least p-value {image.least:.2g} of {image.comparisons}, "
        f"at least {image.level:.2g} expected (significance {image.significance:g})"
    )
    say("passed" if paths.passed and image.passed else "FAILED: the kernel is not the reference")
