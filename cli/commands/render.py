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
from ..common.executors import chosen
from ..common.inputs import load_scene
from ..common.options import FloatType
from ..common.terminal import progress, say
from ..files import exr, images
from ..files.outputs import check_output, write_text


def render(
    scene: str,
    output: Path | None = None,
    width: int = 256,
    height: int = 256,
    spp: int = 1,
    feature_spp: int = 0,
    seen: bool = False,
    shadow_rays: int = 0,
    seed: int = 0,
    time: float | None = None,
    parameters: list[str] | None = None,
    *,
    view: options.View,
    max_depth: int = 5,
    sampler: options.Sampler = "pcg4d",
    dtype: FloatType = "float32",
    executor: options.ExecutorChoice = "auto",
    context: options.ContextName | None = None,
    workers: int | None = None,
    exposure: float = 0.0,
) -> None:
    """Path-trace a scene: colour, albedo, normal, depth, position and ray direction."""
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
    name: str,
    output: Path | None = None,
    time: float | None = None,
    parameters: list[str] | None = None,
    *,
    view: options.View,
) -> None:
    """Write a scene as a JSON file that you can edit and render."""
    text = to_json(load_scene(name, time, parameters or [], view))
    if output is None:
        typer.echo(text, nl=False)
        return
    check_output(output, (".json",), [Path(name)])
    write_text(output, text)
    say(str(output))
