"""`wamnet tune`: measure a denoiser's schedules on this machine, and remember the fastest."""

import os
from contextlib import nullcontext
from pathlib import Path

from ...compiler.variants import FULL, plan_model, with_rank
from ...kernels import cache as cache_folders
from ...kernels import open_executor
from ...kernels.bench.workload import paper_model
from ...kernels.run.tune import Table, Tuning
from ..common import options
from ..common.inputs import load_model
from ..common.options import ExecutorName
from ..common.terminal import say, table
from ..files.alone import alone_in


def tune(
    model: Path | None = None,
    executor: ExecutorName = ExecutorName.opencl,
    size: int = 512,
    rank: int = 0,
    context: options.ContextName | None = None,
    force: bool = False,
    cache: Path | None = None,
) -> None:
    """Measure which schedule of the denoiser is fastest on this machine, and cache the result."""
    if cache is not None:
        os.environ["WAMNET_CACHE"] = str(cache)
    network = load_model(model) if model else paper_model()
    square = (size, size)
    # Another process that tunes would measure this one's load; without a cache there is nothing to share.
    folder = cache_folders.folder()
    kept = folder is not None and cache_folders.writable(folder)
    remedy = "wait for it, or choose another with --cache"
    alone = alone_in(folder, "tuning", remedy) if folder and kept else nullcontext()
    with alone, open_executor(executor.value) as runner:
        plan = plan_model(network, runner.language, variant=with_rank(FULL, rank))
        tuning = Tuning(runner, plan.model, square, plan.varied)
        known = None if force else tuning.remembered()
        found = known or tuning.measured(plan)
        # A long compilation may pay for an animation.
        picks = {n: tuning.picked(n) for n in (1, 1000)}
    show(found)
    if known:
        say(f"measured on {found.day}; --force measures again")
    for count, (schedule, reason) in picks.items():
        say(f"for {count} image{'s' if count > 1 else ''}: {schedule}; {reason}")


def show(found: Table) -> None:
    """Print what was measured, the fastest first."""
    rows = sorted(found.rows, key=lambda row: float("inf") if row.ms is None else row.ms)
    texts = [
        (
            row.schedule,
            "" if row.ms is None else f"{row.ms:.3g}",
            f"{row.first_s:.2f}" if row.first_s else "",
            f"{row.again_s:.2f}" if row.again_s else "",
            row.note,
        )
        for row in rows
    ]
    height, width = found.size
    heads = ("schedule", "ms", "s to compile", "s again", "why it was not timed")
    say(f"{found.device}, {width}x{height}, {found.network}")
    table("Schedules", heads, texts, texts=len(heads))
