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
    kernel = compile_path(programs, executor, 16 if lanes else 1)
    assert (here / "a" / source).read_text() == kernel.source
    assert json.loads((here / "a/manifest.json").read_text()) == json.loads(json.dumps(kernel.manifest))
    assert wamnet("compile", "minicubes", *options, "--sampler", "sobol", "-o", "sobol").status == 0
    assert "sampler sobol" in (here / "sobol" / source).read_text()
    wamnet("scene", "minicubes", "--time", 1.5, "-o", "s.json")
    assert wamnet("compile", "s.json", *options, "-o", "b").status == 0
    assert (here / "b" / source).read_text() == kernel.source


def test_the_frame_s_layers_are_kept(wamnet, here, picture) -> None:
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


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ("denoise {model} flat.exr", "normal"),
        ("denoise {model} {model}", "input file 'model.safetensors': is not an OpenEXR image"),
        ("denoise noisy.exr noisy.exr", "noisy.exr': is not a safetensors file"),
        ("{denoise} -o noisy.exr", "output file 'noisy.exr': is an input of this command"),
        ("{denoise} -o a.tif", "output file 'a.tif': must end in .exr or .png"),
        ("{denoise} -o dir.exr", "output file 'dir.exr': is a folder"),
        ("{denoise} --keep-layers -o all.png", "must end in .exr"),
        ("{denoise} --schedule tile:8", "schedule 'tile:8': unknown to this target (choose one of plain"),
        ("{denoise} --rank 9999", "has ranks from 1 to"),
        ("{compile} --schedule fast",
         "schedule 'fast': unknown to this target (choose one of plain, vector:16, tile:16"),
        ("{compile} --profile best", "profile 'best': unknown (choose one of ieee"),
        ("{compile} -o noisy.exr", "output folder 'noisy.exr': is a file"),
        ("{compile} -o a/b/c", "output folder 'a/b': not found (create it: mkdir -p 'a/b'"),
        ("{compile} --time 2",
         "--time 2.0: model.safetensors is not a scene: neither a canonical one nor a .json file (leave"),
        ("{compile} --lanes 4", "--lanes 4: model.safetensors is not a scene"),
        ("compile {model}", "Missing option '--target'"),
        ("compile {model} --target basic", "Invalid value for '--target': 'basic' is not one of"),
        ("compile none.st --target glsl", "wamnet-model file 'none.st': not found"),
        ("compile minicube --target glsl",
         "model or scene 'minicube': not found (did you mean 'minicubes'? choose one of minicubes,"),
        ("compile noisy.exr --target glsl", "noisy.exr': is not a safetensors file"),
        ("compile none.json --target glsl", "scene file 'none.json': not found"),
        ("compile cornell --target glsl --lanes 4",
         "target opengl cannot trace 4 paths at once (choose one of 1"),
        ("compile cornell --target glsl --max-depth -1", "max_depth -1: must be an integer of 0 or more"),
        ("compile cornell --target opencl --schedule tile:8",
         "--schedule 'tile:8': cornell is a scene, whose kernels have one schedule"),
    ],
)  # fmt: skip
def test_refusals(refused, here, command, text) -> None:
    """Before anything is computed, and without a file."""
    exr.write_frame(here / "flat.exr", Frame({"color": np.zeros((3, 2, 3))}))
    (here / "dir.exr").mkdir()
    begins = {"denoise": "denoise model.safetensors noisy.exr", "model": "model.safetensors"}
    begins["compile"] = "compile model.safetensors --target opencl"
    assert text in refused(*command.format(**begins).split())


def test_the_list_of_executors(wamnet, monkeypatch) -> None:
    """NumPy is always ready; what is missing says why."""

    def missing(name: str) -> None:
        raise ExecutorUnavailable(f"{name}: no device was found; install one")

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
    """Another program's manifest, another target's and another kind's kernel stay."""
    glsl = ["compile", "model.safetensors", "--target", "glsl", "-o"]
    (here / "site").mkdir()
    for text in ('{"name": "my site"}', "[]", "no JSON"):
        (here / "site" / "manifest.json").write_text(text)
        told = refused(*glsl, "site")
        assert "output folder 'site': its manifest.json is not one that wamnet wrote" in told
    assert wamnet(*glsl, "kernel").status == 0
    assert wamnet(*glsl, "kernel").status == 0
    told = refused("compile", "model.safetensors", "--target", "opencl", "-o", "kernel")
    assert "output folder 'kernel': holds a kernel for opengl, and this one is for opencl" in told
    assert wamnet("compile", "cornell", "--target", "glsl", "-o", "k").status == 0
    assert "output folder 'k': holds a scene's kernel, and this is a model's kernel" in refused(*glsl, "k")
