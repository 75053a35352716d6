"""Frames of canonical scenes, rendered once: a folder keeps them, each under the checksum of its file.

1. What is wanted is data: a scene at a time, a size, samples, a seed [`Shot`].
2. Its file is named after all that determines its pixels, and ends in the SHA-256 of its bytes, so that file
   and checksum appear in one step [`path_of`]. One that was damaged is rendered again [`find`].
3. Whatever is missing is rendered by a device or by the reference, with progress [`render_all`]. Shots of one
   scene that differ only in numbers share a kernel: compiling one for each takes longer than their pictures.

A frame depends on the version of this package: whoever changes light transport without a new version
empties the folder. A new layer makes new files by itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from wamnet.cli.common.terminal import hint_on_interrupt, progress
from wamnet.cli.files import exr
from wamnet.cli.files.dataset_files import sum_of
from wamnet.kernels.run.render_frame import render_frame
from wamnet.kernels.run.render_on import Frames
from wamnet.models.data.frame_plan import version
from wamnet.refimpl.frame import FIRST_HIT, SUN, Floats, Frame
from wamnet.refimpl.light.environment import sun_of
from wamnet.refimpl.light.render import Job, feature_job, render_info
from wamnet.refimpl.light.scene import BLACK, Scene, scene_digest
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import AT_REST, Variation, varied

NOISY_SPP = 1
"""Samples per pixel of what is denoised."""

DIGITS = 16
"""Hexadecimal digits of a shot's digest in a file's name: two shots never share them."""

Pair = tuple[Frame, Frame]
"""A noisy frame and its reference."""


@dataclass(frozen=True)
class Shot:
    """A picture to be rendered.

    Its features are means over `feature_spp` camera rays at random; 0: over the colour's. `seen`: features
    are also of what is seen past mirrors and glass. With `shadow_rays` of each camera ray the frame has the
    layer `direct` too, and these camera rays are spread evenly, as with `spread`. `sun`: of a sky only that.
    """

    scene: str = "minicubes"
    time: float = 0.0
    size: int = 128
    spp: int = NOISY_SPP
    seed: int = 0
    feature_spp: int = 0
    variation: Variation = AT_REST
    seen: bool = False
    shadow_rays: int = 0
    settings: Settings = field(default_factory=Settings)
    spread: bool = False
    sun: bool = False

    @property
    def job(self) -> Job:
        """Return size, samples and seed as the renderer wants them."""
        sampler = "" if self.shadow_rays or self.spread else Settings().sampler
        rays = {"feature_spp": self.feature_spp, "feature_sampler": sampler, "shadow_rays": self.shadow_rays}
        how = self.size, self.size, self.spp, self.seed, self.settings
        return Job(*how, seen=self.seen, **rays)  # type: ignore[arg-type]

    def build(self) -> Scene:
        """Return the scene at its time, from its side and under its lamps."""
        scene = canonical(self.scene, time=self.time)
        if self.sun and (sky := scene.environment):
            scene = replace(scene, environment=replace(sky, zenith=BLACK, horizon=BLACK, ground=BLACK))
        return scene if self.variation == AT_REST else varied(scene, self.variation)


def path_of(folder: Path, shot: Shot, executor: str) -> Path:
    """Return the name of a shot's file without checksum and suffix."""
    job = shot.job.facts()
    if not shot.feature_spp:
        del job["feature_spp"]  # these files are older than it is
    if shot.shadow_rays or not shot.spread:
        del job["feature_sampler"]  # the same for all with shadow rays, and for all without
    scene = shot.build()
    layers = sorted([*shot.job.layers, *([SUN] if sun_of(scene) is not None else [])])
    made_from = [scene_digest(scene), job, executor, layers, version()]
    digest = hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()[:DIGITS]
    return folder / f"{shot.scene}-{shot.time:.4g}s-{shot.size}px-{shot.spp}spp-{digest}"


def find(folder: Path, shot: Shot, executor: str = "opencl") -> Path | None:
    """Return the whole file of a shot, if it is there; one that is damaged is removed."""
    name = path_of(folder, shot, executor)
    for path in sorted(folder.glob(f"{name.name}.*.exr")):
        if path.name == f"{name.name}.{sum_of(path).sha256}.exr":
            return path
        path.unlink()
    return None


def render_all(folder: Path, shots: Iterable[Shot], executor: str = "opencl") -> list[Path]:
    """Return the files of all shots, in their order, after rendering those that are not there."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = list(shots)
    there = {id(shot): find(folder, shot, executor) for shot in wanted}
    left = [shot for shot in wanted if there[id(shot)] is None]
    samples = sum(shot.job.samples for shot in left)
    kernels = Frames([shot.build() for shot in left])
    with (
        hint_on_interrupt(lambda: f"the same command resumes where it was, in {folder}"),
        progress(f"rendering {len(left)} frames", samples) as advance,
    ):
        for shot in left:
            # A shot that appears twice in the list is there by now.
            known = find(folder, shot, executor)
            there[id(shot)] = known or _render(folder, shot, executor, kernels, advance)
    return [path for shot in wanted if (path := there[id(shot)]) is not None]


def _render(folder: Path, shot: Shot, executor: str, kernels: Frames, advance: Any) -> Path:
    """Render a shot and give its file the name that ends in its checksum.

    Where the same colour is there with features of its own rays, only the others' first hits are traced.
    """
    scene, plain = (
        shot.build(),
        find(folder, replace(shot, feature_spp=0, seen=False, shadow_rays=0), executor),
    )
    if (of_features := feature_job(shot.job)) is not None and plain is not None:
        hits = _rendered(executor, scene, of_features, kernels, advance)
        layers = {**hits.layers, "color": exr.read_frame(plain)["color"]}
        frame = Frame(layers, render_info(scene, shot.job))
    else:
        frame = _rendered(executor, scene, shot.job, kernels, advance)
    name = path_of(folder, shot, executor)
    new = folder / f".{name.name}.exr"
    exr.write_frame(new, frame)
    return new.replace(folder / f"{name.name}.{sum_of(new).sha256}.exr")


def _rendered(executor: str, scene: Scene, job: Job, kernels: Frames, advance: Any) -> Frame:
    """Return the frame of a job; the reference compiles nothing."""
    return render_frame(executor, scene, job, workers=None, on_progress=advance, frames=kernels).frame


Made = TypeVar("Made", Job, Shot)
"""What says how a picture is rendered."""


def one_scattering(job: Made, spp: int) -> tuple[Made, Made]:
    """Return how to render the direct light that a job's own paths have found, and that of so many paths."""
    own = replace(job, feature_spp=0, shadow_rays=0, settings=Settings(max_depth=1))
    return own, replace(own, spp=spp, settings=Settings(max_depth=1, sampler="sobol"))


def relit(frame: Frame, own: Floats, lit: Floats) -> Frame:
    """Return a frame whose colour has other direct light than what its own paths have found."""
    color = np.maximum(frame["color"] - own, 0.0) + lit
    return Frame({**frame.layers, "color": color}, frame.info)


def in_sun(frame: Frame, sun: Frame, scene: Scene) -> Frame:
    """Return a frame whose direct light, with and without shadows, is that of another frame: of the sun."""
    cosines = np.maximum(frame["normal"] @ sun_of(scene), 0.0)[..., np.newaxis]
    full = frame["albedo"] * cosines * (np.array(scene.environment.sun_irradiance) / np.pi)
    layers = {"direct": sun["direct"], "unshadowed": full.astype(np.float32)}
    return Frame({**frame.layers, **layers}, frame.info)


def frames(folder: Path, shots: Iterable[Shot], executor: str = "opencl") -> list[Frame]:
    """Return the frames of all shots, rendered where they are not there."""
    return [exr.read_frame(path) for path in render_all(folder, shots, executor)]


def past_mirrors(frame: Frame) -> Frame:
    """Return a frame whose layers of the first hit are those past mirrors and glass."""
    return Frame({**frame.layers, **{first: frame[seen] for seen, first in FIRST_HIT.items()}}, frame.info)


def reference(shot: Shot, spp: int) -> Shot:
    """Return the shot of a noisy shot's reference: more samples, and random numbers of its own.

    Seeds of references are odd and those of noisy shots even, so that none share their random numbers.
    """
    return replace(shot, spp=spp, seed=2 * shot.seed + 1, feature_spp=0, seen=False, shadow_rays=0)


def noisy(shot: Shot) -> Shot:
    """Return the noisy shot itself, with an even seed."""
    return replace(shot, spp=NOISY_SPP, seed=2 * shot.seed)
