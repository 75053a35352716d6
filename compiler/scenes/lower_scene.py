"""From a scene to the programs of one path: trace the reference's own functions [`lower_scene`].

A path is four pure functions of the reference, each a program; a kernel's skeleton calls them:

1. `start`: pixel and counters -> the path at the camera (refimpl/light/render.py).
2. `arrive`: path -> its next surface and the radiance gathered so far (refimpl/light/transport.py).
3. `look`: the first surface -> the feature layers (refimpl/light/render.py).
4. `scatter`: path, surface, depth and counters -> the path after it, and whether it continues.
5. On request `shadow`: surface, counters and the number of a shadow ray -> its part of the layer `direct`.
6. On request `see`: way, path and surface -> the layers of what is seen past mirrors and glass, and the way
   after it (refimpl/light/following.py). Where nothing is followed it is the first surface's layers [`_see`].

Where features are means over more camera rays [`FeatureRays`] there is a fifth one, `ray`: `start` with
another source of random numbers.

Values between them have names [`PATH`, `SURFACE`, `COUNTERS`]: a vector is three numbers, `origin_x` and so
on. The scene is constants by then: what it lacks (a kind of primitive, a second light, a rotation) is in no
program. Numbers of it that shall move are inputs of all four [scene_inputs.py].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...refimpl import frame, vectors
from ...refimpl.light import following, intersection, render, transport
from ...refimpl.light.intersection import Hit, Surface, reflecting
from ...refimpl.light.scene import Scene, scene_digest
from ...refimpl.light.transport import Counters, Path, Settings, World
from ..core.ir import Program, Type
from ..core.loops import USUAL, Forms
from ..core.passes import pipeline
from ..core.trace import Traced, trace
from ..core.verify import verify
from .forms import as_statements, planted
from .scene_inputs import Places, SceneInputs, flattened, lay_out

XYZ, RGB, NUMBER = ("_x", "_y", "_z"), ("_r", "_g", "_b"), ("",)
"""Endings of the names of a vector's, a colour's and a number's components."""

FLOAT, INTEGER, COUNTER, TRUTH = "float32", "int32", "uint32", "bool"
"""Kinds of numbers of the values between programs."""

Values = Mapping[str, tuple[tuple[str, ...], str]]
"""Values by name: the endings of their components, and their kind of number."""

PATH: Values = {
    "origin": (XYZ, FLOAT),
    "direction": (XYZ, FLOAT),
    "beta": (RGB, FLOAT),
    "radiance": (RGB, FLOAT),
    "pdf": (NUMBER, FLOAT),
}
"""State of a path between bounces, as refimpl/light/transport.py: Path."""

SURFACE: Values = {
    "point": (XYZ, FLOAT),
    "normal": (XYZ, FLOAT),
    "reflectance": (RGB, FLOAT),
    "t": (NUMBER, FLOAT),
    "surface": (NUMBER, INTEGER),
}
"""What a scattering needs to know of the surface that was hit."""

COUNTERS: Values = dict.fromkeys(("seed", "pixel", "sample_number"), (NUMBER, COUNTER))
"""What names a path's random numbers: Counters of refimpl/light/transport.py (GLSL reserves sample)."""

LAYERS: Values = {
    "albedo": (RGB, FLOAT),
    "normal": (XYZ, FLOAT),
    "depth": (NUMBER, FLOAT),
    "position": (XYZ, FLOAT),
    "direction": (XYZ, FLOAT),
    "unshadowed": (RGB, FLOAT),
}
"""The feature layers of the first hit, as refimpl/light/render.py: first_hit_layers."""

SEEN: Values = {
    **{seen: LAYERS[first] for seen, first in frame.FIRST_HIT.items()},
    "seen_emission": (RGB, FLOAT),
}
"""The feature layers past mirrors and glass, as refimpl/light/following.py: see."""

LIT: Values = {frame.DIRECT: (RGB, FLOAT)}
"""The feature layer of shadow rays, as refimpl/light/transport.py: direct."""

SHADOW: Values = {"shadow_number": (NUMBER, COUNTER)}
"""The number of a shadow ray among those of a camera ray."""

WAY: Values = {"way_going": (NUMBER, TRUTH), "way_length": (NUMBER, FLOAT)}
"""State of the way to what is seen, as refimpl/light/following.py: Way."""

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
    world_of = partial(_world, laid, moving)

    def arrive(given: Mapping[str, Any]) -> dict[str, Any]:
        path, surface, hit = transport.arrive(world_of(given), _path(given))
        return {**_taken({"radiance": PATH["radiance"]}, path), **_taken(SURFACE, surface, hit)}

    def look(given: Mapping[str, Any]) -> dict[str, Any]:
        toward = _vector(given, "direction", XYZ)
        return _components(LAYERS, render.first_hit_layers(world_of(given), *_surface(given), toward))

    def scatter(given: Mapping[str, Any]) -> dict[str, Any]:
        surface, hit = _surface(given)
        counters = Counters(*(given[name] for name in COUNTERS))
        path, alive = transport.scatter(world_of(given), _path(given), surface, hit, given["depth"], counters)
        return {**_taken(PATH, path), "alive": alive}

    numbers = dict.fromkeys(("x", "y", "seed", "sample_number"), (NUMBER, COUNTER))
    size, depth = dict.fromkeys(("width", "height"), (NUMBER, FLOAT)), {"depth": (NUMBER, COUNTER)}
    scene_numbers = dict.fromkeys(moving.names, (NUMBER, FLOAT))
    lowered = partial(_lowered, most_unrolled=None if statements else 1, keep_places=keep_places)
    start, started = partial(_started, laid, moving), {**numbers, **size, **scene_numbers}
    arriving = lowered("arrive", arrive, {**PATH, **scene_numbers})
    scattering = lowered("scatter", scatter, {**PATH, **SURFACE, **COUNTERS, **depth, **scene_numbers})
    parts = {
        "start": lowered("start", partial(start, settings.sampler), started),
        "arrive": arriving,
        "look": lowered("look", look, {**SURFACE, "direction": PATH["direction"], **scene_numbers}),
        "scatter": _reached(scattering, arriving),
    }
    most = _most_followed(laid["world"], moving)
    if shadow_rays:
        lit = partial(_shadow, world_of, shadow_rays)
        parts["shadow"] = lowered("shadow", lit, {**SURFACE, **COUNTERS, **SHADOW, **scene_numbers})
    if seen:
        parts["see"] = lowered("see", *_see(world_of, most, scene_numbers))
    if rays:
        parts["ray"] = lowered("ray", partial(start, rays.sampler), started)
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


def _see(
    world_of: Callable[[Mapping[str, Any]], World], most: int, scene_numbers: Values
) -> tuple[Callable[[Mapping[str, Any]], dict[str, Any]], Values]:
    """Return the function that sees, and its inputs; with nothing to follow it has no state."""

    def first(given: Mapping[str, Any]) -> dict[str, Any]:
        layers = render.first_hit_layers(world_of(given), *_surface(given), _vector(given, "point", XYZ))
        found = {name: layers[of] for name, of in frame.FIRST_HIT.items()}
        return _components(SEEN, {**found, "seen_emission": _emitting(world_of(given), given)[0].emission})

    def see(given: Mapping[str, Any]) -> dict[str, Any]:
        way = following.Way(given["way_going"] & given["alive"], given["way_length"])
        path = Path(*[None] * 5)._replace(beta=_vector(given, "beta", RGB))  # type: ignore[arg-type]
        world, depth = world_of(given), given["depth"]
        way, layers = following.see(world, way, path, *_emitting(world, given), depth, most)
        return {**_components(SEEN, layers), "way_going": way.going, "way_length": way.length}

    if not most:
        return first, {**SURFACE, "direction": PATH["direction"], **scene_numbers}
    arrived = {name: PATH[name] for name in ("beta", "direction")}
    state = {"depth": (NUMBER, COUNTER), "alive": (NUMBER, TRUTH)}
    return see, {**SURFACE, **arrived, **state, **WAY, **scene_numbers}


def _shadow(
    world_of: Callable[[Mapping[str, Any]], World], rays: int, given: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what a shadow ray adds to the layer `direct`."""
    counters = Counters(*(given[name] for name in COUNTERS))
    at = world_of(given), *_surface(given), counters
    return _components(LIT, {frame.DIRECT: transport.direct(*at, rays, given["shadow_number"])})


def _started(
    laid: dict[str, Any], moving: SceneInputs, sampler: str, given: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the path at the camera, with its pixel's counter."""
    # As in refimpl/light/render.py: pixel_counter.
    pixel = given["x"] + np.uint32(render.MAX_IMAGE_SIDE_PX) * given["y"]
    counters = Counters(given["seed"], pixel, given["sample_number"])
    x, y = (given[n].astype(np.float32) for n in "xy")
    basis, size = moving.opened(laid, given)["camera"], (given["width"], given["height"])
    path = render.start(basis, x, y, *size, counters, np.float32, sampler)
    return {**_taken(PATH, path), "pixel": pixel}


def _world(laid: dict[str, Any], moving: SceneInputs, given: Mapping[str, Any]) -> World:
    """Return the world, with those of its numbers that are inputs as they are given."""
    world: World = moving.opened(laid, given)["world"]
    return world


def names(values: Values) -> list[str]:
    """Return the names of all components, in order."""
    return [name + end for name, (ends, _) in values.items() for end in ends]


def kinds(values: Values) -> dict[str, str]:
    """Return the kind of number of each component."""
    return {name + end: kind for name, (ends, kind) in values.items() for end in ends}


def _lowered(
    name: str, function: Any, values: Values, most_unrolled: int | None, keep_places: bool
) -> Program:
    """Trace a function of named numbers, and run the passes."""
    inputs = {component: Type(kind) for component, kind in kinds(values).items()}
    program = trace(
        lambda *given: function(dict(zip(inputs, given, strict=True))),
        inputs,
        most_unrolled=most_unrolled,
        keep_places=keep_places,
    )
    return pipeline.run(verify(program, f"traced {name}"), PASSES)


def _vector(given: Mapping[str, Any], name: str, ends: tuple[str, ...]) -> Any:
    """Join a value from its components."""
    parts = [given[name + end] for end in ends]
    return vectors.vector(*parts) if len(parts) > 1 else parts[0]


def _path(given: Mapping[str, Any]) -> Path:
    """Return the state of a path from its components."""
    return Path(**{name: _vector(given, name, ends) for name, (ends, _) in PATH.items()})


def _surface(given: Mapping[str, Any]) -> tuple[Surface, Hit]:
    """Return surface and hit from their components; a scattering asks for neither emission nor light."""
    point, normal, reflectance = (
        _vector(given, name, SURFACE[name][0]) for name in ("point", "normal", "reflectance")
    )
    return reflecting(point, normal, reflectance), Hit(given["t"], given["surface"])


def _emitting(world: World, given: Mapping[str, Any]) -> tuple[Surface, Hit]:
    """Return surface and hit, with the emission: it is looked up again, as `arrive` hands on only its sum."""
    surface, hit = _surface(given)
    direction = _vector(given, "direction", XYZ)
    emission = intersection.emission_at(world.geometry, hit, direction)
    return surface._replace(emission=transport.with_sky(world, hit, direction, emission)), hit


def _taken(values: Values, *tuples: Any) -> dict[str, Traced]:
    """Return the components of the fields named in `values`, each from the first tuple that has it."""
    return {
        component: value
        for name, (ends, _) in values.items()
        for component, value in _split(
            name, ends, next(t._asdict() for t in reversed(tuples) if name in t._fields)
        )
    }


def _components(values: Values, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the components of values by name."""
    return {part: number for name, (ends, _) in values.items() for part, number in _split(name, ends, found)}


def _split(name: str, ends: tuple[str, ...], values: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Return the components of one value by name."""
    whole = values[name]
    return [(name + end, whole[..., i] if len(ends) > 1 else whole) for i, end in enumerate(ends)]
