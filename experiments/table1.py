"""Table 1 of the paper, with what its readers would ask for today: every denoiser on the same frames.

    python experiments/table1.py
    python experiments/table1.py --only input wamnet-short oidn-noisy --seeds 0

1. Frames of `minicubes` over one turn are rendered and kept: training frames, and test frames at times
   between them that nothing was trained on [`baselines/rows.py`].
2. Each row is trained, tuned or opened for each seed, which is that of the noise too, and judged on the test
   frames [`judged`]. A row without its packages is left out, and said so.
3. Times of a frame and of a step of training are taken in turns, when everything else is done [`timed`].
   "training" is the steps times that.
4. The folder gets `table1.json`, `times.json`, `table1.md`, the pictures of the first test frame, and
   `crops.png`: a crop around a corner of pix2pix's patches [`drawn`].

Every step is kept, so an interrupted run goes on. Numbers are means over seeds, with the standard deviation
of one. "worth" is the number of samples per pixel whose render has the same error. "blocks" is how much the
error jumps at borders of patches, against elsewhere [`baselines/blocks.py`]. "MSE modulo 256" is that of
arithmetic of 8 bits, which the paper's own figures look like [`lab/scores.py`].
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from baselines.blocks import blockiness
from baselines.rows import ROWS, Bench, Case, Ready, Scale
from lab import command, figures, results, scores, tables
from lab.results import Results, Summary, Values

from wamnet.cli import exr
from wamnet.cli.images import write_png
from wamnet.cli.outputs import write_text
from wamnet.kernels import open_executor
from wamnet.kernels.measure import in_turns
from wamnet.refimpl.encoding import to_display

SCALES: Mapping[str, Scale] = {
    "toy": Scale(
        size=128,
        train=3,
        test=1,
        train_spp=2,
        test_spp=16,
        ladder=(1, 4),
        short_frames=2,
        paper={"steps": 2, "batch": 64, "n_windows": 128},
        short={"steps": 2, "batch": 32},
        dncnn={"steps": 1, "batch": 1, "crop": 16, "width": 4},
        shrunk={"steps": 1, "batch": 1, "crop": 8, "width": 4, "shrink": 4},
        pix2pix={"steps": 1, "batch": 1, "crop": 64, "width": 4},
    ),
    "small": Scale(
        size=256,
        train=24,
        test=4,
        train_spp=256,
        test_spp=1024,
        ladder=(1, 2, 4, 8, 16, 32, 64, 128, 256),
        short_frames=24,
        paper={"steps": 4000},
        dncnn={"steps": 600, "batch": 8, "crop": 40, "half": True},
        shrunk={"steps": 200, "batch": 8, "crop": 40, "half": True, "shrink": 4},
        pix2pix={"steps": 1500, "batch": 1, "crop": 128, "width": 32},
    ),
    "paper": Scale(
        size=1024,
        train=1000,
        test=100,
        train_spp=1024,
        test_spp=1024,
        ladder=(1, 2, 4, 8, 16, 32, 64, 128, 256),
        short_frames=32,
        dncnn={"steps": 50_000, "batch": 128, "crop": 40},
        shrunk={"steps": 6_250, "batch": 8, "crop": 256, "shrink": 4},
        pix2pix={"steps": 200_000, "batch": 1, "crop": 128, "width": 64},
    ),
}
"""Sizes by name; see the chapter beside the experiments for what the small ones leave out."""

CROP_PX = 96
"""Side of the crop that is shown."""

SHOWN = ("input", "dncnn", "wamnet", "wamnet-best", "pix2pix", "oidn-noisy", "render30")
"""Rows of which a crop is shown."""

ROUNDS = 5
"""Rounds of the times."""


def judged(row: str, bench: Bench, ladder: scores.Ladder, pictures: Path, seed: int) -> Values:
    """Return the mean scores of a row over the test frames, and what else is known of it."""
    ready = ROWS[row].make(bench, seed)
    own = ready.facts.get("case")
    found, pairs = [], []
    for case in bench.cases(seed, ready.rays) if own is None else [own]:
        picture, linear = ready.picture(case)
        found.append(scores.score(picture, case.reference["color"], linear))
        pairs.append((picture, to_display(case.reference["color"])))
        if seed == 0 and case.index == 0:
            write_png(pictures / f"{row}.png", picture)
            write_png(pictures / "reference.png", pairs[0][1])
    values: dict[str, Any] = scores.mean_scores(found)
    facts = {name: value for name, value in ready.facts.items() if name != "case"}
    values |= {"blocks": blockiness(pairs, bench.scale.pix2pix["crop"]), **facts}
    if own is None:
        values["worth"] = ladder.spp_of(values["mse"])
    return values


def climbed(bench: Bench, kept: Results) -> scores.Ladder:
    """Return the errors of renders of the test frames, by samples per pixel; they are kept too."""
    name = "ladder"
    if (found := kept.get(name, 0)) is None:
        references = [case.reference["color"] for case in bench.cases(0)]
        renders = {
            spp: [
                (exr.read_frame(path)["color"], reference)
                for path, reference in zip(bench.renders(spp, 0), references, strict=True)
            ]
            for spp in bench.scale.ladder
        }
        ladder = scores.ladder(renders)
        found = {"spp": list(ladder.spp), "mse": list(ladder.mse)}
        kept.put(name, 0, found)
    return scores.Ladder(tuple(found["spp"]), tuple(found["mse"]))


def timed(rows: Sequence[str], bench: Bench, kept: Results, rounds: int) -> None:
    """Take the times of a frame, all rows in turns; a render's is that of its samples."""
    left = [row for row in rows if kept.get(row, 0) is None and row not in ("input", "wamnet-own")]
    if not left:
        return
    made = {row: ROWS[row].make(bench, 0) for row in left}
    cases = {rays: next(iter(bench.cases(0, rays))) for rays in {ready.rays for ready in made.values()}}
    ways = {row: _way(row, ready, bench, cases[ready.rays]) for row, ready in made.items()}
    times = in_turns(ways, rounds)
    steps = in_turns({row: ready.step for row, ready in made.items() if ready.step is not None}, rounds)
    for row, found in times.items():
        values = {"ms": 1e3 * found.median, "spread": found.spread, "device": bench.device.device}
        if row in steps:
            values["step_ms"] = 1e3 * steps[row].median
            values["training_s"] = steps[row].median * made[row].facts["steps"]
        kept.put(row, 0, values)


def _way(row: str, ready: Ready, bench: Bench, case: Case) -> Callable[[], float | None]:
    """Return what makes a row's picture of a case once."""
    if row == "render30":
        return partial(_render, bench)
    if ready.seconds is not None:
        return partial(ready.seconds, case)

    def make() -> None:
        ready.picture(case)

    return make


def _render(bench: Bench) -> None:
    """Render a test frame with 30 samples."""
    from lab.frames import Shot

    from wamnet.kernels.render_frame import render_frame

    shot = Shot(bench.scene, bench.times()[1][0], bench.scale.size, spp=30, seed=0)
    render_frame(bench.executor, shot.build(), shot.job)


def count(found: Summary) -> str:
    """Return a whole number with commas."""
    return f"{found.mean:,.0f}"


COLUMNS = (
    tables.Column("mse255", "MSE", 1),
    tables.Column("psnr", "PSNR, dB", 2),
    tables.Column("paper", "10 ln(255²/MSE)", 2),
    tables.Column("wrapped", "MSE modulo 256", 1),
    tables.Column("ssim", "SSIM", 3),
    tables.Column("flip", "FLIP", 3),
    tables.Column(
        "worth", "worth, spp", write=lambda s: f"{s.mean:.1f}" if s.mean < 100 else f"{s.mean:.0f}"
    ),
    tables.Column("blocks", "blocks", 2),
    tables.Column("parameters", "parameters", write=count),
)
"""The columns of the table that have one number for each seed; MSE is that of 0 .. 255."""

TIMES = (
    tables.Column("ms", "ms a frame", write=lambda s: f"{s.mean:.1f}" if s.mean < 100 else count(s)),
    tables.Column("training_s", "training, s", write=lambda s: f"{s.mean:.1f}" if s.mean < 10 else count(s)),
)
"""The columns of times."""


def written(kept: Results, times: Results) -> str:
    """Return the table."""
    rows = [row for row in ROWS if kept.summary(row, "mse") is not None]
    clocks = TIMES if times.configurations() else ()
    cells = []
    for row in rows:
        shown = [column.cell(kept.summary(row, column.value)) for column in COLUMNS]
        cells.append(
            [ROWS[row].text, *shown, *(column.cell(times.summary(row, column.value)) for column in clocks)]
        )
    return tables.markdown(["", *(column.heading for column in (*COLUMNS, *clocks))], cells)


def drawn(folder: Path, pictures: Path, size: int, patch: int) -> None:
    """Draw crops around the corner of four patches, and their errors (FLIP), of rows that have a picture."""
    from wamnet.cli.images import read_png

    at = (size // patch // 2 or 1) * patch
    low = max(0, min(at - CROP_PX // 2, size - CROP_PX))
    part = slice(low, low + CROP_PX)
    shown = [row for row in SHOWN if (pictures / f"{row}.png").exists()]
    whole = {row: read_png(pictures / f"{row}.png") for row in (*shown, "reference")}
    crops = [(row, image[part, part]) for row, image in whole.items()]
    target = whole["reference"]
    maps = [("FLIP", scores.flip_map(image, target)[part, part]) for image in whole.values()]
    figures.sheet(folder / "crops.png", [("crop", crops), ("error", maps)], inches=1.7)


def available(rows: Sequence[str]) -> list[str]:
    """Return the rows whose packages are there, in the order of the table; say which are left out."""
    kept = []
    for row in (name for name in ROWS if name in rows):
        if missing := ROWS[row].missing:
            way_out = "pip install 'wamnet[baselines]'"
            sys.stderr.write(f"table1: {row} is left out: {', '.join(missing)} is missing; {way_out}\n")
        else:
            kept.append(row)
    return kept


def main(arguments: Sequence[str] | None = None) -> None:
    """Render, train, judge, time, and print the table."""
    parser = command.parser(__doc__ or "", "table1")
    parser.add_argument("--only", nargs="+", choices=list(ROWS), default=list(ROWS), help="rows")
    parser.add_argument("--no-times", action="store_true", help="leave the times of frames for later")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="rounds of the times")
    options = parser.parse_args(arguments)
    run(options)


def run(options: argparse.Namespace) -> None:
    """Do all that the options ask for."""
    scale = SCALES[options.scale]
    folder: Path = options.output
    settings = {"scale": json.loads(json.dumps(asdict(scale))), "executor": options.executor}
    kept = Results.open(folder / "table1.json", "table1", settings)
    times = Results.open(folder / "times.json", "table1-times", settings)
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    rows = available(options.only)
    with open_executor(options.executor) as device:
        bench = Bench(scale, options.cache, device)
        ladder = climbed(bench, kept)
        work = {row: partial(judged, row, bench, ladder, pictures) for row in rows}
        results.fill(kept, work, options.seeds)
        if not options.no_times:
            timed(rows, bench, times, options.rounds)
    if 0 in options.seeds and any((pictures / f"{row}.png").exists() for row in SHOWN):
        drawn(folder, pictures, scale.size, scale.pix2pix["crop"])
    text = written(kept, times)
    write_text(folder / "table1.md", text)
    print(text, end="")


if __name__ == "__main__":
    command.begin(main)
