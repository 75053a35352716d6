"""Sines of all executors, measured: `python experiments/sines.py`.

1. A kernel of one pixel that is a sine is compiled like any other, and run [`kernel`]: each executor's own
   sine under profile native, `native_sin` of OpenCL, the emitted ones under profile ieee, degree by degree.
2. Arguments are drawn uniformly, 2^20 in each range, the same for all [`drawn`]; what they are compared with
   is NumPy's float64 sine, within 2^-50 of the exact one there (tests/compiler/test_sine.py).
3. The first table has the largest absolute error on [-pi, pi], on arguments as networks have them, and on the
   emitted sines' domain; the second has own sines and the emitted one octave by octave [`tables`].

`--every`: the emitted sines and cosines of all degrees meet all float32 numbers of their domains, of both
signs, 2.4 and 2.3 billion, on one executor; `--share` takes a part of them, `--least` those of at least a
magnitude. Each line has the largest error, where it is, and the proven bound; the command fails where a bound
is broken [`every`].

`--speed`: milliseconds of a denoiser's frame by degree, and with OpenCL's own sine [`speed`].
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.compiler.artifact import Artifact
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import sine
from wamnet.compiler.core.enclosure import round_up
from wamnet.compiler.core.ir import Gather, Image, Type, sha256
from wamnet.compiler.core.profiles import DEGREE_WORD
from wamnet.compiler.core.trace import trace
from wamnet.kernels import open_executor
from wamnet.kernels.measure import in_turns
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Window
from wamnet.refimpl.network.denoise import denoise_pixel

Array = NDArray[Any]

CHANNELS = 4
"""Numbers of a pixel: what a texture holds."""

WIDTH = 1024
"""Pixels in a row of the images that hold the arguments."""

COUNT = 2**20
"""Arguments in each range."""

BATCH = 2**17
"""Positive arguments at a time with `--every`."""

NUMPY = 2.0**-50
"""What NumPy's float64 sine may be off."""

NETWORK = 30.0
"""Largest argument that is usual in a network, in radians: SIREN's omega_0 for inputs of at most 1."""

WINDOW, FEATURES, SIDE = 12, 6, 1024
"""The denoiser whose frames are timed: taps of a window's side, channels, pixels of a frame's side."""

OPEN: Mapping[str, tuple[str, dict[str, str]]] = {
    "numpy": ("numpy", {}),
    "opencl": ("opencl", {}),
    "opengl-egl": ("opengl", {"context": "egl"}),
    "opengl-osmesa": ("opengl", {"context": "osmesa"}),
}
"""How to open each executor."""

OWN = {
    "numpy": ("np.sin", "none"),
    "opencl": ("sin", "4 ulp (OpenCL C 1.2, 7.4)"),
    "opengl-egl": ("sin", "none (GLSL 4.60, 4.7.1)"),
    "opengl-osmesa": ("sin", "none (GLSL 4.60, 4.7.1)"),
}
"""Each executor's own sine: its name, and what is promised of it."""


@dataclass(frozen=True)
class Way:
    """One sine: where it runs, its name, what is promised of it, and its kernel."""

    executor: Any
    place: str
    name: str
    promise: str
    artifact: Artifact

    def __call__(self, x: Array) -> Array:
        """Return the values (N,) at x (N,), N a multiple of a row's numbers."""
        image = x.reshape(-1, WIDTH, CHANNELS)
        found: Array = self.executor.run(self.artifact, {"a": image})
        return found.reshape(-1)


def kernel(target: str, profile: str, cosine: bool = False) -> Artifact:
    """Return a kernel whose output is the sine of its input, or the cosine."""
    largest = sine.COSINE_DOMAIN if cosine else sine.DOMAIN
    gather = Gather(Window(1, "clamp"), (Image("a", CHANNELS, -largest, largest),))
    function = np.cos if cosine else np.sin
    program = trace(lambda window: function(window), {"window": Type(shape=(CHANNELS,))}, gather)  # noqa: PLW0108
    return compile_program(program, target, profile)


def native_sin(artifact: Artifact) -> Artifact:
    """Return the OpenCL kernel with `native_sin` instead of `sin`."""
    source = artifact.source.replace("= sin(", "= native_sin(")
    if source == artifact.source:
        raise ValueError("the kernel calls no sin: nothing was replaced")
    return replace(artifact, source=source, manifest={**artifact.manifest, "digest": sha256(source.encode())})


def ways(places: Mapping[str, Any]) -> Iterator[Way]:
    """Yield all sines of open executors, by name."""
    for place, executor in places.items():
        own = kernel(executor.name, "native")
        yield Way(executor, place, *OWN[place], own)
        if executor.name == "opencl":
            yield Way(executor, place, "native_sin", "none (OpenCL C 1.2, 7.4)", native_sin(own))
        for degree, polynomial in sine.POLYNOMIALS.items():
            profile = f"ieee{DEGREE_WORD}{degree}"
            yield Way(
                executor,
                place,
                f"emitted, degree {degree}",
                f"{polynomial.error:g}",
                kernel(executor.name, profile),
            )


def drawn(low: float, high: float, seed: int) -> Array:
    """Return float32 arguments (COUNT,) of both signs, their magnitudes uniform in [low, high]."""
    random = np.random.default_rng(seed)
    x = random.uniform(low, high, COUNT) * random.choice([-1.0, 1.0], COUNT)
    return np.clip(x.astype(np.float32), -np.float32(high), np.float32(high))


def error_of(way: Way, x: Array) -> tuple[float, float]:
    """Return the largest absolute error, and the largest in units in the last place of the exact sine."""
    exact = np.sin(x.astype(np.float64))
    off = np.abs(way(x) - exact)
    ulp = off / np.spacing(np.maximum(np.abs(exact), 2.0**-126).astype(np.float32))
    return float(off.max()), float(ulp.max())


def octaves() -> Iterator[tuple[float, float]]:
    """Yield the octaves of the domain, the first from 0 on."""
    low, high = 0.0, 1.0
    while low < sine.DOMAIN:
        yield low, min(high, sine.DOMAIN)
        low, high = high, 2 * high


def tables(places: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of both tables."""
    ranges = {
        "[-pi, pi]": np.pi,
        f"[-{NETWORK:g}, {NETWORK:g}]": NETWORK,
        f"[-{sine.DOMAIN:g}, {sine.DOMAIN:g}]": sine.DOMAIN,
    }
    found = list(ways(places))
    for place, executor in places.items():
        yield f"* {place}: {executor.device}"
    yield ""
    yield f"| executor | sine | promise | {' | '.join(ranges)} | ulp on [-pi, pi] |"
    yield f"|---|---|---|{'---|' * len(ranges)}---|"
    for way in found:
        errors = [error_of(way, drawn(0.0, largest, 1)) for largest in ranges.values()]
        cells = " | ".join(f"{absolute:.2e}" for absolute, _ in errors)
        yield f"| {way.place} | {way.name} | {way.promise} | {cells} | {errors[0][1]:.3g} |"
    few = [way for way in found if not way.name.startswith("emitted") or way.name.endswith(f" {sine.DEGREE}")]
    few = [way for way in few if not way.name.startswith("emitted") or way.place == "opencl"]
    yield ""
    yield f"| magnitude | {' | '.join(f'{way.place} {way.name}' for way in few)} |"
    yield f"|---|{'---|' * len(few)}"
    for low, high in octaves():
        x = drawn(low, high, 2)
        cells = " | ".join(f"{error_of(way, x)[0]:.1e}" for way in few)
        yield f"| {low:g} to {high:g} | {cells} |"


def batches(least: float, largest: float, share: float) -> Iterator[Array]:
    """Yield all float32 numbers of [least, largest], or an even share of them, as (BATCH,) arrays."""
    first, end = (int(np.float32(x).view(np.uint32)) for x in (least, largest))
    end += 1
    starts = range(first, end, BATCH)
    for i, start in enumerate(starts):
        if int((i + 1) * share) > int(i * share) or start == starts[-1]:
            bits = np.minimum(np.arange(start, start + BATCH, dtype=np.int64), end - 1)
            yield bits.astype(np.uint32).view(np.float32)


def every(executor: Any, cosine: bool, share: float, least: float = 0.0) -> bool:
    """Print the largest error of each degree over all float32 numbers of the domain; tell if all hold."""
    kernels = {
        degree: kernel(executor.name, f"ieee{DEGREE_WORD}{degree}", cosine) for degree in sine.POLYNOMIALS
    }
    run = {degree: Way(executor, "", "", "", artifact) for degree, artifact in kernels.items()}
    largest, at, count = dict.fromkeys(run, 0.0), dict.fromkeys(run, 0.0), 0
    begin = time.perf_counter()
    for x in batches(least, sine.COSINE_DOMAIN if cosine else sine.DOMAIN, share):
        half = np.cos(x.astype(np.float64)) if cosine else np.sin(x.astype(np.float64))
        both = np.concatenate([x, -x])
        exact = np.concatenate([half, half if cosine else -half])
        count += both.size
        for degree, way in run.items():
            off = np.abs(way(both) - exact)
            worst = int(np.argmax(off))  # NaN counts as the largest
            if not off[worst] <= largest[degree]:
                largest[degree], at[degree] = float(off[worst]), float(both[worst])
    name = "cosine" if cosine else "sine"
    print(f"{name}: {count} numbers on {executor.device}, {time.perf_counter() - begin:.0f} s", flush=True)
    print(f"\n| degree | {name} | at | proven |\n|---|---|---|---|")
    holds = True
    for degree, polynomial in sine.POLYNOMIALS.items():
        bound = polynomial.cosine_error if cosine else polynomial.error
        holds &= largest[degree] + NUMPY <= bound
        text = f"| {degree} | {round_up(largest[degree]):.3g} | {at[degree]!r} | {bound:g} |"
        print(text, "" if largest[degree] + NUMPY <= bound else "BROKEN", flush=True)
    return holds


def timed(executor: Any, artifact: Artifact, image: Array) -> None:
    """Run and forget."""
    executor.run(artifact, {"a": image})


def speed(rounds: int) -> Iterator[str]:
    """Yield a line a sine: a frame's time in OpenCL's schedule for this machine, all sines interleaved."""
    widths = (WINDOW**2 * FEATURES, 32, 32, 32, 32, 3)
    network = siren.init(widths, 3.0, 3.0, seed=1, dtype=np.float32)
    gather = Gather(Window(WINDOW, "clamp"), (Image("a", FEATURES, -1.0, 1.0),))
    inputs = {"window": Type(shape=(gather.n_inputs,))}
    program = trace(lambda window: denoise_pixel(network, window), inputs, gather)
    image = np.random.default_rng(1).uniform(-1, 1, (SIDE, SIDE, FEATURES)).astype(np.float32)
    profiles = {f"degree {degree}": f"ieee{DEGREE_WORD}{degree}" for degree in sine.POLYNOMIALS}
    with open_executor("opencl") as executor:

        def way(profile: str) -> Callable[[], None]:
            artifact = compile_program(program, "opencl", profile, executor.schedule)
            return lambda: timed(executor, artifact, image)

        ways = {name: way(profile) for name, profile in {**profiles, "OpenCL's sin": "native"}.items()}
        found = in_turns(ways, rounds)
        plain = found[f"degree {sine.DEGREE}"]
        yield f"{SIDE} x {SIDE}, {'-'.join(map(str, widths))}, {executor.schedule}, {executor.device}"
    yield "| sine | ms | of degree 11, median of rounds |"
    yield "|---|---|---|"
    for name, times in found.items():
        ratio = np.median(np.divide(times.seconds, plain.seconds))
        yield f"| {name} | {1e3 * times.median:.0f} | {ratio:.3f} |"


def main() -> int:
    """Print the tables, or the largest errors over every number."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--every", action="store_true", help="every float32 of the domain, on one executor")
    parser.add_argument("--executor", choices=list(OPEN), default="opencl", help="which one, with --every")
    parser.add_argument("--least", type=float, default=0.0, help="least magnitude, with --every")
    parser.add_argument("--speed", type=int, metavar="ROUNDS", help="times by degree, in so many rounds")
    parser.add_argument("--share", type=float, default=1.0, help="share of the numbers, with --every")
    given = parser.parse_args()
    if given.every:
        name, options = OPEN[given.executor]
        with open_executor(name, **options) as executor:
            holds = [every(executor, cosine, given.share, given.least) for cosine in (False, True)]
        return 0 if all(holds) else 1
    if given.speed:
        print("\n".join(speed(given.speed)))
        return 0
    with ExitStack() as opened:
        places = {
            place: opened.enter_context(open_executor(name, **options))
            for place, (name, options) in OPEN.items()
        }
        for line in tables(places):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
