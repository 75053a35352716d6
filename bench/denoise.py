"""Speed of the denoiser: schedules of the compiled kernels, their peers, and how far each is from float64.

    python bench/denoise.py --size 1024 --repeats 7
    python bench/denoise.py --size 256 --ways opencl:plain opencl:tile16 opengl:inlined numpy torch.compile
    python bench/denoise.py --channels 12 --ways opencl:tile16 opencl:tile16:rank16 opencl:tile16:rank8

A way is TARGET:SCHEDULE, TARGET:SCHEDULE:rankR (the first layer cut to rank R, in two passes), `numpy` (the
interpreter), `torch` or `torch.compile` (a convolution and 1x1 convolutions in channels-last order, all
threads; left out, with a line, where PyTorch is not installed). The network is the paper's,
864-32-32-32-32-3, or with --channels 12 (also albedo and position) 1728-32-32-32-32-3, with its initial
weights; the frame is noise. Ways take turns, so that drift of the machine's speed meets all of them alike.

Time is wall-clock time of a frame: for kernels the executor's `run`, with its checks and the copies of images
and result; `kernel` is the OpenCL kernel alone, on images that the device has. Compile is the time until a
first frame can be run: tracing, bound, emission, the driver. GFLOP/s counts two operations a weight and pixel
and nothing for sines; OpenCL's are those of the kernel alone. The share is of the rate at which NumPy's BLAS
multiplies float32 matrices of 4096 x 4096, measured between the ways; OPENBLAS_CORETYPE=SkylakeX is twice as
fast on processors with AVX-512 that OpenBLAS does not know. The error is the largest difference from float64
on a crop, beside the largest bound there; for a rank, from the network whose weights are the product of both
factors.

On a machine that others use, compare single threads: OPENBLAS_NUM_THREADS=1 POCL_MAX_PTHREAD_COUNT=1
OMP_NUM_THREADS=1, and processor time in place of wall-clock time with --cpu.
"""

from __future__ import annotations

import argparse
import importlib.util
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.cli import machine
from wamnet.compiler import bounds
from wamnet.compiler.artifact import Artifact
from wamnet.compiler.compile import analysed, compile_program, schedule_named, sine_contract
from wamnet.compiler.factor import at_images, factor, product
from wamnet.compiler.interpret import interpret
from wamnet.compiler.lower import lower
from wamnet.kernels import open_executor
from wamnet.kernels.executor import Images
from wamnet.kernels.memory import keep_freed_memory
from wamnet.refimpl import dataset, siren
from wamnet.refimpl.denoise import Model

HIDDEN = (32, 32, 32, 32, 3)
"""The paper's layers after the window of 12 x 12 pixels."""

FEATURES = {6: ("color", "normal"), 12: ("color", "normal", "albedo", "position")}
"""What the network sees, by the number of channels: the paper's, and all that the presets use."""

CROP = 48
"""Rows and columns of the crop on which errors are computed."""

MATRIX = 4096
"""Rows and columns of the matrices whose product is the machine's rate."""

PAUSE_S = 0.3
"""Seconds before a measurement: threads of OpenMP and OpenBLAS spin for a while after their last work."""

WAYS = ("opencl:plain", "opencl:vector16", "opencl:tile16", "opencl:fft32", "torch", "torch.compile")
"""What is measured by default: what takes less than a few seconds a frame."""

FACTOR = np.full((MATRIX, MATRIX), 0.5, np.float32)
"""One of the matrices."""

Run = Callable[[], NDArray[np.float32]]
Clock = Callable[[], float]


@dataclass
class Way:
    """A way to denoise: a frame, the time to prepare it, and the times of its runs, of kernels in seconds.

    `weights`: of a pixel's matrices; `expected`: the float64 reference on the crop, and the bound there.
    """

    run: Run
    on_crop: Run
    seconds_compile: float
    weights: int
    expected: tuple[Any, float]
    seconds: list[float] = field(default_factory=list)
    kernel: Callable[[Clock], float] | None = None
    seconds_kernel: list[float] = field(default_factory=list)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--ways", nargs="+", default=list(WAYS))
    parser.add_argument("--size", type=int, default=1024, help="width and height in pixels")
    parser.add_argument("--channels", type=int, choices=tuple(FEATURES), default=6)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument(
        "--cpu", action="store_true", help="processor time of all threads, not wall-clock time"
    )
    given = parser.parse_args(arguments)
    keep_freed_memory()
    clock = time.process_time if given.cpu else time.perf_counter
    model = _model(given.channels)
    images = _images(model, given.size)
    crop = {name: np.ascontiguousarray(image[:CROP, :CROP]) for name, image in images.items()}
    ways = {name: way for name in given.ways if (way := _way(name, model, images, crop))}
    products: list[float] = []
    for _ in range(given.repeats):
        products.append(_seconds(clock, _product))
        for way in ways.values():
            way.seconds.append(_seconds(clock, way.run))
            if way.kernel:
                way.seconds_kernel.append(way.kernel(clock))
    rate = 2 * MATRIX**3 / statistics.median(products) / 1e9
    facts = [
        *(f"{name} {value}" for name, value in machine.describe().items()),
        f"NumPy {np.__version__}, sgemm {MATRIX}: {rate:.0f} GFLOP/s",
        f"{given.size}x{given.size}, {'-'.join(map(str, model.siren.widths))}",
    ]
    print(", ".join(facts) + "\n")
    _print_table(ways, rate, given.size)


def _print_table(ways: Mapping[str, Way], rate: float, size: int) -> None:
    """Print a row for each way."""
    print("| way | ms, median | ms, range | GFLOP/s | of sgemm | kernel, ms | compile, s | error | bound |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, way in ways.items():
        median = statistics.median(way.seconds)
        counted = statistics.median(way.seconds_kernel or way.seconds)
        reference, bound = way.expected
        flops = 2 * way.weights * size**2 / counted / 1e9
        span = f"{1e3 * min(way.seconds):.0f} - {1e3 * max(way.seconds):.0f}"
        kernel = f"{1e3 * statistics.median(way.seconds_kernel):.0f}" if way.seconds_kernel else ""
        error = float(np.abs(way.on_crop() - reference).max())
        figures = f"{flops:.1f} | {100 * flops / rate:.0f} % | {kernel} | {way.seconds_compile:.2f}"
        print(f"| {name} | {1e3 * median:.0f} | {span} | {figures} | {error:.1e} | {bound:.1e} |")


def _model(channels: int) -> Model:
    """Return the paper's network for so many channels with its initial weights."""
    window = dataset.Window(12, "clamp")
    widths = [window.size**2 * channels, *HIDDEN]
    network = siren.init(widths, 3.0, 3.0, seed=1, dtype=np.float32)
    return Model(network, FEATURES[channels], window, dataset.Normalization())


def _images(model: Model, size: int) -> Images:
    """Return noise in the images' ranges."""
    random, images = np.random.default_rng(1), {}
    for feature in (dataset.FEATURES[name] for name in model.features):
        noise = random.random((size, size, feature.channels), dtype=np.float32)
        low, high = np.float32(feature.low), np.float32(feature.high)
        images[feature.name] = np.minimum(low + (high - low) * noise, high)
    return images


def _expected(model: Model, crop: Images, rank: int = 0, made: Artifact | None = None) -> tuple[Any, float]:
    """Return the float64 reference on the crop, and the largest bound there; of a rank: of rounding alone."""
    program, contract = analysed(lower(model)), sine_contract("ieee", "opencl")
    joined = np.concatenate(list(crop.values()), axis=-1)
    windows = {"window": dataset.all_windows(dataset.pad(joined, model.window), model.window)}
    if rank:
        cut = factor(program, rank)
        found = bounds.output_errors(program, at_images(cut, contract, crop, of_cut=False))
        program = product(cut)
    elif made:
        schedule = schedule_named(made.target, made.manifest["schedule"]["name"])
        found = bounds.output_errors(program, schedule.enclosures(program, contract, crop))
    else:
        found = bounds.at_inputs(program, windows, contract)
    (reference,), (bound,) = interpret(program, windows, np.float64).values(), found.values()
    return reference, float(bound.max())


def _product() -> Any:
    """Return a product of two square matrices."""
    return np.matmul(FACTOR, FACTOR)


def _seconds(clock: Clock, function: Callable[[], Any]) -> float:
    """Return the time that a function takes by a clock, after a pause."""
    time.sleep(PAUSE_S)
    start = clock()
    function()
    return clock() - start


# ---- ways ------------------------------------------------------------------------------------------------


def _way(name: str, model: Model, images: Images, crop: Images) -> Way | None:
    """Return a way that is ready to run, or None with a line that says what is missing."""
    if name.startswith("torch"):
        if importlib.util.find_spec("torch") is None:
            print(f"{name}: left out, PyTorch is not installed")
            return None
        return _torch(name == "torch.compile", model, images, crop)
    target, schedule, rank = [*name.split(":"), "", ""][:3]
    number = int(rank.removeprefix("rank") or 0)
    executor: Any = open_executor(target)
    start = time.perf_counter()
    artifact = compile_program(lower(model), target, "ieee", schedule or executor.schedule, number)
    executor.build(artifact, next(iter(images.values())).shape[:2])
    seconds = time.perf_counter() - start
    run, on_crop = (partial(executor.run, artifact, given) for given in (images, crop))
    kernel = partial(executor.kernel_seconds, artifact, images) if target == "opencl" else None
    weights = sum(a.size for k in artifact.kernels for a in k.program.parameters.values() if a.ndim == 2)
    return Way(run, on_crop, seconds, weights, _expected(model, crop, number, artifact), kernel=kernel)


def _torch(compiled: bool, model: Model, images: Images, crop: Images) -> Way:
    """Return the same network in PyTorch: one 12 x 12 convolution, then 1 x 1 convolutions."""
    import torch

    window = model.window.size
    first, *others = (torch.from_numpy(weight) for weight in model.siren.weights)
    kernels = [first.reshape(len(first), window, window, -1).permute(0, 3, 1, 2).contiguous()]
    kernels += [weight[:, :, None, None] for weight in others]
    biases = [torch.from_numpy(bias) for bias in model.siren.biases]
    kernels = [kernel.to(memory_format=torch.channels_last) for kernel in kernels]
    omegas = (model.siren.omega_0_first, *[model.siren.omega_0_hidden] * len(others))

    margins = (window // 2, window - 1 - window // 2) * 2

    def network(images: Sequence[Any]) -> Any:
        x = torch.nn.functional.pad(torch.cat(images, dim=1), margins, mode="replicate")
        for number, (kernel, bias) in enumerate(zip(kernels, biases, strict=True)):
            x = torch.nn.functional.conv2d(x, kernel, bias)
            if number < len(others):
                x = torch.sin(omegas[number] * x)
        return x.clamp(0.0, 1.0)

    function = torch.compile(network) if compiled else network

    def run(given: Images) -> NDArray[np.float32]:
        with torch.inference_mode():
            # A view of rows with interleaved channels is PyTorch's channels-last order.
            images = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in given.values()]
            result: NDArray[np.float32] = function(images)[0].permute(1, 2, 0).numpy()
        return result

    start = time.perf_counter()
    run(images)
    seconds, weights = time.perf_counter() - start, sum(w.size for w in model.siren.weights)
    return Way(partial(run, images), partial(run, crop), seconds, weights, _expected(model, crop))


if __name__ == "__main__":
    main()
