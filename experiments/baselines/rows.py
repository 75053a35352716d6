"""The rows of Table 1: every way to denoise, made ready for one seed, on common frames.

1. A bench renders and keeps what all rows share: training frames, and cases to be judged on [`Bench`].
2. A row is made ready for a seed: trained, or tuned on a training frame, or opened [`ROWS`].
3. What is ready turns a case into a picture, display-encoded, and its radiance where it has one [`Ready`].

A new row is a function and a line in [`ROWS`]. PyTorch and Open Image Denoise are imported by the rows that
use them; without them these rows say so.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from lab import frames, training
from lab.frames import Shot

from wamnet.cli import exr
from wamnet.cli.packages import need
from wamnet.kernels import denoise_on
from wamnet.kernels.denoise_on import images_of
from wamnet.kernels.executor import Executor
from wamnet.refimpl import metrics
from wamnet.refimpl.denoise import Model, denoise
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.scenes import TURN_SECONDS
from wamnet.refimpl.train import BEST, PAPER, SHORT, Recipe

from . import atrous

TEST_SEED = 1_000_000
"""Seeds of test frames begin here, those of training frames at 0: none is used twice."""

RENDER_SEED = 2_000_000
"""Seeds of renders of more samples begin here."""

SEEDS_APART = 10_000
"""Frames of one seed: the noise of another one begins so many seeds later."""

Picture = tuple[Floats, Floats | None]
"""Display-encoded colour (H, W, 3) in [0, 1], and linear radiance where it is known."""


@dataclass(frozen=True)
class Scale:
    """Sizes: pixels, frames, samples, and the length of each training."""

    size: int
    train: int
    test: int
    train_spp: int
    test_spp: int
    ladder: tuple[int, ...]
    short_frames: int
    paper: Mapping[str, Any] = field(default_factory=dict)
    short: Mapping[str, Any] = field(default_factory=dict)
    dncnn: Mapping[str, Any] = field(default_factory=dict)
    shrunk: Mapping[str, Any] = field(default_factory=dict)
    pix2pix: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """A frame to be denoised, its reference, and which one it is."""

    noisy: Frame
    reference: Frame
    index: int
    seed: int


@dataclass(frozen=True)
class Ready:
    """A way that is made ready: `picture` of a case, and facts: parameters, seconds of training, choices.

    `seconds`: how long a picture takes, if calling `picture` says something else; `step`: how long a step of
    its training takes; `rays`: the camera rays that the features of its cases are means over, if not one.
    """

    picture: Callable[[Case], Picture]
    facts: Mapping[str, Any] = field(default_factory=dict)
    seconds: Callable[[Case], float] | None = None
    step: Callable[[], float] | None = None
    rays: int = 0


@dataclass(frozen=True)
class Bench:
    """What all rows share: the scale, the folder of frames and networks, what renders and denoises."""

    scale: Scale
    cache: Path
    device: Executor
    scene: str = "minicubes"

    @property
    def executor(self) -> str:
        """Return the executor's name."""
        return self.device.name

    def times(self) -> tuple[list[float], list[float]]:
        """Return the times of training and of test frames."""
        return frames.split_times(self.scale.train, self.scale.test, TURN_SECONDS)

    def train_files(self, seed: int, every: int = 1, rays: int = 0) -> list[tuple[Path, Path]]:
        """Return noisy frame and reference of every so many of the training times; noise is the seed's."""
        shots = self._shots(self.times()[0], 0)[::every]
        noisy = [self._noisy(shot, seed, rays) for shot in shots]
        clean = [frames.reference(s, self.scale.train_spp) for s in shots]
        return list(zip(self._files(noisy), self._files(clean), strict=True))

    def train_pairs(self, seed: int, count: int, rays: int = 0) -> list[frames.Pair]:
        """Return about so many training pairs, evenly over the animation: the first one first."""
        every = -(-self.scale.train // count)
        return [(exr.read_frame(n), exr.read_frame(c)) for n, c in self.train_files(seed, every, rays)]

    def cases(self, seed: int, rays: int = 0) -> Iterator[Case]:
        """Yield the test frames with the seed's noise, one after another: all may be too many to keep."""
        shots = self._shots(self.times()[1], TEST_SEED)
        noisy = [self._noisy(shot, seed, rays) for shot in shots]
        clean = [frames.reference(s, self.scale.test_spp) for s in shots]
        found = zip(self._files(noisy), self._files(clean), strict=True)
        for index, (dirty, reference) in enumerate(found):
            yield Case(exr.read_frame(dirty), exr.read_frame(reference), index, seed)

    def renders(self, spp: int, seed: int) -> list[Path]:
        """Return the files of renders of the test frames with so many samples."""
        shots = self._shots(self.times()[1], RENDER_SEED + SEEDS_APART * seed)
        return self._files([replace(shot, spp=spp, seed=2 * shot.seed) for shot in shots])

    def _noisy(self, shot: Shot, seed: int, rays: int) -> Shot:
        """Return a shot's noisy one, with the seed's noise and features of so many camera rays."""
        return replace(frames.noisy(shot), seed=2 * (shot.seed + SEEDS_APART * seed), feature_spp=rays)

    def _shots(self, times: Sequence[float], first: int) -> list[Shot]:
        """Return a shot of each time, with seeds from `first` on."""
        return [Shot(self.scene, t, self.scale.size, seed=first + n) for n, t in enumerate(times)]

    def _files(self, shots: Sequence[Shot]) -> list[Path]:
        """Return the files of shots."""
        return frames.render_all(self.cache / "frames", shots, self.executor)


# ---- nothing, and more samples ----------------------------------------------------------------------------


def as_it_is(bench: Bench, seed: int) -> Ready:
    """Show the noisy frame."""
    return Ready(lambda case: (to_display(case.noisy["color"]), case.noisy["color"]))


def more_samples(spp: int, bench: Bench, seed: int) -> Ready:
    """Show a render of more samples."""
    files = bench.renders(spp, seed)

    def picture(case: Case) -> Picture:
        color = exr.read_frame(files[case.index])["color"]
        return to_display(color), color

    return Ready(picture)


# ---- WAMnet ----------------------------------------------------------------------------------------------


def wamnet(base: Recipe, kind: str, bench: Bench, seed: int, rays: int = 0) -> Ready:
    """Train WAMnet: the paper's recipe on one pair, the project's on more; features of so many rays."""
    count = 1 if kind == "paper" else bench.scale.short_frames
    pairs = bench.train_pairs(seed, count, rays)[:count]
    recipe = replace(base, seed=seed, **getattr(bench.scale, kind))
    model, spent = training.trained(recipe, pairs, bench.cache / "networks", bench.executor)
    facts = {"parameters": parameters(model), "training_s": spent, "steps": recipe.steps}
    facts |= {"training_frames": len(pairs)}
    step = partial(training.seconds_a_step, recipe, pairs, bench.device)
    seconds = partial(_network_seconds, bench, model)
    return Ready(partial(_by_network, bench, model), facts, seconds, step, rays)


def _by_network(bench: Bench, model: Model, case: Case) -> Picture:
    """Return a network's picture, made by the bench's device."""
    if bench.executor == "numpy":
        return denoise(model, case.noisy), None
    return denoise_on(bench.device, model, case.noisy).image, None


def _network_seconds(bench: Bench, model: Model, case: Case) -> float:
    """Return the seconds of a frame: features encoded, images to the device, kernel, result back."""
    begun = time.perf_counter()
    images_of(model, case.noisy)
    encoded = time.perf_counter() - begun
    return encoded + denoise_on(bench.device, model, case.noisy).seconds_run


def parameters(model: Model) -> int:
    """Return the number of weights and biases."""
    return sum(array.size for array in (*model.siren.weights, *model.siren.biases))


def on_its_own_frame(bench: Bench, seed: int) -> Ready:
    """Show what the paper's recipe makes of the frame that it was trained on, with that frame's noise."""
    ready = wamnet(PAPER, "paper", bench, seed)
    ((noisy, clean),) = bench.train_pairs(seed, 1)[:1]
    own = Case(noisy, clean, -1, seed)
    return Ready(ready.picture, {**ready.facts, "case": own})


# ---- the paper's baselines -------------------------------------------------------------------------------


def dncnn(kind: str, bench: Bench, seed: int) -> Ready:
    """Train DnCNN on all training frames."""
    need("torch", "for DnCNN", "baselines")
    from . import dncnn as module
    from .fitting import Recipe, examples, fit, seconds_a_step

    recipe = Recipe("dncnn", learning_rate=1e-3, seed=seed, **getattr(bench.scale, kind))
    data = examples(recipe, bench.train_files(seed), bench.cache / "networks")
    made = module.DnCNN(recipe)
    run = fit(made, recipe, data, bench.cache / "networks")
    facts = {"parameters": run["parameters"]["dncnn"], "training_s": run["seconds"], "steps": recipe.steps}
    step = partial(seconds_a_step, module.DnCNN(recipe), recipe, data)
    return Ready(lambda case: (made.picture(case.noisy), None), facts, step=step)


def pix2pix(bench: Bench, seed: int) -> Ready:
    """Train pix2pix on patches of all training frames; its parameters are those of the generator."""
    need("torch", "for pix2pix", "baselines")
    from . import pix2pix as module
    from .fitting import Recipe, examples, fit, seconds_a_step

    chosen = {"features": ("color", "normal"), "tiles": True, **bench.scale.pix2pix}
    recipe = Recipe("pix2pix", learning_rate=2e-4, seed=seed, **chosen)
    data = examples(recipe, bench.train_files(seed), bench.cache / "networks")
    made = module.Pix2pix(recipe)
    run = fit(made, recipe, data, bench.cache / "networks")
    facts = {"parameters": run["parameters"]["generator"], "training_s": run["seconds"]}
    facts |= {"parameters_of_discriminator": run["parameters"]["discriminator"], "steps": recipe.steps}
    step = partial(seconds_a_step, module.Pix2pix(recipe), recipe, data)
    return Ready(lambda case: (made.picture(case.noisy), None), facts, step=step)


# ---- what today's users would ask for ---------------------------------------------------------------------


def open_image_denoise(aux: str, bench: Bench, seed: int) -> Ready:
    """Open Intel's denoiser: without albedo and normal, with those of the noisy frame, or with clean ones."""
    need("pyoidn", "for Open Image Denoise", "baselines")
    from wamnet.kernels.bench.peer_oidn import filtered

    def picture(case: Case) -> Picture:
        guide = {"none": None, "noisy": case.noisy, "clean": case.reference}[aux]
        color = filtered(case.noisy, guide, clean=aux == "clean")
        return to_display(color), color

    return Ready(picture)


def svgf(bench: Bench, seed: int) -> Ready:
    """Open the a-trous filter, with the settings that suit a training frame best."""
    ((noisy, clean),) = bench.train_pairs(seed, 1)[:1]
    target = to_display(clean["color"])
    choices = [
        atrous.Settings(sigma_luminance=luminance, sigma_normal=normal)
        for luminance, normal in itertools.product((1.0, 2.0, 4.0, 8.0), (8.0, 32.0, 128.0))
    ]
    best = min(choices, key=lambda s: metrics.mse(to_display(atrous.denoise(noisy, s)), target))

    def picture(case: Case) -> Picture:
        color = atrous.denoise(case.noisy, best)
        return to_display(color), color

    return Ready(picture, {"chosen": {"luminance": best.sigma_luminance, "normal": best.sigma_normal}})


def non_local_means(bench: Bench, seed: int) -> Ready:
    """Open scikit-image's non-local means, with the strength that suits a training frame best."""
    restoration = need("skimage.restoration", "for non-local means", "experiments")

    def filtered(frame: Frame, strength: float) -> Floats:
        noisy = to_display(frame["color"].astype(np.float64))
        found = restoration.denoise_nl_means(
            noisy, patch_size=5, patch_distance=6, h=strength, fast_mode=True, channel_axis=-1
        )
        clipped: Floats = np.clip(found, 0.0, 1.0)
        return clipped

    ((noisy, clean),) = bench.train_pairs(seed, 1)[:1]
    target = to_display(clean["color"])
    best = min((0.1, 0.2, 0.3, 0.4, 0.6), key=lambda h: metrics.mse(filtered(noisy, h), target))
    return Ready(lambda case: (filtered(case.noisy, best), None), {"chosen": {"h": best}})


# ---- the table -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """A row: what it is called in the table, how it is made ready, which packages it needs."""

    text: str
    make: Callable[[Bench, int], Ready]
    packages: tuple[str, ...] = ()

    @property
    def missing(self) -> list[str]:
        """Return the packages that are not installed."""
        return [name for name in self.packages if find_spec(name) is None]


ROWS: Mapping[str, Row] = {
    "input": Row("input, 1 spp", as_it_is),
    "dncnn": Row("DnCNN", partial(dncnn, "dncnn"), ("torch",)),
    "dncnn-shrunk": Row("DnCNN, trained on frames a quarter as large", partial(dncnn, "shrunk"), ("torch",)),
    "wamnet-color": Row(
        "WAMnet without normals, preset `paper`",
        partial(wamnet, replace(PAPER, features=("color",)), "paper"),
    ),
    "wamnet": Row("WAMnet, preset `paper`", partial(wamnet, PAPER, "paper")),
    "wamnet-own": Row("the same, on the frame it was trained on", on_its_own_frame),
    "wamnet-short": Row("WAMnet, preset `short`", partial(wamnet, SHORT, "short")),
    "wamnet-best": Row(
        "WAMnet, preset `best`, features of 16 camera rays", partial(wamnet, BEST, "short", rays=16)
    ),
    "pix2pix": Row("pix2pix", pix2pix, ("torch",)),
    "oidn": Row("Open Image Denoise", partial(open_image_denoise, "none"), ("pyoidn",)),
    "oidn-noisy": Row("the same, with albedo and normal", partial(open_image_denoise, "noisy"), ("pyoidn",)),
    "oidn-clean": Row("the same, with clean ones", partial(open_image_denoise, "clean"), ("pyoidn",)),
    "svgf": Row("SVGF's spatial filter (a-trous)", svgf),
    "nlm": Row("non-local means", non_local_means, ("skimage",)),
    "render30": Row("render, 30 spp", partial(more_samples, 30)),
}
"""All rows by name, in the order of the table: a new one is a function and a line here."""
