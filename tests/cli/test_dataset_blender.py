"""`wamnet dataset --from-blender`: DSF-13, by a program that answers as Blender does, and by Blender."""

import hashlib
import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from wamnet.cli.files import dataset_files, exr
from wamnet.models.blender import session
from wamnet.refimpl.errors import ExecutorUnavailable

ROOT = Path(__file__).resolve().parents[2]
"""The project's folder."""

STAND_IN = ROOT / "tests/support/stand_in_blender.py"
"""What answers as Blender does."""

TINY = ("--frames", 3, "--test", 1, "--percent", 50, "--spp", 4)
"""Four frames of 20 x 10 pixels."""


@pytest.fixture
def blend(tmp_path):
    """Return a file of a film."""
    path = tmp_path / "film.blend"
    path.write_bytes(b"BLENDER")
    return path


@pytest.fixture
def blender(tmp_path_factory):
    """Return a program named as Blender is."""
    path = tmp_path_factory.mktemp("bin") / "blender"
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{STAND_IN}" "$@"\n')
    path.chmod(0o755)
    return path


def test_frames_of_a_film_become_a_data_set(wamnet, blend, blender, tmp_path):
    outcome = wamnet("dataset", "--from-blender", blend, "--blender", blender, *TINY, "-o", "film")
    assert outcome.status == 0, outcome.err
    assert "frames 1 to 10 of stand-in, view layer View, by Cycles of Blender 9.9" in outcome.out
    assert "film: 8 images of 4 frames, 8 of them rendered now" in outcome.out
    manifest = json.loads((tmp_path / "film/manifest.json").read_text())
    assert manifest["complete"] is True
    assert manifest["request"]["sha256"] == hashlib.sha256(blend.read_bytes()).hexdigest()
    (noisy, target), *_ = dataset_files.read_pairs(tmp_path / "film")
    assert set(noisy.layers) == {"color", "albedo", "normal", "depth", "position"}
    assert (noisy.width, noisy.height, set(target.layers)) == (20, 10, {"color"})
    # A miss is 0, as our own are; the colour is that of the pass Combined, the normal that of Normal.
    assert noisy["depth"][0, 0] == 0.0
    assert noisy["depth"].max() < 9.0
    assert noisy["normal"].min() < -0.4
    first = manifest["frames"][0]
    assert noisy.info["film_frame"] == str(first["frame"])
    facts = {**first["noisy"], "frame": first["frame"]}
    sys.path.insert(0, str(STAND_IN.parent))
    import stand_in_blender

    made = stand_in_blender.channels(facts)
    assert (noisy["color"][..., 1] == made["View.Combined.G"]).all()


def test_it_is_checked_resumed_and_learned(wamnet, blend, blender, tmp_path, monkeypatch):
    command = ("dataset", "--from-blender", blend, "--blender", blender, *TINY, "-o", "film")
    monkeypatch.setenv("BLENDER_FAULT", "end")
    cut = wamnet(*command)
    assert cut.status == 2
    assert "Blender has ended: a warning of a driver" in cut.err
    monkeypatch.delenv("BLENDER_FAULT")
    assert "8 images of 4 frames, 6 of them rendered now" in wamnet(*command).out
    assert wamnet("dataset", "--check", "-o", "film").out == "film: 8 images match manifest.json\n"
    assert "0 of them rendered now" in wamnet(*command).out
    again = (*command[:-1], "again")
    assert wamnet(*again).status == 0
    for path in (tmp_path / "film").rglob("*.exr"):
        assert (tmp_path / "again" / path.relative_to(tmp_path / "film")).read_bytes() == path.read_bytes()
    trained = wamnet(
        "train", "--dataset", "film", "--preset", "short", "--steps", 3, "-o", "film.safetensors"
    )
    assert trained.status == 0, trained.err
    # Another file of that name is another data set.
    blend.write_bytes(b"BLENDER changed")
    assert "holds another data set: sha256" in wamnet(*command).err


def test_refusals(wamnet, refused, blend, blender, monkeypatch):
    by = ("dataset", "--from-blender", blend, "--blender", blender)
    assert "SCENE': has no meaning with --from-blender" in refused(*by, "minicubes")
    assert "--size': has no meaning with --from-blender" in refused(*by, "--size", 12)
    assert "'--yaw': has no meaning" in refused(*by, "--yaw=-1:1")
    assert "'--percent': has no meaning without --from-blender" in refused(
        "dataset", "cornell", "--percent", 9
    )
    assert "the animation has 10 frames" in refused(*by, "--frames", 12)
    assert "none.blend" in refused("dataset", "--from-blender", "none.blend")
    assert "not found" in refused("dataset", "--from-blender", blend, "--blender", "none")
    monkeypatch.setenv("BLENDER_FAULT", "refuse")
    told = refused(*by)
    assert f"Blender file '{blend}': its scene has no camera (change it in Blender" in told


def test_a_machine_without_blender_says_what_to_install(monkeypatch):
    monkeypatch.setattr(session, "find_spec", lambda name: None)
    monkeypatch.setattr(session.shutil, "which", lambda name: None)
    with pytest.raises(ExecutorUnavailable, match="install Blender, or pip install --no-deps bpy"):
        session.program(None)
    monkeypatch.setattr(session.shutil, "which", lambda name: f"/bin/{name}")
    assert session.program(None)[0] == "/bin/blender"
    assert "--disable-autoexec" in session.program(None)


@pytest.fixture(scope="module")
def hall(tmp_path_factory):
    """Return the film of the hall, made by Blender."""
    if find_spec("bpy") is None:
        pytest.skip("MISSING: Blender as a Python module; pip install --no-deps bpy")
    path = tmp_path_factory.mktemp("hall") / "hall.blend"
    script = ROOT / "examples/blender/scenes.py"
    subprocess.run([sys.executable, str(script), "hall", str(path)], check=True, capture_output=True)
    return path


def test_blender_renders_what_is_requested(wamnet, hall, tmp_path):
    """The seed is the noise; more samples are nearer to the target; misses have no depth."""
    command = ("dataset", "--from-blender", hall, "--frames", 2, "--test", 0, "--percent", 10, "--spp", 64)
    for folder, seed in (("a", 0), ("b", 0), ("c", 40)):
        assert wamnet(*command, "--seed", seed, "-o", folder).status == 0
    manifests = [json.loads((tmp_path / f / "manifest.json").read_text()) for f in "abc"]
    pairs = [dataset_files.read_pairs(tmp_path / folder) for folder in "abc"]
    assert manifests[0] == manifests[1]
    (noisy, target), (other, _) = pairs[0][0], pairs[2][0]
    assert (noisy.width, noisy.height) == (38, 28)
    assert not np.array_equal(noisy["color"], other["color"])
    lengths = np.linalg.norm(noisy["normal"], axis=-1)
    # A pixel's normal is a weighted mean of unit vectors, by a filter that is positive.
    assert lengths.max() < 1.0 + 1e-5
    error = np.abs(np.minimum(noisy["color"], 1.0) - np.minimum(target["color"], 1.0)).mean()
    assert 0.0 < error < 0.5
    assert 0.0 < noisy["depth"].max() < 100.0


def test_a_frame_of_blender_is_denoised_for_its_compositor(wamnet, hall, tmp_path):
    """All of Blender's layers stay, and it reads one more."""
    frame, made = tmp_path / "frame.exr", tmp_path / "made.exr"
    script = [sys.executable, str(ROOT / "examples/blender/frame.py")]
    subprocess.run([*script, hall, "20", frame, "10"], check=True, capture_output=True)
    command = ("dataset", "--from-blender", hall, "--frames", 2, "--test", 0, "--percent", 10, "--spp", 4)
    assert wamnet(*command, "-o", "film").status == 0
    assert (
        wamnet("train", "--dataset", "film", "--preset", "short", "--steps", 3, "-o", "m.safetensors").status
        == 0
    )
    outcome = wamnet("denoise", "m.safetensors", frame, "--keep-layers", "--anyway", "-o", made)
    assert outcome.status == 0, outcome.err
    read = (
        "import bpy, sys\n"
        "image = bpy.data.images.load(sys.argv[1])\n"
        "node = bpy.data.node_groups.new('c', 'CompositorNodeTree').nodes.new('CompositorNodeImage')\n"
        "node.image = image\n"
        "print(image.type, *(each.name for each in node.outputs), sep=';')\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", read, made], check=True, capture_output=True, text=True
    ).stdout.split(";")
    assert told[0].splitlines()[-1] == "MULTILAYER"
    assert {"Combined", "Depth", "Position", "wamnet"} <= {name.strip() for name in told}
    assert exr.read_frame(made)["color"].shape == exr.read_frame(frame)["color"].shape
