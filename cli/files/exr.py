"""Frames as multi-layer OpenEXR files.

1. A layer is a group of channels: `R,G,B` is colour, then `albedo.R`, `normal.X`, `depth.Z`, `position.X`,
   `direction.X` and so on [`CHANNELS`]; float32, losslessly compressed, facts about the frame as text
   attributes [`write_frame`].
2. Reading also knows the names that other renderers and denoisers use [`ALIASES`], in upper or lower case and
   behind a prefix such as a view layer's; half floats are widened, other channels ignored [`read_frame`].
3. The picture is the data window; where it lies in the display window does not matter to a denoiser.
4. A depth of 1e9 or more in a file of another program stands for a miss and is read as 0, as ours are.
5. What comes from a file is checked before anything else sees it; errors start with the file's name.
6. A denoised picture can be written beside all channels of the file that it was made of, as a layer of its
   own, for a compositor [`write_beside`].
"""

from __future__ import annotations

import os
import threading
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.frame import HISTORY, LAYERS, SEEN, SUN, Floats, Frame, validate
from ...refimpl.network.dataset import FARTHEST_DEPTH
from ...refimpl.reading import check_room, refusing
from ..common.inputs import check_input
from ..common.packages import need
from .outputs import replacing, spelled, unwritable

CHANNELS: Mapping[str, tuple[str, ...]] = {
    "color": ("R", "G", "B"),
    "albedo": ("albedo.R", "albedo.G", "albedo.B"),
    "normal": ("normal.X", "normal.Y", "normal.Z"),
    "depth": ("depth.Z",),
    "position": ("position.X", "position.Y", "position.Z"),
    "direction": ("direction.X", "direction.Y", "direction.Z"),
    "unshadowed": ("unshadowed.R", "unshadowed.G", "unshadowed.B"),
    "seen_albedo": ("seen_albedo.R", "seen_albedo.G", "seen_albedo.B"),
    "seen_normal": ("seen_normal.X", "seen_normal.Y", "seen_normal.Z"),
    "seen_depth": ("seen_depth.Z",),
    "seen_position": ("seen_position.X", "seen_position.Y", "seen_position.Z"),
    "seen_emission": ("seen_emission.R", "seen_emission.G", "seen_emission.B"),
    "history": ("history.R", "history.G", "history.B"),
    "history_weight": ("history_weight.V",),
    "sun": ("sun.X", "sun.Y", "sun.Z"),
}
"""The channels that hold each layer in the files that are written here."""

ALIASES: Mapping[str, tuple[str, ...]] = {
    "color": ("", "color", "rgb", "rgba", "beauty", "combined", "noisy image"),
    "albedo": ("albedo", "denoising albedo", "diffuse_albedo", "diffusealbedo"),
    "normal": ("normal", "normals", "n", "denoising normal", "sh_normal"),
    "depth": ("depth", "z", "denoising depth", ""),
    "position": ("position", "p"),
    "direction": ("direction", "raydirection"),
    "unshadowed": ("unshadowed",),
    **{name: (name,) for name in (*SEEN, *HISTORY, SUN)},
}
"""Names of each layer on reading, lower case, best first: as in Blender, pbrt, Mitsuba, Arnold and here."""

COMPONENTS: Mapping[int, tuple[tuple[str, ...], ...]] = {
    3: (("r", "g", "b"), ("x", "y", "z")),
    1: (("z",), ("v",), ("y",), ("t",), ("depth",)),
}
"""Last parts of the channels' names of a layer of 3 or 1 channels, lower case, best first."""

DENOISED = "wamnet"
"""Layer of a denoised picture among another program's channels."""

BOUND = ("channels", "chunkCount", "compression", "name", "tiles", "type", "version")
"""Attributes that say how a file was written; another one has its own."""

INFO_PREFIX = "wamnet."
"""Before each name of the frame's info among the file's attributes, so that it meets no other program's."""

ORIGIN = "origin"
"""Name of the info that says what a frame was made from."""

EXR_BYTES = 12
"""Memory that a pixel of a channel takes until it is in a frame: as read, as float32, in its layer."""


class Plane(NamedTuple):
    """One channel: its name in the file, and its pixels (H, W)."""

    name: str
    pixels: Any


Group = Mapping[str, Plane]
"""Channels of one layer by the lower-case last part of their names."""


def write_frame(path: Path, frame: Frame) -> None:
    """Write a valid frame as float32, losslessly compressed, all of it or nothing."""
    validate(frame)
    openexr = need("OpenEXR", "to write EXR files", "files")
    channels = {
        name: np.ascontiguousarray(values[:, :, index], np.float32)
        for layer, values in frame.layers.items()
        for index, name in enumerate(CHANNELS[layer])
    }
    _write(path, openexr, channels, {INFO_PREFIX + name: text for name, text in frame.info.items()})


def write_beside(path: Path, source: Path, color: Floats, view_layer: str = "") -> str:
    """Write all channels of `source` as they are, and linear colour (H, W, 3) as a layer [`DENOISED`] more.

    It is beside the colour of its view layer, in place of an earlier one. Returns the layer's name.
    """
    channels, header = _read_channels(source, whole=True)
    planes = _layer(source, "color", _group(_of_view_layer(source, channels, view_layer)))
    if planes is None:
        names = ", ".join(sorted(channels))
        raise InputError(f"{source}: list of channels", names, "no colour is among them", "export it too")
    beside = planes[0].name.rpartition(".")[0].rpartition(".")[0]
    layer = f"{beside}.{DENOISED}" if beside else DENOISED
    kept = {name: channel.pixels for name, channel in channels.items()}
    own = zip("RGB", np.moveaxis(np.asarray(color, np.float32), -1, 0), strict=True)
    kept |= {f"{layer}.{name}": np.ascontiguousarray(plane) for name, plane in own}
    facts = {name: value for name, value in header.items() if name not in BOUND}
    _write(path, need("OpenEXR", "to write EXR files", "files"), kept, facts)
    return layer


def _write(path: Path, openexr: Any, channels: Mapping[str, Any], header: Mapping[str, Any]) -> None:
    """Write channels (H, W), losslessly compressed, all of them or nothing."""
    form = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    with replacing(path) as new, spelled(new) as name:
        try:
            with _quiet:
                openexr.File({**header, **form}, dict(channels)).write(name)
        except (RuntimeError, ValueError, TypeError) as error:
            # The package tells a full disk in this way, with the temporary file's name.
            reason = " ".join(str(error).replace(str(new), str(path)).split())
            raise unwritable(path, RuntimeError(reason)) from None


def read_frame(
    path: Path, finite: bool = True, tell: Callable[[str], None] | None = None, view_layer: str = ""
) -> Frame:
    """Read the known layers of an EXR file as a float32 frame that is valid, `finite` or not.

    `tell` is given a sentence on layers that stand under other names than ours, and on depths of misses. Of a
    file with several view layers the one that is named is read.
    """
    channels, header = _read_channels(path)
    groups = _group(_of_view_layer(path, channels, view_layer))
    found = {name: planes for name in LAYERS if (planes := _layer(path, name, groups)) is not None}
    layers = {name: _stack(path, name, planes) for name, planes in found.items()}
    told = _taken(found)
    ours = any(key.startswith(INFO_PREFIX) for key in header)
    if "depth" in layers and not ours and (missed := _without_misses(layers)):
        told.append(f"{missed} depths of {FARTHEST_DEPTH:g} or more are read as 0: nothing is hit there")
    if tell is not None and told:
        tell(f"{path}: {'; '.join(told)}")
    if not layers:
        names = ", ".join(sorted(channels))
        rule = "no known layer is among them"
        raise InputError(
            f"{path}: list of channels", names, rule, "name colour R,G,B and normals normal.X,..."
        )
    with refusing(f"{path}: attributes", "damaged", "they must be texts in UTF-8", "export it again"):
        info = {k.removeprefix(INFO_PREFIX): str(v) for k, v in header.items() if k.startswith(INFO_PREFIX)}
    frame = Frame(layers, info)
    try:
        validate(frame, finite)
    except InputError as error:
        raise InputError(f"{path}: {error.what}", error.value, error.rule, error.way_out) from None
    return frame


def read_origin(path: Path) -> str | None:
    """Return the text that names the origin of a frame, or None."""
    check_input(path)
    openexr = need("OpenEXR", "to read EXR files", "files")
    with suppress(RuntimeError, ValueError, TypeError), _quiet:
        for part in openexr.File(str(path), header_only=True).parts:
            return str(part.header.get(INFO_PREFIX + ORIGIN, ""))
    return None


def _read_channels(path: Path, whole: bool = False) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return all channels of all parts by name, and the first part's header.

    `whole`: parts with a channel of one name are refused, since all but the last would be lost.
    """
    check_input(path)
    openexr = need("OpenEXR", "to read EXR files", "files")
    try:
        with _quiet, spelled(path) as name:
            headers = openexr.File(name, header_only=True).parts
            expected = len(headers)
            _check_room(path, headers)
            parts = openexr.File(name, separate_channels=True).parts
    except InputError:
        raise
    except (RuntimeError, ValueError, TypeError):
        raise InputError(
            "input file", str(path), "it is not an OpenEXR image", "render or export it as .exr"
        ) from None
    # The package reports a part that it cannot read by leaving it out.
    if len(parts) < expected or not parts:
        rule = "its pixels cannot be read (cut short, damaged, or subsampled)"
        raise InputError("input file", str(path), rule, "export it again, without subsampling")
    windows = {str([corner.tolist() for corner in part.header["dataWindow"]]) for part in parts}
    if len(windows) > 1:
        text = ", ".join(sorted(windows))
        raise InputError(f"{path}: data windows", text, "all parts must have the same", "export full frames")
    names = Counter(name for part in parts for name in part.channels)
    twice = [name for name, count in names.items() if count > 1]
    if whole and twice:
        rule = "they are in several parts, and one part is written"
        way_out = "export it with the layers' names in those of the channels"
        raise InputError(f"{path}: channels", ", ".join(sorted(twice)), rule, way_out)
    return {name: channel for part in parts for name, channel in part.channels.items()}, parts[0].header


def _check_room(path: Path, headers: Sequence[Any]) -> None:
    """Refuse pictures that do not fit the memory: a file of a few bytes may stand for any size."""
    needed = 0
    for part in headers:
        (left, top), (right, bottom) = (corner.tolist() for corner in part.header["dataWindow"])
        needed += EXR_BYTES * (right - left + 1) * (bottom - top + 1) * len(part.header["channels"])
    check_room(needed, "input file", str(path), "cut the picture, or leave channels out")


def _of_view_layer(path: Path, channels: Mapping[str, Any], view_layer: str) -> dict[str, Any]:
    """Return the channels of a view layer, all of them if none is named."""
    found = {name: c for name, c in channels.items() if not view_layer or name.startswith(f"{view_layer}.")}
    if not found:
        known = dict.fromkeys(name.split(".")[0] for name in sorted(channels) if name.count(".") > 1)
        rule = f"no channel's name begins so; those of the file begin with {', '.join(known) or 'no name'}"
        raise InputError(f"{path}: view layer", view_layer, rule, "name one of these, or leave it out")
    return found


def _group(channels: Mapping[str, Any]) -> dict[str, dict[str, Group]]:
    """Group channels by layer: alias of the layer -> full prefix -> last part of the name -> pixels."""
    groups: dict[str, dict[str, dict[str, Plane]]] = defaultdict(lambda: defaultdict(dict))
    for name, channel in channels.items():
        prefix, _, component = name.rpartition(".")
        alias = prefix.rpartition(".")[2].lower()
        groups[alias][prefix][component.lower()] = Plane(name, channel.pixels)
    return {alias: dict(prefixes) for alias, prefixes in groups.items()}


def _layer(path: Path, name: str, groups: Mapping[str, Mapping[str, Group]]) -> list[Plane] | None:
    """Return the planes of layer `name` under the best of its aliases, or None if none is in the file."""
    for alias in ALIASES[name]:
        candidates = groups.get(alias, {})
        whole = {
            prefix: found
            for prefix, group in candidates.items()
            if (found := _components(name, alias, group))
        }
        if len(whole) > 1:
            text = ", ".join(sorted(whole))
            rule = f"each of them could be {name}"
            raise InputError(f"{path}: layers", text, rule, "name one view layer, or leave others out")
        if whole:
            return next(iter(whole.values()))
    return None


def _components(name: str, alias: str, group: Group) -> list[Plane] | None:
    """Return the channels that make up a layer, in order, or None if one is missing.

    Without a layer's name, one channel is depth only if it is called Z: a lone Y is luminance.
    """
    choices = COMPONENTS[LAYERS[name].channels]
    for components in choices if alias or len(choices[0]) > 1 else (("z",),):
        if all(component in group for component in components):
            return [group[component] for component in components]
    return None


def _stack(path: Path, name: str, planes: list[Plane]) -> Floats:
    """Return the planes (H, W) of one layer as float32 (H, W, C)."""
    kinds = sorted({str(plane.pixels.dtype) for plane in planes})
    if not set(kinds) <= {"float16", "float32"}:
        rule = "they must be half or float"
        raise InputError(
            f"{path}: pixels of {name}", ", ".join(kinds), rule, "export them as 16 or 32 bit floats"
        )
    return np.stack([plane.pixels.astype(np.float32) for plane in planes], axis=-1)


def _taken(found: Mapping[str, list[Plane]]) -> list[str]:
    """Return which channels became which layer, where their names are not ours."""
    names = {layer: [plane.name for plane in planes] for layer, planes in found.items()}
    return [
        f"{layer} is taken from {', '.join(channels)}"
        for layer, channels in names.items()
        if channels != list(CHANNELS[layer])
    ]


def _without_misses(layers: dict[str, Floats]) -> int:
    """Put 0 for depths that many renderers write where nothing is hit; return how many there were."""
    missed = np.isfinite(layers["depth"]) & (layers["depth"] >= FARTHEST_DEPTH)
    if missed.any():
        layers["depth"] = np.where(missed, np.float32(0.0), layers["depth"])
    return int(missed.sum())


class _Quiet:
    """Silence what the OpenEXR package prints by itself about a bad file: our error says it in one line.

    Threads may read and write at once: the first that enters redirects, the last that leaves restores.
    """

    def __init__(self) -> None:
        self._lock, self._count, self._restore = threading.Lock(), 0, ExitStack()

    def __enter__(self) -> None:
        with self._lock:
            if not self._count:
                saved, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
                for descriptor in (saved, nowhere):
                    self._restore.callback(os.close, descriptor)
                self._restore.callback(os.dup2, saved, 2)
                os.dup2(nowhere, 2)
                self._restore.enter_context(redirect_stdout(StringIO()))
            self._count += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._count -= 1
            if not self._count:
                self._restore.close()


_quiet = _Quiet()
