"""Reading what commands are given, with errors that name the file and fit the command."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from ... import models
from ...models import model_file
from ...models.data.scene_source import SCENE_FILE, scene_source
from ...refimpl.errors import InputError, choice
from ...refimpl.light.render import FEATURE_SAMPLER, FEATURE_SPP, SHADOW_RAYS, spread_rays
from ...refimpl.light.scene import Scene
from ...refimpl.light.scenes import CANONICAL, canonical
from ...refimpl.light.variation import RANGES, outside, ranges_from_json
from ...refimpl.network.denoise import Model
from ...refimpl.reading import check_regular
from . import options
from .terminal import tell

MODEL_PREFIX = "model:"
"""May be before the name of a model that ships with the package, and must where scenes have names too."""

CHECKPOINT_MARK = ".checkpoint"
"""Before the suffix of a model's name in the name of its checkpoint."""


def check_input(path: Path) -> None:
    """Refuse an input that is not a file."""
    if not path.exists():
        raise InputError("input file", str(path), "not found", "check the name")
    check_regular(path.stat(), "input file", str(path))


def model_path(path: Path) -> Path:
    """Return the file of a model: the file that is named, else the shipped one of this name."""
    known, name = models.names(), str(path).removeprefix(MODEL_PREFIX)
    # No model is a folder: one of that name, perhaps of results, does not hide the model.
    if path.suffix or (path.exists() and not (name in known and path.is_dir())):
        return path
    if path.is_dir():
        tell(f"{path}/ is a folder, not a model: using the bundled model of this name")
    if name not in known:
        raise InputError(
            "model", str(path), "not found", f"{choice(name, known)}, or give a .safetensors file"
        )
    return models.path(name)


def load_model(path: Path, imported: bool = False) -> Model:
    """Read a model; a checkpoint is refused with the name of the model that belongs to it.

    `imported`: networks of other programs too, which do not read frames.
    """
    path = model_path(path)
    try:
        found = model_file.load_model(path)
        if not found.is_imported or imported:
            return found
        rule = f"was imported and reads {', '.join(found.features)}, not the features of a frame"
        raise InputError("model", str(path), rule, "use it with wamnet compile, listing or export --check")
    except InputError as error:
        if error.value != model_file.CHECKPOINT_FORMAT:
            raise
    name = path.name.replace(CHECKPOINT_MARK + path.suffix, path.suffix)
    way_out = f"give the model next to it: {path.with_name(name)}" if name != path.name else "give the model"
    raise InputError("model file", str(path), "is a checkpoint of training, not a model", way_out)


def trained_scene(model: Model) -> str | None:
    """Return the canonical scene that a model was trained on; None for several, a file's, and no name."""
    name = model.info.get("trained_on_scene", "")
    return name if name in CANONICAL and f"trained_on_{SCENE_FILE}" not in model.info else None


def learned_scene(model: Model) -> str:
    """Return the canonical scene that a model was trained on, minicubes if it names none; reject others."""
    names = model.info.get("trained_on_scene", "")
    name = trained_scene(model) if names else "minicubes"
    if name is None:
        rule = "must be one canonical scene, or one must be chosen"
        raise InputError("scene that the model was trained on", names, rule, "name one with --scene")
    return name


def unlike_training(model: Model, info: Mapping[str, str]) -> list[str]:
    """Return what about a frame of this info a model has not learned, as sentences; not known is nothing."""
    told, files = [], model.info.get(f"trained_on_{SCENE_FILE}", "")
    scenes, scene = model.info.get("trained_on_scene", ""), info.get("scene", "")
    if scenes and scene and scene not in scenes.split(", "):
        told.append(f"it shows {scene}, but the model was trained only on {scenes}: expect a poor image")
    elif files and scene and info.get(SCENE_FILE, "") not in files.split(", "):
        told.append(f"{scene} is another scene file than the one the model was trained on: expect errors")
    elif beyond := outside_ranges(model, info):
        told.append(f"outside the training ranges: {', '.join(beyond)}; expect errors")
    if scenes and "spp" in info and (rule := unlike_features(model, info)):
        told.append(f"{rule}: expect worse edges")
    rays, learned = info.get(SHADOW_RAYS, ""), model.info.get(f"trained_on_{SHADOW_RAYS}", "")
    if rays and learned and rays not in learned.split(", "):
        told.append(f"its --shadow-rays are {rays}, those of the training {learned}: expect other shadows")
    return told


def unlike_features(model: Model, info: Mapping[str, str]) -> str:
    """Return that a frame's features are of other rays than a model's, or "": fewer do if spread."""
    rays, wanted = info.get(FEATURE_SPP, "1"), model.info.get(f"trained_on_{FEATURE_SPP}", "1")
    source, learned = info.get(FEATURE_SAMPLER, ""), model.info.get(f"trained_on_{FEATURE_SAMPLER}", "")
    counts = wanted.split(", ")
    if source and not learned:
        counts = [str(spread_rays(int(count))) for count in counts if count.isdigit()] + counts
    if rays in counts and (source or not learned):
        return ""
    at_random = "" if source or not learned else " at random"
    return f"its features are of --feature-spp {rays}{at_random}, those of the training of {wanted}"


def outside_ranges(model: Model, info: Mapping[str, str]) -> list[str]:
    """Return what of a frame lies outside of the ranges that a model says it has learned."""
    text, scene = model.info.get(f"trained_on_{RANGES}"), info.get("scene", "")
    files = model.info.get(f"trained_on_{SCENE_FILE}")
    if text is None:
        return []
    own = canonical(scene).lights if scene in CANONICAL and not files else ()
    return outside(ranges_from_json(text), info, [light.color for light in own])


def load_scene(
    name: str, time: float | None, assignments: Sequence[str], view: options.View | None = None
) -> Scene:
    """Return a canonical scene by name, or that of a scene file, as a view has it."""
    parameters = options.parse_parameters(assignments)
    if time is not None:
        parameters["time"] = time
    source = scene_source(name, parameters)
    # A file may say of itself that it is another scene's, from such a side: that stays.
    if view is None or (source.still is not None and view == options.View()):
        return source.at()
    return view.of(source.at())
