"""Reading products of bytes: words, their bytes, ranges of integers (spec/text.md)."""

import json

import numpy as np
import pytest
from texts import changed, parts, planned, unnoticed

from wamnet.compiler.proof.evidence import Refused
from wamnet.compiler.reading import field, words
from wamnet.compiler.reading.check import check_text, run_text
from wamnet.compiler.reading.lanes import Unread, Wrong

# What breaks a byte's marker shows where its text is read, not where it is summed.
NO_MARKER = "begins with no token|which nothing defines"
GROUPS = ("cuda", "glsl-vulkan", "opencl", "wgsl")


@pytest.fixture(scope="module")
def dot16(tmp_path_factory):
    return parts(planned(tmp_path_factory.mktemp("dot:16"), "opencl", "dot:16", border="clamp"))


@pytest.fixture(scope="module", params=["cuda", "opencl"])
def grouped(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("grouped")
    return parts(planned(folder, request.param, "groupdot:4", border="clamp"))


@pytest.mark.product
@pytest.mark.product
@pytest.mark.parametrize(
    ("target", "schedule"),
    [
        ("opencl", "dot:16"), ("c", "dot:16"), ("cuda", "groupdot:4"), ("wgsl", "groupdot:4"),
        ("opencl", "groupdot:4"), ("glsl-vulkan", "groupdot:4"), ("opencl", "tile:16"),
        ("glsl-vulkan", "group:4"),
    ],
)  # fmt: skip
@pytest.mark.parametrize(("border", "size"), [("zero", 3), ("clamp", 4)])
def test_texts_of_bytes_compute_what_is_certified(target, schedule, border, size, tmp_path):
    """TXT-7, TXT-11: every schedule of bytes, in every language that has it."""
    found = check_text(planned(tmp_path, target, schedule, border=border, size=size))
    pixels = json.loads((tmp_path / "manifest.json").read_text())["schedule"]["pixels"]
    assert found["sums"] == 3 * pixels


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (" + 128);", " + 127);", "never made"),
        (" + 128);", " + 129);", "never made"),
        ("sum[p][0] = w[18];", "sum[p][0] = w[19];", "beyond 16777216|never made"),
        ("(four).s1, 16)", "(four).s1, 8)", NO_MARKER),
        ("(four).s1, 16)", "(four).s0, 16)", NO_MARKER),
        ("(int)(byte)", "(int)(byte) - 1", NO_MARKER),
        ("(sums)(as_int(four)), weight", "(sums)(as_int(four)), weight >> (sums)(8)", NO_MARKER),
        ("sum[p][0] = DOT(sum[p][0],", "sum[p][0] = DOT(sum[p][0] * 65536,", "to another sum"),
        ("w0 = w[dy * 3 + i];", "w0 = w[dy * 3 + i + 1];", "never made"),
        ("+ p) * 3 + 4 * i", "+ p) * 3 + 3 * i", "never made"),
        ("PATCH_WIDTH * 3 + i] = 0;", "PATCH_WIDTH * 3 + i];", "is not an assignment"),
        ("bytes49[i] = (uchar)", "bytes49[i] = (char)", "char is not declared"),
    ],
)
def test_faults_of_bytes_are_named(dot16, old, new, why):
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(dot16, old, new))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(uint)(int)b & 255u", "(uint)(int)b & 127u"), ("255u) << 8", "255u) << 7"),
        ("255u) << 8", "255u) << 16"), ("& 255u) << 16", ") << 16"),
        ("(uint)(int)d << 24", "(uint)(int)d << 16"),
        ("((uint)(int)a", "((uint)(int)b"),
    ],
)  # fmt: skip
def test_faults_of_words_are_noticed(grouped, old, new):
    """A word has each byte at its own place, and nothing of another's sign."""
    pair = [t.replace("uint", "unsigned int") if "__dp4a" in grouped[0] else t for t in (old, new)]
    with pytest.raises((Refused, Unread), match=NO_MARKER):
        run_text(*changed(grouped, *pair))


def test_weights_in_another_order_are_refused(dot16):
    """TXT-11: weights.bin is read bit by bit."""
    source, held, manifest, weights = dot16
    turned = weights.copy()
    turned[[0, 1]] = turned[[1, 0]]
    with pytest.raises(Refused, match="never made"):
        run_text(source, held, manifest, turned)


@pytest.mark.nightly(but="wgsl-groupdot:4-8")
@pytest.mark.parametrize(
    ("target", "schedule", "count"), [("opencl", "dot:16", 8), ("wgsl", "groupdot:4", 8)]
)
def test_planted_faults_in_bytes_are_noticed(target, schedule, count, tmp_path):
    """TXT-8: what holds the reader."""
    assert unnoticed(parts(planned(tmp_path, target, schedule)), count) == []


def known(low, high, kind="int32"):
    """Return a number of an image, an integer between two ends."""
    return field.leaf(field.hashed("image", np.array([low, high])), kind, span=(low, high))


def test_sums_that_may_leave_32_bits_are_refused():
    weight = words.integers(127, "int32", weight=True)
    assert words.operate("multiply", weight, known(-127, 127)).span == (-16129, 16129)
    with pytest.raises(Wrong, match="int32 does not hold"):
        words.operate("multiply", weight, known(0, 2**25))
    assert words.operate("add", words.integers(1, "uint32"), known(0, 2**32 - 1, "uint32")) is None


def test_what_cancels_is_the_same_integer():
    """Nothing rounds: n + 128 - 128 is n, unlike sums of floats."""
    n, byte = known(-127, 127), words.integers(128, "int32")
    again = words.operate("subtract", words.operate("add", n, byte), byte)
    assert np.array_equal(again.value % field.P, n.value % field.P)


def test_bytes_move_as_words_are_shifted():
    n, by = known(-127, 127), [field.literal(b, "int32") for b in (8, 24, 255)]
    low = words.moved("bitwise_and", n, by[2])
    assert low.span is None  # of a negative one it is another number
    assert words.moved("bitwise_and", known(0, 127), by[2]).span == (0, 127)
    top = words.moved("left_shift", low, by[1])
    back = words.moved("right_shift", top, by[1])
    assert back.span == (-127, 127)
    assert np.array_equal(back.value, n.value)
    none = words.moved("right_shift", words.moved("left_shift", low, by[0]), by[1])
    assert none.parts == (words.ZERO,) * 4
    assert words.moved("left_shift", low, field.literal(7, "int32")) is None


def test_shifts_of_known_words_wrap():
    word = words.integers(np.array([-2, 0x7F80]), "int32", weight=True)
    moved = words.moved("left_shift", word, field.literal(16, "int32"))
    assert words.known(moved).tolist() == [-(2**17), 0x7F800000]
    assert words.known(words.moved("right_shift", moved, field.literal(24, "int32"))).tolist() == [-1, 127]
