"""The cache folder: where it is, what survives damage, and that writers cannot harm readers."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from wamnet.kernels import cache

DATA = {"winner": "tile:16", "ms": [1.5, 2.25], "none": None}
"""Some data."""


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "deep" / "cache"))


def test_the_folder_is_the_user_s(monkeypatch):
    monkeypatch.delenv(cache.FOLDER_VARIABLE)
    monkeypatch.setenv("HOME", "/h")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache.folder() == Path("/h/.cache/wamnet")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache.folder() == Path("/h/.cache/wamnet")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert cache.folder() == Path("/x/wamnet")
    monkeypatch.setenv(cache.FOLDER_VARIABLE, "mine")
    assert cache.folder() == Path("mine")


def test_what_is_written_is_read(caplog):
    assert cache.read_json("a") is None
    path = cache.write_json("a", DATA)
    assert path == cache.folder() / "a.json"
    assert cache.read_json("a") == DATA
    cache.write_json("a", [1])
    assert cache.read_json("a") == [1]
    assert [file.name for file in cache.folder().iterdir()] == ["a.json"], "no unfinished file is left"
    assert cache.folder().stat().st_mode & 0o077 == 0
    assert not caplog.records


DAMAGES = {
    "empty": lambda text: "",
    "half": lambda text: text[: len(text) // 2],
    "number": lambda text: text.replace("1.5", "0.5"),
    "winner": lambda text: text.replace("tile:16", "tile:8"),
    "checksum": lambda text: text.replace('"sha256": "', '"sha256": "0'),
    "form": lambda text: text.replace(cache.SCHEMA, "wamnet-cache-0"),
    "foreign": lambda text: json.dumps({"data": DATA}),
    "list": lambda text: "[]",
    "constant": lambda text: text.replace("1.5", "NaN"),
    "deep": lambda text: "[" * 100_000,
    "binary": lambda text: "\0\xff",
}
"""What may have happened to a file."""


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_entry_is_ignored_with_a_line_and_rewritten(caplog, damage):
    path = cache.write_json("a", DATA)
    text = path.read_text()
    assert DAMAGES[damage](text) != text
    path.write_text(DAMAGES[damage](text), encoding="latin-1")
    assert cache.read_json("a") is None
    assert [record.getMessage() for record in caplog.records] == [
        f"cache entry {path} is damaged, or no entry of wamnet: it is ignored and written again"
    ]
    cache.write_json("a", DATA)
    assert cache.read_json("a") == DATA


def test_a_file_that_is_too_large_is_no_entry(monkeypatch, caplog):
    cache.write_json("a", DATA)
    monkeypatch.setattr(cache, "LARGEST_BYTES", 20)
    assert cache.read_json("a") is None
    assert "at most 20 bytes are read (remove it): it is ignored" in caplog.text


def test_what_cannot_be_read_or_written_costs_no_run(caplog):
    cache.folder().mkdir(parents=True)
    (cache.folder() / "a.json").mkdir()
    assert cache.read_json("a") is None
    assert "is a folder (give the name of a file in it): it is ignored" in caplog.text
    assert cache.write_json("a", DATA) is None
    assert "cannot be written" in caplog.text
    assert [file.name for file in cache.folder().iterdir()] == ["a.json"]


def test_a_folder_that_cannot_be(tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "file" / "cache"))
    assert cache.read_json("a") is None
    assert cache.write_json("a", DATA) is None
    assert "is not used: Not a directory" in caplog.text


def test_names_hold_no_folder():
    with pytest.raises(AssertionError, match="hold no folder"):
        cache.read_json("../a")


def test_keys_tell_parts_and_their_order_apart():
    keys = [cache.key("a", "b"), cache.key("b", "a"), cache.key("ab"), cache.key(["a"], "b"), cache.key("a")]
    assert len(set(keys)) == len(keys)
    assert cache.key({"a": 1, "b": 2}) == cache.key({"b": 2, "a": 1})
    assert cache.key("a", 1.0) != cache.key("a", 1)
