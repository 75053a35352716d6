"""The baseline of the kernel rebuild: images, bounds and times; bugs seeded in the old emitters, as a record.

    python experiments/house3.py images bounds
    python experiments/house3.py speed
    python experiments/publish.py out/house3/house3.json --partial

1. `images`: the SHA-256 of what kernels of every role compute on small inputs, per backend and schedule
   [`IMAGES`]. Compilers may contract differently on another processor: compare on the same machine.
2. `bounds`: the proven bound of each bundled model, per target, schedule and variant [`bounds`].
3. `speed`: milliseconds per frame, path and training step, in interleaved rounds. Nothing else may run on the
   machine [`speed`].

The record also has bugs that were seeded in the emitters before the rebuild (`rows`): commit 754642fe has the
code that planted them. All of it resumes where it was interrupted. Each part adds its rows to one file.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from lab.command import begin
from lab.records import ROOT
from lab.results import Results, Values, fill
from lab.tables import markdown
from numpy.typing import NDArray

from wamnet.compiler.compile import compile_plan
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.smooth_kernel import compile_smoothing
from wamnet.compiler.targets import DENOISERS, EXPORTED
from wamnet.compiler.variants import parse, plan_model, vary
from wamnet.kernels import open_executor
from wamnet.kernels.devices import planes
from wamnet.kernels.devices.executor import Executor, Part
from wamnet.kernels.export.check import digest_of
from wamnet.kernels.run.denoise_on import images_of
from wamnet.kernels.run.follow_on import follow_on
from wamnet.kernels.run.render_on import frames_of, render_on
from wamnet.kernels.run.trainer import train_on
from wamnet.models.model_file import load_model
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import siren, train
from wamnet.refimpl.network.dataset import Normalization, Window
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import Recipe

Array = NDArray[np.float32]

WIDTH, HEIGHT, SEED, TIME = 41, 27, 7, 1.0
"""Size of the images, a multiple of nothing; the seed of the noise, and the frame time of the scenes."""

SMALL = "small"
"""A network of 3 x 3 pixels with a border of zeros, whose layers fill no vector."""

DENOISED: Mapping[tuple[str, str, str], Sequence[str]] = {
    ("opencl", "minicubes", "full"): ("plain", "tile:16", "fft:16", "group:4"),
    ("opencl", "cornell", "full"): ("plain", "vector:16", "tile:8", "fft:8"),
    ("opencl", "glossy", "whole8"): ("plain", "tile:16", "dot:16", "groupdot:4"),
    ("opencl", SMALL, "full"): ("plain", "tile:4", "vector:16", "group:1"),
    ("c", "minicubes", "full"): ("plain", "tile:16", "fft:16"),
    ("c", "cornell", "full"): ("tile:8", "fft:8"),
    ("c", "glossy", "whole8"): ("plain", "dot:16"),
    ("c", SMALL, "full"): ("plain", "tile:4", "tile:8"),
    ("opengl", "cornell", "full"): ("plain",),
    ("opengl", "glossy", "whole8"): ("plain",),
    ("opengl", SMALL, "full"): ("plain", "inlined"),
    ("numpy", "cornell", "full"): ("plain",),
    ("numpy", "glossy", "whole8"): ("plain",),
    ("numpy", SMALL, "full"): ("plain",),
}
"""Backend, model and variant, with the schedules whose images are recorded."""

BACKENDS = ("numpy", "opencl", "c", "opengl")
"""Backends of the other roles."""

SCENES = ("minicubes", "cornell", "glossy", "daylight")
"""Scenes of the path kernels."""

RECIPE = Recipe(
    features=("color",), window=Window(5), widths=(12, 20), omega_0_first=1.0, omega_0_hidden=5.0,
    n_windows=0, batch=100, steps=20, learning_rate=1e-3, schedule="cosine", seed=3, log_every=4,
)  # fmt: skip
"""Twenty training steps of a small network."""

SCALES = Normalization(exposure_stops=-1.5)
"""Scales of the encoding and of the filter."""

# ---- images -----------------------------------------------------------------------------------------------


@cache
def model_named(name: str) -> Model:
    """Return a bundled model, or the small one."""
    if name != SMALL:
        return load_model(ROOT / "models" / f"{name}.safetensors")
    network = siren.init((3**2 * 6, 6, 5, 3), 1.0, 3.0, seed=5)
    return Model(network, ("color", "normal"), Window(3, "zero"), Normalization())


@cache
def noisy(scene: str) -> Frame:
    """Return a noisy frame of a scene."""
    settings = Settings(max_depth=2)
    return render(canonical(scene, time=TIME), Job(WIDTH, HEIGHT, 1, SEED, settings)).frame


def denoised(device: Executor, name: str, variant: str, schedule: str) -> Array:
    """Return a noisy frame, denoised."""
    artifact = compile_plan(plan_model(model_named(name), device.name, "ieee", schedule, variant))
    assert artifact.plan.picked.schedule.name == schedule, f"{device.name} {schedule} holds no {name}"
    network = vary(parse(variant), model_named(name)).model
    return device.run(artifact, images_of(network, noisy("minicubes" if name == SMALL else name)))


def traced(device: Executor, scene: str) -> Array:
    """Return the sums over two paths per pixel of a scene."""
    job = Job(WIDTH, HEIGHT, 2, SEED, Settings(max_depth=3))
    kernel = frames_of(canonical(scene, time=TIME)).of(device, canonical(scene, time=TIME), job).kernel
    return device.trace(kernel, Part(WIDTH, HEIGHT, 0, HEIGHT, 0, 2, SEED))


def encoded(device: Executor) -> Array:
    """Return the encoded images of random sums over two samples."""
    kernel = compile_encode(("color", "normal", "albedo", "depth"), SCALES, device.name)
    sums = 2 * np.random.default_rng(SEED).random((len(kernel.planes), HEIGHT, WIDTH), np.float32)
    return np.concatenate([*device.encode(kernel, sums, 2).values()], axis=-1)


def smoothed(device: Executor) -> Array:
    """Return the colour of a noisy frame after the edge-aware filter."""
    kernels = compile_smoothing(SCALES, device.name, lanes=device.lanes)
    names = ("color", "normal", "albedo", "position", "depth")
    return planes.smoothed(device, kernels, {name: noisy("minicubes")[name] for name in names})


def accumulated(device: Executor) -> Array:
    """Return the colour of the history buffer after three frames."""
    past = None
    for k in range(3):
        color = np.random.default_rng(k).random((HEIGHT, WIDTH, 3), np.float32)
        scene = canonical("minicubes", time=TIME + k / 24)
        past = follow_on(device, past, scene, Job(WIDTH, HEIGHT, seed=SEED), color)
    assert past is not None
    return np.concatenate([past.color, past.count[..., None]], axis=-1).astype(np.float32)


def trained(device: Executor) -> Array:
    """Return the parameters after twenty training steps."""
    noise = noisy("cornell")
    clean = Frame({"color": np.sqrt(noise["color"])})
    state = train_on(device, RECIPE, [(Frame({"color": noise["color"]}), clean)])
    arrays = train.state_to_arrays(state)[0]
    return np.concatenate([np.ravel(arrays[name]).astype(np.float32) for name in sorted(arrays)])


def images(devices: Callable[[str], Executor]) -> Iterator[tuple[str, Callable[[int], Values]]]:
    """Yield the name of each image, and what returns its digest."""

    def row(backend: str, compute: Callable[[Executor], Array]) -> Callable[[int], Values]:
        def digest(seed: int) -> Values:
            device = devices(backend)
            return {"part": "images", "backend": device.device, "sha256": digest_of(compute(device))}

        return digest

    for (backend, name, variant), schedules in DENOISED.items():
        for schedule in schedules:
            compute = lambda device, inputs=(name, variant, schedule): denoised(device, *inputs)  # noqa: E731
            yield f"image: {backend} {schedule} {name} {variant}", row(backend, compute)
    for backend in BACKENDS:
        for scene in SCENES:
            yield f"image: {backend} path {scene}", row(backend, lambda device, s=scene: traced(device, s))
        for role, compute in {"encode": encoded, "smooth": smoothed, "history": accumulated}.items():
            yield f"image: {backend} {role}", row(backend, compute)
    yield "image: opencl training, 20 steps", row("opencl", trained)


# ---- bounds -----------------------------------------------------------------------------------------------

MODELS = ("minicubes", "cornell", "glossy")
"""Bundled models."""

VARIANTS = ("full", "whole8")
"""Variants of a network whose bounds are recorded: as it is, and as integers."""

NO_BOUND = "none"
"""What is recorded of a kernel without a bound."""


def bounds() -> Iterator[tuple[str, Callable[[int], Values]]]:
    """Yield the name of each kernel of a bundled model, and what returns its bound."""
    for model, variant in product(MODELS, VARIANTS):
        for target in {**DENOISERS, **EXPORTED}.values():
            for schedule in target.schedules:
                inputs = model, target.name, schedule.name, variant
                yield f"bound: {' '.join(inputs)}", lambda seed, inputs=inputs: bound(*inputs)


def bound(model: str, target: str, schedule: str, variant: str) -> Values:
    """Return the largest bound of an output, and the schedule that holds the model."""
    plan = plan_model(model_named(model), target, "ieee", schedule, variant)
    proven = plan.bound.output
    largest = NO_BOUND if proven is None else max(proven)
    return {"part": "bounds", "schedule": plan.picked.schedule.name, "bound": largest}


# ---- speed ------------------------------------------------------------------------------------------------

SIZE, ROUNDS = 512, 9
"""Width and height of the frames that are timed, and how often each entry has its turn."""

TIMED = (
    ("opencl", "plain", "full"), ("opencl", "fft:16", "full"), ("opencl", "tile:16", "full"),
    ("opencl", "dot:16", "whole8"), ("c", "plain", "full"), ("c", "fft:16", "full"), ("c", "tile:16", "full"),
    ("c", "dot:16", "whole8"),
)  # fmt: skip
"""Backend, schedule and variant of the denoisers that are timed, of the mini-cubes model."""

TRAINED = Recipe(
    features=("color", "normal"), window=Window(12), widths=(32, 32), omega_0_first=1.0, omega_0_hidden=5.0,
    n_windows=0, batch=4096, steps=20, learning_rate=1e-3, schedule="cosine", seed=3, log_every=20,
)  # fmt: skip
"""The training whose steps are timed."""


def speed(devices: Callable[[str], Executor]) -> Iterator[tuple[str, Values]]:
    """Yield the milliseconds of each entry: all entries take turns, so that drift affects them alike."""
    entries = dict(timed(devices))
    for run in entries.values():
        run()
    taken: dict[str, list[float]] = {name: [] for name in entries}
    for _ in range(ROUNDS):
        for name, run in entries.items():
            began = time.perf_counter()
            count = run()
            taken[name].append(1e3 * (time.perf_counter() - began) / count)
    for name, values in taken.items():
        yield f"speed: {name}", {"part": "speed", "ms": statistics.median(values), "rounds": values}


def timed(devices: Callable[[str], Executor]) -> Iterator[tuple[str, Callable[[], int]]]:
    """Yield the entries: name, and what runs one and returns how many frames or steps it was."""
    scene, job = canonical("minicubes", time=TIME), Job(SIZE, SIZE, 1, SEED, Settings(max_depth=2))
    model, frame = model_named("minicubes"), render_on(devices("opencl"), scene, job).frame
    for backend, schedule, variant in TIMED:
        device = devices(backend)
        kernel = compile_plan(plan_model(model, backend, "ieee", schedule, variant))
        inputs = images_of(vary(parse(variant), model).model, frame)
        yield f"{backend} {schedule} {variant}", lambda d=device, k=kernel, g=inputs: one(d.run(k, g))
    device = devices("opencl")
    kernel, part = frames_of(scene).of(device, scene, job).kernel, Part(SIZE, SIZE, 0, SIZE, 0, 1, SEED)
    yield f"opencl path, {device.lanes} lanes", lambda: one(device.trace(kernel, part))
    pairs = [(frame, frame)]
    yield "opencl training step", lambda: train_on(device, TRAINED, pairs).step


def one(result: Any) -> int:
    """Return that one frame was computed."""
    return 1


# ---- what a document shows --------------------------------------------------------------------------------

HEADS = (
    "emitters of", "origin", "bugs", "on a device", "by the source checker", "only when compiled", "missed",
    "no difference", "open",
)  # fmt: skip
"""Of the table of bugs."""


def rows(result: Results) -> str:
    """Return the table of bugs: how many of each group and origin are detected, and by what."""
    groups: dict[tuple[str, str], list[Values]] = {}
    for record in result.records():
        if record["values"]["part"] == "kills":
            values = record["values"]
            groups.setdefault((values["group"], values["origin"]), []).append(values)
    cells = [[group, *counts(origin, some)] for (group, origin), some in sorted(groups.items())]
    every = [values for some in groups.values() for values in some]
    return markdown(HEADS, [*cells, ["all", *counts("", every)]])


def counts(origin: str, some: Sequence[Values]) -> list[str]:
    """Return the cells of some bugs."""
    states = Counter(values["tier"] or values["state"] for values in some)
    numbers = (
        len(some), states["device"], states["reader"], states["compile"] + states["import"], states["missed"],
        states["equal"] + states["text"], states["open"],
    )  # fmt: skip
    return [origin, *map(str, numbers)]


# ---- the record -------------------------------------------------------------------------------------------

PARTS = ("images", "bounds", "speed")
"""Parts, in their order."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run parts, and add what they find to the results."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="+", choices=PARTS, help="what to run")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/house3"), help="folder of the results")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = Results.open(options.output / "house3.json", "house3", {})
    with ExitStack() as stack:
        devices = cache(lambda name: stack.enter_context(open_executor(name)))
        if "images" in options.parts:
            fill(results, dict(images(devices)), (0,), "images")
        if "bounds" in options.parts:
            fill(results, dict(bounds()), (0,), "bounds")
        if "speed" in options.parts:
            results.put_all(dict(speed(devices)))


if __name__ == "__main__":
    begin(main)
