"""A bound on what rounding does to a network of sines, which an independent checker takes.

A kernel computes in float32: each operation's result is the exact one times (1 + d), |d| <= U. What it gives
is compared with the same network in exact numbers.

A sum of n products and a bias, added in any order, is off by at most gamma(n + 2) times its magnitude: |W|
times the largest |x|, and |b|. An argument omega (W x + b) is a product more: omega times that error, and U
times the largest argument. A sine adds `sine_error`; its argument's error passes through with a slope of at
most 1. So hidden layers give numbers in [-1 - sine_error, 1 + sine_error], and the last layer has neither
omega nor sine.

An error e after layer l becomes omega |W| e in the next one, and so on to the output, which adds all layers'
contributions. TINY is more than all numbers that a device may flush to 0; WIDER is a factor above what
float64 itself rounds: multiply your results by it. Tutorial: page 8. Clauses: PRO-6, PRO-6b, CER-2, CER-3.
"""

from __future__ import annotations

from typing import Any

U, TINY, WIDER = 2.0**-24, 2.0**-110, 1 + 2.0**-16
"""float32's rounding; a number above all that is flushed; a factor for float64's own rounding."""

Step = tuple[Any, Any, Any]
"""Of a layer, (m,) each: the largest argument that a kernel may hold, which its own error makes larger; the
error that rounding adds to it; that and the sine's."""


def gamma(n: int) -> float:
    """Return the largest relative error of n roundings one after another: n U / (1 - n U)."""
    raise NotImplementedError("gamma")


def layer(weight: Any, bias: Any, omega: float, low: Any, high: Any, sine_error: float | None) -> Step:
    """Return a layer's step for x (n,) in [low, high]: weight is (m, n), bias (m,).

    sine_error is None for the last layer, which is W x + b; omega is 1 there.
    """
    raise NotImplementedError("layer")


def layers(
    weights: list[Any], biases: list[Any], omegas: tuple[float, float], low: Any, high: Any, sine_error: float
) -> list[Step]:
    """Return the steps of all layers, the first one's inputs being in [low, high] (n,).

    omegas[0] is the first layer's, omegas[1] that of the other hidden ones.
    """
    raise NotImplementedError("layers")


def contributions(weights: list[Any], omegas: tuple[float, float], errors: list[Any]) -> Any:
    """Return what each layer adds to the error of each output, (D_out, L), from the layers' errors (m,)."""
    raise NotImplementedError("contributions")
