"""Executors by name. Their packages are imported when one is opened: the base install has none of them."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from ...models.writing import signals_wait
from ...refimpl.errors import ExecutorUnavailable, InputError, choice
from ..folders import protect_caches
from ..memory import widen_stacks
from .executor import Executor

CONTEXT_VARIABLE = "WAMNET_OPENGL_CONTEXT"
"""Environment variable that names the kind of OpenGL's context, egl or osmesa, where the caller does not."""


EXECUTORS: Mapping[str, str] = {
    "numpy": "NumpyExecutor",
    "opencl": "OpenCLExecutor",
    "opengl": "OpenGLExecutor",
    "c": "CExecutor",
}
"""The class of each executor, whose module begins with its name; that is also the target of its kernels.

OpenCL's takes the option `device`, a part of a device's name, and OpenGL's `context`: auto, egl or osmesa."""

OPTIONS: Mapping[str, tuple[Mapping[str, str], ...]] = {"opengl": ({"context": "egl"}, {"context": "osmesa"})}
"""Options of executors that can be opened in several ways, each perhaps another driver."""

FASTEST = ("opencl", "c", "opengl")
"""Executors that are faster than NumPy, the fastest first, as measured (docs/speed.md); each chooses its
schedule by its device. Exports have the lists of export/targets.py, the fastest first."""

SLOW = "softpipe"
"""A renderer that interprets shaders, and is slower than NumPy."""

WAYS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "-".join((name, *options.values())): (name, options)
    for name in EXECUTORS
    for options in OPTIONS.get(name, ({},))
}
"""Every way to open an executor: numpy, opencl, opengl-egl, ...; its name and its options."""


def open_executor(name: str, **options: Any) -> Executor:
    """Return an open executor, or raise ExecutorUnavailable that says what is missing and how to get it."""
    if name not in EXECUTORS:
        raise InputError("executor", name, "unknown", choice(name, EXECUTORS))
    if name != "numpy":
        widen_stacks()
        protect_caches()
    try:
        with signals_wait():
            module = import_module(f".{name}_executor", __package__)
        found: Executor = getattr(module, EXECUTORS[name])(**options)
        return found
    except ImportError as error:
        missing = error.name or error
        fix = f"pip install 'wamnet[{name}]'"
        if platform.machine().lower() not in ("x86_64", "amd64"):
            fix += f"; if this processor has no wheel, build one: pip install {missing} (g++, libx11-dev)"
        raise ExecutorUnavailable(f"{name}: package {missing} cannot be imported; {fix}") from None


def fastest(trains: bool = False) -> tuple[str, list[str]]:
    """Return the fastest executor that opens here, and of each faster one why it is passed over.

    Opening compiles no kernel, and a second time takes milliseconds. `trains`: one that trains.
    """
    reasons = []
    for name in FASTEST:
        try:
            with open_executor(name) as executor:
                if SLOW in executor.device:
                    reasons.append(f"{name}: {executor.device} interprets shaders, slower than NumPy")
                elif trains and not executor.trains:
                    reasons.append(f"{name}: it does not train")
                else:
                    return name, reasons
        except ExecutorUnavailable as error:
            reasons.append(str(error))
    return "numpy", reasons
