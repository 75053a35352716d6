"""Names of schedules: a family, or a family and its parameter, as `tile:8`.

The parameter is the number of components of a vector (`vector`, `tile`, `fft`, `dot`), of pixels of a work
item (`group`, `groupdot`), or of points of a transform (`fftpasses`).
"""

from __future__ import annotations

from collections.abc import Iterable

from ...refimpl.errors import choice

FORMER = {
    "tile16": "tile:16", "tile8": "tile:8", "tile4": "tile:4", "vector16": "vector:16", "dot16": "dot:16",
    "fft32": "fft:16", "fft32x8": "fft:8", "fft32x4": "fft:4", "groupdot": "groupdot:4",
    "group": "group:1", "group4": "group:4", "compute": "group:1", "compute4": "group:4",
}  # fmt: skip
"""Present names by those of version 0.3, for messages."""


def parse(name: str) -> tuple[str, int | None]:
    """Return the family and the parameter of a name; None where it has none."""
    family, _, parameter = name.partition(":")
    return family, int(parameter) if parameter.isdecimal() else None


def remedy(name: str, names: Iterable[str]) -> str:
    """Return the remedy for an unknown name: the present one, those of the same family, or all `names`."""
    names, present = list(names), FORMER.get(name, name)
    if present in names:
        return f"its name is {present} now"
    return choice(present, [each for each in names if parse(each)[0] == parse(present)[0]] or names)


def split(kernel: str) -> tuple[str, str, str]:
    """Return target, schedule, and form (or nothing) of a benchmark's kernel, as of `c:tile:8:native`."""
    target, *rest = kernel.split(":")
    count = 2 if "".join(rest[1:2]).isdecimal() else 1
    return target, ":".join(rest[:count]), ":".join(rest[count:])
