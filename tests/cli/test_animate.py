"""Tests of `wamnet animate`: what the pictures show, films that can be read, resuming, refusals."""

import os
import shutil
import struct
import subprocess
import zlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from wamnet.cli.commands import animate
from wamnet.cli.common.inputs import learned_scene
from wamnet.cli.files import images
from wamnet.cli.files.images import LABEL_PX, read_png
from wamnet.kernels.run.render_frame import render_frame
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl import encoding
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light import history
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Ranges, Variation, varied
from wamnet.refimpl.network import factored, siren
from wamnet.refimpl.network.dataset import Normalization, n_inputs
from wamnet.refimpl.network.denoise import Model, denoise, learned_feature_spp
from wamnet.refimpl.network.window import Window

SHORT = ("--seconds", 0.4, "--fps", 5, "--size", 13)


@pytest.fixture(autouse=True)
def model(samples, tmp_path) -> None:
    """Put the model into the working folder."""
    shutil.copy(samples / "model.safetensors", tmp_path / "m.safetensors")


def test_the_pictures_are_the_references(wamnet, tmp_path) -> None:
    """Noisy, denoised and reference of the second time, side by side below their labels."""
    outcome = wamnet("animate", "m.safetensors", *SHORT, "--reference-spp", 2, "--start", 1, "-o", "a")
    assert (outcome.status, outcome.out) == (0, "a: 2 frames, 2 of them rendered now\n")
    network, scene = load_model(tmp_path / "m.safetensors"), canonical("minicubes", time=1.2)
    noisy, reference = (render(scene, Job(13, 13, spp, seed)).frame for spp, seed in ((1, 2), (2, 3)))
    got = read_png(tmp_path / "a/00001.png")
    assert got.shape == (LABEL_PX + 14, 40, 3)
    assert got[:LABEL_PX].any()
    want = [
        encoding.to_display(noisy["color"]),
        denoise(network, noisy),
        encoding.to_display(reference["color"]),
    ]
    difference = np.abs(got[LABEL_PX:-1, :39] - np.concatenate(want, axis=1))
    # Half a level of 8 bits, and float32's rounding of sums below 256.
    assert difference.max() <= 0.5 / 255 + 256 * 2.0**-23


@pytest.mark.nightly(but="2-3-opengl")
@pytest.mark.parametrize("name", ["opencl", "opengl"])
@pytest.mark.parametrize(("spp", "rays"), [(0, 0), (2, 0), (0, 3), (2, 3)])
def test_one_device_draws_by_one_pipeline(
    wamnet, tmp_path, monkeypatch, executor_named, name, spp, rays
) -> None:
    """The pictures are those of the separate way up to one level: both round what differs by less."""
    executor_named({"opengl": "opengl-egl"}.get(name, name))
    devices = ("--executor", name, "--renderer", name, "--reference-spp", spp, "--feature-spp", rays)
    with monkeypatch.context() as patch:
        patch.setattr(animate, "draw_apart", None)
        assert wamnet("animate", "m.safetensors", *SHORT, *devices, "-o", "one").status == 0
    monkeypatch.setattr(animate, "draw_frames", animate.draw_apart)
    assert wamnet("animate", "m.safetensors", *SHORT, *devices, "-o", "apart").status == 0
    for picture in ("00000.png", "00001.png"):
        one, apart = (read_png(tmp_path / folder / picture) for folder in ("one", "apart"))
        assert one.shape == apart.shape == (LABEL_PX + 14, 26 + 14 * (spp > 0), 3)
        levels = np.abs(np.rint(255 * (one - apart)))
        assert levels.max() <= 1
        assert (levels > 0).mean() <= 0.01  # values within 1e-5 of a rounding limit: 255 x 2e-5 of all


@pytest.mark.nightly(but="numpy")
@pytest.mark.parametrize("name", ["numpy", "opencl"])
def test_a_network_that_sees_the_history_gets_that_of_the_film(
    wamnet, tmp_path, monkeypatch, executor_named, name
) -> None:
    """One that is made again has the same bytes, for which those before it are rendered again."""
    executor_named(name)
    features, window = ("history", "history_weight", "normal"), Window(2)
    network = siren.init((n_inputs(features, window), 4, 3), 1.0, 1.0, 0)
    save_model(tmp_path / "h.safetensors", Model(network, features, window, Normalization()))
    monkeypatch.setattr(animate, "draw_frames", None)
    film = ("--seconds", 0.3, "--fps", 10, "--size", 13, "--executor", name, "--renderer", name)
    assert wamnet("animate", "h.safetensors", *film, "-o", "a").status == 0
    past = None
    for number in range(3):
        scene, job = canonical("minicubes", time=number / 10), Job(13, 13, 1, 2 * number)
        frame = render(scene, job).frame
        past = (
            history.begin(scene, job, frame["color"])
            if past is None
            else history.follow(past, scene, job, frame["color"])
        )
    whole = Frame({**frame.layers, **history.layers_of(past)})
    last = tmp_path / "a" / "00002.png"
    got = read_png(last)[LABEL_PX:-1, 13:26]
    # Half a level of 8 bits; weights below 1 leave an error of the images far below the other half.
    assert np.abs(got - denoise(load_model(tmp_path / "h.safetensors"), whole)).max() <= 1.0 / 255
    before = last.read_bytes()
    last.unlink()
    assert wamnet("animate", "h.safetensors", *film, "-o", "a").out.endswith(
        "3 frames, 1 of them rendered now\n"
    )
    assert last.read_bytes() == before


def test_scene_and_rays_are_those_of_the_training(wamnet, tmp_path) -> None:
    """Unless others are named; a model that does not tell shows mini cubes, with the colour's rays."""
    network = load_model(tmp_path / "m.safetensors")
    facts = {"trained_on_scene": "cornell", "trained_on_feature_spp": "3"}
    learned = replace(network, info=facts)
    assert (learned_scene(learned), learned_feature_spp(learned)) == ("cornell", 3)
    assert (learned_scene(network), learned_feature_spp(network)) == ("minicubes", 0)
    file = replace(network, info={"trained_on_scene": "cornell", "trained_on_scene_sha256": "0" * 64})
    with pytest.raises(InputError, match=r"trained on 'cornell': must be one canonical scene, or one must"):
        learned_scene(file)
    odd = replace(network, info={"trained_on_scene": "cornell, empty", "trained_on_feature_spp": "1, 3"})
    with pytest.raises(InputError, match=r"trained on 'cornell, empty': must be one canonical scene"):
        learned_scene(odd)
    assert learned_feature_spp(odd) == 3
    save_model(tmp_path / "l.safetensors", learned)
    one = ("--seconds", 0.2, "--fps", 5, "--size", 13)
    assert wamnet("animate", "l.safetensors", *one, "-o", "own").status == 0
    noisy = render(canonical("cornell"), Job(13, 13, feature_spp=2)).frame
    got = read_png(tmp_path / "own" / "00000.png")[LABEL_PX:-1, 13:26]
    # Half a level of 8 bits, and float32's rounding of sums below 256.
    assert np.abs(got - denoise(network, noisy)).max() <= 0.5 / 255 + 256 * 2.0**-23
    named = ("--scene", "minicubes", "--feature-spp", 0)
    assert wamnet("animate", "l.safetensors", *one, *named, "-o", "named").status == 0
    assert wamnet("animate", "m.safetensors", *one, "-o", "plain").status == 0
    pictures = [read_png(tmp_path / folder / "00000.png") for folder in ("named", "plain")]
    assert np.array_equal(*pictures)


@pytest.mark.nightly(but=("numpy", "opencl"))
@pytest.mark.parametrize("name", ["numpy", "opencl", "opengl", "c"])
def test_a_cut_first_layer(wamnet, tmp_path, refused, executor_named, name) -> None:
    """The pictures of the model whose first layer is expanded from its factors, up to one level."""
    executor_named({"opengl": "opengl-egl"}.get(name, name))
    network = load_model(tmp_path / "m.safetensors")
    size, first = network.window.size, network.siren.weights[0]
    low = factored.expand(factored.cut(first.astype(np.float64), size, 2)).astype(np.float32)
    siren = replace(network.siren, weights=(low, *network.siren.weights[1:]))
    save_model(tmp_path / "low.safetensors", replace(network, siren=siren))
    devices = ("--executor", name, "--renderer", name)
    assert wamnet("animate", "m.safetensors", *SHORT, *devices, "--rank", 2, "-o", "cut").status == 0
    assert wamnet("animate", "low.safetensors", *SHORT, *devices, "-o", "low").status == 0
    assert wamnet("animate", "m.safetensors", *SHORT, *devices, "-o", "full").status == 0
    for picture in ("00000.png", "00001.png"):
        cut, low, full = (read_png(tmp_path / folder / picture) for folder in ("cut", "low", "full"))
        assert np.abs(np.rint(255 * (cut - low))).max() <= 1
        assert np.abs(np.rint(255 * (cut - full))).max() > 1
    text = "holds something else: 00000.png"
    assert text in refused("animate", "m.safetensors", *SHORT, *devices, "--rank", 1, "-o", "cut")


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_films(wamnet, tmp_path, suffix) -> None:
    """As many pictures of that size as the animation has; their folder is gone."""
    outcome = wamnet("animate", "m.safetensors", *SHORT, "-o", f"f{suffix}")
    assert (outcome.status, outcome.out) == (0, f"f{suffix}: 2 frames, 2 of them rendered now\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"f{suffix}", "m.safetensors"]
    if suffix == ".gif":
        with Image.open(tmp_path / "f.gif") as film:
            assert (film.n_frames, film.size, film.info["duration"]) == (2, (26, LABEL_PX + 14), 200)
    else:
        import imageio_ffmpeg

        assert imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "f.mp4")) == (2, 0.4)
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", tmp_path / "f.mp4"]
        told = subprocess.run(command, capture_output=True, text=True, check=False).stderr
        assert f" 26x{LABEL_PX + 14}" in told
        assert " 5 fps" in told


def test_an_interrupted_run_goes_on(wamnet, tmp_path, monkeypatch) -> None:
    """The picture that was there is not drawn again, a damaged one is; the film has the same bytes."""
    assert wamnet("animate", "m.safetensors", *SHORT, "-o", "whole.gif").status == 0
    write, drawn = animate.write_shot, []

    def once(shot, *arguments) -> None:
        if drawn:
            raise KeyboardInterrupt
        drawn.append(shot.path.name)
        write(shot, *arguments)

    monkeypatch.setattr(animate, "write_shot", once)
    assert wamnet("animate", "m.safetensors", *SHORT, "-o", "a.gif").status == 130
    assert not (tmp_path / "a.gif").exists()
    monkeypatch.setattr(animate, "write_shot", write)
    (tmp_path / "a.gif.frames/00001.png").write_bytes(b"damaged")
    assert wamnet("animate", "m.safetensors", *SHORT, "-o", "a.gif").out.endswith(
        "2 frames, 1 of them rendered now\n"
    )
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "whole.gif").read_bytes()


def test_the_folder_of_a_film_s_pictures_is_no_link(refused, tmp_path) -> None:
    """What is in it would be written over and removed."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "a.gif.frames").symlink_to("mine")
    text = "folder 'a.gif.frames': is a symbolic link, and a folder of this command's own"
    assert text in refused("animate", "m.safetensors", *SHORT, "-o", "a.gif")


def test_a_film_s_folder_with_more_in_it_stays(wamnet, tmp_path) -> None:
    """Only the pictures that have become the film are removed."""
    (tmp_path / "a.gif.frames").mkdir()
    (tmp_path / "a.gif.frames" / ".kept").write_text("mine")
    assert wamnet("animate", "m.safetensors", *SHORT, "-o", "a.gif").status == 0
    assert [path.name for path in (tmp_path / "a.gif.frames").iterdir()] == [".kept"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--fps", 0], "must be finite and last (change it"),
        (["--fps", 1e9], "number of frames 8000000000: an animation has 100000 at most"),
        (["--size", 0], "width 0"),
        (["--rank", 9999], "rank 9999: a window of "),
        (["--rank", -1], "rank -1: a window of "),
        (["--scene", "nowhere"], "scene 'nowhere"),
        (["--reference-spp", -1], "spp -1"),
        (["-o", "a.avi"], "output 'a.avi': must end in .mp4 or .gif, or name a folder (rename"),
        (["-o", "no/a.gif"], "output folder 'no': not found"),
        (["-o", "no/a"], "output folder 'no': not found"),
        (["-o", "file"], "output folder 'file': is a file"),
        (["-o", "full"], "output folder 'full': holds something else: x (choose another with -o"),
        (["--set", "time=1"], "parameter time 1.0: every frame has its own (use --start and --seconds"),
        (["--yaw", 999], "yaw_deg 999.0: must be a number from -180 to 180"),
        (["--light", "3=1,1,1"], "--light '3=1,1,1': the scene's lights are 1 to 2"),
        (["--set", "fps=1"], "parameter 'fps': unknown to scene minicubes (choose one of time, warm"),
        (
            ["--fps", 0.001, "--seconds", 2000, "-o", "a.gif"],
            "--fps 0.001: a GIF shows each frame for 655.35 s at most (use more, or .mp4",
        ),
        (["--fps", 60, "-o", "a.gif"], "--fps 60.0: a GIF has 50 at most (use fewer, or .mp4"),
    ],
)
def test_refusals(refused, tmp_path, arguments, text) -> None:
    """Before anything is drawn."""
    (tmp_path / "file").write_text("kept")
    (tmp_path / "full").mkdir()
    (tmp_path / "full/x").write_text("kept")
    assert text in refused("animate", "m.safetensors", *arguments)


def test_another_animation_is_refused(wamnet, refused) -> None:
    """Other pictures, and more of them, are not overwritten nor left among the new ones."""
    wamnet("animate", "m.safetensors", *SHORT, "-o", "a")
    assert "holds something else: 00000.png" in refused(
        "animate", "m.safetensors", *SHORT, "--seed", 1, "-o", "a"
    )
    fewer = ("--seconds", 0.2, "--fps", 5, "--size", 13)
    assert "holds something else: 00001.png" in refused("animate", "m.safetensors", *fewer, "-o", "a")
    assert images.LABEL_PX > 0


def test_without_the_package(refused, monkeypatch) -> None:
    """The usual line, before the work."""
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    assert "install it: pip install 'wamnet[full]'" in refused("animate", "m.safetensors", "-o", "a.mp4")


def test_a_network_that_sees_the_sun_gets_it(wamnet, tmp_path, monkeypatch, executor_named) -> None:
    """Rendered and denoised apart, although one device could do both: its path kernel knows no sun."""
    executor_named("opencl")
    features, window = ("color", "sun"), Window(2)
    network = siren.init((n_inputs(features, window), 4, 3), 1.0, 1.0, 0)
    save_model(tmp_path / "sun.safetensors", Model(network, features, window, Normalization()))
    monkeypatch.setattr(animate, "draw_frames", None)
    film = ("--scene", "daylight", "--seconds", 0.1, "--fps", 10, "--size", 13)
    by = ("--executor", "opencl", "--renderer", "opencl")
    assert wamnet("animate", "sun.safetensors", *film, *by, "-o", "day").status == 0
    scene = canonical("daylight")
    whole = render_frame("opencl", scene, Job(13, 13)).frame
    got = read_png(tmp_path / "day" / "00000.png")[LABEL_PX:-1, 13:26]
    # As for the history above.
    assert np.abs(got - denoise(load_model(tmp_path / "sun.safetensors"), whole)).max() <= 1.0 / 255
    text = "features 'sun': a path kernel knows what a pixel's paths meet, not where the sun is"
    assert text in wamnet("view", "sun.safetensors", "--scene", "daylight", "-o", "page.html").err


def test_pictures_outside_of_the_ranges_are_told(wamnet, tmp_path) -> None:
    """How many, and what of the first: here of time, and of all from another side."""
    network = load_model(tmp_path / "m.safetensors")
    learned = {"trained_on_scene": "minicubes", "trained_on_ranges": Ranges((0.0, 0.1)).to_json()}
    save_model(tmp_path / "n.safetensors", replace(network, info=learned))
    begin, unlike = "outside the training ranges: ", "frames differ from the training frames: "
    outcome = wamnet("animate", "n.safetensors", *SHORT, "-o", "a")
    assert f"a: 1 of 2 {unlike}{begin}the time is 0.2 s (learned: 0 s to 0.1 s); expect" in outcome.out
    outcome = wamnet("animate", "n.safetensors", *SHORT, "--yaw", 5, "--light", "1=1,0,0", "-o", "b")
    told = "the camera's yaw is 5° (learned: 0° to 0°), lamp 1 has another colour (learned: its own)"
    assert f"b: 2 of 2 {unlike}{begin}{told}; expect errors\n" in outcome.out
    assert "unlike" not in wamnet("animate", "m.safetensors", *SHORT, "--yaw", 5, "-o", "c").out
    noisy = render(varied(canonical("minicubes"), Variation(yaw_deg=5.0)), Job(13, 13)).frame
    got = read_png(tmp_path / "c/00000.png")[LABEL_PX:-1, :13]
    # Half a level of 8 bits, and float32's rounding of sums below 256.
    assert np.abs(got - encoding.to_display(noisy["color"])).max() <= 0.5 / 255 + 256 * 2.0**-23


def test_what_a_killed_run_leaves_is_removed(wamnet, tmp_path) -> None:
    """The unfinished picture and the lock; another hidden file stays, as does a link of such a name."""
    (tmp_path / "a").mkdir()
    for name in (".wamnet-0123456789abcdef.png", ".kept", ".lock"):
        (tmp_path / "a" / name).write_text("")
    link = ".wamnet-fedcba9876543210.png"
    (tmp_path / "a" / link).symlink_to("00000.png")
    assert wamnet("animate", "m.safetensors", *SHORT, "-o", "a").status == 0
    found = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert found == [".kept", link, "00000.png", "00001.png"]


def test_a_pipe_or_a_bomb_in_the_place_of_a_picture(wamnet, refused, tmp_path) -> None:
    """A pipe was waited for; a header of 60,000 x 60,000 pixels was a traceback of Pillow's."""
    (tmp_path / "a").mkdir()
    os.mkfifo(tmp_path / "a/00000.png")
    assert "is a pipe or a device, not a regular file" in refused(
        "animate", "m.safetensors", *SHORT, "-o", "a"
    )
    (tmp_path / "a/00000.png").unlink()
    Image.new("RGB", (2, 2)).save(tmp_path / "a/00000.png")
    content = bytearray((tmp_path / "a/00000.png").read_bytes())
    content[16:24] = struct.pack(">II", 60_000, 60_000)
    content[29:33] = struct.pack(">I", zlib.crc32(bytes(content[12:29])))
    (tmp_path / "a/00000.png").write_bytes(content)
    assert wamnet("animate", "m.safetensors", *SHORT, "-o", "a").status == 0
    assert read_png(tmp_path / "a/00000.png").shape[0] < 100
