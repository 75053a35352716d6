"""`wamnet compile` and `wamnet listing`: from a model or a scene to the source of a kernel and its manifest.

A name of a canonical scene, or a file that ends in .json, is a scene; anything else is a model: a file, or
one that ships with the package, as in model:minicubes.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ... import models
from ...compiler import artifact
from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan, compile_program
from ...compiler.core.listing import as_text, lines_of
from ...compiler.core.lower import lower
from ...compiler.scenes import lower_scene, path_kernel
from ...compiler.scenes.path_kernel import compile_path
from ...compiler.targets import Language, language_named
from ...kernels import open_executor
from ...kernels.run.tune import Tuning
from ...refimpl.errors import NO_VALUE, InputError, choice
from ...refimpl.light.scenes import CANONICAL
from ...refimpl.light.transport import Settings
from ...refimpl.reading import parse_json, read_file
from ..common.inputs import MODEL_PREFIX, load_model, load_scene
from ..common.options import Sampler, Target
from ..common.request import KernelRequest, given, refuse
from ..common.terminal import say
from ..files.outputs import check_output, check_parent, unwritable, visible, write_text
from .choose import Request


@dataclass(frozen=True)
class OfScene:
    """What only the kernel of a scene has."""

    time: float | None = None
    parameters: list[str] | None = None
    max_depth: int | None = None
    sampler: Sampler | None = None
    lanes: int | None = None

    def compiled(self, name: str, language: Language, network: KernelRequest) -> Artifact:
        """Return the kernel of a scene's paths."""
        scene = load_scene(name, self.time, self.parameters or [])
        settings = Settings() if self.max_depth is None else Settings(max_depth=self.max_depth)
        if self.sampler is not None:
            settings = replace(settings, sampler=self.sampler)
        programs = lower_scene.lower_scene(scene, settings, language.forms)
        return compile_path(
            programs, language.under(network.profile), 1 if self.lanes is None else self.lanes
        )


def compile_model(
    model: str,
    target: Target,
    output: Path | None = None,
    *,
    of_scene: OfScene,
    network: KernelRequest,
    here: bool = False,
    limits: Request,
) -> None:
    """Compile a model or a scene to a kernel: source, weights, and a manifest of its interface."""
    folder, language = output or Path(target), language_named(target)
    if is_scene(model):
        of_models = given(network, "schedule", "variant") | {"--here": here or None} | given(limits)
        rule = f"{model} is a scene, whose kernels have one schedule, no variants"
        refuse(of_models, rule, "leave it out, or name a model")
        check_folder(folder, language.name, of_scene=True)
        kernel = of_scene.compiled(model, language, network)
    else:
        _check_name(model, given(of_scene))
        check_folder(folder, language.name)
        kernel = _compiled_model(Path(model), language, network, limits, here)
    _write(kernel, folder)


def _write(kernel: Artifact, folder: Path) -> None:
    """Write a kernel, and say its files, why its schedule is another one, and why it has no certificate."""
    for path in write_kernel(kernel, folder):
        say(str(path))
    picked = kernel.manifest.get("schedule", {})
    if "reason" in picked:
        say(f"schedule {picked['name']}, not {picked['asked']}: {picked['reason']}")
    if kernel.plan is None:
        say("no certificate: path kernels have none, since paths have no bound over all pixels")
    elif kernel.plan.unproven:
        say(f"no certificate: {kernel.plan.unproven}")


def _compiled_model(
    path: Path, language: Language, network: KernelRequest, limits: Request, here: bool
) -> Artifact:
    """Return the kernel of a model: of a variant that is named, or that keeps limits, or of all of it."""
    limits.check(network.variant)
    model = load_model(path, imported=True)
    if limits.limited:
        if model.is_imported:
            rule = "limits are measured on frames, which an imported network does not read"
            raise InputError("limits", NO_VALUE, rule, "leave them out")
        refuse({"--here": NO_VALUE if here else None}, "limits choose the schedule too")
        network = limits.choose(model, network, language.name)
    elif here:
        # For many of the paper's images.
        refuse(given(network, "schedule"), "--here chooses another", "leave one of them out")
        with open_executor(language.name) as runner:
            runner.profile = network.profile
            plan = network.plan(model, language.name)
            schedule, reason = Tuning(runner, plan.model, (1024, 1024), plan.varied).picked(1000)
            say(f"schedule {schedule} for {runner.device}: {reason}")
        network = replace(network, schedule=schedule)
    return compile_plan(network.plan(model, language))


def is_scene(name: str) -> bool:
    """Tell whether a name is that of a scene."""
    return name in CANONICAL or Path(name).suffix.lower() == ".json"


def _check_name(name: str, of_scenes: Mapping[str, Any]) -> None:
    """Refuse options of scenes, and what looks like a scene's name but is not one: a model's file exists."""
    rule = f"{name} is not a scene: neither a canonical one nor a .json file"
    refuse(of_scenes, rule, "leave it out, or name a scene")
    comes_along = name.startswith(MODEL_PREFIX)
    if not comes_along and not Path(name).suffix and not Path(name).exists():
        known = [*CANONICAL, *(f"{MODEL_PREFIX}{model}" for model in models.names())]
        raise InputError("model or scene", name, "not found", f"{choice(name, known)}, or give a file")


def check_folder(folder: Path, name: str, of_scene: bool = False) -> None:
    """Refuse a folder where a kernel cannot be, or that holds files of another program, kind or target."""
    visible(folder)
    check_parent(folder)
    path = folder / artifact.MANIFEST_NAME
    data: Any = None
    if not path.exists():
        return
    with suppress(InputError):
        data = parse_json(read_file(path), "manifest", "choose another folder")
    kinds = {artifact.SCHEMA: "a model's kernel", path_kernel.SCHEMA: "a scene's kernel"}
    schema, target = (data.get(key) if isinstance(data, dict) else None for key in ("schema", "target"))
    wanted = path_kernel.SCHEMA if of_scene else artifact.SCHEMA
    if schema not in kinds:
        rule = f"its {artifact.MANIFEST_NAME} is not one that wamnet wrote"
    elif schema != wanted:
        rule = f"holds {kinds[schema]}, and this is {kinds[wanted]}"
    elif target != name:
        rule = f"holds a kernel for {target}, and this one is for {name}"
    else:
        return
    raise InputError("output folder", str(folder), rule, "choose another with -o")


def write_kernel(kernel: Artifact, folder: Path) -> tuple[Path, ...]:
    """Write a kernel's files; what the system refuses is reported with the folder's name."""
    try:
        return artifact.write(kernel, folder)
    except OSError as error:
        raise unwritable(folder, error, "output folder") from None


def listing(
    model: str,
    target: Target,
    output: Path | None = None,
    profile: str = "ieee",
) -> None:
    """Print a kernel interleaved with the lines of the reference that it came from."""
    if output is not None:
        check_output(output, inputs=[Path(model)])
    language = language_named(target).under(profile)
    if is_scene(model):
        scene = load_scene(model, None, [])
        programs = lower_scene.lower_scene(scene, Settings(), language.forms, keep_places=True)
        path_kernel = compile_path(programs, language)
        lines = lines_of(path_kernel.source, path_kernel.programs.parts)
    else:
        program = lower(load_model(Path(model), imported=True), keep_places=True)
        kernel = compile_program(program, language)
        lines = lines_of(kernel.source, {"": kernel.programs})
    text = as_text(lines, _reference)
    if output is not None:
        write_text(output, text)
        text = str(output)
    for line in text.rstrip("\n").split("\n"):
        say(line)


def _reference(place: str) -> str:
    """Return the text of a place, refimpl/network/siren.py:122."""
    path, _, line = place.rpartition(":")
    return (Path(__file__).parents[2] / path).read_text(encoding="utf-8").splitlines()[int(line) - 1]
