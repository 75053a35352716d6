"""Integers: a network in which no operation rounds, so that every device computes the same bits.

1. Inputs, weights and hidden values are integers of 8 bits or a few more. Sums of their products stay
   below 2^24 in magnitude, in any order and with or without fused multiply-add: float32, int32 and products
   of bytes hold each of them exactly [`check_whole`].
2. The argument of a sine is an angle, and an angle is known modulo a turn. Here a turn is 2^24: the phase
   sum * factor + bias is computed modulo 2^32, a multiple of a turn, in words that wrap [`hidden`]. No
   argument is too large, whatever omega_0.
3. The sine folds a phase to a quarter turn of 16 bits and evaluates an odd polynomial in products of words
   below 2^32 and shifts [`whole_sine`].
4. The last layer's colour is an integer multiple of 1 / 65536 [`colour`]: float32 holds it.
5. A trained network becomes such a one by rounding [`rounded`]: each row has a factor of its own, and its
   weights are the multiples of it that are nearest.
6. Where windows of frames are given, layers are rounded one after another so that their sums over these
   windows move least [`rounded_on`]: the error of a weight goes to those of its row that are rounded later.

The functions of one pixel are traced by the compiler as those of siren.py are. Source of 8-bit weights with a
scale a row, and of sums in integers: Jacob et al., "Quantization and Training of Neural Networks for
Efficient Integer-Arithmetic-Only Inference", CVPR 2018, section 2. The phase in words that wrap is that of
direct digital synthesis: Tierney, Rader, Gold, "A Digital Frequency Synthesizer", IEEE Transactions on Audio
and Electroacoustics 19, 1971. Rounding that moves sums little: Babai, "On Lovasz' Lattice Reduction and the
Nearest Lattice Point Problem", Combinatorica 6, 1986, section 3 (the nearest plane); Frantar, Ashkboos,
Hoefler, Alistarh, "GPTQ: Accurate Post-Training Quantization for Generative Pre-trained Transformers", ICLR
2023, do the same to layers of networks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NO_VALUE, InputError
from .activation import SINE
from .siren import Siren

Array = NDArray[np.floating[Any]]

INPUT_LEVELS = 127
"""An input of 1 becomes this number: 8 bits with a sign."""

WEIGHT_LEVELS = 127
"""Largest magnitude of a weight: 8 bits with a sign."""

TURN = 2**24
"""A full turn of a phase; factors and biases are below it, so that float32 holds them."""

EXACT = 2**24
"""float32 holds every integer up to this magnitude."""

LARGEST_INT = 2**31 - 1
"""Largest number of int32, in which the last layer's colours are computed."""

MOST_INPUTS = 2**13
"""Most inputs of a layer: weights of a flat row then still reach 14 with inputs of 8 bits, 2 with 10."""

COLOUR_STEPS = 2**16
"""A colour of 1 in integers."""

MOST_FRACTION = 8
"""Most binary digits that the last layer keeps below a step of a colour."""

SPREAD = 1e-2
"""What is added to each input's variance, as a part of their mean: weights of inputs that the windows do not
tell apart would move without end."""


@dataclass(frozen=True)
class SinePolynomial:
    """round(A sin(pi/2 x)) of x = m / 2^16: (m q + 2^(shift - 1)) >> shift, q = c1 - z (c3 - z c5) / 2^32.

    z = m m >> 16, and each product with z is shifted by 16. `error` bounds the distance from A sin in steps,
    before and without the last rounding, at the middle of what m stands for.
    """

    coefficients: tuple[int, int, int]
    shift: int
    error: float


SINES: Mapping[int, SinePolynomial] = {
    127: SinePolynomial((51053, 20871, 2332), 24, 0.0113),
    511: SinePolynomial((51355, 20996, 2347), 22, 0.0450),
}
"""By the largest hidden value A, for 8 and 10 bits; the error is the largest of all 65,536 m, which a test
computes, and the coefficients are those among the neighbours of the scaled minimax polynomial of degree 5
whose error is least. m q < 2^31 for all m."""


@dataclass(frozen=True)
class Whole(Siren):
    """A network of integers, which are held as floats: `weights` in +-127, `biases` in +-2^24.

    Layer l has `factors[l]` (D_out,), from 0 to 2^24 - 1. Hidden values lie in +-`amplitude`. Colours are
    computed in units of 2^-(16 + fraction). omega_0 is in the factors; the fields say what it was.
    """

    factors: tuple[Array, ...] = ()
    amplitude: int = 127
    fraction: int = MOST_FRACTION


def round_image(image: Array) -> NDArray[np.float32]:
    """Return floor(127 x + 1/2), at most 127 in magnitude, of encoded features x (..., C) in [-1, 1].

    x is float32, so that 127 x has 31 binary digits and float64 computes the floor of the real number.
    """
    steps: NDArray[np.float32] = steps_of(image.astype(np.float64)).astype(np.float32)
    return steps


def steps_of(x: Any) -> Any:
    """Return floor(127 x + 1/2) (...), at most 127 in magnitude, with x's own rounding; may be traced."""
    return np.clip(np.floor(INPUT_LEVELS * x + 0.5), -INPUT_LEVELS, INPUT_LEVELS)


def forward_whole(network: Whole, numbers: Any) -> Any:
    """Map integers (..., D_in) to colours (..., D_out) in [0, 1]; may be traced."""
    last = len(network.weights) - 1
    for _, values in sine_layers(network, numbers, last):
        numbers = values
    return colour(network, np.matmul(numbers, network.weights[last].T))


def sine_layers(network: Whole, numbers: Any, count: int) -> Iterator[tuple[Any, Any]]:
    """Yield the sums and the values (..., D_out) of each of the first `count` layers; may be traced."""
    for layer in range(count):
        sums = np.matmul(numbers, network.weights[layer].T)
        numbers = whole_sine(phase(sums, network.factors[layer], network.biases[layer]), network.amplitude)
        yield sums, numbers


def phase(sums: Any, factor: Array, bias: Array) -> Any:
    """Return sums * factor + bias (..., D) modulo 2^32, whose last 24 bits are phases; may be traced."""
    return sums.astype(np.int32).astype(np.uint32) * factor.astype(np.uint32) + bias.astype(np.uint32)


def whole_sine(phases: Any, amplitude: int) -> Any:
    """Return the integer (...) near amplitude * sin(2 pi phases / 2^24), as float32; may be traced."""
    polynomial = SINES[amplitude]
    c1, c3, c5 = polynomial.coefficients
    # The second quarter of a half-turn runs back: its bits are inverted, which mirrors all 22 of them.
    back = (phases >> 22) & 1
    m = ((phases ^ (0 - back)) >> 6) & 0xFFFF
    z = (m * m) >> 16
    q = c1 - ((z * (c3 - ((z * c5) >> 16))) >> 16)
    rounded_up = (m * q + (1 << (polynomial.shift - 1))) >> polynomial.shift
    # It is not larger for any m, which the ranges of m and q by themselves do not show.
    magnitude = np.minimum(rounded_up, amplitude).astype(np.float32)
    # The second half-turn is below 0.
    return magnitude * (1.0 - 2.0 * ((phases >> 23) & 1).astype(np.float32))


def colour(network: Whole, sums: Any) -> Any:
    """Return the colours (..., D_out) in [0, 1] of the last layer's sums; may be traced."""
    factor, bias = (array[-1].astype(np.int32) for array in (network.factors, network.biases))
    units = np.clip(sums.astype(np.int32) * factor + bias, 0, COLOUR_STEPS << network.fraction)
    steps = units.astype(np.uint32) >> network.fraction
    return steps.astype(np.float32) * (1.0 / COLOUR_STEPS)


# ---- making one -------------------------------------------------------------------------------------------


def rounded(siren: Siren, size: int, amplitude: int = 127) -> Whole:
    """Return a trained network in integers; its window has size x size taps.

    All is computed in float64, one rounding an operation, so that every machine makes the same network.
    """
    _check_roundable(siren, size, amplitude)
    parts: list[tuple[Array, Array, Array]] = []
    for layer in range(len(siren.weights) - 1):
        unit = _unit(siren, layer)
        weight, factor = _rounded_rows(siren, layer, unit, size, amplitude)
        bias = np.rint(siren.biases[layer].astype(np.float64) * unit)
        parts.append((weight, np.mod(bias, TURN), np.mod(factor, TURN)))
    last = len(parts)
    for fraction in range(MOST_FRACTION, -1, -1):
        unit = _unit(siren, last, fraction)
        weight, factor = _rounded_rows(siren, last, unit, size, amplitude)
        # A step of a colour begins at its lower end: half a step more makes its middle the nearest.
        bias = np.rint(siren.biases[last].astype(np.float64) * unit + 2.0**fraction / 2)
        layers = zip(*parts, (weight, bias, factor), strict=True)
        weights, biases, factors = (tuple(array.astype(np.float32) for array in some) for some in layers)
        omegas = (siren.omega_0_first, siren.omega_0_hidden)
        found = Whole(weights, biases, *omegas, siren.activation, factors, amplitude, fraction)
        if not any(_faults(found)):
            return found
    rule = f"is too large: sums of the last layer must stay below {LARGEST_INT / COLOUR_STEPS:.6g} in colour"
    raise InputError("network to be rounded", NO_VALUE, rule, "train the model again")


def _unit(siren: Siren, layer: int, fraction: int = 0) -> float:
    """Return what a sum of 1 is in units of a phase; or, in the last layer, of a colour."""
    if layer == len(siren.weights) - 1:
        return COLOUR_STEPS * 2.0**fraction
    return (siren.omega_0_hidden if layer else siren.omega_0_first) / (2.0 * math.pi) * TURN


def _rounded_rows(siren: Siren, layer: int, unit: float, size: int, amplitude: int) -> tuple[Array, Array]:
    """Return weights (D_out, D_in) as multiples of factors (D_out,), the least that keep sums exact.

    `unit`: what a weight of 1 adds for an input of 1, in units of a phase or of a colour.
    """
    largest = amplitude if layer else INPUT_LEVELS
    real = siren.weights[layer].astype(np.float64) * (unit / largest)
    peak, total = np.abs(real).max(axis=1), np.abs(real).sum(axis=1)
    # Rounding and what it hands on add less than two factors a weight.
    room = (EXACT - 1) // largest - 2 * real.shape[1]
    factor = np.ceil(np.maximum(np.maximum(peak / WEIGHT_LEVELS, total / room), 1.0))
    multiples = real / factor[:, None]
    if layer:
        return np.rint(multiples), factor
    taps = multiples.reshape(len(real), size, size, -1)
    return diffused(taps, WEIGHT_LEVELS).reshape(real.shape), factor


def rounded_on(siren: Siren, windows: Array, size: int, amplitude: int = 127) -> Whole:
    """Return a trained network in integers whose sums over windows (N, D_in) are near the network's own.

    Factors are those of [`rounded`]; and so is all if the new weights leave what holds their sums.
    """
    network = rounded(siren, size, amplitude)
    weights, biases = list(network.weights), list(network.biases)
    last = len(weights) - 1
    values = windows.astype(np.float64)
    numbers = steps_of(values)
    for layer in range(last + 1):
        unit, largest = _unit(siren, layer, network.fraction), amplitude if layer else INPUT_LEVELS
        _, factor = _rounded_rows(siren, layer, unit, size, amplitude)
        weight, bias = (array[layer].astype(np.float64) for array in (siren.weights, siren.biases))
        # What the network has over the windows, in units of a phase or of a colour.
        wanted = (np.matmul(values, weight.T) + bias) * unit
        found = nearest(weight * (unit / largest) / factor[:, None], wanted / factor, numbers)
        sums = np.matmul(numbers, found.T)
        bias = np.mean(wanted - sums * factor, axis=0)
        weights[layer] = found.astype(np.float32)
        if layer == last:
            biases[layer] = np.rint(bias + 2.0**network.fraction / 2).astype(np.float32)
            break
        biases[layer] = np.mod(np.rint(bias), TURN).astype(np.float32)
        values = np.sin(wanted * (2.0 * math.pi / TURN))
        numbers = whole_sine(phase(sums, network.factors[layer], biases[layer]), amplitude)
        numbers = numbers.astype(np.float64)
    moved = replace(network, weights=tuple(weights), biases=tuple(biases))
    return network if any(_faults(moved)) else moved


def nearest(weight: Array, wanted: Array, numbers: Array) -> Array:
    """Return integers (D_out, D_in) in +-127 with sums over x (N, D_in) near the wanted (N, D_out).

    `weight` begins; the sums may be off by a constant a row, which a bias makes good. With R^T R the
    covariance of x, the mean square of (W - Q) x is that of R (W - Q)^T, and R is triangular: from the last
    input to the first, each takes the integer that is best with those already there.
    """
    apart = numbers - np.mean(numbers, axis=0)
    covariance = np.matmul(apart.T, apart) / len(apart)
    spread = SPREAD * max(float(np.mean(np.diag(covariance))), 1.0)
    covariance += spread * np.eye(len(covariance))
    # The best real weights make up for what these inputs, which are rounded, miss.
    missing = wanted - np.matmul(numbers, weight.T)
    best = weight + np.linalg.solve(covariance, np.matmul(apart.T, missing) / len(apart)).T
    # Inputs that vary most are rounded first: to the others they may hand on most.
    order = np.argsort(np.diag(covariance), kind="stable")
    root = np.linalg.cholesky(covariance[np.ix_(order, order)]).T
    best = best[:, order]
    left, found = best.copy(), np.zeros_like(best)
    for i in range(len(root) - 1, -1, -1):
        handed_on = np.matmul(left[:, i + 1 :], root[i, i + 1 :]) / root[i, i]
        found[:, i] = np.clip(np.rint(best[:, i] + handed_on), -WEIGHT_LEVELS, WEIGHT_LEVELS)
        left[:, i] -= found[:, i]
    placed: Array = np.empty_like(found)
    placed[:, order] = found
    return placed


def diffused(taps: Array, most: int) -> Array:
    """Return taps (D_out, size, size, C) as integers in +-`most`, each channel's sum kept.

    Neighbouring taps of a window see much the same, most of all where features are smooth: rounding errors
    of one sign would add up. So each tap's error goes to the neighbours that are rounded after it, with the
    shares of Floyd and Steinberg, "An Adaptive Algorithm for Spatial Greyscale", Proceedings of the SID 17,
    1976; rows run to and fro, and at the window's rim those inside share all.
    """
    left, found = taps.copy(), np.zeros_like(taps)
    size = taps.shape[1]
    for y in range(size):
        ahead = -1 if y % 2 else 1
        for x in range(size)[::ahead]:
            found[:, y, x] = np.clip(np.rint(left[:, y, x]), -most, most)
            shares = {(y, x + ahead): 7, (y + 1, x - ahead): 3, (y + 1, x): 5, (y + 1, x + ahead): 1}
            inside = {at: share for at, share in shares.items() if at[0] < size and 0 <= at[1] < size}
            for (row, column), share in inside.items():
                left[:, row, column] += (left[:, y, x] - found[:, y, x]) * (share / sum(inside.values()))
    return found


def _check_roundable(siren: Siren, size: int, amplitude: int) -> None:
    """Refuse a network without angles, one that is rounded already, and an amplitude without a sine."""
    if siren.activation != SINE:
        rule = "integer networks have sines only"
        raise InputError("activation", siren.activation, rule, f"train with --activation {SINE}")
    if isinstance(siren, Whole):
        raise InputError("network to be rounded", NO_VALUE, "is rounded already", "use it as it is")
    if amplitude not in SINES:
        rule = "must be the largest value of an integer sine"
        raise InputError("amplitude", amplitude, rule, f"choose one of {', '.join(map(str, SINES))}")
    n_in = siren.widths[0]
    if size < 1 or n_in % (size * size) or n_in > MOST_INPUTS or max(siren.widths[1:]) > MOST_INPUTS:
        rule = (
            f"layers take at most {MOST_INPUTS} numbers, the first one {size} x {size} taps of each channel"
        )
        raise InputError("widths", siren.widths, rule, "give the model's window, or a smaller network")


def real(network: Whole, near: Siren) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Return weights and biases, float64, of the network that computes the same without rounding.

    Of the angles that a phase may be, each bias is the one nearest to that of `near`, which was rounded.
    Factors that have wrapped stand for their remainder: what is between both is another angle.
    """
    weights, biases = [], []
    last = len(network.weights) - 1
    for layer in range(last + 1):
        unit = _unit(near, layer, network.fraction)
        largest = network.amplitude if layer else INPUT_LEVELS
        factor, bias = (array[layer].astype(np.float64) for array in (network.factors, network.biases))
        weights.append(network.weights[layer].astype(np.float64) * factor[:, None] * (largest / unit))
        if layer == last:
            bias = bias - 2.0**network.fraction / 2
        else:
            wanted = near.biases[layer].astype(np.float64) * unit
            bias = bias + TURN * np.rint((wanted - bias) / TURN)
        biases.append(bias / unit)
    return tuple(weights), tuple(biases)


# ---- what must hold ---------------------------------------------------------------------------------------


def check_whole(network: Whole) -> None:
    """Refuse a network some number of which is not whole, or may leave what holds it, whatever the order."""
    for what, value, rule in _faults(network):
        raise InputError(what, value, rule, "round the trained model again")


def _faults(network: Whole) -> Iterator[tuple[str, object, str]]:
    """Yield each thing that is not as it must be: what, its value, the rule."""
    if network.amplitude not in SINES:
        yield "amplitude", network.amplitude, f"must be one of {', '.join(map(str, SINES))}"
        return
    if not 0 <= network.fraction <= MOST_FRACTION:
        yield "fraction", network.fraction, f"must be from 0 to {MOST_FRACTION}"
        return
    last = len(network.weights) - 1
    if len(network.factors) != last + 1 or network.activation != SINE:
        yield "factors", len(network.factors), f"must be those of {last + 1} layers of sines"
        return
    for layer, (weight, bias, factor) in enumerate(
        zip(network.weights, network.biases, network.factors, strict=True)
    ):
        if factor.shape != bias.shape:
            yield f"layer {layer}: shape of the factors", factor.shape, f"must be {bias.shape}"
            return
        least = -EXACT if layer == last else 0
        for name, array, low, high in (
            ("weights", weight, -WEIGHT_LEVELS, WEIGHT_LEVELS),
            ("biases", bias, least, EXACT - 1),
            ("factors", factor, 0, EXACT - 1),
        ):
            # Written so that NaN counts.
            wrong = array[~((array >= low) & (array <= high) & (array == np.floor(array)))]
            if wrong.size:
                yield f"layer {layer}: {name}", wrong[0].item(), f"integers from {low} to {high}"
                return
        sums = largest_sums(network, layer)
        if not sums.max() < EXACT:
            yield f"layer {layer}: largest sum", int(sums.max()), f"must be below {EXACT}: float32 is exact"
        reach = sums * factor.astype(np.float64) + np.abs(bias.astype(np.float64))
        if layer == last and not reach.max() <= LARGEST_INT:
            yield f"layer {layer}: largest colour", int(reach.max()), f"must be at most {LARGEST_INT}"


def largest_sums(network: Whole, layer: int) -> Array:
    """Return the largest magnitude (D_out,) of a partial sum of each row of a layer, in any order."""
    inputs = network.amplitude if layer else INPUT_LEVELS
    total: Array = inputs * np.abs(network.weights[layer].astype(np.float64)).sum(axis=1)
    return total
