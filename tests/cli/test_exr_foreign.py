"""Tests of OpenEXR files as other programs write them: parts, views, attributes, text."""

import re
import struct
from collections import Counter
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import raw_exr
from hypothesis import given
from hypothesis import strategies as st
from raw_exr import RawPart, attribute, floats, texts, write_raw

from wamnet.cli.files import exr, primaries
from wamnet.refimpl.errors import InputError

AP1 = primaries.SPACES["lin_ap1_scene"][1]
AP1_TO_REC_709 = np.array(
    [
        [1.7050509, -0.6217921, -0.0832589],
        [-0.1302564, 1.1408047, -0.0105485],
        [-0.0240033, -0.1289690, 1.1529724],
    ]
)
"""As the Academy publishes it, with seven digits."""

VIEWS = texts("multiView", "left", "right")


def planes(value: float, prefix: str = "", names: str = "RGB") -> dict[str | bytes, np.ndarray]:
    """Return constant channels (2, 3): value, value + 1, ..."""
    return {prefix + n: np.full((2, 3), value + i, np.float32) for i, n in enumerate(names)}


def view(name: str) -> bytes:
    """Return the attribute that a part is of a view."""
    return attribute("view", "string", name.encode())


# ---- two things of one name --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parts", "chosen", "layers"),
    [
        ([RawPart(planes(1), view("l"), "l"), RawPart(planes(5), view("r"), "r")], "", {"color": 1}),
        ([RawPart(planes(1), view("l"), "l"), RawPart(planes(5), view("r"), "r")], "r", {"color": 5}),
        ([RawPart(planes(1), view("l"), "a.l"), RawPart(planes(5), view("r"), "a.r")], "a.r", {"color": 5}),
        ([RawPart(planes(1) | planes(5, "right."), VIEWS)], "", {"color": 1}),
        ([RawPart(planes(1) | planes(5, "right."), VIEWS)], "right", {"color": 5}),
        ([RawPart(planes(1, "left.") | planes(5, "right."), VIEWS)], "", {"color": 1}),
        ([RawPart(planes(1, "V.Combined.left.") | planes(5, "V.Combined.right."), VIEWS)], "", {"color": 1}),
        ([RawPart(planes(5, "normal.right.", "XYZ") | planes(1), VIEWS)], "", {"color": 1}),
        ([RawPart(planes(1, "left.") | planes(5, "right."))], "right", {"color": 5}),
        ([RawPart(planes(1), name="rgba"), RawPart(planes(5), name="Albedo")], "", {"color": 1, "albedo": 5}),
        ([RawPart(planes(5), name="N"), RawPart(planes(1), name="main")], "", {"color": 1, "normal": 5}),
        ([RawPart(planes(5), name="specular"), RawPart(planes(1), name="beauty")], "", {"color": 1}),
        ([RawPart(planes(1), name="a"), RawPart(planes(5), name="b")], "b", {"color": 5}),
        ([RawPart(planes(7, names="Z"), name="z"), RawPart(planes(1))], "", {"depth": 7, "color": 1}),
        ([RawPart(planes(1), name="ViewLayer")], "", {"color": 1}),
        ([RawPart(planes(1, "Image."))], "", {"color": 1}),
        ([RawPart(planes(1) | planes(5, "r.", "XYZ"), view("r"), "rgba")], "", {"color": 1}),
        ([RawPart(planes(1), name="a"), RawPart(planes(5, "albedo."), name="b")], "",
         {"color": 1, "albedo": 5}),
        ([RawPart(planes(5, "beauty.") | planes(1))], "", {"color": 1}),
        ([RawPart(planes(5, "V.Combined.") | planes(1, "V.Noisy Image."))], "", {"color": 1}),
        ([RawPart(planes(1, names="RGBY"))], "", {"color": 1}),
        ([RawPart(planes(1, names="RGBZ"))], "", {"color": 1, "depth": 4}),
    ],
)  # fmt: skip
def test_views_and_parts(tmp_path: Path, parts: list[RawPart], chosen: str, layers: dict[str, int]) -> None:
    """The first view, or the one that is named; a part's name is a layer's.

    Where Blender writes a noisy image beside `Combined`, that one is denoised. Luminance does not count as
    depth.
    """
    frame = exr.read_frame(write_raw(tmp_path / "a.exr", *parts), view_layer=chosen)
    assert {name: pixels[0, 0, 0] for name, pixels in frame.layers.items()} == layers
    assert all((np.diff(pixels) == 1).all() for pixels in frame.layers.values())


@pytest.mark.parametrize(
    ("parts", "rule"),
    [
        ([RawPart(planes(1), name="a"), RawPart(planes(5), name="b")], "R, G, B of part 'a', .*: each of"),
        ([RawPart(planes(1), name="a"), RawPart(planes(5), name="a")], "each of them could be color"),
        ([RawPart(planes(1) | planes(5, names="r"))], "channels 'R, r, G, B': color has duplicates"),
        ([RawPart(planes(1, "Albedo.") | planes(5, "albedo."))], "Albedo, albedo': each of them could be"),
        ([RawPart(planes(1, "N.") | planes(5, "N.", "XYZ"))], "normal has duplicates"),
        ([RawPart(planes(1) | planes(1, "left."), VIEWS)], "channels '.*left.*': color has duplicates"),
    ],
)  # fmt: skip
def test_two_things_of_one_name(tmp_path: Path, parts: list[RawPart], rule: str) -> None:
    with pytest.raises(InputError, match=rule):
        exr.read_frame(write_raw(tmp_path / "a.exr", *parts))


# ---- text --------------------------------------------------------------------------------------------------


@given(st.binary(max_size=40), st.binary(min_size=1, max_size=12), st.binary(min_size=1, max_size=8))
def test_any_text_is_read_and_kept(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, name: bytes, layer: bytes
) -> None:
    """Attributes, their names, and channels in no encoding: pixels are right, and the bytes are kept."""
    folder = tmp_path_factory.mktemp("exr")
    name, layer = (b"x" + text.replace(b"\0", b"").replace(b".", b"") for text in (name, layer))
    others = {layer + b".R": np.full((2, 3), 9, np.float32), b"\xe8.R": np.full((2, 3), 8, np.float32)}
    extra = attribute(name, "string", data)
    source = write_raw(folder / "a.exr", RawPart({**planes(1), **others}, extra))
    frame = exr.read_frame(source)
    assert (frame["color"][0, 0] == [1, 2, 3]).all()
    for keep in (True, False):
        exr.write_denoised(folder / "b.exr", source, frame["color"], keep=keep)
        written = (folder / "b.exr").read_bytes()
        assert extra in written
        assert (layer + b".R\0" in written) == keep
        assert (exr.read_frame(folder / "b.exr")["color"] == frame["color"]).all()


# ---- attributes that change the meaning --------------------------------------------------------------------


def chromaticities(*values: float) -> bytes:
    """Return the attribute of primaries."""
    return floats("chromaticities", "chromaticities", *values)


def interop(name: str) -> bytes:
    """Return the attribute that names a colour space."""
    return attribute("colorInteropID", "string", name.encode())


@pytest.mark.parametrize("extra", [chromaticities(*AP1), interop("lin_ap1_scene")])
def test_colours_in_acescg(tmp_path: Path, extra: bytes) -> None:
    """Colour and albedo are converted by the published matrix and back; normals are not."""
    channels = planes(1) | planes(1, "albedo.") | planes(1, "normal.")
    source = write_raw(tmp_path / "a.exr", RawPart(channels, extra))
    notes: list[str] = []
    frame = exr.read_frame(source, tell=notes.append)
    assert "converted to Rec. 709 from the primaries ACEScg (AP1)" in notes[0]
    # Half of the last digit of three numbers, which are multiplied by up to 3; the Academy's whites have five
    # digits, as here; chromaticities of the attribute are float32, and so is the result.
    assert np.abs(frame["color"] - AP1_TO_REC_709 @ [1, 2, 3]).max() <= 1e-5
    assert (frame["albedo"] == frame["color"]).all()
    assert (frame["normal"][0, 0] == [1, 2, 3]).all()
    for keep, prefix in ((False, ""), (True, "wamnet.")):
        exr.write_denoised(tmp_path / "b.exr", source, frame["color"], keep=keep)
        assert extra in (tmp_path / "b.exr").read_bytes()
        written = OpenEXR.File(str(tmp_path / "b.exr"), separate_channels=True).channels()
        back = np.stack([written[prefix + name].pixels for name in "RGB"], axis=-1)
        # Twice rounded to float32, through a matrix whose condition is below 5.
        assert np.abs(back - [1, 2, 3]).max() <= 2 * 5 * 3 * 2.0**-24


@pytest.mark.parametrize("extra", [b"", chromaticities(*primaries.REC_709), interop("lin_rec709_scene")])
def test_rec_709_is_not_converted(tmp_path: Path, extra: bytes) -> None:
    """To the bit, infinities too."""
    channels = {name: np.array([[np.inf, 1e-45, 3e38]], np.float32) for name in "RGB"}
    frame = exr.read_frame(write_raw(tmp_path / "a.exr", RawPart(channels, extra)), finite=False)
    assert (frame["color"][..., 0] == channels["R"]).all()


@pytest.mark.parametrize(
    ("extra", "rule"),
    [
        (chromaticities(*(0.0,) * 8), "chromaticities: must span a colour space"),
        (chromaticities(*(0.3, 0.3) * 4), "chromaticities: must span a colour space"),
        (chromaticities(*(float("nan"),) * 8), "chromaticities: must"),
        (chromaticities(1.0), "chromaticities has 1 numbers instead of 8"),
        (interop("srgb_rec709_scene"), "colorInteropID 'srgb_rec709_scene': the colour spaces"),
        (interop("lin_ap0_scene") + chromaticities(*AP1), "chromaticities '.*colorInteropID is lin_ap0"),
    ],
)  # fmt: skip
def test_colour_spaces_that_cannot_be(tmp_path: Path, extra: bytes, rule: str) -> None:
    with pytest.raises(InputError, match=rule):
        exr.read_frame(write_raw(tmp_path / "a.exr", RawPart(planes(1), extra)))


def test_windows_and_attributes_stay_and_are_named(tmp_path: Path) -> None:
    """With and without the other layers; a sentence names each that changes what the pixels mean."""
    extra = floats("pixelAspectRatio", "float", 2) + floats("whiteLuminance", "float", 100)
    extra += attribute("own", "madeUp", b"\1\2\3") + view("left")
    part = RawPart(planes(1), extra, origin=(-8, 100), display=(0, 0, 1919, 1079))
    source = write_raw(tmp_path / "a.exr", part)
    notes: list[str] = []
    frame = exr.read_frame(source, tell=notes.append)
    assert "the data window (-8, 100)-(-6, 101), not all of (0, 0)-(1919, 1079)" in notes[0]
    assert "aspect ratio 2, which" in notes[0]
    assert "whiteLuminance is 100 cd" in notes[0]
    for keep in (True, False):
        exr.write_denoised(tmp_path / "b.exr", source, frame["color"], keep=keep, denoised="true")
        written = (tmp_path / "b.exr").read_bytes()
        windows = (
            raw_exr.window("dataWindow", -8, 100, -6, 101),
            raw_exr.window("displayWindow", 0, 0, 1919, 1079),
        )
        own = extra.split(attribute("own", "madeUp", b"\1\2\3"))
        assert all(piece in written for piece in (*windows, attribute("own", "madeUp", b"\1\2\3"), own[1]))
        assert exr.read_frame(tmp_path / "b.exr").info == {"denoised": "true"}


def test_one_of_two_views_is_written_as_itself(tmp_path: Path) -> None:
    """A file of one view has no list of views, whose first would be the wrong one."""
    source = write_raw(tmp_path / "a.exr", RawPart(planes(1) | planes(5, "right."), VIEWS))
    color = exr.read_frame(source, view_layer="right")["color"]
    assert exr.write_denoised(tmp_path / "b.exr", source, color, "right") == ""
    header = OpenEXR.File(str(tmp_path / "b.exr")).header()
    assert (header["view"], "multiView" in header) == ("right", False)
    assert exr.write_denoised(tmp_path / "c.exr", source, color, "right", keep=True) == "wamnet.right"


# ---- what cannot be read -----------------------------------------------------------------------------------


def deep(path: Path) -> None:
    """Write a file whose pixels have several samples."""
    samples = np.empty((1, 1), object)
    samples[0, 0] = np.ones(2, np.float32)
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    OpenEXR.File(header, dict.fromkeys("RGB", samples)).write(str(path))


@pytest.mark.parametrize(
    ("write", "rule"),
    [
        (deep, r"its pixels are deep: they have several samples each \(flatten it"),
        (lambda path: write_raw(path, RawPart(planes(1), compression=77)), "pixels that cannot be read"),
        (lambda path: write_raw(path, RawPart(planes(1), sampling=2)), "are subsampled"),
        (
            lambda path: write_raw(path, RawPart(dict.fromkeys(("Y", "RY", "BY"), planes(1)["R"]))),
            r"its colour is stored as luminance and chroma \(export R, G, B",
        ),
        (
            lambda path: write_raw(path, RawPart(planes(1), floats("whiteLuminance", "float", 1, 2))),
            "attributes 'damaged': .*whiteLuminance has 2 numbers instead of 1",
        ),
        (
            lambda path: write_raw(path, RawPart({n: p.astype(np.uint32) for n, p in planes(1).items()})),
            "pixels of color 'uint32': must be half or float",
        ),
    ],
)
def test_each_cause_has_its_diagnosis(tmp_path: Path, write, rule: str, capfd) -> None:
    """And nothing of the library's reaches the terminal."""
    write(tmp_path / "a.exr")
    with pytest.raises(InputError, match=rule):
        exr.read_frame(tmp_path / "a.exr", tell=lambda text: None)
    assert capfd.readouterr() == ("", "")


def test_a_missing_layer_names_the_channels_that_are_left(tmp_path: Path) -> None:
    source = write_raw(tmp_path / "a.exr", RawPart(planes(1, "Picture.") | planes(5, "N.")))
    frame = exr.read_frame(source)
    with pytest.raises(InputError, match=r"color must be .*not used: Picture.B, Picture.G, Picture.R\)"):
        exr.need_layers(source, frame, ("color",), "it is tested", "export it")


LAYER_NAMES = ("", "rgba", "beauty", "albedo", "Albedo", "normal", "N", "id", "left.", "right.")
"""Parts, and layers in the names of channels, of the files below; a view is the last piece."""


@st.composite
def files(draw) -> tuple[list[RawPart], dict[float, tuple[int, str]]]:
    """Draw a file of several parts and views, and the channel of each of its values."""
    parts, origin, views = [], {}, draw(st.sampled_from([(), ("left", "right"), ("right", "left")]))
    several = draw(st.integers(1, 3))
    for index in range(several):
        channels: dict[str | bytes, np.ndarray] = {}
        for layer in draw(st.sets(st.sampled_from(LAYER_NAMES), min_size=1, max_size=3)):
            prefix = layer.rstrip(".") + "." if layer else ""
            for name in draw(st.sampled_from(["RGB", "rgb", "XYZ", "RGBr", "RG", "RGBA"])):
                value = float(len(origin) + 1)
                origin[value] = (index, prefix + name)
                channels[prefix + name] = np.full((2, 3), value, np.float32)
        own = draw(st.sampled_from(["", *views])) if several > 1 else ""
        extra = view(own) if own else b""
        extra += texts("multiView", *views) if views and several == 1 else b""
        name = draw(st.sampled_from(LAYER_NAMES)).rstrip(".") if several > 1 else None
        parts.append(RawPart(channels, extra, f"{name}.{index}" if name == "id" else name))
    return parts, origin


OTHERS = ("id", "left", "right")
"""Names that stand for no layer: a part of such a name may have the colour if nothing else has."""


WORDS = {"color": ("", "rgba", "beauty", "?"), "albedo": ("albedo",), "normal": ("normal", "n")}
"""What the layers below are called."""


def meaning(part: RawPart, name: str, sides: set[str]) -> tuple[str, str]:
    """Return the view of a channel ("" for the first), and the layer by its name or its part's."""
    pieces = name.lower().split(".")[:-1]
    attribute_of = re.search(rb"view\0string\0....(left|right)", part.extra, re.DOTALL)
    own = attribute_of[1].decode() if attribute_of else next((p for p in pieces if p in sides), "")
    layer = [p for p in pieces if p != own]
    named = [p for p in (part.name or "").lower().split(".") if p not in sides]
    return own, (layer or ["?" if named[:1] and named[0] in OTHERS else p for p in named] or [""])[0]


@given(files())
def test_never_silently_another_part(tmp_path_factory: pytest.TempPathFactory, file) -> None:
    """A layer is three channels of one place, of its own name and of the first view; or an error says why.

    No second place has the layer's name: a reader that takes the last of two fails here.
    """
    parts, origin = file
    path = write_raw(tmp_path_factory.mktemp("exr") / "a.exr", *parts)
    try:
        frame = exr.read_frame(path)
    except InputError as error:
        reason = str(error)
        assert re.search(r"each of them|duplicates|twice|no known layer", reason)
        return
    views = [side.decode() for part in parts for side in re.findall(rb"left|right", part.extra)]
    first, sides = next(iter(views), ""), set(views)
    every = [(index, str(name)) for index, part in enumerate(parts) for name in part.channels]
    for layer, pixels in frame.layers.items():
        places = [origin[float(value)] for value in pixels[0, 0]]
        ((index, prefix),) = {(index, name.rpartition(".")[0]) for index, name in places}
        assert "".join(name.rpartition(".")[2].upper() for _, name in places) in ("RGB", "XYZ")
        own, word = meaning(parts[index], places[0][1], sides)
        assert own in ("", first), "another view"
        assert word in WORDS[layer], "another layer"
        same = [
            (number, name.rpartition(".")[0])
            for number, name in every
            if meaning(parts[number], name, sides) in (("", word), (first, word))
            and name[-1] in ("RGBrgb" if layer == "color" else "RGBXYZrgb")
        ]
        complete = [place for place, count in Counter(same).items() if count >= 3]
        assert complete == [(index, prefix)], "another place has this name"


@given(st.data())
def test_a_changed_header_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data) -> None:
    """Any bytes in the header: a frame, or an error of ours."""
    path = tmp_path_factory.mktemp("exr") / "a.exr"
    extra = VIEWS + chromaticities(*AP1) + attribute("owner", "string", b"\xff\xfe")
    content = bytearray(write_raw(path, RawPart(planes(1), extra)).read_bytes())
    end = content.index(struct.pack("<ii", 0, 36))
    for at in data.draw(st.lists(st.integers(0, end - 1), min_size=1, max_size=3)):
        content[at] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    try:
        exr.read_frame(path, finite=False)
    except InputError as error:
        message = str(error)
        assert message.isprintable()
