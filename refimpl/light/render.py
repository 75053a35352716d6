"""The driver: from a scene to a frame, in tiles of pixels, one sample of every pixel at a time.

1. [`render`] walks over the image in tiles, and over the samples of a tile.
2. [`trace`] sends one path through each pixel of a tile and follows them until none is alive; paths that have
   ended leave the arrays, which is the only thing that this driver does for speed.
3. Means and variances are taken over the samples in their order, in float64. A pixel's random numbers depend
   only on (seed, pixel, sample), so neither tile size nor row range changes a bit of the result.
4. The features may be means over more camera rays than are followed to the end: they cost a fraction of a
   path, and show edges without jags. They are then the layers of a job without scattering [`feature_job`],
   [`with_own_features`], whose rays are spread evenly over a pixel and begin with the colour's first one.
5. Features of what is seen past mirrors and glass are layers of their own, on request (following.py). They
   follow the same paths; those of more camera rays end where the features do.
6. On request each camera ray sends shadow rays to the lights, for the layer `direct`: their light, and what
   the first hit emits itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .. import rng, vectors
from ..errors import InputError, choice
from ..frame import DIRECT, LAYERS, LIT, SEEN, SEEN_DIRECT, USUAL, Frame
from ..vectors import Directions, Ids
from . import following, intersection, transport
from .camera import CameraBasis, camera_basis, camera_ray
from .intersection import Hit, Surface
from .scene import Scene, scene_digest
from .transport import Counters, Path, Settings, World

MAX_IMAGE_SIDE_PX = 1 << 16
"""Largest width or height, in pixels: x and y share one 32-bit counter of the random generator."""

MAX_SAMPLES = 1 << 32
"""Largest number of the last sample plus one: samples are counted in 32 bits."""

TILE_PIXELS = 8192
"""Pixels in a tile at most: arrays of this length stay in a core's cache. The image does not depend on it."""


FEATURE_SPP = "feature_spp"
"""Name of the fact, in a frame's info, that its features are means over more camera rays than its colour."""

SHADOW_RAYS = "shadow_rays"
"""Name of the fact of how many shadow rays each of these camera rays sends."""

MOST_SHADOW_RAYS = 64
"""Most shadow rays of a camera ray: more camera rays spread them over the pixel too."""

FEATURE_SAMPLER = "feature_sampler"
"""Name of the fact of the source of these rays; without it they come from the colour's."""


@dataclass(frozen=True)
class Job:
    """How to render a scene: size in pixels, samples per pixel, seed, transport, float type.

    `first_sample` is the number of the first sample: jobs with different ranges are independent parts of one
    render. `feature_spp` is the number of camera rays whose first hits the feature layers are means over; 0,
    as any number up to spp, means those of the colour's samples. `feature_sampler` is where they come from;
    "" is an even spread [`spread`]. `seen`: the frame has the layers of what is seen past mirrors and glass
    too. `color` is False where paths end with their features. `shadow_rays` is how many shadow rays each
    camera ray sends for the layer `direct`; with 0 the frame does not have it.
    """

    width: int
    height: int
    spp: int = 1
    seed: int = 0
    settings: Settings = field(default_factory=Settings)
    dtype: str = "float32"
    first_sample: int = 0
    feature_spp: int = 0
    seen: bool = False
    color: bool = True
    feature_sampler: str = ""
    shadow_rays: int = 0

    def __post_init__(self) -> None:
        """Refuse sizes and counts outside their rules."""
        for name in ("width", "height"):
            _check_range(name, getattr(self, name), 1, MAX_IMAGE_SIDE_PX)
        _check_range("spp", self.spp, 1, MAX_SAMPLES)
        _check_range("seed", self.seed, 0, (1 << 32) - 1)
        _check_range("first_sample", self.first_sample, 0, MAX_SAMPLES - self.spp)
        _check_range("feature_spp", self.feature_spp, 0, MAX_SAMPLES - self.first_sample)
        _check_range("shadow_rays", self.shadow_rays, 0, MOST_SHADOW_RAYS)
        if self.dtype not in ("float32", "float64"):
            raise InputError("dtype", self.dtype, "must be float32 or float64", "convert it")
        source, known = self.feature_sampler, transport.CAMERA_SAMPLERS
        if source and source not in known:
            raise InputError("feature_sampler", source, "unknown", choice(source, known))

    @property
    def layers(self) -> tuple[str, ...]:
        """Return the names of the frame's layers, in their order."""
        lit = LIT[: 1 + self.seen] if self.shadow_rays else ()
        names = (*USUAL, *(SEEN if self.seen else ()), *lit)
        return names if self.color else tuple(name for name in names if name != "color")

    def facts(self) -> dict[str, Any]:
        """Return what determines the frame by name: parts that jobs have not always had, if not as ever."""
        usual = {"seen": False, "color": True, "shadow_rays": 0}
        return {name: value for name, value in asdict(self).items() if usual.get(name, ...) != value}

    @property
    def samples(self) -> int:
        """Return the number of samples of all pixels together, the features' own camera rays among them."""
        own = 0 if feature_job(self) is None else self.feature_spp
        return self.width * self.height * (self.spp + own)


@dataclass(frozen=True, eq=False)
class Render:
    """A rendered frame (or some of its rows) and color_variance (H, W, 3), the variance of one sample.

    Without colour the variance is 0.
    """

    frame: Frame
    color_variance: NDArray[np.float64]


def _check_range(name: str, value: Any, low: int, high: int) -> None:
    """Refuse an argument that is not an integer from low to high."""
    if not isinstance(value, (int, np.integer)) or isinstance(value, bool) or not low <= value <= high:
        raise InputError(name, value, f"must be an integer from {low} to {high}", "choose another value")


def render(
    scene: Scene,
    job: Job,
    *,
    rows: tuple[int, int] | None = None,
    tile_pixels: int = TILE_PIXELS,
    on_progress: Callable[[int], None] | None = None,
) -> Render:
    """Render the rows [first, last) of a scene, all by default.

    on_progress is called with the number of samples that were just finished.
    """
    if feature_job(job) is not None:
        part = partial(render, scene, rows=rows, tile_pixels=tile_pixels, on_progress=on_progress)
        return with_own_features(scene, job, part)
    first, last = checked_rows(job, rows)
    _check_range("tile_pixels", tile_pixels, 1, MAX_IMAGE_SIDE_PX**2)
    world = transport.build(scene, job.settings, job.dtype)
    basis = camera_basis(scene.camera, job.dtype)
    pixels = np.arange(first * job.width, last * job.width)
    tiles = [
        _render_tile(world, basis, job, tile, on_progress)
        for tile in np.array_split(pixels, -(-len(pixels) // tile_pixels))
    ]
    shape = (last - first, job.width)
    means = {n: np.concatenate([means[n] for means, _ in tiles]).reshape(*shape, -1) for n in job.layers}
    variance = np.concatenate([variance for _, variance in tiles]).reshape(*shape, 3)
    layers = {name: mean.astype(job.dtype) for name, mean in means.items()}
    return Render(Frame(layers, render_info(scene, job)), variance)


def feature_job(job: Job) -> Job | None:
    """Return the job whose frame has the feature layers, or None where they come with the colour.

    Its rays are numbered as the colour's samples are, from the same one on; none is scattered. Where the
    features are also of what is seen, they are, without light samples, until that is found.
    """
    if job.feature_spp <= job.spp:
        return None
    settings, color = feature_settings(job.settings, job.seen), not job.seen
    settings = replace(settings, sampler=feature_sampler(job))
    return replace(
        job, spp=job.feature_spp, feature_spp=0, feature_sampler="", settings=settings, color=color
    )


def feature_settings(settings: Settings, seen: bool) -> Settings:
    """Return the settings of paths that only features need: of first hits, or of what is seen as well."""
    if not seen:
        return replace(settings, max_depth=0)
    most = min(following.MOST_FOLLOWED, settings.max_depth)
    return replace(settings, max_depth=most, strategy="bsdf", roulette_depth=None)


def feature_sampler(job: Job) -> str:
    """Return the source of the features' own rays."""
    return job.feature_sampler or spread(job.settings.sampler, job.seen)


def spread(sampler: str, seen: bool) -> str:
    """Return the source of features' own rays, spread evenly, beside a path's sampler.

    It begins with the colour's first ray [transport.py: SPREAD]; paths that features follow need numbers for
    scatterings too, and take Sobol's.
    """
    return "sobol" if seen else transport.SPREAD.get(sampler, sampler)


def other_sampler(job: Job) -> str:
    """Return the source of the features' own rays where there are such, and it is not the colour's; or ""."""
    source = feature_sampler(job)
    return "" if feature_job(job) is None or source == job.settings.sampler else source


def spread_rays(rays: int) -> int:
    """Return how many camera rays that are spread evenly show edges about as well as so many at random."""
    return math.isqrt(max(rays - 1, 0)) + 1 if rays else 0


def with_own_features(scene: Scene, job: Job, render_part: Callable[[Job], Render]) -> Render:
    """Render colour and features apart, each by `render_part`, and return them as one render."""
    of_features = feature_job(job)
    assert of_features is not None
    color = render_part(replace(job, feature_spp=0, shadow_rays=0))
    return joined(scene, job, color, render_part(of_features))


def joined(scene: Scene, job: Job, color: Render, features: Render) -> Render:
    """Return one render of a job: the colour of the one, all other layers of the other that it has."""
    own = {name: layer for name, layer in features.frame.layers.items() if name != "color"}
    found = {**color.frame.layers, **own}
    layers = {name: found[name] for name in job.layers}
    return Render(Frame(layers, render_info(scene, job)), color.color_variance)


def checked_rows(job: Job, rows: tuple[int, int] | None) -> tuple[int, int]:
    """Return the rows [first, last) of a job, all for None, or refuse them."""
    first, last = rows if rows is not None else (0, job.height)
    if not 0 <= first < last <= job.height:
        raise InputError("rows", rows, f"must be a range within 0 to {job.height}", "give first < last")
    return first, last


def _render_tile(
    world: World,
    basis: CameraBasis,
    job: Job,
    pixels: NDArray[Any],
    on_progress: Callable[[int], None] | None,
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Return the layers' means (P, C) over the samples of P pixels, and the variance (P, 3) of a colour."""
    y, x = np.divmod(pixels, job.width)
    sums = {name: np.zeros((len(pixels), LAYERS[name].channels)) for name in job.layers}
    # Welford's running variance: no cancellation where the mean is large.
    squares = np.zeros((len(pixels), 3))
    for n in range(job.spp):
        layers = trace(world, basis, job, x, y, job.first_sample + n)
        for name, values in layers.items():
            sample = values.astype(np.float64)
            if name == "color" and n > 0:
                squares += (n * sample - sums[name]) ** 2 / (n * (n + 1))
            sums[name] += sample
        if on_progress is not None:
            on_progress(len(pixels))
    means = {name: total / job.spp for name, total in sums.items()}
    return means, squares / max(job.spp - 1, 1)


def trace(world: World, basis: CameraBasis, job: Job, x: Any, y: Any, sample: int) -> dict[str, Any]:
    """Trace one path through each pixel x, y (P,) and return its layers (P, C)."""
    dtype = world.geometry.dtype
    counters = Counters(rng.counter(job.seed), pixel_counter(x, y), rng.counter(sample))
    sampler = job.settings.sampler
    path = start(basis, x.astype(dtype), y.astype(dtype), job.width, job.height, counters, dtype, sampler)
    direction = path.direction
    color = np.zeros((len(x), 3), dtype)
    lanes = np.arange(len(x))
    way, most = following.begin(direction), following.most_followed(world)
    layers: dict[str, Any] = {}
    for depth in range(job.settings.max_depth + 1):
        path, surface, hit = transport.arrive(world, path)
        if depth == 0:
            layers = first_hit_layers(world, surface, hit, direction)
            past = (*SEEN, SEEN_DIRECT)
            layers |= {n: np.zeros((len(x), LAYERS[n].channels), dtype) for n in past if n in job.layers}
            layers[DIRECT] = path.radiance  # what the first hit emits
        rays = job.shadow_rays if depth == 0 or (job.seen and way.going.any()) else 0
        lit = [transport.direct(world, surface, hit, counters, rays, np.uint32(n)) for n in range(rays)]
        if depth == 0:
            layers[DIRECT] = sum(lit, layers[DIRECT])
        if job.seen:
            going = way.going
            way, seen = following.see(world, way, path, surface, hit, rng.counter(depth), most)
            if lit:
                tint = intersection.choose_or_zero(going & ~way.going, path.beta)
                seen[SEEN_DIRECT] = sum((tint * part for part in lit), seen["seen_emission"])
            for name, values in seen.items():
                layers[name][lanes] += values.reshape(len(lanes), -1)
        if depth == job.settings.max_depth or not (job.color or way.going.any()):
            break
        path, alive = transport.scatter(world, path, surface, hit, rng.counter(depth), counters)
        if not job.color:
            alive = alive & way.going
        # Store what paths that end have gathered, and continue with the others.
        ended = np.flatnonzero(~alive)
        color[lanes[ended]] = path.radiance[ended]
        if len(ended) > 0:
            left = np.flatnonzero(alive)
            lanes, counters = lanes[left], counters._replace(pixel=counters.pixel[left])
            path = Path(*(_select(part, left) for part in path))
            way = following.Way(*(_select(part, left) for part in way))
        if len(lanes) == 0:
            break
    color[lanes] = path.radiance
    found = {"color": color, **layers}
    return {name: found[name] for name in job.layers}


def start(
    basis: CameraBasis,
    x: Any,
    y: Any,
    width: Any,
    height: Any,
    counters: Counters,
    dtype: DTypeLike,
    sampler: str = "pcg4d",
) -> Path:
    """Return paths that leave the camera through a random point of pixels x, y (...), in floats."""
    u, v, _, _ = transport.CAMERA_SAMPLERS[sampler](*counters, np.uint32(0), dtype)
    return transport.camera_path(*camera_ray(basis, x, y, u, v, width, height))


def pixel_counter(x: Any, y: Any) -> Any:
    """Return the random generator's counter (...) of pixel x, y (...): x + 2**16 y in images of any size."""
    return rng.counter(x + MAX_IMAGE_SIDE_PX * y)


def first_hit_layers(world: World, surface: Surface, hit: Hit, direction: Directions) -> dict[str, Any]:
    """Return the feature layers (P, C) of camera rays' first hits; 0 where nothing is hit."""
    found = hit.surface < world.geometry.nothing
    return {
        "albedo": surface.reflectance,
        "normal": surface.normal,
        "depth": np.where(found, hit.t, 0.0)[..., np.newaxis],
        "position": intersection.choose_or_zero(found, surface.point),
        "direction": direction,
        "unshadowed": transport.unshadowed(world, surface),
    }


def _select(values: Any, index: Ids) -> Any:
    """Return the lanes `index` of values (P,) or (P, 3), keeping the planes of vectors apart in memory."""
    if values.ndim == 1:
        return np.take(values, index)
    return vectors.vector(*(np.take(values[:, i], index) for i in range(3)))


def join_rows(parts: list[Render]) -> Render:
    """Return one render from renders of consecutive row ranges, top to bottom."""
    layers = {name: np.concatenate([part.frame[name] for part in parts]) for name in parts[0].frame.layers}
    variance = np.concatenate([part.color_variance for part in parts])
    return Render(replace(parts[0].frame, layers=layers), variance)


def render_info(scene: Scene, job: Job) -> dict[str, str]:
    """Return what the frame's reader may want to know of its making, as text."""
    return {
        **scene.info,
        "scene": scene.name,
        "scene_digest": scene_digest(scene),
        "spp": str(job.spp),
        "seed": str(job.seed),
        **_feature_facts(job),
        **{
            name: str(value)
            for name, value in job.settings.facts().items()
            if name in ("max_depth", "sampler")
        },
    }


def _feature_facts(job: Job) -> dict[str, str]:
    """Return what is said of features' rays: shadow rays, own rays, and their source if it is another one."""
    facts = {SHADOW_RAYS: str(job.shadow_rays)} if job.shadow_rays else {}
    if feature_job(job) is not None:
        facts[FEATURE_SPP] = str(job.feature_spp)
    return {**facts, **({FEATURE_SAMPLER: source} if (source := other_sampler(job)) else {})}
