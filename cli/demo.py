"""`wamnet demo`: the whole way, from a scene to a report, judged on a frame that the network has not seen.

1. Render the scene at the training times, noisy and as reference, and at one more time [`render_frames`].
2. Train the network on the training frames [`train_network`].
3. Compile it for every executor, and run each that is there on the frame of the other time [`run_kernels`].
4. Measure noisy and denoised picture against the reference of that time [`score`].
5. Write pictures and frames [`write_pictures`], then `report.json` and `report.html` [`report.write`].

A run that was interrupted goes on where it was: a frame's file names what it was made from and is used again
if that is still so; training resumes from its checkpoint, which refuses other frames and other recipes.
"""

from __future__ import annotations

import hashlib
import json
import math
import shlex
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from ..refimpl.errors import InputError
from . import machine, train
from .compare import Score, measure
from .compile import write_kernel
from .outputs import unwritable, write_text
from .packages import need
from .runs import Run, run_all
from .terminal import Advance, hint_on_interrupt, progress, say, table

if TYPE_CHECKING:
    from ..refimpl.denoise import Model
    from ..refimpl.frame import Frame
    from ..refimpl.train import TrainState

    Pair = tuple[Frame, Frame]

EXAMPLES = """Examples:

wamnet demo

wamnet demo --size 384 -o out/large"""
"""Shown below the help of `wamnet demo`."""

FOLDER = "out/demo"
"""Folder of the results, unless another is given."""

QUICK_FOLDER = "out/demo-quick"
"""Folder of the results of `--quick`, which must not mix with the others."""

PLAN_NAME = "plan.json"
"""File in the folder that says which plan its results are of."""

SHOWN_FIRST = ("opencl", "opengl", "numpy")
"""Whose picture the report shows: that of a compiled kernel, if one ran here."""

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Plan:
    """All sizes of a demonstration; the defaults take two to four minutes on two cores.

    Times are those of the scene's animation, in seconds; the network never sees `test_time_s`. `steps` None
    means the preset's.
    """

    scene: str = "minicubes"
    size_px: int = 192
    train_times_s: tuple[float, ...] = tuple(0.5 * k for k in range(16))
    test_time_s: float = 3.25
    noisy_spp: int = 1
    train_reference_spp: int = 24
    test_reference_spp: int = 256
    preset: str = "short"
    steps: int | None = None
    seed: int = 1


QUICK = Plan(size_px=24, train_times_s=(0.0, 1.0), train_reference_spp=4, test_reference_spp=8, steps=60)
"""Small enough to test the whole way; its pictures are not meant to be looked at."""


@dataclass(frozen=True)
class Results:
    """What a demonstration has found; frames and pictures are those of the held-out time.

    `denoised` (H, W, 3) is the picture of the executor `denoised_by`; `scores` and `seconds` have a name for
    each picture and each step.
    """

    noisy: Frame
    reference: Frame
    denoised: Any
    denoised_by: str
    model: Model
    state: TrainState
    seconds_per_step: float | None
    runs: tuple[Run, ...]
    scores: dict[str, tuple[Score, ...]]
    seconds: dict[str, float]


def demo(
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FOLDER",
            help="Folder for all results.",
            show_default=f"{FOLDER}, or {QUICK_FOLDER} with --quick",
        ),
    ] = None,
    size: Annotated[
        int | None,
        typer.Option(
            help="Width and height of the frames, in pixels; not with --quick.",
            show_default=str(Plan.size_px),
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Tiny frames: try whether everything works.")
    ] = False,
) -> None:
    """Render, train, compile, denoise an unseen frame and write a report, in a few minutes.

    Open FOLDER/report.html afterwards. After Ctrl-C, the same command goes on where it was.
    """
    from . import report

    for module in ("matplotlib", "jinja2"):
        need(module, "to draw the report", "report")
    if quick and size is not None:
        raise InputError("--size", size, "--quick has a size of its own", "leave out one of them")
    plan = QUICK if quick else Plan(size_px=Plan.size_px if size is None else size)
    folder = output or Path(QUICK_FOLDER if quick else FOLDER)
    command = f"wamnet demo {'--quick' if quick else f'--size {plan.size_px}'} -o {shlex.quote(str(folder))}"
    begin(plan, folder)
    with hint_on_interrupt(lambda: f"go on with the same command: {command}"):
        results = carry_out(plan, folder)
        report.write(folder, plan, results, command)
    _tell(results, folder)


def begin(plan: Plan, folder: Path) -> None:
    """Make the folder and note the plan in it; refuse a folder that has anything but results of this plan."""
    from ..refimpl.render import Job

    Job(plan.size_px, plan.size_px)  # Refuses a size that cannot be rendered.
    if folder.exists() and not folder.is_dir():
        raise InputError("output folder", str(folder), "it is a file", "choose another with -o")
    note, text = folder / PLAN_NAME, json.dumps(asdict(plan), indent=2) + "\n"
    if folder.is_dir() and any(folder.iterdir()):
        try:
            found = note.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            found = ""
        if found != text:
            rule = "it holds results of another plan" if found else "it holds files that are not the demo's"
            raise InputError("output folder", str(folder), rule, "choose another with -o, or remove it")
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error, "output folder") from None
    write_text(note, text)


def carry_out(plan: Plan, output: Path) -> Results:
    """Do all steps in the folder `output` and return what they have found."""
    seconds: dict[str, float] = {}
    pairs, (noisy, reference) = _timed(seconds, "rendering", lambda: render_frames(plan, output))
    model, state, per_step = _timed(seconds, "training", lambda: train_network(plan, pairs, output))
    images, runs = _timed(seconds, "kernels", lambda: run_kernels(model, noisy, output))
    by = next(name for name in SHOWN_FIRST if name in images)
    scores = score(model, noisy, reference, images[by])
    results = Results(noisy, reference, images[by], by, model, state, per_step, runs, scores, seconds)
    write_pictures(output, results)
    return results


def _timed(seconds: dict[str, float], name: str, step: Callable[[], _Result]) -> _Result:
    """Do a step, and note and print how long it took."""
    start = clock.perf_counter()
    result = step()
    seconds[name] = clock.perf_counter() - start
    say(f"{name}: {seconds[name]:.1f} s")
    return result


def render_frames(plan: Plan, output: Path) -> tuple[list[Pair], Pair]:
    """Render the training pairs and the held-out pair (noisy, reference), or take those of an earlier run."""
    spps = [plan.train_reference_spp] * len(plan.train_times_s) + [plan.test_reference_spp]
    times = (*plan.train_times_s, plan.test_time_s)
    folder = output / "frames"
    folder.mkdir(exist_ok=True)
    pairs = []
    with progress("rendering", plan.size_px**2 * (plan.noisy_spp * len(times) + sum(spps))) as advance:
        for index, (time, spp) in enumerate(zip(times, spps, strict=True)):
            # Each frame has random numbers of its own, and so have a noisy frame and its reference.
            seed = plan.seed + 2 * index
            noisy = _frame(folder / f"{index}-noisy.exr", plan, time, plan.noisy_spp, seed, advance)
            reference = _frame(folder / f"{index}-reference.exr", plan, time, spp, seed + 1, advance)
            pairs.append((noisy, reference))
    return pairs[:-1], pairs[-1]


def _frame(path: Path, plan: Plan, time: float, spp: int, seed: int, advance: Advance) -> Frame:
    """Return the frame in `path` if this version made it from the same scene and job, else render it."""
    from ..kernels.render_pool import render_parallel
    from ..refimpl.render import Job
    from ..refimpl.scene import scene_digest
    from ..refimpl.scenes import canonical
    from . import exr

    scene, job = canonical(plan.scene, time=time), Job(plan.size_px, plan.size_px, spp, seed)
    origin = json.dumps([scene_digest(scene), asdict(job), machine.versions()["wamnet"]])
    origin = hashlib.sha256(origin.encode()).hexdigest()
    try:
        kept = exr.read_frame(path)
        if kept.info.get("demo_origin") == origin:
            advance(plan.size_px**2 * spp)
            return kept
    except InputError:
        pass  # There is no such file yet, or it is damaged: render.
    frame = render_parallel(scene, job, on_progress=advance).frame
    frame = replace(frame, info={**frame.info, "demo_origin": origin})
    exr.write_frame(path, frame)
    return frame


def train_network(plan: Plan, pairs: Sequence[Pair], output: Path) -> tuple[Model, TrainState, float | None]:
    """Train, or finish what an earlier run began; return model, last state and seconds a step, if known."""
    from ..compiler.model_file import load_checkpoint
    from ..refimpl.train import PRESETS, model_of

    recipe = replace(PRESETS[plan.preset], seed=plan.seed)
    if plan.steps is not None:
        recipe = replace(recipe, steps=plan.steps, log_every=max(1, plan.steps // 20))
    path, speed = output / "model.safetensors", output / "frames" / "seconds_per_step.txt"
    done = 0
    try:
        begin = load_checkpoint(train.checkpoint_path(path))
        state, seconds = train.fit(recipe, pairs, path, begin)
        done = begin.step
    except InputError:
        # There is no checkpoint, or it is damaged, or one of other frames or another recipe: begin anew.
        state, seconds = train.fit(recipe, pairs, path)
    if state.step > done:
        write_text(speed, f"{seconds / (state.step - done)}\n")
    return model_of(state, train.facts(pairs)), state, _seconds(speed)


def _seconds(path: Path) -> float | None:
    """Return the time in a file, or None where there is none: it is told, and nothing depends on it."""
    try:
        value = float(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def run_kernels(model: Model, noisy: Frame, output: Path) -> tuple[dict[str, Any], tuple[Run, ...]]:
    """Write the kernel of each target, and run each executor on the noisy frame."""
    from ..compiler.compile import TARGETS, compile_program
    from ..compiler.lower import lower

    kernels = {target: compile_program(lower(model), target) for target in TARGETS}
    for target, kernel in kernels.items():
        write_kernel(kernel, output / "kernels" / target)
    with progress("running kernels", len(kernels)) as advance:
        return run_all(model, noisy, kernels, advance)


def score(model: Model, noisy: Frame, reference: Frame, denoised: Any) -> dict[str, tuple[Score, ...]]:
    """Return the scores of the noisy and the denoised picture.

    The network's output is display-encoded and ends at white, so all pictures are measured in that form.
    """
    from ..refimpl.encoding import from_display, to_display
    from .images import Image

    stops = model.normalization.exposure_stops

    def seen(display: Any) -> Image:
        return Image(display, from_display(display, stops))

    target = seen(to_display(reference["color"], stops))
    pictures = {"input": seen(to_display(noisy["color"], stops)), "denoised": seen(denoised)}
    return {name: measure(picture, target) for name, picture in pictures.items()}


def write_pictures(output: Path, results: Results) -> None:
    """Write the held-out frames as EXR, and noisy, denoised, reference and normal as PNG."""
    from ..refimpl.encoding import normal_to_display, to_display
    from . import exr, images
    from .denoise import write_denoised

    stops = results.model.normalization.exposure_stops
    for name, frame in (("noisy", results.noisy), ("reference", results.reference)):
        exr.write_frame(output / f"{name}.exr", frame)
        images.write_png(output / f"{name}.png", to_display(frame["color"], stops))
    for suffix in (".exr", ".png"):
        write_denoised(output / f"denoised{suffix}", results.denoised, results.model, results.noisy)
    images.write_png(output / "normal.png", normal_to_display(results.noisy["normal"]))


def _tell(results: Results, output: Path) -> None:
    """Print the two tables of the report, and where it is."""
    before, after = results.scores["input"], results.scores["denoised"]
    rows = [(a.metric, str(a), str(b)) for a, b in zip(before, after, strict=True)]
    table("Unseen frame against its reference", ("metric", "input", "denoised"), rows)
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
