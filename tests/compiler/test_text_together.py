"""Reading faster: lanes of tiles, numbers of all lanes as one, turns of a loop at once (spec/text.md)."""

import numpy as np
import pytest

from wamnet.compiler.kernel.kernel import FLOAT, Block, For, Let, Store, apply, call, const, load, name
from wamnet.compiler.reading import field
from wamnet.compiler.reading.groups import tile_lanes
from wamnet.compiler.reading.machine import elementwise


def test_tiles_have_every_case_of_a_row():
    """TXT-10."""
    lanes = tile_lanes((6, 4), 3, seed=1)
    x, width, y, height = lanes.known
    far = (y > 5) & (height - y > 8)
    cases = {(a > 0, min(b, 11)) for a, b in zip(x[far], (width - x)[far], strict=True) if b > 0}
    assert cases == {(a, b) for a in (False, True) for b in range(1, 12)}
    assert (x % 6 == 0).all()
    assert (y % 4 == 0).all()
    assert not ((x >= width) | (y >= height)).any()


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


INDEX, N = name("i"), const(4)


def element(array, index=INDEX):
    return load(array, index)


@pytest.mark.parametrize(
    ("body", "arrays"),
    [
        ([Let("a", element("x") * 2.0), Store("y", (INDEX,), name("a", FLOAT))], ("x", "y")),
        ([Store("y", (INDEX,), apply("minimum", element("y"), element("x")))], ("y", "x")),
        ([Store("y", (INDEX,), element("x", INDEX + 1))], ()),
        ([Store("y", (INDEX,), element("x", const(0)))], ()),
        ([Store("y", (INDEX,), apply("convert", INDEX, value="float32"))], ()),
        ([Store("y", (INDEX,), element("x"), add=True)], ()),
        ([Store("y", (INDEX,), call("f", [element("x")], FLOAT))], ()),
        ([Store("y", (INDEX,), name("b", FLOAT))], ()),
        ([Store("y", (INDEX,), load("x", INDEX, kind=FLOAT.of(4)).lane(0))], ()),
        ([Let("a", element("x")), Block((Store("y", (INDEX,), name("a", FLOAT)),))], ()),
    ],
)
def test_loops_of_which_each_turn_has_its_own_numbers_are_told(body, arrays):
    assert elementwise(For("i", N, tuple(body))) == arrays


@pytest.mark.parametrize("start", [const(1), name("first")])
def test_loops_from_elsewhere_are_run_turn_by_turn(start):
    assert elementwise(For("i", N, (Store("y", (INDEX,), element("x")),), start=start)) == ()
