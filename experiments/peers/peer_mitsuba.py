"""Mitsuba 3 as a peer of the renderer: the same picture from another renderer.

1. [`open_mitsuba`] imports Mitsuba in one of its variants and adds the sensor of step 4.
2. [`export`] turns a scene into Mitsuba's dictionary, shape by shape, with the materials and the sky of
   mitsuba_looks.py; [`check`] refuses what has no counterpart.
3. Transport is Mitsuba's integrator `path`: light samples and BSDF samples combined by the power heuristic,
   as in refimpl/light/transport.py, without Russian roulette. It counts edges of a path where wamnet counts
   scatterings: `max_depth` is one more. Reflectances and radiances are taken as they are (linear RGB).
4. A room's wall is only there for rays that leave through it; Mitsuba's walls are there for all. Within a
   room that holds everything, both are the same for all rays but those of a camera outside. The sensor of
   [`_sensor_class`] moves their origins to where they enter the room; all else is Mitsuba's own pinhole
   camera. No surface is added and no path gets longer, so that the peer's speed is its own.
5. [`render`] gives the mean colours as wamnet's frames have them: rows from the top, one-pixel box filter.

Mitsuba: Jakob et al., "Mitsuba 3 renderer", https://mitsuba-renderer.org, its documentation of plugins.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light.materials import Material
from wamnet.refimpl.light.scene import Box, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.shapes.quad import light_radiance
from wamnet.refimpl.light.transport import Settings
from wamnet_verify.parts import room_walls

from . import mitsuba_looks as looks
from .mitsuba_looks import rgb

VARIANT = "llvm_ad_rgb"
"""The variant that is measured: compiled, on vectors and all cores."""

LEAST_LLVM = 17
"""First version of LLVM that compiles Dr.Jit's code for AVX-512: 16 ends the process, for it knows no maximum
of single numbers there that passes NaN on, which Dr.Jit 1.5 asks for; 19 is what was run."""

ENTRY_OFFSET = 1e-4
"""How far behind the entry into the room a ray starts, in the distance to it: float32 rounds to 6e-8 of the
distance, and the slice that is lost is thinner than anything in the scenes."""

BACK_TO_BACK = 1e-4
"""Distance of the two sides of a quad that emits, in its shorter edge: Mitsuba's lights emit to one side."""


def open_mitsuba(variant: str) -> Any:
    """Return the module `mitsuba`, set to a variant: scalar_rgb, or llvm_ad_rgb, which needs LLVM."""
    try:
        mi = importlib.import_module("mitsuba")
    except ImportError:
        raise ExecutorUnavailable("mitsuba: the package is not installed; pip install mitsuba") from None
    if variant.startswith("llvm"):
        _check_llvm()
    mi.set_variant(variant)
    mi.register_sensor("wamnet_inside", _sensor_class(mi))
    looks.register(mi)
    return mi


def _check_llvm() -> None:
    """Refuse a libLLVM that is missing or too old, before it ends the process."""
    version = importlib.import_module("drjit").detail.llvm_version()[0]
    if version < LEAST_LLVM:
        found = f"LLVM {version}" if version > 0 else "none"
        raise ExecutorUnavailable(
            f"mitsuba: its LLVM variant needs libLLVM {LEAST_LLVM} or newer and finds {found}; apt-get "
            "install libllvm19, or name the library's file in DRJIT_LIBLLVM_PATH"
        )


# ---- the scene ---------------------------------------------------------------------------------------------


def check(scene: Scene, settings: Settings) -> None:
    """Refuse a scene or settings that Mitsuba would show differently."""
    if settings.roulette_depth is not None or settings.strategy != "mis" or settings.heuristic != "power":
        rule = "Mitsuba combines both strategies by the power heuristic, without roulette"
        raise InputError("settings", settings, rule, "use the default ones except for max_depth")
    parts: tuple[Box | Sphere | Quad | Light, ...] = (
        *scene.boxes,
        *scene.spheres,
        *scene.quads,
        *scene.lights,
    )
    for part in parts:
        if scene.room is not None and not _holds(scene.room, part):
            rule = "in a room that is seen from outside nothing may reach out of it"
            raise InputError("primitive", part, rule, "make the room larger, or leave it out")
        if isinstance(part, (Box, Sphere)) and _surrounds(part, scene.camera.position):
            raise InputError(
                "camera inside", part, "Mitsuba shows solids from outside", "move the camera out"
            )
    _check_glass(scene)
    if scene.environment is not None and scene.environment.sun_concentration > looks.LARGEST_TABLED:
        rule = f"the sky's table shows lobes up to {looks.LARGEST_TABLED:g}"
        raise InputError(
            "sun_concentration", scene.environment.sun_concentration, rule, "make the sun softer"
        )


def check_matte(scene: Scene, settings: Settings, peer: str) -> None:
    """Refuse, for a peer that knows matte surfaces only, what it or Mitsuba would show differently."""
    check(scene, settings)
    if scene.environment is not None:
        rule = f"no sky is given to {peer}"
        raise InputError("scene with a sky", scene.name, rule, "measure a scene without")
    materials = [part.material for part in (*scene.boxes, *scene.spheres, *scene.quads)]
    materials += scene.room.materials if scene.room is not None else ()
    if any(material is not None for material in materials):
        rule = f"only matte surfaces are given to {peer}"
        raise InputError("scene with materials", scene.name, rule, "measure a scene without")


def _check_glass(scene: Scene) -> None:
    """Refuse light that begins in glass: Mitsuba's is scaled where it leaves, ours is basic radiance."""
    solids: tuple[Box | Sphere, ...] = (*scene.boxes, *scene.spheres)
    glass = [part for part in solids if part.material is not None and part.material.transmits]
    inner = [part.center for part in solids if any(part.emission)]
    inner += [light.corner for light in scene.lights]
    inner += [quad.corner for quad in scene.quads if any(quad.emission)]
    for part in glass:
        if any(_surrounds(part, point) for point in inner):
            raise InputError(
                "glass", part, "no light may start inside", "move the light out, or remove its emission"
            )


def _holds(room: Room, part: Box | Sphere | Quad | Light) -> bool:
    """Tell whether a primitive lies within the room, up to rounding."""
    low, high, _ = part.extent
    slack = 1e-6 * (np.array(room.high) - room.low)
    return bool(np.all(low >= room.low - slack) and np.all(high <= room.high + slack))


def _within(room: Room, point: Any) -> bool:
    """Tell whether a point (3,) lies in the room."""
    return bool(np.all(np.array(point) >= room.low) and np.all(np.array(point) <= room.high))


def _surrounds(part: Box | Sphere, point: Any) -> bool:
    """Tell whether a point (3,) lies inside a solid."""
    offset = np.array(point) - part.center
    if isinstance(part, Sphere):
        return bool(np.linalg.norm(offset) <= part.radius)
    return bool(np.all(np.abs(np.array(part.rotation) @ offset) <= part.half_extent))


def export(mi: Any, scene: Scene, width: int, height: int, settings: Settings) -> dict[str, Any]:
    """Return the scene as a dictionary for `mitsuba.load_dict`."""
    check(scene, settings)
    path = {"type": "path", "max_depth": settings.max_depth + 1, "rr_depth": settings.max_depth + 2}
    made = {"type": "scene", "integrator": path, "sensor": _sensor(mi, scene, width, height)}
    for wall, (corner, edge_u, edge_v) in enumerate(room_walls(scene.room) if scene.room else ()):
        assert scene.room is not None
        material = scene.room.materials[wall] if scene.room.materials else None
        look = _look(scene.room.reflectances[wall], scene.room.emission, material)
        made[f"wall_{wall}"] = _rectangle(mi, corner, edge_u, edge_v, look)
    for i, box in enumerate(scene.boxes):
        axes = np.array(box.rotation).T * box.half_extent
        look = _look(box.reflectance, box.emission, box.material)
        made[f"box_{i}"] = {"type": "cube", "to_world": _matrix(mi, axes, box.center), **look}
    for i, ball in enumerate(scene.spheres):
        place = {"center": list(ball.center), "radius": ball.radius}
        look = _look(ball.reflectance, ball.emission, ball.material)
        made[f"sphere_{i}"] = {"type": "sphere", **place, **look}
    for i, quad in enumerate(scene.quads):
        made |= _two_sided(mi, f"quad_{i}", quad)
    for i, light in enumerate(scene.lights):
        look = _look((0.0, 0.0, 0.0), light_radiance(light))
        made[f"light_{i}"] = _rectangle(mi, light.corner, light.edge_u, light.edge_v, look)
    if any(scene.background):
        made["background"] = {"type": "constant", "radiance": rgb(scene.background)}
    if scene.environment is not None:
        made["background"] = looks.emitter(mi, scene.environment)
    return made


def _two_sided(mi: Any, name: str, quad: Quad) -> dict[str, Any]:
    """Return the shape of a quad that reflects on both sides, or two shapes if it emits on both."""
    if not any(quad.emission):
        look = {"bsdf": {"type": "twosided", "nested": looks.bsdf(quad.reflectance, quad.material)}}
        return {name: _rectangle(mi, quad.corner, quad.edge_u, quad.edge_v, look)}
    u, v = np.array(quad.edge_u), np.array(quad.edge_v)
    normal = np.cross(u, v)
    apart = normal / np.linalg.norm(normal) * (0.5 * BACK_TO_BACK * min(np.linalg.norm(u), np.linalg.norm(v)))
    look = _look(quad.reflectance, quad.emission, quad.material)
    return {
        f"{name}_front": _rectangle(mi, quad.corner + apart, u, v, look),
        f"{name}_back": _rectangle(mi, quad.corner - apart, v, u, look),
    }


def _rectangle(mi: Any, corner: Any, edge_u: Any, edge_v: Any, look: dict[str, Any]) -> dict[str, Any]:
    """Return a parallelogram that faces the side of edge_u x edge_v; Mitsuba's spans [-1, 1]^2 at z = 0."""
    u, v = 0.5 * np.array(edge_u), 0.5 * np.array(edge_v)
    normal = np.cross(u, v)
    axes = np.stack([u, v, normal / np.linalg.norm(normal)], axis=1)
    return {"type": "rectangle", "to_world": _matrix(mi, axes, np.array(corner) + u + v), **look}


def _look(
    reflectance: Any, emission: Any = (0.0, 0.0, 0.0), material: Material | None = None
) -> dict[str, Any]:
    """Return a shape's material and, if it emits, its emitter."""
    look: dict[str, Any] = {"bsdf": looks.bsdf(reflectance, material)}
    if any(emission):
        look["emitter"] = {"type": "area", "radiance": rgb(emission)}
    return look


def _matrix(mi: Any, axes: Any, origin: Any) -> Any:
    """Return the map from local coordinates to axes (3, 3; columns) at origin (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes, origin
    return mi.ScalarTransform4f(matrix)


# ---- the camera --------------------------------------------------------------------------------------------


def _sensor(mi: Any, scene: Scene, width: int, height: int) -> dict[str, Any]:
    """Return the camera; outside a room, the one whose rays start inside."""
    camera = scene.camera
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb"}
    parts = {
        "film": {**film, "component_format": "float32", "rfilter": {"type": "box"}},
        "sampler": {"type": "independent"},
    }
    place = {"origin": list(camera.position), "target": list(camera.look_at), "up": list(camera.up)}
    pinhole = {
        "type": "perspective",
        "fov_axis": "y",
        "fov": camera.vertical_fov_deg,
        "near_clip": 1e-6,
        "to_world": mi.ScalarTransform4f().look_at(**place),
        **parts,
    }
    if scene.room is None or _within(scene.room, camera.position):
        return pinhole
    room = {f"{end}_{k}": getattr(scene.room, end)[i] for end in ("low", "high") for i, k in enumerate("xyz")}
    return {"type": "wamnet_inside", "pinhole": pinhole, **room, **parts}


def _sensor_class(mi: Any) -> Any:
    """Return the class of the sensor whose rays start where those of a pinhole camera enter a room."""
    dr = importlib.import_module("drjit")

    class Inside(mi.Sensor):  # type: ignore[misc]
        """The rays of the sensor `pinhole`, from their entry into the room low_x .. high_z on."""

        def __init__(self, given: Any) -> None:
            super().__init__(given)
            self.pinhole = given["pinhole"]
            self.low, self.high = (
                mi.Point3f(*(given[f"{end}_{k}"] for k in "xyz")) for end in ("low", "high")
            )

        def _enter(self, ray: Any) -> Any:
            """Return the ray from its entry on; a ray that misses the room, or starts in it, as it is."""
            a, b = (self.low - ray.o) / ray.d, (self.high - ray.o) / ray.d
            near, far = dr.max(dr.minimum(a, b)), dr.min(dr.maximum(a, b))
            t = dr.select((near <= far) & (near > 0.0), near * (1.0 + ENTRY_OFFSET), 0.0)
            ray.o = ray(t)
            return ray

        def sample_ray(self, *sample: Any, **named: Any) -> Any:
            ray, weight = self.pinhole.sample_ray(*sample, **named)
            return self._enter(ray), weight

        def sample_ray_differential(self, *sample: Any, **named: Any) -> Any:
            ray, weight = self.sample_ray(*sample, **named)
            return mi.RayDifferential3f(ray), weight

        def traverse(self, visitor: Any) -> None:
            """Nothing here is to be changed or differentiated."""

        def to_string(self) -> str:
            return "Inside[]"

    return Inside


# ---- the picture -------------------------------------------------------------------------------------------


def render(mi: Any, loaded: Any, spp: int, seed: int) -> Any:
    """Return the mean colours (H, W, 3), rows from the top, of a loaded scene; waits until they are there."""
    return np.array(mi.render(loaded, spp=spp, seed=seed))


def renderer(scene: Scene, width: int, height: int, settings: Settings) -> Callable[[int, int], Any]:
    """Return what renders a scene, by the number of samples and a seed."""
    mi = open_mitsuba(VARIANT)
    return partial(render, mi, mi.load_dict(export(mi, scene, width, height, settings)))
