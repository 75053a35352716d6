"""The languages that are read: their parsers, their compilers' macros, and names of their own."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .lanes import Unread
from .syntax import Parser, Text
from .wgsl_syntax import WgslParser


@dataclass(frozen=True)
class Language:
    """How texts of a target are read.

    `compilers` are sets of macros between which a text may make a difference: each is checked. `within`: the
    host calls the kernel for pixels of the picture only. `fragment`: one pixel's result is a variable.
    `brings`: names that the text does not declare. `host`: a function of the text that calls the kernel for
    every work item. `doubles`: a constant without a suffix is one. `of_floats`, `of_integers`: what the names
    of other schedules than plain begin with that are read, of networks of floats and of integers.
    """

    parser: type[Parser] = Parser
    preprocessed: bool = True
    compilers: tuple[Mapping[str, str], ...] = ({},)
    within: bool = False
    fragment: bool = False
    brings: tuple[str, ...] = ()
    host: str = ""
    doubles: bool = False
    of_floats: tuple[str, ...] = ()
    of_integers: tuple[str, ...] = ()


AVX512 = dict.fromkeys(("__AVX512F__", "__AVX512BW__", "__AVX512VNNI__"), "1")
"""What compilers define for the largest processors that texts ask for."""

CLANG = {
    "__has_builtin(name)": "1", "__builtin_elementwise_floor": "floor",
    "__builtin_convertvector(a, kind)": "((kind)(a))", **AVX512,
    "__opencl_c_integer_dot_product_input_4x8bit_packed": "1",
}  # fmt: skip
"""A compiler of OpenCL C with all that texts ask for; its own functions by what they mean."""

LANGUAGES: Mapping[str, Language] = {
    "opencl": Language(
        compilers=({}, CLANG),
        doubles=True,
        brings=("CLK_LOCAL_MEM_FENCE", "CLK_GLOBAL_MEM_FENCE"),
        of_floats=("tile", "vector", "group", "fft"),
        of_integers=("tile", "vector", "group", "dot"),
    ),
    "c": Language(
        compilers=(
            {"FLT_EVAL_METHOD": "0"},
            {"FLT_EVAL_METHOD": "0", "__GNUC__": "12", "__AVX__": "1", **AVX512},
        ),
        within=True,
        host="wamnet_image",
        doubles=True,
        of_floats=("tile", "fft"),
        of_integers=("tile", "dot"),
    ),
    "opengl": Language(
        compilers=({"GL_ARB_gpu_shader5": "1"},), within=True, fragment=True, brings=("gl_FragCoord",)
    ),
    "glsl-es": Language(within=True, fragment=True, brings=("gl_FragCoord",)),
    "glsl-vulkan": Language(
        compilers=({}, {"GL_EXT_integer_dot_product": "1"}),
        brings=("gl_GlobalInvocationID", "gl_LocalInvocationID", "gl_WorkGroupID"),
        of_floats=("group",),
        of_integers=("group",),
    ),
    "wgsl": Language(WgslParser, preprocessed=False, of_floats=("group",), of_integers=("group",)),
    "metal": Language(
        brings=tuple(f"mem_flags::mem_{a}" for a in ("none", "device", "threadgroup")),
        of_floats=("group",),
        of_integers=("group",),
    ),
    "cuda": Language(
        doubles=True,
        brings=("threadIdx", "blockIdx", "blockDim"),
        of_floats=("group",),
        of_integers=("group",),
    ),
}
"""By a manifest's target."""


class Stopped(Unread):
    """A text that is an error for a compiler: it computes nothing there."""


READ_PROFILES = ("ieee", "exact")
"""The profiles whose sines are read, of every degree."""


def is_read(manifest: Mapping[str, Any]) -> bool:
    """Return whether the text of a kernel is of a kind that is read, by its manifest (TXT-7)."""
    language, schedule = LANGUAGES.get(manifest["target"]), manifest["schedule"]["name"]
    known_sines = not manifest["sine_arguments"] or manifest["profile"]["name"].startswith(READ_PROFILES)
    if language is None or not known_sines:
        return False
    begins = language.of_floats if any(manifest["bound"]["output"]) else language.of_integers
    return bool(schedule == "plain" or schedule.startswith(begins))


def parsed(source: str, language: Language, macros: Mapping[str, str]) -> Text:
    """Return a text, parsed."""
    parser = language.parser(preprocessed(source, macros) if language.preprocessed else source)
    parser.doubles = language.doubles
    return parser.parse()


def preprocessed(source: str, macros: Mapping[str, str]) -> str:
    """Return a text with its macros replaced and its branches chosen; other directives are left out."""
    import pcpp

    class Reader(pcpp.Preprocessor):  # type: ignore[misc]
        def on_include_not_found(self, *given: Any) -> Any:
            raise pcpp.OutputDirective(pcpp.Action.IgnoreAndRemove)

        def on_directive_handle(self, directive: Any, *given: Any) -> Any:
            if directive.value in ("pragma", "version", "extension"):
                raise pcpp.OutputDirective(pcpp.Action.IgnoreAndRemove)
            return super().on_directive_handle(directive, *given)

        def on_directive_unknown(self, directive: Any, *given: Any) -> Any:
            kind = Stopped if directive.value == "error" else Unread
            raise kind(f"a compiler for which line {directive.lineno} is #{directive.value}")

    reader = Reader()
    reader.line_directive = None
    for name, value in macros.items():
        reader.define(f"{name} {value}")
    reader.parse(source)
    written = io.StringIO()
    reader.write(written)
    return written.getvalue()
