"""Grouped schedules [emit_group.py] on buffers: CUDA C, Metal, WGSL, GLSL for Vulkan and OpenGL 4.3.

Elementwise operations are functions of one number, called for each component: these languages have vectors
of four and products of a vector and a number, and hardware computes one number after another in any case.
WGSL and Vulkan promise 16 KiB that a group shares, CUDA and Metal 32 KiB and more: groups of the former are
half as wide. Three of them have a word for products of bytes [emit_dot.py].
"""

from __future__ import annotations

from ..languages.cuda import CLAMP, CUDA
from ..languages.dialect import Parts
from ..languages.glsl_buffers import BUFFERS, Compute, Declared, Vulkan
from ..languages.interface import DENOISE, WEIGHTS, Array, Interface
from ..languages.metal import Metal
from ..languages.openings import IMAGES, WEIGHTS_RESULT
from ..languages.wgsl import WGSL
from .emit_dot import GroupDotDialect
from .emit_group import BufferGroup, GroupDialect, Grouped, Lifted

PORTABLE = "WAMNET_PORTABLE"
"""What to define where a kernel may use nothing beyond its language's own standard."""

LEAST_SHARED = 2**14
"""Bytes that a group may share on every device: WebGPU's maxComputeWorkgroupStorageSize, and Vulkan's
maxComputeSharedMemorySize."""

GROUPED = (
    "Start ceil(width / ({pixels} * GROUP_WIDTH)) x ceil(height / GROUP_HEIGHT) groups of {group} items;\n"
    "those beyond the picture write nothing. Weights at an address that is a multiple of 16"
)
"""How all these kernels are started."""

HELD = (
    "1 the weights, 2 the result (width * height *\n{channels} floats, encoded as `output` says), 3 and on "
    "the images in this order"
)
"""What the buffers with numbers hold."""

STORE = "result[(y * width + x + {p} * GROUP_WIDTH) * {channels} + {i}] = {value};"
"""How a number of a pixel is written."""

PIXEL_AT = "image_{image}[(row * width + column) * {channels} + {c}]"
"""How a number of a pixel is read."""

SAID = {DENOISE: f"{BUFFERS.format(sizes='width, height')}{HELD}.\n{GROUPED}"}
"""How those are called whose arrays have numbers."""


class _Group(Lifted, BufferGroup):
    """What all have in common; it comes before a language's plain dialect."""

    pixel_at = PIXEL_AT
    store = STORE
    first_weight = "first"
    operand = "{kind} {name}"


CUDA_VECTOR = """\
#ifndef WAMNET_VECTOR
#define WAMNET_VECTOR
struct __align__(16) wamnet_vector { float x, y, z, w; };
static __device__ inline wamnet_vector wamnet_made(float x, float y, float z, float w)
{
    wamnet_vector made = {x, y, z, w};
    return made;
}
static __device__ inline wamnet_vector operator*(wamnet_vector a, float b)
{
    return wamnet_made(a.x * b, a.y * b, a.z * b, a.w * b);
}
static __device__ inline void operator+=(wamnet_vector &a, wamnet_vector b)
{
    a = wamnet_made(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}
#endif
"""
"""Vectors of four, with the two operations that sums need: CUDA's own have none."""


class CUDAGroup(_Group, CUDA):
    """CUDA C."""

    heading = 'extern "C" __global__ void __launch_bounds__(GROUP_WIDTH * GROUP_HEIGHT) {entry}'
    kind = "wamnet_vector"
    wait = "__syncthreads();"
    literal_zero = "wamnet_made(0.0f, 0.0f, 0.0f, 0.0f)"
    function_head = "static __device__ inline {kind} {name}({operands})"
    made = "wamnet_made({values})"
    shared_tile = "__shared__ float tile[TILE_NUMBERS];"
    weights_as_vectors = "const wamnet_vector *w = (const wamnet_vector *)weights;"
    local = ("threadIdx.x", "threadIdx.y")
    group = ("blockIdx.x", "blockIdx.y")
    said = {DENOISE: f"{IMAGES};\n{WEIGHTS_RESULT};\nwidth; height. {GROUPED}"}

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [f"{CLAMP}{CUDA_VECTOR}{parts.top}"]


class MetalGroup(_Group, Metal):
    """Metal Shading Language."""

    threads = (
        "uint2 item_place [[thread_position_in_threadgroup]]",
        "uint2 group_place [[threadgroup_position_in_grid]]",
    )
    kind = "float4"
    wait = "threadgroup_barrier(mem_flags::mem_threadgroup);"
    literal_zero = "float4(0.0f)"
    function_head = "static inline {kind} {name}({operands})"
    made = "float4({values})"
    shared_tile = "threadgroup float tile[TILE_NUMBERS];"
    weights_as_vectors = "device const float4 *w = (device const float4 *)weights;"
    local = ("item_place.x", "item_place.y")
    group = ("group_place.x", "group_place.y")
    said = SAID

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return super().top(kernel, parts)[:-1]


class _Declared(_Group, Declared):
    """Languages whose weights are declared as vectors, and `group_tile` above the function."""

    largest_shared = LEAST_SHARED
    said = SAID
    group_tile: str

    def element(self, array: Array) -> tuple[str, str]:
        """Return an array's name in the kernel, and the type of its elements."""
        return ("w", self.kind) if array.name == WEIGHTS else super().element(array)

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [*super().top(kernel, parts)[:-1], self.group_tile, ""]


class WGSLGroup(_Declared, WGSL):
    """WGSL."""

    group_size = "@compute @workgroup_size(GROUP_WIDTH, GROUP_HEIGHT)"
    places = (
        "@builtin(local_invocation_id) item_place: vec3<u32>, @builtin(workgroup_id) group_place: vec3<u32>"
    )
    kind = "vec4<f32>"
    wait = "workgroupBarrier();"
    literal_zero = "vec4<f32>(0.0f)"
    strided = "for (var {i}: i32 = {first}; {i} < {end}; {i} += {step}) {{"
    function_head = "fn {name}({operands}) -> {kind}"
    operand = "{name}: {kind}"
    made = "vec4<f32>({values})"
    group_tile = "var<workgroup> tile: array<f32, TILE_NUMBERS>;"
    local, group = MetalGroup.local, MetalGroup.group

    def vector(self, name: str, value: str) -> str:
        """Return the declaration of four numbers that may be added to."""
        return f"var {name}: {self.kind} = {value};"

    def truth(self, name: str, value: str) -> str:
        """Return the declaration of a boolean."""
        return self.let("bool", name, value)


class VulkanGroup(_Declared, Vulkan):
    """GLSL for Vulkan, of which SPIR-V and HLSL are made."""

    group_size = ("GROUP_WIDTH", "GROUP_HEIGHT")
    kind = "vec4"
    wait = "barrier();"
    literal_zero = "vec4(0.0f)"
    function_head = "{kind} {name}({operands})"
    made = "vec4({values})"
    group_tile = "shared float tile[TILE_NUMBERS];"
    local = ("gl_LocalInvocationID.x", "gl_LocalInvocationID.y")
    group = ("gl_WorkGroupID.x", "gl_WorkGroupID.y")


class ComputeGroup(Compute, VulkanGroup):
    """The same for OpenGL 4.3, which lets a group share 32 KiB; halves are as fast to start."""


def groups(dialect: GroupDialect, width: int = 16) -> tuple[Grouped, Grouped]:
    """Return the schedules for graphics processors in a language, of groups of `width` x 8 items."""
    one = "a tile of the image in memory that a group of items shares; layers in registers, one pixel an item"
    four = "the same with 4 pixels an item, which share each weight"
    return (
        Grouped("group", one, dialect, 1, (width, 8)),
        Grouped("group4", four, dialect, 4, (width, 8), "group"),
    )


# ---- products of bytes -----------------------------------------------------------------------------------

CUDA_DOTS = """\
#ifndef WAMNET_DOTS
#define WAMNET_DOTS
static __device__ inline int wamnet_packed(float a, float b, float c, float d)
{
    unsigned int low = ((unsigned int)(int)a & 255u) | ((unsigned int)(int)b & 255u) << 8;
    return (int)(low | ((unsigned int)(int)c & 255u) << 16 | (unsigned int)(int)d << 24);
}
static __device__ inline int4 wamnet_dots(int4 sums, int4 weights, int word)
{
    int x = __dp4a(weights.x, word, sums.x), y = __dp4a(weights.y, word, sums.y);
    int z = __dp4a(weights.z, word, sums.z), w = __dp4a(weights.w, word, sums.w);
    return make_int4(x, y, z, w);
}
static __device__ inline wamnet_vector wamnet_floats(int4 sums)
{
    return wamnet_made((float)sums.x, (float)sums.y, (float)sums.z, (float)sums.w);
}
static __device__ inline wamnet_vector wamnet_numbers(int4 bits)
{
    float x = __int_as_float(bits.x), y = __int_as_float(bits.y);
    float z = __int_as_float(bits.z), w = __int_as_float(bits.w);
    return wamnet_made(x, y, z, w);
}
#endif
"""
"""Words of bytes in CUDA."""


class CUDADot(GroupDotDialect, CUDAGroup):
    """CUDA C."""

    by = "__dp4a, which needs -arch=sm_61 or later"
    whole_kind = "int4"
    whole_zero = "make_int4(0, 0, 0, 0)"
    shared_tile = "__shared__ int tile[TILE_NUMBERS];"
    weights_as_vectors = "const int4 *w = (const int4 *)weights;"

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [*super().top(kernel, parts), CUDA_DOTS]


class _DeclaredDot(GroupDotDialect, _Declared):
    """Languages whose weights are declared as vectors of integers; `dots` are the functions."""

    dots: str

    def element(self, array: Array) -> tuple[str, str]:
        """Return an array's name in the kernel, and the type of its elements."""
        return ("w", self.whole_kind) if array.name == WEIGHTS else super().element(array)

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [*super().top(kernel, parts), self.dots]


class WGSLDot(_DeclaredDot, WGSLGroup):
    """WGSL."""

    by = "dot4I8Packed, of the language feature packed_4x8_integer_dot_product"
    first = ("requires packed_4x8_integer_dot_product;",)
    whole_kind = "vec4<i32>"
    whole_zero = "vec4<i32>(0)"
    group_tile = "var<workgroup> tile: array<i32, TILE_NUMBERS>;"
    dots = """\
fn wamnet_packed(a: f32, b: f32, c: f32, d: f32) -> i32 {
    return bitcast<i32>(pack4xI8(vec4<i32>(vec4<f32>(a, b, c, d))));
}
fn wamnet_dots(sums: vec4<i32>, weights: vec4<i32>, word: i32) -> vec4<i32> {
    let words = bitcast<vec4<u32>>(weights);
    let four = bitcast<u32>(word);
    let x = dot4I8Packed(words.x, four);
    let y = dot4I8Packed(words.y, four);
    let z = dot4I8Packed(words.z, four);
    let w = dot4I8Packed(words.w, four);
    return sums + vec4<i32>(x, y, z, w);
}
fn wamnet_floats(sums: vec4<i32>) -> vec4<f32> {
    return vec4<f32>(sums);
}
fn wamnet_numbers(bits: vec4<i32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(bits);
}
"""

    def four(self, name: str, value: str) -> str:
        """Return the declaration of four integers that may be added to."""
        return f"var {name}: {self.whole_kind} = {value};"


SHIFTED = """\
    return sums + (weights << 24 >> 24) * (word << 24 >> 24) + (weights << 16 >> 24) * (word << 16 >> 24)
        + (weights << 8 >> 24) * (word << 8 >> 24) + (weights >> 24) * (word >> 24);"""
"""Products of bytes with a sign in languages whose vectors can be shifted."""

VULKAN_EXTENSION = (
    f"#if defined(GL_EXT_integer_dot_product) && !defined({PORTABLE})",
    "#define WAMNET_DOT_PRODUCT",
    "#extension GL_EXT_integer_dot_product : require",
    "#endif",
)
"""Asks for Vulkan's products of bytes where the compiler knows them."""


class VulkanDot(_DeclaredDot, VulkanGroup):
    """GLSL for Vulkan."""

    by = f"GL_EXT_integer_dot_product where the compiler knows it and {PORTABLE} is not defined, else shifts"
    first = (*VulkanGroup.first, *VULKAN_EXTENSION)
    whole_kind = "ivec4"
    whole_zero = "ivec4(0)"
    group_tile = "shared int tile[TILE_NUMBERS];"
    dots = f"""\
int wamnet_packed(float a, float b, float c, float d)
{{
    return (int(a) & 255) | ((int(b) & 255) << 8) | ((int(c) & 255) << 16) | (int(d) << 24);
}}
ivec4 wamnet_dots(ivec4 sums, ivec4 weights, int word)
{{
#ifdef WAMNET_DOT_PRODUCT
    int x = dotPacked4x8EXT(weights.x, word), y = dotPacked4x8EXT(weights.y, word);
    int z = dotPacked4x8EXT(weights.z, word), w = dotPacked4x8EXT(weights.w, word);
    return sums + ivec4(x, y, z, w);
#else
{SHIFTED}
#endif
}}
vec4 wamnet_floats(ivec4 sums)
{{
    return vec4(sums);
}}
vec4 wamnet_numbers(ivec4 bits)
{{
    return intBitsToFloat(bits);
}}
"""
