"""Let an old PoCL run on a processor that is newer than its LLVM.

PoCL asks LLVM for the processor's name and hands the name to its compiler. LLVM 14, in the wheel of PoCL
3.0, answers "generic" for processors that it does not know (AMD's since 2022, for example), and its
compiler then refuses every kernel: "unknown target CPU 'generic'" (PoCL's issue 1049). No option or
variable of PoCL 3 changes the name. AMD's Zen 4, which has AVX-512, it takes for its predecessor: PoCL then
links its library for AVX-512 into kernels for a processor without, and LLVM ends the process on some of them
("Cannot select").

1. Nothing is done unless the device's record, as long as the C library says it is [`_allocated`], holds
   exactly one pointer to a name that is wrong [`name_the_processor`], [`MISTAKEN`]: a PoCL that knows the
   processor, or a later one, is left alone.
2. That pointer is set to the name of the instruction set level that the processor has [`level`]: the levels
   of the x86-64 psABI, which LLVM knows since version 12 and which promise no instruction that is missing.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Mapping
from itertools import takewhile
from pathlib import Path

PLATFORM = "Portable Computing Language"
"""PoCL's name among OpenCL's platforms."""

MISTAKEN: Mapping[bytes, str] = {b"generic\0": "x86-64", b"znver3\0": "x86-64-v4"}
"""Names that LLVM 14 gives to processors that it does not know, and the level from which they are wrong: a
real Zen 3 has no AVX-512."""

RECORD_BYTES = 1024
"""How far into a device's record the pointer is looked for: PoCL 3.0 has it at 640 of 1024 bytes."""

LEVELS: Mapping[str, frozenset[str]] = {
    "x86-64": frozenset(),
    "x86-64-v2": frozenset({"cx16", "lahf_lm", "popcnt", "sse4_1", "sse4_2", "ssse3"}),
    "x86-64-v3": frozenset({"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "xsave"}),
    "x86-64-v4": frozenset({"avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"}),
}
"""Levels of the x86-64 psABI, lowest first, and the flags of /proc/cpuinfo that each adds to those before."""

_ORDER = {name: number for number, name in enumerate(LEVELS)}
"""Number of each level, the lowest first."""


def name_the_processor(record: int) -> bool:
    """Give the device with its record at address `record` a processor name, if it has none; say whether."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return False  # elsewhere "generic" is a name that the compiler takes
    readable, reached = _readable(), level(_flags())
    words = range(record, record + min(RECORD_BYTES, _allocated(record)) // 8 * 8, 8)
    wrong = [name for name, least in MISTAKEN.items() if _ORDER[least] <= _ORDER[reached]]
    found = [word for word in words if _inside(word, readable) and _points_to(word, wrong, readable)]
    if len(found) != 1:
        return False
    # The C library's own copy of the text: PoCL may free it when the process ends.
    copy = ctypes.CDLL(None).strdup
    copy.restype, copy.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    ctypes.c_uint64.from_address(found[0]).value = copy(reached.encode())
    return True


def level(flags: frozenset[str]) -> str:
    """Return the highest instruction set level of a processor with these flags."""
    reached = takewhile(lambda name: LEVELS[name] <= flags, LEVELS)
    return list(reached)[-1]


def _allocated(address: int) -> int:
    """Return the bytes that the C library has given out at `address`; 0 where it does not tell."""
    usable = getattr(ctypes.CDLL(None), "malloc_usable_size", None)
    if usable is None:
        return 0
    usable.restype, usable.argtypes = ctypes.c_size_t, [ctypes.c_void_p]
    return int(usable(address))


def _points_to(word: int, texts: list[bytes], readable: list[tuple[int, int]]) -> bool:
    """Return whether the eight bytes at `word` are the address of one of some texts."""
    address = ctypes.c_uint64.from_address(word).value
    return _inside(address, readable) and any(ctypes.string_at(address, len(text)) == text for text in texts)


def _inside(address: int, readable: list[tuple[int, int]]) -> bool:
    """Return whether the eight bytes at `address` may be read."""
    return any(start <= address and address + 8 <= end for start, end in readable)


def _readable() -> list[tuple[int, int]]:
    """Return the readable address ranges of this process; none where the system does not list them."""
    maps = Path("/proc/self/maps")
    lines = [line.split()[:2] for line in maps.read_text().splitlines()] if maps.exists() else []
    spans = [span.split("-") for span, access in lines if access.startswith("r")]
    return [(int(start, 16), int(end, 16)) for start, end in spans]


def _flags() -> frozenset[str]:
    """Return the first processor's feature flags, none where the system does not list them."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    return frozenset(next((line for line in lines if line.startswith("flags")), "").split())
