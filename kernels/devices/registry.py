"""Executors by name. Their packages are imported when one is opened: the base install has none of them."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from typing import Any

from ...models.writing import signals_wait
from ...refimpl.errors import ExecutorUnavailable, InputError, choice
from ..folders import protect_caches
from ..memory import widen_stacks
from .executor import Executor

CONTEXT_VARIABLE = "WAMNET_OPENGL_CONTEXT"
"""Environment variable that names the kind of OpenGL's context, egl or osmesa, where the caller does not."""


def _numpy(**options: Any) -> Executor:
    """Open the interpreter."""
    from .numpy_executor import NumpyExecutor

    return NumpyExecutor(**options)


def _opencl(**options: Any) -> Executor:
    """Open an OpenCL device; option `device`: a part of its name."""
    with signals_wait():
        from .opencl_executor import OpenCLExecutor

    return OpenCLExecutor(**options)


def _opengl(**options: Any) -> Executor:
    """Open an OpenGL context; option `context`: auto, egl or osmesa."""
    with signals_wait():
        from .opengl_executor import OpenGLExecutor

    return OpenGLExecutor(**options)


def _c(**options: Any) -> Executor:
    """Open the system's C compiler."""
    from .c_executor import CExecutor

    return CExecutor(**options)


EXECUTORS: Mapping[str, Callable[..., Executor]] = {
    "numpy": _numpy,
    "opencl": _opencl,
    "opengl": _opengl,
    "c": _c,
}
"""How to open each executor; the name is also the target that the compiler takes."""

OPTIONS: Mapping[str, tuple[Mapping[str, str], ...]] = {"opengl": ({"context": "egl"}, {"context": "osmesa"})}
"""Options of executors that can be opened in several ways, each perhaps another driver."""

FASTEST = ("opencl", "c", "opengl")
"""Executors that may be faster than NumPy, the fastest first, as measured (docs/speed.md)."""

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
        return EXECUTORS[name](**options)
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
                if executor.software:
                    reasons.append(f"{name}: {executor.device} is a software renderer, slower than NumPy")
                elif trains and not executor.trains:
                    reasons.append(f"{name}: it does not train")
                else:
                    return name, reasons
        except ExecutorUnavailable as error:
            reasons.append(str(error))
    return "numpy", reasons
