"""A frame: what a renderer hands to the denoiser, as named layers of one size.

1. The registry says which layers exist, how many channels each has and what they mean [`LAYERS`].
2. A frame maps layer names to arrays (H, W, C) and carries facts about its origin as text [`Frame`].
3. A frame that comes from outside is checked once, at the border; everything behind it relies on that
   [`validate`].

Row 0 is the top of the picture, column 0 its left edge. Every layer is the mean over the pixel's samples, so
a normal on an edge is shorter than 1 and an albedo there is a mixture.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import NO_VALUE, InputError

Floats = NDArray[Any]
"""An array of float32 or float64, whichever the caller chose; results keep it."""

FLOAT_KINDS = ("float32", "float64")
"""The element types of layers: the executors' and the reference's."""


@dataclass(frozen=True)
class Layer:
    """A kind of layer: its name, its number of channels, what it holds and in which unit."""

    name: str
    channels: int
    meaning: str


LAYERS: Mapping[str, Layer] = {
    layer.name: layer
    for layer in (
        Layer("color", 3, "linear radiance: red, green, blue"),
        Layer("albedo", 3, "reflectance of the first hit in [0, 1]; 0 where nothing is hit"),
        Layer(
            "normal",
            3,
            "unit normal of the first hit in world space, on the ray's side; 0 where nothing is hit",
        ),
        Layer("depth", 1, "distance along the ray to the first hit, in scene units; 0 where nothing is hit"),
        Layer("position", 3, "first hit in world space, in scene units; 0 where nothing is hit"),
        Layer("direction", 3, "unit direction of the camera ray in world space"),
        Layer(
            "unshadowed",
            3,
            "radiance of the first hit from the lamps only, if it were matte and nothing were in between",
        ),
        Layer(
            "seen_albedo",
            3,
            "reflectance of what is seen, past mirrors and glass, times theirs; 0 where nothing is hit",
        ),
        Layer("seen_normal", 3, "unit normal of what is seen in world space, on the path's side"),
        Layer("seen_depth", 1, "length of the way to what is seen, in scene units; 0 where nothing is hit"),
        Layer("seen_position", 3, "what is seen in world space, in scene units; 0 where nothing is hit"),
        Layer(
            "seen_emission",
            3,
            "radiance that what is seen emits itself, times the throughput of the way there",
        ),
        Layer("history", 3, "linear radiance: mean of this colour and those of the pictures before"),
        Layer("history_weight", 1, "share of the pictures before in the history, in [0, 1); 0: it is new"),
        Layer("sun", 3, "unit direction in world space towards the sun of the sky: the same in all pixels"),
        Layer("direct", 3, "emission of the first hit, and unshadowed with its shadows, by few shadow rays"),
        Layer("seen_direct", 3, "the same of what is seen, times the throughput of the way there"),
    )
}
"""Every layer that a frame may have; a new one is one line here."""

FIRST_HIT: Mapping[str, str] = {
    "seen_albedo": "albedo",
    "seen_normal": "normal",
    "seen_depth": "depth",
    "seen_position": "position",
}
"""Layers of what is seen, and those of the first hit that they are where nothing is followed."""

SEEN = (*FIRST_HIT, "seen_emission")
"""The layers of what is seen past mirrors and glass (light/following.py), which a frame has on request."""

HISTORY = ("history", "history_weight")
"""The layers that a frame has which follows others (light/history.py)."""

SUN = "sun"
"""The layer that a frame has whose scene has a sun (light/environment.py)."""

DIRECT = "direct"
"""The layer of the lamps' light with shadows (light/transport.py: direct), which a frame has on request."""

SEEN_DIRECT = "seen_direct"
"""The same of what is seen past mirrors and glass, which a frame has that has both."""

LIT = (DIRECT, SEEN_DIRECT)
"""The layers of direct light with shadows."""

REMEDIES = {
    DIRECT: "render it: --shadow-rays 1, or shadow_rays=1; bundled models named -basic do without it",
    SEEN_DIRECT: "render it: --seen --shadow-rays 1, or seen=True, shadow_rays=1",
}
"""What helps where a frame lacks a layer, if it is not as usual."""

USUAL = tuple(name for name in LAYERS if name not in (*SEEN, *HISTORY, SUN, DIRECT, SEEN_DIRECT))
"""The layers that any rendered frame has."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Layers (H, W, C) of one picture by name, and facts about it (scene, time, spp, seed, ...) as text."""

    layers: Mapping[str, Floats]
    info: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Floats:
        """Return the layer `name` (H, W, C), or say which layers there are."""
        if name not in self.layers:
            rule, remedy = f"layer {name!r} is missing", REMEDIES.get(name, "render it")
            raise InputError("layers of the frame", ", ".join(self.layers), rule, remedy)
        return self.layers[name]

    def __contains__(self, name: object) -> bool:
        """Tell whether the frame has the layer `name`."""
        return name in self.layers

    @property
    def height(self) -> int:
        """Number of rows, in pixels."""
        return int(next(iter(self.layers.values())).shape[0])

    @property
    def width(self) -> int:
        """Number of columns, in pixels."""
        return int(next(iter(self.layers.values())).shape[1])


def validate(frame: Frame, finite: bool = True) -> None:
    """Raise InputError unless the layers are known, of one size, of floats, and finite in every pixel.

    `finite` False leaves the last rule out, for a reader that states one of its own [`dataset.known`].
    """
    if not frame.layers:
        raise InputError("frame", NO_VALUE, "has no layers", _known())
    for name, values in frame.layers.items():
        _check_form(name, values)
    sizes = {name: values.shape[:2] for name, values in frame.layers.items()}
    if len(set(sizes.values())) > 1:
        text = ", ".join(f"{name} {width}x{height}" for name, (height, width) in sizes.items())
        rule = "all layers must have the same size"
        raise InputError("sizes of the layers", text, rule, "render them in one run")
    for name, values in frame.layers.items() if finite else ():
        check_finite(f"layer {name!r}", values)


def not_finite(frame: Frame) -> dict[str, int]:
    """Return the number of pixels with a NaN or an infinity of each layer that has some."""
    finite = {name: np.isfinite(values) for name, values in frame.layers.items()}
    return {name: int((~each).any(axis=-1).sum()) for name, each in finite.items() if not each.all()}


def check_finite(what: str, image: Floats) -> None:
    """Refuse an `image` (H, W, C) with a NaN or an infinity: name the first such pixel and their number."""
    bad = ~np.isfinite(image)
    if bad.any():
        y, x, channel = (int(index) for index in np.argwhere(bad)[0])
        count = int(bad.any(axis=-1).sum())
        where = f"{what} at x={x}, y={y} (first of {count} such pixel{'s' if count > 1 else ''})"
        raise InputError(
            where, float(image[y, x, channel]), "every pixel must be finite", "render or repair these pixels"
        )


def _check_form(name: str, values: Floats) -> None:
    """Refuse a layer with an unknown name, another element type, another number of channels or no pixel."""
    if name not in LAYERS:
        raise InputError("layer", name, "unknown", _known())
    if not isinstance(values, np.ndarray) or values.dtype.name not in FLOAT_KINDS:
        kind = getattr(values, "dtype", type(values).__name__)
        raise InputError(
            f"element type of layer {name!r}", str(kind), "must be float32 or float64", "convert it"
        )
    channels = LAYERS[name].channels
    if values.ndim != 3 or values.shape[-1] != channels or values.size == 0:
        rule = f"must be (height, width, {channels}) with at least one pixel"
        raise InputError(f"shape of layer {name!r}", values.shape, rule, "reshape or render it again")


def _known() -> str:
    """Return the remedy for a wrong layer name."""
    return f"choose one of {', '.join(LAYERS)}"
