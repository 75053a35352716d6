"""A first layer of low rank: the window's weights as a horizontal pass followed by a vertical one.

The first layer of the network is a convolution of a size x size window with C channels. Of rank R it is

    h_r(y, x) = sum over dx, c of horizontal[r, dx, c] image(y, x + dx, c)
    z_n(y, x) = sum over dy, r of vertical[n, dy, r] h_r(y + dy, x)

so that neighbouring pixels of a column share the horizontal sums: R (size C + size D_out) products a pixel in
place of size^2 C D_out. As a matrix with rows (n, dy) and columns (dx, c) the weights are the product of both
factors [`expand`].

1. A trained layer is cut to the nearest one of rank R by the singular value decomposition [`cut`] (Eckart and
   Young, "The Approximation of One Matrix by Another of Lower Rank", Psychometrika 1, 1936). Near means that
   the layer's sums are, over pictures whose neighbouring pixels have something in common [`SHARED`].
2. Training in this form follows the derivatives by both factors [`backward`]; the network that is evaluated
   has the expanded weights, so that nothing else changes.

Source of separable first layers: Rigamonti, Sironi, Lepetit, Fua, "Learning Separable Filters", CVPR 2013.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.floating[Any]]


SHARED = 0.5
"""What two taps of a channel along an axis have in common, by [`cut`], against 1 that is a tap's own."""


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


def cut(weight: Array, size: int, rank: int, shared: float = SHARED) -> Factors:
    """Return the factors of the weights of rank `rank` that give the sums of (D_out, D_in) most nearly.

    Windows x with E[x x^T] = A (rows) times A (columns) of each channel, A = I + shared 1 1^T: the mean
    square of (W - V H) x is the squared Frobenius norm of A^(1/2) (W - V H) A^(1/2). `shared` 0: the nearest
    weights.
    """
    n_out, n_in = weight.shape
    check_rank(rank, size, n_in, n_out)
    root, inverse = (_power_of_ones(size, shared, exponent) for exponent in (0.5, -0.5))
    taps = weight.astype(np.float64).reshape(n_out, size, size, -1)
    weighted = np.einsum("ab,nbxc,xy->nayc", root, taps, root)
    u, s, v = np.linalg.svd(weighted.reshape(n_out * size, -1), full_matrices=False)
    # Each factor takes half of a singular value, so that steps of one length move both alike.
    half = np.sqrt(s[:rank])
    vertical = np.einsum("ab,nbr->nar", inverse, (u[:, :rank] * half).reshape(n_out, size, rank))
    columns = (half[:, np.newaxis] * v[:rank]).reshape(rank, size, -1)
    horizontal = np.einsum("rxc,xy->ryc", columns, inverse).reshape(rank, -1)
    return Factors(vertical.astype(weight.dtype), horizontal.astype(weight.dtype))


def _power_of_ones(n: int, shared: float, exponent: float) -> Array:
    """Return (I + shared 1 1^T)^exponent (n, n): its eigenvalues are 1, and 1 + n shared along 1."""
    ones: Array = np.ones((n, n)) / n
    power: Array = np.eye(n) + ((1.0 + n * shared) ** exponent - 1.0) * ones
    return power


def start(weight: Array, size: int, rank: int) -> Factors:
    """Return factors to begin training with: those of [`cut`], scaled to the norm of the weights.

    The initial weights are random: a cut without scaling would make them smaller, and so all that follows.
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
