"""Kinds of paths: one step of a path from its state to the next, and whole paths with every vertex.

1. A step is a function of a state: from the camera [`start`], to the next surface [`arrive`], and away from
   it [`scatter`]. Its bound is the range of what single precision may give at that state
   (compiler/proof/ranges.py).
2. A whole path is the steps one after another, each from the range of the one before: the bound grows from
   vertex to vertex [`_Ranges`]. Every decision of a case is sure, or one of twins [`EQUAL`].
"""

from __future__ import annotations

import json
from collections import ChainMap
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ....compiler.core.loops import STATEMENTS
from ....compiler.proof import ranges
from ....compiler.proof.ranges import Range
from ....compiler.scenes.lower_scene import LIT, PATH, SURFACE, PathPrograms, lower_scene
from ....compiler.scenes.values import Values, kinds
from ....refimpl import rng
from ....refimpl.light import camera, render, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.intersection import Hit, reflecting
from ....refimpl.light.transport import Counters, Path, Settings
from ....refimpl.reading import to_dataclass
from ..case import Expect, Output
from ..functions import SOURCE
from .network import STEPS
from .tables import kind

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


def programs_of(scene: str, settings: Mapping[str, Any], shadow_rays: int = 0) -> PathPrograms:
    """Return the programs of a path; they do not depend on the greatest depth."""
    return _programs(scene, replace(settings_of(settings), max_depth=0), shadow_rays)


@cache
def _programs(scene: str, settings: Settings, shadow_rays: int) -> PathPrograms:
    """Return the programs of a path through a scene, made once."""
    return lower_scene(scene_module.from_json(scene), settings, STATEMENTS, shadow_rays=shadow_rays)


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


SCATTERED = ("direction", "beta", "pdf", "origin", "radiance")
"""The outputs of a scattering, in the order in which they are looked at."""

EQUAL = "range of single precision with decisions as the reference takes them: twins are equal to the bit"
"""Where the bounds of rays to two equal shapes come from."""

NEAR = 2.0**-14
"""Largest bound of a ray to twins: a wrong decision would move a number by a quarter at least."""


def _step(name: str) -> Expect:
    """Return what bounds a step: all of its decisions are sure, or of twins, where the file says so."""

    def expect(
        inputs: Mapping[str, Any], wanted: Mapping[str, Any], told: Mapping[str, Any]
    ) -> dict[str, Output]:
        programs = programs_of(inputs["scene"], inputs["settings"], int(inputs.get("shadow_rays", 0)))
        states = [_flat(inputs, values) for values in (PATH, SURFACE) if values.keys() <= inputs.keys()]
        guided = any(output.get("source") == EQUAL for output in told.values())
        given = dict(ChainMap(*states, _counted(inputs)))
        found = ranges.evaluate(programs.parts[name], given, guided=guided)
        return {key: _bounded(key, value, found, guided) for key, value in wanted.items()}

    return expect


def _bounded(name: str, value: Any, found: Mapping[str, Range], guided: bool) -> Output:
    """Return an output of a step with its bound; `guided`: twins decide nothing."""
    if name == "pixel":
        return Output(value)
    ends, form = {**PATH, **SURFACE, **LIT, "alive": (("",), "bool")}[name]
    low, high, sure = _ends(found, name, ends)
    assert sure or guided, f"a decision about {name} is not sure"
    if form in ("bool", "int32"):
        return Output(bool(value) if form == "bool" else int(value))
    low, high = (end.reshape(np.shape(value)) for end in (low, high))
    bound = np.maximum(high - value, value - low)
    assert not guided or np.max(bound) <= NEAR, name
    return Output(value, bound, EQUAL if guided else SOURCE)


AT_CAMERA = {"beta": np.ones(3), "radiance": np.zeros(3), "pdf": transport.CAMERA_PDF}
"""What a path has gathered at the camera."""


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

    def __init__(self, inputs: Mapping[str, Any]) -> None:
        self.programs = programs_of(inputs["scene"], inputs["settings"])
        pixel = inputs["x"] + render.MAX_IMAGE_SIDE_PX * inputs["y"]
        self.counters = _counted({**inputs, "pixel": pixel})
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


def _of_whole(inputs: Mapping[str, Any], wanted: Mapping[str, Any], told: Any) -> dict[str, Output]:
    """Return every vertex with bounds; decisions up to the last one are sure."""
    at, reach, expected, last = _Ranges(inputs), list[dict[str, Range]](), {}, len(wanted["t"]) - 1
    for depth in range(last + 1):
        at.arrive()
        assert at.sure([*kinds(PATH), *kinds(SURFACE)]), f"a decision about vertex {depth} is not sure"
        reach.append(dict(at.state))
        alive = at.scatter(depth)
        assert depth == last or np.all(alive.sure & (alive.low > 0)), f"vertex {depth} may be the last one"
    for name in VERTEX:
        parts = {**PATH, **SURFACE}[name][0]
        sides = [_ends(state, name, parts)[:2] for state in reach]
        low, high = (np.reshape([side[i] for side in sides], wanted[name].shape) for i in (0, 1))
        bound = np.maximum(high - wanted[name], wanted[name] - low)
        expected[name] = Output(wanted[name], bound if name != "surface" else 0.0, STEPS)
    return expected


def gathered(inputs: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the ends (3,) of what a whole path gathers; each of its decisions must be sure."""
    at, most = _Ranges(inputs), inputs["settings"]["max_depth"]
    for depth in range(most + 1):
        at.arrive()
        if depth == most:
            break
        assert at.sure(kinds(SURFACE)), f"a decision about vertex {depth} is not sure"
        alive = at.scatter(depth)
        assert np.all(alive.sure), f"whether vertex {depth} is the last one is not sure"
        if not np.any(alive.high):
            break
    low, high, sure = _ends(at.state, "radiance", PATH["radiance"][0])
    assert sure, "the light is not sure"
    return low, high


KINDS = (
    *(kind(f"path.{step.__name__}", step, _step(step.__name__)) for step in (start, arrive, scatter, shadow)),
    kind("path.whole", whole, _of_whole),
)
"""The kinds of this module."""
