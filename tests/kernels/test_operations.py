"""Each operation of the IR on each executor: a function of one pixel, on ordinary and on awkward numbers."""

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ops import LOOPS, OPS
from wamnet.compiler.core.profiles import EMITTED_COSINE
from wamnet.compiler.kernel.interface import BOTH, READ, TRAIN, Array, Interface
from wamnet.compiler.kernel.kernel import FLOAT, Kernel, Launch, Store, apply, const, load, name
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.renderer import Renderer
from wamnet.compiler.proof.bounds import NO_BOUND
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import LANES, language_named
from wamnet.refimpl import rng
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings

W = np.array([[1.5, -2.0, 0.25, 3.0], [0.1, 0.2, -0.3, 0.7]], np.float32)
B = np.array([0.1, -0.2, 0.3, 1e-3], np.float32)

T = np.array([0.25, -3.0, 1e-3, 7.0, 0.5, 2.0, -1.0], np.float32)
K = np.array([5, -7, 123456789], np.int32)
F = np.array([True, False, True])


def words(x):
    """Return integers up to 2000."""
    return (np.absolute(x) * 1000.0).astype(np.uint32)


def index(x, limit):
    """Return an index below `limit`."""
    return np.minimum(np.floor(np.absolute(x[..., 0]) * 3.0).astype(np.int32), limit)


def look_up(table, x):
    i = index(x, len(table) - 1)
    return np.take(np.asarray(table, like=i), i)


def floats(truth):
    return np.where(truth, np.float32(1), np.float32(2))


def hashed(x):
    """Return four random numbers from four counters."""
    w = (np.absolute(x) * 2.0**20).astype(np.uint32) * np.uint32(4093)
    return np.stack(rng.uniforms(*(w[..., i] for i in range(4))), axis=-1)


CASES = {
    "input": lambda x: x,
    "constant": lambda x: x * 0.1,
    "parameter": lambda x: np.maximum(x, B),
    "affine": lambda x: np.matmul(np.matmul(x, W.T), W),
    "add": lambda x: x + x[..., 1][..., None],
    "subtract": lambda x: x - x[..., 2][..., None],
    "multiply": lambda x: x * x[..., 3][..., None],
    "divide": lambda x: x / (x[..., 0] + 3.0)[..., None],
    "negative": lambda x: -x,
    "absolute": lambda x: np.absolute(x),
    "minimum": lambda x: np.minimum(x, x[..., 0][..., None]),
    "maximum": lambda x: np.clip(x, -0.5, x[..., 1][..., None]),
    "floor": lambda x: np.floor(x * 1.5),
    "sqrt": lambda x: np.sqrt(np.absolute(x)),
    "power": lambda x: (np.absolute(x) + 0.003) ** (1 / 2.4) + (x + 2.5) ** 2.4,
    "exp": lambda x: np.exp(3.0 * x) + np.exp(-40.0 * np.absolute(x)),
    "sin": lambda x: np.sin(1000.0 * x),
    "stack": lambda x: np.stack([x[..., 3], 0.5 * x[..., 0], x[..., -2]], axis=-1),
    "component": lambda x: x[..., 2] * x[..., 1] + 1.0,
    "reciprocal": lambda x: np.reciprocal(x + 3.0),
    "cos": lambda x: np.cos(1.5 * x),
    "less": lambda x: floats(x < x[..., 1][..., None]),
    "less_equal": lambda x: floats(x <= 2.0),
    "greater": lambda x: floats(words(x) > np.uint32(700)),
    "greater_equal": lambda x: floats(words(x).astype(np.int32) >= 2000),
    "equal": lambda x: floats(x == 0.0),
    "not_equal": lambda x: floats(words(x) != words(x)[..., 2][..., None]),
    "logical_and": lambda x: floats((x > 0.0) & (x < 1.0)),
    "logical_or": lambda x: floats((x < 0.0) | (x > 1.0)[..., 1][..., None]),
    "logical_not": lambda x: floats(~(x < 0.0)),
    "bitwise_and": lambda x: (words(x) & words(x)[..., 1][..., None]).astype(np.float32),
    "bitwise_xor": lambda x: (words(x) ^ words(x)[..., 1][..., None]).astype(np.float32),
    "right_shift": lambda x: (words(x) >> np.uint32(3)).astype(np.float32),
    "select": lambda x: np.where(x < 0.5, x, np.maximum(words(x).astype(np.int32), 7).astype(np.float32)),
    "convert": lambda x: (x * 100.0).astype(np.int32).astype(np.float32),
    "take": lambda x: np.stack(
        [look_up(T, x), look_up(K, x).astype(np.float32), floats(look_up(F, x)), x[..., 1]], axis=-1
    ),
}
"""One function for each operation, named after it."""

EXACT = (
    *("less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "logical_and", "logical_or"),
    *(
        "logical_not",
        "bitwise_and",
        "bitwise_xor",
        "right_shift",
        "select",
        "convert",
        "take",
        "minimum",
        "negative",
        "stack",
    ),
)
"""Cases that every executor computes to the bit: integers, decisions, and floats rounded once."""

AWKWARD = [0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 1 / 3, 2 / 3, 1e-20, -1e-40, 0.66666669, 1.9999999]
"""Zeros of both signs, integers after scaling, denormals, neighbours of integers."""


@pytest.fixture(scope="module")
def image():
    random = np.random.default_rng(3)
    values = np.concatenate([random.uniform(-2, 2, 36), np.array(AWKWARD)])
    return random.permutation(np.repeat(values, 4)).reshape(6, 8, 4).astype(np.float32)


def test_every_operation_has_a_case():
    """Loops are only in kernels of paths: tests/kernels/test_tables.py."""
    assert set(CASES) == set(OPS) - set(LOOPS)


def test_operations_without_a_bound_are_tested_without_one():
    assert set(NO_BOUND) <= {*EXACT, "cos"}


@pytest.mark.product
@pytest.mark.parametrize("op", CASES)
def test_operation_on_executor(denoiser, kit, image, op):
    program = kit.program(CASES[op], {"a": 4})
    if {node.op for node in program.nodes} & set(NO_BOUND):
        assert op in {*EXACT, "cos", "greater", "greater_equal"}
        return  # exact, as the next test says, or without a promise
    assert op in {node.op for node in program.nodes}
    assert kit.excess(denoiser, program, {"a": image}) <= 1


@pytest.mark.parametrize("op", EXACT)
def test_operation_is_exact(denoiser, kit, image, op):
    image = np.where(np.abs(image) < 1e-30, np.float32(0), image)  # denormals may be flushed
    program = kit.program(CASES[op], {"a": 4})
    found = denoiser.run(compile_program(program, denoiser.name), {"a": image})
    (expected,) = interpret(program, {"window": image}).values()
    assert np.array_equal(found, expected)


def test_random_numbers_are_those_of_the_reference(denoiser, kit, image):
    program = kit.program(hashed, {"a": 4})
    found = denoiser.run(compile_program(program, denoiser.name), {"a": image})
    assert np.array_equal(found, hashed(image))
    assert len(np.unique(found)) > 100


def test_cosine_without_a_bound_is_near(denoiser, kit, image):
    """Every target's cosine is right to 2^-11 on [-pi, pi], and the emitted one to its contract."""
    program = kit.program(lambda x: np.cos(1.5 * x), {"a": 4})
    exact = np.cos((np.float32(1.5) * image).astype(np.float64))
    for profile, error in (("ieee", EMITTED_COSINE.error), ("native", 2.0**-11)):
        artifact = compile_program(program, language_named(denoiser.name).under(profile))
        assert artifact.manifest["bound"]["output"] is None
        assert np.max(np.abs(denoiser.run(artifact, {"a": image}) - exact)) <= error


def test_all_operations_compile_without_a_window_of_one(denoiser, kit):
    """A value that is read in loops, in straight code and by two affine maps, with a window of 2."""

    def function(x):
        first = np.sin(np.matmul(x, np.ones((3, 16), np.float32).T))
        again = np.matmul(x, np.full((3, 16), 0.5, np.float32).T)
        return first * again[..., 1][..., None] + x[..., 5][..., None]

    program = kit.program(function, {"a": 4}, size=2, border="zero")
    images = {"a": np.random.default_rng(4).uniform(-2, 2, (3, 5, 4)).astype(np.float32)}
    assert kit.excess(denoiser, program, images) <= 1


def test_constant_output(denoiser, kit):
    artifact = compile_program(kit.program(lambda x: 0.25, {"a": 1}), denoiser.name)
    found = denoiser.run(artifact, {"a": np.zeros((2, 3, 1), np.float32)})
    assert np.array_equal(found, np.full((2, 3, 1), 0.25, np.float32))


# ---- operators on vectors --------------------------------------------------------------------------------

EDGES = [0.0, -0.0, 0.25, -0.25, 1.0, -1.0, 2.5, -2.5, 1e30, -1e30, 2.0**23 - 0.5, 0.5 - 2.0**23, 2.0**31]
"""Numbers where a floor by cutting off, or a comparison in place of a function, could go wrong."""


@pytest.mark.parametrize("lanes", LANES[1:])
@pytest.mark.parametrize("operation", ["absolute", "floor", "minimum", "maximum"])
def test_operators_on_vectors_compute_what_numpy_computes(executor_named, lanes, operation):
    """All pairs of the edges; equal to the bit, except for the sign of zero, which comparisons do not see."""
    arity = OPS[operation].arity
    a, b = (part.ravel().astype(np.float32) for part in np.meshgrid(EDGES, EDGES))
    a, b = (np.resize(part, -(-len(a) // lanes) * lanes) for part in (a, b))
    found = on_vectors(executor_named("opencl")._context, lanes, operation, a, b)
    assert np.array_equal(found, OPS[operation].definition(*(a, b)[:arity]))


def on_vectors(context, lanes, operation, a, b):
    """Return the operation on arrays of whole vectors, as OpenCL C has it."""
    cl = pytest.importorskip("pyopencl")
    kinds = {"a": READ, "b": READ, "c": BOTH}
    arrays = tuple(Array(key, access, (len(a) // lanes,), lanes=lanes) for key, access in kinds.items())
    values = [load(key, name("i"), kind=FLOAT.of(lanes)) for key in ("a", "b")]
    value = apply(operation, *values[: OPS[operation].arity])
    launch = Launch(("i",), (const(len(a) // lanes),), (Store("c", (name("i"),), value),), "run")
    kernel = Kernel(Interface(TRAIN, arrays, ()), (launch,), step=(const(lanes), const(1)))
    flags, result = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR, np.empty_like(a)
    buffers = [cl.Buffer(context, flags, hostbuf=part) for part in (a, b)][: OPS[operation].arity]
    output = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, result.nbytes)
    with cl.CommandQueue(context) as queue:
        program = cl.Program(context, Renderer(OpenCL(), kernel, False).source([])).build()
        program.wamnet_run(queue, (len(a) // lanes,), None, *buffers, output)
        cl.enqueue_copy(queue, result, output)
    return result


def test_a_kernel_calls_floor_where_its_program_has_it():
    """The sine's range reduction has it; native kernels call the device's sine."""
    scene = lower_scene(scenes.furnace(), Settings())
    assert " = FLOOR(" in compile_path(scene, "opencl", lanes=16).source
    assert " = FLOOR(" not in compile_path(scene, language_named("opencl").under("native"), lanes=16).source
