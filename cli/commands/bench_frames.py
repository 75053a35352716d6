"""The frames on which a benchmark measures: of the model's own scene, at draws that it was not trained on.

1. The test frames of a data set, with what its manifest says of each [`of_folder`].
2. Without a data set they are rendered into a folder, once: the scene, the ranges of time, camera and lamps,
   the camera rays of the features and the depth are those that the model names as its training's
   [`inputs.trained_scene`, `ranges_of`, `rendered`].
3. Training frames of the same kind, for forms of the network that are trained on [`for_training`].

An interrupted run resumes, as that of `wamnet dataset` does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ...compiler.scenes.encode_kernel import sees
from ...models.data.frame_plan import KINDS, Request, plan
from ...refimpl.errors import InputError
from ...refimpl.frame import Frame
from ...refimpl.light.render import FEATURE_SAMPLER
from ...refimpl.light.variation import RANGES, ranges_from_json
from ...refimpl.network.denoise import Model, learned_feature_spp, learned_shadow_rays
from ..common.executors import chosen
from ..common.inputs import trained_scene, unlike_training
from ..common.terminal import say
from ..files import dataset_files, exr
from . import dataset

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
