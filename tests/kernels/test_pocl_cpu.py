"""Naming the processor for PoCL, on a record made here: no device is touched."""

import ctypes
import weakref

import pytest

from wamnet.kernels.devices import pocl_cpu

libc = ctypes.CDLL(None)
libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
libc.free.argtypes = [ctypes.c_void_p]


def record(*texts, words=128, before=3):
    """Return a device's record of `words` words of the C library that points to `texts`, and the texts.

    The first pointer comes after `before` words.
    """
    kept = [ctypes.create_string_buffer(text) for text in texts]
    memory = (ctypes.c_uint64 * words).from_address(libc.malloc(8 * words))
    weakref.finalize(memory, libc.free, ctypes.addressof(memory))
    memory[:] = [0] * words
    memory[:3] = [3, 0, 2**63 + 8]
    memory[before : before + len(kept)] = list(map(ctypes.addressof, kept))
    return memory, kept


def test_an_unknown_processor_gets_the_name_of_its_level(monkeypatch):
    monkeypatch.setattr(pocl_cpu.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(
        pocl_cpu, "_flags", lambda: pocl_cpu.LEVELS["x86-64-v2"] | pocl_cpu.LEVELS["x86-64-v3"]
    )
    words, _kept = record(b"pthread-name", b"generic", b"x86_64-unknown")
    assert pocl_cpu.name_the_processor(ctypes.addressof(words))
    assert ctypes.string_at(words[4]) == b"x86-64-v3"


def test_a_successor_that_is_taken_for_its_predecessor_gets_its_level(monkeypatch):
    """Zen 4 as Zen 3: by its name without AVX-512, which PoCL's own library then uses even so."""
    monkeypatch.setattr(pocl_cpu.platform, "machine", lambda: "x86_64")
    every = frozenset().union(*pocl_cpu.LEVELS.values())
    monkeypatch.setattr(pocl_cpu, "_flags", lambda: every - {"avx512f"})
    words, _kept = record(b"znver3")
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words)), "a real Zen 3 keeps its name"
    monkeypatch.setattr(pocl_cpu, "_flags", lambda: every)
    assert pocl_cpu.name_the_processor(ctypes.addressof(words))
    assert ctypes.string_at(words[3]) == b"x86-64-v4"


@pytest.mark.parametrize("texts", [(b"znver3-name",), (b"generic-not",), (b"generic", b"generic")])
def test_anything_else_is_left_alone(texts):
    words, _kept = record(*texts)
    before = list(words)
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words))
    assert list(words) == before


def test_size_of_a_record_is_the_c_library_s():
    """glibc rounds up to multiples of 16, and uses 8 bytes of what follows."""
    words, _kept = record(words=100)
    assert 800 <= pocl_cpu._allocated(ctypes.addressof(words)) <= 800 + 16


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


def test_memory_behind_the_record_is_left_alone(monkeypatch):
    """The pointer is in the same piece of readable memory, but just beyond what belongs to the record."""
    monkeypatch.setattr(pocl_cpu.platform, "machine", lambda: "x86_64")
    words, _kept = record(b"generic", before=80)
    monkeypatch.setattr(pocl_cpu, "_allocated", lambda _: 8 * 80)
    before = list(words)
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words))
    assert list(words) == before
    monkeypatch.setattr(pocl_cpu, "_allocated", lambda _: 8 * 81)
    assert pocl_cpu.name_the_processor(ctypes.addressof(words))


def test_no_record_is_searched_further_than_known(monkeypatch):
    monkeypatch.setattr(pocl_cpu.platform, "machine", lambda: "x86_64")
    words, _kept = record(b"generic", words=256, before=pocl_cpu.RECORD_BYTES // 8)
    assert not pocl_cpu.name_the_processor(ctypes.addressof(words))
