"""Networks trained once: a folder keeps each under its recipe and its data, with the seconds it took.

1. The file is named after the recipe, the training frames and the executor [`path_of`].
2. Training goes through the command's own code: progress, checkpoints, and a run that was interrupted resumes
   to the same bits [`trained`]. Its seconds are those of the steps of the last part, in proportion.
3. A picture is made by the executor, or by the reference [`denoised`].
"""

import hashlib
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

from wamnet.cli.commands.train import checkpoint_path, fit
from wamnet.cli.files.outputs import write_text
from wamnet.kernels import denoise_on, open_executor, train_on
from wamnet.kernels.devices.executor import Executor
from wamnet.models.model_file import load_checkpoint, load_model
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model, denoise
from wamnet.refimpl.network.train import Recipe, recipe_to_json, train

from .frames import DIGITS, Pair


def path_of(folder: Path, recipe: Recipe, pairs: Sequence[Pair], executor: str) -> Path:
    """Return the file of a network."""
    text = json.dumps([recipe_to_json(recipe), _digest(recipe, pairs), executor])
    return folder / f"{hashlib.sha256(text.encode()).hexdigest()[:DIGITS]}.safetensors"


_LAST: list[tuple[Sequence[Pair], object, str]] = []
"""Pairs, the inputs that were made of them, and their digest: smoothing some hundred frames takes minutes."""


def _digest(recipe: Recipe, pairs: Sequence[Pair]) -> str:
    """Return the digest of the data that a recipe makes of pairs; of the same list as before it is known."""
    inputs = recipe.features, recipe.window
    if not _LAST or _LAST[0][0] is not pairs or _LAST[0][1] != inputs:
        scales = dataset.normalization_of([noisy for noisy, _ in pairs])
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            data = dataset.build(pairs, *inputs, scales, pool.map)
        _LAST[:] = [(pairs, inputs, data.digest)]
    return _LAST[0][2]


def trained(
    recipe: Recipe, pairs: Sequence[Pair], folder: Path, executor: str = "opencl"
) -> tuple[Model, float]:
    """Return the network of a recipe trained on pairs, and the seconds of its training."""
    folder.mkdir(parents=True, exist_ok=True)
    path = path_of(folder, recipe, pairs, executor)
    clock, checkpoint = path.with_suffix(".json"), checkpoint_path(path)
    if path.exists() and clock.exists():
        return load_model(path), float(json.loads(clock.read_text(encoding="utf-8"))["seconds"])
    state = load_checkpoint(checkpoint) if checkpoint.exists() else None
    if state is not None and state.step >= recipe.steps:
        state = None  # its seconds are not known
    share = 1.0 if state is None else 1.0 - state.step / recipe.steps
    _, seconds = fit(recipe, pairs, path, state, executor=executor)
    # A resumed run has timed only its own steps: all of them took as long, in proportion.
    total = seconds / share
    write_text(clock, json.dumps({"seconds": total, "recipe": json.loads(recipe_to_json(recipe))}) + "\n")
    checkpoint.unlink(missing_ok=True)
    return load_model(path), total


TIMED_STEPS = 100
"""Steps whose time is taken, after as many whose is not."""


def seconds_a_step(
    recipe: Recipe, pairs: Sequence[Pair], device: Executor, steps: int = TIMED_STEPS
) -> float:
    """Return the seconds of a step on a device: of the steps in the middle, without what comes before."""
    count = max(1, min(steps, recipe.steps // 2))
    seen: list[float] = []
    fit_on = train if device.name == "numpy" else partial(train_on, device)
    fit_on(
        replace(recipe, log_every=count),
        pairs,
        until=2 * count,
        on_progress=lambda *_: seen.append(time.perf_counter()),
    )
    return (seen[1] - seen[0]) / count


def denoised(model: Model, frames: Sequence[Frame], executor: str = "opencl") -> list[Floats]:
    """Return the display-encoded pictures (H, W, 3) of some frames."""
    if executor == "numpy":
        return [denoise(model, frame) for frame in frames]
    with open_executor(executor) as device:
        return [denoise_on(device, model, frame).image for frame in frames]
