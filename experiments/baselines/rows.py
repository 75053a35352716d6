"""The rows of Table 1: every way to denoise, made ready for one seed, on common frames.

1. Training, validation and test frames are shots of one scene, each with a geometry of its own [`split_of`],
   which is checked [`compared`].
2. A bench renders and keeps what all rows share: training frames, and cases to be judged on [`Bench`].
3. A row is made ready for a seed: trained, or tuned on a training frame, or opened [`ROWS`].
4. What is ready turns a case into a picture, display-encoded, and its radiance where it has one, and says
   what the rendering of its input costs [`Ready`].

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
from typing import TYPE_CHECKING, Any

import numpy as np
from lab import frames, training
from lab.frames import Shot

from wamnet.cli.common.packages import need
from wamnet.cli.files import exr
from wamnet.kernels import denoise_on
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.run.denoise_on import images_of
from wamnet.models.data import draws, geometry
from wamnet.models.data.geometry import Shown
from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import from_display, to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.light.scenes import TURN_SECONDS
from wamnet.refimpl.network.denoise import Model, denoise
from wamnet.refimpl.network.train import BEST, PAPER, SHORT, Recipe

from . import atrous

if TYPE_CHECKING:
    from .fitting import Method

VALIDATION_SEED = 500_000
"""Seeds of validation frames begin here, those of training frames at 0: none is used twice."""

TEST_SEED = 1_000_000
"""Seeds of test frames begin here."""

RENDER_SEED = 2_000_000
"""Seeds of renders of more samples begin here."""

SEEDS_APART = 10_000
"""Frames of one seed: the noise of another one begins so many seeds later."""

TIMES_SEED = 1
"""Where the sequence of times begins."""

EQUAL_RAYS, EQUAL_SPP = 16, 3
"""Camera rays of one sample's features, and the samples whose rendering costs no less than both together."""

TUNED_PX = 256
"""Largest side of the middle of a training frame that a filter is tuned on."""

Picture = tuple[Floats, Floats | None]
"""Display-encoded colour (H, W, 3) in [0, 1], and linear radiance where it is known."""


@dataclass(frozen=True)
class Scale:
    """Sizes: pixels, frames, samples, and the length of each training; `few`: seeds of the costly rows."""

    size: int
    train: int
    validation: int
    test: int
    train_spp: int
    validation_spp: int
    test_spp: int
    ladder: tuple[int, ...]
    short_frames: int
    few: tuple[int, ...] = (0, 1, 2)
    paper: Mapping[str, Any] = field(default_factory=dict)
    short: Mapping[str, Any] = field(default_factory=dict)
    dncnn: Mapping[str, Any] = field(default_factory=dict)
    shrunk: Mapping[str, Any] = field(default_factory=dict)
    pix2pix: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Split:
    """Shots to train on, to look at while training, and to judge by."""

    train: tuple[Shot, ...]
    validation: tuple[Shot, ...]
    test: tuple[Shot, ...]


def split_of(scale: Scale, scene: str = "minicubes") -> Split:
    """Return shots at times of the golden-ratio sequence over a turn, one kind after another."""
    kinds = ((scale.train, 0), (scale.validation, VALIDATION_SEED), (scale.test, TEST_SEED))
    found, first = [], 0
    for count, seed in kinds:
        times = draws.times(TIMES_SEED, 0.0, TURN_SECONDS, first, count)
        found.append(tuple(Shot(scene, t, scale.size, seed=seed + k) for k, t in enumerate(times)))
        first += count
    return Split(*found)


def compared(split: Split) -> dict[str, Any]:
    """Return times, and how far the nearest training shot is; refuse shots that look alike."""
    kinds = {"training": split.train, "validation": split.validation, "test": split.test}
    shown = {
        kind: [Shown(f"{kind} frame {n}", shot.time, shot.build()) for n, shot in enumerate(shots)]
        for kind, shots in kinds.items()
    }
    train = shown.pop("training")
    nearest = {kind: found.as_data() for kind, found in geometry.compare(train, shown).items()}
    return {"times_s": {kind: [s.time for s in shots] for kind, shots in kinds.items()}, "nearest": nearest}


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
    its training takes; `rays`: the camera rays that the features of its cases are means over, if not those of
    the colour's `spp`; `paid`: the samples and rays that its input costs, if not these. `cases`: those that
    it is judged on in place of the test frames; `ladder`: the shot whose renders it is compared with then.
    """

    picture: Callable[[Case], Picture]
    facts: Mapping[str, Any] = field(default_factory=dict)
    seconds: Callable[[Case], float] | None = None
    step: Callable[[], float] | None = None
    rays: int = 0
    spp: int = frames.NOISY_SPP
    paid: tuple[int, int] | None = None
    cases: Sequence[Case] = ()
    ladder: Shot | None = None

    @property
    def cost(self) -> tuple[int, int]:
        """Return samples and further camera rays a pixel that are rendered for its input."""
        return (self.spp, self.rays) if self.paid is None else self.paid


@dataclass(frozen=True)
class Bench:
    """What all rows share: the scale, the shots, the folder of frames and networks, what renders them."""

    scale: Scale
    cache: Path
    device: Executor
    split: Split

    @classmethod
    def of(cls, scale: Scale, cache: Path, device: Executor) -> Bench:
        """Return the bench of a scale."""
        return cls(scale, cache, device, split_of(scale))

    @property
    def executor(self) -> str:
        """Return the executor's name."""
        return self.device.name

    def files(
        self, shots: Sequence[Shot], target_spp: int, seed: int, rays: int = 0, spp: int = frames.NOISY_SPP
    ) -> list[tuple[Path, Path]]:
        """Return noisy frame and reference of each shot; noise is the seed's, the reference is not."""
        noisy = self._files([self.noisy(shot, seed, rays, spp) for shot in shots])
        return list(zip(noisy, self._files([frames.reference(s, target_spp) for s in shots]), strict=True))

    def train_files(self, seed: int) -> list[tuple[Path, Path]]:
        """Return noisy frame and reference of each training shot."""
        return self.files(self.split.train, self.scale.train_spp, seed)

    def validation_files(self, seed: int) -> list[tuple[Path, Path]]:
        """Return noisy frame and reference of each validation shot."""
        return self.files(self.split.validation, self.scale.validation_spp, seed)

    def own(self, seed: int) -> Shot:
        """Return the training shot that a network of one frame has for this seed."""
        return self.split.train[seed % len(self.split.train)]

    def pairs(self, shots: Sequence[Shot], seed: int, rays: int = 0) -> list[frames.Pair]:
        """Return the pairs of training shots."""
        found = self.files(shots, self.scale.train_spp, seed, rays)
        return [(exr.read_frame(noisy), exr.read_frame(clean)) for noisy, clean in found]

    def cases(self, seed: int, rays: int = 0, spp: int = frames.NOISY_SPP) -> Iterator[Case]:
        """Yield the test frames with the seed's noise, one after another: all may be too many to keep."""
        found = self.files(self.split.test, self.scale.test_spp, seed, rays, spp)
        for index, (noisy, reference) in enumerate(found):
            yield Case(exr.read_frame(noisy), exr.read_frame(reference), index, seed)

    def renders(self, shots: Sequence[Shot], spp: int, seed: int) -> list[Path]:
        """Return the files of renders of shots with so many samples."""
        apart = RENDER_SEED + SEEDS_APART * seed
        return self._files([replace(shot, spp=spp, seed=2 * (shot.seed + apart)) for shot in shots])

    def noisy(self, shot: Shot, seed: int, rays: int = 0, spp: int = frames.NOISY_SPP) -> Shot:
        """Return a shot's noisy one, with the seed's noise and features of so many camera rays."""
        return replace(shot, seed=2 * (shot.seed + SEEDS_APART * seed), feature_spp=rays, spp=spp)

    def _files(self, shots: Sequence[Shot]) -> list[Path]:
        """Return the files of shots."""
        return frames.render_all(self.cache / "frames", shots, self.executor)


# ---- nothing, and more samples ----------------------------------------------------------------------------


def as_it_is(bench: Bench, seed: int) -> Ready:
    """Show the noisy frame."""
    return Ready(lambda case: (to_display(case.noisy["color"]), case.noisy["color"]))


def more_samples(spp: int, own: bool, bench: Bench, seed: int) -> Ready:
    """Show a render of more samples: of the test frames, or of the one that a network is trained on."""
    shots = (bench.own(seed),) if own else bench.split.test
    files = bench.renders(shots, spp, seed)

    def picture(case: Case) -> Picture:
        color = exr.read_frame(files[case.index])["color"]
        return to_display(color), color

    return _on_own(bench, seed, Ready(picture, paid=(0, 0))) if own else Ready(picture, paid=(0, 0))


def _on_own(bench: Bench, seed: int, ready: Ready) -> Ready:
    """Return what is judged on the seed's training frame, with that frame's noise."""
    shot = bench.own(seed)
    ((noisy, clean),) = bench.pairs([shot], seed)
    facts = {name: value for name, value in ready.facts.items() if name != "training_s"}
    return replace(ready, facts=facts, cases=(Case(noisy, clean, 0, seed),), ladder=shot, step=None)


# ---- WAMnet ----------------------------------------------------------------------------------------------


def wamnet(base: Recipe, kind: str, bench: Bench, seed: int, rays: int = 0) -> Ready:
    """Train WAMnet: the paper's recipe on one pair, the project's on more; features of so many rays."""
    shots = [bench.own(seed)] if kind == "paper" else bench.split.train[: bench.scale.short_frames]
    pairs = bench.pairs(shots, seed, rays)
    recipe = replace(base, seed=seed, **getattr(bench.scale, kind))
    model, spent = training.trained(recipe, pairs, bench.cache / "networks", bench.executor)
    facts = {"parameters": parameters(model), "training_s": spent, "steps": recipe.steps}
    facts |= {"training_frames": len(pairs), "training_samples": len(pairs) * (1 + bench.scale.train_spp)}
    facts |= {"training_rays": len(pairs) * rays}
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


def on_its_own_frame(base: Recipe, bench: Bench, seed: int) -> Ready:
    """Show what the paper's recipe makes of the frame that it was trained on, with that frame's noise."""
    return _on_own(bench, seed, wamnet(base, "paper", bench, seed))


# ---- the paper's baselines -------------------------------------------------------------------------------


def fitted(recipe_of: Mapping[str, Any], bench: Bench, seed: int) -> tuple[Method, Ready]:
    """Train a network in PyTorch on all training frames until its error on the validation frames is flat."""
    from . import dncnn, pix2pix
    from .fitting import examples, fit, seconds_a_step
    from .recipe import Recipe

    recipe = Recipe(seed=seed, **recipe_of)
    make = {"dncnn": dncnn.DnCNN, "pix2pix": pix2pix.Pix2pix}[recipe.method]
    folder = bench.cache / "networks"
    data = examples(recipe, bench.train_files(seed), folder)
    method = make(recipe)
    run = fit(method, recipe, data, examples(recipe, bench.validation_files(seed), folder), folder)
    facts = {"training_s": run["seconds"], "steps": run["steps_done"], "flat": run["flat"]}
    facts |= {"curve": run["curve"], "threads": run["threads"], "recipe": run["recipe"]}
    facts |= {"parameters": next(iter(run["parameters"].values())), "training_frames": bench.scale.train}
    s = bench.scale
    facts["training_samples"] = s.train * (1 + s.train_spp) + s.validation * (1 + s.validation_spp)
    step = partial(seconds_a_step, make(recipe), recipe, data)
    return method, Ready(lambda case: (method.picture(case.noisy), None), facts, step=step)


def dncnn(bench: Bench, seed: int) -> Ready:
    """Train DnCNN."""
    return fitted({"method": "dncnn", "learning_rate": 1e-3, **bench.scale.dncnn}, bench, seed)[1]


def pix2pix(bench: Bench, seed: int) -> Ready:
    """Train pix2pix on patches; its parameters are those of the generator."""
    chosen = {"method": "pix2pix", "learning_rate": 2e-4, "features": ("color", "normal"), "tiles": True}
    return fitted({**chosen, **bench.scale.pix2pix}, bench, seed)[1]


def shrunk_dncnn(at_its_size: bool, bench: Bench, seed: int) -> Ready:
    """Train DnCNN on resized frames, as the paper did; judge it at their size, or enlarged again.

    Pictures are enlarged by cubic interpolation.
    """
    chosen = {"method": "dncnn", "learning_rate": 1e-3, **bench.scale.shrunk}
    method, ready = fitted(chosen, bench, seed)
    factor = bench.scale.shrunk["shrink"]
    if at_its_size:
        cases = [
            replace(c, noisy=smaller(c.noisy, factor), reference=smaller(c.reference, factor))
            for c in bench.cases(seed)
        ]
        return replace(ready, cases=cases)
    return replace(
        ready, picture=lambda case: (larger(method.picture(smaller(case.noisy, factor)), factor), None)
    )


def smaller(frame: Frame, factor: int) -> Frame:
    """Return a frame whose display-encoded colours are means of squares of so many pixels a side."""
    shown = to_display(frame["color"])
    height, width = (side // factor for side in shown.shape[:2])
    squares = shown[: height * factor, : width * factor].reshape(height, factor, width, factor, 3)
    return Frame({"color": from_display(squares.mean(axis=(1, 3))).astype(np.float32)}, frame.info)


def larger(picture: Floats, factor: int) -> Floats:
    """Return a picture (H, W, 3) with so many times the pixels a side, in [0, 1]."""
    import torch

    image = torch.from_numpy(np.ascontiguousarray(np.moveaxis(picture, -1, 0)))[None]
    found = torch.nn.functional.interpolate(image, scale_factor=factor, mode="bicubic")
    return np.moveaxis(found[0].clamp(0.0, 1.0).numpy(), 0, -1)


# ---- what today's users would ask for ---------------------------------------------------------------------


def open_image_denoise(
    aux: str, bench: Bench, seed: int, rays: int = 0, spp: int = frames.NOISY_SPP
) -> Ready:
    """Open Intel's denoiser without albedo and normal, or with noisy, prefiltered or clean ones.

    Clean ones are those of the reference, whose camera rays are counted as its cost.
    """
    from wamnet_peers.peer_oidn import filtered, prefiltered

    guides: Mapping[str, Callable[[Case], Frame | None]] = {
        "none": lambda _: None,
        "noisy": lambda case: case.noisy,
        "prefiltered": lambda case: prefiltered(case.noisy),
        "clean": lambda case: case.reference,
    }

    def picture(case: Case) -> Picture:
        color = filtered(case.noisy, guides[aux](case), clean=aux in ("prefiltered", "clean"))
        return to_display(color), color

    paid = (spp, bench.scale.test_spp) if aux == "clean" else None
    return Ready(picture, rays=rays, spp=spp, paid=paid)


def _to_tune(bench: Bench, seed: int) -> tuple[Frame, Floats]:
    """Return the middle of a noisy training frame, and its display-encoded reference."""
    ((noisy, clean),) = bench.pairs(bench.split.train[:1], seed)
    size = min(TUNED_PX, noisy.height, noisy.width)
    y, x = (noisy.height - size) // 2, (noisy.width - size) // 2
    part = slice(y, y + size), slice(x, x + size)
    middle = Frame({name: values[part] for name, values in noisy.layers.items()}, noisy.info)
    return middle, to_display(clean["color"][part])


def svgf(bench: Bench, seed: int) -> Ready:
    """Open the a-trous filter, with the settings that suit a training frame best."""
    noisy, target = _to_tune(bench, seed)
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
    restoration = need("skimage.restoration", "for non-local means", "scikit-image")

    def filtered(frame: Frame, strength: float) -> Floats:
        noisy = to_display(frame["color"].astype(np.float64))
        found = restoration.denoise_nl_means(
            noisy, patch_size=5, patch_distance=6, h=strength, fast_mode=True, channel_axis=-1
        )
        clipped: Floats = np.clip(found, 0.0, 1.0)
        return clipped

    noisy, target = _to_tune(bench, seed)
    best = min((0.1, 0.2, 0.3, 0.4, 0.6), key=lambda h: metrics.mse(filtered(noisy, h), target))
    return Ready(lambda case: (filtered(case.noisy, best), None), {"chosen": {"h": best}})


# ---- the table -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """A row: what it is called in the table, how it is made ready, which packages it needs.

    `trains`: which of the scale's settings it is trained with; `few`: it has the seeds of the costly rows.
    `timed`: it is a way of its own, not another one judged on other frames.
    """

    text: str
    make: Callable[[Bench, int], Ready]
    packages: tuple[str, ...] = ()
    trains: str = ""
    few: bool = False
    timed: bool = True

    @property
    def missing(self) -> list[str]:
        """Return the packages that are not installed."""
        return [name for name in self.packages if find_spec(name) is None]


COLOR = replace(PAPER, features=("color",))
"""The paper's recipe without normals."""

TORCH, OIDN = ("torch",), ("pyoidn",)
"""Packages of rows."""

ROWS: Mapping[str, Row] = {
    "input": Row("input, 1 spp", as_it_is, timed=False),
    "dncnn": Row("DnCNN", dncnn, TORCH, "dncnn", few=True),
    "dncnn-shrunk": Row("DnCNN on frames a quarter as large, enlarged",
        partial(shrunk_dncnn, False), TORCH, "shrunk", True),
    "dncnn-shrunk-own": Row("the same, judged at that size",
        partial(shrunk_dncnn, True), TORCH, "shrunk", True, timed=False),
    "wamnet-color": Row("WAMnet without normals, preset `paper`",
        partial(wamnet, COLOR, "paper"), trains="paper"),
    "wamnet-color-own": Row("the same, on the frame it was trained on",
        partial(on_its_own_frame, COLOR), trains="paper", timed=False),
    "wamnet": Row("WAMnet, preset `paper`", partial(wamnet, PAPER, "paper"), trains="paper"),
    "wamnet-own": Row("the same, on the frame it was trained on",
        partial(on_its_own_frame, PAPER), trains="paper", timed=False),
    "wamnet-short": Row("WAMnet, preset `short`", partial(wamnet, SHORT, "short"), trains="short"),
    "wamnet-best": Row("WAMnet, preset `best`, features of 16 camera rays",
        partial(wamnet, BEST, "short", rays=EQUAL_RAYS), trains="short"),
    "pix2pix": Row("pix2pix", pix2pix, TORCH, "pix2pix", few=True),
    "oidn": Row("Open Image Denoise, colour only", partial(open_image_denoise, "none"), OIDN),
    "oidn-noisy": Row("the same, with albedo and normal", partial(open_image_denoise, "noisy"), OIDN),
    "oidn-prefiltered": Row("the same, with prefiltered ones",
        partial(open_image_denoise, "prefiltered"), OIDN),
    "oidn-rays": Row("the same, with prefiltered ones of 16 camera rays",
        partial(open_image_denoise, "prefiltered", rays=EQUAL_RAYS), OIDN),
    "oidn-spp": Row("the same, with prefiltered ones, 3 spp",
        partial(open_image_denoise, "prefiltered", spp=EQUAL_SPP), OIDN),
    "oidn-clean": Row("the same, with clean ones", partial(open_image_denoise, "clean"), OIDN),
    "svgf": Row("SVGF's spatial filter (a-trous)", svgf, few=True),
    "nlm": Row("non-local means", non_local_means, ("skimage",), few=True),
    "render30": Row("render, 30 spp", partial(more_samples, 30, False)),
    "render30-own": Row("the same, of the frames trained on", partial(more_samples, 30, True), timed=False),
}  # fmt: skip
"""All rows by name, in the order of the table: a new one is a function and a line here."""
