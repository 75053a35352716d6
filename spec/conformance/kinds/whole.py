"""Kinds of networks of integers: inputs, the sine, a network layer by layer, rounding. Every bound is 0."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl.network import dataset, siren, whole
from ....refimpl.network.dataset import Window
from ....refimpl.network.siren import Siren
from ....refimpl.network.whole import (
    EXACT,
    INPUT_LEVELS,
    LARGEST_INT,
    MOST_INPUTS,
    SINES,
    TURN,
    WEIGHT_LEVELS,
    Whole,
)
from ..case import Case, Output
from ..case import exact as exactly
from ..functions import drawn
from .network import as_inputs, network_of
from .tables import kind

Array = NDArray[Any]

SOURCE = "integers: no operation rounds"
"""Where the bound 0 comes from."""

PARTS = ("weight", "factor", "bias")
"""The arrays of a layer, as inputs name them."""


def exact(outputs: Mapping[str, Any]) -> dict[str, Output]:
    """Return what is expected, to the bit, and what a deviation is blamed on."""
    return exactly(outputs, SOURCE, blamed)


def blamed(name: str) -> str:
    """Return the clause that an output follows from, "" for that of the case."""
    if name.startswith("layer_"):
        return "WHO-4"
    own = {"color": "WHO-6", "weight_0": "WHO-8", "n": "", "value": ""}
    return own.get(name, "WHO-7")


def integers(values: Array) -> Array:
    """Return whole floats (...) as integers."""
    return np.asarray(values).astype(np.int64)


# ---- inputs and the sine ----------------------------------------------------------------------------------


def _input(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of encoded features."""
    return {"n": integers(whole.round_image(np.asarray(inputs["x"], np.float32)))}


def _input_cases() -> list[Case]:
    """Return ties with their neighbours, the ends, tiny numbers and others."""
    ties = ((np.array([-127, -64, -1, 0, 1, 63, 126]) + 0.5) / INPUT_LEVELS).astype(np.float32)
    rows: dict[str, Array] = {
        "ties": ties,
        "just below ties": np.nextafter(ties, np.float32(-2)),
        "just above ties": np.nextafter(ties, np.float32(2)),
        "ends, zeros and denormal numbers": np.array(
            [-1.0, 1.0, 0.0, -0.0, 1e-45, -1e-45, 2.0**-9], np.float32
        ),
        "": (2.0 * drawn("whole.input", 0, 12) - 1.0).astype(np.float32),
    }
    halves = (np.arange(-INPUT_LEVELS, INPUT_LEVELS) + 0.5) / INPUT_LEVELS
    moved = halves[whole.round_image(halves) != whole.round_image(halves.astype(np.float32))]
    rows["ties of float64, which float32 moves to the integer below or above"] = moved
    given = [(note, {"x": x.astype(np.float64)}) for note, x in rows.items()]
    return [Case("WHO-2", inputs, exact(_input(inputs)), note) for note, inputs in given]


def _sine(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of phases."""
    phases = np.asarray(inputs["phase"], np.float64).astype(np.uint32)
    return {"value": integers(whole.whole_sine(phases, int(inputs["amplitude"])))}


def _sine_cases() -> list[Case]:
    """Return phases at the ends of each quarter, of words, at roundings, and others."""
    quarter = TURN // 4
    ends = np.array([[k * quarter - 1, k * quarter, k * quarter + 64] for k in range(1, 5)]).ravel()
    rows: list[tuple[str, Array]] = [
        ("ends of quarters", ends),
        ("words beyond a turn: the upper bits mean nothing", np.array([2**24, 2**31, 2**32 - 1, 0xABCDEF01])),
        ("steps of 64 phases", np.array([63, 64, 127, 128, 2**22 - 65, 2**22 - 64])),
        ("", (drawn("whole.sine", 0, 24) * 2**32).astype(np.uint64)),
    ]
    found: list[Case] = []
    for amplitude in SINES:
        for note, phase in [*rows, ("both sides of all steps of a quarter", _steps(amplitude))]:
            inputs = {"amplitude": amplitude, "phase": phase.astype(np.int64)}
            found.append(Case("WHO-5", inputs, exact(_sine(inputs)), note))
    return found


def _steps(amplitude: int) -> Array:
    """Return the last phase of each step of a quarter, and the first phase of the next."""
    values = whole.whole_sine(np.arange(0, TURN // 4, 64).astype(np.uint32), amplitude)
    first = 64 * (1 + np.flatnonzero(np.diff(values)))
    return np.stack((first - 1, first), axis=-1).ravel()


# ---- networks ---------------------------------------------------------------------------------------------


def _network(index: int) -> Whole:
    """Return the network of a case: of 8 bits or 10, with a large omega_0 in one, without a hidden layer."""
    widths, omega, amplitude = (
        ([8, 6, 5, 3], 3.0, 127),
        ([8, 6, 5, 3], 1e6, 127),
        ([12, 4, 3], 9.0, 511),
        ([4, 3], 1.0, 127),
    )[index]
    return whole.rounded(siren.init(widths, omega, omega, seed=index), 2, amplitude)


def _inputs_of(network: Whole) -> dict[str, Any]:
    """Return a network as inputs of a case."""
    found: dict[str, Any] = {"amplitude": network.amplitude, "fraction": network.fraction}
    for name, arrays in zip(PARTS, (network.weights, network.factors, network.biases), strict=True):
        found |= {f"{name}_{layer}": integers(array) for layer, array in enumerate(arrays)}
    return found


def network_from(inputs: Mapping[str, Any]) -> Whole:
    """Return the network of a case, or refuse it."""
    count = sum(name.startswith("weight_") for name in inputs)
    given = [[np.asarray(inputs[f"{name}_{layer}"], np.float64) for layer in range(count)] for name in PARTS]
    fields = {name: int(inputs[name]) for name in ("amplitude", "fraction")}

    def network(dtype: type[np.floating[Any]]) -> Whole:
        weights, factors, biases = (tuple(array.astype(dtype) for array in arrays) for arrays in given)
        return Whole(weights, biases, 1.0, 1.0, factors=factors, **fields)  # type: ignore[arg-type]

    whole.check_whole(network(np.float64))  # float32 rounds what is beyond the limits to what is not
    return network(np.float32)


def layers(network: Whole, numbers: Any) -> dict[str, Any]:
    """Return the numbers of each hidden layer, and the colour; inputs (..., D_in) may be traced."""
    hidden = whole.sine_layers(network, numbers, len(network.weights) - 1)
    found = {f"layer_{layer}": values for layer, (_, values) in enumerate(hidden)}
    return {**found, "color": whole.forward_whole(network, numbers)}


def _forward(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the integers of each hidden layer, and the colour."""
    found = layers(network_from(inputs), np.asarray(inputs["n"], np.float32))
    return {name: value if name == "color" else integers(value) for name, value in found.items()}


USUAL_NETWORKS, USUAL_ROWS = 4, 12
"""Networks that are at no limit, and the cases that they have: who refuses one has limits of its own."""


def _forward_cases() -> list[Case]:
    """Return networks at random inputs and at the ends; then some at limits, and some that are refused."""
    rows: list[tuple[str, str, Whole, Array]] = []
    for index in range(USUAL_NETWORKS):
        network = _network(index)
        n_in = network.widths[0]
        random = (drawn("whole.forward", index, n_in) * 255).astype(np.int64) - INPUT_LEVELS
        rows += [
            ("a million turns a layer" if index == 1 else "", "WHO-6", network, random),
            ("all inputs at an end", "WHO-6", network, np.full(n_in, -INPUT_LEVELS)),
            ("black", "WHO-6", network, np.zeros(n_in, np.int64)),
        ]
    one, most, factor = _network(3), _at_the_limit(0.0), 2.0**24
    plain = _changed(fraction=0, factors=1.0, biases=np.array([5.0, -300.0, 2e4]))
    some, zeros = np.array([127, 90, -64, -5]), np.zeros(4)
    rows += [
        ("a hidden bias of 0", "WHO-1", _with_hidden_bias(0.0), np.full(8, 100)),
        ("a fraction of 5 digits", "WHO-6", replace(_network(0), fraction=5), np.full(8, 100)),
        ("a fraction of 0 digits", "WHO-6", plain, some),
        ("colours of 2^31 - 1", "WHO-6", most, np.full(4, INPUT_LEVELS)),
        ("colours of 1 - 2^31", "WHO-6", most, np.full(4, -INPUT_LEVELS)),
        ("the largest last bias", "WHO-1", _changed(biases=factor - 1.0), zeros),
        ("the largest factor", "WHO-1", _changed(weights=0, factors=factor - 1.0, biases=0), zeros),
        ("factors of 0", "WHO-1", _changed(factors=one.factors[0] * np.array([0.0, 1.0, 0.0])), some),
        ("the least last bias", "WHO-1", _changed(biases=-factor), zeros),
    ]
    refused: list[tuple[str, str, Whole]] = [
        ("a weight of 9 bits", "WHO-1", _changed(weights=WEIGHT_LEVELS + 1)),
        ("a weight of -128", "WHO-1", _changed(weights=-WEIGHT_LEVELS - 1)),
        ("a factor of 25 bits", "WHO-1", _changed(factors=factor)),
        ("rows of zeros with a factor of 25 bits", "WHO-1", _changed(weights=0, factors=factor, biases=0)),
        ("a factor below 0", "WHO-1", _changed(factors=-one.factors[0])),
        ("a factor of -1", "WHO-1", _changed(factors=np.array([1.0, -1.0, 1.0]))),
        ("a last bias of 2^24", "WHO-1", _changed(weights=0, factors=1, biases=factor)),
        ("a last bias of -2^24 - 1", "WHO-1", _changed(weights=0, factors=1, biases=-factor - 1)),
        ("a hidden bias below 0", "WHO-1", _with_hidden_bias(-1.0)),
        ("a hidden bias of a turn", "WHO-1", _with_hidden_bias(float(TURN))),
        ("sums of 2^24", "WHO-3", _wide()),
        ("colours beyond int32", "WHO-6", _changed(factors=factor - 1)),
        ("colours of 2^31", "WHO-6", _at_the_limit(1.0)),
        ("colours of -2^31", "WHO-6", _at_the_limit(-1.0)),
        ("an amplitude without a sine", "WHO-1", _changed(amplitude=128)),
        ("a fraction of 9 digits", "WHO-1", _changed(fraction=9)),
        ("a fraction below 0", "WHO-1", _changed(fraction=-1)),
    ]
    cases: list[Case] = []
    for note, clause, network, n in rows:
        inputs = {**_inputs_of(network), "n": integers(n)}
        refusal = "WHO-1" if len(cases) < USUAL_ROWS else ""
        cases.append(Case(clause, inputs, exact(_forward(inputs)), note, refusal))
    for note, clause, network in refused:
        inputs = {**_inputs_of(network), "n": np.zeros(network.widths[0], np.int64)}
        cases.append(Case(clause, inputs, None, note))
    return cases


def _changed(**changes: Any) -> Whole:
    """Return the network of one layer with other arrays, or ones of one number, and other facts."""
    one = _network(3)
    arrays: dict[str, Any] = {
        name: (np.broadcast_to(np.float64(changes.pop(name)), getattr(one, name)[0].shape),)
        for name in ("weights", "factors", "biases")
        if name in changes
    }
    return replace(one, **arrays, **changes)


def _at_the_limit(more: float) -> Whole:
    """Return a layer whose colours reach 2^31 - 1 in magnitude; the first bias is `more` farther from 0."""
    factor, rest = divmod(LARGEST_INT, INPUT_LEVELS * 4 * WEIGHT_LEVELS)
    sign = -1.0 if more < 0 else 1.0
    biases = np.array([sign * rest + more, -rest, rest - 7.0])
    return _changed(weights=WEIGHT_LEVELS, factors=factor, biases=biases)


def _with_hidden_bias(value: float) -> Whole:
    """Return the first network with another bias of a neuron."""
    network = _network(0)
    biases = [bias.copy() for bias in network.biases]
    biases[1][2] = value
    return replace(network, biases=tuple(biases))


def _wide() -> Whole:
    """Return a network of which one of the last sums may be 2^24; if all inputs agree, it is smaller."""
    last = np.full((3, 259), float(WEIGHT_LEVELS))
    last[:, 1::2] *= -1.0
    last[:, 0] = -(-EXACT // 511) - 258 * WEIGHT_LEVELS
    last[::2] = 0.0
    weights, ones = (np.ones((259, 1)), last), (np.ones(259), np.ones(3))
    return Whole(weights, tuple(0 * some for some in ones), 1.0, 1.0, factors=ones, amplitude=511)


# ---- rounding ---------------------------------------------------------------------------------------------


def _rounded(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a network in integers."""
    return _in_order(whole.rounded(network_of(inputs), int(inputs["size"]), int(inputs["amplitude"])))


def _in_order(network: Whole) -> dict[str, Any]:
    """Return what a network holds: first what the weights depend on, and those of the first layer last."""
    found = {name: value for name, value in _inputs_of(network).items() if name != "amplitude"}
    order = sorted(found, key=lambda name: (name.startswith("weight_"), name == "weight_0"))
    return {name: found[name] for name in order}


def _rounded_cases() -> list[Case]:
    """Return networks as they begin, and with what is hard to round; then some that are refused."""
    one = siren.init([8, 6, 5, 3], 3.0, 2.0, seed=5)
    zeros = [weight.copy() for weight in one.weights]
    zeros[0][1], zeros[1][2] = 0.0, 1e-42
    biases = (*one.biases[:2], np.array([1.0, -1.0, 0.25]))
    loud = _louder(one, 19200.0)
    loud = replace(loud, biases=(*one.biases[:2], np.array([5.25, -5.75, 100.0]) / 2.0**16))
    flat = siren.init([1, 264, 1], 3.0, 2.0, seed=7)
    ramp = np.sign(flat.weights[1]) * (1.0 - np.arange(264) / 2.0**13)
    flat = replace(flat, weights=(flat.weights[0], ramp))
    first = replace(siren.init([264, 1, 1], 3.0, 2.0, seed=7), weights=(ramp, np.array([[0.5]])))
    rows: list[tuple[str, str, Siren, int, int]] = [
        ("", "WHO-7", one, 2, 127),
        ("10 bits", "WHO-7", one, 2, 511),
        ("a row of zeros, one of denormals", "WHO-7", replace(one, weights=tuple(zeros)), 2, 127),
        ("factors that wrap", "WHO-7", replace(one, omega_0_first=1e9), 2, 127),
        ("colours that need a smaller fraction", "WHO-7", _louder(one, 300.0), 2, 127),
        ("errors are passed from tap to tap", "WHO-8", siren.init([27, 2, 3], 5.0, 2.0, seed=6), 3, 127),
        ("colours that need the fraction 0", "WHO-7", loud, 2, 127),
        ("biases that need a smaller fraction", "WHO-7", replace(one, biases=biases), 2, 127),
        ("a flat row: its sum limits the factor", "WHO-7", flat, 1, 511),
        ("inputs of 10 bits would be too large for the first layer", "WHO-3", first, 1, 511),
        ("a quotient that order moves across an integer", "WHO-7", _at_an_integer(), 2, 127),
        ("halves in the last layer, and integers as quotients", "WHO-7", _halves([4, 4, 3]), 2, 127),
        ("halves in one layer, the first and the last", "WHO-8", _halves([4, 3]), 2, 127),
        ("errors that would lead beyond 127", "WHO-8", _beyond(), 2, 127),
    ]
    refused: list[tuple[str, str, Siren, int, int]] = [
        ("colours beyond all fractions", "WHO-7", _louder(one, 1e6), 2, 127),
        ("an amplitude without a sine", "WHO-1", one, 2, 255),
        ("windows that the first layer does not have", "WHO-8", one, 3, 127),
        ("windows of no tap", "WHO-8", one, 0, 127),
    ]
    return [_rounded_case(*row, row in rows) for row in [*rows, *refused]] + _later_rounded()


def _later_rounded() -> list[Case]:
    """Return a row whose sum limits its factor, just above an integer, and layers of too many inputs."""
    flat = siren.init([1, 264, 1, 1], 3.0, 6.0, seed=7)
    ramp = np.sign(flat.weights[1]) * (1.0 - np.arange(264) / 2.0**13)
    flat = replace(flat, weights=(flat.weights[0], ramp, flat.weights[2]))
    loud = _louder(siren.init([8, 6, 5, 3], 3.0, 2.0, seed=5), 38400.0)
    most, odd = MOST_INPUTS, siren.init([6, 5, 3], 3.0, 2.0, seed=5)
    rows: list[tuple[str, Siren, int, int, bool]] = [
        ("a flat row: two steps for each weight", flat, 1, 511, True),
        (f"{most} inputs", _nothing(most, 1), 1, 127, True),
        (f"{most + 1} inputs", _nothing(most + 1, 1), 1, 127, False),
        (f"{most + 1} numbers in between", _nothing(1, most + 1, 1), 1, 127, False),
        ("6 inputs of a window of 2 x 2", odd, 2, 127, False),
        ("colours that would need the fraction -1", loud, 2, 127, False),
    ]
    return [
        _rounded_case(note, "WHO-7", network, size, amplitude, valid)
        for note, network, size, amplitude, valid in rows
    ]


def _rounded_case(note: str, clause: str, network: Siren, size: int, amplitude: int, valid: bool) -> Case:
    """Return a network to be rounded."""
    inputs = {**as_inputs(network), "size": size, "amplitude": amplitude}
    return Case(clause, inputs, exact(_rounded(inputs)) if valid else None, note)


def _nothing(*widths: int) -> Siren:
    """Return a network of zeros."""
    pairs = zip(widths[1:], widths, strict=False)
    weights: Any = tuple(np.zeros(pair, np.int64) for pair in pairs)
    biases: Any = tuple(np.zeros(width, np.int64) for width in widths[1:])
    return Siren(weights, biases, 1.0, 1.0)


def _louder(network: Siren, scale: float) -> Siren:
    """Return a network whose last weights are larger."""
    return replace(network, weights=(*network.weights[:-1], network.weights[-1] * np.float32(scale)))


def _at_an_integer() -> Siren:
    """Return a network where the least integers at least W (g / N) / 127 and W g / N / 127 differ."""
    network = siren.init([4, 2, 2, 3], 3.0, 2.0, seed=8)
    g = network.omega_0_hidden / (2.0 * np.pi) * TURN
    near = INPUT_LEVELS * WEIGHT_LEVELS * np.arange(1.0, 200.0) / g
    quotients = near * (g / INPUT_LEVELS) / WEIGHT_LEVELS, near * g / INPUT_LEVELS / WEIGHT_LEVELS
    wanted = near[np.ceil(quotients[0]) != np.ceil(quotients[1])][0]
    weights = [weight.astype(np.float64) for weight in network.weights]
    weights[1][0] = wanted, wanted / 2
    return replace(network, weights=tuple(weights))


def _halves(widths: Sequence[int]) -> Siren:
    """Return a network whose last layer has the factor 2, and multiples and biases that are halves."""
    network = siren.init(widths, 3.0, 2.0, seed=9)
    step = INPUT_LEVELS / 2.0**24
    last = np.array([[254.0, 1.0, 3.0, 5.0], [-1.0, -3.0, -5.0, -254.0], [7.0, 254.0, 13.0, -9.0]]) * step
    biases = np.array([0.5, 1.5, -2.5]) / 2.0**24
    return replace(network, weights=(*network.weights[:-1], last), biases=(*network.biases[:-1], biases))


def _beyond() -> Siren:
    """Return a network whose first layer passes errors of one sign to a tap of 127, which is rounded last."""
    network = siren.init([4, 2, 3], 1e6, 2.0, seed=10)
    row = np.array([100.45, 100.2, 127.0, 99.9]) / 1270.0
    return replace(network, weights=(np.stack((row, -row)), *network.weights[1:]))


# ---- on windows -------------------------------------------------------------------------------------------

CHOSEN = "integers: what is rounded is at least 2^-12 from a tie, and float64 is off by less than 2^-20"
"""Where the bound 0 comes from: the covariance has a condition of at most 100 D_in + 1 (WHO-14), so that any
way to solve for a dozen inputs is off by some 1e-9."""


def _rounded_on(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a network in integers that was rounded on windows."""
    windows = np.asarray(inputs["windows"], np.float64)
    size, amplitude = int(inputs["size"]), int(inputs["amplitude"])
    return _in_order(whole.rounded_on(network_of(inputs), windows, size, amplitude))


def _windows(index: int, network: Siren) -> Array:
    """Return the windows (32, D_in) of two frames of 4 x 4 pixels, smooth along the rows."""
    channels = network.widths[0] // 4
    steps = 2.0 * drawn("whole.rounded_on", index, 2 * 4 * 4 * channels).reshape(2, 4, 4, channels) - 1.0
    frames = np.clip(np.cumsum(steps, axis=2), -1.0, 1.0).astype(np.float32)
    padded = [dataset.all_windows(dataset.pad(f, Window(2)), Window(2)) for f in frames]
    return np.concatenate(padded).reshape(-1, network.widths[0]).astype(np.float64)


QUIET, BEYOND = 23, 4
"""Seeds of networks and windows, found by trying. With the first, inputs vary by 0.28 and 0.12 squared steps,
so that the 1 of WHO-14 decides; what is rounded is 0.047 from a tie. With the second, the largest weights are
127.7 and -127.5, 0.020 from a tie."""


def _rounded_on_cases() -> list[Case]:
    """Return networks of 8 and 10 bits, of one layer, with large colours; windows that hardly vary."""
    one = siren.init([8, 4, 3], 3.0, 3.0, seed=0)
    loud, quiet, beyond = (siren.init([8, 4, 3], 3.0, 3.0, seed=seed) for seed in (2, QUIET, BEYOND))
    wide, affine = siren.init([12, 4, 4, 3], 3.0, 3.0, seed=1), siren.init([8, 3], 3.0, 3.0, seed=2)
    flat = np.full((6, 8), 0.25) + np.float32(1 / 512) * np.eye(6, 8)
    steps = np.floor((1.0 + 0.25 * np.arange(8)) * drawn("whole.quiet", QUIET, 24 * 8).reshape(24, 8))
    few = (np.float32(0.25) + steps / np.float32(127)).astype(np.float32).astype(np.float64)
    rows: list[tuple[str, Siren, int, Array]] = [
        ("", one, 127, _windows(0, one)),
        ("10 bits, two hidden layers", wide, 511, _windows(1, wide)),
        ("no hidden layer", affine, 127, _windows(2, affine)),
        ("colours would leave int32: as without windows", _louder(loud, 137.125), 127, _windows(3, loud)),
        (
            "the fraction 0: half a step is added before the bias is rounded",
            _louder(loud, 20000.0),
            127,
            _windows(4, loud),
        ),
        ("flat windows: a spread of one step counts", one, 127, flat),
        ("windows of few steps: a spread below one step counts as one", quiet, 127, few),
        ("the best integers would be 128 and -128", beyond, 127, _windows(BEYOND, beyond)),
    ]
    blamed: Callable[[str], str] = lambda name: "WHO-7" if name[0] == "f" else "WHO-14"  # noqa: E731
    given = [
        (note, {**as_inputs(network), "size": 2, "amplitude": amplitude, "windows": windows})
        for note, network, amplitude, windows in rows
    ]
    return [Case("WHO-14", i, exactly(_rounded_on(i), CHOSEN, blamed), note) for note, i in given]


KINDS = (
    kind("whole.input", _input_cases, _input),
    kind("whole.sine", _sine_cases, _sine),
    kind("whole.forward", _forward_cases, _forward),
    kind("whole.rounded", _rounded_cases, _rounded),
    kind("whole.rounded_on", _rounded_on_cases, _rounded_on),
)
"""The kinds of this module."""
