"""Reading faster: lanes of tiles, numbers of all lanes as one, turns of a loop at once (spec/text.md)."""

import numpy as np
import pytest

from wamnet.compiler.reading import field, together
from wamnet.compiler.reading.builtins import BUILTINS
from wamnet.compiler.reading.groups import tile_lanes
from wamnet.compiler.reading.lanes import Wrong
from wamnet.compiler.reading.machine import Machine
from wamnet.compiler.reading.syntax import Parser


def test_tiles_have_every_case_of_a_row():
    """TXT-10."""
    lanes = tile_lanes((6, 4), 3, seed=1)
    x, width, y, height = lanes.known
    far = (y > 5) & (height - y > 8)
    cases = {(a > 0, min(b, 11)) for a, b in zip(x[far], (width - x)[far], strict=True) if b > 0}
    assert cases == {(a, b) for a in (False, True) for b in range(1, 12)}
    assert (x % 6 == 0).all()
    assert (y % 4 == 0).all()
    assert ((x >= width) | (y >= height)).sum() == 4


def test_numbers_that_differ_in_a_lane_are_folded_to_others():
    known = np.arange(12, dtype=np.uint64).reshape(4, 3)
    other, beyond = known.copy(), known.copy()
    other[2, 1] += np.uint64(1)
    beyond[3, 1] += np.uint64(1)
    try:
        field.fold_lanes(np.array([True, True, True, False]))
        found = field.folded(known)
        assert (found == field.folded(other)).tolist() == [True, False, True]
        assert (found == field.folded(beyond)).all()
    finally:
        field.add_up_lanes(None)


LOOP = "for (int i = 0; i < 4; ++i) {{ {} }}"


@pytest.mark.parametrize(
    ("body", "read"),
    [
        ("float a = x[i] * 2.0f; y[i] = a;", True),
        ("y[i] = y[i] < b ? fmaxf(y[i], -b) : (float)(x[i]);", True),
        ("y[i] = x[i + 1];", False),
        ("y[i] = x[0];", False),
        ("y[i] = i;", False),
        ("y[i] += x[i];", False),
        ("y[i] = f(x[i]);", False),
        ("b = x[i]; y[i] = b;", False),
        ("float a = x[i];  { y[i] = a; }", False),
    ],
)
def test_loops_of_which_each_turn_has_its_own_numbers_are_told(body, read):
    text = Parser(
        f"void g(float *x, float *y, float b) {{ {LOOP.format(body)} }}", {}, {"f", "fmaxf"}
    ).parse()
    (loop,) = text.functions["g"].body[1]
    assert (together.read_loop(*loop[1:]) is not None) == read


@pytest.mark.parametrize(
    ("body", "turns"),
    [
        ("float x[4], y[4]; for (int i = 0; i < 4; ++i) { x[i] = 1.0f; } LOOP { y[i] = x[i]; }", [4, 3]),
        ("float x[4]; x[0] = 1.0f; x[1] = 1.0f; x[2] = 1.0f; float *y = x + 1; LOOP { y[i] = x[i]; }", []),
        ("union { float4 a[4]; float b[16]; } u; u.a[0] = (float4)(1.0f); LOOP { u.a[i] = u.b[i]; }", []),
        ("float x[4]; float4 b = (float4)(1.0f); LOOP { x[i] = b; }", []),
    ],
)
def test_loops_of_arrays_that_overlap_are_run_turn_by_turn(body, turns, monkeypatch):
    """What a turn writes is read by a later one where two names are of one memory."""
    text = Parser(f"void f() {{ {body.replace('LOOP', 'for (int i = 0; i < 3; ++i)')} }}").parse()
    lanes, at_once, run = tile_lanes((6, 4), 3, seed=1), [], Machine._run_turns
    monkeypatch.setattr(Machine, "_run_turns", lambda *given: (at_once.append(given[2]), run(*given)))
    try:
        field.fold_lanes(np.ones(lanes.count, dtype=bool))
        machine = Machine(text, lanes, {}, BUILTINS, lambda number: number)
        if "(float4)(1.0f); LOOP { x" in body:
            with pytest.raises(Wrong, match="4 numbers for 1"):
                machine.call("f", [])
        else:
            machine.call("f", [])
    finally:
        field.add_up_lanes(None)
    assert at_once == turns
