"""Tests of `wamnet dataset`: the same bytes from any number of processes, resumed, and checked."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from wamnet.cli.common import cluster
from wamnet.cli.files import dataset_files, exr
from wamnet.models.data import draws, frame_plan
from wamnet.models.model_file import load_model
from wamnet.refimpl.frame import HISTORY, SEEN, USUAL
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scene import from_json, scene_digest
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Ranges, Variation, ranges_from_json, varied
from wamnet.refimpl.network.denoise import learned_shadow_rays

TINY = ("minicubes", "--frames", 2, "--test", 1, "--size", 12, "--spp", 4)


def content(folder: Path) -> dict[str, bytes]:
    """Return every file."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_the_pictures_are_the_references(wamnet, tmp_path) -> None:
    """Times, seeds and samples as the manifest says, all layers, to the bit; checked, and made once."""
    outcome = wamnet("dataset", *TINY, "--seed", 5, "-o", "a")
    assert outcome.status == 0
    summary, made = outcome.out.splitlines()
    assert summary.startswith("test frames differ from the nearest training frame in ")
    assert made == "a: 6 images of 3 frames, 6 of them rendered now"
    manifest = json.loads((tmp_path / "a/manifest.json").read_text())
    assert set(manifest["nearest"]) == {"test"}
    frames = manifest["frames"]
    times = draws.times(5, 0.0, 8.0, 0, 3)
    assert [(frame["split"], frame["time_s"]) for frame in frames] == list(
        zip(("train", "train", "test"), times, strict=True)
    )
    for frame in frames:
        scene = canonical("minicubes", time=frame["time_s"])
        assert frame["scene_digest"] == scene_digest(scene)
        for kind, spp in (("noisy", 1), ("target", 4)):
            facts = frame[kind]
            want = render(scene, Job(12, 12, spp, facts["seed"])).frame
            got = exr.read_frame(tmp_path / "a" / facts["file"])
            assert all((got[name] == values).all() for name, values in want.layers.items())
            assert want.info.items() <= got.info.items()
            assert ranges_from_json(got.info["ranges"]) == Ranges()
    assert wamnet("dataset", "--check", "-o", "a").out == "a: 6 images match manifest.json\n"
    assert wamnet("dataset", *TINY, "--seed", 5, "-o", "a").out.endswith(", 0 of them rendered now\n")


def test_a_kernel_makes_the_pictures(wamnet, executor_named, tmp_path) -> None:
    """Nearly all pixels are the reference's (tests/kernels/test_paths.py)."""
    executor_named("opencl")
    assert wamnet("dataset", *TINY, "--executor", "opencl", "-o", "a").status == 0
    assert wamnet("dataset", *TINY, "-o", "b").status == 0
    assert json.loads((tmp_path / "a/manifest.json").read_text())["request"]["executor"] == "opencl"
    for name in ("train/00001-noisy.exr", "train/00001-target.exr"):
        got, want = (exr.read_frame(tmp_path / folder / name) for folder in "ab")
        near = np.abs(got["color"] - want["color"]) <= 1e-5 * (want["color"] + want["color"].mean())
        assert near.all(axis=-1).mean() >= 0.97
    assert wamnet("dataset", "--check", "-o", "a").status == 0


def test_shadow_rays_are_the_request_s(wamnet, tmp_path) -> None:
    """DSF-3, MET-11, TRN-9d: noisy frames and targets of tests have the layer; a model keeps their number."""
    assert wamnet("dataset", *TINY, "--shadow-rays", 2, "-o", "a").status == 0
    assert json.loads((tmp_path / "a/manifest.json").read_text())["request"]["shadow_rays"] == 2
    frames = {name: exr.read_frame(tmp_path / f"a/{name}.exr") for name in NAMES}
    assert [name for name, frame in frames.items() if "direct" in frame] == [*NAMES[:1], *NAMES[2:]]
    few = ("--preset", "shadows", "--steps", 2, "-o", "m.safetensors")
    assert wamnet("train", "--dataset", "a", *few).status == 0
    model = load_model(tmp_path / "m.safetensors")
    assert (model.features[-1], learned_shadow_rays(model)) == ("direct", 2)


NAMES = ("train/00000-noisy", "train/00000-target", "test/00000-noisy", "test/00000-target")
"""Frames of a data set."""


def test_what_is_seen_is_the_request_s(wamnet, tmp_path) -> None:
    """DSF-3: noisy pictures have its layers and targets do not; a request without it does not name it."""
    assert wamnet("dataset", *TINY, "--seen", "-o", "a").status == 0
    assert json.loads((tmp_path / "a/manifest.json").read_text())["request"]["seen"] is True
    assert set(exr.read_frame(tmp_path / "a/train/00000-noisy.exr").layers) == {*USUAL, *SEEN}
    assert set(exr.read_frame(tmp_path / "a/train/00000-target.exr").layers) == set(USUAL)
    assert wamnet("dataset", *TINY, "-o", "b").status == 0
    assert "seen" not in json.loads((tmp_path / "b/manifest.json").read_text())["request"]
    few = "--preset short --steps 2 --features color,seen_normal,seen_depth -o m.safetensors"
    assert wamnet("train", "--dataset", "a", *few.split()).status == 0
    film = "--seconds 0.2 --fps 5 --size 9 -o c"
    assert wamnet("animate", "m.safetensors", *film.split()).status == 0


def test_check_tells_and_a_run_mends(wamnet, tmp_path) -> None:
    """Exit status 2 and nothing changed; then the same bytes again."""
    wamnet("dataset", *TINY, "-o", "a")
    before = content(tmp_path)
    path = tmp_path / "a/train/00001-target.exr"
    path.write_bytes(b"x")
    outcome = wamnet("dataset", "--check", "-o", "a")
    assert outcome.status == 2
    assert outcome.out == "a/train/00001-target.exr: damaged\n"
    assert outcome.err.startswith("wamnet: error: data set 'a': 1 of its images do not match manifest.json")
    assert path.read_bytes() == b"x"
    outcome = wamnet("dataset", *TINY, "-o", "a")
    assert outcome.out.startswith("a/train/00001-target.exr: damaged, rendered again\n")
    assert content(tmp_path) == before


@pytest.mark.nightly
def test_bands_on_a_cluster_with_a_worker_killed(wamnet, tmp_path, monkeypatch) -> None:
    """Two processes, pictures in three bands, a worker killed while it has some: one process's bytes."""
    assert wamnet("dataset", *TINY, "--workers", 1, "-o", "one").status == 0
    monkeypatch.setattr(frame_plan, "TASK_SAMPLES", 1)
    monkeypatch.setattr(frame_plan, "TILE_PIXELS", 48)
    share, killed = cluster.do_on_cluster, []

    def with_a_loss(client, tasks, do, on_result) -> None:
        pids = client.run(os.getpid)

        def keep(task, band) -> None:
            on_result(task, band)
            busy = [worker for worker, keys in client.processing().items() if keys]
            if busy and not killed:
                os.kill(pids[busy[0]], signal.SIGKILL)
                killed.append(busy[0])

        share(client, tasks, do, keep)

    monkeypatch.setattr(cluster, "do_on_cluster", with_a_loss)
    assert wamnet("dataset", *TINY, "--workers", 2, "-o", "two").status == 0
    assert killed
    assert content(tmp_path / "two") == content(tmp_path / "one")


def test_ranges_and_parameters_are_passed_on(wamnet, tmp_path) -> None:
    """Start, length, a parameter of the scene, depth, arc, camera, lamps."""
    options = ("--start", 1, "--seconds", 2, "--set", "warm=1,0.5,0.5", "--max-depth", 1)
    ranges = ("--arc", 0.5, "--yaw=-24:24", "--pitch=-8:8", "--distance", "0.9:1.1", "--saturation", "0:0.7")
    ranges += ("--power", "0.5:2")
    assert wamnet("dataset", *TINY, *options, *ranges, "--outside", 3, "-o", "a").status == 0
    manifest = json.loads((tmp_path / "a/manifest.json").read_text())
    assert manifest["request"]["parameters"] == {"warm": [1.0, 0.5, 0.5]}
    assert set(manifest["nearest"]) == {"test", "outside"}
    frames = manifest["frames"]
    assert [f["split"] for f in frames] == ["train", "train", "test", "outside", "outside", "outside"]
    assert [f.get("outside") for f in frames[3:]] == ["time", "camera", "lamps"]
    assert all(1.0 <= f["time_s"] < 2.5 for f in frames[:3])
    assert 2.5 <= frames[3]["time_s"] < 3.0
    wanted = Ranges((1.0, 2.5), (-24.0, 24.0), (-8.0, 8.0), (0.9, 1.1), (0.0, 0.7), (0.5, 2.0))
    for facts in frames:
        scene = canonical("minicubes", time=facts["time_s"], warm=(1.0, 0.5, 0.5))
        lights = tuple(tuple(color) for color in facts["lights"])
        v = Variation(facts["yaw_deg"], facts["pitch_deg"], facts["distance"], lights)
        got = exr.read_frame(tmp_path / "a" / facts["noisy"]["file"]).info
        assert got["scene_digest"] == scene_digest(varied(scene, v))
        assert got["max_depth"] == "1"
        assert ranges_from_json(got["ranges"]) == wanted


def test_test_frames_that_were_seen_are_refused(refused, tmp_path) -> None:
    """Before anything is rendered: the lattice of a scene that stands still is one picture."""
    text = refused("dataset", "daylight", "--frames", 2, "--test", 1, "--size", 12, "-o", "still")
    assert "test frame 'test/00000 (" in text
    assert "over 99 % of the pixels (move the camera (--yaw, --pitch, --distance)" in text
    assert not (tmp_path / "still").exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "argument SCENE: missing"),
        (["--check"], "data set 'dataset': has no manifest.json (make one"),
        (["glossy", "--check"], "argument SCENE 'glossy': --check looks at the folder"),
        (["none.json"], "scene file 'none.json': not found (check"),
        (["minicbes"], "unknown (did you mean 'minicubes'? choose one of minicubes, glossy"),
        (["minicubes", "--frames", 0], "frames 0: must be an integer from 1 to"),
        (["minicubes", "--workers", 0], "workers 0: at least one process must work"),
        (["minicubes", "--workers", 2, "--scheduler", "x"], "a running scheduler has its own workers (leave"),
        (["minicubes", "--set", "time=1"], "parameter time 1.0: each frame has its own"),
        (["minicubes", "--yaw", "5"], "--yaw '5': must be LOW:HIGH (for example --yaw=-24:24"),
        (
            ["minicubes", "--pitch", "0:99"],
            "range of pitch_deg '0.0:99.0': must be LOW:HIGH within -85 to 85",
        ),
        (["minicubes", "--before", 257], "before 257: must be from 0 to 256 frames (choose fewer"),
    ],
)
def test_refusals(refused, arguments, text) -> None:
    """Before any work, and without a folder."""
    assert text in refused("dataset", *arguments)


MINE = ("mine.json", "--frames", 2, "--test", 1, "--size", 12, "--spp", 2)
"""A small data set of a scene file, without the ranges."""


def test_a_scene_file_is_a_scene(wamnet, refused, tmp_path) -> None:
    """Static, from the draws' cameras and under their lights; its SHA-256 goes from file to model."""
    wamnet("scene", "cornell", "--time", 1, "-o", "mine.json")
    content, ranges = (tmp_path / "mine.json").read_bytes(), ("--yaw=-20:20", "--saturation=0:0.5")
    assert wamnet("dataset", *MINE, *ranges, "-o", "a").status == 0
    manifest, digest = json.loads((tmp_path / "a/manifest.json").read_text()), sha256(content).hexdigest()
    assert manifest["request"]["scene_sha256"] == digest
    for facts in manifest["frames"]:
        lights = tuple(map(tuple, facts["lights"]))
        variation = Variation(facts["yaw_deg"], facts["pitch_deg"], facts["distance"], lights)
        shown = varied(from_json(content), variation)
        assert facts["scene_digest"] == scene_digest(shown)
        for kind, spp in (("noisy", 1), ("target", 2)):
            found = exr.read_frame(tmp_path / "a" / facts[kind]["file"])
            assert found.info["scene_sha256"] == digest
            want = render(shown, Job(12, 12, spp, facts[kind]["seed"])).frame["color"]
            assert (found["color"] == want).all()
    assert wamnet("train", "--dataset", "a", "--steps", 1).status == 0
    small = ("render", "mine.json", "--width", 8, "--height", 8)
    wamnet(*small, "--yaw", 10, "-o", "same.exr")
    assert "expect" not in wamnet("denoise", "model.safetensors", "same.exr").out
    (tmp_path / "mine.json").write_bytes(content + b"\n")
    wamnet(*small, "-o", "other.exr")
    sentence = "cornell is another scene file than the one the model was trained on"
    assert sentence in wamnet("denoise", "model.safetensors", "other.exr").out
    assert f"scene_sha256 {digest} (now" in refused("dataset", *MINE, *ranges, "-o", "a")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((), "scene 'cornell': is static, and without a range of camera or lights all its frames show"),
        (("--yaw=-9:9", "--arc", 1), "argument '--arc': has no meaning for a scene file, which is static"),
        (("--yaw=-9:9", "--set", "size=1"), "option for the scene 'size': a scene file has no parameters"),
    ],
)
def test_refusals_of_a_scene_file(wamnet, refused, arguments, text) -> None:
    """What only a scene that moves has, and frames that would all be alike."""
    wamnet("scene", "cornell", "-o", "mine.json")
    assert text in refused("dataset", *MINE, *arguments)


@pytest.mark.nightly
@pytest.mark.parametrize("executor", ["opencl", "opengl", "c"])
def test_kernels_on_a_cluster_give_the_same_bytes(wamnet, executor_named, tmp_path, executor) -> None:
    """A worker opens a device of its own, in a thread that is not its first one."""
    executor_named({"opengl": "opengl-egl"}.get(executor, executor))
    for folder, workers in (("a", 1), ("b", 2)):
        arguments = ("--executor", executor, "--workers", workers, "-o", folder)
        assert wamnet("dataset", *TINY, *arguments).status == 0
    assert content(tmp_path / "a") == content(tmp_path / "b")


def test_on_a_running_scheduler(wamnet, tmp_path) -> None:
    """The same bytes through an address."""
    assert wamnet("dataset", *TINY, "-o", "one").status == 0
    with cluster.open_client(1, None) as client:
        address = client.scheduler.address
        assert wamnet("dataset", *TINY, "--scheduler", address, "-o", "two").status == 0
    assert content(tmp_path / "two") == content(tmp_path / "one")


@pytest.mark.nightly
@pytest.mark.parametrize(("sent", "workers"), [(signal.SIGINT, 1), (signal.SIGINT, 2), (signal.SIGKILL, 2)])
def test_an_interrupted_process_is_gone_on_with(wamnet, tmp_path, sent, workers) -> None:
    """The whole group is interrupted, or only the process killed; nothing that was done is redone."""
    arguments = [str(a) for a in (*TINY[:-3], 36, "--spp", 64, "-o", "a")]
    command = [sys.executable, "-m", "wamnet.cli", "dataset", *arguments, "--workers", str(workers)]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, start_new_session=True) as process:
        try:
            journal = tmp_path / "a" / dataset_files.UNFINISHED / dataset_files.JOURNAL
            for _ in range(600):
                if journal.exists() and journal.read_text().count("\n") >= 2:
                    break
                time.sleep(0.05)
            assert process.poll() is None
            (os.killpg if sent == signal.SIGINT else os.kill)(process.pid, sent)
            _, errors = process.communicate(timeout=60)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    if sent == signal.SIGINT:
        hint = b"wamnet: a: the same command resumes\n"
        assert (process.returncode, errors) == (130, hint + b"wamnet: interrupted\n")
    done = list((tmp_path / "a").rglob("0*.exr"))
    times = {path: path.stat().st_mtime_ns for path in done}
    assert len(done) >= 2
    assert wamnet("dataset", *arguments).status == 0
    assert {path: path.stat().st_mtime_ns for path in done} == times
    assert wamnet("dataset", *arguments[:-1], "b").status == 0
    assert content(tmp_path / "a") == content(tmp_path / "b")


def test_noisy_pictures_have_the_history_of_those_before(wamnet, tmp_path) -> None:
    """By the reference here; targets have none."""
    assert wamnet("dataset", *TINY, "--before", 2, "-o", "film").status == 0
    noisy, target = (
        exr.read_frame(tmp_path / f"film/train/00000-{kind}.exr") for kind in ("noisy", "target")
    )
    assert [(name in noisy, name in target) for name in HISTORY] == [(True, False)] * len(HISTORY)
    assert 0.5 < noisy["history_weight"].max() <= 2 / 3  # of three samples: 1 - 1/3
