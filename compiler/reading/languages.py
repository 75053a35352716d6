"""Which kinds of kernels' sources are checked, by a manifest's target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

TITLES: Mapping[str, str] = {
    "opencl": "OpenCL C", "c": "C99", "opengl": "GLSL 3.30", "glsl-es": "GLSL ES 3.00",
    "glsl-vulkan": "GLSL 4.50", "glsl-compute": "GLSL 4.30", "wgsl": "WGSL", "metal": "Metal",
    "cuda": "CUDA C",
}  # fmt: skip
"""What a language's name in manifests begins with."""

BUFFERS = dict.fromkeys(("glsl-vulkan", "glsl-compute", "wgsl", "cuda", "metal"), ("group", "tile"))
"""Languages of which work groups and register tiles are read, and of floats FFT passes."""

OF_FLOATS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(BUFFERS, ("group", "tile", "fftpasses")), "opengl": ("group", "fftpasses", "inlined"),
    "opencl": ("tile", "vector", "group", "fft"), "c": ("tile", "fft"), "glsl-es": ("packed", "inlined"),
}  # fmt: skip
"""What the names of schedules other than plain begin with, of networks of floats."""

OF_INTEGERS: Mapping[str, tuple[str, ...]] = {
    **BUFFERS, "opencl": ("tile", "vector", "group", "dot"), "c": ("tile", "dot"),
    **dict.fromkeys(("glsl-vulkan", "glsl-compute", "wgsl"), ("group",)),
}  # fmt: skip
"""The same of networks of integers."""

READ_PROFILE = "ieee"
"""The profile whose sines are read, of every degree."""


def language_of(manifest: Mapping[str, Any]) -> str:
    """Return the language of a kernel: its target without the place of the weights."""
    return str(manifest["target"]).partition(":")[0]


def is_read(manifest: Mapping[str, Any]) -> bool:
    """Return whether the text of a kernel is of a kind that is read, by its manifest (TXT-7)."""
    target, schedule = language_of(manifest), manifest["schedule"]["name"]
    known_sines = not manifest["sine_arguments"] or manifest["profile"]["name"].startswith(READ_PROFILE)
    places = target, f"{target}:inline", f"{target}:uniform"
    if target not in TITLES or not known_sines or manifest["target"] not in places:
        return False
    begins = (OF_FLOATS if any(manifest["bound"]["output"]) else OF_INTEGERS).get(target, ())
    return bool(schedule == "plain" or schedule.startswith(begins))
