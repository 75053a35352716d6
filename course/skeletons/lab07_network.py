"""A network of sines, forwards and backwards.

Layer l maps x to sin(omega (W x + b)), the last one to W x + b; omega is omegas[0] for the first layer and
omegas[1] for the other sines. Backwards, the chain rule from the last layer to the first. What does not
fit together, as a bias of another length than its layer or an x of another width than the first one's D_in,
is refused with ValueError: NumPy would stretch some of it silently. Tutorial: page 5. Clauses: SIR-1, SIR-2,
SIR-7.
"""

from __future__ import annotations

from typing import Any


def forward(weights: list[Any], biases: list[Any], omegas: tuple[float, float], x: Any) -> list[Any]:
    """Return what each layer gives, [(N, D_1), ..., (N, D_out)], for x (N, D_in); W is (D_out, D_in)."""
    raise NotImplementedError("forward")


def gradients(
    weights: list[Any], biases: list[Any], omegas: tuple[float, float], x: Any, target: Any
) -> tuple[float, list[Any], list[Any]]:
    """Return the mean of (y - target)^2 over all N * D_out numbers, and its derivatives [dW], [db]."""
    raise NotImplementedError("gradients")
