"""A scene from another side and under other lamps, and the ranges that such frames are drawn from.

1. The camera moves on a sphere around what it looks at: yaw about the vertical, pitch towards it, distance as
   a factor of its own [`orbited`].
2. A lamp gets another hue and saturation and keeps its brightness, the mean of its channels [`lamp_color`],
   or has its power times a factor, which its colour carries: light is linear in the lamps' colours.
3. Both together make a scene of a frame, whose `info` says what was changed [`varied`].
4. A data set draws its frames from ranges, which a model then has learned [`Ranges`]; what of another frame
   lies outside of them is said in sentences [`outside`].

Yaw and pitch are those of an orbit camera, as modelling programs have it; hue and saturation are those of the
HSV hexcone (A. R. Smith, "Color Gamut Transform Pairs", SIGGRAPH 1978) in linear RGB.
"""

from __future__ import annotations

import colorsys
import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..errors import InputError
from ..reading import BROKEN, parse_json, to_dataclass
from .scene import Camera, Scene, Vector
from .scenes import LARGEST_TIME_S, TURN_SECONDS

STEEPEST_DEG = 85.0
"""Largest angle of a turned camera against the horizon: straight from above, `up` would be no direction."""

BRIGHTNESS_TOLERANCE = 0.02
"""Largest relative difference between the mean of a lamp's channels and its own that counts as the same: a
colour that is picked in eight bits is off by less."""

SATURATION_TOLERANCE = 0.005
"""How far a saturation may be beyond its range by rounding to eight bits."""

POWER_LIMITS = (2.0**-10, 2.0**10)
"""Least and largest factor of a lamp's power: ten stops of a camera either way."""

RANGES = "ranges"
"""Name of the fact, in a frame's info, that says the ranges of its data set, as JSON."""


@dataclass(frozen=True)
class Variation:
    """How a frame departs from its scene: turns of the camera in degrees, its distance as a factor, lamps.

    `lights` are the lamps' colours in linear RGB, in the order of the scene's; none: its own.
    """

    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    distance: float = 1.0
    lights: tuple[Vector, ...] = ()


AT_REST = Variation()
"""The scene as it is."""


@dataclass(frozen=True)
class Ranges:
    """Ranges [low, high] that frames are drawn from; `saturation` None: lamps keep their own colours.

    `power` are factors of the lamps' own power; None: lamps keep it.
    """

    time_s: tuple[float, float] = (0.0, TURN_SECONDS)
    yaw_deg: tuple[float, float] = (0.0, 0.0)
    pitch_deg: tuple[float, float] = (0.0, 0.0)
    distance: tuple[float, float] = (1.0, 1.0)
    saturation: tuple[float, float] | None = None
    power: tuple[float, float] | None = None

    def to_json(self) -> str:
        """Return the ranges as one line of JSON, without a power that is not varied."""
        return json.dumps({k: v for k, v in asdict(self).items() if k != "power" or v is not None})


def check_ranges(ranges: Ranges) -> None:
    """Refuse ranges that are not finite, empty, or beyond what a camera or a colour can be."""
    for name, pair in asdict(ranges).items():
        if pair is None:
            continue
        low, high = _limits(name)
        rule = f"must be LOW:HIGH within {low:g} to {high:g}, LOW not above HIGH"
        if not (all(map(math.isfinite, pair)) and low <= pair[0] <= pair[1] <= high):
            raise InputError(f"range of {name}", f"{pair[0]}:{pair[1]}", rule, "choose other limits")


def _limits(name: str) -> tuple[float, float]:
    """Return the least and the largest value that a range may have."""
    limits = {"yaw_deg": (-180.0, 180.0), "pitch_deg": (-STEEPEST_DEG, STEEPEST_DEG)}
    limits |= {"distance": (0.1, 10.0), "saturation": (0.0, 1.0), "power": POWER_LIMITS}
    return limits.get(name, (-LARGEST_TIME_S, LARGEST_TIME_S))


def ranges_from_json(text: str) -> Ranges:
    """Return the ranges that a frame or a model states; refuse what is not ranges."""
    found = to_dataclass(Ranges, parse_json(text, "ranges", "make the data set or the model again"), "ranges")
    check_ranges(found)
    return found


def orbited(camera: Camera, yaw_deg: float, pitch_deg: float, distance: float) -> Camera:
    """Return the camera turned around what it looks at; at rest it is the same, to the bit.

    Its height above the horizon is clamped to STEEPEST_DEG.
    """
    if (yaw_deg, pitch_deg, distance) == (0.0, 0.0, 1.0):
        return camera
    away = [p - q for p, q in zip(camera.position, camera.look_at, strict=True)]
    radius = math.sqrt(sum(a * a for a in away)) * distance
    yaw = math.atan2(away[0], away[2]) + math.radians(yaw_deg)
    steepest = math.radians(STEEPEST_DEG)
    pitch = math.atan2(away[1], math.hypot(away[0], away[2])) + math.radians(pitch_deg)
    pitch = max(-steepest, min(steepest, pitch))
    offset = (math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch))
    x, y, z = (q + radius * o for q, o in zip(camera.look_at, offset, strict=True))
    return replace(camera, position=(x, y, z))


def lamp_color(own: Vector, hue: float, saturation: float) -> Vector:
    """Return a colour of this hue and saturation, each in [0, 1], with the mean of channels of `own`."""
    drawn = colorsys.hsv_to_rgb(hue, saturation, 1.0)
    red, green, blue = (c * sum(own) / sum(drawn) for c in drawn)
    return (red, green, blue)


def saturation_of(color: Sequence[float]) -> float:
    """Return the saturation of a linear colour: 1 - min / max; that of black is 0."""
    most = max(color)
    return 1.0 - min(color) / most if most > 0.0 else 0.0


def varied(scene: Scene, variation: Variation) -> Scene:
    """Return the scene from another side and under other lamps; its info says from where and which."""
    v = variation
    for name in ("yaw_deg", "pitch_deg", "distance"):
        value, (low, high) = getattr(v, name), _limits(name)
        if not low <= value <= high:
            raise InputError(name, value, f"must be a number from {low:g} to {high:g}", "choose another")
    lights = scene.lights
    if v.lights:
        if len(v.lights) != len(lights):
            rule = f"the scene has {len(lights)}"
            raise InputError("number of light colours", len(v.lights), rule, "give one per light")
        lights = tuple(replace(light, color=color) for light, color in zip(lights, v.lights, strict=True))
    told = {name: repr(float(getattr(v, name))) for name in ("yaw_deg", "pitch_deg", "distance")}
    told["lights"] = json.dumps([light.color for light in lights])
    camera = orbited(scene.camera, v.yaw_deg, v.pitch_deg, v.distance)
    return replace(scene, camera=camera, lights=lights, info={**scene.info, **told})


def outside(ranges: Ranges, info: Mapping[str, str], lights: Sequence[Vector] = ()) -> list[str]:
    """Return what of a frame lies outside of the ranges, as sentences; what its info does not say is inside.

    `lights` are the scene's own lamps' colours. A time is inside if it is so in some turn of the animation.
    """
    told = []
    start, end = ranges.time_s
    if (time := _number(info.get("time"))) is not None and (time - start) % TURN_SECONDS > end - start:
        told.append(f"the time is {time:g} s (learned: {start:g} s to {end:g} s)")
    words = {"yaw_deg": ("yaw", "°"), "pitch_deg": ("pitch", "°"), "distance": ("distance", "")}
    for name, (word, unit) in words.items():
        low, high = getattr(ranges, name)
        value = _number(info.get(name))
        if value is not None and not low <= value <= high:
            told.append(f"the camera's {word} is {value:g}{unit} (learned: {low:g}{unit} to {high:g}{unit})")
    for number, color in enumerate(_colors(info.get("lights"))):
        own = lights[number] if number < len(lights) else None
        told += _lamp_outside(number, color, own, ranges)
    return told


def _lamp_outside(number: int, color: Vector, own: Vector | None, ranges: Ranges) -> list[str]:
    """Return what of a lamp's colour and power was not learned."""
    if own is None:
        return []
    lamp, brightness = f"lamp {number + 1}", sum(color) / sum(own) if sum(own) > 0.0 else 1.0
    scale = 1.0 if ranges.power is None else brightness
    hue_kept = all(math.isclose(a, scale * b, rel_tol=1e-6) for a, b in zip(color, own, strict=True))
    if hue_kept and ranges.power is None:
        return []
    if not hue_kept and ranges.saturation is None:
        return [f"{lamp} has another colour (learned: its own)"]
    told = []
    if not hue_kept and ranges.saturation is not None:
        found, (low, high) = saturation_of(color), ranges.saturation
        if not low - SATURATION_TOLERANCE <= found <= high + SATURATION_TOLERANCE:
            told.append(f"the saturation of {lamp} is {found:.2f} (learned: {low:.2f} to {high:.2f})")
    return told + _power_outside(lamp, brightness, ranges.power)


def _power_outside(lamp: str, brightness: float, power: tuple[float, float] | None) -> list[str]:
    """Return whether a lamp's brightness, relative to its own, was not learned."""
    low, high = power or (1.0, 1.0)
    if low * (1.0 - BRIGHTNESS_TOLERANCE) <= brightness <= high * (1.0 + BRIGHTNESS_TOLERANCE):
        return []
    if power is None:
        return [f"{lamp} is {brightness:.2f} times as bright as the one that was learned"]
    return [f"{lamp} is {brightness:.2f} times as bright as its own (learned: {low:g} to {high:g})"]


def _number(text: str | None) -> float | None:
    """Return a finite number of an info, or None where there is none."""
    try:
        value = float(text) if text is not None else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _colors(text: str | None) -> list[Vector]:
    """Return the lamps' colours of an info; none where it says none."""
    with suppress(*BROKEN):
        data: Any = parse_json(text, "colours", "render the frame again") if text else []
        return [(float(r), float(g), float(b)) for r, g, b in data]
    return []
