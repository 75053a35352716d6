"""The kinds of shapes: a new one is a file in this folder, a line in the registry and a list of `Scene`."""

from __future__ import annotations

from collections.abc import Mapping

from .box import Box
from .quad import Light, Quad
from .shape import Group, Shape
from .sphere import Sphere

__all__ = ["SHAPES", "Box", "Group", "Light", "Quad", "Shape", "Sphere", "kinds"]

SHAPES: Mapping[str, type[Shape]] = {kind.kind: kind for kind in (Box, Sphere, Quad)}
"""Every kind of shape by the name of its list in scenes."""


def kinds() -> list[type[Shape]]:
    """Return the kinds in the order of surface ids; quads come last, for lights are numbered after them."""
    return [*(kind for kind in SHAPES.values() if kind is not Quad), Quad]
