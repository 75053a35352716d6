"""`wamnet compile`: from a model to the source of a kernel, its weights and its manifest."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..refimpl.errors import InputError
from . import options
from .inputs import load_model
from .options import Target
from .outputs import check_parent, unwritable
from .terminal import say

if TYPE_CHECKING:
    from ..compiler.artifact import Artifact

EXAMPLES = """Examples:

wamnet compile model.safetensors --target glsl -o kernel-glsl

wamnet compile model.safetensors --target opencl --profile native -o kernel-opencl"""
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
    from ..compiler.compile import compile_program
    from ..compiler.lower import lower

    folder = output or Path(target.value)
    check_folder(folder, EXECUTOR_OF[target])
    kernel = compile_program(lower(load_model(model)), EXECUTOR_OF[target], profile)
    for path in write_kernel(kernel, folder):
        say(str(path))


def check_folder(folder: Path, target: str) -> None:
    """Refuse a folder where a kernel cannot lie, or that holds files of another program or target."""
    from ..compiler.artifact import MANIFEST_NAME, SCHEMA

    if folder.exists() and not folder.is_dir():
        raise InputError("output folder", str(folder), "it is a file", "choose another name with -o")
    check_parent(folder)
    path = folder / MANIFEST_NAME
    if not path.exists():
        return
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        data = None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        rule = f"its {MANIFEST_NAME} is not one that wamnet wrote"
        raise InputError("output folder", str(folder), rule, "choose another with -o")
    if data.get("target") != target:
        rule = f"it holds a kernel for {data.get('target')}, and this one is for {target}"
        raise InputError("output folder", str(folder), rule, "choose another with -o")


def write_kernel(kernel: Artifact, folder: Path) -> tuple[Path, ...]:
    """Write a kernel's files; what the system refuses is told with the folder's name."""
    from ..compiler import artifact

    try:
        return artifact.write(kernel, folder)
    except OSError as error:
        raise unwritable(folder, error, "output folder") from None
