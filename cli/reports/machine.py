"""What a report says about the machine, and the versions of what ran on it."""

import os
import platform
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

PACKAGES = ("wamnet", "numpy", "pyopencl", "moderngl", "OpenEXR")
"""Packages whose versions a report names, where they are installed."""


def describe() -> dict[str, str]:
    """Return processor, cores that this process may use, memory, system and Python."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return {
        "processor": _first_value("/proc/cpuinfo", "model name") or platform.processor() or "unknown",
        "cores": str(cores),
        "memory": _memory(),
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
    }


def versions(others: Sequence[str] = ()) -> dict[str, str]:
    """Return the versions of the packages that matter, and of others, where they are installed."""
    found = {}
    for name in (*PACKAGES, *others):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _memory() -> str:
    """Return the memory in whole GiB as text; Linux counts it in KiB."""
    kibibytes = _first_value("/proc/meminfo", "MemTotal").split()
    return f"{int(kibibytes[0]) >> 20} GiB" if kibibytes else "unknown"


def _first_value(path: str, key: str) -> str:
    """Return what follows `key :` in a text of the Linux kernel, or nothing."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")
