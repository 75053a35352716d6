"""All kinds of cases, by name: a new one is a module here and a line in `KINDS` or `FUNCTIONS`."""

from __future__ import annotations

from collections.abc import Mapping

from ..case import Kind
from ..functions import Function
from . import (
    files,
    images,
    integers,
    light,
    materials,
    network,
    numbers,
    paths,
    pictures,
    rare,
    records,
    scene_files,
    smoothing,
    surfaces,
    whole,
)

FUNCTIONS: Mapping[str, Function] = {
    f.name: f for f in (*numbers.FUNCTIONS, *light.FUNCTIONS, *surfaces.FUNCTIONS, *materials.FUNCTIONS)
}
"""Kinds that are functions of numbers, which executors can run."""

KINDS: Mapping[str, Kind] = {
    kind.name: integers.asked(rare.asked(kind))
    for kind in (
        *numbers.KINDS,
        *light.KINDS,
        *paths.KINDS,
        *network.KINDS,
        *images.KINDS,
        *smoothing.KINDS,
        *records.KINDS,
        *files.KINDS,
        *scene_files.KINDS,
        *pictures.KINDS,
        *whole.KINDS,
        *(function.kind() for function in FUNCTIONS.values()),
    )
}
"""Kinds by name."""
