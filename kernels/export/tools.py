"""Translators and compilers of other languages: glslang, SPIRV-Tools, SPIRV-Cross, compilers of C++ and CUDA.

1. [`run`] runs one in a folder of its own; the error for a missing one says how to get it.
2. [`spirv`] makes SPIR-V from GLSL or HLSL and validates it; [`hlsl`] makes HLSL from that.
3. glslang gives a block that the source does not name an empty name, and a translator then makes one up:
   `_709`. A host that binds by name, as Unity does, needs `weights` and `image_color`, which the manifest
   says [`named`].
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from ...compiler.kernel.instructions import PORTABLE
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


SHIMS = Path(__file__).parent / "shims"
"""The words of CUDA, Metal, Shadertoy and Godot that kernels use; functions `wamnet_call` that run all
threads one after another, or those of a group at once, where they wait for each other; a device of Dawn."""


def shim(name: str) -> str:
    """Return the text of a file of the shims."""
    return (SHIMS / name).read_text(encoding="utf-8")


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


@lru_cache(maxsize=2)
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


def validate(folder: Path, name: str) -> None:
    """Refuse SPIR-V that is not valid."""
    run("spirv-val", "--target-env", ENVIRONMENT, name, folder=folder)


def hlsl(source: str, style: str) -> str:
    """Return a compute shader in GLSL as HLSL for a compiler of [`HLSL_STYLES`]."""
    with tempfile.TemporaryDirectory(prefix="wamnet-hlsl-") as name:
        folder, model = Path(name), HLSL_STYLES[style]
        (folder / "kernel.spv").write_bytes(spirv(source))
        options = ("--hlsl", "--shader-model", model, "--output", "kernel.hlsl")
        run("spirv-cross", "kernel.spv", *options, folder=folder)
        return named((folder / "kernel.hlsl").read_text(encoding="utf-8"), source)


def named(text: str, source: str) -> str:
    """Return HLSL whose buffers have the names of their blocks in GLSL, that of integers the name `sizes`."""
    blocks = dict(re.findall(r"binding = (\d+)\) .*?(\w+) \{", source))
    names = {number: f"{block[0].lower()}{block[1:]}" for number, block in blocks.items()} | {"0": "sizes"}
    buffers = re.findall(r"^\w*ByteAddressBuffer (_\d+) : register\(\w(\d+)", text, re.M)
    constants = re.findall(r": register\(b(\d+).*\n\{\n *\w+ (_\d+)_", text)
    own = {made: names[number] for made, number in [*buffers, *(pair[::-1] for pair in constants)]}
    return re.sub(r"\b(_\d+)(?=_|\b)", lambda match: own.get(match[1], match[1]), text)
