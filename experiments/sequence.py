"""Many frames by `wamnet denoise`, and by the same loop around Open Image Denoise's library.

    python experiments/publish.py --run sequence python experiments/sequence.py

1. Frames of minicubes, 16 camera rays per pixel for the features, are rendered with the five layers that the
   bundled model reads; a sequence repeats a few of them under other names [`frames`].
2. Each program denoises the sequence in a process of its own, files and start-up included, interleaved
   [`sequence_rows`]. The loop reads ahead and writes behind as the command does, with the same code.
3. One frame of 256 x 256 by a second command, when everything is kept [`single_rows`].

Prints Markdown tables: seconds are medians of rounds, with the least and the most.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from lab.command import described

from wamnet.cli.common.sequence import frames_of, outputs_of, overlapped
from wamnet.cli.files import exr
from wamnet.refimpl.frame import Frame
from wamnet_peers.peer_oidn import Kept

MODEL = "minicubes"
LAYERS = ("color", "normal", "albedo", "position", "direct")
"""The layers that the model reads, and so those of the files."""

RENDERED = 8
"""Frames that are rendered; the sequence repeats them."""


def frames(folder: Path, size: int, count: int) -> Path:
    """Write `count` frames of `size` pixels squared, and return their pattern."""
    for number in range(count):
        path = folder / f"shot.{number:04d}.exr"
        if number >= RENDERED:
            os.link(folder / f"shot.{number % RENDERED:04d}.exr", path)
            continue
        rendered = folder / "rendered.exr"
        rays = ["--feature-spp", 16, "--shadow-rays", 1]
        what = [MODEL, "--width", size, "--height", size, "--seed", number, *rays]
        _run(["render", *what, "--time", number / RENDERED, "--executor", "c", "-o", rendered])
        frame = exr.read_frame(rendered)
        exr.write_frame(path, Frame({name: frame[name] for name in LAYERS}, frame.info))
        rendered.unlink()
    return folder / "shot.%04d.exr"


def _run(arguments: Sequence[object], program: Sequence[str] = ("-m", "wamnet.cli")) -> tuple[float, int]:
    """Run `wamnet`, or another program of Python; return its seconds and its largest memory in bytes."""
    start = time.perf_counter()
    command = [sys.executable, *program, *map(str, arguments)]
    child = os.posix_spawn(command[0], command, os.environ, file_actions=_silent())
    _, status, used = os.wait4(child, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} ended with status {os.waitstatus_to_exitcode(status)}")
    return time.perf_counter() - start, 1024 * used.ru_maxrss


def _silent() -> list[tuple[int, int, str, int, int]]:
    """Return what leaves standard output out."""
    return [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]


def loop(quality: str, pattern: Path, output: Path) -> None:
    """Denoise a sequence by Open Image Denoise, as `wamnet denoise` does by a network."""
    paths = frames_of([pattern])
    first = exr.read_frame(paths[0])
    output.mkdir(exist_ok=True)
    library = Kept((first.height, first.width), quality, clean=True)

    def write(task: tuple[Path, Path], color: object) -> None:
        exr.write_frame(task[1], Frame({"color": color}), compress=False)

    tasks = list(zip(paths, outputs_of(paths, output), strict=True))
    read = lambda task: exr.read_frame(task[0], False)  # noqa: E731
    failed = overlapped(tasks, read, lambda frame: library(frame).copy(), write, lambda _: None)
    if failed:
        raise SystemExit(str(failed[0][1]))


def sequence_rows(folder: Path, size: int, count: int, rounds: int) -> list[str]:
    """Return the rows of the sequence: frames per second and memory by each program."""
    pattern = frames(folder, size, count)
    here = Path(__file__)

    def command(executor: str) -> Callable[[Path], tuple[float, int]]:
        return lambda out: _run(["denoise", MODEL, pattern, "--executor", executor, "-o", out])

    def library(quality: str) -> Callable[[Path], tuple[float, int]]:
        return lambda out: _run(["--loop", quality, pattern, out], [str(here)])

    programs = {
        "wamnet denoise, C": command("c"),
        "wamnet denoise, OpenCL": command("opencl"),
        "Open Image Denoise, fast": library("fast"),
    }
    runs: dict[str, list[tuple[float, int]]] = {name: [] for name in programs}
    for _ in range(rounds):
        for name, program in programs.items():
            with tempfile.TemporaryDirectory(dir=folder) as out:
                runs[name].append(program(Path(out) / "denoised"))
    lines = [
        f"| {count} frames, {size} x {size}, {len(LAYERS)} layers "
        "| frames per second | least | most | memory, MB |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, done in runs.items():
        rates = sorted(count / seconds for seconds, _ in done)
        memory = max(used for _, used in done) / 1e6
        lines.append(
            f"| {name} | {statistics.median(rates):.2f} | {rates[0]:.2f} | {rates[-1]:.2f} | {memory:.0f} |"
        )
    return lines


def single_rows(folder: Path, rounds: int) -> list[str]:
    """Return the rows of one frame of 256 x 256: seconds of a second command by each executor."""
    frame = folder / "one.exr"
    _run(["render", MODEL, "--feature-spp", 16, "--executor", "c", "-o", frame])
    names = ("numpy", "c", "opencl")
    seconds: dict[str, list[float]] = {name: [] for name in names}
    for number in range(rounds + 1):
        for name in names:
            taken, _ = _run(["denoise", MODEL, frame, "--executor", name, "-o", folder / "one-out.exr"])
            if number:
                seconds[name].append(taken)
    lines = ["| one frame, 256 x 256, second command | s | least | most |", "| --- | --- | --- | --- |"]
    for name, taken in seconds.items():
        middle, least, most = statistics.median(taken), min(taken), max(taken)
        lines.append(f"| wamnet denoise, {name} | {middle:.2f} | {least:.2f} | {most:.2f} |")
    return lines


def main() -> None:
    """Measure."""
    parser = described(__doc__)
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--loop", nargs=3, metavar=("QUALITY", "PATTERN", "FOLDER"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.loop:
        quality, pattern, folder = options.loop
        loop(quality, Path(pattern), Path(folder))
        return
    with tempfile.TemporaryDirectory() as folder:
        rows = single_rows(Path(folder), 3 * options.rounds)
        rows += ["", *sequence_rows(Path(folder), options.size, options.frames, options.rounds)]
    print("\n".join(rows))


if __name__ == "__main__":
    main()
