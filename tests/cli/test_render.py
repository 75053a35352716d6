"""Tests of `wamnet render` and `wamnet scene`: the same frame as the reference's, and every refusal."""

import colorsys
import json
import os

import numpy as np
import pytest

from wamnet.cli.files import exr
from wamnet.cli.files.images import read_png
from wamnet.refimpl import encoding
from wamnet.refimpl.frame import SEEN
from wamnet.refimpl.light import scenes, variation
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scene import scene_digest
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings


def test_the_frame_is_the_references(wamnet, tmp_path) -> None:
    """Size, samples, seed, time and depth are passed on; the file has the reference's bits and origin."""
    arguments = ["--width", 7, "--height", 5, "--spp", 2, "--seed", 9, "--time", 1.5, "--max-depth", 2]
    outcome = wamnet("render", "minicubes", *arguments, "--workers", 1)
    assert outcome.status == 0
    assert outcome.out.startswith("minicubes.exr: 7x5 pixels, 2 spp, ")
    scene = canonical("minicubes", time=1.5)
    want = render(scene, Job(7, 5, 2, 9, Settings(max_depth=2))).frame
    got = exr.read_frame(tmp_path / "minicubes.exr")
    assert all((got[name] == values).all() for name, values in want.layers.items())
    assert got.info["scene_digest"] == scene_digest(scene)
    assert got.info["spp"] == "2"


def test_double_precision_and_parameters(wamnet, tmp_path) -> None:
    """A furnace is uniform: float64 in the file is float64 rounded to float32."""
    arguments = "--set albedo=0.25 --dtype float64 --width 3 --height 2 --executor numpy -o f.exr"
    assert wamnet("render", "furnace", *arguments.split()).status == 0
    want = render(canonical("furnace", albedo=0.25), Job(3, 2, dtype="float64")).frame
    assert (exr.read_frame(tmp_path / "f.exr")["color"] == want["color"].astype(np.float32)).all()


def test_what_is_seen_past_mirrors(wamnet, tmp_path) -> None:
    """On request the file has four layers more, and all others as without."""
    size = ("--width", 6, "--height", 4)
    for options, name in (((), "a.exr"), (("--seen",), "b.exr")):
        assert wamnet("render", "glossy", *size, *options, "-o", name).status == 0
    plain, seen = (exr.read_frame(tmp_path / name) for name in ("a.exr", "b.exr"))
    want = render(canonical("glossy"), Job(6, 4, seen=True)).frame
    assert set(seen.layers) == set(want.layers) == {*plain.layers, *SEEN}
    assert all((seen[name] == values).all() for name, values in want.layers.items())
    assert all((seen[name] == values).all() for name, values in plain.layers.items())


def test_a_picture(wamnet, tmp_path) -> None:
    """PNG holds the display-encoded colour, one stop brighter here."""
    arguments = ["--set", "background=0.25", "--width", 3, "--height", 2]
    assert wamnet("render", "empty", *arguments, "--exposure", 1, "-o", "e.png").status == 0
    want = encoding.from_8bit(encoding.to_8bit(encoding.to_display(np.full((2, 3, 3), 0.25), 1.0)))
    assert (read_png(tmp_path / "e.png") == want).all()


def test_camera_and_lamps_are_options(wamnet, tmp_path) -> None:
    """The scene is the reference's variation; a lamp takes hue and saturation, and keeps its brightness."""
    look = ("--yaw", 20, "--pitch", -5, "--distance", 1.25, "--light", "2=0.2,0.5,0.3")
    assert wamnet("render", "minicubes", "--width", 4, "--height", 3, *look, "-o", "a.exr").status == 0
    color = variation.lamp_color(scenes.COOL, *colorsys.rgb_to_hsv(0.2, 0.5, 0.3)[:2])
    seen = variation.Variation(20.0, -5.0, 1.25, (scenes.WARM, color))
    got, want = exr.read_frame(tmp_path / "a.exr"), variation.varied(canonical("minicubes"), seen)
    assert (got["color"] == render(want, Job(4, 3)).frame["color"]).all()
    assert got.info["yaw_deg"] == "20.0"
    assert json.loads(got.info["lights"]) == [list(scenes.WARM), list(color)]
    # Two roundings of products and one of a sum, of numbers below 4.
    assert abs(sum(color) - sum(scenes.COOL)) <= 4 * 3 * 2.0**-53
    # Each share is a quotient of two such numbers: below eight roundings.
    assert np.allclose(np.divide(color, color[1]), [0.4, 1.0, 0.6], rtol=8 * 2.0**-53, atol=0)


def test_a_scene_file_renders_the_same(wamnet, tmp_path) -> None:
    """Written by `wamnet scene`, read by `wamnet render`; with its camera."""
    look = ("--time", 2, "--yaw", 20)
    assert wamnet("scene", "minicubes", *look, "-o", "mine.json").out == "mine.json\n"
    assert wamnet("render", "mine.json", "--width", 4, "--height", 3).status == 0
    varied = variation.varied(canonical("minicubes", time=2.0), variation.Variation(20.0))
    mine, want = exr.read_frame(tmp_path / "mine.exr"), render(varied, Job(4, 3)).frame
    assert (mine["color"] == want["color"]).all()
    assert mine.info["yaw_deg"] == "20.0"
    assert wamnet("scene", "minicubes", *look).out == (tmp_path / "mine.json").read_text()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nowhere"], "scene 'nowhere': unknown (choose one of minicubes,"),
        (["none.json"], "scene file 'none.json': not found (check the name"),
        (["minicubes", "--set", "orbit"], "--set 'orbit': must be NAME=NUMBER or NAME=NUMBER,NUMBER,NUMBER"),
        (["minicubes", "--set", "warm=x"], "--set 'warm=x': must be"),
        (["minicubes", "--set", "warm=1,2"], "--set 'warm=1,2': must be"),
        (["minicubes", "--set", "warm=1"],
         "parameter warm 1.0: scene minicubes needs three numbers with commas"),
        (["minicubes", "--yaw", "nan"], "yaw_deg nan: must be a number from -180 to 180"),
        (["minicubes", "--light", "1,1,1"],
         "--light '1,1,1': must be N=R,G,B: a light's number and its colour (for example --light 1="),
        (["minicubes", "--light", "1=1,2"], "--light '1=1,2': must be N=R,G,B"),
        (["minicubes", "--light", "x=1,1,1"], "--light 'x=1,1,1': must be N=R,G,B"),
        (["minicubes", "--light", "1=0,0,0"], "its channels must be finite, 0 or more, and not all 0"),
        (["minicubes", "--light", "1=1,-1,0"], "its channels must be finite, 0 or more, and not all 0"),
        (["minicubes", "--light", "1=1,nan,0"], "its channels must be finite, 0 or more, and not all 0"),
        (["minicubes", "--light", "3=1,1,1"], "--light '3=1,1,1': the scene's lights are 1 to 2 (choose"),
        (["minicubes", "--light", "0=1,1,1"], "--light '0=1,1,1': the scene's lights are 1 to 2 (choose"),
        (["daylight", "--light", "1=1,1,1"], "--light '1=1,1,1': the scene has no lights (leave it out"),
        (["minicubes", "--light", "1=1,1,1", "--light", "1=1,1,0"],
         "--light '1=1,1,0': light 1 already has a colour (give one per light"),
        (["minicubes", "--width", "0"], "width 0: must be an integer from 1 to"),
        (["minicubes", "--workers", "0"], "workers 0: at least one process must work (use 1 or more"),
        (["minicubes", "--time", "1e308"], "time 1e+308: must be a number from -1e+09 to 1e+09 seconds"),
        (["cornell", "--executor", "opencl", "--workers", 2],
         "workers 2: opencl shares the work by itself (leave it out"),
        (["minicubes", "-o", "a.jpg"], "output file 'a.jpg': must end in .exr or .png"),
        (["minicubes", "-o", "no/a.exr"], "output folder 'no': not found (create it: mkdir -p 'no'"),
    ],
)  # fmt: skip
def test_refusals(refused, arguments, text) -> None:
    """Each before any work, and without a file."""
    assert text in refused("render", *arguments)


def test_refusals_of_scene_files(refused, wamnet, tmp_path) -> None:
    """Not JSON; not text; parameters that a file does not have; a target that is the source."""
    (tmp_path / "a.json").write_text("{")
    assert "a.json: scene '{': is not acceptable JSON" in refused("render", "a.json")
    (tmp_path / "a.json").write_bytes(b"\xff\xfe\xfd")
    assert "a.json: scene " in refused("render", "a.json")
    wamnet("scene", "empty", "-o", "b.json")
    text = "option for the scene 'time': a scene file has no parameters (change the file"
    assert text in refused("render", "b.json", "--time", 1)
    assert "output file 'b.json': is an input of this command" in refused("scene", "b.json", "-o", "b.json")
    assert "must end in .json" in refused("scene", "empty", "-o", "c.txt")


@pytest.mark.nightly(but="opencl")
@pytest.mark.parametrize("name", ["opencl", "opengl", "c"])
def test_a_kernel_renders_the_frame(wamnet, tmp_path, executor_named, name) -> None:
    """At least 95 pixels in 100 have the reference's colour to 1e-5; the others' paths may pass an edge."""
    executor_named({"opengl": "opengl-egl"}.get(name, name))
    outcome = wamnet("render", "cornell", "--width", 20, "--height", 10, "--executor", name, "-o", "a.exr")
    assert outcome.status == 0
    got, want = exr.read_frame(tmp_path / "a.exr"), render(canonical("cornell"), Job(20, 10)).frame
    near = np.abs(got["color"] - want["color"]) <= 1e-5 * (want["color"] + want["color"].mean())
    assert near.all(axis=-1).mean() >= 0.95


def test_a_pipe_is_no_scene_file(refused, tmp_path):
    """Reading it would wait for ever."""
    os.mkfifo(tmp_path / "s.json")
    assert "scene file 's.json': is a pipe or a device, not a regular file" in refused("render", "s.json")
