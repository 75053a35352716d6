"""Kernels that are kept between runs, in the cache folder: a second command compiles nothing.

What a device reads of a kernel is written as data of JSON's types [`data_of`] and read back as a kernel
without its program or plan [`KeptKernel`], so that the compiler is not even imported. The entry's name holds
all that the kernels depend on; its checksum is that of the cache [cache.py].
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.ir import Image
from ...compiler.kernel.interface import Array, Interface, launches
from .. import cache
from ..devices.kernel import Kernel

SAME = ("source", "manifest", "target", "profile", "entry_point", "digest")
"""Fields that are JSON's types by themselves."""


@dataclass(frozen=True)
class KeptKernel:
    """A kernel as a device sees it; fields that its role does not have are empty."""

    source: str
    manifest: Mapping[str, Any]
    target: str
    profile: str
    entry_point: str
    digest: str
    interface: Interface
    images: tuple[Image, ...]
    planes: tuple[str, ...]
    lanes: int
    channels: int
    weights: NDArray[np.float32]
    before: KeptKernel | None

    @property
    def kernels(self) -> tuple[KeptKernel, ...]:
        """Return the kernels in the order in which they run."""
        return (self.before, self) if self.before else (self,)

    @property
    def launches(self) -> tuple[KeptKernel, ...]:
        """Return a kernel of several launches as one of each."""
        found = launches(self.source, self.manifest)
        return tuple(replace(self, source=s, manifest=m, entry_point=m["entry_point"]) for s, m in found)


def kept_kernels(
    kind: str, parts: Sequence[object], compiled: Callable[[], Sequence[Kernel]]
) -> list[KeptKernel]:
    """Return the kernels that depend on `parts`, from the cache, or compiled and put there."""

    def data() -> list[dict[str, Any]]:
        return [data_of(kernel) for kernel in compiled()]

    entry = cache.kept(kind, parts, data)
    with suppress(KeyError, TypeError, ValueError):
        if kernels := [kernel_of(each) for each in entry]:
            return kernels
    # An entry of the right name and checksum that this program has not written.
    return [kernel_of(each) for each in data()]


def data_of(kernel: Any) -> dict[str, Any]:
    """Return a kernel as JSON's types."""
    before = getattr(kernel, "before", None)
    weights = getattr(kernel, "weights", np.zeros(0, np.float32)).astype("<f4").tobytes()
    return {
        **{name: getattr(kernel, name) for name in SAME},
        "interface": asdict(kernel.interface),
        "images": [asdict(image) for image in getattr(kernel, "images", ())],
        "planes": list(getattr(kernel, "planes", ())),
        **{name: getattr(kernel, name, 0) for name in ("lanes", "channels")},
        "weights": base64.b64encode(weights).decode(),
        "before": data_of(before) if before else None,
    }


def kernel_of(data: Mapping[str, Any]) -> KeptKernel:
    """Return the kernel that [`data_of`] wrote."""
    taken = data["interface"]
    arrays = tuple(Array(**{**array, "shape": tuple(array["shape"])}) for array in taken["arrays"])
    return KeptKernel(
        **{name: data[name] for name in SAME},
        interface=Interface(taken["role"], arrays, tuple(taken["integers"])),
        images=tuple(Image(**facts) for facts in data["images"]),
        planes=tuple(data["planes"]),
        lanes=int(data["lanes"]),
        channels=int(data["channels"]),
        weights=np.frombuffer(base64.b64decode(data["weights"]), "<f4").astype(np.float32),
        before=kernel_of(data["before"]) if data["before"] else None,
    )
