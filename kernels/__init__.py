"""Executors: the only modules that talk to OpenCL and OpenGL, and the NumPy one that defines the answer."""

from .denoise_on import RunResult as RunResult
from .denoise_on import denoise_on as denoise_on
from .pipeline import Pipeline as Pipeline
from .registry import EXECUTORS as EXECUTORS
from .registry import open_executor as open_executor
from .render_on import render_on as render_on
