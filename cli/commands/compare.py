"""`wamnet compare`: how far a picture is from its reference, in every metric, and a kernel's paths."""

import json
from pathlib import Path

import typer

from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.light.render import Job
from ...refimpl.light.transport import Settings
from ..common import options
from ..common.options import ExecutorName, argument, option
from ..common.terminal import table, tell
from ..files.images import read_image
from ..reports.compare_paths import compare_paths
from ..reports.scores import as_data, measure

PANEL = "Paths"
"""Title of the options that go with `--paths`."""

OF_PATHS = ("executor", "width", "height", "sample", "spp", "seed", "max_depth")
"""Options that go only with `--paths`."""

OF_SCENE = ("time", "parameters")
"""Options of the scene."""

OF_PICTURES = ("image", "reference", "exposure")
"""Arguments and options of pictures."""


def compare(
    context: typer.Context,
    image: Path | None = argument("IMAGE  Image to compare (.exr or .png).", None),
    reference: Path | None = argument("REFERENCE  Reference image.", None),
    as_json: bool = option("--json  Print JSON instead of a table.", False),
    exposure: options.Exposure = 0.0,
    paths: str | None = option(
        "SCENE  Compare a kernel's paths in this scene with the reference's, instead of two images.",
        rich_help_panel=PANEL,
    ),
    executor: ExecutorName = option("", ExecutorName.opencl, rich_help_panel=PANEL),
    width: int = option("Width in pixels.", 64, rich_help_panel=PANEL),
    height: int = option("Height in pixels.", 64, rich_help_panel=PANEL),
    sample: int = option("Index of the sample to compare.", 0, rich_help_panel=PANEL),
    spp: int = option("Paths per pixel of the reference image.", 64, rich_help_panel=PANEL),
    seed: int = option("Random seed.", 0, rich_help_panel=PANEL),
    max_depth: int = option("Maximum number of bounces per path.", 5, rich_help_panel=PANEL),
    time: options.Time = None,
    parameters: options.Parameters = None,
) -> None:
    """Compare an image with its reference, or a kernel's paths with the reference path tracer's.

    MSE, PSNR and SSIM compare displayed colours (sRGB-encoded, clipped to white); relMSE and SMAPE compare
    linear radiance.

    With --paths every step of every path has a rounding-error bound; a larger difference is
    [bold]unexplained[/]. A step whose decision is within the bound of its threshold is
    [bold]undecided[/], and [bold]different[/] if the reference decides otherwise. [bold]parted[/] counts the
    paths that have diverged; [bold]moved[/] is the largest change of the others' vertices. Welch's test
    compares the images. The exit status is 1 if a difference is unexplained or the test fails.

    Examples:
    wamnet compare denoised.png reference.png
    wamnet compare noisy.exr reference.exr --json
    wamnet compare --paths minicubes
    wamnet compare --paths cornell --executor opengl --width 32 --height 32 --max-depth 3
    """
    if paths is None:
        options.refuse_given(context, (*OF_PATHS, *OF_SCENE), "without --paths SCENE")
        if image is None or reference is None:
            rule = "needs IMAGE and REFERENCE, or --paths SCENE"
            raise InputError("wamnet compare", NO_VALUE, rule, "see wamnet compare --help")
        compare_pictures(image, reference, exposure, as_json)
        return
    options.refuse_given(context, OF_PICTURES, "with --paths")
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
