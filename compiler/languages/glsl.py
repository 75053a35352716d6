"""GLSL 3.30 fragment shaders: one fragment a pixel; images, weights and sums are textures.

`precise` (GL_ARB_gpu_shader5) keeps the compiler from rewriting (x - k P1) - k P2 as x - k (P1 + P2), which
plain GLSL allows and which would undo the sine's range reduction. A kernel with an error bound does not
compile without it. What is written are colour buffers of one framebuffer: the result's channels, sums four
planes a buffer, or one buffer for each image of an encoding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.profiles import SineContract
from ..kernel.interface import (
    BLOCK,
    DENOISE,
    ENCODE,
    FOLLOW,
    GUIDE,
    INTEGERS,
    PATH,
    RESULT,
    SCENE_NUMBERS,
    SMOOTH,
    UNSIGNED,
    WEIGHTS,
    WRITE,
    Interface,
)
from ..kernel.interface import Array as Given
from ..kernel.kernel import BATCH, Array, Kernel, Launch
from .dialect import NOTHING, Dialect

SHADER_VERSION = 430
"""The version of GLSL, and of OpenGL, that has compute shaders."""

WEIGHT_TEXTURE_WIDTH = 1024
"""Texels in a row of the weight texture: every implementation takes 1024 rows of 1024, a million weights."""

MOST_RESULTS = 8
"""Colour buffers that every implementation of OpenGL 3.3 draws into at once (MAX_DRAW_BUFFERS)."""

MOST_UNIFORMS = 200
"""Vectors of four uniforms for a scene's numbers: 224 are there everywhere (MAX_FRAGMENT_UNIFORM_VECTORS)."""

ORDER_EXTENSION = "GL_ARB_gpu_shader5"
"""The extension of OpenGL 3.3 that brings `precise`."""

PREAMBLE = f"""\
#version 330 core
#extension {ORDER_EXTENSION} : enable
#if defined({ORDER_EXTENSION}) || __VERSION__ >= 400
#define PRECISE precise
#else
{{unordered}}
#endif"""
"""First lines of a shader. `PRECISE` qualifies temporaries: it is `precise` where the compiler knows that."""


def is_texture(weights: Given | None) -> bool:
    """Return whether weights are read from a texture."""
    return weights is not None and weights.home != BLOCK and weights.shape != (0,)


def fetch(kind: str, index: str, place: str, part: str) -> list[str]:
    """Return the function that reads the weights' texture: a texel, or a part of it."""
    width = WEIGHT_TEXTURE_WIDTH
    return [
        f"{kind} weights(int {index})",
        "{",
        f"    ivec2 {place} = ivec2({index} % {width}, {index} / {width});",
        f"    return texelFetch(weight_texture, {place}, 0){part};",
        "}",
    ]


class GLSL(Dialect):
    """The dialect's table; `preamble` are the first lines, in which `{unordered}` has its place.

    `sampler`, `colour`: the declarations of a texture and of a colour buffer; `started` is before the name of
    a buffer that gets its first value; `above`: functions above `main`; `beginning`: its first lines.
    """

    target = "opengl"
    language = "GLSL 3.30, fragment shader"
    suffix = ".frag"
    entries = dict.fromkeys(INTEGERS, "main")
    integers = {
        DENOISE: (),
        PATH: ("width", "height", "first_row", "first_sample", "samples", "seed_number"),
        ENCODE: ("sample_count",),
        GUIDE: (),
        SMOOTH: ("width", "height", "gap"),
        FOLLOW: ("width", "height"),
    }
    preamble = PREAMBLE
    pixel = "texelFetch(image_{image}, ivec2({column}, {row}), 0)[{c}]"
    weight = "weights({index})"
    store = "{result}[{i}] = {value};"
    vector_kinds = {
        "float32": "vec{lanes}", "int32": "ivec{lanes}", "uint32": "uvec{lanes}", "bool": "bvec{lanes}",
    }  # fmt: skip
    texel = "texelFetch(image_{image}, ivec2({column}, {row}), 0).{part}"
    weight_vector = "weights({index})"
    vector_operations = {
        **{
            name: f"{text}({{0}}, {{1}})"
            for name, text in (
                ("less", "lessThan"),
                ("less_equal", "lessThanEqual"),
                ("greater", "greaterThan"),
                ("greater_equal", "greaterThanEqual"),
            )
        },
        "select": "mix({2}, {1}, {0})",
    }
    covered = "Draw one triangle that covers what is written: row 0 is the TOP row of all images"
    called = ""
    fragment = ("int(gl_FragCoord.x)", "int(gl_FragCoord.y)")
    sampler = "uniform sampler2D {name};"
    colour = "layout(location = {number}) out vec4 {name};"
    started = ""
    main = "void main()"
    above: tuple[str, ...] = ()
    beginning: tuple[str, ...] = ()
    max_output_channels = 4 * MOST_RESULTS
    channels_per_result: int | None = 4
    planes_per_buffer = 4
    max_planes = 4 * MOST_RESULTS
    max_images = MOST_RESULTS  # of GLSL ES too: most devices draw into more buffers than it promises
    most_numbers = 4 * MOST_UNIFORMS
    native_sine = SineContract("sin() of GLSL 3.30, which promises nothing", None)
    qualifiers = {"float32": "PRECISE "}
    table = "const {type} {name}[{count}] = {type}[{count}]({values});"
    unordered = (
        "#define PRECISE",
        f"#error the error bound needs `precise`: {ORDER_EXTENSION}, or #version 400",
    )

    def begin(self, kernel: Kernel, top: str, bounded: bool) -> str:
        """Return the text of a shader up to its first statement."""
        role, interface = kernel.interface.role, kernel.interface
        weights = interface.named(WEIGHTS)
        read = [array for array in interface.arrays if array.access != WRITE and array.name != SCENE_NUMBERS]
        samplers = [name for array in read if array is not weights for name in self.textures(array)]
        colours = [name for array in interface.written for name in self.textures(array)]
        names = [*samplers, *(["weight_texture"] if is_texture(weights) else [])]
        lines = [self.preamble.format(unordered=self.unordered[bounded]), top]
        lines += [self.sampler.format(name=name, number=number) for number, name in enumerate(names)]
        if weights is not None and weights.home == BLOCK:
            lines.append(f"layout(std140) uniform Weights {{ vec4 weights[{weights.quads}]; }};")
        lines += [self.colour.format(name=name, number=number) for number, name in enumerate(colours)]
        lines = [*filter(None, [*lines, *self.uniforms(interface)]), ""]
        if is_texture(weights):
            whole = kernel.weights.lanes > 1
            lines += fetch("vec4", "texel", "place", "") if whole else fetch("float", "index", "texel", ".r")
            lines.append("")
        lines += [*self.above, self.main, "{", *self.beginning]
        if role == DENOISE:
            first = samplers[0]
            lines += [
                f"    int width = textureSize({first}, 0).x;",
                f"    int height = textureSize({first}, 0).y;",
            ]
        lines += [
            f"    int {name} = {text};" for name, text in zip(interface.place, self.fragment, strict=True)
        ]
        start = "vec4(0.0, 0.0, 0.0, 1.0)" if role == DENOISE else "vec4(0.0)"
        starts = colours if role != PATH else []
        return "\n".join([*lines, *(f"    {self.started}{name} = {start};" for name in starts)])

    def uniforms(self, kernel: Interface) -> list[str]:
        """Return the declarations of the integers, and of a scene's numbers."""
        kinds = {name: "uint" if name in UNSIGNED else "int" for name in kernel.integers}
        moving = kernel.named(SCENE_NUMBERS)
        scene = [f"uniform vec4 {SCENE_NUMBERS}[{moving.quads}];"] if moving else []
        return [*(f"uniform {kind} {name};" for name, kind in kinds.items()), *scene]

    def arguments(
        self, kernel: Kernel, lists: Mapping[str, Sequence[str]] = NOTHING, notes: Mapping[str, str] = NOTHING
    ) -> str:
        """Return how a kernel is called."""
        return self.called or super().arguments(kernel, lists, notes)

    def about(self, array: Given) -> str:
        """Return what an array is that a kernel is given, by the names of its textures."""
        name, written = ", ".join(self.textures(array)), array.access == WRITE
        if array.planes:
            kind = "float colour buffers" if written else "textures of 32-bit floats"
            return f"{name}: RGBA {kind}, plane 4 k + c in component c of number k"
        if array.is_image or array.name == RESULT:
            buffer = f"a float colour buffer, RGBA, of which {array.shape[-1]} components are written"
            buffer += ", encoded as `output` says" if array.name == RESULT else ""
            return f"{name}: {buffer if written else 'a texture of 32-bit floats'}"
        if array.name == WEIGHTS and array.home != BLOCK:
            one = "RGBA32F" if self.vectors and self.vectors.lanes > 1 else "R32F"
            size = f"{WEIGHT_TEXTURE_WIDTH} texels wide, as many rows as weights fill, row by row"
            return f"weight_texture: {one}, {size}, the last row padded"
        if array.name == WEIGHTS or array.name == SCENE_NUMBERS:
            return f"{name}: {array.shape[0]} floats, uniforms of four to a vector, the last one padded"
        rows = "rows" if len(array.shape) > 1 else "a row"
        return f"{name}: an R32F texture, {rows} of {array.shape[-1]} texels"

    def launch(self, kernel: Kernel) -> str:
        """Return what is drawn."""
        if kernel.interface.role == PATH:
            return f"{self.covered}; fragment (x, y) follows pixel x of row first_row + y"
        bound = (
            "OpenGL's own row 0 is the bottom: flip what it has rendered. Half floats in images void the\n"
            "bound, and a target that encodes sRGB encodes once more"
        )
        return f"{self.covered}.\n{bound}" if kernel.interface.role == DENOISE else self.covered

    def textures(self, array: Given) -> list[str]:
        """Return the names of an array's textures: planes are four to each."""
        if array.name == RESULT and not array.planes:
            count = -(-int(array.shape[-1]) // (self.channels_per_result or self.max_output_channels))
            return [f"{RESULT}_{number}" for number in range(count)] if count > 1 else [RESULT]
        count = -(-array.planes // self.planes_per_buffer)
        return [f"{array.name}_{number}" for number in range(count)] or [array.name]

    def read(self, array: Given, index: Sequence[str], lanes: int) -> str:
        """Return an element of a texture, a component of a colour buffer, or a number of the scene."""
        name, part = array.name, "[0]"
        if name == SCENE_NUMBERS:
            number, component = divmod(int(index[0]), 4)
            return f"{name}[{number}].{'xyzw'[component]}"
        row, column = ("0", *index)[-2:]
        if array.planes:
            number, component = divmod(int(index[0]), self.planes_per_buffer)
            name, part = f"{name}_{number}", f"[{component}]"
        elif array.is_image:
            row, column, part = index[0], index[1], f"[{index[2]}]"
        written = array.access == WRITE
        return f"{name}{part}" if written else f"texelFetch({name}, ivec2({column}, {row}), 0){part}"


class Groups(Dialect):
    """The words of GLSL's compute shaders."""

    staged = True
    shared_array = "shared {kind} {name}[{count}];"
    local_place = ("gl_LocalInvocationID.x", "gl_LocalInvocationID.y")
    group_place = ("gl_WorkGroupID.x", "gl_WorkGroupID.y")
    wait = "barrier();"
    qualifiers = GLSL.qualifiers
    table = GLSL.table
    vector_kinds = GLSL.vector_kinds


class GLSLCompute(Groups, GLSL):
    """GLSL 4.30 compute shaders on textures: the result is an image, the weights a buffer of `vec4`."""

    language = f"GLSL {SHADER_VERSION / 100:.2f}, compute shader"
    suffix = ".comp"
    group = (16, 8)
    max_output_channels = 4
    pixel_begin = ("vec4 color = vec4(0.0, 0.0, 0.0, 1.0);",)
    pixel_end = ("imageStore(result, ivec2({column}, {row}), color);",)
    weight_vector = "w[{index}]"
    channels_per_result = None
    store = "color[{i}] = {value};"
    launches = (
        "",
        "Dispatch ceil(width / ({columns} * GROUP_WIDTH)) x ceil(height / GROUP_HEIGHT) groups of {group}\n"
        "items. Row 0 is the TOP row of all images; half floats in them void the bound",
    )

    def begin(self, kernel: Kernel, top: str, bounded: bool) -> str:
        """Return the text of a shader up to its first statement."""
        staged = bool(kernel.launches)
        across, down = ("ITEMS", 1) if staged else ("GROUP_WIDTH", "GROUP_HEIGHT")
        device = [s for s in kernel.body if isinstance(s, Array) and s.space == "device"]
        lines = [
            f"#version {SHADER_VERSION} core",
            "#define PRECISE precise",
            top,
            f"layout(local_size_x = {across}, local_size_y = {down}) in;",
            *(self.sampler.format(name=image.name) for image in kernel.interface.images),
            "layout(std430, binding = 0) restrict readonly buffer weight_buffer { vec4 w[]; };",
            "layout(rgba32f, binding = 0) restrict writeonly uniform image2D result;",
        ]
        for number, array in enumerate(device):
            block = f"{{ vec{array.type.lanes} {array.name}[]; }}"
            lines.append(
                f"layout(std430, binding = {number + 1}) restrict buffer {array.name}_buffer {block};"
            )
        if staged:
            return "\n".join([*lines, *(f"uniform int {each};" for each in BATCH), ""])
        return "\n".join(
            [*lines, *self.group_memory(kernel), "", *self.opened(kernel.interface), *self.item_place()]
        )

    def about(self, array: Given) -> str:
        """Return what an array is that a kernel is given."""
        if array.name == WEIGHTS:
            return f"weight_buffer: a storage buffer at binding 0, {array.shape[0]} floats"
        if array.name == RESULT:
            return "result: an image of format RGBA32F at binding 0, encoded as `output` says"
        return super().about(array)

    def launch(self, kernel: Kernel) -> str:
        """Return how many items are started."""
        memory = "Storage buffers 1 and on: the last arrays. Define ITEMS as `items`.\n"
        return (memory if kernel.launches else "") + Dialect.launch(self, kernel)

    def opened(self, kernel: Interface | None = None) -> list[str]:
        """Return the first lines of the function."""
        size = f"textureSize({kernel.images[0].name}, 0)" if kernel else "imageSize(result)"
        return ["void main()", "{", f"    int width = {size}.x;", f"    int height = {size}.y;"]

    def launched(self, kernel: Kernel, launch: Launch, counts: Sequence[str]) -> list[str]:
        """Return the first lines of a launch; no item is beyond the grid, and none needs a branch."""
        column, row = launch.place
        return [
            *self.opened(),
            f"    int {column} = int(gl_GlobalInvocationID.x);",
            f"    int {row} = int(gl_WorkGroupID.y);",
        ]
