"""Features through mirrors and glass: what a path meets first that is not one of them, over lanes.

The first hit of a camera ray says nothing of what a mirror shows. Here a path's features are those of the
first vertex at which it is not followed any further:

1. Each material says whether a path is followed beyond it (`follows`, materials/material.py): past mirrors
   and glass, and past metals that are nearly mirrors. What reflects nothing (a lamp, the sky) is an end.
2. The way is that of the path itself: no ray is traced, and no number drawn, for a feature. Glass mirrors or
   refracts as the path does [`transport.scatter`], so features belong to the colour of the same sample.
3. [`see`] is called after each arrival with the way so far [`Way`]. At its end it gives the layers, anywhere
   else 0, so that a driver adds them up: reflectance times the path's throughput, the normal and the point of
   that surface in world space, and the length of the way.
4. A path is followed past [`MOST_FOLLOWED`] surfaces at most, and to `max_depth`: the surface there is the
   end whatever it is [`most_followed`]. Where no material is followed the layers are those of the first hit.

Source of the idea: Intel Open Image Denoise, documentation, section on albedos: for perfectly specular
surfaces to follow the path to the first diffuse or glossy one, with the product of the albedos on the way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .. import vectors
from ..vectors import Directions, Floats, Truths
from . import intersection, shading
from .intersection import Hit, Surface
from .transport import Path, World

MOST_FOLLOWED = 4
"""Most surfaces past which a path is followed: through two bodies of glass, one behind the other."""


class Way(NamedTuple):
    """Whether a path is still followed (...), and the length (...) from the camera to its last vertex."""

    going: Truths
    length: Floats


def begin(direction: Directions) -> Way:
    """Return the way of paths that leave the camera in a direction (..., 3)."""
    length = np.zeros_like(direction[..., 0])
    return Way(length == 0.0, length)


def most_followed(world: World) -> int:
    """Return past how many surfaces a path of this world is followed at most: 0 where no material is."""
    return min(MOST_FOLLOWED, world.settings.max_depth) if shading.ever_follows(world.materials) else 0


def see(
    world: World, way: Way, path: Path, surface: Surface, hit: Hit, depth: Any, most: int
) -> tuple[Way, dict[str, Any]]:
    """Return the way after an arrival, and the layers (...) and (..., 3) where it ends here, else 0.

    depth (...) counts the scatterings so far, as uint32; most is that of [`most_followed`].
    """
    found = hit.surface < world.geometry.nothing
    further = followed(world, surface, hit, depth, most)
    length = way.length + np.where(found, hit.t, 0.0)
    ends = way.going & ~further
    layers = {
        "seen_albedo": intersection.choose_or_zero(ends, path.beta * surface.reflectance),
        "seen_normal": intersection.choose_or_zero(ends, surface.normal),
        "seen_depth": np.where(ends & found, length, 0.0),
        "seen_position": intersection.choose_or_zero(ends & found, surface.point),
        "seen_emission": intersection.choose_or_zero(ends, path.beta * surface.emission),
    }
    return Way(way.going & further, length), layers


def followed(world: World, surface: Surface, hit: Hit, depth: Any, most: int) -> Truths:
    """Tell (...) whether a path that is still followed is followed past a surface, too."""
    found, shown = hit.surface < world.geometry.nothing, vectors.largest(surface.reflectance) > 0.0
    further: Truths = found & shown & shading.follows(world.materials, hit) & (depth < np.uint32(most))
    return further
