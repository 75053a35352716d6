"""Kernels that are kept between runs, in the cache folder: a second command compiles nothing.

What a device reads of a kernel is written as data of JSON's types [`data_of`] and read back as a kernel
without its program or plan [`kernel_of`], so that the compiler is not even imported. The entry's name holds
all that the kernels depend on; its checksum is that of the cache [cache.py].
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from ...compiler.artifact import Artifact, weight_bytes
from ...compiler.core.ir import Image
from ...compiler.kernel.interface import Array, Interface
from .. import cache


def kept_kernels(
    kind: str, parts: Sequence[object], compiled: Callable[[], Sequence[Artifact]]
) -> list[Artifact]:
    """Return the kernels that depend on `parts`, from the cache, or compiled and put there."""

    def data() -> list[dict[str, Any]]:
        return [data_of(kernel) for kernel in compiled()]

    entry = cache.kept(kind, parts, data)
    with suppress(KeyError, TypeError, ValueError):
        if kernels := [kernel_of(each) for each in entry]:
            return kernels
    # An entry of the right name and checksum that this program has not written.
    return [kernel_of(each) for each in data()]


def data_of(kernel: Artifact) -> dict[str, Any]:
    """Return a kernel as JSON's types."""
    return {
        "source": kernel.source,
        "manifest": kernel.manifest,
        "interface": asdict(kernel.interface),
        "images": [asdict(image) for image in kernel.images],
        "weights": base64.b64encode(weight_bytes(kernel)).decode(),
        "before": data_of(kernel.before) if kernel.before else None,
    }


def kernel_of(data: Mapping[str, Any]) -> Artifact:
    """Return the kernel that [`data_of`] wrote."""
    taken = data["interface"]
    arrays = tuple(Array(**{**array, "shape": tuple(array["shape"])}) for array in taken["arrays"])
    return Artifact(
        data["source"],
        data["manifest"],
        Interface(taken["role"], arrays, tuple(taken["integers"])),
        tuple(Image(**facts) for facts in data["images"]),
        weights=np.frombuffer(base64.b64decode(data["weights"]), "<f4").astype(np.float32),
        before=kernel_of(data["before"]) if data["before"] else None,
    )
