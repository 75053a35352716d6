"""Operators in place of functions on vectors of paths: what NumPy computes, on every length of vector."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.core.ops import OPS
from wamnet.compiler.kernel.interface import BOTH, READ, TRAIN, Array, Interface
from wamnet.compiler.kernel.kernel import FLOAT, Kernel, Launch, Store, apply, const, load, name
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.renderer import Renderer
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import LANES, language_named
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings

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
