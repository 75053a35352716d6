"""Kernels that mean the same, written otherwise, agree within the bound on every executor (profile `ieee`).

Each variant changes a network, its images or its source so that the real function stays what it was; the
reference is the original's, in float64, the bound the variant's own: two variants agree within the sum of
theirs. A miscompiled loop, layout or border shows in one variant and not in another, which says where to
look.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import attributes
from wamnet.compiler.plan import plan_program
from wamnet.compiler.schedules import schedules
from wamnet.compiler.targets import DENOISERS, language_named

EXAMPLES = max(settings.default.max_examples // 10, 1)
"""Each example compiles a kernel: a tenth of what other tests draw."""

SIZE, CHANNELS = 3, {"a": 3, "b": 1}
"""Window and images of the original."""


@dataclass(frozen=True)
class Case:
    """A network, its images, and the window that it reads; the axes along which pictures are mirrored."""

    network: object
    images: dict
    size: int = SIZE
    mirrored: tuple[int, ...] = ()

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
    """The last image first: taps hold their channels in another order."""
    ends = np.cumsum([image.shape[2] for image in case.images.values()])[:-1]
    weights = np.concatenate(np.split(taps(case), ends, axis=-1)[::-1], axis=-1)
    return with_first_layer(case, weights, images=dict(reversed(case.images.items())))


def images_split(case):
    """Each channel is an image of its own."""
    joined = np.concatenate(list(case.images.values()), axis=-1)
    return replace(case, images={f"c{i}": joined[..., i : i + 1].copy() for i in range(joined.shape[2])})


def images_joined(case):
    """All channels in one image."""
    return replace(case, images={"all": np.concatenate(list(case.images.values()), axis=-1)})


def larger_window(case):
    """A larger window whose first row and column have no weight, if its centre moves with them, or last."""
    more = (1, 0) if case.size % 2 else (0, 1)
    return with_first_layer(case, np.pad(taps(case), ((0, 0), more, more, (0, 0))), size=case.size + 1)


def dead_channel(case):
    """One more channel, of large numbers, that has no weight."""
    image = np.full((*next(iter(case.images.values())).shape[:2], 1), 2.0, np.float32)
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


def mirrored(case, axis):
    """Pictures and windows turned around along an axis, and the result turned back."""
    if case.size % 2 == 0:
        case = larger_window(case)  # one that has a centre
    images = {name: np.ascontiguousarray(np.flip(image, axis)) for name, image in case.images.items()}
    return with_first_layer(
        case, np.flip(taps(case), axis + 1), images=images, mirrored=(*case.mirrored, axis)
    )


def mirrored_rows(case):
    """The last row first."""
    return mirrored(case, 0)


def mirrored_columns(case):
    """The last column first."""
    return mirrored(case, 1)


def weights_doubled(case):
    """Powers of two are exact: weights and biases of sine layers times 4, their omega_0 over 4."""
    weights = tuple(weight * np.float32(4) for weight in case.network.weights[:-1])
    biases = tuple(bias * np.float32(4) for bias in case.network.biases[:-1])
    network = replace(
        case.network,
        weights=(*weights, case.network.weights[-1]),
        biases=(*biases, case.network.biases[-1]),
        omega_0_first=case.network.omega_0_first / 4,
        omega_0_hidden=case.network.omega_0_hidden / 4,
    )
    return replace(case, network=network)


def images_halved(case):
    """Images times 1/2, the first layer's weights times 2."""
    images = {name: image * np.float32(0.5) for name, image in case.images.items()}
    return with_first_layer(case, taps(case) * np.float32(2), images=images)


VARIANTS = (
    *(reversed_sums, images_in_another_order, images_split, images_joined, larger_window),
    *(dead_channel, dead_neurons, halved_and_doubled, signs_turned),
    *(mirrored_rows, mirrored_columns, weights_doubled, images_halved),
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
    wanted = plan_program(reference, "numpy").expected(original.images).value
    artifact = artifact or compile_program(program, executor.name, "ieee", executor.schedule)
    bound = artifact.plan.expected(variant.images).bound
    assert np.isfinite(bound).all()
    off = np.abs(executor.run(artifact, variant.images) - np.flip(wanted, variant.mirrored))
    return float(np.max(off / bound))


@pytest.fixture(autouse=True)
def _spectra_of_small_windows(monkeypatch):
    """Let the Fourier schedule hold what is faster without it."""
    monkeypatch.setattr(schedules, "COST", 0.0)


@pytest.mark.product
@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.__name__)
def test_variants_agree_within_the_bound(denoiser, kit, original, variant, border):
    assert excess(kit, denoiser, original, variant(original), border) <= 1


@st.composite
def changes(draw):
    """Draw (original, border, number of a schedule, variants one after another)."""
    size, seed = draw(st.integers(1, 4)), draw(st.integers(0, 2**32 - 1))
    hidden = draw(st.lists(st.integers(1, 9), min_size=1, max_size=3))
    random = np.random.default_rng(seed)
    shape = draw(st.tuples(st.integers(1, 7), st.integers(1, 20)))
    # With a dead channel they are four, the most that GLSL has in one image.
    images = {name: random.uniform(-2, 2, (*shape, n)).astype(np.float32) for name, n in (("a", 2), ("b", 1))}
    widths = [size * size * 3, *hidden, draw(st.integers(1, 4))]
    chosen = draw(st.lists(st.sampled_from(VARIANTS), min_size=1, max_size=4, unique=True))
    return (
        (widths, size, seed, images),
        draw(st.sampled_from(["clamp", "zero"])),
        draw(st.integers(0)),
        chosen,
    )


@pytest.mark.nightly(but=("numpy", "c"))
@settings(max_examples=EXAMPLES)
@given(drawn=changes())
def test_variants_of_variants_agree_within_the_bound(denoiser, kit, drawn):
    """Of any small network, in any schedule that its target has."""
    (widths, size, seed, images), border, number, chosen = drawn
    variant = original = Case(kit.network(widths, (3.0, 9.0), seed), images, size)
    for change in chosen:
        variant = change(variant)
    schedules = language_named(denoiser.name).schedules
    schedule = schedules[number % len(schedules)].name
    artifact = compile_program(variant.program(kit, border), denoiser.name, "ieee", schedule)
    assert excess(kit, denoiser, original, variant, border, artifact) <= 1


@pytest.mark.product
@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize(
    ("target", "schedule"), [(t.name, s.name) for t in DENOISERS.values() for s in t.schedules]
)
def test_schedules_agree_within_the_bound(executor_named, kit, original, border, target, schedule):
    """Unrolled, in tiles, with weights in other orders: the same function."""
    executor = executor_named({"opengl": "opengl-egl"}.get(target, target))
    program = original.program(kit, border)
    artifact = compile_program(program, target, "ieee", schedule)
    if reason := artifact.manifest["schedule"].get("reason"):
        pytest.skip(f"{schedule} is replaced: {reason}")
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


def test_an_unused_layer_leaves_no_trace(kit, original):
    """Dead nodes of a program: the kernel is the same to the byte, and so is its bound."""
    program = original.program(kit, "clamp")
    first = next(node for node in program.nodes if node.op == "affine")
    unused = replace(first, attributes=attributes(**{**dict(first.attributes), "weight": "Wx"}))
    longer = replace(
        program,
        nodes=(*program.nodes, unused),
        parameters={**program.parameters, "Wx": program.parameters[first["weight"]] + 1},
    )
    for target in DENOISERS:
        kernels = [compile_program(p, target) for p in (program, longer)]
        assert kernels[0].manifest == kernels[1].manifest
        assert kernels[0].contents() == kernels[1].contents()


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
