"""Exported fragment shaders on OpenGL, in the language of their target.

An OpenGL driver with ARB_ES3_compatibility, as Mesa's, takes GLSL ES 3.00 with the rules of that language.
"""

from __future__ import annotations

from ...compiler.languages.glsl_es import VERSION
from ..devices.opengl_executor import OpenGLExecutor


class ESRunner(OpenGLExecutor):
    """GLSL ES 3.00."""

    name = "glsl-es"
    version = VERSION
