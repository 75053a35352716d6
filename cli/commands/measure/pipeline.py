"""`wamnet bench pipeline`: whole pictures of a scene that moves, by one pipeline and by other means."""

from collections.abc import Sequence
from contextlib import ExitStack

from ....kernels import EXECUTORS, open_executor
from ....kernels.bench import peers, pipelines
from ....kernels.bench.fresh import first_picture
from ....kernels.bench.pipelines import MOVING
from ....kernels.bench.workload import paper_model
from ....kernels.measure import Entry, measure
from ....models.data.scene_source import scene_source
from ....refimpl.errors import ExecutorUnavailable, InputError
from ....refimpl.light.transport import Settings
from ....refimpl.network.dataset import FEATURES
from ....refimpl.network.denoise import Model
from ...common.options import option
from ...common.terminal import say
from .shared import (
    NUMPY,
    Repeats,
    SceneShown,
    check_counts,
    counts_of,
    extent,
    head,
    names_of,
    row,
    say_facts,
)


def pipeline(
    scene: SceneShown = "minicubes",
    executors: str = option("NAME,...  Backends to measure: numpy, opencl, opengl, c.", "opencl,opengl"),
    sizes: str = option("N,...  Image sizes (width and height), in pixels.", "256,512"),
    features: str = option("NAME,...  Input features of the network.", "color,normal"),
    hidden: str = option("N,...  Width of each hidden layer, in neurons.", "32,32,32,32"),
    window: int = option("Width and height of the window, in pixels.", 12),
    feature_rays: int = option("N  Camera rays per pixel for the features; 0 uses the paths themselves.", 0),
    repeats: Repeats = 5,
    peers: str = option("NAME,...  Other renderers to include: mitsuba, cycles. [default: none]", ""),
) -> None:
    """Measure full frames of an animated scene: one path per pixel, and denoising.

    [bold]ours, moving[/] is one pipeline on a device in which every frame has a different time; the table
    has its stages. [bold]separate[/] traces, reads back, encodes, uploads, denoises and reads back.
    [bold]mitsuba[/] is Mitsuba 3 with Open Image Denoise, [bold]cycles[/] Blender's renderer with its
    own (package bpy). All are interleaved. The first frame includes compiling its path kernel; with empty
    caches, in a separate process, all kernels. The network has random weights.

    Examples:
    wamnet bench pipeline --sizes 256,512 --executors opencl,opengl --repeats 5
    wamnet bench pipeline --executors opencl,opengl,c --sizes 256,512,1024,2048 --peers mitsuba,cycles
    wamnet bench pipeline --scene cornell --features color,albedo,normal --hidden 32,32
    """
    scene_source(scene)
    given, widths = names_of("--executors", executors, EXECUTORS), counts_of("--sizes", sizes, "256,512")
    others = names_of("--peers", peers, pipelines.PEERS) if peers else ()
    check_counts(widths, window=(window, 12), repeats=(repeats, 5))
    seen, layers = names_of("--features", features, FEATURES), counts_of("--hidden", hidden, "32,32")
    model = paper_model(seen, window, layers, depth_scale=20.0, position_scale=10.0)
    rays = f", features of {feature_rays} rays" if feature_rays > 1 else ""
    network = f"network {'-'.join(map(str, model.siren.widths))}"
    say_facts(NUMPY, f"{scene}, 1 spp{rays}, {Settings().max_depth + 1} edges", network)
    head("backend", "size", "method", "ms, median", "ms, range", "images/s", f"times {given[0]}, moving")
    notes: dict[str, None] = {}
    for size in widths:
        _show(_entries(given, others, model, scene, size, repeats, notes, feature_rays), size)
    for line in ("", *notes) if notes else ():
        say(line)


def _entries(
    given: Sequence[str],
    others: Sequence[str],
    model: Model,
    scene: str,
    size: int,
    repeats: int,
    notes: dict[str, None],
    rays: int,
) -> list[Entry]:
    """Return all rows of a size: what takes turns, then first pictures; note what others are, or lack."""
    with ExitStack() as stack, ExitStack() as pipes:
        found: list[Entry] = []
        opened = [stack.enter_context(open_executor(name)) for name in given]
        for each in opened:
            found += pipelines.entries(each.name, pipelines.ways_of(pipes, each, model, scene, size, rays))
        shots = pipelines.moments(scene)
        for name in others:
            try:
                maker = peers.table().makers[name](shots[0], size)
            except (ExecutorUnavailable, InputError) as error:
                notes[f"No row: {error}"] = None
                continue
            stack.callback(maker.close)
            notes[f"{name}: {maker.about}"] = None
            found += pipelines.entries(name, maker.ways(shots))
        measure(found, repeats, pause_s=pipelines.PAUSE_S)
        pipes.close()
        for each in opened:
            seconds = pipelines.first_pictures(each, model, scene, size, rays)
            found.append(Entry("first picture of a new scene", by=each.name, seconds=seconds))
    for name in given:
        if (cold := first_picture(name, model, scene, size)) is not None:
            found.append(Entry("first picture, empty caches", by=name, seconds=[cold]))
    return found


def _show(found: Sequence[Entry], size: int) -> None:
    """Print the rows of a size; pictures a second are those of whole pictures that were not the first."""
    ours = next(each.times.median for each in found if each.name == MOVING)
    for each in found:
        ms, median = [1e3 * second for second in each.seconds], each.times.median
        whole = not each.name.startswith(("of it", "first"))
        rates = (f"{1.0 / median:.2f}", f"{median / ours:.2f}") if whole else ("", "")
        row(each.by, f"{size}x{size}", each.name, f"{1e3 * median:.1f}", extent(ms, 1), *rates)
