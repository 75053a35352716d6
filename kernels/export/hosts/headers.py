"""`host.h` of hosts without a reader of JSON: what an export is bound to; their programs never differ.

1. Hosts in C and C++: the export's headers, and functions that call all of its kernels in order [`calling`].
   Arrays of images come in the order of `host_images`; weights are read once, from the manifest's files.
2. Hosts that launch kernels on buffers, OpenCL and Vulkan: buffers and launches as tables [`launching`]. The
   first kernel of a rank writes the buffer that the second one reads as `image_horizontal`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ....compiler.kernel.interface import DENOISE, ENCODE, IMAGE, PATH, RESULT, SUMS, WEIGHTS
from ....compiler.languages.c import whole

TOP = """\
/*
 * What this export is bound to. Written by `wamnet export`: main.c is the same for every model.
 */
#ifndef HOST_H
#define HOST_H
{includes}

enum {{
    HOST_WIDTH = {width}, /* of the check pair */
    HOST_HEIGHT = {height},
    HOST_IMAGES = {count},
    HOST_PLANES = {planes}, /* of the sums over paths; 0 without a scene */
    HOST_RAYS = {rays}, /* a pixel, whose means are the features that the model has learned from */
    HOST_SEED = {seed}
}};

#define HOST_ADDED {added}f /* what the host's storage may add to a bound */
#define HOST_ALIKE {alike}f /* share of the sums that must be the reference's except for rounding */
#define HOST_WITHIN {within}f

static const struct {{
    const char *file;
    int channels;
}} host_images[HOST_IMAGES] = {{
{images}
}};
"""
"""The file up to its functions."""

SEED, WITHIN, ALIKE = 7, 10_000 * 2.0**-24, 0.98
"""The check pair's seed, and how its sums are compared (spec/export.md, EXP-10)."""

DENOISED = """\
/* All kernels of the denoiser, in order. Arrays are (height, width, channels), rows from the top. */
static void host_denoise(float *const *images, float *result, int width, int height)
{{
{body}
}}
"""
"""The function around the denoiser's kernels."""

PATHS = """\
/* Sums over `samples` paths a pixel from `first` on: planes of width * height numbers. */
static void host_trace(int width, int height, int first, int samples, float *sums)
{{
    wamnet_part part;
    part.width = width;
    part.height = height;
    part.first_row = 0;
    part.rows = height;
    part.first_sample = (uint32_t)first;
    part.samples = samples;
    part.seed_number = HOST_SEED;
    {call}(&part, sums);
}}

/* The images of the features, from sums. */
static void host_encode(const float *sums, float *const *images, int width, int height, int samples)
{{
    {encode}({arguments});
}}
"""
"""The functions around the kernels of a scene."""


def calling(facts: Mapping[str, Any]) -> str:
    """Return the text of `host.h` for hosts in C and C++."""
    check, kernels = facts["check"], facts["kernels"]
    files = [name for kernel in kernels for name in kernel["files"]]
    sums, own = check["sums"], facts["scene"] and facts["scene"]["feature_rays"]
    images = [
        f'    {{"check/{check["images"][image["name"]]["file"]}", {image["channels"]}}},'
        for image in facts["images"]
    ]
    top = TOP.format(
        includes="\n".join(f'#include "{name}"' for name in files),
        width=check["width"],
        height=check["height"],
        count=len(images),
        planes=len(sums["planes"]) if sums else 0,
        # Those of one launch where the path kernel traces further rays.
        rays=1 if own else int(facts["model"]["feature_spp"]),
        seed=SEED,
        added=float(facts["host"]["storage"]["added"]),
        alike=ALIKE,
        within=WITHIN,
        images="\n".join(images),
    )
    made = [top, *_paths(kernels, facts["images"]), _denoiser(kernels, facts["images"])]
    return "\n".join([*made, "#endif\n"])


def _places(images: list[Mapping[str, Any]]) -> dict[str, str]:
    """Return the text of each image's array."""
    return {f"{IMAGE}{image['name']}": f"images[{index}]" for index, image in enumerate(images)}


def _denoiser(kernels: list[Mapping[str, Any]], images: list[Mapping[str, Any]]) -> str:
    """Return the function that calls the kernels of the denoiser."""
    called = [kernel for kernel in kernels if kernel["role"] not in (PATH, ENCODE)]
    places, declared, lines, freed = _places(images), list[str](), list[str](), list[str]()
    for kernel in called:
        role, own = kernel["role"], dict(places)
        for bound in kernel["bindings"]:
            name, shape = bound["name"], bound["shape"]
            if name == WEIGHTS:
                own[name] = f"weights_{role}"
                declared.append(f"    static float *weights_{role};")
                lines.append(f"    if (!weights_{role}) {{")
                read = f'host_read("{role}/weights.bin", {shape[0]})'
                lines += [f"        weights_{role} = {read};", "    }"]
            elif name == RESULT and role != DENOISE:
                own[name] = places[f"{IMAGE}{role}"] = role
                size = f"(size_t)width * (size_t)height * {shape[2]}"
                lines.append(f"    float *{role} = host_floats({size});")
                freed.append(f"    free({role});")
        given = ", ".join(own.get(bound["name"], bound["name"]) for bound in kernel["bindings"])
        lines.append(f"    {whole(kernel['entry_point'])}({given});")
    return DENOISED.format(body="\n".join([*declared, *lines, *freed]))


def _paths(kernels: list[Mapping[str, Any]], images: list[Mapping[str, Any]]) -> list[str]:
    """Return the functions that call the kernels of a scene, if there is one."""
    found = {kernel["role"]: kernel for kernel in kernels}
    if PATH not in found:
        return []
    places = {**_places(images), SUMS: SUMS, "sample_count": "samples"}
    given = [places.get(bound["name"], bound["name"]) for bound in found[ENCODE]["bindings"]]
    call, encode = whole(found[PATH]["entry_point"]), found[ENCODE]["entry_point"]
    return [PATHS.format(call=call, encode=encode, arguments=", ".join(given))]


# ---- launches on buffers -----------------------------------------------------------------------------------


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


def launching(facts: Mapping[str, Any]) -> str:
    """Return the text of `host.h` for hosts that launch kernels on buffers."""
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
