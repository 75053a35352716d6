"""A plan: what it computes once, and the reference and the bound at given images."""

import pickle

import numpy as np
import pytest

from wamnet.compiler import plan as module
from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.plan import analysed, plan_program
from wamnet.compiler.proof import bounds
from wamnet.compiler.targets import DENOISERS, language_named
from wamnet.refimpl.errors import CompileError

CHANNELS = {"a": 2, "b": 1}
"""The images' channels."""


@pytest.fixture
def images():
    random = np.random.default_rng(1)
    return {name: random.uniform(-2, 2, (9, 7, n)).astype(np.float32) for name, n in CHANNELS.items()}


@pytest.mark.parametrize("border", ["clamp", "zero"])
def test_it_is_the_interpreter_and_the_rules(kit, images, border):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, border)
    windows = {"window": kit.windows(program, images)}
    (value,) = interpret(program, windows, np.float64).values()
    for target in DENOISERS:
        found = plan_program(program, target).expected(images)
        contract = language_named(target).sine
        (bound,) = bounds.at_inputs(analysed(program), windows, contract).values()
        assert found.value.shape == found.bound.shape == (9, 7, 3)
        # float64 adds up in another order
        assert np.abs(found.value - value).max() <= 1e-13
        assert np.abs(found.bound / bound - 1).max() <= 1e-9  # the same


def test_blocks_of_rows_are_one_picture(kit, images, monkeypatch):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    plan = plan_program(program, "opencl")
    whole = plan.expected(images)
    for numbers in (1, 2 * 7 * 27, 4 * 7 * 27):
        monkeypatch.setattr(module, "BLOCK_NUMBERS", numbers)
        found = plan.expected(images)
        # sums of 27 terms in float64, in another order
        assert np.abs(found.value - whole.value).max() <= 1e-13
        assert np.abs(found.bound / whole.bound - 1).max() <= 1e-9  # the same


def test_one_number_and_constants(kit, images):
    """Outputs without an axis of channels, and those that are the same everywhere."""
    for function, value in (
        (lambda x: x[..., 0] * 0.0 + 0.5, np.full((9, 7, 1), 0.5)),
        (lambda x: np.matmul(x, np.zeros((27, 2), np.float32)) + 0.25, np.full((9, 7, 2), 0.25)),
        (lambda x: x[..., 0] * 2.0, None),
    ):
        program = kit.program(function, CHANNELS, 3)
        found = plan_program(program, "numpy").expected(images)
        assert found.bound.shape == found.value.shape
        if value is None:
            assert found.value.shape == (9, 7, 1)
            assert np.array_equal(found.value, 2.0 * kit.windows(program, images)[..., :1])
        else:
            assert np.array_equal(found.value, value)


def test_what_promises_nothing_has_no_bound(kit, images):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    assert np.isinf(
        plan_program(program, language_named("opengl").under("native")).expected(images).bound
    ).all()


def test_a_plan_is_resolved_once(kit, monkeypatch):
    """Passes run and the schedule is picked once for each kernel, however often a plan is asked."""
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    counts = dict.fromkeys(("run", "pick"), 0)

    def counted(name, function):
        def call(*given):
            counts[name] += 1
            return function(*given)

        return call

    monkeypatch.setattr(module.pipeline, "run", counted("run", module.pipeline.run))
    monkeypatch.setattr(module, "pick", counted("pick", module.pick))
    plan = plan_program(program, "opencl")
    first, second = compile_plan(plan), compile_plan(plan)
    assert first.source == second.source
    assert counts == {"run": 2, "pick": 1}


def test_a_plan_travels_to_another_process(kit, images):
    """Targets go by name; what was computed is computed again there."""
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    plan = plan_program(program, "opencl", schedule="tile:16")
    artifact = compile_plan(plan)
    there = pickle.loads(pickle.dumps(artifact))
    assert there.plan.target is plan.target
    assert compile_plan(there.plan).source == artifact.source
    assert np.array_equal(there.plan.expected(images).bound, plan.expected(images).bound)


def test_another_schedule_is_another_plan(kit):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    plan = plan_program(program, "opencl")
    assert plan.schedule.name == "plain"
    assert plan.scheduled("tile:16").schedule.name == "tile:16"
    assert plan.schedule.name == "plain"
    assert compile_program(program, "opencl", "tile:16").plan.asked == "tile:16"
    with pytest.raises(CompileError, match="schedule 'spiral': unknown to this target"):
        plan.scheduled("spiral").bound  # noqa: B018
