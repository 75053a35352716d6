"""What the public module returns: kernels, certificates, and traced functions that become kernels."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compiler import artifact as artifacts
from .compiler.artifact import Artifact
from .compiler.core import ir
from .compiler.targets import ALIASES, LANGUAGES, Language, language_named
from .refimpl.errors import InputError, WamnetError, choice

PLAIN = "plain"
"""The schedule that every target has."""


def language_of(name: str, profile: str) -> Language:
    """Return the language of a target under a profile; raise InputError for an unknown target."""
    if ALIASES.get(name, name) not in LANGUAGES:
        raise InputError("target", name, "unknown", choice(name, [*ALIASES, *LANGUAGES]))
    return language_named(name).under(profile)


class CertificateError(WamnetError):
    """A bound that is not proven, or a source that does not compute the proven program, or is not checked."""


@dataclass(frozen=True)
class Certificate:
    """A bound that has been proven again, step by step, and a source that has been checked against it.

    `bound`: largest absolute difference of each output from the float64 reference, for all inputs in their
    ranges; empty for integer networks, whose results are exact. `sums` and `places`: how many sums of the
    source were compared, at how many positions in images of several sizes.
    """

    bound: tuple[float, ...]
    sums: int
    places: int


@dataclass(frozen=True, repr=False)
class Kernel:
    """A compiled kernel: source, weights, and a manifest with its interface and its bound."""

    artifact: Artifact

    def __repr__(self) -> str:
        """Return the target, the schedule, the sizes and the bound."""
        bound = "none" if self.bound is None else f"{max(self.bound, default=0.0):.2g}"
        size = f"{len(self.source)} characters, {self.weights.size} weights"
        return f"Kernel({self.target}, {self.schedule}; {size}; error bound {bound})"

    @property
    def target(self) -> str:
        """Name of the language or executor, such as `"opencl"`."""
        return self.artifact.target

    @property
    def schedule(self) -> str:
        """Name of the schedule, such as `"tile:16"`."""
        return str(self.artifact.manifest["schedule"]["name"])

    @property
    def source(self) -> str:
        """The source code, ready to be compiled by another program."""
        return self.artifact.source

    @property
    def weights(self) -> NDArray[np.float32]:
        """All weights (N,), in the order in which the source reads them."""
        return np.frombuffer(artifacts.weight_bytes(self.artifact), "<f4")

    @property
    def manifest(self) -> dict[str, Any]:
        """Interface, weights, schedule and bound, as JSON's types."""
        return dict(self.artifact.manifest)

    @property
    def bound(self) -> tuple[float, ...] | None:
        """Largest absolute error of each output for all inputs in their ranges; None where it is infinite."""
        bound = self.artifact.manifest["bound"]["output"]
        return None if bound is None else tuple(bound)

    def run(self, **images: NDArray[Any]) -> NDArray[np.float32]:
        """Run on this machine's device for the target, and return the output (H, W, C).

        `images` are the kernel's input images (H, W, channels) by name, within their ranges. Raises
        ExecutorUnavailable where the device or a package is missing, InputError where an image is missing,
        unknown, or of another size.

            kernel.run(color=image)
        """
        from .kernels import EXECUTORS, open_executor

        if self.target not in EXECUTORS:
            rule = f"only kernels for {', '.join(EXECUTORS)} run here"
            raise InputError("target", self.target, rule, "save it, and run it in its own host")
        arrays = {name: np.ascontiguousarray(image, np.float32) for name, image in images.items()}
        with open_executor(self.target) as executor:
            image: NDArray[np.float32] = executor.run(self.artifact, arrays)
        return image

    def save(self, folder: str | os.PathLike[str]) -> tuple[Path, ...]:
        """Write source, weights, manifest and certificate into a folder, and return the files."""
        return artifacts.write(self.artifact, folder)


@dataclass(frozen=True, repr=False)
class Function:
    """A function of NumPy arrays, traced: a program of elementary operations on one pixel's window."""

    program: ir.Program

    def __repr__(self) -> str:
        """Return the program, one operation per line."""
        return ir.text(self.program)

    def compile(self, target: str, *, profile: str = "ieee", schedule: str = PLAIN) -> Kernel:
        """Compile to a kernel; `target`, `profile` and `schedule` are those of `wamnet.compile`."""
        from .compiler.compile import compile_program

        return Kernel(compile_program(self.program, language_of(target, profile), schedule))
