"""`wamnet bench train`: milliseconds of a training step, by each trainer."""

from functools import partial

from ....kernels.bench import training
from ....kernels.measure import measure
from ....refimpl.errors import InputError
from ....refimpl.network.train import PRESETS
from ...common.options import option
from ...common.terminal import progress, say
from ...reports import machine
from .shared import Repeats, Square, check_counts, extent, head, names_of, row, say_facts

LONGEST_S = 600.0
"""More seconds of one measurement than anybody waits for."""


def train(
    presets: str = option("NAME,...  Training presets: best, mirrors, paper, short, sky.", "paper,short"),
    trainers: str | None = option(
        "NAME,...  Trainers to measure: numpy, opencl, torch. [default: all that are installed]"
    ),
    size: Square = 256,
    frames: int = option("Number of noise frames to train on.", 4),
    seconds: float = option("S  Approximate time per measurement, in seconds.", 1.0),
    repeats: Repeats = 5,
) -> None:
    """Measure milliseconds per training step: the reference, the compiled trainer, PyTorch.

    The trainers are interleaved with a product of two large matrices, on noise frames, minibatch sampling
    included and compilation excluded. The table has the median and the range, GFLOP/s of the matrix
    products, their share of the large product's rate, and the time that all steps would take. [bold]pip
    install torch[/] adds PyTorch.

    Examples:
    wamnet bench train --presets paper,short --repeats 5
    wamnet bench train --trainers numpy,opencl,torch --presets paper
    """
    names = names_of("--presets", presets, PRESETS)
    given = training.trainers() if trainers is None else names_of("--trainers", trainers, training.TRAINERS)
    check_counts([size], frames=(frames, 4), repeats=(repeats, 5))
    if not 0.0 < seconds <= LONGEST_S:
        rule = f"must be above 0 and at most {LONGEST_S:g}"
        raise InputError("--seconds", seconds, rule, "for example --seconds 1")
    packages = [f"{name} {value}" for name, value in machine.versions().items()]
    say_facts(*packages, f"{frames} frames of {size}x{size}")
    pairs = training.noise(frames, size)
    for recipe, preset in ((PRESETS[name], name) for name in names):
        entries, product = training.entries(recipe, pairs, given, seconds), training.sgemm()
        with progress(f"measuring {preset}", (len(given) + 1) * (repeats + 1), "rounds") as advance:
            measure([product, *entries], repeats, warm=0, done=partial(advance, 1.0))
        work, most = training.operations(recipe), product.facts["operations"] / min(product.seconds)
        say("")
        say(f"preset `{preset}`: {work / 1e9:.3f} GFLOP per step; sgemm {most / 1e9:.0f} GFLOP/s")
        head("backend", "ms per step", "range", "GFLOP/s", "of sgemm", f"{recipe.steps:,} steps")
        for entry in entries:
            median = entry.times.median
            row(
                *(entry.name, f"{1e3 * median:.2f}", extent([1e3 * time for time in entry.seconds], 2)),
                *(f"{work / median / 1e9:.0f}", f"{work / median / most:.0%}"),
                f"{median * recipe.steps:,.0f} s",
            )
