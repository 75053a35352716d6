"""GLSL 3.30 for the inlined schedule [emit_inlined.py]."""

from __future__ import annotations

from .dialect import Parts
from .glsl import GLSL, said_of_denoiser
from .interface import DENOISE, Interface
from .tiled_dialect import ON_INTEGERS


class GLSLInlined(GLSL):
    """The dialect's table: values are `vec4`, no texture holds weights."""

    types = {"float32": "vec4", "bool": "bvec4", "int32": "ivec4", "uint32": "uvec4"}
    said = {DENOISE: said_of_denoiser()}
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
        **{name: GLSL.operations[name] for name in ON_INTEGERS},
        **{f"{op}imum.int32": f"{op}(ivec4({{0}}), ivec4({{1}}))" for op in ("min", "max")},
        "minimum.uint32": "min(uvec4({0}), uvec4({1}))",
        "select": "mix(vec4({2}), vec4({1}), {0})",
    }

    def denoise_begin(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return what follows the first lines of a denoiser."""
        declared = [*self.images(kernel), *self.weights(), *self.declared_results(kernel)]
        return [*declared, parts.top, "void main()", "{", *self.started(kernel)]

    def weights(self) -> list[str]:
        """Return the declaration of the weights, and of what reads them: all are in the source."""
        return []
