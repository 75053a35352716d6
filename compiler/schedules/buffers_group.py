"""Grouped schedules [emit_group.py] on buffers: CUDA C, Metal, WGSL, GLSL for Vulkan and OpenGL 4.3.

Elementwise operations are functions of one number, called for each component: these languages have vectors
of four and products of a vector and a number, and hardware computes one number after another in any case.
WGSL and Vulkan promise 16 KiB that a group shares, CUDA and Metal 32 KiB and more: groups of the former are
half as wide.
"""

from __future__ import annotations

from ..languages.cuda import CLAMP, CUDA
from ..languages.dialect import Parts
from ..languages.glsl_buffers import BUFFERS, Compute, Declared, Vulkan
from ..languages.interface import DENOISE, WEIGHTS, Array, Interface
from ..languages.metal import Metal
from ..languages.openings import IMAGES, WEIGHTS_RESULT
from ..languages.wgsl import WGSL
from .emit_group import BufferGroup, GroupDialect, Grouped, Lifted

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
