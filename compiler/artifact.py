"""What the compiler hands out: source, weights and a manifest that says how to call it and what it promises.

Everything is a function of program, target and profile, to the byte: no time, no path, no machine.
[`write`] writes all files of an artifact (a denoiser's, or a scene's: path_kernel.py) under names that nobody
else has, then gives them their own names one by one, the manifest last; it carries the hashes of the others:
a mixture with another artifact shows.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..models.writing import making_parents, write_together
from .core.ir import Image, Program
from .kernel import interface
from .kernel.interface import Interface

if TYPE_CHECKING:
    from .plan import Plan

SCHEMA = "wamnet-artifact-1"
"""Name and version of the manifest's form; described in spec/kernel_interface.md."""


@dataclass(frozen=True)
class Artifact:
    """A compiled kernel of a plan; `program` is what was emitted, after all passes.

    `before`: the kernel that writes the only image of this one, of a first layer in two passes [factor.py];
    `certificate`: the proof of the bound, as JSON's types.
    """

    plan: Plan
    source: str
    source_name: str
    program: Program
    weights: NDArray[np.float32]
    manifest: Mapping[str, Any]
    before: Artifact | None = None
    certificate: Mapping[str, Any] | None = None

    @property
    def target(self) -> str:
        """Return the name of the target."""
        return self.plan.target.name

    @property
    def profile(self) -> str:
        """Return the name of the profile."""
        return self.plan.profile.name

    @property
    def entry_point(self) -> str:
        """Return the name of the kernel's function."""
        return str(self.manifest["entry_point"])

    @property
    def digest(self) -> str:
        """Return the hash that names this artifact: of source and weights."""
        return str(self.manifest["digest"])

    @property
    def images(self) -> tuple[Image, ...]:
        """Return the images that the window is filled from, in order."""
        assert self.program.gather is not None, "kernels have windows"
        return self.program.gather.images

    @property
    def channels(self) -> int:
        """Return the number of channels of the result."""
        return int(self.manifest["output"]["channels"])

    @property
    def interface(self) -> Interface:
        """Return what the kernel is bound to, in its language."""
        dialect = self.plan.target.dialect
        assert dialect is not None, "the interpreter binds nothing"
        size, taken = self.weights.size, dialect.integers[interface.DENOISE]
        found = interface.denoiser(self.images, size, self.channels, dialect.home, taken)
        memory = self.manifest["schedule"].get("memory")
        return found.handing_on(memory) if memory else found

    @property
    def kernels(self) -> tuple[Artifact, ...]:
        """Return the kernels in the order in which they run: one, or two passes."""
        return (self.before, self) if self.before else (self,)

    @property
    def launches(self) -> tuple[Artifact, ...]:
        """Return a kernel of several launches as one of each, with its source and entry point; else none."""
        found = interface.launches(self.source, self.manifest)
        return tuple(replace(self, source=source, manifest=manifest) for source, manifest in found)

    def contents(self) -> Mapping[str, bytes]:
        """Return all files except the manifest, by name."""
        own = {self.source_name: self.source.encode(), WEIGHTS_NAME: weight_bytes(self)}
        first = self.before.contents() if self.before else {}
        if self.certificate:
            own[CERTIFICATE_NAME] = (json.dumps(self.certificate, allow_nan=False) + "\n").encode()
        return {**{f"{FIRST_PASS}{name}": data for name, data in first.items()}, **own}


FIRST_PASS = "horizontal."
"""What the names of the first pass's files begin with."""

WEIGHTS_NAME = "weights.bin"
"""File of the weights: little-endian float32, nothing else."""

CERTIFICATE_NAME = "denoise.certificate.json"
"""File of the proof of the bound, beside kernels that have one [certificate.py]."""

MANIFEST_NAME = "manifest.json"
"""File of the manifest."""


class OneSource:
    """What artifacts of a manifest and one more file have in common."""

    source: str
    source_name: str
    manifest: Mapping[str, Any]

    @property
    def digest(self) -> str:
        """Return the hash that names this artifact: of its source."""
        return str(self.manifest["digest"])

    @property
    def kernels(self) -> tuple[Any, ...]:
        """Return the kernels in the order in which they run: this one."""
        return (self,)

    def contents(self) -> Mapping[str, bytes]:
        """Return all files except the manifest, by name."""
        return {self.source_name: self.source.encode()}


class Files(Protocol):
    """An artifact of any kind: a manifest, and files beside it."""

    @property
    def manifest(self) -> Mapping[str, Any]:
        """Return what the manifest says, as JSON's types."""

    def contents(self) -> Mapping[str, bytes]:
        """Return all files except the manifest, by name."""


def weight_bytes(artifact: Artifact) -> bytes:
    """Return the weights as they are written."""
    return artifact.weights.astype("<f4").tobytes()


def schedule_text(picked: Mapping[str, Any]) -> str:
    """Return what a manifest says about its schedule, for a reader."""
    found = f"{picked['name']}: {picked['idea']}"
    return f"{found} (not {picked['asked']}: {picked['reason']})" if "reason" in picked else found


def manifest_text(artifact: Files) -> str:
    """Return the manifest as it is written."""
    return json.dumps(artifact.manifest, indent=2, sort_keys=True, allow_nan=False) + "\n"


def write(artifact: Files, folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write source, weights if there are any, and manifest into `folder`; no file is ever seen half written.

    Others may write there at once. What fails before the first file has its name leaves the folder as it was,
    or none if there was none.
    """
    target = Path(folder)
    contents = {**artifact.contents(), MANIFEST_NAME: manifest_text(artifact).encode()}
    files = {target / name: content for name, content in contents.items()}
    with making_parents(target):
        write_together(files)
    return tuple(files)
