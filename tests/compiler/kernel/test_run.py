"""Kernels in NumPy: near the float64 reference, the bits of C without contraction, the errors of a run."""

import os
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import pictures
from rough import rough_layers
from second_meanings import INTERPRETED

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
from wamnet.compiler.kernel.run import Runner, run, run_on
from wamnet.compiler.kernel.verify import KernelError, verify
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.cuda import CUDA
from wamnet.compiler.languages.glsl import GLSL, GLSLCompute
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.renderer import Renderer
from wamnet.compiler.plan import plan_program
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.history_kernel import CAMERAS, FIRST, MOTION, PAST, compile_history
from wamnet.compiler.scenes.smooth_kernel import compile_smoothing, smooth_kernel
from wamnet.compiler.schedules.bytes import Dot, GroupDot
from wamnet.compiler.schedules.fft import Fourier
from wamnet.compiler.schedules.group import Grouped
from wamnet.compiler.schedules.passes import FourierPasses
from wamnet.compiler.schedules.plain import Packed, Plain
from wamnet.compiler.schedules.straight import Inline
from wamnet.compiler.schedules.tile import Tile
from wamnet.kernels.devices import c_executor
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
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


# ---- images and planes -----------------------------------------------------------------------------------

SCALES = Normalization(exposure_stops=-1.5)
SIZES = [(5, 7), (3, 17), (1, 1), (2, 33)]


def interpreted(made, arrays, integers, planes):
    """Return what the interpreter writes; `planes`: how many there are of each array that is written."""
    size = integers["height"], integers["width"]
    held = {**arrays, **{key: np.zeros((count, *size), np.float32) for key, count in planes.items()}}
    INTERPRETED[made.role](made, held, integers)
    return {key: held[key] for key in planes}


def same_bits(a, b):
    return np.array_equal(a.view(np.uint32), b.view(np.uint32))


def filled(values, count):
    """Return planes (P, H, W) with rows of whole work items; what is beyond the image is NaN."""
    beyond = -values.shape[-1] % count
    return np.pad(values, ((0, 0), (0, 0), (0, beyond)), constant_values=np.nan)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_the_filter(height, width):
    """SMO-6: a level of 1, 4 and 16 pixels in a work item reads nothing beyond the image."""
    made = compile_smoothing(SCALES, "numpy")
    layers = {f"image_{key}": values for key, values in rough_layers(height, width).items()}
    layers["image_depth"] = layers["image_depth"].reshape(height, width, 1)
    size = {"width": width, "height": height, "row_stride": width}
    guides = {"guides": len(made.guide.programs.guides), "light": 3}
    wanted = interpreted(made.guide, layers, size, guides)
    found = run_on(made.guide.kernel, layers, size)
    assert all(same_bits(found[key], wanted[key]) for key in guides)
    for count in (1, 4, 16):
        kernel = smooth_kernel(made.smooth.programs, count)
        for gap in (1, 4):
            expected = interpreted(made.smooth, wanted, {**size, "gap": gap}, {"result": 3})["result"]
            arrays = {key: filled(values, count) for key, values in wanted.items()}
            sizes = {**size, "gap": gap, "row_stride": arrays["light"].shape[-1]}
            assert same_bits(run_on(kernel, arrays, sizes)["result"][..., :width].copy(), expected)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_the_history(height, width):
    """HIS-8: pixels move by less and by more than the image, and some are behind the camera."""
    random, made = np.random.default_rng(height), compile_history("numpy")
    first = random.uniform(-2, 2, (len(FIRST), height, width)).astype(np.float32)
    past = random.uniform(0, 1, (len(PAST), height, width)).astype(np.float32)
    first[0], past[0] = random.integers(0, 3, (2, height, width))
    first[4:7], past[1:4] = 0.6, 0.6
    motions = np.zeros((3, len(MOTION)), np.float32)
    motions[:, [0, 4, 8, MOTION.index("rests"), MOTION.index("found")]] = 1
    motions[:, MOTION.index("limit")] = 8
    camera = [0, 0, -3, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.7]
    arrays = {
        "first": first,
        "past": past,
        "image_color": random.random((height, width, 3), np.float32),
        "motions": motions,
        "cameras": np.array([*camera, 0.1, *camera[1:]], np.float32),
    }
    assert len(arrays["cameras"]) == len(CAMERAS)
    size = {"width": width, "height": height, "row_stride": width}
    with np.errstate(all="ignore"):
        expected = interpreted(made, arrays, size, {"result": len(PAST)})["result"]
    assert same_bits(run_on(made.kernel, arrays, size)["result"], expected)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_the_encoding(height, width):
    """PPL-5: all channels of all images, of planes that are more than it reads."""
    planes = ("alive", "color_r", "color_g", "color_b", "depth", "normal_x", "normal_y", "normal_z")
    made = compile_encode(("color", "normal", "depth"), SCALES, "numpy", planes=planes)
    sums = np.random.default_rng(1).uniform(-1, 3, (len(planes), height, width)).astype(np.float32)
    size = {"width": width, "height": height, "sample_count": 3}
    written = {
        f"image_{image.name}": np.zeros((height, width, image.channels), np.float32) for image in made.images
    }
    INTERPRETED[made.role](made, {"sums": sums, **written}, size)
    found = run_on(made.kernel, {"sums": sums}, size)
    assert found.keys() == written.keys()
    assert all(same_bits(found[key], written[key]) for key in written)


def test_a_read_beyond_the_image_is_an_error():
    made = compile_smoothing(SCALES, "numpy").smooth
    kernel, row = made.kernel, load("light", 0, name("y"), name("x") + 1)
    wrong = replace(kernel, body=(*kernel.body, Let("beyond", row)))
    planes = {key: np.zeros((count, 2, 3), np.float32) for key, count in (("guides", 10), ("light", 3))}
    with pytest.raises(KernelError, match="index 3 is beyond light, which has 3, in the item of pixel"):
        run_on(wrong, planes, {"width": 3, "height": 2, "row_stride": 3, "gap": 1})


WRONG = {
    "a written plane": (Let("a", load("result", 0, name("y"), name("x"))), "the result is read"),
    "a plane to read": (Store("light", (const(0), name("y"), name("x")), const(0.0)), "which is read only"),
    "a plane too much": (Let("a", load("light", 3, name("y"), name("x"))), "index 3 is beyond light"),
    "two indices": (Let("a", load("light", name("y"), name("x"))), "light has 3 indices, not 2"),
    "a row at one index": (
        Let("a", load("light", 0, name("y"), name("x"), kind=FLOAT.of(4)).lane(4)),
        "component 4 does not exist",
    ),
}


@pytest.mark.parametrize(("statement", "message"), WRONG.values(), ids=WRONG)
def test_what_is_refused(statement, message):
    kernel = compile_smoothing(SCALES, "numpy").smooth.kernel
    with pytest.raises(KernelError, match=message):
        verify(replace(kernel, body=(*kernel.body, statement)))
