"""The paths that are cases: scenes and pictures, pixels, settings and counters.

1. The first ones are spread over canonical scenes [`views`]; those through scenes of the vectors' own follow,
   placed by hand [`terrace`], [`foundry`], or with large counters and depths in a picture that is not square
   [`others`].
2. Some arrivals are placed too, in the middle of a path [`SENT`]. Wrong settings are refused
   [`WRONG_SETTINGS`].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ....refimpl import rng
from ....refimpl.light import render, scenes, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.transport import Settings
from ..numbers import Decimal
from .deep import DEEP, RAIL, TWINS
from .terrace import (
    BARE,
    BUBBLE,
    DARK,
    DUSK,
    FOUNDRY,
    GLOW,
    LAMP,
    LENS,
    MIRRORS,
    NIGHT,
    OVERCAST,
    PANE,
    PLATE,
    SHEET,
    TERRACE,
    YARD,
)

SCENES = ("cornell", "glossy", "daylight", "minicubes")
"""Canonical scenes whose paths are cases; each at a time of its own, [`TIME_S`]."""

OWN = {
    scene.name: scene
    for scene in (
        *(TERRACE, FOUNDRY, YARD, MIRRORS, PLATE, BARE, NIGHT, DARK, LENS, PANE, BUBBLE),
        *(GLOW, DUSK, LAMP, OVERCAST, SHEET),
        *(DEEP, TWINS, RAIL),
    )
}
"""Scenes of the vectors' own."""

TIME_S = 1.25
"""Time of the scenes in their animation."""

SIZE_PX = 16
"""Width and height of the images that the paths belong to."""

SEED = 20
"""Seed of their random numbers."""


def scene_text(name: str) -> str:
    """Return the JSON of a scene of these cases."""
    if name in OWN:
        return scene_module.to_json(OWN[name])
    return scene_module.to_json(scenes.canonical(name, time=TIME_S))


def files() -> dict[str, bytes]:
    """Return the scene files."""
    return {scene_file(name): scene_text(name).encode() for name in (*SCENES, *OWN)}


def scene_file(name: str) -> str:
    """Return the name of a scene's file."""
    return f"scenes/{name}.json"


# ---- paths ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class View:
    """A path: its scene and settings, its pixel, its sample.

    `clause` is that of the light gathered at the first vertex, and of the path's end if it ends there, where
    the path is there for it. The first of its `steps` scatterings has the number `depth`."""

    scene: str
    settings: Settings
    x: int
    y: int
    sample: int
    clause: str = ""
    width: int = SIZE_PX
    height: int = SIZE_PX
    seed: int = SEED
    depth: int = 0
    steps: int = 3

    def inputs(self) -> dict[str, Any]:
        """Return the inputs of the first step."""
        return {
            "scene": {"file": scene_file(self.scene)},
            "settings": asdict(self.settings),
            "width": self.width,
            "height": self.height,
            "x": self.x,
            "y": self.y,
            "seed": self.seed,
            "sample": self.sample,
        }


VARIANTS = (
    Settings(),
    Settings(strategy="light", heuristic="balance", sampler="sobol"),
    Settings(roulette_depth=0, heuristic="balance"),
    Settings(strategy="bsdf"),
)
"""Settings of the cases, in turn."""


PLACES = (
    (6, 13, "ENV-4"),  # the floor, half of whose light samples go to the sky
    (2, 5, ""),  # a lamp from behind
    (9, 8, ""),  # a ball of glass
    (6, 3, ""),  # a ball that emits
    (8, 11, "DIE-6"),  # the floor, behind glass as lamps see it
    (12, 8, ""),  # a block that emits
    (5, 9, ""),  # a block of glass
    (11, 2, ""),  # a lamp
    (7, 8, ""),  # rough metal
    (3, 8, ""),  # a matte block
    (1, 6, ""),  # a mirror
    (9, 12, ""),  # the floor
)
"""Columns and rows of pixels of the terrace, and the clause that the light at what is seen there shows."""


FLAT = (
    (8, 9, "SHD-1"),  # a lamp at a grazing angle, where the scene's first kind is a metal
    (3, 8, ""),  # metal
    (0, 0, ""),  # the background
)
"""Columns and rows of pixels of the foundry, and their clauses."""


def terrace() -> Iterator[View]:
    """Yield paths over the terrace."""
    for index, (x, y, clause) in enumerate(PLACES):
        yield View(TERRACE.name, VARIANTS[index % len(VARIANTS)], x, y, index % 3, clause)


def foundry() -> Iterator[View]:
    """Yield paths over the foundry."""
    for x, y, clause in FLAT:
        yield View(FOUNDRY.name, VARIANTS[0], x, y, 0, clause)


OTHER_SETTINGS = (
    Settings(),
    Settings(strategy="light", heuristic="balance", roulette_depth=2),
    Settings(sampler="sobol", roulette_depth=1),
    Settings(strategy="bsdf", roulette_depth=0),
    Settings(heuristic="balance", sampler="sobol"),
)
"""Settings of the paths through the yard and over mirrors, in turn."""

WIDE_PX = (40, 24)
"""Width and height of the pictures that those paths belong to."""

OTHERS = (*range(46),)
"""Numbers of those paths."""


def _other(index: int) -> View:
    """Return a path with any counters, also large ones, and up to six scatterings."""
    words = rng.random_block(rng.counter(SEED), rng.counter(index), rng.counter(1), rng.counter(0))
    place, height, seed, sample = (int(word[0]) for word in words)
    depth = (0, 0, 3, 1 << 16, (1 << 31) - 3)[index // 2 % 5]
    settings = OTHER_SETTINGS[index % len(OTHER_SETTINGS)]
    x, y = place % WIDE_PX[0], height % WIDE_PX[1]
    return View(IN_TURN[index % len(IN_TURN)].name, settings, x, y, sample, "", *WIDE_PX, seed, depth, 6)


IN_TURN = (YARD, TERRACE, YARD, MIRRORS, YARD, BARE, NIGHT, DARK)
"""Scenes of those paths, in turn."""


def others() -> Iterator[View]:
    """Yield the paths through the yard and over mirrors."""
    yield from map(_other, OTHERS)


GLASS = tuple((scene.name, x, y) for scene in (LENS, PANE, BUBBLE) for x, y in ((8, 7), (7, 6), (8, 14)))
"""Scenes with a ball of glass, and pixels that show the ball and what is below it."""

PICKED = {TERRACE.name: (6, 13), NIGHT.name: (8, 13), FOUNDRY.name: (11, 8)}
"""Pixels that show what is lit by several lamps, or by a lamp and the sky."""

BESIDE = (-(2.0**-12), 2.0**-12)
"""How far beside a threshold a path's number is at most: a change by a thousandth is seen."""


def glass() -> Iterator[View]:
    """Yield paths that meet a ball of glass, or what is below it."""
    for index, (scene, x, y) in enumerate(GLASS):
        yield View(scene, VARIANTS[index % 2], x, y, index)


def tall() -> Iterator[View]:
    """Yield paths through pixels whose counters have all 32 bits."""
    for index, scene in enumerate((NIGHT, YARD)):
        yield View(scene.name, VARIANTS[index], 20, 40_000, index, "", 40, 1 << 16, steps=1)


def thresholds(scene: str) -> Iterator[tuple[float, str]]:
    """Yield the numbers at which the choice of a light sample changes, and clauses.

    The choices are sky or lamp, sun or sky, and which lamp."""
    world = transport.build(OWN[scene], Settings(), np.float64)
    assert world.lights is not None
    low = 0.0
    if world.environment is not None:
        low = transport.SKY_SHARE
        sun = low * float(world.environment.sun_share)
        yield from ((number, "ENV-4") for number in (low, sun) if number > 0.0)
    yield from ((low + (1.0 - low) * float(bound), "LTR-3") for bound in world.lights.cumulative[:-1])


def picks() -> Iterator[View]:
    """Yield paths whose first light sample is chosen just beside a threshold."""
    for scene, (x, y) in PICKED.items():
        for number, clause in thresholds(scene):
            for beside in BESIDE:
                low, high = sorted((number + beside, number + beside / 8))
                yield View(scene, VARIANTS[0], x, y, sample_between(low, high, x, y), clause, steps=1)


FIRST_OF_ALL = 5_706_185
"""The first sample of the pixel (8, 12) whose first light number is 0."""


def overcast() -> Iterator[View]:
    """Yield paths whose light is sampled from a sky without a sun: by the number 0, and by others."""
    for sample, variant in ((FIRST_OF_ALL, 0), (0, 0), (1, 1), (2, 2)):
        yield View(
            OVERCAST.name, VARIANTS[variant], 8, 12, sample, "ENV-2" if not variant else "ENV-4", steps=1
        )


def sample_between(low: float, high: float, x: int, y: int) -> int:
    """Return the first sample of a pixel whose number that chooses a light lies between two numbers."""
    samples = np.arange(1 << 16, dtype=np.uint32)
    pixel = render.pixel_counter(np.array(x), np.array(y))
    numbers, *_ = rng.uniforms(rng.counter(SEED), pixel, samples, rng.counter(1), np.float64)
    return int(np.flatnonzero((low < numbers) & (numbers < high))[0])


def views(count: int) -> Iterator[View]:
    """Yield paths spread over scenes, settings and pixels."""
    for index in range(count):
        words = rng.random_block(rng.counter(SEED), rng.counter(index), rng.counter(0), rng.counter(0))
        x, y = (int(word[0]) % SIZE_PX for word in words[:2])
        name = SCENES[index % len(SCENES)]
        yield View(name, VARIANTS[index // len(SCENES) % len(VARIANTS)], x, y, index % 3)


# ---- arrivals ---------------------------------------------------------------------------------------------

SENT = (
    *(
        (scene, settings, direction)
        for scene in (NIGHT.name, TERRACE.name)
        for settings in VARIANTS
        for direction in ((0.0, 1.0, 0.0), (0.6, 0.64, 0.48))
    ),
    *(
        (NIGHT.name, settings, direction)
        for settings in VARIANTS[:2]
        for direction in ((0.63, 0.758, 0.168), (-0.862, 0.304, 0.406))
    ),
    (BARE.name, VARIANTS[0], (0.0, 0.28, 0.96)),
)
"""Directions from a floor to a lamp and to the sky, by scene and settings; then to the second lamp and to the
third, and to the back of a lamp that nothing is beside."""

ORIGINS = {
    TERRACE.name: (0.3125, 0.875, 0.4375),
    NIGHT.name: (0.125, 0.0009765625, 0.25),
    BARE.name: (0.125, -0.25, -2.0),
}
"""Where these directions begin."""


Place = tuple[float, float, float]
"""A place in a scene."""

SHINING: tuple[tuple[str, Place, Place], ...] = (
    ("a wall", (0.0, 0.0, 0.0), (3.0, 1.0, 1.5)),
    ("the ceiling", (0.0, 0.0, 0.0), (1.0, 2.0, 0.5)),
    ("a block", (0.0, 0.0, 0.0), (1.75, 0.0625, 0.125)),
    ("a block of metal", (0.0, 0.0, 0.0), (0.0625, 0.0625, -2.0)),
    ("a block of glass", (0.0, 0.0, 0.0), (-1.5, 0.0625, -1.5)),
    ("a block of glass, from inside", (-1.5, 0.0, -1.5), (-1.25, 0.0625, -0.5)),
    ("a ball", (0.0, 0.0, 0.0), (-2.0, 0.0625, 0.125)),
    ("a ball, from inside", (-2.0, 0.0, 0.125), (-1.0, 0.5, 0.0)),
    ("a ball that is a mirror", (0.0, 0.0, 0.0), (1.5, 0.0625, -1.4375)),
    ("a ball of glass", (0.0, 0.0, 0.0), (0.0625, 0.0625, 2.0)),
    ("a ball of glass, from inside", (0.0, 0.0, 2.0), (1.0, 0.25, 2.5)),
    ("a quad, along edge_u x edge_v", (0.125, 1.5, 0.0), (0.0, 1.0, 0.0625)),
    ("a quad, against edge_u x edge_v", (0.125, 0.25, 0.0), (0.03125, 1.0, 0.0625)),
    ("a quad that is a mirror, along edge_u x edge_v", (0.125, -0.5, 0.0), (0.03125, -1.0, 0.0625)),
    ("a quad that is a mirror, against edge_u x edge_v", (0.125, -1.5, 0.0), (0.03125, -1.0, 0.0625)),
    ("a quad of metal", (0.0, 0.0, 0.0), (1.5, 0.0625, 1.25)),
    ("a quad of metal, from the other side", (2.5, 0.0, 2.5), (1.5, 0.0625, 1.25)),
)
"""What shines in a room beside lamps, with places from which and towards which rays are sent."""

LAMPLIT: tuple[tuple[str, Place, Place], ...] = (
    (MIRRORS.name, (0.0, 0.75, 0.0), (0.125, 2.0, 0.0625)),
    (MIRRORS.name, (0.0, 3.0, 0.0), (0.125, 2.0, 0.0625)),
    (MIRRORS.name, (0.0, 0.75, 0.0), (2.0, 2.0, 3.0)),
    (BUBBLE.name, (2.0, 0.75, 0.0), (3.0, 2.0, 0.0)),
    (DARK.name, (0.0, 0.5, 0.0), (0.125, 1.5, 0.0625)),
    (DARK.name, (0.0, 0.5, 0.0), (3.0, 1.5, 3.0)),
    (DUSK.name, (0.0, 0.0, 0.0), (-0.75, 1.75, 0.25)),
    (DUSK.name, (-0.875, 1.875, 0.0), (-0.75, 1.75, 0.25)),
    (LAMP.name, (0.0, 0.5, 0.0), (0.125, 2.5, 0.0625)),
    (LAMP.name, (0.0, 3.0, 0.0), (0.125, 2.5, 0.0625)),
    (SHEET.name, (0.0, 0.0, 4.0), (0.0, 0.0, 3.0)),
)
"""Rays of scenes to lamps, from both sides, and to what is behind everything: in some no lamp is sampled."""

PDFS = (0.5, float(np.float32(transport.CAMERA_PDF)))
"""Densities of those rays: of a direction that a light sample may have, and of a single one."""


def aimed() -> Iterator[tuple[View, dict[str, Any], str]]:
    """Yield views, inputs and notes of arrivals from given places towards others."""
    some = [
        *((GLOW.name, start, end, f"{note}, no lamp") for note, start, end in SHINING),
        *((DUSK.name, start, end, f"{note}, beside a lamp") for note, start, end in SHINING[::3]),
        *((scene, start, end, "what a light sample may have found") for scene, start, end in LAMPLIT),
    ]
    for index, (scene, start, end, note) in enumerate(some):
        direction = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
        lamp = (scene, start, end) in LAMPLIT and scene in (MIRRORS.name, DUSK.name)
        for settings in VARIANTS if lamp else (VARIANTS[index % 2], VARIANTS[3]):
            for pdf in PDFS if lamp else PDFS[:1]:
                inputs = midway(scene, settings, tuple(direction), start) | {"pdf": pdf}
                told = f"{note}, {settings.strategy}, {settings.heuristic}"
                yield View(scene, settings, 0, 0, 0), inputs, told


def midway(
    scene: str, settings: Settings, direction: tuple[float, ...], origin: Place | None = None
) -> dict[str, Any]:
    """Return the inputs of an arrival in the middle of a path that a surface has sent in a direction."""
    state = {
        "origin": ORIGINS[scene] if origin is None else origin,
        "direction": direction,
        "beta": (0.5, 0.25, 0.75),
        "radiance": (0.125, 0.0625, 0.5),
        "pdf": 0.3125,
    }
    kept = {"scene": {"file": scene_file(scene)}, "settings": asdict(settings)}
    return {**kept, **{name: rounded(np.array(value)) for name, value in state.items()}}


def foundry_settings() -> dict[str, Any]:
    """Return the inputs of a path whose settings are about to be wrong."""
    return next(foundry()).inputs()


WRONG_SETTINGS: tuple[tuple[str, str, Any], ...] = (
    ("LTR-8", "max_depth", -1),
    ("LTR-8", "max_depth", 1 << 31),
    ("LTR-8", "roulette_depth", -1),
    ("LTR-8", "roulette_depth", 1 << 31),
    ("LTR-6", "strategy", "MIS"),
    ("LTR-5", "heuristic", "cutoff"),
    ("LTR-8", "sampler", "halton"),
    ("LTR-8", "roulette_depth", 1.5),
)
"""Settings that are refused, with their clauses."""

NO_INTEGERS: tuple[tuple[str, str, Any], ...] = (
    ("LTR-9", "roulette_depth", Decimal(1.5)),
    ("LTR-9", "roulette_depth", Decimal(1.0)),
    ("LTR-9", "roulette_depth", True),
    ("LTR-8", "max_depth", Decimal(2.0)),
    ("LTR-8", "max_depth", "2"),
    ("LTR-8", "max_depth", None),
)
"""Counts that JSON does not write as integers: they are refused too."""


def rounded(value: Any) -> Any:
    """Return numbers rounded to float32, in float64."""
    if np.asarray(value).dtype.kind == "f":
        return np.asarray(value, np.float32).astype(np.float64)
    return value
