"""Untrusted files: every text gives a value or one InputError, within limits of time and memory."""

import json
import math
import os
import sys
import tracemalloc
from contextlib import suppress
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl import reading
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.reading import parse_json, plain_name, read_file, refusing, to_dataclass

values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats(allow_nan=False, allow_infinity=False)
    # A lone surrogate is not a text.
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), inner),
)


def parsed(text):
    return parse_json(text, "thing", "fix it")


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "Expecting value"),
        ("[" * 200_000, "nested"),
        ("[" * 65 + "]" * 65, "nested"),
        ('{"a":' * 70 + "0" + "}" * 70, "nested"),
        ('{"a": [0, -1e999]}', r"thing\.a\[1\] '-inf"),
        ("1" * 5000, "digits"),
        ("1." + "1" * 5000, "digits"),
        ("1e999", "thing 'inf': must be a finite number"),
        ("9" * 309, "thing 'inf': must be a finite number"),
        ("[-1" + "0" * 309 + "]", r"thing\[0\] '-inf': must be a finite number"),
        ("NaN", "thing 'nan"),
        ("[Infinity]", r"thing\[0\] 'inf"),
        ('{"a": 1, "a": 1}', "twice"),
        ('{"a": 1, "\\u0061": 1}', "twice"),
        (b"\xef\xbb\xbf[]", "BOM"),
        ('["\\ud800"]', "surrogate"),
        ('{"\\udfff": 1}', "surrogate"),
        (b"\xff\xfe[]", "utf-8"),
        (b'"\xed\xa0\x80"', "utf-8"),
        ("[1] 2", "Extra data"),
        ("[1,]", "Expecting value"),
    ],
)
def test_json_that_is_refused(text, rule):
    with pytest.raises(InputError, match=rule) as refused:
        parsed(text)
    assert len(str(refused.value)) < 600


@pytest.mark.parametrize("piece", ["[],", "{},", '{"a":1},', '"",', '"\\u1234",', "1e9,"])
def test_the_worst_json_of_its_length_takes_bounded_memory(piece):
    """A fiftieth of the most values: 10.24 MiB are a fiftieth of the 512 MiB that RDG-2 states."""
    count = reading.MOST_VALUES // 50 // max(1, sum(map(piece.count, ",[{")))
    text = "[" + piece * (count - 1) + "0]"
    tracemalloc.start()
    try:
        parsed(text)
        assert tracemalloc.get_traced_memory()[1] <= 10.24 * 2**20
    finally:
        tracemalloc.stop()


def test_json_of_too_many_values_is_refused_before_it_is_taken_apart():
    with pytest.raises(InputError, match="4000000 values"):
        parsed("[" + "[]," * reading.MOST_VALUES + "0]")
    # It is counted before texts are known from what is between them.
    with pytest.raises(InputError, match="4000000 values"):
        parsed('"' + "," * (reading.MOST_VALUES + 1) + '"')


def test_json_that_is_too_long_is_refused():
    with pytest.raises(InputError, match="10 bytes"):
        parse_json('"0123456789"', "thing", "fix it", most=10)


@given(st.binary() | st.text())
def test_anything_gives_a_value_or_our_error(content):
    with suppress(InputError):
        value = parsed(content)
        assert parsed(json.dumps(value)) == value


# ---- files ------------------------------------------------------------------------------------------------


def test_a_file_is_read(tmp_path):
    (tmp_path / "a").write_bytes(b"1234")
    (tmp_path / "b").symlink_to("a")
    assert read_file(tmp_path / "a", most=4) == read_file(tmp_path / "b") == b"1234"


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    for path, rule in [
        (tmp_path / "pipe", "not a regular file"),
        (tmp_path / "link", "not a regular file"),
        ("/dev/zero", "not a regular file"),
        (tmp_path, "folder"),
        (tmp_path / "none", "not found"),
        (str(tmp_path) + "\0", "null"),
    ]:
        with pytest.raises(InputError, match=rule):
            read_file(path)


def test_no_more_than_the_limit_is_read(tmp_path):
    path = tmp_path / "long"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(InputError, match=f"{reading.LARGEST_FILE_BYTES} bytes"):
        read_file(path)


@pytest.mark.parametrize("stated", [0, 3, 5, 2**70])
def test_a_file_of_another_length_than_stated_is_not_read(tmp_path, monkeypatch, stated):
    (tmp_path / "file").write_bytes(b"1234")
    assert read_file(tmp_path / "file", stated=4) == b"1234"
    monkeypatch.setattr(reading.os, "fdopen", lambda handle, _mode: Unread(handle))
    with pytest.raises(InputError, match=f"in bytes 4: must be the stated one, {stated}"):
        read_file(tmp_path / "file", stated=stated)


class Unread:
    """An open file that nobody may read."""

    def __init__(self, handle):
        self.handle = handle

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.handle)

    def read(self, _size):
        pytest.fail("it was read")


def test_a_file_that_becomes_shorter_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").write_bytes(b"123")
    found = os.stat_result((0o100644, *[0] * 5, 4, *[0] * 3))
    monkeypatch.setattr(reading.os, "fstat", lambda _handle: found)
    with pytest.raises(InputError, match="stated one, 4"):
        read_file(tmp_path / "file", stated=4)


@pytest.mark.parametrize("sizes", [None, [], {}, {"a": -1}, {"a": 1.0}, {"a": True}, {"a": "1"}, {"b": 1}])
def test_lengths_that_a_manifest_does_not_state_are_refused(sizes):
    assert reading.stated_bytes({"file_bytes": {"a": 7}}, "a", "manifest", "fix it") == 7
    assert reading.stated_bytes({}, "a", "manifest", "fix it") is None, "an older manifest"
    with pytest.raises(InputError, match=r"manifest: file_bytes: a .*: must be the file's length in bytes"):
        reading.stated_bytes({"file_bytes": sizes}, "a", "manifest", "fix it")


def test_a_file_that_grows_after_the_look_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    found = os.stat_result((0o100644, *[0] * 5, 4, *[0] * 3))
    monkeypatch.setattr(reading.os, "fstat", lambda _handle: found)
    with pytest.raises(InputError, match="4 bytes"):
        read_file(path, most=4)


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "/dev/zero", "..\\a", "a\0", 3, None])
def test_names_that_lead_elsewhere_are_refused(name):
    with pytest.raises(InputError, match="plain name"):
        plain_name(name, "name", "fix it")
    assert plain_name("weights.bin", "name", "fix it") == "weights.bin"


# ---- records ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Inner:
    flag: tuple[float, ...] = ()


@dataclass(frozen=True)
class Outer:
    number: float
    count: int
    text: str
    pair: tuple[float, float] | None = None
    inner: Inner = Inner()
    texts: dict[str, str] | None = None


GOOD = {"number": 1, "count": 2, "text": "a", "pair": [1, 2.5], "inner": {"flag": [3]}}


def test_a_record_is_made_by_its_annotations():
    assert to_dataclass(Outer, GOOD, "it") == Outer(1.0, 2, "a", (1.0, 2.5), Inner((3.0,)))
    assert to_dataclass(Outer, {**GOOD, "pair": None}, "it").pair is None


@pytest.mark.parametrize(
    ("key", "value", "path"),
    [
        ("number", True, "it.number"),
        ("number", "1", "it.number"),
        ("number", 10**400, "it.number"),
        ("number", math.nan, "it.number"),
        ("count", 2.0, "it.count"),
        ("count", True, "it.count"),
        ("text", 1, "it.text"),
        ("pair", [1], "it.pair"),
        ("pair", {"a": 1}, "it.pair"),
        ("pair", [1, [2]], r"it.pair\[1\]"),
        ("inner", [], "it.inner"),
        ("inner", {"flag": [0, "x"]}, r"it.inner.flag\[1\]"),
        ("inner", {"flags": []}, "it.inner.flags"),
        ("unknown", 1, "it.unknown"),
    ],
)
def test_a_value_of_another_type_is_refused_with_its_path(key, value, path):
    with pytest.raises(InputError, match=f"^{path}[: ]"):
        to_dataclass(Outer, {**GOOD, key: value}, "it")


def test_a_missing_key_is_refused():
    with pytest.raises(InputError, match=r"it\.count: missing"):
        to_dataclass(Outer, {"number": 1, "text": ""}, "it")


def test_numbers_may_be_limited():
    with pytest.raises(InputError, match="at most 10 "):
        to_dataclass(Outer, {**GOOD, "inner": {"flag": [11]}}, "it", largest=10)


@given(values)
def test_a_record_of_anything_is_made_or_refused(value):
    with pytest.raises(InputError, match="Outer has no such key"):
        to_dataclass(Outer, {**GOOD, "surely unknown": value}, "it")
    for key in GOOD:
        try:
            to_dataclass(Outer, {**GOOD, key: value}, "it")
        except InputError:
            continue


@pytest.mark.parametrize("error", reading.BROKEN)
def test_what_python_raises_becomes_ours(error):
    with pytest.raises(InputError, match="thing 3: rule"), refusing("thing", 3, "rule", "way out"):
        raise error("reason")


def test_bugs_and_interrupts_pass():
    for error in (KeyboardInterrupt, AssertionError, MemoryError):
        with pytest.raises(error), refusing("thing", 3, "rule", "way out"):
            raise error
    assert sys.getrecursionlimit() >= 1000


# ---- memory -----------------------------------------------------------------------------------------------


def test_what_does_not_fit_the_memory_is_refused_before_it_is_asked_for():
    reading.check_room(1, "picture", "1 x 1", "cut it")
    with pytest.raises(
        InputError, match=r"picture '9 x 9': it would take [\d,]+ MiB of memory, and [\d,]+ MiB"
    ):
        reading.check_room(2**60, "picture", "9 x 9", "cut it")


def test_the_limits_of_the_process_count(monkeypatch):
    monkeypatch.setattr(reading.resource, "getrlimit", lambda _limit: (2**30, -1))
    with pytest.raises(InputError, match="would take 1,024 MiB"):
        reading.check_room(2**30, "picture", "9 x 9", "cut it")
