"""`wamnet animate`: noisy, denoised and reference pictures of an animation side by side, as PNG, MP4 or GIF.

1. Each time of the animation is rendered and denoised, and drawn as one labelled picture: by one pipeline
   where one device does both [`draw_frames`], else one after the other [`draw_apart`]. A model that reads
   the history gets that of the film: pictures that are there already are rendered again for it, not denoised.
2. A picture carries what it was made from, so that an interrupted run resumes; pictures of another animation
   are refused [`missing`].
3. A film is made from the pictures when all are there; they lie in FILE.frames until then
   [`movie.write_movie`].
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ...compiler.scenes.encode_kernel import feature_rays, sees
from ...compiler.variants import FULL, with_rank
from ...kernels import Pipeline, open_executor, render_on
from ...kernels.run import before as past
from ...kernels.run import render_frame
from ...kernels.run.denoise_on import Denoiser
from ...kernels.run.render_on import Frames
from ...models.data.frame_plan import animation_times
from ...models.data.scene_source import scene_source
from ...models.writing import remove_temporaries
from ...refimpl.encoding import to_display
from ...refimpl.errors import InputError
from ...refimpl.frame import SUN, Frame
from ...refimpl.light.render import Job, feature_job, render_info
from ...refimpl.light.scene import Scene, scene_digest
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model, learned_shadow_rays
from ...refimpl.network.factored import check_rank
from ..common import options
from ..common.domain import Watch
from ..common.executors import chosen
from ..common.inputs import learned_scene, load_model, model_path, unlike_training
from ..common.terminal import hint_on_interrupt, progress, say
from ..files import images, movie
from ..files.alone import working_in
from ..files.outputs import check_output, check_parent, check_real_folder, visible
from ..reports import machine


@dataclass(frozen=True)
class Shot:
    """One picture of an animation: its file, the scene at its time, its jobs, and what names all that."""

    path: Path
    scene: Scene
    noisy: Job
    reference: Job | None
    origin: str


@dataclass(frozen=True)
class Film:
    """What is rendered: times, a size, samples of the reference (0: none), and rays of the features."""

    start: float = 0.0
    seconds: float = 8.0
    fps: float = 10.0
    size: int = 128
    reference_spp: int = 0
    seed: int = 0
    feature_spp: int | None = None


def animate(
    model: Path,
    scene: str | None = None,
    output: Path = Path("animation"),
    *,
    wanted: Film,
    parameters: list[str] | None = None,
    view: options.View,
    executor: options.ExecutorChoice = "auto",
    renderer: options.ExecutorChoice = "auto",
    rank: int = 0,
    context: options.ContextName | None = None,
) -> None:
    """Render and denoise an animation: noisy, denoised and reference images side by side."""
    is_film = output.suffix.lower() in movie.WRITERS
    folder = output.with_name(output.name + ".frames") if is_film else output
    _check_names(output, model, wanted.fps)
    model = model_path(model)
    network = load_model(model)
    if rank:
        check_rank(rank, network.window.size, *network.siren.widths[:2])
    by = chosen(executor), chosen(renderer, work="renderer")
    facts = [hashlib.sha256(model.read_bytes()).hexdigest(), *by, *([f"rank {rank}"] if rank else [])]
    named = scene or learned_scene(network), _parameters(parameters), view
    shots = plan_shots(folder, named, wanted, network, facts)
    if is_film:
        check_real_folder(folder)
    missing(folder, shots)
    _say_what_is_not_learned(output, shots, network)
    with (
        working_in(folder, "drawing pictures"),
        hint_on_interrupt(lambda: f"{folder}: the same command resumes"),
    ):
        made, watch = _draw(shots, folder, network, by, rank)
        if is_film:
            movie.write_movie(output, [shot.path for shot in shots], wanted.fps)
            for shot in shots:
                shot.path.unlink()
    if is_film:
        with suppress(OSError):  # there is more in it than the pictures that have become the film
            folder.rmdir()
    watch.report(output)
    say(f"{output}: {len(shots)} frames, {made} of them rendered now")


def _draw(
    shots: Sequence[Shot], folder: Path, network: Model, by: tuple[str, str], rank: int
) -> tuple[int, Watch]:
    """Draw the pictures that are not in the folder, which only this process uses: how many, how far off."""
    executor, renderer = by
    watch = Watch(network)
    # It was another process's until now.
    left = missing(folder, shots)
    remove_temporaries(folder)
    with open_executor(executor) as runner, progress("rendering", len(left), "frames") as advance:
        denoiser = Denoiser(runner, network, variant=with_rank(FULL, rank), pictures=len(left))
        # One device does both, from what the paths of a pixel have seen.
        features, noisy = network.features, shots[0].noisy
        beside = any(FEATURES[name].guides or name == SUN for name in features) or past.wants(features)
        together = renderer == executor != "numpy" and not (beside or (noisy.seen and feature_job(noisy)))
        draw = draw_frames if together else partial(draw_apart, film=shots)
        for _ in draw(left, watch, denoiser, renderer):
            advance(1)
    return len(left), watch


def _check_names(output: Path, model: Path, fps: float) -> None:
    """Refuse an output that is not a film and no folder, and a film that cannot be written."""
    if output.suffix.lower() in movie.WRITERS:
        check_output(output, tuple(movie.WRITERS), [model])
        movie.check(output, fps)
    elif output.suffix:
        rule = f"must end in {' or '.join(movie.WRITERS)}, or name a folder"
        raise InputError("output", str(output), rule, "rename it")


def _parameters(assignments: Sequence[str] | None) -> dict[str, Any]:
    """Return the scene's parameters; refuse a time."""
    chosen = options.parse_parameters(assignments or [])
    if "time" in chosen:
        value = chosen["time"]
        raise InputError("parameter time", value, "every frame has its own", "use --start and --seconds")
    return dict(chosen)


def _say_what_is_not_learned(output: Path, shots: Sequence[Shot], model: Model) -> None:
    """Warn of pictures that are unlike those of the training: how many, and what the first one shows."""
    found = [unlike_training(model, render_info(shot.scene, shot.noisy)) for shot in shots]
    unlike = [sentences for sentences in found if sentences]
    for sentence in unlike[0] if unlike else ():
        say(f"{output}: {len(unlike)} of {len(shots)} frames differ from the training frames: {sentence}")


def plan_shots(
    folder: Path,
    named: tuple[str, dict[str, Any], options.View],
    film: Film,
    network: Model,
    facts: Sequence[str],
) -> list[Shot]:
    """Return the pictures of an animation; `named` are the scene's name, parameters and view."""
    (name, parameters, view), size, spp = named, film.size, film.reference_spp
    source, shots = scene_source(name, parameters), []
    rays = feature_rays(network) if film.feature_spp is None else film.feature_spp
    seen, shadow_rays = sees(network.features), learned_shadow_rays(network)
    for index, time in enumerate(animation_times(film.start, film.seconds, film.fps)):
        scene = view.of(source.at(time))
        seed = film.seed + 2 * index
        noisy = Job(size, size, 1, seed, feature_spp=rays, seen=seen, shadow_rays=shadow_rays)
        reference = Job(size, size, spp, seed + 1) if spp else None
        made_from = [scene_digest(scene), noisy.facts(), reference and reference.facts(), *facts]
        text = json.dumps([*made_from, machine.versions()["wamnet"]])
        origin = hashlib.sha256(text.encode()).hexdigest()
        shots.append(Shot(folder / f"{index:05d}.png", scene, noisy, reference, origin))
    return shots


def missing(folder: Path, shots: Sequence[Shot]) -> list[Shot]:
    """Return the pictures that are not there or damaged; refuse a folder with anything else in it."""
    found = visible(folder)
    check_parent(folder)
    known = {shot.path: shot for shot in shots}
    there = {}
    for path in found:
        origin = images.read_origin(path) if path in known else ""
        if path not in known or origin not in (None, known[path].origin):
            rule = f"holds something else: {path.name}"
            raise InputError("output folder", str(folder), rule, "choose another with -o, or empty it")
        there[path] = origin
    return [shot for shot in shots if there.get(shot.path) is None]


def draw_apart(
    shots: Sequence[Shot], watch: Watch, denoiser: Denoiser, renderer: str, film: Sequence[Shot] = ()
) -> Iterator[None]:
    """Render, denoise and write pictures, rendering and denoising on different devices.

    `film`: all pictures of the film, in order, of which they are some.
    """
    film = film or shots
    frames, model, render = Frames([shot.scene for shot in film]), watch.model, render_frame.render_frame
    wanted = {shot.path for shot in shots}
    before = past.Film(renderer, [shot.scene for shot in film]) if past.wants(model.features) else None
    # The history of a missing picture is made of all pictures before it.
    count = max((number for number, shot in enumerate(film, 1) if shot.path in wanted), default=0)
    for shot in shots if before is None else film[:count]:
        frame = render(renderer, shot.scene, shot.noisy, workers=None, frames=frames).frame
        if before is not None:
            frame = before.add(shot.scene, shot.noisy, frame)
        if shot.path not in wanted:
            continue
        watch.see_frame(shot.path.name, frame)
        noisy = to_display(frame["color"], model.normalization.exposure_stops)
        denoised = denoiser.run(frame).image
        reference = None
        if shot.reference is not None:
            reference = render(renderer, shot.scene, shot.reference, workers=None, frames=frames).frame
        write_shot(shot, model, noisy, denoised, reference)
        yield


def draw_frames(shots: Sequence[Shot], watch: Watch, denoiser: Denoiser, renderer: str) -> Iterator[None]:
    """Render, denoise and write pictures by one pipeline, on the device that does both."""
    if not shots:
        return
    first, scenes, model = shots[0], [shot.scene for shot in shots], watch.model
    device, frames = denoiser.executor, Frames(scenes)
    with Pipeline(
        device,
        first.scene,
        model,
        (first.noisy.height, first.noisy.width),
        settings=first.noisy.settings,
        show=("color",),
        variant=denoiser.variant,
        pictures=denoiser.pictures,
        moving=scenes,
        feature_spp=first.noisy.feature_spp,
    ) as pipeline:
        features = tuple(dict.fromkeys(("color", *watch.features)))
        # A picture is written while the device draws the next one.
        pictures = pipeline.stream(scenes, [shot.noisy.seed for shot in shots], features=features)
        for shot, drawn in zip(shots, pictures, strict=True):
            frame = None
            if shot.reference:
                frame = render_on(device, shot.scene, shot.reference, frames=frames).frame
            watch.see_images(shot.path.name, drawn.images)
            write_shot(shot, model, drawn.images["color"], drawn.picture, frame)
            yield


def write_shot(shot: Shot, model: Model, noisy: Any, denoised: Any, reference: Frame | None) -> None:
    """Write a picture: noisy and denoised (H, W, 3), display-encoded, and the reference if there is one."""
    panels = [("noisy, 1 spp", noisy), ("denoised", denoised)]
    if reference is not None and shot.reference is not None:
        shown = to_display(reference["color"], model.normalization.exposure_stops)
        panels.append((f"reference, {shot.reference.spp} spp", shown))
    images.write_panels(shot.path, panels, shot.origin)
