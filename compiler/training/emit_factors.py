"""The extra work of a training step for a first layer of low rank: its factors' derivatives, their product.

The step computes with the weights W = V H, and has their derivative dW (refimpl/network/factored.py):

1. `wamnet_vertical` adds up dW over the work items of the step, in their order, and gives dV = dW H^T.
2. `wamnet_horizontal` gives dH = V^T dW. The second kernel of emit_step.py moves both factors with Adam, and
   does not change W.
3. `wamnet_expand` writes W = V H for the next step; nothing after a loss that is not finite.

W is input-major, so that its vectors hold neurons n: row (dy, k) for V's vectors (dy, r) and H's numbers
(k, r). Each work item has sums of its own that no other touches, in one order: a device repeats its bits.
"""

from __future__ import annotations

from collections.abc import Mapping

from .step import Step
from .step_layout import slots

KERNELS = ("wamnet_vertical", "wamnet_horizontal", "wamnet_expand")
"""The kernels' names, in the order in which they run; the update runs before the last one."""


def factor_defines(step: Step) -> Mapping[str, int]:
    """Return the offsets of factors and their product, in vectors; none for a step without factors."""
    if step.split is None:
        return {}
    places = slots(step)
    product = places[step.split.parameter]
    vertical, horizontal = (places[name] for name in step.split.factors)
    return {
        "PRODUCT": product.offset,
        "PRODUCT_END": product.end,
        "FACTORS": vertical.offset,
        "VERTICAL": vertical.offset,
        "HORIZONTAL": horizontal.offset,
        "RANK": step.split.rank,
        "ROWS": step.split.size,
        "RUN": horizontal.rows,
        "NEURONS": product.vectors,
        "RANKS": horizontal.vectors,
    }


def factors_text() -> str:
    """Return the three kernels; the numbers are the definitions of [`factor_defines`]."""
    return FACTORS


FACTORS = """\
__kernel void wamnet_vertical(
    __global float16 *restrict sums,
    int groups,
    __global const float16 *restrict theta)
{
    const int dy = (int)get_global_id(0) / NEURONS, j = (int)get_global_id(0) % NEURONS;
    __global float16 *product = sums + PRODUCT + dy * RUN * NEURONS + j;
    for (int k = 0; k < RUN; ++k) {
        float16 sum = product[k * NEURONS];
        for (int n = 1; n < groups; ++n) {
            sum += product[n * SUMS + k * NEURONS];
        }
        product[k * NEURONS] = sum;
    }
    for (int r = 0; r < RANK; ++r) {
        __global const float *horizontal = (__global const float *)(theta + HORIZONTAL) + r;
        float16 slope = 0.0f;
        for (int k = 0; k < RUN; ++k) {
            slope += product[k * NEURONS] * horizontal[k * RANKS * 16];
        }
        sums[VERTICAL + (dy * RANK + r) * NEURONS + j] = slope;
    }
}

__kernel void wamnet_horizontal(
    __global float16 *restrict sums,
    __global const float16 *restrict theta)
{
    const int k = (int)get_global_id(0);
    __global float *slope = (__global float *)(sums + HORIZONTAL + k * RANKS);
    for (int r = 0; r < RANKS * 16; ++r) {
        float16 sum = 0.0f;
        for (int dy = 0; dy < ROWS && r < RANK; ++dy) {
            for (int j = 0; j < NEURONS; ++j) {
                const float16 vertical = theta[VERTICAL + (dy * RANK + r) * NEURONS + j];
                sum += sums[PRODUCT + (dy * RUN + k) * NEURONS + j] * vertical;
            }
        }
        const float8 s8 = sum.lo + sum.hi;
        const float4 s4 = s8.lo + s8.hi;
        slope[r] = s4.s0 + s4.s1 + s4.s2 + s4.s3;
    }
}

__kernel void wamnet_expand(__global float16 *restrict theta, __global const int *restrict failed)
{
    if (failed[0] >= 0) {
        return;
    }
    const int row = (int)get_global_id(0), dy = row / RUN, k = row % RUN;
    __global const float *horizontal = (__global const float *)(theta + HORIZONTAL + k * RANKS);
    for (int j = 0; j < NEURONS; ++j) {
        float16 sum = 0.0f;
        for (int r = 0; r < RANK; ++r) {
            sum += theta[VERTICAL + (dy * RANK + r) * NEURONS + j] * horizontal[r];
        }
        theta[PRODUCT + row * NEURONS + j] = sum;
    }
}
"""
"""The kernels. Work items: a row of the window and a vector of neurons; an input of a row; an input."""
