"""The targets of `wamnet export`: which kernels are written for each, how they are called, what limits hold.

One row a target [`TARGETS`]. A row names a compiler target for each place that weights can have, the first
one being the usual one, and says how files are named, how kernels are called, and which limits hold. What
runs kernels here that executors of the registry do not is in [`RUNNERS`].
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
from ..devices.executor import Executor
from ..devices.registry import open_executor
from . import tools

BUFFER, TEXTURE = "buffer", "texture"
"""The other places of weights."""

KILOBYTE = 1024
"""Bytes."""


@dataclass(frozen=True)
class Limit:
    """What a host takes: `most` of something that an export needs; `name` is the host's own word for it."""

    name: str
    most: int
    way_out: str


@dataclass(frozen=True)
class Place:
    """A place of weights: the compiler's target, its schedules that can have them there, and a limit.

    The first schedule is the usual one. `each`: how much of the limit a weight takes.
    """

    kernel: str
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


Files = Callable[[str, str], Mapping[str, bytes]]
"""(stem of a file, source) -> files."""


def _as(suffix: str) -> Files:
    """Return the files of a language that is written as it is."""
    return lambda stem, source: {f"{stem}{suffix}": source.encode()}


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
    """One target. `slots`: what kernels are bound to, `code`: ten lines of a program that calls the denoiser.

    `single`: a pass of the host writes one image, so that a noisy picture's features are passes of their own.
    `dispatch`: how kernels on buffers with numbers are started.

    `opens`: what runs its kernels here, the target's own compiler and device or the nearest to it
    [`opened`], to which they are translated by `route`. `stands_in`: it computes the same, but is nothing
    that the target's users have. `timed`: where options of a compiler decide, those that are timed: the
    advised ones, and those of a plain build. `tool`: what takes its files, if not what runs them.
    """

    name: str
    text: str
    places: Mapping[str, Place]
    files: Files
    slots: str
    code: str
    entry: str = ""
    single: bool = False
    most_images: Limit | None = None
    source: Limit | None = None
    dispatch: str = ""
    opens: tuple[str, ...] = ()
    route: str = ""
    stands_in: bool = False
    timed: tuple[Sequence[str], ...] = ()
    tool: Tool | None = None


def _block(bytes_: int, name: str) -> Limit:
    """Return the limit of a uniform block."""
    return Limit(name, bytes_, "use another place with --weights, or a smaller --variant, as window8+rank16")


INLINED = Limit(
    "weights that a driver compiles in reasonable time",
    LARGEST_WEIGHTS,
    "use --weights texture or uniform where the target has it, or a smaller --variant",
)
"""Weights as straight code."""

TABLE_WEIGHTS = Limit("weights of a constant table", 2**20, "use --weights buffer")
"""Weights as a table."""


def _texture(side: int) -> Limit:
    """Return the limit of a texture of so many rows."""
    return Limit(f"GL_MAX_TEXTURE_SIZE rows of {WEIGHT_TEXTURE_WIDTH}", side, "use a smaller --variant")


GROUPED = ("group:4", "group:2", "group:1", PLAIN)
"""Schedules of languages for graphics processors, the usual one first."""

GROUPED_BYTES = (*GROUPED, "groupdot:4")
"""The same where a language has a word for products of bytes."""

PASSES = "fftpasses:32"
"""Schedule of spectra in several launches, the fastest where a processor runs shaders."""


def _storage(
    kernel: str, uniform: int = 0, name: str = "", schedules: tuple[str, ...] = GROUPED
) -> dict[str, Place]:
    """Return the places of a target with storage buffers."""
    found = {BUFFER: Place(kernel, schedules)}
    return found | {BLOCK: Place(f"{kernel}:{BLOCK}", limit=_block(uniform, name))} if uniform else found


def _tabled(kernel: str) -> dict[str, Place]:
    """Return the place of a table."""
    return {TABLE: Place(f"{kernel}:{TABLE}", limit=TABLE_WEIGHTS, each=1.0)}


def _fragment(kernel: str, rows: int) -> dict[str, Place]:
    """Return the places of a fragment shader."""
    return {
        TEXTURE: Place(kernel, limit=_texture(rows), each=1 / WEIGHT_TEXTURE_WIDTH),
        TABLE: Place(kernel, ("inlined",), limit=INLINED, each=1.0),
        BLOCK: Place(f"{kernel}:{BLOCK}", limit=_block(16 * KILOBYTE, "GL_MAX_UNIFORM_BLOCK_SIZE")),
    }


UNIFORM_RANGE = (16 * KILOBYTE, "maxUniformBufferRange")
"""What Vulkan promises of a uniform block."""

TRANSLATED_PLACES = _storage("glsl-vulkan", *UNIFORM_RANGE, (*GROUPED, PASSES))
"""Places of weights for what is made of GLSL for Vulkan by way of SPIR-V 1.0, without products of bytes."""

DISPATCH = "dispatch(ceil(width / {across}), ceil({height} / {down}), 1)"
"""How kernels on buffers are started, in groups that compute so many pixels."""

DISPATCHED = ("numbered", "registers")
"""Kinds of slots of such kernels."""

SPECTRA = ("fft:8", "fft:16", "fft:4")
"""Schedules of spectra. Most processors have AVX2's registers, or get two instructions for each vector."""

BYTES = ("dot:16", "groupdot:4")
"""Schedules of bytes, for networks of integers: the former is the fastest on processors with VNNI, and slow
on others; the latter is for graphics processors."""

ON_PROCESSORS = (*SPECTRA, "tile:16", "tile:8", "tile:4", "vector:16", BYTES[0])
"""Schedules of OpenCL for processors."""

IN_C = ("tile:8", "tile:16", "tile:4", *SPECTRA, BYTES[0], PLAIN)
"""Schedules of C. Those of spectra are the fastest, but only GCC and clang take them."""

GL_CODE = """\
GLuint program = link(fullscreen_triangle, compile(GL_FRAGMENT_SHADER, "{file}"));
glUseProgram(program);
/* One RGBA32F texture for each image (texel row 0 is the top row), and the weights: R32F, 1024 wide. */
{images}
bind_texture({count}, weight_texture, "weight_texture");
/* The result: an RGBA32F colour buffer of the picture's size; its values are display-encoded already. */
glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_of(result_texture));
glViewport(0, 0, width, height);
glDisable(GL_FRAMEBUFFER_SRGB);
glDrawArrays(GL_TRIANGLES, 0, 3);"""
"""Integration with OpenGL; helpers are the program's own."""


ENGINES = """\
/* three.js: a RawShaderMaterial with glslVersion: GLSL3 writes the first line itself: pass the text below
   `#version 300 es`. PlayCanvas wants an output of its own name: see `--host playcanvas`. */"""
"""What engines on WebGL do to a text."""


def _buffers_code(api: str) -> str:
    """Return the integration with buffers that have numbers; helpers are the program's own."""
    return f"""\
/* All buffers hold 32-bit floats; images (height, width, channels), rows from the top. */
{api} pipeline = create_pipeline("{{file}}", "{{entry}}");
{{bound}}
{{dispatch}};
wait();
show(result);   /* width * height * 3 floats, encoded for the display: do not encode them again */"""


def _arguments_code(call: str) -> str:
    """Return the integration with functions."""
    return f"""\
/* Arrays of float: images (height, width, channels), rows from the top; weights as in weights.bin. */
{call}
/* result: width * height * 3 floats, display-encoded: do not encode them for the display again. */"""


ROWS: tuple[Row, ...] = (
    Row(
        "opencl",
        "OpenCL C 1.2",
        _storage(
            "opencl",
            64 * KILOBYTE,
            "CL_DEVICE_MAX_CONSTANT_BUFFER_SIZE",
            (*ON_PROCESSORS, *GROUPED_BYTES),
        )
        | _tabled("opencl"),
        _as(".cl"),
        "arguments",
        'cl_kernel kernel = clCreateKernel(program, "wamnet_denoise", &error);\n'
        "/* Arguments in this order: {arguments}. */\n"
        "set_arguments(kernel, {arguments});\n"
        "/* An item computes {columns} x {rows} pixels. */\n"
        "size_t local[2] = {{{group_x}, {group_y}}}, global[2] = {{\n"
        "    round_up((width + {columns} - 1) / {columns}, {group_x}),\n"
        "    round_up((height + {rows} - 1) / {rows}, {group_y})}};\n"
        "clEnqueueNDRangeKernel(queue, kernel, 2, NULL, global, local, 0, NULL, NULL);",
        opens=("opencl",),
    ),
    Row(
        "glsl",
        "GLSL 3.30, fragment shader",
        _fragment("opengl", 1024),
        _as(".frag"),
        "names",
        GL_CODE,
        opens=("opengl",),
    ),
    Row(
        "glsl-compute",
        "GLSL 4.30, compute shader",
        _storage("glsl-compute", 16 * KILOBYTE, "GL_MAX_UNIFORM_BLOCK_SIZE", ("group:2", *GROUPED, PASSES)),
        _as(".comp"),
        "numbered",
        _buffers_code("GLuint"),
        dispatch=f"gl{DISPATCH}",
        opens=("gl_runner", "ComputeRunner"),
        tool=Tool("glslangValidator", ".comp", options=("glslangValidator", "-S", "comp")),
    ),
    Row(
        "glsl-es",
        "GLSL ES 3.00, fragment shader",
        _fragment("glsl-es", 2048),
        _as(".frag"),
        "names",
        f"{GL_CODE}\n{ENGINES}",
        opens=("gl_runner", "ESRunner"),
        tool=Tool("glslangValidator", ".frag", options=("glslangValidator", "-S", "frag")),
    ),
    Row(
        "glsl-vulkan",
        "GLSL 4.50 for Vulkan, compute shader",
        _storage("glsl-vulkan", *UNIFORM_RANGE, (*GROUPED_BYTES, PASSES)),
        _as(".comp"),
        "numbered",
        _buffers_code("VkPipeline"),
        dispatch=DISPATCH,
        opens=("wgpu_runner", "vulkan_runner"),
        route="SPIR-V, wgpu, ",
        tool=Tool("glslangValidator + spirv-val", ".comp", _translated),
    ),
    Row(
        "wgsl",
        "WGSL",
        _storage("wgsl", 64 * KILOBYTE, "maxUniformBufferBindingSize", (*GROUPED_BYTES, PASSES)),
        _as(".wgsl"),
        "numbered",
        _buffers_code("const"),
        dispatch=DISPATCH,
        most_images=Limit("maxStorageBuffersPerShaderStage, less 2", 6, "use fewer features"),
        opens=("wgpu_runner", "WgpuRunner"),
        route="wgpu, ",
    ),
    Row(
        "hlsl",
        "HLSL, compute shader for fxc (shader model 5.0) and dxc (6.0)",
        TRANSLATED_PLACES,
        _hlsl,
        "registers",
        _buffers_code("auto"),
        dispatch=DISPATCH,
        opens=("wgpu_runner", "vulkan_runner", "dxc"),
        route="back to SPIR-V, wgpu, ",
        tool=Tool("glslangValidator -D + spirv-val", ".hlsl", _translated, ("hlsl",)),
    ),
    Row(
        "metal",
        "Metal Shading Language",
        _storage("metal", 64 * KILOBYTE, "constant memory of a kernel", (*GROUPED, PASSES))
        | _tabled("metal"),
        _as(".metal"),
        "numbered",
        _buffers_code("id<MTLComputePipelineState>"),
        dispatch="dispatchThreadgroups(ceil(width / {across}), ceil({height} / {down})) "
        "of {group_x} x {group_y}",
        opens=("host_runner", "MetalRunner"),
        route="as C++ with a shim, ",
        stands_in=True,
    ),
    Row(
        "spirv",
        "SPIR-V 1.0, compute shader",
        TRANSLATED_PLACES,
        _spirv,
        "numbered",
        _buffers_code("VkPipeline"),
        dispatch=DISPATCH,
        opens=("wgpu_runner", "vulkan_runner"),
        route="wgpu, ",
        tool=Tool("spirv-val", ".spv", tools.validate),
    ),
    Row(
        "c",
        "C99, one header",
        {BUFFER: Place("c", IN_C), **_tabled("c")},
        _as(".h"),
        "header",
        '#include "{file}"\n'
        + _arguments_code("wamnet_image({arguments});")
        + "\n/* wamnet_pixel computes {columns} pixels of a row, for your own loops. -O3 -march=native\n"
        "   is the fastest. Without it GCC 12 and later compile tiles for AVX2 and AVX-512, on Linux, and\n"
        "   the program chooses. For x86 processors without AVX2 define WAMNET_PORTABLE.\n"
        "   Other schedules: tile:8 needs registers of 8 floats (AVX2), tile:4 those of 4 (SSE, NEON).\n"
        "   GCC and clang also compile fft:16, fft:8 and fft:4, which are faster for large windows. */",
        opens=("host_runner", "CRunner"),
        timed=(("-O3", "-march=native"), ("-O2",)),
        tool=Tool("cc -Wall -Wextra -Wconversion -Werror", ".h", _cc),
    ),
    Row(
        "cuda",
        "CUDA C",
        _storage("cuda", schedules=(*GROUPED_BYTES, PASSES)) | _tabled("cuda"),
        _as(".cu"),
        "arguments",
        _arguments_code(
            "dim3 block({group_x}, {group_y});\n"
            "dim3 grid((width + {across} - 1) / {across}, (height + {down} - 1) / {down});\n"
            "wamnet_denoise<<<grid, block>>>({arguments});\n"
            "cudaDeviceSynchronize();",
        ),
        opens=("host_runner", "CUDARunner"),
        route="as C++ with a shim, ",
        stands_in=True,
        tool=Tool("nvcc -ptx", ".cu", options=PTX),
    ),
    Row(
        "shadertoy",
        "Shadertoy's tabs",
        {TABLE: Place("shadertoy", ("inlined",), limit=INLINED, each=1.0)},
        _as(".glsl"),
        "channels",
        "1. Make buffers A, B, ... and paste features/feature.<name>.glsl into one each, in this order.\n"
        "2. Paste denoise.glsl into the tab Image.\n"
        "3. In Image, set iChannel0, iChannel1, ... to the buffers in that order:\n"
        "{images}\n"
        "4. Set each channel's filter to nearest and its wrap to clamp.",
        entry="mainImage",
        single=True,
        opens=("gl_runner", "ShadertoyRunner"),
        route="its uniforms declared, ",
        most_images=Limit("buffers of a Shadertoy, A to D", 4, "use fewer features"),
        # The site states none: with more its editor hardly moves.
        source=Limit("characters of the largest shader", 1_000_000, "use a smaller --variant, as window8"),
    ),
    Row(
        "godot",
        "Godot 4 shading language, canvas item",
        {
            TEXTURE: Place("godot", limit=_texture(16384), each=1 / WEIGHT_TEXTURE_WIDTH),
            **_tabled("godot"),
        },
        _as(".gdshader"),
        "names",
        "var material = ShaderMaterial.new()\n"
        'material.shader = load("res://denoise.gdshader")\n'
        "# Images: FORMAT_RGBF, row 0 the top row; weights: FORMAT_RF, 1024 wide, padded with zeros.\n"
        "{images}\n"
        'material.set_shader_parameter("weight_texture", ImageTexture.create_from_image(weights))\n'
        "$Picture.material = material   # a TextureRect of the picture's size\n"
        "# Leave HDR 2D off: a viewport with it encodes for the display what it shows, and these colours\n"
        "# are encoded. To read them in 16 bits, draw into a SubViewport with use_hdr_2d that is not shown.",
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
