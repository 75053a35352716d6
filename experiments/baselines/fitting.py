"""Training a baseline in PyTorch: one loop for all, which can be stopped after any step and gone on with.

1. Examples are crops of display-encoded pictures, or tiles of them [`Examples`], drawn for each step as a
   function of the seed and the step alone [`draw`]; so is all other noise [`generator_of`].
2. A step is the method's own [`Method.step`]: losses, gradients, optimisers.
3. A checkpoint holds the networks and the optimisers [`fit`]; the finished networks are safetensors, with
   their recipe and the seconds of their training as JSON beside them. Neither is committed.

Sources: those of the methods. Sampling is that of refimpl/dataset.py.
"""

from __future__ import annotations

import hashlib
import json
import signal
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from lab.frames import DIGITS
from numpy.typing import NDArray
from safetensors.torch import load_file, save_file

from wamnet.cli.exr import read_frame
from wamnet.cli.outputs import replacing, write_text
from wamnet.cli.terminal import hint_on_interrupt, progress
from wamnet.refimpl import dataset
from wamnet.refimpl.dataset import Normalization
from wamnet.refimpl.errors import InputError, TrainingError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.rng import counter, random_block

Tensor = torch.Tensor

CROP_TAG = 0x43524F50
"""Counter `block` of the words that choose crops ("CROP" in ASCII)."""

NOISE_TAG = 0x4E4F4953
"""Counter `block` of the words that seed a step's noise ("NOIS" in ASCII)."""

CHECKPOINT_S = 30.0
"""Seconds between two checkpoints."""

HALF = torch.bfloat16
"""Type of the products and sums of training where a recipe says `half`; parameters and losses are float32."""


@dataclass(frozen=True)
class Recipe:
    """All choices of a baseline's training.

    `crop` and `batch`: what a step sees; `shrink` averages squares of so many pixels first; `tiles` takes
    crops from a grid, else from anywhere; `half`: see [`HALF`]. `features`: what the network is given.
    """

    method: str
    steps: int
    batch: int
    crop: int
    learning_rate: float
    features: tuple[str, ...] = ("color",)
    shrink: int = 1
    tiles: bool = False
    half: bool = False
    width: int = 64
    seed: int = 0


class Method(Protocol):
    """Networks by name, optimisers by name, and what a step does with noisy and clean crops (N, C, H, W)."""

    networks: Mapping[str, torch.nn.Module]
    optimizers: Mapping[str, torch.optim.Optimizer]

    def step(self, noisy: Tensor, clean: Tensor, generator: torch.Generator, share: float) -> float:
        """Do one step, at this share of the recipe's learning rate; return its loss."""


@dataclass(frozen=True)
class Examples:
    """Pictures that are trained on: noisy (F, C, H, W) and clean (F, 3, H, W), display-encoded.

    They may lie in files: a thousand large ones do not fit into memory.
    """

    noisy: NDArray[np.float32]
    clean: NDArray[np.float32]
    digest: str


def planes(frame: Frame, features: Sequence[str]) -> Tensor:
    """Return the feature images of a frame (1, C, H, W)."""
    image = dataset.feature_image(frame, features, Normalization())
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(image, -1, 0)))[None]


def examples(recipe: Recipe, files: Sequence[tuple[Path, Path]], folder: Path) -> Examples:
    """Return the pictures of the files of noisy frames and references, shrunk as the recipe says.

    They are kept in the folder as arrays, under the names of the files, which end in their checksums. The
    digest is that of the arrays: layers that are not looked at do not count.
    """
    names = [[path.name for path in pair] for pair in files]
    text = json.dumps([names, recipe.features, recipe.shrink])
    digest = hashlib.sha256(text.encode()).hexdigest()[:DIGITS]
    folder.mkdir(parents=True, exist_ok=True)
    kept, sums = [], []
    for kind, features in enumerate((recipe.features, ("color",))):
        path = folder / f"examples-{digest}-{('noisy', 'clean')[kind]}.npy"
        known = path.with_suffix(".sha256")
        if not (path.exists() and known.exists()):
            with replacing(path) as new:
                found = _stack(new, [pair[kind] for pair in files], features, recipe.shrink)
            write_text(known, found)
        kept.append(np.load(path, mmap_mode="r"))
        sums.append(known.read_text(encoding="utf-8"))
    noisy, clean = kept
    if min(noisy.shape[2:]) < recipe.crop:
        size = f"{noisy.shape[3]}x{noisy.shape[2]}"
        rule = f"crops of {recipe.crop} pixels must fit into them"
        raise InputError("size of the training pictures", size, rule, "render larger ones")
    return Examples(noisy, clean, hashlib.sha256("".join(sums).encode()).hexdigest())


def _stack(path: Path, files: Sequence[Path], features: Sequence[str], shrink: int) -> str:
    """Write the feature images of all files one after another, as (F, C, H, W); return their SHA-256."""
    array, digest = None, hashlib.sha256()
    for index, file in enumerate(files):
        image = shrunk(planes(read_frame(file), features), shrink).numpy()
        if array is None:
            shape = (len(files), *image.shape[1:])
            array = np.lib.format.open_memmap(path, mode="w+", dtype=np.float32, shape=shape)
        array[index] = image[0]
        digest.update(image.tobytes())
    return digest.hexdigest()


def shrunk(images: Tensor, factor: int) -> Tensor:
    """Return images (N, C, H, W) of means of squares of `factor` pixels; a rest at the border is left out."""
    return torch.nn.functional.avg_pool2d(images, factor) if factor > 1 else images


def draw(recipe: Recipe, step: int, data: Examples) -> tuple[Tensor, Tensor]:
    """Return the noisy and clean crops (batch, C, crop, crop) of a step."""
    frames, _, height, width = data.noisy.shape
    if recipe.tiles:
        rows, columns = height // recipe.crop, width // recipe.crop
        unit = recipe.crop
    else:
        rows, columns, unit = height - recipe.crop + 1, width - recipe.crop + 1, 1
    picks = dataset.sample_indices(recipe.seed, step, CROP_TAG, recipe.batch, frames * rows * columns)
    noisy, clean = [], []
    for pick in picks.tolist():
        frame, place = divmod(pick, rows * columns)
        y, x = (unit * n for n in divmod(place, columns))
        part = slice(y, y + recipe.crop), slice(x, x + recipe.crop)
        noisy.append(data.noisy[frame][(slice(None), *part)])
        clean.append(data.clean[frame][(slice(None), *part)])
    return torch.from_numpy(np.stack(noisy)), torch.from_numpy(np.stack(clean))


def generator_of(seed: int, step: int) -> torch.Generator:
    """Return the generator of a step's noise: a function of seed and step alone."""
    words = random_block(*(counter(np.array([n])) for n in (seed, step, 0, NOISE_TAG)))
    high, low = (int(word[0]) for word in words[:2])
    return torch.Generator().manual_seed(high << 32 | low)


def path_of(folder: Path, recipe: Recipe, data: Examples) -> Path:
    """Return the file of the finished networks."""
    text = json.dumps([asdict(recipe), data.digest, torch.__version__])
    return folder / f"{recipe.method}-{hashlib.sha256(text.encode()).hexdigest()[:DIGITS]}.safetensors"


def fit(
    method: Method, recipe: Recipe, data: Examples, folder: Path, until: int | None = None
) -> dict[str, Any]:
    """Train the method's networks in place, up to step `until` (all by default); return the facts of the run.

    Networks that are finished are read, a run that was interrupted goes on.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = path_of(folder, recipe, data)
    if path.exists() and path.with_suffix(".json").exists():
        _put(method, load_file(path))
        facts: dict[str, Any] = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        return facts
    checkpoint = path.with_suffix(".checkpoint")
    done, seconds, history = _load(method, checkpoint)
    end = recipe.steps if until is None else min(until, recipe.steps)
    begun = kept = time.perf_counter()

    def spent() -> float:
        return seconds + time.perf_counter() - begun

    with (
        hint_on_interrupt(lambda: f"the same command goes on where it was, in {folder}"),
        progress(f"training {recipe.method}", end - done) as advance,
    ):
        for step in range(done, end):
            with whole_steps() as interrupted:
                history.append(_one(method, recipe, data, step))
            done = step + 1
            advance(1)
            if interrupted or done == end < recipe.steps or time.perf_counter() - kept > CHECKPOINT_S:
                _save(method, checkpoint, done, spent(), history)
                kept = time.perf_counter()
            if interrupted:
                raise KeyboardInterrupt
    facts = {"recipe": asdict(recipe), "seconds": spent(), "steps_done": done, "history": history}
    facts |= {"parameters": sizes(method), "torch": torch.__version__, "data_digest": data.digest}
    if done == recipe.steps:
        with replacing(path) as new:
            save_file(_parts(method), new)
        write_text(path.with_suffix(".json"), json.dumps(facts) + "\n")
        checkpoint.unlink(missing_ok=True)
    return facts


def seconds_a_step(method: Method, recipe: Recipe, data: Examples) -> float:
    """Do a step of a method that nothing else uses; return its seconds."""
    begun = time.perf_counter()
    _one(method, recipe, data, 0)
    return time.perf_counter() - begun


@contextmanager
def whole_steps() -> Iterator[list[int]]:
    """Put Ctrl-C off until the block is done: half a step could not be gone on with. Yield what came."""
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield came
    finally:
        signal.signal(signal.SIGINT, before)


def _one(method: Method, recipe: Recipe, data: Examples, step: int) -> float:
    """Do a step, or say that its loss is not finite."""
    noisy, clean = draw(recipe, step, data)
    share = 0.5 * (1.0 + float(np.cos(np.pi * step / recipe.steps)))
    with torch.autocast("cpu", dtype=HALF, enabled=recipe.half):
        loss = method.step(noisy, clean, generator_of(recipe.seed, step), share)
    if not np.isfinite(loss):
        raise TrainingError(
            f"loss of {recipe.method} at step {step} is {loss}: it must stay finite; lower the learning rate "
            f"({recipe.learning_rate}) or check the frames"
        )
    return loss


def sizes(method: Method) -> dict[str, int]:
    """Return the number of parameters that training moves, of each network."""
    return {name: sum(p.numel() for p in net.parameters()) for name, net in method.networks.items()}


def follow(optimizer: torch.optim.Optimizer, loss: Tensor, rate: float) -> None:
    """Do a step of an optimiser at a learning rate."""
    for group in optimizer.param_groups:
        group["lr"] = rate
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    optimizer.step()


def _parts(method: Method) -> dict[str, Tensor]:
    """Return all tensors of all networks, those that no gradient moves included."""
    return {
        f"{name}.{key}": value.contiguous()
        for name, net in method.networks.items()
        for key, value in net.state_dict().items()
    }


def _put(method: Method, tensors: Mapping[str, Tensor]) -> None:
    """Set all tensors of all networks."""
    for name, net in method.networks.items():
        mine = {k.removeprefix(f"{name}."): v for k, v in tensors.items() if k.startswith(f"{name}.")}
        net.load_state_dict(mine)


def _save(method: Method, path: Path, done: int, seconds: float, history: list[float]) -> None:
    """Write a checkpoint, all of it or nothing."""
    optimizers = {name: found.state_dict() for name, found in method.optimizers.items()}
    state = {"networks": _parts(method), "optimizers": optimizers}
    with replacing(path) as new:
        torch.save({**state, "done": done, "seconds": seconds, "history": history}, new)


def _load(method: Method, path: Path) -> tuple[int, float, list[float]]:
    """Set networks and optimisers from a checkpoint, if there is one; return its steps, seconds, losses."""
    if not path.exists():
        return 0, 0.0, []
    try:
        state = torch.load(path, weights_only=True)
    except Exception as error:  # noqa: BLE001 - the package's errors for damaged files vary
        rule = f"it cannot be read ({type(error).__name__})"
        raise InputError("checkpoint", str(path), rule, "remove it: training starts anew") from None
    _put(method, state["networks"])
    for name, optimizer in method.optimizers.items():
        optimizer.load_state_dict(state["optimizers"][name])
    return state["done"], state["seconds"], state["history"]
