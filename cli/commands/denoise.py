"""`wamnet denoise` and `wamnet executors`: a model on frames, and what there is to run it.

1. Frames are read, checked and encoded; denoised; and written. For a sequence that overlaps [sequence.py].
2. A result of a sequence names its origin: model, options and frame. One that is there is not made again, so
   that an interrupted command resumes where it was [`_origin`].
3. What was said of several frames is said once, with their number [`Notes`].
"""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ... import kernels
from ...kernels.devices.kernel import Images
from ...kernels.run.denoise_on import Denoiser
from ...kernels.run.tune import first_time
from ...refimpl.encoding import from_display
from ...refimpl.errors import ExecutorUnavailable, InputError
from ...refimpl.frame import Frame, not_finite
from ...refimpl.network.dataset import FEATURES
from ..common import options
from ..common.domain import check_domain
from ..common.executors import chosen
from ..common.inputs import load_model, model_path
from ..common.options import ExecutorName
from ..common.request import KernelRequest
from ..common.sequence import frames_of, is_many, outputs_of, overlapped
from ..common.terminal import hint_on_interrupt, progress, say, table, tell
from ..files import exr, images
from ..files.outputs import check_output


@dataclass(frozen=True)
class Layers:
    """What of a frame is read and kept."""

    anyway: bool = False
    keep_layers: bool = False
    view_layer: str = ""


@dataclass
class Notes:
    """Sentences about frames, each with the first frame that it is about and how many there are."""

    counts: dict[str, tuple[str, int]] = field(default_factory=dict)

    def add(self, text: str) -> None:
        """Take a sentence that begins with the name of a frame."""
        frame, _, sentence = text.partition(": ")
        first, count = self.counts.get(sentence, (frame, 0))
        self.counts[sentence] = first, count + 1

    def say(self) -> None:
        """Print the sentences."""
        for sentence, (first, count) in self.counts.items():
            say(f"{first}{f' and {count - 1} more' if count > 1 else ''}: {sentence}")


@dataclass(frozen=True)
class Job:
    """What is done with each frame: read, encoded, and written with this origin."""

    denoiser: Denoiser
    notes: Notes
    layers: Layers

    def read(self, path: Path) -> tuple[Frame, Images]:
        """Return a frame and its encoded features, or refuse it."""
        model = self.denoiser.full
        noisy = exr.read_frame(path, False, self.notes.add, self.layers.view_layer)
        because, remedy = "the model was trained with it", "render or export that layer too"
        exr.need_layers(path, noisy, model.features, because, remedy, self.layers.view_layer)
        layers = {layer for name in model.features for layer in FEATURES[name].layers}
        for layer, count in not_finite(noisy).items():
            if layer in layers:
                rule = "NaN is read as 0, an infinity as the end of the range"
                self.notes.add(f"{path}: {count} pixels of {layer} are not finite: {rule}")
        check_domain(path, noisy, model, self.layers.anyway, self.notes.add)
        return noisy, self.denoiser.images(noisy)

    def write(self, output: Path, source: Path, encoded: Any, origin: str) -> None:
        """Write a denoised image (H, W, 3), display-encoded: as it is to PNG, as linear colour to EXR."""
        if output.suffix.lower() == ".png":
            images.write_png(output, encoded, origin)
            return
        linear = from_display(encoded, self.denoiser.full.normalization.exposure_stops)
        facts = {"denoised": "true", **({exr.ORIGIN: origin} if origin else {})}
        layer = exr.write_denoised(
            output, source, linear, self.layers.view_layer, self.layers.keep_layers, **facts
        )
        if layer:
            self.notes.add(f"{output}: layer {layer} is the denoised image")


def denoise(
    model: Path,
    frames: list[Path],
    output: Path = Path("denoised.png"),
    executor: options.ExecutorChoice = "auto",
    *,
    kernel: KernelRequest,
    rank: int = 0,
    layers: Layers,
    context: options.ContextName | None = None,
) -> None:
    """Denoise frames with a trained model."""
    paths = frames_of(frames)
    outputs = outputs_of(paths, output)
    many, suffixes = is_many(paths, output), (".exr",) if layers.keep_layers else (".exr", ".png")
    if many:
        outputs[0].parent.mkdir(parents=True, exist_ok=True)
    for result in outputs:
        check_output(result, suffixes, [model, *paths])
    network, notes = load_model(model), Notes()
    how = kernel.schedule, kernel.network(rank)
    name = chosen(executor)
    with kernels.open_executor(name) as runner:
        runner.profile = kernel.profile
        job = Job(Denoiser(runner, network, *how, len(paths), keeps=True), notes, layers)
        if many:
            made_by = [name, kernel.profile, *how, layers.keep_layers, layers.view_layer]
            content = hashlib.sha256(model_path(model).read_bytes()).hexdigest()
            _denoise_all(job, paths, outputs, output, _digest(content, *made_by))
        else:
            _denoise_one(job, paths[0], output)


def _denoise_one(job: Job, path: Path, output: Path) -> None:
    """Denoise a frame, and say all about it."""
    denoiser = job.denoiser
    noisy, images = job.read(path)
    job.notes.say()
    job.notes.counts.clear()
    result = denoiser.run(noisy, images)
    first = first_time(denoiser.executor.identity, result.kernel, result.seconds_compile)
    job.write(output, path, result.image, "")
    job.notes.say()
    say(f"{output}: {noisy.width}x{noisy.height} pixels on {denoiser.executor.name} ({result.device})")
    say(f"schedule {result.schedule}; {result.reason}")
    if result.variant:
        say(result.variant)
    before = "" if first == result.seconds_compile else f" (the first time {first:.3f} s)"
    say(f"{result.seconds_run:.3f} s, after {result.seconds_compile:.3f} s of compilation{before}")
    if denoiser.model.is_whole:
        say(f"sha256 of the float32 result, the same on every executor: {result.digest}")


def _denoise_all(job: Job, paths: Sequence[Path], outputs: Sequence[Path], output: Path, how: str) -> None:
    """Denoise a sequence of frames, those that are not there; the others are done when one fails."""
    start = time.perf_counter()
    # A frame that is not there fails when it is read.
    tasks = [(path, out, _origin(path, how)) for path, out in zip(paths, outputs, strict=True)]
    missing = [task for task in tasks if not task[2] or read_origin(task[1]) != task[2]]

    with (
        hint_on_interrupt(lambda: f"{output}: the same command resumes"),
        progress("denoising", len(missing), "frames") as advance,
    ):
        failed = overlapped(
            missing,
            lambda task: job.read(task[0]),
            lambda read: job.denoiser.image(read[1]),
            lambda task, encoded: job.write(task[1], task[0], encoded, task[2]),
            advance,
        )
    job.notes.say()
    seconds = time.perf_counter() - start
    done, there = len(missing) - len(failed), len(tasks) - len(missing)
    runner = job.denoiser.executor
    rate = f", {done / seconds:.2f} frames per second" if done else ""
    besides = f"; {there} were there already" if there else ""
    count = f"{done} frame{'' if done == 1 else 's'}"
    say(f"{output}: {count} in {seconds:.1f} s{rate}{besides}; {runner.name} ({runner.device})")
    for _, error in failed:
        tell(f"error: {error}")
    if failed:
        share = f"{len(failed)} of {len(tasks)}"
        rule = "they could not be denoised, for the reasons above"
        raise InputError("number of frames that failed", share, rule, "fix them, or leave them out")


def _digest(*parts: object) -> str:
    """Return a hash of data of JSON's types."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _origin(path: Path, how: str) -> str:
    """Return what names a result's origin: the file of its frame, and how it is made; "" without a file."""
    try:
        facts = path.stat()
    except OSError:
        return ""
    return _digest(how, path.name, facts.st_size, facts.st_mtime_ns)


def read_origin(path: Path) -> str | None:
    """Return the origin that a result names; None where there is none, or it is damaged."""
    if not path.exists():
        return None
    return images.read_origin(path) if path.suffix.lower() == ".png" else exr.read_origin(path)


def executors() -> None:
    """List the available backends, and what the others need."""
    found = [probe(name.value) for name in ExecutorName]
    heads = ("name", "state", "schedule", "device, or what is missing")
    table("Executors", heads, found, texts=4)


def probe(name: str) -> tuple[str, str, str, str]:
    """Return an executor's name, whether it works here, its schedule, and its device or why it does not."""
    try:
        with kernels.open_executor(name) as executor:
            least = f" from {executor.schedule_pixels} pixels on" if executor.schedule_pixels else ""
            return name, "ready", executor.schedule + least, executor.device
    except ExecutorUnavailable as error:
        return name, "missing", "", str(error)
