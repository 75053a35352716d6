"""`host.h` of hosts that launch kernels on buffers, OpenCL and Vulkan: buffers and launches as tables.

`main.c` is the same for every model: it makes the buffers of [`TABLES`] and walks through the launches. The
first kernel of a rank writes the buffer that the second one reads as `image_horizontal`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ....compiler.kernel.interface import DENOISE, IMAGE, RESULT, WEIGHTS

TABLES = """\
/*
 * What this export is bound to. Written by `wamnet export`: main.c is the same for every model.
 */
#ifndef HOST_H
#define HOST_H

enum {{ HOST_WIDTH = {width}, HOST_HEIGHT = {height} }}; /* of the check pair */

enum {{ HOST_SIZES = -1, HOST_COLUMNS = -2, HOST_ROWS = -3 }}; /* integers: both, or one */

#define HOST_ADDED {added}f /* what the host's storage may add to a bound */

/* Numbers of a pixel, or in all; the file that a buffer holds at first, or none. */
static const struct host_buffer {{
    const char *name;
    int each;
    int all;
    const char *file;
}} host_buffers[] = {{
{buffers}
}};

enum {{ HOST_BUFFERS = {count}, HOST_RESULT = {result}, HOST_MOST = {most} }};

/* A kernel: pixels of an item along a row and down, items of a group; its arguments, by their places. */
static const struct host_launch {{
    const char *file;
    const char *entry;
    int pixels, rows, group_x, group_y;
    int count;
    struct {{
        int place;
        int buffer;
    }} arguments[HOST_MOST];
}} host_launches[] = {{
{launches}
}};

enum {{ HOST_LAUNCHES = {steps} }};

#endif
"""
"""The file."""

INTEGERS = {"sizes": "HOST_SIZES", "width": "HOST_COLUMNS", "height": "HOST_ROWS"}
"""What arguments other than buffers are called."""

GROUP = (8, 8)
"""Items of a group where a kernel asks for no other number."""


def header(facts: Mapping[str, Any]) -> str:
    """Return the text of `host.h`."""
    check, kernels = facts["check"], facts["kernels"]
    rows, names = _buffers(check, facts["images"], kernels)
    return TABLES.format(
        width=check["width"],
        height=check["height"],
        added=float(facts["host"]["storage"]["added"]),
        buffers="\n".join(rows),
        count=len(rows),
        result=names.index(f"{IMAGE}{DENOISE}"),
        most=max(len(kernel["bindings"]) for kernel in kernels),
        launches="\n".join(_launch(kernel, names) for kernel in kernels),
        steps=len(kernels),
    )


def _buffers(
    check: Mapping[str, Any], images: Sequence[Mapping[str, Any]], kernels: Sequence[Mapping[str, Any]]
) -> tuple[list[str], list[str]]:
    """Return the rows of the table of buffers, and their names."""
    found = [
        (f"{IMAGE}{i['name']}", i["channels"], 0, f"check/{check['images'][i['name']]['file']}")
        for i in images
    ]
    for kernel in kernels:
        role = kernel["role"]
        for bound in kernel["bindings"]:
            if bound["name"] == WEIGHTS:
                found.append((f"{WEIGHTS}_{role}", 0, bound["shape"][0], f"{role}/weights.bin"))
            elif bound["name"] == RESULT:
                found.append((f"{IMAGE}{role}", bound["shape"][2], 0, ""))
    rows = [
        f'    {{"{name}", {each}, {count}, {f"{chr(34)}{file}{chr(34)}" if file else 0}}},'
        for name, each, count, file in found
    ]
    return rows, [name for name, *_ in found]


def _launch(kernel: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return the row of a kernel."""
    role, schedule = kernel["role"], kernel["schedule"]
    own = {WEIGHTS: f"{WEIGHTS}_{role}", RESULT: f"{IMAGE}{role}"}
    given = []
    for bound in kernel["bindings"]:
        name = own.get(bound["name"], bound["name"])
        place = INTEGERS.get(name) or names.index(name)
        given.append(f"{{{bound['slot']}, {place}}}")
    width, height = schedule.get("group", GROUP)
    file = next(name for name in kernel["files"] if not name.endswith(".comp"))
    numbers = f"{schedule['pixels']}, {schedule.get('rows', 1)}, {width}, {height}, {len(given)}"
    return f'    {{"{file}", "{kernel["entry_point"]}", {numbers}, {{{", ".join(given)}}}}},'
