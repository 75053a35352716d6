"""Tests of `--executor auto`, the default of the commands that run on an executor."""

import inspect
import shutil
from threading import local

import pytest

from wamnet.cli.commands import animate, dataset, denoise, render, train
from wamnet.cli.common.request import spread
from wamnet.kernels.devices import registry
from wamnet.refimpl.errors import ExecutorUnavailable

COMMANDS = (render.render, train.train, dataset.dataset, denoise.denoise, animate.animate)
"""Those that choose by themselves."""


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.__name__)
def test_auto_is_the_default(command) -> None:
    """Of each option that names an executor."""
    parameters = inspect.signature(spread(command)).parameters
    found = [parameters[name].default for name in ("executor", "renderer") if name in parameters]
    assert found in (["auto"], ["auto", "auto"])


SMALL = ("--size", 8, "--spp", 1, "--frames", 1, "--test", 0)


@pytest.mark.parametrize(
    "command",
    [
        ("render", "furnace", "--width", 4, "--height", 4),
        ("dataset", "furnace", *SMALL),
        ("train", "-i", "noisy.exr", "-t", "reference.exr", "--steps", 1, "-o", "new.safetensors"),
        ("denoise", "model.safetensors", "noisy.exr"),
        ("animate", "model.safetensors", "--seconds", 0.1, "--fps", 10, "--size", 8),
    ],
    ids=lambda command: command[0],
)
def test_the_choice_is_printed_with_its_reason(wamnet, samples, tmp_path, monkeypatch, command) -> None:
    """What is faster and not available too; without the variable that names NumPy."""
    monkeypatch.delenv("WAMNET_EXECUTOR")
    monkeypatch.setattr(registry, "fastest", lambda _trains: ("numpy", ["opencl: nothing there"]))
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    outcome = wamnet(*command)
    assert outcome.status == 0, outcome.err
    lines = outcome.out.splitlines()
    assert lines[:2] == ["not opencl: nothing there", "executor numpy: the fastest available"]


@pytest.mark.parametrize(
    ("arguments", "because"),
    [
        (("--dtype", "float64"), "kernels compute in float32"),
        (("--workers", 1), "--workers are processes of NumPy"),
    ],
)
def test_work_for_numpy_alone(wamnet, monkeypatch, arguments, because) -> None:
    """It is done by NumPy, whatever is faster."""
    monkeypatch.delenv("WAMNET_EXECUTOR")
    outcome = wamnet("render", "furnace", "--width", 4, "--height", 4, *arguments)
    assert outcome.out.splitlines()[0] == f"executor numpy: {because}"


@pytest.mark.parametrize(
    "command",
    [
        "render furnace --width 4 --height 4",
        "dataset minicubes --frames 2 --test 1 --size 12 --spp 4",
        "train -i noisy.exr -t reference.exr --features color",
        "denoise model.safetensors noisy.exr",
    ],
)
def test_a_device_that_is_missing(refused, samples, tmp_path, monkeypatch, command) -> None:
    """One line with the reason. A folder that asks for it would refuse the request for another executor."""

    def missing(name: str) -> None:
        raise ExecutorUnavailable(f"{name}: no device was found; install one")

    for module in ("wamnet.kernels", "wamnet.kernels.run.render_frame"):
        monkeypatch.setattr(f"{module}.open_executor", missing)
    # A thread keeps its devices open: an earlier test may have opened this one.
    monkeypatch.setattr("wamnet.kernels.run.render_frame._opened", local())
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    line = refused(*command.split(), "--executor", "opencl")
    assert line == "wamnet: error: opencl: no device was found; install one\n"
    assert not [path for path in tmp_path.iterdir() if path.is_dir()]
