"""Translators and compilers of other languages: glslang, SPIRV-Tools, SPIRV-Cross, compilers of C++ and CUDA.

1. [`run`] runs one in a folder of its own; the error for a missing one says how to get it.
2. [`spirv`] makes SPIR-V from GLSL or HLSL and validates it; [`hlsl`] makes HLSL from SPIR-V.
3. glslang gives a block that the source does not name an empty name, and a translator then makes one up:
   `_709`. A host that binds by name, as Unity does, needs `weights` and `image_color`, which the manifest
   says: a block has the name of its first member there [`named`].
"""

from __future__ import annotations

import os
import shlex
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...compiler.kernel.instructions import PORTABLE
from ...compiler.kernel.interface import WEIGHTS
from ...refimpl.errors import CompileError, ExecutorUnavailable

PACKAGES: Mapping[str, str] = {
    "glslangValidator": "glslang-tools",
    "spirv-val": "spirv-tools",
    "spirv-cross": "spirv-cross",
    "nvcc": "nvidia-cuda-toolkit, or NVIDIA's own installer",
    "c++": "g++",
    "cc": "gcc and libc6-dev",
}
"""Programs, and what Debian calls the package of each."""

MOST_TOLD = 600
"""Most letters of a program's complaint in a message."""

COMPILERS = {"cc": "CC", "c++": "CXX"}
"""Environment variables that name other compilers."""

ENVIRONMENT = "vulkan1.0"
"""The oldest Vulkan: SPIR-V 1.0 without extensions, which all of them take."""

HLSL_STYLES: Mapping[str, str] = {"fxc": "50", "dxc": "60"}
"""Shader models by the compiler that takes them."""


def _command(program: str) -> list[str]:
    """Return the words that call a program."""
    return shlex.split(os.environ.get(COMPILERS.get(program, ""), "")) or [program]


def run(program: str, *arguments: str, folder: Path) -> str:
    """Run a program in a folder and return what it says, or say what is wrong."""
    try:
        done = subprocess.run(
            [*_command(program), *arguments],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            errors="replace",
        )
    except OSError:
        raise ExecutorUnavailable(
            f"{program} is not installed: apt-get install {PACKAGES[program]}"
        ) from None
    told = " ".join((done.stdout + done.stderr).split())
    if done.returncode:
        raise CompileError(f"{program} rejects the kernel: {told[:MOST_TOLD]}")
    return told


def spirv(source: str, language: str = "glsl") -> bytes:
    """Return the validated SPIR-V of a compute shader in GLSL or HLSL."""
    with tempfile.TemporaryDirectory(prefix="wamnet-spirv-") as name:
        folder = Path(name)
        (folder / "kernel.comp").write_text(source, encoding="utf-8")
        options = ["-D", "-e", "main"] if language == "hlsl" else []
        options += [f"-D{PORTABLE}", "-V", "--target-env", ENVIRONMENT, "-S", "comp"]
        run("glslangValidator", *options, "-o", "kernel.spv", "kernel.comp", folder=folder)
        validate(folder, "kernel.spv")
        return (folder / "kernel.spv").read_bytes()


def validate(folder: Path, name: str, environment: str = ENVIRONMENT) -> None:
    """Refuse SPIR-V that is not valid."""
    run("spirv-val", "--target-env", environment, name, folder=folder)


def hlsl(binary: bytes, style: str) -> str:
    """Return SPIR-V as HLSL for a compiler of [`HLSL_STYLES`]."""
    with tempfile.TemporaryDirectory(prefix="wamnet-hlsl-") as name:
        folder = Path(name)
        (folder / "kernel.spv").write_bytes(named(binary))
        model = HLSL_STYLES[style]
        run(
            "spirv-cross",
            *("kernel.spv", "--hlsl", "--shader-model", model, "--output", "kernel.hlsl"),
            folder=folder,
        )
        return (folder / "kernel.hlsl").read_text(encoding="utf-8")


# ---- names in SPIR-V --------------------------------------------------------------------------------------


HEAD = 5
"""Words before the first instruction."""

NAME, MEMBER_NAME, POINTER, FUNCTION, VARIABLE = 5, 6, 32, 54, 59
"""Numbers of OpName, OpMemberName, OpTypePointer, OpFunction and OpVariable."""

UNIFORM, BLOCK_NAME = 2, "sizes"
"""The storage class of buffers and blocks; what a block of integers is called, as manifests say it."""

SHORT = {"w": WEIGHTS}
"""What schedules of groups call an array for short."""

Words = NDArray[np.uint32]


def _instructions(words: Words) -> Iterator[tuple[int, Words]]:
    """Yield the number and the operands of each instruction."""
    at = HEAD
    while at < len(words):
        length = int(words[at] >> 16)
        yield int(words[at] & 0xFFFF), words[at + 1 : at + length]
        at += length


def named(binary: bytes) -> bytes:
    """Return a module whose buffers have the names of their first members, its block of integers `sizes`."""
    words: Words = np.frombuffer(binary, "<u4").astype(np.uint32)
    members, structures, names = dict[int, list[str]](), dict[int, int](), dict[int, str]()
    for operation, given in _instructions(words):
        if operation == MEMBER_NAME:
            text = given[2:].tobytes().partition(b"\0")[0].decode()
            members.setdefault(int(given[0]), []).append(text)
        elif operation == POINTER and given[1] == UNIFORM:
            structures[int(given[0])] = int(given[2])
        elif operation == VARIABLE and given[2] == UNIFORM:
            fields = members[structures[int(given[0])]]
            first = SHORT.get(fields[0], fields[0])
            names[int(given[1])] = first if len(fields) == 1 else BLOCK_NAME
        elif operation == FUNCTION:
            break
    written = [words[:HEAD]]
    for operation, given in _instructions(words):
        number = int(given[0]) if operation == NAME else -1
        if number in names:
            raw = names[number].encode()
            given = np.array([number, *np.frombuffer(raw + b"\0" * (4 - len(raw) % 4), "<u4")], np.uint32)
        written += [np.array([(len(given) + 1) << 16 | operation], np.uint32), given]
    return np.concatenate(written).astype("<u4").tobytes()
