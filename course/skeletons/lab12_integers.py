"""A layer in which no operation rounds.

Sums of integers are exact in float32 as long as no partial sum reaches 2^24: say how large one can be. A
phase is an angle in units of a turn / 2^24; words of 32 bits that wrap keep it exact, however large the angle
is. The sine folds a phase to a quarter turn and evaluates a polynomial in products below 2^32 and shifts.
Tutorial: page 10. Clauses: WHO-3, WHO-4, WHO-5.

All but `largest_sums` are traced, and the compiler proves that nothing rounds. It has rules for +, -, *, @,
>>, &, ^, np.minimum, np.maximum and .astype of float32, int32 and uint32. A float becomes uint32 by way of
int32: a float below 0 that becomes uint32 at once is undefined in many languages.
"""

from __future__ import annotations

from typing import Any

SINES = {127: ((51053, 20871, 2332), 24), 511: ((51355, 20996, 2347), 22)}
"""By amplitude: c1, c3 and c5, and the last shift s."""


def largest_sums(weights: Any, most: int) -> Any:
    """Return the largest magnitude (D_out,) of a partial sum of each row of integer weights (D_out, D_in).

    The inputs are any integers in [-most, most], and the sum has any order.
    """
    raise NotImplementedError("largest_sums")


def phase(sums: Any, factor: Any, bias: Any) -> Any:
    """Return sums * factor + bias (..., D) as words, uint32, that wrap.

    sums (..., D), float32, are integers below 2^24 in magnitude; factor and bias (D,), float32, are integers
    in [0, 2^24).
    """
    raise NotImplementedError("phase")


def sine(phases: Any, amplitude: int) -> Any:
    """Return the integers (...) near amplitude * sin(2 pi phases / 2^24), as float32, of phases in uint32."""
    raise NotImplementedError("sine")


def layer(weights: Any, factor: Any, bias: Any, amplitude: int, numbers: Any) -> Any:
    """Return the integers (..., D_out), as float32, of a hidden layer, from those before it (..., D_in).

    weights (D_out, D_in), factor (D_out,) and bias (D_out,) are float32.
    """
    raise NotImplementedError("layer")
