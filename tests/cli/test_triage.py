"""Tests of `wamnet triage`: verdicts, exit status, the reproducer and its command, refusals."""

import json
import re
import shlex
import shutil
from dataclasses import replace

import numpy as np
import pytest

from wamnet.cli.files import exr
from wamnet.cli.main import main
from wamnet.compiler import artifact
from wamnet.compiler import compile as compiling
from wamnet.compiler.core.ir import sha256
from wamnet.kernels.devices.registry import WAYS
from wamnet.kernels.run.denoise_on import images_of
from wamnet.models.model_file import load_model
from wamnet.refimpl.errors import ExecutorUnavailable

TWO = ("--executor", "numpy", "--executor", "opencl", "--schedules", "plain")
"""Executors that all machines with OpenCL have."""


@pytest.fixture
def here(samples, tmp_path, executor_named):
    """Put model.safetensors and noisy.exr into the working folder."""
    executor_named("opencl")
    for name in ("model.safetensors", "noisy.exr"):
        shutil.copy(samples / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def fault(monkeypatch):
    """Plant a fault in OpenCL's kernels: one pixel's green is off. Return a way to fix them."""
    real = compiling.compile_plan

    def compiled(plan):
        made = real(plan)
        if plan.target.name != "opencl" or "neurons" in made.manifest["output"]["encoding"]:
            return made
        vector = re.findall(r"    float (v\d+)\[3\];", made.source)[-1]
        mark = "    /* output color */\n"
        assert mark in made.source
        source = made.source.replace(mark, f"{mark}    if (y == 5 && x == 4) {{ {vector}[1] = 2.5f; }}\n")
        digest = sha256(source.encode())
        files = {**made.manifest["files"], made.source_name: digest}
        return replace(made, source=source, manifest={**made.manifest, "digest": digest, "files": files})

    monkeypatch.setattr(compiling, "compile_plan", compiled)
    return lambda: monkeypatch.setattr(compiling, "compile_plan", real)


def test_all_within(wamnet, here) -> None:
    """A line for each executor that is here, status 0, and no folder."""
    outcome = wamnet("triage", "model.safetensors", "noisy.exr")
    assert outcome.status == 0
    assert "model.safetensors on noisy.exr, 13x12, profile ieee" in outcome.out
    lines = [line for line in outcome.out.splitlines() if " within " in line and " row " in line]
    missing = re.findall(r"not available: ([\w-]+)", outcome.out)
    assert [line.split()[0] for line in lines] == [way for way in WAYS if way not in missing]
    assert f"{len(lines)} kernels within their bounds" in outcome.out
    assert sorted(path.name for path in here.iterdir()) == ["model.safetensors", "noisy.exr"]


def test_the_odd_one_out_is_kept(wamnet, here, fault) -> None:
    """Status 1; the folder has model, part of the frame, the kernel and the report."""
    outcome = wamnet("triage", "model.safetensors", "noisy.exr", *TWO, "-o", "odd")
    assert outcome.status == 1
    assert "opencl plain is the odd one out: 1 other within its bound" in outcome.out
    assert "smallest part that reproduces it: 5x6 pixels from row " in outcome.out
    assert "opencl plain: no stage deviates by itself" in outcome.out
    odd = here / "odd"
    names = sorted(str(path.relative_to(odd)) for path in odd.rglob("*") if path.is_file())
    assert {"README.md", "frame.exr", "model.safetensors", "report.json"} <= set(names)
    assert {"opencl-plain/denoise.cl", "opencl-plain/manifest.json", "opencl-plain/weights.bin"} <= set(names)
    assert "2.5f" in (odd / "opencl-plain/denoise.cl").read_text()
    report = json.loads((odd / "report.json").read_text())
    assert report["schema"] == "wamnet-triage-1"
    assert report["conclusion"] == "opencl plain is the odd one out: 1 other within its bound"
    assert (report["part"]["height"], report["part"]["width"]) == (6, 5)
    assert [v["deviates"] for v in report["part"]["verdicts"]] == [False, True]
    assert report["stages"] == [
        {"executor": "opencl", "schedule": "plain", "stage": None, "neurons_from": None, "worst": None}
    ]
    assert report["frame"] == {"height": 12, "width": 13}
    good, bad = report["verdicts"]
    assert (good["executor"], good["deviates"]) == ("numpy", False)
    assert (bad["executor"], bad["deviates"], bad["pixel"], bad["channel"]) == ("opencl", True, [5, 4], 1)
    assert bad["found"] == 2.5
    assert bad["bound"] < 1 < bad["error_over_bound"]
    assert bad["device"].startswith("Portable Computing Language")
    assert report["versions"]["numpy"] == np.__version__
    assert not list(here.glob(".wamnet-*"))


@pytest.mark.nightly
def test_the_kept_command_repeats_it(wamnet, here, fault, monkeypatch, capsys) -> None:
    """With the kept kernel (TRI-11) also when the compiler is fixed; without it no longer."""
    assert wamnet("triage", "model.safetensors", "noisy.exr", *TWO, "-o", "odd").status == 1
    fault()
    commands = re.findall(r"^wamnet (triage .*)$", (here / "odd/README.md").read_text(), re.MULTILINE)
    assert len(commands) == 2
    monkeypatch.chdir(here / "odd")
    assert main(shlex.split(commands[0])) == 1
    again = json.loads((here / "odd/triage/report.json").read_text())
    assert (again["part"]["height"], again["part"]["width"]) == (6, 5)
    assert again["verdicts"][0]["pixel"] == [5, 4]
    assert "stages are compiled again" in capsys.readouterr().out
    kernel = here / "odd/triage/opencl-plain"
    files = json.loads((kernel / "manifest.json").read_text())["files"]
    assert files["denoise.cl"] == sha256((kernel / "denoise.cl").read_bytes())
    shutil.rmtree(here / "odd/triage")
    assert main(shlex.split(commands[1])) == 0
    # A kernel that somebody fixes by hand is run as it is.
    source = here / "odd/opencl-plain/denoise.cl"
    source.write_text(source.read_text().replace("[1] = 2.5f", "[1] += 0.0f"))
    assert main(shlex.split(commands[0])) == 0


def test_a_kernel_that_is_given_runs_though_another_schedule_would_be_picked(wamnet, here) -> None:
    """The executor's own choice must not take its place: its verdict would be reported as the kept one's."""
    compiled = wamnet("compile", "model.safetensors", "--target", "opencl", "-o", "kept")
    assert compiled.status == 0
    given = ("triage", "model.safetensors", "noisy.exr", "--executor", "opencl", "--kernel", "kept")
    outcome = wamnet(*given)
    assert outcome.status == 0
    assert [line.split()[:2] for line in outcome.out.splitlines() if " row " in line] == [["opencl", "plain"]]
    source = here / "kept/denoise.cl"
    source.write_text(source.read_text() + "this is not OpenCL;")
    outcome = wamnet(*given, "-o", "odd")
    assert outcome.status in (1, 2)
    assert "within its bound" not in outcome.out


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda folder: (folder / "weights.bin").unlink(), "not found"),
        (lambda folder: (folder / "weights.bin").write_bytes(bytes(1001)), "float32 weights"),
        (lambda folder: (folder / "denoise.cl").write_bytes(b"\xff\xfe"), "must be UTF-8"),
        (lambda folder: (folder / "manifest.json").write_text("[" * 200_000), "nested"),
        (lambda folder: (folder / "manifest.json").write_text("[]"), "must hold a manifest.json"),
    ],
)
def test_a_kernel_that_cannot_be_run_is_refused(wamnet, refused, here, change, says) -> None:
    assert wamnet("compile", "model.safetensors", "--target", "opencl", "-o", "kept").status == 0
    change(here / "kept")
    assert says in refused(
        "triage", "model.safetensors", "noisy.exr", "--executor", "numpy", "--kernel", "kept"
    )


@pytest.mark.parametrize("options", [["--executor", "numpy"], ["--executor", "c", "--schedules", "plain"]])
def test_a_kernel_that_no_executor_would_run_is_refused(wamnet, refused, here, options) -> None:
    assert wamnet("compile", "model.safetensors", "--target", "opencl", "-o", "kept").status == 0
    text = refused("triage", "model.safetensors", "noisy.exr", *options, "--kernel", "kept")
    assert "none of the kernels to run is of opencl in schedule plain" in text


def test_one_that_is_not_here_is_told(wamnet, here, monkeypatch, refused) -> None:
    """Unless it was requested by name."""
    monkeypatch.setenv("WAMNET_OPENCL_DEVICE", "abacus")
    outcome = wamnet("triage", "model.safetensors", "noisy.exr")
    assert outcome.status == 0
    assert "not available: opencl: OpenCL: no device matches 'abacus'" in outcome.out
    assert "no device matches 'abacus'" in refused("triage", "model.safetensors", "noisy.exr", *TWO)

    def missing(way: str) -> None:
        raise ExecutorUnavailable(f"{way}: gone")

    monkeypatch.setattr("wamnet.cli.commands.triage.Apart", missing)
    command = ("triage", "model.safetensors", "noisy.exr", "--executor", "opengl")
    outcome = wamnet(*command)
    assert outcome.status == 2
    assert "none of opengl is available; see wamnet executors" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ["--executor", "abacus"],
            "--executor 'abacus': unknown (choose one of numpy, opencl, opengl, c, opengl-egl",
        ),
        (["--profile", "sloppy"], "profile 'sloppy': unknown"),
        (["-o", "model.safetensors"], "output folder 'model.safetensors': is a file"),
        (["-o", "full"], "output folder 'full': is not empty"),
        (["-o", "no/where"], "output folder 'no': not found"),
        (["--kernel", "full"], "--kernel 'full': must hold a manifest.json"),
        (["--kernel", "other"], "--kernel 'other': its kernel is of another model or profile (native)"),
    ],
)
def test_refusals(refused, here, arguments, text) -> None:
    """One line each, before anything is run."""
    (here / "full").mkdir()
    (here / "full/manifest.json").write_text("[]")
    assert (
        main(["compile", "model.safetensors", "--target", "opencl", "--profile", "native", "-o", "other"])
        == 0
    )
    assert text in refused("triage", "model.safetensors", "noisy.exr", *arguments)


def test_pixels_that_are_no_numbers_are_kept_as_they_are_read(wamnet, here, fault, monkeypatch) -> None:
    """A file of a frame holds finite numbers: the kept ones are encoded to the same bits."""
    noisy = exr.read_frame(here / "noisy.exr")
    noisy["color"][:, 2] = (np.nan, np.inf, -np.inf)
    with monkeypatch.context() as patch:
        patch.setattr(exr, "validate", lambda frame: None)
        exr.write_frame(here / "bad.exr", noisy)
    assert wamnet("triage", "model.safetensors", "bad.exr", *TWO).status == 1
    model, kept = load_model(here / "model.safetensors"), exr.read_frame(here / "triage/frame.exr")
    part = json.loads((here / "triage/report.json").read_text())["part"]
    rows = slice(part["top"], part["top"] + part["height"])
    columns = slice(part["left"], part["left"] + part["width"])
    assert np.isnan(noisy["color"][rows, columns]).any()
    assert set(kept.layers) == {"color", "normal"}
    for name, image in images_of(model, noisy).items():
        assert np.array_equal(images_of(model, kept)[name], image[rows, columns])


def test_nothing_is_half_written(here, fault, monkeypatch, wamnet) -> None:
    """A disk that fills up leaves no folder."""

    def full(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(artifact, "write", full)
    outcome = wamnet("triage", "model.safetensors", "noisy.exr", *TWO, "-o", "odd")
    assert outcome.status == 2
    assert "output folder 'odd': cannot be written: No space left on device (" in outcome.err
    assert sorted(path.name for path in here.iterdir()) == ["model.safetensors", "noisy.exr"]
