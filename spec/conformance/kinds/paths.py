"""Kinds of paths: one step of a path from its state to the next, and whole paths with every vertex.

1. A step is a function of a state: from the camera [`start`], to the next surface [`arrive`], and away from
   it [`scatter`]. Its bound is the range of what single precision may give at that state
   (compiler/proof/ranges.py).
2. A whole path is the steps one after another, each from the range of the one before: the bound grows from
   vertex to vertex. A case ends before the first vertex of which a decision is not sure [`followed`].
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ....compiler.core.loops import STATEMENTS
from ....compiler.proof import ranges
from ....compiler.proof.ranges import Range
from ....compiler.scenes.lower_scene import PATH, SURFACE, PathPrograms, Values, kinds, lower_scene
from ....refimpl import rng
from ....refimpl.light import camera, render, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.intersection import Hit, materials_by_id, reflecting
from ....refimpl.light.materials import Dielectric
from ....refimpl.light.transport import Counters, Path, Settings
from ....refimpl.reading import to_dataclass
from ..case import Case, Kind, Output
from ..functions import SOURCE
from ..numbers import Decimal
from .terrace import MIRRORS
from .views import (
    NO_INTEGERS,
    SEED,
    SENT,
    WRONG_SETTINGS,
    View,
    aimed,
    files,
    foundry,
    foundry_settings,
    glass,
    midway,
    others,
    overcast,
    picks,
    rounded,
    scene_text,
    tall,
    terrace,
    views,
)

LARGEST_BOUND = 0.01
"""Whole paths end where the point of a vertex has a larger bound, in scene units."""

MOST_VERTICES = 5
"""Most vertices of a whole path."""

CHAIN = "ranges of single precision under profile ieee, from step to step (compiler/proof/ranges.py)"
"""Where the bounds of whole paths come from."""

SCENE_FIELD = "scene file (SCN-6)"
"""What a scene is, for the page."""

SETTINGS_FIELD = "object: max_depth, roulette_depth (or null), strategy, heuristic, sampler (LTR-6 to LTR-9)"
"""What settings are, for the page."""

State = dict[str, Any]


class World(NamedTuple):
    """A scene in float64, and its camera."""

    world: transport.World
    basis: camera.CameraBasis


def settings_of(data: Mapping[str, Any]) -> Settings:
    """Return settings from JSON."""
    return to_dataclass(Settings, data, "settings")


def world_of(text: str, settings: Mapping[str, Any]) -> World:
    """Return what a scene's text and settings stand for."""
    return _world(text, json.dumps(settings))


@cache
def _world(text: str, settings_text: str) -> World:
    """Return a world, made once."""
    scene, settings = scene_module.from_json(text), settings_of(json.loads(settings_text))
    return World(
        transport.build(scene, settings, np.float64),
        camera.camera_basis(scene.camera, np.float64),
    )


def programs_of(name: str, settings: Settings) -> PathPrograms:
    """Return the programs of a path; they do not depend on the greatest depth."""
    return _programs(name, replace(settings, max_depth=0))


@cache
def _programs(name: str, settings: Settings) -> PathPrograms:
    """Return the programs of a path through a canonical scene, made once."""
    return lower_scene(scene_module.from_json(scene_text(name)), settings, STATEMENTS)


# ---- steps in float64 -----------------------------------------------------------------------------------


def _lanes(values: Values, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a state as arrays with one lane."""
    return {
        name: np.asarray(inputs[name], kind if kind != "float32" else "float64")[np.newaxis]
        for name, (_, kind) in values.items()
    }


def _counters(inputs: Mapping[str, Any]) -> Counters:
    """Return the counters of a path."""
    return Counters(*(rng.counter(int(inputs[name])) for name in ("seed", "pixel", "sample")))


def start(inputs: Mapping[str, Any]) -> State:
    """Return a path at the camera."""
    at = world_of(inputs["scene"], inputs["settings"])
    x, y = (np.array([float(inputs[name])]) for name in ("x", "y"))
    pixel = render.pixel_counter(x.astype(np.int64), y.astype(np.int64))
    counters = Counters(rng.counter(int(inputs["seed"])), pixel, rng.counter(int(inputs["sample"])))
    size = float(inputs["width"]), float(inputs["height"])
    path = render.start(at.basis, x, y, *size, counters, np.float64, at.world.settings.sampler)
    return {"pixel": int(pixel[0]), "origin": path.origin[0], "direction": path.direction[0]}


def arrive(inputs: Mapping[str, Any]) -> State:
    """Return the surface that a path meets, and the light gathered there."""
    at = world_of(inputs["scene"], inputs["settings"])
    path, surface, hit = transport.arrive(at.world, Path(**_lanes(PATH, inputs)))
    found = {**surface._asdict(), **hit._asdict()}
    return {**{name: found[name][0] for name in ARRIVED}, "radiance": path.radiance[0]}


def scatter(inputs: Mapping[str, Any]) -> State:
    """Return how a path leaves a surface; of one that ends, only the light it has gathered."""
    at = world_of(inputs["scene"], inputs["settings"])
    of_surface = _lanes(SURFACE, inputs)
    point, normal, reflectance = (of_surface[name] for name in ("point", "normal", "reflectance"))
    surface = reflecting(point, normal, reflectance)
    hit = Hit(of_surface["t"], of_surface["surface"])
    path = Path(**_lanes(PATH, inputs))
    found, alive = transport.scatter(
        at.world, path, surface, hit, rng.counter(int(inputs["depth"])), _counters(inputs)
    )
    if not alive[0]:
        return {"alive": np.False_, "radiance": found.radiance[0]}
    return {"alive": np.True_, **{name: getattr(found, name)[0] for name in SCATTERED}}


ARRIVED = ("t", "surface", "point", "normal", "reflectance")
"""The outputs of an arrival before its light, in the order in which they are looked at."""


# ---- bounds ---------------------------------------------------------------------------------------------


def _flat(inputs: Mapping[str, Any], values: Values) -> dict[str, Any]:
    """Return the components of a state by name, each (1,)."""
    found = {}
    for name, (ends, kind) in values.items():
        parts = np.asarray(inputs[name]).reshape(len(ends))
        for end, part in zip(ends, parts, strict=True):
            found[name + end] = np.array([part]).astype(kind)
    return found


def _counted(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the counters by the names of programs."""
    names = {
        "seed": "seed",
        "pixel": "pixel",
        "sample_number": "sample",
        "x": "x",
        "y": "y",
        "depth": "depth",
    }
    found = {name: rng.counter(int(inputs[own])) for name, own in names.items() if own in inputs}
    sizes = {name: np.array([inputs[name]], np.float32) for name in ("width", "height") if name in inputs}
    return {**found, **sizes}


def _ends(found: Mapping[str, Range], name: str, ends: tuple[str, ...]) -> tuple[Any, Any, bool]:
    """Return the ends (len(ends),) of a value's range, and whether it is sure and finite."""
    parts = [found[name + end] for end in ends]
    low, high = (
        np.array([np.float64(np.ravel(getattr(p, side))[0]) for p in parts]) for side in ("low", "high")
    )
    return low, high, bool(all(np.all(p.sure & p.known) for p in parts))


CLAUSES: Mapping[str, Mapping[str, str]] = {
    "path.start": {"pixel": "RNG-4"},
    "path.arrive": {
        "point": "ISC-1",
        "normal": "ISC-8",
        "reflectance": "SHD-3",
        "t": "ISC-1",
        "surface": "ISC-1",
    },
    "path.scatter": {"alive": "LTR-8", "origin": "ISC-9", "radiance": "LTR-4"},
}
"""Clauses of outputs where they are not those of the kind."""

OF_GLASS = {"direction": "DIE-1", "beta": "DIE-4", "pdf": "DIE-4"}
"""Clauses of outputs of a scattering at glass."""

SCATTERED = ("direction", "beta", "pdf", "origin", "radiance")
"""The outputs of a scattering, in the order in which they are looked at."""

WITH_ROULETTE = {"alive": "LTR-9", "beta": "LTR-9"}
"""Clauses of outputs of a scattering with Russian roulette."""


def _clauses(kind: str, inputs: Mapping[str, Any], wanted: State) -> Mapping[str, str]:
    """Return the clauses of a case's outputs where they are not the case's own."""
    name = str(inputs["scene"]["file"]).removeprefix("scenes/").removesuffix(".json")
    found = {**CLAUSES[kind], **({"radiance": "SHD-4"} if name == MIRRORS.name else {})}
    if kind != "path.scatter":
        return found
    scene = scene_module.from_json(scene_text(name))
    if scene.lights and scene.environment is not None and name != MIRRORS.name:
        found |= {"radiance": "ENV-4"}
    materials = materials_by_id(scene)
    number = int(inputs["surface"])
    if number < len(materials) and isinstance(materials[number][0], Dielectric):
        found |= OF_GLASS
        if float(np.dot(wanted.get("direction", inputs["normal"]), inputs["normal"])) < 0.0:
            found |= {"origin": "DIE-4"}
    return {**found, **(WITH_ROULETTE if inputs["settings"]["roulette_depth"] is not None else {})}


def _expected(
    wanted: State, found: Mapping[str, Range], clauses: Mapping[str, str]
) -> dict[str, Output] | None:
    """Return outputs with bounds, or nothing where a decision is not sure."""
    outputs = {}
    for name, value in wanted.items():
        if name == "pixel":
            outputs[name] = Output(value, clause=clauses[name])
            continue
        ends, kind = {**PATH, **SURFACE, "alive": (("",), "bool")}[name]
        low, high, sure = _ends(found, name, ends)
        if not sure:
            return None
        if kind in ("bool", "int32"):
            outputs[name] = Output(bool(value) if kind == "bool" else int(value), clause=clauses[name])
            continue
        low, high = (end.reshape(np.shape(value)) for end in (low, high))
        bound = np.maximum(high - value, value - low)
        outputs[name] = Output(value, bound, SOURCE, clause=clauses.get(name, ""))
    return outputs


# ---- cases ----------------------------------------------------------------------------------------------


def _with_scene(inputs: Mapping[str, Any], view: View) -> dict[str, Any]:
    """Return inputs as the reference takes them: the scene's text for its file."""
    return {**inputs, "scene": scene_text(view.scene)}


class Found(NamedTuple):
    """The cases of the three kinds of steps."""

    start: list[Case]
    arrive: list[Case]
    scatter: list[Case]


@cache
def _steps() -> Found:
    """Return the cases of all steps: paths in float64 whose states are rounded to float32 at each step."""
    found = Found([], [], [])
    for view in (*views(16), *terrace(), *foundry(), *others(), *glass(), *tall(), *picks()):
        _walk(found, view)
    _sent_midway(found)
    _refuse(found, WRONG_SETTINGS)
    for view in overcast():
        _walk(found, view)
    _refuse(found, NO_INTEGERS)
    return found


def _refuse(found: Found, settings: Sequence[tuple[str, str, Any]]) -> None:
    """Add settings that are refused: clause, name and value."""
    given = foundry_settings()
    for clause, name, value in settings:
        inputs = {**given, "settings": {**given["settings"], name: value}}
        note = f"{name} = {json.dumps(value)}" if isinstance(value, Decimal) else f"{name} = {value}"
        found.start.append(Case(f"path.start/{len(found.start)}", clause, inputs, None, (), note))


def _walk(found: Found, view: View) -> None:
    """Add the steps of a path, each from the state that the step before has left."""
    given = view.inputs()
    programs = programs_of(view.scene, view.settings)
    wanted = start(_with_scene(given, view))
    _add(
        found.start,
        "path.start",
        "CAM-3",
        given,
        wanted,
        ranges.evaluate(programs.parts["start"], _counted(given)),
    )
    kept = {name: given[name] for name in ("scene", "settings")}
    counters = {"seed": view.seed, "pixel": wanted.pop("pixel"), "sample": view.sample}
    one = np.ones(3)
    state: dict[str, Any] = {**wanted, "beta": one, "radiance": 0.0 * one, "pdf": transport.CAMERA_PDF}
    for depth in range(view.depth, view.depth + view.steps):
        state = {name: rounded(state[name]) for name in PATH}
        wanted = arrive(_with_scene({**kept, **state}, view))
        sent = ranges.evaluate(programs.parts["arrive"], _flat(state, PATH))
        inputs = {**kept, **state}
        of_light = _of_emission(view, state["direction"], wanted)
        _add(found.arrive, "path.arrive", "LTR-2", inputs, wanted, sent, of_light)
        surface = {name: rounded(wanted[name]) for name in SURFACE}
        inputs = {
            **kept,
            **counters,
            "depth": depth,
            **state,
            "radiance": rounded(wanted["radiance"]),
            **surface,
        }
        wanted = scatter(_with_scene(inputs, view))
        flat = {**_flat(inputs, PATH), **_flat(inputs, SURFACE), **_counted(inputs)}
        sent = ranges.evaluate(programs.parts["scatter"], flat)
        _add(
            found.scatter,
            "path.scatter",
            "LTR-7",
            inputs,
            wanted,
            sent,
            view.clause * (depth == view.depth),
        )
        if not wanted["alive"]:
            break
        state = wanted


def _sent_midway(found: Found) -> None:
    """Add arrivals of rays that are sent from inside of a scene."""
    for scene, settings, direction in SENT:
        inputs = midway(scene, settings, direction)
        view = View(scene, settings, 0, 0, 0)
        wanted = arrive(_with_scene(inputs, view))
        reach = ranges.evaluate(programs_of(scene, settings).parts["arrive"], _flat(inputs, PATH))
        of_light = _of_emission(view, inputs["direction"], wanted)
        _add(found.arrive, "path.arrive", "LTR-2", inputs, wanted, reach, of_light)
    for view, inputs, note in aimed():
        wanted = arrive(_with_scene(inputs, view))
        reach = ranges.evaluate(programs_of(view.scene, view.settings).parts["arrive"], _flat(inputs, PATH))
        of_light = _of_emission(view, inputs["direction"], wanted)
        _add(found.arrive, "path.arrive", "LTR-2", inputs, wanted, reach, of_light, note)


def _of_emission(view: View, direction: Any, wanted: State) -> str:
    """Return the clause of the light of an arrival, "" for that of the case.

    A lamp is black behind, other quads are not; where no light is sampled, all weights are 1, as
    those of other surfaces."""
    world = world_of(scene_text(view.scene), asdict(view.settings)).world
    lamp = int(world.geometry.light[int(wanted["surface"])])
    if lamp < 0 and int(wanted["surface"]) < world.geometry.nothing:
        scene = scene_module.from_json(scene_text(view.scene))
        quad = int(wanted["surface"]) - (world.geometry.nothing - len(scene.lights) - len(scene.quads))
        return "QUA-1" if quad >= 0 and any(scene.quads[quad].emission) else ""
    if lamp >= 0 and world.lights is not None and float(world.lights.normal[lamp] @ direction) > 0.0:
        return "ISC-14"
    if world.samples_lights:
        return "ENV-4" if world.lights is not None and world.environment is not None else ""
    return "SHD-4" if world.materials.single else "LTR-10"


def _add(
    cases: list[Case],
    kind: str,
    clause: str,
    inputs: Mapping[str, Any],
    wanted: State,
    found: Mapping[str, Range],
    of_light: str = "",
    note: str = "",
) -> None:
    """Append a case, unless a decision of it is not sure. Its light may have a clause of its own."""
    own = ("radiance",) if wanted.get("alive", True) else ("alive", "radiance")
    clauses = {**_clauses(kind, inputs, wanted), **(dict.fromkeys(own, of_light) if of_light else {})}
    expected = _expected(wanted, found, clauses)
    if expected is not None:
        note = note or f"{inputs['settings']['strategy']}, {inputs['settings']['sampler']}"
        cases.append(Case(f"{kind}/{len(cases)}", clause, dict(inputs), expected, (), note, "LTR-8"))


# ---- whole paths ----------------------------------------------------------------------------------------

VERTEX = ("t", "surface", "point", "normal", "reflectance", "beta", "radiance")
"""The outputs of each vertex: the surface, and beta and radiance on arrival."""


def whole(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return every vertex of a path: each output with the vertices on its first axis."""
    state: dict[str, Any] = dict(start(inputs))
    counters = {name: inputs[name] for name in ("scene", "settings", "seed", "sample")}
    counters["pixel"] = state.pop("pixel")
    one = np.ones(3)
    state |= {"beta": one, "radiance": 0.0 * one, "pdf": transport.CAMERA_PDF}
    vertices = []
    for depth in range(inputs["settings"]["max_depth"] + 1):
        found = arrive({**counters, **state})
        state["radiance"] = found["radiance"]
        vertices.append({**state, **found})
        if depth == inputs["settings"]["max_depth"]:
            break
        sent: dict[str, Any] = dict(scatter({**counters, **state, **found, "depth": depth}))
        if not sent.pop("alive"):
            break
        state = sent
    return {name: np.array([vertex[name] for vertex in vertices]) for name in VERTEX}


def followed(view: View) -> Iterator[tuple[dict[str, Range], bool]]:
    """Yield the ranges of each vertex of a path while all decisions are sure, and whether it surely ends."""
    given, programs = view.inputs(), programs_of(view.scene, view.settings)
    counters = _counted({**given, "pixel": view.x + render.MAX_IMAGE_SIDE_PX * view.y})
    state = dict(ranges.evaluate(programs.parts["start"], counters))
    for depth in range(MOST_VERTICES):
        state |= ranges.evaluate(programs.parts["arrive"], state)
        if not all(
            np.all(state[name].sure & state[name].known) for name in {**kinds(PATH), **kinds(SURFACE)}
        ):
            return
        sent = dict(
            ranges.evaluate(programs.parts["scatter"], {**state, **counters, "depth": rng.counter(depth)}),
        )
        alive = sent.pop("alive")
        yield dict(state), bool(np.all(alive.sure) and not np.any(alive.high))
        state = {**state, **sent}
        if not (np.all(alive.sure) and np.all(alive.low)):
            return


def gathered(view: View) -> tuple[Any, Any] | None:
    """Return the ends (3,) of what a whole path gathers, or None where some decision is not sure."""
    given, programs = view.inputs(), programs_of(view.scene, view.settings)
    counters = _counted({**given, "pixel": view.x + render.MAX_IMAGE_SIDE_PX * view.y})
    state = dict(ranges.evaluate(programs.parts["start"], counters))
    for depth in range(view.settings.max_depth + 1):
        state |= ranges.evaluate(programs.parts["arrive"], state)
        if depth == view.settings.max_depth:
            break
        if not all(np.all(state[name].sure & state[name].known) for name in kinds(SURFACE)):
            return None
        sent = dict(
            ranges.evaluate(programs.parts["scatter"], {**state, **counters, "depth": rng.counter(depth)}),
        )
        alive = sent.pop("alive")
        state = {**state, **sent}
        if not np.all(alive.sure):
            return None
        if not np.any(alive.high):
            break
    low, high, sure = _ends(state, "radiance", PATH["radiance"][0])
    return (low, high) if sure else None


@cache
def _whole_cases() -> list[Case]:
    """Return whole paths."""
    cases: list[Case] = []
    for view in (*views(32), *terrace(), *others()):
        reach, ends = list[dict[str, Range]](), False
        for state, ends in followed(view):
            low, high, _ = _ends(state, "point", PATH["origin"][0])
            if not np.max(high - low) <= LARGEST_BOUND:
                ends = False
                break
            reach.append(state)
        if len(reach) < (2 if view.seed == SEED else 1):
            continue
        inputs = view.inputs()
        # Paths of the scenes that came first are cut where they are known to end; others end by themselves.
        by_itself = ends and view.seed != SEED and len(reach) > 1
        inputs["settings"]["max_depth"] = len(reach) - 1 + 2 * by_itself
        wanted = whole(_with_scene(inputs, view))
        expected = {}
        for name in VERTEX:
            parts = {**PATH, **SURFACE}[name][0]
            sides = [_ends(state, name, parts)[:2] for state in reach]
            low, high = (np.reshape([side[i] for side in sides], wanted[name].shape) for i in (0, 1))
            bound = np.maximum(high - wanted[name], wanted[name] - low)
            expected[name] = Output(wanted[name], bound if name != "surface" else 0.0, CHAIN)
        note = f"{view.scene}, {len(reach)} vertices"
        cases.append(Case(f"path.whole/{len(cases)}", "LTR-8", inputs, expected, (), note))
    return cases


COUNTED = {"seed": "integer below 2^32", "sample": "integer below 2^32"}
"""Counters, for the page."""

PLACED = {"width": "pixels", "height": "pixels", "x": "column", "y": "row"}
"""A pixel, for the page."""

OF_PATH = {
    "origin": "float[3]",
    "direction": "float[3], unit",
    "beta": "float[3], throughput",
    "radiance": "float[3], gathered so far",
    "pdf": "float, density of the direction, 1/sr; of single directions and at the camera float32(1e30), a "
    "little above 1e30: it says all that the depth does (LTR-2)",
}
"""A state, for the page."""

OF_SURFACE = {
    "point": "float[3]",
    "normal": "float[3]",
    "reflectance": "float[3]",
    "t": "float, distance; 1e30 for none, which a request has as float32(1e30)",
    "surface": "integer, number of the surface (ISC-1)",
}
"""A surface, for the page."""

GIVEN = {"scene": SCENE_FIELD, "settings": SETTINGS_FIELD}
"""What all paths are given, for the page."""

KINDS = (
    Kind(
        "path.start",
        "A path at the camera",
        {**GIVEN, **PLACED, **COUNTED},
        {"pixel": "integer, its counter (RNG-4)", "origin": "float[3]", "direction": "float[3], unit"},
        lambda: _steps().start,
        start,
        files,
    ),
    Kind(
        "path.arrive",
        "The next surface of a path, and the light that it emits",
        {**GIVEN, **OF_PATH},
        {**OF_SURFACE, "radiance": "float[3], after the surface's emission"},
        lambda: _steps().arrive,
        arrive,
        files,
    ),
    Kind(
        "path.scatter",
        "A path leaves a surface: light sample, new direction, roulette",
        {
            **GIVEN,
            **COUNTED,
            "pixel": "integer below 2^32",
            "depth": "scatterings before; who calls compares it with max_depth (LTR-8)",
            **OF_PATH,
            **OF_SURFACE,
        },
        {"alive": "whether it continues; if not, only radiance is required", **OF_PATH},
        lambda: _steps().scatter,
        scatter,
        files,
    ),
    Kind(
        "path.whole",
        "A whole path with every vertex",
        {**GIVEN, **PLACED, **COUNTED},
        {
            "t": "float[V]",
            "surface": "integer[V]",
            **dict.fromkeys(("point", "normal", "reflectance"), "float[V][3]"),
            "beta": "float[V][3], on arrival",
            "radiance": "float[V][3], after the vertex's emission, the last one's too",
        },
        _whole_cases,
        whole,
        files,
    ),
)
"""The kinds of this module."""
