"""Training a baseline in PyTorch until its validation error is flat; it can be stopped after any step.

1. Examples are crops of display-encoded pictures, or tiles of them [`Examples`]. What a step draws depends
   only on the seed and the step [`draw`]; so does all other noise [`generator_of`].
2. A step is the method's own [`Method.step`]: losses, gradients, optimisers.
3. Every so many steps the network denoises validation pictures, which are neither trained on nor reported
   [`validated`]. Where the best PSNR of the last third of these looks is less than [`FLAT_DB`] above the best
   one before, the curve is flat [`flat`]: the learning rate falls to its next share in [`RATES`], and the
   training ends after the last one. The network that is kept is the best of all looks.
4. A checkpoint holds networks, optimisers and the curve [`fit`]; the finished networks are safetensors, with
   their recipe, the curve and the seconds of their training as JSON beside them. Neither is committed. A
   training that met its largest number of steps before the curve was flat says so: `flat` is false.

Sources: those of the methods. Sampling is that of refimpl/network/dataset.py. Rates that fall where progress
ends are those of He, Zhang, Ren, Sun, "Deep Residual Learning for Image Recognition", CVPR 2016, section 3.4.
"""

import hashlib
import json
import os
import signal
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from lab.frames import DIGITS
from numpy.typing import NDArray
from safetensors.torch import load_file, save_file

from wamnet.cli.common.terminal import hint_on_interrupt, progress
from wamnet.cli.files.exr import read_frame
from wamnet.cli.files.outputs import replacing, write_text
from wamnet.refimpl import metrics
from wamnet.refimpl.errors import InputError, TrainingError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.rng import counter, random_block

from .recipe import Recipe

Tensor = torch.Tensor

CROP_TAG = 0x43524F50
"""Counter `block` of the words that choose crops ("CROP" in ASCII)."""

NOISE_TAG = 0x4E4F4953
"""Counter `block` of the words that seed a step's noise ("NOIS" in ASCII)."""

CHECKPOINT_S = 30.0
"""Seconds between two checkpoints."""

RATES = (1.0, 0.1)
"""Shares of the recipe's learning rate, one after another."""

FLAT_DB = 0.05
"""A curve whose last third gains less than this is flat: a tenth of the differences that the table shows."""

FEWEST_LOOKS = 12
"""Looks at one rate before it can be called flat: the last third then has four."""

VALIDATION_PX = 512
"""Largest side of a validation picture; of a larger one its middle is taken, since a look costs time."""

HALF = torch.bfloat16
"""Type of the products and sums of training where a recipe says `half`; parameters and losses are float32."""


class Method(Protocol):
    """Networks by name, optimisers by name, and what a step does with noisy and clean crops (N, C, H, W)."""

    networks: Mapping[str, torch.nn.Module]
    optimizers: Mapping[str, torch.optim.Optimizer]

    def step(self, noisy: Tensor, clean: Tensor, generator: torch.Generator, share: float) -> float:
        """Do one step, at this share of the recipe's learning rate; return its loss."""

    def denoised(self, noisy: Tensor) -> Tensor:
        """Return the pictures (N, 3, H, W) in [0, 1] of feature images (N, C, H, W)."""


@dataclass(frozen=True)
class Look:
    """The mean PSNR of the validation pictures after so many steps, and the share of the rate before it."""

    step: int
    psnr: float
    share: float
    seconds: float


@dataclass
class Progress:
    """How far a training is: steps, seconds, losses, looks, and the networks of the best look."""

    done: int = 0
    seconds: float = 0.0
    history: list[float] = field(default_factory=list)
    curve: list[Look] = field(default_factory=list)
    best: dict[str, Tensor] = field(default_factory=dict)

    @property
    def stage(self) -> int:
        """Return the number of rates after which the curve was flat."""
        found = 0
        while found < len(RATES) and flat([look.psnr for look in self.curve if look.share == RATES[found]]):
            found += 1
        return found


@dataclass(frozen=True)
class Examples:
    """Pictures that are trained on, or looked at: noisy (F, C, H, W) and clean (F, 3, H, W), display-encoded.

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
    """Return the generator of a step's noise, which depends only on seed and step."""
    words = random_block(*(counter(np.array([n])) for n in (seed, step, 0, NOISE_TAG)))
    high, low = (int(word[0]) for word in words[:2])
    return torch.Generator().manual_seed(high << 32 | low)


def flat(psnr: Sequence[float]) -> bool:
    """Tell whether the best of the last third is less than [`FLAT_DB`] above the best one before."""
    if len(psnr) < FEWEST_LOOKS:
        return False
    last = len(psnr) - len(psnr) // 3
    return max(psnr[last:]) - max(psnr[:last]) < FLAT_DB


def validated(method: Method, recipe: Recipe, data: Examples) -> float:
    """Return the mean PSNR, in dB, of what the networks make of the middles of validation pictures."""
    found = []
    for noisy, clean in zip(data.noisy, data.clean, strict=True):
        size = min(VALIDATION_PX, *noisy.shape[1:])
        # For pix2pix, whose pictures are tiled with patches: the middle is made of whole patches.
        size -= size % recipe.crop if recipe.tiles else 0
        y, x = ((side - size) // 2 for side in noisy.shape[1:])
        part = slice(None), slice(y, y + size), slice(x, x + size)
        with torch.no_grad(), torch.autocast("cpu", dtype=HALF, enabled=recipe.half):
            made = method.denoised(torch.from_numpy(np.array(noisy[part]))[None])
        found.append(metrics.psnr(made[0].float().clamp(0.0, 1.0).numpy(), np.array(clean[part])))
    return float(np.mean(found))


def use_all_cores() -> int:
    """Let PyTorch use every processor that this process may use, as all else does; return their number."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    torch.set_num_threads(count)
    return count


def path_of(folder: Path, recipe: Recipe, data: Examples, validation: Examples) -> Path:
    """Return the file of the finished networks; a larger number of steps is no other training."""
    text = json.dumps(
        [asdict(replace(recipe, steps=0)), data.digest, validation.digest, torch.__version__, RATES]
    )
    return folder / f"{recipe.method}-{hashlib.sha256(text.encode()).hexdigest()[:DIGITS]}.safetensors"


def fit(
    method: Method,
    recipe: Recipe,
    data: Examples,
    validation: Examples,
    folder: Path,
    until: int | None = None,
) -> dict[str, Any]:
    """Train the method's networks in place until they are flat; return the facts of the run.

    `until`: stop after so many steps, to resume later. Networks that are finished are read; a run that was
    interrupted resumes, and so does one that may do more steps than it did and was not flat.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = path_of(folder, recipe, data, validation)
    if path.exists() and path.with_suffix(".json").exists():
        facts: dict[str, Any] = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        if facts["flat"] or facts["steps_done"] >= recipe.steps:
            _put(method, load_file(path))
            return facts
    checkpoint = path.with_suffix(".checkpoint")
    run = _load(method, checkpoint)
    with hint_on_interrupt(lambda: f"the same command resumes where it was, in {folder}"):
        _advance(method, recipe, (data, validation), run, checkpoint, until)
    found = _facts(method, recipe, (data, validation), run)
    if run.done == recipe.steps or found["flat"]:
        _put(method, run.best)
        with replacing(path) as new:
            save_file(_parts(method), new)
        write_text(path.with_suffix(".json"), json.dumps(found) + "\n")
    if found["flat"]:
        checkpoint.unlink(missing_ok=True)
    return found


def _advance(
    method: Method,
    recipe: Recipe,
    data: tuple[Examples, Examples],
    run: Progress,
    checkpoint: Path,
    until: int | None,
) -> None:
    """Do steps until the curve is flat, or there are enough of them; keep a checkpoint now and then."""
    end = recipe.steps if until is None else min(until, recipe.steps)
    begun, before, kept = time.perf_counter(), run.seconds, time.perf_counter()
    stage = run.stage
    with progress(f"training {recipe.method}, at most", end - run.done) as advance:
        while run.done < end and stage < len(RATES):
            with whole_steps() as interrupted:
                run.history.append(_one(method, recipe, data[0], run.done, RATES[stage]))
                run.done += 1
                run.seconds = before + time.perf_counter() - begun
                if run.done % recipe.every == 0 or run.done == recipe.steps:
                    _look(method, recipe, data[1], run, RATES[stage])
                    stage = run.stage
            advance(1)
            over = run.done == end or stage == len(RATES)
            if interrupted or over or time.perf_counter() - kept > CHECKPOINT_S:
                _save(method, checkpoint, run)
                kept = time.perf_counter()
            if interrupted:
                raise KeyboardInterrupt


def _look(method: Method, recipe: Recipe, validation: Examples, run: Progress, share: float) -> None:
    """Add a look to the curve; keep the networks if it is the best one."""
    psnr = validated(method, recipe, validation)
    if not run.curve or psnr > max(look.psnr for look in run.curve):
        run.best = {name: tensor.clone() for name, tensor in _parts(method).items()}
    run.curve.append(Look(run.done, psnr, share, run.seconds))


def _facts(method: Method, recipe: Recipe, data: tuple[Examples, Examples], run: Progress) -> dict[str, Any]:
    """Return what is kept beside the networks."""
    facts = {"recipe": asdict(recipe), "seconds": run.seconds, "steps_done": run.done}
    facts |= {"flat": run.stage == len(RATES), "curve": [asdict(look) for look in run.curve]}
    facts |= {"history": run.history, "parameters": sizes(method), "torch": torch.__version__}
    return {**facts, "threads": torch.get_num_threads(), "digests": [each.digest for each in data]}


def seconds_a_step(method: Method, recipe: Recipe, data: Examples) -> float:
    """Do a step of a method that nothing else uses; return its seconds."""
    begun = time.perf_counter()
    _one(method, recipe, data, 0, RATES[0])
    return time.perf_counter() - begun


@contextmanager
def whole_steps() -> Iterator[list[int]]:
    """Put Ctrl-C off until the block is done: a run cannot resume in mid-step. Yield what came."""
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield came
    finally:
        signal.signal(signal.SIGINT, before)


def _one(method: Method, recipe: Recipe, data: Examples, step: int, share: float) -> float:
    """Do a step at a share of the learning rate, or say that its loss is not finite."""
    noisy, clean = draw(recipe, step, data)
    with torch.autocast("cpu", dtype=HALF, enabled=recipe.half):
        loss = method.step(noisy, clean, generator_of(recipe.seed, step), share)
    if not np.isfinite(loss):
        raise TrainingError(
            f"loss of {recipe.method} at step {step} {loss}: must stay finite; lower the learning rate "
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


def _save(method: Method, path: Path, run: Progress) -> None:
    """Write a checkpoint, all of it or nothing."""
    optimizers = {name: found.state_dict() for name, found in method.optimizers.items()}
    state = {"networks": _parts(method), "optimizers": optimizers}
    with replacing(path) as new:
        torch.save({**state, **vars(run), "curve": [asdict(look) for look in run.curve]}, new)


def _load(method: Method, path: Path) -> Progress:
    """Set networks and optimisers from a checkpoint, if there is one; return how far it is."""
    if not path.exists():
        return Progress()
    try:
        state = torch.load(path, weights_only=True)
    except Exception as error:  # noqa: BLE001 - the package's errors for damaged files vary
        rule = f"cannot be read: {type(error).__name__}"
        raise InputError("checkpoint", str(path), rule, "remove it: training starts again") from None
    _put(method, state.pop("networks"))
    for name, found in state.pop("optimizers").items():
        method.optimizers[name].load_state_dict(found)
    return Progress(**{**state, "curve": [Look(**look) for look in state["curve"]]})
