"""Tests of `wamnet demo --quick`: all files, honest numbers, a report that stands alone, resuming."""

from __future__ import annotations

import json
import re
import shutil
from html.parser import HTMLParser

import numpy as np
import pytest

from wamnet.cli import demo, exr, machine, runs
from wamnet.cli.images import read_png
from wamnet.cli.main import main
from wamnet.compiler.model_file import load_model
from wamnet.refimpl import encoding, metrics
from wamnet.refimpl.denoise import denoise


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Return the folder of a finished quick demonstration."""
    folder = tmp_path_factory.mktemp("demo") / "out"
    assert main(["demo", "--quick", "-o", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def report(finished):
    """Return the demonstration's facts."""
    return json.loads((finished / "report.json").read_text())


def test_all_files_are_there(finished) -> None:
    """Pictures, frames, model, kernels and both reports."""
    names = {path.relative_to(finished).as_posix() for path in finished.rglob("*") if path.is_file()}
    pictures = {f"{name}.png" for name in ("noisy", "denoised", "reference", "normal")}
    frames = {f"{name}.exr" for name in ("noisy", "denoised", "reference")}
    kernels = {"kernels/opencl/denoise.cl", "kernels/opengl/denoise.frag", "kernels/opencl/manifest.json"}
    assert pictures | frames | kernels | {"model.safetensors", "report.json", "report.html"} <= names
    assert not [name for name in names if name.startswith(".") or "/." in name]


def test_the_frame_is_held_out(finished, report) -> None:
    """Its time is no training time, in the plan and in the files."""
    times = {exr.read_frame(path).info["time"] for path in (finished / "frames").glob("[01]-*.exr")}
    held_out = exr.read_frame(finished / "noisy.exr").info["time"]
    assert float(held_out) == report["plan"]["test_time_s"]
    assert held_out not in times
    assert demo.Plan.test_time_s not in demo.Plan.train_times_s


def test_the_numbers_are_those_of_the_files(finished, report) -> None:
    """Metrics of the written EXR files; linear ones up to white, as the report says."""
    noisy, reference = (exr.read_frame(finished / f"{name}.exr")["color"] for name in ("noisy", "reference"))
    a, b = encoding.to_display(noisy), encoding.to_display(reference)
    scores = report["scores"]["input"]["metrics"]
    assert scores["PSNR"] == metrics.psnr(a, b)
    assert scores["SSIM"] == metrics.ssim(a, b)
    assert scores["relMSE"] == metrics.relmse(encoding.from_display(a), encoding.from_display(b))
    assert set(report["scores"]) == {"input", "denoised"}


def test_every_executor_is_told_and_within_its_bound(report) -> None:
    """Those that run have times, an error and a bound that holds; numpy always runs."""
    told = {run["executor"]: run for run in report["runs"]}
    assert set(told) == {"numpy", "opencl", "opengl"}
    assert not told["numpy"]["missing"]
    for run in told.values():
        if not run["missing"]:
            assert run["error"] <= run["bound_frame"] <= run["bound_all"]
            assert run["seconds_run"] > 0


def test_the_denoised_picture_is_the_models(finished, report) -> None:
    """The written picture is the definition's, but for the kernel's bound and the rounding to 8 bits."""
    model = load_model(finished / "model.safetensors")
    want = denoise(model, exr.read_frame(finished / "noisy.exr"), np.float64)
    bound = next(run["bound_frame"] for run in report["runs"] if run["executor"] == report["denoised_by"])
    # Half a level of 8 bits, and float64's rounding of a sum below 256.
    slack = 0.5 / 255 + 256 * 2.0**-52
    assert np.abs(read_png(finished / "denoised.png") - want).max() <= bound + slack


class Addresses(HTMLParser):
    """Collects the addresses, alternative texts and tags of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.texts: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            if name in ("src", "srcset", "href"):
                self.addresses.append(value or "")
            if name == "alt":
                self.texts.append(value or "")


def test_the_report_stands_alone(finished, report) -> None:
    """Only embedded pictures, each with a text; no script; the command, the machine and each metric."""
    html = (finished / "report.html").read_text()
    page = Addresses()
    page.feed(html)
    assert page.addresses
    assert all(address.startswith("data:image/png;base64,") for address in page.addresses)
    assert len(page.texts) == 7
    assert all(page.texts)
    assert not page.tags & {"script", "link", "iframe"}
    assert not re.search(r"url\(|@import|https?:", re.sub(r"base64,[^\"]*", "", html))
    assert report["command"] in html
    assert report["machine"]["cores"] in html
    assert all(name in html for name in metrics.METRICS)


def test_a_second_run_reuses_everything(finished, tmp_path, monkeypatch) -> None:
    """No frame is rendered and no step trained again."""
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)

    def never(*_args: object, **_options: object) -> None:
        raise AssertionError("this was done before")

    monkeypatch.setattr("wamnet.kernels.render_pool.render_parallel", never)
    monkeypatch.setattr("wamnet.refimpl.train.train_step", never)
    results = demo.carry_out(demo.QUICK, folder)
    assert results.state.step == demo.QUICK.steps
    assert results.seconds_per_step > 0


def test_other_frames_are_rendered_and_trained_anew(finished, tmp_path, monkeypatch) -> None:
    """Another seed: no file of the earlier run is mistaken for this one's; a damaged one is replaced."""
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)
    monkeypatch.setattr(machine, "versions", lambda: {"wamnet": "another"})
    (folder / "frames" / "0-noisy.exr").write_text("damaged")
    pairs, _ = demo.render_frames(demo.replace(demo.QUICK, seed=7), folder)
    assert pairs[0][0].info["seed"] == "7"
    plan = demo.replace(demo.QUICK, seed=7, steps=3)
    _, state, _ = demo.train_network(plan, pairs, folder)
    assert state.step == 3
    assert state.recipe.seed == 7


def test_an_executor_that_is_missing_is_told(finished, monkeypatch) -> None:
    """The report goes on without it and says why."""
    from wamnet.compiler.compile import compile_program
    from wamnet.compiler.lower import lower
    from wamnet.kernels import open_executor
    from wamnet.refimpl.errors import ExecutorUnavailable

    def only_numpy(name: str):
        if name != "numpy":
            raise ExecutorUnavailable(f"{name}: nothing there")
        return open_executor(name)

    monkeypatch.setattr("wamnet.kernels.open_executor", only_numpy)
    model = load_model(finished / "model.safetensors")
    kernels = {name: compile_program(lower(model), name) for name in ("numpy", "opencl")}
    images, found = runs.run_all(model, exr.read_frame(finished / "noisy.exr"), kernels, lambda _: None)
    assert set(images) == {"numpy"}
    assert found[1] == runs.Run("opencl", missing="opencl: nothing there")


def test_a_target_that_promises_nothing_has_no_bound(finished) -> None:
    """OpenGL's own sine."""
    model = load_model(finished / "model.safetensors")
    assert runs.frame_bound(model, exr.read_frame(finished / "noisy.exr"), "opengl", "native") is None


def test_refusals(refused, tmp_path) -> None:
    """A file in the folder's place; a size that is none."""
    (tmp_path / "a").write_text("hello")
    assert "output folder is a: it is a file; choose another with -o" in refused("demo", "-o", "a")
    assert "width is 0: it must be an integer" in refused("demo", "--size", 0)


def test_the_machine_is_described() -> None:
    """Where the system says nothing, the report says unknown."""
    facts = machine.describe()
    assert set(facts) == {"processor", "cores", "memory", "system", "Python"}
    assert int(facts["cores"]) >= 1
    assert "numpy" in machine.versions()
    assert machine._first_value("/no/such/file", "x") == ""


def test_a_folder_holds_one_plan(refused, tmp_path, finished) -> None:
    """Results of another plan and other files are not mixed with this one's; nor are two sizes."""
    shutil.copytree(finished, tmp_path / "out")
    text = "output folder is out: it holds results of another plan; choose another with -o"
    assert text in refused("demo", "--size", 16, "-o", "out")
    demo.begin(demo.QUICK, tmp_path / "out")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "noisy.exr").write_text("precious")
    assert "it holds files that are not the demo's" in refused("demo", "--quick", "-o", "mine")
    assert "--size is 16: --quick has a size of its own" in refused("demo", "--quick", "--size", 16)


@pytest.mark.parametrize("quick", [True, False])
def test_an_interrupt_tells_how_to_go_on(wamnet, tmp_path, monkeypatch, quick) -> None:
    """With the whole command; quick results have a folder of their own."""

    def interrupt(*_arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "carry_out", interrupt)
    outcome = wamnet("demo", *(["--quick"] if quick else []))
    command = "--quick -o out/demo-quick" if quick else "--size 192 -o out/demo"
    assert outcome.err == f"wamnet: go on with the same command: wamnet demo {command}\nwamnet: interrupted\n"
    assert outcome.status == 130


@pytest.mark.parametrize("content", [None, b"", b"fast", b"\xff", b"nan", b"-1"])
def test_an_unknown_time_is_no_error(finished, report, tmp_path, content) -> None:
    """The report has a dash, and the curve no second axis."""
    from wamnet.cli import plots
    from wamnet.cli.report import page

    path = tmp_path / "seconds.txt"
    if content is not None:
        path.write_bytes(content)
    assert demo._seconds(path) is None
    assert plots.training_curve([(1, 0.5), (2, 0.25)], None, plots.LIGHT).startswith(b"\x89PNG")
    data = {**report, "training": {**report["training"], "seconds_per_step": None}}
    pictures = dict.fromkeys(("noisy", "denoised", "reference", "normal"), "")
    drawn = {key: {"light": "", "dark": ""} for key in ("input_error", "denoised_error", "training")}
    assert "<dd>– <small>60 steps</small>" in page(data, pictures, drawn)


def test_the_report_tells_whose_picture_it_is(finished, report) -> None:
    """That of a compiled kernel, if one ran; what the network sees; that the reference is noisy too."""
    ran = {run["executor"] for run in report["runs"] if not run["missing"]}
    assert report["denoised_by"] == next(name for name in ("opencl", "opengl", "numpy") if name in ran)
    html = (finished / "report.html").read_text()
    assert "it sees color, normal, albedo, position of its" in html
    assert "its own noise counts as error" in html
