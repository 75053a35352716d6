"""`wamnet compare --paths`: a path kernel against the reference, path by path and as a picture."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import typer

from ... import kernels
from ...kernels.judge.compare_images import ImageReport, check_samples, compare_images
from ...kernels.judge.compare_paths import PathReport
from ...refimpl.light.render import Job
from ..common.inputs import load_scene
from ..common.terminal import progress, say, table

STATUS_DIFFERENT = 1
"""Exit status when a difference has no explanation."""


def compare_paths(
    name: str,
    executor: str,
    job: Job,
    time: float | None,
    parameters: Sequence[str],
    as_json: bool,
) -> None:
    """Compare the paths of the job's first sample, and the picture; end with status 1 if they disagree."""
    from ...kernels.judge.compare_paths import View, compare_paths

    scene = load_scene(name, time, parameters)
    check_samples(job)
    view = View(job.width, job.height, job.first_sample, job.seed)
    with kernels.open_executor(executor) as device:
        with progress(f"comparing paths of {name}", job.settings.max_depth + 1, "bounces") as advance:
            paths = compare_paths(device, scene, job.settings, view, on_progress=advance)
        with progress(f"rendering {name}", job.width * job.height * job.spp, "samples") as advance:
            image = compare_images(device, scene, job, on_progress=advance)
    if as_json:
        typer.echo(json.dumps(_as_data(name, device.device, paths, image)))
    else:
        _print(f"{name} on {device.device}", paths, image)
    if not (paths.passed and image.passed):
        raise typer.Exit(STATUS_DIFFERENT)


def _as_data(name: str, device: str, paths: PathReport, image: ImageReport) -> dict[str, Any]:
    """Return both reports as JSON's types; what is not finite is null."""
    parts = {
        "paths": {**asdict(paths), "passed": paths.passed},
        "image": {**asdict(image), "passed": image.passed},
    }
    return {"scene": name, "device": device, **_finite(parts)}


def _finite(data: Any) -> Any:
    """Return data with None instead of numbers that JSON does not know."""
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not abs(data) < float("inf") else data


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
