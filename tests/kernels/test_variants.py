"""Variants on every executor: the varied network up to rounding, the full one up to the variant's bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler import variants
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.core import sine
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import analysed, sine_contract
from wamnet.compiler.proof import bounds
from wamnet.compiler.schedules import factor
from wamnet.compiler.targets import TARGETS, schedule_named
from wamnet.compiler.variants import parse, plan_model, vary, with_rank
from wamnet.kernels import denoise_on
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, siren
from wamnet.refimpl.network.denoise import Model

NAMES = (
    *("full", "window4", "window3", "hidden7", "without-normal", "rank4", "window4+rank8"),
    *(f"sine{degree}" for degree in sine.POLYNOMIALS),
    "without-normal+window3+hidden7+rank2",
)
"""Variants that are run: each kind, and together; a rank that fills two of GLSL's colour buffers."""

WAYS = [(target.name, schedule.name) for target in TARGETS.values() for schedule in target.schedules]
"""All targets and schedules."""


def paper_s(border="clamp"):
    """Return a small model whose colours are seldom clipped."""
    network = siren.init([5 * 5 * 6, 10, 9, 3], 1.0, 2.0, seed=2, dtype=np.float32)
    last = network.weights[-1] * np.float32(0.4 / np.abs(network.weights[-1]).sum(axis=1).max())
    weights, biases = (*network.weights[:-1], last), (*network.biases[:-1], np.full(3, 0.5, np.float32))
    network = replace(network, weights=weights, biases=biases)
    return Model(network, ("color", "normal"), dataset.Window(5, border), dataset.Normalization())


def picture(shape=(7, 33)):
    random = np.random.default_rng(3)
    return {
        "color": random.random((*shape, 3), dtype=np.float32),
        "normal": random.uniform(-1, 1, (*shape, 3)).astype(np.float32),
    }


def float64_of(program, images):
    """Return the output (H, W, 3) of a program on images."""
    gather = program.gather
    joined = np.concatenate([images[image.name] for image in gather.images], axis=-1).astype(np.float64)
    windows = dataset.all_windows(dataset.pad(joined, gather.window), gather.window)
    (found,) = interpret(program, {"window": windows}, np.float64).values()
    return found


@pytest.mark.product
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("target", "schedule"), WAYS)
def test_a_kernel_is_its_variant(executor_named, target, schedule, name) -> None:
    """Up to rounding at these windows; and as near to the full network as its manifest says for all."""
    border = "zero" if "+" in name else "clamp"
    model, images, executor = paper_s(border), picture(), executor_named(target)
    varied = vary(parse(name), model)
    artifact = compile_plan(plan_model(model, target, "ieee", schedule, name))
    found = executor.run(artifact, {k: images[k] for k in varied.features}).astype(np.float64)
    program, contract = analysed(lower(varied.model)), sine_contract(artifact.profile, target)
    chosen = {k: images[k] for k in varied.features}
    expected = float64_of(program, images)
    used = artifact.manifest["schedule"]["name"]
    if varied.rank:
        cut = factor.factor(program, varied.rank)
        errors = bounds.output_errors(program, factor.at_images(cut, contract, chosen))
    else:
        enclosed = schedule_named(target, used).enclosures(program, contract, chosen)
        errors = bounds.output_errors(program, enclosed)
    (bound,) = errors.values()
    assert np.isfinite(bound).all()
    assert (np.abs(found - expected) <= bound).all()
    full = float64_of(analysed(lower(model)), images)
    promise = variants.bound_of(artifact.plan)
    assert (np.abs(found - full).max(axis=(0, 1)) <= promise).all()
    if name == "full":
        enclosed = schedule_named(target, used).enclosures(program, contract)
        alone = bounds.output_errors(program, enclosed)
        # Nothing is left out: it is the bound of rounding, which both compute, widened once more in each of
        # three layers.
        (alone,) = alone.values()
        assert (promise <= (1 + 4 * bounds.OUTWARD) ** 3 * alone).all()


def test_denoise_on_runs_variants(executor_named) -> None:
    model = paper_s()
    frame = Frame(picture())
    executor = executor_named("numpy")
    small = vary(parse("window3+rank2"), model).model
    found = denoise_on(executor, model, frame, variant="window3+rank2")
    # Two passes in place of one, of 54 terms below 1, through layers that stretch by less than 10.
    assert np.abs(found.image - denoise_on(executor, small, frame).image).max() <= 1e3 * 54 * 2.0**-24
    assert found.variant.startswith("variant window3+rank2: ")
    assert denoise_on(executor, model, frame).variant == ""


def test_a_rank_is_short_for_a_variant() -> None:
    assert [with_rank("full", 0), with_rank("full", 2), with_rank("window3", 0)] == [
        "full",
        "rank2",
        "window3",
    ]
    with pytest.raises(InputError, match=r"rank 2: the variant is window3 \(name it in the variant"):
        with_rank("window3", 2)
