"""Successive pictures of a scene, each with what those before it know: rendered and followed once, then kept.

1. A take is as many shots, one after another; only the last ones are looked at [`Take`]. Camera and scene
   move, or rest [`taken`].
2. One kernel renders all takes of a study, with the numbers of each moment as inputs [`rendered`].
3. The history is that of the definition (refimpl/light/history.py), with the limits of a study [`followed`].
4. References of a take share their random numbers, so that their own noise does not flicker [`references`].

A folder keeps colours and frames, each file under a digest of what it is made from. Whoever changes the
definition without a new version of the package empties it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wamnet.cli.common.terminal import progress
from wamnet.cli.files.outputs import replacing
from wamnet.kernels.run.render_frame import render_frame
from wamnet.kernels.run.render_on import Frames
from wamnet.models.data.frame_plan import version
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.light import history
from wamnet.refimpl.light.history import Limits
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene, scene_digest

from .frames import DIGITS, Shot

PICTURES_PER_SECOND = 24
"""Rate of the pictures, as in cinemas."""

YAW_DEG_PER_S, PITCH_DEG_PER_S = 15.0, 4.0
"""How fast a camera turns around what it looks at: nearly two pixels a picture at 128 pixels a side."""


@dataclass(frozen=True)
class Take:
    """Shots of successive pictures; the last `kept` are looked at."""

    shots: tuple[Shot, ...]
    kept: int = 1


def taken(shot: Shot, before: int, kept: int, moves: bool, backwards: bool = False) -> Take:
    """Return the take of `before + kept` pictures whose last one is a shot, with seeds from the shot's on.

    `backwards`: the camera turns in the other direction.
    """
    count, turn = before + kept, -1.0 if backwards else 1.0
    shots = []
    for k in range(count):
        seconds = (k - count + 1) / PICTURES_PER_SECOND if moves else 0.0
        variation = replace(
            shot.variation,
            yaw_deg=shot.variation.yaw_deg + turn * YAW_DEG_PER_S * seconds,
            pitch_deg=shot.variation.pitch_deg + turn * PITCH_DEG_PER_S * seconds,
        )
        shots.append(replace(shot, time=shot.time + seconds, variation=variation, seed=shot.seed + k))
    return Take(tuple(shots), kept)


def followed(folder: Path, takes: Sequence[Take], limits: Limits, executor: str) -> list[list[Frame]]:
    """Return the last frames of each take, with layers of history."""
    folder.mkdir(parents=True, exist_ok=True)
    plain = rendered(folder, takes, executor)
    found = []
    with progress("following", len(takes)) as advance:
        for take, (colors, frames) in zip(takes, plain, strict=True):
            path = _path(folder, "history", [_made_from(shot) for shot in take.shots], executor, vars(limits))
            if not path.exists():
                layers = list(_layers(take, colors, limits))[-take.kept :]
                _write(path, {f"{name} {k}": v for k, each in enumerate(layers) for name, v in each.items()})
            with np.load(path) as kept:
                names = ("history", "history_weight")
                rows = [{name: kept[f"{name} {k}"] for name in names} for k in range(take.kept)]
            found.append([Frame({**f.layers, **row}, f.info) for f, row in zip(frames, rows, strict=True)])
            advance(1)
    return found


def _layers(take: Take, colors: Floats, limits: Limits) -> Iterator[dict[str, Floats]]:
    """Yield the layers of history after each picture of a take."""
    past = None
    for shot, color in zip(take.shots, colors, strict=True):
        scene, job = shot.build(), _job(shot)
        past = (
            history.begin(scene, job, color)
            if past is None
            else history.follow(past, scene, job, color, limits)
        )
        yield history.layers_of(past)


def rendered(folder: Path, takes: Sequence[Take], executor: str) -> list[tuple[Floats, list[Frame]]]:
    """Return the colours (T, H, W, 3) of each take, and its last frames without layers of history."""
    kernels = Frames([shot.build() for take in takes for shot in take.shots])
    found = []
    with progress("rendering", sum(len(take.shots) for take in takes)) as advance:
        for take in takes:
            path = _path(folder, "take", [_made_from(shot) for shot in take.shots], executor, take.kept)
            if not path.exists():
                pictures = [_render(shot.build(), _job(shot), executor, kernels) for shot in take.shots]
                last = enumerate(pictures[-take.kept :])
                layers = {f"{name} {k}": v for k, frame in last for name, v in frame.layers.items()}
                _write(path, {"colors": np.stack([frame["color"] for frame in pictures]), **layers})
            with np.load(path) as kept:
                names = take.shots[0].job.layers
                frames = [Frame({name: kept[f"{name} {k}"] for name in names}) for k in range(take.kept)]
                found.append((kept["colors"], frames))
            advance(len(take.shots))
    return found


def references(folder: Path, takes: Sequence[Take], spp: int, executor: str) -> list[list[Frame]]:
    """Return the references of the last pictures of each take: more samples, with the first one's seed."""
    folder.mkdir(parents=True, exist_ok=True)
    kernels = Frames([shot.build() for take in takes for shot in take.shots[-take.kept :]])
    found: list[list[Frame]] = []
    with progress("references", sum(take.kept for take in takes)) as advance:
        for take in takes:
            found.append([])
            for shot in take.shots[-take.kept :]:
                job = Job(shot.size, shot.size, spp, 2 * take.shots[0].seed + 1)
                path = _path(folder, "reference", [_made_from(shot)], executor, spp, job.seed)
                if not path.exists():
                    _write(path, {"color": _render(shot.build(), job, executor, kernels)["color"]})
                with np.load(path) as kept:
                    found[-1].append(Frame({"color": kept["color"]}))
                advance(1)
    return found


def _job(shot: Shot) -> Job:
    """Return the job of a noisy picture: seeds of pictures are even and those of references odd."""
    return Job(shot.size, shot.size, shot.spp, 2 * shot.seed, feature_spp=shot.feature_spp)


def _render(scene: Scene, job: Job, executor: str, kernels: Frames) -> Frame:
    """Return a frame."""
    return render_frame(executor, scene, job, frames=kernels).frame


def _made_from(shot: Shot) -> list[object]:
    """Return what determines a picture."""
    return [scene_digest(shot.build()), _job(shot).facts()]


def _path(folder: Path, what: str, *made_from: object) -> Path:
    """Return the file of what is made from these."""
    digest = hashlib.sha256(json.dumps([what, *made_from, version()], sort_keys=True).encode()).hexdigest()
    return folder / f"{what}-{digest[:DIGITS]}.npz"


def _write(path: Path, arrays: dict[str, Floats]) -> None:
    """Write arrays in one step."""
    with replacing(path) as new, new.open("wb") as file:
        np.savez(file, **arrays)
