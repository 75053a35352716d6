"""One pipeline: a noisy picture is path-traced, encoded and denoised without leaving the device.

1. Three kernels of one executor: the scene's paths, which add up the planes that the features need; the
   encoding of the features, traced from the reference (compiler/scenes/encode_kernel.py); the model's
   denoiser [`Pipeline`]. On a processor the encoding is the end of the paths' kernel.
2. [`Pipeline.draw`] starts them one after another. Sums, feature images and the result stay on the device
   (kernels/devices/passes.py).
3. The result is read back, and other images only on request [`Pipeline.picture`], [`Pipeline.image`]. Of an
   animation one picture is copied while the device draws the next one [`Pipeline.later`, `Pipeline.stream`].
4. Features may be means over more camera rays than are followed to the end: the path kernel traces these too.
5. A scene that moves is other numbers for the same path kernel, and compiles nothing (render_on.py).

The definition is the composition of the three on the executor `numpy`. The separate way (render_on.py, then
denoise_on.py) gives the same picture up to rounding: it encodes in float64 on the host. It refuses pictures
with a NaN or an infinity; here the encoding clips what can be clipped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.scenes.emit_path import planes
from ...compiler.scenes.encode_kernel import compile_encode, encoding_of, layers_of, sees
from ...compiler.scenes.lower_scene import FeatureRays
from ...compiler.scenes.scene_inputs import SceneInputs
from ...compiler.variants import FULL, plan_model
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.light.render import Job, feature_job, feature_sampler
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import SPREAD, Settings
from ...refimpl.network.dataset import check_features
from ...refimpl.network.denoise import Model, check_model, learned_shadow_rays
from ...refimpl.network.whole import INPUT_LEVELS
from ..devices.executor import Executor
from ..devices.kernel import Closing, Part
from ..devices.passes import PICTURE, Passes
from .render_on import SAMPLES_AT_ONCE, MovingPaths
from .tune import Tuning


@dataclass(frozen=True)
class Drawn:
    """A denoised picture (H, W, 3), display-encoded, and feature images (H, W, C) of it by name."""

    picture: NDArray[np.float32]
    images: Mapping[str, NDArray[np.float32]]


def _rays_of(job: Job, seen: bool) -> FeatureRays | None:
    """Return the features' own rays of a job of one path, if there are any, or refuse them."""
    if feature_job(job) is None:
        return None
    if seen:
        rule = "in a pipeline the paths see through mirrors and glass, and there are fewer of them"
        raise InputError("feature_spp", job.feature_spp, rule, "use 0, or render_on and denoise_on")
    source, sampler = feature_sampler(job), job.settings.sampler
    if source not in (sampler, SPREAD[sampler]):
        rule = f"in a pipeline the first ray is that of the path, whose sampler is {sampler}"
        raise InputError("feature_sampler", source, rule, f"use {sampler} or {SPREAD[sampler]}")
    return FeatureRays(job.feature_spp, source)


class Pipeline(Closing):
    """A scene and a model on an open executor, for pictures of one size; a context manager.

    `show` names features that are to be readable in addition to the model's. `moving` are scenes that
    [`set_scene`] will be given, or the numbers that are inputs: the path kernel is then compiled once for all
    of them. A `variant` of the model has fewer operations [variants.py]. So many `pictures` are to come: what
    compiles long may pay [tune.py]. The kernels are `path`, `encode` and `denoise`; `moment` is the path
    kernel with the scene's numbers; `passes` runs them one by one. `feature_spp` and `feature_sampler` are
    those of a Job, whose features the images then have; the paths' first camera ray is one of these rays.
    With `sums` the encoding is a separate kernel on all devices.
    """

    def __init__(
        self,
        device: Executor,
        scene: Scene,
        model: Model,
        size: tuple[int, int],
        *,
        settings: Settings | None = None,
        show: Sequence[str] = (),
        variant: str = FULL,
        pictures: int = 1,
        sums: bool = False,
        moving: Sequence[Scene] | SceneInputs = (),
        feature_spp: int = 0,
        feature_sampler: str = "",
    ) -> None:
        """Compile all kernels for pictures of `size` (height, width)."""
        check_model(model)
        # The first picture does not wait for a proof that nobody reads.
        plan = replace(plan_model(model, device.language, variant=variant), proves=False)
        model = plan.model
        self._height, self._width = size
        self._settings = settings or Settings()
        self._features = tuple(dict.fromkeys((*model.features, *show)))
        check_features(self._features)
        # The job refuses sizes and numbers that mean nothing.
        rays = {"feature_spp": feature_spp, "feature_sampler": feature_sampler}
        job = Job(self._width, self._height, settings=self._settings, **rays)  # type: ignore[arg-type]
        shadow_rays = learned_shadow_rays(replace(model, features=self._features))
        self._rays = _rays_of(job, sees(self._features))
        self._in_integers = integers = model.is_whole
        features, scales = self._features, model.normalization
        language, passes = device.language, device.language.profile.passes
        count = self._rays.count if self._rays else 0
        painted = device.paints and not sums
        encoding = encoding_of(features, scales, passes, integers, count) if painted else None
        groups = layers_of(self._features)
        more = {"seen": sees(self._features), "rays": self._rays, "shadow_rays": shadow_rays}
        self._paths = MovingPaths(device, self._settings, groups, more, encoding, moving)
        self.set_scene(scene)
        planned = planes(groups)
        self.encode = compile_encode(features, scales, language, planned, integers, count)
        schedule, _ = Tuning(device, plan.model, size, plan.varied).picked(pictures)
        self.denoise = compile_plan(plan.scheduled(schedule))
        self._drawn = self._closed = False
        self.passes = Passes(device, self.encode, self.denoise, size)

    def set_scene(self, scene: Scene) -> None:
        """Continue with another scene, or another time of it.

        If it differs from those before in inputs of the path kernel, only these are new. If it differs in
        more numbers they become inputs too, and the kernel is compiled once more; if it is laid out in
        another way, its own kernel is compiled. Encoding and denoiser stay.
        """
        self.moment = self._paths.of(scene)
        self._paths.executor.build(self.path)

    @property
    def path(self) -> Artifact:
        """Return the path kernel."""
        return self.moment.kernel

    def draw(self, seed: int = 0, spp: int = 1, first_sample: int = 0) -> None:
        """Trace, encode and denoise a picture, on the device."""
        self._check_open()
        Job(self._width, self._height, spp, seed, self._settings, first_sample=first_sample)
        if spp > SAMPLES_AT_ONCE:
            rule = f"a pipeline adds up in float32: at most {SAMPLES_AT_ONCE} paths per pixel"
            raise InputError("spp", spp, rule, "use fewer, or render_on and denoise_on")
        self._check_rays(spp, first_sample)
        self.passes.trace(self.path, self.part(seed, spp, first_sample), self.moment.numbers)
        if not self.path.images:
            self.passes.encode(spp)
        self.passes.denoise()
        self._drawn = True

    def _check_rays(self, spp: int, first_sample: int) -> None:
        """Refuse samples that do not begin with one of the features' rays, or are as many as these."""
        if self._rays is None:
            return
        if spp >= self._rays.count:
            rule = f"features are of {self._rays.count} camera rays: there must be fewer paths"
            raise InputError("spp", spp, rule, "create a pipeline without feature_spp")
        if first_sample and self._rays.sampler != self._settings.sampler:
            rule = f"rays of {self._rays.sampler} begin with the ray of sample 0"
            raise InputError("first_sample", first_sample, rule, "use 0, and another seed")

    def part(self, seed: int, spp: int, first_sample: int) -> Part:
        """Return what the path kernel has to draw: all rows."""
        return Part(self._width, self._height, 0, self._height, first_sample, spp, seed)

    def picture(self) -> NDArray[np.float32]:
        """Return the denoised picture (H, W, 3) that was drawn last, display-encoded."""
        self._check_drawn()
        return self.passes.read(PICTURE)()

    def image(self, feature: str) -> NDArray[np.float32]:
        """Return a feature image (H, W, C) of the picture that was drawn last, encoded.

        Of a network of integers it is what they stand for, steps of 1 / 127.
        """
        self._check_shown(feature)
        self._check_drawn()
        return self._meant(self.passes.read(feature)())

    def _meant(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what a feature image stands for."""
        return image / np.float32(INPUT_LEVELS) if self._in_integers else image

    def later(self, *features: str) -> Callable[[], Drawn]:
        """Begin to copy what was drawn last, with feature images; return what waits for it.

        The next picture can be drawn before that is called: a device with a queue computes it meanwhile.
        """
        self._check_drawn()
        for feature in features:
            self._check_shown(feature)
        picture = self.passes.read(PICTURE)
        images = {feature: self.passes.read(feature) for feature in features}
        return lambda: Drawn(picture(), {name: self._meant(image()) for name, image in images.items()})

    def stream(
        self, scenes: Iterable[Scene], seeds: Iterable[int], spp: int = 1, features: Sequence[str] = ()
    ) -> Iterator[Drawn]:
        """Yield the picture of each scene with its seed, with feature images; the next is drawn meanwhile."""
        before: Callable[[], Drawn] | None = None
        for scene, seed in zip(scenes, seeds, strict=True):
            self.set_scene(scene)
            self.draw(seed, spp)
            now = self.later(*features)
            if before is not None:
                yield before()
            before = now
        if before is not None:
            yield before()

    def run(self, seed: int = 0, spp: int = 1, first_sample: int = 0) -> NDArray[np.float32]:
        """Draw a picture and return it (H, W, 3)."""
        self.draw(seed, spp, first_sample)
        return self.picture()

    def _check_shown(self, feature: str) -> None:
        """Refuse a feature without an image."""
        if feature not in self._features:
            known = ", ".join(self._features)
            raise InputError("feature image", feature, f"is not one of {known}", "name it in show=")

    def _check_drawn(self) -> None:
        """Refuse to read what was not drawn."""
        self._check_open()
        if not self._drawn:
            raise InputError("pipeline", NO_VALUE, "has rendered no image yet", "render first")

    def _check_open(self) -> None:
        """Refuse work without images."""
        if self._closed:
            raise InputError("pipeline", NO_VALUE, "closed", "open a new one")

    def close(self) -> None:
        """Give the images on the device back; the executor stays open."""
        if not self._closed:
            self._closed = True
            self.passes.close()
