"""Kernels of small programs in all languages and schedules: what a change of an emitter is compared by.

[`sources`] returns, by name, the source of each kernel and the digest of its packed weights. The programs
hold what emitters distinguish: both borders, layers of less and more than one vector, images of several
channels, integer networks, path kernels with lights and lists, and the other roles.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain

import numpy as np

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Program, Type, sha256
from wamnet.compiler.core.loops import LISTS
from wamnet.compiler.core.trace import trace
from wamnet.compiler.plan import analysed
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.history_kernel import compile_history
from wamnet.compiler.scenes.lower_scene import FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.smooth_kernel import compile_smoothing
from wamnet.compiler.schedules.c_fourier import CFourier
from wamnet.compiler.schedules.emit import output_channels
from wamnet.compiler.schedules.emit_fourier import Fourier
from wamnet.compiler.schedules.opencl_fourier import OpenCLFourier
from wamnet.compiler.schedules.schedules import pick
from wamnet.compiler.targets import DENOISERS, EXPORTED
from wamnet.compiler.training.step_kernel import compile_step
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light.scene import Sphere
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization, Window
from wamnet.refimpl.network.denoise import denoise_pixel
from wamnet.refimpl.network.whole import forward_whole, rounded

FEATURES = ("color", "normal", "albedo", "depth")
"""Features of the encoding."""

LARGEST = 127.0
"""Largest value of an integer network's images."""

TARGETS = {**DENOISERS, **EXPORTED}
"""All targets."""


def sources(file: str = "") -> dict[str, str]:
    """Return the source of each kernel by its name, and after it the digest of its weights.

    `file`: the module that may be changed; a schedule's makes no difference to other roles.
    """
    result = dict(chain(denoisers(), spectra(), passes()))
    return result if file.startswith("compiler/schedules/") else result | dict(chain(paths(), others()))


def others() -> Iterator[tuple[str, str]]:
    """Yield kernels of encodings, filters, histories and training."""
    for name, target in TARGETS.items():
        if target.encodes:
            yield f"{name} encode", compile_encode(FEATURES, Normalization(), name).source
        for lanes in sorted(target.planes)[::3] if target.dialect else ():
            kernels = compile_smoothing(Normalization(), name, lanes=lanes)
            yield f"{name} filter {lanes}", kernels.guide.source + kernels.smooth.source
        if target.planes and target.dialect:
            yield f"{name} history", compile_history(name).source
    yield "opencl training", compile_step((2 * 2 * 3, 20, 3), (1.0, 10.0), 4, 2).source
    yield "opencl training of factors", compile_step((2 * 2 * 3, 20, 3), (1.0, 10.0), 4, 2, 5).source


def denoisers() -> Iterator[tuple[str, str]]:
    """Yield the denoisers: each program in each schedule that holds it."""
    for label, program in programs().items():
        for name, target in TARGETS.items():
            for schedule in target.schedules:
                if pick(target.schedules, schedule.name, program).schedule is not schedule:
                    continue
                if target.dialect and output_channels(program) > target.dialect.max_output_channels:
                    continue
                source = schedule.emit(program, ["a kernel"], True)
                yield (
                    f"{name} {schedule.name} {label}",
                    f"{source}weights {sha256(schedule.pack(program).tobytes())}\n",
                )


def spectra() -> Iterator[tuple[str, str]]:
    """Yield denoisers by FFT, with tiles of 4 x 4 points: as large ones are, in shorter codelets."""
    for dialect in (OpenCLFourier(4), CFourier(4)):
        for label, tiles in (("one tile", 1), ("two tiles", 2)):
            schedule = Fourier("fft4", "an idea", dialect, 4, 2, 4, tiles)
            for name in ("zero border", "wide layers"):
                program = programs()[name]
                source = schedule.emit(program, ["a kernel"], True)
                weights = sha256(schedule.pack(program).tobytes())
                yield f"{dialect.target} fft4 {label} {name}", f"{source}weights {weights}\n"


def passes() -> Iterator[tuple[str, str]]:
    """Yield the two kernels of a first layer of low rank."""
    for name in ("opencl", "c", "opengl"):
        second = compile_program(_network({"a": 3, "b": 2}, "zero", (5, 3)), name, rank=2)
        parts = (f"{kernel.source}weights {sha256(kernel.weights.tobytes())}" for kernel in second.kernels)
        yield f"{name} rank 2", "\n".join(parts)


def programs() -> dict[str, Program]:
    """Return small networks, by name."""
    return {
        "zero border": _network({"a": 3, "b": 2}, "zero", (5, 3)),
        "wide layers": _network({"a": 1, "b": 4}, "clamp", (40, 20, 3), activation="relu"),
        "many channels": _network({"a": 3}, "zero", (5, 6)),
        "exact": _network({"a": 2}, "clamp", (4, 2), profile="exact"),
        "integers": _network({"a": 3, "b": 2}, "zero", (6, 3), whole=True),
    }


def _network(
    channels: dict[str, int],
    border: str,
    widths: tuple[int, ...],
    activation: str = "sine",
    profile: str = "ieee",
    whole: bool = False,
) -> Program:
    """Return the program of a small network."""
    most = LARGEST if whole else 1.0
    images = tuple(Image(name, count, -most, most, whole=whole) for name, count in channels.items())
    gather = Gather(Window(2, border), images)
    network = siren.init((gather.n_inputs, *widths), 1.0, 3.0, 1, np.float32, activation)
    integer = rounded(network, 2) if whole else None
    function = (lambda x: forward_whole(integer, x)) if whole else lambda x: denoise_pixel(network, x)
    return analysed(trace(function, {"window": Type(shape=(gather.n_inputs,))}, gather), profile)


def paths() -> Iterator[tuple[str, str]]:
    """Yield path kernels: a light, a list of spheres, and evenly spread feature rays."""
    spheres = tuple(Sphere((0.3 * i, 0.1, 0.2 - i), 0.1 + 0.1 * i, (0.2, 0.3 * i, 0.1)) for i in range(3))
    furnace = replace(canonical("furnace"), name="spheres", spheres=spheres)
    scenes = {
        "light": lower_scene(canonical("lone_light"), Settings(max_depth=2)),
        "list": lower_scene(furnace, Settings(max_depth=1), LISTS),
        "rays": lower_scene(canonical("furnace"), Settings(max_depth=1), rays=FeatureRays(4, "net")),
    }
    for name, target in TARGETS.items():
        for lanes in sorted(target.paths)[::3]:
            for label, lowered in scenes.items():
                groups = ("color", "normal") if label == "rays" else ("color", "normal", "albedo")
                with suppress(CompileError):
                    yield (
                        f"{name} path {lanes} {label}",
                        compile_path(lowered, name, "ieee", lanes, groups).source,
                    )
