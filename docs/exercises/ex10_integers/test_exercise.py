"""Grades exercise 10: sums in any order, phases, every angle, the spec's vectors, a proof."""

from __future__ import annotations

import numpy as np

from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.proof.whole import Rounds, known
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Window
from wamnet.refimpl.network.whole import SINES, TURN, colour, rounded, whole_sine
from wamnet.spec.conformance.kinds.whole import network_from

PARTS = 500
"""Random parts of sums, and random phases, that are looked at."""


def test_no_partial_sum_is_larger(student):
    """Each part of a sum is a partial sum in some order; the largest that there is must be reached."""
    rng = np.random.default_rng(6)
    weights = rng.integers(-127, 128, (5, 40)).astype(np.float32)
    said = np.asarray(student.largest_sums(weights, 127))
    assert said.shape == (5,), f"5 rows have 5 largest sums, not the shape {said.shape}"
    for row, most in zip(weights.astype(int), said.tolist(), strict=True):
        inputs = rng.integers(-127, 128, (PARTS, 40))
        inputs[-1] = 127 * np.sign(row)
        taken = rng.integers(0, 2, (PARTS, 40))
        taken[-1] = 1
        reached = int(np.abs((inputs * taken) @ row).max())
        assert most == reached, (
            f"a partial sum of row {row[:3]}... reaches {reached}; at most {most:g}, you say"
        )


def test_phases(student):
    """Against Python's integers, which do not wrap: the last 24 bits count."""
    rng = np.random.default_rng(7)
    sums = rng.integers(1 - TURN, TURN, PARTS)
    for factor, bias in ((1, 0), (62, 5_000_000), (TURN - 1, TURN - 1)):
        pair = (np.full(PARTS, value, np.float32) for value in (factor, bias))
        found = student.phase(sums.astype(np.float32), *pair)
        assert found.dtype == np.uint32, f"phases are uint32, not {found.dtype}"
        wanted = np.array([(int(a) * factor + bias) % TURN for a in sums])
        off = np.flatnonzero(found % TURN != wanted)
        assert off.size == 0, (
            f"the phase of {sums[off[0]]} * {factor} + {bias} is {found[off[0]] % TURN}; "
            f"{wanted[off[0]]} expected"
        )


def test_the_vectors_of_the_sine(student, hold_to_vectors):
    def answer(given):
        phases = np.asarray(given["phase"]).astype(np.uint32)
        return {"value": student.sine(phases, int(given["amplitude"]))}

    hold_to_vectors("whole.sine", answer)


def test_every_angle(student):
    """All 262,144 phases that differ in more than their last 6 bits."""
    phases = np.arange(0, TURN, 64, dtype=np.uint32)
    for amplitude in SINES:
        found, wanted = student.sine(phases, amplitude), whole_sine(phases, amplitude)
        off = np.flatnonzero(found != wanted)
        assert off.size == 0, (
            f"sine({phases[off[0]]}, {amplitude}) is {found[off[0]]:g}; {wanted[off[0]]:g} expected"
        )


def forward(student, network, numbers):
    """Return what each of the student's layers gives."""
    found = []
    for row in zip(network.weights[:-1], network.factors, network.biases, strict=False):
        numbers = student.layer(*row, network.amplitude, numbers)
        found.append(numbers)
    return found


def test_the_vectors_of_a_network(student, hold_to_vectors):
    """Its last layer is not yours, nor is what refuses a network."""

    def answer(given):
        network = network_from(given)
        numbers = np.asarray(given["n"], np.float32)
        layers = forward(student, network, numbers)
        sums = (layers or [numbers])[-1] @ network.weights[-1].T
        named = {f"layer_{index}": values for index, values in enumerate(layers)}
        return {**named, "color": colour(network, sums)}

    hold_to_vectors("whole.forward", answer)


def test_nothing_rounds(student):
    """The compiler's own proof, of a network of your layers."""
    network = rounded(siren.init([12, 8, 8, 3], 30.0, 30.0, seed=1), 2)
    gather = Gather(Window(2), (Image("color", 3, -127.0, 127.0, whole=True),))
    types = {"window": Type(shape=(gather.n_inputs,))}
    program = trace(lambda window: forward(student, network, window)[-1], types, gather)
    try:
        known(program)
    except Rounds as reason:
        raise AssertionError(f"right in NumPy perhaps, but {reason}") from None
