"""First layers in two passes, on every executor that has them: borders, sizes, ranks, schedules."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import COMPILED, networks, pictures, ways

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.plan import analysed
from wamnet.compiler.proof import bounds
from wamnet.compiler.schedules import factor
from wamnet.compiler.schedules.bytes import Dot, GroupDot
from wamnet.compiler.schedules.fft import Transformed
from wamnet.compiler.targets import language_named
from wamnet.kernels import Pipeline, denoise_on
from wamnet.kernels.devices import opencl_executor
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.network import factored
from wamnet.refimpl.network.window import BORDERS

WAYS = ways(lambda schedule: not isinstance(schedule, Transformed | Dot | GroupDot))
"""All targets and schedules that hold a first layer in two passes: spectra are of windows along both axes,
and bytes hold integers."""


ONE_IMAGE = tuple(("opengl", f"group:{pixels}") for pixels in (1, 2, 4))
"""Schedules that write four channels: a first pass with more is plain. Mesa compiles four layers of straight
code in a minute, so that the paper's network is left out."""


def excess(kit, executor, artifact, program, images, of_cut):
    """Return the largest error / bound at these images, against the program, or against its cut's product."""
    rank = artifact.manifest["factored"]["rank"]
    cut, contract = factor.factor(analysed(program), rank), language_named(artifact.target).sine
    found = cut.enclosures(contract, images, of_cut)
    (bound,) = bounds.output_errors(cut.whole, found).values()
    wanted = cut.whole if of_cut else cut.product
    (expected,) = interpret(wanted, {"window": kit.windows(program, images)}, np.float64).values()
    assert np.isfinite(bound).all(), "a bound that is infinite holds for every kernel"
    difference = np.abs(executor.run(artifact, images).astype(np.float64) - expected)
    return float(np.max(difference / bound))


@pytest.mark.product
@pytest.mark.parametrize(("target", "schedule"), WAYS)
@settings(max_examples=COMPILED)
@given(case=networks(), share=st.floats(0, 1), group=st.tuples(st.integers(1, 5), st.integers(1, 4)))
def test_error_is_within_both_bounds(executor_named, kit, target, schedule, case, share, group):
    """Against the network of the factors' product, up to rounding; against the whole one, with the cut."""
    executor = executor_named(target)
    program = kit.denoiser(
        kit.network(case["widths"], (9.0, 3.0), case["seed"]), case["channels"], case["size"], case["border"]
    )
    images = pictures(case["channels"], case["shape"], case["seed"])
    most = factored.largest_rank(case["size"], *case["widths"][:2])
    rank = min(1 + round(share * (most - 1)), language_named(target).dialect.max_output_channels)
    artifact = compile_program(program, target, schedule, rank)
    for kernel in artifact.kernels:
        picked = kernel.manifest["schedule"]
        reason = picked.get("reason", "")
        several = (target, schedule) in ONE_IMAGE and reason == f"it writes {rank} channels, of at most 4"
        # Groups hold four channels of a tile at once.
        assert picked["name"] == schedule or several or reason.endswith("is one partial sum")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("LOCAL_SIZE", "TILE_LOCAL_SIZE"):
            patch.setattr(opencl_executor, name, group)
        for of_cut in (False, True):
            assert excess(kit, executor, artifact, program, images, of_cut) <= 1


def paper_s(kit, border="clamp", rank=0):
    """Return the paper's network; with a rank, one whose first layer was made so, in float32."""
    network = kit.network([864, 32, 32, 32, 32, 3], (3.0, 3.0))
    if rank:
        weight = factored.expand(factored.cut(network.weights[0], 12, rank))
        network = replace(network, weights=(weight, *network.weights[1:]))
    return kit.denoiser(network, {"color": 3, "normal": 3}, 12, border)


@pytest.mark.nightly(but=("numpy-plain-clamp", "c-tile:16-clamp"))
@pytest.mark.product
@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize(("target", "schedule"), [way for way in WAYS if way.values not in ONE_IMAGE])
def test_the_paper_s_network_of_rank_16(executor_named, kit, target, schedule, border) -> None:
    """A model that was trained so loses nothing: its cut is as small as its own rounding to float32."""
    program = paper_s(kit, border, 16)
    artifact = compile_program(program, target, schedule, 16)
    images = pictures({"color": 3, "normal": 3}, (13, 31))
    for of_cut in (False, True):
        assert excess(kit, executor_named(target), artifact, program, images, of_cut) <= 1
    report = artifact.manifest["factored"]
    # Each weight is rounded by at most u = 2^-24 of itself when the model is made; its factors again, when
    # they are cut: a product of two is off by 2 u of the magnitudes |V| |H|, which are larger than |W|.
    assert report["cut"]["first_layer"] <= 2.0**-18 * report["cut"]["of"]
    # Sums of two passes hold larger numbers than one of 36 terms: what is left is below half an 8-bit step.
    assert max(artifact.manifest["bound"]["output"]) <= 1 / 510


@pytest.mark.parametrize("rank", [1, 4])
def test_executors_agree_through_denoise_on(executor_named, kit, rank) -> None:
    """A variant rankR has the picture of the model with the expanded cut, up to both bounds of rounding."""
    model = kit.model((9,), ("color",), 5, "zero")
    network = model.siren
    noisy = Frame({"color": np.random.default_rng(2).random((7, 18, 3), dtype=np.float32)})
    expanded = factored.expand(factored.cut(network.weights[0].astype(np.float64), 5, rank))
    low = replace(model, siren=replace(network, weights=(expanded.astype(np.float32), *network.weights[1:])))
    # The sums have at most 75 terms of magnitude below 1 each: 2^-24 * 75 * 4 roundings, times omega_0 = 3
    # and the next layer's row sum, below 1, is less than 2^-12.
    for name in ("numpy", "opencl", "opengl"):
        found = denoise_on(executor_named(name), model, noisy, variant=f"rank{rank}")
        wanted = denoise_on(executor_named("numpy"), low, noisy)
        assert np.max(np.abs(found.image - wanted.image)) <= 2.0**-12
        assert found.variant.startswith(f"variant rank{rank}: ")
    assert denoise_on(executor_named("numpy"), model, noisy).variant == ""


@pytest.mark.parametrize("name", ["numpy", "opencl", "opengl-egl", "opengl-osmesa"])
def test_passes_over_a_picture_hold_both_kernels(executor_named, kit, name) -> None:
    """Between a path kernel and a picture that stay on the device: the bits of `run` on the same images."""
    executor, model = executor_named(name), kit.model(size=4, border="zero")
    with Pipeline(executor, canonical("minicubes"), model, (6, 11), variant="rank6") as pipeline:
        assert len(pipeline.denoise.kernels) == 2
        for seed in (2, 1):
            picture = pipeline.run(seed, 2)
        images = {feature: pipeline.image(feature) for feature in model.features}
        assert np.ptp(picture) > 0
        assert (picture == executor.run(pipeline.denoise, images)).all()


@pytest.mark.parametrize("schedule", ["plain", "inlined"])
@pytest.mark.parametrize("rank", [4, 5, 32])
def test_executors_draw_into_as_many_textures_as_ranks_fill(executor_named, kit, rank, schedule) -> None:
    """One, two, and the most that OpenGL 3.3 promises."""
    program = kit.denoiser(kit.network([216, 16, 3], (3.0, 3.0)), {"color": 3, "normal": 3}, 6, "zero")
    artifact = compile_program(program, "opengl", schedule, rank)
    first, second = artifact.kernels
    assert first.source.count("layout(location") == -(-rank // 4)
    assert [i.channels for i in second.programs.gather.images] == [4] * (rank // 4) + [1] * (rank % 4)
    images = pictures({"color": 3, "normal": 3}, (5, 8))
    assert excess(kit, executor_named("opengl-egl"), artifact, program, images, False) <= 1


def test_opengl_refuses_ranks_of_more_than_eight_textures(kit) -> None:
    with pytest.raises(
        CompileError, match=r"rank 33: the intermediate image .* writes at most 32; use a smaller ran"
    ):
        compile_program(paper_s(kit), "opengl", rank=33)


@pytest.mark.parametrize("rank", [-1, 73])
def test_ranks_that_no_layer_has(kit, rank) -> None:
    with pytest.raises(InputError, match=rf"rank {rank}.*has ranks from 1 to 72"):
        compile_program(paper_s(kit), "opencl", rank=rank)


def test_the_images_are_those_of_the_first_pass(executor_named, kit) -> None:
    """Their ranges are checked; nobody can give the intermediate image."""
    artifact = compile_program(paper_s(kit), "opencl", rank=2)
    images = pictures({"color": 3, "normal": 3}, (4, 4))
    with pytest.raises(InputError, match="images for the kernel"):
        executor_named("opencl").run(artifact, {factor.HORIZONTAL: np.zeros((4, 4, 2), np.float32)})
    with pytest.raises(InputError, match="the kernel's bound holds for values in"):
        executor_named("opencl").run(artifact, {**images, "color": 2 * images["color"]})
