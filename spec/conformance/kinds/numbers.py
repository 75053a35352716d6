"""Kinds of single numbers: the random generator, encodings, the sine, Adam."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....compiler.core import sine
from ....refimpl import encoding, rng
from ....refimpl.light import sobol
from ....refimpl.network import adam
from ..case import Case, Kind, Output
from ..functions import Field, Function, drawn

LAST = 2**32 - 1
"""Largest counter."""

COUNTERS = ("seed", "pixel", "sample", "block")
"""Inputs of a block of random numbers, in the order of `refimpl/rng.py: random_block`."""


def _block(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the words and floats of a block."""
    seed, pixel, sample, block = (rng.counter(int(inputs[name])) for name in COUNTERS)
    words = rng.random_block(seed, pixel, sample, block)
    floats = rng.uniforms(seed, pixel, sample, block, np.float64)
    return {"words": [int(w[0]) for w in words], "floats": np.array([f[0] for f in floats])}


def _blocks() -> list[Case]:
    """Return blocks at the ends of the counters, one counter at a time, and others."""
    rows: list[tuple[str, tuple[int, ...]]] = [
        ("zeros", (0, 0, 0, 0)),
        ("all at their end: products wrap", (LAST,) * 4),
    ]
    rows += [(f"only {name} at its end", tuple(LAST * (name == n) for n in COUNTERS)) for name in COUNTERS]
    rows += [
        ("the order of the counters matters", (9, 10, 11, 12)),
        ("pixel (1, 2)", (7, 1 + 65536 * 2, 0, 0)),
    ]
    rows += [("", tuple(int(u * 2**32) for u in drawn("random.block", i, 4))) for i in range(8)]
    found = []
    for index, (note, values) in enumerate(rows):
        inputs = dict(zip(COUNTERS, values, strict=True))
        expected = {name: Output(value, clause=OF_BLOCK[name]) for name, value in _block(inputs).items()}
        found.append(Case(f"random.block/{index}", "RNG-3", inputs, expected, (), note))
    return found


OF_BLOCK = {"words": "", "floats": "RNG-6"}
"""Clauses of the outputs of a block where they are not the block's."""


def word_kind(
    name: str, title: str, clause: str, inputs: Mapping[str, str], count: int, call: Callable[..., Any]
) -> Kind:
    """Return a kind of words of 32 bits: `call` maps arrays of one word each to a list of `count` words."""

    def answer(given: Mapping[str, Any]) -> dict[str, Any]:
        words = call(*(rng.counter(int(given[name])) for name in inputs))
        return {"words": [int(word[0]) for word in words]}

    def cases() -> list[Case]:
        ends = [(n,) * len(inputs) for n in (0, LAST, 1)]
        rows = [*ends, *(tuple(map(int, drawn(name, i, len(inputs)) * 2**32)) for i in range(6))]
        given = [dict(zip(inputs, row, strict=True)) for row in rows]
        return [
            Case(f"{name}/{index}", clause, one, {"words": Output(answer(one)["words"])})
            for index, one in enumerate(given)
        ]

    return Kind(name, title, inputs, {"words": f"integer[{count}] below 2^32"}, cases, answer)


WORD = "integer below 2^32"
"""What a word is, for the page."""

HASH = word_kind("random.pcg4d", "The hash of four words", "RNG-2", dict.fromkeys("xyzw", WORD), 4, rng.pcg4d)
"""PCG4D."""

SCRAMBLED = word_kind(
    "random.scrambled",
    "A fraction of 2^32 under the permutation that a key names",
    "SOB-2",
    {"fraction": WORD, "key": WORD},
    1,
    lambda fraction, key: [sobol.scramble(fraction, key)],
)
"""Owen's scrambling."""

POINT = word_kind(
    "random.point",
    "A Sobol point, not scrambled, as fractions of 2^32",
    "SOB-1",
    {"index": WORD},
    4,
    lambda index: [sobol.sobol(index, dimension) for dimension in range(4)],
)
"""Sobol's points."""


def _float(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the float of a word."""
    return {"float": np.float64(rng.uniform_floats(rng.counter(int(inputs["word"])), np.float64)[0])}


def _floats() -> list[Case]:
    """Return words at the ends, around the bits that count, and others."""
    words = [0, 255, 256, LAST, LAST - 255, *(int(u * 2**32) for u in drawn("random.float", 0, 4))]
    return [
        Case(f"random.float/{i}", "RNG-5", {"word": word}, {"float": Output(_float({"word": word})["float"])})
        for i, word in enumerate(words)
    ]


FLOAT = Kind(
    "random.float", "A word as a float", {"word": WORD}, {"float": "float in [0, 1)"}, _floats, _float
)
"""24 bits of a word."""

BLOCK = Kind(
    "random.block",
    "A block of random numbers",
    dict.fromkeys(COUNTERS, "integer below 2^32"),
    {"words": "integer[4] below 2^32", "floats": "float[4] in [0, 1)"},
    _blocks,
    _block,
)
"""Four words and four floats of four counters."""


def _sobol(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the floats of a block of scrambled Sobol points."""
    seed, pixel, sample, block = (rng.counter(int(inputs[name])) for name in COUNTERS)
    floats = sobol.uniforms(seed, pixel, sample, block, np.float64)
    return {"floats": np.array([f[0] for f in floats])}


def _sobol_blocks() -> list[Case]:
    """Return blocks of a pixel's first samples, at the ends of the counters, and others."""
    rows: list[tuple[str, tuple[int, ...]]] = [("", (3, 65536, sample, 1)) for sample in range(6)]
    rows += [("all at their end", (LAST,) * 4), ("half of all samples", (0, 0, 2**31, 0))]
    rows += [("", tuple(int(u * 2**32) for u in drawn("random.sobol", i, 4))) for i in range(4)]
    found = []
    for index, (note, values) in enumerate(rows):
        inputs = dict(zip(COUNTERS, values, strict=True))
        expected = {name: Output(value) for name, value in _sobol(inputs).items()}
        found.append(Case(f"random.sobol/{index}", "SOB-3", inputs, expected, (), note))
    return found


SOBOL = Kind(
    "random.sobol",
    "A block of scrambled Sobol points",
    dict.fromkeys(COUNTERS, "integer below 2^32"),
    {"floats": "float[4] in [0, 1)"},
    _sobol_blocks,
    _sobol,
)
"""Four floats of four counters."""


def _scalar(u: np.ndarray, low: float, high: float) -> float:
    """Return the first of uniform numbers, stretched to a range."""
    return float(low + (high - low) * u[0])


TRANSFER = Function(
    "encoding.srgb",
    "Linear values in [0, 1] by the transfer function of sRGB",
    "ENC-1",
    {"linear": Field("linear value", 0, -1.0, 1.0)},
    {"encoded": Field("encoded value in [0, 1]; of a negative one on the straight part")},
    lambda given, dtype: {"encoded": encoding.srgb_encode(given["linear"])},
    [
        ("black", {"linear": 0.0}),
        ("white", {"linear": 1.0}),
        ("where the line meets the curve, below", {"linear": 0.0031308}),
        ("where the line meets the curve, above", {"linear": 0.0031309}),
        ("below black", {"linear": -0.5}, "ENC-3"),
    ],
    lambda u: {"linear": u[0]},
)
"""The transfer function by itself."""


def _exposed(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return exposed radiance."""
    stops = float(inputs["exposure_stops"])
    return {"exposed": np.float64(encoding.expose(np.asarray(inputs["linear"], np.float64), stops))}


def _exposures() -> list[Case]:
    """Return stops of either sign, whole and not."""
    rows = ((0.5, 0.0), (0.5, 1.0), (0.75, -2.0), (3.0, 0.5), (0.1875, -1.25), (0.0, 64.0), (2.0, -64.0))
    found = []
    for index, (linear, stops) in enumerate(rows):
        inputs = {"linear": linear, "exposure_stops": stops}
        value = _exposed(inputs)["exposed"]
        expected = {"exposed": Output(value, 2.0**-22 * value, "a power, rounded to float32, and a product")}
        found.append(Case(f"encoding.exposed/{index}", "ENC-4", inputs, expected))
    return found


EXPOSED = Kind(
    "encoding.exposed",
    "Linear radiance, exposed",
    {"linear": "float", "exposure_stops": "float"},
    {"exposed": "float"},
    _exposures,
    _exposed,
)
"""Exposure."""

SRGB = Function(
    "encoding.display",
    "Linear radiance to display-encoded colour",
    "ENC-5",
    {"linear": Field("linear radiance", 0, -1.0, 1e6)},
    {"encoded": Field("display-encoded colour in [0, 1]")},
    lambda given, dtype: {"encoded": encoding.to_display(given["linear"])},
    [
        ("black", {"linear": 0.0}),
        ("below black: clipped", {"linear": -0.5}),
        ("white", {"linear": 1.0}),
        ("a firefly: clipped", {"linear": 1e6}),
        ("where the line meets the curve, below", {"linear": 0.0031308}),
        ("where the line meets the curve, above", {"linear": 0.0031309}),
        ("least normal number", {"linear": 2.0**-126}),
    ],
    lambda u: {"linear": _scalar(u, 0.0, 1.2)},
)
"""The transfer function with its clip."""


def _shown(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return exposed and display-encoded radiance."""
    linear = np.asarray(inputs["linear"], np.float64)
    return {"encoded": np.float64(encoding.to_display(linear, float(inputs["exposure_stops"])))}


def _displays() -> list[Case]:
    """Return radiance that exposure brings into the range, or out of it at either end."""
    rows = (
        ("clipped after it is exposed: 1 is not white", 4.0, -3.0),
        ("exposed beyond white", 0.25, 3.0),
        ("exposed to white", 0.25, 2.0),
        ("below black", -0.5, 3.0),
        ("below black, darker", -8.0, -3.0),
        ("onto the line at black", 0.5, -8.0),
        ("from the line to the curve", 0.001953125, 6.0),
        ("a fraction of a stop", 0.375, 0.5),
        ("a firefly of which exposure leaves little", 1024.0, -11.5),
    )
    found = []
    for index, (note, linear, stops) in enumerate(rows):
        inputs = {"linear": linear, "exposure_stops": stops}
        light = np.float64(np.float32(_exposed(inputs)["exposed"]))
        value = _shown(inputs)["encoded"]
        # Near a number the encoding grows by at most its own share: slope times x over value is at most 1.
        bound = SRGB.bounded({"linear": light})[0]["encoded"].bound + 2.0**-22 * value
        expected = {"encoded": Output(value, bound, "those of encoding.exposed and of encoding.display")}
        found.append(Case(f"encoding.shown/{index}", "ENC-5", inputs, expected, (), note))
    return found


SHOWN = Kind(
    "encoding.shown",
    "Linear radiance, exposed and display-encoded",
    {"linear": "float", "exposure_stops": "float"},
    {"encoded": "float in [0, 1]"},
    _displays,
    _shown,
)
"""Exposure, clip and transfer function, one after another."""


def _adam(given: Mapping[str, Any], dtype: Any) -> dict[str, Any]:
    """Return parameter and moments after a step."""
    grown = (given["growth_1"], given["growth_2"])
    theta, g, m, v = (given[name] for name in ("theta", "g", "m", "v"))
    theta, m, v = adam.update(theta, g, m, v, given["learning_rate"], grown)
    return {"theta": theta, "m": m, "v": v}


def _step(theta: float, g: float, m: float, v: float, t: int, rate: float = 1e-3) -> dict[str, float]:
    """Return the inputs of a step."""
    first, second = adam.growth(t)
    names = ("theta", "g", "m", "v", "learning_rate", "growth_1", "growth_2")
    return dict(zip(names, (theta, g, m, v, rate, first, second), strict=True))


ADAM = Function(
    "adam.step",
    "One parameter through one step of Adam",
    "ADM-1",
    {
        "theta": Field("parameter", 0, -1.0, 1.0),
        "g": Field("derivative of the loss", 0, -1e6, 1e6),
        "m": Field("mean of derivatives", 0, -1.0, 1.0),
        "v": Field("mean of their squares"),
        "learning_rate": Field("step length"),
        "growth_1": Field("1 - beta_1^t", 0, 0.09),
        "growth_2": Field("1 - beta_2^t", 0, 0.0009),
    },
    {
        "theta": Field("parameter after the step"),
        "m": Field("mean after it"),
        "v": Field("mean of squares after it"),
    },
    _adam,
    [
        ("first step: the learning rate, whatever the gradient", _step(1.0, 0.5, 0.0, 0.0, 1)),
        ("no gradient yet: nothing moves, nothing divides 0 by 0", _step(1.0, 0.0, 0.0, 0.0, 1)),
        (
            "gradient of the size of epsilon: half a step; epsilon is outside the root",
            _step(0.0, 1e-8, 0.0, 0.0, 1),
        ),
        ("step 20,000: bias correction has faded", _step(0.3, -0.01, 0.02, 0.003, 20_000)),
        ("large gradient", _step(0.3, 1e6, 0.0, 0.0, 1)),
    ],
    lambda u: _step(2 * u[0] - 1, 2 * u[1] - 1, u[2] - 0.5, u[3], 1 + int(100 * u[4])),
)
"""The update of one number."""

LARGEST = float(np.nextafter(np.float32(sine.DOMAIN), np.float32(0)))
"""Largest argument of the sine in these cases: the last float32 below the end of its domain."""

SINE = Function(
    "sine",
    "The emitted sine",
    "PRO-4",
    {"x": Field("radians, |x| < 12,800", 0, -LARGEST, LARGEST)},
    {"sin": Field("sine, in [-1, 1]")},
    lambda given, dtype: {"sin": np.sin(given["x"])},
    [
        ("zero", {"x": 0.0}),
        ("least denormal number", {"x": 2.0**-149}),
        ("float32 nearest to pi", {"x": np.float32(np.pi)}),
        ("float32 nearest to pi / 2", {"x": np.float32(np.pi / 2)}),
        (
            "float32 nearest to 710 pi: few multiples of pi are so near a float",
            {"x": np.float32(710 * np.pi)},
        ),
        ("last float32 in the domain", {"x": LARGEST}),
        ("first one", {"x": -LARGEST}, "SIN-1"),
        *(
            (f"{x:g}: its multiple of pi is rounded down", {"x": x}, "SIN-1")
            for x in (-1.5, -1.75, -3.0, -4.5, -5.0, 1.5, 1.75, 4.5, 5.0)
        ),
    ],
    lambda u: {"x": _scalar(u, -100.0, 100.0)},
)
"""The sine of the network; its contract is the emitted sine's."""

KINDS = (HASH, FLOAT, BLOCK, SCRAMBLED, POINT, SOBOL, EXPOSED, SHOWN)
"""Kinds of this module that are not functions of floats."""

FUNCTIONS = (TRANSFER, SRGB, SINE, ADAM)
"""Those that are."""
