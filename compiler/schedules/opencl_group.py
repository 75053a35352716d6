"""OpenCL C 1.2 for the grouped schedule [emit_group.py], and the schedules for graphics processors."""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.interface import DENOISE, Interface
from .buffers_group import SHIFTED
from .emit_dot import GroupDotDialect, dots
from .emit_group import BufferGroup, Grouped
from .opencl_tiled import ALIGNED, OpenCLTiled


class OpenCLGroup(BufferGroup, OpenCLTiled):
    """The dialect's table."""

    heading = "__kernel __attribute__((reqd_work_group_size(GROUP_WIDTH, GROUP_HEIGHT, 1)))\nvoid {entry}"
    kind = "vector"
    wait = "barrier(CLK_LOCAL_MEM_FENCE);"
    literal_zero = "(vector)(0.0f)"
    pixel_at = "image_{image}[(row * width + column) * {channels} + {c}]"
    shared_tile = "__local float tile[TILE_NUMBERS];"
    weights_as_vectors = "__global const vector *w = (__global const vector *)weights;"
    local = ("get_local_id(0)", "get_local_id(1)")
    group = ("get_group_id(0)", "get_group_id(1)")
    store = "result[(y * width + x + {p} * GROUP_WIDTH) * {channels} + {i}] = {value};"
    said = {
        DENOISE: f"{ALIGNED}\nGroups of {{group}} items; "
        "global size: (ceil(width / {pixels}), height), in whole groups"
    }

    def __init__(self) -> None:
        super().__init__(4)

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [self.macros, parts.top]


OPENCL_GROUPS = (
    Grouped(
        "group",
        "a tile of the image in memory that a work group shares; layers in registers, one pixel an item",
        OpenCLGroup(),
        pixels=1,
    ),
    Grouped(
        "group4", "the same with 4 pixels an item, which share each weight", OpenCLGroup(), 4, instead="group"
    ),
)
"""The schedules for graphics processors; none of them has been measured on one."""

DOTS = f"""\
int wamnet_packed(float a, float b, float c, float d)
{{
    uint low = ((uint)(int)a & 255u) | ((uint)(int)b & 255u) << 8;
    return as_int(low | ((uint)(int)c & 255u) << 16 | (uint)(int)d << 24);
}}
int4 wamnet_dots(int4 sums, int4 weights, int word)
{{
#ifdef __opencl_c_integer_dot_product_input_4x8bit_packed
    int x = dot_acc_sat_4x8packed_ss_int(as_uint(weights.x), as_uint(word), sums.x);
    int y = dot_acc_sat_4x8packed_ss_int(as_uint(weights.y), as_uint(word), sums.y);
    int z = dot_acc_sat_4x8packed_ss_int(as_uint(weights.z), as_uint(word), sums.z);
    int w = dot_acc_sat_4x8packed_ss_int(as_uint(weights.w), as_uint(word), sums.w);
    return (int4)(x, y, z, w);
#else
{SHIFTED}
#endif
}}
vector wamnet_floats(int4 sums)
{{
    return (vector)((float)sums.x, (float)sums.y, (float)sums.z, (float)sums.w);
}}
vector wamnet_numbers(int4 bits)
{{
    return as_float4(bits);
}}
"""
"""Words of bytes: no sum is near the ends of 32 bits, where the instruction would saturate."""


class OpenCLGroupDot(GroupDotDialect, OpenCLGroup):
    """The dialect's table for words of bytes."""

    by = "cl_khr_integer_dot_product where -cl-std=CL3.0 and the device have it, else shifts"
    whole_kind = "int4"
    whole_zero = "(int4)(0)"
    shared_tile = "__local int tile[TILE_NUMBERS];"
    weights_as_vectors = "__global const int4 *w = (__global const int4 *)weights;"

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [*super().top(kernel, parts), DOTS]


OPENCL_GROUP_DOT = dots(OpenCLGroupDot())
"""The schedule of bytes for graphics processors."""
