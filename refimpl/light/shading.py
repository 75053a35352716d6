"""The materials of a scene at a vertex: each kind that the scene has is computed, the surface's own is kept.

1. [`build`] finds the kinds of material that the scene has, and lays out which surface is of which kind, and
   each kind's numbers, as tables by surface id [`Materials`].
2. [`site`] gathers what the materials ask for at a vertex.
3. [`scattered`], [`value`] and [`pdf`] ask every kind, and select by the surface's id. With one kind there is
   nothing to select.

Inside and outside: boxes and spheres are convex, so a normal points out of the body where it points away from
the centre. The normal itself faces the path, so that tells on which side the path is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from .. import vectors
from ..vectors import Colors, Directions, Floats, Truths
from . import intersection
from .intersection import Hit, Surface
from .materials import Lambertian, Material, Scattered, Site
from .scene import Scene


@dataclass(frozen=True)
class Materials:
    """The kinds of material of a scene, and tables by surface id (S+1,), one for each kind.

    is_kind tells who is of the kind; parameters are the kind's numbers, or None where it has none. centers
    (S+1, 3) are those of bodies that light passes into, or None where there are none. A path ends at
    surfaces numbered `ends` and higher.
    """

    kinds: tuple[type[Material], ...]
    is_kind: tuple[Any, ...]
    parameters: tuple[Any, ...]
    centers: Any
    ends: int

    @property
    def single(self) -> bool:
        """Whether all kinds scatter into single directions, which no light sample meets."""
        return all(kind.single for kind in self.kinds)

    @property
    def by_kind(self) -> tuple[Any, ...]:
        """Return the kinds, who is of each, and each one's numbers."""
        return self.kinds, self.is_kind, self.parameters


def build(scene: Scene, dtype: DTypeLike) -> Materials:
    """Lay out the materials of a scene; surfaces without one are Lambertian."""
    rows = [(material or Lambertian(), center) for material, center in intersection.materials_by_id(scene)]
    found = [material for material, _ in rows] or [Lambertian()]
    kinds = tuple(dict.fromkeys(type(material) for material in found))
    # Lights and "nothing" scatter nothing. They belong to the first kind, which takes no selection; their
    # reflectance is 0, so a path's throughput is 0 there, and only where that kind reflects even so (a metal
    # at grazing angles) is the path ended by the light's number.
    ends = len(rows) if kinds[0].black_reflects else len(rows) + len(scene.lights)
    owners = [type(material) for material, _ in rows] + [kinds[0]] * (len(scene.lights) + 1)
    bodies = [center for material, center in rows if material.transmits]
    centers = [center if material.transmits else bodies[0] for material, center in rows] if bodies else []
    return Materials(
        kinds,
        tuple(np.array([owner is kind for owner in owners]) for kind in kinds),
        tuple(_parameters(kind, found, len(owners), dtype) for kind in kinds),
        np.asarray(centers + bodies[:1] * (len(scene.lights) + 1), dtype) if bodies else None,
        ends,
    )


def _parameters(kind: type[Material], found: list[Material], count: int, dtype: DTypeLike) -> Any:
    """Return the numbers (S+1,) of one kind; surfaces of other kinds repeat its first one."""
    given = [material.parameter for material in found if isinstance(material, kind)]
    if given[0] is None:
        return None
    rows = [material.parameter if isinstance(material, kind) else given[0] for material in found]
    return np.asarray(rows + given[:1] * (count - len(rows)), dtype)


def site(materials: Materials, surface: Surface, hit: Hit, direction: Directions, beta: Colors) -> Site:
    """Return the vertices where rays of the given direction (..., 3) and throughput beta (..., 3) arrived."""
    tinted = beta * surface.reflectance
    outside = None
    if materials.centers is not None:
        from_center = surface.point - vectors.look_up_rows(materials.centers, hit.surface)
        outside = vectors.dot(surface.normal, from_center) > 0.0
    return Site(-direction, surface.normal, outside, surface.reflectance, beta, tinted, None)


def scattered(
    materials: Materials, at: Site, hit: Hit, u0: Floats, u1: Floats, u_choice: Floats
) -> Scattered:
    """Return how paths continue, each by the material of its surface, for three uniform numbers (...)."""
    return Scattered(*_ask(materials, at, hit, lambda kind, own: kind.sample(own, u0, u1, u_choice)))


def value(
    materials: Materials, at: Site, hit: Hit, wi: Directions, cos_surface: Floats
) -> tuple[Colors, Floats]:
    """Return a colour (..., 3) and a factor (...) whose product is beta f cos for light from wi (..., 3)."""
    color, factor = _ask(materials, at, hit, lambda kind, own: kind.value(own, wi, cos_surface))
    return color, factor


def pdf(materials: Materials, at: Site, hit: Hit, wi: Directions, cos_surface: Floats) -> Floats:
    """Return the density (...), in 1/sr, with which [`scattered`] finds wi (..., 3)."""
    density: Floats
    (density,) = _ask(materials, at, hit, lambda kind, own: (kind.pdf(own, wi, cos_surface),))
    return density


def ever_follows(materials: Materials) -> bool:
    """Tell whether features look past any surface of the scene."""
    rows = zip(*materials.by_kind, strict=True)
    return any(bool(np.any(is_kind & kind.follows(parameters))) for kind, is_kind, parameters in rows)


def follows(materials: Materials, hit: Hit) -> Truths:
    """Tell (...) whether features look past the surface that was hit, as its material says."""
    told: Truths = hit.surface < 0  # nobody yet
    for kind, is_kind, parameters in zip(*materials.by_kind, strict=True):
        own = None if parameters is None else vectors.look_up(parameters, hit.surface)
        said = kind.follows(own)
        if said is not False:
            told = told | (vectors.look_up(is_kind, hit.surface) & said)
    return told


def _ask(
    materials: Materials, at: Site, hit: Hit, question: Callable[[type[Material], Site], Any]
) -> list[Any]:
    """Return the parts of all kinds' answers, each that of the surface's own kind."""
    answers = []
    for kind, parameters in zip(materials.kinds, materials.parameters, strict=True):
        own = None if parameters is None else vectors.look_up(parameters, hit.surface)
        answers.append(question(kind, at._replace(parameter=own)))
    found = [*answers[0]]
    others = [vectors.look_up(is_kind, hit.surface) for is_kind in materials.is_kind[1:]]
    for is_kind, answer in zip(others, answers[1:], strict=True):
        found = [_either(is_kind, *parts) for parts in zip(answer, found, strict=True)]
    return found


def _either(is_kind: Truths, a: Any, b: Any) -> Any:
    """Return a (...) or (..., 3) where is_kind (...) holds, else b; None, who passes through, is nobody."""
    if a is None and b is None:
        return None
    a, b = (False if part is None else part for part in (a, b))
    is_vector = getattr(a, "ndim", 0) > is_kind.ndim
    return vectors.choose(is_kind, a, b) if is_vector else np.where(is_kind, a, b)
