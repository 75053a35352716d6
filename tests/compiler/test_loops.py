"""Loops over the rows of tables: what a fold becomes, what is in a body, and that nothing else changes."""

import numpy as np
import pytest

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.loops import loops
from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.passes.fold import fold, fold_float32
from wamnet.compiler.core.passes.rewrite import eliminate_dead, scalarize
from wamnet.compiler.core.trace import trace
from wamnet.compiler.core.verify import verify
from wamnet.compiler.core.weights import tables, weights
from wamnet.refimpl import vectors
from wamnet.refimpl.errors import CompileError

ROWS = 5
RANDOM = np.random.default_rng(2)
NUMBERS = RANDOM.normal(size=ROWS).astype(np.float32)
VECTORS = RANDOM.normal(size=(ROWS, 3)).astype(np.float32)
MATRICES = RANDOM.normal(size=(ROWS, 3, 3)).astype(np.float32)
IDS = np.arange(10, 10 + ROWS, dtype=np.int32)
FLAGS = np.array([True, False, True, True, False])
X = RANDOM.normal(size=(7, 3)).astype(np.float32)


def nearest(x):
    """Return the largest of some distances and its id: every kind of table, two values that are carried."""

    def step(values, number, vector, matrix, known, flag):
        best, found = values
        turned = vectors.dot(vectors.rotate(matrix, x - vector), x) * number
        nearer = (turned > best) & flag
        return np.where(nearer, turned, best), np.where(nearer, known, found)

    start = (np.full_like(x[..., 0], -1e30), np.full_like(x[..., 0], -1, dtype=np.int32))
    best, found = vectors.fold_rows(step, (NUMBERS, VECTORS, MATRICES, IDS, FLAGS), start)
    return {"best": best, "found": found}


def exchanged(x):
    """Two values that trade places, one that is carried as it is, and one that is forgotten in each trip."""

    def step(values, number):
        a, b, same, _ = values
        return b, a + number, same, x[..., 2] * 2.0

    a, b, same, last = vectors.fold_rows(step, (NUMBERS,), (x[..., 0], x[..., 1], x[..., 2], x[..., 2]))
    return {"a": a, "b": b, "same": same, "last": last}


def two_loops(x):
    """A loop that starts from another's result, in the same tables."""

    def step(values, number):
        return (values[0] * number + x[..., 1],)

    (first,) = vectors.fold_rows(step, (NUMBERS,), (x[..., 0],))
    (second,) = vectors.fold_rows(step, (NUMBERS,), (first * 2.0,))
    return {"first": first, "second": second}


FUNCTIONS = [nearest, exchanged, two_loops]


def traced(function, most_unrolled=0):
    return trace(function, {"x": Type(shape=(3,))}, most_unrolled=most_unrolled)


def ops(program):
    return [node.op for node in program.nodes]


@pytest.mark.parametrize("passes", [(), ("scalarize", "fold_float32", "expand_tables", "eliminate_dead")])
@pytest.mark.parametrize("most_unrolled", [0, ROWS - 1, ROWS, None])
@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_fold_means_the_plain_loop(function, most_unrolled, passes):
    """The same bits in float32 and in float64, unrolled or not, before and after the passes."""
    program = pipeline.run(verify(traced(function, most_unrolled)), passes)
    assert ("loop" in ops(program)) == (most_unrolled is not None and most_unrolled < ROWS)
    for dtype in (np.float32, np.float64):
        expected = function(X.astype(dtype))
        found = interpret(program, {"x": X}, dtype)
        for name, values in expected.items():
            # In float64 the reference's tables stay float32: their products with x are exact in both.
            assert np.array_equal(found[name], values), name


def test_the_plain_loop_is_the_definition():
    """Two rows by hand; values that say NotImplemented go through the loop, others give their own answer."""

    class Own:
        def __init__(self, answer):
            self.answer = answer

        def __fold_rows__(self, step, tables, start):
            return self.answer

    def step(values, a, b):
        return (*values[:-1], (values[-1], int(a), int(b)))

    tables = (np.array([1, 2]), np.array([3, 4]))
    assert vectors.fold_rows(step, tables, (0,)) == (((0, 1, 3), 2, 4),)
    assert vectors.fold_rows(step, tables, (Own((5,)), 0)) == (5,)
    plain = vectors.fold_rows(step, tables, (Own(NotImplemented), 0))
    assert plain[1] == ((0, 1, 3), 2, 4)
    with pytest.raises(ValueError, match="shorter"):
        vectors.fold_rows(step, (tables[0], np.array([3])), (0,))


def test_what_does_not_depend_on_the_row_is_outside():
    """The rotation that boxes share: written in the step, computed once."""

    def function(x):
        def step(values, number):
            turned = vectors.dot(vectors.rotate(MATRICES[0], x), x)
            return (np.maximum(values[0], turned * number),)

        return vectors.fold_rows(step, (NUMBERS,), (x[..., 0],))[0]

    program = eliminate_dead(scalarize(traced(function)))
    (loop,) = loops(program)[0].values()
    assert [program.nodes[i].op for i in loop.body] == ["row", "multiply", "maximum"]


def test_a_column_of_equal_entries_is_a_constant():
    sizes = np.full(ROWS, 0.5, np.float32)
    program = traced(
        lambda x: vectors.fold_rows(lambda v, a, b: (v[0] * a + b,), (NUMBERS, sizes), (x[..., 0],))[0]
    )
    folded = eliminate_dead(fold_float32(program))
    assert ops(program).count("row") == 2
    assert ops(folded).count("row") == 1
    assert list(folded.parameters) == ["T0"]
    assert np.array_equal(*(interpret(p, {"x": X})["color"] for p in (program, folded)))


def test_a_number_that_no_output_needs_is_carried_when_another_needs_it():
    """Each result keeps the whole loop: `found` depends on `best` trip by trip."""
    program = eliminate_dead(trace(lambda x: nearest(x)["found"], {"x": Type(shape=(3,))}, most_unrolled=0))
    assert ops(program).count("carried") == 2
    assert ops(program).count("loop") == 1
    assert np.array_equal(interpret(program, {"x": X})["color"], nearest(X)["found"])


def test_rows_are_read_from_tables_not_from_weights():
    program = traced(nearest)
    assert list(tables(program)) == list(program.parameters)
    assert not weights(program)
    assert len(program.parameters) == 1 + 3 + 9 + 1 + 1


def test_a_loop_of_constants_is_not_computed_by_fold():
    program = traced(
        lambda x: vectors.fold_rows(lambda v, a: (v[0] + a,), (NUMBERS,), (np.ones_like(x[..., 0]),))[0]
    )
    folded = fold(program)
    assert "loop" in ops(folded)
    assert interpret(folded, {"x": X})["color"] == interpret(program, {"x": X})["color"]


@pytest.mark.parametrize(
    ("step", "start", "message"),
    [
        (
            lambda v, a: (v[0],) * 2,
            lambda x: (x[..., 0],),
            "a step that does not return 1 values cannot be tr",
        ),
        (
            lambda v, a: v[0] + a,
            lambda x: (x[..., 0],),
            "a step that does not return 1 values cannot be traced",
        ),
        (
            lambda v, a: (v[0] > a,),
            lambda x: (x[..., 0],),
            "a trip must keep the kinds .*: float32 became bool",
        ),
        (lambda v, a: (v[0],), lambda x: (x,), r"carried: a loop carries numbers, not float32\[3\]"),
    ],
)
def test_a_step_that_is_no_step_is_refused(step, start, message):
    with pytest.raises(CompileError, match=message) as caught:
        traced(lambda x: vectors.fold_rows(step, (NUMBERS,), start(x)))
    assert "test_loops.py:" in str(caught.value)


def test_a_trip_s_value_that_escapes_is_refused():
    escaped = []

    def step(values, a):
        escaped.append(values[0] + a)
        return (escaped[0],)

    def function(x):
        vectors.fold_rows(step, (NUMBERS,), (x[..., 0],))
        return escaped[0]

    with pytest.raises(
        CompileError, match="output 'color', %4, is a value of a trip; take the loop's result"
    ):
        verify(traced(function))
