"""What a data set consists of: draws, seeds, pictures, and the independent tasks that make them.

1. Each frame draws a time, a camera and lamps' colours from the request's ranges: training frames, test
   frames inside of the ranges, test frames outside [`frame_draws`].
2. Each draw has a noisy picture and a target, each with random numbers of its own [`plan`].
3. What the frames show is compared: test frames that repeat one another or a training frame are refused
   [`compared`].
4. A picture is cut into bands of rows, each an independent task [`Picture.tasks`]; how is a function of the
   request only, so that an interrupted run finds its bands again whatever the number of workers is.
5. A task is carried out anywhere [kernels/run/before.py], and the bands of a picture are joined [`join`]. A
   noisy picture with others before it is one task, since a history needs whole pictures.

The pictures are a function of the request and of the version of this package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from typing import Any

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.frame import Frame
from ...refimpl.light.render import FEATURE_SAMPLER, TILE_PIXELS, Job, other_sampler, spread
from ...refimpl.light.scene import Scene, scene_digest
from ...refimpl.light.scenes import TURN_SECONDS
from ...refimpl.light.transport import Settings
from ...refimpl.light.variation import RANGES, Ranges, check_ranges, varied
from .draws import Draw, drawn, drawn_outside
from .geometry import Comparison, Shown, compare
from .scene_source import SCENE_FILE, Parameters, SceneSource

NOISY_SPP = 1
"""Paths per pixel of a noisy picture: what the network is made for."""

TASK_SAMPLES = 1 << 23
"""Samples in a task at most, where one tile of pixels allows it: half a minute of the reference on one core,
which is what the loss of a worker costs; a picture of 1024x1024 at 1024 spp is 128 tasks."""

LARGEST_FRAMES = 100_000
"""Largest number of training or of test frames: their names count them in five digits, and so sort."""

KINDS = ("noisy", "target")
"""The two pictures of each frame, in the order of their seeds."""

TRAIN, TEST, OUTSIDE = "train", "test", "outside"
"""The splits: frames to train on, frames at other draws inside the same ranges, frames outside of them."""

SPLITS = (TRAIN, TEST, OUTSIDE)
"""The splits in the order of their frames."""

MOST_BEFORE = 256
"""Most pictures before a frame: at rest a history counts to 64, and studies to four times as many."""

Rows = tuple[int, int]
"""A band of rows [first, last)."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class Request:
    """All that determines a data set, except for the version: scene, animation, numbers, sizes, seed, ways.

    The animation runs from `start_s` for `seconds`, of which training leaves out the last `arc_s`;
    `parameters` are those of the canonical scene; `still` is the scene of a file instead. Cameras are drawn
    from the ranges `yaw_deg`, `pitch_deg` and `distance` (a factor), lamps' colours from the range
    `saturation` (None: the lamps' own), factors of their power from `power` (None: the lamps' own). The
    features of noisy pictures are means over `feature_spp` camera rays; 0: over the colour's one; they come
    from `feature_sampler`, "" is an even spread. Targets have `spp` samples, those of test frames `test_spp`;
    0: as many. `seen`: noisy pictures have the layers of what is seen past mirrors and glass too. `before`:
    they have layers of history after so many pictures, in which the animation runs and the camera rests.
    `shadow_rays`: they, and targets of tests, have the layer `direct`, by so many shadow rays of each camera
    ray.
    """

    scene: str
    parameters: Parameters = field(default_factory=dict)
    start_s: float = 0.0
    seconds: float = TURN_SECONDS
    frames: int = 8
    test_frames: int = 2
    size_px: int = 64
    spp: int = 64
    seed: int = 0
    max_depth: int = 5
    executor: str = "numpy"
    sampler: str = "pcg4d"
    feature_spp: int = 0
    test_spp: int = 0
    outside_frames: int = 0
    arc_s: float = 0.0
    yaw_deg: Pair = (0.0, 0.0)
    pitch_deg: Pair = (0.0, 0.0)
    distance: Pair = (1.0, 1.0)
    saturation: Pair | None = None
    seen: bool = False
    feature_sampler: str = ""
    power: Pair | None = None
    before: int = 0
    shadow_rays: int = 0
    still: Scene | None = None

    def as_data(self) -> dict[str, Any]:
        """Return the request as JSON's types: what came later only if given, a source not the colour's."""
        fields = asdict(replace(self, still=None))
        data = {name: list(v) if isinstance(v, tuple) else v for name, v in fields.items()}
        del data["still"]
        if self.still is not None:
            data[SCENE_FILE] = self.source.sha256
        source = data.pop("feature_sampler") or spread(self.sampler, self.seen)
        if self.feature_spp > NOISY_SPP and source != self.sampler:
            data["feature_sampler"] = source
        lists = {k: list(v) if isinstance(v, tuple) else v for k, v in sorted(self.parameters.items())}
        for name in ("seen", "power", "before", "shadow_rays"):
            if data[name] in (False, None, 0):
                del data[name]
        return {**data, "parameters": lists}

    @property
    def source(self) -> SceneSource:
        """Return the scene as a function of time."""
        return SceneSource(self.scene, self.parameters, self.still)

    @property
    def ranges(self) -> Ranges:
        """Return what training frames are drawn from."""
        times = (self.start_s, self.start_s + self.seconds - self.arc_s)
        return Ranges(times, self.yaw_deg, self.pitch_deg, self.distance, self.saturation, self.power)

    @property
    def counts(self) -> dict[str, int]:
        """Return the number of frames of each split, in their order."""
        return dict(zip(SPLITS, (self.frames, self.test_frames, self.outside_frames), strict=True))

    def scene_at(self, draw: Draw) -> Scene:
        """Return the scene that a frame shows; its info has the ranges too."""
        found = varied(self.source.at(draw.time_s), draw.variation)
        return replace(found, info={**found.info, RANGES: self.ranges.to_json()})


@dataclass(frozen=True)
class Picture:
    """One file: its name within the data set (with slashes), and what it shows: a draw, a job."""

    name: str
    request: Request
    draw: Draw
    job: Job

    @property
    def scene(self) -> Scene:
        """Return the scene, made again each time: thousands of pictures are kept, and few are looked at."""
        return self.request.scene_at(self.draw)

    @property
    def height(self) -> int:
        """Return the number of its rows."""
        return self.job.height

    @property
    def before(self) -> int:
        """Return the number of pictures before it, of which a target has none."""
        return self.request.before if self.name.endswith(f"-{KINDS[0]}.exr") else 0

    def scene_at(self, seconds: float) -> Scene:
        """Return the scene so many seconds from the picture's own moment, seen by the same camera."""
        return self.request.scene_at(replace(self.draw, time_s=self.draw.time_s + seconds))

    def tasks(self) -> list[Task]:
        """Return its tasks, top to bottom.

        A band has about TASK_SAMPLES samples, but a tile of pixels at least: smaller ones would be slow.
        """
        job = self.job
        rows = max(TASK_SAMPLES // (job.samples // job.height), TILE_PIXELS // job.width, 1)
        rows = job.height if self.before else rows
        bands = [(first, min(first + rows, job.height)) for first in range(0, job.height, rows)]
        here = version()
        return [Task(self, band, here) for band in bands]


@dataclass(frozen=True)
class FramePlan:
    """One frame: its split, its draw, and its two pictures, by kind."""

    split: str
    draw: Draw
    pictures: Mapping[str, Picture]

    @property
    def name(self) -> str:
        """Return what its pictures have in common: split and number."""
        return self.pictures[KINDS[0]].name.removesuffix(f"-{KINDS[0]}.exr")

    def describe(self) -> dict[str, Any]:
        """Return a frame as JSON's types: split, scene, draw, and of each picture its name and its job."""
        scene, variation = self.pictures[KINDS[0]].scene, self.draw.variation
        facts: dict[str, Any] = {
            "split": self.split,
            "time_s": self.draw.time_s,
            "yaw_deg": variation.yaw_deg,
            "pitch_deg": variation.pitch_deg,
            "distance": variation.distance,
            "lights": [list(light.color) for light in scene.lights],
            "scene": scene.name,
            "scene_digest": scene_digest(scene),
        }
        if self.draw.outside:
            facts["outside"] = self.draw.outside
        for kind, picture in self.pictures.items():
            job = picture.job
            facts[kind] = {"file": picture.name, "width": job.width, "height": job.height}
            facts[kind] |= {"spp": job.spp, "seed": job.seed}
            if job.feature_spp:
                facts[kind]["feature_spp"] = job.feature_spp
                facts[kind] |= {FEATURE_SAMPLER: source} if (source := other_sampler(job)) else {}
        return facts


@dataclass(frozen=True)
class Task:
    """A band of a picture, to be rendered by a version of this package."""

    picture: Picture
    rows: Rows
    version: str

    @property
    def samples(self) -> int:
        """Return the number of paths to be traced."""
        job = self.picture.job
        earlier = job.width * job.height * job.spp * self.picture.before
        return job.samples // job.height * (self.rows[1] - self.rows[0]) + earlier


def version() -> str:
    """Return the installed version of this package."""
    return metadata.version("wamnet")


def frame_draws(request: Request) -> list[tuple[str, Draw]]:
    """Return (split, draw) of all frames: training, then inside, then outside.

    Test frames inside continue the sequences of the training frames, those outside the sequences of both.
    """
    lights = request.source.at().lights
    ranges, (train, inside, beyond) = request.ranges, request.counts.values()
    found = drawn(request.seed, ranges, lights, 0, train + inside)
    far = drawn_outside(request.seed, ranges, request.arc_s, lights, train + inside, beyond)
    times = [draw.time_s for draw in (*found, *far)]
    if len(set(times)) < len(times) or not all(map(math.isfinite, times)):
        rule = f"{len(times)} different times must fit into it"
        raise InputError("seconds of the animation", request.seconds, rule, "make it longer")
    splits = [split for split, count in request.counts.items() for _ in range(count)]
    return list(zip(splits, (*found, *far), strict=True))


def animation_times(start_s: float, seconds: float, fps: float) -> list[float]:
    """Return the times of a film, 1 / fps apart, from the start to before the end; the first at least."""
    if not (all(map(math.isfinite, (start_s, seconds, fps))) and seconds > 0.0 and fps > 0.0):
        what = "animation (start, seconds, pictures per second)"
        raise InputError(what, (start_s, seconds, fps), "must be finite and last", "change it")
    count = max(1, round(seconds * fps))
    if count > LARGEST_FRAMES:
        rule = f"an animation has {LARGEST_FRAMES} at most"
        raise InputError("number of frames", count, rule, "make it shorter, or use fewer per second")
    return [start_s + k / fps for k in range(count)]


def plan(request: Request) -> list[FramePlan]:
    """Return all frames of a data set, training first, or refuse the request.

    Frame i has the seeds seed + 2 i (noisy) and seed + 2 i + 1 (target).
    """
    _check(request)
    size, settings = request.size_px, Settings(max_depth=request.max_depth, sampler=request.sampler)
    frames = []
    numbers = dict.fromkeys(SPLITS, 0)
    for index, (split, draw) in enumerate(frame_draws(request)):
        pictures = {}
        target_spp = request.spp if split == TRAIN else request.test_spp or request.spp
        for offset, (kind, spp) in enumerate(zip(KINDS, (NOISY_SPP, target_spp), strict=True)):
            job = Job(size, size, spp, request.seed + 2 * index + offset, settings)
            if split != TRAIN or kind == KINDS[0]:  # a penumbra is measured by its reference
                job = replace(job, shadow_rays=request.shadow_rays)
            if kind == KINDS[0]:
                rays, sampler = request.feature_spp, request.feature_sampler
                job = replace(job, feature_spp=rays, feature_sampler=sampler, seen=request.seen)
            pictures[kind] = Picture(f"{split}/{numbers[split]:05d}-{kind}.exr", request, draw, job)
        frames.append(FramePlan(split, draw, pictures))
        numbers[split] += 1
    return frames


def _check(request: Request) -> None:
    """Refuse a scene, numbers of frames, an animation or a seed that mean nothing."""
    for name, low in (("frames", 1), ("test_frames", 0), ("outside_frames", 0)):
        value = getattr(request, name)
        if not low <= value <= LARGEST_FRAMES:
            rule = f"must be an integer from {low} to {LARGEST_FRAMES}"
            raise InputError(name, value, rule, "choose another number")
    if not (math.isfinite(request.seconds) and request.seconds > 0.0 and math.isfinite(request.start_s)):
        what = "animation (start, seconds)"
        raise InputError(what, (request.start_s, request.seconds), "must be finite and last", "change it")
    if not (math.isfinite(request.arc_s) and 0.0 <= request.arc_s < request.seconds):
        rule = "training leaves it out of the animation: it must be 0 or more and shorter"
        raise InputError("arc_s", request.arc_s, rule, "use a shorter --arc")
    if not 0 <= request.before <= MOST_BEFORE:
        raise InputError("before", request.before, f"must be from 0 to {MOST_BEFORE} frames", "choose fewer")
    check_ranges(request.ranges)
    if "time" in request.parameters:
        value = request.parameters["time"]
        raise InputError("parameter time", value, "each frame has its own", "use --start and --seconds")
    request.source.at()
    cameras = (request.yaw_deg, request.pitch_deg, request.distance)
    varies = any(low < high for low, high in cameras) or request.saturation or request.power
    if request.still is not None and not varies and sum(request.counts.values()) > 1:
        rule = "is static, and without a range of camera or lights all its frames show the same"
        way_out = "give one, for example --yaw=-24:24 --pitch=-5:10"
        raise InputError("scene", request.scene, rule, way_out)
    last = request.seed + 2 * sum(request.counts.values()) - 1
    if request.seed < 0 or last >= 1 << 32:
        rule = "seeds up to that plus twice the number of frames must fit into 32 bits"
        raise InputError("seed", request.seed, rule, "choose a smaller one, 0 or more")


def compared(
    frames: Sequence[FramePlan], on_progress: Callable[[int], None] = lambda frames: None
) -> dict[str, Comparison]:
    """Return how far the nearest training frame is from each split of test frames, or refuse frames alike."""
    shown: dict[str, list[Shown]] = {split: [] for split in SPLITS}
    for frame in frames:
        scene = frame.pictures[KINDS[0]].scene
        shown[frame.split].append(Shown(frame.name, frame.draw.time_s, scene))
    train = shown.pop(TRAIN)
    return compare(train, shown, on_progress) if any(shown.values()) else {}


def join(bands: Sequence[Frame]) -> Frame:
    """Return the frame whose bands, top to bottom, are given."""
    layers = {name: np.concatenate([band[name] for band in bands]) for name in bands[0].layers}
    return replace(bands[0], layers=layers)
