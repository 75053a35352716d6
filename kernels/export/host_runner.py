"""Exported C, and CUDA C and Metal with a few of their words in C++, built by the system's compiler.

CUDA's and Metal's kernels use so little of their languages that a shim of macros and functions makes them
C++: what is run is the exported text, thread by thread. It says nothing about their compilers' arithmetic.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import BLOCK, BOTH, PATH, TABLE, UNSIGNED, Array, Interface
from ...compiler.languages.c import whole
from ...refimpl.errors import ExecutorUnavailable
from . import tools
from .buffer_runner import BufferRunner, Launch

OPTIONS = ("-ffp-contract=off", "-fPIC", "-shared")
"""Nothing here may allow what the standards do not; a check compiles for longer than it runs."""


class HostRunner(BufferRunner):
    """A compiler and the glue of one language; what it has built stays loaded as long as the process.

    `last`: options that come after all others. Some relax arithmetic: floats then lose their bound, integers
    keep their bits.
    """

    program = "c++"
    suffix = ".cpp"
    options: tuple[str, ...] = ("-std=c++20", "-pthread")
    homes = (TABLE, BLOCK)

    def __init__(self, *last: str) -> None:
        super().__init__()
        self.last: Sequence[str] = last
        self._folder = tempfile.TemporaryDirectory(prefix="wamnet-host-")
        self._count = 0
        try:
            told = tools.run(self.program, "--version", folder=Path(self._folder.name))
        except ExecutorUnavailable:
            self._folder.cleanup()
            raise
        self.device = " ".join(told.split()[:4])

    def _glue(self, kernel: Artifact, group: tuple[int, int] | None, folder: Path) -> str:
        """Return the text that is compiled, with a function `wamnet_call`."""
        raise NotImplementedError

    def _build(self, kernel: Artifact, group: tuple[int, int] | None) -> Any:
        self._count += 1
        folder = Path(self._folder.name) / str(self._count)
        folder.mkdir()
        (folder / "kernel.txt").write_text(kernel.source, encoding="utf-8")
        glue = self._glue(kernel, group, folder)
        (folder / f"glue{self.suffix}").write_text(glue, encoding="utf-8")
        tools.run(
            self.program,
            *(*self.options, *OPTIONS, *self.last, "-I.", "-o", "kernel.so", f"glue{self.suffix}", "-lm"),
            folder=folder,
        )
        function = ctypes.CDLL(str(folder / "kernel.so")).wamnet_call
        function.restype = None
        return function, group is not None

    def _launch(self, built: Any, launch: Launch) -> None:
        empty, count = np.zeros(4, np.float32), max(launch.buffers) + 1
        arrays = [launch.buffers.get(number, empty) for number in range(count)]
        pointers = (ctypes.c_void_p * count)(*(array.ctypes.data for array in arrays))
        integers = (ctypes.c_uint32 * len(launch.integers))(*launch.integers.tolist())
        function, grouped = built
        function(integers, pointers, *(launch.groups if grouped else launch.threads))

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


def _arrays(interface: Interface, listed: Sequence[Array] = ()) -> list[str]:
    """Return the texts of a kernel's arrays, in the order of its arguments, or of others."""
    numbers, pair = interface.numbers(), {BOTH: "(float2 *)"}
    return [f"{pair.get(a.access, '')}buffers[{numbers[a.name]}]" for a in listed or interface.arrays]


def _integers(interface: Interface) -> list[str]:
    """Return the texts of a kernel's integers, in order."""
    return [f"{'(unsigned int)' * (n in UNSIGNED)}sizes[{i}]" for i, n in enumerate(interface.integers)]


class CRunner(HostRunner):
    """C99, as a C compiler takes it; check.py compiles exports with warnings as errors."""

    name = "c"
    program = "cc"
    suffix = ".c"
    options = ("-std=c99",)

    def _glue(self, kernel: Artifact, group: tuple[int, int] | None, folder: Path) -> str:
        arrays, integers = _arrays(kernel.interface), _integers(kernel.interface)
        call = f"{whole(kernel.entry_point)}({', '.join([*arrays, *integers])});"
        if kernel.interface.role == PATH:
            part = f"const wamnet_part part = {{{', '.join(integers)}}};"
            call = f"{part}\n    {whole(kernel.entry_point)}(&part, {', '.join(arrays)});"
        head = "void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)"
        return (
            f'#include "kernel.txt"\n{head};\n{head}\n{{\n    (void)columns;\n    (void)rows;\n'
            f"    {call}\n}}\n"
        )


class CUDARunner(HostRunner):
    """CUDA C as C++."""

    name = "cuda"

    def _glue(self, kernel: Artifact, group: tuple[int, int] | None, folder: Path) -> str:
        arguments = [*_arrays(kernel.interface), *_integers(kernel.interface)]
        call = f"{kernel.entry_point}({', '.join(arguments)});"
        if group is None:
            place = "blockIdx = {(unsigned)column, (unsigned)row, 0}; blockDim = {1, 1, 1};"
            place += " threadIdx = {0, 0, 0};"
        else:
            place = "blockIdx = {(unsigned)group_column, (unsigned)group_row, 0};"
            place += " threadIdx = {(unsigned)column, (unsigned)row, 0};"
        before = _waiting(group) + tools.shim("cuda.h") + '#include "kernel.txt"\n'
        return before + _started(f"{place} {call}", group)


class MetalRunner(HostRunner):
    """Metal as C++."""

    name = "metal"
    options = ("-std=c++20", "-pthread", "-Wno-attributes")

    def _glue(self, kernel: Artifact, group: tuple[int, int] | None, folder: Path) -> str:
        (folder / "metal_stdlib").write_text(tools.shim("metal_stdlib.h"), encoding="utf-8")
        arrays = _arrays(kernel.interface, kernel.interface.by_number())
        arguments = ["*(const Size *)sizes", *arrays]
        places = ["{(uint)column, (uint)row}"]
        if group is not None:
            places.append("{(uint)group_column, (uint)group_row}")
        call = f"{kernel.entry_point}({', '.join([*arguments, *places])});"
        return f'{_waiting(group)}#include "kernel.txt"\n#undef thread\n{_started(call, group)}'


def _waiting(group: tuple[int, int] | None) -> str:
    """Return what lets threads wait for those of their group, if there is one."""
    return tools.shim("alone.h" if group is None else "together.h")


def _started(call: str, group: tuple[int, int] | None) -> str:
    """Return the function that runs all threads."""
    names = {"CALL": call} | ({} if group is None else {"WIDTH": group[0], "HEIGHT": group[1]})
    defined = "".join(f"#define WAMNET_{name} {value}\n" for name, value in names.items())
    return defined + tools.shim("threads.cpp" if group is None else "groups.cpp")
