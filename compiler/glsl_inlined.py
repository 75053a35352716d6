"""GLSL 3.30 for the inlined schedule [emit_inlined.py], and the ladder of schedules for fragment shaders."""

from __future__ import annotations

from .emit_inlined import Inlined
from .glsl import GLSL, PREAMBLE


class GLSLInlined(GLSL):
    """The dialect's table: values are `vec4`, no texture holds weights."""

    begin = f"""\
{PREAMBLE}
{{images}}
{{results}}
{{defines}}
void main()
{{{{
    int x = int(gl_FragCoord.x);
    int y = int(gl_FragCoord.y);
{{starts}}"""
    types = {"float32": "vec4", "bool": "bvec4"}
    arguments = "\n".join(
        line
        for line in GLSL.arguments.split("\n")
        if not any(word in line for word in ("weight_texture", "padded), row by row"))
    )
    operations = {
        **{
            name: GLSL.operations[name]
            for name in ("add", "subtract", "multiply", "divide", "negative", "reciprocal", "absolute")
        },
        **{name: GLSL.operations[name] for name in ("sqrt", "sin", "cos", "floor")},
        "minimum": "min(vec4({0}), vec4({1}))",
        "maximum": "max(vec4({0}), vec4({1}))",
        **{
            name: f"{text}(vec4({{0}}), vec4({{1}}))"
            for name, text in (
                ("less", "lessThan"),
                ("less_equal", "lessThanEqual"),
                ("greater", "greaterThan"),
                ("greater_equal", "greaterThanEqual"),
            )
        },
        "select": "mix(vec4({2}), vec4({1}), {0})",
    }


GLSL_LADDER = (Inlined(GLSLInlined()),)
"""The schedules for fragment shaders besides the plain one."""
