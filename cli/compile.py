"""`wamnet compile`: from a model to the source of a kernel, its weights and its manifest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..refimpl.errors import InputError
from . import options
from .options import Target
from .terminal import say

EXAMPLES = """Examples:

wamnet compile model.safetensors --target glsl -o kernel

wamnet compile model.safetensors --target opencl --profile native -o kernel"""
"""Shown below the help of `wamnet compile`."""

EXECUTOR_OF = {Target.opencl: "opencl", Target.glsl: "opengl"}
"""The compiler names a target by the executor that runs it; people know the language."""


def compile_model(
    model: options.ModelFile,
    target: Annotated[Target, typer.Option(help="Language of the kernel.", show_default=False)],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Folder for the files.", show_default="TARGET"),
    ] = None,
    profile: options.Profile = "ieee",
) -> None:
    """Compile a model to a kernel: source, weights, and a manifest with its interface and error bound.

    The source is meant to be read and pasted into another program. No device is needed.
    """
    from ..compiler import artifact, model_file
    from ..compiler.compile import compile_program
    from ..compiler.lower import lower

    folder = output or Path(target.value)
    if folder.exists() and not folder.is_dir():
        raise InputError("output folder", str(folder), "it is a file", "choose another name with -o")
    kernel = compile_program(lower(model_file.load_model(model)), EXECUTOR_OF[target], profile)
    for path in artifact.write(kernel, folder):
        say(str(path))
