"""Tests of `wamnet compile`, `wamnet denoise` and `wamnet executors`."""

import json
import re
import shutil

import numpy as np
import OpenEXR
import pytest

from wamnet.cli.commands import denoise
from wamnet.cli.files import exr
from wamnet.cli.files.images import read_png
from wamnet.kernels import denoise_on, open_executor
from wamnet.models.model_file import load_model
from wamnet.refimpl import encoding
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.frame import Frame


@pytest.fixture
def here(samples, tmp_path):
    """Put model.safetensors and noisy.exr into the working folder."""
    for name in ("model.safetensors", "noisy.exr"):
        shutil.copy(samples / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def picture(here):
    """Return the denoised picture of the NumPy executor."""
    with open_executor("numpy") as executor:
        return denoise_on(
            executor, load_model(here / "model.safetensors"), exr.read_frame(here / "noisy.exr")
        ).image


def test_the_picture_is_the_executors(wamnet, here, picture) -> None:
    """PNG holds it as it is, EXR as linear radiance; both lines name executor, device and time."""
    outcome = wamnet("denoise", "model.safetensors", "noisy.exr", "--executor", "numpy")
    assert outcome.status == 0
    assert outcome.out.startswith("denoised.png: 13x12 pixels on numpy (NumPy ")
    assert " s, after " in outcome.out
    assert "schedule plain: one operation after another" in outcome.out
    assert (encoding.to_8bit(read_png(here / "denoised.png")) == encoding.to_8bit(picture)).all()
    assert wamnet("denoise", "model.safetensors", "noisy.exr", "-o", "d.exr").status == 0
    frame = exr.read_frame(here / "d.exr")
    assert (frame["color"] == encoding.from_display(picture)).all()
    assert frame.info["denoised"] == "true"
    assert frame.info["scene"] == "minicubes"


def test_pixels_that_are_no_numbers_are_named_and_read_by_the_rule(wamnet, here, monkeypatch) -> None:
    """The frame is denoised, the output says what was replaced; other commands refuse the frame."""
    noisy = exr.read_frame(here / "noisy.exr")
    noisy["color"][2, 3] = np.nan
    noisy["color"][5, 6, 1] = np.inf
    with monkeypatch.context() as patch:
        patch.setattr(exr, "validate", lambda frame: None)
        exr.write_frame(here / "bad.exr", noisy)
    outcome = wamnet("denoise", "model.safetensors", "bad.exr")
    assert outcome.status == 0
    assert (
        "bad.exr: 2 pixels of color are not finite: NaN is read as 0, an infinity as the end" in outcome.out
    )
    with open_executor("numpy") as executor:
        expected = denoise_on(executor, load_model(here / "model.safetensors"), noisy).image
    assert np.isfinite(expected).all()
    assert (encoding.to_8bit(read_png(here / "denoised.png")) == encoding.to_8bit(expected)).all()
    assert wamnet("compare", "bad.exr", "noisy.exr").status == 2


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--rank", 9999], "has ranks from 1 to"),
        (["--rank", 25, "--executor", "opengl"], "has ranks from 1 to 24"),
    ],
)
def test_a_rank_that_cannot_be_is_refused(wamnet, here, options, reason) -> None:
    outcome = wamnet("denoise", "model.safetensors", "noisy.exr", *options)
    assert outcome.status == 2
    assert reason in " ".join(outcome.err.split())
    assert not (here / "denoised.png").exists()


@pytest.mark.parametrize(
    ("target", "source"), [("opencl", "denoise.cl"), ("glsl", "denoise.frag"), ("c", "denoise.h")]
)
def test_compile_writes_a_kernel(wamnet, here, target, source) -> None:
    """Source, weights, certificate, manifest; by default into a folder that is named after the language."""
    outcome = wamnet("compile", "model.safetensors", "--target", target)
    assert outcome.status == 0
    names = (source, "weights.bin", "denoise.certificate.json", "manifest.json")
    assert outcome.out.split() == [f"{target}/{name}" for name in names]
    assert json.loads((here / target / "manifest.json").read_text())["profile"]["name"] == "ieee"
    first = (here / target / source).read_text()
    assert (
        wamnet("compile", "model.safetensors", "--target", target, "--profile", "native", "-o", "n").status
        == 0
    )
    assert (here / "n" / source).read_text() != first


@pytest.mark.nightly(but="opencl-path.cl")
@pytest.mark.parametrize(("target", "source"), [("opencl", "path.cl"), ("glsl", "path.frag")])
def test_compile_writes_a_scene_s_kernel(wamnet, here, target, source) -> None:
    """The bytes that the compiler gives for this scene, time and schedule; a scene file is a scene too."""
    from wamnet.compiler.scenes.lower_scene import lower_scene
    from wamnet.compiler.scenes.path_kernel import compile_path
    from wamnet.refimpl.light.scenes import canonical
    from wamnet.refimpl.light.transport import Settings

    lanes = ["--lanes", 16] if target == "opencl" else []
    options = ["--target", target, "--max-depth", 2, *lanes]
    outcome = wamnet("compile", "minicubes", "--time", 1.5, *options, "-o", "a")
    *files, why = outcome.out.splitlines()
    assert (outcome.status, " ".join(files).split()) == (0, [f"a/{source}", "a/manifest.json"])
    assert why.startswith("no certificate: path kernels have none")
    programs = lower_scene(canonical("minicubes", time=1.5), Settings(max_depth=2))
    executor = {"opencl": "opencl", "glsl": "opengl"}[target]
    kernel = compile_path(programs, executor, "ieee", 16 if lanes else 1)
    assert (here / "a" / source).read_text() == kernel.source
    assert json.loads((here / "a/manifest.json").read_text()) == json.loads(json.dumps(kernel.manifest))
    assert wamnet("compile", "minicubes", *options, "--sampler", "sobol", "-o", "sobol").status == 0
    assert "sampler sobol" in (here / "sobol" / source).read_text()
    wamnet("scene", "minicubes", "--time", 1.5, "-o", "s.json")
    assert wamnet("compile", "s.json", *options, "-o", "b").status == 0
    assert (here / "b" / source).read_text() == kernel.source


def test_refusals_of_compiling_a_scene(wamnet, refused, here) -> None:
    """Options of scenes with a model; a folder with the other kind; what no schedule does; no such scene."""
    glsl = ["--target", "glsl"]
    text = "--time 2.0: model.safetensors is not a scene: neither a canonical one nor a .json file (leave"
    assert text in refused("compile", "model.safetensors", *glsl, "--time", 2)
    assert "--lanes 4: model.safetensors is not a scene" in refused(
        "compile", "model.safetensors", *glsl, "--lanes", 4
    )
    assert "target opengl cannot trace 4 paths at once (choose one of 1" in refused(
        "compile", "cornell", *glsl, "--lanes", 4
    )
    assert "max_depth -1: must be an integer of 0 or more" in refused(
        "compile", "cornell", *glsl, "--max-depth", -1
    )
    assert "scene file 'none.json': not found" in refused("compile", "none.json", *glsl)
    assert wamnet("compile", "cornell", *glsl, "-o", "k").status == 0
    assert "output folder 'k': holds a scene's kernel, and this is a model's kernel" in refused(
        "compile", "model.safetensors", *glsl, "-o", "k"
    )


def test_a_schedule_by_name(wamnet, refused, here) -> None:
    """The kernel's manifest names it; unknown ones, and ones for scenes, are refused."""
    opencl = ["--target", "opencl", "-o", "kernel"]
    outcome = wamnet("compile", "model.safetensors", *opencl, "--schedule", "tile:8")
    assert outcome.status == 0
    assert "schedule" not in outcome.out
    assert json.loads((here / "kernel/manifest.json").read_text())["schedule"]["name"] == "tile:8"
    line = refused("compile", "model.safetensors", *opencl, "--schedule", "fast")
    assert "schedule 'fast': unknown to this target (choose one of plain, vector:16, tile:16" in line
    line = refused("denoise", "model.safetensors", "noisy.exr", "--schedule", "tile:8")
    assert "schedule 'tile:8': unknown to this target (choose one of plain" in line
    line = refused("compile", "cornell", *opencl, "--schedule", "tile:8")
    assert "--schedule 'tile:8': cornell is a scene, whose kernels have one schedule" in line


def test_refusals_of_compile(refused, here) -> None:
    """No model; another kind of file; no such profile or target; a file in the folder's place."""
    target = ["--target", "glsl"]
    assert "wamnet-model file 'none.st': not found" in refused("compile", "none.st", *target)
    assert (
        "model or scene 'minicube': not found (did you mean 'minicubes'? choose one of minicubes,"
        in refused("compile", "minicube", *target)
    )
    assert "noisy.exr': is not a safetensors file" in refused("compile", "noisy.exr", *target)
    assert "profile 'best': unknown (choose one of ieee" in refused(
        "compile", "model.safetensors", *target, "--profile", "best"
    )
    assert "output folder 'noisy.exr': is a file" in refused(
        "compile", "model.safetensors", *target, "-o", "noisy.exr"
    )
    told = refused("compile", "model.safetensors", "--target", "basic")
    assert "Invalid value for '--target': 'basic' is not one of" in told
    assert "Missing option '--target'" in refused("compile", "model.safetensors")


def test_the_frame_s_layers_are_kept(wamnet, refused, here, picture) -> None:
    """FRM-7: the same pixels as without, as linear radiance in a layer of their own."""
    outcome = wamnet("denoise", "model.safetensors", "noisy.exr", "--keep-layers", "-o", "all.exr")
    assert outcome.status == 0, outcome.err
    assert "all.exr: layer wamnet is the denoised image" in outcome.out
    frame = exr.read_frame(here / "all.exr")
    before = exr.read_frame(here / "noisy.exr")
    assert all((frame[name] == values).all() for name, values in before.layers.items())
    channels = OpenEXR.File(str(here / "all.exr"), separate_channels=True).channels()
    got = np.stack([channels[f"wamnet.{name}"].pixels for name in "RGB"], axis=-1)
    assert (got == encoding.from_display(picture, 0.0).astype(np.float32)).all()
    assert "must end in .exr" in refused(
        "denoise", "model.safetensors", "noisy.exr", "--keep-layers", "-o", "all.png"
    )


def test_refusals_of_denoise(refused, here) -> None:
    """Before anything is computed, and without a file."""
    exr.write_frame(here / "flat.exr", Frame({"color": np.zeros((3, 2, 3))}))
    both = ["model.safetensors", "noisy.exr"]
    assert "normal" in refused("denoise", "model.safetensors", "flat.exr")
    assert "input file 'model.safetensors': is not an OpenEXR image" in refused("denoise", both[0], both[0])
    assert "noisy.exr': is not a safetensors file" in refused("denoise", both[1], both[1])
    assert "output file 'noisy.exr': is an input of this command" in refused(
        "denoise", *both, "-o", "noisy.exr"
    )
    assert "output file 'a.tif': must end in .exr or .png" in refused("denoise", *both, "-o", "a.tif")
    assert "output file 'dir.exr': is a folder" in _with_folder(refused, here, both)


def _with_folder(refused, here, both) -> str:
    """Refuse to replace a folder."""
    (here / "dir.exr").mkdir()
    return refused("denoise", *both, "-o", "dir.exr")


def missing(name: str, **_: object) -> None:
    """Stand for an executor that is not there."""
    raise ExecutorUnavailable(f"{name}: no device was found; install one")


def test_a_missing_executor(refused, here, monkeypatch) -> None:
    """One line with the way to get it."""
    monkeypatch.setattr("wamnet.kernels.open_executor", missing)
    line = refused("denoise", "model.safetensors", "noisy.exr", "--executor", "opencl")
    assert line == "wamnet: error: opencl: no device was found; install one\n"


def test_the_list_of_executors(wamnet, monkeypatch) -> None:
    """NumPy is always ready; what is missing says why."""
    assert denoise.probe("numpy")[:3] == ("numpy", "ready", "plain")
    monkeypatch.setattr(
        "wamnet.kernels.open_executor", lambda name: open_executor(name) if name == "numpy" else missing(name)
    )
    outcome = wamnet("executors")
    assert outcome.status == 0
    assert re.search(r"numpy +ready", outcome.out)
    assert re.search(r"opengl +missing", outcome.out)
    assert "opengl: no device was found; install one" in outcome.out


def test_a_kernels_folder_has_one_owner(wamnet, refused, here) -> None:
    """Another program's manifest and another target's kernel stay; missing parents are not made."""
    glsl = ["compile", "model.safetensors", "--target", "glsl", "-o"]
    (here / "site").mkdir()
    for text in ('{"name": "my site"}', "[]", "no JSON"):
        (here / "site" / "manifest.json").write_text(text)
        assert "output folder 'site': its manifest.json is not one that wamnet wrote" in refused(
            *glsl, "site"
        )
    assert wamnet(*glsl, "kernel").status == 0
    assert wamnet(*glsl, "kernel").status == 0
    assert "output folder 'kernel': holds a kernel for opengl, and this one is for opencl" in refused(
        "compile", "model.safetensors", "--target", "opencl", "-o", "kernel"
    )
    assert "output folder 'a/b': not found (create it: mkdir -p 'a/b'" in refused(*glsl, "a/b/c")
