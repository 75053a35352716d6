"""Headers in C: what an export is bound to, for programs that never differ and have no reader of JSON.

1. Hosts in C and C++: the export's headers, and functions that call all of its kernels in order [`calling`].
   Arrays of images come in the order of `host_images`; weights are read once, from the manifest's files.
2. Hosts that launch kernels on buffers, OpenCL and Vulkan: buffers and launches as tables [`launching`]. The
   first kernel of a rank writes the buffer that the second one reads as `image_horizontal`.
3. `scratch.h` of every export in C, for threads with small stacks [`scratch`].

The files are templates of [files/made].
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ....compiler.artifact import Artifact
from ....compiler.kernel.interface import DENOISE, ENCODE, IMAGE, PATH, READ, RESULT, SUMS, WEIGHTS
from ....compiler.languages.c import stack_bytes, whole
from ..bindings import started
from ..check_pair import PATHS_ALIKE, PATHS_WITHIN, SEED

FILES = Path(__file__).parent / "files"
"""A folder for each host, one for what several share, and one for templates."""

MADE = "made"
"""The latter."""


def filled(name: str, values: Mapping[str, object]) -> str:
    """Return a template with the values between its `@`."""
    text = (FILES / MADE / name).read_text(encoding="utf-8")
    return re.sub(r"@(\w+)@", lambda match: str(values[match[1]]), text)


def _pair(facts: Mapping[str, Any]) -> dict[str, object]:
    """Return the values of both headers: the check pair's size, and what the host's storage adds."""
    return {**facts["check"], "added": float(facts["host"]["storage"]["added"])}


def _images(facts: Mapping[str, Any]) -> dict[str, tuple[str, int]]:
    """Return the file and the channels of each image of the check pair, by its array's name."""
    files = facts["check"]["images"]
    return {
        f"{IMAGE}{i['name']}": (f"check/{files[i['name']]['file']}", i["channels"]) for i in facts["images"]
    }


def calling(facts: Mapping[str, Any]) -> str:
    """Return the text of `host.h` for hosts in C and C++."""
    kernels, images = facts["kernels"], _images(facts)
    sums, own = facts["check"]["sums"], facts["scene"] and facts["scene"]["feature_rays"]
    places = {name: f"images[{index}]" for index, name in enumerate(images)}
    values = {
        **_pair(facts),
        "includes": "\n".join(f'#include "{name}"' for kernel in kernels for name in kernel["files"]),
        "count": len(images),
        "planes": len(sums["planes"]) if sums else 0,
        # Those of one launch where the path kernel traces further rays.
        "rays": 1 if own else int(facts["model"]["feature_spp"]),
        "seed": SEED,
        "alike": PATHS_ALIKE,
        "within": PATHS_WITHIN,
        "images": "\n".join(f'    {{"{file}", {channels}}},' for file, channels in images.values()),
        "paths": "",
    }
    scene = {kernel["role"]: kernel for kernel in kernels if kernel["role"] in (PATH, ENCODE)}
    if scene:
        given = {**places, SUMS: SUMS, "sample_count": "samples"}
        call, encode = whole(scene[PATH]["entry_point"]), scene[ENCODE]["entry_point"]
        called = {"call": call, "encode": encode, "arguments": _arguments(scene[ENCODE], given)}
        values["paths"] = filled("paths.h", called)
    denoiser = [kernel for kernel in kernels if kernel["role"] not in scene]
    return filled("calls.h", {**values, "body": _denoiser(denoiser, places)})


def _arguments(kernel: Mapping[str, Any], places: Mapping[str, str]) -> str:
    """Return the arguments of a kernel's function, some under other names."""
    return ", ".join(places.get(bound["name"], bound["name"]) for bound in kernel["bindings"])


def _denoiser(kernels: list[Mapping[str, Any]], places: dict[str, str]) -> str:
    """Return the lines that call the kernels of the denoiser."""
    declared, lines, freed = list[str](), list[str](), list[str]()
    for kernel in kernels:
        role, own = kernel["role"], dict(places)
        for bound in kernel["bindings"]:
            name, shape = bound["name"], bound["shape"]
            if name == WEIGHTS:
                own[name] = f"weights_{role}"
                declared.append(f"    static float *weights_{role};")
                read = f'host_read("{role}/weights.bin", {shape[0]})'
                lines += [f"    if (!weights_{role}) {{", f"        weights_{role} = {read};", "    }"]
            elif name == RESULT and role != DENOISE:
                own[name] = places[f"{IMAGE}{role}"] = role
                size = f"(size_t)width * (size_t)height * {shape[2]}"
                lines.append(f"    float *{role} = host_floats({size});")
                freed.append(f"    free({role});")
        lines.append(f"    {whole(kernel['entry_point'])}({_arguments(kernel, own)});")
    return "\n".join([*declared, *lines, *freed])


# ---- launches on buffers -----------------------------------------------------------------------------------


INTEGERS = {"sizes": "HOST_SIZES", "width": "HOST_COLUMNS", "height": "HOST_ROWS"}
"""What arguments other than buffers are called."""


def launching(facts: Mapping[str, Any]) -> str:
    """Return the text of `host.h` for hosts that launch kernels on buffers."""
    kernels = facts["kernels"]
    # Numbers of a pixel, or in all, and the file, of each buffer.
    buffers = {name: (channels, 0, f'"{file}"') for name, (file, channels) in _images(facts).items()}
    for kernel in kernels:
        role = kernel["role"]
        shapes = {bound["name"]: bound["shape"] for bound in kernel["bindings"]}
        if WEIGHTS in shapes:
            buffers[f"{WEIGHTS}_{role}"] = 0, shapes[WEIGHTS][0], f'"{role}/weights.bin"'
        buffers[f"{IMAGE}{role}"] = shapes[RESULT][2], 0, "0"
    names = list(buffers)
    values = {
        **_pair(facts),
        "buffers": "\n".join(f'    {{"{name}", {", ".join(map(str, b))}}},' for name, b in buffers.items()),
        "count": len(names),
        "result": names.index(f"{IMAGE}{DENOISE}"),
        "most": max(len(kernel["bindings"]) for kernel in kernels),
        "launches": "\n".join(_launch(kernel, names) for kernel in kernels),
        "steps": len(kernels),
    }
    return filled("launches.h", values)


def _launch(kernel: Mapping[str, Any], names: list[str]) -> str:
    """Return the row of a kernel."""
    role = kernel["role"]
    own = {WEIGHTS: f"{WEIGHTS}_{role}", RESULT: f"{IMAGE}{role}"}
    given = []
    for bound in kernel["bindings"]:
        name = own.get(bound["name"], bound["name"])
        given.append(f"{{{bound['slot']}, {INTEGERS.get(name) or names.index(name)}}}")
    file = next(name for name in kernel["files"] if not name.endswith(".comp"))
    numbers = "{columns}, {rows}, {group_x}, {group_y}".format(**started(kernel["schedule"]))
    numbers += f", {len(given)}"
    return f'    {{"{file}", "{kernel["entry_point"]}", {numbers}, {{{", ".join(given)}}}}},'


# ---- small stacks ------------------------------------------------------------------------------------------


SCRATCH_NAME = "scratch.h"
"""Name of the header for threads with small stacks."""

PAGE = 1 << 14
"""The largest page of usual systems, in bytes: some require stacks of complete pages."""

THREAD_BYTES = 1 << 16
"""What the C library keeps on a stack too, in bytes: the thread's record and local storage, signals."""


def stack_of(kernel: Artifact) -> int:
    """Return the most bytes of stack that a call of a denoiser's kernel in C takes."""
    return stack_bytes(kernel.manifest["private_bytes"])


def scratch(kernel: Artifact) -> str:
    """Return the header whose call runs a denoiser's kernel in C on memory of the caller.

    A denoiser's arrays are on the stack of the thread that calls it [languages/c.py, `stack_bytes`]; threads
    of some systems have less: musl's 128 KiB, for example. The call runs on a thread whose stack is that
    memory, and waits for its end. The source of the kernel remains the one that is certified.
    """
    function, stack = whole(kernel.entry_point), stack_of(kernel)
    prefix = function.removesuffix("_image")
    kinds = {
        **{a.name: f"{'const ' if a.access == READ else ''}float *" for a in kernel.interface.arrays},
        **dict.fromkeys(kernel.interface.integers, "int "),
    }
    values = {
        "all": function,
        "source": kernel.source_name,
        "stack": stack,
        "prefix": prefix,
        "guard": f"{prefix.upper()}_SCRATCH_H",
        "fields": "\n".join(f"    {kind}{name};" for name, kind in kinds.items()),
        "bytes": -(-(stack + THREAD_BYTES) // PAGE) * PAGE + PAGE,
        "page": PAGE,
        "passed": ",".join(f"\n        call->{name}" for name in kinds),
        "parameters": ",\n".join(f"    {kind}{name}" for name, kind in kinds.items()),
        "arguments": ",".join(f"\n        {name}" for name in kinds),
    }
    return filled(SCRATCH_NAME, values)
