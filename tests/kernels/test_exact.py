"""Profile `exact`: every executor and every schedule gives the interpreter's bits; wrong kernels do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import LEAST, Gather, Image, Type
from wamnet.compiler.core.profiles import EMITTED_SINE
from wamnet.compiler.core.trace import trace
from wamnet.compiler.plan import analysed, sine_contract
from wamnet.compiler.proof import bounds
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.schedules import factor
from wamnet.compiler.targets import DENOISERS
from wamnet.kernels import denoise_on
from wamnet.refimpl import frame
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import dataset, denoise, siren

EXAMPLES = settings.default.max_examples // 10
"""Each example compiles a kernel, up to a second on Mesa: a tenth of what other tests draw."""

KINDS = ("random", "tiny", "signed zeros", "threshold", "extreme")
"""Kinds of images."""

APART = ("inlined", "dot16", "groupdot")
"""The inlined schedule takes 20 s to compile for the paper's network, and has a test of its own; those of
bytes hold integers only."""

WAYS = [(t.name, s.name) for t in DENOISERS.values() for s in t.schedules if s.name not in APART]
"""The other schedules."""

PRODUCT = ("weights[(tap + c) * 32 + j]", "value")
"""The factors of a product in a plain kernel for the paper's network."""

OPENED = {"opengl": "opengl-egl"}
"""The executor of a target, where its name is another."""


def image(kind, shape, random):
    """Return numbers in [-2, 2]: all magnitudes down to denormals, both zeros, neighbours of LEAST."""
    edge = np.float32(LEAST)
    few = {
        "signed zeros": [0.0, -0.0, 1.0, -1.0],
        "threshold": [
            edge,
            -edge,
            np.nextafter(edge, np.float32(0)),
            -np.nextafter(edge, np.float32(0)),
            2 * edge,
        ],
        "extreme": [2.0, -2.0],
    }
    if kind in few:
        return random.choice(np.float32(few[kind]), shape)
    values = random.uniform(-2, 2, shape)
    if kind == "tiny":
        values = np.ldexp(values, random.integers(-149, 1, shape))
    return values.astype(np.float32)


@st.composite
def cases(draw):
    """Draw a network whose hidden layers are wide or narrow, with tiny weights among others, and images."""
    channels = draw(st.sampled_from([{"a": 3}, {"a": 3, "b": 1}, {"a": 1, "b": 4, "c": 2}]))
    size = draw(st.integers(1, 8))
    return {
        "widths": [
            size * size * sum(channels.values()),
            *draw(st.lists(st.integers(1, 20), max_size=3)),
            draw(st.integers(1, 4)),
        ],
        "omegas": draw(st.tuples(st.floats(1, 30), st.floats(1, 30))),
        "seed": draw(st.integers(0, 2**32 - 1)),
        "channels": channels,
        "size": size,
        "border": draw(st.sampled_from(["clamp", "zero"])),
        "shape": draw(st.tuples(st.integers(1, 14), st.integers(1, 17))),
        "kinds": draw(st.tuples(*[st.sampled_from(KINDS)] * len(channels))),
        "tiny_weights": draw(st.booleans()),
    }


def made(kit, case):
    """Return the program and the images of a case."""
    network = kit.network(case["widths"], case["omegas"], case["seed"])
    random = np.random.default_rng(case["seed"])
    if case["tiny_weights"]:
        weights = tuple(
            np.where(random.random(w.shape) < 0.2, image("tiny", w.shape, random) * np.float32(0.01), w)
            for w in network.weights
        )
        network = replace(network, weights=weights)
    images = {
        name: image(kind, (*case["shape"], n), random)
        for (name, n), kind in zip(case["channels"].items(), case["kinds"], strict=True)
    }
    return kit.denoiser(network, case["channels"], case["size"], case["border"]), images


def bits(array):
    """Return the bits of float32 numbers, so that zeros of both signs differ."""
    return np.ascontiguousarray(array).view(np.uint32)


def expected(program, images, kit):
    """Return what the interpreter computes (H, W, C), all windows at once."""
    (found,) = interpret(analysed_and_emitted(program), {"window": kit.windows(program, images)}).values()
    return found


def analysed_and_emitted(program):
    """Return the program that all targets emit under profile `exact`."""
    return compile_program(program, "numpy", "exact").program


@settings(max_examples=EXAMPLES)
@given(case=cases())
def test_bits_are_those_of_the_interpreter(denoiser, kit, case):
    """The schedule is the one that the executor takes for large pictures, where that holds exact programs."""
    program, images = made(kit, case)
    artifact = compile_program(program, denoiser.name, "exact", denoiser.schedule)
    assert artifact.program.exact
    assert np.array_equal(bits(denoiser.run(artifact, images)), bits(expected(program, images, kit)))


@pytest.fixture(scope="module")
def paper(kit):
    """The paper's network, as a program, and two images with numbers of all kinds."""
    program = kit.denoiser(kit.network([864, 32, 32, 32, 32, 3], (3.0, 3.0)), {"a": 3, "b": 3}, 12, "clamp")
    random = np.random.default_rng(1)
    parts = [image(kind, (13, 33, 6), random) for kind in KINDS]
    mixed = np.choose(random.integers(0, len(parts), (13, 33, 6)), parts)
    return program, {"a": mixed[..., :3].copy(), "b": mixed[..., 3:].copy()}


@pytest.mark.parametrize(("target", "schedule"), WAYS)
def test_every_schedule_gives_the_same_bits(executor_named, kit, paper, target, schedule):
    executor = executor_named(OPENED.get(target, target))
    program, images = paper
    artifact = compile_program(program, target, "exact", schedule)
    picked = artifact.manifest["schedule"]
    # Sums from spectra have another order, which the profile does not allow: they say so and are replaced.
    assert picked["name"] == schedule or "profile exact states" in picked["reason"]
    found = executor.run(artifact, images)
    assert np.array_equal(bits(found), bits(expected(program, images, kit)))
    if target == "opencl":  # the only one that contracts by default; the others' order is the same anyway
        ieee = executor.run(compile_program(program, target, "ieee", schedule), images)
        assert not np.array_equal(bits(found), bits(ieee)), "the numbers are too easy to tell profiles apart"


def test_every_context_gives_the_same_bits(executor_named, kit, paper):
    program, images = paper
    artifact = compile_program(program, "opengl", "exact")
    for name in ("opengl-egl", "opengl-osmesa"):
        assert np.array_equal(
            bits(executor_named(name).run(artifact, images)), bits(expected(program, images, kit))
        )


def test_error_is_within_the_bound(denoiser, kit, paper):
    """Against the float64 reference with the images as they are and the weights that the kernel has."""
    program, images = paper
    artifact = compile_program(program, denoiser.name, "exact")
    common = analysed(program, "exact")
    window = {"window": kit.windows(program, images)}
    (wanted,) = interpret(replace(common, exact=False), window, np.float64).values()
    contract = sine_contract("exact", denoiser.name)
    (bound,) = bounds.at_inputs(common, window, contract).values()
    assert np.isfinite(bound).all()
    assert (np.abs(denoiser.run(artifact, images) - wanted) <= bound).all()
    (alike,) = bounds.at_inputs(analysed(program), window, sine_contract("ieee", denoiser.name)).values()
    # Reading 0 in place of numbers below 2^-40 costs little of a bound for any order.
    assert bound.max() <= 1.001 * alike.max()


@pytest.mark.parametrize("target", DENOISERS)
@pytest.mark.parametrize("border", ["clamp", "zero"])
def test_a_first_layer_in_two_passes_gives_the_same_bits(executor_named, kit, border, target):
    program = kit.denoiser(kit.network([150, 9, 3], (3.0, 3.0)), {"a": 4, "b": 2}, 5, border)
    random = np.random.default_rng(2)
    images = {"a": image("random", (7, 18, 4), random), "b": image("tiny", (7, 18, 2), random)}
    found = executor_named("numpy").run(compile_program(program, "numpy", "exact", rank=6), images)
    assert len(np.unique(found)) > 100
    for schedule in [s.name for s in DENOISERS[target].schedules]:
        artifact = compile_program(program, target, "exact", schedule, rank=6)
        assert all(kernel.program.exact for kernel in artifact.kernels)
        again = executor_named(OPENED.get(target, target)).run(artifact, images)
        assert np.array_equal(bits(again), bits(found))


def test_the_bound_of_two_passes_holds_what_the_second_one_does_not_read():
    """An image between the passes whose numbers are below LEAST is read as 0."""
    gather = Gather(dataset.Window(2, "clamp"), (Image("a", 1, -1.0, 1.0),))
    ones = np.ones((2, 4), np.float32)
    program = trace(lambda x: np.matmul(x, ones.T), {"window": Type(shape=(4,))}, gather)
    cut = factor.factor(analysed(program, "exact"), 1)
    assert cut.horizontal.exact
    assert cut.vertical.exact
    contract = sine_contract("exact", "opencl")
    found = factor.over_images(cut, contract, of_cut=False)[cut.layer]
    plain = factor.over_images(
        replace(cut, vertical=replace(cut.vertical, exact=False)), contract, of_cut=False
    )
    assert (found.error >= plain[cut.layer].error + LEAST / 2).all()


# ---- zeros -------------------------------------------------------------------------------------------


@settings(max_examples=EXAMPLES)
@given(seed=st.integers(0, 2**32 - 1))
@example(seed=0)
def test_outputs_have_one_zero(denoiser, kit, seed):
    """Operations that make zeros of both signs, on zeros of both signs."""
    random = np.random.default_rng(seed)

    def function(x):
        y = np.minimum(np.maximum(x, 0.0), -x) * (x - x[..., 1][..., None])
        return np.where(x < 0.0, np.floor(x * 0.25) * 0.0, np.maximum(-y, np.absolute(x) * -1.0))

    program, images = kit.program(function, {"a": 4}), {"a": image("signed zeros", (6, 9, 4), random)}
    found = denoiser.run(compile_program(program, denoiser.name, "exact"), images)
    assert np.array_equal(bits(found), bits(expected(program, images, kit)))
    assert not np.signbit(found[found == 0]).any()


# ---- wrong kernels are caught ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("opencl", "#pragma OPENCL FP_CONTRACT OFF", ""),
        ("opencl", "for (int dy = 0; dy < WINDOW_SIZE; ++dy) {", "for (int dy = WINDOW_SIZE; --dy >= 0;) {"),
        ("opengl-egl", "for (int c = 0; c < 3; ++c) {", "for (int c = 2; c >= 0; --c) {"),
        ("c", f"part1[j] += {PRODUCT[0]} * {PRODUCT[1]}", f"part1[j] = fmaf({', '.join(PRODUCT)}, part1[j])"),
    ],
    ids=["contraction", "rows", "channels", "contraction"],
)
def test_a_kernel_with_other_bits_is_caught(executor_named, kit, paper, name, old, new):
    executor = executor_named(name)
    program, images = paper
    artifact = compile_program(program, executor.name, "exact")
    wrong = kit.with_source(artifact, old, new)
    found = executor.run(wrong, images)
    assert not np.array_equal(bits(found), bits(expected(program, images, kit)))


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("opencl", "fabs(value) < 9.09494702e-13f", "fabs(value) < 0.0f"),
        ("opengl-egl", "abs(value) < 9.09494702e-13f", "abs(value) < 1.0e-37f"),
        ("c", " == 0.0f ? 0.0f : ", " == 0.0f ? -0.0f : "),
    ],
    ids=["denormals", "small numbers", "zeros"],
)
def test_a_kernel_that_reads_or_writes_otherwise_is_caught(executor_named, kit, name, old, new):
    executor, program = executor_named(name), kit.program(lambda x: x * 0.5, {"a": 4})
    artifact = compile_program(program, executor.name, "exact")
    images = {"a": image("tiny", (9, 9, 4), np.random.default_rng(3))}
    wanted = bits(expected(program, images, kit))
    assert np.array_equal(bits(executor.run(artifact, images)), wanted)
    assert not np.array_equal(bits(executor.run(kit.with_source(artifact, old, new), images)), wanted)


# ---- what users see ----------------------------------------------------------------------------------


def test_denoise_on_gives_one_digest(executor_named):
    random = np.random.default_rng(7)
    network = siren.init([54, 8, 3], 3.0, 3.0, seed=1, dtype=np.float32)
    model = denoise.Model(network, ("color", "normal"), dataset.Window(3, "zero"), dataset.Normalization())
    layers = {"color": random.uniform(0, 4, (6, 11, 3)), "normal": random.uniform(-1, 1, (6, 11, 3))}
    noisy = frame.Frame({name: layer.astype(np.float32) for name, layer in layers.items()})
    results = [
        denoise_on(executor_named(OPENED.get(name, name)), model, noisy, "exact") for name in DENOISERS
    ]
    assert len({result.digest for result in results}) == 1
    other = denoise_on(executor_named("numpy"), model, noisy, "ieee")
    assert other.digest != results[0].digest


def test_the_manifest_says_what_was_promised(kit, paper):
    manifest = compile_program(paper[0], "opencl", "exact").manifest
    assert manifest["profile"]["name"] == "exact"
    assert "the same bits on every target" in manifest["profile"]["text"]
    assert manifest["passes"] == [
        "fold",
        "fuse_bias",
        "eliminate_dead",
        "pin",
        "expand_sine",
        "fold",
        "eliminate_dead",
    ]
    assert manifest["bound"]["against"].endswith("where weights below 9.094947017729282e-13 are 0")
    assert manifest["sine"]["error"] == EMITTED_SINE.error + LEAST


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("channels", [{"a": 3, "b": 4}, {"a": 1}, {"a": 2, "b": 1}])
def test_inlined_weights_give_the_same_bits(executor_named, kit, channels, border):
    """Numbers of all kinds; products of matrices and vectors of 1 to 4 components."""
    random = np.random.default_rng(4)
    widths = [9 * sum(channels.values()), 9, 6, 3]
    program = kit.denoiser(kit.network(widths, (3.0, 3.0)), channels, 3, border)
    images = {
        name: image(kind, (9, 8, n), random)
        for (name, n), kind in zip(channels.items(), KINDS[:2], strict=False)
    }
    artifact = compile_program(program, "opengl", "exact", "inlined")
    assert artifact.manifest["schedule"]["name"] == "inlined"
    wanted = bits(expected(program, images, kit))
    for name in ("opengl-egl", "opengl-osmesa"):
        assert np.array_equal(bits(executor_named(name).run(artifact, images)), wanted)


def test_inlined_kernels_write_one_zero(executor_named, kit):
    def function(x):
        y = np.matmul(x, np.eye(3, dtype=np.float32).T)
        return np.minimum(y, -y) * y

    artifact = compile_program(kit.program(function, {"a": 3}), "opengl", "exact", "inlined")
    assert artifact.manifest["schedule"]["name"] == "inlined"
    images = {"a": image("signed zeros", (5, 5, 3), np.random.default_rng(5))}
    found = executor_named("opengl-egl").run(artifact, images)
    assert (found == 0).any()
    assert not np.signbit(found[found == 0]).any()


# ---- refusals ----------------------------------------------------------------------------------------


def test_paths_are_refused():
    programs = lower_scene(scenes.CANONICAL["empty"](0.0), Settings())
    with pytest.raises(
        CompileError, match=r"paths divide and take roots, .* profile exact holds denoisers; use"
    ):
        compile_path(programs, "opencl", "exact")


def test_encodings_are_refused():
    with pytest.raises(CompileError, match="encodings of features divide and take roots"):
        compile_encode(("color",), dataset.Normalization(), "opencl", "exact")
