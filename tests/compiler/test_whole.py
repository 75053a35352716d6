"""Programs in which nothing rounds: ranges hold all values, and each rule refuses what it must."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Program, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.cuda import CUDA
from wamnet.compiler.languages.glsl_buffers import Vulkan
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.wgsl import WGSL
from wamnet.compiler.plan import analysed, plan_program
from wamnet.compiler.proof import whole
from wamnet.compiler.schedules.bytes import Dot, GroupDot
from wamnet.compiler.targets import LANGUAGES, language_named
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.whole import SINES, Whole, forward_whole, rounded
from wamnet.refimpl.network.window import Window

CHANNELS = {"a": 3, "b": 1}
"""Images of the networks here."""

LARGEST = 127.0
"""The end of their range."""


def program(function, low: float = -LARGEST, high: float = LARGEST, is_whole: bool = True) -> Program:
    """Trace a function of a window of one pixel."""
    images = tuple(Image(name, n, low, high, whole=is_whole) for name, n in CHANNELS.items())
    gather = Gather(Window(1, "clamp"), images)
    return analysed(trace(function, {"window": Type(shape=(gather.n_inputs,))}, gather))


def network(amplitude: int = 127, seed: int = 1):
    return rounded(siren.init((4, 5, 6, 3), 1.0, 5.0, seed=seed), 1, amplitude)


@settings(max_examples=8)
@given(seed=st.integers(0, 2**16), amplitude=st.sampled_from(sorted(SINES)))
def test_ranges_hold_all_values(seed, amplitude) -> None:
    net = network(amplitude, seed)
    found = program(lambda window: forward_whole(net, window))
    drawn = np.random.default_rng(seed).integers(-127, 128, (50, 4)).astype(np.float32)
    drawn[0], drawn[1] = -127, 127
    for index, (node, (low, high, grain)) in enumerate(zip(found.nodes, whole.known(found), strict=True)):
        one = replace(found, outputs=(("it", index),))
        if node.op in ("constant", "parameter"):
            continue
        values = interpret(one, {"window": drawn})["it"].astype(np.float64)
        assert (low <= values).all(), node
        assert (values <= high).all(), node
        assert (values / 2.0**grain == np.floor(values / 2.0**grain)).all(), node


@pytest.mark.parametrize("target", LANGUAGES)
def test_every_kernel_states_the_bound_zero(target) -> None:
    net = network()
    traced = program(lambda window: forward_whole(net, window))
    for number, schedule in enumerate(LANGUAGES[target].schedules):
        artifact = compile_program(
            traced, language_named(target).under(("native", "ieee")[number % 2]), schedule
        )
        assert artifact.manifest["bound"]["output"] == [0.0, 0.0, 0.0]
        assert "same bits" in artifact.source
        assert all(image["whole"] for image in artifact.manifest["images"])


MATRIX = np.full((3, 4), 100.0, np.float32)
"""Weights whose sums are 3 * 100 * 127 + 100 * 127 at most."""

REFUSED = {
    "fractions in the images": (lambda x: np.matmul(x, MATRIX.T), "hold integers", {"is_whole": False}),
    "sums beyond 2^24": (lambda x: np.matmul(x, 400 * MATRIX.T), "of at most 2", {}),
    "a sine": (lambda x: np.sin(np.matmul(x, MATRIX.T)), "may round", {}),
    "a quotient": (lambda x: np.matmul(x, MATRIX.T) / 2.0, "may round", {}),
    "weights of many digits": (lambda x: np.matmul(x, np.float32(1e-9) * MATRIX.T), "a sum may be", {}),
    "products of fractions": (
        lambda x: np.matmul(x, np.float32(2.0**-20) * MATRIX.T) * 1.001,
        "units of",
        {},
    ),
    "a negative number in a word": (
        lambda x: np.matmul(x, MATRIX.T).astype(np.uint32),
        "not in uint32",
        {},
    ),
    "a fraction in an integer": (lambda x: (x * 0.5).astype(np.int32), "not of integers", {}),
    "an integer that overflows": (
        lambda x: np.matmul(x, MATRIX.T).astype(np.int32) * 2**20,
        "not in int32",
        {},
    ),
    "a large word in a float": (
        lambda x: (x.astype(np.int32).astype(np.uint32) * 3).astype(np.float32),
        "of at most 2",
        {},
    ),
}
"""Functions with an operation that may round, what the refusal says, and the images."""


@pytest.mark.parametrize("name", REFUSED)
def test_what_may_round_is_refused(name) -> None:
    function, message, images = REFUSED[name]
    found = program(function, **images)
    with pytest.raises(whole.Rounds, match=message):
        whole.known(found)
    assert not whole.holds(found)


def test_a_shift_by_an_unknown_number_is_refused() -> None:
    """NumPy gives 0 for a shift by 32, C gives anything."""

    def shifted(x):
        words = np.maximum(x, 0.0).astype(np.uint32)
        return (words >> words).astype(np.float32)

    with pytest.raises(whole.Rounds, match="not a constant below 32"):
        whole.known(program(shifted))


def test_the_sum_of_magnitudes_counts_not_the_range() -> None:
    """Over images that hold one value only, the sum of two large products is 0, and its parts are not."""
    large = np.float32([[2.0**18, -(2.0**18), 0, 0]])
    found = program(lambda x: np.matmul(x, large.T), low=127.0)
    with pytest.raises(whole.Rounds, match="of at most 2"):
        whole.known(found)


def test_zeros_of_either_sign_are_no_promise_of_bits() -> None:
    """A sum of products is -0 or 0 by its order; a colour has one zero."""
    net = network()
    sums = program(lambda window: np.matmul(window, net.weights[0].T))
    assert whole.holds(sums)
    assert not whole.has_one_zero(sums)
    assert "a zero may have either sign" in compile_program(sums, "c").source
    assert whole.has_one_zero(program(lambda window: forward_whole(net, window)))


def test_a_cut_or_another_arithmetic_is_not_whole() -> None:
    net = network()
    traced = program(lambda window: forward_whole(net, window))
    assert plan_program(traced, "opencl").is_whole
    fractions = program(lambda window: forward_whole(net, window), is_whole=False)
    assert not plan_program(fractions, language_named("opencl").under("native")).is_whole


# ---- products of bytes -----------------------------------------------------------------------------------


def smallest(channels) -> Program:
    """Return the smallest program that has all parts: several images, a hidden layer, what is filled up."""
    images = tuple(Image(name, n, -LARGEST, LARGEST, whole=True) for name, n in channels.items())
    gather = Gather(Window(2, "zero"), images)
    net = rounded(siren.init((gather.n_inputs, 3, 3), 1.0, 5.0, seed=1), 2)
    types = {"window": Type(shape=(gather.n_inputs,))}
    return analysed(trace(lambda x: forward_whole(net, x), types, gather))


@pytest.mark.parametrize("dialect", [CUDA(), WGSL(), Vulkan(), OpenCL()])
def test_the_text_of_grouped_dots(golden, dialect) -> None:
    tiny = GroupDot(dialect, "groupdot:1", "a tiny group", pixels=1, group=(4, 2))
    found = tiny.renderer(smallest({"a": 3, "b": 2}), False).source(["a tiny kernel"])
    golden(f"groupdot.denoise{dialect.suffix}", found)


def test_a_tile_of_words_takes_a_quarter() -> None:
    """Five channels are two words of a pixel; 21 are six, of which four are in the tile at once."""
    for channels, words in (({"a": 3, "b": 2}, 2), ({"a": 4, "b": 17}, 4)):
        tiny = GroupDot(WGSL(), "groupdot:4", "a tiny group", pixels=4, group=(8, 8))
        assert tiny.details(smallest(channels))["shared_bytes"] == 4 * words * (8 * 4 + 1) * (8 + 1)


def test_the_text_of_dots(golden) -> None:
    found = smallest(CHANNELS)
    for dialect in (C(), OpenCL()):
        tiny = Dot(dialect, "dot:4", "a tiny tile", lanes=4, pixels=2)
        golden(f"dot4.denoise{dialect.suffix}", tiny.renderer(found, True).source(["a tiny kernel"]))


@pytest.mark.parametrize("schedule", ["dot:16", "groupdot:4"])
@pytest.mark.parametrize("halved", ["weights", "numbers", "nothing"])
def test_halves_are_no_bytes(schedule, halved) -> None:
    """They do not round, so that the program is exact; as bytes they would lose their halves."""
    first, second = np.float32([[1, 2, 3, 5], [3, -1, 1, 7]]), np.float32([[1, 2], [3, -1]])
    scale, half = (np.float32(0.5 if halved == what else 1.0) for what in ("weights", "numbers"))
    found = program(lambda x: np.clip(half * np.clip(x @ first.T, 0.0, 99.0) @ (scale * second).T, 0.0, 9.0))
    assert whole.holds(found)
    picked = compile_program(found, "opencl", schedule=schedule).manifest["schedule"]
    assert (picked["name"] == schedule) == (halved == "nothing")
    assert (
        picked.get("reason", "its numbers or weights are fractions") == "its numbers or weights are fractions"
    )


@pytest.mark.parametrize("language", ["wgsl", "glsl-vulkan", "metal", "opencl"])
def test_a_tile_reads_weights_as_they_are_declared(language) -> None:
    """Integers of a layer are read one by one, which a buffer of vectors has no name for."""
    chosen = compile_program(program(lambda x: forward_whole(network(), x)), language, schedule="tile:4")
    read = set(re.findall(r"\b(weights|w)\[", chosen.source))
    pointers = {"w", "weights"} if language in ("metal", "opencl") else {"weights"}
    assert read <= pointers
    assert (chosen.manifest["schedule"]["name"] == "tile:4") == (language in ("metal", "opencl"))


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        (lambda net: net, ""),
        (lambda net: rounded(siren.init((4, 5, 6, 3), 1.0, 5.0, seed=1), 1, 511), "more than 8 bits"),
        (lambda net: siren.init((4, 5, 6, 3), 1.0, 5.0, seed=1), "not of integers"),
    ],
)
def test_what_bytes_do_not_hold_is_refused(changed, reason) -> None:
    net = changed(network())
    pixel = forward_whole if isinstance(net, Whole) else siren.forward
    found = program(lambda window: pixel(net, window), is_whole=isinstance(net, Whole))
    tile = Dot(C(), lanes=16, pixels=14).refusal(found)
    group = GroupDot(WGSL(), pixels=4, group=(8, 8)).refusal(found)
    assert reason in tile
    assert (reason in group) or not reason
    assert bool(reason) == bool(tile) == bool(group)
