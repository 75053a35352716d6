"""`wamnet dataset --from-blender`: noisy pictures and targets over the animation of a Blender file.

Blender renders to a file beside the data set; what is read of it, as of any other program's, is kept in the
project's own form, with the same manifest, checksums and resumption as other data sets [dataset_files.py].
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ....models.data.frame_plan import KINDS
from ...common.inputs import check_input
from ...common.terminal import progress, say
from ...files import dataset_files, exr

if TYPE_CHECKING:
    from ....models.blender.plan import FilmFrame, Request, Shot
    from ....models.blender.session import Blender
    from ....refimpl.frame import Frame

PASSES = ("color", "albedo", "normal", "depth", "position")
"""Layers of a noisy picture: what Cycles has passes of."""


@dataclass(frozen=True)
class Asked:
    """What the options ask for."""

    file: Path
    frames: int
    test: int
    outside: int
    spp: int
    test_spp: int
    arc: float
    seed: int
    noisy_spp: int = 1
    percent: int = 100
    view_layer: str = ""
    blender: str | None = None


def make(folder: Path, asked: Asked) -> None:
    """Make what is missing in the folder."""
    from ....models.blender.session import Blender

    check_input(asked.file)
    with Blender(asked.file, asked.view_layer, asked.blender) as blender:
        request, frames = _planned(asked, blender)
        known = 0
        if (folder / dataset_files.MANIFEST).exists():
            known = dataset_files.bytes_of(dataset_files.read_manifest(folder))
        with (
            progress("checking", known, "bytes") as look,
            dataset_files.Store.open(folder, request, frames, look) as store,
        ):
            made = len(store.missing)
            if made:
                _render(store, blender)
    animation = request.animation
    say(
        f"{asked.file}: frames {animation.first} to {animation.last} of {animation.scene}, view layer "
        f"{animation.view_layer}, by Cycles of Blender {animation.version}"
    )
    for line in store.summary(made):
        say(line)


def _planned(asked: Asked, blender: Blender) -> tuple[Request, list[FilmFrame]]:
    """Return the request for the open file, and its frames."""
    from ....models.blender.plan import Request, plan

    counts = (asked.frames, asked.test, asked.outside, asked.arc, asked.percent)
    samples = (asked.noisy_spp, asked.spp, asked.test_spp, asked.seed)
    digest = dataset_files.sum_of(asked.file).sha256
    request = Request(asked.file.name, digest, blender.animation, *counts, *samples)
    return request, plan(request)


def _render(store: dataset_files.Store[Shot], blender: Blender) -> None:
    """Render what is left in the store."""
    tasks = store.tasks()
    with (
        progress("rendering", sum(shot.samples for shot in tasks), "samples") as advance,
        tempfile.TemporaryDirectory(prefix="wamnet-blender-") as scratch,
    ):
        path = Path(scratch, "picture.exr")
        for shot in tasks:
            blender.render(shot, path)
            store.put(shot, _read(path, shot))
            path.unlink()
            advance(shot.samples)


def _read(path: Path, shot: Shot) -> Frame:
    """Return what Blender has rendered as a frame of a data set."""
    from ....refimpl.frame import Frame

    frame, animation = exr.read_frame(path), shot.request.animation
    wanted = PASSES if shot.name.endswith(f"{KINDS[0]}.exr") else PASSES[:1]
    return Frame(
        {name: frame[name] for name in wanted},
        {
            "renderer": f"Cycles, Blender {animation.version}",
            "scene": f"{shot.request.blend}: {animation.scene}",
            "film_frame": str(shot.frame),
            "spp": str(shot.spp),
            "seed": str(shot.seed),
        },
    )
