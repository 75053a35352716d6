"""Tests of frames in EXR files: round trip to the bit, other programs' names, and every refusal."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from wamnet.cli.files import exr
from wamnet.refimpl import reading
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import LAYERS, Frame


def random_frame(height: int, width: int, seed: int = 0, names: tuple[str, ...] = tuple(LAYERS)) -> Frame:
    """Return a frame of float32 bit patterns of all magnitudes (denormal to huge), finite."""
    rng = np.random.default_rng(seed)
    layers = {}
    for name in names:
        bits = rng.integers(0, 2**32, (height, width, LAYERS[name].channels), dtype=np.uint32)
        values = bits.view(np.float32)
        layers[name] = np.where(np.isfinite(values), values, np.float32(0.5))
    return Frame(layers, {"scene": "minicubes", "time": "0.5", "note": "été ✓ ", "empty": ""})


def write(path: Path, channels: dict[str, Any], **header: Any) -> Path:
    """Write channels as given, by the OpenEXR package itself."""
    OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, channels).write(str(path))
    return path


def part(name: str, channels: dict[str, Any], **header: Any) -> OpenEXR.Part:
    """Return one part of several."""
    return OpenEXR.Part({"type": OpenEXR.scanlineimage, **header}, channels, name)


def plane(value: float, dtype: type = np.float32, shape: tuple[int, int] = (2, 3)) -> np.ndarray:
    """Return one constant channel."""
    return np.full(shape, value, dtype)


def rgb(*values: float, prefix: str = "", names: str = "RGB") -> dict[str, np.ndarray]:
    """Return three constant channels."""
    return {prefix + name: plane(value) for name, value in zip(names, values, strict=True)}


def assert_same(a: Frame, b: Frame) -> None:
    """The same layers to the bit (signs of zero and denormals too) and the same info."""
    assert a.layers.keys() == b.layers.keys()
    for name, values in a.layers.items():
        assert b[name].dtype == np.float32
        assert values.shape == b[name].shape
        assert values.tobytes() == b[name].tobytes()
    assert dict(a.info) == dict(b.info)


ALL = st.sets(st.sampled_from(list(LAYERS)), min_size=1)
"""Any selection of layers."""


@example(1, 1, 0, set(LAYERS))
@example(17, 33, 0, set(LAYERS))
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 99), ALL)
def test_round_trip_of_any_size_and_selection(
    tmp_path_factory: pytest.TempPathFactory, height: int, width: int, seed: int, names: set[str]
) -> None:
    """Any size, any selection of layers, any bits; info with accents, spaces and an empty value."""
    path = tmp_path_factory.mktemp("exr") / "a.exr"
    frame = random_frame(height, width, seed, tuple(name for name in LAYERS if name in names))
    exr.write_frame(path, frame)
    assert_same(frame, exr.read_frame(path))


def test_a_frame_that_does_not_fit_the_memory_is_refused_before_its_pixels(
    tmp_path: Path, monkeypatch
) -> None:
    """A few bytes may stand for any size: what the header says is compared with what is free."""
    path = tmp_path / "a.exr"
    exr.write_frame(path, Frame({"color": np.zeros((4, 5, 3), np.float32)}))
    monkeypatch.setattr(reading, "_free_bytes", lambda: exr.EXR_BYTES * 60 - 1)
    with pytest.raises(InputError, match=r"input file '.*a\.exr': it would take 0 MiB of memory"):
        exr.read_frame(path)
    monkeypatch.setattr(reading, "_free_bytes", lambda: exr.EXR_BYTES * 60)
    assert exr.read_frame(path).width == 5


@pytest.mark.parametrize(
    ("layer", "channels"),
    [
        ("color", rgb(1, 2, 3)),
        ("color", rgb(1, 2, 3, prefix="ViewLayer.Combined.")),
        ("albedo", rgb(1, 2, 3, prefix="Albedo.", names="rgb")),
        ("albedo", rgb(1, 2, 3, prefix="ViewLayer.Denoising Albedo.")),
        ("normal", rgb(1, 2, 3, prefix="N.", names="XYZ")),
        ("normal", rgb(1, 2, 3, prefix="Normal.", names="XYZ")),
        ("normal", rgb(1, 2, 3, prefix="normal.")),
        ("position", rgb(1, 2, 3, prefix="P.", names="XYZ")),
        ("depth", {"Z": plane(1)}),
        ("depth", {"depth.V": plane(1)}),
        ("depth", {"ViewLayer.Depth.Z": plane(1)}),
    ],
)
def test_names_of_other_programs(tmp_path: Path, layer: str, channels: dict[str, np.ndarray]) -> None:
    """Aliases, letter case, prefixes, components named as colours or as axes; other channels are ignored."""
    extra = {"A": plane(9), "variance.R": plane(9)}
    frame = exr.read_frame(write(tmp_path / "a.exr", channels | extra))
    assert list(frame.layers) == [layer]
    assert (frame[layer] == np.arange(1.0, 1.0 + LAYERS[layer].channels)).all()


def test_half_floats_are_widened(tmp_path: Path) -> None:
    """Each half is a float32."""
    path = write(tmp_path / "a.exr", {name: plane(0.1, np.float16) for name in "RGB"})
    color = exr.read_frame(path)["color"]
    assert color.dtype == np.float32
    assert (color == np.float32(np.float16(0.1))).all()


def test_tiles_and_windows(tmp_path: Path) -> None:
    """A tiled file, and one whose data window starts at (-2, 3) inside a display window of another size."""
    tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    assert (exr.read_frame(write(tmp_path / "a.exr", rgb(1, 2, 3), **tiles))["color"] == [1, 2, 3]).all()
    corners = {
        "dataWindow": (np.array([-2, 3], np.int32), np.array([0, 4], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([9, 9], np.int32)),
    }
    frame = exr.read_frame(write(tmp_path / "b.exr", rgb(1, 2, 3), **corners))
    assert (frame.height, frame.width) == (2, 3)


def shifted(path: Path) -> None:
    """Write two parts of one size at different places, which would be shifted silently."""
    window = {"dataWindow": (np.array([1, 0], np.int32), np.array([3, 1], np.int32))}
    parts = [part("a", rgb(1, 2, 3)), part("b", rgb(4, 5, 6, prefix="albedo."), **window)]
    OpenEXR.File(parts).write(str(path))


def cut(path: Path) -> None:
    """Write a file whose header is whole and whose pixels are not."""
    exr.write_frame(path, random_frame(30, 30))
    path.write_bytes(path.read_bytes()[:-300])


def endless(path: Path) -> None:
    """Write pixels that are not finite."""
    channels = rgb(1, 2, 3)
    channels["G"][1, 2], channels["B"][0, 1] = np.nan, np.inf
    write(path, channels)


SIDES = rgb(1, 2, 3, prefix="left.albedo.") | rgb(1, 2, 3, prefix="right.albedo.")
"""Of the left and the right eye: no guess."""


@pytest.mark.parametrize(
    ("make", "rule"),
    [
        (lambda path: None, r"input file '.*a\.exr': not found"),
        (lambda path: path.write_bytes(b""), r"input file '.*a\.exr': is not an OpenEXR image"),
        (cut, "pixels that cannot be read"),
        (shifted, r"data windows '.*': all parts must have the same \(export full frames"),
        (lambda path: write(path, {"G": plane(1), "R": plane(1), "mask.A": plane(1)}),
         r"list of channels 'G, R, mask\.A': no known layer is among them"),
        (lambda path: write(path, {"Y": plane(1)}), "list of channels 'Y': no known layer"),
        (lambda path: write(path, SIDES),
         r"layers 'left\.albedo, right\.albedo': each of them could be albedo \(export one of them alone"),
        (endless, r"a\.exr: layer 'color' at x=1, y=0 \(first of 2 such pixels\) inf: every pixel must be"),
    ],
)  # fmt: skip
def test_files_that_are_refused(tmp_path: Path, make, rule: str, capfd) -> None:
    """The file is named, and the library's own messages do not reach the terminal."""
    make(tmp_path / "a.exr")
    with pytest.raises(InputError, match=rule):
        exr.read_frame(tmp_path / "a.exr")
    assert capfd.readouterr() == ("", "")


def test_an_invalid_frame_is_not_written(tmp_path: Path) -> None:
    """Nothing appears on disk."""
    with pytest.raises(InputError, match="layer 'color' at x=0, y=0"):
        exr.write_frame(tmp_path / "a.exr", Frame({"color": np.full((1, 1, 3), np.nan)}))
    assert not list(tmp_path.iterdir())


def test_what_is_taken_from_other_names_is_said(tmp_path) -> None:
    """File channels to our layer; depths of misses become 0; of our own names nothing is said."""
    planes = {f"ViewLayer.Denoising Normal.{axis}": np.ones((1, 3), np.float32) for axis in "XYZ"}
    planes |= {f"ViewLayer.Combined.{letter}": np.ones((1, 3), np.float32) for letter in "RGB"}
    planes["ViewLayer.Depth.Z"] = np.array([[2.0, 1e10, np.finfo(np.float32).max]], np.float32)
    write(tmp_path / "blender.exr", planes)
    told: list[str] = []
    frame = exr.read_frame(tmp_path / "blender.exr", tell=told.append)
    assert frame["depth"].ravel().tolist() == [2.0, 0.0, 0.0]
    (line,) = told
    names = ", ".join(f"ViewLayer.Combined.{letter}" for letter in "RGB")
    assert line.startswith(f"{tmp_path / 'blender.exr'}: color is taken from {names}; ")
    assert "normal is taken from ViewLayer.Denoising Normal.X, " in line
    assert "depth is taken from ViewLayer.Depth.Z; " in line
    assert line.endswith("2 depths of 1e+09 or more are read as 0: nothing is hit there")


def test_our_own_frames_are_read_as_they_are(tmp_path) -> None:
    """Nothing is said, and no depth is changed."""
    depth = np.array([[2.0, 3e10]], np.float32)[..., None]
    exr.write_frame(
        tmp_path / "own.exr", Frame({"color": np.ones((1, 2, 3), np.float32), "depth": depth}, {"a": "b"})
    )
    told: list[str] = []
    assert np.array_equal(exr.read_frame(tmp_path / "own.exr", tell=told.append)["depth"], depth)
    assert told == []


# ---- beside another program's layers -----------------------------------------------------------------------


def blender_like(*view_layers: str) -> dict[str, Any]:
    """Return channels as Blender names them, half floats and an integer among them."""
    rng = np.random.default_rng(4)
    found: dict[str, Any] = {}
    for name in view_layers:
        found |= {f"{name}.Combined.{c}": rng.random((2, 3)).astype(np.float16) for c in "RGBA"}
        found |= {f"{name}.Normal.{c}": rng.random((2, 3)).astype(np.float32) for c in "XYZ"}
        found[f"{name}.IndexOB.X"] = rng.integers(0, 9, (2, 3)).astype(np.uint32)
    return found


def test_a_picture_is_written_beside_all_channels_of_its_source(tmp_path: Path) -> None:
    """FRM-7: types, bits and attributes stay; a second time replaces the first."""
    given = blender_like("View")
    source = write(tmp_path / "in.exr", dict(given), BlenderMultiChannel="Blender V2.55.1 and newer")
    color = np.random.default_rng(5).random((2, 3, 3))
    for path, taken in ((tmp_path / "a.exr", source), (tmp_path / "b.exr", tmp_path / "a.exr")):
        assert exr.write_denoised(path, taken, color, keep=True) == "View.wamnet"
        file = OpenEXR.File(str(path), separate_channels=True)
        channels = {name: channel.pixels for name, channel in file.parts[0].channels.items()}
        assert set(channels) == {*given, *(f"View.wamnet.{c}" for c in "RGB")}
        for name, pixels in given.items():
            assert channels[name].dtype == pixels.dtype, name
            assert channels[name].tobytes() == pixels.tobytes()
        got = np.stack([channels[f"View.wamnet.{c}"] for c in "RGB"], axis=-1)
        assert (got == color.astype(np.float32)).all()
        assert file.header()["BlenderMultiChannel"] == "Blender V2.55.1 and newer"


def test_one_of_several_view_layers_is_read_by_its_name(tmp_path: Path) -> None:
    given = blender_like("front", "back")
    path = write(tmp_path / "in.exr", dict(given))
    with pytest.raises(InputError, match=r"back.Combined, front.Combined': each of them could be color"):
        exr.read_frame(path)
    for name in ("front", "back"):
        read = exr.read_frame(path, view_layer=name)["color"]
        assert (read[..., 0] == given[f"{name}.Combined.R"]).all()
        assert exr.write_denoised(tmp_path / "out.exr", path, read, name, keep=True) == f"{name}.wamnet"
    with pytest.raises(InputError, match=r"view layer 'left': neither .*; there are back, front \("):
        exr.read_frame(path, view_layer="left")
    with pytest.raises(InputError, match="no colour is among them"):
        exr.write_denoised(tmp_path / "out.exr", write(tmp_path / "n.exr", {"Z": plane(1.0)}), read)


def test_every_part_is_kept(tmp_path: Path) -> None:
    """FRM-7: parts with channels of one name stay parts, and the layer is in that of the colour."""
    parts = [part(name, rgb(value, value, value), view=name) for name, value in (("left", 1), ("right", 2))]
    source = tmp_path / "in.exr"
    OpenEXR.File(parts).write(str(source))
    black = np.zeros((2, 3, 3))
    assert exr.write_denoised(tmp_path / "out.exr", source, black, "right", keep=True) == "wamnet"
    left, right = OpenEXR.File(str(tmp_path / "out.exr"), separate_channels=True).parts
    assert (left.name(), left.header["view"], set(left.channels)) == ("left", "left", set("RGB"))
    assert set(right.channels) == {*"RGB", *(f"wamnet.{name}" for name in "RGB")}
    assert (right.channels["R"].pixels == 2).all()


def test_what_others_see(tmp_path: Path) -> None:
    """The channel names of the specification, float32, lossless, text attributes."""
    exr.write_frame(tmp_path / "a.exr", random_frame(3, 2))
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        names = sorted(file.channels())
        header = dict(file.header())
    assert names == sorted(name for group in exr.CHANNELS.values() for name in group)
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["wamnet.scene"] == "minicubes"


@pytest.mark.parametrize(
    ("space", "others", "noted"),
    [
        ("sRGB", {}, True),
        ("ACEScg", {}, True),
        ("Linear", {}, False),
        ("lin_rec709", {}, False),
        ("ACEScg", {"colorInteropID": "lin_ap1_scene"}, False),
    ],
)
def test_a_color_space_of_openimageio_is_named(tmp_path: Path, space: str, others: dict, noted: bool) -> None:
    """It is a hint of one library; where nothing else says what the colours are, it may be right."""
    path, notes = tmp_path / "a.exr", []
    header = {"type": OpenEXR.scanlineimage, "oiio:ColorSpace": space, **others}
    OpenEXR.File(header, rgb(1, 2, 3)).write(str(path))
    exr.read_frame(path, tell=notes.append)
    assert (f"oiio:ColorSpace is {space}" in "".join(notes)) is noted


def test_ctrl_c_while_writing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The writer dies in the middle of the file: the old file is as it was, and nothing else is there."""
    out = tmp_path / "a.exr"
    exr.write_frame(out, random_frame(2, 2))
    before = out.read_bytes()

    class Interrupted:
        ZIP_COMPRESSION = scanlineimage = None

        def Part(self, *_: object) -> None:
            pass

        def File(self, *_: object) -> "Interrupted":
            return self

        def write(self, name: str) -> None:
            Path(name).write_bytes(b"half")
            raise KeyboardInterrupt

    monkeypatch.setattr(exr, "need", lambda *_: Interrupted())
    with pytest.raises(KeyboardInterrupt):
        exr.write_frame(out, random_frame(3, 3))
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [before]
