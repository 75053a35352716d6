"""The emitted sines on each executor: at hard points, and beyond their domain."""

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import sine
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.targets import language_named
from wamnet.refimpl.network.window import Window

DEGREES = sorted(sine.POLYNOMIALS)
NUMPY = 2.0**-50
"""What NumPy's float64 sine may be off: tests/compiler/test_sine.py."""

KINDS = {"sine": (np.sin, sine.DOMAIN, "error"), "cosine": (np.cos, sine.COSINE_DOMAIN, "cosine_error")}
"""Each function with its domain, and the name of its bound."""


def values(executor, kind, degree, x):
    """Return what the executor computes (N,) at x (N,)."""
    function, domain, _ = KINDS[kind]
    gather = Gather(Window(1, "clamp"), (Image("a", 1, -domain, domain),))
    program = trace(lambda window: function(window), {"window": Type(shape=(1,))}, gather)
    artifact = compile_program(program, language_named(executor.name).under(f"ieee-sine{degree}"))
    return unchecked(executor, artifact, np.asarray(x, np.float32).reshape(-1, 1, 1)).reshape(-1)


def unchecked(executor, artifact, image):
    """Run on an image that may break its range: `run` would refuse it."""
    executor.build(artifact, image.shape[:2])
    with np.errstate(all="ignore"):
        return executor._run(artifact, {"a": image})


def hard(domain):
    """Return float32 neighbours (N,) of some k pi / 4 up to the domain, ends, denormals, both zeros."""
    k = np.concatenate([np.arange(300), np.linspace(300, domain / np.pi * 4, 900).astype(int)])
    near = np.concatenate([k * (np.pi / 4), [domain, 1.0, 0.0, 1e-40, 2.0**-126, 2.0**-149]]).astype(
        np.float32
    )
    near = np.concatenate([near, *(np.nextafter(near, np.float32(end)) for end in (np.inf, -np.inf))])
    near = np.concatenate([near, -near])
    return near[np.abs(near) <= domain]


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("kind", KINDS)
def test_hard_arguments_on_executor(executor, kind, degree):
    function, domain, name = KINDS[kind]
    x = hard(domain)
    found = values(executor, kind, degree, x)
    off = np.abs(found - function(x.astype(np.float64)))
    assert np.max(off) + NUMPY <= getattr(sine.POLYNOMIALS[degree], name)
    assert np.max(np.abs(found)) <= 1


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("kind", KINDS)
def test_beyond_the_domain_on_executor(executor, kind, degree):
    """A number gives +0, to the bit; an infinity and NaN give NaN."""
    domain = np.float32(KINDS[kind][1])
    numbers = [np.nextafter(domain, np.float32(np.inf)), 3e4, 1e6, 1e9, 1e20, 1e38, np.finfo(np.float32).max]
    found = values(executor, kind, degree, [*numbers, *(-number for number in numbers)])
    assert np.array_equal(found.view(np.uint32), np.zeros(14))
    assert np.isnan(values(executor, kind, degree, [np.inf, -np.inf, np.nan])).all()


@pytest.mark.parametrize("name", ["numpy", "opencl", "opengl-egl", "opengl-osmesa"])
def test_beyond_the_domain_in_vectors(executor_named, kit, name):
    """The schedules of vectors choose in their own words: between two affine maps, where they hold sines."""
    executor, eye = executor_named(name), np.eye(3, dtype=np.float32)
    program = kit.program(lambda x: np.matmul(np.sin(np.matmul(x, 6000.0 * eye)), eye), {"a": 3})
    image = np.zeros((6, 1, 3), np.float32)
    image[:, 0, 0] = [1.0, 2.2, -2.2, 1e30, np.inf, np.nan]
    known = {"opencl": ("tile:16", "tile:8", "vector:16"), "opengl": ("inlined",), "c": ("tile:16", "tile:4")}
    schedules = known.get(executor.name, ())
    for schedule in ("plain", *schedules):
        artifact = compile_program(program, executor.name, schedule)
        assert artifact.manifest["schedule"]["name"] == schedule
        found = unchecked(executor, artifact, image)
        assert abs(found[0, 0, 0] - np.sin(6000.0)) <= artifact.manifest["bound"]["output"][0]
        assert np.array_equal(found[1:4, 0, 0], np.zeros(3))
        assert np.isnan(found[4:, 0, 0]).all()


@pytest.mark.parametrize("degree", DEGREES)
def test_zeros_on_executor(executor, degree):
    found = values(executor, "sine", degree, [0.0, -0.0])
    assert np.array_equal(found.view(np.uint32), [0, 0])
