"""Kinds of single numbers: the random generator, encodings, the sine, Adam."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....refimpl import encoding, rng
from ....refimpl.light import sobol
from ....refimpl.network import adam
from ..case import Kind, within
from .tables import ROWS, function, kind

FUNCTIONS = (
    function("encoding.srgb", encoding.srgb_encode),
    function("encoding.display", encoding.to_display),
    function("sine", np.sin),
    function("adam.step", lambda theta, g, m, v, rate, *grown: adam.update(theta, g, m, v, rate, grown)),
)
"""Kinds that are functions of floats; the contract of the sine is the emitted sine's."""


def _words(name: str, call: Callable[..., Any]) -> Kind:
    """Return a kind of counters: `call` maps arrays of one each to the numbers of each output, also such."""
    row = ROWS["kinds"][name]

    def answer(given: Mapping[str, Any]) -> dict[str, Any]:
        found = call(*(rng.counter(int(given[key])) for key in row["inputs"]))
        one = [np.array([part[0] for part in parts]) for parts in found]
        one = [numbers[0] for numbers in one] if name == "random.float" else one
        return dict(zip(row["outputs"], one, strict=True))

    return kind(name, answer)


def _block(seed: Any, pixel: Any, sample: Any, block: Any) -> tuple[Any, Any]:
    """Return the words and floats of a block."""
    floats = rng.uniforms(seed, pixel, sample, block, np.float64)
    return rng.random_block(seed, pixel, sample, block), floats


def _exposed(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return exposed radiance."""
    stops = float(inputs["exposure_stops"])
    return {"exposed": np.float64(encoding.expose(np.asarray(inputs["linear"], np.float64), stops))}


def _shown(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return exposed and display-encoded radiance."""
    linear = np.asarray(inputs["linear"], np.float64)
    return {"encoded": np.float64(encoding.to_display(linear, float(inputs["exposure_stops"])))}


def _bound_of_shown(inputs: Mapping[str, Any], value: Any) -> Any:
    """Return the bound of encoded radiance.

    Near a number the encoding grows by at most its own share: slope times x over value is at most 1."""
    light = np.float64(np.float32(_exposed(inputs)["exposed"]))
    return FUNCTIONS[1].bounded({"linear": light})["encoded"].bound + 2.0**-22 * value


KINDS = (
    _words("random.pcg4d", lambda *words: (rng.pcg4d(*words),)),
    _words("random.float", lambda word: ([rng.uniform_floats(word, np.float64)],)),
    _words("random.block", _block),
    _words("random.scrambled", lambda fraction, key: ([sobol.scramble(fraction, key)],)),
    _words("random.point", lambda index: ([sobol.sobol(index, axis) for axis in range(4)],)),
    _words("random.sobol", lambda s, p, n, b: (sobol.uniforms(s, p, n, b, np.float64),)),
    kind(
        "encoding.exposed",
        _exposed,
        within(lambda inputs, value: 2.0**-22 * value, "a power, rounded to float32, and a product"),
    ),
    kind(
        "encoding.shown",
        _shown,
        within(_bound_of_shown, "those of encoding.exposed and of encoding.display"),
    ),
)
"""Kinds of counters and words of 32 bits, and of exposure."""
