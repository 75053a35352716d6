"""What a report says about the machine, and the versions of what ran on it."""

import os
import platform
from collections.abc import Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from ...kernels.memory import cores


def describe() -> dict[str, str]:
    """Return processor, cores that this process may use, memory, system and Python."""
    return {
        "processor": _processor(),
        "cores": str(cores()),
        "memory": f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') >> 30} GiB",
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
    }


def versions(others: Sequence[str] = ()) -> dict[str, str]:
    """Return the versions of the packages that matter, and of others, where they are installed."""
    found = {}
    for name in ("wamnet", "numpy", "pyopencl", "moderngl", "OpenEXR", *others):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _processor() -> str:
    """Return the processor's name, as the Linux kernel tells it."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        return next(named, "") or platform.processor() or "unknown"
    return platform.processor() or "unknown"
