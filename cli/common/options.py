"""The types of options, and the parsing of their values; their names and texts are in cli/options.ini.

Ranges are not repeated here: what a number may be is said by the function of the reference that takes it.
"""

from __future__ import annotations

import colorsys
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Literal

import typer

from ...refimpl.errors import InputError

if TYPE_CHECKING:
    from ...refimpl.light.scene import Scene, Vector


def _finite(value: float | None) -> float | None:
    """Refuse a time that is not a number."""
    if value is not None and not math.isfinite(value):
        raise InputError("--time", value, "must be finite", "give seconds, for example --time 2.5")
    return value


def _context(command: typer.Context, value: ContextName | None) -> ContextName | None:
    """Let this command, and the processes that it starts, open OpenGL in this way."""
    from ...kernels.devices.registry import CONTEXT_VARIABLE

    if value is None:
        return None
    before = os.environ.get(CONTEXT_VARIABLE)
    os.environ[CONTEXT_VARIABLE] = value

    def restore() -> None:
        """Leave the environment as it was."""
        if before is None:
            os.environ.pop(CONTEXT_VARIABLE, None)
        else:
            os.environ[CONTEXT_VARIABLE] = before

    command.call_on_close(restore)
    return value


class ExecutorName(str, Enum):
    """What runs a kernel; equal to the registry in kernels, which is not imported for a help text."""

    numpy = "numpy"
    opencl = "opencl"
    opengl = "opengl"
    c = "c"


ContextName = Literal["egl", "osmesa"]
"""How OpenGL [kernels/devices/opengl_executor.py] gets a context: with no display, or in main memory."""

ExecutorChoice = Literal["auto", "numpy", "opencl", "opengl", "c"]
"""An executor, or the fastest that is available."""

TrainerName = Literal["auto", "numpy", "opencl"]
"""What trains: the reference, its steps compiled, or the faster one of those available."""

Target = Literal["opencl", "glsl", "c"]
"""Languages that a model is compiled to."""

FloatType = Literal["float32", "float64"]
"""Element types of the reference's arithmetic."""

Sampler = Literal["pcg4d", "sobol"]
"""Sources of random numbers by name; equal to the registry in refimpl."""

Preset = Literal["best", "mirrors", "mirrors-shadows", "shadows", "paper", "short", "sky", "sky-shadows"]
"""Training protocols by name; equal to the registry in refimpl."""


CALLBACKS: Mapping[str, Callable[..., Any]] = {"context": _context, "time": _finite}
"""What is done with the values of these parameters as soon as they are read."""


def parse_parameters(texts: Sequence[str]) -> dict[str, float | tuple[float, ...]]:
    """Return parameters of a scene from texts like `albedo=0.8` and `warm=1,0.5,0.2`."""
    parameters: dict[str, float | tuple[float, ...]] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        try:
            numbers = tuple(float(part) for part in value.split(","))
        except ValueError:
            numbers = ()
        if not sign or len(numbers) not in (1, 3):
            rule = "must be NAME=NUMBER or NAME=NUMBER,NUMBER,NUMBER"
            raise InputError("--set", text, rule, "for example --set albedo=0.8")
        if not all(map(math.isfinite, numbers)):
            raise InputError("--set", text, "must have finite numbers", "for example --set albedo=0.8")
        parameters[name.strip()] = numbers if len(numbers) > 1 else numbers[0]
    return parameters


def parse_limits(option: str, text: str) -> tuple[float, float]:
    """Return the two numbers of a text like `-24:24`, or refuse it."""
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(option, text, "must be LOW:HIGH", f"for example {option}=-24:24") from None
    return low, high


@dataclass(frozen=True)
class View:
    """What is asked of camera and lamps: degrees, a factor of the distance, texts like `1=1,0.5,0.2`."""

    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    distance: float = 1.0
    lights: list[str] | None = None

    def of(self, scene: Scene) -> Scene:
        """Return the scene from there and under these lamps; its info says so."""
        from ...refimpl.light.variation import Variation, varied

        colors = parse_lights(self.lights or (), [light.color for light in scene.lights])
        return varied(scene, Variation(self.yaw_deg, self.pitch_deg, self.distance, colors))


def parse_lights(texts: Sequence[str], own: Sequence[Vector]) -> tuple[Vector, ...]:
    """Return the lamps' colours from texts like `1=1,0.5,0.2`, as bright as their own; none without texts."""
    from ...refimpl.light.variation import lamp_color

    colors = dict(enumerate(own, start=1))
    chosen: set[int] = set()
    for text in texts:
        index, _, value = text.partition("=")
        try:
            number, color = int(index), [float(part) for part in value.split(",")]
            red, green, blue = color
        except ValueError:
            rule = "must be N=R,G,B: a light's number and its colour"
            raise InputError("--light", text, rule, "for example --light 1=1,0.4,0.2") from None
        if not (all(map(math.isfinite, color)) and min(color) >= 0.0 and max(color) > 0.0):
            rule = "its channels must be finite, 0 or more, and not all 0"
            raise InputError("--light", text, rule, "for example --light 1=1,0.4,0.2")
        if number not in colors:
            rule = f"the scene's lights are 1 to {len(own)}" if own else "the scene has no lights"
            raise InputError("--light", text, rule, "choose another" if own else "leave it out")
        if number in chosen:
            raise InputError("--light", text, f"light {number} already has a colour", "give one per light")
        chosen.add(number)
        hue, saturation, _ = colorsys.rgb_to_hsv(red, green, blue)
        colors[number] = lamp_color(own[number - 1], hue, saturation)
    return tuple(colors.values()) if texts else ()


def parse_names(text: str) -> tuple[str, ...]:
    """Return names that are separated by commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def refuse_given(context: typer.Context, names: Sequence[str], where: str) -> None:
    """Refuse arguments and options that were given on the command line and have no meaning."""
    typed = {each.name: each.opts[-1] for each in context.command.params}
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name not in ("DEFAULT", "ENVIRONMENT"):
            shown = typed[name] if typed[name].startswith("-") else name.upper()
            raise InputError("argument", shown, f"has no meaning {where}", "leave it out")
