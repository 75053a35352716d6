"""Sources are read back as the kernels that they are; whatever else they may say is refused."""

import random
import re
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import untrained

from wamnet.compiler.core.ir import Image
from wamnet.compiler.kernel.interface import RESULT, denoiser
from wamnet.compiler.kernel.kernel import (
    BOOL,
    FLOAT,
    INT,
    Array,
    Block,
    Comment,
    Constant,
    Expr,
    For,
    If,
    Kernel,
    Let,
    Store,
    apply,
    const,
    load,
    name,
)
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.cuda import CUDA
from wamnet.compiler.languages.glsl import GLSL
from wamnet.compiler.languages.glsl_buffers import Vulkan
from wamnet.compiler.languages.metal import Metal
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.renderer import Renderer
from wamnet.compiler.languages.wgsl import WGSL
from wamnet.compiler.parsing.expressions import binds
from wamnet.compiler.parsing.grammar import LANGUAGES as GRAMMARS
from wamnet.compiler.parsing.parse import Unread, parse
from wamnet.compiler.plan import plan_program
from wamnet.compiler.reading.check import passes_of
from wamnet.compiler.schedules.plain import Plain
from wamnet.compiler.schedules.tile import Tile
from wamnet.compiler.targets import LANGUAGES as TARGETS
from wamnet.compiler.variants import plan_model
from wamnet.refimpl.network.activation import RELU
from wamnet_course.canonical import canonical

LANGUAGES = {
    dialect.target: dialect for dialect in (OpenCL(), C(), CUDA(), Metal(), GLSL(), Vulkan(), WGSL())
}
X, Y, F, G, N, M = name("x"), name("y"), *(name(n, FLOAT) for n in "fg"), *map(name, "nm")


def read(source, target, kernel):
    """Return a source's kernel; textures do not state their channels."""
    arrays = kernel.interface.arrays
    found = parse(source, target, {a.name: a.shape[-1] for a in arrays} if target == "opengl" else None)
    return canonical(found)


def tiled(program, target, lanes=4, pixels=3, vectors=2):
    """Return a tile of a language and its weights."""
    tile = Tile(OpenCL() if target == "opencl" else C(), lanes=lanes, pixels=pixels, vectors=vectors)
    return tile.build(program), tile.pack(program)


def plain(program):
    """Return the plain kernel of a program."""
    return Plain(C()).build(program)


def pack(program):
    """Return the weights of the plain kernel."""
    return Plain(C()).pack(program)


def rendered(kernel, target, weights, bounded=True):
    """Return the source of a kernel."""
    return Renderer(LANGUAGES[target], kernel, bounded, weights).source(["a comment", "of two lines"])


@settings(max_examples=4)
@given(
    window=st.integers(1, 4),
    hidden=st.lists(st.integers(1, 9), max_size=2),
    border=st.sampled_from(["clamp", "zero"]),
    relu=st.booleans(),
    shape=st.tuples(st.sampled_from([2, 4, 16]), st.integers(1, 5), st.integers(1, 3)),
    bounded=st.booleans(),
)
def test_round_trip(kit, window, hidden, border, relu, shape, bounded):
    network = kit.network([window**2 * 4, *hidden, 3], (3.0, 5.0), activation=RELU if relu else "sine")
    program = plan_program(kit.denoiser(network, {"a": 3, "b": 1}, window, border), "opencl").emitted
    for target in LANGUAGES:
        kernel = plain(program)
        assert read(rendered(kernel, target, pack(program), bounded), target, kernel) == canonical(kernel)
    for target in ("opencl", "c"):
        kernel, weights = tiled(program, target, *shape)
        assert read(rendered(kernel, target, weights, bounded), target, kernel) == canonical(kernel)


SCHEDULES = [
    (target, schedule) for target in TARGETS if target in GRAMMARS for schedule in TARGETS[target].schedules
]
"""All schedules of all languages that are read."""


def emitted(target, schedule, border="clamp"):
    """Return the kernel of a schedule in a language, of a small network that it holds, and its source."""
    size = 7 if schedule.startswith("fft") else 3
    model = untrained((34 if size > 3 else 18, 5), ("color", "depth"), size, border, (1.0, 3.0))
    plan = plan_model(model, target, schedule=schedule, variant="whole8" if "dot" in schedule else "full")
    assert plan.schedule.name == schedule
    details = plan.schedule.details(plan.emitted)
    passes = passes_of(details)
    source = plan.schedule.renderer(plan.emitted, True).source(["a comment"])
    return plan.schedule.kernel(plan.emitted), source, passes


def read_back(source, target, kernel, passes=None):
    """Return a source's kernel; some languages' textures do not state their channels."""
    channels = {a.name: a.shape[-1] for a in kernel.interface.arrays}
    rounds = "dot4" not in str(kernel.body)
    return canonical(parse(source, target, channels if GRAMMARS[target].texels else None, rounds, passes))


# ---- what no schedule says ---------------------------------------------------------------------------------


def small(*body, **more):
    """Return a kernel with two images and one channel of a result."""
    images = [Image("a", 3, -2.0, 2.0), Image("b", 1, -2.0, 2.0)]
    first = [Let(each, load(f"image_{each}", Y, X, 0)) for each in "ab"]
    return Kernel(denoiser(images, 1), (*first, *body), **more)


WRITE = Store(RESULT, (Y, X, const(0)), F)
STATEMENTS = small(
    Comment("a comment"),
    Array("v", FLOAT, (2, name("PIXELS") + 1)),
    Let("n", (X + (Y - 2)) % 3),
    Array("f", FLOAT, value=const(-0.25), kept=True),
    Array("k", INT),
    Store("k", (), const(3)),
    Store("f", (), apply("negative", F)),
    Store("f", (), apply("negative", apply("negative", F))),
    If(apply("not_equal", N, 1), (Store("f", (), const(1.0), add=True),), (Block((Let("m", name("k")),)),)),
    For("i", X, (Store("v", (const(1), name("i")), F),), start=N, step=const(2), until=name("i") < Y),
    For("j", const(2), (Let("g", load("v", name("j"), 0), kept=True),), "unroll"),
    Let("row", load("image_a", Y, X * 3 + N)),
    WRITE,
    constants=(Constant("PIXELS", const(3), "pixels"),),
)


@pytest.mark.parametrize("target", LANGUAGES)
def test_statements(target):
    kernel = STATEMENTS
    if target == "opengl":  # textures have no positions of rows, GLSL 3.30 no arrays of arrays
        body = (s for s in kernel.body if getattr(s, "name", "") not in ("row", "v", "i", "j"))
        kernel = replace(kernel, body=tuple(body))
    if target == "c":  # WAMNET_UNROLL is defined beside vectors
        loops = (replace(s, how="loop") if isinstance(s, For) else s for s in kernel.body)
        kernel = replace(kernel, body=tuple(loops))
    assert read(rendered(kernel, target, np.zeros(4, np.float32)), target, kernel) == canonical(kernel)


def floats(inner):
    """Return a strategy of expressions of floats, of conditions, and of integers around smaller ones."""
    operator = st.sampled_from(["add", "subtract", "multiply", "divide", "minimum", "maximum"])
    compared = st.sampled_from(["less", "less_equal", "greater", "equal", "not_equal"])
    both = st.tuples(inner, inner)
    condition = st.builds(lambda op, ab: Expr(op, ab, BOOL), compared, both)
    joined = st.builds(
        lambda op, a, b: Expr(op, (a, b), BOOL),
        st.just("logical_and"),
        condition,
        condition,
    )
    return st.one_of(
        st.builds(lambda op, ab: Expr(op, ab, FLOAT), operator, both),
        st.builds(
            lambda op, a: Expr(op, (a,), FLOAT), st.sampled_from(["absolute", "floor", "negative"]), inner
        ),
        st.builds(lambda c, ab: Expr("select", (c, *ab), FLOAT), st.one_of(condition, joined), both),
    )


def integers(inner):
    """Return a strategy of expressions of integers around smaller ones."""
    operator = st.sampled_from(["add", "subtract", "multiply", "divide", "remainder"])
    return st.builds(lambda op, a, b: Expr(op, (a, b), INT), operator, inner, inner)


FLOATS = st.recursive(
    st.one_of(st.sampled_from([F, G]), st.floats(0.0, 1e6, width=32).map(const)), floats, max_leaves=9
)
INTEGERS = st.recursive(
    st.one_of(st.sampled_from([N, M]), st.integers(0, 99).map(const)), integers, max_leaves=9
)


@settings(max_examples=25)
@given(value=FLOATS, index=INTEGERS)
def test_expressions(value, index):
    """The parentheses that are left out are those that no language needs."""
    lets = (
        Let("n", X),
        Let("m", Y),
        Let("f", const(0.5)),
        Let("g", const(1.5)),
        Let("t", value),
        Let("k", index),
    )
    kernel = small(*lets, WRITE)
    for target in LANGUAGES:
        assert read(rendered(kernel, target, np.zeros(4, np.float32)), target, kernel) == canonical(kernel)


# ---- what is refused ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tiny(kit):
    """The program of a small network."""
    program = kit.denoiser(kit.network([8, 2, 2], (3.0, 5.0), activation=RELU), {"a": 1, "b": 1}, 2, "zero")
    return plan_program(program, "opencl").emitted


KINDS = [*((target, "plain") for target in LANGUAGES), ("opencl", "tile"), ("c", "tile")]
USUAL = [
    "opencl-vector:16", "opencl-fft:16", "opencl-dot:16", "opencl-group:2", "c-tile:8", "c-fft:4", "c-dot:16",
    "cuda-groupdot:4", "cuda-group:4", "opengl-inlined", "opengl-group:1", "glsl-es-packed", "metal-tile:4",
    "metal-group:1", "wgsl-group:4", "wgsl-tile:4", "glsl-compute-group:1", "glsl-vulkan-tile:4",
    "glsl-vulkan-groupdot:4", "glsl-vulkan-fftpasses:32",
]  # fmt: skip
"""Each schedule in a language, and each language with some: one renderer and one reader have all of them."""
SIGNS = re.findall(
    r"\S+", "+ - * / < <= > && 0 1 2 i j x y dx row column width height ( ) [ ] { } ; , float int ="
)
ATTRIBUTES = ("PRECISE", "WAMNET_UNROLL", "pragma", "unroll")
"""What says how a kernel is compiled, and not what it computes."""


def every_token_counts(source, known, reads, count):
    """Insist that a source in which one token is another, or is missing, is refused or another kernel."""
    source = re.sub(r"/\*.*?\*/", "", source, flags=re.S)
    original = reads(source)
    assert original == canonical(known)
    drawn = random.Random(source)
    tokens = [token for token in re.finditer(r"\w+|[^\w\s]+", source) if token[0] not in ATTRIBUTES]
    for token in drawn.sample(tokens, count):
        changed = source[: token.start()] + drawn.choice(["", *SIGNS]) + source[token.end() :]
        with suppress(Unread):
            place = changed[token.start() - 60 : token.end() + 60]
            assert changed.split() == source.split() or reads(changed) != original, place


@pytest.mark.parametrize(("target", "schedule"), KINDS)
def test_every_token_counts(tiny, target, schedule):
    kernel, weights = (plain(tiny), pack(tiny)) if schedule == "plain" else tiled(tiny, target)
    every_token_counts(rendered(kernel, target, weights), kernel, lambda text: read(text, target, kernel), 20)


@pytest.mark.nightly(but=USUAL)
@pytest.mark.parametrize(("target", "schedule"), SCHEDULES)
def test_every_schedule_reads_back(target, schedule):
    """KER-26: a source is the kernel that its schedule has built; with another token it is not."""
    kernel, source, passes = emitted(target, schedule, "zero" if len(schedule) % 2 else "clamp")
    every_token_counts(source, kernel, lambda text: read_back(text, target, kernel, passes), 2)


REFUSED = [
    ("#define PIXELS 3", "#define v1 3", "begins with no token"),
    ("#define PIXELS 3", "#define PIXELS 1 + 2", "is not a constant"),
    ("#define PIXELS 3", "#define PIXELS 3\n#define PIXELS 3", "its second value"),
    ("#define PIXELS 3", "#define PIXELS (1) + (2)", "not in parentheses"),
    ("j < 2;", "j < 02;", "begins with no token"),
    ("float v1[2];", "float v1[2]; // all", "which languages read differently"),
    ("float v1[2];", "float v1[2]; \\\n", "which languages read differently"),
    ("float v1[2];", "float v1[2]; /* \N{GREEK SMALL LETTER ALPHA} */", "beyond printable ASCII"),
    ("float v1[2];", "float v1[2]; int clamp = 0;", "'clamp' is not a name of a value"),
    ("v1[j] += part1[j]", "v1[j] += part2[j]", "part2 is not declared"),
    ("part1[j] = 0.0f", "part1[j] = 0.50000002980232238769531250000001f", "half-way between two"),
    ("part1[j] = 0.0f", "part1[j] = 0.0", "begins with no token"),
    ("part1[j] = 0.0f", "part1[j] = --v1[j]", "'--' is not a value"),
    ("part1[j] = 0.0f", "part1[j] = 0x0", "begins with no token"),
    ("float v1[2];", "float v1[2]; int q = 4294967297;", "4294967297, which int32 does not hold"),
    ("part1[j] = 0.0f", "part1[j] = 0.0f + j", "part1 of type .* has a value of type"),
    ("v1[j] += part1[j];", "v1[j] += part1[j]; j = 0;", "j is not an array"),
    ("part1[j] = 0.0f", "part1[j] = tan(0.0f)", "tan is not a function of the language"),
    ("float v1[2];", "float v1[2]; v1[2] = 0.0f;", "index 2 is beyond v1"),
    ("    int x = (int)get", "    width = 1;\n    int x = (int)get", "not a frame of opencl"),
    (
        "__kernel void",
        "float twice(float a) { return a; }\n__kernel void",
        "'twice' is not a name of a value",
    ),
    ("image_a,\n", "image_a,\n    __global const float *restrict image_a,\n", "images in two orders"),
    (
        "image_a[(row * width + column) * 1 + c]",
        "image_a[(row * width + column) * 2 + c]",
        "image_a has two numbers of channels",
    ),
    ("(y * width + x)", "(y * height + x)", "without its row"),
    pytest.param("part1[j] = 0.0f", f"part1[j] = {'(' * 9999}0.0f{')' * 9999}", "recursion", id="deep"),
]


@pytest.mark.parametrize(("old", "new", "reason"), REFUSED)
def test_refused(tiny, old, new, reason):
    kernel = plain(tiny)
    kernel = replace(kernel, constants=(*kernel.constants, Constant("PIXELS", const(3))))
    source = rendered(kernel, "opencl", pack(tiny))
    channels = {"image_a": 1}
    assert canonical(parse(source, "opencl", channels)) == canonical(kernel)
    with pytest.raises(Unread, match=reason):
        parse(source.replace(old, new, 1), "opencl", channels)


def test_a_step_of_another_language_is_refused(tiny):
    """WGSL has `j++` as a statement, and not `++j`."""
    source = rendered(plain(tiny), "wgsl", pack(tiny))
    assert "j++) {" in source
    with pytest.raises(Unread, match="no 'j'"):
        parse(source.replace("j++) {", "++j) {", 1), "wgsl", {"image_a": 1})


@pytest.mark.parametrize(
    ("sign", "first", "second", "right"),
    [
        ("+", "*", "-", True), ("&&", "<", "&&", False), ("&&", "&&", "<", True), (">>", "+", "", False),
        ("&", "", ">>", False), ("^", "^", "", True), ("<", ">>", "+", True), ("+", "", "&", False),
    ],
)  # fmt: skip
def test_operators_that_need_brackets_in_wgsl(sign, first, second, right):
    assert binds(sign, first, second) == right


def test_sums_are_declared_precise(tiny):
    """PRO-6: GLSL may change the order of other sums."""
    kernel = plain(tiny)
    source = rendered(kernel, "opengl", pack(tiny))
    arrays = [array for array in kernel.interface.arrays if array.is_image or array.name == RESULT]
    channels = {array.name: int(array.shape[-1]) for array in arrays}
    assert parse(source, "opengl", channels, bounded=True)
    loose = source.replace("PRECISE float part1", "float part1", 1)
    assert loose != source
    assert parse(loose, "opengl", channels)
    with pytest.raises(Unread, match="part1 is not declared PRECISE"):
        parse(loose, "opengl", channels, bounded=True)
    total = small(
        Array("t", FLOAT, value=const(0.0)), Store("t", (), load("image_b", Y, X, 0), add=True), WRITE
    )
    loose = rendered(total, "opengl", np.zeros(4, np.float32)).replace("PRECISE float t", "float t", 1)
    with pytest.raises(Unread, match="t is not declared PRECISE"):
        parse(loose, "opengl", {"image_a": 3, "image_b": 1}, bounded=True)
