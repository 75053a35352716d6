"""Kinds of paths: one step of a path from its state to the next, and whole paths with every vertex.

1. A step is a function of a state: from the camera [`start`], to the next surface [`arrive`], and away from
   it [`scatter`]. Its bound is the range of what single precision may give at that state
   (compiler/proof/ranges.py).
2. A whole path is the steps one after another, each from the range of the one before: the bound grows from
   vertex to vertex. A case ends before the first vertex of which a decision is not sure [`followed`].
"""

from __future__ import annotations

import json
from collections import ChainMap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from ....compiler.core.loops import STATEMENTS
from ....compiler.proof import ranges
from ....compiler.proof.ranges import Range
from ....compiler.scenes.lower_scene import LIT, PATH, SURFACE, PathPrograms, Values, kinds, lower_scene
from ....refimpl import rng
from ....refimpl.light import camera, render, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.intersection import Hit, materials_by_id, reflecting
from ....refimpl.light.materials import Dielectric
from ....refimpl.light.transport import Counters, Path, Settings
from ....refimpl.reading import to_dataclass
from ..case import Case, Output
from ..functions import SOURCE
from ..numbers import Decimal
from .tables import kind
from .views import (
    PLACED,
    SEED,
    VARIANTS,
    View,
    aimed,
    files,
    midway,
    others,
    placed,
    rounded,
    scene,
    scene_text,
    sent,
    towards,
    views,
)

LARGEST_BOUND = 0.01
"""Whole paths end where the point of a vertex has a larger bound, in scene units."""

MOST_VERTICES = 5
"""Most vertices of a whole path."""

CHAIN = "ranges of single precision under profile ieee, from step to step (compiler/proof/ranges.py)"
"""Where the bounds of whole paths come from."""

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
    read, settings = scene_module.from_json(text), settings_of(json.loads(settings_text))
    return World(transport.build(read, settings, np.float64), camera.camera_basis(read.camera, np.float64))


def programs_of(name: str, settings: Settings, shadow_rays: int = 0) -> PathPrograms:
    """Return the programs of a path; they do not depend on the greatest depth."""
    return _programs(name, replace(settings, max_depth=0), shadow_rays)


@cache
def _programs(name: str, settings: Settings, shadow_rays: int) -> PathPrograms:
    """Return the programs of a path through a canonical scene, made once."""
    return lower_scene(scene(name), settings, STATEMENTS, shadow_rays=shadow_rays)


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


def shadow(inputs: Mapping[str, Any]) -> State:
    """Return what a shadow ray adds to the layer `direct`."""
    world, of_surface = world_of(inputs["scene"], inputs["settings"]).world, _lanes(SURFACE, inputs)
    surface = reflecting(*(of_surface[name] for name in ("point", "normal", "reflectance")))
    hit = Hit(of_surface["t"], of_surface["surface"])
    numbers = int(inputs["shadow_rays"]), rng.counter(int(inputs["shadow_number"]))
    return {"direct": transport.direct(world, surface, hit, _counters(inputs), *numbers)[0]}


ARRIVED = ("t", "surface", "point", "normal", "reflectance")
"""The outputs of an arrival before its light, in the order in which they are looked at."""


# ---- bounds ---------------------------------------------------------------------------------------------


def _flat(inputs: Mapping[str, Any], values: Values) -> dict[str, Any]:
    """Return the components of a state by name, each (1,)."""
    found = {}
    for name, (ends, dtype) in values.items():
        parts = np.asarray(inputs[name]).reshape(len(ends))
        for end, part in zip(ends, parts, strict=True):
            found[name + end] = np.array([part]).astype(dtype)
    return found


def _counted(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the counters by the names of programs."""
    same = ("seed", "pixel", "x", "y", "depth", "shadow_number")
    own = {"sample_number": "sample", **{name: name for name in same}}
    found = {name: rng.counter(int(inputs[key])) for name, key in own.items() if key in inputs}
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


def _clauses(name: str, view: View, inputs: Mapping[str, Any], wanted: State) -> dict[str, str]:
    """Return the clauses of a case's outputs where they are not the case's own."""
    found = {**CLAUSES.get(name, {}), **({"radiance": "SHD-4"} if view.scene == "mirrors" else {})}
    if name != "path.scatter":
        return found
    seen = scene(view.scene)
    if seen.lights and seen.environment is not None and view.scene != "mirrors":
        found |= {"radiance": "ENV-4"}
    materials = materials_by_id(seen)
    number = int(inputs["surface"])
    if number < len(materials) and isinstance(materials[number][0], Dielectric):
        found |= OF_GLASS
        if float(np.dot(wanted.get("direction", inputs["normal"]), inputs["normal"])) < 0.0:
            found |= {"origin": "DIE-4"}
    return {**found, **(WITH_ROULETTE if inputs["settings"]["roulette_depth"] is not None else {})}


EQUAL = "range of single precision with decisions as the reference takes them: twins are equal to the bit"
"""Where the bounds of rays to two equal shapes come from."""

NEAR = 2.0**-14
"""Largest bound of a ray to twins: a wrong decision would move a number by a quarter at least."""


def _expected(
    wanted: State, found: Mapping[str, Range], clauses: Mapping[str, str], guided: bool
) -> dict[str, Output] | None:
    """Return outputs with bounds, or nothing where a decision is not sure; `guided`: twins decide nothing."""
    outputs = {}
    for name, value in wanted.items():
        clause = clauses.get(name, "")
        if name == "pixel":
            outputs[name] = Output(value, clause=clause)
            continue
        ends, form = {**PATH, **SURFACE, **LIT, "alive": (("",), "bool")}[name]
        low, high, sure = _ends(found, name, ends)
        if not sure and not guided:
            return None
        if form in ("bool", "int32"):
            outputs[name] = Output(bool(value) if form == "bool" else int(value), clause=clause)
            continue
        low, high = (end.reshape(np.shape(value)) for end in (low, high))
        bound = np.maximum(high - value, value - low)
        assert not guided or np.max(bound) <= NEAR, name
        outputs[name] = Output(value, bound, EQUAL if guided else SOURCE, clause=clause)
    return outputs


# ---- cases ----------------------------------------------------------------------------------------------

Cases = dict[str, list[Case]]
"""Cases of steps, by kind."""


def step(
    cases: Cases,
    name: str,
    view: View,
    inputs: Mapping[str, Any],
    of_light: str | None = None,
    note: str = "",
    clause: str = "",
    guided: bool = False,
) -> State:
    """Append a case of a step, unless a decision of it is not sure, and return what the reference answers.

    Its light, and its end, may have a clause of its own; that of an arrival is found if none is stated.
    """
    answer, own_clause = STEPS[name]
    wanted = answer({**inputs, "scene": scene_text(view.scene)})
    programs = programs_of(view.scene, view.settings, inputs.get("shadow_rays", 0))
    program = programs.parts[name.removeprefix("path.")]
    states = [_flat(inputs, values) for values in (PATH, SURFACE) if values.keys() <= inputs.keys()]
    found = ranges.evaluate(program, dict(ChainMap(*states, _counted(inputs))), guided=guided)
    if of_light is None:
        of_light = _of_emission(view, inputs["direction"], wanted) if name == "path.arrive" else ""
    own = ("radiance",) if wanted.get("alive", True) else ("alive", "radiance")
    clauses = _clauses(name, view, inputs, wanted) | (dict.fromkeys(own, of_light) if of_light else {})
    expected = _expected(wanted, found, clauses, guided)
    if expected is not None:
        note = note or f"{inputs['settings']['strategy']}, {inputs['settings']['sampler']}"
        cases.setdefault(name, []).append(Case(clause or own_clause, dict(inputs), expected, note, "LTR-8"))
    return wanted


STEPS = {
    "path.start": (start, "CAM-3"),
    "path.arrive": (arrive, "LTR-2"),
    "path.scatter": (scatter, "LTR-7"),
    "path.shadow": (shadow, "LTR-12"),
}
"""Function and clause of each step."""


@cache
def _steps() -> Cases:
    """Return the cases of all steps: paths in float64 whose states are rounded to float32 at each step."""
    cases: Cases = {}
    for view in (*views(16), *placed("terrace", "foundry"), *others(), *placed("glass", "tall", "picks")):
        walk(cases, view)
    for view, inputs, note in (*sent(), *aimed()):
        step(cases, "path.arrive", view, inputs, note=note)
    _refuse(cases, "wrong_settings")
    for view in placed("overcast"):
        walk(cases, view)
    _refuse(cases, "no_integers")
    _decide(cases)
    _shade(cases)
    return cases


def _shade(cases: Cases) -> None:
    """Add shadow rays from the surfaces of scatterings; counts and numbers of rays in turn."""
    settings = asdict(Settings())
    for index, case in enumerate(cases["path.scatter"]):
        name = case.inputs["scene"]["file"].removeprefix("scenes/").removesuffix(".json")
        if name not in SHADED:
            continue
        kept = {key: case.inputs[key] for key in ("scene", "seed", "sample", "pixel", *SURFACE)}
        rays = (1, 4, 64)[index % 3]
        numbers = {"settings": settings, "shadow_rays": rays, "shadow_number": 5 * index % rays}
        step(cases, "path.shadow", View(name, Settings()), {**kept, **numbers}, note=f"{name}, {rays} rays")


SHADED = ("terrace", "foundry", "minicubes", "cornell", "daylight", "vitrine")
"""Scenes of shadow rays: of several lamps, of one, of none, of lamps next to blocks and spheres."""


def _decide(cases: Cases) -> None:
    """Add steps that decide what others leave open: each kills changes of a program that survived.

    The largest counts that there are; two equal shapes at once, of which the one of the lower number counts
    (SCN-2); a block that shines, which no light sample finds; light samples a thousand units out, where a
    lamp's point is lifted by its magnitude; a lamp and its floor; a choice of a light at its threshold.
    """
    most = transport.LARGEST_DEPTH - 1
    view = View("foundry", Settings(max_depth=most, roulette_depth=most), 3, 8)
    step(cases, "path.start", view, view.inputs(), note=f"both depths {most}", clause="LTR-8")
    view = View("twins", VARIANTS[0])
    for shapes, origin, direction in PLACED["twins"]:
        note = f"two equal {shapes}: the first counts"
        inputs = midway(view, origin, direction)
        step(cases, "path.arrive", view, inputs, "", note, clause="ISC-1", guided=True)
    start, end = (1.375, 1.5, 1.5), (1.4375, 0.375, -0.25)
    for settings in VARIANTS[:2]:
        view, note = View("terrace", settings), f"a block that shines under a sky, {settings.strategy}"
        step(cases, "path.arrive", view, midway(view, start, towards(start, end)), "LTR-10", note)
    for note, clause, name, direction, point, normal, reflectance, t, surface, sample in PLACED["scattered"]:
        view = View(name, VARIANTS[0])
        numbers = {"point": point, "normal": normal, "reflectance": reflectance, "t": float(t)}
        inputs = {
            **midway(view, np.subtract(point, np.multiply(t, direction)), direction),
            "seed": SEED,
            "pixel": 0,
            "sample": sample,
            "depth": 0,
            **{name: rounded(np.array(value, np.float64)) for name, value in numbers.items()},
            "surface": surface,
        }
        step(cases, "path.scatter", view, inputs, clause, note)
    for view in placed("tie"):
        tied: Cases = {}
        walk(tied, view)
        cases["path.scatter"] += tied["path.scatter"]


def _refuse(cases: Cases, group: str) -> None:
    """Add settings that are refused: clause, name and value."""
    given = next(placed("foundry")).inputs()
    for clause, name, value in PLACED[group]:
        number = Decimal(value) if group == "no_integers" and isinstance(value, float) else value
        inputs = {**given, "settings": {**given["settings"], name: number}}
        cases["path.start"].append(Case(clause, inputs, None, f"{name} = {value}"))


def walk(cases: Cases, view: View) -> None:
    """Add the steps of a path, each from the state that the step before has left."""
    given = view.inputs()
    wanted = step(cases, "path.start", view, given)
    kept = {name: given[name] for name in ("scene", "settings")}
    counters = {"seed": view.seed, "pixel": wanted.pop("pixel"), "sample": view.sample}
    state: dict[str, Any] = {**wanted, **AT_CAMERA}
    for depth in range(view.depth, view.depth + view.steps):
        state = {name: rounded(state[name]) for name in PATH}
        wanted = step(cases, "path.arrive", view, {**kept, **state})
        surface = {name: rounded(wanted[name]) for name in SURFACE}
        state |= {"radiance": rounded(wanted["radiance"])}
        inputs = {**kept, **counters, "depth": depth, **state, **surface}
        wanted = step(cases, "path.scatter", view, inputs, view.clause * (depth == view.depth))
        if not wanted["alive"]:
            break
        state = wanted


AT_CAMERA = {"beta": np.ones(3), "radiance": np.zeros(3), "pdf": transport.CAMERA_PDF}
"""What a path has gathered at the camera."""


def _of_emission(view: View, direction: Any, wanted: State) -> str:
    """Return the clause of the light of an arrival, "" for that of the case.

    A lamp is black behind, other quads are not; where no light is sampled, all weights are 1, as
    those of other surfaces."""
    world = world_of(scene_text(view.scene), asdict(view.settings)).world
    lamp = int(world.geometry.light[int(wanted["surface"])])
    if lamp < 0 and int(wanted["surface"]) < world.geometry.nothing:
        seen = scene(view.scene)
        quad = int(wanted["surface"]) - (world.geometry.nothing - len(seen.lights) - len(seen.quads))
        return "QUA-1" if quad >= 0 and any(seen.quads[quad].emission) else ""
    if lamp >= 0 and world.lights is not None and float(world.lights.normal[lamp] @ direction) > 0.0:
        return "ISC-14"
    if world.samples_lights:
        return "ENV-4" if world.lights is not None and world.environment is not None else ""
    return "SHD-4" if world.materials.single else "LTR-10"


# ---- whole paths ----------------------------------------------------------------------------------------

VERTEX = ("t", "surface", "point", "normal", "reflectance", "beta", "radiance")
"""The outputs of each vertex: the surface, and beta and radiance on arrival."""


def whole(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return every vertex of a path: each output with the vertices on its first axis."""
    counters = {name: inputs[name] for name in ("scene", "settings", "seed", "sample")}
    state: dict[str, Any] = {**start(inputs), **AT_CAMERA}
    counters["pixel"] = state.pop("pixel")
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


class _Ranges:
    """The ranges of a path, from step to step."""

    def __init__(self, view: View) -> None:
        self.programs = programs_of(view.scene, view.settings)
        self.counters = _counted({**view.inputs(), "pixel": view.x + render.MAX_IMAGE_SIDE_PX * view.y})
        self.state = dict(ranges.evaluate(self.programs.parts["start"], self.counters))

    def arrive(self) -> None:
        """Go on to the next surface."""
        self.state |= ranges.evaluate(self.programs.parts["arrive"], self.state)

    def sure(self, names: Iterable[str]) -> bool:
        """Tell whether all values of these names are sure and finite."""
        return all(np.all(self.state[name].sure & self.state[name].known) for name in names)

    def scatter(self, depth: int) -> Range:
        """Leave the surface, and return whether the path continues."""
        given = {**self.state, **self.counters, "depth": rng.counter(depth)}
        sent = dict(ranges.evaluate(self.programs.parts["scatter"], given))
        alive = sent.pop("alive")
        self.state |= sent
        return alive


def followed(view: View) -> Iterator[tuple[dict[str, Range], bool]]:
    """Yield the ranges of each vertex of a path while all decisions are sure, and whether it surely ends."""
    at = _Ranges(view)
    for depth in range(MOST_VERTICES):
        at.arrive()
        if not at.sure([*kinds(PATH), *kinds(SURFACE)]):
            return
        there = dict(at.state)
        alive = at.scatter(depth)
        yield there, bool(np.all(alive.sure) and not np.any(alive.high))
        if not (np.all(alive.sure) and np.all(alive.low)):
            return


def gathered(view: View) -> tuple[Any, Any] | None:
    """Return the ends (3,) of what a whole path gathers, or None where some decision is not sure."""
    at = _Ranges(view)
    for depth in range(view.settings.max_depth + 1):
        at.arrive()
        if depth == view.settings.max_depth:
            break
        if not at.sure(kinds(SURFACE)):
            return None
        alive = at.scatter(depth)
        if not np.all(alive.sure):
            return None
        if not np.any(alive.high):
            break
    low, high, sure = _ends(at.state, "radiance", PATH["radiance"][0])
    return (low, high) if sure else None


@cache
def _whole_cases() -> list[Case]:
    """Return whole paths."""
    cases: list[Case] = []
    for view in (*views(32), *placed("terrace"), *others()):
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
        wanted = whole({**inputs, "scene": scene_text(view.scene)})
        expected = {}
        for name in VERTEX:
            parts = {**PATH, **SURFACE}[name][0]
            sides = [_ends(state, name, parts)[:2] for state in reach]
            low, high = (np.reshape([side[i] for side in sides], wanted[name].shape) for i in (0, 1))
            bound = np.maximum(high - wanted[name], wanted[name] - low)
            expected[name] = Output(wanted[name], bound if name != "surface" else 0.0, CHAIN)
        note = f"{view.scene}, {len(reach)} vertices"
        cases.append(Case("LTR-8", inputs, expected, note))
    return cases


def _cases(name: str) -> list[Case]:
    """Return the cases of a step."""
    return _steps()[name]


KINDS = (
    *(kind(name, partial(_cases, name), answer, files) for name, (answer, _) in STEPS.items()),
    kind("path.whole", _whole_cases, whole, files),
)
"""The kinds of this module."""
