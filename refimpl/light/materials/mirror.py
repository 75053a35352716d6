"""A perfect mirror: all light goes into the mirrored direction, times the surface's reflectance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...vectors import Floats
from .material import SINGLE_PDF, Scattered, Single, Site, mirrored


@dataclass(frozen=True)
class Mirror(Single):
    """A mirror whose reflectance is the same at every angle."""

    kind = "mirror"

    @staticmethod
    def sample(site: Site, u0: Floats, u1: Floats, u_choice: Floats) -> Scattered:
        """Return the mirrored directions 2 (n . wo) n - wo."""
        direction, cosine = mirrored(site)
        return Scattered(direction, site.tinted, np.full_like(cosine, SINGLE_PDF), None)
