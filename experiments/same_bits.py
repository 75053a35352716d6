"""One picture of a network of integers by every compiler and device that is here: one SHA-256, or a finding.

1. A noisy picture of a scene is rendered and encoded; a shipped network is rounded to integers, and the
   reference denoises the picture: the digest that all must have [`made`].
2. Each way is a process of its own with its own environment and options: they let its compiler reorder, fuse
   and drop what it can [`WAYS`]. It denoises the picture in some schedules [`answer`].
3. The same is asked of the network of floats, under profile ieee: the share of its numbers that have not
   NumPy's bits says what such freedom costs where operations round.
4. One table, a row a way and schedule; what is not installed has a row that says so. The command fails where
   a picture of integers differs.

    python experiments/same_bits.py
    python experiments/same_bits.py --only opencl,c --size 96
    python experiments/publish.py --run same-bits python experiments/same_bits.py
"""

from __future__ import annotations

import argparse
import ctypes.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lab import browsers
from lab.command import begin
from numpy.typing import NDArray

from wamnet.cli.common.inputs import load_model
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.variants import parse, vary
from wamnet.kernels import open_executor
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.export import onnx_export, tools
from wamnet.kernels.export.check import digest_of
from wamnet.kernels.export.gl_runner import ComputeRunner, ESRunner
from wamnet.kernels.export.host_pass_runner import GodotRunner
from wamnet.kernels.export.host_runner import CRunner, CUDARunner, MetalRunner
from wamnet.kernels.export.tint_runner import TintRunner
from wamnet.kernels.export.wgpu_runner import WgpuRunner, hlsl_runner, vulkan_runner
from wamnet.kernels.run.denoise_on import images_of
from wamnet.models.model_file import save_model
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import all_windows, pad
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.whole import Whole, forward_whole

Picture = NDArray[np.float32]
Images = Mapping[str, Picture]
Run = Callable[[Model, Images, str], tuple[str, Picture]]
"""(model, images, schedule) -> device, picture."""

WHOLE, FULL = "whole", "full"
"""Both networks, by the names of their files."""

SEED, TIME = 7, 1.0
"""The picture's noise, and the moment of its scene."""

LIMIT_S = 1200
"""Seconds that a way may take: compilers of shaders are slow."""

RELAXED = {
    "PYOPENCL_BUILD_OPTIONS": "-cl-fast-relaxed-math -cl-mad-enable -cl-unsafe-math-optimizations",
}
"""What lets OpenCL's compilers do most."""

FAST = ("-Ofast", "-ffp-contract=fast", "-march=native")
"""The same of compilers of C and C++."""

C_COMPILERS: Mapping[str, Sequence[str]] = {
    "gcc": FAST,
    "clang": ("-O3", "-ffast-math", *FAST[1:]),
    "tcc": (),
}
"""Compilers of C and what lets each do most; tcc relaxes nothing."""

VENDORS = "OCL_ICD_VENDORS"
"""Environment variable with a folder that names drivers of OpenCL, or with one driver's library."""

DRIVERS: Mapping[str, tuple[str, str, str]] = {
    "PoCL of Debian": ("libpocl.so.2", "pocl", "apt-get install libpocl2"),
    "Intel's runtime": (
        f"{sys.prefix}/lib/libintelocl.so",
        f"{sys.prefix}/lib/libintelocl.so",
        "pip install intel-opencl-rt intel-cmplr-lib-rt",
    ),
    "OpenCL of the system": ("/etc/OpenCL/vendors", "/etc/OpenCL/vendors", "a driver that is named there"),
}
"""Drivers beside the wheel's: what is loaded, the path or library that must be there, and how it gets there.
Debian's library without its package pocl-opencl-icd is named nowhere: other programs keep their driver."""


@dataclass(frozen=True)
class Way:
    """How a picture is computed; `kind` groups ways for --only, `options` is what the table says.

    `needs`: the path or library without which it is not here, and `way_out` how to get it. `slow`: further
    schedules, whose kernels Mesa compiles for minutes: only --slow asks for them.
    """

    kind: str
    name: str
    run: Run
    schedules: tuple[str, ...] = ("plain",)
    options: str = ""
    environment: Mapping[str, str] | None = None
    needs: str = ""
    way_out: str = ""
    slow: tuple[str, ...] = ()


def on(opened: Callable[[], Executor]) -> Run:
    """Return what compiles a network for an executor, and runs it."""

    def run(model: Model, images: Images, schedule: str) -> tuple[str, Picture]:
        with opened() as executor:
            profile = "native" if model.is_whole else "ieee"
            artifact = compile_program(lower(model), executor.name, profile, schedule)
            return executor.device, executor.run(artifact, images)

    return run


def by_graph(model: Model, images: Images, schedule: str) -> tuple[str, Picture]:
    """Run the graph by ONNX Runtime."""
    return onnx_export.run_graph(onnx_export.graph(model), images)


def by_evaluator(model: Model, images: Images, schedule: str) -> tuple[str, Picture]:
    """Run the graph by the evaluator that defines ONNX's operators."""
    import onnx
    from onnx.reference import ReferenceEvaluator

    (found,) = ReferenceEvaluator(onnx_export.graph(model)).run(None, dict(images))
    return f"onnx.reference {onnx.__version__}", found


def in_browser(flags: Sequence[str]) -> Run:
    """Return what denoises in WebGL 2 in Chromium."""
    return lambda model, images, schedule: browsers.denoise(model, images, flags)


def in_firefox(model: Model, images: Images, schedule: str) -> tuple[str, Picture]:
    """Denoise in WebGL 2 in Firefox."""
    return browsers.denoise_in_firefox(model, images)


def dxc_runner() -> WgpuRunner:
    """Return a runner of HLSL that Microsoft's compiler makes SPIR-V of."""
    if shutil.which(DXC[0]) is None:
        raise ExecutorUnavailable(
            "there is no dxc; where Debian has it: apt-get install directx-shader-compiler"
        )

    def translated(source: str) -> bytes:
        with tempfile.TemporaryDirectory(prefix="wamnet-dxc-") as name:
            made, written = Path(name) / "kernel.hlsl", Path(name) / "kernel.spv"
            made.write_text(tools.hlsl(tools.spirv(source), "dxc"), encoding="utf-8")
            done = subprocess.run([*DXC, "-Fo", written, made], capture_output=True, text=True, check=False)
            if done.returncode:
                raise CompileError(f"dxc rejects the kernel: {done.stderr}")
            return written.read_bytes()

    return WgpuRunner("glsl-vulkan", translated)


def _executors() -> Iterator[Way]:
    """Yield NumPy, OpenCL and OpenGL."""
    yield Way("numpy", "NumPy", on(lambda: open_executor("numpy")))
    opencl, schedules = (
        on(lambda: open_executor("opencl")),
        ("plain", "group:4", "vector:16", "tile:16", "dot:16"),
    )
    for environment in ({}, RELAXED):
        options = " ".join(environment.values())
        yield Way("opencl", "PoCL of the wheel", opencl, schedules, options, environment)
        for named, (loaded, needs, way_out) in DRIVERS.items():
            told = {**environment, VENDORS: loaded}
            yield Way("opencl", named, opencl, schedules, options, told, needs, way_out)
    egl = on(lambda: open_executor("opengl", context="egl"))
    yield Way("opengl", "GLSL, fragments", egl)
    yield Way("opengl", "GLSL, fragments", egl, options="vectors of 4", environment=NARROW)
    yield Way("opengl", "GLSL, fragments", on(lambda: open_executor("opengl", context="osmesa")))
    yield Way("opengl", "GLSL, fragments", egl, options="softpipe", environment=SOFTPIPE)
    yield Way("opengl", "GLSL, compute", on(ComputeRunner), (), slow=("plain", "group:1"))
    yield Way("opengl", "GLSL ES", on(ESRunner))
    yield Way("opengl", "Godot", on(GodotRunner))


DXC = ("dxc", "-spirv", "-T", "cs_6_0", "-E", "main", "-O3")
"""Microsoft's compiler of HLSL; without `precise` it may reorder."""

NARROW = {"LP_NATIVE_VECTOR_WIDTH": "128"}
"""llvmpipe then takes other instructions, without fused multiply-add."""

SOFTPIPE = {"GALLIUM_DRIVER": "softpipe", "LIBGL_ALWAYS_SOFTWARE": "1"}
"""Mesa's other software renderer, which interprets shaders."""


def _compilers() -> Iterator[Way]:
    """Yield compilers of C and C++, strict and as fast as they can."""
    tiles = ("plain", "tile:8", "dot:16")
    for compiler, fast in C_COMPILERS.items():
        for options in dict.fromkeys(((), tuple(fast))):
            environment, text = {"CC": compiler}, " ".join(options)
            yield Way("c", f"C, {compiler}", on(lambda o=options: CRunner(*o)), tiles, text, environment)
    for runner, language in ((CUDARunner, "CUDA C"), (MetalRunner, "Metal")):
        for compiler in ("g++", "clang++"):
            name = f"{language} as C++, {compiler}"
            relaxed = on(lambda made=runner: made(*FAST))
            yield Way("c++", name, relaxed, ("plain", "group:4"), " ".join(FAST), {"CXX": compiler})


def _others() -> Iterator[Way]:
    """Yield Vulkan, WebGPU, ONNX and browsers."""
    groups = ("group:1", "group:4")
    yield Way("vulkan", "WGSL, naga", on(WgpuRunner), slow=groups)
    yield Way("vulkan", "WGSL, Tint, SPIR-V", on(TintRunner), ("plain", *groups))
    tint_gles = on(lambda: TintRunner("opengles"))
    yield Way("opengl", "WGSL, Tint, GLSL ES", tint_gles, (), slow=("plain", *groups))
    yield Way("vulkan", "GLSL, SPIR-V, naga", on(vulkan_runner), slow=groups)
    for style in ("fxc", "dxc"):
        yield Way(
            "vulkan", f"HLSL for {style}, SPIR-V, naga", on(lambda s=style: hlsl_runner(s)), slow=groups
        )
    yield Way("vulkan", "HLSL, DXC, SPIR-V, naga", on(dxc_runner), options=" ".join(DXC), slow=groups)
    yield Way("onnx", "ONNX", by_graph, ("",))
    yield Way("onnx", "ONNX", by_evaluator, ("",))
    for angle in ("swiftshader", "gl-egl"):
        flags = (f"--use-angle={angle}",)
        yield Way("web", "WebGL 2, Chromium", in_browser(flags), ("packed",), " ".join(flags))
    yield Way("web", "WebGL 2, Firefox", in_firefox, ("packed",))


WAYS: tuple[Way, ...] = (*_executors(), *_compilers(), *_others())
"""All ways, in the table's order."""


# ---- the case ---------------------------------------------------------------------------------------------


def made(folder: Path, model: Path, variant: str, size: int) -> str:
    """Write both networks, their images and what they must give into a folder; return the digest."""
    full = load_model(model)
    whole = vary(parse(variant), full).model
    name = full.info.get("trained_on_scene", "minicubes").partition(",")[0]
    scene, settings = canonical(name, time=TIME), Settings(max_depth=2)
    frame = render(scene, Job(size, size, 1, SEED, settings)).frame
    for what, network in ((WHOLE, whole), (FULL, full)):
        images = images_of(network, frame)
        save_model(folder / f"{what}.safetensors", network)
        expected = by_definition(network, images)
        np.savez(folder / f"{what}.npz", expected=expected, **images)
    return digest_of(np.load(folder / f"{WHOLE}.npz")["expected"])


def by_definition(model: Model, images: Images) -> Picture:
    """Return the reference's picture; of floats that of the NumPy executor, whose bits are compared."""
    if not isinstance(model.siren, Whole):
        return on(lambda: open_executor("numpy"))(model, images, "plain")[1]
    joined = np.concatenate([images[name] for name in model.features], axis=-1)
    rows = [
        forward_whole(model.siren, all_windows(pad(joined, model.window), model.window)[row])
        for row in range(len(joined))
    ]
    return np.stack(rows).astype(np.float32)


# ---- one way, in a process of its own ---------------------------------------------------------------------


def answer(way: Way, schedule: str, folder: Path) -> dict[str, Any]:
    """Return what a way makes of both networks, or what is missing for it."""
    found: dict[str, Any] = {}
    for what in (WHOLE, FULL):
        kept = dict(np.load(folder / f"{what}.npz"))
        expected = kept.pop("expected")
        model = load_model(folder / f"{what}.safetensors")
        try:
            device, picture = way.run(model, kept, schedule)
        except (ExecutorUnavailable, ImportError) as error:
            return {**found, "missing": str(error)}
        except CompileError as error:
            # A kernel of floats may refuse options that would break its bound.
            return {**found, "missing": f"refused: {error}"}
        differ = picture.view(np.uint32) != expected.view(np.uint32)
        found[what] = {"device": device, "digest": digest_of(picture), "differ": float(differ.mean())}
        if differ.any():
            row, column, channel = (int(i) for i in np.argwhere(differ)[0])
            numbers = [float(image[row, column, channel]) for image in (picture, expected)]
            place = f"pixel ({column}, {row}), channel {channel}"
            found[what]["first"] = f"{place}: {numbers[0]}, not {numbers[1]}"
    return found


def lacking(way: Way) -> str:
    """Return what a way needs and is not here, or nothing."""
    named = [(way.environment or {}).get(name) for name in ("CC", "CXX")]
    if missing := [name for name in named if name and shutil.which(name) is None]:
        return f"there is no {missing[0]}"
    found = Path(way.needs).exists() if "/" in way.needs else ctypes.util.find_library(way.needs)
    return f"there is no {way.needs}: {way.way_out}" if way.needs and not found else ""


def asked(number: int, schedule: str, folder: Path) -> dict[str, Any]:
    """Return the answer of a process for one way and schedule."""
    way = WAYS[number]
    command = [sys.executable, __file__, "--way", str(number), "--schedule", schedule, "--case", str(folder)]
    environment = {**os.environ, **(way.environment or {})}
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=LIMIT_S
        )
    except subprocess.TimeoutExpired:
        return {"missing": f"it took more than {LIMIT_S} s"}
    last = done.stdout.strip().splitlines()[-1:]
    if done.returncode or not last:
        told = (done.stderr.strip().splitlines() or ["nothing"])[-1]
        return {"missing": f"ended with status {done.returncode}: {told}"}
    found: dict[str, Any] = json.loads(last[0])
    return found


MOST_SAID = 160
"""Most letters of a reason."""

HEADS = ("compiler or device", "found", "options", "schedule", "SHA-256", "equal", "floats that differ")
"""Of the table."""


def rows(only: Sequence[str], folder: Path, digest: str, slow: bool = False) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each way and schedule."""
    for number, way in enumerate(WAYS):
        if only and way.kind not in only:
            continue
        missing, asked_for = lacking(way), way.schedules + way.slow * slow
        for schedule in [", ".join(asked_for)] if missing else asked_for:
            found = {"missing": missing} if missing else asked(number, schedule, folder)
            head = (way.name, way.options or "-", schedule or "-")
            if WHOLE not in found:
                said = " ".join(found["missing"].split())[:MOST_SAID].replace("|", "/")
                yield head[0], f"NOT HERE: {said}", *head[1:], "-", "-", "-"
                continue
            of = found[WHOLE]
            equal = "yes" if of["digest"] == digest else f"NO: {of['first']}"
            floats = f"{found[FULL]['differ']:.1%}" if FULL in found else "refused"
            yield head[0], of["device"], *head[1:], of["digest"], equal, floats
        if way.slow and not slow:
            yield (
                way.name,
                "NOT RUN: takes minutes, add --slow",
                way.options or "-",
                ", ".join(way.slow),
                "-",
                "-",
                "-",
            )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table; end with status 1 if a picture differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    shipped = Path(__file__).parents[1] / "models/cornell.safetensors"
    parser.add_argument("--model", type=Path, default=shipped, help="a model of floats")
    parser.add_argument("--variant", default="whole8", help="how it is rounded")
    parser.add_argument("--size", type=int, default=32, help="pixels of a side")
    parser.add_argument("--only", default="", help=f"kinds: {', '.join(dict.fromkeys(w.kind for w in WAYS))}")
    parser.add_argument("--slow", action="store_true", help="also what Mesa compiles for minutes")
    for name in ("--way", "--schedule", "--case"):
        parser.add_argument(name, default="", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.way:
        print(json.dumps(answer(WAYS[int(given.way)], given.schedule, Path(given.case))))
        return
    with tempfile.TemporaryDirectory(prefix="wamnet-bits-") as name:
        digest = made(Path(name), given.model, given.variant, given.size)
        told = f"{given.model.stem}, {given.variant}, {given.size} x {given.size} pixels"
        print(f"{told}; the reference: {digest}\n")
        print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}", flush=True)
        differ = 0
        only = list(filter(None, given.only.split(",")))
        for cells in rows(only, Path(name), digest, given.slow):
            print(f"| {' | '.join(cells)} |", flush=True)
            differ += cells[5].startswith("NO")
    if differ:
        raise SystemExit(1)


if __name__ == "__main__":
    begin(main)
