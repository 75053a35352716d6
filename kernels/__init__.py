"""Executors: the only modules that talk to OpenCL and OpenGL, and the NumPy one that defines the answer.

A name is imported when it is first used: most commands need one of them, and all take longer than a frame.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .devices.registry import EXECUTORS as EXECUTORS
    from .devices.registry import open_executor as open_executor
    from .run.denoise_on import RunResult as RunResult
    from .run.denoise_on import denoise_on as denoise_on
    from .run.pipeline import Pipeline as Pipeline
    from .run.render_on import render_on as render_on
    from .run.trainer import train_on as train_on

MODULES = {
    "EXECUTORS": "devices.registry",
    "open_executor": "devices.registry",
    "RunResult": "run.denoise_on",
    "denoise_on": "run.denoise_on",
    "Pipeline": "run.pipeline",
    "render_on": "run.render_on",
    "train_on": "run.trainer",
}
"""Module of each public name."""


def __getattr__(name: str) -> Any:
    """Import a name when it is first used."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{MODULES[name]}", __name__), name)
