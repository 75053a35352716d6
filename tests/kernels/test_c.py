"""C: clean under warnings and sanitizers, exact under all options that keep the standard, refusals."""

import os
import platform
import subprocess
from pathlib import Path

import numpy as np
import pytest
from kit import pictures

from wamnet import kernels
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.targets import language_named
from wamnet.kernels.devices import c_executor
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable, InputError

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wpedantic", "-Werror")
"""What a careful project compiles with."""

SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""Any access outside an array and any undefined operation ends the program."""

MAIN = """
#include <stdio.h>
#include "denoise.h"

static float result[{count}];

int main(void)
{{
    wamnet_image({images}, numbers, result, {width}, {height});
    for (int i = 0; i < {count}; ++i) {{
        printf("%a\\n", (double)result[i]);
    }}
    return 0;
}}
"""
"""A program that has the kernel pasted in, images and weights as arrays of their own."""


@pytest.fixture(scope="module")
def case(kit):
    """A denoiser with two images, a picture narrower than its window, and what the reference computes."""
    program = kit.denoiser(kit.network([100, 7, 5, 3], (3.0, 5.0)), {"a": 3, "b": 1}, 5, "zero")
    images = pictures({"a": 3, "b": 1}, (6, 3))
    (expected,) = interpret(program, {"window": kit.windows(program, images)}, np.float64).values()
    return program, images, expected


def array(name, values):
    """Return the declaration of an array."""
    text = ", ".join(float(value).hex() + "f" for value in np.ravel(values))
    return f"static const float {name}[{np.size(values)}] = {{{text}}};\n"


def built(folder: Path, case, profile, options, schedule="plain"):
    """Compile a program around the kernel with the compiler of the executor, and return what it prints."""
    program, images, expected = case
    artifact = compile_program(program, language_named("c").under(profile), schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    (folder / artifact.source_name).write_text(artifact.source)
    data = array("numbers", artifact.weights) + "".join(array(f"in_{n}", x) for n, x in images.items())
    height, width, _ = expected.shape
    arguments = ", ".join(f"in_{name}" for name in images)
    main = MAIN.format(count=expected.size, images=arguments, width=width, height=height)
    (folder / "main.c").write_text(data + main)
    command = os.environ.get(c_executor.COMPILER_VARIABLE, "cc").split()
    subprocess.run([*command, *options, "-o", "main", "main.c", "-lm"], cwd=folder, check=True)
    lines = subprocess.run(["./main"], cwd=folder, check=True, capture_output=True, text=True).stdout.split()
    return np.array([float.fromhex(line) for line in lines], np.float32).reshape(expected.shape)


def within_bound(case, found):
    """Return whether what a kernel of a case writes keeps the bound of profile ieee."""
    bound = compile_program(case[0], "c").manifest["bound"]["output"]
    return bool((np.abs(found - case[2]) <= bound).all())


@pytest.mark.parametrize("profile", ["ieee", "native"])
def test_source_is_clean_under_warnings_and_sanitizers(executor_named, case, tmp_path, profile):
    executor_named("c")
    found = built(tmp_path, case, profile, ["-std=c99", "-O1", "-g", *WARNINGS, *SANITIZERS])
    if profile == "ieee":
        assert within_bound(case, found)


WAYS = (["-march=native"], ["-DWAMNET_PORTABLE"])
TILES = [(name, way) for name in ("tile:16", "tile:8", "tile:4") for way in WAYS]
"""The tiled schedules, with the vectors of GCC and clang, where the processor has those, and without."""


@pytest.fixture(
    scope="module", params=[("clamp", (1, 1)), ("zero", (1, 1)), ("zero", (3, 31)), ("clamp", (2, 9))]
)
def bordered(request, kit):
    """A denoiser as above whose layers fill no vector, and pictures that fill no tile; the reference's."""
    border, size = request.param
    program = kit.denoiser(kit.network([100, 37, 5, 3], (3.0, 5.0)), {"a": 3, "b": 1}, 5, border)
    images = pictures({"a": 3, "b": 1}, size, 3)
    (expected,) = interpret(program, {"window": kit.windows(program, images)}, np.float64).values()
    return program, images, expected


@pytest.mark.product
@pytest.mark.parametrize(
    "options",
    [["-O0"], ["-O3"], ["-O1", "-g", *SANITIZERS]],
    ids=["not optimised", "optimised", "sanitized"],
)
@pytest.mark.parametrize(("schedule", "way"), TILES)
def test_tiles_are_clean_and_within_their_bound(executor_named, bordered, tmp_path, schedule, way, options):
    """KER-16, without the executor's options: no access leaves an array, at any border."""
    executor_named("c")
    found = built(tmp_path, bordered, "ieee", ["-std=c99", *options, *WARNINGS, *way], schedule)
    assert within_bound(bordered, found)


@pytest.mark.parametrize("portable", [False, True])
def test_a_plain_build_has_tiles_for_newer_processors(executor_named, case, tmp_path, portable):
    """KER-16: GCC on x86 with glibc compiles them for AVX2 and AVX-512 too, unless it may not."""
    if platform.machine() != "x86_64" or "(Debian" not in executor_named("c").device:
        pytest.skip("the compiler is not Debian's GCC for x86-64")
    options = ["-std=c99", "-O2", *WARNINGS, *["-DWAMNET_PORTABLE"][: int(portable)]]
    assert within_bound(case, built(tmp_path, case, "ieee", options, "tile:8"))
    assert (b"wamnet_pixel.arch_x86_64_v3" in (tmp_path / "main").read_bytes()) != portable


@pytest.mark.parametrize(
    "options",
    [["-std=gnu11", "-O3"], ["-std=gnu11", "-O3", "-march=native"]],
    ids=["optimised", "contraction is the default"],
)
def test_pasted_plain_source_fuses_nothing(executor_named, case, tmp_path, options):
    """GCC contracts by default where the processor can, and clang within an expression: pragmas forbid it."""
    executor_named("c")
    found, strict = (built(tmp_path, case, "ieee", each) for each in (options, ["-std=c99", "-O0"]))
    assert np.array_equal(found.view(np.uint32), strict.view(np.uint32))
    assert within_bound(case, found)


def test_arithmetic_that_is_not_ieee_is_refused_by_the_source(executor_named, case, tmp_path, capfd):
    executor_named("c")
    with pytest.raises(subprocess.CalledProcessError, match="non-zero exit status"):
        built(tmp_path, case, "ieee", ["-std=c99", "-ffast-math"])
    assert "the error bound needs float arithmetic as in IEEE 754" in capfd.readouterr().err


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (17, 5)])
def test_rows_are_shared_out_without_gaps(executor_named, kit, size):
    program = kit.program(lambda x: x * 1.0, {"a": 2})
    image = np.random.default_rng(2).uniform(-2, 2, (*size, 2)).astype(np.float32)
    assert np.array_equal(executor_named("c").run(compile_program(program, "c"), {"a": image}), image)


@pytest.fixture
def wrapped(executor_named, tmp_path, monkeypatch):
    """Give a function that puts a script in place of the compiler."""
    executor_named("c")

    def wrap(script):
        (tmp_path / "cc").write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / "cc").chmod(0o755)
        monkeypatch.setenv("CC", str(tmp_path / "cc"))

    return wrap


@pytest.mark.parametrize(("native", "lanes"), [("no-avx", 4), ("avx2 -mno-avx512f", 8), ("avx512f", 16)])
def test_the_schedule_follows_from_the_registers(wrapped, native, lanes):
    """The trial tells for what the compiler is told to make code; none of its own needs such registers."""
    wrapped(f'exec cc "$@" -march=x86-64 -m{native} -mprefer-vector-width=128')
    with kernels.open_executor("c") as executor:
        assert executor.schedule == executor.schedule_for((1, 1)) == f"fft:{lanes}"
        assert executor.schedule_reason == f"built-in choice for processors with {lanes} floats in a register"


def test_a_compiler_without_vectors_gets_the_plain_schedule(executor_named, monkeypatch):
    executor_named("c")
    monkeypatch.setattr(c_executor, "TRIAL", c_executor.TRIAL.replace("!defined(__GNUC__)", "1"))
    with kernels.open_executor("c") as executor:
        assert executor.schedule == "plain"


def test_the_trial_prints_what_numpy_computes():
    """NumPy is the definition of all arithmetic here."""
    f = np.float32
    one, large, small = f(1), f(16777216), f(1e-30)
    third, total = one / f(3), f(0)
    for i in range(64):
        total = total + one / f(i + 1)
    with np.errstate(over="ignore", invalid="ignore"):
        no_number = large * large * large * large * large * large * f(0)
    values = [
        *(total, (large + one) - large, third * third - one / f(9), small * f(1e-12), large / f(7)),
        *(np.sqrt(third), -one * f(0) + -f(0), one if no_number == 0 else f(0)),
    ]
    assert [f"{int(f(value).view(np.uint32)):08x}" for value in values] == c_executor.TRIAL_BITS.split()


# ---- refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("no-such-compiler -O2", r"c: the compiler 'no-such-compiler' cannot be run .*Debian: gcc"),
        ("false", r"does not compile C99 \(.*\); install one"),
        ("true", r"\(it writes no program\); install one"),
        ("gcc '", r"c: CC is .* not a command \(No closing quotation\); install"),
    ],
)
@pytest.mark.needs("programs")
def test_no_compiler(monkeypatch, command, says):
    monkeypatch.setenv("CC", command)
    with pytest.raises(ExecutorUnavailable, match=says):
        kernels.open_executor("c")


RELAXED = (
    "-ffast-math -funsafe-math-optimizations -Ofast -fassociative-math -fno-signed-zeros -fno-trapping-math "
    "-freciprocal-math -ffinite-math-only",
    "-ffp-contract=fast -mfma",
)


@pytest.mark.parametrize("relaxed", RELAXED)
def test_options_that_relax_arithmetic_are_taken_back(executor_named, case, monkeypatch, relaxed):
    """The bits of the plain kernel, and denormal numbers of this process, survive what CC names."""
    program, images, _ = case
    artifact = compile_program(program, "c")
    wanted = executor_named("c").run(artifact, images)
    monkeypatch.setenv("CC", f"cc {relaxed}")
    with kernels.open_executor("c") as executor:
        assert np.array_equal(executor.run(artifact, images).view(np.uint32), wanted.view(np.uint32))
        assert within_bound(case, executor.run(compile_program(program, "c", schedule="tile:16"), images))
    # A number below the smallest normal one, 2^-126, which a process that flushes them loses.
    assert np.float32(2.0**-133) * np.float32(1) == np.float32(2.0**-133)


def test_kernel_that_does_not_compile(executor_named, kit):
    artifact = compile_program(kit.program(lambda x: x * 0.5, {"a": 1}), "c")
    with pytest.raises(CompileError, match=r"(?s)cannot build the kernel: .*error"):
        executor_named("c").build(kit.with_source(artifact, "float value", "flaot value"))


def test_arrays_too_large_for_a_stack(executor_named, kit):
    wide = np.ones((2**18, 1), np.float32)
    program = kit.program(lambda x: np.matmul(np.sin(np.matmul(x, wide.T)), wide) * 0.5, {"a": 1})
    with pytest.raises(
        CompileError, match=r"arrays take \d+ bytes per pixel; at most 1048576 fit a thread's stack"
    ):
        executor_named("c").build(compile_program(program, language_named("c").under("native")))


@pytest.mark.parametrize("name", ["c", "numpy"])
def test_a_pipeline_is_the_composition_of_its_kernels(executor_named, kit, name):
    """PPL-7: paths, encoding and denoiser, in C of one header each, to the bit."""
    kit.check_composed(executor_named(name))


# ---- integers ----------------------------------------------------------------------------------------------


@pytest.mark.needs("programs")
def test_a_library_is_compiled_once_for_a_compiler_and_a_processor(case, monkeypatch, tmp_path):
    monkeypatch.setenv("WAMNET_CACHE", str(tmp_path))
    artifact, calls = compile_program(case[0], "c"), []
    call = c_executor.CExecutor._call

    def counted(self, *arguments):
        calls.append(arguments)
        return call(self, *arguments)

    monkeypatch.setattr(c_executor.CExecutor, "_call", counted)
    pictures = []
    for change in (None, None, "processor"):
        if change:
            monkeypatch.setattr(c_executor, "processor", lambda: "another")
        calls.clear()
        with kernels.open_executor("c") as executor:
            pictures.append(executor.run(artifact, case[1]))
        compiled = sum("-shared" in arguments for arguments in calls)
        assert compiled == (1 if change or len(pictures) == 1 else 0)
        assert len(calls) == (1 if compiled == 0 else 3), "the version; the trial and the library"
    assert all(np.array_equal(picture, pictures[0]) for picture in pictures)


OTHER = ["-O0", "-include", "other.h", "-Wno-unknown-pragmas"]
"""What makes GCC a compiler that is not GCC, for which the standard's pragma is in the text."""


PORTABLE = ["-O0", "-DWAMNET_PORTABLE"]
"""Loops for vectors, which GCC takes 20 s to make fast."""


@pytest.mark.parametrize("other", [[], PORTABLE, OTHER], ids=["usual", "portable", "no GCC"])
def test_a_plain_build_has_transforms_for_newer_processors(executor_named, kit, tmp_path, other):
    """KER-22, FOU-9: GCC on x86 with glibc compiles them for AVX2 and AVX-512 too; others take C99."""
    if platform.machine() != "x86_64" or "(Debian" not in executor_named("c").device:
        pytest.skip("the compiler is not Debian's GCC for x86-64")
    program = kit.denoiser(kit.network([864, 8, 3], (3.0, 3.0)), {"a": 6}, 12, "clamp")
    images = {"a": np.random.default_rng(5).uniform(-1, 1, (23, 47, 6)).astype(np.float32)}
    (expected,) = interpret(program, {"window": kit.windows(program, images)}, np.float64).values()
    # After the system's headers, which need it.
    undefined = "#include <math.h>\n#include <stdio.h>\n#undef __GNUC__\n#define __attribute__(x) of_GNU\n"
    (tmp_path / "other.h").write_text(undefined)
    options = ["-std=c99", "-O2", *WARNINGS, *other]
    found = built(tmp_path, (program, images, expected), "ieee", options, "fft:8")
    bound = compile_program(program, "c", "fft:8").manifest["bound"]["output"]
    assert np.all(np.abs(found - expected) <= bound)
    held = (tmp_path / "main").read_bytes()
    for name in ("forward", "backward", "pixel"):
        assert (f"wamnet_{name}.arch_x86_64_v3".encode() in held) != bool(other)


@pytest.mark.parametrize("relaxed", ["-funsafe-math-optimizations", "-ffp-contract=fast -mfma", "-Ofast"])
def test_compiler_that_relaxes_arithmetic_all_the_same_is_refused(wrapped, relaxed):
    """The wrapper puts its options last; the trial's digits tell."""
    wrapped(f'exec cc "$@" {relaxed}')
    with pytest.raises(ExecutorUnavailable, match="does not compute as IEEE 754 says; take options"):
        kernels.open_executor("c")


def test_compiler_that_does_not_know_this_processor(wrapped, kit):
    """A compiler that refuses -march=native builds kernels without it."""
    wrapped('case "$*" in *-march*) exit 1;; esac\nexec cc "$@"')
    with kernels.open_executor("c") as executor:
        image = np.ones((2, 3, 1), np.float32)
        artifact = compile_program(kit.program(lambda x: x * 0.5, {"a": 1}), "c")
        assert np.array_equal(executor.run(artifact, {"a": image}), image / 2)


def test_picture_too_large_for_indices(executor_named, kit, monkeypatch):
    monkeypatch.setattr(c_executor.CExecutor, "largest_bytes", 40)
    artifact = compile_program(kit.program(lambda x: x * 0.5, {"a": 1}), "c")
    with pytest.raises(
        InputError, match=r"size of the image on .* '4 x 3 with 1 channels': .* at most 40 bytes"
    ):
        executor_named("c").run(artifact, {"a": np.zeros((3, 4, 1), np.float32)})
