"""What a data set of a Blender file consists of: frames of its animation, and two pictures of each.

1. Frames are whole ones, since films have no others and simulations are kept for no others. Training and
   test frames are drawn, as times of other data sets are, by steps of the golden ratio [`drawn`].
2. The last `arc_s` seconds are left out of training; frames outside are drawn from them.
3. Frame i has the seeds seed + 2 i (noisy) and seed + 2 i + 1 (target) [`plan`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ...refimpl.errors import InputError
from ..data.draws import times
from ..data.frame_plan import KINDS, SPLITS, TRAIN, Rows

LARGEST_SEED = (1 << 31) - 1
"""Of Cycles."""

LARGEST_SIDE = 1 << 14
"""Pixels along a side, at most."""

DRAWS = 64
"""Draws for each frame, after which what is left is taken in order."""


@dataclass(frozen=True)
class Animation:
    """What a file says: frames `first` to `last`, `fps` of them a second, width and height in pixels."""

    version: str
    scene: str
    view_layer: str
    first: int
    last: int
    step: int
    fps: float
    width: int
    height: int
    pixel_filter: str
    device: str

    @property
    def frames(self) -> list[int]:
        """Return the numbers of the film's frames."""
        return list(range(self.first, self.last + 1, max(self.step, 1)))


@dataclass(frozen=True)
class Request:
    """All that determines a data set of a Blender file: the file by its SHA-256, frames, samples, seed.

    Noisy pictures have `noisy_spp` samples a pixel, targets `spp`, those of test frames `test_spp`; 0: as
    many. Pictures have `percent` of the width and height that the file says.
    """

    blend: str
    sha256: str
    animation: Animation
    frames: int = 8
    test_frames: int = 2
    outside_frames: int = 0
    arc_s: float = 0.0
    percent: int = 100
    noisy_spp: int = 1
    spp: int = 64
    test_spp: int = 0
    seed: int = 0

    def as_data(self) -> dict[str, Any]:
        """Return the request as JSON's types."""
        return asdict(self)

    @property
    def size(self) -> tuple[int, int]:
        """Return width and height of the pictures."""
        width, height = (
            max(side * self.percent // 100, 1) for side in (self.animation.width, self.animation.height)
        )
        return width, height


@dataclass(frozen=True)
class Shot:
    """A picture: a name within the data set, a frame of the film, samples and a seed; it is one task."""

    name: str
    request: Request
    frame: int
    spp: int
    seed: int

    @property
    def height(self) -> int:
        """Return the number of its rows."""
        return self.request.size[1]

    @property
    def rows(self) -> Rows:
        """Return all of its rows."""
        return 0, self.height

    @property
    def picture(self) -> Shot:
        """Return the picture of this task."""
        return self

    def tasks(self) -> list[Shot]:
        """Return its only task."""
        return [self]

    @property
    def samples(self) -> int:
        """Return the number of paths."""
        width, height = self.request.size
        return width * height * self.spp

    def as_question(self) -> dict[str, Any]:
        """Return what process.py is asked."""
        width, height = self.request.size
        sizes = {"percent": self.request.percent, "width": width, "height": height}
        return {"frame": self.frame, "spp": self.spp, "seed": self.seed, **sizes}


@dataclass(frozen=True)
class FilmFrame:
    """One frame: its split, its number in the film, and its two pictures by kind."""

    split: str
    frame: int
    pictures: Mapping[str, Shot]

    def describe(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        facts: dict[str, Any] = {"split": self.split, "frame": self.frame}
        for kind, shot in self.pictures.items():
            width, height = shot.request.size
            facts[kind] = {"file": shot.name, "width": width, "height": height}
            facts[kind] |= {"spp": shot.spp, "seed": shot.seed}
        return facts


def plan(request: Request) -> list[FilmFrame]:
    """Return all frames of a data set, training first, or refuse the request."""
    _check(request)
    found: list[FilmFrame] = []
    for split, numbers in zip(SPLITS, _numbers(request), strict=True):
        target_spp = request.spp if split == TRAIN else request.test_spp or request.spp
        for index, number in enumerate(numbers):
            seed = request.seed + 2 * len(found)
            shots = {
                kind: Shot(f"{split}/{index:05d}-{kind}.exr", request, number, spp, seed + offset)
                for offset, (kind, spp) in enumerate(zip(KINDS, (request.noisy_spp, target_spp), strict=True))
            }
            found.append(FilmFrame(split, number, shots))
    return found


def _numbers(request: Request) -> tuple[list[int], list[int], list[int]]:
    """Return the frames of the film for training, inside and outside."""
    film = request.animation.frames
    beyond = round(request.arc_s * request.animation.fps / max(request.animation.step, 1))
    inner, outer = (film[:-beyond], film[-beyond:]) if beyond else (film, [])
    both = drawn(inner, request.seed, request.frames + request.test_frames, "frames and test frames")
    far = drawn(outer, request.seed, request.outside_frames, "frames outside, which --arc holds")
    return both[: request.frames], both[request.frames :], far


def drawn(frames: Sequence[int], seed: int, count: int, what: str) -> list[int]:
    """Return `count` different frames, each the one that a time of the sequence falls into.

    A frame that is there already is passed over. Raises InputError where there are not so many.
    """
    if count > len(frames):
        rule = f"the animation has {len(frames)} frames for them"
        raise InputError(f"number of {what}", count, rule, "use fewer, or a longer animation")
    places = (int(time) for time in times(seed, 0.0, float(len(frames)), 0, DRAWS * len(frames)))
    order = dict.fromkeys(min(place, len(frames) - 1) for place in places) if count else {}
    return [frames[place] for place in [*order, *(k for k in range(len(frames)) if k not in order)][:count]]


def _check(request: Request) -> None:
    """Refuse numbers that mean nothing."""
    least = {"frames": 1, "test_frames": 0, "outside_frames": 0, "noisy_spp": 1, "spp": 1, "test_spp": 0}
    for name, low in {**least, "percent": 1, "seed": 0}.items():
        value = getattr(request, name)
        if value < low:
            raise InputError(name, value, f"must be {low} or more", "choose another number")
    if not 0.0 <= request.arc_s < len(request.animation.frames) / request.animation.fps:
        rule = "training leaves it out of the animation: it must be 0 or more and shorter"
        raise InputError("arc_s", request.arc_s, rule, "use a shorter --arc")
    if max(request.size) > LARGEST_SIDE:
        rule = f"at most {LARGEST_SIDE} pixels along a side"
        raise InputError("width and height", request.size, rule, "use a smaller --percent")
    last = request.seed + 2 * (request.frames + request.test_frames + request.outside_frames) - 1
    if last > LARGEST_SEED:
        rule = f"with twice the number of frames it must be at most {LARGEST_SEED}"
        raise InputError("seed", request.seed, rule, "choose a smaller one, 0 or more")
