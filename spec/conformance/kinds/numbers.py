"""Kinds of single numbers: the random generator, encodings, the sine, Adam."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ....refimpl import encoding, rng
from ....refimpl.light import sobol
from ....refimpl.network import adam
from ..case import Case, Kind, Output, exact
from ..functions import drawn
from .tables import WORDS, direct, kind

# ---- random numbers ---------------------------------------------------------------------------------------


def _words(
    name: str,
    clause: str,
    call: Callable[..., Any],
    draws: int = 6,
    clauses: Mapping[str, str] = MappingProxyType({}),
) -> Kind:
    """Return a kind of counters: `call` maps arrays of one each to the numbers of each output, also such."""
    row = WORDS[name]

    def answer(given: Mapping[str, Any]) -> dict[str, Any]:
        found = call(*(rng.counter(int(given[key])) for key in row["inputs"]))
        one = [np.array([part[0] for part in parts]) for parts in found]
        one = [numbers[0] for numbers in one] if name == "random.float" else one
        return dict(zip(row["outputs"], one, strict=True))

    def cases() -> list[Case]:
        size = len(row["inputs"])
        some = [("", map(int, drawn(name, index, size) * 2**32)) for index in range(draws)]
        given = [(note, dict(zip(row["inputs"], n, strict=True))) for note, n in [*row["given"], *some]]
        blamed: Callable[[str], str] = lambda key: clauses.get(key, "")  # noqa: E731
        return [Case(clause, one, exact(answer(one), clause=blamed), note) for note, one in given]

    return kind(name, cases, answer)


def _block(seed: Any, pixel: Any, sample: Any, block: Any) -> tuple[Any, Any]:
    """Return the words and floats of a block."""
    floats = rng.uniforms(seed, pixel, sample, block, np.float64)
    return rng.random_block(seed, pixel, sample, block), floats


def _sobol(seed: Any, pixel: Any, sample: Any, block: Any) -> tuple[Any]:
    """Return the floats of a block of scrambled Sobol points."""
    return (sobol.uniforms(seed, pixel, sample, block, np.float64),)


WORD_KINDS = (
    _words("random.pcg4d", "RNG-2", lambda *words: (rng.pcg4d(*words),)),
    _words("random.float", "RNG-5", lambda word: ([rng.uniform_floats(word, np.float64)],), draws=0),
    _words("random.block", "RNG-3", _block, 8, {"floats": "RNG-6"}),
    _words("random.scrambled", "SOB-2", lambda fraction, key: ([sobol.scramble(fraction, key)],)),
    _words("random.point", "SOB-1", lambda index: ([sobol.sobol(index, axis) for axis in range(4)],)),
    _words("random.sobol", "SOB-3", _sobol, draws=4),
)
"""Kinds of counters and words of 32 bits."""

# ---- functions --------------------------------------------------------------------------------------------


def _step(theta: float, g: float, m: float, v: float, t: int) -> dict[str, float]:
    """Return the inputs of a step of Adam."""
    first, second = adam.growth(t)
    return {"theta": theta, "g": g, "m": m, "v": v, "growth_1": first, "growth_2": second}


FUNCTIONS = (
    direct("encoding.srgb", encoding.srgb_encode, lambda u: {"linear": u[0]}),
    direct("encoding.display", encoding.to_display, lambda u: {"linear": float(1.2 * u[0])}),
    direct("sine", np.sin, lambda u: {"x": float(200.0 * u[0] - 100.0)}),
    direct(
        "adam.step",
        lambda theta, g, m, v, rate, *grown: adam.update(theta, g, m, v, rate, grown),
        lambda u: _step(2 * u[0] - 1, 2 * u[1] - 1, u[2] - 0.5, u[3], 1 + int(100 * u[4])),
    ),
)
"""Kinds that are functions of floats; the contract of the sine is the emitted sine's."""

# ---- exposure ---------------------------------------------------------------------------------------------


def _exposed(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return exposed radiance."""
    stops = float(inputs["exposure_stops"])
    return {"exposed": np.float64(encoding.expose(np.asarray(inputs["linear"], np.float64), stops))}


def _exposures() -> list[Case]:
    """Return stops of either sign, whole and not."""
    found = []
    for linear, stops in WORDS["encoding.exposed"]["given"]:
        inputs = {"linear": linear, "exposure_stops": stops}
        value = _exposed(inputs)["exposed"]
        expected = {"exposed": Output(value, 2.0**-22 * value, "a power, rounded to float32, and a product")}
        found.append(Case("ENC-4", inputs, expected))
    return found


def _shown(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return exposed and display-encoded radiance."""
    linear = np.asarray(inputs["linear"], np.float64)
    return {"encoded": np.float64(encoding.to_display(linear, float(inputs["exposure_stops"])))}


def _displays() -> list[Case]:
    """Return radiance that exposure brings into the range, or out of it at either end."""
    found, display = [], FUNCTIONS[1]
    for note, linear, stops in WORDS["encoding.shown"]["given"]:
        inputs = {"linear": linear, "exposure_stops": stops}
        light = np.float64(np.float32(_exposed(inputs)["exposed"]))
        value = _shown(inputs)["encoded"]
        # Near a number the encoding grows by at most its own share: slope times x over value is at most 1.
        bound = display.bounded({"linear": light})[0]["encoded"].bound + 2.0**-22 * value
        expected = {"encoded": Output(value, bound, "those of encoding.exposed and of encoding.display")}
        found.append(Case("ENC-5", inputs, expected, note))
    return found


KINDS = (
    *WORD_KINDS,
    kind("encoding.exposed", _exposures, _exposed),
    kind("encoding.shown", _displays, _shown),
)
"""Kinds of this module that are not functions of floats."""
