"""Small programs, images, and the one comparison that all tests of executors use [`Kit`]."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from wamnet.compiler.artifact import Artifact
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Program, Type, sha256
from wamnet.compiler.core.trace import trace
from wamnet.compiler.schedules.names import parse
from wamnet.compiler.targets import DENOISERS, LANGUAGES
from wamnet.kernels import Pipeline
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.activation import SINE
from wamnet.refimpl.network.dataset import Normalization, n_inputs
from wamnet.refimpl.network.denoise import Model, denoise_pixel
from wamnet.refimpl.network.window import Window, all_windows, pad

LONG = os.environ.get("HYPOTHESIS_PROFILE") == "long"
"""Whether this run draws other cases each time, and wide networks among them."""

COMPILED = max(settings.default.max_examples // 50, 1)
"""Examples of a test that compiles a kernel for each, up to a second; NumPy runs many more."""


def untrained(
    hidden: Sequence[int] = (8,),
    features: tuple[str, ...] = ("color", "normal"),
    size: int = 4,
    border: str = "clamp",
    omegas: tuple[float, float] = (2.0, 2.0),
    seed: int = 5,
    activation: str = SINE,
) -> Model:
    """Return an untrained model, with weights as training begins with them."""
    window = Window(size, border)
    widths = (n_inputs(features, window), *hidden, 3)
    network = siren.init(widths, *omegas, seed, np.float32, activation)
    return Model(network, features, window, Normalization())


def biased(model: Model) -> Model:
    """Return a model none of whose biases is zero."""
    biases = tuple(b + np.float32(0.25) for b in model.siren.biases)
    return replace(model, siren=replace(model.siren, biases=biases))


@st.composite
def trained_sizes(draw: st.DrawFn) -> tuple[dict[str, int], int, list[int]]:
    """Draw (channels by image, window size, hidden layers) of a network as wide as those that are trained."""
    channels = draw(
        st.sampled_from(
            [{"a": 3, "b": 3, "c": 3, "d": 3}, {"a": 3, "b": 1}, {"a": 4, "b": 4, "c": 4, "d": 4}]
        )
    )
    hidden = draw(st.lists(st.sampled_from([32, 64]), min_size=4, max_size=4))
    return channels, draw(st.integers(8, 12)), hidden


@st.composite
def networks(
    draw: st.DrawFn, size: int = 12, neurons: int = 40, layers: int = 3, wide: bool = False
) -> dict[str, Any]:
    """Draw a denoiser, its border, and an image's shape; `wide`: in long runs half are as trained ones."""
    channels = draw(st.sampled_from([{"a": 3}, {"a": 3, "b": 1}, {"a": 1, "b": 4, "c": 2}]))
    size, hidden = draw(st.integers(1, size)), draw(st.lists(st.integers(1, neurons), max_size=layers))
    if LONG and wide and draw(st.booleans()):
        channels, size, hidden = draw(trained_sizes())
    return {
        "widths": [size * size * sum(channels.values()), *hidden, draw(st.integers(1, 4))],
        "channels": channels,
        "size": size,
        "border": draw(st.sampled_from(["clamp", "zero"])),
        "shape": draw(st.tuples(st.integers(1, 17), st.integers(1, 45))),
        "seed": draw(st.integers(0, 2**32 - 1)),
    }


def pictures(channels: Mapping[str, int], shape: tuple[int, int], seed: int = 1) -> dict[str, Any]:
    """Return an image of each name, with values in [-2, 2]."""
    random = np.random.default_rng(seed)
    return {name: random.uniform(-2, 2, (*shape, n)).astype(np.float32) for name, n in channels.items()}


def ways(fits: Callable[[Any], bool]) -> list[Any]:
    """Return targets with their schedules, as parameters of a test: the largest of each family, nightly all.

    The others are the same statements with other numbers, of which each is tested in NumPy.
    """
    found = [(t, s.name) for t in DENOISERS for s in LANGUAGES[t].schedules.values() if fits(s)]
    sizes = {way: parse(way[1])[1] or 0 for way in found}
    largest = {(way[0], parse(way[1])[0]): way for way in sorted(found, key=sizes.__getitem__)}
    marks = {way: () if way in largest.values() else pytest.mark.nightly for way in found}
    return [pytest.param(*way, marks=marks[way]) for way in found]


def encoded(executor: Any, kernel: Any, sums: Any, samples: int) -> dict[str, Any]:
    """Return the encoded images (H, W, C) of sums (planes, H, W) over so many samples, by name."""
    height, width = sums.shape[1:]
    strides = {"width": width, "height": height, "row_stride": width, "plane_stride": height * width}
    written = executor.call(
        kernel, {"sums": np.ascontiguousarray(sums)}, {**strides, "sample_count": samples}
    )
    return {name.removeprefix("image_"): image for name, image in written.items()}


class Kit:
    """What the tests of this folder share."""

    def network(
        self,
        widths: list[int],
        omegas: tuple[float, float],
        seed: int = 1,
        scale: float = 1.0,
        activation: str = SINE,
    ) -> siren.Siren:
        """Return a network with weights and biases that are `scale` times the initial ones, float32.

        The last layer is made such that outputs lie within 0.5 +- 0.45, for inputs in [-2, 2]: clipped ones
        would hide errors.
        """
        drawn = siren.init(widths, *omegas, seed, np.float32, activation)
        factor = np.float32(scale)
        *weights, last = (w * factor for w in drawn.weights)
        *biases, middle = (b * factor for b in drawn.biases)
        largest = 2.0
        for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
            sums = np.abs(weight).sum(axis=1) * largest + np.abs(bias)
            largest = 1.0 if activation == SINE else float(omegas[layer > 0] * sums.max())
        last = last * np.float32(0.45 / largest / np.abs(last).sum(axis=1).max())
        return replace(drawn, weights=(*weights, last), biases=(*biases, np.full_like(middle, 0.5)))

    def model(
        self,
        hidden: Sequence[int] = (8,),
        features: tuple[str, ...] = ("color", "normal"),
        size: int = 3,
        border: str = "clamp",
        scales: Normalization | None = None,
        seed: int = 1,
    ) -> Model:
        """Return a model whose outputs lie within 0.5 +- 0.45."""
        window = Window(size, border)
        network = self.network([n_inputs(features, window), *hidden, 3], (3.0, 3.0), seed)
        return Model(network, features, window, scales or Normalization())

    def program(
        self, function: Callable[..., Any], channels: Mapping[str, int], size: int = 1, border: str = "clamp"
    ) -> Program:
        """Trace a function of the window vector over images with values in [-2, 2]."""
        images = tuple(Image(name, n, -2.0, 2.0) for name, n in channels.items())
        gather = Gather(Window(size, border), images)
        return trace(function, {"window": Type(shape=(gather.n_inputs,))}, gather)

    def denoiser(self, network: siren.Siren, channels: Mapping[str, int], size: int, border: str) -> Program:
        """Trace the reference's pixel function."""
        return self.program(lambda window: denoise_pixel(network, window), channels, size, border)

    def windows(self, program: Program, images: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the windows (H, W, n) of the images."""
        joined = np.concatenate([images[image.name] for image in program.gather.images], axis=-1)
        return all_windows(pad(joined, program.gather.window), program.gather.window)

    def excess(
        self,
        executor: Any,
        program: Program,
        images: Mapping[str, np.ndarray],
        artifact: Artifact | None = None,
    ) -> float:
        """Return the largest error / bound against the float64 reference: at most 1 for a right kernel."""
        artifact = artifact or compile_program(program, executor.name)
        held = artifact.plan.expected(images)
        found = executor.run(artifact, images).astype(np.float64)
        assert np.isfinite(held.bound).all(), "a bound that is infinite holds for every kernel"
        return float(np.max(np.abs(found - held.value) / held.bound))

    def check_composed(self, executor: Any) -> None:
        """Insist that a pipeline gives to each kernel what the one before it returned, to the bit."""
        model, scene, settings = self.model((6,)), canonical("lone_light"), Settings(max_depth=1)
        with Pipeline(executor, scene, model, (6, 9), settings=settings, sums=True) as pipeline:
            found = pipeline.run(seed=3)
            sums = executor.trace(pipeline.path, pipeline.part(3, 1, 0))
            wanted = executor.run(pipeline.denoise, encoded(executor, pipeline.encode, sums, 1))
        assert np.array_equal(found, wanted)
        assert np.isfinite(found).all()
        assert found.std() > 0, "a picture of one colour would hide what is mixed up"

    def with_source(self, artifact: Artifact, old: str, new: str) -> Artifact:
        """Return the artifact with a piece of its source replaced, under a digest of its own."""
        assert old in artifact.source
        source = artifact.source.replace(old, new)
        return replace(
            artifact, source=source, manifest={**artifact.manifest, "digest": sha256(source.encode())}
        )
