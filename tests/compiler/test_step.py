"""A training step as a program: its layout, its error bounds, its kernels' text, and what has no schedule."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import step_sums

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Node, Type, attributes
from wamnet.compiler.training import step
from wamnet.compiler.training.step import ADAM_INPUTS, lower_adam, lower_step, step_of
from wamnet.compiler.training.step_kernel import BLOCK, INPUTS, compile_lowered, compile_step
from wamnet.compiler.training.step_layout import LANES, pack, slots, transposed_slots, unpack
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import adam

WIDTHS = (3 * 3 * 3, 18, 5, 3)


def weights(seed: int, names: Any, program: Any) -> dict[str, Any]:
    random = np.random.default_rng(seed)
    return {name: random.uniform(-1, 1, program.parameters[name].shape).astype(np.float32) for name in names}


def test_layout_round_trip() -> None:
    """Whole vectors, input-major, zeros between; every number comes back."""
    found = lower_step(WIDTHS, 1.0, 10.0, 4)
    places = {name: slot for name, slot in slots(found).items() if name != step.SQUARES}
    arrays = weights(1, found.trained, found.program)
    numbers = pack(places, arrays)
    assert numbers.size == LANES * (27 * 2 + 2 + 18 + 1 + 5 + 1)
    assert numbers[1] == arrays["W0"][1, 0]
    assert not numbers[18:32].any()
    back = unpack(places, numbers)
    assert all(np.array_equal(back[name].reshape(arrays[name].shape), arrays[name]) for name in arrays)
    assert [slot.rows for slot in transposed_slots(found).values()] == [3, 5]
    assert pack({}, {}).size == 0


def test_errors_hold_for_float32_in_any_order() -> None:
    """NumPy's float32 sums, forwards and backwards, are executors like others; the bound fits."""
    random = np.random.default_rng(2)
    found = lower_step(WIDTHS, 2.0, 10.0, 50)
    found = step_sums.with_parameters(found, weights(3, found.trained, found.program))
    x = random.uniform(-1, 1, (50, WIDTHS[0])).astype(np.float32)
    t = random.uniform(0, 1, (50, 3)).astype(np.float32)
    exact, bound = step_sums.sums(found, x, t), step.sum_errors(found, x, t)
    for order in (slice(None), slice(None, None, -1)):
        single = step_sums.sums(found, x[order], t[order], np.float32)
        for name, error in bound.items():
            assert np.all(np.abs(single[name] - exact[name]) <= error), name
            assert np.isfinite(error).all()
            # Errors grow through the layers, here with weights of 1 and omega 10; still far below the value.
            assert error.max() <= 0.05 * np.abs(exact[name]).max(), name


def test_adams_program_is_adam() -> None:
    random = np.random.default_rng(4)
    theta, g, m = random.uniform(-1, 1, (3, 20))
    v = random.uniform(0, 1, 20)
    rate, t = 0.01, 7
    given = dict(zip(ADAM_INPUTS, (theta, g, m, v, rate, *adam.growth(t)), strict=True))
    found = interpret(lower_adam(), given, np.float64)
    moved, state = adam.step((theta,), (g,), adam.AdamState((m,), (v,), t - 1), rate)
    for name, want in (("theta", moved[0]), ("m", state.m[0]), ("v", state.v[0])):
        assert np.array_equal(found[name], want)


def test_golden_source(golden: Any) -> None:
    golden("train.step.cl", compile_step((2 * 2 * 3, 20, 3), (1.0, 10.0), 4, 2).source)


def test_golden_source_of_factors(golden: Any) -> None:
    golden("train.factors.step.cl", compile_step((2 * 2 * 3, 20, 3), (1.0, 10.0), 4, 2, 5).source)


def test_factors_lie_before_the_squares() -> None:
    """Rows (dy, r) of neurons, rows k of ranks; the matrix keeps its place, and has no transposed copy."""
    places = slots(compile_step((2 * 2 * 3, 20, 3), (1.0, 10.0), 4, 2, 5).programs)
    vertical, horizontal = (places[name] for name in step.factor_names("W0"))
    assert (vertical.rows, vertical.width, horizontal.rows, horizontal.width) == (2 * 5, 20, 6, 5)
    assert list(places)[-3:] == [vertical.name, horizontal.name, step.SQUARES]
    assert [slot.offset for slot in places.values()][1:] == [slot.end for slot in places.values()][:-1]


def test_source_is_a_function_of_the_step() -> None:
    same, again = (compile_step(WIDTHS, (1.0, 10.0), 4, 3).source for _ in range(2))
    assert same == again != compile_step(WIDTHS, (1.0, 10.0), 5, 3).source


def test_wide_layers_are_done_in_blocks() -> None:
    """Six vectors of neurons are four and two: registers hold no more."""
    text = compile_step((3 * 3 * 3, 6 * LANES, 3), (1.0, 1.0), 4, 3).source
    assert f"s0_{BLOCK - 1}" in text
    assert f"s0_{BLOCK} = " in text
    assert f"s{INPUTS}_" not in text


def test_a_window_that_is_changed_first_has_no_schedule() -> None:
    w, b = np.ones((3, 12), np.float32), np.ones(3, np.float32)
    with pytest.raises(CompileError, match="only affine maps may read the window"):
        compile_lowered(step_of(lambda x: np.matmul(x * 2.0, w.T) + b, 12, 3, 1), 2)


def test_what_else_has_no_schedule() -> None:
    """A lone number, which no step has."""
    found = lower_step((12, 3), 1.0, 1.0, 1)
    nodes = (*found.program.nodes, Node("component", (0,), Type(), attributes(index=0)))
    program = replace(found.program, nodes=nodes, outputs=(*found.program.outputs, ("more", len(nodes) - 1)))
    with pytest.raises(CompileError, match="component : float32 has no schedule in a training kernel"):
        compile_lowered(replace(found, program=program), 2)
