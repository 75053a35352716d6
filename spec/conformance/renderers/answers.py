"""Closed forms of what a renderer must show, in float64: light over matte floors, glass, metal, and rays.

1. Direct light of a rectangle and of a sphere [`rectangle_irradiance`], [`sphere_irradiance`].
2. Glass: Fresnel's share [`fresnel`], a pane with all that goes back and forth in it [`pane`], and what a
   matte floor close below a wide pane shows under a white sky [`floor_below_pane`].
3. Metal that is a microscopic landscape of mirrors: what it shows of a white sky [`rough_metal`]; a mirror's
   colour where it fades to white [`schlick`].
4. Camera rays against a plane, for the layers of a picture [`plane_hits`].

Every formula is written a second time here: nothing of the renderer's own code is asked, except its camera's
definition of a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.light.camera import camera_basis, camera_ray
from wamnet.refimpl.light.scene import Camera

NODES = 64
"""Nodes of a Gauss-Legendre rule: the integrands are smooth, and 32 give the same ten digits."""

GRID = 600
"""Cells along each variable of a metal's integral; a half as many change the fifth digit."""

SUBPIXELS = 8
"""Rays along each side of a pixel for its mean distance; the error is that of a midpoint rule, below 1e-5."""

Rectangle = tuple[float, float, float, float]
"""Ends of a rectangle in a horizontal plane: x from, x to, z from, z to."""


def rectangle_irradiance(x: float, z: float, rectangle: Rectangle, height: float) -> float:
    """Return the irradiance at (x, 0, z), facing up, of a rectangle of radiance 1 above that faces down.

    Four corners with signs of the form factor from a small surface to a parallel rectangle with a corner
    above it (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-3), times pi.
    """

    def corner(a: float, b: float) -> float:
        p, q = a / height, b / height
        s, t = np.hypot(1.0, p), np.hypot(1.0, q)
        return float(0.5 * (p / s * np.arctan(q / s) + q / t * np.arctan(p / t)))

    x0, x1, z0, z1 = rectangle[0] - x, rectangle[1] - x, rectangle[2] - z, rectangle[3] - z
    return corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0)


def sphere_irradiance(radius: float, distance: float) -> float:
    """Return the irradiance of a surface that faces a sphere of radiance 1: pi (radius / distance)^2."""
    return float(np.pi * (radius / distance) ** 2)


def schlick(reflectance: Sequence[float], cosine: float) -> tuple[float, ...]:
    """Return a colour of metal at an angle: r + (1 - r) (1 - cosine)^5 (Schlick 1994, equation 15)."""
    return tuple(r + (1.0 - r) * (1.0 - cosine) ** 5 for r in reflectance)


def fresnel(cosine: Any, ior: float) -> Any:
    """Return the share (...) of unpolarised light that glass of an index mirrors, for cosines (...) outside.

    Fresnel's equations: Born and Wolf, "Principles of Optics", 1999, section 1.5.2.
    """
    inside = np.sqrt(1.0 - (1.0 - np.asarray(cosine) ** 2) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    return 0.5 * (across**2 + along**2)


def pane(cosine: Any, ior: float) -> Any:
    """Return the share (...) that passes a pane, all ways back and forth in it added: (1 - F) / (1 + F).

    (1 - F)^2 (1 + F^2 + F^4 + ...), each reflection being that of unpolarised light, as renderers have it.
    """
    share = fresnel(cosine, ior)
    return (1.0 - share) / (1.0 + share)


def floor_below_pane(reflectance: float, ior: float) -> float:
    """Return the radiance of a matte floor close below a wide pane under a sky of radiance 1.

    Of what comes from angle theta the share T is the sky's, and 1 - T is the floor's own, mirrored: L = rho
    (T' + (1 - T') L) with T' the mean of T over the cosine-weighted hemisphere.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    cosine = 0.5 * (nodes + 1.0)
    passes = float(np.sum(weights * cosine * pane(cosine, ior)))
    return reflectance * passes / (1.0 - reflectance * (1.0 - passes))


def rough_metal(angle_deg: float, alpha: float, correlated: bool = True) -> float:
    """Return what a white metal of GGX roughness alpha shows of a white sky at an angle: single scattering.

    The mean of G2 (o . m) / ((o . n) (m . n)) over normals m drawn in proportion to D (m . n); masking by
    Smith (Heitz, JCGT 3(2), 2014), height-correlated or as the product of both directions' own.
    """
    u, v = np.meshgrid((np.arange(GRID) + 0.5) / GRID, (np.arange(GRID // 2) + 0.5) / (GRID // 2))
    # The plane of o and n is one of symmetry: half a turn of phi has the mean of a whole one.
    tangent, phi = alpha * np.sqrt(u / (1.0 - u)), np.pi * v
    height = 1.0 / np.sqrt(1.0 + tangent**2)
    across, along = np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))
    cosine = height * (across * tangent * np.cos(phi) + along)
    up = 2.0 * cosine * height - along
    seen = (cosine > 0.0) & (up > 0.0)

    def slope(z: Any) -> Any:
        return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / z**2 - 1.0)) - 1.0)

    out, back = slope(along), slope(np.where(seen, up, 1.0))
    masking = 1.0 / (1.0 + out + back) if correlated else 1.0 / ((1.0 + out) * (1.0 + back))
    return float(np.mean(np.where(seen, masking * cosine / (along * height), 0.0)))


def plane_hits(
    camera: Camera, size: int, block: tuple[int, int, int, int], normal: Any
) -> tuple[float, float, NDArray[np.float64]]:
    """Return means over a block (top, left, height, width) of a square picture for the plane normal . p = 0.

    They are the distance along the ray, the distance along the view, and the point (3,).
    """
    top, left, height, width = block
    steps: Any = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS
    rays: Any = np.meshgrid(
        np.arange(top, top + height), np.arange(left, left + width), steps, steps, indexing="ij"
    )
    y, x, v, u = rays
    basis = camera_basis(camera)
    origin, direction = camera_ray(basis, x.astype(float), y.astype(float), u, v, size, size)
    t = -(origin @ normal) / (direction @ normal)
    point = origin + t[..., np.newaxis] * direction
    return float(t.mean()), float((t * (direction @ basis.forward)).mean()), point.reshape(-1, 3).mean(axis=0)
