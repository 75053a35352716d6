"""OpenCL C 1.2: one work item a pixel; images, weights and result are buffers of floats."""

from __future__ import annotations

from .dialect import Dialect
from .profiles import UNIT_ROUNDOFF, SineContract


class OpenCL(Dialect):
    """The dialect's table."""

    target = "opencl"
    language = "OpenCL C 1.2"
    suffix = ".cl"
    entry = "wamnet_denoise"
    image_declaration = "    __global const float *restrict image_{image}"
    image_separator = ",\n"
    begin = """\
{defines}
__kernel void {entry}(
{images},
    __global const float *restrict weights,
    __global float *restrict result,
    int width,
    int height)
{{
    int x = (int)get_global_id(0);
    int y = (int)get_global_id(1);
    if (x >= width || y >= height) {{
        return;
    }}"""
    pixel = "image_{image}[(row * width + column) * {channels} + c]"
    weight = "weights[{index}]"
    store = "result[(y * width + x) * {channels} + {i}] = {value};"
    arguments = (
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "weights; result: width * height * {channels} floats in the same order, encoded as `output` says;\n"
        "width; height.\n"
        "Global size: at least (width, height)"
    )
    max_output_channels = 2**16
    exact = ("#pragma OPENCL FP_CONTRACT OFF /* every operation is rounded */",)
    native_sine = SineContract(
        "sin() of OpenCL 1.2, 4 ulp on all arguments (full profile)", 4 * 2 * UNIT_ROUNDOFF
    )
    table = "__constant {type} {name}[{count}] = {{{values}}};"
    operations = {
        **Dialect.operations,
        "absolute": "fabs({0})",
        # pow() computes in double on PoCL, and takes four times as long.
        "power": "exp2({1} * log2({0}))",
        "minimum": "fmin({0}, {1})",
        "maximum": "fmax({0}, {1})",
        **{
            f"{op}imum.{kind}": f"{op}({{0}}, {{1}})" for op in ("min", "max") for kind in ("int32", "uint32")
        },
        "convert": "convert_{type}({0})",
    }
