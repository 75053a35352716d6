"""How much the denoised animation flickers, beside its noisy input, another denoiser, and a longer render.

1. Successive frames of `minicubes`, 24 a second, each with noise of its own; and as often the same moment,
   where nothing moves [`sequence`]. References share their random numbers from frame to frame.
2. Each frame is denoised by itself: by the paper's network and by the preset `short`, trained for each seed
   (and never on these moments), and by Open Image Denoise. Seeds are those of the noise too [`METHODS`].
3. Flicker is measured [`lab/motion.py`]: variance over time beyond the reference's, variance of the error,
   FLIP between successive frames beyond the reference's; and for the moment that stands still [`measure`].
4. A table, and two figures: a row of pixels over time, and FLIP from frame to frame [`report`].

    python experiments/flicker.py
    python experiments/flicker.py --scale paper -o out/flicker-paper

Without the package `pyoidn` (group `baselines`) the rows of Open Image Denoise are left out, and it says so.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, figures, frames, motion, tables, training
from lab.frames import Shot
from lab.ground import Ground, judged, start, write_table
from lab.results import Results, Values, fill
from lab.tables import Column

from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.network.train import PAPER, SHORT, Recipe
from wamnet_peers import peer_oidn

FRAMES_PER_SECOND = 24
"""Rate of the animation, as in cinemas."""

LENGTH = {"toy": 3, "small": 12, "paper": 48}
"""Frames of the sequence, by scale."""

BEGIN_S = 2.27
"""Time of the first frame, in seconds: no training time."""

RENDER_SPP = 32
"""Samples per pixel of the longer render, next to which the denoised sequences stand."""

FIRST_SEED = 10_000
"""Seed of the first frame; training and test frames have smaller ones."""

MOVING, STILL = "moving", "still"
"""Names of the sequences: the animation, and one in which nothing moves."""


def sequence(ground: Ground, scale: str, kind: str, seed: int, spp: int) -> list[Frame]:
    """Return the frames of a sequence with the noise of `seed`."""
    count = LENGTH[scale]
    times = [BEGIN_S + (0 if kind == STILL else k) / FRAMES_PER_SECOND for k in range(count)]
    shots = [
        Shot("minicubes", time, ground.plan.size, spp, FIRST_SEED + 2 * (1000 * seed + k))
        for k, time in enumerate(times)
    ]
    return frames.frames(ground.cache / "frames", shots, ground.executor)


def references(ground: Ground, scale: str) -> list[Frame]:
    """Return the references of the moving sequence: of one seed, so that their own noise is steady."""
    shot = Shot("minicubes", BEGIN_S, ground.plan.size, ground.plan.test_spp, FIRST_SEED + 1)
    shots = [replace(shot, time=BEGIN_S + k / FRAMES_PER_SECOND) for k in range(LENGTH[scale])]
    return frames.frames(ground.cache / "frames", shots, ground.executor)


def displayed(rendered: Sequence[Frame]) -> Floats:
    """Return the colours (T, H, W, 3) of frames, display-encoded."""
    return np.stack([to_display(frame["color"]) for frame in rendered])


Method = Callable[[Ground, str, str, int], Floats]
"""From ground, scale, kind of sequence and seed to display-encoded pictures (T, H, W, 3)."""


def rendered(spp: int, ground: Ground, scale: str, kind: str, seed: int) -> Floats:
    """Return a sequence that is rendered with so many samples and not denoised."""
    return displayed(sequence(ground, scale, kind, seed, spp))


def by_network(recipe: Recipe, lone: bool, ground: Ground, scale: str, kind: str, seed: int) -> Floats:
    """Return the pictures of a network, trained on all training pairs, or on a lone one as in the paper."""
    plan = ground.plan
    steps, batch = (plan.paper_steps, plan.paper_batch) if lone else (plan.steps, plan.batch)
    pairs = ground.seen()[:1] if lone else ground.seen()
    model, _ = ground.train(replace(recipe, steps=steps, batch=batch, seed=seed), pairs)
    noisy = sequence(ground, scale, kind, seed, frames.NOISY_SPP)
    return np.stack(training.denoised(model, noisy, ground.executor))


def by_oidn(clean: bool, ground: Ground, scale: str, kind: str, seed: int) -> Floats:
    """Return what Open Image Denoise makes of colour, albedo and normal; `clean`: they have no noise."""
    noisy = sequence(ground, scale, kind, seed, frames.NOISY_SPP)
    return np.stack([to_display(peer_oidn.filtered(frame, frame, clean)) for frame in noisy])


METHODS: Mapping[str, Method] = {
    "input, 1 spp": partial(rendered, frames.NOISY_SPP),
    "WAMnet, paper": partial(by_network, PAPER, True),
    "WAMnet, short": partial(by_network, SHORT, False),
    "Open Image Denoise": partial(by_oidn, False),
    "Open Image Denoise, clean": partial(by_oidn, True),
    f"render, {RENDER_SPP} spp": partial(rendered, RENDER_SPP),
}
"""What makes pictures, in the order of the table."""

OIDN = "Open Image Denoise"
"""How the rows begin that need the package `pyoidn`."""

COLUMNS = (
    Column("psnr", "PSNR, dB", 2),
    Column("flip", "FLIP", 3),
    Column("excess_variance", "variance beyond the reference's, 1e-4", 2, 1e4),
    Column("error_variance", "variance of the error, 1e-4", 2, 1e4),
    Column("excess_flip", "FLIP from frame to frame beyond the reference's", 4),
    Column("still_variance", "standing still: variance, 1e-4", 2, 1e4),
    Column("still_flip", "standing still: FLIP from frame to frame", 4),
)
"""The columns of the table."""


def measure(ground: Ground, scale: str, method: Method, seed: int) -> Values:
    """Return the measures of one method with one seed."""
    wanted = references(ground, scale)
    clean = displayed(wanted)
    moving, still = (method(ground, scale, kind, seed) for kind in (MOVING, STILL))
    quality = judged(list(moving), [(frame, frame) for frame in wanted])
    return {
        **{name: quality[name] for name in ("psnr", "ssim", "flip")},
        "excess_variance": motion.excess_variance(moving, clean),
        "error_variance": motion.error_variance(moving, clean),
        "excess_flip": motion.excess_flip(moving, clean),
        "steps": motion.flip_steps(moving).tolist(),
        "still_variance": motion.temporal_variance(still),
        "still_flip": float(np.mean(motion.flip_steps(still))),
    }


def methods() -> dict[str, Method]:
    """Return the methods that this installation can run; say which it cannot."""
    there = importlib.util.find_spec("pyoidn") is not None
    if not there:
        sys.stderr.write(f"{OIDN} is left out: pip install pyoidn\n")
    return {name: method for name, method in METHODS.items() if there or not name.startswith(OIDN)}


def report(ground: Ground, results: Results, scale: str, seed: int, folder: Path) -> None:
    """Write the table and the figures; pictures are those of one seed."""
    found = methods()
    write_table(folder / "table.md", tables.table(results, COLUMNS, dict(zip(found, found, strict=True))))
    clean = displayed(references(ground, scale))
    steps = {name: results.of(name, "steps") for name in found}
    lines: dict[str, Any] = {
        name: [(k + 1, [values[k] for values in of_seeds]) for k in range(len(clean) - 1)]
        for name, of_seeds in steps.items()
    }
    lines["reference"] = [(k + 1, [value]) for k, value in enumerate(motion.flip_steps(clean))]
    labels = ("frame", "FLIP against the frame before")
    figures.curves(folder / "flip.png", lines, labels, (False, True))
    row, repeat = clean.shape[1] // 2, max(1, clean.shape[2] // (3 * len(clean)))

    def line(name: str, moving: Floats, still: Floats) -> figures.Row:
        slices = [motion.slice_over_time(pictures, row, repeat) for pictures in (moving, still)]
        return "", [(f"{name}: a row over time", slices[0]), ("the same, standing still", slices[1])]

    rows = [
        line(name, *(method(ground, scale, kind, seed) for kind in (MOVING, STILL)))
        for name, method in found.items()
    ]
    rows.append(line("reference", clean, np.repeat(clean[:1], len(clean), axis=0)))
    figures.sheet(folder / "rows.png", rows, 3.2)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "flicker"), "flicker", arguments)
    work = {name: partial(measure, ground, options.scale, method) for name, method in methods().items()}
    fill(results, work, options.seeds, "measuring flicker")
    report(ground, results, options.scale, options.seeds[0], options.output)


if __name__ == "__main__":
    command.begin(main)
