"""Which recipe to train with: the paper's protocol and candidates for the short preset, on unseen frames.

1. Render noisy frames and references of `minicubes` over one turn, and at two times that no recipe is trained
   on, which continue their golden sequence [`frames`]. They are kept in a folder for the next run.
2. Train each recipe, the paper's on one pair, all others on all pairs, and compare pictures [`score`].
3. Print a Markdown table [`main`]: seconds, and PSNR and SSIM of display-encoded colour.

    python experiments/presets.py --frames out/presets --only paper short omega_0=3,batch=1024
    python experiments/presets.py --only paper short --executor opencl

Candidates without a name are the preset `short` with the changes that they list. Times are wall-clock times.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import lab.frames
from lab.frames import Pair, Shot
from numpy.typing import NDArray

from wamnet.kernels import open_executor, train_on
from wamnet.refimpl import metrics
from wamnet.refimpl.light.scenes import TURN_SECONDS
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import denoise
from wamnet.refimpl.network.train import PAPER, SHORT, Recipe, model_of, train

UNSEEN = 2
"""Number of test frames."""

CANDIDATES: dict[str, Recipe] = {
    "paper": PAPER,
    "paper, omega_0 3": replace(PAPER, omega_0_first=3.0, omega_0_hidden=3.0),
    "paper, omega_0 30": replace(PAPER, omega_0_first=30.0, omega_0_hidden=30.0),
    "short": SHORT,
}
"""Recipes that have a name; those called `paper...` are trained on one pair."""

FEATURE_SETS = {
    "c": ("color",),
    "cn": ("color", "normal"),
    "cna": ("color", "normal", "albedo"),
    "cnp": ("color", "normal", "position"),
    "cnad": ("color", "normal", "albedo", "depth"),
    "cnap": ("color", "normal", "albedo", "position"),
}
"""Feature sets by the initials of their members."""

Picture = tuple[NDArray[Any], NDArray[Any]]


def candidate(name: str) -> Recipe:
    """Return a recipe of the table above, or `short` with changes written as key=value,key=value."""
    recipe = CANDIDATES.get(name, SHORT)
    for change in [] if name in CANDIDATES else name.split(","):
        key, value = change.split("=")
        if key == "omega_0":
            recipe = replace(recipe, omega_0_first=float(value), omega_0_hidden=float(value))
        elif key == "features":
            recipe = replace(recipe, features=FEATURE_SETS[value])
        else:
            changes: dict[str, Any] = {key: type(getattr(recipe, key))(value)}
            recipe = replace(recipe, **changes)
    return recipe


def frames(folder: Path, size: int, times: Sequence[float], reference_spp: int) -> list[Pair]:
    """Return (1 spp, reference) pairs at the times, from the folder where they are there already."""
    shots = []
    for moment in times:
        seed = round(moment * 1000)
        shots.append(Shot("minicubes", moment, size, 1, seed))
        shots.append(Shot("minicubes", moment, size, reference_spp, seed + 1))
    found = lab.frames.frames(folder, shots, "numpy")
    return list(zip(found[::2], found[1::2], strict=True))


def score(
    recipe: Recipe, trained: Sequence[Pair], tested: Sequence[Pair], executor: str = "numpy"
) -> tuple[float, list[Picture]]:
    """Train on some pairs; return the seconds, and the pictures of the tested ones with their targets."""
    started = time.perf_counter()
    if executor == "numpy":
        state = train(recipe, trained)
    else:
        with open_executor(executor) as device:
            state = train_on(device, recipe, trained)
    model = model_of(state)
    seconds = time.perf_counter() - started
    scales = model.normalization
    return seconds, [(denoise(model, noisy), dataset.target_image(clean, scales)) for noisy, clean in tested]


def main() -> None:
    """Render, train, and print one line of the table for each recipe."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--frames", type=Path, default=Path("out/presets"), help="folder that keeps the frames"
    )
    parser.add_argument("--size", type=int, default=128, help="width and height in pixels")
    parser.add_argument("--training-frames", type=int, default=32, help="pairs, evenly over a turn")
    parser.add_argument("--reference-spp", type=int, default=64, help="samples of the training references")
    parser.add_argument("--unseen-spp", type=int, default=512, help="samples of the test references")
    parser.add_argument("--only", nargs="+", default=["paper", "short"], help="names, or key=value,...")
    parser.add_argument("--executor", default="numpy", choices=["numpy", "opencl"], help="what trains")
    options = parser.parse_args()
    times, tests = lab.frames.split_times(options.training_frames, UNSEEN, TURN_SECONDS)
    trained = frames(options.frames, options.size, times, options.reference_spp)
    unseen = frames(options.frames, options.size, tests, options.unseen_spp)
    tested = [trained[0], *unseen]
    print("| recipe | s | PSNR dB: a training frame, unseen frames | SSIM |\n|---|---|---|---|", flush=True)
    row("input, 1 spp", 0.0, [_targets(pair) for pair in tested])
    for name in options.only:
        seen = trained[:1] if name.startswith("paper") else trained
        row(name, *score(candidate(name), seen, tested, options.executor))


def _targets(pair: Pair) -> Picture:
    """Return both frames of a pair as pictures."""
    noisy, clean = (dataset.target_image(frame, dataset.Normalization()) for frame in pair)
    return noisy, clean


def row(name: str, seconds: float, pictures: Sequence[Picture]) -> None:
    """Print one line of the table."""
    psnr = " / ".join(f"{metrics.psnr(image, target):.2f}" for image, target in pictures)
    ssim = " / ".join(f"{metrics.ssim(image, target):.3f}" for image, target in pictures)
    print(f"| {name} | {seconds:.0f} | {psnr} | {ssim} |", flush=True)


if __name__ == "__main__":
    main()
