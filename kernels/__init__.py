"""Executors: the only modules that talk to OpenCL and OpenGL, and the NumPy one that defines the answer."""

from .devices.registry import EXECUTORS as EXECUTORS
from .devices.registry import open_executor as open_executor
from .run.denoise_on import RunResult as RunResult
from .run.denoise_on import denoise_on as denoise_on
from .run.pipeline import Pipeline as Pipeline
from .run.render_on import render_on as render_on
from .run.trainer import train_on as train_on
