"""What a benchmark measures on: frames of the model's own scene, and forms of the network that it trains.

1. The test frames of a data set, with what its manifest says of each [`of_folder`].
2. Without a data set they are rendered into a folder, once: the scene, the ranges of time, camera and lamps,
   the camera rays of the features and the depth are those that the model names as its training's
   [`inputs.trained_scene`, `ranges_of`, `rendered`]. Training frames are of the same kind [`for_training`].
3. A form is cut from the model [compiler/variants.py] and trained further with the model's recipe, with fewer
   steps, on its own scales: images are encoded as the model's are [`start_of`]. The whole network is trained
   on as far too: what more steps give is not credited to a form [`FURTHER`].
4. Each form is kept in a folder of its model, beside its checkpoint [`trained`].

An interrupted run resumes: frames as in `wamnet dataset`, and a form that is finished is read.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ...compiler import variants
from ...compiler.scenes.encode_kernel import sees
from ...compiler.variants import digest_of
from ...kernels.bench.contenders import Variant
from ...kernels.run.curve import names_for
from ...models.data.frame_plan import KINDS, Request, plan
from ...models.model_file import load_checkpoint
from ...refimpl.errors import InputError
from ...refimpl.frame import Frame
from ...refimpl.light.render import FEATURE_SAMPLER
from ...refimpl.light.variation import RANGES, ranges_from_json
from ...refimpl.network.dataset import build
from ...refimpl.network.denoise import Model, learned_feature_spp, learned_shadow_rays
from ...refimpl.network.train import PRESETS, Recipe, TrainState, recipe_from_json, start
from ..common.executors import chosen
from ..common.inputs import load_model, trained_scene, unlike_training
from ..common.terminal import say
from ..files import dataset_files, exr
from . import dataset, train

Pair = tuple[Frame, Frame]

TEST_SEED = 1 << 31
"""Seed of the test frames: training sets of fewer than a thousand million frames never have it."""

TRAINING_PX = 256
"""Width and height of the training frames: those of the models that ship with the package."""

TRAINING_FRAMES = 64
"""Training frames: a camera that moves needs more of them than one at rest."""

TRAINING_SPP = 32
"""Samples of a training target: many targets teach more than few clean ones."""


@dataclass(frozen=True)
class Frames:
    """Pairs of a noisy frame and its reference, and what is known of them, as JSON's types.

    `facts` say how they were made; `draws` has time, scene and seeds of each.
    """

    pairs: tuple[Pair, ...] = ()
    draws: tuple[Mapping[str, Any], ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def as_data(self) -> dict[str, Any]:
        """Return what is known of the frames."""
        return {**self.facts, "draws": list(self.draws)}


def of_folder(folder: Path, model: Model, split: str = "test") -> Frames:
    """Return a data set's frames of a split; refuse one without any, or whose frames lack a layer."""
    pairs = dataset_files.read_pairs(folder, split, tell=say)
    if not pairs:
        raise InputError("data set", str(folder), f"has no {split} frames", "make one with --test 1")
    for noisy, _ in pairs:
        exr.need_layers(
            folder, noisy, model.features, "the model was trained with it", "make another data set"
        )
    manifest = dataset_files.read_manifest(folder)
    chosen = [frame for frame in manifest["frames"] if frame["split"] == split]
    asked = manifest["request"]
    facts = {
        "scene": asked["scene"],
        "executor": asked["executor"],
        "feature_spp": asked.get("feature_spp", 0) or 1,
        "reference_spp": chosen[0]["target"]["spp"],
        "frame_px": chosen[0]["noisy"]["width"],
    }
    draws = (_draw(frame, noisy, model) for frame, (noisy, _) in zip(chosen, pairs, strict=True))
    return Frames(tuple(pairs), tuple(draws), facts)


def _draw(frame: Mapping[str, Any], noisy: Frame, model: Model) -> dict[str, Any]:
    """Return what a manifest says of a frame beyond its files, and what about it training did not have.

    A frame at a time that training had is named too: it may show what was learned.
    """
    known = model.info.get("trained_on_time", "").split(", ")
    found = {key: value for key, value in frame.items() if key not in (*KINDS, "split")}
    seeds = {f"{kind}_seed": frame[kind]["seed"] for kind in KINDS}
    unlike = unlike_training(model, noisy.info)
    return {**found, **seeds, "time_in_training": str(frame["time_s"]) in known, "unlike_training": unlike}


def request_for(model: Model, executor: str, **numbers: Any) -> Request:
    """Return the request of frames that are like those that a model was trained on."""
    scene = trained_scene(model)
    assert scene is not None, "whoever asks for frames has looked for a scene"
    rays = learned_feature_spp(model)
    numbers = {**numbers, **ranges_of(model), "feature_spp": rays if rays > 1 else 0}
    numbers |= {"seen": sees(model.features), "shadow_rays": learned_shadow_rays(model)}
    # Frames of before say no source: theirs was the colour's.
    numbers["feature_sampler"] = model.info.get(f"trained_on_{FEATURE_SAMPLER}", Request.sampler)
    found = Request(scene, executor=executor, **numbers)
    return replace(found, max_depth=_first(model, "max_depth", found.max_depth))


def ranges_of(model: Model) -> dict[str, Any]:
    """Return the ranges that a model has learned, as parts of a request; nothing where it names none."""
    if (text := model.info.get(f"trained_on_{RANGES}")) is None:
        return {}
    found = asdict(ranges_from_json(text))
    start, end = found.pop("time_s")
    return {"start_s": start, "seconds": end - start, **found}


def _first(model: Model, name: str, otherwise: int) -> int:
    """Return the first number of a fact about the training frames."""
    text = model.info.get(f"trained_on_{name}", "").split(", ")[0]
    return int(text) if text.isdigit() else otherwise


def rendered(model: Model, folder: Path, size: int, count: int, spp: int) -> Frames:
    """Return test frames (size, size) of the model's scene, rendered where they are missing."""
    executor = chosen(work="renderer")
    # Where no kernel runs more samples would take an hour.
    spp = min(spp, 32) if executor == "numpy" else spp
    # A data set has a training frame at least; the shortest one.
    numbers = {"frames": 1, "test_frames": count, "spp": 1, "test_spp": spp}
    place = folder / f"frames-{trained_scene(model)}-{size}"
    _make(place, request_for(model, executor, size_px=size, seed=TEST_SEED, **numbers))
    return of_folder(place, model)


def for_training(model: Model, folder: Path) -> Sequence[Pair]:
    """Return training frames of the model's scene, rendered where they are missing."""
    executor = chosen(work="renderer")
    place = folder / f"training-{trained_scene(model)}-{TRAINING_PX}"
    numbers = {"frames": TRAINING_FRAMES, "test_frames": 0, "spp": TRAINING_SPP, "size_px": TRAINING_PX}
    _make(place, request_for(model, executor, seed=1 << 30, **numbers))
    return of_folder(place, model, "train").pairs


def _make(folder: Path, request: Request) -> None:
    """Render what the folder lacks of a request."""
    dataset.make(folder, request, plan(request), workers=1, scheduler=None)


# ---- forms -------------------------------------------------------------------------------------------------

FORMS = (
    *("full", "rank16", "rank12", "rank8", "window10", "window8", "window6"),
    *("window8+rank16", "window8+rank12", "window6+rank12"),
)
"""Forms that are trained; `full` is the control."""

QUICK_FORMS = ("full", "rank16", "window8+rank16")
"""Forms of a quick run."""

FURTHER = "further"
"""Name of the whole network after as many more steps."""


def planned(model: Model, names: Sequence[str], steps: int) -> dict[str, Variant]:
    """Return the forms that this model can have, by the names of variants, not trained yet."""
    found = {}
    for name in names_for(model, names):
        varied = variants.vary(variants.parse(name), model)
        text = f"{'the whole network' if varied.is_full else name}, trained for {steps} steps more"
        shown = FURTHER if varied.is_full else name
        found[name] = Variant(shown, text, varied.rank, model=varied.model, steps=steps)
    return found


def folder_of(model: Model, output: Path) -> Path:
    """Return the folder of a model's forms, in that of the results."""
    return output / f"forms-{digest_of(model)[:12]}"


def trained(
    model: Model, forms: dict[str, Variant], pairs: Sequence[Pair], folder: Path, executor: str
) -> list[Variant]:
    """Return the forms after training on pairs of frames, which is done where the folder lacks it."""
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for name, form in forms.items():
        path = folder / f"{name}.safetensors"
        begin = start_of(model, name, form.steps, pairs)
        state = _kept(train.checkpoint_path(path), begin)
        if state.step < form.steps or not path.exists():
            say(f"form {form.name}: {form.steps - state.step} steps")
            train.fit(begin.recipe, pairs, path, state, executor=executor)
        found.append(replace(form, model=load_model(path)))
    return found


def start_of(model: Model, name: str, steps: int, pairs: Sequence[Pair]) -> TrainState:
    """Return the state of a form before its first step, on the model's own scales."""
    recipe, network = train.varied(recipe_of(model, steps), model, name)
    scales = model.normalization
    data = build(pairs, recipe.features, recipe.window, scales)
    return start(recipe, scales, data.digest, network=network)


def recipe_of(model: Model, steps: int) -> Recipe:
    """Return the recipe that a model was trained by, or the best preset, with other steps."""
    text = model.info.get("recipe")
    known = recipe_from_json(text) if text else PRESETS["best"]
    # Another seed than that of the model's own training.
    return replace(known, steps=steps, seed=2, log_every=max(1, min(known.log_every, steps)))


def _kept(path: Path, begin: TrainState) -> TrainState:
    """Return the state of an earlier run of the same recipe on the same frames, or the first one."""
    with suppress(InputError):
        found = load_checkpoint(path)
        if (found.recipe, found.digest, found.normalization) == (
            begin.recipe,
            begin.digest,
            begin.normalization,
        ):
            return found
    return begin
