"""`host.h` of hosts in C and C++: the export's headers, and functions that call all of its kernels in order.

`main.c` and `main.cpp` are the same for every model and scene: what differs is here. Arrays of images come in
the order of `host_images`; weights are read once, from the files that the manifest names.
"""

from __future__ import annotations

from collections.abc import Mapping
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


def header(facts: Mapping[str, Any]) -> str:
    """Return the text of `host.h`."""
    check, kernels = facts["check"], facts["kernels"]
    files = [name for kernel in kernels for name in kernel["files"]]
    sums = check["sums"]
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
        rays=_rays(facts),
        seed=SEED,
        added=float(facts["host"]["storage"]["added"]),
        alike=ALIKE,
        within=WITHIN,
        images="\n".join(images),
    )
    made = [top, *_paths(kernels, facts["images"]), _denoiser(kernels, facts["images"])]
    return "\n".join([*made, "#endif\n"])


def _rays(facts: Mapping[str, Any]) -> int:
    """Return how many launches' means the features are: those of one where its kernel traces further rays."""
    own = facts["scene"] and facts["scene"]["feature_rays"]
    return 1 if own else int(facts["model"]["feature_spp"])


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
