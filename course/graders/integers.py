"""Grades lab 12: sums in any order, phases, every angle, the spec's vectors, and the compiler's proof."""

from __future__ import annotations

from typing import Any

import numpy as np

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.verify import verify
from wamnet.compiler.proof.whole import Rounds, known
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.whole import SINES, TURN, colour, rounded, whole_sine
from wamnet.refimpl.network.window import Window
from wamnet.spec.conformance.kinds.network import network_from

from ..frame import Check, Wrong, asked, expect, kind_of_number, numbers_of, spread
from ..wire import Expression

PHASES = 64
"""Random phases that are looked at."""

STEP = 64
"""Every phase that differs in more than its last 6 bits is looked at."""


def whole(stream: int, shape: tuple[int, ...], least: int, most: int) -> Any:
    """Return random integers in [least, most]."""
    return np.floor(spread(stream, shape, least, most + 1)).astype(np.int64)


def largest(student: Any) -> None:
    """Each part of a sum is a partial sum in some order: the largest has the weights' magnitudes."""
    weights = whole(111, (5, 40), -127, 127)
    w, size = weights.astype(np.float32), np.abs(weights)
    found = numbers_of("WHO-3", "largest sums", student.largest_sums(w, 127), (5,))
    likely = [
        (127 * np.abs(weights.sum(axis=1)), "the sum of the magnitudes, not the magnitude of the sum"),
        (127 * weights.sum(axis=1), "the sum of the magnitudes: weights have both signs"),
        (size.sum(axis=1), "times the largest input"),
        (127 * size.max(axis=1), "the sum over the row, not its largest weight"),
        (127 * 40 * size.max(axis=1), "a sum of these weights: no row has 40 times its largest"),
        (np.full(5, 127 * 127 * 40), "a sum of these weights, not of the largest that there are"),
        (127 * np.maximum(np.maximum(weights, 0).sum(axis=1), np.maximum(-weights, 0).sum(axis=1)),
         "the inputs have both signs: negative weights count with positive ones"),
        (128 * size.sum(axis=1), "inputs are in [-most, most]"),
        (127 * np.sqrt((weights**2).sum(axis=1)), "a bound of all inputs: the sum of magnitudes, not a norm"),
    ]  # fmt: skip
    text = "most * sum of |weights| of a row"
    expect("WHO-3", "largest sums", found, 127 * size.sum(axis=1), 0.0, likely, text)


def phases(student: Any) -> None:
    """Against Python's integers, which do not wrap: the last 24 bits count."""
    sums = whole(112, (PHASES,), 1 - TURN, TURN - 1)
    sums[:2] = [1 - TURN, -1]
    for factor, bias in ((1, 0), (1, 5), (62, 5_000_000), (TURN - 1, TURN - 1)):
        one, other = (np.full(PHASES, value, np.float32) for value in (factor, bias))
        found = student.phase(sums.astype(np.float32), one, other)
        kind_of_number("WHO-4", "phases", found, np.uint32)
        wanted = np.array([(int(a) * factor + bias) % TURN for a in sums])
        rounds = (sums.astype(np.float32) * one + other).astype(np.float64)
        likely = [
            (np.array([int(a) * factor % TURN for a in sums]), "the bias is missing"),
            (
                np.array([(int(a) + bias) * factor % TURN for a in sums]),
                "sums * factor + bias: the bias is added last",
            ),
            (np.array([(int(a) + bias) % TURN for a in sums]), "the factor is missing"),
            (np.array([(int(a) * factor - bias) % TURN for a in sums]), "the bias is added"),
            (np.array([(abs(int(a)) * factor + bias) % TURN for a in sums]), "sums below 0 keep their sign"),
            (
                np.array([(max(int(a), 0) * factor + bias) % TURN for a in sums]),
                "a float below 0 becomes uint32 by way of int32",
            ),
            (
                np.mod(rounds, TURN),
                "float32 has 24 bits: the product needs words that wrap, so convert first",
            ),
        ]
        text = "words first, then product and sum: float32 rounds what is above 2^24"
        what = f"phases of sums * {factor} + {bias}, modulo 2^24"
        expect("WHO-4", what, np.asarray(found) % TURN, wanted, 0.0, likely, text)


def folded(at: Any, amplitude: int, how: str = "") -> Any:
    """Return the sine of WHO-5 with one mistake of [`SINE_MISTAKES`], in words of 32 bits that wrap."""
    (c1, c3, c5), shift = SINES[amplitude].coefficients, SINES[amplitude].shift
    at = np.asarray(at).astype(np.uint32)
    one = np.uint32(1)
    back = (at >> np.uint32(23 if how == "quarter" else 22)) & one
    turned = 0 - at if how == "negative" else at if how == "forward" else ~at
    m = np.where(back == 1, turned, at) >> np.uint32(6)
    m = m & np.uint32({"mask": 0x7FFF, "unmasked": 2**32 - 1}.get(how, 0xFFFF))
    z = (m * m) >> np.uint32(16)
    inner = (z * np.uint32(c5)) >> np.uint32(16)
    inner = np.uint32(c3) + inner if how == "plus" else np.uint32(c3) - inner
    q = np.uint32(c1) - ((z * inner) >> np.uint32(16))
    added = {"down": 0, "one": 1, "whole": 1 << shift}.get(how, 1 << (shift - 1))
    size = np.minimum((m * q + np.uint32(added)) >> np.uint32(shift), amplitude).astype(np.float64)
    half = (at >> np.uint32(22 if how == "half" else 23)) & one
    return np.where(half == 1, -size, size)


SINE_MISTAKES = (
    ("down", "half of the last place, 1 << (shift - 1), is added before the shift: it is missing"),
    ("one", "half of the last place is 1 << (shift - 1), not 1"),
    ("whole", "half of the last place is 1 << (shift - 1), not 1 << shift"),
    ("half", "the sign is that of bit 23, the half turn; bit 22 is the quarter"),
    ("quarter", "bit 22 turns the phase around, not bit 23: the second and fourth quarter run backwards"),
    ("forward", "the second and fourth quarter run backwards: bit 22 turns the phase around"),
    ("negative", "backwards is the complement of all bits, ~k, not its negative"),
    ("mask", "bits 6 to 21 are 16 bits: & 0xFFFF"),
    ("unmasked", "bits 6 to 21 only: & 0xFFFF after the shift masks those above"),
    ("plus", "the signs of the polynomial alternate: c3 - (z c5 >> 16)"),
)
"""Mistakes in a sine, and their explanations."""


def single(student: Any) -> None:
    """Angles whose sines are known."""
    for amplitude in SINES:
        at = np.arange(0, TURN, TURN // 48, dtype=np.uint32)
        found = numbers_of("WHO-5", "sines", student.sine(at, amplitude), at.shape)
        wanted = whole_sine(at, amplitude)
        kind_of_number("WHO-5", "sines", found, np.float32)
        likely = [
            (np.abs(wanted), "the sign of the second half turn is missing: bit 23"),
            (-wanted, "the sign: the first half turn is positive"),
            (wanted / amplitude, "integers in [-amplitude, amplitude], not numbers in [-1, 1]"),
            (np.round(amplitude * np.cos(2 * np.pi * at / TURN)), "a cosine"),
        ]
        likely += [(folded(at, amplitude, how), told) for how, told in SINE_MISTAKES]
        text = "fold by bit 22, bits 6 to 21, the polynomial, half of the last place, a shift, sign by bit 23"
        if not np.all(found == np.floor(found)):
            text = "a sine is an integer: shift, do not divide"
        expect("WHO-5", f"sines of amplitude {amplitude}", found, wanted, 0.0, likely, text)


def every_angle(student: Any) -> None:
    """All 262,144 phases that differ in more than their last 6 bits, and some that are beyond a turn."""
    at = np.arange(0, TURN, STEP, dtype=np.uint32)
    for amplitude in SINES:
        found = numbers_of("WHO-5", "sines", student.sine(at, amplitude), at.shape)
        wanted = whole_sine(at, amplitude)
        off = np.flatnonzero(found != wanted)
        if off.size:
            made = ((folded(at, amplitude, how), told) for how, told in SINE_MISTAKES)
            text = "the last place: what is added before the shift, and the shift"
            text = "a coefficient, a shift, or the place of a shift" if off.size > at.size // 2 else text
            text = next((told for values, told in made if np.array_equal(values, found)), text)
            what = f"sine({at[off[0]]}, {amplitude}); {off.size} of {at.size} angles differ"
            raise Wrong("WHO-5", what, f"{wanted[off[0]]:g}", f"{found[off[0]]:g}", text)
        beyond = at[::997] + np.uint32(TURN)
        text = "only the last 24 bits of a phase count: mask them, & 0xFFFF after the shift"
        expect("WHO-5", "sines beyond a turn", student.sine(beyond, amplitude), wanted[::997], 0.0, (), text)


def sine_of(student: Any, given: Any) -> Any:
    """Return the student's answer to a case of whole.sine."""
    return {"value": student.sine(np.asarray(given["phase"]).astype(np.uint32), int(given["amplitude"]))}


def forward(student: Any, network: Any, numbers: Any) -> list[Any]:
    """Return what each of the student's layers gives."""
    found = []
    for row in zip(network.weights[:-1], network.factors, network.biases, strict=False):
        numbers = student.layer(*row, network.amplitude, numbers)
        found.append(numbers)
    return found


def one_layer(student: Any) -> None:
    """A layer, from its parts."""
    weights, numbers = whole(113, (4, 3), -127, 127), whole(114, (5, 3), -127, 127)
    factor, bias = whole(115, (4,), 1, 4000), whole(116, (4,), 0, TURN - 1)
    given = (a.astype(np.float32) for a in (weights, factor, bias))
    found = student.layer(*given, 127, numbers.astype(np.float32))

    def made(factor: Any, bias: Any) -> Any:
        return whole_sine(((numbers @ weights.T) * factor + bias).astype(np.int64).astype(np.uint32), 127)

    likely = [
        (made(factor, 0), "the bias is missing"),
        (made(1, bias), "the factor is missing"),
        (numbers @ weights.T, "the sine is missing"),
    ]
    expect("WHO-5", "a layer", found, made(factor, bias), 0.0, likely, LAYER)


LAYER = "sine(phase(numbers @ weights.T, factor, bias), amplitude)"
"""What a layer is."""


def layers_of(student: Any, given: Any) -> Any:
    """Return the answer to a case of whole.forward; last layer and refusals are not the student's."""
    network = network_from(given)
    numbers = np.asarray(given["n"], np.float32)
    layers = forward(student, network, numbers)
    sums = (layers or [numbers])[-1] @ network.weights[-1].T
    named = {f"layer_{index}": values for index, values in enumerate(layers)}
    return {**named, "color": colour(network, sums)}


TRACE = Expression(
    "lambda rows, amplitude, types, gather: import_module('wamnet.compiler.core.trace').trace("
    "lambda window: import_module('functools').reduce("
    "lambda numbers, row: student.layer(*row, amplitude, numbers), rows, window), types, gather)"
)
"""Traces a network of the student's layers, as `forward` calls them."""


def nothing_rounds(student: Any) -> None:
    """The compiler's own proof, of a network of the student's layers."""
    network = rounded(siren.init([12, 8, 8, 3], 30.0, 30.0, seed=1), 2)
    gather = Gather(Window(2), (Image("color", 3, -127.0, 127.0, whole=True),))
    types = {"window": Type(shape=(gather.n_inputs,))}
    what, wanted = "the compiler's proof", "that nothing rounds"
    try:
        rows = list(zip(network.weights[:-1], network.factors, network.biases, strict=False))
        program = verify(student.request(TRACE, rows, network.amplitude, types, gather), "of the layers")
        known(program)
    except Rounds as reason:
        # Without a rule is what the proof cannot follow; with one, what may round.
        op = str(reason).removesuffix(" may round").rpartition(" ")[2]
        text = "right in NumPy perhaps; a kernel's words have 32 bits and its floats 24"
        if str(reason).endswith(" may round"):
            text = f"the proof has no rule for {op}: use the operations that the task names"
        raise Wrong("WHO-3", what, wanted, str(reason), text) from None
    except CompileError as reason:
        text = "an operation that cannot be traced: use only the operations that the task names"
        raise Wrong("WHO-3", what, wanted, str(reason).partition(";")[0], text) from None
    numbers = whole(117, (20, gather.n_inputs), -127, 127).astype(np.float32)
    found = interpret(program, {"window": numbers}, np.float32)["color"]
    text = "a layer asks what its arguments are"
    expect("WHO-3", "the traced layers", found, forward(student, network, numbers)[-1], 0.0, (), text)


CHECKS = (
    Check("largest partial sums", largest),
    Check("phases", phases),
    Check("sines of known angles", single),
    Check("every angle", every_angle),
    Check("the vectors of the sine", asked("whole.sine", sine_of, "the last bits of a phase")),
    Check("a layer", one_layer),
    Check("the vectors of a network", asked("whole.forward", layers_of, LAYER)),
    Check("nothing rounds", nothing_rounds),
)
"""In the order in which they explain a mistake best."""
