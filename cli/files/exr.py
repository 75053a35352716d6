"""Frames as multi-layer OpenEXR files.

1. A layer is a group of channels: `R,G,B` is colour, then `albedo.R`, `normal.X`, `depth.Z`, `position.X`,
   `direction.X` and so on [`exr_layers.CHANNELS`]; float32, losslessly compressed, facts about the frame as
   text attributes [`write_frame`].
2. Reading also accepts the names that other renderers and denoisers use [`exr_layers.py`]; half floats are
   widened, and other channels ignored [`read_frame`].
3. Colours are converted to linear RGB of Rec. 709, and back in a file that is written for another program
   [`primaries.py`].
4. The image is the data window. A depth of 1e9 or more in a file of another program means a miss and is read
   as 0, as ours are.
5. What comes from a file is checked before anything else sees it; errors start with the file's name.
6. A denoised image is written with the attributes of the file that it was made from: by itself, or as a layer
   among all channels of that file, for a compositor [`write_denoised`].
"""

import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.frame import REMEDIES, Floats, Frame, validate
from ...refimpl.network.dataset import FARTHEST_DEPTH, FEATURES
from ...refimpl.reading import check_room, refusing
from ..common.packages import need
from . import primaries
from .exr_header import File, read_headers
from .exr_layers import CHANNELS, Plane, Selection, select, unused
from .outputs import replacing, spelled, unwritable

BOUND = ("channels", "chunkCount", "compression", "lineOrder", "name", "tiles", "type", "version")
"""Attributes that say how a file was written; another one has its own."""

INFO_PREFIX = "wamnet."
"""Before each name of the frame's info among the file's attributes, so that it meets no other program's."""

ORIGIN = "origin"
"""Name of the info that says what a frame was made from."""

EXR_BYTES = 12
"""Memory that a pixel of a channel takes until it is in a frame: as read, as float32, in its layer."""

COLORS = ("color", "albedo", "unshadowed", "direct", "seen_direct", "seen_albedo", "seen_emission", "history")
"""Layers whose channels are mixtures of the file's primaries."""

OIIO_SPACE = "oiio:ColorSpace"
"""OpenImageIO's attribute for a colour space: a hint that other programs may leave as it was."""

OIIO_REC_709 = ("linear", "scene_linear", "lin_srgb", "lin_rec709", "lin_rec709_scene")
"""Its names of linear Rec. 709, lower case."""


def write_frame(path: Path, frame: Frame, compress: bool = True) -> None:
    """Write a valid frame as float32, losslessly compressed or not at all, all of it or nothing."""
    validate(frame)
    channels = {
        name: np.ascontiguousarray(values[:, :, index], np.float32)
        for layer, values in frame.layers.items()
        for index, name in enumerate(CHANNELS[layer])
    }
    _write(
        path,
        [("", {INFO_PREFIX + name: text for name, text in frame.info.items()}, channels)],
        None,
        compress,
    )


def write_denoised(
    path: Path, source: Path, color: Floats, view_layer: str = "", keep: bool = False, **info: str
) -> str:
    """Write linear colour (H, W, 3) of Rec. 709 in the primaries and with the attributes of its source.

    `keep`: all parts and channels of the source too, as they are; the colour is a layer more beside theirs,
    in place of an earlier one. `info` is added to the facts about the frame. Returns the layer's name.
    """
    file = read_headers(source)
    selection = select(source, file.parts, view_layer)
    if "color" not in selection.layers:
        raise _missing(source, file, selection, "no colour is among them", "export it too")
    deep = file.deep
    if keep and deep:
        rule = "parts with several samples per pixel cannot be kept"
        raise InputError(f"{source}: deep parts", ", ".join(deep), rule, "leave out --keep-layers")
    index = selection.layers["color"][0].part
    matrix, _ = primaries.to_rec_709(str(source), file.parts[index])
    own = np.asarray(color, np.float32)
    own = own if matrix is None else primaries.converted(own, np.linalg.inv(matrix))
    layer = selection.denoised_layer() if keep else ""
    planes = zip("RGB", np.moveaxis(own, -1, 0), strict=True)
    image = {f"{layer}.{name}" if layer else name: np.ascontiguousarray(plane) for name, plane in planes}
    parts = []
    for number, (name, header, channels) in enumerate(_load(file, keep)):
        facts = {key: value for key, value in header.items() if key not in BOUND}
        if number == index:
            facts |= {INFO_PREFIX + key: text for key, text in info.items()}
            channels = {**channels, **image} if keep else image
        if not keep and facts.pop("multiView", None):
            facts["view"] = selection.view
        if keep or number == index:
            parts.append((name, facts, channels))
    # The last bits of computed colour are noise: compressing it takes as long as the network, and saves 6 %.
    _write(path, parts, file, compress=keep)
    return layer


def _write(
    path: Path,
    parts: Sequence[tuple[str, Mapping[str, Any], Mapping[str, Any]]],
    source: File | None = None,
    compress: bool = True,
) -> None:
    """Write the name, attributes and channels (H, W) of each part, or nothing.

    Text that came from a source gets its bytes.
    """
    openexr = need("OpenEXR", "to write EXR files")
    compression = openexr.ZIP_COMPRESSION if compress else openexr.NO_COMPRESSION
    form = {"compression": compression, "type": openexr.scanlineimage}
    with replacing(path) as new, spelled(new) as name:
        try:
            with _quiet():
                all_parts = [
                    openexr.Part({**header, **form}, dict(planes), part) for part, header, planes in parts
                ]
                openexr.File(all_parts).write(name)
        except (RuntimeError, ValueError, TypeError) as error:
            # The package tells a full disk in this way, with the temporary file's name.
            reason = " ".join(str(error).replace(str(new), str(path)).split())
            raise unwritable(path, RuntimeError(reason)) from None
        if source is not None:
            source.restore(new)


def read_frame(
    path: Path, finite: bool = True, tell: Callable[[str], None] | None = None, view_layer: str = ""
) -> Frame:
    """Read the known layers of an EXR file as a float32 frame that is valid, `finite` or not.

    `tell` is given a sentence on what was chosen, converted or left out. Of a file with several views, parts
    or view layers the one that is named is read.
    """
    file = read_headers(path)
    selection = select(path, file.parts, view_layer)
    if not selection.layers:
        way_out = "name colour R,G,B and normals normal.X,..."
        raise _missing(path, file, selection, "no known layer is among them", way_out)
    notes = [*selection.notes, *_attribute_notes(path, file, selection)]
    _check_planes(path, file, selection)
    pixels = [channels for _, _, channels in _load(file)]
    layers = {name: _stack(path, name, planes, pixels) for name, planes in selection.layers.items()}
    for name in COLORS:
        if (
            name in layers
            and (matrix := primaries.to_rec_709(str(path), file.parts[selection.layers[name][0].part])[0])
            is not None
        ):
            layers[name] = primaries.converted(layers[name], matrix)
    attributes = file.parts[0].attributes
    info = {
        k.removeprefix(INFO_PREFIX): file.parts[0].text(k) for k in attributes if k.startswith(INFO_PREFIX)
    }
    if "depth" in layers and not info:
        # Many renderers write such depths where nothing is hit.
        missed = np.isfinite(layers["depth"]) & (layers["depth"] >= FARTHEST_DEPTH)
        layers["depth"] = np.where(missed, np.float32(0.0), layers["depth"])
        if count := int(missed.sum()):
            notes.append(f"{count} depths of {FARTHEST_DEPTH:g} or more are read as 0: nothing is hit there")
    if tell is not None and notes:
        tell(f"{path}: {'; '.join(notes)}")
    frame = Frame(layers, info)
    try:
        validate(frame, finite)
    except InputError as error:
        raise InputError(f"{path}: {error.what}", error.value, error.rule, error.way_out) from None
    return frame


def read_origin(path: Path) -> str | None:
    """Return the text that names the origin of a frame; None if the file is damaged, "" without a text."""
    with suppress(InputError):
        file = read_headers(path)
        origin = max(part.text(INFO_PREFIX + ORIGIN) for part in file.parts)
        # A file that is cut short has all of its header.
        if origin:
            _load(file)
        return origin
    return None


def need_layers(
    path: Path, frame: Frame, features: Sequence[str], because: str, way_out: str, view_layer: str = ""
) -> None:
    """Refuse the frame in `path` if it lacks a layer that one of the features needs."""
    # Unknown features are refused where they come from.
    for layer in (layer for name in features if name in FEATURES for layer in FEATURES[name].layers):
        if layer not in frame.layers:
            rule = f"{layer} must be among them, because {because}"
            if path.is_file():
                file = read_headers(path)
                left = unused(file.parts, select(path, file.parts, view_layer))
                rule += f" (channels that are not used: {', '.join(left)})" if left else ""
            remedy = REMEDIES.get(layer, way_out)
            raise InputError(f"{path}: list of layers", ", ".join(frame.layers), rule, remedy)


def _missing(path: Path, file: File, selection: Selection, rule: str, way_out: str) -> InputError:
    """Return the error for a file without a layer that it needs."""
    names = unused(file.parts, selection)
    deep = file.deep
    if deep:
        rule, way_out = "its pixels are deep: they have several samples each", "flatten it"
    elif {"Y", "RY", "BY"} <= {name for part in file.parts for name in part.channels}:
        rule, way_out = "its colour is stored as luminance and chroma", "export R, G, B"
    return InputError(f"{path}: list of channels", ", ".join(names), rule, way_out)


def _check_planes(path: Path, file: File, selection: Selection) -> None:
    """Refuse planes of different sizes or positions, and images that do not fit the memory."""
    chosen = [plane for planes in selection.layers.values() for plane in planes]
    sampled = [p.name for p in chosen if file.parts[p.part].channels[p.name] != (1, 1)]
    if sampled:
        rule = "are subsampled: they have fewer pixels than the image"
        raise InputError(f"{path}: channels", ", ".join(sampled), rule, "export them in full resolution")
    windows = {_corners(file.parts[plane.part].window) for plane in chosen}
    if len(windows) > 1:
        text = ", ".join(sorted(windows))
        raise InputError(f"{path}: data windows", text, "all parts must have the same", "export full frames")
    needed = 0.0
    # A file of a few bytes may state any size.
    for part in file.parts:
        left, top, right, bottom = part.window
        needed += EXR_BYTES * (right - left + 1) * (bottom - top + 1) * len(part.channels)
    check_room(int(needed), "input file", str(path), "cut the image, or leave channels out")


def _attribute_notes(path: Path, file: File, selection: Selection) -> Iterator[str]:
    """Yield sentences on attributes that change what the pixels mean."""
    used = dict.fromkeys(plane.part for planes in selection.layers.values() for plane in planes)
    spaces: dict[str, None] = {}
    for name in COLORS:
        for plane in selection.layers.get(name, ())[:1]:
            matrix, space = primaries.to_rec_709(str(path), file.parts[plane.part])
            spaces |= {} if matrix is None else {space: None}
    if spaces:
        yield f"colours are converted to Rec. 709 from the primaries {' and '.join(spaces)}"
    part = file.parts[next(iter(used))]
    space = part.text(OIIO_SPACE)
    if space and space.lower() not in OIIO_REC_709 and not set(primaries.STATED) & part.attributes.keys():
        yield f"{OIIO_SPACE} is {space}, and is not used: colours are taken for linear Rec. 709"
    with refusing(f"{path}: attributes", "damaged", "must be of OpenEXR's types", "export it again"):
        display = part.numbers("displayWindow", "<i4", part.window)
        (aspect,) = part.numbers("pixelAspectRatio", "<f4", (1.0,))
        (white,) = part.numbers("whiteLuminance", "<f4", (0.0,))
    if display != part.window:
        yield f"the image is the data window {_corners(part.window)}, not all of {_corners(display)}"
    if aspect != 1.0:
        yield f"pixels have the aspect ratio {aspect:g}, which an .exr keeps and a .png does not"
    if white:
        yield f"whiteLuminance is {white:g} cd/m², and no value is scaled by it"
    deep = file.deep
    if deep:
        yield f"deep parts are left out: {', '.join(deep)}"


def _corners(window: Sequence[float]) -> str:
    """Return a window as text."""
    left, top, right, bottom = (int(value) for value in window)
    return f"({left}, {top})-({right}, {bottom})"


def _load(file: File, pixels: bool = True) -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Return the name, the attributes and, if pixels are read, the channels (H, W) of each part."""
    openexr = need("OpenEXR", "to read EXR files")
    path, log = file.path, [""]
    with file.in_utf8() as readable, spelled(readable) as name:
        try:
            with _quiet(log):
                opened = openexr.File(name, separate_channels=True, header_only=not pixels)
                parts = {part.part_index: part for part in opened.parts}
        except (RuntimeError, ValueError, TypeError) as error:
            log[0], parts = str(error), {}
    # The package leaves out a part that it cannot read, and prints why.
    missing = [part.text("name") or str(i) for i, part in enumerate(file.parts) if i not in parts]
    if missing:
        reason = " ".join(log[0].replace(name, str(path)).split())
        of = f" of part {missing[0]!r}" if parts else ""
        rule = f"has pixels{of} that cannot be read: {reason}"
        raise InputError("input file", str(path), rule, "it may be cut short or damaged: export it again")
    return [
        (part.name(), dict(part.header), {name: c.pixels for name, c in part.channels.items()})
        for _, part in sorted(parts.items())
    ]


def _stack(path: Path, name: str, planes: Sequence[Plane], pixels: Sequence[Mapping[str, Any]]) -> Floats:
    """Return the planes (H, W) of one layer as float32 (H, W, C)."""
    channels = [pixels[plane.part][plane.name] for plane in planes]
    kinds = sorted({str(channel.dtype) for channel in channels})
    if not set(kinds) <= {"float16", "float32"}:
        rule = "must be half or float"
        raise InputError(
            f"{path}: pixels of {name}", ", ".join(kinds), rule, "export them as 16 or 32 bit floats"
        )
    layer = np.empty((*channels[0].shape, len(channels)), np.float32)
    for index, channel in enumerate(channels):
        layer[:, :, index] = channel
    return layer


class _Printed:
    """Take what the OpenEXR package prints about a bad file from the terminal, its last line into a log.

    Threads may read and write at once: the first that enters redirects, the last that leaves restores.
    """

    def __init__(self) -> None:
        self._lock, self._count, self._restore = threading.Lock(), 0, ExitStack()

    @contextmanager
    def __call__(self, log: list[str] | None = None) -> Iterator[None]:
        with self._lock:
            if not self._count:
                self._redirect()
            self._count += 1
        try:
            yield
        finally:
            with self._lock:
                if log is not None:
                    log[:] = [self._last()]
                self._count -= 1
                if not self._count:
                    self._restore.close()

    def _redirect(self) -> None:
        """Send standard error to a file, and what Python prints to a text."""
        saved = os.dup(2)
        self._restore.callback(os.close, saved)
        self._errors = self._restore.enter_context(TemporaryFile())  # noqa: SIM115 (the stack closes it)
        self._restore.callback(os.dup2, saved, 2)
        os.dup2(self._errors.fileno(), 2)
        self._text = self._restore.enter_context(redirect_stdout(StringIO()))

    def _last(self) -> str:
        """Return the end of the last line."""
        descriptor = self._errors.fileno()
        errors = os.pread(descriptor, os.fstat(descriptor).st_size, 0).decode(errors="replace")
        lines = (errors + self._text.getvalue()).splitlines()
        return lines[-1].rpartition(" - ")[2] if lines else ""


_quiet = _Printed()
