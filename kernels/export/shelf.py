"""The shelf: kernels of canonical models that are kept in the repository, with an index page.

`python -m wamnet.kernels.export.shelf -o kernels/shelf MODEL.safetensors ...` writes it again; without
models it is a small network of random weights. A test compares the files with what the command would write.
The index says for each kernel its size, products a pixel, certified bound and, with `--measure`, how long a
picture of so many pixels a side takes here, copies included, on what is nearest to its target [`measured`].

The paper's network takes 600 kB of text where weights are inlined: the shelf has sources that read weights,
which are one file a model, and leaves out what `wamnet export` adds.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ...compiler.artifact import Artifact
from ...compiler.core.writing import is_regular, write_together
from ...compiler.model_file import load_model
from ...compiler.schedules.schedules import PLAIN
from ...refimpl.errors import ExecutorUnavailable, InputError, WamnetError
from ...refimpl.network import siren
from ...refimpl.network.dataset import Normalization, Window
from ...refimpl.network.denoise import Model
from ..bench.cost import products_of
from ..devices.executor import Executor
from ..devices.images import Images, black
from ..measure import in_turns
from .check import runner
from .package import Export, Request, export

KEPT = ("opencl", "glsl", "glsl-es", "wgsl", "c", "cuda", "metal", "glsl-vulkan")
"""Targets whose files need no translator, so that they are the same on every machine."""

TIMED = ("opencl", "glsl", "glsl-es", "wgsl", "c", "glsl-vulkan")
"""Those that run here as they are; Metal and CUDA C as C++ with a shim would say nothing of their speed."""

TURNS = 3
"""Measurements of each kernel."""

READ = PLAIN
"""The schedule of all kernels here: the one that is made to be read."""

INDEX = "README.md"
"""The index page."""

OWN = re.compile(rf"{re.escape(INDEX)}|[^/]+/weights\.bin|[^/]+/({'|'.join(KEPT)})/denoise\.[a-z]+")
"""Paths of the files of a shelf."""

SMALL = "small"
"""Name of the network of random weights."""


def contents(models: Mapping[str, Model], times: Mapping[str, str] | None = None) -> Mapping[str, bytes]:
    """Return all files of the shelf by path, for models by name; `times` are texts by `model/target`."""
    files: dict[str, bytes] = {}
    lines = [
        "# Kernels of the canonical models",
        "",
        "Written by `python -m wamnet.kernels.export.shelf`; a test keeps them equal to what the compiler",
        "writes. `wamnet export` adds certificate, manifest, check pair and everything else. Weights are one",
        "file a model: little-endian float32, in the order that each source's header states. Speed is that",
        "of the plain kernel on what runs it without a GPU (PoCL, llvmpipe, a C compiler), copies included.",
        "",
        "| model | target | source | products a pixel | certified bound | speed |",
        "|---|---|---|---|---|---|",
    ]
    for name, model in models.items():
        for target in KEPT:
            made = export(Request(model, target, schedule=READ))
            source = _source(made)
            files[f"{name}/{target}/{Path(source).name}"] = made.files[source]
            files[f"{name}/weights.bin"] = made.files["denoise/weights.bin"]
            lines.append(_row(name, target, made, source, times or {}))
    files[INDEX] = ("\n".join([*lines, ""])).encode()
    return files


def _source(made: Export) -> str:
    """Return the path of the denoiser's source."""
    return str(made.manifest["kernels"][-1]["files"][0])


def _row(name: str, target: str, made: Export, source: str, times: Mapping[str, str]) -> str:
    """Return the line of one kernel."""
    bound = made.manifest["bound"]["output"]
    assert made.denoiser is not None, "every target of the shelf has a kernel"
    cells = (
        name,
        f"[{target}]({name}/{target}/{Path(source).name})",
        f"{len(made.files[source]) / 1000:.1f} kB",
        f"{products_of(made.denoiser.program):,}",
        f"{max(bound):.2g}" if bound else "-",
        times.get(f"{name}/{target}", "not measured"),
    )
    return f"| {' | '.join(cells)} |"


def measured(models: Mapping[str, Model], size: int) -> dict[str, str]:
    """Return the median time of a picture of size x size pixels, in words, by `model/target`."""
    found = {}
    for name, model in models.items():
        with ExitStack() as stack:
            ways = {}
            for target in TIMED:
                kernel = export(Request(model, target, schedule=READ)).denoiser
                assert kernel is not None, "every target of the shelf has a kernel"
                try:
                    opened = stack.enter_context(runner(target, kernel.target))
                except ExecutorUnavailable:
                    continue
                ways[target] = partial(_ran, opened, kernel, black(kernel, (size, size)))
            for target, times in in_turns(ways, TURNS).items():
                found[f"{name}/{target}"] = f"{1000 * times.median:.0f} ms, {size}x{size}"
    return found


def _ran(opened: Executor, kernel: Artifact, images: Images) -> None:
    """Run a kernel once, from images in memory to a picture in memory."""
    opened.run(kernel, images)


def random_model() -> Model:
    """Return a small network of random weights, whose outputs are around 0.5."""
    network = siren.init((96, 8, 3), 2.0, 2.0, 5, np.float32)
    network = replace(network, biases=(*network.biases[:-1], np.full(3, 0.5, np.float32)))
    return Model(network, ("color", "normal"), Window(4, "clamp"), Normalization(), {})


def write(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write the shelf over the one that is there; of that, only files that a shelf has are removed."""
    there = _files_of(folder)
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    write_together({folder / name: data for name, data in files.items()})
    for name in there - files.keys():
        (folder / name).unlink()
        for parent in (folder / name).parents:
            if parent == folder or any(parent.iterdir()):
                break
            parent.rmdir()


def _files_of(folder: Path) -> set[str]:
    """Return the files of the shelf in a folder; refuse a folder with anything else."""
    rule, way_out = "it is not a shelf: {}", "name another folder with -o, or a new one"
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise InputError("output folder", str(folder), rule.format("a link or a file"), way_out)
    found = set()
    # Links to folders are listed, not entered.
    for top, folders, names in os.walk(folder):
        links = [name for name in folders if (Path(top) / name).is_symlink()]
        for path in (Path(top) / name for name in (*names, *links)):
            name = path.relative_to(folder).as_posix()
            if not OWN.fullmatch(name) or not is_regular(path):
                raise InputError("output folder", str(folder), rule.format(f"it holds {name}"), way_out)
            found.add(name)
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the shelf."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--measure", type=int, metavar="SIZE", help="time pictures of SIZE x SIZE pixels")
    options = parser.parse_args(arguments)
    try:
        models = {path.stem: load_model(path) for path in options.models} or {SMALL: random_model()}
        times = measured(models, options.measure) if options.measure else None
        write(options.output, contents(models, times))
    except WamnetError as error:
        sys.exit(f"shelf: error: {error}")


if __name__ == "__main__":
    main()
