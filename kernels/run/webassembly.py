"""A C kernel as a WebAssembly module, which a page runs where shaders would run on the processor anyway.

Zig's package is a C compiler with a linker for WebAssembly (pip install ziglang). A module imports nothing,
and exports its memory, the first byte that is free there (`__heap_base`), and `wamnet_rows` of C executors:
pointers to the arrays, the integers, and the rows to be computed.
"""

from __future__ import annotations

import base64
import importlib.util
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from ...compiler.artifact import Artifact
from ...refimpl.errors import CompileError, ExecutorUnavailable
from .. import cache
from ..devices.c_executor import MOST_TOLD, glue_of

OPTIONS = (
    "-target", "wasm32-wasi", "-mcpu=generic+simd128", "-mexec-model=reactor", "-std=gnu99", "-O3",
    "-ffp-contract=off", "-nostartfiles", "-Wl,--strip-all", "-Wl,--export=wamnet_rows",
    "-Wl,--export=__heap_base",
)  # fmt: skip
"""No start, no file, no debugging: a page needs one function."""


def compiler() -> list[str]:
    """Return the words that call Zig; none where it is not there."""
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang"]
    return [*filter(None, [shutil.which("zig")])]


def module_of(artifact: Artifact) -> bytes:
    """Return a kernel in C as a module.

    Raises `ExecutorUnavailable` without Zig, `CompileError` where it does not build the kernel.
    """
    command = compiler()
    if not command:
        raise ExecutorUnavailable("zig is not installed: pip install ziglang")
    glue = glue_of(artifact, "denoise.h")

    def built() -> str:
        with tempfile.TemporaryDirectory(prefix="wamnet-") as name:
            folder = Path(name)
            (folder / "denoise.h").write_text(artifact.source, encoding="utf-8")
            (folder / "page.c").write_text(glue, encoding="utf-8")
            done = subprocess.run(
                [*command, "cc", *OPTIONS, "-o", "page.wasm", "page.c"],
                cwd=folder, capture_output=True, text=True, check=False, errors="replace",
            )  # fmt: skip
            if done.returncode:
                raise CompileError(f"zig: {done.stderr.strip()[:MOST_TOLD] or 'no module'}; update ziglang")
            return base64.b64encode((folder / "page.wasm").read_bytes()).decode()

    version = subprocess.run([*command, "version"], capture_output=True, text=True, check=False).stdout
    return base64.b64decode(cache.kept("webassembly", [version, *OPTIONS, artifact.source, glue], built))
