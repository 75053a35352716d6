"""Grouped schedules [emit_group.py] on buffers: CUDA C, Metal, WGSL, GLSL for Vulkan and OpenGL 4.3.

Elementwise operations are functions of one number, called for each component: these languages have vectors
of four and products of a vector and a number, and hardware computes one number after another in any case.
WGSL and Vulkan promise 16 KiB that a group shares, CUDA and Metal 32 KiB and more: groups of the former are
half as wide.
"""

from __future__ import annotations

from . import glsl_buffers, metal, wgsl
from .cuda import CLAMP, CUDA
from .emit_group import GroupDialect, Grouped, Lifted
from .glsl_buffers import BUFFERS, ComputeDenoise, VulkanDenoise
from .metal import TOP, Metal
from .wgsl import WGSL

LEAST_SHARED = 2**14
"""Bytes that a group may share on every device: WebGPU's maxComputeWorkgroupStorageSize, and Vulkan's
maxComputeSharedMemorySize."""

PLACE = """\
    int local_x = {local_x};
    int local_y = {local_y};
    int item = local_y * GROUP_WIDTH + local_x;
    int x = {group_x} * (GROUP_WIDTH * PIXELS) + local_x;
    int y = {group_y} * GROUP_HEIGHT + local_y;"""
"""Where an item is in its group, and its first pixel in the picture."""

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


class _Buffers(Lifted):
    """What all have in common; it comes before a language's plain dialect."""

    pixel_at = PIXEL_AT
    store = STORE
    first_weight = "first"


CUDA_VECTOR = """\
#ifndef WAMNET_VECTOR
#define WAMNET_VECTOR
struct __align__(16) wamnet_vector {{ float x, y, z, w; }};
static __device__ inline wamnet_vector wamnet_made(float x, float y, float z, float w)
{{
    wamnet_vector made = {{x, y, z, w}};
    return made;
}}
static __device__ inline wamnet_vector operator*(wamnet_vector a, float b)
{{
    return wamnet_made(a.x * b, a.y * b, a.z * b, a.w * b);
}}
static __device__ inline void operator+=(wamnet_vector &a, wamnet_vector b)
{{
    a = wamnet_made(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}}
#endif
"""
"""Vectors of four, with the two operations that sums need: CUDA's own have none."""


class CUDAGroup(_Buffers, CUDA):
    """CUDA C."""

    kind = "wamnet_vector"
    wait = "__syncthreads();"
    literal_zero = "wamnet_made(0.0f, 0.0f, 0.0f, 0.0f)"
    function_head = "static __device__ inline {kind} {name}({operands})"
    operand = "{kind} {name}"
    made = "wamnet_made({values})"
    begin = (
        f"{CLAMP}{CUDA_VECTOR}"
        + """\
{defines}
extern "C" __global__ void __launch_bounds__(GROUP_WIDTH * GROUP_HEIGHT) {entry}(
{images},
    const float *__restrict__ weights,
    float *__restrict__ result,
    int width,
    int height)
{{
    __shared__ float tile[TILE_NUMBERS];
    const wamnet_vector *w = (const wamnet_vector *)weights;
"""
        + PLACE.format(
            local_x="(int)threadIdx.x",
            local_y="(int)threadIdx.y",
            group_x="(int)blockIdx.x",
            group_y="(int)blockIdx.y",
        )
    )
    arguments = (
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "weights; result: width * height * {channels} floats in the same order, encoded as `output` says;\n"
        f"width; height. {GROUPED}"
    )


class MetalGroup(_Buffers, Metal):
    """Metal Shading Language."""

    kind = "float4"
    wait = "threadgroup_barrier(mem_flags::mem_threadgroup);"
    literal_zero = "float4(0.0f)"
    function_head = "static inline {kind} {name}({operands})"
    operand = "{kind} {name}"
    made = "float4({values})"
    begin = (
        f"{TOP}\n{{defines}}\n{metal.sized('int width', 'int height')}"
        + """\
kernel void {entry}(
    constant Size &size [[buffer(0)]],
    device const float *weights [[buffer(1)]],
    device float *result [[buffer(2)]],
{images},
    uint2 item_place [[thread_position_in_threadgroup]],
    uint2 group_place [[threadgroup_position_in_grid]])
{{
    threadgroup float tile[TILE_NUMBERS];
    device const float4 *w = (device const float4 *)weights;
    int width = size.width;
    int height = size.height;
"""
        + PLACE.format(
            local_x="int(item_place.x)",
            local_y="int(item_place.y)",
            group_x="int(group_place.x)",
            group_y="int(group_place.y)",
        )
    )
    arguments = f"{BUFFERS.format(sizes='width, height')}{HELD}.\n{GROUPED}"


class WGSLGroup(_Buffers, WGSL):
    """WGSL."""

    kind = "vec4<f32>"
    wait = "workgroupBarrier();"
    literal_zero = "vec4<f32>(0.0f)"
    largest_shared = LEAST_SHARED
    strided = "for (var {i}: i32 = {first}; {i} < {end}; {i} += {step}) {{"
    function_head = "fn {name}({operands}) -> {kind}"
    operand = "{name}: {kind}"
    made = "vec4<f32>({values})"
    begin = (
        f"{{defines}}\n{wgsl.sized()}"
        f"{wgsl.storage('1', 'read', 'w', 'vec4<f32>')}\n"
        f"{wgsl.storage('2', 'read_write', 'result')}\n"
        + """\
{images}
var<workgroup> tile: array<f32, TILE_NUMBERS>;

@compute @workgroup_size(GROUP_WIDTH, GROUP_HEIGHT)
fn main(@builtin(local_invocation_id) item_place: vec3<u32>, @builtin(workgroup_id) group_place: vec3<u32>) {{
    let width: i32 = size.width;
    let height: i32 = size.height;
    let local_x: i32 = i32(item_place.x);
    let local_y: i32 = i32(item_place.y);
    let item: i32 = local_y * GROUP_WIDTH + local_x;
    let x: i32 = i32(group_place.x) * (GROUP_WIDTH * PIXELS) + local_x;
    let y: i32 = i32(group_place.y) * GROUP_HEIGHT + local_y;"""
    )
    arguments = MetalGroup.arguments

    def vector(self, name: str, value: str) -> str:
        """Return the declaration of four numbers that may be added to."""
        return f"var {name}: {self.kind} = {value};"

    def truth(self, name: str, value: str) -> str:
        """Return the declaration of a truth value."""
        return self.let("bool", name, value)


class VulkanGroup(_Buffers, VulkanDenoise):
    """GLSL for Vulkan, of which SPIR-V and HLSL are made."""

    kind = "vec4"
    wait = "barrier();"
    literal_zero = "vec4(0.0f)"
    largest_shared = LEAST_SHARED
    function_head = "{kind} {name}({operands})"
    operand = "{kind} {name}"
    made = "vec4({values})"
    begin = (
        "{defines}\nlayout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;\n"
        + glsl_buffers.sized()
        + glsl_buffers.storage("1", "readonly", "Weights", "w", "vec4")
        + "\n"
        + glsl_buffers.storage("2", "writeonly", "Result", "result")
        + "\n{images}\nshared float tile[TILE_NUMBERS];\n\nvoid main()\n{{\n"
        + PLACE.format(
            local_x="int(gl_LocalInvocationID.x)",
            local_y="int(gl_LocalInvocationID.y)",
            group_x="int(gl_WorkGroupID.x)",
            group_y="int(gl_WorkGroupID.y)",
        )
    )
    arguments = MetalGroup.arguments


class ComputeGroup(ComputeDenoise, VulkanGroup):
    """The same for OpenGL 4.3, which lets a group share 32 KiB; halves are as fast to start."""

    arguments = VulkanGroup.arguments


def groups(dialect: GroupDialect, width: int = 16) -> tuple[Grouped, Grouped]:
    """Return the schedules for graphics processors in a language, of groups of `width` x 8 items."""
    one = "a tile of the image in memory that a group of items shares; layers in registers, one pixel an item"
    four = "the same with 4 pixels an item, which share each weight"
    return (
        Grouped("group", one, dialect, 1, (width, 8)),
        Grouped("group4", four, dialect, 4, (width, 8), "group"),
    )
