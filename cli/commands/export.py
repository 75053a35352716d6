"""`wamnet export`: a model, and a scene's path tracer with it, for other programs and engines."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from ...compiler.artifact import schedule_text
from ...kernels.export import check as checking
from ...kernels.export.hosts.host import host_named
from ...kernels.export.motion import TIME, Motion
from ...kernels.export.package import Export, Request, with_speed
from ...kernels.export.package import export as exported
from ...models.data.frame_plan import animation_times
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings
from ..common import options
from ..common.inputs import load_model, load_scene
from ..common.request import KernelRequest, given, refuse
from ..common.terminal import STATUS_WRONG, say
from ..files.outputs import check_new_folder, making_folder
from ..reports import webpage

HTML, PAGE_NAME = "html", "index.html"
"""The target that is a web page, and its file."""

SECONDS, FPS = 8.0, 10.0
"""Length of a table of times, and times a second, if nobody asks for others."""


@dataclass(frozen=True)
class Kernel(KernelRequest):
    """How the denoiser is compiled, for another machine than this one."""

    schedule: str | None = None
    weights: str | None = None


@dataclass(frozen=True)
class Shown:
    """The scene whose path tracer comes along, and what of it moves."""

    scene: str | None = None
    time: float | None = None
    parameters: list[str] | None = None
    max_depth: int = 5
    sampler: options.Sampler = "pcg4d"
    moving: str | None = None
    seconds: float | None = None
    fps: float | None = None

    def check(self) -> None:
        """Refuse options that mean nothing without others."""
        if self.scene is None:
            of_scenes = given(self, "time", "parameters", "sampler", "max_depth", "moving")
            refuse(of_scenes, "there is no scene", "name one with --scene, or leave it out")
        if self.moving is None:
            refuse(given(self, "seconds", "fps"), "nothing moves", "add --moving time, or leave it out")

    def at(self, time: float | None) -> Scene:
        """Return the scene at a time."""
        assert self.scene is not None, "there is a scene"
        return load_scene(self.scene, time, self.parameters or [])

    def motion(self) -> Motion | None:
        """Return the scene at the times of the table: half a step beside multiples, as a page has them.

        Some scenes are laid out in another way at time 0, where their boxes are parallel to the axes.
        """
        if self.moving is None:
            return None
        kinds, start = tuple(self.moving.split(",")), self.time or 0.0
        if TIME not in kinds:
            rule, remedy = "time does not move", "add it to --moving, or leave it out"
            refuse(given(self, "seconds", "fps"), rule, remedy)
            return Motion((start,), (self.at(self.time),), kinds)
        fps = FPS if self.fps is None else self.fps
        spaced = animation_times(start, SECONDS if self.seconds is None else self.seconds, fps)
        times = [time + 0.5 / fps for time in spaced]
        return Motion(tuple(times), tuple(map(self.at, times)), kinds)


@dataclass(frozen=True)
class Into:
    """What is exported for; one of the two is needed."""

    target: str | None = None
    host: str | None = None

    @property
    def language(self) -> str:
        """Return the target that is named, or that of a host."""
        if self.host is not None:
            return self.target or host_named(self.host).target
        if self.target is None:
            rule = "one of them is needed"
            raise InputError("--target or --host", NO_VALUE, rule, "--help lists their values")
        return self.target


def export(
    model: Path,
    *,
    into: Into,
    output: Path | None = None,
    shown: Shown,
    kernel: Kernel,
    check: bool = False,
    measure: bool = False,
) -> None:
    """Export a denoiser for another program: kernels, a manifest, a README and a reference test image."""
    target, host = into.language, into.host
    folder = output or Path(host or target)
    if target == HTML:
        of_kernels = given(kernel, "weights", "variant", "schedule")
        of_kernels |= given(shown, "time", "moving", "seconds", "fps") | {
            "--check": check or None,
            "--measure": measure or None,
        }
        refuse(of_kernels, "a web page has its own")
        page = webpage.page_of(model, shown.scene, shown.parameters or [], None)
        _write(folder, {PAGE_NAME: page.encode()})
        return
    check_new_folder(folder)
    shown.check()
    made = _export(model, target, host or "", shown, kernel, measure)
    _write(folder, made.contents())
    _tell(made)
    if check:
        _checked(made)


def _export(model: Path, target: str, host: str, shown: Shown, kernel: Kernel, measured: bool) -> Export:
    """Return the export that the options ask for; `measured`: it says how long it takes."""
    settings = replace(Settings(max_depth=shown.max_depth), sampler=shown.sampler)
    motion = shown.motion()
    scene = motion.scenes[0] if motion else shown.at(shown.time) if shown.scene else None
    how = (kernel.profile, kernel.weights or "", kernel.network(), settings, kernel.schedule or "")
    request = Request(load_model(model, imported=True), target, scene, *how, motion, host)
    if measured:
        checking.check_measured(request)
    made = exported(request)
    return with_speed(made, checking.measure(made)) if measured else made


def _tell(made: Export) -> None:
    """Say which schedule an export has, which limits it keeps, and what its bound rests on."""
    for picked in filter(None, (kernel.get("schedule") for kernel in made.manifest["kernels"])):
        say(f"schedule {schedule_text(picked)}")
    for limit in made.manifest["limits"]:
        say(f"{limit['name']}: {limit['needs']} of {limit['most']}")
    if made.manifest["assumes"]:
        say(f"the bound assumes: {made.manifest['assumes']}")


def _write(folder: Path, contents: Any) -> None:
    """Write all files into a new folder, which appears as a whole."""
    with making_folder(folder) as new:
        for name, data in contents.items():
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_bytes(data)
    for name in sorted(contents):
        say(str(folder / name))


def _checked(made: Export) -> None:
    """Say what compiles and runs an export here, and how far off it is; end with status 1 if wrong."""
    verdict = checking.check(made)
    for name, value in zip(checking.HEAD, verdict.cells(), strict=True):
        say(f"{name}: {value}")
    if verdict.bound == 0:
        wanted = checking.digest_of(made.pair.output)
        say(f"SHA-256 of the image: {verdict.digest}; the reference's: {wanted}")
    if not verdict.holds:
        say(f"wrong: {verdict.wrong}")
        raise typer.Exit(STATUS_WRONG)
