"""Kernels in NumPy: near the float64 reference, the bits of C without contraction, the errors of a run."""

from __future__ import annotations

import os
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import pictures

from wamnet.compiler.core import ir
from wamnet.compiler.core.ir import Gather, Image
from wamnet.compiler.core.trace import trace
from wamnet.compiler.kernel.interface import RESULT, denoiser
from wamnet.compiler.kernel.kernel import (
    BOOL,
    BYTE,
    FLOAT,
    INT,
    Array,
    Barrier,
    Break,
    Call,
    Constant,
    Expr,
    For,
    Function,
    If,
    Kernel,
    Launch,
    Let,
    Store,
    Type,
    View,
    any_lane,
    apply,
    call,
    const,
    lanes,
    load,
    name,
    splat,
)
from wamnet.compiler.kernel.memory import Domain
from wamnet.compiler.kernel.run import Runner, run
from wamnet.compiler.kernel.verify import KernelError
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.cuda import CUDA
from wamnet.compiler.languages.glsl import GLSL, GLSLCompute
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.renderer import Renderer
from wamnet.compiler.plan import plan_program
from wamnet.compiler.schedules.bytes import Dot, GroupDot
from wamnet.compiler.schedules.fft import Fourier
from wamnet.compiler.schedules.group import Grouped
from wamnet.compiler.schedules.passes import FourierPasses
from wamnet.compiler.schedules.plain import Packed, Plain
from wamnet.compiler.schedules.straight import Inline
from wamnet.compiler.schedules.tile import Tile
from wamnet.kernels.devices import c_executor
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.whole import forward_whole, rounded
from wamnet.refimpl.network.window import Window

X, Y, TURN = map(name, ("x", "y", "i"))
WRITTEN = Store(RESULT, (Y, X, const(0)), const(1.0))
LOCAL, ITEM = name("local_x"), name("item")

MAIN = """
#include <stdio.h>
#include "denoise.h"
static float result[{count}];
int main(void)
{{
    wamnet_image({images}, weights, result, {width}, {height});
    for (int i = 0; i < {count}; ++i) {{
        printf("%a\\n", (double)result[i]);
    }}
    return 0;
}}
"""


def scheduled(program, shape=None):
    """Return a kernel of a program and its weights: plain, or a tile of (lanes, pixels, vectors, wide)."""
    schedule = Plain(C())
    if shape is not None:
        lanes, pixels, vectors, wide = shape
        schedule = Tile(OpenCL() if wide else C(), lanes=lanes, pixels=pixels, vectors=vectors)
    return schedule.build(program), schedule.pack(program)


def small(*body, images=1, **more):
    """Return a kernel with one image and one channel of a result."""
    interface = denoiser([Image("a", images, -2.0, 2.0)], 1)
    return Kernel(interface, body, **more)


def ran(kernel, size=(2, 3), weights=(0, 0, 0, 0)):
    """Return the first channel of the result of a small kernel, whose image counts pixels."""
    image = np.arange(size[0] * size[1], dtype=np.float32).reshape(*size, 1)
    return run(kernel, {"a": image}, np.float32(weights))[..., 0]


@st.composite
def cases(draw):
    """Draw the parts of a small denoiser, an image's size and a schedule."""
    channels = draw(st.sampled_from([{"a": 1}, {"a": 3}, {"a": 2, "b": 1}]))
    window = draw(st.sampled_from([1, 2, 3, 5, 8, 13]))
    hidden = draw(st.lists(st.integers(1, 6), min_size=1, max_size=2))
    size = draw(st.tuples(st.integers(1, 5), st.integers(1, 7)))
    lanes, vectors = draw(st.sampled_from([1, 2, 4, 16])), draw(st.integers(1, 3))
    shape = (lanes, draw(st.integers(1, 5)), vectors, lanes > 1 and draw(st.booleans()))
    return channels, window, hidden, draw(st.sampled_from(["clamp", "zero"])), size, shape


@settings(max_examples=12)
@given(case=cases())
def test_kernels_are_near_the_reference(kit, case):
    channels, window, hidden, border, size, shape = case
    inputs = window**2 * sum(channels.values())
    program = kit.denoiser(kit.network([inputs, *hidden, 3], (3.0, 5.0)), channels, window, border)
    plan, images = plan_program(program, "opencl"), pictures(channels, size)
    expected = plan.expected(images)
    for each in (None, shape):
        kernel, weights = scheduled(plan.emitted, each)
        result = run(kernel, images, weights)
        assert result.dtype == np.float32
        assert (np.abs(result - expected.value) <= expected.bound).all()


SCHEDULES = {
    "group": Grouped(OpenCL(), pixels=2, group=(4, 2)),
    "group, by components": Grouped(CUDA(), pixels=1, group=(2, 4)),
    "inlined": Inline(GLSL()),
    "packed": Packed(GLSL()),
    "fft": Fourier(OpenCL(), lanes=4, pixels=2, points=4, tiles=2),
    "fft in passes": FourierPasses(GLSLCompute(), points=4),
}


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_other_schedules_are_near_the_reference(kit, schedule, border):
    channels = {"a": 3, "b": 1, "c": 2}
    program = kit.denoiser(kit.network([54, 5, 3], (3.0, 5.0)), channels, 3, border)
    plan, images = plan_program(program, "opencl"), pictures(channels, (3, 5))
    expected, kernel = plan.expected(images), SCHEDULES[schedule].build(plan.emitted)
    weights = SCHEDULES[schedule].pack(plan.emitted)
    far = 4 if schedule.startswith("fft") else 1  # another order of sums, whose own bound is larger
    assert (np.abs(run(kernel, images, weights) - expected.value) <= far * expected.bound).all()


BYTEWISE = {
    "tile": Dot(OpenCL(), lanes=4, pixels=3),
    "group": GroupDot(OpenCL(), pixels=2, group=(4, 2)),
}


@pytest.mark.parametrize("schedule", BYTEWISE)
def test_integer_networks_are_exact(schedule):
    network = rounded(siren.init([36, 7, 5, 3], 3.0, 5.0, seed=2), 3)
    channels = {"a": 3, "b": 1}
    sources = tuple(Image(key, n, -127.0, 127.0, whole=True) for key, n in channels.items())
    gather = Gather(Window(3, "zero"), sources)
    program = trace(lambda x: forward_whole(network, x), {"window": ir.Type(shape=(36,))}, gather)
    plan = plan_program(program, "opencl")
    random = np.random.default_rng(3)
    images = {key: random.integers(-127, 128, (3, 5, n)).astype(np.float32) for key, n in channels.items()}
    kernel, weights = BYTEWISE[schedule].build(plan.emitted), BYTEWISE[schedule].pack(plan.emitted)
    assert np.array_equal(run(kernel, images, weights), plan.expected(images).value)


@pytest.mark.parametrize("shape", [None, (4, 3, 2, False), (16, 5, 1, False)])
@pytest.mark.parametrize(("border", "size"), [("zero", (3, 7)), ("clamp", (1, 1))])
def test_bits_are_those_of_c_without_contraction(executor_named, kit, tmp_path, border, size, shape):
    executor_named("c")
    channels = {"a": 3, "b": 1}
    program = kit.denoiser(kit.network([100, 19, 5, 3], (3.0, 5.0)), channels, 5, border)
    kernel, weights = scheduled(plan_program(program, "c").emitted, shape)
    images = pictures(channels, size)
    result = run(kernel, images, weights)
    source = Renderer(C(), kernel, False, weights).source([]).replace("fp-contract=fast", "fp-contract=off")
    arrays = {"weights": weights, **images}
    texts = {key: ", ".join(float(each).hex() + "f" for each in np.ravel(a)) for key, a in arrays.items()}
    data = [f"static const float {key}[] = {{{text}}};\n" for key, text in texts.items()]
    main = MAIN.format(count=result.size, images="a, b", width=size[1], height=size[0])
    (tmp_path / "denoise.h").write_text(source)
    (tmp_path / "main.c").write_text("".join(data) + main)
    command = os.environ.get(c_executor.COMPILER_VARIABLE, "cc").split()
    options = ["-std=c99", "-O1", "-ffp-contract=off", "-o", "main", "main.c", "-lm"]
    subprocess.run([*command, *options], cwd=tmp_path, check=True)
    lines = subprocess.run(
        ["./main"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout.split()
    bits = np.array([float.fromhex(line) for line in lines], np.float32).view(np.uint32)
    assert np.array_equal(np.ravel(result).view(np.uint32), bits)


@pytest.mark.parametrize(("widths", "size"), [((48, 35, 3), (30, 47)), ((48, 5, 4, 2), (1, 1))])
def test_passes_have_the_bits_of_the_fft_schedule(kit, widths, size):
    """Both add the same numbers in the same order: with several tiles, groups of neurons, for one pixel."""
    program = kit.denoiser(kit.network(list(widths), (3.0, 5.0)), {"a": 3}, 4, "zero")
    plan, images = plan_program(program, "opencl"), pictures({"a": 3}, size)
    one = Fourier(OpenCL(), lanes=16, pixels=2, points=16, tiles=1)
    both = one, FourierPasses(GLSLCompute(), points=16)
    found, other = (run(each.build(plan.emitted), images, each.pack(plan.emitted)) for each in both)
    assert np.array_equal(found, other)


def launched(*bodies):
    """Return a kernel of launches of width x height items, which share two numbers an item."""
    grids = [Launch(("column", "line"), (name("width"), name("height")), body) for body in bodies]
    return small(Array("shared", FLOAT, (name("width") * name("height"),), "device"), *grids)


PLACE = name("line") * name("width") + name("column")
NEXT = apply("minimum", PLACE + 1, name("width") * name("height") - 1)
PUT = Store("shared", (PLACE,), apply("convert", PLACE, value="float32"))


def test_launches_see_what_the_one_before_has_written():
    take = Store(RESULT, (name("line"), name("column"), const(0)), load("shared", NEXT))
    assert np.array_equal(ran(launched((PUT,), (take,))), [[1, 2, 3], [4, 5, 5]])
    with pytest.raises(KernelError, match="an item reads shared where another wrote"):
        ran(launched((PUT, take)))
    with pytest.raises(KernelError, match="two items write one element of shared"):
        ran(launched((Store("shared", (const(0),), const(1.0)),), (take,)))
    with pytest.raises(KernelError, match="shared is read before it is written"):
        ran(launched((take,)))


# ---- statements that no schedule of a program has together ------------------------------------------------


def test_loops_and_branches_of_each_item():
    turns = For("i", X + 1, (Store("n", (), const(1), add=True),), until=apply("not_equal", TURN, Y + 1))
    both = If(
        apply("equal", X, 1), (Store("n", (), const(10), add=True),), (Store("n", (), const(20), add=True),)
    )
    result = Store(RESULT, (Y, X, const(0)), apply("convert", name("n"), value="float32"))
    kernel = small(Array("n", INT, value=const(0)), turns, both, result)
    assert ran(kernel).tolist() == [[21, 11, 21], [21, 12, 22]]


def group_kernel(*between, write=ITEM, read=None):
    """Return a kernel of groups of 4 x 2 items: each writes an element, and reads another item's."""
    read = apply("subtract", const(7), ITEM) if read is None else read
    inside = apply("less", X, name("width")) & apply("less", Y, name("height"))
    load_image = load("image_a", apply("minimum", Y, name("height") - 1), X % name("width"), const(0))
    return small(
        Array("shared", FLOAT, (8,), "group"),
        Store("shared", (write,), load_image),
        *between,
        Let("other", load("shared", read)),
        If(inside, (Store(RESULT, (Y, X, const(0)), name("other", FLOAT)),)),
        group=(4, 2),
    )


def test_groups_share_memory_behind_a_barrier():
    assert ran(group_kernel(Barrier()), (2, 4)).tolist() == [[7, 6, 5, 4], [3, 2, 1, 0]]
    assert ran(group_kernel(Barrier()), (2, 5))[:, :4].tolist() == [[8, 7, 6, 5], [3, 2, 1, 0]]


def test_products_of_bytes():
    """Words of bytes with a sign, times four bytes without one from any place on, or those of a word."""
    rows = [Store("bytes", (const(k),), const(v, BYTE)) for k, v in enumerate((9, 1, 2, 255, 3))]
    word = Expr("pack4", tuple(const(float(each)) for each in (1, -2, 3, 100)), INT)
    words = splat(name("word"), 2)
    four, twice = load("bytes", 1, kind=BYTE.of(4)), call("twice", [name("word")], INT)
    double = Function("twice", (("n", INT),), (Let("m", name("n") + name("n")),), name("m"))
    sums = Array("sums", INT.of(2), value=splat(const(1000), 2))
    adds = [
        Store("sums", (), Expr("dot4", (words, each), INT.of(2)), add=True) for each in (four, name("word"))
    ]
    total = name("sums", INT.of(2)).lane(1) + (twice - name("word"))
    write = Store(RESULT, (Y, X, const(0)), apply("convert", total - name("word"), value="float32"))
    kernel = small(
        Array("bytes", BYTE, (5,)), *rows, Let("word", word), sums, *adds, write, functions=(double,)
    )
    assert (ran(kernel) == 1000 + (1 - 4 + 765 + 300) + (1 + 4 + 9 + 10000)).all()


def test_functions_on_views_step_through_arrays():
    body = (Store("to", (name("leap") * 2,), apply("add", load("from", 0), load("from", name("step")))),)
    fill = For("i", const(8), (Store("v", (TURN,), apply("convert", TURN, value="float32")),))
    views = (View("v", (const(1),), const(3)), View("v", (const(0),), const(2)))
    write = Store(RESULT, (Y, X, const(0)), load("v", const(4)))
    function = Function("add", (("from", FLOAT), ("to", FLOAT)), body)
    kernel = small(Array("v", FLOAT, (8,)), fill, Call("add", views), write, functions=(function,))
    assert (ran(kernel) == 1 + 4).all()
    beyond = (View("v", (const(1),), const(7)), views[1])
    with pytest.raises(KernelError, match="index 8 is beyond v, which has 8"):
        ran(replace(kernel, body=(*kernel.body[:2], Call("add", beyond), write)))


def test_components_of_vectors_and_positions_of_rows():
    four = FLOAT.of(4)
    body = (
        Array("v", four, (2,)),
        Store("v", (const(0),), splat(load("image_a", Y, X), 4)),
        Store("v", (const(1),), load("weights", const(0), kind=four)),
        Let("sum", apply("add", load("v", const(0), kind=four), load("v", const(1), kind=four))),
        Store(RESULT, (Y, X, const(0)), apply("add", name("sum", four).lane(2), load("v", const(7)))),
    )
    result = ran(small(*body, weights=four), weights=(10, 20, 30, 40))
    assert result.tolist() == [[70, 71, 72], [73, 74, 75]]


def test_domains_see_every_operation():
    """A domain that counts the operations on the way to each value."""

    class Depth(Domain):
        dtype = np.int32

        def lift(self, values):
            return np.zeros(np.shape(values), np.int32)

        def apply(self, operation, args):
            return np.maximum.reduce(np.broadcast_arrays(*args)) + 1

    add = For("i", X, (Store("v", (), const(1.0), add=True),))
    kernel = small(Array("v", FLOAT, value=const(0.0)), add, Store(RESULT, (Y, X, const(0)), load("v")))
    depths = run(kernel, {"a": np.zeros((1, 4, 1), np.float32)}, np.zeros(4, np.float32), Depth())
    assert depths[0, :, 0].tolist() == [0, 1, 2, 3]


# ---- errors ------------------------------------------------------------------------------------------------

V = Array("v", FLOAT, (2,))
ERRORS = [
    (
        (V, Store("v", (X,), const(0.0)), WRITTEN),
        r"index 2 is beyond v, which has 2, in the item of pixel \(2, 0\)",
    ),
    ((V, Store("v", (X - 1,), const(0.0)), WRITTEN), "index -1 is beyond v"),
    ((Let("t", load("image_a", Y + 1, X, 0)), WRITTEN), "index 2 is beyond image_a"),
    ((Let("t", load("weights", X + 2)), WRITTEN), "index 4 is beyond weights"),
    (
        (V, Store("v", (const(0),), const(0.0)), Let("t", load("v", const(1))), WRITTEN),
        "v is read before it is written",
    ),
    (
        (V, If(X < 2, (Store("v", (const(0),), const(0.0)),)), Let("t", load("v", const(0))), WRITTEN),
        r"v is read before it is written, in the item of pixel \(2, 0\)",
    ),
    (
        (
            For(
                "i",
                const(2),
                (V, If(TURN < 1, (Store("v", (TURN,), const(0.0)),)), Let("t", load("v", TURN))),
            ),
        ),
        "v is read before",
    ),
    ((V, Store("v", (const(0),), const(1.0), add=True), WRITTEN), "v is read before"),
    (
        (Array("n", INT, (1,)), Store("n", (const(0),), (X + 2**30) * 4), WRITTEN),
        "n is set to an integer that int32 does not hold",
    ),
    ((Let("t", (X - 1) // 2), WRITTEN), "divide of a negative index"),
    ((WRITTEN, WRITTEN), "a channel of the result is written twice"),
    ((Store(RESULT, (Y, const(0), const(0)), const(0.0)),), "a channel of the result is written twice"),
    ((Store(RESULT, (Y, X + 1, const(0)), const(0.0)),), "index 3 is beyond res"),
    ((If(X < 2, (WRITTEN,)),), r"channel 0 of pixel \(2, 0\) of the result is never written"),
]


@pytest.mark.parametrize(("body", "message"), ERRORS)
def test_error(body, message):
    with pytest.raises(KernelError, match=message):
        ran(small(*body))


def test_items_that_are_not_active_make_no_error():
    kernel = small(V, If(X < 2, (Store("v", (X,), const(0.0)), Let("t", load("v", X)))), WRITTEN)
    assert (ran(kernel) == 1).all()


AFTER = Store("shared", (ITEM,), const(0.0))
READ_BY_ONE = (Let("t", load("shared", const(7) - ITEM)), AFTER)
READ_BY_SEVERAL = (Let("t", load("shared", LOCAL)), AFTER)
RACES = [
    (group_kernel(), "reads shared where another wrote"),
    (group_kernel(Barrier(), write=const(0)), "two items write one element of shared"),
    (group_kernel(Barrier(), *READ_BY_ONE), "writes shared where another read"),
    (group_kernel(Barrier(), *READ_BY_SEVERAL), "writes shared where another read"),
]


@pytest.mark.parametrize(("kernel", "message"), RACES)
def test_race(kernel, message):
    with pytest.raises(KernelError, match=message):
        ran(kernel, (2, 4))


def test_loops_end_for_each_item_by_itself():
    """As many turns as an item's column says, and no more than two; an inner loop's break ends that alone."""
    sum_of, result = (
        Array("sum", FLOAT, value=const(0.0)),
        Store(RESULT, (Y, X, const(0)), name("sum", FLOAT)),
    )
    one, inner = Store("sum", (), const(1.0), add=True), For("k", const(3), (Break(const(True)),))
    body = Break(apply("equal", TURN, X)), inner, Break(apply("equal", TURN, 2)), one
    assert np.array_equal(ran(small(sum_of, For("i", const(9), body), result), (1, 5)), [[0, 1, 2, 2, 2]])


def test_lanes_are_numbered_and_tell_whether_any_holds():
    """Entries of a table by the lanes' numbers; an index beyond it is found in any lane."""
    index = apply("add", apply("convert", lanes(4), value="int32"), splat(X, 4))
    entry = Expr("take", (index,), FLOAT.of(4), "table")
    found = any_lane(apply("equal", entry, splat(const(5.0), 4)))
    write = Store(RESULT, (Y, X, const(0)), apply("select", found, const(1.0), const(0.0)))
    long, short = (small(write, tables=(("table", np.arange(n, dtype=np.float32)),)) for n in (6, 5))
    assert np.array_equal(ran(long), [[0, 0, 1]] * 2)
    with pytest.raises(KernelError, match=r"index 5 is beyond table, which has 5, in the item of pixel \(2"):
        ran(short)


def test_a_barrier_that_some_items_miss():
    """`verify` refuses such a kernel, so that the run itself is called."""
    kernel = small(If(LOCAL < 3, (Barrier(),)), WRITTEN, group=(4, 2))
    runner = Runner(kernel, {}, {"width": 4, "height": 2}, Domain())
    with pytest.raises(KernelError, match="a barrier is reached by 6 of 8 items of a group"):
        runner.body(kernel.body)


def test_tables_and_constants():
    """An entry of a table by an item's column; one beyond is an error."""
    entry = Expr("take", (X + name("FIRST"),), FLOAT, "table")
    kernel = small(
        Store(RESULT, (Y, X, const(0)), entry),
        constants=(Constant("FIRST", const(1)),),
        tables=(("table", np.float32([1, 2, 3, 4])),),
    )
    assert ran(kernel).tolist() == [[2, 3, 4], [2, 3, 4]]
    with pytest.raises(KernelError, match="index 4 is beyond table, which has 4"):
        ran(replace(kernel, constants=(Constant("FIRST", const(2)),)))


def test_conditions_choose_between_vectors():
    inside = Let("inside", X < 1)
    value = apply("select", name("inside", BOOL), splat(const(1.0), 2), splat(const(2.0), 2))
    kernel = small(
        inside, Let("v", value), Store(RESULT, (Y, X, const(0)), name("v", Type("float32", 2)).lane(1))
    )
    assert ran(kernel).tolist() == [[1, 2, 2], [1, 2, 2]]
