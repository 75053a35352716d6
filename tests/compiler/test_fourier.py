"""Transforms, sums from spectra, and their bound: against numpy.fft and direct sums."""

import re

import numpy as np
import pytest
import spectra_sums
from hypothesis import given
from hypothesis import strategies as st

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import profiles
from wamnet.compiler.core.enclosure import round_up
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.trace import trace
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.plan import analysed
from wamnet.compiler.proof import bounds, spectra, spectra_checker
from wamnet.compiler.schedules import fourier
from wamnet.compiler.schedules.fft import Fourier
from wamnet.compiler.schedules.schedules import LARGEST_PRIVATE
from wamnet.compiler.targets import language_named
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.denoise import denoise_pixel
from wamnet.refimpl.network.window import BORDERS, Window

POWERS = (1, 2, 4, 8, 16, 32, 64)
"""Lengths of transforms."""

FFT32 = language_named("opencl").schedules["fft:16"]
TURN, HALF_TURN = 2.8, 2.3
"""FOU-5: coefficients of a product with a factor, and with one of an eighth of a turn."""

CONTRACT = language_named("opencl").sine


def pairs_of(numbers):
    """Return (real, imaginary) of each complex number of an array (n, ...)."""
    return list(zip(numbers.real, numbers.imag, strict=True))


def complexes(pairs):
    return np.array([real + 1j * imaginary for real, imaginary in pairs])


def exact(points, sign):
    """Return the transform by numpy.fft, in float64."""
    numbers = np.asarray(points, np.complex128)
    return np.fft.fft(numbers, axis=0) if sign < 0 else np.fft.ifft(numbers, axis=0) * len(points)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("n", POWERS)
def test_a_transform_is_numpy_s(n, sign) -> None:
    random = np.random.default_rng(n)
    points = random.normal(size=(n, 7)) + 1j * random.normal(size=(n, 7))
    found = complexes(fourier.transform(pairs_of(points), sign))
    # Both are off by less than 20 u of float64 of the norm, which is sqrt(n) |x|.
    assert np.abs(found - exact(points, sign)).max() <= 40 * 2.0**-53 * np.sqrt(n) * np.linalg.norm(points)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("n", POWERS[1:])
def test_a_transform_in_float32_is_within_its_bound(n, sign) -> None:
    random = np.random.default_rng(n)
    points = (random.normal(size=(n, 500)) + 1j * random.normal(size=(n, 500))).astype(np.complex64)
    computed = complexes(fourier.transform(pairs_of(points), sign)).astype(np.complex128)
    wanted = exact(points, sign)
    error, norm = (np.linalg.norm(a, axis=0) for a in (computed - wanted, wanted))
    # Whatever the energies: each layer's largest coefficient.
    found = spectra_checker.layers(n).max(axis=1).sum() * 2.0**-24 * spectra.AGAIN
    assert (error <= found * norm).all()
    # Not far from it either: the largest of many is within a factor of 40 of what no input exceeds.
    assert error.max() >= found * norm[error.argmax()] / 40


@pytest.mark.parametrize("n", POWERS[1:-1])
def test_layers_hold_every_operation_of_the_algorithm(n) -> None:
    """Each number is in log2 n sums; a factor's coefficient is above what its two operations add."""
    layers = spectra_checker.layers(n)
    sums = np.sum(layers == 1.0, axis=0)
    assert set(sums) == {n.bit_length() - 1}
    assert set(layers.ravel()) <= {0.0, 1.0, TURN, HALF_TURN}
    assert (np.diff(layers, axis=0) <= 0).all()
    for size in (2**i for i in range(3, n.bit_length())):
        for k in range(1, size // 4):
            angle = 2 * np.pi * k / size
            factor = np.exp(1j * angle)
            rounded = np.float32(factor.real).astype(float) + 1j * np.float32(factor.imag).astype(float)
            own = abs(rounded - factor) * 2.0**24
            if 8 * k == size:
                assert 2 + own <= HALF_TURN * (1 - 2.0**-10)
            else:
                assert 1 + np.sqrt(1 + abs(np.sin(2 * angle))) + own <= TURN * (1 - 2.0**-10)


def direct(tile, matrix, size):
    """Return the sums (out, out, D_out) of a tile's windows, in float64."""
    views = np.lib.stride_tricks.sliding_window_view(tile.astype(np.float64), (size, size), axis=(0, 1))
    taps = matrix.reshape(len(matrix), size, size, -1)
    return np.einsum("yxcij,nijc->yxn", views, taps)


def drawn(points, size, channels, neurons, seed):
    """Return a tile in float32 and a matrix of float32 numbers in float64."""
    random = np.random.default_rng(seed)
    tile = random.uniform(-2, 2, (points, points, channels)).astype(np.float32)
    matrix = random.uniform(-1, 1, (neurons, size * size * channels)).astype(np.float32)
    return tile, matrix.astype(np.float64)


@given(
    points=st.sampled_from([4, 8, 16]),
    size=st.integers(1, 4),
    channels=st.integers(1, 5),
    neurons=st.integers(1, 5),
    seed=st.integers(0, 2**32 - 1),
)
def test_sums_from_spectra_are_the_direct_ones(points, size, channels, neurons, seed) -> None:
    """FOU-2, FOU-4: channels and neurons go by pairs, also where their number is odd."""
    tile, matrix = drawn(points, size, channels, neurons, seed)
    wanted = direct(tile, matrix, size)
    # In float64: some hundreds of u of the norms.
    whole = tile.astype(np.float64)
    norms = np.linalg.norm(whole) * np.linalg.norm(matrix)
    assert np.abs(spectra_sums.sums(whole, matrix, size) - wanted).max() <= 500 * 2.0**-53 * norms
    computed = spectra_sums.sums(tile, matrix, size)
    assert computed.dtype == np.float32
    bound = spectra.alone(held(matrix, size, points, channels), matrix, channels) * np.linalg.norm(whole)
    assert (np.abs(computed - wanted) <= bound).all()


def held(matrix, size, points, channels):
    """Return what `sums` does: neurons are pairs at half of the layer, nothing is subtracted."""
    rounded = fourier.spectrum(matrix, size, points).astype(np.complex64)[:, :, : points // 2 + 1]
    pairs, order = -(-channels // 2), np.arange(len(matrix))
    lanes, table = -(-len(matrix) // 2), 2 * points * rounded.astype(np.complex128)
    zeros = np.zeros(channels), np.zeros(len(matrix))
    return spectra.Spectra(points, size, order, lanes, fourier.block_of(pairs), zeros[0], table, zeros[1])


@given(
    size=st.integers(1, 4),
    channels=st.integers(1, 7),
    neurons=st.integers(1, 5),
    seed=st.integers(0, 2**32 - 1),
)
def test_all_neurons_of_a_pixel_are_within_their_joint_bound(size, channels, neurons, seed) -> None:
    """With scalings drawn at random, for a tile of the largest numbers."""
    tile, matrix = drawn(8, size, channels, neurons, seed)
    random = np.random.default_rng(seed)
    tile = (2 * np.sign(tile)).astype(np.float32)
    before, after = random.uniform(0.2, 5, -(-channels // 2)), random.uniform(0.2, 5, neurons)
    of = held(matrix, size, 8, channels)
    facts = {"points": 8, "lanes": of.lanes, "block": of.block, "centres": [0.0] * channels}
    ends = np.full(size**2 * channels, 2.0)
    table = of.table.transpose(1, 2, 0, 3), of.bias
    given = {**facts, "order": of.order.tolist()}, matrix, of.bias, table, -ends, ends
    steps = spectra_checker.Tables(*given).steps(before, after)
    error = np.linalg.norm(
        after * (spectra_sums.sums(tile, matrix, size) - direct(tile, matrix, size)), axis=-1
    )
    assert error.max() <= sum(steps)
    assert min(steps[0], *steps[2:]) > 0


@pytest.mark.parametrize("shape", [(5, 3, 7), (4, 6, 2), (2, 1, 1), (3, 4, 4)])
def test_norms_are_above_the_largest_singular_value_and_near_it(shape) -> None:
    """n eigenvalues that are all the largest: n^(1/128) of the norm."""
    random = np.random.default_rng(4)
    matrices = random.normal(size=shape) + 1j * random.normal(size=shape)
    matrices[0] = 0
    found, wanted = np.sqrt(spectra_checker.norms(matrices)), np.linalg.norm(matrices, 2, axis=(-2, -1))
    assert found[0] == 0
    assert (found >= wanted * (1 - 1e-12)).all()
    assert (found <= wanted * min(shape[1:]) ** (1 / 128) * (1 + 1e-12)).all()


def test_the_bound_of_the_paper_s_layer_is_below_that_of_direct_sums() -> None:
    """865 terms in any order, against transforms of 32 points."""
    tile, matrix = drawn(32, 12, 6, 32, 1)
    tile = np.sign(tile)
    bound = spectra.alone(held(matrix, 12, 32, 6), matrix, 6) * np.linalg.norm(tile.astype(np.float64))
    worst = bounds.gamma(865) * np.abs(matrix).sum(axis=1)
    assert bound.max() < worst.min()
    error = np.abs(spectra_sums.sums(tile, matrix, 12) - direct(tile, matrix, 12)).max(axis=(0, 1))
    assert (error <= bound).all()


def test_neurons_of_similar_scalings_share_an_image() -> None:
    """The bound of neurons by twos is that of one image; the order is a permutation that packing undoes."""
    made = emitted(paper())
    found = fourier.arrangement(made, 16)
    assert sorted(found.order) == list(range(32))
    assert found.order.tolist() != list(range(32))
    assert found.centres == (0.0,) * 6
    of = FFT32.spectra(made)
    assert of.both.shape == (2, 16)
    matrix = made.parameters[found.weight].astype(np.float64)
    spectrum = 64 * 32 * fourier.spectrum(matrix, 12, 32)[:, :, :17] / 32
    # Rounded to float32, and 0 where a frequency is its own negative.
    assert np.abs(of.table - spectrum).max() <= 2.0**-24 * np.abs(spectrum).max() * 2


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("shape", [(1, 1), (3, 17), (13, 6)])
def test_norms_are_those_of_the_tiles_that_kernels_gather(border, shape) -> None:
    window, points = Window(4, border), 8
    image = np.random.default_rng(1).normal(size=(*shape, 2))
    centres = (0.25, -1.5)
    out, found = points - window.size + 1, fourier.tile_norms(image, window, points, centres)
    # Pad by more than a tile on all sides, by the border rule.
    mode = {"clamp": "edge", "zero": "constant"}[border]
    padded = np.pad(image, ((20, 20), (20, 20), (0, 0)), mode=mode)
    for y in range(shape[0]):
        for x in range(shape[1]):
            top, left = (20 + at // out * out - window.size // 2 for at in (y, x))
            tile = padded[top : top + points, left : left + points]
            # Sums of 128 squares and a root, in both; the middles' squares are widened by 2^-40.
            assert found[y, x] == pytest.approx(np.linalg.norm(tile - centres), rel=2.0**-38)


# ---- the schedule ----------------------------------------------------------------------------------------


def program(widths=(96, 20, 3), channels=6, size=4, border="clamp"):
    network = siren.init(list(widths), 3.0, 3.0, seed=1, dtype=np.float32)
    gather = Gather(Window(size, border), (Image("a", channels, -2.0, 2.0),))
    kind = {"window": Type(shape=(gather.n_inputs,))}
    return analysed(trace(lambda window: denoise_pixel(network, window), kind, gather))


def paper(channels=6, size=12, hidden=32):
    return program((size * size * channels, hidden, 32, 3), channels, size)


def test_the_manifest_states_the_bound_of_spectra() -> None:
    found, tiled = (compile_program(paper(), "opencl", name) for name in ("fft:16", "tile:16"))
    assert found.manifest["schedule"]["name"] == "fft:16"
    assert (found.manifest["schedule"]["pixels"], found.manifest["schedule"]["rows"]) == (42, 21)
    assert found.certificate is not None
    proven = found.certificate["bound"]["output"]
    assert found.manifest["bound"]["output"] == [round_up(error) for error in proven]
    # One neuron after another, each at its worst, is a larger bound.
    errors = bounds.output_errors(paper(), FFT32.enclosures(paper(), CONTRACT))["color"]
    assert (np.array(proven) < errors).all()
    assert found.manifest["bound"] != tiled.manifest["bound"]
    assert f"<= {max(found.manifest['bound']['output']):g} for all images" in found.source
    assert "Global size: at least (ceil(width / 42), ceil(height / 21))" in found.source


def test_rows_of_a_picture_have_the_bounds_of_the_picture() -> None:
    image = {"a": np.random.default_rng(1).uniform(-2, 2, (45, 4, 6)).astype(np.float32)}
    whole = FFT32.enclosures(paper(), CONTRACT, image)[-1].error
    rows = [slice(top, top + 20) for top in (0, 20, 40)]
    parts = [FFT32.enclosures(paper(), CONTRACT, image, some)[-1].error for some in rows]
    assert whole.shape == (45, 4, 3)
    assert np.array_equal(np.concatenate(parts), whole)


REFUSED = {
    "small": (lambda: paper(size=3), "tile:16", r"the direct sum takes 108 operations .*, spectra 7\d"),
    "large": (lambda: paper(size=32, channels=1), "tile:16", "a window of 32 x 32 pixels in a tile of 32"),
    "private": (
        lambda: paper(hidden=160),
        "tile:16",
        rf"its arrays take \d+ bytes a work item, of at most {LARGEST_PRIVATE}",
    ),
    "component": (
        lambda: trace(
            lambda x: x[..., 0] * 2.0,
            {"window": Type(shape=(3,))},
            Gather(Window(1), (Image("a", 3, 0.0, 1.0),)),
        ),
        "plain",
        "%1 is component, which has no form on vectors",
    ),
}
"""Programs that the schedule does not hold, what takes its place, and the reason."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_it_does_not_hold_is_tiled_with_the_reason(case) -> None:
    make, instead, reason = REFUSED[case]
    found = compile_program(make(), "opencl", "fft:16").manifest["schedule"]
    assert (found["name"], found["asked"]) == (instead, "fft:16")
    assert re.match(reason, found["reason"])


TWICE = np.linspace(-0.1, 0.1, 36**2, dtype=np.float32).reshape(36, 36)
"""A matrix that fits a window of 6 x 6 pixels and a layer."""


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (lambda x: np.sin(x @ TWICE.T) @ TWICE.T, "a matrix is applied to the window and to a layer"),
        (lambda x: x @ TWICE.T + x @ TWICE[::-1].T, "2 affine maps read the window, not one"),
    ],
)
def test_two_readers_are_refused(function, reason) -> None:
    gather = Gather(Window(6), (Image("a", 1, 0.0, 1.0),))
    assert FFT32.refusal(trace(function, {"window": Type(shape=(36,))}, gather)).startswith(reason)


def test_windows_along_one_axis_are_refused() -> None:
    found = compile_program(paper(), "opencl", "fft:16", rank=4).manifest
    assert found["schedule"]["reason"] == "a window of 12 x 1 pixels in a tile of 32"
    assert found["schedule"]["name"] == "tile:16"


def test_sums_that_may_overflow_are_refused() -> None:
    network = siren.init([150, 32, 3], 3.0, 3.0, seed=1, dtype=np.float32)
    gather = Gather(Window(5), (Image("a", 6, -1e38, 1e38),))
    traced = trace(lambda x: denoise_pixel(network, x), {"window": Type(shape=(150,))}, gather)
    found = FFT32.enclosures(analysed(traced), CONTRACT)
    index = next(i for i, node in enumerate(analysed(traced).nodes) if node.op == "affine")
    assert found[index].overflows
    assert np.isinf(found[index].error).all()
    with pytest.raises(CompileError, match=r"affine \(layer 0, %\d\) may reach"):
        compile_program(traced, "opencl", "fft:16")


def emitted(program):
    return pipeline.run(program, profiles.profile_named("ieee").passes)


def test_golden_spectra(golden) -> None:
    """Tiles of 4 x 4 points, vectors of 4 numbers, blocks of 2 pixels."""
    network = siren.init([12, 5, 2], 3.0, 3.0, seed=1, dtype=np.float32)
    gather = Gather(Window(2, "zero"), (Image("i0", 2, -1.0, 1.0), Image("i1", 1, -1.0, 1.0)))
    first, last = network.weights
    function = lambda x: np.sin(x @ first.T) @ last.T  # noqa: E731
    traced = trace(function, {"window": Type(shape=(12,))}, gather)
    idea = "small tiles"
    for dialect in (OpenCL(), C()):
        tiny = Fourier(dialect, "fft4", idea, lanes=4, pixels=2, points=4, tiles=1)
        golden(
            f"fft4.denoise{dialect.suffix}", tiny.renderer(analysed(traced), True).source(["a tiny kernel"])
        )
