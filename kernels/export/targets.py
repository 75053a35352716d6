"""The targets of `wamnet export`: which kernels are written for each, how they are called, what limits hold.

One row a target [`TARGETS`]. A row says where weights can be, how kernels are bound, and which limits hold;
the compiler's language of that name, or `of` another one, says the rest. What runs kernels here that
executors of the registry do not is in [`RUNNERS`].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path

from ...compiler.kernel.interface import BLOCK, TABLE, staged
from ...compiler.languages.glsl import WEIGHT_TEXTURE_WIDTH
from ...compiler.schedules.schedules import PLAIN
from ...compiler.schedules.straight import LARGEST_WEIGHTS
from ...compiler.targets import LANGUAGES, Language, language_named
from ..devices.executor import Executor
from ..devices.registry import open_executor
from . import tools

BUFFER, TEXTURE = "buffer", "texture"
"""The other places of weights."""


@dataclass(frozen=True)
class Limit:
    """What a host takes: `most` of something that an export needs; `name` is the host's own word for it."""

    name: str
    most: int
    way_out: str


@dataclass(frozen=True)
class Place:
    """A place of weights: the schedules that can have them there, the usual one first, and a limit.

    `each`: how much of the limit a weight takes.
    """

    schedules: tuple[str, ...] = (PLAIN,)
    limit: Limit | None = None
    each: float = 4.0


UNREAD = "177"
"""Number of the warning that a variable is not read: a path's program has some, whatever it adds up."""

PTX = ("nvcc", "-ptx", "-Werror", "all-warnings", "-diag-suppress", UNREAD, "-o", "kernel.ptx")
"""What compiles CUDA C."""

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wpedantic", "-Werror", "-c")
"""What a careful project compiles C with."""


def _run(folder: Path, name: str, *command: str) -> None:
    """Run a command for a file."""
    tools.run(*command, name, folder=folder)


def _translated(folder: Path, name: str, *language: str) -> None:
    """Compile a file to SPIR-V, and validate that."""
    tools.spirv((folder / name).read_text(), *language)


def _cc(folder: Path, name: str) -> None:
    """Compile a header by itself, with all warnings as errors."""
    (folder / "one.c").write_text(f'#include "{name}"\nint wamnet_one;\n')
    tools.run("cc", *WARNINGS, "-Wno-unused-function", "-o", "one.o", "one.c", folder=folder)


@dataclass(frozen=True)
class Tool:
    """The target's own compiler or validator: `take` gets a folder, a file's name, and these options."""

    title: str
    suffix: str
    take: Callable[..., None] = _run
    options: tuple[str, ...] = ()


def _launches(stem: str, source: str) -> Mapping[str, str]:
    """Return the source of each launch by the stem of its files, or of a kernel that is one."""
    count = source.count(" STAGE == ")
    return {f"{stem}.{number}": staged(source, number) for number in range(count)} or {stem: source}


def _spirv(stem: str, source: str) -> Mapping[str, bytes]:
    """Return SPIR-V, and the GLSL that it is made of."""
    made = {f"{name}.spv": tools.spirv(text) for name, text in _launches(stem, source).items()}
    return {**made, f"{stem}.comp": source.encode()}


def _hlsl(stem: str, source: str) -> Mapping[str, bytes]:
    """Return HLSL for both compilers."""
    return {
        f"{name}.{style}.hlsl": tools.hlsl(text, style).encode()
        for name, text in _launches(stem, source).items()
        for style in tools.HLSL_STYLES
    }


@dataclass(frozen=True)
class Row:
    """One target. `slots`: what kernels are bound to; `places`: where weights can be, the usual one first.

    `of`: the compiler's target, where that has another name, and `text` the language, for a reader.
    `api`: the type of a pipeline in the README's code.
    `single`: a pass of the host writes one image, so that a noisy picture's features are passes of their own.

    `opens`: what runs its kernels here, the target's own compiler and device or the nearest to it
    [`opened`], to which they are translated by `route`. `stands_in`: it computes the same, but is nothing
    that the target's users have. `timed`: options of a compiler that are timed, those for this processor
    first. `tool`: what takes its files, if not what runs them. `translated`: to another language's files.
    """

    name: str
    slots: str
    places: Mapping[str, Place]
    api: str = ""
    of: str = ""
    text: str = ""
    single: bool = False
    most_images: Limit | None = None
    source: Limit | None = None
    opens: tuple[str, ...] = ()
    route: str = ""
    stands_in: bool = False
    timed: tuple[Sequence[str], ...] = ()
    tool: Tool | None = None
    translated: Callable[[str, str], Mapping[str, bytes]] | None = None

    @property
    def language(self) -> Language:
        """Return the language, wherever weights are."""
        return language_named(self.of or self.name)

    def kernel(self, place: str) -> Language:
        """Return the language with the weights at a place."""
        return LANGUAGES.get(f"{self.language.name}:{place}", self.language)

    def files(self, stem: str, source: str) -> Mapping[str, bytes]:
        """Return the files of a source: those that it is translated to, or it as it is."""
        if self.translated:
            return self.translated(stem, source)
        return {f"{stem}{self.language.dialect.suffix}": source.encode()}


STRAIGHT = Place(
    ("inlined",),
    Limit(
        "weights that a driver compiles in reasonable time",
        LARGEST_WEIGHTS,
        "use --weights texture or uniform where the target has it, or a smaller --variant",
    ),
    1.0,
)
"""Weights as straight code."""

TABLED = Place(limit=Limit("weights of a constant table", 2**20, "use --weights buffer"), each=1.0)
"""Weights as a table."""


def _block(kilobytes: int, name: str) -> Place:
    """Return weights in a uniform block."""
    fix = "use another place with --weights, or a smaller --variant, as window8+rank16"
    return Place(limit=Limit(name, 1024 * kilobytes, fix))


def _texture(side: int) -> Place:
    """Return weights in a texture of so many rows."""
    limit = Limit(f"GL_MAX_TEXTURE_SIZE rows of {WEIGHT_TEXTURE_WIDTH}", side, "use a smaller --variant")
    return Place(limit=limit, each=1 / WEIGHT_TEXTURE_WIDTH)


GROUPED = ("group:4", "group:2", "group:1", PLAIN)
"""Schedules of languages for graphics processors, the usual one first."""

GROUPED_BYTES = (*GROUPED, "groupdot:4")
"""The same where a language has a word for products of bytes."""

PASSES = "fftpasses:32"
"""Schedule of spectra in several launches, the fastest where a processor runs shaders."""


GL_BLOCK = _block(16, "GL_MAX_UNIFORM_BLOCK_SIZE")
"""Weights in a block of OpenGL."""

VULKAN_BLOCK = _block(16, "maxUniformBufferRange")
"""Weights in a block of Vulkan."""

TRANSLATED = {BUFFER: Place((*GROUPED, PASSES)), BLOCK: VULKAN_BLOCK}
"""Places of weights for what is made of GLSL for Vulkan by way of SPIR-V 1.0, without products of bytes."""

DISPATCHED = ("numbered", "registers")
"""Kinds of slots of such kernels."""

SPECTRA = ("fft:8", "fft:16", "fft:4")
"""Schedules of spectra. Most processors have AVX2's registers, or get two instructions for each vector."""

BYTES = ("dot:16", "groupdot:4")
"""Schedules of bytes, for networks of integers: the former is the fastest on processors with VNNI, and slow
on others; the latter is for graphics processors."""

ON_PROCESSORS = (*SPECTRA, "tile:16", "tile:8", "tile:4", "vector:16", BYTES[0])
"""Schedules of OpenCL for processors."""

IN_C = (*SPECTRA, "tile:8", "tile:16", "tile:4", BYTES[0], PLAIN)
"""Schedules of C."""

ROWS: tuple[Row, ...] = (
    Row(
        "opencl",
        "arguments",
        {
            BUFFER: Place((*ON_PROCESSORS, *GROUPED_BYTES)),
            BLOCK: _block(64, "CL_DEVICE_MAX_CONSTANT_BUFFER_SIZE"),
            TABLE: TABLED,
        },
        opens=("opencl",),
    ),
    Row(
        "glsl",
        "names",
        {TEXTURE: _texture(1024), TABLE: STRAIGHT, BLOCK: GL_BLOCK},
        of="opengl",
        opens=("opengl",),
    ),
    Row(
        "glsl-compute",
        "numbered",
        {BUFFER: Place(("group:2", *GROUPED, PASSES)), BLOCK: GL_BLOCK},
        "GLuint",
        opens=("gl_runner", "ComputeRunner"),
        tool=Tool("glslangValidator", ".comp", options=("glslangValidator", "-S", "comp")),
    ),
    Row(
        "glsl-es",
        "names",
        {TEXTURE: _texture(2048), TABLE: STRAIGHT, BLOCK: GL_BLOCK},
        opens=("gl_runner", "ESRunner"),
        tool=Tool("glslangValidator", ".frag", options=("glslangValidator", "-S", "frag")),
    ),
    Row(
        "glsl-vulkan",
        "numbered",
        {BUFFER: Place((*GROUPED_BYTES, PASSES)), BLOCK: VULKAN_BLOCK},
        "VkPipeline",
        opens=("wgpu_runner", "vulkan_runner"),
        route="SPIR-V, wgpu, ",
        tool=Tool("glslangValidator + spirv-val", ".comp", _translated),
    ),
    Row(
        "wgsl",
        "numbered",
        {BUFFER: Place((*GROUPED_BYTES, PASSES)), BLOCK: _block(64, "maxUniformBufferBindingSize")},
        "const",
        most_images=Limit("maxStorageBuffersPerShaderStage, less 2", 6, "use fewer features"),
        opens=("wgpu_runner", "WgpuRunner"),
        route="wgpu, ",
    ),
    Row(
        "hlsl",
        "registers",
        TRANSLATED,
        "auto",
        of="glsl-vulkan",
        text="HLSL, compute shader for fxc (shader model 5.0) and dxc (6.0)",
        translated=_hlsl,
        opens=("wgpu_runner", "vulkan_runner", "dxc"),
        route="back to SPIR-V, wgpu, ",
        tool=Tool("glslangValidator -D + spirv-val", ".hlsl", _translated, ("hlsl",)),
    ),
    Row(
        "metal",
        "numbered",
        {
            BUFFER: Place((*GROUPED, PASSES)),
            BLOCK: _block(64, "constant memory of a kernel"),
            TABLE: TABLED,
        },
        "id<MTLComputePipelineState>",
        opens=("host_runner", "MetalRunner"),
        route="as C++ with a shim, ",
        stands_in=True,
    ),
    Row(
        "spirv",
        "numbered",
        TRANSLATED,
        "VkPipeline",
        of="glsl-vulkan",
        text="SPIR-V 1.0, compute shader",
        translated=_spirv,
        opens=("wgpu_runner", "vulkan_runner"),
        route="wgpu, ",
        tool=Tool("spirv-val", ".spv", tools.validate),
    ),
    Row(
        "c",
        "header",
        {BUFFER: Place(IN_C), TABLE: TABLED},
        text="C99, one header",
        opens=("host_runner", "CRunner"),
        timed=(("-O3", "-march=native"), ("-O2",)),
        tool=Tool("cc -Wall -Wextra -Wconversion -Werror", ".h", _cc),
    ),
    Row(
        "cuda",
        "arguments",
        {BUFFER: Place((*GROUPED_BYTES, PASSES)), TABLE: TABLED},
        opens=("host_runner", "CUDARunner"),
        route="as C++ with a shim, ",
        stands_in=True,
        tool=Tool("nvcc -ptx", ".cu", options=PTX),
    ),
    Row(
        "shadertoy",
        "channels",
        {TABLE: STRAIGHT},
        text="Shadertoy's tabs",
        single=True,
        opens=("gl_runner", "ShadertoyRunner"),
        route="its uniforms declared, ",
        most_images=Limit("buffers of a Shadertoy, A to D", 4, "use fewer features"),
        # The site states none: with more its editor hardly moves.
        source=Limit("characters of the largest shader", 1_000_000, "use a smaller --variant, as window8"),
    ),
    Row(
        "godot",
        "names",
        {TEXTURE: _texture(16384), TABLE: TABLED},
        single=True,
        opens=("gl_runner", "GodotRunner"),
        route="its words declared, ",
    ),
)
"""All rows but that of ONNX, which is not a kernel's text."""

TARGETS: Mapping[str, Row] = {row.name: row for row in ROWS}
"""All targets whose kernels are text or SPIR-V, by name."""

ONNX = "onnx"
"""The target that is a graph."""

NAMES = (*TARGETS, ONNX)
"""All names of targets here; the web page is another command's."""


# ---- what runs kernels here --------------------------------------------------------------------------------


def opened(module: str, *name: str) -> Executor:
    """Open an executor of the registry, or a runner of this folder, whose packages are imported only then."""
    if not name:
        return open_executor(module)
    found: Executor = getattr(import_module(f".{module}", __package__), name[0])(*name[1:])
    return found


OWN = ("glsl-es", "glsl-compute", "glsl-vulkan", "wgsl", "metal", "cuda", "godot")
"""Targets whose kernels run as they are."""

RUNNERS: Mapping[str, Callable[[], Executor]] = {
    name: partial(opened, *opens)
    for name, opens in {
        **{name: TARGETS[name].opens for name in OWN},
        "c99": TARGETS["c"].opens,
        "glsl-vulkan/hlsl-fxc": ("wgpu_runner", "vulkan_runner", "fxc"),
        "glsl-vulkan/hlsl-dxc": ("wgpu_runner", "vulkan_runner", "dxc"),
        "wgsl/tint": ("tint_runner", "TintRunner"),
        "wgsl/tint-gles": ("tint_runner", "TintRunner", "opengles"),
    }.items()
}
"""By compiler target, and after a stroke what translates it, or to what; c99 is C, whose name an executor
has. Conformance runs them by name."""
