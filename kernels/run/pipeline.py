"""One pipeline: a noisy picture is path-traced, encoded and denoised without leaving the device.

1. Three kernels of one executor: the scene's paths, which add up the planes that the features need; the
   encoding of the features, traced from the reference (compiler/scenes/lower_encode.py); the model's denoiser
   [`Pipeline`]. On a processor the encoding is the end of the paths' kernel.
2. [`Pipeline.draw`] starts them one after another. Sums, feature images and the result stay on the device
   (kernels/devices/passes.py).
3. The result is read back, and other images only on request [`Pipeline.picture`], [`Pipeline.image`].

The definition is the composition of the three on the executor `numpy`. The separate way (render_on.py, then
denoise_on.py) gives the same picture up to rounding: it encodes in float64 on the host. It refuses pictures
with a NaN or an infinity; here the encoding clips what can be clipped.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...compiler.compile import compile_plan
from ...compiler.scenes.encode_kernel import compile_encode, encoding_of
from ...compiler.scenes.lower_encode import layers_of
from ...compiler.scenes.lower_scene import lower_scene
from ...compiler.scenes.path_kernel import PathArtifact, compile_path, most_unrolled
from ...compiler.variants import FULL, plan_model
from ...refimpl.errors import InputError
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings
from ...refimpl.network.dataset import check_features
from ...refimpl.network.denoise import Model, check_model
from ...refimpl.network.whole import INPUT_LEVELS
from ..devices.executor import Executor, Part
from ..devices.passes import PICTURE
from .render_on import SAMPLES_AT_ONCE, compile_scene
from .tune import choose


class Pipeline:
    """A scene and a model on an open executor, for pictures of one size; a context manager.

    `show` names features that are to be readable in addition to the model's. With `whole`, paths are traced
    by the kernel of render_on.py, which writes more than is needed: one to compile where both are used. A
    `variant` of the model has fewer operations [variants.py]. So many `pictures` are to come: what compiles
    long may pay [tune.py]. The kernels are `path`, `encode` and `denoise`; `passes` runs
    them one by one. With `sums` the encoding is a kernel of its own on all devices.
    """

    def __init__(
        self,
        executor: Executor,
        scene: Scene,
        model: Model,
        size: tuple[int, int],
        *,
        settings: Settings | None = None,
        profile: str = "ieee",
        show: Sequence[str] = (),
        whole: bool = False,
        variant: str = FULL,
        pictures: int = 1,
        sums: bool = False,
    ) -> None:
        """Compile all kernels for pictures of `size` (height, width)."""
        check_model(model)
        plan = plan_model(model, executor.name, profile, variant=variant)
        model = plan.model
        self._height, self._width = size
        Job(self._width, self._height)  # refuses sizes that mean nothing
        self._executor, self._profile = executor, profile
        self._settings = settings or Settings()
        self._features = tuple(dict.fromkeys((*model.features, *show)))
        check_features(self._features)
        self._in_integers = model.is_whole
        # A kernel of whole frames leaves sums, which are read in another way too.
        painted = executor.paints and not whole and not sums
        self._encoding = (
            encoding_of(self._features, model.normalization, profile, model.is_whole) if painted else None
        )
        self._whole = whole
        self.path = self._compiled(scene)
        self.encode = compile_encode(
            self._features, model.normalization, executor.name, profile, self.path.planes, model.is_whole
        )
        self.denoise = compile_plan(choose(executor, plan, size, pictures).plan)
        self._drawn = self._closed = False
        self.passes = executor.passes(self.encode, self.denoise, size)

    def _compiled(self, scene: Scene) -> PathArtifact:
        """Return the path kernel of a scene, built."""
        executor, profile = self._executor, self._profile
        if self._whole:
            kernel = compile_scene(executor, scene, Job(1, 1, settings=self._settings), profile)
        else:
            programs = lower_scene(scene, self._settings, most_unrolled(executor.name))
            groups = layers_of(self._features)
            kernel = compile_path(programs, executor.name, profile, executor.lanes, groups, self._encoding)
        executor.build(kernel)
        return kernel

    def set_scene(self, scene: Scene) -> None:
        """Continue with another scene, or another time of it: compiles its path kernel, the others stay."""
        self.path = self._compiled(scene)

    def draw(self, seed: int = 0, spp: int = 1, first_sample: int = 0) -> None:
        """Trace, encode and denoise a picture, on the device."""
        self._check_open()
        Job(self._width, self._height, spp, seed, self._settings, first_sample=first_sample)
        if spp > SAMPLES_AT_ONCE:
            rule = f"a pipeline adds up in float32: at most {SAMPLES_AT_ONCE} paths per pixel"
            raise InputError("spp", spp, rule, "use fewer, or render_on and denoise_on")
        self.passes.trace(self.path, self.part(seed, spp, first_sample))
        if not self.path.images:
            self.passes.encode(spp)
        self.passes.denoise()
        self._drawn = True

    def part(self, seed: int, spp: int, first_sample: int) -> Part:
        """Return what the path kernel has to draw: all rows."""
        return Part(self._width, self._height, 0, self._height, first_sample, spp, seed)

    def picture(self) -> NDArray[np.float32]:
        """Return the denoised picture (H, W, 3) that was drawn last, display-encoded."""
        return self._read(PICTURE)

    def image(self, feature: str) -> NDArray[np.float32]:
        """Return a feature image (H, W, C) of the picture that was drawn last, encoded.

        Of a network of integers it is what they stand for, steps of 1 / 127.
        """
        if feature not in self._features:
            known = ", ".join(self._features)
            raise InputError("feature image", feature, f"there are {known}", "name it in show=")
        found = self._read(feature)
        return found / np.float32(INPUT_LEVELS) if self._in_integers else found

    def _read(self, name: str) -> NDArray[np.float32]:
        """Copy an image to the host."""
        self._check_open()
        if not self._drawn:
            raise InputError("pipeline", "nothing drawn", "an image is read after it was drawn", "draw first")
        return self.passes.read(name)

    def run(self, seed: int = 0, spp: int = 1, first_sample: int = 0) -> NDArray[np.float32]:
        """Draw a picture and return it (H, W, 3)."""
        self.draw(seed, spp, first_sample)
        return self.picture()

    def _check_open(self) -> None:
        """Refuse work without images."""
        if self._closed:
            raise InputError("pipeline", "closed", "its images were given back", "make another one")

    def close(self) -> None:
        """Give the images on the device back; the executor stays open."""
        if not self._closed:
            self._closed = True
            self.passes.close()

    def __enter__(self) -> Pipeline:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
