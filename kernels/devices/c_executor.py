"""Kernels as C, built by the system's compiler and called in this process: rows of a picture in threads.

1. Write the kernel's source and a function around it [`GLUE`] into a folder that goes with the executor.
2. Compile them to a shared object, for this processor where the compiler knows how [`OPTIONS`]; what was
   compiled before by this compiler for this processor is taken from the cache [cache.py].
3. Call it on blocks of rows, one a thread: ctypes lets other threads run meanwhile.
4. The schedule that suits the processor follows from the registers that it has [`VECTOR_SCHEDULES`].
"""

from __future__ import annotations

import base64
import ctypes
import itertools
import os
import platform
import shlex
import shutil
import subprocess
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import ENCODE, INTEGERS, PATH, PLAIN
from ...refimpl.errors import CompileError, ExecutorUnavailable
from .. import cache
from ..folders import discard, new_temporary
from ..memory import cores
from .executor import BYTE_SCHEDULE, INDEX_LIMIT, VECTOR_SCHEDULES, Executor
from .kernel import Memory, words

COMPILER_VARIABLE = "CC"
"""Environment variable that names the compiler, with options if need be; else `cc`."""

OPTIONS = ("-std=c99", "-O3", "-fPIC")
"""Options of every call, before those that keep the arithmetic."""

STRICT = (
    "-fno-fast-math",
    "-fno-unsafe-math-optimizations",
    "-fno-associative-math",
    "-fno-reciprocal-math",
    "-fno-finite-math-only",
    "-fsigned-zeros",
    "-ftrapping-math",
    "-ffp-contract=off",
)
"""What takes back whatever the user's options allow beyond IEEE 754: compilers obey the last of several.
Contraction is off in the source too."""

NATIVE = "-march=native"
"""Option for this very processor's instructions; not all compilers take it."""

TRIAL = """\
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#if !defined(__GNUC__)
#define LANES 1
#elif defined(__AVX512F__)
#define LANES 16
#elif defined(__AVX__)
#define LANES 8
#else
#define LANES 4
#endif
#if defined(__AVX512VNNI__) && defined(__AVX512BW__)
#define BYTES 1
#else
#define BYTES 0
#endif

static void show(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    printf("%08lx\\n", (unsigned long)bits);
}

int main(int count, char **arguments)
{
    (void)arguments;
    /* The compiler does not know that count is 1. */
    float one = (float)count, large = 16777216.0f * one, small = 1e-30f * one, third = one / 3.0f, sum = 0.0f;
    float terms[64];
    for (int i = 0; i < 64; ++i) terms[i] = one / (float)(i + 1);
    for (int i = 0; i < 64; ++i) sum += terms[i];
    show(sum);
    show((large + one) - large);
    show(third * third - one / 9.0f);
    show(small * 1e-12f);
    show(large / 7.0f);
    show(sqrtf(third));
    show(-one * 0.0f + -0.0f);
    show(large * large * large * large * large * large * 0.0f == 0.0f ? one : 0.0f);
    printf("%d %d\\n", BYTES, LANES);
    return 0;
}
"""
"""A program in which each freedom that a compiler may take shows: order of sums, contraction, reciprocals,
denormal numbers, signs of zeros, comparison with NaN. Last it prints whether kernels are compiled for an
instruction for products of bytes, and the floats in a vector register: 1 where there are no vectors."""

TRIAL_BITS = "4097cdf6 00000000 32000000 000002ca 4a124925 3f13cd3a 80000000 00000000"
"""What the trial's arithmetic prints where it is IEEE 754's, as NumPy's is."""

WAY_OUT = f"install one (Debian: gcc and libc6-dev), or name yours in {COMPILER_VARIABLE}"
"""What to do without a compiler."""

TRIAL_S = 10.0
"""Most seconds that the trial may take: it takes a thousandth of one."""

MOST_TOLD = 300
"""Most letters of a compiler's complaint in a message of one line."""

GLUE = """\
#include <stdint.h>
#include <string.h>
#include "{header}"

void wamnet_rows(float *const *arrays, const uint32_t *integers, int first, int end)
{{
{body}
}}
"""
"""The function that is called: rows [first, end), arrays and integers in the interface's order."""

ITEMS = """\
    for (int y = first; y < end; y += {rows}) {{
        for (int x = 0; x < (int)integers[0]; x += {columns}) {{
            {entry}({arguments}, x, y);
        }}
    }}"""
"""What it does: it calls a kernel for all work items of these rows."""

PART = """\
    wamnet_part part;
    memcpy(&part, integers, sizeof part);
"""
"""What comes before that where a kernel traces paths: its integers are one structure."""

AT_ONCE = """\
    (void)first;
    (void)end;
    {entry}({arguments});"""
"""What it does for an encoding, which takes all rows at once: a thousandth of the time of the paths."""


def glue_of(kernel: Artifact, header: str) -> str:
    """Return the text with the function that is called, around a kernel's source in a file."""
    taken, schedule = kernel.interface, kernel.manifest.get("schedule", {})
    arrays = [f"arrays[{place}]" for place in range(len(taken.arrays))]
    integers = [f"(int)integers[{place}]" for place in range(len(INTEGERS[taken.role]))]
    paths = taken.role == PATH
    body = (AT_ONCE if taken.role == ENCODE else PART + ITEMS if paths else ITEMS).format(
        entry=kernel.entry_point,
        arguments=", ".join(["&part", *arrays] if paths else [*arrays, *integers]),
        columns="WAMNET_PATHS" if paths else schedule.get("pixels", 1),
        rows=schedule.get("rows", 1),
    )
    return GLUE.format(header=header, body=body)


class CExecutor(Executor):
    """The system's C compiler; what it has built stays loaded as long as the process."""

    name = "c"
    paints = True
    smooths = True
    largest_bytes = 4 * INDEX_LIMIT

    def __init__(self) -> None:
        super().__init__()
        given = os.environ.get(COMPILER_VARIABLE) or ""
        try:
            self._command = shlex.split(given) or ["cc"]
        except ValueError as error:
            rule = f"{COMPILER_VARIABLE} is {given!r}, which is not a command ({error})"
            raise ExecutorUnavailable(f"c: {rule}; {WAY_OUT}") from None
        version = self._call("--version").stdout.strip().partition("\n")[0]
        self.device = f"{' '.join(self._command)}: {version}"
        self._count = itertools.count()
        self._options = list(OPTIONS)
        self._folder, self._lock = new_temporary("c", programs=True)
        self._compiler = [*self._command, version, *_file_facts(self._command[0]), processor()]
        try:
            tried = cache.kept("c-trial", [*self._compiler, TRIAL], self._try)
            self._options, lanes, byte_products = tried["options"], tried["lanes"], tried["bytes"]
        except ExecutorUnavailable:
            discard(self._folder, self._lock)
            raise
        self.byte_schedule = BYTE_SCHEDULE if byte_products else ""
        self._suits(f"processors with {lanes} floats in a register", VECTOR_SCHEDULES.get(lanes, PLAIN))
        self._threads = ThreadPoolExecutor(cores())

    def _try(self) -> dict[str, Any]:
        """Return what the compiler takes; raise where its programs do not compute as they must."""
        program = self._folder / "trial"
        # Not all compilers know all options; what the program prints decides, not which options they accept.
        for options in ([*STRICT, NATIVE], STRICT, []):
            self._options = [*OPTIONS, *options]
            done = self._compile(program, TRIAL, [])
            if done.returncode == 0:
                break
        told = " ".join(done.stderr.split())[:MOST_TOLD]
        if done.returncode or not program.is_file():
            told = told or "it writes no program"
            raise ExecutorUnavailable(f"c: {self.device} does not compile C99 ({told}); {WAY_OUT}")
        try:
            ran = subprocess.run([program], capture_output=True, text=True, check=False, timeout=TRIAL_S)
            found = ran.stdout.split()
        except (OSError, ValueError, subprocess.TimeoutExpired) as error:
            rule = f"what it compiles does not run here ({type(error).__name__})"
            raise ExecutorUnavailable(f"c: {self.device}: {rule}; {WAY_OUT}") from None
        *bits, byte_products, lanes = found or ["", ""]
        if bits != TRIAL_BITS.split():
            rule = "what it compiles does not compute as IEEE 754 says"
            way_out = f"take options that relax arithmetic out of {COMPILER_VARIABLE}"
            raise ExecutorUnavailable(f"c: {self.device}: {rule}; {way_out}")
        return {"options": self._options, "lanes": int(lanes), "bytes": byte_products == "1"}

    def _prepare(self, kernel: Artifact) -> Any:
        """Return the function of a loaded kernel."""
        self.check_stack(kernel.manifest.get("private_bytes", 0))
        function = self._library(kernel, glue_of(kernel, _header(kernel)))
        function.argtypes = [*[ctypes.c_void_p] * 2, *[ctypes.c_int] * 2]
        return function

    def _library(self, kernel: Artifact, glue: str) -> Any:
        """Return the function of a kernel's source and the glue around it, compiled and loaded."""
        # A library that was built before may still be loaded: each has a name of its own.
        library = self._folder / f"{kernel.digest[:32]}-{next(self._count)}.so"

        def built() -> str:
            (library.parent / _header(kernel)).write_text(kernel.source, encoding="utf-8")
            done = self._compile(library, glue, ["-shared"])
            if done.returncode or not library.is_file():
                told = done.stderr.strip()[:MOST_TOLD] or "it writes no library"
                raise CompileError(f"{self.device} cannot build the kernel: {told}; {WAY_OUT}")
            return base64.b64encode(library.read_bytes()).decode()

        content = cache.kept("c-library", [*self._compiler, self._options, kernel.source, glue], built)
        library.write_bytes(base64.b64decode(content))
        function = ctypes.CDLL(str(library)).wamnet_rows
        function.restype = None
        return function

    def _compile(self, result: Path, text: str, options: list[str]) -> subprocess.CompletedProcess[str]:
        """Compile a text to a program, or to a library if the options say so."""
        source = result.with_suffix(".c")
        source.write_text(text, encoding="utf-8")
        return self._call(*self._options, *options, "-o", str(result), str(source), "-lm")

    def _call(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run the compiler."""
        try:
            return subprocess.run(
                [*self._command, *arguments], capture_output=True, text=True, check=False, errors="replace"
            )
        except OSError as error:
            raise ExecutorUnavailable(
                f"c: the compiler {self._command[0]!r} cannot be run ({error.strerror}); {WAY_OUT}"
            ) from None

    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        taken = kernel.interface
        held = (arrays[array.name].held.ctypes.data for array in taken.arrays)
        numbers = words(taken, integers)
        call = partial(prepared, (ctypes.c_void_p * len(taken.arrays))(*held), numbers.ctypes.data)
        if taken.role == ENCODE:
            call(0, integers["height"])
        else:
            rows = kernel.manifest.get("schedule", {}).get("rows", 1)
            self._in_threads(integers[taken.rows], rows, call)

    def _in_threads(self, height: int, whole: int, rows: Callable[[int, int], None]) -> None:
        """Call a function for blocks of rows [first, end), multiples of `whole`, shared out to threads."""
        count = max(1, height // (8 * cores()))
        firsts = range(0, height, -(-count // whole) * whole)
        list(self._threads.map(rows, firsts, [*firsts[1:], height]))

    def close(self) -> None:
        """End the threads and remove the folder."""
        self._threads.shutdown()
        discard(self._folder, self._lock)


def processor() -> str:
    """Return what code for this very processor depends on, as far as the system tells."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").partition("\n\n")[0]
        kinds = ("vendor_id", "cpu family", "model", "stepping", "flags", "CPU ", "Features")
        return "".join(line for line in lines.splitlines(True) if line.startswith(kinds))
    return " ".join(platform.uname())


def _file_facts(command: str) -> tuple[str, ...]:
    """Return where a program is, its size and time: another one compiles otherwise."""
    path = shutil.which(command) or command
    with suppress(OSError):
        facts = Path(path).resolve().stat()
        return path, str(facts.st_size), str(facts.st_mtime_ns)
    return (path,)


def _header(kernel: Artifact) -> str:
    """Return the name of the file that holds a kernel's source."""
    return f"{kernel.digest[:32]}.h"
