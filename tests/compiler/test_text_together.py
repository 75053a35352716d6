"""Reading faster: lanes of tiles, numbers of all lanes as one, turns of a loop at once (spec/text.md)."""

import numpy as np
import pytest

from wamnet.compiler.reading.cells import Cells, Device, Race, Turns
from wamnet.compiler.reading.lanes import Wrong, tile_lanes
from wamnet.compiler.reading.places import NOTHING, TILE, Place
from wamnet.compiler.reading.terms import Fold, Term


def test_tiles_have_every_case_of_a_row():
    """TXT-10."""
    lanes = tile_lanes((6, 4), 3, beyond=False)
    x, width, y, height = lanes.known
    far = (y > 5) & (height - y > 8)
    cases = {(a > 0, min(b, 11)) for a, b in zip(x[far], (width - x)[far], strict=True) if b > 0}
    assert cases == {(a, b) for a in (False, True) for b in range(1, 12)}
    assert (x % 6 == 0).all()
    assert (y % 4 == 0).all()
    assert not ((x >= width) | (y >= height)).any()


def test_tiles_of_launches_are_below_the_picture_too():
    """TXT-12: at each distance from its last row, and far."""
    lanes = tile_lanes((6, 4), 3, beyond=True)
    _, _, y, height = lanes.known
    assert {*range(8)} <= {*(y - height)[y >= height].tolist()}
    assert (y - height).max() > 1000
    assert (height > 0).all()


def test_numbers_that_differ_in_a_lane_are_folded_to_others():
    fold = Fold(np.array([True, True, True, False]), 2)
    known = np.arange(12, dtype=np.uint64).reshape(4, 3)
    other, beyond = known.copy(), known.copy()
    other[2, 1] += np.uint64(1)
    beyond[3, 1] += np.uint64(1)
    found = fold.of(known, 0)
    assert (found == fold.of(other, 0)).tolist() == [True, False, True]
    assert (found == fold.of(beyond, 0)).all()
    assert (found != fold.of(known, 1)).all()
    assert (fold.of(known, np.array([0, 1, 0])) == found).tolist() == [True, False, True]


# ---- turns that are run at once ----------------------------------------------------------------------------


def shape(*values):
    return Term(np.array([values], dtype=np.uint64))


def put(cells, turns, place, *values, active=None):
    cells.store(np.array([place]), 1, shape(*values), turns, active, 0)


def get(cells, turns, place, active=None):
    return cells.load(np.array([place]), 1, turns, active).shape[0].tolist()


def test_turns_use_elements_of_their_own():
    cells, turns = Cells("x", 4, 1), Turns(3)
    put(cells, turns, [0, 1, 2], 10, 11, 12)
    assert get(cells, turns, [0, 1, 2]) == [10, 11, 12]
    put(cells, turns, [2, 1, 3], 20, 21, 22, active=np.array([False, True, True]))
    assert get(cells, turns, [0, 1, 3]) == [10, 21, 22]
    with pytest.raises(Wrong, match="has no number 4"):
        get(cells, turns, [0, 1, 4])
    with pytest.raises(Wrong, match="before it is written"):
        get(Cells("x", 4, 1), turns, [0, 1, 2])


def test_turns_that_read_what_others_write_race():
    cells, turns = Cells("x", 4, 1), Turns(3)
    put(cells, turns, [0, 1, 2], 10, 11, 12)
    with pytest.raises(Race, match="with each other"):
        get(cells, turns, [1, 1, 2])


def test_turns_that_write_what_others_read_or_write_race():
    cells, turns = Cells("x", 4, 1), Turns(2)
    put(cells, Turns(1), [3], 7)
    assert get(cells, turns, [3, 3]) == [7, 7]
    turns.end(Turns(1))
    put(cells, turns, [0, 3], 1, 2)
    with pytest.raises(Race, match="with each other"):
        turns.end(Turns(1))
    with pytest.raises(Race, match="with each other"):
        put(Cells("x", 4, 1), Turns(2), [1, 1], 1, 2)


def test_the_last_turn_writes_last():
    """Turns of a loop have an order, items of a launch have none."""
    cells, turns = Cells("x", 2, 1), Turns(2)
    put(cells, turns, [0, 1], 1, 2)
    with pytest.raises(Race, match="with each other"):
        put(cells, turns, [1, 0], 3, 4)
    cells, turns = Cells("x", 2, 1), Turns(2, ordered=True)
    put(cells, turns, [0, 1], 1, 2)
    put(cells, turns, [1, 0], 3, 4)
    assert get(cells, Turns(1), [0]) + get(cells, Turns(1), [1]) == [4, 2]


@pytest.mark.parametrize("first", [0, 1])
def test_no_turn_reads_before_two_write(first):
    """In order, the second turn would read what the first one wrote."""
    cells, turns = Cells("x", 3, 1), Turns(2, ordered=True)
    put(cells, Turns(1), [1], 7)
    assert get(cells, turns, [0, 1], active=np.array([False, True]))[1] == 7
    ways = [[0, 1], [1, 2]]
    put(cells, turns, ways[first], 1, 2)
    with pytest.raises(Race, match="with each other"):
        put(cells, turns, ways[1 - first], 3, 4)


def test_turns_inside_turns_have_used_what_these_use():
    cells, outer = Cells("x", 8, 1), Turns(2)
    inner = Turns(4)
    put(cells, inner, [0, 1, 2, 3], 1, 2, 3, 4)
    inner.end(outer)
    assert get(cells, outer, [1, 2]) == [2, 3]
    with pytest.raises(Race, match="with each other"):
        get(cells, outer, [2, 1])
    put(cells, inner := Turns(4), [4, 5, 2, 7], 1, 2, 3, 4)
    put(cells, outer, [6, 4], 1, 2)
    with pytest.raises(Race, match="with each other"):
        inner.end(outer)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize(
    "use",
    [
        get,
        lambda cells, turns, place: put(cells, turns, place, 1, 2),
        lambda cells, turns, place: turns.added(cells, np.array(place), False),
        lambda cells, turns, place: turns.added(cells, np.array(place), True),
    ],
    ids=["read", "write", "add", "add a product"],
)
@pytest.mark.parametrize("ordered", [True, False])
def test_what_turns_add_to_they_do_not_use(inside, first, use, ordered):
    """Nor do those around them: the sum of some turns is not known."""
    cells, outer = Cells("x", 2, 1), Turns(2, ordered=ordered)
    for place in (0, 1):
        put(cells, Turns(1), [place], 5)

    def add():
        turns = Turns(4) if inside else outer
        turns.added(cells, np.array([0]), False)
        if inside:
            turns.end(outer)

    steps = [add, lambda: use(cells, outer, [0, 1])]
    steps[first]()
    with pytest.raises(Race, match="with each other"):
        steps[1 - first]()


def test_what_raced_is_undone():
    cells, turns = Cells("x", 2, 1), Turns(2, undoes=True)
    put(cells, Turns(1), [0], 7)
    put(cells, turns, [0, 1], 1, 2)
    turns.restore()
    assert get(cells, Turns(1), [0]) == [7]
    with pytest.raises(Wrong, match="before it is written"):
        get(cells, Turns(1), [1])


def test_arrays_of_turns_have_a_column_for_each():
    cells, turns = Cells("x", 2, 2), Turns(4)
    cells.store(0, 1, shape(5, 6), Turns(2), None, 0)
    assert get(cells, turns, [0, 0, 0, 0]) == [5, 5, 6, 6]


def test_nothing_is_compared_with_the_number_of_a_tile():
    """What is true of the tiles that are computed is true of all."""
    lanes = tile_lanes((6, 4), 3)
    lanes.batch = 4004, 4
    count, tile = (Place(np.array([n]), NOTHING, TILE) for n in ([4004], [17, 1018]))

    def made(what, a, b):
        return Place.operated(lanes, what, a, b, None)

    index = made("add", made("multiply", 3, count), tile)
    assert index.values.tolist() == [[12029, 13030]]
    assert made("divide", count, 4).values.item() == 1001
    for what, a, b in (
        ("remainder", tile, 4),
        ("divide", tile, 4),
        ("divide", count, 2),
        ("maximum", 0, tile),
    ):
        with pytest.raises(Wrong, match="otherwise than in an index"):
            made(what, a, b)
    with pytest.raises(Wrong, match="otherwise than in an index"):
        Place.compared(lanes, "less", tile, 3, None)
    with pytest.raises(Wrong, match="both axes"):
        made("add", tile, Place.of(lanes, 0))
    device = Device("rows", 2, 5, np.array([17, 1018]), 4004)
    assert device.place(index, None).tolist() == [[12, 14]]
    with pytest.raises(Wrong, match="another tile"):
        device.place(made("add", index, 1), None)
