"""Tests of `wamnet demo --quick`: all files, honest numbers, a self-contained report, resuming."""

import dataclasses
import json
import re
import shutil
from html.parser import HTMLParser

import numpy as np
import pytest

from wamnet.cli.commands import bench, bench_frames, demo
from wamnet.cli.files import exr
from wamnet.cli.files.images import read_png
from wamnet.cli.main import main
from wamnet.models.model_file import load_model
from wamnet.refimpl import encoding, metrics
from wamnet.refimpl.network import train
from wamnet.refimpl.network.denoise import denoise

for_this_machine = demo.for_this_machine


@pytest.fixture(scope="module", autouse=True)
def small():
    """Let NumPy render and train a little: test_dataset.py and test_train.py test kernels that do."""
    by_numpy = {"renderer": "numpy", "trainer": "numpy"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "QUICK", demo.replace(demo.QUICK, size_px=16, steps=20))
        patch.setattr(demo, "for_this_machine", lambda plan: demo.replace(plan, **by_numpy))
        patch.setitem(train.PRESETS, "best", demo.replace(train.BEST, widths=(8, 8), batch=64))
        yield


@pytest.fixture(scope="module")
def finished(tmp_path_factory, small):
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
    ends = ("noisy.png", "denoised.png", "reference.png", "normal.png", "denoised.exr")
    pictures = {f"pictures/{index}-{end}" for index in (0, 1) for end in ends}
    frames = {f"frames/test/{k:05d}-{kind}.exr" for k in (0, 1) for kind in ("noisy", "target")}
    kernels = {"kernels/opencl/denoise.cl", "kernels/opengl/denoise.frag", "kernels/opencl/manifest.json"}
    assert pictures | frames | kernels | {"model.safetensors", "report.json", "report.html"} <= names
    assert not [name for name in names if name.startswith(".") or "/." in name]


def test_the_frames_are_held_out(finished, report) -> None:
    """Two times that are not training times, in the report and in the files."""
    times = {exr.read_frame(path).info["time"] for path in (finished / "frames/train").glob("*.exr")}
    held_out = [exr.read_frame(finished / f"frames/test/0000{k}-noisy.exr").info["time"] for k in (0, 1)]
    assert [float(time) for time in held_out] == [frame["time_s"] for frame in report["unseen"]]
    assert {float(time) for time in times} == set(report["train_times_s"])
    assert len({*held_out, *times}) == 2 + len(times) == 2 + demo.QUICK.train_frames


def test_the_full_plan_is_what_is_promised() -> None:
    """Frames of 256x256 or larger, references of 1024 samples, several training times, two unseen ones.

    Training takes the default preset, on features of more rays than one.
    """
    plan = demo.Plan()
    assert plan.size_px >= 256
    assert plan.reference_spp >= 1024
    assert plan.train_frames >= 4
    assert plan.test_frames >= 2
    assert plan.feature_spp > 1
    assert plan.preset == "shadows"


def test_the_numbers_are_those_of_the_files(finished, report) -> None:
    """Metrics of the EXR files; linear ones up to white, as the report says."""
    for index, frame in enumerate(report["unseen"]):
        noisy, reference = (
            exr.read_frame(finished / f"frames/test/0000{index}-{kind}.exr")["color"]
            for kind in ("noisy", "target")
        )
        a, b = encoding.to_display(noisy), encoding.to_display(reference)
        scores = frame["input"]["metrics"]
        assert scores["PSNR"] == metrics.psnr(a, b)
        assert scores["SSIM"] == metrics.ssim(a, b)
        assert scores["relMSE"] == metrics.relmse(encoding.from_display(a), encoding.from_display(b))
        assert set(frame) == {"time_s", "label", "input", "denoised"}
        assert frame["denoised"]["metrics"]["PSNR"] != scores["PSNR"]


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
    """The written picture is the definition's, up to the kernel's bound and the rounding to 8 bits."""
    model = load_model(finished / "model.safetensors")
    # The bound for all frames: the one of a frame is that of the first.
    bound = next(run["bound_all"] for run in report["runs"] if run["executor"] == report["denoised_by"])
    # Half a level of 8 bits, and float64's rounding of a sum below 256.
    slack = 0.5 / 255 + 256 * 2.0**-52
    for k in (0, 1):
        want = denoise(model, exr.read_frame(finished / f"frames/test/0000{k}-noisy.exr"), np.float64)
        assert np.abs(read_png(finished / f"pictures/{k}-denoised.png") - want).max() <= bound + slack


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
    assert len(page.texts) == 2 * 6 + 1
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

    monkeypatch.setattr("wamnet.kernels.run.before.render_frame", never)
    monkeypatch.setattr("wamnet.refimpl.network.train.train_step", never)
    monkeypatch.setattr("wamnet.kernels.run.trainer.Run.enqueue", never)
    results = demo.carry_out(demo.for_this_machine(demo.QUICK), folder)
    assert results.state.step == demo.QUICK.steps
    assert results.seconds_per_step > 0


def test_where_no_kernel_runs_numpy_renders_less(monkeypatch, capsys) -> None:
    """And both are reported to the user."""
    from wamnet.refimpl.errors import ExecutorUnavailable

    def nothing(name: str):
        raise ExecutorUnavailable(f"{name}: nothing there")

    monkeypatch.setattr("wamnet.kernels.devices.registry.open_executor", nothing)
    plan = for_this_machine(demo.Plan())
    assert plan == demo.replace(
        demo.Plan(),
        renderer="numpy",
        trainer="numpy",
        train_frames=demo.TRAIN_FRAMES_OF_NUMPY,
        train_spp=demo.REFERENCE_SPP_OF_NUMPY,
        reference_spp=demo.REFERENCE_SPP_OF_NUMPY,
    )
    told = capsys.readouterr().out
    assert "not opengl: nothing there" in told
    assert "rendered with NumPy, which is slow: 12 training times, references have 32 paths per pixel" in told


def test_refusals(refused, tmp_path) -> None:
    """A file in the folder's place; an invalid size; a scene that is not there."""
    assert "did you mean 'cornell'?" in refused("demo", "--scene", "cornel")
    assert "scene file 'none.json': not found" in refused("demo", "--scene", "none.json")
    (tmp_path / "a").write_text("hello")
    assert "output folder 'a': is a file (choose another with -o" in refused("demo", "-o", "a")
    assert "width 0: must be an integer" in refused("demo", "--size", 0)


def test_a_folder_holds_one_plan(refused, tmp_path, finished) -> None:
    """Results of another plan and other files are not mixed with this one's; nor are two sizes."""
    shutil.copytree(finished, tmp_path / "out")
    text = "output folder 'out': holds results of another plan (choose another with -o"
    assert text in refused("demo", "--size", 16, "-o", "out")
    with demo.begun(demo.for_this_machine(demo.QUICK), tmp_path / "out"):
        assert "another process is making a demonstration there" in refused("demo", "--quick", "-o", "out")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "noisy.exr").write_text("precious")
    text = "output folder 'mine': holds files that are not the demo's"
    assert text in refused("demo", "--quick", "-o", "mine")
    assert "--size 16: cannot be combined with --quick" in refused("demo", "--quick", "--size", 16)


def test_the_report_tells_whose_picture_it_is(finished, report) -> None:
    """That of a compiled kernel, if one ran; what the network sees; that the reference is noisy too."""
    ran = {run["executor"] for run in report["runs"] if not run["missing"]}
    assert report["denoised_by"] == next(name for name in ("opencl", "opengl", "numpy") if name in ran)
    html = (finished / "report.html").read_text()
    assert "it sees color, normal, albedo, position, direct of its" in html
    assert "its own noise counts as error" in html


@pytest.mark.parametrize(
    ("trainer", "forms"), [("opencl", ["full", "rank16", "window8+rank16"]), ("numpy", [])]
)
def test_the_report_compares_trained_forms_on_the_unseen_frames(
    finished, tmp_path, monkeypatch, trainer, forms
) -> None:
    """With their draws; where nothing compiled trains, there are no forms."""
    shutil.copytree(finished, tmp_path / "out")
    trained, given = [], []
    monkeypatch.setattr(bench, "measure", lambda request, **more: given.append((request, more)) or {})
    monkeypatch.setattr(
        bench_frames,
        "trained",
        lambda model, wanted, pairs, *_: trained.append((wanted, len(pairs))) or ["form"],
    )
    results = type("Results", (), {"model": load_model(finished / "model.safetensors")})()
    demo.measure_speed(dataclasses.replace(demo.QUICK, trainer=trainer), results, tmp_path / "out")
    ((request, more),) = given
    assert [draw["time_in_training"] for draw in request.frames["draws"]] == [False] * 2
    assert len(request.pairs) == 2
    assert more["forms"] == (["form"] if forms else [])
    assert [(list(wanted), count) for wanted, count in trained] == ([(forms, 2)] if forms else [])


@pytest.mark.parametrize(("name", "turns"), [("minicubes", False), ("glossy", False), ("daylight", True)])
def test_the_camera_turns_where_only_light_moves(name, turns):
    """Normals and depths of frames must differ; the sun's place changes none."""
    assert (demo.of_scene(demo.QUICK, name).yaw_deg == demo.VIEWS["yaw_deg"]) == turns
