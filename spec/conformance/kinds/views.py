"""The paths that are cases: scenes and pictures, pixels, settings and counters.

1. The first ones are spread over canonical scenes [`views`]; those through scenes of the vectors' own [`OWN`]
   follow, placed by hand [`placed`], or with large counters and depths in a picture that is not square
   [`others`].
2. Some arrivals are placed too, in the middle of a path [`sent`], [`aimed`].
3. What is placed is in `views.json`, by group. `picks` are the first samples whose choice of a light is at
   most 2^-12 beside a threshold (ENV-4, LTR-3); the first number of `overcast` is 0. `wrong_settings` and
   `no_integers` are refused, each with its clause.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ....refimpl import rng
from ....refimpl.light import scene as scene_module
from ....refimpl.light import scenes, transport
from ....refimpl.light.scene import Scene
from ....refimpl.light.transport import Settings
from .tables import table

SCENES = ("cornell", "glossy", "daylight", "minicubes")
"""Canonical scenes whose paths are cases; each at a time of its own, [`TIME_S`]."""

OWN = {
    "terrace": "lamps under a sky, one seen from behind; surfaces that emit without being lamps; boxes whose "
    "rotations alternate, so that their numbers differ from their order; glass between a lamp and a floor",
    "foundry": "a metal as the first kind of material, a lamp at a grazing angle, a camera that is rolled",
    "yard": "a room seen from outside, whose walls are of several materials and shine; blocks that share a "
    "rotation, channels that reflect nothing, a black ball, a lamp without power among others",
    "mirrors": "single directions only, so that light is never sampled, under a lamp and a sky",
    "plate": "a matte floor under a distant lamp, whose samples hardly differ",
    "bare": "a lamp and nothing else",
    "night": "three lamps under a sky that is black",
    "dark": "lamps without power or colour",
    "lens": "glass as the first of two kinds of material",
    "pane": "glass as the second one, under a sky whose light sums up to less than 1",
    "bubble": "glass by itself",
    "glow": "no lamp and no sky, and a surface of each kind and material that emits",
    "dusk": "the same with a lamp in it",
    "lamp": "a scene without a material",
    "overcast": "a sky without a sun, by a lamp without power",
    "sheet": "a turned sheet through the origin: 0.8 * 4.02 - 0.6 * 5.36 is 0, and -4.4e-16 with rounded "
    "products; a ray along it leaves it after 3.2, since a component is at least 1e-15 (ISC-5)",
    "deep": "a floor under a lamp a thousand units out along each axis, at negative coordinates: a point "
    "there is lifted in proportion to its magnitude, by 64 2^-24 2,000 = 0.0076 (LTR-3)",
    "twins": "two equal boxes, balls and quads at one place: equal in their distances to the bit",
    "rail": "a dim lamp beside a matte floor and a quad of metal, whose kind is the last one (SHD-1)",
}
"""Scenes of the vectors' own, with what the canonical ones lack: files that are kept as they are."""

FOLDER = Path(__file__).resolve().parents[2] / "vectors"
"""The vectors, with those scenes in a folder of theirs."""

TIME_S = 1.25
"""Time of the canonical scenes in their animation."""

SIZE_PX = 16
"""Width and height of the images that the paths belong to."""

SEED = 20
"""Seed of their random numbers."""


@cache
def scene_text(name: str) -> str:
    """Return the JSON of a scene of these cases."""
    if name in OWN:
        return (FOLDER / scene_file(name)).read_text(encoding="utf-8")
    return scene_module.to_json(scenes.canonical(name, time=TIME_S))


@cache
def scene(name: str) -> Scene:
    """Return a scene of these cases."""
    return scene_module.from_json(scene_text(name))


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
    x: int = 0
    y: int = 0
    sample: int = 0
    clause: str = ""
    width: int = SIZE_PX
    height: int = SIZE_PX
    seed: int = SEED
    depth: int = 0
    steps: int = 3

    def inputs(self) -> dict[str, Any]:
        """Return the inputs of the first step."""
        numbers = {name: getattr(self, name) for name in ("width", "height", "x", "y", "seed", "sample")}
        return {"scene": {"file": scene_file(self.scene)}, "settings": asdict(self.settings), **numbers}


PLACED = table("views")
"""What is placed by hand."""

VARIANTS, OTHER_SETTINGS = (
    tuple(Settings(**row) for row in PLACED[name]) for name in ("variants", "other_variants")
)
"""Settings of the cases, in turn; and of the paths through the yard and over mirrors."""

WIDE_PX = (40, 24)
"""Width and height of the pictures that those paths belong to."""

IN_TURN = ("yard", "terrace", "yard", "mirrors", "yard", "bare", "night", "dark")
"""Scenes of those paths, in turn."""


def views(count: int) -> Iterator[View]:
    """Yield paths spread over scenes, settings and pixels."""
    for index in range(count):
        words = rng.random_block(rng.counter(SEED), rng.counter(index), rng.counter(0), rng.counter(0))
        x, y = (int(word[0]) % SIZE_PX for word in words[:2])
        name = SCENES[index % len(SCENES)]
        yield View(name, VARIANTS[index // len(SCENES) % len(VARIANTS)], x, y, index % 3)


def placed(*groups: str) -> Iterator[View]:
    """Yield the paths of groups, as they are placed."""
    for group in groups:
        for name, variant, *numbers in PLACED[group]:
            more = numbers.pop() if isinstance(numbers[-1], dict) else {}
            yield View(name, VARIANTS[variant], *numbers, **more)


def others() -> Iterator[View]:
    """Yield paths with any counters, also large ones, and up to six scatterings."""
    for index in range(46):
        words = rng.random_block(rng.counter(SEED), rng.counter(index), rng.counter(1), rng.counter(0))
        place, height, seed, sample = (int(word[0]) for word in words)
        depth = (0, 0, 3, 1 << 16, (1 << 31) - 3)[index // 2 % 5]
        settings = OTHER_SETTINGS[index % len(OTHER_SETTINGS)]
        x, y = place % WIDE_PX[0], height % WIDE_PX[1]
        yield View(IN_TURN[index % len(IN_TURN)], settings, x, y, sample, "", *WIDE_PX, seed, depth, 6)


# ---- arrivals ---------------------------------------------------------------------------------------------

Arrival = tuple[View, dict[str, Any], str]
"""A view, the inputs of an arrival, and a note."""

PDFS = (0.5, float(np.float32(transport.CAMERA_PDF)))
"""Densities of rays to lamps: of a direction that a light sample may have, and of a single one."""


def sent() -> Iterator[Arrival]:
    """Yield arrivals at a lamp and at the sky, by scene and settings, and at the back of a lamp."""
    for name, variant, direction in PLACED["sent"]:
        view = View(name, VARIANTS[variant])
        yield view, midway(view, PLACED["origins"][name], direction), ""


def aimed() -> Iterator[Arrival]:
    """Yield arrivals from given places towards others: at what shines, and at lamps from both sides."""
    some = [
        *(("glow", start, end, f"{note}, no lamp") for note, start, end in PLACED["shining"]),
        *(("dusk", start, end, f"{note}, beside a lamp") for note, start, end in PLACED["shining"][::3]),
        *((name, start, end, "what a light sample may have found") for name, start, end in PLACED["lamplit"]),
    ]
    for index, (name, start, end, note) in enumerate(some):
        lamp = note.startswith("what") and name in ("mirrors", "dusk")
        for settings in VARIANTS if lamp else (VARIANTS[index % 2], VARIANTS[3]):
            for pdf in PDFS if lamp else PDFS[:1]:
                view = View(name, settings)
                inputs = midway(view, start, towards(start, end)) | {"pdf": pdf}
                yield view, inputs, f"{note}, {settings.strategy}, {settings.heuristic}"


def towards(start: Any, end: Any) -> Any:
    """Return the unit direction from a place to another."""
    way = np.subtract(end, start)
    return way / np.linalg.norm(way)


def midway(view: View, origin: Any, direction: Any) -> dict[str, Any]:
    """Return the inputs of an arrival in the middle of a path that a surface has sent in a direction."""
    state = {
        "origin": origin,
        "direction": direction,
        "beta": (0.5, 0.25, 0.75),
        "radiance": (0.125, 0.0625, 0.5),
        "pdf": 0.3125,
    }
    kept = {name: view.inputs()[name] for name in ("scene", "settings")}
    return {**kept, **{name: rounded(np.array(value, np.float64)) for name, value in state.items()}}


def rounded(value: Any) -> Any:
    """Return numbers rounded to float32, in float64."""
    if np.asarray(value).dtype.kind == "f":
        return np.asarray(value, np.float32).astype(np.float64)
    return value
