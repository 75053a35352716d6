"""Unidirectional path tracing of one path, over lanes: pure functions from state to state.

A path starts at the camera [`camera_path`]. At each vertex

1. [`arrive`] finds the next surface [`closest_hit`] and adds what it emits, weighted against the light sample
   that could have found the same light [`emission_weight`];
2. [`scatter`] samples a point on a light or a direction to the sky, and adds its light when nothing is in
   between [`direct_light`] (next-event estimation);
3. it then samples a direction by the surface's material, and multiplies the throughput beta by f cos / pdf
   (shading.py; for a Lambertian surface that is just the reflectance);
4. a path ends where nothing or a lamp was hit, and by Russian roulette if enabled. Drivers end it after
   `max_depth` scatterings, with the emission that the last direction meets.

Both ways to find a light are combined by multiple importance sampling (Veach, "Robust Monte Carlo Methods
for Light Transport Simulation", 1997, chapter 9) with the balance or the power heuristic; each way by itself
is an unbiased estimator as well, which the tests use. Emission of surfaces that are not lights, and of a
constant background, is found only by the second way and has weight 1; so has whatever a mirrored or
refracted direction meets, since no light sample ever takes it.

The functions hold no state, write nothing in place, use no mask as an index, and get their random numbers
from (seed, pixel, sample), so that lanes are independent: a compiler can trace them as it traces the network.
Drivers loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from .. import rng, vectors
from ..errors import InputError, choice
from ..vectors import Colors, Directions, Floats, Ids, Normals, Points, Radiance, Truths
from . import environment, intersection, sampling, shading, sobol
from .environment import Environment
from .intersection import Geometry, Hit, Surface
from .materials.material import SINGLE_PDF, Site
from .scene import Scene
from .shading import Materials
from .shapes.quad import light_radiance, quad_area_pdf
from .shapes.shape import MISS

HEURISTICS = {"balance": 1, "power": 2}
"""Exponent of the densities in the multiple importance sampling weight, by the heuristic's name."""

STRATEGIES = ("mis", "light", "bsdf")
"""Ways to find a light: both combined, only light samples, only directions of the BSDF."""

SAMPLERS: Mapping[str, Callable[..., rng.Block]] = {"pcg4d": rng.uniforms, "sobol": sobol.uniforms}
"""Sources of random numbers by name: four uniform floats of (seed, pixel, sample, block). The first is the
default: its samples are independent."""

NET = "net"
"""Name of the source whose samples are spread evenly over a pixel, and over nothing else."""

CAMERA_SAMPLERS: Mapping[str, Callable[..., rng.Block]] = {**SAMPLERS, NET: sobol.net_uniforms}
"""Sources of the numbers of camera rays: of paths that end at their first hit, any of them."""

SPREAD: Mapping[str, str] = {"pcg4d": NET, "sobol": "sobol"}
"""The source of camera rays that are spread evenly, by a path's sampler: both give sample 0 the same ray."""

BLOCKS_PER_BOUNCE = 2
"""Blocks of four random numbers that a scattering uses; block 0 belongs to the camera."""

LARGEST_DEPTH = (1 << 32) // BLOCKS_PER_BOUNCE
"""Largest number of scatterings whose blocks, after the camera's, have numbers of 32 bits."""

ROULETTE_LIMIT = 0.95
"""Greatest probability to survive Russian roulette, so that paths between white walls end too."""

SHADOW_BLOCK = LARGEST_DEPTH * BLOCKS_PER_BOUNCE - 1
"""Block of the random numbers of the layer `direct`: the last one, which no scattering reaches."""

LEAST_DENSITY = 1e-15
"""Floor of cosines and densities that divide: its inverse squared is still finite in float32."""

SKY_SHARE = 0.5
"""Share of the light samples that go to the sky where a scene has lamps too: a lamp's power and a sky's
radiance cannot be compared without knowing the size of what they light. A half: its halving is exact."""

CAMERA_PDF = SINGLE_PDF
"""Density of a camera ray's direction, in 1/sr: it is not a sample, so light sampling is not an alternative
to it, and the weight of what it meets is 1."""

LEAST_SQUARE = 1e-30
"""Floor of squared distances that divide, in scene units squared; it acts only on coincident points."""


@dataclass(frozen=True)
class Settings:
    """How light is gathered. `max_depth` is the greatest number of scatterings; 0 shows only emission.

    `roulette_depth` is the number of scatterings after which Russian roulette begins; None turns it off.
    """

    max_depth: int = 5
    roulette_depth: int | None = None
    strategy: str = "mis"
    heuristic: str = "power"
    sampler: str = "pcg4d"

    def __post_init__(self) -> None:
        """Refuse settings outside their rules."""
        if not isinstance(self.max_depth, int) or self.max_depth < 0:
            raise InputError("max_depth", self.max_depth, "must be an integer of 0 or more", "5 is usual")
        if self.max_depth >= LARGEST_DEPTH:
            rule = f"must be below {LARGEST_DEPTH}, since random numbers are counted in 32 bits"
            raise InputError("max_depth", self.max_depth, rule, "5 is usual")
        if self.roulette_depth is not None and not 0 <= self.roulette_depth < LARGEST_DEPTH:
            rule = f"must be 0 or more, and below {LARGEST_DEPTH}"
            raise InputError("roulette_depth", self.roulette_depth, rule, "use None for none")
        if self.strategy not in STRATEGIES:
            raise InputError("strategy", self.strategy, "unknown", choice(self.strategy, STRATEGIES))
        if self.heuristic not in HEURISTICS:
            raise InputError("heuristic", self.heuristic, "unknown", choice(self.heuristic, HEURISTICS))
        if self.sampler == NET and self.max_depth > 0:
            rule = "samples camera rays only, not scatterings"
            raise InputError("sampler", self.sampler, rule, f"choose one of {', '.join(SAMPLERS)}")
        if self.sampler not in CAMERA_SAMPLERS:
            raise InputError("sampler", self.sampler, "unknown", choice(self.sampler, SAMPLERS))

    def facts(self) -> dict[str, Any]:
        """Return the settings by name, without the sampler where it is the default."""
        facts = asdict(self)
        return {key: facts[key] for key in facts if key != "sampler" or facts[key] != next(iter(SAMPLERS))}


@dataclass(frozen=True)
class Lights:
    """The scene's lights as constants, per light: corner and edges (3,), normal (3,), radiance (3,), area ().

    `cumulative` (K,) are the running sums of the probabilities with which light sampling picks each light.
    """

    corner: Points
    edge_u: Directions
    edge_v: Directions
    normal: Normals
    radiance: Radiance
    area: Floats
    cumulative: Floats
    probability: Floats


@dataclass(frozen=True)
class World:
    """All constants of light transport in one float type."""

    geometry: Geometry
    materials: Materials
    lights: Lights | None
    environment: Environment | None
    settings: Settings

    @property
    def samples_lights(self) -> bool:
        """Whether lights and the sky are sampled: there is one, and a material that it can light."""
        has_some = self.lights is not None or self.environment is not None
        return has_some and self.settings.strategy != "bsdf" and not self.materials.single


class Counters(NamedTuple):
    """The counters (...) that name a path's random numbers, as uint32."""

    seed: Any
    pixel: Any
    sample: Any


class Path(NamedTuple):
    """State of paths between bounces: the ray, what is gathered so far, and what the next hit needs to know.

    origin, direction, beta (throughput), radiance (..., 3); pdf (...) of the direction by the BSDF, in 1/sr.
    """

    origin: Points
    direction: Directions
    beta: Colors
    radiance: Radiance
    pdf: Floats


def build(scene: Scene, settings: Settings, dtype: DTypeLike = np.float32) -> World:
    """Lay out a scene as constants of one float type."""
    geometry = intersection.build(scene, dtype)
    powered = [light for light in scene.lights if light.power * sum(light.color) > 0.0]
    sky = None if scene.environment is None else environment.build(scene.environment, dtype)
    lights = _build_lights(scene, dtype, 1.0 if sky is None else 1.0 - SKY_SHARE) if powered else None
    return World(geometry, shading.build(scene, dtype), lights, sky, settings)


def _build_lights(scene: Scene, dtype: DTypeLike, share: float) -> Lights:
    """Return the tables of the lights; a light is picked in proportion to its power times its mean colour.

    share is the probability that any of them is picked, and not the sky.
    """
    lights = scene.lights
    edge_u, edge_v = (np.array([getattr(light, edge) for light in lights]) for edge in ("edge_u", "edge_v"))
    normal = vectors.normalize(vectors.cross(edge_u, edge_v))
    weight = np.array([light.power * sum(light.color) for light in lights], np.float64)
    cumulative = np.cumsum(weight) / np.sum(weight)
    cumulative[-1] = 1.0
    # Probabilities are differences of the rounded sums, so that sampling and density agree to the bit.
    cumulative = cumulative.astype(dtype)
    tables = (
        [light.corner for light in lights],
        edge_u,
        edge_v,
        normal,
        [light_radiance(light) for light in lights],
        [1.0 / quad_area_pdf(light) for light in lights],
        cumulative,
        share * sampling.discrete_pdf(np.arange(len(lights)), cumulative),
    )
    return Lights(*(np.asarray(table, dtype) for table in tables))


def camera_path(origin: Points, direction: Directions) -> Path:
    """Return the state of paths that leave the camera."""
    one, zero = np.ones_like(direction), np.zeros_like(direction)
    return Path(origin, direction, one, zero, np.full_like(direction[..., 0], CAMERA_PDF))


def arrive(world: World, path: Path) -> tuple[Path, Surface, Hit]:
    """Find the next surface of paths and add what it emits; return state, surface and hit."""
    hit = intersection.closest_hit(world.geometry, path.origin, path.direction)
    surface = intersection.surface_at(world.geometry, hit, path.origin, path.direction)
    surface = surface._replace(emission=with_sky(world, hit, path.direction, surface.emission))
    weight = emission_weight(world, path, hit, surface)
    radiance = path.radiance + path.beta * vectors.scale(surface.emission, weight)
    return path._replace(radiance=radiance), surface, hit


def with_sky(world: World, hit: Hit, direction: Directions, emission: Radiance) -> Radiance:
    """Return the emission (..., 3) of hits, and where rays of a direction (..., 3) miss all, the sky's."""
    if world.environment is None:
        return emission
    missed = hit.surface == world.geometry.nothing
    return vectors.choose(missed, environment.radiance(world.environment, direction), emission)


def scatter(
    world: World, path: Path, surface: Surface, hit: Hit, depth: Any, counters: Counters
) -> tuple[Path, Any]:
    """Gather light at the surface and leave it in a sampled direction; return state and what (...) continues.

    depth (...) counts the scatterings so far, as uint32.
    """
    alive = hit.surface < world.materials.ends
    block = np.uint32(1) + np.uint32(BLOCKS_PER_BOUNCE) * depth
    u_pick, u_light_0, u_light_1, u_roulette = _uniforms(world, counters, block)
    # Add light that a sampled point of a light sends here.
    t = np.where(alive, hit.t, 0.0)
    origin = intersection.spawn_origin(surface.point, surface.normal, t)
    site = shading.site(world.materials, surface, hit, path.direction, path.beta)
    radiance = path.radiance
    if world.samples_lights:
        color, light = direct_light(world, site, hit, origin, u_pick, u_light_0, u_light_1)
        radiance = radiance + color * vectors.choose(alive, light, 0.0)
    # Sample the next direction, and leave the surface on its side.
    u_direction_0, u_direction_1, u_choice, _ = _uniforms(world, counters, block + np.uint32(1))
    direction, beta, pdf, through = shading.scattered(
        world.materials, site, hit, u_direction_0, u_direction_1, u_choice
    )
    if through is not None:
        behind = intersection.spawn_origin(surface.point, -surface.normal, t)
        origin = vectors.choose(through, behind, origin)
    # End paths that carry nothing, and some others by Russian roulette.
    alive = alive & (vectors.largest(beta) > 0.0)
    if world.settings.roulette_depth is not None:
        beta, alive = _roulette(world.settings.roulette_depth, beta, alive, u_roulette, depth)
    return Path(origin, direction, beta, radiance, pdf), alive


def _roulette(first: int, beta: Colors, alive: Truths, u: Floats, depth: Any) -> tuple[Colors, Truths]:
    """End paths at random from depth `first` on, in proportion to what they carry; scale up the others."""
    survival = np.minimum(vectors.largest(beta), ROULETTE_LIMIT)
    survival = np.where(depth < np.uint32(first), np.ones_like(survival), survival)
    return beta / np.maximum(survival, LEAST_DENSITY)[..., np.newaxis], alive & (u < survival)


def _uniforms(world: World, counters: Counters, block: Any) -> rng.Block:
    """Return four uniform numbers (...) of the given block in the world's float type."""
    draw = CAMERA_SAMPLERS[world.settings.sampler]
    return draw(counters.seed, counters.pixel, counters.sample, block, world.geometry.dtype)


def emission_weight(world: World, path: Path, hit: Hit, surface: Surface) -> Floats:
    """Return the weight (...) of emission that a BSDF sample (or the camera) has found."""
    if not world.samples_lights:
        return np.ones_like(hit.t)
    if world.settings.strategy == "light":
        found_twice = _sampled(world, hit, surface) & (path.pdf < CAMERA_PDF)
        return np.where(found_twice, np.zeros_like(hit.t), np.ones_like(hit.t))
    weight = np.ones_like(hit.t)
    if world.lights is not None:
        is_light = surface.light >= 0
        index = np.maximum(surface.light, 0)
        cos_light = np.abs(vectors.dot(surface.normal, path.direction))
        distance = np.where(is_light, hit.t, 0.0)  # the square of a miss would overflow
        pdf_light = light_pdf(world.lights, index, distance * distance, cos_light)
        weight = np.where(is_light, mis_weight(world.settings, path.pdf, pdf_light), weight)
    if world.environment is not None:
        missed = hit.surface == world.geometry.nothing
        weight = np.where(
            missed, mis_weight(world.settings, path.pdf, _sky_pdf(world, path.direction)), weight
        )
    return weight


def _sampled(world: World, hit: Hit, surface: Surface) -> Truths:
    """Tell (...) whether light samples could have found the same: only lights and the sky can be."""
    if world.environment is None:
        lamps: Truths = surface.light >= 0
        return lamps
    either: Truths = (hit.surface == world.geometry.nothing) | (surface.light >= 0)
    return either


def direct_light(
    world: World, site: Site, hit: Hit, origin: Points, u_pick: Floats, u0: Floats, u1: Floats
) -> tuple[Any, Any]:
    """Return a colour and light (..., 3); their product is what a sample of the lights or the sky adds."""
    wi, cos_surface, cos_light, pdf, radiance, distance = _towards(world, site, origin, u_pick, u0, u1)
    # Weight by f cos / pdf and by the heuristic, where both sides face each other and nothing is in between.
    color, factor = shading.value(world.materials, site, hit, wi, cos_surface)
    weight = factor / pdf
    if world.settings.strategy == "mis":
        other_pdf = shading.pdf(world.materials, site, hit, wi, cos_surface)
        weight = weight * mis_weight(world.settings, pdf, other_pdf)
    facing = (cos_surface > 0.0) & (cos_light > 0.0)
    visible = facing & ~intersection.occluded(world.geometry, origin, wi, distance, facing)
    return color, vectors.scale(radiance, np.where(visible, weight, 0.0))


def unshadowed(world: World, surface: Surface) -> Radiance:
    """Return a surface's radiance (..., 3) from the lamps only, if it were matte and saw all of them.

    Each lamp, of area A and radiance L, is taken for a disk of the same area around its middle, in direction
    wi at distance d: its irradiance L A cos_s cos_l / (d^2 + A / pi). On the axis of a disk that faces the
    surface that is exact, pi L sin^2 of the angle of its rim, since A / pi is the square of its radius;
    nowhere does it exceed pi L. No random number enters, and the result is linear in the lamps' colours.
    """
    black = np.zeros_like(surface.reflectance[..., 0])
    if world.lights is None:
        return vectors.vector(black, black, black)
    lights = world.lights

    def add(
        values: tuple[Any, ...], middle: Points, normal: Normals, radiance: Radiance, area: Floats
    ) -> tuple[Any, ...]:
        """Add what one lamp gives to each channel's irradiance (...)."""
        factor = _disk(world, surface, middle, normal, area)
        return tuple(value + factor * radiance[..., i] for i, value in enumerate(values))

    _, middle, normal, area = _lamp_tables(lights)
    tables = middle, normal, lights.radiance, area
    irradiance = vectors.fold_rows(add, tables, (black, black, black))
    light: Radiance = surface.reflectance * vectors.vector(*irradiance) * world.geometry.dtype.type(1 / np.pi)
    return light


def _disk(world: World, surface: Surface, middle: Points, normal: Normals, area: Floats) -> Floats:
    """Return the irradiance (...) of a surface by a lamp of radiance 1, taken for a disk."""
    offset = middle - surface.point
    square = vectors.dot(offset, offset)
    # Cosines are products by the distance here: their two divisions are one by its square.
    along_surface = np.maximum(vectors.dot(surface.normal, offset), 0.0)
    along_light = np.maximum(-vectors.dot(normal, offset), 0.0)
    near = np.maximum(square, LEAST_SQUARE) * (square + area * world.geometry.dtype.type(1 / np.pi))
    factor: Floats = area * along_surface * along_light / near
    return factor


def direct(world: World, surface: Surface, hit: Hit, counters: Counters, rays: int, number: Any) -> Radiance:
    """Return what shadow ray `number` (...) of so many `rays` adds to the layer `direct` (..., 3).

    Their sum estimates `unshadowed` with each lamp's light times the share of its area that the surface sees,
    and the same of the sun and of the rest of the sky. One of all is picked in proportion to its unshadowed
    light, and a point of the lamp, or a direction, by two numbers: what is left of the first one, after the
    choice, is uniform again. The rays of all samples of a pixel are one sequence of points that are spread
    evenly over lamps and areas (sobol.py: net_uniforms).
    """
    black = np.zeros_like(surface.reflectance[..., 0])
    if world.lights is None and world.environment is None:
        return vectors.vector(black, black, black)
    dtype = world.geometry.dtype
    lamps = black if world.lights is None else _lamplight(world, surface)
    total = lamps
    if world.environment is not None:
        total = lamps + sum(_skylight(world.environment, surface))
    sample = counters.sample * np.uint32(rays) + number
    block = np.full_like(sample, SHADOW_BLOCK)
    u0, u1, _, _ = sobol.net_uniforms(counters.seed, counters.pixel, sample, block, dtype)
    wanted = u0 * total
    # Send the shadow ray, from the surface to the point.
    reflects = hit.surface < world.materials.ends
    origin = intersection.spawn_origin(surface.point, surface.normal, np.where(reflects, hit.t, 0.0))
    if world.environment is None:
        way = _to_lamp(world, surface, origin, wanted, u1)
    else:
        way = _to_sky(world.environment, surface, wanted - lamps, u1)
        if world.lights is not None:
            way = _either(wanted >= lamps, way, _to_lamp(world, surface, origin, wanted, u1))
    facing = reflects & (way.cos_surface > 0.0) & (way.cos_light > 0.0)
    blocked = intersection.occluded(world.geometry, origin, way.wi, way.distance, facing)
    part = total / np.maximum(way.divisor, LEAST_DENSITY) * dtype.type(1 / (np.pi * rays))
    return vectors.scale(surface.reflectance * way.radiance, np.where(facing & ~blocked, part, 0.0))


def _lamp_tables(lights: Lights) -> tuple[Any, ...]:
    """Return each lamp's power, middle, normal and area."""
    power = lights.radiance[:, 0] + lights.radiance[:, 1] + lights.radiance[:, 2]
    return power, lights.corner + (lights.edge_u + lights.edge_v) / 2, lights.normal, lights.area


def _lamplight(world: World, surface: Surface) -> Floats:
    """Return the irradiance (...) of a surface by all lamps, the sum of its channels."""

    def add(values: tuple[Any], power: Floats, *disk: Any) -> tuple[Any]:
        """Add a lamp's light (...)."""
        return (values[0] + power * _disk(world, surface, *disk),)

    assert world.lights is not None
    black = np.zeros_like(surface.reflectance[..., 0])
    total: Floats
    (total,) = vectors.fold_rows(add, _lamp_tables(world.lights), (black,))
    return total


def _to_lamp(world: World, surface: Surface, origin: Points, wanted: Floats, u1: Floats) -> Towards:
    """Return the way to a point of the lamp with which light adds up to what is wanted."""
    lights, black = world.lights, np.zeros_like(wanted)
    assert lights is not None

    def pick(values: tuple[Any, ...], index: Any, power: Floats, *disk: Any) -> tuple[Any, ...]:
        """Choose a lamp if the light before it does not exceed what is looked for."""
        before, chosen, share = values
        own = power * _disk(world, surface, *disk)
        here = wanted >= before
        share = np.where(here, (wanted - before) / np.maximum(own, LEAST_DENSITY), share)
        return before + own, np.where(here, index, chosen), share

    tables = np.arange(len(lights.area), dtype=np.int32), *_lamp_tables(lights)
    _, index, share = vectors.fold_rows(pick, tables, (black, np.zeros_like(black, dtype=np.int32), black))
    way = _towards_point(lights, surface.normal, origin, index, np.minimum(share, 1.0), u1)
    return way._replace(divisor=way.radiance[..., 0] + way.radiance[..., 1] + way.radiance[..., 2])


def _skylight(sky: Environment, surface: Surface) -> tuple[Floats, Floats]:
    """Return the irradiance (...) of a surface by the sun, and that by the rest as if that were uniform."""
    sun, rest = environment.power(sky)
    towards = vectors.dot(surface.normal, np.zeros_like(surface.normal) + sky.sun)
    return sun * np.maximum(towards, 0.0), np.full_like(towards, np.pi * rest)


def _to_sky(sky: Environment, surface: Surface, wanted: Floats, u1: Floats) -> Towards:
    """Return the way to the sun or to the rest of the sky."""
    sun, rest = _skylight(sky, surface)
    sunny = wanted < sun
    share = np.where(sunny, wanted, wanted - sun) / np.maximum(np.where(sunny, sun, rest), LEAST_DENSITY)
    wi = environment.towards(sky, surface.normal, sunny, np.minimum(np.maximum(share, 0.0), 1.0), u1)
    radiance = vectors.choose(sunny, sky.irradiance, environment.gradient(sky, wi))
    cos_surface = np.maximum(vectors.dot(surface.normal, wi), 0.0)
    power, facing = np.where(sunny, *environment.power(sky)), np.ones_like(cos_surface)
    return Towards(wi, cos_surface, facing, power, radiance, np.full_like(cos_surface, MISS))


class Towards(NamedTuple):
    """A sampled way to light: unit wi (..., 3), cosines (...) at both ends, and more.

    divisor (...): the pdf of wi in 1/sr, or of a shadow ray the power of its source [`direct`]; the radiance
    (..., 3) that comes from there, and the distance (...).
    """

    wi: Directions
    cos_surface: Floats
    cos_light: Floats
    divisor: Floats
    radiance: Radiance
    distance: Floats


def _towards(world: World, site: Site, origin: Points, u_pick: Floats, u0: Floats, u1: Floats) -> Towards:
    """Sample a light or the sky, whichever there is; of both, one by the choice's first bit."""
    if world.environment is None:
        return _towards_light(world, site, origin, u_pick, u0, u1)
    if world.lights is None:
        return _towards_sky(world, site, u_pick, u0, u1)
    is_sky = u_pick < SKY_SHARE
    rest = np.where(is_sky, u_pick / SKY_SHARE, (u_pick - SKY_SHARE) / (1.0 - SKY_SHARE))
    sky = _towards_sky(world, site, rest, u0, u1)
    return _either(is_sky, sky, _towards_light(world, site, origin, rest, u0, u1))


def _either(is_sky: Truths, sky: Towards, light: Towards) -> Towards:
    """Return the way to the sky or that to a light."""
    return Towards(
        vectors.choose(is_sky, sky.wi, light.wi),
        np.where(is_sky, sky.cos_surface, light.cos_surface),
        np.where(is_sky, sky.cos_light, light.cos_light),
        np.where(is_sky, sky.divisor, light.divisor),
        vectors.choose(is_sky, sky.radiance, light.radiance),
        np.where(is_sky, sky.distance, light.distance),
    )


def _towards_light(
    world: World, site: Site, origin: Points, u_pick: Floats, u0: Floats, u1: Floats
) -> Towards:
    """Sample a point on a light."""
    lights = world.lights
    assert lights is not None
    index = sampling.sample_discrete(u_pick, lights.cumulative)
    return _towards_point(lights, site.normal, origin, index, u0, u1)


def _towards_point(
    lights: Lights, normal: Normals, origin: Points, index: Ids, u0: Floats, u1: Floats
) -> Towards:
    """Return the way from a surface to a uniform point of light `index` (...)."""
    corner, edge_u, edge_v, light_normal, radiance = (
        vectors.look_up_rows(table, index)
        for table in (lights.corner, lights.edge_u, lights.edge_v, lights.normal, lights.radiance)
    )
    # A point on the light, a little off its surface.
    point = sampling.sample_quad(u0, u1, corner, edge_u, edge_v)
    target = intersection.spawn_origin(point, light_normal, vectors.largest(np.abs(origin)))
    # Measure direction, distance and the cosines at both ends.
    offset = target - origin
    square = np.maximum(vectors.dot(offset, offset), LEAST_SQUARE)
    distance = np.sqrt(square)
    wi = offset / distance[..., np.newaxis]
    cos_surface = np.maximum(vectors.dot(normal, wi), 0.0)
    cos_light = np.maximum(-vectors.dot(light_normal, wi), 0.0)
    return Towards(
        wi, cos_surface, cos_light, light_pdf(lights, index, square, cos_light), radiance, distance
    )


def _towards_sky(world: World, site: Site, u_choice: Floats, u0: Floats, u1: Floats) -> Towards:
    """Sample a direction to the sky; what shines from everywhere faces everything."""
    sky = world.environment
    assert sky is not None
    wi = environment.sample(sky, u_choice, u0, u1)
    cos_surface = np.maximum(vectors.dot(site.normal, wi), 0.0)
    far = np.full_like(cos_surface, MISS)
    radiance = environment.radiance(sky, wi)
    return Towards(wi, cos_surface, np.ones_like(cos_surface), _sky_pdf(world, wi), radiance, far)


def _sky_pdf(world: World, direction: Directions) -> Floats:
    """Return the density (...), in 1/sr, with which light sampling finds a direction (..., 3) to the sky."""
    assert world.environment is not None
    pdf = environment.pdf(world.environment, direction)
    return pdf if world.lights is None else SKY_SHARE * pdf


def light_pdf(lights: Lights, index: Ids, square: Floats, cos_light: Floats) -> Floats:
    """Return the density (...), in 1/sr, with which light sampling finds a point of light `index` (...).

    square is the squared distance (...), cos_light (...) the cosine at the light.
    """
    area, probability = vectors.look_up(lights.area, index), vectors.look_up(lights.probability, index)
    return probability * square / (area * np.maximum(cos_light, LEAST_DENSITY))


def mis_weight(settings: Settings, pdf: Floats, other_pdf: Floats) -> Floats:
    """Return the weight (...) of samples of density pdf (...) where another technique has other_pdf (...).

    Veach's balance (exponent 1) and power (2) heuristics, through the ratio, so that large densities do not
    overflow.
    """
    ratio = np.minimum(other_pdf / np.maximum(pdf, LEAST_DENSITY), 1.0 / LEAST_DENSITY)
    return 1.0 / (1.0 + ratio ** HEURISTICS[settings.heuristic])
