"""What a process asks of the C library and the system: freed memory that it keeps, and room on its stacks.

1. NumPy's temporary arrays reuse memory, where the C library is glibc [`keep_freed_memory`].
2. Threads have room for a kernel's arrays, and compilers for their recursion, where the system's limit of
   stacks (`ulimit -s`) is low [`widen_stacks`].

glibc gives freed blocks above a moving threshold (128 KiB at first) back to the system, and takes page
faults when it asks for them again. The reference renderer allocates and frees hundreds of such arrays a
bounce, so that its speed could halve with the history of the process (`wamnet bench render`). The sums that
kernels return are such arrays too: page faults took a sixth of the time of a 512x512 frame of 16 samples.
"""

from __future__ import annotations

import ctypes
import os
import resource
from contextlib import suppress

from ..refimpl.errors import ExecutorUnavailable

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


def cores() -> int:
    """Return the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


THREAD_STACK = 1 << 21
"""Least stack of a thread that starts after [`widen_stacks`], in bytes: twice a kernel's arrays at most."""

STACK = 1 << 23
"""The limit of stacks that is requested, in bytes: Linux's usual one."""

LEAST_STACK = 1 << 18
"""The limit of stacks, in bytes, below which C compilers and LLVM crash on kernels."""


def widen_stacks() -> None:
    """Raise the limit of stacks and the stack of threads to come, or reject a limit that is too low.

    The limit holds for this thread's stack, which grows, and for compilers that are started from here; the
    stack of threads was derived from it when the process started, those of drivers included.
    """
    unlimited = resource.RLIM_INFINITY
    soft, hard = resource.getrlimit(resource.RLIMIT_STACK)
    for limits in ((STACK, hard if hard == unlimited else max(hard, STACK)), (hard, hard)):
        if soft != unlimited and soft < STACK:
            with suppress(ValueError, OSError):  # only an administrator raises the hard limit
                resource.setrlimit(resource.RLIMIT_STACK, limits)
            soft, hard = resource.getrlimit(resource.RLIMIT_STACK)
    if soft != unlimited and soft < LEAST_STACK:
        rule = f"compilers and kernels need {LEAST_STACK >> 10} KiB at least"
        raise ExecutorUnavailable(f"the stack limit is {soft >> 10} KiB: {rule}; set ulimit -s 8192")
    library, attributes = ctypes.CDLL(None), ctypes.create_string_buffer(256)  # glibc's has 56 or 64 bytes
    size = ctypes.c_size_t(THREAD_STACK)
    with suppress(AttributeError):  # another system, whose threads have stacks of their own size
        library.pthread_getattr_default_np(attributes)
        library.pthread_attr_getstacksize(attributes, ctypes.byref(size))
        if size.value < THREAD_STACK:
            library.pthread_attr_setstacksize(attributes, ctypes.c_size_t(THREAD_STACK))
            library.pthread_setattr_default_np(attributes)
