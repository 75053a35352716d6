"""Table 1 of the paper, with what its readers would ask for today: every denoiser on the same frames.

    python experiments/table1.py
    python experiments/table1.py --scale paper --only wamnet wamnet-own --seeds 0 1 2

1. Frames of `minicubes` at times of the golden-ratio sequence are rendered and kept, each of another
   geometry: to train on, to look at while training, and to judge by [`baselines/rows.py`].
2. Each row is trained, tuned or opened for each seed, which is that of the noise too, and judged on the test
   frames [`judged`]. A row without its packages is left out, and said so. DnCNN and pix2pix are trained until
   their error on the validation frames is flat [`baselines/fitting.py`].
3. Times of a frame, of its input and of a step of training are interleaved, on the same cores, when
   everything else is done [`timed`].
4. The folder gets `table1.json`, `times.json`, `table1.md` with a table of qualities and one of costs, the
   pictures of the first test frame, `curves.png` with the validation errors, and `crops.png`: a crop around a
   corner of pix2pix's patches [`drawn`].

Every step is kept, so an interrupted run resumes. Numbers are means over test frames and seeds; records keep
those of each frame. "worth" is the number of samples per pixel whose render has the same error. "blocks" is
how much the error jumps at borders of patches, against elsewhere [`baselines/blocks.py`]. "MSE modulo 256" is
that of arithmetic of 8 bits; that the paper's was so is a conjecture (record `claims`).
"""

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from baselines.blocks import blockiness
from baselines.rows import ROWS, Bench, Case, Ready, Row, Scale, compared
from lab import command, figures, plots, results, scores, tables
from lab.frames import Shot
from lab.results import PER_FRAME, Results, Summary, Values

from wamnet.cli.common.terminal import hint_on_interrupt
from wamnet.cli.files import exr
from wamnet.cli.files.images import write_png
from wamnet.cli.files.outputs import write_text
from wamnet.kernels import open_executor
from wamnet.kernels.measure import in_turns
from wamnet.kernels.run.render_frame import render_frame
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError

SCALES: Mapping[str, Scale] = {
    "toy": Scale(
        size=128, train=3, validation=1, test=2, train_spp=2, validation_spp=2, test_spp=16, ladder=(1, 4),
        short_frames=2, paper={"steps": 2, "batch": 64, "n_windows": 128}, short={"steps": 2, "batch": 32},
        dncnn={"steps": 1, "batch": 1, "crop": 16, "width": 4},
        shrunk={"steps": 1, "batch": 1, "crop": 8, "width": 4, "shrink": 4},
        pix2pix={"steps": 1, "batch": 1, "crop": 64, "width": 4},
    ),
    "small": Scale(
        size=256, train=24, validation=2, test=8, train_spp=256, validation_spp=256, test_spp=1024,
        ladder=(1, 2, 4, 8, 16, 32, 64, 128, 256), short_frames=24,
        dncnn={"steps": 6000, "batch": 16, "crop": 40, "half": True},
        shrunk={"steps": 6000, "batch": 8, "crop": 40, "half": True, "shrink": 4},
        pix2pix={"steps": 12_000, "batch": 1, "crop": 128, "width": 32, "every": 200},
    ),
    "paper": Scale(
        size=1024, train=4, validation=2, test=4, train_spp=1024, validation_spp=256, test_spp=1024,
        ladder=(1, 4, 16, 30, 64, 128), short_frames=4, few=(0,),
        dncnn={"steps": 30_000, "batch": 16, "crop": 40, "half": True},
        shrunk={"steps": 5000, "batch": 8, "crop": 40, "half": True, "shrink": 4},
        pix2pix={"steps": 80_000, "batch": 1, "crop": 128, "width": 32, "every": 200},
    ),
}  # fmt: skip
"""Sizes by name. `paper` has the paper's pictures, references and training of WAMnet, and fewer frames: the
paper had 1,000 to train on and 100 to test by."""

OWN_LADDER = (1, 2, 4, 8, 16, 32, 64)
"""Samples of the renders of a frame that a network was trained on."""

CROP_PX = 96
"""Side of the crop that is shown."""

SHOWN = ("input", "dncnn", "wamnet", "wamnet-best", "pix2pix", "oidn-prefiltered", "render30")
"""Rows of which a crop is shown."""

ROUNDS = 5
"""Rounds of the times."""

LADDER = "ladder"
"""Configuration of the renders of test frames; with `-own` those of the frames trained on."""


def settings_of(scale: Scale, executor: str) -> dict[str, Any]:
    """Return what all records of a file have in common: the frames, and what renders them."""
    shared = ("size", "train", "validation", "test", "train_spp", "validation_spp", "test_spp", "ladder")
    return {**{name: getattr(scale, name) for name in (*shared, "short_frames")}, "executor": executor}


def trained_with(row: Row, scale: Scale) -> dict[str, Any]:
    """Return a row's own settings of the scale, as JSON has them."""
    found: dict[str, Any] = json.loads(json.dumps(dict(getattr(scale, row.trains) if row.trains else {})))
    return found


def judged(row: str, bench: Bench, kept: Results, pictures: Path, seed: int) -> Values:
    """Return the scores of a row, means and those of each frame, and what else is known of it."""
    ready = ROWS[row].make(bench, seed)
    found, pairs = [], []
    for case in ready.cases or bench.cases(seed, ready.rays, ready.spp):
        picture, linear = ready.picture(case)
        found.append(scores.score(picture, case.reference["color"], linear))
        pairs.append((picture, to_display(case.reference["color"])))
        if seed == 0 and case.index == 0 and not ready.cases:
            write_png(pictures / f"{row}.png", picture)
            write_png(pictures / "reference.png", pairs[0][1])
    per_frame = {name: [each[name] for each in found] for name in found[0]}
    values: dict[str, Any] = {**scores.mean_scores(found), **ready.facts, PER_FRAME: per_frame}
    values["settings"] = trained_with(ROWS[row], bench.scale)
    if (patch := bench.scale.pix2pix["crop"]) < min(pairs[0][0].shape[:2]):
        values["blocks"] = blockiness(pairs, patch)
        per_frame["blocks"] = [blockiness([pair], patch) for pair in pairs]
    if not ready.cases or ready.ladder is not None:
        values["worth"] = climbed(bench, kept, ready.ladder, seed).spp_of(values["mse"])
    return values


def climbed(bench: Bench, kept: Results, own: Shot | None = None, seed: int = 0) -> scores.Ladder:
    """Return the errors of renders of the test frames, or of a seed's own frame; they are kept too."""
    name, number = (LADDER, 0) if own is None else (f"{LADDER}-own", seed)
    if (found := kept.get(name, number)) is None:
        found = _renders(bench, own, number)
        kept.put(name, number, found)
    return scores.Ladder(tuple(found["spp"]), tuple(found["mse"]))


def _renders(bench: Bench, own: Shot | None, seed: int) -> dict[str, Any]:
    """Return samples, mean errors and PSNR of renders, and the errors of each frame."""
    scale, shots = bench.scale, bench.split.test if own is None else (own,)
    target = scale.test_spp if own is None else scale.train_spp
    references = [exr.read_frame(clean)["color"] for _, clean in bench.files(shots, target, seed)]
    rungs = scale.ladder if own is None else [n for n in OWN_LADDER if n <= scale.ladder[-1]]
    renders = {
        spp: [
            (exr.read_frame(path)["color"], reference)
            for path, reference in zip(bench.renders(shots, spp, seed), references, strict=True)
        ]
        for spp in rungs
    }
    ladder = scores.ladder(renders)
    each = {
        spp: [scores.metrics.mse(to_display(image), to_display(target)) for image, target in pairs]
        for spp, pairs in renders.items()
    }
    psnr = [float(np.mean(-10.0 * np.log10(each[spp]))) for spp in ladder.spp]
    frames_mse = [each[spp] for spp in ladder.spp]
    return {"spp": list(ladder.spp), "mse": list(ladder.mse), "psnr": psnr, "frames_mse": frames_mse}


# ---- times and costs ---------------------------------------------------------------------------------------


def timed(rows: Sequence[str], bench: Bench, kept: Results, rounds: int) -> None:
    """Take interleaved times of a frame and of its input, for all rows."""
    left = [row for row in rows if kept.get(row, 0) is None and ROWS[row].timed]
    if not left:
        return
    made = {row: ROWS[row].make(bench, 0) for row in left}
    inputs = {(ready.rays, ready.spp) for ready in made.values()}
    cases = {(rays, spp): next(iter(bench.cases(0, rays, spp))) for rays, spp in inputs}
    ways = {row: _way(row, ready, bench, cases[ready.rays, ready.spp]) for row, ready in made.items()}
    costs = {cost for ready in made.values() if (cost := ready.cost) != (0, 0)} | {(1, 0), (30, 0)}
    ways |= {_input(cost): partial(_render, bench, *cost) for cost in costs}
    times = in_turns(ways, rounds)
    steps = in_turns({row: ready.step for row, ready in made.items() if ready.step is not None}, rounds)
    first, thirty = (1e3 * times[_input((spp, 0))].median for spp in (1, 30))
    for row, ready in made.items():
        paid = 1e3 * times[_input(ready.cost)].median if ready.cost != (0, 0) else 0.0
        values = {"ms": 1e3 * times[row].median, "spread": times[row].spread, "input_ms": paid}
        values |= {"render1_ms": first, "sample_ms": (thirty - first) / 29.0}
        values |= {"device": bench.device.device, "threads": _threads(ROWS[row])}
        if row in steps:
            values["step_ms"] = 1e3 * steps[row].median
        kept.put(row, 0, values)


def _input(cost: tuple[int, int]) -> str:
    """Return the name of a way to render an input of so many samples and rays."""
    return f"input of {cost[0]} spp and {cost[1]} rays"


def _threads(row: Row) -> int:
    """Return the number of threads of a row's package, which is that of the cores."""
    if "torch" in row.packages:
        from baselines.fitting import use_all_cores

        return use_all_cores()
    return int(results.machine.describe()["cores"])


def _way(row: str, ready: Ready, bench: Bench, case: Case) -> Callable[[], float | None]:
    """Return what makes a row's picture of a case once."""
    if row == "render30":
        return partial(_render, bench, 30, 0)
    if ready.seconds is not None:
        return partial(ready.seconds, case)

    def make() -> None:
        ready.picture(case)

    return make


def _render(bench: Bench, spp: int, rays: int) -> None:
    """Render a test frame with so many samples, and features of so many rays."""
    shot = bench.noisy(bench.split.test[0], 0, rays, spp)
    render_frame(bench.executor, shot.build(), shot.job)


def priced(row: str, kept: Results, times: Results) -> dict[str, float] | None:
    """Return what a row costs, and the renders of equal time and of equal error.

    Milliseconds of a frame: its input, its denoising, both; samples and PSNR of the render of that time; the
    milliseconds of the render of its error; seconds of training, and of rendering what is trained on; the
    number of frames from which on all of that pays, against that render.
    """
    time, found, ladder = times.get(row, 0), kept.get(row, 0), kept.get(LADDER, 0)
    if time is None or found is None or ladder is None:
        return None

    def render_ms(spp: float) -> float:
        return time["render1_ms"] + (spp - 1.0) * time["sample_ms"]

    total = time["input_ms"] + time["ms"]
    spp = max(1.0, 1.0 + (total - time["render1_ms"]) / time["sample_ms"])
    each = [scores.Ladder(ladder["spp"], mse).mse_of(spp) for mse in zip(*ladder["frames_mse"], strict=True)]
    training_s = found.get("training_s", 0.0)
    frames_s = found.get("training_samples", 0) * time["sample_ms"] / 1e3
    gain = (render_ms(found["worth"]) - total) / 1e3
    return {
        "input_ms": time["input_ms"],
        "ms": time["ms"],
        "total_ms": total,
        "equal_time_spp": spp,
        "equal_time_psnr": float(np.mean(-10.0 * np.log10(each))),
        "equal_error_ms": render_ms(found["worth"]),
        "frames_s": frames_s,
        "training_s": training_s,
        "pays_after": math.ceil((frames_s + training_s) / gain) if gain > 0.0 else math.inf,
    }


# ---- tables and figures ----------------------------------------------------------------------------------


def count(found: Summary) -> str:
    """Return an integer with commas."""
    return f"{found.mean:,.0f}"


COLUMNS = (
    tables.Column("mse255", "MSE", 1),
    tables.Column("psnr", "PSNR, dB", 2, interval=True),
    tables.Column("paper", "10 ln(255²/MSE)", 2),
    tables.Column("wrapped", "MSE modulo 256", 1),
    tables.Column("ssim", "SSIM", 3, interval=True),
    tables.Column("flip", "FLIP", 3, interval=True),
    tables.Column(
        "worth", "worth, spp", write=lambda s: f"{s.mean:.1f}" if s.mean < 100 else f"{s.mean:.0f}"
    ),
    tables.Column("blocks", "blocks", 2),
    tables.Column("parameters", "parameters", write=count),
)
"""The columns of the table of qualities; MSE is that of 0 .. 255."""

COSTS = (
    ("input_ms", "input, ms"),
    ("ms", "denoising, ms"),
    ("total_ms", "both, ms"),
    ("equal_time_spp", "render of equal time, spp"),
    ("equal_time_psnr", "its PSNR, dB"),
    ("equal_error_ms", "render of equal error, ms"),
    ("frames_s", "training frames, s"),
    ("training_s", "training, s"),
    ("pays_after", "pays after, frames"),
)
"""The columns of the table of costs."""


def written(kept: Results, times: Results) -> str:
    """Return the table of qualities, and that of costs where there are times."""
    names = {row: ROWS[row].text for row in ROWS if kept.summary(row, "mse") is not None}
    text = tables.table(kept, COLUMNS, names) if names else ""
    prices = {row: price for row in names if (price := priced(row, kept, times)) is not None}
    lines = [[names[row], *(_short(price[name]) for name, _ in COSTS)] for row, price in prices.items()]
    return text + ("\n" + tables.markdown(["", *(head for _, head in COSTS)], lines) if lines else "")


def _short(value: float) -> str:
    """Return a number with as many digits as matter."""
    if not math.isfinite(value):
        return "never"
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}" if value else ""


def curves(folder: Path, kept: Results) -> None:
    """Draw the validation errors of the rows that have some, over the steps of their training."""
    lines = {}
    for row in ROWS:
        looks = kept.of(row, "curve") if ROWS[row].timed else []
        for number, curve in enumerate(looks):
            name = ROWS[row].text if len(looks) == 1 else f"{ROWS[row].text}, run {number}"
            lines[name] = [(look["step"], *[look["psnr"]] * 3) for look in curve]
    if lines:
        figure, (axis,) = plots.axes(1, (8.4, 4.0))
        plots.lines(axis, lines, ("steps", "PSNR of the validation frames, dB"))
        figures.save(folder / "curves.png", figure)


def drawn(folder: Path, pictures: Path, size: int, patch: int) -> None:
    """Draw crops around the corner of four patches, and their errors (FLIP), of rows that have a picture."""
    from wamnet.cli.files.images import read_png

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
            way_out = "pip install --group baselines"
            sys.stderr.write(f"table1: {row} is left out: {', '.join(missing)} is missing; {way_out}\n")
        else:
            kept.append(row)
    return kept


def left(
    kept: Results, rows: Sequence[str], seeds: Sequence[int] | None, scale: Scale
) -> Iterator[tuple[str, int]]:
    """Yield rows and seeds without a record; refuse records of other settings."""
    for row in rows:
        mine = seeds if seeds is not None else scale.few if ROWS[row].few else command.SEEDS
        for seed in mine:
            found, now = kept.get(row, seed), trained_with(ROWS[row], scale)
            if found is None or _may_go_on(found, now):
                yield row, seed
            elif found.get("settings") != now:
                rule = f"was made with {json.dumps(found.get('settings'))}, not {json.dumps(now)}"
                raise InputError(f"record of {row}, seed {seed}", str(kept.path), rule, results.WAY_OUT)


def _may_go_on(found: Values, settings: Mapping[str, Any]) -> bool:
    """Tell whether a training met its number of steps before it was flat, and may now do more."""
    before = found.get("settings", {})
    return not found.get("flat", True) and {**before, "steps": settings.get("steps")} == settings != before


def main(arguments: Sequence[str] | None = None) -> None:
    """Render, train, judge, time, and print the table."""
    parser = command.parser(__doc__ or "", "table1")
    # Costly rows have fewer seeds than others, unless seeds are given.
    parser.set_defaults(seeds=None)
    parser.add_argument("--only", nargs="+", choices=list(ROWS), default=list(ROWS), help="rows")
    parser.add_argument("--no-times", action="store_true", help="leave the times of frames for later")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="rounds of the times")
    options = parser.parse_args(arguments)
    run(options)


def run(options: argparse.Namespace) -> None:
    """Do all that the options ask for."""
    scale = SCALES[options.scale]
    folder: Path = options.output
    settings = settings_of(scale, options.executor)
    kept = Results.open(folder / "table1.json", "table1", settings)
    times = Results.open(folder / "times.json", "table1-times", settings)
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    rows = available(options.only)
    if any("torch" in ROWS[row].packages for row in rows):
        _threads(ROWS["dncnn"])
    with open_executor(options.executor) as device:
        bench = Bench.of(scale, options.cache, device)
        if kept.get("frames", 0) is None:
            kept.put("frames", 0, compared(bench.split))
        missing = list(left(kept, rows, options.seeds, scale))
        with hint_on_interrupt(lambda: f"the same command resumes where it was, in {folder}"):
            for row, seed in missing:
                sys.stderr.write(f"table1: {row}, seed {seed}\n")
                kept.put(row, seed, judged(row, bench, kept, pictures, seed))
        if not options.no_times:
            timed(rows, bench, times, options.rounds)
    if any((pictures / f"{row}.png").exists() for row in SHOWN):
        drawn(folder, pictures, scale.size, scale.pix2pix["crop"])
    curves(folder, kept)
    text = written(kept, times)
    write_text(folder / "table1.md", text)
    print(text, end="")


if __name__ == "__main__":
    command.begin(main)
