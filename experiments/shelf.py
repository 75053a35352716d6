"""The shelf: kernels of canonical models that are kept in the repository, with an index page.

`python experiments/shelf.py -o kernels/shelf MODEL.safetensors ...` writes it again; without
models it is a small network of random weights. A test compares the files with what the command would write.
The index says for each kernel its size, products a pixel, schedule, certified bound, and whether its text is
one that `wamnet certify` reads, and as what language.

The paper's network takes 600 kB of text where weights are inlined: the shelf has sources that read weights,
which are one file a model, and leaves out what `wamnet export` adds to kernel, manifest and certificate.
"""

import argparse
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from wamnet.compiler.artifact import (
    CERTIFICATE_NAME,
    MANIFEST_NAME,
    WEIGHTS_NAME,
    Artifact,
    manifest_text,
    weight_bytes,
)
from wamnet.compiler.reading.languages import is_read
from wamnet.compiler.schedules.schedules import PLAIN
from wamnet.kernels.bench.workload import random_model
from wamnet.kernels.export.package import Request, export
from wamnet.kernels.run.denoise_on import products_of
from wamnet.models.model_file import load_model
from wamnet.models.writing import is_regular, write_together
from wamnet.refimpl.errors import InputError, WamnetError
from wamnet.refimpl.network.denoise import Model

KEPT = ("opencl", "glsl", "glsl-es", "wgsl", "c", "cuda", "metal", "glsl-vulkan")
"""Targets whose files need no translator, so that they are the same on every machine."""

READ = PLAIN
"""The schedule of all kernels here: the one that is made to be read."""

INDEX = "README.md"
"""The index page."""

OWN = re.compile(
    rf"{re.escape(INDEX)}|[^/]+/weights\.bin"
    rf"|[^/]+/({'|'.join(KEPT)})/(denoise\.[a-z]+|denoise\.certificate\.json|manifest\.json)"
)
"""Paths of the files of a shelf."""

COLUMNS = ("model", "target", "source", "products a pixel", "schedule", "bound", "text checked")
"""Heads of the index."""

SMALL = "small"
"""Name of the network of random weights."""


def contents(models: Mapping[str, Model]) -> Mapping[str, bytes]:
    """Return all files of the shelf by path, for models by name."""
    files: dict[str, bytes] = {}
    lines = [
        "# Kernels of the canonical models",
        "",
        "Written by `python experiments/shelf.py`; a test keeps them equal to what the compiler",
        "writes. Each kernel has its manifest and the certificate of its bound for all images in their",
        "ranges. `wamnet certify kernels/shelf/minicubes/wgsl` checks it, and whether the text computes the",
        "certified program; a test runs it on every row. Weights are one file a model, one folder above its",
        "kernels: little-endian float32, in the order that each source's header states. `wamnet export`",
        "adds a check pair and everything else. [How fast they are](../../docs/speed.md).",
        "",
        f"| {' | '.join(COLUMNS)} |",
        "|" + "---|" * len(COLUMNS),
    ]
    for name, model in models.items():
        for target in KEPT:
            made = export(Request(model, target, schedule=READ))
            assert made.denoiser is not None, "every target of the shelf has a kernel"
            files |= _files(f"{name}/{target}", made.denoiser)
            files[f"{name}/{WEIGHTS_NAME}"] = weight_bytes(made.denoiser)
            lines.append(_row(f"{name}/{target}", made.denoiser))
    files[INDEX] = ("\n".join([*lines, ""])).encode()
    return files


def _files(folder: str, made: Artifact) -> dict[str, bytes]:
    """Return a kernel's files by path; the manifest says that the weights are one folder up (CER-5)."""
    own = {name: data for name, data in made.contents().items() if name != WEIGHTS_NAME}
    manifest = {**made.manifest, "weights": {**made.manifest["weights"], "folder": ".."}}
    own[MANIFEST_NAME] = manifest_text(replace(made, manifest=manifest)).encode()
    return {f"{folder}/{name}": data for name, data in own.items()}


def _row(folder: str, made: Artifact) -> str:
    """Return the line of one kernel, by its folder."""
    assert made.certificate is not None, "every kernel of the shelf has a certificate"
    schedule = made.manifest["schedule"]["name"]
    name, target = folder.split("/")
    cells = (
        name,
        f"[{target}]({folder}/{made.source_name})",
        f"{len(made.source.encode()) / 1000:.1f} kB",
        f"{products_of(made.programs):,}",
        schedule,
        f"[{max(made.certificate['bound']['output']):g}]({folder}/{CERTIFICATE_NAME})",
        f"yes, as {made.manifest['language'].partition(',')[0]}" if is_read(made.manifest) else "no",
    )
    return f"| {' | '.join(cells)} |"


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
    rule, way_out = "is not a shelf: {}", "name another folder with -o, or a new one"
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
    options = parser.parse_args(arguments)
    try:
        models = {path.stem: load_model(path) for path in options.models} or {SMALL: random_model()}
        write(options.output, contents(models))
    except WamnetError as error:
        sys.exit(f"shelf: error: {error}")


if __name__ == "__main__":
    main()
