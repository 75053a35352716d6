"""OpenCL C 1.2 for the grouped schedule [emit_group.py], and the schedules for graphics processors."""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.interface import DENOISE, Interface
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
