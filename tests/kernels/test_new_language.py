"""How a language is added: one class of words and one line of targets.py give it kernels of every role."""

import ctypes
import os
import subprocess

import numpy as np
import pytest
from kit import encoded

from wamnet.compiler import targets
from wamnet.compiler.compile import compile_program
from wamnet.compiler.kernel.interface import DENOISE, ENCODE, PATH
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.openings import Arguments
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.devices.kernel import Part
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import Normalization


class Items(Arguments):
    """C whose items are called one by one, as a processor for graphics would: a language of nobody's own."""

    target = "items"
    language = "C by items"
    suffix = ".c"
    heading = "void {entry}"
    reads = "const float *{name}"
    writes = "float *{name}"
    item = ("item_x", "item_y")
    said = {DENOISE: "images; weights; result; width; height", PATH: "{planes}", ENCODE: "{planes}"}
    pixel, weight, store, table = C.pixel, C.weight, C.store, C.table
    operations, native_sine = C.operations, C.native_sine
    max_output_channels = 2**16


TOP = """\
#include <math.h>
#include <stdbool.h>
typedef unsigned int uint;
extern int item_x, item_y;
static int clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}
"""
"""What the language's own compiler would know."""

LOOPS = """\
#include <stdarg.h>
int item_x, item_y;
void wamnet_run(void (*kernel)({types}), {arguments}, int across, int down)
{{
    for (item_y = 0; item_y < down; ++item_y)
        for (item_x = 0; item_x < across; ++item_x)
            kernel({names});
}}
"""
"""What starts all items."""


@pytest.fixture
def language(monkeypatch):
    """Give the target, which is one line."""
    target = targets._of(Items())
    monkeypatch.setitem(targets.LANGUAGES, "items", target)
    return target


def run(kernel, buffers, integers, size, tmp_path):
    """Call a kernel for all items; `buffers` by name."""
    known = kernel.interface
    kinds = ["float *"] * len(known.arrays) + ["int"] * len(known.integers)
    names = [*(array.name for array in known.arrays), *known.integers]
    listed = ", ".join(f"{kind} {name}" for kind, name in zip(kinds, names, strict=True))
    loops = LOOPS.format(types=", ".join(kinds), arguments=listed, names=", ".join(names))
    (tmp_path / "kernel.c").write_text(TOP + kernel.source + loops)
    name = f"{kernel.entry_point}.so"  # a library is loaded once under its name
    options = ["-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", "-w"]
    command = [os.environ.get("CC", "cc"), *options, "-o", name, "kernel.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    library = ctypes.CDLL(str(tmp_path / name))
    given = [buffers[array.name].ctypes.data_as(ctypes.c_void_p) for array in known.arrays]
    numbers = [ctypes.c_int(integers[name]) for name in known.integers]
    library.wamnet_run(getattr(library, kernel.entry_point), *given, *numbers, *map(ctypes.c_int, size))


def test_a_class_and_a_line_are_all_that_a_new_language_needs(language, executor_named, kit, tmp_path):
    """A denoiser within its bound, a path kernel that adds up what C's does, and an encoding of it."""
    executor_named("c")  # the same compiler
    width, height = 7, 5
    program = kit.denoiser(kit.network([54, 6, 3], (3.0, 3.0)), {"color": 3, "normal": 3}, 3, "clamp")
    drawn = np.random.default_rng(1).uniform(-2, 2, (2, height, width, 3)).astype(np.float32)
    images = dict(zip(("color", "normal"), drawn, strict=True))
    kernel = compile_program(program, "items")
    result = np.zeros((height, width, 3), np.float32)
    buffers = {**{f"image_{name}": image for name, image in images.items()}, "result": result}
    size = {"width": width, "height": height}
    run(kernel, {**buffers, "weights": kernel.weights}, size, (width, height), tmp_path)
    held = kernel.plan.expected(images)
    assert np.isfinite(held.bound).all()
    assert (np.abs(result.astype(np.float64) - held.value) <= held.bound).all()
    assert result.std() > 0, "a picture of one colour would hide what is mixed up"


def test_it_traces_and_encodes(language, executor_named, tmp_path):
    """Of a scene of one light, what C's own kernels compute: the same arithmetic, to the bit."""
    c = executor_named("c")
    width, height = 7, 5
    programs = lower_scene(canonical("lone_light"), Settings(max_depth=1))
    part = Part(width, height, 0, height, 0, 2, 3)
    groups = ("color", "normal")
    kernels = {target: compile_path(programs, target, groups=groups) for target in ("items", "c")}
    sums = np.zeros((len(kernels["items"].planes), height, width), np.float32)
    integers = {"width": width, "height": height, "first_row": 0, "rows": height}
    integers |= {"first_sample": 0, "samples": 2, "seed_number": 3}
    run(kernels["items"], {"sums": sums}, integers, (width, height), tmp_path)
    assert np.array_equal(sums, c.trace(kernels["c"], part))
    planes = kernels["c"].planes
    made = {target: compile_encode(groups, Normalization(), target, planes=planes) for target in kernels}
    written = {f"image_{name}": np.zeros((height, width, 3), np.float32) for name in groups}
    size = {"width": width, "height": height, "sample_count": 2}
    run(made["items"], {"sums": sums, **written}, size, (width, height), tmp_path)
    for name, image in encoded(c, made["c"], sums, 2).items():
        assert np.array_equal(image, written[f"image_{name}"])
