"""Sets of frames that experiments train and judge on: a scene, what varies, and frames that are truly unseen.

1. A set has a name, a scene and ranges of time, camera and lamps [`SETS`].
2. Training frames, test frames inside of the ranges and outside are the draws of `wamnet dataset`
   [`FrameSet.draws`], and become shots with seeds of their own [`FrameSet.shots`].
3. Before a set is used, what its frames show is compared: frames that are alike are refused [`compared`].

The ranges of `minicubes-page` are those that the model which ships has learned for the web page.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from wamnet.models.data.draws import Draw
from wamnet.models.data.frame_plan import OUTSIDE, TEST, TRAIN, Request, frame_draws
from wamnet.models.data.geometry import Comparison, Shown, compare
from wamnet.refimpl.light.variation import Ranges

from .frames import Shot

DRAW_SEED = 0
"""Seed of the draws of all sets."""

NOISE_SEEDS_APART = 100_000
"""Frames of one seed of noise: that of another one begins so many later."""

WIDE = Ranges(yaw_deg=(-45.0, 45.0), pitch_deg=(-10.0, 10.0), distance=(0.9, 1.15))
"""A camera that a visitor drags around: it stays between the floor and the ceiling, whose lamp has no depth
and is a line of broken pixels from above."""

NARROW = Ranges(yaw_deg=(-24.0, 24.0), pitch_deg=(-8.0, 8.0), distance=(0.9, 1.1))
"""A camera that stays before the scene."""


@dataclass(frozen=True)
class Counts:
    """Numbers of frames: to train on, inside, outside."""

    train: int
    test: int
    outside: int


@dataclass(frozen=True)
class FrameSet:
    """A scene, the ranges of its frames, and how many of them training may have at most.

    `seen`: frames have the layers of what is seen past mirrors and glass. References of tests have `cleaner`
    times as many samples as those of other sets.
    """

    scene: str
    ranges: Ranges
    most: int = 240
    seen: bool = False
    cleaner: int = 1

    def counts(self, train: int, test: int, outside: int) -> Counts:
        """Return the numbers of frames of a set of this size."""
        return Counts(min(train, self.most), test, outside)

    def draws(self, split: str, counts: Counts) -> list[Draw]:
        """Return the draws of a split; those of tests continue the sequence of training."""
        start, end = self.ranges.time_s
        request = Request(
            self.scene,
            start_s=start,
            seconds=end - start,
            frames=counts.train,
            test_frames=counts.test,
            outside_frames=counts.outside,
            seed=DRAW_SEED,
            yaw_deg=self.ranges.yaw_deg,
            pitch_deg=self.ranges.pitch_deg,
            distance=self.ranges.distance,
            saturation=self.ranges.saturation,
            power=self.ranges.power,
        )
        return [draw for kind, draw in frame_draws(request) if kind == split]

    def shots(
        self, split: str, counts: Counts, size: int, rays: int = 0, noise: int = 0, shadow_rays: int = 0
    ) -> list[Shot]:
        """Return the shots of a split with the noise of a seed; features of `rays` rays, 0: the colour's."""
        first = {TRAIN: 0, TEST: counts.train, OUTSIDE: counts.train + counts.test}[split]
        shot = Shot(self.scene, size=size, feature_spp=rays, seen=self.seen, shadow_rays=shadow_rays)
        return [
            replace(
                shot,
                time=draw.time_s,
                variation=draw.variation,
                seed=first + k + NOISE_SEEDS_APART * noise,
            )
            for k, draw in enumerate(self.draws(split, counts))
        ]


def compared(chosen: FrameSet, counts: Counts) -> dict[str, Comparison]:
    """Return how far the nearest training frame is from tests inside and outside; refuse frames alike."""
    shown: dict[str, Sequence[Shown]] = {
        split: [
            Shown(f"{split} {k}", shot.time, shot.build())
            for k, shot in enumerate(chosen.shots(split, counts, 1))
        ]
        for split in (TRAIN, TEST, OUTSIDE)
    }
    train = shown.pop(TRAIN)
    return compare(train, shown)


HARD = ("glossy", "vitrine", "daylight")
"""Scenes with mirrors, metal, glass or a sky. Few paths find the light that glass gathers: with as many
samples as in other sets the noise of references would be an eighth of the error that is to be measured."""

SETS: Mapping[str, FrameSet] = {
    "minicubes": FrameSet("minicubes", NARROW),
    "minicubes-page": FrameSet("minicubes", replace(WIDE, saturation=(0.0, 0.7))),
    "cornell": FrameSet("cornell", NARROW, most=96),
    **{name: FrameSet(name, NARROW, seen=True, cleaner=4) for name in HARD},
}
"""The sets by name."""
