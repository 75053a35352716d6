"""`wamnet export`: files of each target, options of scenes, verdicts, refusals."""

import json

import pytest

from wamnet.cli.common.request import table
from wamnet.kernels.export import check, targets
from wamnet.kernels.export.hosts.host import HOSTS


def test_an_export_is_a_folder_that_certify_takes(wamnet, samples, tmp_path):
    outcome = wamnet(
        "export", samples / "model.safetensors", "--target", "c", "--weights", "inline", "-o", "x"
    )
    assert outcome.status == 0, outcome.err
    manifest = json.loads((tmp_path / "x/manifest.json").read_text())
    assert manifest["target"] == "c"
    assert manifest["weights"]["where"] == "inline"
    assert "weights of a constant table: 803 of 1048576" in outcome.out
    assert {*manifest["files"], "manifest.json"} == {
        path.relative_to(tmp_path / "x").as_posix() for path in (tmp_path / "x").rglob("*") if path.is_file()
    }
    assert wamnet("certify", "--no-text", "x/denoise").status == 0


def test_a_scene_comes_along_and_the_check_is_told(wamnet, samples, tmp_path):
    arguments = ["--scene", "lone_light", "--max-depth", "1", "--target", "cuda", "--check", "-o", "x"]
    outcome = wamnet("export", samples / "model.safetensors", *arguments)
    assert outcome.status == 0, outcome.err
    assert {path.name for path in (tmp_path / "x").iterdir() if path.is_dir()} == {
        *("denoise", "path", "encode", "check")
    }
    assert "the bound assumes: the compiler is not told to relax arithmetic" in outcome.out
    assert "error: " in outcome.out
    manifest = json.loads((tmp_path / "x/manifest.json").read_text())
    assert manifest["scene"]["settings"]["max_depth"] == 1
    assert [kernel["role"] for kernel in manifest["kernels"]] == ["path", "encode", "denoise"]


@pytest.mark.parametrize(("asked", "name"), [([], "tile:8"), (["--schedule", "plain"], "plain")])
def test_the_schedule_is_the_fastest_or_the_named_one(wamnet, samples, tmp_path, asked, name):
    """EXP-12: the output, the manifest and the README say which."""
    outcome = wamnet("export", samples / "model.safetensors", "--target", "c", *asked, "-o", "x")
    assert outcome.status == 0, outcome.err
    assert f"schedule {name}: " in outcome.out
    manifest = json.loads((tmp_path / "x/manifest.json").read_text())
    assert manifest["kernels"][-1]["schedule"]["name"] == name
    offered = "fft:8, fft:16, fft:4, tile:8, tile:16, tile:4, dot:16, plain"
    assert ", ".join(manifest["schedules"]) == offered
    assert f"* Schedule: {name}: " in (tmp_path / "x/README.md").read_text()


def test_a_wrong_export_ends_with_status_1(wamnet, samples, monkeypatch):
    verdict = check.Verdict("c", "buffer", 1, "cc", "cc", wrong="off by 1, 9 times the bound")
    monkeypatch.setattr(check, "check", lambda made: verdict)
    outcome = wamnet("export", samples / "model.safetensors", "--target", "c", "--check", "-o", "x")
    assert outcome.status == 1
    assert "wrong: off by 1, 9 times the bound" in outcome.out


def test_help_names_every_target_and_host():
    names = table()["names"]
    assert names["targets"].split(", ") == [*targets.NAMES, "html"]
    assert names["hosts"].split(", ") == list(HOSTS)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--target", "abacus"], "--target 'abacus': unknown (choose one of opencl, glsl"),
        (["--target", "c", "--weights", "texture"],
         "--weights 'texture': is not available for target c (choose one of buffer, inline"),
        (["--target", "c", "--time", "2"], "--time 2.0: there is no scene (name one with --scene"),
        (["--target", "c", "--max-depth", "2"], "--max-depth 2: there is no scene"),
        (["--target", "c", "--moving", "time"], "--moving 'time': there is no scene"),
        (["--target", "c", "--fps", "5"], "--fps 5.0: nothing moves (add --moving time"),
        (["--target", "c", "--scene", "minicubes", "--moving", "camera", "--seconds", "2"],
         "--seconds 2.0: time does not move (add it to --moving"),
        (["--target", "c", "--scene", "minicubes", "--moving", "tide"],
         "--moving 'tide': unknown (did you mean 'time'? choose one of time, camera"),
        (["--target", "html", "--moving", "time"], "--moving 'time': a web page has its own"),
        (["--target", "html", "--weights", "inline"], "--weights 'inline': a web page has its own"),
        (["--target", "html", "--schedule", "plain"], "--schedule 'plain': a web page has its own"),
        (["--target", "wgsl", "--schedule", "tile:8"],
         "--schedule 'tile:8': is not available for target wgsl with --weights"),
        (["--target", "c", "-o", "noisy.exr"], "output folder 'noisy.exr': is a file"),
    ],
)  # fmt: skip
def test_refusals(refused, samples, tmp_path, arguments, told):
    (tmp_path / "noisy.exr").write_bytes(b"")
    assert told in refused("export", samples / "model.safetensors", *arguments)


@pytest.mark.parametrize("target", ["cuda", "metal", "onnx", "html"])
def test_a_target_without_its_own_device_is_refused(wamnet, tmp_path, target):
    outcome = wamnet("export", "minicubes", "--target", target, "--measure", "-o", tmp_path / "new")
    assert outcome.status == 2
    assert "--measure" in outcome.err
    assert not (tmp_path / "new").exists()


@pytest.mark.nightly
def test_the_command_writes_a_time(wamnet, executor_named, tmp_path):
    executor_named("opencl")
    outcome = wamnet("export", "minicubes", "--target", "opencl", "--measure", "-o", tmp_path / "new")
    assert outcome.status == 0, outcome.err
    speed = json.loads((tmp_path / "new/manifest.json").read_text())["speed"]
    assert 0 < speed["least_ms"] <= speed["ms"] <= speed["most_ms"]
    assert f"{speed['ms']:.3g} ms" in (tmp_path / "new" / "README.md").read_text()
