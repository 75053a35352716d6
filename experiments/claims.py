"""The paper's claims: each holds here, does not hold, is not decided, or is not tested.

    python experiments/claims.py
    python experiments/claims.py --table out/table1/table1.json

1. Qualities are those of Table 1 [`experiments/table1.py`]; what is said of other orientations, of other
   lights and of this machine's seconds is read from records in git [`Evidence`].
2. A claim asks questions; each is decided on the bootstrap interval of its own number [`lab/verdicts.py`]:
   improvements pose by pose [`gain`], ratios of means [`change`]. Of a network whose training was broken off
   before its validation error was flat, nothing is tested [`Evidence.table`].
3. The noisy frames are judged at several exposures too [`exposures`]. Table 1's MSE of 82.93 for 1 spp is a
   PSNR that dark frames have; its SSIM of 0.21 is one that so dark frames do not have. What follows is said
   below that table [`follows`]. That squares were taken modulo 256 is a conjecture; no verdict rests on it.
4. The folder gets `claims.json`, of which the record is made. Exposures and times of the record in git are
   kept: `git show c0740039:experiments/claims.py` measured them.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from baselines.rows import ROWS, TORCH
from lab import scores, tables
from lab.command import begin
from lab.intervals import Interval, apart, interval, paired, ratio
from lab.records import FOLDER, Records
from lab.results import PER_FRAME, Results, Values
from lab.verdicts import HOLDS, Answer, Measured, Question, Untested, decide, said, together
from numpy.typing import NDArray

from wamnet.refimpl.encoding import LEVELS
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network.train import PAPER

STOPS = (0, -2, -4, -6)
"""Exposures that the noisy frames are judged at, in stops: a stop less is half of the light."""

PAPER_MSE, PAPER_SSIM = 82.93, 0.21
"""What the paper's Table 1 prints for its input of 1 spp."""

EQUAL_DB = 0.5
"""Decision: a picture is equally good if it gains at most so many decibels less."""

NO_BLOCKS = 1.1
"""Decision: errors that jump less than this, against elsewhere, are not blocks."""

LOST = 2.0
"""Decision: colours are not reproduced where they are farther off than this, against those trained on."""

DIGITS = {"psnr": 2, "ssim": 3, "mse255": 1, "wrapped": 1, "blocks": 2}
"""Digits after the point, by score."""

NAMES = {
    "psnr": "PSNR",
    "ssim": "SSIM",
    "mse255": "MSE",
    "wrapped": "MSE modulo 256",
    "blocks": "jump of errors at borders of patches",
}
"""What scores are called; MSE is that of levels 0 to 255."""

Table = Mapping[int, Sequence[float]]
"""Numbers of each pose, by seed."""


# ---- what is known ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Evidence:
    """All that claims are decided on: Table 1, records of studies, and seconds that were measured."""

    table1: Results
    records: Mapping[str, Results] | Records = field(default_factory=Records)
    times: Mapping[str, Any] | None = None

    def table(self, row: str, name: str) -> Table:
        """Return a number of a row of Table 1; refuse one of a training that was broken off."""
        if ROWS[row].packages == TORCH:
            for seed, values in by_seed(self.table1, row).items():
                if values.get("flat") is not True:
                    rule = "its validation error was not flat when its training ended"
                    raise Untested(f"row {row}, seed {seed}: {rule}")
        return numbers(self.table1, row, name, f"row {row} of Table 1")

    def seconds(self, name: str) -> Sequence[float]:
        """Return the seconds of each round."""
        if not self.times or name not in self.times:
            raise Untested("it was not measured")
        found: Sequence[float] = self.times[name]
        return found


def by_seed(kept: Results, configuration: str) -> dict[int, Values]:
    """Return the values of a configuration by seed."""
    return {r["seed"]: r["values"] for r in kept.records() if r["configuration"] == configuration}


def numbers(kept: Results, configuration: str, name: str, text: str = "") -> dict[int, list[float]]:
    """Return a number by seed: that of each pose where it was kept, else the mean."""
    found: dict[int, list[float]] = {}
    for seed, values in by_seed(kept, configuration).items():
        each = values.get(PER_FRAME, {}).get(name, values.get(name))
        if each is not None:
            row = each if isinstance(each, list) else [each]
            found[seed] = [math.nan if value is None else float(value) for value in row]
    if not found:
        raise Untested(f"no record of {text or configuration}")
    return found


def common(*found: Table) -> list[NDArray[np.float64]]:
    """Return numbers (seeds, poses) of the seeds that all have."""
    seeds = sorted(set.intersection(*(set(table) for table in found)))
    if not seeds:
        raise Untested("no seed is common to both")
    rows = [[table[seed] for seed in seeds] for table in found]
    if any(len({len(row) for row in each}) != 1 for each in rows):
        raise Untested("seeds have different numbers of poses")
    arrays = [np.asarray(each, np.float64) for each in rows]
    if not all(np.all(np.isfinite(array)) for array in arrays):
        raise Untested("a number is not finite")
    return arrays


def of_common(compare: Callable[..., Interval], *found: Table, further: str = "") -> Measured:
    """Return what a function of the intervals makes of numbers of common seeds, with their means."""
    arrays = common(*found)
    try:
        result = compare(*arrays)
    except InputError as error:
        raise Untested(f"{error.what}: {error.rule}") from None
    means = tuple(float(array.mean()) for array in reversed(arrays)) if len(arrays) > 1 else ()
    over = f"{_count(result.seeds, 'seed')} x {_count(result.poses, 'pose')}{further}"
    return Measured(result, over, means)


def _count(number: int, what: str) -> str:
    """Return a number of things."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def size_of(kept: Results) -> str:
    """Return the size of a study's frames, to be said beside its numbers."""
    return ", {0}x{0}".format(kept.settings["size"])


# ---- questions -------------------------------------------------------------------------------------------


def gain(
    before: str, after: str, name: str, found: Evidence, least: float = 0.0, decides: bool = True
) -> Answer:
    """Return whether one row is better than another by more than so much, pose by pose."""
    lower = name in scores.LOWER_IS_BETTER
    bound = 0.0 - least if lower else least
    unit = "dB" if name == "psnr" else ""
    question = Question(f"{NAMES[name]}, difference", bound, not lower, decides, DIGITS[name], unit)
    return question.ask(lambda: of_common(paired, found.table(after, name), found.table(before, name)))


def change(before: str, after: str, name: str, bound: float, found: Evidence, decides: bool = True) -> Answer:
    """Return whether a mean is more than `bound` times that of another row; of errors, whether it is less."""
    above = name not in scores.LOWER_IS_BETTER
    question = Question(f"{NAMES[name]}, ratio", bound, above, decides, 3, means_digits=DIGITS[name])
    return question.ask(lambda: of_common(ratio, found.table(after, name), found.table(before, name)))


def better(before: str, after: str, names: Sequence[str], found: Evidence) -> list[Answer]:
    """Return whether one row is better than another by each of some scores."""
    return [gain(before, after, name, found) for name in names]


def noise_falls(found: Evidence) -> list[Answer]:
    """Return whether the MSE falls below 60 %, as it is; and, beside it, modulo 256."""
    return [
        change("input", "wamnet", "mse255", 0.6, found),
        change("input", "wamnet", "wrapped", 0.6, found, decides=False),
    ]


def two_percent(found: Evidence) -> list[Answer]:
    """Return whether pix2pix has 0.02 of SSIM more; and, beside it, whether it has more at all."""
    return [
        gain("wamnet", "pix2pix", "ssim", found, 0.02),
        gain("wamnet", "pix2pix", "ssim", found, decides=False),
    ]


def blocks(found: Evidence) -> list[Answer]:
    """Return whether errors of pix2pix jump at the borders of patches, and those of WAMnet do not."""

    def of(row: str, question: Question) -> Answer:
        return question.ask(lambda: of_common(interval, found.table(row, "blocks")))

    return [
        of("pix2pix", Question(f"pix2pix, {NAMES['blocks']}", NO_BLOCKS)),
        of("wamnet", Question(f"WAMnet, {NAMES['blocks']}", NO_BLOCKS, above=False)),
    ]


def training_time(found: Evidence) -> list[Answer]:
    """Return, beside a claim about another machine, whether the paper's training takes 90 s on this one."""
    return [_on_these_cores("training", "step_s", PAPER.steps, 90.0, found)]


def frame_time(found: Evidence) -> list[Answer]:
    """Return, beside a claim about another machine, whether a frame takes 1/11 s on this one."""
    return [_on_these_cores("a frame of 1024x1024", "frame_s", 1, 1.0 / 11.0, found)]


def _on_these_cores(what: str, name: str, times: int, bound: float, found: Evidence) -> Answer:
    """Return whether so many times a measured time are below a bound, here."""

    def measure() -> Measured:
        rounds = common({0: found.seconds(name)})[0]
        over = f"{_count(rounds.size, 'round')}, {(found.times or {}).get('device', 'one device')}"
        return Measured(interval(rounds).scaled(float(times)), over)

    digits = 1 if bound > 1.0 else 4
    return Question(f"{what} on this machine's cores", round(bound, 4), False, False, digits, "s").ask(
        measure
    )


AT = re.compile(r"psnr at (-?\d+(?:\.\d+)?)")
"""The name of the PSNR at an orientation, in degrees."""


def orientations(found: Evidence) -> list[Answer]:
    """Return whether the gain over the noisy frames is as large at other orientations as at that of training.

    Frames at other orientations show other things: so gains are compared, not qualities.
    """
    kept, row = found.records["generalisation"], "paper's features: one"

    def gained(degrees: float) -> Table:
        name = f"psnr at {degrees:g}"
        after, before = common(numbers(kept, row, name), numbers(kept, "input", name))
        return dict(enumerate((after - before).tolist()))

    def measure(at: float) -> Measured:
        return of_common(apart, gained(at), gained(0.0), further=size_of(kept))

    names = next(iter(by_seed(kept, row).values()))
    degrees = [float(match[1]) for name in names if (match := AT.fullmatch(name)) and float(match[1])]
    less = "gain of PSNR over the input at {:g} degrees, less that at 0"
    return [Question(less.format(at), -EQUAL_DB, unit="dB").ask(partial(measure, at)) for at in degrees]


def other_lights(trained: str, found: Evidence) -> list[Answer]:
    """Return whether colours under unseen lights are `LOST` times as far off as under A, the own ones."""
    kept = found.records["lights"]

    def measure() -> Measured:
        both = (numbers(kept, f"paper: {trained}", name) for name in ("color", "color on A"))
        return of_common(ratio, *both, further=size_of(kept))

    what = f"error of colours under unseen lights over that under A, trained on {trained}"
    return [Question(what, LOST).ask(measure)]


# ---- the claims ------------------------------------------------------------------------------------------


class Claim(NamedTuple):
    """A claim by name, in words, the paper's number, what is asked, and what a reader should know of it."""

    name: str
    text: str
    paper: str
    ask: Callable[[Evidence], list[Answer]]
    note: str = ""


NOT_THIS_MACHINE = "About the paper's GPU, which was not there: nothing is tested."
"""What is said of claims about speed."""

ITS_TRAINING = "Both as the paper trains them, until the baseline's validation error is flat."
"""What is said of baselines."""

ALL_THREE = ("mse255", "psnr", "ssim")
"""The scores of the paper's Table 1."""

CLAIMS = (
    Claim("noise", "noise falls by 40 %", "MSE 82.93 to 48.04, -42 %", noise_falls,
          "Read as: by 40 % at least. Squares modulo 256 are a conjecture about the paper's numbers."),
    Claim("structure", "structure improves by 200 %", "SSIM 0.21 to 0.68, +224 %",
          lambda found: [change("input", "wamnet", "ssim", 3.0, found)],
          "Read as: SSIM is three times that of the input, whose own is lower here."),
    Claim("normals-own", "normals help, on the frame trained on", "seen in pictures",
          partial(better, "wamnet-color-own", "wamnet-own", ("psnr", "ssim")),
          "Each seed has a frame of its own."),
    Claim("normals", "normals help, on other frames", "seen in pictures",
          partial(better, "wamnet-color", "wamnet", ("psnr", "ssim"))),
    Claim("training-time", "training takes 90 s", "90 s on a GPU", training_time, NOT_THIS_MACHINE),
    Claim("speed", "11 frames a second", "11 at 1024x1024 on a GPU", frame_time, NOT_THIS_MACHINE),
    Claim("worth-own", "worth a render of 30 spp, on the frame trained on", "seen in pictures",
          partial(better, "render30-own", "wamnet-own", ("mse255",)),
          "Read as: a smaller MSE than the render's. Each seed has a frame of its own."),
    Claim("worth", "worth a render of 30 spp, on other frames", "seen in pictures",
          partial(better, "render30", "wamnet", ("mse255",)), "Read as: a smaller MSE than the render's."),
    Claim("dncnn", "DnCNN is worse, at full size", "SSIM 0.44 to 0.68",
          partial(better, "dncnn", "wamnet", ALL_THREE), ITS_TRAINING),
    Claim("dncnn-resized", "DnCNN is worse, on frames a quarter as wide, enlarged again",
          "SSIM 0.44 to 0.68", partial(better, "dncnn-shrunk", "wamnet", ALL_THREE), ITS_TRAINING),
    Claim("dncnn-judged-small", "DnCNN is worse, on frames a quarter as wide, judged there",
          "SSIM 0.44 to 0.68", partial(better, "dncnn-shrunk-own", "wamnet", ALL_THREE),
          "Each of its pixels is the mean of 16 noisy ones, before any network: its input is another one."),
    Claim("pix2pix", "pix2pix is 2 % better", "SSIM 0.68 to 0.70", two_percent,
          "Read as: 0.02 of SSIM at least. " + ITS_TRAINING),
    Claim("blocks", "pix2pix leaves blocks, WAMnet does not", "seen in pictures", blocks),
    Claim("orientations", "equally good for unknown orientations", "no number", orientations,
          f"Read as: a gain over the input that is at most {EQUAL_DB:g} dB less."),
    Claim("lights", "colours of other lights are not reproduced, trained on lights A (6.1)",
          "seen in pictures", partial(other_lights, "A only"),
          f"Read as: {LOST:g} times as far off, in means over tiles."),
    Claim("several-lights", "nor when trained on several sets of lights (6.2)", "seen in pictures",
          partial(other_lights, "16 sets"), f"Read as: {LOST:g} times as far off, in means over tiles."),
)  # fmt: skip
"""All claims, in the order of the paper's numbers, then of its further studies."""


def decided(claim: Claim, found: Evidence) -> Values:
    """Return the record of a claim."""
    answers = [answer.as_data() for answer in claim.ask(found)]
    said_of_it = {"claim": claim.text, "paper": claim.paper, "note": claim.note}
    return {**said_of_it, "verdict": together(answers), "answers": answers}


def _exposure(stops: int) -> str:
    """Return the name of the noisy frames at an exposure."""
    return f"input at {stops:+d} stops" if stops else "input as it is"


# ---- texts -----------------------------------------------------------------------------------------------


def verdicts(kept: Results) -> str:
    """Return the table of the claims, from their records."""
    lines = []
    for name in kept.configurations():
        values = kept.get(name, 0) or {}
        if "verdict" in values:
            answers = values["answers"]
            deciding = sum(answer["decides"] for answer in answers)
            here = "<br>".join(said(a, alone=a["decides"] and deciding == 1) for a in answers)
            lines.append([values["claim"], values["paper"], f"**{values['verdict']}**", here, values["note"]])
    return tables.markdown(["claim", "paper", "verdict", "here", "note"], lines)


def exposures(kept: Results) -> str:
    """Return PSNR and SSIM of the noisy frames by exposure, and what follows; nothing without records."""
    names = {_exposure(stops): _exposure(stops) for stops in STOPS if kept.get(_exposure(stops), 0)}
    if not names:
        return ""
    columns = [
        tables.Column(name, f"{NAMES[name]}{', dB' if name == 'psnr' else ''}", DIGITS[name], interval=True)
        for name in ("psnr", "ssim", "mse255", "wrapped")
    ]
    psnr, ssim = ([kept.per_pose(name, value)[0] for name in names] for value in ("psnr", "ssim"))
    poses = [list(map(list, zip(*found, strict=True))) for found in (psnr, ssim)]
    return f"{tables.table(kept, columns, names)}\n{follows(*poses)}\n"


def follows(psnr: Sequence[Sequence[float]], ssim: Sequence[Sequence[float]]) -> str:
    """Return what follows from PSNR and SSIM (poses, exposures) of noisy frames that get darker."""
    wanted = -10.0 * math.log10(PAPER_MSE / LEVELS**2)
    printed = f"An MSE of {PAPER_MSE} is {wanted:.2f} dB"
    if not all(each[0] <= wanted <= each[-1] and np.all(np.diff(each) > 0.0) for each in psnr):
        return f"{printed}, which not all of the noisy frames have at one of these exposures."
    there = interval([float(np.interp(wanted, *pose)) for pose in zip(psnr, ssim, strict=True)])
    text = f"{printed}. Noisy frames so dark that they have this PSNR have an SSIM of {there.text(2)}"
    verdict, _ = decide(there, PAPER_SSIM)
    if verdict != HOLDS:
        return f"{text}, which does not exclude the {PAPER_SSIM} that the paper prints beside it."
    return (
        f"{text}, where the paper prints {PAPER_SSIM}: so it is not the MSE of frames like these at any of "
        "these exposures. Squares modulo 256 give numbers of that size; that they were taken is a conjecture."
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Decide, and print the claims."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=FOLDER / "table1.json", help="Table 1's results")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/claims"), help="folder of the results")
    options = parser.parse_args(arguments)
    before = Records()["claims"]
    kept = Results.open(options.output / "claims.json", "claims", before.settings)
    for record in before.records():
        if "verdict" not in record["values"]:
            kept.put(record["configuration"], 0, record["values"])
    found = Evidence(Results.read(options.table), times=kept.get("times", 0))
    for claim in CLAIMS:
        kept.put(claim.name, 0, decided(claim, found))
    print("\n".join(filter(None, (verdicts(kept), exposures(kept)))), end="")


if __name__ == "__main__":
    begin(main)
