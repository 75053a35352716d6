"""Exported fragment shaders on OpenGL, in the language of their target.

An OpenGL driver with ARB_ES3_compatibility, as Mesa's, takes GLSL ES 3.00 with the rules of that language.
"""

from __future__ import annotations

from ...compiler.glsl_es import VERSION
from ..opengl_executor import VERTEX_SHADER, OpenGLExecutor


class ESRunner(OpenGLExecutor):
    """GLSL ES 3.00."""

    name = "glsl-es"
    vertex_shader = VERTEX_SHADER.replace("#version 330 core", VERSION)
