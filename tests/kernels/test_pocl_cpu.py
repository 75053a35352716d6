"""Naming the processor for PoCL, on a record made here: no device is touched."""

from __future__ import annotations

import ctypes

import pytest

from wamnet.kernels import pocl_cpu


def record(*texts):
    """Return a device's record of 256 words that points to `texts`, and what keeps the texts alive."""
    kept = [ctypes.create_string_buffer(text) for text in texts]
    words = (ctypes.c_uint64 * 256)(3, 0, 2**63 + 8, *map(ctypes.addressof, kept))
    return words, kept


def test_an_unknown_processor_gets_the_name_of_its_level(monkeypatch):
    monkeypatch.setattr(pocl_cpu.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(
        pocl_cpu, "_flags", lambda: pocl_cpu.LEVELS["x86-64-v2"] | pocl_cpu.LEVELS["x86-64-v3"]
    )
    words, _ = record(b"pthread-name", b"generic", b"x86_64-unknown")
    assert pocl_cpu.name_the_processor(ctypes.addressof(words))
    assert ctypes.string_at(words[4]) == b"x86-64-v3"


@pytest.mark.parametrize("texts", [(b"znver3-name",), (b"generic-not",), (b"generic", b"generic")])
def test_anything_else_is_left_alone(texts):
    words, _ = record(*texts)
    before = list(words)
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words))
    assert list(words) == before


def test_other_architectures_are_left_alone(monkeypatch):
    monkeypatch.setattr(pocl_cpu.platform, "machine", lambda: "aarch64")
    words, _ = record(b"generic")
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words))


def test_system_without_lists_is_left_alone(monkeypatch):
    monkeypatch.setattr(pocl_cpu, "_readable", list)
    words, _ = record(b"generic")
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words))


@pytest.mark.parametrize(
    ("flags", "name"), [((), "x86-64"), (("avx512f",), "x86-64"), (("abm", "avx"), "x86-64")]
)
def test_a_level_needs_all_its_flags(flags, name):
    assert pocl_cpu.level(frozenset(flags)) == name


def test_a_level_needs_those_below_it():
    everything = frozenset().union(*pocl_cpu.LEVELS.values())
    assert pocl_cpu.level(everything) == "x86-64-v4"
    assert pocl_cpu.level(everything - {"fma"}) == "x86-64-v2"
