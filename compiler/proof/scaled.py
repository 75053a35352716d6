"""Errors of a network's outputs over a box, by norms of its layers between scaled vectors.

A network of sines or rectifiers is e_l = D_l (A_l e_(l-1) + p_l) + q_l: errors after layer l, A_l = omega_0
W_l, D_l a diagonal of slopes of at most 1, of which nothing else is known, p_l and q_l the errors that the
operations add themselves.

1. Find the layers of a program whose output is such a network, if it is one [`network`].
2. For any positive scalings s_l of the values after layer l, |s_l D x| <= |s_l x| in the 2-norm, diagonals
   commuting. So with S_l = diag(s_l), N_l = |S_l A_l S_(l-1)^-1| and r a row of A_L, for each output

       |e_L| <= |r S_(L-1)^-1| (E_(L-1) + N_(L-1) (E_(L-2) + N_(L-2) (...))) + p_L,   E_l = |s_l (p_l + q_l)|:

   errors meet as signed sums, where products of |W| add up magnitudes [`amplified`].
3. Any scalings are sound. Good ones come from descent on the logarithm of the leading term, along its
   gradient, the squares of singular vectors, at norms that begin smooth and become sharp [`scalings`].

Over all D_l this is the convex relaxation with one multiplier a neuron of Fazlyab, Robey, Hassani, Morari,
Pappas, "Efficient and Accurate Estimation of Lipschitz Constants for Deep Neural Networks", NeurIPS 2019,
section 3, with slopes in [-1, 1], layer by layer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..core.enclosure import OUTWARD, Enclosure
from ..core.ir import Program
from .adjoint import unclamped

Array = NDArray[np.float64]

Gradients = Callable[[list[Array], float], Sequence[Array]]
"""Of logarithms of scalings, and the power that makes norms sharp."""

STEPS = 60
"""Most steps of the descent: three hundred more gain a hundredth."""

WORK = 2**23
"""Multiplications that all steps may take, those of a decomposition being m n min(m, n)."""

LARGEST_WORK = 2**31
"""Most multiplications of one step: layers beyond have no bound of this kind."""

WIDEST = 2**12
"""Neurons of the widest layer that is looked at: matrices of that many rows and columns are made."""

MOST_ALONE = 4
"""Most outputs that have scalings of their own; more share theirs."""

DIGITS_BITS = 8
"""Bits of a scaling's mantissa: few enough to be exact in any text, and the same on all machines."""


@dataclass(frozen=True)
class Layer:
    """One affine map of a network and what follows, as indices of nodes; `scale` is omega_0.

    `read` is what it maps; `multiply` omega_0 times the map, or the map itself; `activation` None at the end.
    """

    read: int
    affine: int
    multiply: int
    activation: int | None
    scale: float


def network(program: Program, found: Sequence[Enclosure], output: int) -> list[Layer]:
    """Return the layers whose last one makes this value, first to last; none if it is another network."""
    index = unclamped(program, found, output)
    layers: list[Layer] = []
    if program.nodes[index].op != "affine":
        return []
    layers.append(Layer(program.nodes[index].args[0], index, index, None, 1.0))
    while (argument := argument_of(program, found, layers[0].read)) is not None:
        activation = layers[0].read
        multiply = affine = argument
        scale = 1.0
        if program.nodes[affine].op == "multiply":
            constants = [arg for arg in program.nodes[affine].args if program.nodes[arg].op == "constant"]
            if len(constants) != 1 or np.any(found[constants[0]].error):
                return []
            scale = float(program.nodes[constants[0]]["value"])  # type: ignore[arg-type]
            (affine,) = (arg for arg in program.nodes[affine].args if arg != constants[0])
        if program.nodes[affine].op != "affine":
            return []
        layers.insert(0, Layer(program.nodes[affine].args[0], affine, multiply, activation, scale))
    return layers


def argument_of(program: Program, found: Sequence[Enclosure], index: int) -> int | None:
    """Return what this activation is of, a sine, or a rectifier: the larger of a value and an exact constant.

    Both have slopes of at most 1. None for other operations.
    """
    node = program.nodes[index]
    if node.op == "sin":
        return node.args[0]
    if node.op != "maximum":
        return None
    others = [arg for arg in node.args if program.nodes[arg].op != "constant" or np.any(found[arg].error)]
    return others[0] if len(others) == 1 and program.nodes[others[0]].type == node.type else None


def output_error(program: Program, found: Sequence[Enclosure], output: int) -> Array | None:
    """Return the bound (n,) of a network's output; None for other programs, or at given inputs."""
    layers = network(program, found, output)
    if len(layers) < 2 or any(np.ndim(found[layer.affine].error) != 1 for layer in layers):
        return None
    first = layers[0]
    # What comes in with an error, or is known as a whole, counts as the first layer's own.
    if found[first.affine].own is not None and np.any(found[first.read].error):
        return None
    own = [own_error(found, layer) for layer in layers]
    if not all(np.isfinite(part).all() for part in own):
        return None
    weights = [str(program.nodes[layer.affine]["weight"]) for layer in layers[1:]]
    parameters = [program.parameters[name].astype(np.float64) for name in weights]
    matrices = [layer.scale * each for layer, each in zip(layers[1:], parameters, strict=True)]
    if not decomposable(matrices):
        return None
    errors = np.zeros(len(own[-1]))
    for rows in outputs(len(errors)):
        some = [*matrices[:-1], matrices[-1][rows]]
        errors[rows] = amplified(some, [*own[:-1], own[-1][rows]], scalings(some, own[0])) * (1 + OUTWARD)
    return errors


def outputs(count: int) -> list[list[int]]:
    """Return groups of outputs, each with scalings of its own."""
    return [[i] for i in range(count)] if count <= MOST_ALONE else [list(range(count))]


def decomposable(matrices: Sequence[Array]) -> bool:
    """Return whether norms of matrices (m, n) of these sizes are found in little time."""
    return _work(matrices) <= LARGEST_WORK and max(max(matrix.shape) for matrix in matrices) <= WIDEST


def _work(matrices: Sequence[Array]) -> int:
    """Return the multiplications of the decompositions of all matrices (m, n)."""
    return sum(matrix.size * min(matrix.shape) for matrix in matrices)


def own_error(found: Sequence[Enclosure], layer: Layer) -> Array:
    """Return the errors (m,) that a layer's operations add, at its end: slopes are at most 1."""
    total = np.zeros(1)
    indices = {layer.affine: abs(layer.scale), layer.multiply: 1.0}
    for index, factor in indices.items():
        e = found[index]
        total = total + factor * (e.error if e.own is None else e.own)
    if layer.activation is not None:
        total = total + found[layer.activation].own
    return total


def amplified(matrices: Sequence[Array], own: Sequence[Array], scales: Sequence[Array]) -> Array:
    """Return |e_L| (n,) from A_2 ... A_L, the errors that each layer adds, and s_1 ... s_(L-1)."""
    reach = float(np.linalg.norm(scales[0] * own[0]))
    for matrix, before, after, error in zip(matrices[:-1], scales, scales[1:], own[1:], strict=False):
        norm = float(np.linalg.norm(after[:, None] * matrix / before, 2))
        reach = norm * reach + float(np.linalg.norm(after * error))
    found: Array = np.linalg.norm(matrices[-1] / scales[-1], axis=1) * reach + own[-1]
    return found


def scalings(matrices: Sequence[Array], error: Array) -> list[Array]:
    """Return s_1 ... s_(L-1) for which the first layer's errors (n,) reach the output least amplified."""
    return [np.array(scale) for scale in _scalings(*map(Held, (*matrices, short(error))))]


class Held:
    """An array that can be looked up: a manifest's bound and its certificate ask for the same scalings."""

    def __init__(self, array: Array) -> None:
        self.array = array
        self._key = (array.shape, array.tobytes())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Held) and self._key == other._key


@lru_cache(maxsize=16)
def _scalings(*held: Held) -> list[Array]:
    """Return the scalings for matrices and, last, the first layer's errors."""
    *matrices, error = (array.array for array in held)
    steps = min(STEPS, WORK // max(_work(matrices), 1))
    start = [np.zeros(matrix.shape[1]) for matrix in matrices]
    found = descended(start, lambda logs, power: _gradients(matrices, error, logs, power), steps)
    return [short(np.exp(log - log.mean())) for log in found]


def descended(logs: list[Array], gradients: Gradients, steps: int) -> list[Array]:
    """Return the logarithms of scalings after so many steps along means of gradients, over their size."""
    means, squares = ([np.zeros_like(log) for log in logs] for _ in range(2))
    for step in range(steps):
        for i, gradient in enumerate(gradients(logs, 20.0 * (1 + step / 20))):
            means[i] = 0.9 * means[i] + 0.1 * gradient
            squares[i] = 0.99 * squares[i] + 0.01 * gradient**2
            logs[i] = logs[i] - 0.1 / (1 + step / 20) * means[i] / (np.sqrt(squares[i]) + 1e-6)
    return logs


def chain(matrices: Sequence[Array], logs: Sequence[Array], power: float) -> tuple[float, list[Array]]:
    """Return the logarithm of the product of all scaled norms, and its derivatives by each log s_l.

    The largest singular value stands for all as the norm of their vector that `power` belongs to.
    """
    found, product = [np.zeros_like(log) for log in logs], 0.0
    for i, matrix in enumerate(matrices):
        after = np.exp(logs[i + 1])[:, None] if i + 1 < len(logs) else 1.0
        u, values, vt = np.linalg.svd(after * matrix / np.exp(logs[i]), full_matrices=False)
        shares = (values / max(float(values[0]), 1e-300)) ** power
        shares = shares / max(float(shares.sum()), 1e-300)
        product += float(np.log(max(float(values[0]), 1e-300)))
        found[i] -= vt.T**2 @ shares
        if i + 1 < len(logs):
            found[i + 1] += u**2 @ shares
    return product, found


def _gradients(matrices: Sequence[Array], error: Array, logs: Sequence[Array], power: float) -> list[Array]:
    """Return the derivatives of the leading term's logarithm by each log s_l."""
    _, found = chain(matrices, logs, power)
    scaled = (np.exp(logs[0]) * error) ** 2
    found[0] += scaled / max(float(scaled.sum()), 1e-300)
    return found


def short(scale: Array) -> Array:
    """Return numbers of few bits near these."""
    mantissa, exponent = np.frexp(scale)
    found: Array = np.ldexp(np.round(mantissa * 2**DIGITS_BITS), exponent - DIGITS_BITS)
    return found
