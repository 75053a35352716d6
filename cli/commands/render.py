"""`wamnet render` and `wamnet scene`: from a scene to a frame, and from a scene's name to its text."""

import time as clock
from pathlib import Path

import typer

from ...kernels.run import render_frame
from ...refimpl.encoding import to_display
from ...refimpl.errors import InputError
from ...refimpl.light.render import Job
from ...refimpl.light.scene import to_json
from ...refimpl.light.transport import Settings
from ..common import options
from ..common.effort import said_of_rendering
from ..common.executors import chosen
from ..common.inputs import load_scene
from ..common.options import FloatType, option
from ..common.terminal import progress, say
from ..files import exr, images
from ..files.outputs import check_output, write_text


def render(
    scene: str = option("scene", ...),
    output: Path | None = option(
        "-o --output FILE  Output: frame with all layers (.exr), or its colour only (.png). [default: "
        "SCENE.exr]"
    ),
    width: int = option("Width in pixels.", 256),
    height: int = option("Height in pixels.", 256),
    spp: int = option("Paths per pixel: 1 is noisy, 1024 is smooth.", 1),
    feature_spp: int = option("feature_spp", 0),
    seen: bool = option("seen", False),
    shadow_rays: int = option("shadow_rays", 0),
    seed: int = option("seed", 0),
    time: float | None = option("time"),
    parameters: list[str] | None = option("parameters"),
    *,
    view: options.View,
    max_depth: int = option("max_depth", 5),
    sampler: options.Sampler = option("sampler", "pcg4d"),
    dtype: FloatType = option("Floating-point type of the computation; files store float32.", "float32"),
    executor: options.ExecutorChoice = option("renderer", "auto"),
    context: options.ContextName | None = option("context"),
    workers: int | None = option("Number of worker processes (NumPy only). [default: one per core]"),
    exposure: float = option("exposure", 0.0),
) -> None:
    """Path-trace a scene: colour, albedo, normal, depth, position and ray direction.

    The same scene, size, samples and seed give the same frame, whatever the number of workers. Compiled
    backends (OpenCL, OpenGL, C) give the same frame up to rounding, and are much faster.

    Examples:
    wamnet render minicubes
    wamnet render minicubes --feature-spp 4 -o noisy.exr
    wamnet render glossy --seen -o mirrors.exr
    wamnet render minicubes --feature-spp 4 --shadow-rays 4 -o shadows.exr
    wamnet render minicubes --time 2.5 --spp 64 --width 512 --height 512 -o reference.exr
    wamnet render minicubes --yaw 20 --light 1=1,0.3,0.3 --light 2=0.3,0.6,1
    wamnet render minicubes --spp 1024 --executor opencl -o reference.exr
    wamnet render furnace --set albedo=0.8 --max-depth 20 -o furnace.png
    """
    loaded = load_scene(scene, time, parameters or [], view)
    path = output or Path(f"{Path(scene).stem}.exr")
    check_output(path, (".exr", ".png"), [Path(scene)])
    settings = Settings(max_depth=max_depth, sampler=sampler)
    job = Job(width, height, spp, seed, settings, dtype, 0, feature_spp, seen, shadow_rays=shadow_rays)
    because = "kernels compute in float32" if dtype == "float64" else ""
    tracer = chosen(executor, because="--workers are processes of NumPy" if workers is not None else because)
    if workers is not None and render_frame.shares_work(tracer):
        rule = f"{tracer} shares the work by itself"
        raise InputError("workers", workers, rule, "leave it out, or use --executor numpy")
    said_of_rendering(loaded, job.samples, width * height, tracer, workers)
    started = clock.perf_counter()
    with progress(f"rendering {scene}", job.samples, "samples") as advance:
        frame = render_frame.render_frame(tracer, loaded, job, workers=workers, on_progress=advance).frame
    taken = f"{clock.perf_counter() - started:.1f} s"
    if path.suffix.lower() == ".exr":
        exr.write_frame(path, frame)
    else:
        images.write_png(path, to_display(frame["color"], exposure))
    say(f"{path}: {width}x{height} pixels, {spp} spp, {taken}")


def scene(
    name: str = option("scene", ...),
    output: Path | None = option("-o --output FILE  Output file. [default: the terminal]"),
    time: float | None = option("time"),
    parameters: list[str] | None = option("parameters"),
    *,
    view: options.View,
) -> None:
    """Write a scene as a JSON file that you can edit and render.

    Examples:
    wamnet scene minicubes
    wamnet scene minicubes --time 2.5 --set warm=1,0.5,0.2 -o mine.json
    wamnet render mine.json
    """
    text = to_json(load_scene(name, time, parameters or [], view))
    if output is None:
        typer.echo(text, nl=False)
        return
    check_output(output, (".json",), [Path(name)])
    write_text(output, text)
    say(str(output))
