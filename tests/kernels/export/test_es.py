"""GLSL ES 3.00 (EXP-1, EXP-2): what the language asks for, and the bound of its schedules."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.export.gl_runner import ESRunner
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings


@pytest.fixture(scope="module")
def runner(executor_named):
    executor_named("opengl-egl")
    with ESRunner("egl") as opened:
        yield opened


@pytest.fixture(scope="module")
def case(kit):
    program = kit.denoiser(kit.network([100, 7, 5, 3], (3.0, 5.0)), {"a": 3, "b": 1}, 5, "zero")
    random = np.random.default_rng(1)
    images = {name: random.uniform(-2, 2, (6, 9, n)).astype(np.float32) for name, n in (("a", 3), ("b", 1))}
    return program, images


@pytest.mark.parametrize("schedule", ["plain", "inlined", "packed"])
def test_denoiser_keeps_its_bound(runner, kit, case, schedule):
    """EXP-1, WEB-5."""
    artifact = compile_program(case[0], "glsl-es", schedule=schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    assert kit.excess(runner, *case, artifact) <= 1


def test_the_bound_says_what_it_assumes(case):
    assert "assumes   the compiler keeps the order" in compile_program(case[0], "glsl-es").source
    assert "assumes" not in compile_program(case[0], "opengl").source


def test_more_than_four_buffers_are_refused():
    programs = lower_scene(canonical("empty"), Settings())
    with pytest.raises(
        CompileError, match=r"adds up [0-9]+ planes: GLSL ES 3\.00, fragment shader writes at most"
    ):
        compile_path(programs, "glsl-es")
