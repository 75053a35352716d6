"""Numbers as text: nothing is lost, and what is not a number is refused in one line."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import InputError
from wamnet.spec.conformance.numbers import from_file, from_json, is_number, number_text, rounded_up, to_json


@given(st.floats(allow_nan=False))
def test_a_float_comes_back_to_the_bit(value):
    found = float(from_json(number_text(value), "x"))
    assert struct.pack("d", found) == struct.pack("d", value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.5, "0x1.8p+0"),
        (0.0, "0x0p+0"),
        (-0.0, "-0x0p+0"),
        (2.0**-1074, "0x0.0000000000001p-1022"),
        (1.0, "0x1p+0"),
        (-math.inf, "-inf"),
        (math.nan, "nan"),
    ],
)
def test_texts_are_short(value, text):
    assert number_text(value) == text


def test_arrays_keep_shape_and_kind():
    assert to_json({"a": np.array([[1, 2]]), "b": (True, 0.5), "c": "text"}) == {
        "a": [[1, 2]],
        "b": [True, "0x1p-1"],
        "c": "text",
    }
    assert from_json([[1, 2], [3, 4]], "x").dtype == np.int64
    assert from_json([1, "0x1p-1"], "x").tolist() == [1.0, 0.5]
    assert from_json([True, False], "x").dtype == np.bool_


@pytest.mark.parametrize(
    "value", ["word", None, {}, ["0x1p+0", "a"], "0x", "0xp+1", [[1.5], [1.5, 2.5]], [10**30]]
)
def test_what_is_no_number_is_refused(value):
    with pytest.raises(InputError, match=r"must be a number|lists must be of one length"):
        from_json(value, "x")


def test_lists_that_are_nested_too_deeply_are_refused():
    value: list = []
    for _ in range(100_000):
        value = [value]
    with pytest.raises(InputError, match="nested too deeply"):
        from_json(value, "x")
    while value:
        value = value[0]


def test_numbers_are_told_from_words():
    assert [is_number(v) for v in (1, "inf", "0x1p+0", "1e3", "color", None, True)] == [True] * 4 + [
        False
    ] * 3


@given(st.one_of(st.just(0.0), st.floats(2.0**-1000, 1e30)))
def test_bounds_are_rounded_up_to_8_bits(bound):
    """The mantissa has 8 bits, so a bound grows by less than 2^-7 of itself."""
    found = float(rounded_up(bound))
    assert bound <= found <= bound * (1 + 2.0**-7)
    assert len(number_text(found)) <= len("0x1.fep-1000")


def test_a_picture_may_be_a_file(tmp_path):
    values = np.arange(6, dtype="<f4")
    (tmp_path / "a.f32").write_bytes(values.tobytes())
    found = from_file({"file": str(tmp_path / "a.f32"), "shape": [1, 2, 3]}, "x")
    assert np.array_equal(found, values.reshape(1, 2, 3))


@pytest.mark.parametrize(
    "value",
    [
        {"file": "a.f32"},
        {"file": "a.f32", "shape": [7]},
        {"file": "a.f32", "shape": ["a"]},
        {"file": "b.f32", "shape": [6]},
        {"shape": [6]},
        {"file": "a.f32", "shape": 6},
        {"file": "a\0b", "shape": [6]},
    ],
)
def test_other_files_are_refused(tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.f32").write_bytes(bytes(24))
    rule = r"little-endian float32 of its shape|cannot be read|not found|must be the stated one, 28"
    with pytest.raises(InputError, match=rule):
        from_file(value, "x")
