"""Exported WGSL on Dawn, the WebGPU of Chromium, whose compiler is Tint: by its bindings for Node.

1. The npm package `webgpu` is Dawn. A process of Node opens a device [`SCRIPT`]: of Vulkan, for which Tint
   writes SPIR-V, or of OpenGL ES, for which it writes GLSL ES.
2. A launch is a line of JSON to that process with the kernel and all buffers, and a line of JSON back with
   what the kernel wrote [`TintRunner`].

Where the environment as it is has no device, another one is tried [`TRIED`]: Dawn does not take lavapipe of
Mesa 22, which lacks `shaderUniformArrayDynamicIndexing`, but SwiftShader, which Chromium brings; OpenGL ES
needs no display if the environment says so.
"""

from __future__ import annotations

import base64
import os
import shutil
import subprocess
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import BLOCK
from ...models.lines import LineProcess
from ...refimpl.errors import CompileError, ExecutorUnavailable
from . import tools
from .buffer_runner import BufferRunner, Launch
from .wgpu_runner import UNIFORM_BYTES, kinds_of

WAY_OUT = "npm install --global webgpu, and a driver of Vulkan or OpenGL ES"
"""How to get a device."""

LEVELS: Mapping[str, str] = {"vulkan": "core", "opengles": "compatibility"}
"""Levels of WebGPU by Dawn's name of what it drives."""

TRIED: Mapping[str, Mapping[str, str]] = {
    "vulkan": {"VK_ICD_FILENAMES": "/usr/lib/chromium/vk_swiftshader_icd.json"},
    "opengles": {"EGL_PLATFORM": "surfaceless"},
}
"""What the environment is given where it has no device by itself, unless it says otherwise."""

SCRIPT = "dawn.mjs"
"""The shim that Node runs: one device; each line asks for a kernel to be built, or built and run."""


def _environment() -> dict[str, str]:
    """Return the environment, with npm's global folder among those in which Node looks for packages."""
    root, npm = "", shutil.which("npm")
    if npm:
        root = subprocess.run([npm, "root", "--global"], capture_output=True, text=True, check=False).stdout
    paths = [os.environ.get("NODE_PATH", ""), root.strip()]
    return {**os.environ, "NODE_PATH": os.pathsep.join(filter(None, paths))}


class TintRunner(BufferRunner):
    """A device of Dawn in a process of Node; `backend`: what it drives [`LEVELS`]."""

    name = "wgsl"
    homes = (BLOCK,)

    def __init__(self, backend: str = "vulkan") -> None:
        super().__init__()
        node = shutil.which("node")
        if node is None:
            raise ExecutorUnavailable(f"node is not installed: apt-get install nodejs npm; {WAY_OUT}")
        environment = _environment()
        refused = self._open(node, backend, environment)
        if refused and not set(TRIED[backend]) & set(environment):
            refused = self._open(node, backend, {**environment, **TRIED[backend]}) and refused
        if refused:
            raise ExecutorUnavailable(f"Dawn has no {backend} device ({refused}): {WAY_OUT}")

    def _open(self, node: str, backend: str, environment: Mapping[str, str]) -> str:
        """Start the process; return why it has no device, or nothing."""
        command = [node, "--input-type=module", "-e", tools.shim(SCRIPT), "--", backend, LEVELS[backend]]
        self._process = LineProcess(command, "Node has ended", environment=environment)
        told = self._answer()
        if "device" in told:
            self.device = f"Dawn, {told['device']}, {told['described']}"
            return ""
        said = self._process.end(10.0).splitlines()
        warnings = ["no warning", *(line for line in said if line.startswith("Warning: "))]
        return " ".join(f"{told.get('missing', told.get('error'))}; {warnings[-1]}".split())

    def _answer(self) -> dict[str, Any]:
        """Return the next line of the process."""
        try:
            return self._process.answer()
        except ExecutorUnavailable as error:
            return {"error": str(error)}

    def _ask(self, **asked: Any) -> dict[str, Any]:
        """Return what the process answers; raise CompileError for what Dawn does not take."""
        self._process.tell(asked)
        told = self._answer()
        if "error" in told:
            raise CompileError(f"{self.device} rejects the kernel: {' '.join(told['error'].split())}")
        return told

    def _build(self, kernel: Artifact, group: tuple[int, int] | None) -> Any:
        built = {
            "source": kernel.source,
            "entry": kernel.entry_point,
            "kinds": {str(number): kind for number, kind in kinds_of(kernel.interface).items()},
        }
        self._ask(**built)
        return built

    def _launch(self, built: Any, launch: Launch) -> None:
        sizes = launch.integers.tobytes()
        given = {"0": sizes + bytes(-len(sizes) % UNIFORM_BYTES)}
        given |= {str(number): array.tobytes() for number, array in launch.buffers.items()}
        buffers = {n: base64.b64encode(given[n]).decode() for n in built["kinds"]}
        told = self._ask(**built, buffers=buffers, groups=launch.groups)
        for number, text in told["written"].items():
            array: NDArray[np.float32] = launch.buffers[int(number)]
            array[...] = np.frombuffer(base64.b64decode(text), np.float32).reshape(array.shape)

    def close(self) -> None:
        """End the process."""
        self._process.end(10.0)
