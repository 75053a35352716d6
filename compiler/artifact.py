"""What the compiler hands out: source, weights and a manifest that says how to call it and what it promises.

Everything is a function of programs, target and profile, to the byte: no time, no path, no machine.
[`write`] writes all files of an artifact under names that nobody else has, then gives them their own names
one by one, the manifest last; it carries the hashes of the others: a mixture with another artifact shows.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.writing import making_parents, write_together
from .core.ir import Image
from .kernel.interface import Interface, staged
from .proof.evidence import FIRST_PASS as FIRST_PASS

SCHEMA = "wamnet-artifact-1"
"""Name and version of the manifest's form; described in spec/kernel_interface.md."""

WEIGHTS_NAME = "weights.bin"
"""File of the weights: little-endian float32, nothing else."""

CERTIFICATE_NAME = "denoise.certificate.json"
"""File of the proof of the bound, beside kernels that have one [certificate.py]."""

MANIFEST_NAME = "manifest.json"
"""File of the manifest."""

NONE = np.zeros(0, np.float32)
"""The weights of a kernel that has none."""


@dataclass(frozen=True)
class Artifact:
    """A compiled kernel of any role.

    `programs` are what was emitted, after all passes, for what interprets them; `kernel` is the same as data
    of the kernel IR.
    `images` are the encoded images that it reads, or writes where it reads none. A network's has a `plan`;
    `before` is the kernel that writes the only image of this one, of a first layer in two passes [factor.py];
    `certificate`: the proof of the bound, as JSON's types.
    """

    source: str
    manifest: Mapping[str, Any]
    interface: Interface
    images: tuple[Image, ...] = ()
    programs: Any = None
    kernel: Any = None
    weights: NDArray[np.float32] = field(default_factory=lambda: NONE)
    plan: Any = None
    before: Artifact | None = None
    certificate: Mapping[str, Any] | None = None

    @property
    def target(self) -> str:
        """Return the name of the target."""
        return str(self.manifest["target"])

    @property
    def profile(self) -> str:
        """Return the name of the profile."""
        return str(self.manifest["profile"]["name"])

    @property
    def role(self) -> str:
        """Return what the kernel does."""
        return self.interface.role

    @property
    def entry_point(self) -> str:
        """Return the name of the kernel's function."""
        return str(self.manifest["entry_point"])

    @property
    def digest(self) -> str:
        """Return the hash that names this artifact: of source and weights."""
        return str(self.manifest["digest"])

    @property
    def source_name(self) -> str:
        """Return the name of the source's file."""
        files: Mapping[str, str] = self.manifest["files"]
        return next(name for name in files if name != WEIGHTS_NAME and not name.startswith(FIRST_PASS))

    @property
    def lanes(self) -> int:
        """Return how many paths a work item follows at once, or how many pixels of a row it computes."""
        return int(self.manifest.get("lanes", 1))

    @property
    def planes(self) -> tuple[str, ...]:
        """Return what the planes of sums are that it writes or reads, in order."""
        return tuple(self.manifest.get("planes", ()))

    @property
    def channels(self) -> int:
        """Return the number of channels of a network's result."""
        return int(self.manifest["output"]["channels"])

    @property
    def kernels(self) -> tuple[Artifact, ...]:
        """Return the kernels in the order in which they run: one, or two passes."""
        return (self.before, self) if self.before else (self,)

    @property
    def launches(self) -> tuple[Artifact, ...]:
        """Return a kernel of several launches as one of each, with its source and entry point; else none."""
        found, schedule = [], self.manifest.get("schedule", {})
        for number, entry in enumerate(schedule.get("entries", ())):
            parts = {name: [schedule[name][number]] for name in ("launches", "entries", "arrays")}
            own = {"entry_point": entry, "schedule": {**schedule, **parts}}
            text = self.source if str(number) in entry else staged(self.source, number)
            found.append(replace(self, source=text, manifest={**self.manifest, **own}))
        return tuple(found)

    def contents(self) -> Mapping[str, bytes]:
        """Return all files except the manifest, by name."""
        own = {self.source_name: self.source.encode()}
        if WEIGHTS_NAME in self.manifest["files"]:
            own[WEIGHTS_NAME] = weight_bytes(self)
        first = self.before.contents() if self.before else {}
        if self.certificate:
            own[CERTIFICATE_NAME] = (json.dumps(self.certificate, allow_nan=False) + "\n").encode()
        return {**{f"{FIRST_PASS}{name}": data for name, data in first.items()}, **own}


class SmoothKernels(NamedTuple):
    """What runs one after another: `guide`, `smooth` once a level, `encode`."""

    guide: Artifact
    smooth: Artifact
    encode: Artifact


def weight_bytes(artifact: Artifact) -> bytes:
    """Return the weights as they are written."""
    return artifact.weights.astype("<f4").tobytes()


def schedule_text(picked: Mapping[str, Any]) -> str:
    """Return what a manifest says about its schedule, for a reader."""
    found = f"{picked['name']}: {picked['idea']}"
    return f"{found} (not {picked['asked']}: {picked['reason']})" if "reason" in picked else found


def manifest_text(artifact: Artifact) -> str:
    """Return the manifest as it is written."""
    return json.dumps(artifact.manifest, indent=2, sort_keys=True, allow_nan=False) + "\n"


def files_of(artifact: Artifact) -> dict[str, bytes]:
    """Return all files of an artifact by name, the manifest last."""
    return {**artifact.contents(), MANIFEST_NAME: manifest_text(artifact).encode()}


def write(artifact: Artifact, folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write source, weights if there are any, and manifest into `folder`; no file is ever seen half written.

    Others may write there at once. What fails before the first file has its name leaves the folder as it was,
    or none if there was none.
    """
    target = Path(folder)
    files = {target / name: content for name, content in files_of(artifact).items()}
    with making_parents(target):
        write_together(files)
    return tuple(files)
