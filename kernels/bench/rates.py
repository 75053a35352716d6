"""What the machine and each executor do in a second, by measurements that take no answer into account.

1. The machine: a product of two square matrices by NumPy's BLAS (`sgemm`), a triad a = b + s c of arrays
   that no cache holds, counted as three passes as in J. McCalpin's STREAM ("Memory Bandwidth and Machine
   Balance in Current High Performance Computers", IEEE TCCA Newsletter, 1995), and NumPy's sine; the last two
   in a thread for each core [`machine_ways`, `limits_of`].
2. An executor with a schedule: three small programs of its own [`probes`]: a window of 2 x 2, one of 6 x 6,
   and the first one with a chain of sines, on a picture so large that they take milliseconds [`probe_times`].
   Differences of their times give products and sines a second, and what is left of the first one's time is
   that of a pixel [`rates_of`].
3. A way to denoise is a list of stages that run one after another: a kernel, or an operation of a library
   that reads and writes whole pictures [`Stage`]. A stage takes as long as its arithmetic or its memory,
   whichever is longer: S. Williams, A. Waterman and D. Patterson, "Roofline: An Insightful Visual Performance
   Model for Multicore Architectures", Communications of the ACM 52(4), 2009, figure 1 [`predicted_seconds`]

       pixels * max(pixel + products / products_per_s + sines / sines_per_s, bytes / bytes_per_s)

Departure from the source: sines are counted apart from products, because one takes as long as many of those.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_program
from ...compiler.core.ir import Gather, Image, Program, Type
from ...compiler.core.trace import trace
from ...compiler.schedules.common import kernel_gather, output_channels
from ...compiler.targets import Language
from ...refimpl import rng
from ...refimpl.network.window import Window
from ..devices.executor import Executor
from ..measure import Round, Times, in_turns
from ..memory import cores
from ..run.denoise_on import products_of
from ..run.tune import noise

MATRIX = 4096
"""Rows and columns of the matrices whose product is the machine's rate: larger ones are hardly faster."""

TRIAD_NUMBERS = 2**25
"""Numbers of each array of the triad: three times 128 MiB, more than caches hold."""

BLOCK_NUMBERS = 2**14
"""Numbers of a block of 64 KiB: the triad's first half stays in a core's cache until the second."""

SINE_BLOCKS = 256
"""Blocks of which NumPy's sine is taken: 4 million numbers."""

PROBE_PX = (128, 256, 512)
"""Widths and heights of the pictures on which small programs run: the first that takes long enough."""

PROBE_S = 4e-3
"""What is long enough for the least of them: far above the time that starts a kernel."""

PROBE_NEURONS = 32
"""Numbers of the small programs' only layer: the paper's."""

PROBE_SINES = 8
"""Sines one after another in the third program."""

SGEMM, TRIAD, SINE = "sgemm", "triad", "sine"
"""Names of the machine's measurements."""

ROUNDS = 3
"""Times that a small program runs; the median counts."""


@dataclass(frozen=True)
class Limits:
    """The machine: operations (two a product), bytes and sines a second."""

    flops_per_s: float
    bytes_per_s: float
    sines_per_s: float

    @property
    def rates(self) -> Rates:
        """Return what a library could do at best: the arithmetic of sgemm, NumPy's sine, no other cost."""
        return Rates(self.flops_per_s / 2, self.sines_per_s, self.bytes_per_s)


def machine_ways(scale: int = 1) -> Mapping[str, Round]:
    """Return the machine's rounds by name; a `scale` of 2 halves each length."""
    side, count = MATRIX // scale, TRIAD_NUMBERS // scale
    left, product = np.full((side, side), 0.5, np.float32), np.empty((side, side), np.float32)
    b, c, a = (np.full(count, value, np.float32) for value in (1.0, 2.0, 0.0))
    # Arguments between -3 and 3, as those of hidden layers are.
    angles = np.linspace(-3.0, 3.0, BLOCK_NUMBERS, dtype=np.float32)

    def sgemm(_number: int = 0) -> None:
        np.matmul(left, left, out=product)

    def triad(block: slice) -> None:
        np.multiply(c[block], np.float32(3.0), out=a[block])
        np.add(a[block], b[block], out=a[block])

    def sine(block: slice) -> None:
        np.sin(angles, out=a[block])

    starts = range(0, count, BLOCK_NUMBERS)
    blocks = [slice(start, start + BLOCK_NUMBERS) for start in starts]
    return {
        SGEMM: sgemm,
        TRIAD: partial(_in_threads, triad, blocks),
        SINE: partial(_in_threads, sine, blocks[:SINE_BLOCKS]),
    }


def limits_of(times: Mapping[str, Times], scale: int = 1) -> Limits:
    """Return the machine's rates from the times of [`machine_ways`]."""
    side, count = MATRIX // scale, TRIAD_NUMBERS // scale
    sines = min(SINE_BLOCKS * BLOCK_NUMBERS, count)
    return Limits(
        2.0 * side**3 / times[SGEMM].median,
        3.0 * FLOAT_BYTES * count / times[TRIAD].median,
        sines / times[SINE].median,
    )


def _in_threads(work: Callable[[slice], None], blocks: list[slice], _number: int = 0) -> None:
    """Do all blocks, a part of them in each thread; NumPy lets other threads run meanwhile."""
    count = cores()
    share = math.ceil(len(blocks) / count)

    def part(first: int) -> None:
        for block in blocks[first : first + share]:
            work(block)

    with ThreadPoolExecutor(count) as pool:
        list(pool.map(part, range(0, len(blocks), share)))


# ---- executors --------------------------------------------------------------------------------------------


def probes() -> Mapping[str, Program]:
    """Return the three small programs by name."""
    return {"small": _probe(2, 0), "window": _probe(6, 0), "sines": _probe(2, PROBE_SINES)}


def probe_times(
    device: Executor, language: Language, schedule: str, pause_s: float
) -> tuple[dict[str, Times], int]:
    """Return the times of the small programs by name, and the size of the picture on which they ran."""
    programs = probes()
    made = {name: compile_program(p, language, schedule) for name, p in programs.items()}
    for size in PROBE_PX:
        images = noise(programs["small"], (size, size))
        for artifact in made.values():
            device.build(artifact, (size, size))
        # Without copies, where the executor can tell.
        alone = getattr(device, "kernel_seconds", device.run)
        ways = {name: partial(alone, artifact, images) for name, artifact in made.items()}
        small = in_turns({"small": ways["small"]}, 2, warm=0, pause_s=0.0)["small"]
        if min(small.seconds) >= PROBE_S:
            break
    return in_turns(ways, ROUNDS, warm=1, pause_s=pause_s), size


def rates_of(times: Mapping[str, Times], pixels: int, bytes_per_s: float) -> Rates:
    """Return the rates behind the times of [`probes`]; products whose time drowns in noise have rate NaN."""
    programs, per_pixel = probes(), {name: found.median / pixels for name, found in times.items()}
    more = products_of(programs["window"]) - products_of(programs["small"])
    waited = per_pixel["window"] - per_pixel["small"]
    products = more / waited if waited > 0.0 else math.nan
    # Sines whose time drowns in noise cost nothing that could be seen.
    waited = max(0.0, per_pixel["sines"] - per_pixel["small"])
    sines = sines_of(programs["sines"]) / waited if waited > 0.0 else math.inf
    rest = per_pixel["small"] - products_of(programs["small"]) / products
    return Rates(products, sines, bytes_per_s, max(0.0, rest))


def _probe(window: int, sines: int) -> Program:
    """Trace a layer of a window, a chain of sines, and three sums."""
    gather = Gather(Window(window), (Image("a", 3, 0.0, 1.0), Image("b", 3, 0.0, 1.0)))
    first = _weights(1, (PROBE_NEURONS, gather.n_inputs)) / np.float32(gather.n_inputs)
    last = _weights(2, (3, PROBE_NEURONS)) / np.float32(PROBE_NEURONS)

    def pixel(x: Any) -> Any:
        x = np.matmul(x, first.T)
        for _ in range(sines):
            x = np.sin(x)
        return np.matmul(x, last.T)

    return trace(pixel, {"window": Type(shape=(gather.n_inputs,))}, gather)


def _weights(stream: int, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return numbers (D_out, D_in) in [0, 1)."""
    pixels = rng.counter(np.arange(math.prod(shape)))
    found: NDArray[np.float32] = rng.uniforms(rng.counter(stream), pixels, rng.counter(0), rng.counter(0))[0]
    return found.reshape(shape)


# ---- the cost model ---------------------------------------------------------------------------------------


FLOAT_BYTES = 4
"""Bytes of a float32."""


@dataclass(frozen=True)
class Stage:
    """What one pass over a picture does for a pixel: products with their sums, sines, bytes of memory."""

    products: float
    sines: float
    bytes: float


@dataclass(frozen=True)
class Rates:
    """What a device does in a second, and the seconds that a pixel takes in addition."""

    products_per_s: float
    sines_per_s: float
    bytes_per_s: float
    pixel_s: float = 0.0


def predicted_seconds(stages: Sequence[Stage], rates: Rates, pixels: int) -> float | None:
    """Return the time of a picture; None without stages, or where a rate is not positive."""
    known = (rates.products_per_s, rates.sines_per_s, rates.bytes_per_s)
    if not stages or not all(rate > 0.0 for rate in known):
        return None
    return pixels * sum(
        max(
            rates.pixel_s + stage.products / rates.products_per_s + stage.sines / rates.sines_per_s,
            stage.bytes / rates.bytes_per_s,
        )
        for stage in stages
    )


def sines_of(program: Program) -> int:
    """Return the sines of a pixel, in a program whose sines are single nodes."""
    return sum(math.prod(node.type.shape) for node in program.nodes if node.op == "sin")


def fused(artifact: Artifact, sines: int) -> tuple[Stage, ...]:
    """Return the stages of compiled kernels: each reads its images and writes one; the last has the sines."""
    channels = [kernel_gather(k.programs).channels + output_channels(k.programs) for k in artifact.kernels]
    return tuple(
        Stage(products_of(kernel.programs), sines if kernel is artifact else 0, FLOAT_BYTES * count)
        for kernel, count in zip(artifact.kernels, channels, strict=True)
    )
