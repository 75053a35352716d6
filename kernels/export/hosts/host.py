"""The hosts of `wamnet export --host`, and what each adds to an export.

A row of hosts.json is one host [`Host`]; its files are those of its folder in files/, those that several
share, and what is written from the manifest: a header or a page.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ....refimpl.errors import InputError, choice
from .headers import FILES, calling, filled, launching

SHARED = "pages"
"""The folder of what several hosts share."""

HELD = {"name": "32-bit floats", "added": 0.0, "why": "it holds what the kernel computes"}
"""The usual storage of a picture: the check pair's own."""

HEADERS = {"calling": calling, "launching": launching}
"""What writes a host's header, by its name in a row."""


@dataclass(frozen=True)
class Host:
    """One host. `shared`: names in the folder of pages; `header`: what writes `host.h`; `page`: its values.

    `run`: commands of a shell in the export's folder; `needs`: what must be there; `sees`: what it draws.
    `storage`: what holds a picture before it is read, with what it adds to the error of a number in [0, 1].
    `scenes`, `ranks`: whether it runs kernels of paths, and a first layer in two kernels. `schedule`: that
    which it wants, where it is not the usual one: spectra need more stack than some drivers of OpenCL give.
    `features`: those that it can make, where it makes them itself.
    """

    name: str
    text: str
    target: str
    run: str
    needs: str
    sees: str
    shared: Sequence[str] = ()
    header: str = ""
    page: Mapping[str, Any] = field(default_factory=dict)
    storage: Mapping[str, Any] = field(default_factory=lambda: HELD)
    scenes: bool = False
    ranks: bool = True
    schedule: str = ""
    features: Sequence[str] = ()

    def contents(self, facts: Mapping[str, Any]) -> dict[str, bytes]:
        """Return its files by name, for an export of which the manifest says `facts`.

        Programs in Python have .txt behind their names here: they are data, and no part of this package.
        """
        own = sorted((FILES / self.name).iterdir())
        found = [*own, *(FILES / SHARED / name for name in self.shared)]
        files = {path.name.removesuffix(".txt"): path.read_bytes() for path in found}
        if self.header:
            files["host.h"] = HEADERS[self.header](facts).encode()
        if self.page:
            imports = json.dumps({"imports": self.page["imports"]})
            files["index.html"] = filled("index.html", {**self.page, "imports": imports}).encode()
        return files

    def facts(self) -> dict[str, Any]:
        """Return what a manifest says about it."""
        return {"name": self.name, "run": self.run, "storage": self.storage}


def _rows() -> list[dict[str, Any]]:
    """Return the rows of all hosts."""
    found: list[dict[str, Any]] = json.loads((FILES.parent / "hosts.json").read_text(encoding="utf-8"))
    return found


HOSTS: Mapping[str, Host] = {row["name"]: Host(**row) for row in _rows()}
"""All hosts by name."""


def host_named(name: str) -> Host:
    """Return a host, or refuse a name that nobody has."""
    if name not in HOSTS:
        raise InputError("--host", name, "unknown", choice(name, HOSTS))
    return HOSTS[name]
