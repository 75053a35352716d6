"""Products of bytes on graphics processors (WHO-12): stand-ins for what compilers lack."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.kernel.instructions import PORTABLE
from wamnet.compiler.targets import language_named
from wamnet.kernels import open_executor
from wamnet.kernels.export import tools
from wamnet.kernels.export.wgpu_runner import vulkan_runner
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.whole import forward_whole, rounded
from wamnet.refimpl.network.window import Window, all_windows, pad

pytestmark = pytest.mark.apart  # drivers of several targets stay in memory

WINDOW = Window(3, "zero")
"""The window of the network here; beyond the border words are 0."""

NETWORK = rounded(siren.init([9 * 5, 7, 5, 3], 3.0, 5.0, seed=1), 3)
"""Two words of a pixel, and hidden layers whose last word is filled up."""

NUMBERS = np.random.default_rng(3).integers(-127, 128, (11, 37, 5)).astype(np.float32)
"""The channels of both images."""


def kernel(target):
    """Return the kernel for a target."""
    images = tuple(Image(name, n, -127.0, 127.0, whole=True) for name, n in (("a", 4), ("b", 1)))
    types = {"window": Type(shape=(45,))}
    program = trace(lambda window: forward_whole(NETWORK, window), types, Gather(WINDOW, images))
    return compile_program(program, language_named(target).under("native"), "groupdot:4")


def is_right(opened, artifact):
    """Return whether a runner's picture is the reference's; skip where there is none."""
    try:
        runner = opened()
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    with runner:
        found = runner.run(artifact, {"a": NUMBERS[..., :4].copy(), "b": NUMBERS[..., 4:].copy()})
    held = forward_whole(NETWORK, all_windows(pad(NUMBERS, WINDOW), WINDOW)).astype(np.float32)
    return found.tobytes() == held.tobytes()


def changed(artifact, before, after):
    """Return a kernel with another text."""
    assert before in artifact.source
    source = artifact.source.replace(before, after)
    return replace(artifact, source=source, manifest={**artifact.manifest, "digest": "0" * 64})


# ---- stand-ins for what compilers here do not know --------------------------------------------------------

VULKAN_STAND_IN = """\
int dotPacked4x8EXT(int a, int b)
{
    int sum = 0;
    for (int i = 0; i < 4; ++i) {
        sum += bitfieldExtract(a, 8 * i, 8) * bitfieldExtract(b, 8 * i, 8);
    }
    return sum;
}
"""
"""The function of GL_EXT_integer_dot_product, by the standard's words."""

OPENCL_STAND_IN = """\
#define __opencl_c_integer_dot_product_input_4x8bit_packed 1
int dot_acc_sat_4x8packed_ss_int(uint a, uint b, int sum)
{
    char4 left = as_char4(a), right = as_char4(b);
    return sum + left.s0 * right.s0 + left.s1 * right.s1 + left.s2 * right.s2 + left.s3 * right.s3;
}
"""
"""The function of cl_khr_integer_dot_product; nothing saturates here."""


@pytest.mark.parametrize("portable", [True, False])
def test_vulkan_s_product_of_bytes(portable):
    """Its text is compiled both ways; glslang of Debian 12 does not know the extension."""
    found = kernel("glsl-vulkan")
    if not portable:
        asked = "#extension GL_EXT_integer_dot_product : require"
        condition = f"#if defined(GL_EXT_integer_dot_product) && !defined({PORTABLE})"
        found = changed(changed(found, condition, "#if 1"), asked, "")
        found = changed(found, "int wamnet_packed(", f"{VULKAN_STAND_IN}int wamnet_packed(")
    assert is_right(vulkan_runner, found)


def test_vulkan_s_extension_is_what_its_compiler_knows(tmp_path):
    (tmp_path / "kernel.comp").write_text(kernel("glsl-vulkan").source)
    (tmp_path / "asks.comp").write_text(
        "#version 450\n#ifndef GL_EXT_integer_dot_product\n#error\n#endif\nvoid main() {}\n"
    )
    modern = ("-V", "--target-env", "vulkan1.3")
    try:
        tools.run("glslangValidator", *modern, "-o", "asks.spv", "asks.comp", folder=tmp_path)
    except (CompileError, ExecutorUnavailable):
        pytest.skip("no glslangValidator here knows GL_EXT_integer_dot_product: install a newer glslang")
    tools.run("glslangValidator", *modern, "-o", "kernel.spv", "kernel.comp", folder=tmp_path)
    assert not tools.run("spirv-val", "--target-env", "vulkan1.3", "kernel.spv", folder=tmp_path)


@pytest.mark.parametrize("portable", [True, False])
def test_opencl_s_product_of_bytes(portable):
    """PoCL 3 does not have the extension."""
    found = kernel("opencl")
    if not portable:
        found = replace(changed(found, "/*\n", "/*\n"), source=OPENCL_STAND_IN + found.source)
    assert is_right(lambda: open_executor("opencl"), found)


def test_cuda_s_product_of_bytes_is_an_instruction(tmp_path):
    (tmp_path / "kernel.cu").write_text(kernel("cuda").source)
    try:
        tools.run("nvcc", "-ptx", "-o", "kernel.ptx", "kernel.cu", folder=tmp_path)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    assert "dp4a.s32.s32" in (tmp_path / "kernel.ptx").read_text()
