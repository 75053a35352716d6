"""Slang, a second reader of HLSL that SPIRV-Cross has written."""

import tempfile
from pathlib import Path

import numpy as np

from wamnet.kernels.export import tools
from wamnet.kernels.export.tools import HEAD, Words, _instructions

SOURCE = 3
"""Number of OpSource."""


def slang(source: str) -> bytes:
    """Return the validated SPIR-V that Slang makes of a compute shader in HLSL, registers as bindings."""
    with tempfile.TemporaryDirectory(prefix="wamnet-slang-") as name:
        folder = Path(name)
        (folder / "kernel.hlsl").write_text(source, encoding="utf-8")
        # -O0: what optimises is a library of its own, which some packages leave out.
        options = ["-target", "spirv", "-O0", "-entry", "main", "-stage", "compute", "-profile", "spirv_1_3"]
        for kind in ("b", "t", "u"):
            options += [f"-fvk-{kind}-shift", "0", "0"]
        tools.run("slangc", "kernel.hlsl", *options, "-o", "kernel.spv", folder=folder)
        (folder / "kernel.spv").write_bytes(unsourced((folder / "kernel.spv").read_bytes()))
        tools.validate(folder, "kernel.spv", "vulkan1.1")
        return (folder / "kernel.spv").read_bytes()


def unsourced(binary: bytes) -> bytes:
    """Return a module that does not say its source's language, a number that older readers may not know."""
    words: Words = np.frombuffer(binary, "<u4").astype(np.uint32)
    written = [words[:HEAD]]
    for operation, given in _instructions(words):
        if operation != SOURCE:
            written += [np.array([(len(given) + 1) << 16 | operation], np.uint32), given]
    return np.concatenate(written).astype("<u4").tobytes()
