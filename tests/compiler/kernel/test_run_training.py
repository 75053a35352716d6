"""A training step in NumPy: sums within their bounds, Adam's bits, and what wrong kernels do with memory."""

from dataclasses import replace

import numpy as np
import pytest
import step_sums

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.passes.gradient import TRANSPOSED
from wamnet.compiler.kernel.run import run_on
from wamnet.compiler.kernel.verify import KernelError
from wamnet.compiler.training import step, step_kernel
from wamnet.compiler.training.step import ADAM_INPUTS, lower_adam
from wamnet.compiler.training.step_kernel import compile_step
from wamnet.compiler.training.step_layout import pack, slots, transposed_slots, unpack
from wamnet.refimpl.network import adam, factored
from wamnet.refimpl.network.factored import Factors

WIDTHS, SIZE, BATCH, GROUPS = (2 * 2 * 3, 18, 3), 2, 39, 2
"""Layers of less than one vector and of more; 19 and 20 examples for each of two items."""


@pytest.fixture(autouse=True)
def small_tiles(monkeypatch):
    """Let each item have two tiles, of which the second is not full."""
    monkeypatch.setattr(step_kernel, "TILE", 16)


def random_step(rank=0):
    """Return the kernel and its step, arrays of random numbers, and the examples in them."""
    random, compiled = np.random.default_rng(rank + 1), compile_step(WIDTHS, (1.0, 3.0), BATCH, SIZE, rank)
    corner, row = 3 * random.integers(0, 50, BATCH), 3 * random.integers(2, 9, BATCH)
    values, targets = random.uniform(-1, 1, 230), random.uniform(0, 1, (40, 3))
    target, trained, copies = (
        random.integers(0, 40, BATCH),
        trained_of(compiled.programs),
        transposed_slots(compiled.programs),
    )
    theta, m, v = (
        {key: random.uniform(low, 1, (slot.width, slot.rows)) for key, slot in trained.items()}
        for low in (-1, -1, 0)
    )
    arrays = {
        "values": values.astype(np.float32),
        "targets": targets.astype(np.float32).ravel(),
        "places": np.concatenate([corner, row, target]),
        "rates": np.array([0, 0, 0, 1e-3, *adam.growth(7)], np.float32),
        "old": np.concatenate([pack(trained, each) for each in (theta, m, v)]),
        "transposed": pack(copies, {key: theta[key.removesuffix(TRANSPOSED)].T for key in copies}),
        "losses": np.zeros(2, np.float32),
        "failed": np.array([-1]),
    }
    taps = corner[:, None, None] + row[:, None, None] * np.arange(SIZE)[:, None] + np.arange(6)
    examples = arrays["values"][taps].reshape(BATCH, -1), targets.astype(np.float32)[target]
    return compiled, arrays, examples


def trained_of(traced):
    return {key: slot for key, slot in slots(traced).items() if key != step.SQUARES}


def ran(kernel, arrays):
    """Return what step 7 leaves, the second of its block."""
    return run_on(kernel, arrays, {"groups": GROUPS, "at": 1, "step": 7})


def factors_of(arrays):
    vertical, horizontal = (arrays[key].astype(np.float64) for key in step.factor_names("W0"))
    return Factors(vertical.reshape(len(vertical), SIZE, -1), horizontal)


def wrong_in(compiled, arrays, examples, left):
    """Return what a step has left that is beyond its bounds, or has other bits than Adam's."""
    traced, trained = compiled.programs, trained_of(compiled.programs)
    sums, places = step_sums.summed(traced, left["sums"], GROUPS), slots(traced)
    first = left["sums"].reshape(GROUPS, -1)[0]
    before, after = (
        [unpack(trained, part) for part in state.reshape(3, -1)] for state in (arrays["old"], left["moved"])
    )
    shapes = {key: traced.program.parameters[key].shape for key in traced.trained}
    at = step_sums.with_parameters(
        traced, {key: before[0][key].reshape(shape) for key, shape in shapes.items()}
    )
    exact, bound = step_sums.sums(at, *examples), step.sum_errors(at, *examples)
    right = {key: np.abs(sums[key].reshape(exact[key].shape) - exact[key]) <= bound[key] for key in bound}
    loss = exact[step.SQUARES].sum() / (3 * BATCH)
    right["loss"] = left["losses"][0] == 0 and abs(left["losses"][1] - loss) <= 1e-5 * loss
    right["zeros that fill up"] = pack(places, unpack(places, first)) == first
    for key in trained.keys() - ({"W0"} if traced.split else set()):
        state = (before[0][key], sums[key], before[1][key], before[2][key], *arrays["rates"][3:])
        expected = interpret(lower_adam(), dict(zip(ADAM_INPUTS, state, strict=True)), np.float32)
        right[f"Adam of {key}"] = [part[key] == expected[n] for part, n in zip(after, expected, strict=True)]
    for key, copy in unpack(transposed_slots(traced), left["transposed"]).items():
        right["copies"] = copy == after[0][key.removesuffix(TRANSPOSED)].T
    if traced.split:
        old, new, slopes = map(factors_of, (before[0], after[0], sums))
        expected = factored.backward(old, exact["W0"])
        errors = step_sums.factor_errors(old, exact["W0"], bound["W0"])
        right["vertical"] = np.abs(slopes.vertical - expected.vertical) <= errors.vertical
        right["horizontal"] = np.abs(slopes.horizontal - expected.horizontal) <= errors.horizontal
        right["product"] = np.abs(after[0]["W0"] - factored.expand(new)) <= step_sums.expansion_error(new)
    return {key for key, each in right.items() if not np.all(each)}


@pytest.mark.parametrize("rank", [0, 2])
def test_a_step(rank):
    """TRK-2, TRK-3: sums. TRK-5: their loss, Adam of them to the bit, the copies. TRK-8: factors, product."""
    compiled, arrays, examples = random_step(rank)
    left = ran(compiled.kernel, arrays)
    assert wrong_in(compiled, arrays, examples, left) == set()
    assert left["failed"] == [-1]


def test_a_loss_that_is_not_finite_leaves_its_step():
    """TRK-6: the parameters are not written, by this step or by a later one."""
    compiled, arrays, _ = random_step()
    left = ran(compiled.kernel, {**arrays, "targets": np.full(120, np.inf, np.float32)})
    assert (left["failed"], np.isnan(left["moved"]).all()) == ([7], True)
    later = ran(compiled.kernel, {**arrays, "failed": left["failed"]})
    assert (later["failed"], np.isnan(later["moved"]).all(), later["losses"][1]) == ([7], True, 0)


def without(kernel, launch):
    return replace(kernel, body=tuple(each for each in kernel.body if each.name != launch))


def smaller(kernel, constant, by=1):
    """Return a kernel with one of its integers smaller."""
    constants = (replace(c, value=c.value - by * (c.name == constant)) for c in kernel.constants)
    return replace(kernel, constants=tuple(constants))


WRONG = {
    "no derivatives": (lambda k: without(k, "step"), "sums is read before it is written"),
    "another item's sums": (lambda k: smaller(k, "SUMS"), "one element of sums|reads sums where another"),
    "another item's values": (lambda k: smaller(k, "SCRATCH"), "one element of scratch|reads scratch where"),
    "another minibatch": (lambda k: smaller(k, "BATCH", -1), "index 117 is beyond places, which has 117"),
    "a shorter state": (lambda k: smaller(k, "COUNT", -1), "is beyond old"),
}


@pytest.mark.parametrize(("change", "message"), WRONG.values(), ids=WRONG)
def test_wrong_kernels_are_found(change, message):
    compiled, arrays, _ = random_step()
    with pytest.raises(KernelError, match=message):
        ran(change(compiled.kernel), arrays)
