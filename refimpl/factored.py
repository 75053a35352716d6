"""A first layer of low rank: the window's weights as a horizontal pass followed by a vertical one.

The first layer of the network is a convolution of a size x size window with C channels. Of rank R it is

    h_r(y, x) = sum over dx, c of horizontal[r, dx, c] image(y, x + dx, c)
    z_n(y, x) = sum over dy, r of vertical[n, dy, r] h_r(y + dy, x)

so that neighbouring pixels of a column share the horizontal sums: R (size C + size D_out) products a pixel in
place of size^2 C D_out. As a matrix with rows (n, dy) and columns (dx, c) the weights are the product of both
factors [`expand`].

1. A trained layer is cut to the nearest one of rank R by the singular value decomposition [`cut`] (Eckart and
   Young, "The Approximation of One Matrix by Another of Lower Rank", Psychometrika 1, 1936).
2. Training in this form follows the derivatives by both factors [`backward`]; the network that is evaluated
   has the expanded weights, so that nothing else changes.

Source of separable first layers: Rigamonti, Sironi, Lepetit, Fua, "Learning Separable Filters", CVPR 2013.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Factors:
    """vertical (D_out, size, R) and horizontal (R, size C), C channels being the last index of a column."""

    vertical: Array
    horizontal: Array

    @property
    def rank(self) -> int:
        """Return R."""
        return len(self.horizontal)


def largest_rank(size: int, n_in: int, n_out: int) -> int:
    """Return the rank of an unrestricted layer with n_in = size^2 C inputs: its matrix's shorter side."""
    return min(n_out * size, n_in // size)


def check_rank(rank: int, size: int, n_in: int, n_out: int) -> None:
    """Refuse a rank that no first layer of this shape has."""
    most = largest_rank(size, n_in, n_out)
    if not 1 <= rank <= most:
        rule = f"a window of {size} rows, {n_in} inputs and {n_out} neurons has ranks from 1 to {most}"
        raise InputError("rank", rank, rule, "choose one of these, for example 16")


def expand(factors: Factors) -> Array:
    """Return the weights (D_out, size size C) of which these are the factors."""
    product: Array = np.matmul(factors.vertical, factors.horizontal)
    return product.reshape(len(product), -1)


def cut(weight: Array, size: int, rank: int) -> Factors:
    """Return the factors of the nearest weights of rank `rank` (in the Frobenius norm) to (D_out, D_in)."""
    n_out, n_in = weight.shape
    check_rank(rank, size, n_in, n_out)
    u, s, v = np.linalg.svd(weight.astype(np.float64).reshape(n_out * size, -1), full_matrices=False)
    # Each factor takes half of a singular value, so that steps of one length move both alike.
    root = np.sqrt(s[:rank])
    vertical, horizontal = u[:, :rank] * root, root[:, np.newaxis] * v[:rank]
    return Factors(vertical.reshape(n_out, size, rank).astype(weight.dtype), horizontal.astype(weight.dtype))


def start(weight: Array, size: int, rank: int) -> Factors:
    """Return factors to begin training with: those of [`cut`], scaled to the norm of the weights.

    The initial weights are random: cut alone they would be smaller, and so would all that follows.
    """
    factors = cut(weight, size, rank)
    norm, left = (float(np.linalg.norm(w.astype(np.float64))) for w in (weight, expand(factors)))
    scale = np.sqrt(norm / left) if left > 0.0 else 1.0
    grown = ((scale * a).astype(weight.dtype) for a in (factors.vertical, factors.horizontal))
    return Factors(*grown)


def backward(factors: Factors, dweight: Array) -> Factors:
    """Turn dweight (D_out, D_in), the loss's derivative by the weights, into those by both factors."""
    n_out, size, rank = factors.vertical.shape
    # M = V H with rows (n, dy): dV = dM H^T, dH = V^T dM.
    d = dweight.reshape(n_out * size, -1)
    dvertical = np.matmul(d, factors.horizontal.T).reshape(n_out, size, rank)
    return Factors(dvertical, np.matmul(factors.vertical.reshape(-1, rank).T, d))
