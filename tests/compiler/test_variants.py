"""Tests of variants: names, what is left out, the bound of the move, manifests, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import untrained

from wamnet.compiler import variants
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.core import sine
from wamnet.compiler.targets import TARGETS, language_named
from wamnet.compiler.variants import parse, plan_model, vary, with_rank
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network.denoise import as_dtype, check_model, denoise_pixel
from wamnet.refimpl.network.whole import round_image
from wamnet.refimpl.network.window import BORDERS, all_windows, pad

FEATURES = ("color", "normal")
"""What the small model sees: 6 channels, colours in [0, 1], normals in [-1, 1]."""


def small(size=4, hidden=(7, 6), seed=1, omega=3.0, border="clamp"):
    """Return a small random model, in float32."""
    return untrained(hidden, FEATURES, size, border, (omega, omega), seed)


def image(shape=(5, 6), seed=1):
    """Return a feature image (H, W, 6) in the features' ranges."""
    random = np.random.default_rng(seed)
    return np.concatenate([random.random((*shape, 3)), random.uniform(-1, 1, (*shape, 3))], axis=-1)


def denoised(model, picture):
    """Return the picture (H, W, 3) that a model makes of a feature image, in float64."""
    wide = replace(
        model.siren,
        weights=tuple(w.astype(np.float64) for w in model.siren.weights),
        biases=tuple(b.astype(np.float64) for b in model.siren.biases),
    )
    chosen = [k for k, name in enumerate(np.repeat(FEATURES, 3)) if name in model.features]
    picture = picture[..., chosen]
    return denoise_pixel(wide, all_windows(pad(picture, model.window), model.window))


NAMES = ("window3", "window1", "hidden5", "rank4", "without-color", "without-normal", "half16")
COMBINED = (
    "window3+rank4",
    "without-normal+window2+hidden5+rank2",
    "hidden5+window3",
    "rank3+sine11",
    "window3+half16",
)


@pytest.mark.parametrize("name", ["full", *NAMES, *COMBINED])
def test_names_are_read_back(name) -> None:
    assert parse(name).name == name


WRONG = {
    "": "'' is not an approximation; supported: leave out a feature",
    "rank": "'rank' is not an approximation",
    "rank0": "'rank0' is not an approximation",
    "rank-3": "'rank-3' is not an approximation",
    "full+rank3": "'full' is not an approximation",
    "rank12 ": "'rank12 ' is not an approximation",
    "rank12+": "'' is not an approximation",
    "Rank12": "'Rank12' is not an approximation",
    "rank99999": "'rank99999' is not an approximation",
    "rank3+rank4": "rank comes twice",
    "without-color+without-color": "without comes twice",
    "rank4+window3": "window must come before rank, which it would undo",
    "rank4+without-color": "without must come before rank",
    "rank4+hidden5": "hidden must come before rank",
    "half16+window3": "window must come before half",
    "half16+rank4": "rank must come before half",
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_names_are_refused(name) -> None:
    with pytest.raises(InputError, match="variant '.*': " + WRONG[name].replace("+", r"\+")):
        parse(name)


IMPOSSIBLE = {
    "window4": "the window has 4 x 4 taps",
    "window9": "the window has 4 x 4 taps",
    "hidden7": "the widest hidden layer has 7 neurons",
    "without-albedo": "the model reads color, normal",
    "without-color+without-normal": "the model reads normal",
    "rank25": "ranks from 1 to 24",
    "sine4": "there are .*sine11",
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_what_a_model_cannot_have_is_refused(name) -> None:
    with pytest.raises(InputError, match=IMPOSSIBLE[name]):
        vary(parse(name), small())


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("name", [*NAMES, *COMBINED])
def test_the_small_network_is_the_one_with_zeros(name, border) -> None:
    """The varied model, and the full one's shape with zeros, are one function: sums in another order."""
    model = small(border=border)
    varied = vary(parse(name), model)
    check_model(varied.model)
    weights, biases = varied.inside
    whole = replace(model, siren=replace(model.siren, weights=weights, biases=biases))
    picture = image()
    difference = np.abs(denoised(varied.model, picture) - denoised(whole, picture)).max()
    # Sums of at most 97 terms below 1, through three layers that stretch by less than 10 each.
    assert difference <= 1e3 * 97 * 2.0**-52


@pytest.mark.parametrize("name", ["window3", "without-normal+window2"])
def test_a_narrow_window_keeps_each_channel_s_sum(name) -> None:
    """VAR-3: what a channel adds to a neuron in a picture of one colour."""
    varied = vary(parse(name), small())
    before, after = (
        np.asarray(w, np.float64).reshape(7, 16, 6).sum(axis=1)
        for w in (small().siren.weights[0], varied.weights[0])
    )
    left = slice(0, 3) if "without" in name else slice(0, 6)
    # Sums of 16 weights below 1, added up in another order, and divided.
    assert np.abs(after - before)[:, left].max() <= 3 * 16 * 2.0**-52


def test_halves_are_the_nearest_and_hold_what_a_kernel_reads() -> None:
    """Each weight is off by 2^-11 of itself at most; all numbers of the kernel's weights are halves."""
    model = small(hidden=(8, 8))
    found = vary(parse("half16"), model)
    for rounded, before in zip(found.weights, model.siren.weights, strict=True):
        wide = before.astype(np.float64)
        assert np.abs(rounded - wide).max() > 0.0
        # Below 2^-14 halves are 2^-24 apart.
        assert (np.abs(rounded - wide) <= np.maximum(2.0**-11 * np.abs(wide), 2.0**-25)).all()
    for target in ("opencl", "c"):
        held = compile_plan(plan_model(model, target, variant="half16")).weights
        assert np.array_equal(held.astype(np.float16).astype(np.float32), held)


def test_halves_that_cannot_be_are_refused() -> None:
    model = small()
    for name, told in (("half8", "there is half16"), ("rank3+half16", "factors of a rank are other numbers")):
        with pytest.raises(InputError, match=told):
            vary(parse(name), model)
    large = tuple(w * np.float32(1e6) for w in model.siren.weights)
    with pytest.raises(InputError, match="65504 is the largest"):
        vary(parse("half16"), replace(model, siren=replace(model.siren, weights=large)))


def test_the_heaviest_neurons_stay() -> None:
    model = small(hidden=(4,))
    last = np.array([[0.1, 5.0, 0.0, -2.0]] * 3, np.float32)
    model = replace(model, siren=replace(model.siren, weights=(model.siren.weights[0], last)))
    found = vary(parse("hidden2"), model)
    assert found.kept[1].tolist() == [1, 3]
    assert np.array_equal(found.model.siren.weights[1], last[:, [1, 3]])


@st.composite
def cases(draw):
    """Draw (model, name of a variant)."""
    size = draw(st.integers(2, 5))
    hidden = draw(st.lists(st.integers(2, 8), min_size=1, max_size=3))
    parts = []
    if draw(st.booleans()):
        parts.append(f"without-{draw(st.sampled_from(FEATURES))}")
    if draw(st.booleans()):
        parts.append(f"window{draw(st.integers(1, size - 1))}")
    if draw(st.booleans()):
        parts.append(f"hidden{draw(st.integers(1, max(hidden) - 1))}")
    if draw(st.booleans()):
        parts.append(f"rank{draw(st.integers(1, 3))}")
    model = small(size, hidden, draw(st.integers(0, 2**31)), draw(st.sampled_from([0.05, 0.3, 2.0])))
    return model, "+".join(parts) or "full"


@given(case=cases(), seed=st.integers(0, 2**31))
def test_no_picture_moves_by_more_than_the_bound(case, seed) -> None:
    """On random pictures, and on ones made of the ends of the ranges, in float64."""
    model, name = case
    try:
        varied = vary(parse(name), model)
    except InputError:
        return  # a rank that this window does not have
    bound = variants.bound_of(plan_model(model, "opencl", variant=name))
    for picture in (image(seed=seed), np.where(image(seed=seed) > 0.5, 1.0, 0.0)):
        moved = np.abs(denoised(varied.model, picture) - denoised(model, picture)).max(axis=(0, 1))
        assert (moved <= bound).all()


@pytest.mark.parametrize(
    ("name", "neurons"), [("window3", 1), ("hidden1", 2), ("rank2", 1), ("without-normal", 1)]
)
def test_the_bound_of_a_linear_network_is_reached(name, neurons) -> None:
    """Without sines to speak of, and one neuron that moves, the worst window moves the output that far."""
    model = small(hidden=(neurons,), omega=1e-3)
    scaled = tuple(w * np.float32(s) for w, s in zip(model.siren.weights, (0.1, 1.0), strict=True))
    last = np.full(3, 0.5, np.float32)
    model = replace(model, siren=replace(model.siren, weights=scaled, biases=(model.siren.biases[0], last)))
    varied = vary(parse(name), model)
    weights, biases = (tuple(a.astype(np.float64) for a in arrays) for arrays in varied.inside)
    whole = [a.astype(np.float64) for a in model.siren.weights]
    offset = [a.astype(np.float64) for a in model.siren.biases]
    # sin(a) = a up to a^3 / 6: of arguments below 1e-2 that is 2e-7.
    slope = 1e-3 * (weights[1] @ weights[0] - whole[1] @ whole[0])
    middle = 1e-3 * (weights[1] @ biases[0] - whole[1] @ offset[0])
    low, high = (np.tile(np.repeat(ends, 3), 16) for ends in ((0.0, -1.0), (1.0, 1.0)))
    outward = 1.0 if middle[0] + slope[0] @ (low + high) / 2 >= 0 else -1.0
    worst = np.where(slope[0] * outward > 0, high, low)
    moved = abs(middle[0] + slope[0] @ worst)
    (bound, *_) = variants.bound_of(plan_model(model, "opencl", variant=name))
    # Its sine is not quite the line that `moved` is computed with: see above.
    curved = 1e-2**3 / 6
    assert moved <= bound + curved
    # Beside the move there is rounding: that of a sine, as the next layer weighs it, and of sums below 1.
    rounding = 2 * sine.POLYNOMIALS[11].error * np.abs(whole[1]).sum(axis=1).max()
    assert bound <= moved + rounding + 2 * 97 * 2.0**-24


def test_a_bound_holds_where_a_weight_is_wrong() -> None:
    """What is not in the bound shows: a kernel's weight that differs moves beyond that of `full`."""
    model = small(omega=0.05)
    plan = plan_model(model, "opencl")
    full, varied = variants.bound_of(plan), plan.varied
    weight = varied.weights[0].copy()
    weight[0, 0] += 0.1
    wrong = replace(varied, weights=(weight, *varied.weights[1:]))
    assert (variants.bound_of(replace(plan, varied=wrong)) > 2 * full).any()


def test_native_sines_have_no_bound_on_numpy() -> None:
    plan = plan_model(small(), language_named("numpy").under("native"), variant="rank2")
    assert variants.bound_of(plan) is None
    manifest = compile_plan(plan).manifest
    assert manifest["variant"]["bound"]["output"] is None


@pytest.mark.parametrize("target", TARGETS)
def test_manifests_say_what_was_done(target) -> None:
    name = "window3+rank2"
    found = compile_plan(plan_model(small(), target, variant=name))
    said = found.manifest["variant"]
    assert said["name"] == name
    assert said["approximations"] == ["window3", "rank2"]
    assert said["program"] == variants.digest_of(small())
    assert (said["products"], said["products_of_full"]) == (138, 732)
    bound = variants.bound_of(found.plan)
    assert len(found.kernels) == 2
    assert (np.array(said["bound"]["output"]) >= bound).all()
    assert (np.array(said["bound"]["output"]) <= 1.01 * bound).all()
    assert "variant" not in compile_plan(plan_model(small(), target)).manifest


# ---- integers ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bits", [8, 10])
def test_integers_are_within_their_bound_of_the_full_network(bits) -> None:
    """Layers so thin and weights so small that the bound says something: it is below 1 and holds."""
    model = small(2, (3,), 4, 1.0)
    plan = variants.plan_model(model, "numpy", variant=f"whole{bits}")
    bound = variants.bound_of(plan)
    assert bound is not None
    assert (bound < 1.0).all()
    drawn = np.random.default_rng(7).uniform(-1, 1, (500, 24)).astype(np.float32)
    drawn[:, [i for i in range(24) if i % 6 < 3]] = np.abs(drawn[:, [i for i in range(24) if i % 6 < 3]])
    full = denoise_pixel(as_dtype(model.siren, np.float64), drawn.astype(np.float64))
    varied = denoise_pixel(plan.model.siren, round_image(drawn))
    assert (np.abs(full - varied) <= bound).all()
    # And it is not ten thousand times what is found: the bound is of this network, not of any.
    assert np.abs(full - varied).max() * 1e4 >= bound.max()


@pytest.mark.parametrize("text", ["rank2", "sine7", "window2", "without-normal", "hidden2", "whole8"])
def test_integers_have_no_variants(text) -> None:
    whole = vary(parse("whole8"), small()).model
    with pytest.raises(InputError, match="the model is one of integers, which come last"):
        vary(parse(text), whole)
    assert vary(parse("full"), whole).model.is_whole


@pytest.mark.parametrize("text", ["rank2+whole8", "sine7+whole8", "whole9", "whole8+window2"])
def test_integers_of_what_rounds_are_refused(text) -> None:
    with pytest.raises(InputError, match="variant"):
        vary(parse(text), small(2, (3,), 4, 1.0))


def test_a_rank_is_short_for_a_variant() -> None:
    found = [with_rank("full", 0), with_rank("full", 2), with_rank("window3", 0)]
    assert found == ["full", "rank2", "window3"]
    with pytest.raises(InputError, match=r"rank 2: the variant is window3 \(name it in the variant"):
        with_rank("window3", 2)


def test_constant_pictures_are_denoised_as_before() -> None:
    """VAR-3: a narrow window sees the mean of its own taps where taps are left out; clamped borders too."""
    model = small()
    picture = np.broadcast_to(image((1, 1)), (5, 6, 6))
    narrow = vary(parse("window2"), model).model
    # The weights are rounded to float32 once more: 96 of them, stretched by less than 10 three times.
    assert np.abs(denoised(narrow, picture) - denoised(model, picture)).max() <= 96 * 1e3 * 2.0**-25 / 16
    dropped = vary(parse("without-normal"), model).model
    flat = picture.copy()
    flat[..., 3:] = 0.0
    assert np.abs(denoised(dropped, flat) - denoised(model, flat)).max() <= 96 * 1e3 * 2.0**-25 / 16
