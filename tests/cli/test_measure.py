"""The commands below `wamnet bench`: their tables, refusals and helps. What they measure here is nothing."""

import pytest

from wamnet.cli.commands import measure
from wamnet.kernels import render_on
from wamnet.kernels.export.check import Verdict
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scenes import canonical

CALLS = {
    "render": ("--scenes", "empty", "--by", "opencl", "--size", 8, "--spp", 1, "--repeats", 1),
    "train": ("--presets", "short", "--trainers", "opencl", "--size", 32, "--seconds", 0.01, "--repeats", 2),
    "pipeline": ("--executors", "opencl", "--sizes", "8", "--hidden", "4", "--window", 3, "--repeats", 1),
    "exports": ("--targets", "opencl"),
    "primitives": ("--executors", "opencl", "--counts", "10", "--size", 8, "--spp", 1, "--repeats", 1),
}
"""Arguments with which each takes seconds."""


@pytest.fixture(scope="module")
def opencl(executor_named):
    """Give OpenCL after a first kernel, which opens pyopencl's cache in the home folder of the tests."""
    executor = executor_named("opencl")
    render_on(executor, canonical("empty"), Job(2, 2))
    return executor


@pytest.mark.nightly(but=("render", "train"))
@pytest.mark.parametrize("name", CALLS)
@pytest.mark.usefixtures("opencl")
def test_a_command_prints_its_table(wamnet, name) -> None:
    outcome = wamnet("bench", name, *CALLS[name])
    assert outcome.status == 0, outcome.err
    rows = [line for line in outcome.out.splitlines() if line.startswith("|")]
    assert len(rows) >= 3, "a head, its rule, and a row"
    assert set(rows[1]) == {"|", "-"}
    assert all(row.count("|") == rows[0].count("|") for row in rows)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("render --by numpy,abacus", "--by 'numpy,abacus': must be one or more of numpy, opencl, opengl"),
        ("render --scenes nowhere", "scene 'nowhere': unknown (choose one of minicubes, "),
        ("render --scenes ,", "scene ',': unknown"),
        ("render --scenes none.json", "scene file 'none.json': not found"),
        ("pipeline --scene none.json", "scene file 'none.json': not found"),
        ("render --by ,", "--by ',': must be one or more of numpy"),
        ("render --workers 1,x", "--workers '1,x': must be integers from 1 to"),
        ("render --workers 0", "--workers '0': must be integers from 1 to"),
        ("render --size 9000", "size of the image 9000: must be from 1 to 8192 pixels"),
        ("render --spp 0", "--spp 0: must be from 1 to"),
        ("render --depth 0", "--depth 0: must be from 1 to"),
        ("render --repeats 0", "--repeats 0: must be from 1 to"),
        ("render minicubes", "Got unexpected extra argument"),
        ("train --presets long", "--presets 'long': must be one or more of best, mirrors, "),
        ("train --trainers abacus", "--trainers 'abacus': must be one or more of numpy, opencl, torch"),
        ("train --seconds nan", "--seconds nan: must be from 0.001 to 600 seconds"),
        ("train --frames 0", "--frames 0: must be from 1 to"),
        ("pipeline --scene nowhere", "scene 'nowhere': unknown (choose one of"),
        ("pipeline --executors abacus", "--executors 'abacus': must be one or more of numpy, opencl"),
        ("pipeline --sizes 8,0", "--sizes '8,0': must be integers from 1 to"),
        ("pipeline --features smell", "--features 'smell': must be one or more of color"),
        ("pipeline --peers blender", "--peers 'blender': must be one or more of mitsuba, cycles"),
        ("pipeline --window 0", "--window 0: must be from 1 to"),
        ("exports --targets abacus", "--targets 'abacus': must be one or more of opencl"),
        ("exports --scene nowhere", "scene 'nowhere': unknown (choose one of"),
        ("exports --model none.safetensors", "none.safetensors"),
        ("primitives --executors numpy", "--executors 'numpy': must be one or more of opencl, opengl"),
        ("primitives --kinds cones", "--kinds 'cones': must be one or more of shared, turned"),
        ("primitives --counts many", "--counts 'many': must be integers from 1 to"),
    ],
)
def test_wrong_options_are_one_line(refused, arguments, message) -> None:
    """And nothing is measured before."""
    assert message in refused("bench", *arguments.split())


def test_what_is_wrong_of_an_export_is_the_status(wamnet, monkeypatch) -> None:
    verdicts = {"c": Verdict("c", "", 0, "cc", "here"), "wgsl": Verdict("wgsl", "", 0, "x", "-", wrong="off")}
    monkeypatch.setattr(measure, "judged", lambda model, target, place, scene: verdicts[target])
    assert wamnet("bench", "exports", "--targets", "c").status == 0
    outcome = wamnet("bench", "exports", "--targets", "wgsl,c")
    assert outcome.status == measure.STATUS_WRONG
    assert outcome.out.splitlines()[2].endswith(" | off")


def test_other_first_arguments_are_models(refused) -> None:
    assert "model 'rendr': not found" in refused("bench", "rendr")
    assert "see wamnet bench --help" in refused("bench", "--rendr")
