"""The paper's claims, each as a line: its number, ours, whether it holds here, and why the two differ.

    python experiments/claims.py
    python experiments/claims.py --table out/table1

1. Qualities are those of Table 1 [`experiments/table1.py`]: its records are read, and rows without one are
   made first [`needed`].
2. Two times are measured here: a step of the paper's training, and a frame of 1024x1024 [`timed`].
3. A claim takes the numbers that it needs and says what they are here [`CLAIMS`]. The folder gets
   `claims.json` and `claims.md`.

Percentages are those of means over seeds and test frames.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import table1
from baselines.rows import TEST_SEED
from lab import command, frames, tables
from lab.frames import Shot
from lab.results import Results
from lab.training import TIMED_STEPS, seconds_a_step

from wamnet.cli.outputs import write_text
from wamnet.kernels import denoise_on, open_executor
from wamnet.kernels.bench.workload import noise, paper_model
from wamnet.kernels.executor import Executor
from wamnet.kernels.measure import in_turns
from wamnet.refimpl.train import PAPER

ROWS = ("input", "dncnn", "wamnet-color", "wamnet", "wamnet-own", "wamnet-best", "pix2pix")
"""The rows of Table 1 that the claims speak of."""

FRAME_PX = 1024
"""The paper's size of a frame."""

SMALL = {"toy": (64, 2, 1), "small": (FRAME_PX, TIMED_STEPS, 5), "paper": (FRAME_PX, TIMED_STEPS, 5)}
"""Size of the frame, steps and rounds of the times, by scale."""


def needed(options: argparse.Namespace) -> tuple[Results, list[str]]:
    """Return Table 1's records and the rows of the claims, after making those without a record."""
    scale = table1.SCALES[options.scale]
    settings = table1.settings_of(scale, options.executor)
    found = Results.open(options.table / "table1.json", "table1", settings)
    wanted = table1.available(ROWS)
    left = [row for row in wanted if any(found.get(row, seed) is None for seed in options.seeds)]
    if left:
        shared = {"output": options.table, "only": left, "no_times": True, "rounds": 0, "plan": False}
        table1.run(argparse.Namespace(**{**vars(options), **shared}))
    return found, wanted


def timed(device: Executor, options: argparse.Namespace, kept: Results) -> Mapping[str, float]:
    """Return ms a step of the paper's training on one pair, and ms a frame of the paper's network."""
    if (found := kept.get("times", 0)) is None:
        size, steps, rounds = SMALL[options.scale]
        scale = table1.SCALES[options.scale]
        (pair,) = frames.pairs(
            options.cache / "frames",
            [Shot(size=scale.size, seed=TEST_SEED)],
            scale.train_spp,
            options.executor,
        )
        model, frame = paper_model(), noise(size)
        ways = {
            "step": lambda: seconds_a_step(PAPER, [pair], device, steps),
            "frame": lambda: denoise_on(device, model, frame).seconds_run,
        }
        times = in_turns(ways, rounds)
        found = {f"{name}_ms": 1e3 * times[name].median for name in ways}
        kept.put("times", 0, {**found, "device": device.device, "frame_px": size})
    return found


@dataclass(frozen=True)
class Numbers:
    """What a claim may ask for: means of Table 1 by row and name, and the times."""

    kept: Results
    rows: Sequence[str]
    times: Mapping[str, float]

    def __call__(self, row: str, name: str) -> float:
        """Return a mean of Table 1; NaN without a record, which makes any comparison fail."""
        found = self.kept.summary(row, name)
        return float("nan") if found is None else found.mean

    def change(self, before: str, after: str, name: str) -> float:
        """Return by how many per cent a number grows from one row to another."""
        return 100.0 * (self(after, name) / self(before, name) - 1.0)


@dataclass(frozen=True)
class Claim:
    """A claim in words, the paper's number, what it is here, whether it holds, and why the two differ."""

    text: str
    paper: str
    here: Callable[[Numbers], str]
    holds: Callable[[Numbers], bool]
    why: str
    rows: tuple[str, ...] = ("input", "wamnet")


def _noise(n: Numbers) -> str:
    """Say how MSE falls, in both arithmetics."""
    parts = []
    for name, text in (("wrapped", "modulo 256"), ("mse255", "as it is")):
        change = n.change("input", "wamnet", name)
        parts.append(f"{text}: {n('input', name):.1f} to {n('wamnet', name):.1f}, {change:+.0f} %")
    return "; ".join(parts)


def _structure(n: Numbers) -> str:
    """Say how SSIM rises."""
    change = n.change("input", "wamnet", "ssim")
    return f"{n('input', 'ssim'):.2f} to {n('wamnet', 'ssim'):.2f}, {change:+.0f} %"


def _both(one: str, other: str, n: Numbers) -> str:
    """Say SSIM and PSNR of two rows."""
    ssim, psnr = ([n(row, name) for row in (one, other)] for name in ("ssim", "psnr"))
    return f"SSIM {ssim[0]:.3f} to {ssim[1]:.3f}, PSNR {psnr[0]:.2f} to {psnr[1]:.2f} dB"


def _better(one: str, other: str, n: Numbers) -> bool:
    """Tell whether the other row is better by SSIM and by PSNR."""
    return n(other, "ssim") > n(one, "ssim") and n(other, "psnr") > n(one, "psnr")


def _worth(n: Numbers) -> str:
    """Say the samples that the presets are worth, and how much better the paper's is where it was trained."""
    own = n("wamnet-own", "psnr") - n("wamnet", "psnr")
    return (
        f"preset paper: {n('wamnet', 'worth'):.0f} spp, {own:+.1f} dB on the frame that it was trained on; "
        f"preset best: {n('wamnet-best', 'worth'):.0f} spp"
    )


def _training(n: Numbers) -> str:
    """Say how long the paper's protocol takes here."""
    return f"{n.times['step_ms']:.1f} ms a step, {PAPER.steps:,} steps: {_training_s(n):.0f} s"


def _training_s(n: Numbers) -> float:
    """Return the seconds of the paper's protocol."""
    return PAPER.steps * n.times["step_ms"] / 1e3


LENGTH = "Its training here is as long as its scale allows; the paper does not say how long its own was."
"""Why a baseline may be worse here."""

CLAIMS = (
    Claim(
        "noise falls by 40 %",
        "MSE 82.93 to 48.04, -42 %",
        _noise,
        lambda n: n.change("input", "wamnet", "wrapped") <= -40.0,
        "An MSE of 82.93 is 28.9 dB, which no picture of 1 spp has. Squares of 8-bit numbers that wrap "
        "around give values like the paper's, and hide most of what is gained.",
    ),
    Claim(
        "structure improves by 200 %",
        "SSIM 0.21 to 0.68, +224 %",
        _structure,
        lambda n: n.change("input", "wamnet", "ssim") >= 200.0,
        "Another scene: the input's SSIM is lower.",
    ),
    Claim(
        "normals help",
        "seen in pictures",
        partial(_both, "wamnet-color", "wamnet"),
        partial(_better, "wamnet-color", "wamnet"),
        "",
        rows=("wamnet-color", "wamnet"),
    ),
    Claim(
        "training takes 90 s",
        "90 s on a GPU",
        _training,
        lambda n: _training_s(n) <= 90.0,
        "Processor cores in place of a GPU; the step is compiled.",
        rows=(),
    ),
    Claim(
        "11 frames a second",
        "11 at 1024x1024 on a GPU",
        lambda n: f"{1e3 / n.times['frame_ms']:.1f} ({n.times['frame_ms']:.0f} ms), nothing left out",
        lambda n: n.times["frame_ms"] <= 1e3 / 11.0,
        "Processor cores in place of a GPU. Variants that cost a tenth of a decibel are faster "
        "(spec/variants.md).",
        rows=(),
    ),
    Claim(
        "worth a render of 30 spp",
        "30",
        _worth,
        lambda n: n("wamnet", "worth") >= 30.0,
        "Here it is the render of the same squared error, at times that were not trained on; the paper does "
        "not say how it compares.",
        rows=("wamnet", "wamnet-own", "wamnet-best"),
    ),
    Claim(
        "DnCNN is worse than WAMnet",
        "SSIM 0.44 to 0.68",
        partial(_both, "dncnn", "wamnet"),
        partial(_better, "dncnn", "wamnet"),
        "DnCNN sees colour alone. " + LENGTH,
        rows=("dncnn", "wamnet"),
    ),
    Claim(
        "pix2pix is 2 % better than WAMnet",
        "SSIM 0.68 to 0.70, +3 %",
        partial(_both, "wamnet", "pix2pix"),
        partial(_better, "wamnet", "pix2pix"),
        LENGTH,
        rows=("wamnet", "pix2pix"),
    ),
    Claim(
        "pix2pix leaves blocks, WAMnet does not",
        "seen in pictures",
        lambda n: f"errors jump {n('pix2pix', 'blocks'):.2f} times as far there, {n('wamnet', 'blocks'):.2f}",
        lambda n: n("pix2pix", "blocks") > max(1.0, n("wamnet", "blocks")),
        "",
        rows=("wamnet", "pix2pix"),
    ),
)
"""All claims, in the order of the paper."""


def written(numbers: Numbers) -> str:
    """Return the table of the claims whose rows are there."""
    lines = []
    for claim in CLAIMS:
        if set(claim.rows) <= set(numbers.rows):
            verdict = "holds" if claim.holds(numbers) else "does not hold"
            lines.append([claim.text, claim.paper, claim.here(numbers), verdict, claim.why])
    return tables.markdown(["claim", "paper", "here", "", "why they differ"], lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make what is missing, and print the claims."""
    parser = command.parser(__doc__ or "", "claims")
    parser.add_argument("--table", type=Path, default=Path("out/table1"), help="folder of Table 1's records")
    options = parser.parse_args(arguments)
    found, rows = needed(options)
    kept = Results.open(options.output / "claims.json", "claims", {"scale": options.scale})
    with open_executor(options.executor) as device:
        times = timed(device, options, kept)
    text = written(Numbers(found, rows, times))
    write_text(options.output / "claims.md", text)
    print(text, end="")


if __name__ == "__main__":
    command.begin(main)
