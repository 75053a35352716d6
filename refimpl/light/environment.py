"""Light from infinitely far: a sky that is a function of direction, with a soft sun.

1. [`radiance`]: three colours, blended linearly in the height y of the direction (zenith above, ground below,
   horizon between), and a sun whose radiance has the shape of a spherical Cauchy density (sampling.py).
2. [`sample`] draws a direction towards the sun's lobe or, for the sky, from all directions alike; in which
   proportion follows from their light [`build`]. Both are one density with two concentrations.
3. [`pdf`] is the mixture's density, for multiple importance sampling.
4. Where the sun is, is a layer of a frame: what it lights through glass, no path of the pixel tells
   [`with_sun`].

The lobe is rational: exponentials, powers and tables are not among the operations that all executors have in
common, and a table of an image of the sky would be read at random by every path of a work item. Its wide
skirt looks like the glow around a sun in haze."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .. import vectors
from ..frame import SUN, Frame
from ..vectors import Directions, Floats, Normals, Radiance, Truths
from . import sampling
from .scene import Scene, Sky


@dataclass(frozen=True)
class Environment:
    """A sky as constants of one float type: colours and the sun's unit direction (3,), numbers ().

    sun_share is the probability with which a sample is drawn for the sun.
    """

    zenith: Radiance
    horizon: Radiance
    ground: Radiance
    sun: Directions
    irradiance: Radiance
    concentration: Floats
    sun_share: Floats


def build(sky: Sky, dtype: DTypeLike) -> Environment:
    """Return the sky's constants; they are computed in float64 and then rounded to dtype.

    The sky's light, summed over all directions, is pi (zenith + 2 horizon + ground); the sun's is its
    irradiance. Samples are shared out in proportion, by the sums of the channels.
    """
    everywhere = np.pi * (sum(sky.zenith) + 2.0 * sum(sky.horizon) + sum(sky.ground))
    total = sum(sky.sun_irradiance) + everywhere
    share = sum(sky.sun_irradiance) / total if total > 0.0 else 0.0
    sun = vectors.normalize(np.array(sky.sun_direction, np.float64))
    parts = (sky.zenith, sky.horizon, sky.ground, sun, sky.sun_irradiance, sky.sun_concentration, share)
    return Environment(*(np.asarray(part, dtype) for part in parts))


def sun_of(scene: Scene) -> NDArray[np.float64] | None:
    """Return the unit direction (3,) towards the sun of a scene, or None where there is none."""
    sky = scene.environment
    if sky is None or not any(sky.sun_irradiance):
        return None
    return np.asarray(vectors.normalize(np.array(sky.sun_direction, np.float64)), np.float64)


def with_sun(scene: Scene, frame: Frame) -> Frame:
    """Return a scene's frame with the layer `sun`, if the scene has one."""
    sun = sun_of(scene)
    if sun is None:
        return frame
    shape = (frame.height, frame.width, 3)
    layer = np.broadcast_to(sun.astype(frame.layers[next(iter(frame.layers))].dtype), shape).copy()
    return Frame({**frame.layers, SUN: layer}, frame.info)


def radiance(sky: Environment, direction: Directions) -> Radiance:
    """Return the radiance (..., 3) that comes from unit directions (..., 3)."""
    glow = sampling.spherical_cauchy_pdf(_versine(sky, direction), sky.concentration)
    return gradient(sky, direction) + glow[..., np.newaxis] * sky.irradiance


def gradient(sky: Environment, direction: Directions) -> Radiance:
    """Return the radiance (..., 3) from unit directions (..., 3) without the sun's."""
    height = direction[..., 1]
    pole = vectors.choose(height > 0.0, sky.zenith, sky.ground)
    return sky.horizon + vectors.scale(pole - sky.horizon, np.abs(height))


def sample(sky: Environment, u_choice: Floats, u0: Floats, u1: Floats) -> Directions:
    """Map u_choice, u0, u1 (...) to unit directions (..., 3), towards the sun or from anywhere."""
    concentration = np.where(u_choice < sky.sun_share, sky.concentration, np.zeros_like(u0))
    local = sampling.sample_spherical_cauchy(u0, u1, concentration)
    return sampling.to_world(local, np.zeros_like(local) + sky.sun)


def power(sky: Environment) -> tuple[Floats, Floats]:
    """Return the sun's irradiance () and the mean radiance () of the rest, both as sums of the channels."""
    mean = (sky.zenith + sky.horizon + sky.horizon + sky.ground) / 4
    return sky.irradiance[0] + sky.irradiance[1] + sky.irradiance[2], mean[0] + mean[1] + mean[2]


def towards(sky: Environment, normal: Normals, sunny: Truths, u0: Floats, u1: Floats) -> Directions:
    """Map u0, u1 (...) to unit directions (..., 3): into the sun's lobe, or by the cosine around normals."""
    lobe = sampling.sample_spherical_cauchy(u0, u1, np.zeros_like(u0) + sky.concentration)
    local = vectors.choose(sunny, lobe, sampling.sample_cosine_hemisphere(u0, u1))
    return sampling.to_world(local, vectors.choose(sunny, np.zeros_like(local) + sky.sun, normal))


def pdf(sky: Environment, direction: Directions) -> Floats:
    """Return the density (...), in 1/sr, with which [`sample`] finds directions (..., 3)."""
    lobe = sampling.spherical_cauchy_pdf(_versine(sky, direction), sky.concentration)
    return sky.sun_share * lobe + (1.0 - sky.sun_share) * (0.25 * sampling.INV_PI)


def _versine(sky: Environment, direction: Directions) -> Floats:
    """Return 1 - cos (...) of the angle to the sun: half the squared chord, which keeps its digits near 0."""
    chord = direction - sky.sun
    return 0.5 * vectors.dot(chord, chord)
