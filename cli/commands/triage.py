"""`wamnet triage`: one frame on every executor, each held against its bound, and who is the odd one out.

1. Run the model's kernels and judge them [kernels/judge/triage.py].
2. If one deviates, make the failure small [kernels/judge/reduce.py], and keep it: model, part of the frame,
   the odd kernels' files and a report, all or nothing [`keep`]. Its README has the command that repeats it.
3. `--kernel` runs such a kernel's files, as they are or as somebody has changed them, instead of what the
   compiler makes [`kept_kernel`].
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import typer

from ...compiler import artifact
from ...compiler import compile as compiling
from ...compiler.artifact import Artifact
from ...compiler.core import ir
from ...compiler.core.lower import lower
from ...compiler.core.profiles import profile_named
from ...compiler.plan import Plan, analysed
from ...compiler.targets import language_named
from ...kernels.devices.kernel import Images
from ...kernels.devices.registry import EXECUTORS, WAYS
from ...kernels.judge.reduce import Box, Reduced, reduced
from ...kernels.judge.triage import Apart, Compile, Judge, Kernel, Verdict, conclusion, kernels_of, odd_ones
from ...kernels.run.denoise_on import images_of
from ...refimpl.errors import ExecutorUnavailable, InputError, choice
from ...refimpl.frame import Frame
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ...refimpl.reading import SIZES, parse_json, read_file, refusing
from ..common.inputs import load_model, model_path
from ..common.terminal import STATUS_WRONG, progress, say, table
from ..files import exr
from ..files.outputs import check_new_folder, making_folder, write_text
from ..reports import machine
from ..reports.pages import filled

SCHEMA = "wamnet-triage-1"
"""Name and version of the report's form; described in spec/triage.md."""

REPORT, README, MODEL, FRAME = "report.json", "README.md", "model.safetensors", "frame.exr"
"""Files of a reproducer."""


@dataclass(frozen=True)
class Chosen:
    """The kernels that run."""

    executor: list[str] | None = None
    profile: str = "ieee"
    schedules: str = "picked"
    kernel: Path | None = None


def triage(
    model: Path,
    frame: Path,
    *,
    chosen: Chosen,
    output: Path = Path("triage"),
) -> None:
    """Run a model on every backend, and find the one that exceeds its error bound."""
    check_new_folder(output)
    profile_named(chosen.profile)
    model = model_path(model)
    network, noisy = load_model(model), exr.read_frame(frame, finite=False, tell=say)
    exr.need_layers(
        frame, noisy, network.features, "the model was trained with it", "render or export that layer too"
    )
    kept = kept_kernel(chosen.kernel, chosen, network) if chosen.kernel else None
    task = Task(network, noisy, images_of(network, noisy), chosen.profile, chosen.schedules, kept)
    with ExitStack() as opened:
        runners = open_runners(chosen.executor or [], opened)
        for runner in runners:
            runner.language = runner.language.under(chosen.profile)
        verdicts = _judged(task, runners)
        _print(f"{model} on {frame}, {noisy.width}x{noisy.height}, profile {task.profile}", verdicts)
        found = _concluded(task, verdicts)
    if found is None:
        return
    keep(output, task, verdicts, found, model)
    say(f"{output}: reproducer written; {output / README} has the command")
    raise typer.Exit(STATUS_WRONG)


@dataclass(frozen=True)
class Task:
    """What to do: a model on a frame, whose encoded images are `images`, and how.

    `kept`: the kernel that runs instead of what the compiler makes for its target and schedule.
    """

    model: Model
    frame: Frame
    images: Images
    profile: str
    schedules: str
    kept: Kept | None

    @property
    def compiled(self) -> Compile:
        """Return the compiler, which has the kept kernel for its own where there is one."""
        return self.kept.compiled if self.kept else compiling.compile_plan


def open_runners(wanted: Sequence[str], opened: ExitStack) -> list[Apart]:
    """Open executors by name, each in a process of its own: all that are here, or those that are wanted."""
    for name in wanted:
        if name not in {*WAYS, *EXECUTORS}:
            raise InputError("--executor", name, "unknown", choice(name, dict.fromkeys([*EXECUTORS, *WAYS])))
    runners: list[Apart] = []
    for way, (name, _) in WAYS.items():
        if wanted and not {way, name} & set(wanted):
            continue
        try:
            runners.append(opened.enter_context(Apart(way)))
        except ExecutorUnavailable as error:
            if way in wanted:
                raise
            say(f"not available: {error}")
    if not runners:
        raise ExecutorUnavailable(f"none of {', '.join(wanted)} is available; see wamnet executors")
    return runners


def _judged(task: Task, runners: Sequence[Apart]) -> list[Verdict]:
    """Run all kernels on the whole frame."""
    program, size = lower(task.model), (task.frame.height, task.frame.width)
    # The schedule that an executor would pick is not that of the kept kernel.
    instead = {task.kept.kernel.target: task.kept.schedule} if task.kept else {}
    kernels = kernels_of(runners, program, size, task.schedules, task.compiled, instead)
    if task.kept and not any(kernel.artifact is task.kept.kernel for kernel in kernels):
        # Nobody may take the verdicts of others for its own.
        target, schedule = task.kept.kernel.target, task.kept.schedule
        rule = f"none of the kernels to run is of {target} in schedule {schedule}, as it is"
        remedy = f"choose --executor {target}, and leave out --schedules"
        raise InputError("--kernel", str(task.kept.folder), rule, remedy)
    judge, verdicts = Judge(task.images), []
    with progress("running", len(kernels), "kernels") as advance:
        for kernel in kernels:
            verdicts.append(judge.verdict(kernel))
            advance(1)
    return verdicts


def _concluded(task: Task, verdicts: Sequence[Verdict]) -> Reduced | None:
    """Say who is the odd one out; return the failure made small, or None where there is none."""
    text = conclusion(verdicts)
    if not any(verdict.ran for verdict in verdicts):
        raise InputError("--schedules", task.schedules, text, f"the first reason: {verdicts[0].state}")
    say(text)
    if not odd_ones(verdicts):
        return None
    found = reduced(verdicts, task.model, task.images, task.compiled)
    again = "" if found.repeats else ", because it did not show again"
    say(f"smallest part that reproduces it: {found.box.text}{again}")
    for stage in found.stages:
        say(stage.text)
    if task.kept:
        say("stages are compiled again: the kept kernel's files have none")
    return found


def _print(title: str, verdicts: Sequence[Verdict]) -> None:
    """Print a line for each kernel."""
    heads = ("executor", "schedule", "device", "verdict", "worst number", "largest error", "error / bound")
    rows = []
    for v in verdicts:
        numbers = (f"{v.error:.3g}", f"{v.ratio:.3g}" if v.promised else "-") if v.pixel else ("", "")
        where = "row {}, column {}, channel {}".format(*v.pixel) if v.pixel else ""
        runner = v.kernel.runner
        rows.append((runner.way, v.kernel.schedule, runner.device, v.state, where, *numbers))
    table(title, heads, rows, texts=5)


# ---- the reproducer -----------------------------------------------------------------------------------


def keep(folder: Path, task: Task, verdicts: Sequence[Verdict], found: Reduced, model_file: Path) -> None:
    """Write model, part of the frame, the odd kernels and the report: all of it or nothing."""
    odd = [verdict.kernel for verdict in odd_ones(found.verdicts)]
    with making_folder(folder) as new:
        (new / MODEL).write_bytes(model_file.read_bytes())
        exr.write_frame(new / FRAME, part_of(task, found.box))
        for kernel in odd:
            assert kernel.artifact is not None
            artifact.write(kernel.artifact, new / _folder_of(kernel))
        report = _report(task, verdicts, found)
        text = json.dumps(report, indent=2, sort_keys=True, allow_nan=False) + "\n"
        write_text(new / REPORT, text)
        kept, made = ([shlex.join(_command(task, kernel, it)) for kernel in odd] for it in (True, False))
        text = filled("triage.md.jinja", conclusion=report["conclusion"], kept=kept, made=made, report=REPORT)
        write_text(new / README, text)


def part_of(task: Task, box: Box) -> Frame:
    """Return the part of the frame with the layers that the model reads, in numbers that files may hold.

    NaN is 0, and infinities the largest numbers: they are encoded alike.
    """
    names = dict.fromkeys(layer for name in task.model.features for layer in FEATURES[name].layers)
    largest = float(np.finfo(np.float32).max)
    layers = {
        name: np.nan_to_num(array, nan=0.0, posinf=largest, neginf=-largest)
        for name, array in box.cut({name: task.frame[name] for name in names}).items()
    }
    return replace(task.frame, layers=layers)


def _folder_of(kernel: Kernel) -> str:
    """Return the name of a kernel's folder in a reproducer."""
    return f"{kernel.runner.way}-{kernel.schedule}"


def _report(task: Task, verdicts: Sequence[Verdict], found: Reduced) -> dict[str, Any]:
    """Return what report.json holds; numbers that JSON does not know are words."""
    return {
        "schema": SCHEMA,
        "conclusion": conclusion(verdicts),
        "profile": task.profile,
        "schedules": task.schedules,
        "program": ir.digest(analysed(lower(task.model))),
        "frame": {"height": task.frame.height, "width": task.frame.width},
        "verdicts": [_entry(verdict) for verdict in verdicts],
        "part": {**asdict(found.box), "verdicts": [_entry(verdict) for verdict in found.verdicts]},
        "stages": [
            {
                "executor": s.kernel.runner.way,
                "schedule": s.kernel.schedule,
                "stage": s.stage.text if s.stage else None,
                "neurons_from": s.stage.first if s.stage else None,
                "worst": _entry(s.verdict) if s.verdict else None,
            }
            for s in found.stages
        ],
        "machine": machine.describe(),
        "versions": machine.versions(),
    }


def _entry(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict for JSON; a pixel is (row, column), its channel beside it."""
    runner, pixel = verdict.kernel.runner, verdict.pixel
    return {
        "executor": runner.way,
        "schedule": verdict.kernel.schedule,
        "device": runner.device,
        "kernel": verdict.kernel.artifact.digest if verdict.kernel.artifact else None,
        "state": verdict.state,
        "deviates": verdict.deviates,
        "largest_error": _number(verdict.error),
        "error_over_bound": _number(verdict.ratio),
        "pixel": pixel and pixel[:2],
        "channel": pixel and pixel[2],
        "found": _number(verdict.found),
        "expected": _number(verdict.expected),
        "bound": _number(verdict.bound),
    }


def _number(value: float) -> float | str:
    """Return a number for JSON, or its name: nan, inf, -inf."""
    return value if math.isfinite(value) else str(value)


def _command(task: Task, kernel: Kernel, kept: bool) -> list[str]:
    """Return the command that runs one kernel on the kept frame."""
    words = ["wamnet", "triage", MODEL, FRAME, "--executor", kernel.runner.way]
    words += ["--profile", task.profile, "--schedules", kernel.schedule]
    return [*words, "--kernel", _folder_of(kernel)] if kept else words


@dataclass(frozen=True)
class Kept:
    """A kernel whose files somebody kept: what they are a kernel of, and the artifact that has them in it."""

    folder: Path
    kernel: Artifact

    @property
    def schedule(self) -> str:
        """Return the name of its schedule."""
        return str(self.kernel.manifest["schedule"]["name"])

    def compiled(self, plan: Plan) -> Artifact:
        """Return the kept kernel where it is the plan's, else a new one."""
        made = compiling.compile_plan(plan)
        same = all(
            made.manifest[key] == self.kernel.manifest[key] for key in ("program", "target", "schedule")
        )
        return self.kernel if same else made


def kept_kernel(folder: Path, chosen: Chosen, model: Model) -> Kept:
    """Return the kernel whose manifest and files are in a folder.

    They may have been changed: neither their hashes nor their lengths are checked. The manifest says what
    they are the kernel of.
    """
    way_out = "give a folder that triage or compile wrote"
    rule = f"must hold a {artifact.MANIFEST_NAME} that wamnet wrote beside a model's kernel"
    with refusing("--kernel", str(folder), rule, way_out):
        path = folder / artifact.MANIFEST_NAME
        manifest = parse_json(read_file(path, "--kernel", way_out), f"--kernel {path}", way_out)
        wanted, name = manifest["program"], str(manifest["profile"]["name"])
        target, schedule = str(manifest["target"]), str(manifest["schedule"]["name"])
    program = lower(model)
    if wanted != ir.digest(analysed(program)) or name != chosen.profile:
        rule = f"its kernel is of another model or profile ({name})"
        raise InputError("--kernel", str(folder), rule, "give the model and --profile that it was made with")
    made = compiling.compile_program(program, language_named(target).under(chosen.profile), schedule)
    if made.manifest["schedule"] != manifest["schedule"]:
        rule = f"the compiler makes no kernel of this model for {target} in schedule {schedule} any more"
        raise InputError("--kernel", str(folder), rule, "compile the model again")
    content = read_file(folder / made.source_name, "--kernel")
    raw = read_file(folder / artifact.WEIGHTS_NAME, "--kernel")
    if len(raw) != 4 * made.weights.size:
        rule = f"must hold {made.weights.size} float32 weights, {4 * made.weights.size} bytes"
        raise InputError(f"--kernel: length of {artifact.WEIGHTS_NAME}", len(raw), rule, "restore the file")
    with refusing(f"--kernel: {made.source_name}", str(folder), "must be UTF-8", "restore the file"):
        source = content.decode("utf-8")
    files = {made.source_name: content, artifact.WEIGHTS_NAME: raw}
    facts: dict[str, Any] = {"digest": ir.sha256(content, raw)}
    facts["files"] = {**made.manifest["files"], **{name: ir.sha256(data) for name, data in files.items()}}
    facts[SIZES] = {**made.manifest[SIZES], **{name: len(data) for name, data in files.items()}}
    weights = np.frombuffer(raw, "<f4").astype(np.float32)
    manifest = {**made.manifest, **facts}
    return Kept(folder, replace(made, source=source, weights=weights, manifest=manifest))
