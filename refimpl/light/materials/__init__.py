"""The kinds of materials: a new one is a file in this folder and a line in the registry."""

from __future__ import annotations

from collections.abc import Mapping

from .conductor import Conductor
from .dielectric import Dielectric
from .lambertian import Lambertian
from .material import Material, Scattered, Site
from .mirror import Mirror

__all__ = ["MATERIALS", "Conductor", "Dielectric", "Lambertian", "Material", "Mirror", "Scattered", "Site"]

MATERIALS: Mapping[str, type[Material]] = {
    kind.kind: kind for kind in (Lambertian, Mirror, Conductor, Dielectric)
}
"""Every kind of material by the name that scenes use."""
