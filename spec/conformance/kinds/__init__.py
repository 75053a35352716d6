"""All kinds of cases, by name: a new one is a row of a module here, of `kinds.json` or `functions.json`."""

from __future__ import annotations

from collections.abc import Mapping

from ..case import Kind
from ..functions import Function
from . import files, images, light, network, numbers, paths, pictures

FUNCTIONS: Mapping[str, Function] = {f.name: f for f in (*numbers.FUNCTIONS, *light.FUNCTIONS)}
"""Kinds that are functions of numbers, which executors can run."""

KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        *numbers.KINDS,
        *light.KINDS,
        *paths.KINDS,
        *network.KINDS,
        *images.KINDS,
        *files.KINDS,
        *pictures.KINDS,
        *(function.kind() for function in FUNCTIONS.values()),
    )
}
"""Kinds by name."""
