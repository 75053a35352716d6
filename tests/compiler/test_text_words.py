"""Reading products of bytes: words, their bytes, ranges of integers (spec/text.md)."""

import json

import numpy as np
import pytest
from texts import changed, parts, planned

from wamnet.compiler.proof.evidence import Refused
from wamnet.compiler.reading import field, integers, terms
from wamnet.compiler.reading.check import check_text, run_text
from wamnet.compiler.reading.lanes import Unread, Wrong

# What breaks a byte's marker shows where its text is read, not where it is summed.
NO_MARKER = "begins with no token|which nothing defines"


@pytest.fixture(scope="module")
def dot16(tmp_path_factory):
    return parts(planned(tmp_path_factory.mktemp("dot:16"), "opencl", "dot:16", border="clamp"))


@pytest.fixture(scope="module")
def dot_c(tmp_path_factory):
    return parts(planned(tmp_path_factory.mktemp("dot_c"), "c", "dot:16"))


@pytest.fixture(scope="module", params=["cuda", "opencl"])
def grouped(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("grouped")
    return parts(planned(folder, request.param, "groupdot:4", border="clamp"))


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
        (" + 128);", " + 127);", "another number far from borders"),
        (" + 128);", " + 129);", "a byte of an integer that is not one|before it is written"),
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


def test_integers_are_not_those_of_the_field(dot16):
    """TXT-5: P more is another integer far from borders."""
    sizes = "WINDOW_SIZE * PATCH_WIDTH * 3"
    begun = changed(dot16, "    for (int dy", f"    int q[{sizes}];\n    for (int dy")
    for index, pixel in (("i", "left) * 3 + i"), ("dx * 3 + c", "column) * 3 + c")):
        at, number = f"dy * PATCH_WIDTH * 3 + {index}]", f"(int)image_color[(row * width + {pixel}] + 128"
        more = f" + {field.P}" if index == "i" else ""
        begun = changed(begun, f"patch_color[{at} = (uchar)({number})", f"q[{at} = {number}{more}")
    end = "    float16 v1[PIXELS];"
    made = f"    for (int i = 0; i < {sizes}; ++i) {{ patch_color[i] = (uchar)q[i]; }}\n"
    with pytest.raises(Refused, match="another number far from borders"):
        run_text(*changed(begun, end, made + end))


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


DEAD = (
    "if (1 < 0) { float t301 = (float)t300; float t302 = t301; t301 = t302; }",
    "for (int k = 0; k < 0; ++k) { int t301 = t300; t301 = t300 + t301; }",
    "v1[i] = (float)t300;",
)
"""What comes of nothing: in branches that are never taken, or behind the last use."""


@pytest.mark.parametrize("dead", DEAD)
@pytest.mark.parametrize(
    ("line", "new"),
    [
        ("uint t43 = t42 & 1u;", "(int)((float)t43 * 1.0e+20f)"),
        ("float t49 = t40 * t48;", "(int)(t49 * 1.5f)"),
        ("float t49 = t40 * t48;", "(int)(t48 * 3.0e+09f)"),
        ("int t2 = (int)v1[i];", "t2 * 100000000"),
        ("int t2 = (int)v1[i];", "t2 * t2 * t2 * t2"),
        ("int t85 = (int)v84[i];", "(int)(float)t85 * 100000000"),
    ],
)
def test_integers_of_bytes_that_nothing_uses_are_refused(dot_c, line, new, dead):
    """TXT-6: what overflows is undefined; a branch that is never taken does not use it."""
    line, new, dead = (
        t.replace("uint ", "uint32_t ").replace("(int)", "(int32_t)") for t in (line, new, dead)
    )
    line = line if line in dot_c[0] else line.replace("int ", "int32_t ")
    with pytest.raises((Refused, Unread), match=r"may be beyond int32|never read"):
        run_text(*changed(dot_c, line, f"{line} int t300 = {new}; {dead}"))


def test_vectors_are_filled_up_with_zeros(tmp_path):
    """TXT-11: six neurons in vectors of four have two beside them, whose weights are 0."""
    given = parts(planned(tmp_path, "opencl", "group:1"))
    assert run_text(*given)["sums"] == 3


def test_weights_in_another_order_are_refused(dot16):
    """TXT-11: weights.bin is read bit by bit."""
    source, held, manifest, weights = dot16
    turned = weights.copy()
    turned[[0, 1]] = turned[[1, 0]]
    with pytest.raises(Refused, match="never made"):
        run_text(source, held, manifest, turned)


def number(low, high, kind="int32"):
    """Return a number of an image, an integer between two ends."""
    shape = field.hashed("image", np.array([[low]]), high)
    span = np.full((1, 1), low), np.full((1, 1), high)
    return terms.Term(shape, None if kind == "float32" else field.drawn(shape), kind=kind, span=span)


def refuse(bad, why):
    if np.any(bad):
        raise Wrong(why)


def made(what, a, b):
    return integers.operate(what, a, b, refuse)


def test_sums_that_may_leave_32_bits_are_refused():
    total = made("add", terms.constant(127, "int32"), number(-127, 127))
    assert [end.item() for end in total.span] == [0, 254]
    with pytest.raises(Wrong, match="what int32 holds"):
        made("add", terms.constant(127, "int32"), number(0, 2**31 - 127))
    assert made("add", terms.constant(1, "uint32"), number(0, 2**32 - 1, "uint32")).span is None
    assert made("multiply", number(0, 3), number(0, 5)).span is None


def test_words_are_made_of_bytes_with_signs():
    """TXT-11: a number that does not fit a byte is refused."""
    known = integers.Ranges({"program": ""}, {}, stated=True)
    parts = [number(low, high, "float32") for low, high in ((-127, 127), (0, 127), (-1, 0), (-128, -128))]
    word = integers.packed(parts, known, refuse)
    assert all(np.array_equal(word.part(k).shape, part.shape) for k, part in enumerate(parts))
    for other in ((0, 128), (-129, 0), (2, 1)):
        with pytest.raises(Wrong, match="a byte of an integer that is not one"):
            integers.packed([*parts[:3], number(*other, "float32")], known, refuse)
    weights = terms.known_integers(np.array([[0x7F00FE01]]), "int32")
    found = integers.dots(weights, word, refuse)
    factors = np.array([1, -2, 0, 127])
    drawn = [int(field.drawn(part.shape)[0, 0, 0]) for part in parts]
    assert found.sums[0, 0, 0] == sum(n * int(w) for n, w in zip(factors, drawn, strict=True)) % int(field.P)
    assert [end.item() for end in found.span] == [-127 - 254 - 127 * 128, 127 - 127 * 128]


def test_floats_hold_no_sums_beyond_24_bits():
    one, other = number(0, 2**24), number(0, 2**24 + 1)
    assert integers.as_float(one, lambda term: term, refuse).kind == "float32"
    with pytest.raises(Wrong, match="beyond 16777216"):
        integers.as_float(other, lambda term: term, refuse)
