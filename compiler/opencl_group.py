"""OpenCL C 1.2 for the grouped schedule [emit_group.py], and the schedules for graphics processors."""

from __future__ import annotations

from .emit_group import GroupDialect, Grouped
from .opencl_tiled import MACROS, OpenCLTiled

BEGIN = f"""\
{MACROS.replace("@lanes@", "4")}
{{defines}}
__kernel __attribute__((reqd_work_group_size(GROUP_WIDTH, GROUP_HEIGHT, 1)))
void {{entry}}(
{{images}},
    __global const float *restrict weights,
    __global float *restrict result,
    int width,
    int height)
{{{{
    __local float tile[TILE_NUMBERS];
    __global const vector *w = (__global const vector *)weights;
    int local_x = (int)get_local_id(0);
    int local_y = (int)get_local_id(1);
    int item = local_y * GROUP_WIDTH + local_x;
    int x = (int)get_group_id(0) * (GROUP_WIDTH * PIXELS) + local_x;
    int y = (int)get_group_id(1) * GROUP_HEIGHT + local_y;"""
"""What stands before the statements."""


class OpenCLGroup(OpenCLTiled, GroupDialect):
    """The dialect's table."""

    kind = "vector"
    wait = "barrier(CLK_LOCAL_MEM_FENCE);"
    literal_zero = "(vector)(0.0f)"
    pixel_at = "image_{image}[(row * width + column) * {channels} + {c}]"
    stored = ((), ())
    store = "result[(y * width + x + {p} * GROUP_WIDTH) * {channels} + {i}] = {value};"
    arguments = (
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "weights, at an address that is a multiple of 16; result: width * height * {channels} floats\n"
        "in the order of the images, encoded as `output` says; width; height.\n"
        "Groups of {group} items; global size: (ceil(width / {pixels}), height), in whole groups"
    )

    def __init__(self) -> None:
        super().__init__(4)
        self.begin = BEGIN


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
