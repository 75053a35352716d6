"""Pictures on disk: PNG for looking, EXR for computing, and one way to open either.

1. PNG holds display-encoded colour in 8 bits a channel; other colours than sRGB are converted [`write_png`],
   [`read_png`].
2. Pictures side by side have labels, and a text that names their origin [`write_panels`], [`read_origin`].
3. A picture to be compared is a PNG or the colour of an EXR; either knows its display-encoded and its linear
   form [`read_image`], [`Image`].
"""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl import encoding
from ...refimpl.errors import InputError
from ...refimpl.frame import DIRECT, SUN, Floats
from ...refimpl.metrics import penumbra
from ...refimpl.reading import check_room, read_file
from ..common.inputs import check_input
from ..common.packages import need
from . import exr, png_colors
from .outputs import replacing

PNG_BYTES = 64
"""Memory that a pixel takes until it is linear: levels, and a few pictures of three float32 on the way."""

LABEL_PX = 18
"""Height of the line of labels above pictures: Pillow's own font has letters of 11 pixels."""

ORIGIN = "wamnet.origin"
"""Name of the text in a PNG that says what it was made from."""


@dataclass(frozen=True)
class Image:
    """Colour (H, W, 3) display-encoded in [0, 1], and as linear radiance; a reference's penumbra (H, W)."""

    display: Floats
    linear: Floats
    penumbra: NDArray[np.bool_] | None = None


def write_png(path: Path, encoded: Floats, origin: str = "") -> None:
    """Write display-encoded colour (H, W, 3) in [0, 1] as an 8-bit PNG, all of it or nothing.

    With an `origin` the file keeps a text that names it.
    """
    pillow = need("PIL.Image", "to write PNG files")
    _save(path, pillow.fromarray(encoding.to_8bit(encoded)), origin)


def _save(path: Path, picture: Any, origin: str) -> None:
    """Write an image of Pillow's as a PNG."""
    text = need("PIL.PngImagePlugin", "to write PNG files").PngInfo()
    if origin:
        text.add_text(ORIGIN, origin)
    with replacing(path) as new:
        picture.save(new, format="PNG", pnginfo=text)


def write_panels(path: Path, panels: Sequence[tuple[str, Floats]], origin: str) -> None:
    """Write pictures (H, W, 3) side by side under their labels; the file keeps a text that names its origin.

    Both sides of the whole are even, as films want it.
    """
    pillow = need("PIL.Image", "to write PNG files")
    drawing = need("PIL.ImageDraw", "to label")
    font = need("PIL.ImageFont", "to label").load_default()
    height, width, _ = panels[0][1].shape
    sides = width * len(panels), height + LABEL_PX
    whole = pillow.new("RGB", tuple(side + side % 2 for side in sides))
    for index, (label, encoded) in enumerate(panels):
        bar = pillow.new("RGB", (width, LABEL_PX))
        drawing.Draw(bar).text((3, 3), label, fill="white", font=font)
        whole.paste(bar, (width * index, 0))
        whole.paste(pillow.fromarray(encoding.to_8bit(encoded)), (width * index, LABEL_PX))
    _save(path, whole, origin)


@contextmanager
def _quiet() -> Iterator[None]:
    """Ignore the warnings of Pillow, as for a damaged animation header: its errors are reported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def read_origin(path: Path) -> str | None:
    """Return the text that names the origin of a PNG; None if the file is damaged, "" if it has no text.

    What is not a regular file is refused: a pipe of this name would make us wait.
    """
    pillow = need("PIL.Image", "to read PNG files")
    content = BytesIO(read_file(path, "picture", "move it elsewhere, or choose another output with -o"))
    try:
        with _quiet(), pillow.open(content, formats=["PNG"]) as picture:
            origin = str(picture.text.get(ORIGIN, ""))
            # A picture of another origin is refused anyway, whatever its header says of its size.
            if origin:
                picture.load()
            return origin
    except (OSError, SyntaxError, ValueError, pillow.DecompressionBombError):
        return None


def read_png(path: Path, tell: Callable[[str], None] | None = None) -> Floats:
    """Read a PNG of up to 8 bits a channel as display-encoded colour (H, W, 3) of sRGB.

    `tell` is given a sentence on what was converted or ignored.
    """
    check_input(path)
    pillow = need("PIL.Image", "to read PNG files")
    # Not from the file itself: of a chunk that says it is huge, a file would give room for all of it.
    content = read_file(path)
    chunks = png_colors.read_chunks(path, content)
    try:
        with _quiet(), pillow.open(BytesIO(content), formats=["PNG"]) as picture:
            width, height = picture.size
            # A file of a few bytes may state any size.
            check_room(PNG_BYTES * width * height, f"size of {path}", f"{width} x {height}", "cut it")
            rgba = picture.convert("RGBA")
    except InputError:
        raise
    except (OSError, SyntaxError, ValueError, pillow.DecompressionBombError) as error:
        rule = f"has pixels that cannot be read: {error}"
        raise InputError("input file", str(path), rule, "export it again") from None
    encoded, source = png_colors.in_srgb(path, chunks, rgba.convert("RGB"))
    remarks = list(png_colors.notes(chunks, rgba))
    if source:
        remarks.insert(0, f"colours are converted to sRGB from {source}")
    if tell is not None and remarks:
        tell(f"{path}: {'; '.join(remarks)}")
    return encoded


def read_image(path: Path, exposure_stops: float = 0.0, tell: Callable[[str], None] | None = None) -> Image:
    """Read a PNG, or the colour of an EXR, in both forms at the given exposure; `tell` is given remarks."""
    suffix = path.suffix.lower()
    if suffix == ".png":
        display = read_png(path, tell)
        return Image(display, encoding.from_display(display, exposure_stops))
    if suffix == ".exr":
        frame = exr.read_frame(path, tell=tell)
        exr.need_layers(path, frame, ("color",), "pictures are compared by their colour", "export it too")
        linear, lit = frame["color"], {DIRECT, "unshadowed"} <= {*frame.layers} and SUN not in frame
        mask = penumbra(frame[DIRECT], frame["unshadowed"]) if lit else None
        return Image(encoding.to_display(linear, exposure_stops), linear, mask)
    if path.is_dir():
        check_input(path)
    raise InputError("input file", str(path), "must end in .exr or .png", "convert it")
