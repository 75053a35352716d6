"""`wamnet bench pipeline`: whole pictures of a scene that moves, by one pipeline and by other means."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from ...common.terminal import say
from .shared import (
    Repeats,
    SceneShown,
    check_count,
    counts_of,
    extent,
    facts,
    head,
    names_of,
    numpy_version,
    row,
)

if TYPE_CHECKING:
    from ....kernels.bench.measure_pipeline import Maker, Measured
    from ....refimpl.network.denoise import Model

EXAMPLES = """Examples:

wamnet bench pipeline --sizes 256,512 --executors opencl,opengl --repeats 5

wamnet bench pipeline --executors opencl,opengl,c --sizes 256,512,1024,2048 --peers mitsuba,cycles

wamnet bench pipeline --scene cornell --features color,albedo,normal --hidden 32,32"""
"""Shown below the help of `wamnet bench pipeline`."""

Peers = Annotated[
    str,
    typer.Option(
        metavar="NAME,...", help="Other renderers to include: mitsuba, cycles.", show_default="none"
    ),
]


def pipeline(
    scene: SceneShown = "minicubes",
    executors: Annotated[
        str, typer.Option(metavar="NAME,...", help="Backends to measure: numpy, opencl, opengl, c.")
    ] = "opencl,opengl",
    sizes: Annotated[
        str, typer.Option(metavar="N,...", help="Image sizes (width and height), in pixels.")
    ] = "256,512",
    features: Annotated[
        str, typer.Option(metavar="NAME,...", help="Input features of the network.")
    ] = "color,normal",
    hidden: Annotated[str, typer.Option(metavar="N,...", help="Width of each hidden layer, in neurons.")] = (
        "32,32,32,32"
    ),
    window: Annotated[int, typer.Option(help="Width and height of the window, in pixels.")] = 12,
    feature_rays: Annotated[
        int,
        typer.Option(
            metavar="N", help="Camera rays per pixel for the features; 0 uses the paths themselves."
        ),
    ] = 0,
    repeats: Repeats = 5,
    peers: Peers = "",
) -> None:
    """Measure full frames of an animated scene: one path per pixel, and denoising.

    [bold]ours, moving[/] is one pipeline on a device in which every frame has a different time; the table
    has its stages. [bold]separate[/] traces, reads back, encodes, uploads, denoises and reads back.
    [bold]mitsuba[/] is Mitsuba 3 with Open Image Denoise, [bold]cycles[/] Blender's renderer with its
    own (package bpy). All are interleaved. The first frame includes compiling its path kernel; with empty
    caches, in a separate process, all kernels. The network has random weights.
    """
    from ....kernels import EXECUTORS
    from ....kernels.bench import measure_pipeline as measuring
    from ....kernels.bench.workload import check_size
    from ....models.data.scene_source import scene_source
    from ....refimpl.light.transport import Settings
    from ....refimpl.network.dataset import FEATURES

    scene_source(scene)
    given, widths = names_of("--executors", executors, EXECUTORS), counts_of("--sizes", sizes, "256,512")
    others = names_of("--peers", peers, measuring.PEERS) if peers else ()
    for size in widths:
        check_size(size)
    check_count("--window", window, 12)
    check_count("--repeats", repeats, 5)
    seen, layers = names_of("--features", features, FEATURES), counts_of("--hidden", hidden, "32,32")
    model = measuring.random_model(seen, window, layers)
    rays = f", features of {feature_rays} rays" if feature_rays > 1 else ""
    network = f"network {'-'.join(map(str, model.siren.widths))}"
    say(", ".join(facts(numpy_version(), f"{scene}, 1 spp{rays}, {Settings().max_depth + 1} edges", network)))
    say("")
    head("by", "size", "way", "ms, median", "ms, range", "pictures/s", f"times {given[0]}, moving")
    notes: dict[str, None] = {}
    for size in widths:
        _show(_rows(given, others, model, scene, size, repeats, notes, feature_rays), size)
    for line in ("", *notes) if notes else ():
        say(line)


def _rows(
    given: Sequence[str],
    others: Sequence[str],
    model: Model,
    scene: str,
    size: int,
    repeats: int,
    notes: dict[str, None],
    rays: int,
) -> list[Measured]:
    """Return all rows of a size: what takes turns, then first pictures."""
    from ....kernels import open_executor
    from ....kernels.bench.first_picture import first_picture
    from ....kernels.bench.measure_pipeline import Measured, first_pictures, measured

    with ExitStack() as stack:
        opened = [stack.enter_context(open_executor(name)) for name in given]
        makers = _makers(stack, others, scene, size, notes)
        found = measured(opened, model, scene, size, repeats, makers, rays)
        for executor in opened:
            news = tuple(first_pictures(executor, model, scene, size, rays))
            found.append(Measured(executor.name, "first picture of a new scene", news))
    for name in given:
        if (cold := first_picture(name, model, scene, size)) is not None:
            found.append(Measured(name, "first picture, empty caches", (cold,)))
    return found


def _makers(
    stack: ExitStack, names: Sequence[str], scene: str, size: int, notes: dict[str, None]
) -> dict[str, Maker]:
    """Open other makers of pictures until the stack is closed; note what they are, or why one is missing."""
    from ....kernels.bench import measure_pipeline as measuring
    from ....kernels.bench import peers
    from ....refimpl.errors import ExecutorUnavailable, InputError

    makers: dict[str, Maker] = {}
    for name in names:
        try:
            makers[name] = peers.table().makers[name](measuring.moments(scene)[0], size)
        except (ExecutorUnavailable, InputError) as error:
            notes[f"No row: {error}"] = None
        else:
            stack.callback(makers[name].close)
            notes[f"{name}: {makers[name].about}"] = None
    return makers


def _show(found: Sequence[Measured], size: int) -> None:
    """Print the rows of a size; pictures a second are those of whole pictures that were not the first."""
    from ....kernels.bench.measure_pipeline import MOVING

    ours = next(statistics.median(each.seconds) for each in found if each.way == MOVING)
    for each in found:
        ms, median = [1e3 * second for second in each.seconds], statistics.median(each.seconds)
        whole = not each.way.startswith(("of it", "first"))
        rate = f"{1.0 / median:.2f}" if whole else ""
        ratio = f"{median / ours:.2f}" if whole else ""
        cells = (f"{statistics.median(ms):.1f}", extent(ms, 1), rate, ratio)
        row(each.by, f"{size}x{size}", each.way, *cells)
