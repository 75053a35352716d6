"""`wamnet demo`: the whole way, from a scene to a report, judged on frames that the network has not seen.

1. Make a data set of the scene's animation: noisy frames and references at training times, and at test times
   of other poses [`render_frames`].
2. Train the network on the training frames [`train_network`].
3. Compile it for every executor, run each that is there on the first test frame, and the best one on all
   [`run_kernels`].
4. Measure noisy and denoised pictures against their references [`score`].
5. Write pictures and frames [`write_pictures`], then `report.json` and `report.html` [`report.write`].

A run that was interrupted resumes: the data set knows what of it is there; training resumes from its
checkpoint, which refuses other frames and other recipes.
"""

import json
import math
import shlex
import time as clock
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar

from ... import kernels
from ...compiler.compile import compile_program
from ...compiler.core.lower import lower
from ...compiler.scenes.encode_kernel import sees
from ...compiler.targets import TARGETS
from ...kernels.bench.contest import Request
from ...kernels.devices import registry
from ...kernels.run.trainer import facts_of
from ...models.data import frame_plan
from ...models.data.scene_source import scene_source
from ...models.model_file import load_checkpoint
from ...refimpl.encoding import from_display, normal_to_display, to_display
from ...refimpl.errors import InputError
from ...refimpl.frame import LIT, Frame
from ...refimpl.light.render import Job
from ...refimpl.light.shading import build, ever_follows
from ...refimpl.network.denoise import Model
from ...refimpl.network.train import PRESETS, TrainState, model_of
from ...refimpl.reading import read_file
from ..common.packages import need
from ..common.terminal import hint_on_interrupt, progress, say, table
from ..files import dataset_files, exr, images
from ..files.alone import working_in
from ..files.images import Image
from ..files.outputs import visible, write_text
from ..reports import report
from ..reports.report import Plan, Results, Unseen
from ..reports.runs import Run, run_all
from ..reports.scores import Score, measure
from . import bench, bench_frames, dataset, train
from .compile import write_kernel

Pair = tuple[Frame, Frame]

FOLDER = "out/demo"
"""Folder of the results, unless another is given."""

QUICK_FOLDER = "out/demo-quick"
"""Folder of the results of `--quick`, which must not mix with the others."""

PLAN_NAME = "plan.json"
"""File in the folder that says which plan its results are of."""

DATA_SET = "frames"
"""Folder of the data set, in the folder of the results."""

REPEATS = 3
"""Times of each contender that the report shows."""

_Result = TypeVar("_Result")

QUICK = Plan(size_px=24, train_frames=2, test_frames=2, train_spp=8, reference_spp=8, steps=60)
"""Small enough to test the whole way; its pictures are not meant to be looked at."""

VIEWS: dict[str, Any] = {"yaw_deg": (-24.0, 24.0), "pitch_deg": (-5.0, 10.0), "distance": (0.9, 1.15)}
"""Cameras of a static scene: about its own; seldom below a floor, or inside an object."""

REFERENCE_SPP_OF_NUMPY = 32
"""Samples of a reference where no kernel runs: NumPy's would take an hour, and are thirty times slower."""

TRAIN_FRAMES_OF_NUMPY = 12
"""Training frames there, for the same reason."""


def demo(
    scene: str = "minicubes",
    output: Path | None = None,
    size: int | None = None,
    quick: bool = False,
) -> None:
    """Render, train, compile, denoise unseen frames and write a report, in about six minutes."""
    for module in ("matplotlib", "jinja2"):
        need(module, "to draw the report")
    if quick and size is not None:
        raise InputError("--size", size, "cannot be combined with --quick", "leave out one of them")
    sizes = QUICK if quick else Plan(size_px=Plan.size_px if size is None else size)
    plan = for_this_machine(of_scene(sizes, scene))
    folder = output or Path(QUICK_FOLDER if quick else FOLDER)
    size_of = "--quick" if quick else f"--size {plan.size_px}"
    scene_of = [] if scene == Plan.scene else ["--scene", scene]
    command = shlex.join(["wamnet", "demo", *scene_of, *size_of.split(), "-o", str(folder)])
    with begun(plan, folder), hint_on_interrupt(lambda: f"{folder}: the same command resumes ({command})"):
        results = carry_out(plan, folder)
        speed = (
            None if quick else _timed(results.seconds, "speed", lambda: measure_speed(plan, results, folder))
        )
        report.write(folder, plan, results, command, speed)
    _tell(results, folder)


def of_scene(plan: Plan, name: str) -> Plan:
    """Return the plan for a scene: the preset for its materials and lights, and views if it is static."""
    source = scene_source(name)
    shown = source.at()
    matte = plan.preset if shown.lights else "best"
    mirrors = "mirrors-shadows" if ever_follows(build(shown, float)) else matte
    preset = "sky-shadows" if shown.environment else mirrors
    first, later = (replace(source.at(time), environment=None, lights=(), info={}) for time in (0.0, 1.0))
    views = VIEWS if first == later else {}
    return replace(plan, scene=name, scene_sha256=source.sha256, preset=preset, **views)


def for_this_machine(plan: Plan) -> Plan:
    """Return the plan with the fastest executors that are available here, or one that NumPy can do."""
    (name, passed), (trainer, _) = registry.fastest(), registry.fastest(trains=True)
    for reason in passed:
        say(f"not {reason}")
    if name != "numpy":
        return replace(plan, renderer=name, trainer=trainer)
    most, frames = REFERENCE_SPP_OF_NUMPY, min(plan.train_frames, TRAIN_FRAMES_OF_NUMPY)
    train_spp, spp = min(plan.train_spp, most), min(plan.reference_spp, most)
    say(f"rendered with NumPy, which is slow: {frames} training times, references have {spp} paths per pixel")
    few = replace(plan, train_frames=frames, train_spp=train_spp, reference_spp=spp)
    return replace(few, renderer=name, trainer=trainer)


@contextmanager
def begun(plan: Plan, folder: Path) -> Iterator[None]:
    """Make the folder and note the plan in it; refuse a folder that has anything but results of this plan.

    Nobody else makes a demonstration there until the block has ended.
    """
    Job(plan.size_px, plan.size_px)  # Refuses a size that cannot be rendered.
    text = json.dumps(asdict(plan), indent=2) + "\n"
    _check_note(folder, text)
    with working_in(folder, "making a demonstration"):
        if not _check_note(folder, text):
            write_text(folder / PLAN_NAME, text)
        yield


def _check_note(folder: Path, text: str) -> bool:
    """Tell whether the folder has results of this plan; refuse it if it has anything else to be seen.

    What is hidden is a lock, or a file of a run that was killed before it had noted its plan.
    """
    if not visible(folder):
        return False
    try:
        found = read_file(folder / PLAN_NAME).decode("utf-8", "replace")
    except InputError:
        found = ""
    if found != text:
        rule = "holds results of another plan" if found else "holds files that are not the demo's"
        raise InputError("output folder", str(folder), rule, "choose another with -o, or remove it")
    return True


def carry_out(plan: Plan, output: Path) -> Results:
    """Do all steps in the folder `output` and return what they have found."""
    seconds: dict[str, float] = {}
    say(f"renderer {plan.renderer}, trainer {plan.trainer}: the fastest available")
    _timed(seconds, "rendering", lambda: render_frames(plan, output))
    times, pairs = zip(*_pairs(output, "train"), strict=True)
    model, state, per_step = _timed(seconds, "training", lambda: train_network(plan, pairs, output))
    tests = _pairs(output, "test")
    inputs = [noisy for _, (noisy, _) in tests]
    images, by, runs = _timed(seconds, "kernels", lambda: run_kernels(model, inputs, output))
    unseen = tuple(
        Unseen(
            time, _label(plan, time, noisy), noisy, reference, image, score(model, noisy, reference, image)
        )
        for (time, (noisy, reference)), image in zip(tests, images, strict=True)
    )
    results = Results(times, unseen, by, model, state, per_step, runs, seconds)
    write_pictures(output, results)
    return results


def _label(plan: Plan, time_s: float, frame: Frame) -> str:
    """Return how the report calls a frame: by its time, or by the camera of a static scene."""
    if not plan.scene_sha256:
        return f"time {time_s:.2f} s"
    yaw, pitch = (float(frame.info[name]) for name in ("yaw_deg", "pitch_deg"))
    return f"view, yaw {yaw:.1f}°, pitch {pitch:.1f}°"


def _timed(seconds: dict[str, float], name: str, step: Callable[[], _Result]) -> _Result:
    """Do a step, and note and print how long it took."""
    start = clock.perf_counter()
    result = step()
    seconds[name] = clock.perf_counter() - start
    say(f"{name}: {seconds[name]:.1f} s")
    return result


def render_frames(plan: Plan, output: Path) -> None:
    """Render what an earlier run has not: the data set of the plan."""
    source, features = scene_source(plan.scene), PRESETS[plan.preset].features
    request = frame_plan.Request(
        source.name,
        still=source.still,
        yaw_deg=plan.yaw_deg,
        pitch_deg=plan.pitch_deg,
        distance=plan.distance,
        seen=sees(features),
        shadow_rays=int(not set(LIT).isdisjoint(features)),
        frames=plan.train_frames,
        test_frames=plan.test_frames,
        size_px=plan.size_px,
        spp=plan.train_spp,
        test_spp=plan.reference_spp,
        feature_spp=plan.feature_spp,
        seed=plan.seed,
        executor=plan.renderer,
    )
    dataset.make(output / DATA_SET, request, frame_plan.plan(request), workers=1, scheduler=None)


def _pairs(output: Path, split: str) -> list[tuple[float, Pair]]:
    """Return time and pair (noisy, reference) of each frame of a split."""
    folder = output / DATA_SET
    frames = dataset_files.read_manifest(folder)["frames"]
    times = [float(frame["time_s"]) for frame in frames if frame["split"] == split]
    return list(zip(times, dataset_files.read_pairs(folder, split), strict=True))


def train_network(plan: Plan, pairs: Sequence[Pair], output: Path) -> tuple[Model, TrainState, float | None]:
    """Train, or finish what an earlier run began; return model, last state and seconds a step, if known."""
    recipe = replace(PRESETS[plan.preset], seed=plan.seed)
    if plan.steps is not None:
        recipe = replace(recipe, steps=plan.steps, log_every=max(1, plan.steps // 20))
    path, speed = output / "model.safetensors", output / "seconds_per_step.txt"
    done = 0
    try:
        begin = load_checkpoint(train.checkpoint_path(path))
        state, seconds = train.fit(recipe, pairs, path, begin, executor=plan.trainer)
        done = begin.step
    except InputError:
        # There is no checkpoint, or it is damaged, or one of other frames or another recipe: start again.
        state, seconds = train.fit(recipe, pairs, path, executor=plan.trainer)
    if state.step > done:
        write_text(speed, f"{seconds / (state.step - done)}\n")
    return model_of(state, facts_of(pairs)), state, _seconds(speed)


def _seconds(path: Path) -> float | None:
    """Return the time in a file, or None where there is none: it is printed, and nothing depends on it."""
    try:
        value = float(read_file(path, most=100))
    except (InputError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def run_kernels(
    model: Model, frames: Sequence[Frame], output: Path
) -> tuple[list[Any], str, tuple[Run, ...]]:
    """Write the kernel of each target, run each executor on the first frame, and one of them on all.

    Return the pictures, whose they are, and what was found about each executor.
    """
    compiled = {target: compile_program(lower(model), target) for target in TARGETS}
    for target, kernel in compiled.items():
        write_kernel(kernel, output / "kernels" / target)
    with progress("running", len(compiled), "kernels") as advance:
        images, runs = run_all(model, frames[0], compiled, advance)
    by = next(name for name in ("opencl", "opengl", "numpy") if name in images)
    with kernels.open_executor(by) as executor:
        others = [kernels.denoise_on(executor, model, frame).image for frame in frames[1:]]
    return [images[by], *others], by, runs


def measure_speed(plan: Plan, results: Results, output: Path) -> dict[str, Any]:
    """Return what a reduced benchmark finds: schedules and trained forms, by time, quality and bound.

    Forms are trained where that is compiled: the reference would take an hour.
    """
    model, forms = results.model, []
    shown = bench_frames.of_folder(output / DATA_SET, model)
    if plan.trainer != "numpy":
        wanted = bench_frames.planned(model, bench_frames.QUICK_FORMS, 1000)
        pairs = bench_frames.of_folder(output / DATA_SET, model, "train").pairs
        forms = bench_frames.trained(
            model, wanted, pairs, bench_frames.folder_of(model, output), plan.trainer
        )
    facts: dict[str, Any] = {"pairs": shown.pairs, "frames": shown.as_data(), "name": f"demo, {plan.scene}"}
    request = Request(model, plan.size_px, REPEATS, budget_s=3.0, quick=True, **facts)
    return bench.measure(request, command="wamnet demo", forms=forms)


def score(model: Model, noisy: Frame, reference: Frame, denoised: Any) -> dict[str, tuple[Score, ...]]:
    """Return the scores of the noisy and the denoised picture.

    The network's output is display-encoded and ends at white, so all pictures are measured in that form.
    """
    stops = model.normalization.exposure_stops

    def seen(display: Any) -> Image:
        return Image(display, from_display(display, stops))

    target = seen(to_display(reference["color"], stops))
    pictures = {"input": seen(to_display(noisy["color"], stops)), "denoised": seen(denoised)}
    return {name: measure(picture, target) for name, picture in pictures.items()}


def write_pictures(output: Path, results: Results) -> None:
    """Write each test frame's pictures as PNG, and the denoised one as EXR too."""
    stops = results.model.normalization.exposure_stops
    folder = output / report.FOLDER
    folder.mkdir(exist_ok=True)
    for index, frame in enumerate(results.unseen):
        for name, picture in (("noisy", frame.noisy), ("reference", frame.reference)):
            images.write_png(folder / f"{index}-{name}.png", to_display(picture["color"], stops))
        denoised = Frame(
            {"color": from_display(frame.denoised, stops)}, {**frame.noisy.info, "denoised": "true"}
        )
        exr.write_frame(folder / f"{index}-denoised.exr", denoised)
        images.write_png(folder / f"{index}-denoised.png", frame.denoised)
        images.write_png(folder / f"{index}-normal.png", normal_to_display(frame.noisy["normal"]))


def _tell(results: Results, output: Path) -> None:
    """Print the tables of the report, and where it is."""
    for frame in results.unseen:
        before, after = frame.scores["input"], frame.scores["denoised"]
        rows = [(a.metric, str(a), str(b)) for a, b in zip(before, after, strict=True)]
        title = f"Unseen {frame.label}"
        table(title, ("metric", "input", "denoised"), rows)
    table(
        "Executors against the float64 reference",
        ("executor", "time", "error", "bound"),
        list(map(_row, results.runs)),
    )
    say(f"report: {output / 'report.html'}")


def _row(run: Run) -> tuple[str, str, str, str]:
    """Return an executor's row of the printed table."""
    if run.seconds_run is None:
        return run.executor, run.missing, "", ""
    bound = "none" if run.bound_frame is None else f"{run.bound_frame:.2e}"
    return run.executor, f"{run.seconds_run:.3f} s", f"{run.error:.2e}", bound
