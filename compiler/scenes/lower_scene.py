"""From a scene to the programs of one path: trace the reference's own functions [`lower_scene`].

A path is four pure functions of the reference, each a program; a kernel's skeleton calls them:

1. `start`: pixel and counters -> the path at the camera (refimpl/light/render.py).
2. `arrive`: path -> its next surface and the radiance gathered so far (refimpl/light/transport.py).
3. `look`: the first surface -> the feature layers (refimpl/light/render.py).
4. `scatter`: path, surface, depth and counters -> the path after it, and whether it continues.
5. On request `shadow`: surface, counters and the number of a shadow ray -> its part of the layer `direct`.
6. On request `see`: way, path and surface -> the layers of what is seen past mirrors and glass, and the way
   after it (refimpl/light/following.py). Where nothing is followed it is those of the first [`_first_seen`].
7. On request of both `past`: what a shadow ray adds to the layer `seen_direct`, where the way ends.

Where features are means over more camera rays [`FeatureRays`] there is one more, `ray`: `start` with
another source of random numbers.

Values between them have names [`PATH`, `SURFACE`, `COUNTERS`; values.py]. The scene is constants by then:
what it lacks (a kind of primitive, a second light, a rotation) is in no program. Numbers of it that shall
move are inputs of all [scene_inputs.py].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...refimpl import frame
from ...refimpl.light import following, intersection, render, transport
from ...refimpl.light.intersection import Hit, Surface, reflecting
from ...refimpl.light.scene import Scene, scene_digest
from ...refimpl.light.transport import Counters, Path, Settings, World
from ..core.ir import Program
from ..core.loops import USUAL, Forms
from ..core.passes import pipeline
from .hierarchy import as_statements, planted
from .scene_inputs import Places, SceneInputs, flattened, lay_out
from .values import COUNTER, INTEGER, NUMBER, RGB, TRUTH, XYZ, Given, Values, floats, lowered

PATH: Values = {
    **floats("origin", "direction", ends=XYZ),
    **floats("beta", "radiance", ends=RGB),
    **floats("pdf"),
}
"""State of a path between bounces, as refimpl/light/transport.py: Path."""

SURFACE: Values = {
    **floats("point", "normal", ends=XYZ),
    **floats("reflectance", ends=RGB),
    **floats("t"),
    "surface": (NUMBER, INTEGER),
}
"""What a scattering needs to know of the surface that was hit."""

COUNTERS: Values = dict.fromkeys(("seed", "pixel", "sample_number"), (NUMBER, COUNTER))
"""What names a path's random numbers: Counters of refimpl/light/transport.py (GLSL reserves sample)."""

LAYERS: Values = {
    **floats("albedo", ends=RGB),
    **floats("normal", ends=XYZ),
    **floats("depth"),
    **floats("position", "direction", ends=XYZ),
    **floats("unshadowed", ends=RGB),
}
"""The feature layers of the first hit, as refimpl/light/render.py: first_hit_layers."""

SEEN: Values = {
    **{seen: LAYERS[first] for seen, first in frame.FIRST_HIT.items()},
    **floats("seen_emission", ends=RGB),
}
"""The feature layers past mirrors and glass, as refimpl/light/following.py: see."""

LIT: Values = floats(frame.DIRECT, ends=RGB)
"""The feature layer of shadow rays, as refimpl/light/transport.py: direct."""

SEEN_LIT: Values = floats(frame.SEEN_DIRECT, ends=RGB)
"""The same past mirrors and glass, as refimpl/light/render.py: trace."""

WAY: Values = {"way_going": (NUMBER, TRUTH), **floats("way_length")}
"""State of the way to what is seen, as refimpl/light/following.py: Way."""

DEPTH: Values = {"depth": (NUMBER, COUNTER)}
"""The number of scatterings so far."""

ALIVE: Values = {"alive": (NUMBER, TRUTH)}
"""Whether a path continues."""

MATERIALS = "world.materials."
"""How the paths of the tables of materials begin: if one has an input, any metal may be nearly a mirror."""

PASSES = ("scalarize", "fold_float32", "expand_tables", "fold_float32", "eliminate_dead")
"""What every program of a path goes through: numbers in place of vectors, the bits that float32 gives."""


@dataclass(frozen=True)
class FeatureRays:
    """How many camera rays features are means over, and their source, whose first ray is the first path's."""

    count: int
    sampler: str


@dataclass(frozen=True)
class PathPrograms:
    """The programs of one path in one scene; `alive`, `scatter`'s boolean, says whether it continues.

    `parts` are the programs by name: `see` is there where it was requested, and the path is followed past
    `most_followed` surfaces at most; `ray` starts the features' own `rays`, if any; `shadow` is one of so
    many `shadow_rays` of each camera ray. `inputs` are the names of the scene's numbers that all of them are
    given [scene_inputs.py], `places` where they are in its tables, `values` those of this scene.
    """

    scene: str
    scene_digest: str
    settings: Settings
    parts: Mapping[str, Program]
    inputs: tuple[str, ...] = ()
    places: tuple[Places, ...] = ()
    values: tuple[float, ...] = ()
    most_followed: int = 0
    rays: FeatureRays | None = None
    shadow_rays: int = 0


def lower_scene(
    scene: Scene,
    settings: Settings,
    forms: Forms = USUAL,
    moving: SceneInputs | None = None,
    *,
    keep_places: bool = False,
    seen: bool = False,
    rays: FeatureRays | None = None,
    shadow_rays: int = 0,
) -> PathPrograms:
    """Return the programs of a path through a scene, in float32.

    Primitives are statements each, tables and loops, or a tree, as `forms` and their costs say [forms.py].
    `keep_places`: nodes know the lines of the reference that they came from, for listings. Numbers that are
    `moving` are inputs; such a scene has no tree, whose boxes would have to move. `seen`: `see` too. `rays`
    are the features' own camera rays; `shadow_rays` of each of them, or of the paths', `shadow`'s.
    """
    moving = moving or SceneInputs(settings, ())
    laid, values, statements = _laid_out(scene, settings, forms, moving)
    start = partial(_started, laid, moving)

    def world_of(given: Given) -> World:
        found: World = moving.opened(laid, given)["world"]
        return found

    most = _most_followed(laid["world"], moving)
    numbers = dict.fromkeys(("x", "y", "seed", "sample_number"), (NUMBER, COUNTER))
    ray = {**numbers, **floats("width", "height")}
    begun, toward = {**PATH, "pixel": (NUMBER, COUNTER)}, {"direction": PATH["direction"]}
    rows: dict[str, tuple[Callable[[Given], Given], Values, Values]] = {
        "start": (partial(start, settings.sampler), ray, begun),
        "arrive": (partial(_arrive, world_of), PATH, {"radiance": PATH["radiance"], **SURFACE}),
        "look": (partial(_look, world_of), {**SURFACE, **toward}, LAYERS),
        "scatter": (partial(_scatter, world_of), {**PATH, **SURFACE, **COUNTERS, **DEPTH}, {**PATH, **ALIVE}),
    }
    if shadow_rays:
        number = {"shadow_number": (NUMBER, COUNTER)}
        rows["shadow"] = partial(_shadow, world_of, shadow_rays), {**SURFACE, **COUNTERS, **number}, LIT
    past = {**SEEN, **(SEEN_LIT if shadow_rays else {})}
    if seen and most:
        state = {"beta": PATH["beta"], **toward, **DEPTH, **ALIVE, **WAY}
        rows["see"] = partial(_see, world_of, most), {**SURFACE, **state}, {**past, **WAY}
    elif seen:
        rows["see"] = partial(_first_seen, world_of), {**SURFACE, **toward}, past
    if seen and shadow_rays:
        state = {"beta": PATH["beta"], **DEPTH, **ALIVE, "way_going": WAY["way_going"]} if most else {}
        inputs = {**SURFACE, **COUNTERS, "shadow_number": (NUMBER, COUNTER), **state}
        rows["past"] = partial(_past, world_of, most, shadow_rays), inputs, SEEN_LIT
    if rays:
        rows["ray"] = partial(start, rays.sampler), ray, begun
    options = {"most_unrolled": None if statements else 1, "keep_places": keep_places}
    parts = {
        name: lowered(name, function, {**inputs, **floats(*moving.names)}, outputs, PASSES, **options)
        for name, (function, inputs, outputs) in rows.items()
    }
    parts["scatter"] = _reached(parts["scatter"], parts["arrive"])
    numbers_of_scene = moving.names, moving.places, tuple(map(float, values))
    identity = scene.name, scene_digest(scene), settings
    return PathPrograms(*identity, parts, *numbers_of_scene, most if seen else 0, rays, shadow_rays)


def _reached(scatter: Program, arrive: Program) -> Program:
    """Return the program of a scattering; where no ray ever meets a surface it has nothing but the end.

    What else `arrive` gives as a constant stays an input: compilers see both blocks.
    """
    met = arrive.nodes[dict(arrive.outputs)["surface"]]
    if met.op != "constant":
        return scatter
    nodes = tuple(met if n.op == "input" and n["name"] == "surface" else n for n in scatter.nodes)
    ended = pipeline.run(replace(scatter, nodes=nodes), ("fold_float32", "eliminate_dead"))
    outputs = dict(ended.outputs)
    alive = ended.nodes[outputs["alive"]]
    if alive.op != "constant" or alive["value"]:
        return scatter
    kept = {str(n["name"]): index for index, n in enumerate(ended.nodes) if n.op == "input"}
    outputs |= {name: kept[name] for name in outputs if name in kept}
    return pipeline.run(replace(ended, outputs=tuple(outputs.items())), ("eliminate_dead",))


def _laid_out(
    scene: Scene, settings: Settings, forms: Forms, moving: SceneInputs
) -> tuple[dict[str, Any], Any, bool]:
    """Return the tables, with a tree if it seems to pay, the inputs' values, and if all are statements."""
    laid = lay_out(scene, settings)
    world: World = laid["world"]
    values, statements = moving.read(flattened(laid)), as_statements(world.geometry, forms)
    if forms.trees and not statements and not moving.places:
        laid["world"] = replace(world, geometry=planted(world.geometry, scene))
    return laid, values, statements


def _most_followed(world: World, moving: SceneInputs) -> int:
    """Return past how many surfaces a path is followed at most, whatever the scene's numbers will be."""
    if any(path.startswith(MATERIALS) for places in moving.places for path, _ in places):
        return min(following.MOST_FOLLOWED, world.settings.max_depth)
    return following.most_followed(world)


# ---- the programs' functions, of values by name -----------------------------------------------------------

WorldOf = Callable[[Given], World]
"""From the scene's numbers to the world."""


def _path(given: Given) -> Path:
    """Return the state of a path."""
    return Path(**{name: given[name] for name in PATH})


def _surface(given: Given) -> tuple[Surface, Hit]:
    """Return surface and hit; a scattering asks for neither emission nor light."""
    surface = reflecting(given["point"], given["normal"], given["reflectance"])
    return surface, Hit(given["t"], given["surface"])


def _counters(given: Given) -> Counters:
    """Return a path's counters."""
    return Counters(*(given[name] for name in COUNTERS))


def _started(laid: dict[str, Any], moving: SceneInputs, sampler: str, given: Given) -> Given:
    """Return the path at the camera, with its pixel's counter."""
    # As in refimpl/light/render.py: pixel_counter.
    pixel = given["x"] + np.uint32(render.MAX_IMAGE_SIDE_PX) * given["y"]
    counters = Counters(given["seed"], pixel, given["sample_number"])
    x, y = (given[n].astype(np.float32) for n in "xy")
    basis, size = moving.opened(laid, given)["camera"], (given["width"], given["height"])
    path = render.start(basis, x, y, *size, counters, np.float32, sampler)
    return {**path._asdict(), "pixel": pixel}


def _arrive(world_of: WorldOf, given: Given) -> Given:
    """Return the next surface, and the radiance so far."""
    path, surface, hit = transport.arrive(world_of(given), _path(given))
    return {**surface._asdict(), **hit._asdict(), "radiance": path.radiance}


def _look(world_of: WorldOf, given: Given) -> Given:
    """Return the feature layers of a first surface."""
    return render.first_hit_layers(world_of(given), *_surface(given), given["direction"])


def _scatter(world_of: WorldOf, given: Given) -> Given:
    """Return the path after a surface, and whether it continues."""
    at = world_of(given), _path(given), *_surface(given)
    path, alive = transport.scatter(*at, given["depth"], _counters(given))
    return {**path._asdict(), "alive": alive}


def _shadow(world_of: WorldOf, rays: int, given: Given) -> Given:
    """Return what a shadow ray adds to the layer `direct`."""
    at = world_of(given), *_surface(given), _counters(given)
    return {frame.DIRECT: transport.direct(*at, rays, given["shadow_number"])}


def _past(world_of: WorldOf, most: int, rays: int, given: Given) -> Given:
    """Return what a shadow ray adds to the layer `seen_direct`: at the end of the way to what is seen."""
    world, (surface, hit) = world_of(given), _surface(given)
    light = transport.direct(world, surface, hit, _counters(given), rays, given["shadow_number"])
    if most:
        further = following.followed(world, surface, hit, given["depth"], most)
        ends = given["way_going"] & given["alive"] & ~further
        light = intersection.choose_or_zero(ends, given["beta"] * light)
    return {frame.SEEN_DIRECT: light}


def _emitting(world: World, given: Given) -> tuple[Surface, Hit]:
    """Return surface and hit, with the emission: it is looked up again, as `arrive` hands on only its sum."""
    surface, hit = _surface(given)
    emission = intersection.emission_at(world.geometry, hit, given["direction"])
    return surface._replace(emission=transport.with_sky(world, hit, given["direction"], emission)), hit


def _first_seen(world_of: WorldOf, given: Given) -> Given:
    """Return the layers of what is seen where nothing is followed: those of the first surface."""
    layers = render.first_hit_layers(world_of(given), *_surface(given), given["point"])
    found = {name: layers[of] for name, of in frame.FIRST_HIT.items()}
    emission = _emitting(world_of(given), given)[0].emission
    return {**found, "seen_emission": emission, frame.SEEN_DIRECT: emission}


def _see(world_of: WorldOf, most: int, given: Given) -> Given:
    """Return the layers of what is seen past mirrors and glass, and the way after it."""
    way = following.Way(given["way_going"] & given["alive"], given["way_length"])
    path = Path(*[None] * 5)._replace(beta=given["beta"])  # type: ignore[arg-type]
    world = world_of(given)
    way, layers = following.see(world, way, path, *_emitting(world, given), given["depth"], most)
    layers[frame.SEEN_DIRECT] = layers["seen_emission"]
    return {**layers, "way_going": way.going, "way_length": way.length}
