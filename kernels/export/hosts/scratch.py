"""C on threads with small stacks: a header whose call runs a kernel on memory of the caller.

A denoiser's arrays are on the stack of the thread that calls it, and the kernel's source says how many bytes
a call may take [languages/c.py, `stack_bytes`]. Threads of some systems have less: musl's 128 KiB, for
example. `scratch.h` runs the call on a thread whose stack is scratch memory of the caller, and waits for its
end [`header`]. The source of the kernel remains the one that is certified.
"""

from __future__ import annotations

from ....compiler.artifact import Artifact
from ....compiler.kernel.interface import READ
from ....compiler.languages.c import stack_bytes, whole
from .host import FILES

NAME = "scratch.h"
"""The header's name."""

PAGE = 1 << 14
"""The largest page of usual systems, in bytes: some require stacks of complete pages."""

THREAD_BYTES = 1 << 16
"""What the C library keeps on a stack too, in bytes: the thread's record and local storage, signals."""


def stack_of(kernel: Artifact) -> int:
    """Return the most bytes of stack that a call of a denoiser's kernel in C takes."""
    return stack_bytes(kernel.manifest["private_bytes"])


def header(kernel: Artifact) -> str:
    """Return the header of a denoiser's kernel in C."""
    function, stack = whole(kernel.entry_point), stack_of(kernel)
    prefix = function.removesuffix("_image")
    kinds = {
        **{a.name: f"{'const ' if a.access == READ else ''}float *" for a in kernel.interface.arrays},
        **dict.fromkeys(kernel.interface.integers, "int "),
    }
    values = {
        "all": function,
        "source": kernel.source_name,
        "stack": str(stack),
        "prefix": prefix,
        "guard": f"{prefix.upper()}_SCRATCH_H",
        "fields": "\n".join(f"    {kind}{name};" for name, kind in kinds.items()),
        "bytes": str(-(-(stack + THREAD_BYTES) // PAGE) * PAGE + PAGE),
        "page": str(PAGE),
        "passed": ",".join(f"\n        call->{name}" for name in kinds),
        "parameters": ",\n".join(f"    {kind}{name}" for name, kind in kinds.items()),
        "arguments": ",".join(f"\n        {name}" for name in kinds),
    }
    text = (FILES / "c" / NAME).read_text(encoding="utf-8")
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    return text
