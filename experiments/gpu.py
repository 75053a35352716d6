"""Denoising kernels on a GPU, in each language: the error against its bound, and milliseconds per frame.

1. A language and a network are a process of its own with a time limit [`asked`]: a driver may take minutes
   for a kernel, or crash. What it had found until then is kept.
2. Each schedule is compiled, run on an image of odd size and on one of the timed size, and compared with the
   reference: every number of the small one, and three parts of the other [`checked`].
3. The kernel is launched until 0.1 s have passed, images and result staying on the device; schedules take
   turns for some rounds [`timed`]. PyTorch does the same with the same network [`by_torch`]. Processes
   compile beside each other, and one at a time has the device [`alone`].
4. Without a GPU the same runs on software: PoCL, Mesa, and CUDA C as C++ (a rehearsal: no times of a GPU).
   On a processor `--only` names C's kernels too, as an export's user compiles them, and as WebAssembly in
   Node [`by_node`]. Processor time grows less than a clock's with what else runs [`spent`].

    python experiments/gpu.py --prepare --prepared DIR   # for a machine without glslang, in less time there
    python experiments/gpu.py --prepared DIR
    python experiments/gpu.py --size 64 --rounds 1 --only opencl,cuda   # a rehearsal
    python experiments/publish.py out/gpu/gpu.json
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import json
import os
import selectors
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from lab import node
from lab.command import begin, described, spent
from lab.nvcc import NvccRunner
from lab.patches import ODD, Wanted, cropped, patches
from lab.results import Results
from lab.tables import markdown
from numpy.typing import NDArray

from wamnet.cli.common.inputs import load_model
from wamnet.compiler.artifact import Artifact
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.kernel.interface import staged
from wamnet.compiler.plan import Plan
from wamnet.compiler.reading.languages import is_read
from wamnet.compiler.schedules.common import kernel_gather
from wamnet.compiler.variants import plan_model
from wamnet.kernels.bench.workload import noise, paper_model
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.devices.kernel import shapes
from wamnet.kernels.devices.registry import open_executor
from wamnet.kernels.export import tools
from wamnet.kernels.export.gl_runner import ComputeRunner
from wamnet.kernels.export.host_runner import CRunner, CUDARunner
from wamnet.kernels.export.wgpu_runner import WgpuRunner
from wamnet.kernels.run.denoise_on import images_of
from wamnet.refimpl.errors import ExecutorUnavailable, InputError, WamnetError
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.whole import round_image

Picture = NDArray[np.float32]

BATCH_S = 0.1
"""Seconds of launches between two looks at the clock."""

MOST = 2000
"""Launches between two looks at the clock, at most."""

MODELS: Mapping[str, tuple[str, str]] = {
    "minicubes": ("minicubes", "full"),
    "minicubes-basic": ("minicubes-basic", "full"),
    "minicubes, integers": ("minicubes", "whole8"),
    "minicubes, rank 16": ("minicubes", "rank16"),
    "paper's layers": ("", "full"),
}
"""Bundled model and variant; no model is the paper's network with its initial weights."""

FLOATS = ("minicubes", "minicubes-basic", "paper's layers")
"""Networks that every language runs."""


class Compute(ComputeRunner):
    """OpenGL's compute shaders, with a wait."""

    def _finish(self) -> None:
        self._context.finish()


class Wgpu(WgpuRunner):
    """A device of WebGPU, with a wait."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._waited = self._memory("waited", (4,)).held

    def _finish(self) -> None:
        # What is read back has waited for all that was submitted before.
        self._device.queue.read_buffer(self._waited)


@dataclass(frozen=True)
class Way:
    """How a language is run: what opens its executor, in order of preference, and its schedules.

    `alone`: schedules that are each a process of their own, since their compilation may not end.
    `target`: the compiler's, where it has another name; such a row has its own schedules only.
    """

    openers: tuple[Callable[[argparse.Namespace], Executor], ...]
    schedules: tuple[str, ...]
    alone: tuple[str, ...] = ()
    models: tuple[str, ...] = FLOATS
    target: str = ""


def spirv(source: str, folder: Path | None) -> bytes:
    """Return a kernel's SPIR-V, from a folder that was prepared if it has it."""
    kept = folder and folder / f"{hashlib.sha256(source.encode()).hexdigest()}.spv"
    if kept and kept.exists():
        return kept.read_bytes()
    made = tools.spirv(source)
    if kept:
        kept.write_bytes(made)
    return made


GROUPS = ("plain", "group:1", "group:2", "group:4", "fftpasses:32")
"""Schedules for graphics processors, and the simplest; OpenCL has all but the last."""

EXPORTED, NATIVE = ("tile:8", "fft:8"), ("-O3", "-march=native")
"""Schedules of C that are compiled as an export's user does, and the options for this processor."""

WAYS: Mapping[str, Way] = {
    "cuda": Way(
        (lambda _: NvccRunner(), lambda _: CUDARunner()),
        (*GROUPS, "groupdot:4"),
        ("tile:4",),
        (*FLOATS, "minicubes, integers", "minicubes, rank 16"),
    ),
    "opencl": Way(
        (lambda _: open_executor("opencl"),),
        GROUPS[:-1],
        ("tile:4", "fft:4", "groupdot:4"),
        (*FLOATS, "minicubes, integers", "minicubes, rank 16"),
    ),
    "c": Way((lambda _: open_executor("c"),), ()),
    "c header -O2": Way((lambda _: CRunner("-O2"),), EXPORTED, target="c"),
    "c header -O3 -march=native": Way((lambda _: CRunner(*NATIVE),), EXPORTED, target="c"),
    "opengl": Way((lambda _: open_executor("opengl", context="egl"),), GROUPS),
    "glsl-compute": Way((lambda _: Compute("egl"),), GROUPS),
    "wgsl": Way((lambda _: Wgpu(),), GROUPS),
    "glsl-vulkan": Way((lambda given: Wgpu("glsl-vulkan", lambda s: spirv(s, given.prepared)),), GROUPS),
}
"""By target."""

GPU_WAYS = tuple(language for language in WAYS if not language.startswith("c") or language == "cuda")
"""What runs on graphics processors."""

TORCH, NODE = "torch", "webassembly"
"""Names of the peer, and of C's kernels in Node, among the languages."""

NODE_SCHEDULES = "tile:4", "fft:4"
"""Tiles and transforms of vectors as WebAssembly has them; the page has the latter."""

# ---- one language and network, in a process of its own ----------------------------------------------------


def network(name: str) -> tuple[Model, str]:
    """Return a model and the variant of it."""
    model, variant = MODELS[name]
    return load_model(Path(model)) if model else paper_model(), variant


def planned(name: str, target: str, schedule: str) -> Plan:
    """Return the plan of a network."""
    model, variant = network(name)
    named = WAYS[target].target if target in WAYS else ""
    return replace(plan_model(model, named or target, schedule, variant), proves=False)


def images_for(name: str, size: tuple[int, int]) -> dict[str, Picture]:
    """Return the images (H, W, C) of noise that a network reads."""
    model, variant = network(name)
    images = images_of(model, noise(max(size)))
    if variant.startswith("whole"):
        images = {feature: round_image(image) for feature, image in images.items()}
    return {feature: np.ascontiguousarray(image[: size[0], : size[1]]) for feature, image in images.items()}


@dataclass
class Kept:
    """A kernel on a device with its images."""

    executor: Executor
    artifact: Artifact
    images: Mapping[str, Any]
    written: Sequence[Any]

    @classmethod
    def of(cls, executor: Executor, artifact: Artifact, images: Mapping[str, Picture]) -> Kept:
        """Copy images to the device."""
        size = next(iter(images.values())).shape[:2]
        with executor._session():
            held = {name: executor._store(name, image) for name, image in images.items()}
            written = [executor._memory("result", shape) for shape in shapes(artifact, (size[0], size[1]))]
        return cls(executor, artifact, held, written)

    def seconds(self, launches: int) -> float:
        """Return the seconds of so many launches."""
        with self.executor._session():
            self.executor._finish()
            start = time.perf_counter()
            for _ in range(launches):
                self.executor._chain(self.artifact, self.images, self.written)
            self.executor._finish()
            return time.perf_counter() - start

    def close(self) -> None:
        """Give the memory back."""
        with self.executor._session():
            for memory in [*self.images.values(), *self.written]:
                self.executor._release(memory)


def launches_of(seconds: Callable[[int], float]) -> int:
    """Return how many launches take BATCH_S, after a first one that nobody counts."""
    seconds(1)
    count = 1
    while (taken := seconds(count)) < BATCH_S / 4 and count < MOST:
        count = min(MOST, 4 * count)
    return max(1, min(MOST, round(count * BATCH_S / taken)))


def wanted(plan: Plan, name: str, images: Mapping[str, Picture], folder: Path | None) -> Wanted:
    """Return what a kernel must write for images of noise, from a folder that was prepared if it has it."""
    height, width = next(iter(images.values())).shape[:2]
    places = patches((height, width))
    digest = hashlib.sha256(f"{name}, {plan.sine.text}, {height} x {width}".encode()).hexdigest()
    kept = folder / f"{digest[:32]}.npz" if folder and plan.shares_bound else None
    if kept is None or not kept.exists():
        value, bound = [], []
        for each in places:
            crop, inside = cropped(images, kernel_gather(plan.analysed).rows, each)
            found = plan.expected(crop)
            value.append(found.value[inside])
            bound.append(found.bound[inside])
        if kept is None:
            return Wanted(places, value, bound)
        np.savez_compressed(kept, value=np.stack(value), bound=np.stack(bound))
    with np.load(kept) as data:
        return Wanted(places, data["value"], data["bound"])


def checked(
    plan: Plan,
    name: str,
    pictures: Sequence[Picture],
    images: Sequence[Mapping[str, Picture]],
    folder: Path | None,
) -> dict[str, float]:
    """Return the largest error of both images, and the largest share of its bound."""
    both = zip(pictures, images, strict=True)
    found = [wanted(plan, name, given, folder).share(picture) for picture, given in both]
    return {"error": max(each[0] for each in found), "share": max(each[1] for each in found)}


def opened(language: str, given: argparse.Namespace) -> Executor:
    """Return the executor of a language."""
    missing = ""
    for opener in WAYS[language].openers:
        try:
            return opener(given)
        except (ExecutorUnavailable, ImportError) as error:
            missing = missing or str(error)
    raise ExecutorUnavailable(missing)


def tell(configuration: str, values: Mapping[str, Any]) -> None:
    """Hand what was found to the process that asked."""
    print(json.dumps({"configuration": configuration, "values": dict(values)}), flush=True)


@contextmanager
def alone(given: argparse.Namespace) -> Iterator[None]:
    """Have the device alone."""
    with (given.output / ".device").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def timed(ways: Mapping[str, tuple[Callable[[int], float], dict[str, Any]]], rounds: int) -> None:
    """Time kernels in turns, and tell."""
    counts = {name: launches_of(seconds) for name, (seconds, _) in ways.items()}
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, (seconds, _) in ways.items():
            before = spent()
            taken[name].append((seconds(counts[name]), spent() - before))
    for name, (_, facts) in ways.items():
        ms, work = ([1000 * each / counts[name] for each in of] for of in zip(*taken[name], strict=True))
        told = {"ms": statistics.median(ms), "least": min(ms), "most": max(ms)}
        tell(name, {**facts, **told, "processor_ms": statistics.median(work), "rounds": rounds})


def proven(artifact: Artifact, plan: Plan) -> dict[str, Any]:
    """Return the bound of a kernel for all images, and whether the source check reads its text."""
    return {"bound": max(plan.bound.output or (np.inf,)), "read": is_read(artifact.manifest)}


def answer(language: str, name: str, names: Sequence[str], given: argparse.Namespace) -> None:
    """Compile, check and time a network's kernels in a language."""
    odd, large = images_for(name, ODD), images_for(name, (given.size, given.size))
    ways: dict[str, tuple[Callable[[int], float], dict[str, Any]]] = {}
    with opened(language, given) as executor, ExitStack() as made:
        facts: dict[str, dict[str, Any]] = {n: {"device": executor.device, "schedule": n} for n in names}
        plans = {schedule: planned(name, language, schedule) for schedule in names}

        def build(schedule: str) -> Artifact | None:
            """Return a kernel that is built; None where another schedule stands in, or says what is wrong."""
            try:
                artifact = compile_plan(plans[schedule])
                start, before = time.perf_counter(), spent()
                if artifact.manifest["schedule"]["name"] != schedule:
                    return None
                executor.build(artifact)
            except WamnetError as error:
                missing = {"missing": " ".join(str(error).split())[:300]}
                tell(f"{language}, {schedule}, {name}", {**facts[schedule], **missing})
                return None
            facts[schedule] |= {"compile_s": time.perf_counter() - start, "first_s": spent() - before}
            facts[schedule] |= proven(artifact, plans[schedule])
            return artifact

        # nvcc is a program: several compile at once.
        with ThreadPoolExecutor(len(names) if isinstance(executor, NvccRunner) else 1) as pool:
            built = dict(zip(names, pool.map(build, names), strict=True))
        for schedule, artifact in built.items():
            configuration = f"{language}, {schedule}, {name}"
            try:
                if artifact is None:
                    continue
                with alone(given):
                    before = spent()
                    pictures = [executor.run(artifact, large)]
                    facts[schedule]["first_s"] += spent() - before
                    pictures.insert(0, executor.run(artifact, odd))
                facts[schedule] |= checked(plans[schedule], name, pictures, (odd, large), given.prepared)
                kept = Kept.of(executor, artifact, large)
                made.callback(kept.close)
                ways[configuration] = kept.seconds, facts[schedule]
                with alone(given):
                    timed({configuration: ways[configuration]}, 1)
            except WamnetError as error:
                told = {"missing": " ".join(str(error).split())[:300]}
                tell(configuration, {**facts[schedule], **told})
        with alone(given):
            timed(ways, given.rounds)


def by_torch(name: str, given: argparse.Namespace) -> None:
    """Time the network as convolutions of PyTorch: the baseline on the same device, with the same images."""
    import torch
    from peers import peer_torch

    if not torch.cuda.is_available():
        raise ExecutorUnavailable("torch.cuda finds no device")
    model, _ = network(name)
    images, odd = images_for(name, (given.size, given.size)), images_for(name, ODD)
    forward = peer_torch.network(model, "cuda")

    def on_device(given_images: Mapping[str, Picture]) -> Any:
        joined = np.concatenate(list(given_images.values()), axis=-1)
        x = torch.from_numpy(joined).cuda().permute(2, 0, 1)[None]
        return x.contiguous(memory_format=torch.channels_last)

    plan, held = planned(name, "numpy", "plain"), on_device(images)
    forms = {"eager": forward, "compiled": torch.compile(forward, dynamic=False)}
    ways: dict[str, tuple[Callable[[int], float], dict[str, Any]]] = {}
    with torch.inference_mode():
        for tf32 in (False, True):
            for form, function in forms.items():

                def run(given_images: Mapping[str, Picture], tf32: bool = tf32, f: Any = function) -> Picture:
                    torch.backends.cudnn.allow_tf32 = tf32
                    found: Picture = f(on_device(given_images))[0].permute(1, 2, 0).cpu().numpy()
                    return found

                def seconds(launches: int, tf32: bool = tf32, f: Any = function) -> float:
                    torch.backends.cudnn.allow_tf32 = tf32
                    torch.cuda.synchronize()
                    start = time.perf_counter()
                    for _ in range(launches):
                        f(held)
                    torch.cuda.synchronize()
                    return time.perf_counter() - start

                device = f"{torch.cuda.get_device_name()}, PyTorch {torch.__version__}"
                facts = {"device": device, "schedule": f"{form}, {'TF32' if tf32 else 'float32'}"}
                configuration = f"{TORCH}, {facts['schedule']}, {name}"
                try:
                    start = time.perf_counter()
                    pictures = [run(given_images) for given_images in (odd, images)]
                    facts["compile_s"] = time.perf_counter() - start
                    facts |= checked(plan, name, pictures, (odd, images), given.prepared)
                    ways[configuration] = seconds, facts
                except RuntimeError as error:
                    tell(configuration, {**facts, "missing": " ".join(str(error).split())[:300]})
        with alone(given):
            timed(ways, given.rounds)


def by_node(name: str, schedules: Sequence[str], given: argparse.Namespace) -> None:
    """Time kernels of C as WebAssembly, on one thread of Node."""
    odd, large = images_for(name, ODD), images_for(name, (given.size, given.size))
    for schedule in schedules:
        plan, configuration = planned(name, "c", schedule), f"{NODE}, {schedule}, {name}"
        artifact = compile_plan(plan)
        with tempfile.TemporaryDirectory() as folder, alone(given):
            small, _ = node.run(artifact, odd, Path(folder), 0)
            picture, told = node.run(artifact, large, Path(folder), given.rounds)
        ms = [1000 * seconds for seconds in told["taken"]]
        tell(
            configuration,
            {
                "device": f"Node {told['version']}, one thread",
                "schedule": schedule,
                "compile_s": told["first"] - statistics.median(told["worked"]),
                "first_s": told["first"],
                **proven(artifact, plan),
                **checked(plan, name, (small, picture), (odd, large), given.prepared),
                "ms": statistics.median(ms),
                "least": min(ms),
                "most": max(ms),
                "processor_ms": 1000 * statistics.median(told["worked"]),
                "rounds": given.rounds,
            },
        )


# ---- all of them ------------------------------------------------------------------------------------------


def tasks(given: argparse.Namespace) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield language, network and schedules of each process; what may not end comes last."""
    asked_for = {language: way for language, way in WAYS.items() if language in given.only}
    for language, way in asked_for.items():
        for name in way.models:
            if name in given.models:
                yield language, name, way.schedules if way.target else given.schedules or way.schedules
    if NODE in given.only:
        for name in FLOATS:
            if name in given.models:
                yield NODE, name, NODE_SCHEDULES
    if TORCH in given.only:
        for name in FLOATS:
            if name in given.models:
                yield TORCH, name, ("",)
    for language, way in asked_for.items():
        for schedule in () if given.schedules else way.alone:
            name = "minicubes, integers" if "dot" in schedule else given.models[0]
            yield language, name, (schedule,)


def asked(task: tuple[str, str, Sequence[str]], given: argparse.Namespace, results: Results) -> None:
    """Ask a process, and keep each answer when it comes."""
    language, name, schedules = task
    command = [sys.executable, __file__, "--task", language, name, ",".join(schedules)]
    command += ["--size", str(given.size), "--rounds", str(given.rounds), "-o", str(given.output)]
    command += ["--prepared", str(given.prepared)] if given.prepared else []
    start, found, whole = time.monotonic(), False, b""
    # With PYTHONSAFEPATH a program's folder is not among those of modules.
    folders = os.pathsep.join(filter(None, [str(Path(__file__).parent), os.environ.get("PYTHONPATH")]))
    one = {**os.environ, "PYTHONPATH": folders, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(command, env=one, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        selector = selectors.DefaultSelector()
        selector.register(running.stdout, selectors.EVENT_READ)
        selector.register(running.stderr, selectors.EVENT_READ)
        told = {running.stdout: b"", running.stderr: b""}
        while selector.get_map():
            left = given.seconds - (time.monotonic() - start)
            ready = selector.select(max(left, 0))
            if not ready:
                running.kill()
                break
            for key, _ in ready:
                stream: Any = key.fileobj
                if not (data := stream.read1(65536)):
                    selector.unregister(stream)
                told[stream] += data
            *lines, told[running.stdout] = told[running.stdout].split(b"\n")
            for line in filter(None, lines):
                answered = json.loads(line)
                results.put(answered["configuration"], 0, answered["values"])
                found = True
        status, whole = running.wait(), told[running.stderr]
    if status:
        last = whole.decode(errors="replace").strip().splitlines()[-1:] or [""]
        reason = f"ended after {time.monotonic() - start:.0f} s with status {status}: {last[0][:300]}"
        kind = " (more of it is kept)" if found else ""
        results.put(f"{language}, {', '.join(schedules)}, {name}", 0, {"missing": reason + kind})


HEADS = ("language", "schedule", *(f"{name}, ms" for name in MODELS), "largest share of the bound")
"""Of the table."""


def rows(results: Results) -> str:
    """Return the table of milliseconds: a row for each language and schedule of a target."""
    found: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for record in results.records():
        values = record["values"]
        name = next(n for n in MODELS if record["configuration"].endswith(f", {n}"))
        if "ms" in values and "@" not in values["schedule"]:  # groups of other sizes
            language = record["configuration"].partition(", ")[0]
            found.setdefault((language, values["schedule"]), {})[name] = values
    cells = []
    for head in sorted(found, key=lambda key: [*WAYS, NODE, TORCH].index(key[0])):
        of = found[head]
        share = max(values["share"] for values in of.values())
        times = [f"{of[name]['ms']:.2f}" if name in of else "" for name in MODELS]
        cells.append([*head, *times, f"{share:.2g}"])
    return markdown(HEADS, cells)


def prepare(given: argparse.Namespace) -> None:
    """Translate all kernels for Vulkan to SPIR-V, and compute what kernels must write."""
    given.prepared.mkdir(parents=True, exist_ok=True)
    for name in FLOATS:
        for schedule in WAYS["glsl-vulkan"].schedules:
            for kernel in compile_plan(planned(name, "glsl-vulkan", schedule)).kernels:
                count = kernel.source.count(" STAGE == ")
                for text in [staged(kernel.source, n) for n in range(count)] or [kernel.source]:
                    spirv(text, given.prepared)
    for name in MODELS:
        for size in (ODD, (given.size, given.size)):
            images = images_for(name, size)
            for language in ("numpy", *(n for n, way in WAYS.items() if name in way.models)):
                wanted(planned(name, language, "plain"), name, images, given.prepared)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print the table."""
    parser = described(__doc__)
    listed = lambda text: tuple(filter(None, text.split(",")))  # noqa: E731
    parser.add_argument("--size", type=int, default=1024, help="pixels of a side of the timed image")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=200, help="time limit of a language and network")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at a time")
    parser.add_argument("--only", type=listed, default=(*GPU_WAYS, TORCH), help="languages")
    parser.add_argument("--models", type=lambda t: tuple(t.split(";")), default=tuple(MODELS), help="by ;")
    parser.add_argument("--schedules", type=listed, default=(), help="others, as tile:8")
    parser.add_argument("--prepared", type=Path, help="folder of SPIR-V and references")
    parser.add_argument("--prepare", action="store_true", help="write that folder, and end")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/gpu"), help="folder of the results")
    parser.add_argument("--task", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.task:
        language, name, schedules = given.task
        if language == TORCH:
            by_torch(name, given)
        elif language == NODE:
            by_node(name, schedules.split(","), given)
        else:
            answer(language, name, schedules.split(","), given)
        return
    if given.prepare:
        prepare(given)
        return
    known = (*WAYS, NODE, TORCH, *MODELS)
    if unknown := [name for name in (*given.only, *given.models) if name not in known]:
        rule = f"must be among {', '.join(known)}"
        raise InputError("language or network", unknown[0], rule, "correct it")
    results = Results.open(given.output / "gpu.json", "gpu", {"size": given.size, "rounds": given.rounds})
    start = time.monotonic()
    with ThreadPoolExecutor(given.jobs) as pool:
        waiting = {pool.submit(asked, task, given, results): task for task in tasks(given)}
        for done in as_completed(waiting):
            done.result()
            language, name, schedules = waiting[done]
            told = f"{time.monotonic() - start:6.1f} s  {language}, {name}, {', '.join(schedules)}: done"
            print(told, file=sys.stderr, flush=True)
    print(rows(results))
    for record in results.records():
        if "missing" in record["values"]:
            print(f"{record['configuration']}: {record['values']['missing']}", file=sys.stderr)


if __name__ == "__main__":
    begin(main)
