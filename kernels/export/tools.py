"""Translators and compilers of other languages: glslang, SPIRV-Tools, SPIRV-Cross, compilers of C++ and CUDA.

1. [`run`] runs one in a folder of its own; the error for a missing one says how to get it.
2. [`spirv`] makes SPIR-V from GLSL or HLSL and validates it; [`hlsl`] makes HLSL from SPIR-V.
3. [`slang`] is a second reader of that HLSL.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from ...compiler.kernel.instructions import PORTABLE
from ...refimpl.errors import CompileError, ExecutorUnavailable
from .spirv_names import named, unsourced

PACKAGES: Mapping[str, str] = {
    "glslangValidator": "glslang-tools",
    "spirv-val": "spirv-tools",
    "spirv-cross": "spirv-cross",
    "nvcc": "nvidia-cuda-toolkit, or NVIDIA's own installer",
    "slangc": "none of Debian's: put slangtorch/bin of PyPI's package slangtorch on the PATH",
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


def have(program: str) -> bool:
    """Return whether a program is there."""
    return shutil.which(_command(program)[0]) is not None


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


def slang(source: str) -> bytes:
    """Return the validated SPIR-V that Slang makes of a compute shader in HLSL, registers as bindings."""
    with tempfile.TemporaryDirectory(prefix="wamnet-slang-") as name:
        folder = Path(name)
        (folder / "kernel.hlsl").write_text(source, encoding="utf-8")
        # -O0: what optimises is a library of its own, which some packages leave out.
        options = ["-target", "spirv", "-O0", "-entry", "main", "-stage", "compute", "-profile", "spirv_1_3"]
        for kind in ("b", "t", "u"):
            options += [f"-fvk-{kind}-shift", "0", "0"]
        run("slangc", "kernel.hlsl", *options, "-o", "kernel.spv", folder=folder)
        (folder / "kernel.spv").write_bytes(unsourced((folder / "kernel.spv").read_bytes()))
        validate(folder, "kernel.spv", "vulkan1.1")
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
