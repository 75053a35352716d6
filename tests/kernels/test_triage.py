"""Triage with planted faults, on each executor: it names the executor, the stage and the pixel."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import plan_program
from wamnet.kernels.devices.registry import EXECUTORS, OPTIONS, WAYS
from wamnet.kernels.judge import triage
from wamnet.kernels.judge.reduce import Box, Stage, first_stage, reduced, shrink, stage_program, stages
from wamnet.kernels.judge.triage import Apart, Outcome, attempt
from wamnet.refimpl.errors import ExecutorUnavailable

SHAPE = (7, 9)
"""Height and width of the picture."""

COMPILED = [way for way in WAYS if way != "numpy"]
"""Executors that run a source."""

RESULT = re.compile(r"( *)/\* output color \*/\n")
"""The place in a plain kernel where all is computed and nothing written."""


@pytest.fixture(scope="module")
def model(kit):
    """Three layers; outputs within 0.5 +- 0.45, so that no clip hides an error."""
    return kit.model((6, 5), seed=4)


@pytest.fixture(scope="module")
def images():
    random = np.random.default_rng(3)
    return {name: random.uniform(0, 1, (*SHAPE, 3)).astype(np.float32) for name in ("color", "normal")}


class Inside:
    """An executor in this process, as a runner."""

    def __init__(self, way, executor, profile="ieee"):
        self.way, self.language, self.device = way, executor.language.under(profile), executor.device
        self._executor = executor

    def picked(self, size: tuple[int, int]) -> str:
        """Return the name of the schedule that the executor picks for a size (height, width)."""
        return self._executor.schedule_for(size)

    def run(self, artifact, images) -> Outcome:
        """Run a kernel on images (H, W, C)."""
        return attempt(self._executor, artifact, images)


def runners(executor_named, *ways, profile="ieee"):
    return [Inside(way, executor_named(way), profile) for way in dict.fromkeys(("numpy", *ways))]


def verdicts_of(ways, model, images, which="plain", compiled=compile_plan):
    kernels = triage.kernels_of(ways, lower(model), SHAPE, which, compiled)
    return triage.judged(kernels, images)


def wrong_weight(target):
    """Return a compiler that gives layer 1's neuron 3 another first weight, for one target."""

    def compiled(plan):
        program = plan.analysed
        if plan.target.name == target and "W1" in program.parameters:
            weight = program.parameters["W1"].copy()
            # A stage of GLSL's holds four neurons, the next one only the fifth.
            if len(weight) > 3:
                weight[3, 0] += 2.0**-6
            program = replace(program, parameters={**program.parameters, "W1": weight})
            # A fault of only the kernel: the plan that it is judged by stays.
            return replace(compile_plan(replace(plan, analysed=program)), plan=plan)
        return compile_plan(plan)

    return compiled


def planted(kit, target, text):
    """Return a compiler that plants `text`, {v} being the output vector, in whole kernels for a target."""

    def compiled(plan):
        artifact = compile_plan(plan)
        if plan.target.name != target or "neurons" in artifact.manifest["output"]["encoding"]:
            return artifact
        vector = re.findall(r"    float (v\d+)\[3\];", artifact.source)[-1]
        (place,) = (match[0] for match in RESULT.finditer(artifact.source))
        return kit.with_source(artifact, place, f"{place}    {text.format(v=vector)}\n")

    return compiled


# ---- naming ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
def test_executor_stage_and_neuron_are_named(executor_named, model, images, way):
    """A wrong weight of layer 1 in one executor, also in numpy: beside it opencl, or numpy."""
    ways = runners(executor_named, way, "opencl" if way == "numpy" else "numpy")
    compiled = wrong_weight(ways[[r.way for r in ways].index(way)].language.name)
    found = verdicts_of(ways, model, images, compiled=compiled)
    (odd,) = triage.odd_ones(found)
    assert odd.kernel.runner.way == way
    assert triage.conclusion(found) == f"{way} plain is the odd one out: 1 other within its bound"
    small = reduced(found, model, images, compiled)
    assert small.repeats
    assert (small.box.height, small.box.width) == (1, 1)
    (stage,) = small.stages
    assert stage.kernel.runner.way == way
    assert (stage.stage.layer, stage.stage.sines) == (1, False)
    assert stage.stage.first + stage.verdict.pixel[2] == 3
    text = f"{way} plain: the first stage that deviates is layer 1, sums, neuron 3, row 0, column 0"
    assert text in stage.text


@pytest.mark.nightly(but="opencl")
@pytest.mark.parametrize("way", COMPILED)
def test_a_pixel_is_named_and_its_place_is_kept(executor_named, kit, model, images, way):
    """One number of one pixel: the part keeps what is above and left of it; no stage by itself has it."""
    ways = runners(executor_named, way)
    compiled = planted(kit, ways[1].language.name, "if (y == 4 && x == 6) {{ {v}[1] += 0.01f; }}")
    found = verdicts_of(ways, model, images, compiled=compiled)
    (odd,) = triage.odd_ones(found)
    assert (odd.kernel.runner.way, odd.pixel) == (way, (4, 6, 1))
    assert odd.state == "DEVIATES"
    # float32 rounds the sum
    assert abs(odd.found - odd.expected - 0.01) <= odd.bound + 2.0**-24
    assert odd.ratio == odd.error / odd.bound > 1
    small = reduced(found, model, images, compiled)
    assert small.box == Box(0, 0, 5, 7)
    text = f"{way} plain: no stage deviates by itself; look at what comes after the last one"
    assert small.stages[0].text == text


@pytest.mark.parametrize("profile", ["ieee", "native"])
@pytest.mark.parametrize("way", COMPILED)
def test_what_is_no_number_deviates(executor_named, kit, model, images, way, profile):
    """Also where nothing is promised."""
    ways = runners(executor_named, way, profile=profile)
    compiled = planted(
        kit, ways[1].language.name, "if (y == 2) {{ {v}[2] = sqrt(-1.0f - {v}[2] * {v}[2]); }}"
    )
    found = verdicts_of(ways, model, images, compiled=compiled)
    (odd,) = triage.odd_ones(found)
    assert (odd.kernel.runner.way, odd.pixel) == (way, (2, 0, 2))
    assert not np.isfinite(odd.found)
    assert odd.ratio == odd.error == np.inf


def test_without_a_bound_finite_numbers_pass(executor_named, model, images):
    found = verdicts_of(runners(executor_named, "opencl", profile="native"), model, images)
    assert [v.state for v in found] == ["no bound", "within"]
    expected_text = "1 kernel within its bound, 1 kernel without a bound that wrote finite numbers"
    assert triage.conclusion(found) == expected_text


def test_if_all_deviate_the_bound_is_suspect(executor_named, model, images):
    """A reference that is not the kernels'."""
    other = lower(replace(model, siren=replace(model.siren, omega_0_hidden=2.9)))

    def compiled(plan):
        return replace(compile_plan(plan), plan=plan_program(other, plan.target.name))

    found = verdicts_of(runners(executor_named, "opencl"), model, images, compiled=compiled)
    text = "all deviate: the program or the bound is suspect, not an executor"
    assert triage.conclusion(found) == text
    text = "numpy plain deviates, and nothing else ran: run other executors beside it"
    assert triage.conclusion(found[:1]) == text


# ---- crashes ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
def test_a_crash_is_a_verdict(executor_named, model, images, monkeypatch, way):
    ways = runners(executor_named, way, "opencl" if way == "numpy" else "numpy")
    index = [runner.way for runner in ways].index(way)
    with monkeypatch.context() as patch:
        patch.setattr(ways[index]._executor, "_run", lambda *_: 1 / 0)
        found = verdicts_of(ways, model, images)
        assert found[index].state == "FAILED: ZeroDivisionError: division by zero"
        assert [v.kernel.runner.way for v in triage.odd_ones(found)] == [way]
        small = reduced(found, model, images)
    assert (small.box.height, small.box.width) == (1, 1)
    assert "layer 0, sums" in small.stages[0].text


SEGMENTATION_FAULT = {
    "opencl": "((volatile __global float *)8)[0] = {v}[0];",
    "c": "((volatile float *)8)[0] = {v}[0];",
}
"""A write to where no process may write."""


@pytest.mark.parametrize("way", SEGMENTATION_FAULT)
def test_a_kernel_that_ends_its_process(executor_named, kit, model, images, way):
    """And the next kernel has a new one."""
    executor_named(way)
    compiled = planted(kit, way, SEGMENTATION_FAULT[way])
    with Apart(way) as runner:
        (found,) = verdicts_of([runner], model, images, compiled=compiled)
        assert found.deviates
        assert "FAILED: its process ended with signal SIG" in found.state
        (found,) = verdicts_of([runner], model, images)
        assert found.within


def test_a_kernel_that_never_ends(executor_named, kit, model, images):
    executor_named("c")
    compiled = planted(kit, "c", "for (volatile int k = 1; k > 0;) {{ }}")
    with Apart("c") as runner:
        runner.limit_s = 0.5
        (found,) = verdicts_of([runner], model, images, compiled=compiled)
        assert found.state == "FAILED: no answer in 0.5 s"


@pytest.mark.needs("devices")
def test_an_executor_that_is_not_here(monkeypatch):
    monkeypatch.setenv("WAMNET_OPENCL_DEVICE", "abacus")
    with pytest.raises(ExecutorUnavailable, match="opencl: OpenCL: no "):
        Apart("opencl")


@pytest.mark.needs("devices")
def test_ways_are_those_of_the_executors():
    from wamnet.kernels.devices import opengl_executor

    assert [options["context"] for options in OPTIONS["opengl"]] == list(opengl_executor.CONTEXTS)
    assert {name for name, _ in WAYS.values()} == set(EXECUTORS)
    assert WAYS["opengl-osmesa"] == ("opengl", {"context": "osmesa"})
    assert WAYS["c"] == ("c", {})


# ---- making it small -------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [None, (13, 20), (0, 0)])
@pytest.mark.parametrize(("rows", "columns"), [((13, 14), (20, 21)), ((3, 17), (0, 30)), ((0, 24), (5, 9))])
def test_shrinking_keeps_what_fails(rows, columns, at):
    """What fails is a picture that holds these rows and columns: nothing else is kept."""
    runs = []

    def fails(box):
        runs.append(box)
        return (
            box.top <= rows[0]
            and rows[1] <= box.top + box.height
            and box.left <= columns[0]
            and columns[1] <= box.left + box.width
        )

    wanted = Box(rows[0], columns[0], rows[1] - rows[0], columns[1] - columns[0])
    assert shrink(Box(0, 0, 24, 31), fails, at, 3) == wanted
    assert len(runs) <= 80


def test_stages_are_the_network(kit, model, images):
    """Each neuron's sum and sine once, in order; their programs compute them."""
    found = list(stages(model.siren, 4))
    neurons = [(s.layer, s.sines, n) for s in found for n in range(s.first, s.end)]
    wanted = [
        (layer, sines, n)
        for layer, width in enumerate((6, 5, 3))
        for sines in ((False, True) if layer < 2 else (False,))
        for n in range(width)
    ]
    assert neurons == wanted
    x = kit.windows(lower(model), images)
    for layer, (weight, bias) in enumerate(zip(model.siren.weights, model.siren.biases, strict=True)):
        x = x.astype(np.float64) @ weight.T.astype(np.float64) + bias
        for sines in (False, True) if layer < 2 else (False,):
            x = np.sin(3.0 * x) if sines else x
            program = stage_program(model, Stage(layer, sines, 1, 3))
            held = plan_program(program, "numpy").expected(images)
            # both in float64, of sums of 54 terms at most
            assert np.abs(held.value - x[..., 1:3]).max() <= 1e-12


def test_no_stage_deviates_in_a_right_kernel(executor, model, images):
    runner = Inside(executor.name, executor)
    (kernel,) = triage.kernels_of([runner], lower(model), SHAPE, "plain")
    assert first_stage(kernel, model, images) is None


def test_numpy_s_nan_deviates(executor_named, model, images, monkeypatch):
    ways = runners(executor_named, "opencl")
    picture = np.full((*SHAPE, 3), np.nan, np.float32)
    monkeypatch.setattr(ways[0], "run", lambda artifact, images: Outcome(picture))
    found = verdicts_of(ways, model, images)
    assert [v.kernel.runner.way for v in triage.odd_ones(found)] == ["numpy"]


def test_shrinking_ends():
    """After so many runs, whatever they say; and where nothing smaller fails, the whole is kept."""
    runs = []
    whole = Box(0, 0, 1000, 1000)
    shrink(whole, lambda box: runs.append(box) or len(runs) % 3 == 0, most=20)
    assert len(runs) == 20
    assert shrink(whole, lambda box: False) == whole
    assert shrink(whole, lambda box: True, at=(999, 999)) == Box(999, 999, 1, 1)


def test_a_failure_that_comes_once_is_told(executor_named, model, images):
    """The whole picture is kept, with what it showed."""
    (runner,) = runners(executor_named, "numpy")
    picture = runner.run(compile_program(lower(model), "numpy"), images).image
    answers = iter([Outcome(picture + np.float32(0.25))])
    once = SimpleNamespace(
        way="numpy",
        language=runner.language,
        device="fake",
        picked=runner.picked,
        run=lambda artifact, images: next(answers, None) or runner.run(artifact, images),
    )
    found = verdicts_of([once], model, images)
    small = reduced(found, model, images)
    assert not small.repeats
    assert small.box == Box(0, 0, *SHAPE)
    assert list(small.verdicts) == found


def test_lines_have_no_line_ends():
    """A driver's log has many: a verdict is one line."""
    executor = SimpleNamespace(run=lambda *_: (_ for _ in ()).throw(RuntimeError("a\n  b")))
    assert attempt(executor, None, {}).failure == "RuntimeError: a b"
