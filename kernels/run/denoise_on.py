"""Denoise frames on an executor: choose, compile, encode, run, with both times.

1. [`Denoiser`] is a network on a device: its kernel is chosen for a size, and compiled or, for a command,
   taken from the cache, before the frame is encoded.
2. Features are encoded by the reference, in blocks of rows that fit a processor's cache; the edge-avoiding
   filter, which takes it longer than a kernel takes for the network, runs on the device [`Denoiser.images`].
3. [`denoise_on`] does both for one frame.
4. What a device reads of a kernel is kept as data of JSON's types, and read back as a kernel without its
   program or plan, so that the compiler is not even imported [`kept_kernels`].
"""

from __future__ import annotations

import base64
import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact, SmoothKernels, schedule_text, weight_bytes
from ...compiler.core.ir import Image
from ...compiler.kernel.interface import FULL, PLAIN, Array, Interface
from ...models.model_file import model_bytes
from ...refimpl.frame import Frame
from ...refimpl.network.dataset import FEATURES, Normalization
from ...refimpl.network.denoise import Model, input_image
from .. import cache
from ..devices.executor import Executor
from ..devices.kernel import Images, Size
from ..devices.passes import Filter
from ..memory import cores, keep_freed_memory
from .tune import Tuning

if TYPE_CHECKING:
    from ...compiler.core.ir import Program
    from ...compiler.plan import Plan

BLOCK_PIXELS = 2**14
"""Pixels of a block of rows that is encoded at once: some copies of it fit a processor's cache."""


@dataclass(frozen=True)
class RunResult:
    """The image (H, W, 3), display-encoded, and where and how fast it was made.

    `seconds_compile`: tracing, passes, bound, emission, the driver's compilation and one run on a few pixels,
    or reading what is kept of it.
    `seconds_run`: images to the device, the kernel, the result back; not the encoding of the features.
    `schedule`: what was picked, and why, where it is not the requested one; `reason`: why that was requested.
    `kernel`: its digest. `variant`: what it may cost.
    """

    image: NDArray[np.float32]
    seconds_compile: float
    seconds_run: float
    device: str
    schedule: str
    reason: str
    kernel: str
    variant: str = ""

    @property
    def digest(self) -> str:
        """Return the SHA-256 of the picture's numbers, little-endian float32, rows from the top."""
        return hashlib.sha256(self.image.astype("<f4").tobytes()).hexdigest()


def images_of(model: Model, frame: Frame) -> Images:
    """Return the encoded feature images (H, W, C) that the model's kernel reads, by name."""
    # NumPy works without the interpreter's lock: features are encoded beside each other.
    with ThreadPoolExecutor(cores()) as pool:
        images = pool.map(lambda name: _image(model, frame, name), model.features)
        return dict(zip(model.features, images, strict=True))


def _image(model: Model, frame: Frame, name: str) -> NDArray[np.float32]:
    """Return one feature's image, in blocks of rows where each pixel is encoded by itself."""
    feature, rows = FEATURES[name], max(1, BLOCK_PIXELS // frame.width)
    if feature.guides or frame.height <= rows:
        return input_image(model, frame, (name,))
    image = np.empty((frame.height, frame.width, feature.channels), np.float32)
    for top in range(0, frame.height, rows):
        block = slice(top, top + rows)
        layers = {layer: frame[layer][block] for layer in feature.layers if layer in frame.layers}
        image[block] = input_image(model, Frame(layers, frame.info), (name,))
    return image


@lru_cache(maxsize=16)
def _filter(normalization: Normalization, how: tuple[str, str, int], keeps: bool) -> SmoothKernels:
    """Return the kernels of the filter, which all models with these scales share.

    `how`: the names of language and profile, and the pixels of a work item.
    """

    def compiled() -> SmoothKernels:
        from ...compiler.scenes.smooth_kernel import compile_smoothing
        from ...compiler.targets import language_named

        return compile_smoothing(normalization, language_named(how[0]).under(how[1]), how[2])

    key = asdict(normalization), *how
    return SmoothKernels(*(kept_kernels("filter", key, compiled) if keeps else compiled()))


@dataclass
class Denoiser:
    """A network on a device; `model` is the variant of it that runs.

    Without a `schedule`, it is the one that suits device, size and so many `pictures` to come [tune.py].
    `keeps`: kernels are taken from the cache, and put there; nothing about the network is proven.
    """

    executor: Executor
    full: Model
    schedule: str | None = None
    variant: str = FULL
    pictures: int = 1
    keeps: bool = False
    model: Model = field(init=False)
    plan: Plan | None = field(init=False, default=None)
    seconds_planned: float = field(init=False)
    ready: dict[Size, tuple[Artifact, str]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Plan the network where a variant changes it, or its plan is needed."""
        start = time.perf_counter()
        self.keeps = self.keeps and not self.executor.interprets
        if not (self.keeps and self.variant == FULL):
            self.plan = self._planned()
        self.model = self.plan.model if self.plan else self.full
        self.seconds_planned = time.perf_counter() - start

    def _planned(self) -> Plan:
        """Return the plan."""
        from ...compiler.variants import plan_model

        plan = plan_model(self.full, self.executor.language, self.schedule or PLAIN, self.variant)
        return replace(plan, proves=not self.keeps)

    def kernel(self, size: Size) -> tuple[Artifact, str]:
        """Return the kernel for frames of `size` (height, width), built, and why it has this schedule."""
        if size not in self.ready:
            self.ready[size] = self._scheduled(size)
            keep_freed_memory()
        kernel, reason = self.ready[size]
        self.executor.build(kernel, size)
        return kernel, reason

    def _scheduled(self, size: Size) -> tuple[Artifact, str]:
        """Return the kernel, not yet built, and why it has this schedule."""
        name, reason = self.schedule, "as asked"
        if name is None:
            varied = self.plan.varied if self.plan else None
            name, reason = Tuning(self.executor, self.model, size, varied).picked(self.pictures)
        if not self.keeps:
            return self._compiled(name)[0], reason
        digest = hashlib.sha256(model_bytes(self.full)).hexdigest()
        parts = (digest, self.executor.name, self.executor.profile, self.variant, name)
        return kept_kernels("kernel", parts, lambda: self._compiled(name))[0], reason

    def _compiled(self, schedule: str) -> Sequence[Artifact]:
        """Return the kernel, compiled."""
        from ...compiler.compile import compile_plan

        self.plan = self.plan or self._planned()
        return (compile_plan(self.plan.scheduled(schedule)),)

    def filter(self, frame: Frame) -> Filter | None:
        """Return what smooths a frame's features on the device; None: the reference does.

        The reference smooths where a device would take longer, where a picture has the same bits on all
        devices (integers), and layers with more digits than a kernel reads.
        """
        executor, model = self.executor, self.model
        layers = [
            layer for name in model.features if FEATURES[name].guides for layer in FEATURES[name].layers
        ]
        if not layers or not executor.smooths or model.is_whole:
            return None
        if not all(layer in frame and frame[layer].dtype == np.float32 for layer in layers):
            return None
        how = executor.name, executor.profile, executor.lanes
        return Filter(executor, _filter(model.normalization, how, self.keeps))

    def images(self, frame: Frame) -> Images:
        """Return the images of [`images_of`], smoothed ones by the device where it does that: up to SMO-5."""
        smoother, model = self.filter(frame), self.model
        if smoother is None:
            return images_of(model, frame)
        others = [name for name in model.features if not FEATURES[name].guides]
        found = dict(images_of(replace(model, features=tuple(others)), frame))
        for feature in (FEATURES[name] for name in model.features if name not in found):
            given = {"color": feature.layer, **feature.guides}
            found[feature.name] = smoother.image({what: frame[layer] for what, layer in given.items()})
        return {name: found[name] for name in model.features}

    def image(self, images: Images) -> NDArray[np.float32]:
        """Return the denoised image (H, W, 3), display-encoded, of a frame's images."""
        height, width = next(iter(images.values())).shape[:2]
        return self.executor.run(self.kernel((height, width))[0], images)

    def run(self, frame: Frame, images: Images | None = None) -> RunResult:
        """Return a denoised frame and the times; `images` are its encoded features, if they are there."""
        start = time.perf_counter()
        if images is None:
            self.filter(frame)
        before = time.perf_counter() - start
        # A frame that lacks a layer is refused before its kernel is compiled; encoding is not part of that.
        images = self.images(frame) if images is None else images
        start = time.perf_counter()
        kernel, reason = self.kernel((frame.height, frame.width))
        built = time.perf_counter()
        image = self.executor.run(kernel, images)
        seconds = time.perf_counter() - built
        facts = (self.executor.device, schedule_text(kernel.manifest["schedule"]), reason, kernel.digest)
        compiling = self.seconds_planned + before + built - start
        return RunResult(image, compiling, seconds, *facts, _text_of(kernel))


def denoise_on(
    device: Executor,
    model: Model,
    frame: Frame,
    schedule: str | None = None,
    variant: str = FULL,
    pictures: int = 1,
    images: Images | None = None,
    keeps: bool = False,
) -> RunResult:
    """Return the denoised frame and the times, by a [`Denoiser`].

    `variant`: with fewer operations [variants.py]. `images`: those of [`images_of`], for whoever compares
    with the reference's image; by default the device may make them [`Denoiser.images`].
    """
    return Denoiser(device, model, schedule, variant, pictures, keeps).run(frame, images)


def products_of(program: Program) -> int:
    """Return the multiplications of a pixel that belong to matrices."""
    affine = [node for node in program.nodes if node.op == "affine"]
    return sum(program.parameters[str(node["weight"])].size for node in affine)


def bound_of(artifact: Artifact) -> float | None:
    """Return the bound for all images."""
    output = artifact.manifest["bound"]["output"]
    return max(output) if output else None


def _text_of(artifact: Artifact) -> str:
    """Return what a manifest says about a variant, for a reader; nothing where it is all of the network."""
    if (found := artifact.manifest.get("variant")) is None:
        return ""
    bound, share = found["bound"]["output"], found["products"] / found["products_of_full"]
    moves = f"moves a colour by at most {max(bound):g}" if bound else "moves colours without a bound"
    return f"variant {found['name']}: {share:.0%} of the multiplications; {moves}, whatever the picture"


# ---- kernels that are kept between runs -------------------------------------------------------------------


def kept_kernels(
    kind: str, parts: Sequence[object], compiled: Callable[[], Sequence[Artifact]]
) -> list[Artifact]:
    """Return the kernels that depend on `parts`, from the cache, or compiled and put there."""

    def data() -> list[dict[str, Any]]:
        return [data_of(kernel) for kernel in compiled()]

    entry = cache.kept(kind, parts, data)
    with suppress(KeyError, TypeError, ValueError):
        if kernels := [kernel_of(each) for each in entry]:
            return kernels
    # An entry of the right name and checksum that this program has not written.
    return [kernel_of(each) for each in data()]


def data_of(kernel: Artifact) -> dict[str, Any]:
    """Return a kernel as JSON's types."""
    return {
        "source": kernel.source,
        "manifest": kernel.manifest,
        "interface": asdict(kernel.interface),
        "images": [asdict(image) for image in kernel.images],
        "weights": base64.b64encode(weight_bytes(kernel)).decode(),
        "before": data_of(kernel.before) if kernel.before else None,
    }


def kernel_of(data: Mapping[str, Any]) -> Artifact:
    """Return the kernel that [`data_of`] wrote."""
    taken = data["interface"]
    arrays = tuple(Array(**{**array, "shape": tuple(array["shape"])}) for array in taken["arrays"])
    return Artifact(
        data["source"],
        data["manifest"],
        Interface(taken["role"], arrays, tuple(taken["integers"])),
        tuple(Image(**facts) for facts in data["images"]),
        weights=np.frombuffer(base64.b64decode(data["weights"]), "<f4").astype(np.float32),
        before=kernel_of(data["before"]) if data["before"] else None,
    )
