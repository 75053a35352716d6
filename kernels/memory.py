"""Let NumPy's temporary arrays reuse memory, where the C library is glibc.

glibc gives freed blocks above a moving threshold (128 KiB at first) back to the system, and takes page
faults when it asks for them again. The reference renderer allocates and frees hundreds of such arrays a
bounce, so that its speed could halve with the history of the process (`wamnet bench render`). The sums that
kernels return are such arrays too: page faults took a sixth of the time of a 512x512 frame of 16 samples.
"""

from __future__ import annotations

import ctypes

KEPT_BYTES = 1 << 28
"""Blocks up to this size, and as much free memory in all, stay with the process: 256 MiB."""

M_TRIM_THRESHOLD = -1
"""glibc's name in malloc.h for the free memory at the top of the heap that is kept."""

M_MMAP_THRESHOLD = -3
"""glibc's name in malloc.h for the size from which a block comes from the system directly."""


def keep_freed_memory() -> bool:
    """Set both thresholds of this process to [`KEPT_BYTES`]; tell whether the C library knows how."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False  # another C library, or another system
    return all(mallopt(name, KEPT_BYTES) == 1 for name in (M_TRIM_THRESHOLD, M_MMAP_THRESHOLD))
