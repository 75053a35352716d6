"""Kernels that mean the same, written otherwise, agree within the bound on every executor (profile `ieee`).

Each variant changes a network, its images or its source so that the real function stays what it was; the
reference is the original's, in float64, the bound the variant's own. A miscompiled loop, layout or border
shows in one variant and not in another, which says where to look.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from wamnet.compiler import bounds
from wamnet.compiler.compile import DENOISERS, analysed, compile_program, sine_contract
from wamnet.compiler.interpret import interpret

SIZE, CHANNELS = 3, {"a": 3, "b": 1}
"""Window and images of the original."""


@dataclass(frozen=True)
class Case:
    """A network, its images, and the window that it reads."""

    network: object
    images: dict
    size: int = SIZE

    def program(self, kit, border):
        """Return the program of one pixel."""
        channels = {name: image.shape[2] for name, image in self.images.items()}
        return kit.denoiser(self.network, channels, self.size, border)


def taps(case):
    """Return the first layer's weights as (D_out, rows, columns, channels of all images)."""
    channels = sum(image.shape[2] for image in case.images.values())
    return case.network.weights[0].reshape(-1, case.size, case.size, channels)


def with_first_layer(case, weights, **changes):
    """Return the case with another first layer (D_out, rows, columns, channels)."""
    first = np.ascontiguousarray(weights.reshape(len(weights), -1))
    network = replace(case.network, weights=(first, *case.network.weights[1:]))
    return replace(case, network=network, **changes)


def reversed_sums(case):
    """Hidden neurons in reverse: each later layer adds up from the last to the first."""
    weights, biases = list(case.network.weights), list(case.network.biases)
    for layer in range(len(weights) - 1):
        weights[layer], biases[layer] = weights[layer][::-1].copy(), biases[layer][::-1].copy()
        weights[layer + 1] = weights[layer + 1][:, ::-1].copy()
    return replace(case, network=replace(case.network, weights=tuple(weights), biases=tuple(biases)))


def images_in_another_order(case):
    """The second image first: taps hold their channels in another order."""
    order = [3, 0, 1, 2]
    return with_first_layer(case, taps(case)[..., order], images=dict(reversed(case.images.items())))


def images_split(case):
    """Each channel is an image of its own."""
    joined = np.concatenate(list(case.images.values()), axis=-1)
    return replace(case, images={f"c{i}": joined[..., i : i + 1].copy() for i in range(joined.shape[2])})


def images_joined(case):
    """All channels in one image."""
    return replace(case, images={"all": np.concatenate(list(case.images.values()), axis=-1)})


def larger_window(case):
    """A window of 4 whose first row and column have no weight: its centre moves with them."""
    return with_first_layer(case, np.pad(taps(case), ((0, 0), (1, 0), (1, 0), (0, 0))), size=4)


def dead_channel(case):
    """One more channel, of large numbers, that has no weight."""
    image = np.full((*case.images["b"].shape[:2], 1), 2.0, np.float32)
    return with_first_layer(
        case, np.pad(taps(case), ((0, 0), (0, 0), (0, 0), (0, 1))), images={**case.images, "dead": image}
    )


def dead_neurons(case):
    """Three neurons more in the first layer, which nothing weighs: layers of other widths."""
    weights, biases = list(case.network.weights), list(case.network.biases)
    weights[0], biases[0] = np.pad(weights[0], ((0, 3), (0, 0)), mode="edge"), np.pad(biases[0], (0, 3))
    weights[1] = np.pad(weights[1], ((0, 0), (0, 3)))
    return replace(case, network=replace(case.network, weights=tuple(weights), biases=tuple(biases)))


def halved_and_doubled(case):
    """A neuron in two halves: two neurons alike, each with half of its weight in the next layer."""
    weights, biases = list(case.network.weights), list(case.network.biases)
    weights[0], biases[0] = np.repeat(weights[0], 2, axis=0), np.repeat(biases[0], 2)
    weights[1] = np.repeat(weights[1] * np.float32(0.5), 2, axis=1)
    return replace(case, network=replace(case.network, weights=tuple(weights), biases=tuple(biases)))


def signs_turned(case):
    """sin(-x) = -sin(x): the first layer's rows and biases, and the next layer's weights, change sign."""
    weights, biases = list(case.network.weights), list(case.network.biases)
    weights[0], biases[0], weights[1] = -weights[0], -biases[0], -weights[1]
    return replace(case, network=replace(case.network, weights=tuple(weights), biases=tuple(biases)))


VARIANTS = (
    *(reversed_sums, images_in_another_order, images_split, images_joined, larger_window),
    *(dead_channel, dead_neurons, halved_and_doubled, signs_turned),
)
"""Ways to write the same function."""


@pytest.fixture(scope="module")
def original(kit):
    """A network with two hidden layers, and images with a border all around each window."""
    random = np.random.default_rng(11)
    images = {name: random.uniform(-2, 2, (6, 9, n)).astype(np.float32) for name, n in CHANNELS.items()}
    return Case(kit.network([SIZE * SIZE * 4, 7, 5, 3], (3.0, 9.0), seed=3), images)


def excess(kit, executor, original, variant, border, artifact=None):
    """Return the largest |variant's kernel - original's reference| over the variant's bound."""
    program, reference = variant.program(kit, border), original.program(kit, border)
    (wanted,) = interpret(reference, {"window": kit.windows(reference, original.images)}, np.float64).values()
    windows = {"window": kit.windows(program, variant.images)}
    contract = sine_contract("ieee", executor.name)
    (bound,) = bounds.at_inputs(analysed(program), windows, contract).values()
    assert np.isfinite(bound).all()
    artifact = artifact or compile_program(program, executor.name, "ieee", executor.schedule)
    return float(np.max(np.abs(executor.run(artifact, variant.images) - wanted) / bound))


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.__name__)
def test_variants_agree_within_the_bound(denoiser, kit, original, variant, border):
    assert excess(kit, denoiser, original, variant(original), border) <= 1


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize(
    ("target", "schedule"), [(t.name, s.name) for t in DENOISERS.values() for s in t.schedules]
)
def test_schedules_agree_within_the_bound(executor_named, kit, original, border, target, schedule):
    """Unrolled, in tiles, with weights in other orders: the same function."""
    executor = executor_named({"opengl": "opengl-egl"}.get(target, target))
    program = original.program(kit, border)
    artifact = compile_program(program, target, "ieee", schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    assert excess(kit, executor, original, original, border, artifact) <= 1


@pytest.mark.parametrize(
    ("name", "dead"),
    [
        ("opencl", "if (width < 0) {{ result[0] = sin(weights[0]) / 0.0f; }} {0}"),
        ("opengl-egl", "if (width < 0) {{ result = vec4(sin(weights(0)) / 0.0); }} {0}"),
        ("c", "if (width < 0) {{ result[0] = sinf(weights[0]) / 0.0f; }} {0}"),
    ],
)
def test_dead_code_changes_no_bit(executor_named, kit, original, name, dead):
    executor = executor_named(name)
    program = original.program(kit, "clamp")
    artifact = compile_program(program, executor.name)
    first = next(line for line in artifact.source.split("\n") if line.startswith("    float v"))
    longer = kit.with_source(artifact, first, dead.format(first))
    assert np.array_equal(executor.run(longer, original.images), executor.run(artifact, original.images))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda case: replace(
            larger_window(case), size=4, images={n: i[:, ::-1].copy() for n, i in case.images.items()}
        ),
        lambda case: replace(case, images=dict(reversed(case.images.items()))),
        lambda case: replace(halved_and_doubled(case), network=replace(case.network, omega_0_hidden=8.999)),
    ],
    ids=["mirrored", "channels mixed up", "omega"],
)
def test_variants_that_mean_something_else_are_caught(executor_named, kit, original, wrong):
    assert excess(kit, executor_named("numpy"), original, wrong(original), "clamp") > 1
