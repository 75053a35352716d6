"""`wamnet dataset --from-blender`: noisy pictures and targets over the animation of a Blender file.

Blender renders to a file beside the data set; what is read of it, as of any other program's, is kept in the
project's own form, with the same manifest, checksums and resumption as other data sets [dataset_files.py].
"""

import tempfile
from pathlib import Path
from typing import Any

from ....models.blender.plan import Request, Shot, plan
from ....models.blender.session import Blender
from ....models.data.frame_plan import KINDS
from ....refimpl.frame import Frame
from ...common.inputs import check_input
from ...common.terminal import progress, say
from ...files import dataset_files, exr

PASSES = ("color", "albedo", "normal", "depth", "position")
"""Layers of a noisy picture: what Cycles has passes of."""


def make(folder: Path, file: Path, view_layer: str, blender: str | None, **numbers: Any) -> None:
    """Make what is missing in the folder; `numbers` are those of a request of this file."""
    check_input(file)
    with Blender(file, view_layer, blender) as opened:
        request = Request(file.name, dataset_files.sum_of(file).sha256, opened.animation, **numbers)
        frames, known = plan(request), 0
        if (folder / dataset_files.MANIFEST).exists():
            known = dataset_files.bytes_of(dataset_files.read_manifest(folder))
        with (
            progress("checking", known, "bytes") as look,
            dataset_files.Store.open(folder, request, frames, look) as store,
        ):
            made = len(store.missing)
            if made:
                _render(store, opened)
    animation = request.animation
    say(
        f"{file}: frames {animation.first} to {animation.last} of {animation.scene}, view layer "
        f"{animation.view_layer}, by Cycles of Blender {animation.version}"
    )
    for line in store.summary(made):
        say(line)


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
