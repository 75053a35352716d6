"""Tests of `wamnet bench`: its files, its refusals, an interrupt, its table and its plots."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from wamnet.cli.commands import bench, bench_frames
from wamnet.cli.common import inputs
from wamnet.cli.reports import bench_report
from wamnet.kernels.bench import contest, rates
from wamnet.models.data.frame_plan import frame_draws
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl.light.variation import Ranges

SPEC = Path(__file__).resolve().parents[2] / "spec" / "bench.md"
"""The chapter that documents the keys of the result."""

NAMES_AS_KEYS = ("machine", "versions", "rates", "limits_rounds_s")
"""Keys whose entries are named after things: there is no list of them."""


@pytest.fixture
def here(samples, tmp_path, monkeypatch):
    """Put a model into the working folder, and let the machine be measured on little."""
    shutil.copy(samples / "model.safetensors", tmp_path / "model.safetensors")
    monkeypatch.setattr(rates, "MATRIX", 32)
    monkeypatch.setattr(rates, "TRIAD_NUMBERS", 2 * rates.BLOCK_NUMBERS)
    monkeypatch.setattr(rates, "PROBE_PX", (8,))
    monkeypatch.setattr(contest, "PROBE_PAUSE_S", 0.0)
    return tmp_path


def test_the_result_is_written_in_all_forms(wamnet, here) -> None:
    """Of the interpreter at two sizes; what is predicted stands beside what is measured."""
    outcome = wamnet(
        *("bench", "model.safetensors", "--only", "numpy:*", "--repeats", 2),
        *("--size", 16, "--sizes", "8,16", "-o", "made/speed"),
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    data = json.loads((here / "made/speed/bench.json").read_text())
    assert data["schema"] == "wamnet-bench-2"
    assert data["interrupted"] is False
    assert data["command"].split()[0] == "wamnet"
    assert [row["name"] for row in data["contenders"]] == ["numpy:plain"]
    assert data["front"] == {"error": ["numpy:plain"], "quality": [], "rounding": ["numpy:plain"]}
    assert [entry["size_px"] for entry in data["sizes"]] == [8]
    folder = here / "made/speed"
    assert sorted(p.name for p in folder.iterdir()) == [
        "bench-error.png",
        "bench-sizes.png",
        "bench.json",
        "bench.md",
    ]
    for path in folder.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    text = (folder / "bench.md").read_text()
    assert re.search(r"^\| numpy:plain \* \| [\d.,]+ \| [\d.,]+ - [\d.,]+ \| ", text, re.M)
    assert re.search(r"^\| contender \| 8, ms \(predicted\) \| 16, ms \(predicted\) \|$", text, re.M)
    assert "numpy:plain *" in outcome.out
    assert "results: made/speed/bench.json, made/speed/bench.md" in outcome.out
    assert keys_of(data) <= set(re.findall(r"`(\w+)`", SPEC.read_text())), "every key is documented"
    heads, rows = bench_report.speed_table(data)
    assert heads[1:4] == ("ms", "range", "predicted, ms")
    assert rows[0][3] == bench_report.number(data["contenders"][0]["predicted_ms"])
    ((mark,),) = (panel.marks for panel in bench_report.panels(data, bench_report.ERRORS))
    assert mark.ms[0] == data["contenders"][0]["ms"]["median"]
    assert mark.on_front


def keys_of(value, skip: bool = False) -> set[str]:
    """Return all keys of nested data, but names of things."""
    if isinstance(value, list):
        return set().union(*(keys_of(item) for item in value), set())
    if not isinstance(value, dict):
        return set()
    own = set() if skip else set(value)
    return own.union(*(keys_of(item, key in NAMES_AS_KEYS) for key, item in value.items()))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--size", "0"], "size of the image 0: must be from 1 to 8192 pixels"),
        (["--sizes", "64,9000"], "size of the image 9000"),
        (["--sizes", "64 128"], "--sizes '64 128': must be integers with commas"),
        (["--repeats", "0"], "--repeats 0: must be from 1 to 1000"),
        (["--budget", "nan"], "--budget nan: must be from 0.001 to 1000000 seconds"),
        (["--budget", "0"], "--budget 0.0: must be from 0.001 to 1000000 seconds"),
        (["--synthetic", "--features", "color,colour"], "feature 'colour"),
        (["--features", "color"], "--features 'color': a trained model says itself what it sees"),
        (["model.safetensors", "--features", "color"], "--features 'color': a trained model says itself"),
        (["--synthetic", "--dataset", "cubes"], "--dataset 'cubes': noise is measured in its place"),
        (["paper", "--dataset", "cubes"], "--dataset 'cubes': noise is measured in its place"),
        (["paper", "--train-variants"], "--train-variants: forms are trained on frames"),
        (["model.safetensors", "--train-variants"], "--train-variants: forms are trained on frames"),
        (["--frames", "0"], "--frames 0: must be from 1 to 100"),
        (["--reference-spp", "0"], "--reference-spp 0: must be from 1 to"),
        (["--steps", "0"], "--steps 0: must be from 1 to"),
        (["model.safetensors", "--dataset", "cubes"], "data set 'cubes': has no manifest.json"),
        (["none.safetensors"], "none.safetensors"),
        (["-o", "file"], "output folder 'file': is a file"),
    ],
)
def test_bad_input_is_refused(refused, here, arguments, message) -> None:
    (here / "file").write_text("mine")
    assert message in refused("bench", *arguments, "--only", "numpy:plain")


def test_unknown_contenders_are_refused(refused, here) -> None:
    told = refused("bench", "--only", "numpy:plain,nobody", "-o", "speed")
    assert "name of a program 'nobody': matches none (choose one of numpy:plain, opencl:plain" in told


def test_without_matplotlib_nothing_is_measured(refused, here, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    assert "pip install 'wamnet[full]'" in refused("bench")


def test_an_interrupt_leaves_what_was_measured(wamnet, here, monkeypatch) -> None:
    """After the first round: files are there, and say that the run was interrupted."""
    monkeypatch.setattr(contest.Contest, "_judge", lambda self: (_ for _ in ()).throw(KeyboardInterrupt))
    outcome = wamnet(
        "bench", "model.safetensors", "--only", "numpy:plain", "--repeats", 1, "--size", 8, "-o", "speed"
    )
    assert outcome.status == 130
    assert "wamnet: speed: has the results so far" in outcome.err
    data = json.loads((here / "speed/bench.json").read_text())
    assert data["interrupted"] is True
    assert len(data["contenders"][0]["ms"]["rounds"]) == 1
    assert "interrupted: this is what was measured until then" in (here / "speed/bench.md").read_text()


def test_quality_comes_from_a_data_set(wamnet, here) -> None:
    """The kernel that is the network loses less than rounding can: 1e-4 dB."""
    made = wamnet("dataset", "cornell", "--frames", 1, "--test", 1, "--size", 16, "--spp", 4, "-o", "set")
    assert made.status == 0, made.err
    outcome = wamnet(
        *("bench", "model.safetensors", "--dataset", "set", "--only", "numpy:plain,opencl:plain"),
        *("--executor", "numpy", "--size", 16, "--repeats", 1, "-o", "speed"),
    )
    assert outcome.status == 0, outcome.err
    data = json.loads((here / "speed/bench.json").read_text())
    assert data["unseen_frames"] == 1
    assert [row["name"] for row in data["contenders"]] == ["numpy:plain"]
    quality = data["contenders"][0]["quality"]
    # A picture that moves by d moves its PSNR by at most 20 log10(1 + d / rmse) dB: with d below 1e-6 and
    # an rmse above 1e-1 (the network is not trained) that is less than 1e-4.
    assert abs(quality["psnr_loss_db"]) <= 1e-4
    assert (here / "speed/bench-trade-off.png").is_file()
    assert "PSNR loss, dB" in (here / "speed/bench.md").read_text()


def small_scene(monkeypatch) -> None:
    """Let training frames be few and tiny, and NumPy render and train: no device is needed."""
    monkeypatch.setattr(bench_frames, "chosen", lambda **_options: "numpy")
    monkeypatch.setattr(bench, "chosen", lambda **_options: "numpy")
    monkeypatch.setattr(bench_frames, "TRAINING_FRAMES", 2)
    monkeypatch.setattr(bench_frames, "TRAINING_SPP", 2)
    monkeypatch.setattr(bench_frames, "TRAINING_PX", 12)


def of_cubes(path: Path) -> None:
    """Make the model in a file one that says that it was trained on the mini cubes."""
    model = load_model(path)
    info = {"trained_on_scene": "minicubes", "trained_on_feature_spp": "2", "trained_on_time": "0.0, 4.0"}
    save_model(path, replace(model, info=info))


def measured(wamnet, *more: object) -> tuple[dict, str]:
    """Return the result of a small run on two rendered frames, and what it said."""
    outcome = wamnet(
        *("bench", "model.safetensors", "--size", 16, "--frames", 2, "--reference-spp", 2),
        *("--repeats", 1, "-o", "speed", *more),
    )
    assert outcome.status == 0, outcome.err
    return json.loads(Path("speed/bench.json").read_text()), outcome.out


def test_frames_of_the_model_s_scene_are_rendered_once(wamnet, here, monkeypatch) -> None:
    """With its camera rays; their draws are in the result, and a second run finds them."""
    small_scene(monkeypatch)
    of_cubes(here / "model.safetensors")
    data, said = measured(wamnet, "--only", "numpy:plain")
    frames = data["frames"]
    assert (data["unseen_frames"], frames["scene"], frames["feature_spp"]) == (2, "minicubes", 2)
    assert (frames["reference_spp"], frames["frame_px"], data["network"]["name"]) == (
        2,
        16,
        "model.safetensors",
    )
    times = [draw["time_s"] for draw in frames["draws"]]
    assert len(set(times)) == 2
    assert [draw["time_in_training"] for draw in frames["draws"]] == [False, False]
    assert min(draw["noisy_seed"] for draw in frames["draws"]) > bench_frames.TEST_SEED
    assert data["contenders"][0]["quality"]["psnr_loss_db"] is not None
    assert re.search(r"6 images .*, 6 of them rendered now", said)
    assert re.search(r"6 images .*, 0 of them rendered now", measured(wamnet, "--only", "numpy:plain")[1])


def test_frames_are_drawn_from_the_ranges_that_a_model_has_learned(samples) -> None:
    """Time, camera and lamps; without ranges the camera is at rest."""
    model = load_model(samples / "model.safetensors")
    named = {"trained_on_scene": "minicubes", "trained_on_feature_spp": "16", "trained_on_max_depth": "3"}
    ranges = Ranges((1.0, 3.0), (-20.0, 30.0), (-5.0, 8.0), (0.9, 1.1), (0.0, 0.5))
    moving = replace(model, info={**named, "trained_on_ranges": ranges.to_json()})
    request = bench_frames.request_for(moving, "numpy", frames=1, test_frames=8, seed=3)
    assert request.ranges == ranges
    assert (request.scene, request.feature_spp, request.max_depth) == ("minicubes", 16, 3)
    assert bench_frames.request_for(replace(model, info=named), "numpy").yaw_deg == (0.0, 0.0)
    for _, draw in frame_draws(request):
        assert 1.0 <= draw.time_s < 3.0
        assert -20.0 <= draw.variation.yaw_deg <= 30.0
        assert len(draw.variation.lights) > 0


def test_what_a_model_has_not_learned_is_said() -> None:
    data = traded()
    data["frames"]["draws"][0]["unlike_training"] = ["it shows cornell"]
    assert "a test frame: it shows cornell" in bench_report.notes(data)


@pytest.mark.nightly(but="opengl")
@pytest.mark.parametrize("executor", ["opencl", "opengl"])
def test_forms_are_trained_and_then_measured(wamnet, here, monkeypatch, executor_named, executor) -> None:
    """Each is a row with the steps of its training; one that the model cannot have has no row."""
    executor_named(executor)
    small_scene(monkeypatch)
    monkeypatch.setattr(bench_frames, "FORMS", ("full", "rank2", "window3", "window14"))
    of_cubes(here / "model.safetensors")
    names = ",".join(f"{executor}:*:{form}" for form in ("further", "rank2", "window3"))
    data, said = measured(wamnet, "--train-variants", "--steps", 3, "--only", names)
    steps = {row["name"].split(":")[-1]: row["trained_steps"] for row in data["contenders"]}
    assert {name: steps[name] for name in ("further", "rank2", "window3")} == dict.fromkeys(
        ("further", "rank2", "window3"), 3
    )
    assert "window14" not in steps
    assert "form rank2: 3 steps" in said
    for row in data["contenders"]:
        assert row["state"] == "measured", row["reason"]
        if row["rounding"]["bound"] is not None:
            assert row["rounding"]["max"] <= row["rounding"]["bound"]


@pytest.mark.parametrize("named", [["--synthetic"], ["paper"]])
def test_noise_is_measured_on_request(wamnet, here, named) -> None:
    """The paper's network, untrained: no frames, and no quality."""
    outcome = wamnet("bench", *named, "--only", "numpy:plain", "--size", 8, "--repeats", 1, "-o", "speed")
    assert outcome.status == 0, outcome.err
    data = json.loads((here / "speed/bench.json").read_text())
    assert (data["network"]["name"], data["network"]["widths"][0]) == ("paper", 864)
    assert (data["unseen_frames"], data["frames"]) == (0, None)


def test_the_shipped_model_is_measured_by_default(monkeypatch) -> None:
    """It names a scene, so that frames of it can be rendered."""
    wanted = bench.Wanted(train_variants=True)
    name, network = wanted.network()
    wanted.check(network)
    assert name == "minicubes"
    assert inputs.trained_scene(network) == "minicubes"


# ---- texts and plots of planted data -----------------------------------------------------------------------


def row(name: str, **facts) -> dict:
    found = {"name": name, "text": name, "kind": "kernel", "state": "measured", "reason": "", "ms": None}
    return {**found, "kernel_ms": None, "caches": "nothing", **facts}


def planted(**facts) -> dict:
    """Return a result of three contenders: two with times, one without."""
    ms = {"median": 2.0, "min": 1.0, "max": 3.0, "spread": 1.0, "rounds": [1.0, 2.0, 3.0]}
    rows = [
        row("slow", ms={**ms, "median": 5000.0}, error={"max": 1e-7}, of_sgemm=1.5, kind="peer"),
        row("fast", ms=ms, error={"max": 1e-3}, predicted_ms=4.0),
        row("none", state="missing", reason="not here"),
        row("zero", ms=ms, error={"max": None}),
    ]
    data = {
        "contenders": rows,
        "front": {"error": ["fast", "slow"], "quality": []},
        "sizes": [{"size_px": 512, "contenders": [row("slow", reason="left out: so slow", state="skipped")]}],
        "size_px": 256,
        "network": {"widths": [4, 3], "features": ["color"]},
        "machine": {"processor": "a <b>"},
        "versions": {},
        "limits": None,
        "unseen_frames": 0,
        "interrupted": False,
        "command": "wamnet bench",
    }
    return {**data, **facts}


def test_notes_say_loudly_what_was_left_out() -> None:
    lines = bench_report.notes(planted(interrupted=True))
    assert lines[:2] == ["none: missing, not here", "slow at 512: left out: so slow"]
    assert lines[2].startswith("a kernel is faster than sgemm: ")
    assert lines[3].startswith("interrupted")


def test_rows_are_sorted_and_have_dashes() -> None:
    _, rows = bench_report.speed_table(planted())
    assert [cells[0] for cells in rows] == ["fast *", "zero", "slow *"]
    assert rows[1][-1] == "–"
    assert rows[2][1] == "5,000"


TRADED = {"ms": {"median": 20.0, "min": 19.0, "max": 25.0, "spread": 0.3, "rounds": [20.0]}}
"""Times of the rows below."""


def traded() -> dict:
    """Return a result with a trained form, a kernel of another sine, one without a bound, and two peers."""
    facts = {"executor": "opencl", "schedule": "tile:16", "profile": "ieee", "degree": 11, "rank": None}
    facts |= {"window": 12, "parameters": 58595, **TRADED}
    bounds = {"max": 2e-7, "bound": 1e-5, "bound_all": 1e-4, "certified": True}
    loss = {"psnr_db": 35.0, "psnr_loss_db": -0.001}
    no_bounds = dict.fromkeys(bounds)
    rows = [
        row("opencl:tile:16", quality=loss, rounding=bounds, **facts),
        row("opencl:tile:16:rank8", quality={"psnr_db": 34.0, "psnr_loss_db": 1.0}, rounding=bounds, **facts)
        | {"rank": 8, "parameters": 7811},
        row("opencl:tile:16:native", quality=loss, rounding=no_bounds, **facts)
        | {"profile": "native", "degree": None},
        row("torch", kind="peer", quality=loss, rounding=no_bounds, **TRADED, window=12),
        row("oidn:high", kind="peer", quality={"psnr_db": 32.0, "psnr_loss_db": 3.0}, **TRADED),
    ]
    network = {"widths": [4, 3], "features": ["color"], "window": 12}
    draws = [{"time_s": 1.6, "time_in_training": False, "unlike_training": []}]
    frames = {"scene": "minicubes", "frame_px": 16, "feature_spp": 16, "reference_spp": 2, "draws": draws}
    front = {"error": [], "quality": ["opencl:tile:16"], "rounding": ["opencl:tile:16"]}
    return planted(contenders=rows, network=network, frames=frames, front=front, unseen_frames=1)


def test_the_table_has_quality_error_and_bounds_of_every_row() -> None:
    lines = bench_report.table(traded()).splitlines()
    start = "| 12 | 58,595 | 20 | 30% |"
    assert (
        lines[2]
        == f"| whole * | opencl tile:16 | ieee, 11 | – {start} 35.00 | 0.00 | 2.0e-07 | 1.0e-05 | 1.0e-04 † |"
    )
    assert lines[3].startswith(
        "| rank8 | opencl tile:16 | ieee, 11 | 8 | 12 | 7,811 | 20 | 30% | 34.00 | +1.00 |"
    )
    assert lines[4] == f"| native | opencl tile:16 | native, its own | – {start} 35.00 | 0.00 | – | – | – |"
    assert lines[6] == "| oidn:high | – | – | – | – | – | 20 | 30% | 32.00 | +3.00 | – | – | – |"


def test_the_picture_has_a_panel_of_loss_and_one_of_bounds() -> None:
    """Markers say the executor, colours the kind; what has no bound is in the second panel without one."""
    loss, bound = bench_report.panels(traded())
    assert (loss.is_loss, bound.is_loss) == (True, False)
    marks = {mark.name: mark for mark in bound.marks}
    assert list(marks) == ["tile:16", "rank8", "native", "torch", "oidn:high"]
    assert [mark.kind for mark in marks.values()] == ["whole", "rank", "sine", "peer", "peer"]
    assert [mark.executor for mark in marks.values()] == ["opencl"] * 3 + ["", "other"]
    assert [mark.y for mark in marks.values()] == [1e-5, 1e-5, None, None, None]
    assert [mark.y for mark in loss.marks] == [-0.001, 1.0, -0.001, -0.001, 3.0]
    assert [mark.on_front for mark in loss.marks] == [True, False, False, False, False]
